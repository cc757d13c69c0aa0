"""`flocsim init`: write a commented example of a config file."""

from argparse import Namespace
from typing import Any

from flocsim.io.files import write_file
from flocsim.io.outputs import OVERWRITE_HELP, Output, check_outputs, data_rule

DEFAULT_FILE = "study.toml"

KINDS = ("types", "measured")
"""Kinds of study that there is an example of."""

EXAMPLE = """\
# A study of binary collisions of settling flocs, for `flocsim ensemble`. docs/config.md has all
# keys. A quantity is a number in SI units, or a string with a unit such as "16.41 um".

preset = "tang2014"        # the paper's values; or "si": quartz in water, of its real weight
seed = 1                   # of all random numbers: the same seed, the same results
replicates = 100           # pairs of orientations per condition

[scene]
types = ["I", "II", "III"] # the paper's sizes
# pairs = [["10 um", "20 um"]]        # or sizes of your own: [receiving, approaching] radius
delta = [0.0, 0.25, 0.5, 0.75, 1.0]   # horizontal displacements, as fractions of delta_max
# delta_max = "projected"  # 1 just grazes; "radius": R_i + R_j, 1 is beyond a straight fall
# receiver = "free"        # or "fixed"
# start_gap = "2 um"       # distance of the outlines at the start

[shapes]
source = "synthetic"       # flocs that flocsim grows
# source = "library"       # or flocs fitted to images with `flocsim fit`
# file = "shapes.h5"
vertices = [1, 4, 16, 64]  # 1: the sphere of the same area
radius = "1 um"            # spheroradius

# What follows overrides the preset where it is not commented out.

# [bodies]
# density = "2650 kg/m^3"  # with depth; or surface_density = "2 kg/m^2"
# depth = "sphere"         # weighs as much as the solid sphere of the same radius

# [fluid]
# viscosity = "0.89 mPa s"
# buoyancy = true          # needs bodies.density

# [forces.van_der_waals]
# hamaker = "1e-18 J"

# [forces.double_layer]
# potential = "15 mV"
# debye_length = "0.98 um"

# [forces.contact]
# k_n = "20 N/m"

# [forces.mine]            # a force of your own
# class = "mine:Yukawa"    # the class Yukawa in mine.py beside this file

# [zone]                   # the attraction zone; one of:
# root = "outer"           # where attraction and repulsion balance; or "inner"
# distance = "5.9 um"      # the distance between the surfaces of the equivalent spheres
# centre = "45 um"         # the distance between the centres

[integrator]
name = "implicit"
tolerance = "1 nm"         # largest error in position of a step
# max_steps = 200000       # a replicate that needs more ends undecided

# [stop]                   # end before all replicates are run
# half_width = 0.02        # of the 95 % intervals, in every condition
# failed = 0.1             # give the study up where a larger share of replicates fails

# [output]
# file = "elsewhere.h5"    # without it, the results of study.toml go to study.h5
"""


MEASURED = (
    ("binary collisions of settling flocs,", "binary collisions of flocs as measured,"),
    (
        """\
types = ["I", "II", "III"] # the paper's sizes
# pairs = [["10 um", "20 um"]]        # or sizes of your own: [receiving, approaching] radius
""",
        """\
pairs = "measured"         # two flocs of the library, each at its own size
# weight = "volume"        # how often each is drawn: "number", all alike; "area", "volume"
# min_radius = "5 um"      # of the flocs that are drawn, by r_eq; max_radius
# classes = ["10 um", "20 um"]        # results by size class; or 3: so many of equal weight
""",
    ),
    (
        """\
source = "synthetic"       # flocs that flocsim grows
# source = "library"       # or flocs fitted to images with `flocsim fit`
# file = "shapes.h5"
""",
        """\
source = "library"         # flocs fitted to images with `flocsim fit`
file = "shapes.h5"         # beside this file, with fits at the vertices below
""",
    ),
    ('radius = "1 um"            # spheroradius\n', ""),
)
"""(text of EXAMPLE, what a study of measured flocs has in its place)."""


def example(kind: str) -> str:
    """The text of an example: "types", of stated sizes, or "measured", of those of a library."""
    text = EXAMPLE
    for old, new in MEASURED if kind == "measured" else ():
        text = text.replace(old, new)
    return text


def add_parser(subparsers: Any) -> None:
    parser = subparsers.add_parser(
        "init",
        help="write an example config file",
        description="Write a commented example of a config file, ready to run.",
    )
    parser.add_argument(
        "file", nargs="?", default=DEFAULT_FILE, help=f"file to write (default: {DEFAULT_FILE})"
    )
    parser.add_argument(
        "--kind", choices=KINDS, default=KINDS[0],
        help="types: flocs resized to stated radii (default); measured: flocs of a library, each "
        "at its own size",
    )  # fmt: skip
    parser.add_argument("--overwrite", action="store_true", help=OVERWRITE_HELP)
    parser.set_defaults(run=run)


def run(args: Namespace) -> int:
    """Write the file; returns the exit code. UsageError if it exists and is not to be replaced."""
    rule = data_rule(args.overwrite)
    check_outputs([Output(args.file, rule)], [])
    write_file(args.file, example(args.kind).encode(), rule)
    print(f"wrote {args.file}; run it with: flocsim ensemble {args.file}")
    return 0

"""`flocsim init`: write a commented example of a config file, for each kind of study."""

import re
from argparse import Namespace
from pathlib import Path
from typing import Any

from flocsim.io.files import write_file
from flocsim.io.outputs import OVERWRITE_HELP, Output, check_outputs, data_rule

DEFAULT_FILE = "study.toml"

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


SPHERES = """\
# Spheres alone, for `flocsim ensemble`: seconds. docs/config.md has all keys.
preset = "si"              # quartz in water, of its real weight
seed = 1
replicates = 20            # spheres have no orientation: they differ by rounding alone

[scene]
pairs = [["5 um", "10 um"], ["10 um", "20 um"]]   # [receiving, approaching] radius
delta = [0.0, 0.25, 0.5, 0.75, 1.0]               # offsets, as fractions of r_i + r_j

[shapes]
vertices = [1]             # the equivalent sphere

[forces.van_der_waals]
hamaker = "1e-20 J"
"""

PAPER = """\
# All conditions of Tang et al. (2014), for `flocsim ensemble`: core-hours, see --dry-run.
preset = "tang2014"        # the paper's values; "tang2014-literal": exactly as printed
seed = 1
replicates = 100

[scene]
types = ["I", "II", "III"] # the paper's sizes
delta = [0.0, 0.25, 0.5, 0.75, 1.0]

[shapes]
source = "synthetic"       # flocs that flocsim grows in place of the paper's pictures
vertices = [1, 4, 16, 64]
pool = 10
"""

PICTURES = """\
# Flocs of your own pictures, for `flocsim ensemble`. First fit them:
#     flocsim fit PICTURES… --pixel-size "0.95 um" --vertices 4,16,64 -o shapes.h5
#     flocsim plot shapes.h5
# docs/images.md says what can be corrected.
preset = "tang2014"
seed = 1
replicates = 100

[scene]
types = ["I", "III"]
delta = [0.0, 0.5, 1.0]

[shapes]
source = "library"
file = "synthetic"         # ships with flocsim; now write "shapes.h5", your own
vertices = [1, 4, 16, 64]  # those that were fitted, and 1, the sphere of the same area
pool = 10                  # each replicate draws its flocs from the ten nearest in size
# size = "own"             # flocs keep their measured sizes
"""

FORCE = """\
# A force of your own, {module}.py beside this file, for `flocsim ensemble`. docs/forces.md.
preset = "tang2014"
seed = 1
replicates = 20

[scene]
types = ["III"]
delta = [0.0, 0.5]

[shapes]
source = "library"
file = "synthetic"         # ships with flocsim: nothing is grown or fitted
vertices = [1, 16]

[forces.mine]
class = "{module}:Mine"
strength = "0.1 mN/m"
length = "100 nm"
"""

FORCE_MODULE = """\
import attrs
from flocsim.fields import quantity
from flocsim.forces import CentreForce


@attrs.frozen
class Mine(CentreForce):
    strength: float = quantity("N/m", above=0.0)
    length: float = quantity("m", above=0.0)

    @staticmethod
    def kernel(pair, strength, length):  # repulsion [N] at a gap of the equivalent spheres
        return strength * max(length - pair.gap, 0.0)
"""

SWEEP = """\
# One study at several values of a key, into one file; more values later with --resume:
#     flocsim sweep {file} --over forces.van_der_waals.hamaker='"1 zJ"','"10 zJ"','"100 zJ"'
#     flocsim plot {stem}-sweep.h5
# --over may be repeated. The study itself runs with `flocsim ensemble`.
preset = "tang2014"
seed = 1                   # the same for all values: the replicates are paired
replicates = 50

[scene]
types = ["III"]
delta = [0.0, 0.5]

[shapes]
source = "library"
file = "synthetic"         # ships with flocsim: nothing is grown or fitted
vertices = [1, 16]

[forces.van_der_waals]
hamaker = "10 zJ"          # replaced by the values of --over
"""

SWARM = """\
# Many flocs settle in a periodic box, meet and hang together; run it with `flocsim swarm`.
# docs/swarm.md; docs/config.md has all keys.
preset = "si"              # quartz in water, of its real weight
seed = 1
replicates = 2             # swarms, each with other flocs at other places

[scene]
kind = "swarm"
number = 60
area_fraction = 0.12       # of the box, which follows from it; or box = ["300 um", "300 um"]
radius = "8 um"            # median r_eq of a lognormal distribution; without it: measured flocs
spread = 0.3               # standard deviation of ln r_eq
duration = "1 s"
every = "0.1 s"            # snapshots
# classes = ["10 um", "20 um"]        # clusters are counted by size
# periodic = "x"           # with floor = true: a bed
# floor = true

[shapes]
source = "library"
file = "synthetic"         # ships with flocsim; or "shapes.h5", your own
vertices = [16]            # one number: 1 for spheres

[forces.van_der_waals]
cut = "1 um"               # bodies further apart do not attract each other
"""

KERNEL = """\
# Rates for population balances: collision kernels and efficiencies of all pairs of size classes.
#     flocsim kernel {file}
#     flocsim plot {stem}.h5
#     flocsim export matrix {stem}.h5 --model spheres      # or flocmod
# docs/kernels.md; docs/config.md has all keys.
preset = "tang2014"        # the paper's values; or "si": quartz in water, of its real weight
seed = 1
replicates = 1024          # points of each pair of classes: scrambles times a power of 2; more
                           # later with --replicates 4096 --resume

[scene]
kind = "kernel"
meeting = ["settling", "shear"]       # each by itself; "extension", too
rate = "10 1/s"            # of the shear
sizes = ["5 um", "10 um", "20 um"]    # radii of the classes: their pairs are what costs
# pairs = "measured"       # instead of sizes: flocs of a library at their own sizes, in
# classes = 3              # so many classes, or between radii as in ["8 um", "15 um"]
scrambles = 8              # intervals follow from the scatter of these

[shapes]
source = "library"         # flocs fitted to images with `flocsim fit`
file = "synthetic"         # ships with flocsim; now write "shapes.h5", your own
vertices = [1, 16]         # 1: the equivalent sphere, which a model's own kernel is of
pool = 10                  # each point draws its flocs from the ten nearest in size

[integrator]
tolerance = "1 nm"         # largest error in position of a step
"""

BROWNIAN = """\
# Two colloids meet by thermal motion alone, or escape; for `flocsim ensemble`. docs/physics.md.
preset = "si"              # quartz in water; weight is left out
seed = 1
replicates = 200           # pairs that are let go, each with directions and kicks of its own

[scene]
meeting = "brownian"
pairs = [["0.5 um", "0.5 um"]]
release = 2.0              # centres at first, over r_i + r_j; outlines must be clear
escape = 4.0               # the same where a pair has missed: half of free spheres do

[shapes]
source = "library"
file = "synthetic"         # ships with flocsim; or "shapes.h5", your own
vertices = [1, 16]         # 1: the equivalent sphere, whose share is known as an integral, too
radius = "50 nm"           # spheroradius

[forces.thermal]
temperature = "298.15 K"

[integrator]
name = "overdamped"        # no inertia, which colloids forget in a microsecond
tolerance = "1 nm"
"""

MEASURED = (
    ("binary collisions of settling flocs,", "binary collisions of flocs as measured,"),
    (
        """\
preset = "tang2014"        # the paper's values; or "si": quartz in water, of its real weight
""",
        """\
preset = "si"              # quartz in water, of its real weight; "tang2014": the paper's values
""",
    ),
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
file = "synthetic"         # ships with flocsim; now write "shapes.h5", your own
""",
    ),
    ('radius = "1 um"            # spheroradius\n', ""),
)
"""(text of EXAMPLE, what a study of measured flocs has in its place)."""


def measured() -> str:
    """The text of a study of flocs at their measured sizes."""
    text = EXAMPLE
    for old, new in MEASURED:
        text = text.replace(old, new)
    return text


KINDS = {
    "study": (EXAMPLE, "all keys, commented"),
    "spheres": (SPHERES, "spheres alone"),
    "paper": (PAPER, "the conditions of Tang et al. (2014)"),
    "measured": (measured(), "flocs at their measured sizes"),
    "pictures": (PICTURES, "flocs fitted to pictures"),
    "force": (FORCE, "a force of your own, its module too"),
    "sweep": (SWEEP, "several values of a key"),
    "swarm": (SWARM, "many bodies in a box"),
    "kernel": (KERNEL, "rates for population balances"),
    "brownian": (BROWNIAN, "two bodies that meet by thermal motion"),
}
"""What there is to begin with: {name: (text, help)}."""

COMMANDS = {"swarm": "swarm", "kernel": "kernel"}
"""What runs it, where that is not `flocsim ensemble`."""


def add_parser(subparsers: Any) -> None:
    kinds = "; ".join(f"{name}: {words}" for name, (_, words) in KINDS.items())
    parser = subparsers.add_parser(
        "init",
        help="write an example config file",
        description="Write a commented example of a config file, ready to run.",
    )
    parser.add_argument(
        "file", nargs="?", default=DEFAULT_FILE, help=f"file to write (default: {DEFAULT_FILE})"
    )
    parser.add_argument(
        "--kind", choices=KINDS, default="study", help=f"{kinds} (default: %(default)s)"
    )
    parser.add_argument("--overwrite", action="store_true", help=OVERWRITE_HELP)
    parser.set_defaults(run=run)


def run(args: Namespace) -> int:
    """Write the file; returns the exit code. UsageError if it exists and is not to be replaced."""
    rule, path = data_rule(args.overwrite), Path(args.file)
    module = re.sub(r"\W", "_", f"{path.stem}_force")
    module = f"_{module}" if module[0].isdigit() else module
    names = {"{module}": module, "{file}": path.name, "{stem}": path.stem}
    text = KINDS[args.kind][0]
    for name, word in names.items():
        text = text.replace(name, word)
    files = {path: text}
    if args.kind == "force":
        files[path.with_name(f"{module}.py")] = FORCE_MODULE
    check_outputs([Output(each, rule) for each in files], [])
    for each, content in files.items():
        write_file(each, content.encode(), rule)
    wrote = " and ".join(map(str, files))
    command = COMMANDS.get(args.kind, "ensemble")
    print(f"wrote {wrote}; run it with: flocsim {command} {args.file}")
    return 0

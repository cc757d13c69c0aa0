"""`flocsim export gsd run.h5`: motion in a format of another program."""

import argparse
from pathlib import Path
from typing import Any

from flocsim.errors import UsageError
from flocsim.io.exchange.gsd_file import write_gsd
from flocsim.io.outputs import OVERWRITE_HELP, Output, check_outputs, data_rule
from flocsim.io.trajectory import read_trajectory


def add_parser(subparsers: Any) -> None:
    parser = subparsers.add_parser(
        "export",
        help="write a file of motion in a format of another program",
        description="Write the motion that flocsim trajectory --save or Trajectory.save put into "
        "a file in a format of another program: gsd, for OVITO and HOOMD's tools, with lengths in "
        "um. (ParaView and xarray open the file itself.)",
    )
    add = parser.add_argument
    add("format", choices=("gsd",))
    add("motion", help="file that flocsim trajectory --save wrote")
    add("-o", "--output", metavar="FILE.gsd",
        help="file to write (default: run.gsd for run.h5, in the current folder)")  # fmt: skip
    add("--overwrite", action="store_true", help=OVERWRITE_HELP)
    parser.set_defaults(run=run)


def run(args: argparse.Namespace) -> int:
    """Write the file and print its path; returns the exit code."""
    path = Path(args.output or f"{Path(args.motion).stem}.gsd")
    if path.suffix.lower() != ".gsd":
        raise UsageError(f"--output {path}: the name must end in .gsd")
    rule = data_rule(args.overwrite)
    check_outputs([Output(path, rule)], [args.motion])
    motion = read_trajectory(args.motion)
    write_gsd(path, motion.t, motion.position, motion.velocity, motion.shapes, rule)
    print(path)
    return 0

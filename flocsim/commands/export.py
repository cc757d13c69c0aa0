"""`flocsim export`: motion in a format of another program, rates as tables for other models."""

import argparse
import sys
from pathlib import Path

import numpy as np

from flocsim.ensembles.contents import file_kind
from flocsim.errors import UsageError
from flocsim.io.files import write_file
from flocsim.io.outputs import OVERWRITE_HELP, Output, check_outputs, data_rule
from flocsim.io.results import kernel_tables
from flocsim.io.seals import held
from flocsim.io.trajectory import WRITERS

SUFFIXES = {suffix[1:]: suffix for suffix in WRITERS} | {"csv": ".csv", "matrix": ".csv"}


DESCRIPTION = (
    "gsd: the motion saved by flocsim trajectory --save or Trajectory.save, or "
    "that of the first swarm of a study, for OVITO and HOOMD's tools, with lengths in um; "
    "vtkhdf: the same as outlines for ParaView, in m. For results of a kernel study, csv: a "
    "table of all pairs of size classes; matrix: a square matrix for each mechanism and "
    "N, whose header says what it multiplies."
)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    add = parser.add_argument
    add("format", choices=tuple(SUFFIXES))
    add("source", help="file written by flocsim trajectory --save, swarm or kernel")
    add("-o", "--output", metavar="FILE",
        help="file to write (default: run.gsd for run.h5, in the current folder); for matrices, "
        "the start of their names")  # fmt: skip
    add("--what", choices=kernel_tables.QUANTITIES, default="efficiency",
        help="for matrices: the quantity to write (default: %(default)s)")  # fmt: skip
    add("--model", choices=kernel_tables.MODELS, default="spheres",
        help="for matrices of efficiencies: the model whose kernels they multiply (default: "
        "%(default)s); flocmod's settling kernel lacks Stokes's 1/18")  # fmt: skip
    add("--curvilinear", choices=(kernel_tables.SPHERES, *kernel_tables.CORRECTIONS),
        help="for matrices of efficiencies: multiply by this factor of solid spheres, for the "
        "water that they push aside. spheres: computed for the study's spheres and forces, a "
        "second or two for each pair; others: formulas from the literature. Not known for "
        "flocs (default: none, an upper bound)")  # fmt: skip
    add("--overwrite", action="store_true", help=OVERWRITE_HELP)


def run(args: argparse.Namespace) -> int:
    """Write the files and print their paths; returns the exit code."""
    if args.format == "matrix":
        return run_matrices(args)
    if args.curvilinear is not None:
        raise UsageError(
            f"--curvilinear is for matrices, not {args.format}: export matrix, or leave it out"
        )
    suffix = SUFFIXES[args.format]
    path = Path(args.output or f"{Path(args.source).stem}{suffix}")
    if path.suffix.lower() != suffix:
        raise UsageError(f"--output {path}: the name must end in {suffix}")
    rule = data_rule(args.overwrite)
    check_outputs([Output(path, rule)], [args.source])
    if args.format == "csv":
        write_file(path, kernel_tables.kernel_csv(kernel_in(args.source)).encode(), rule)
    else:
        kind = file_kind(source := held(args.source), "motion")
        t, position, velocity, shapes = kind.motion(kind.read(source))
        WRITERS[path.suffix.lower()](path, t, position, velocity, shapes, rule)
    print(path)
    return 0


def kernel_in(path):
    """The rates in a results file; UsageError where it has none."""
    kind = file_kind(source := held(path), "rates")
    kernel = kind.rates(kind.read(source))
    if kernel is None:
        raise UsageError(
            f"{path} is not from a kernel study and has no rates: run flocsim kernel with a config "
            "of "
            'scene.kind = "kernel"'
        )
    return kernel


def water_factors(path):
    """{mechanism: (i, j)}: how often the equivalent spheres of a study touch with the water between
    them, over how often they do without."""
    from flocsim.ensembles.pairs.opened import open_results

    results = open_results(path)
    scene, found = results.config.scene, {}
    for facts, (m, i, j) in zip(results.in_water(), scene.conditions, strict=True):
        count = len(scene.labels)
        factors = found.setdefault(scene.meeting[m], np.ones((count, count)))
        # Where none touches without water, none does with it.
        factors[i, j] = factors[j, i] = facts["water"] / (facts["alone"] or 1.0)
    return found


def run_matrices(args):
    """Write a matrix for each mechanism, that the model and the factor have, and N."""
    kernel, rule = kernel_in(args.source), data_rule(args.overwrite)
    start = Path(args.output or Path(args.source).stem)
    start = start.with_suffix("") if start.suffix.lower() == ".csv" else start
    ending = (args.model, args.curvilinear) if args.what in kernel_tables.OF_MODELS else ()
    texts, without = {}, []
    wanted = args.curvilinear == kernel_tables.SPHERES and args.what in kernel_tables.OF_MODELS
    exact = water_factors(args.source) if wanted else {}
    for mechanism in kernel.mechanisms:
        if args.what in kernel_tables.OF_MODELS and args.model not in kernel_tables.REFERENCES.get(
            mechanism, {}
        ):
            continue
        formulas = kernel_tables.CORRECTIONS.get(args.curvilinear)
        if formulas is not None and mechanism not in formulas:
            without.append(mechanism)
            continue
        for count in kernel.vertices.tolist():
            parts = (mechanism, f"N{count}", args.what, *ending)
            name = f"{start.name}-{'-'.join(filter(None, parts))}.csv"
            texts[start.with_name(name)] = kernel_tables.kernel_matrix(
                kernel, mechanism, count, args.what, args.model, args.curvilinear,
                exact.get(mechanism),
            )  # fmt: skip
    if without:
        words = (
            f"{args.curvilinear} has no curvilinear factor for {', '.join(without)}: export "
            "without --curvilinear for the upper bound"
        )
        if not texts:
            raise UsageError(words)
        print(f"flocsim: {words}", file=sys.stderr)
    if not texts:
        raise UsageError(f"{args.model} has no kernel for {', '.join(kernel.mechanisms)}")
    check_outputs([Output(path, rule) for path in texts], [args.source])
    for path, text in texts.items():
        write_file(path, text.encode(), rule)
        print(path)
    return 0

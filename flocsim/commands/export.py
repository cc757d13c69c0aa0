"""`flocsim export`: a file in the formats of other programs and models."""

import argparse
import io
import itertools
import sys
from pathlib import Path
from typing import Any

import numpy as np

from flocsim.commands import add_allowed, add_overwrite, allowed_by
from flocsim.ensembles.contents import open_kind
from flocsim.errors import UsageError
from flocsim.io.files import unfinished, write_file
from flocsim.io.outputs import check_outputs
from flocsim.io.results import kernel_tables
from flocsim.io.results.file import read_results
from flocsim.io.trajectory import WRITERS

SUFFIXES = {suffix[1:]: suffix for suffix in WRITERS}
"""{format of an exported motion: how its files end}."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Write a file for another program. gsd: the motion saved by flocsim trajectory --save or
    Trajectory.save, or that of the first swarm of a study, for OVITO and HOOMD's tools, with
    lengths in um. vtkhdf: the same as outlines for ParaView, in m. csv: the tables of any file
    that flocsim wrote, with the columns of docs/results.md, in SI units. matrix, for results of a
    kernel study: a square matrix for each mechanism and N; its header says which kernel it
    multiplies.

    source: file that flocsim wrote
    --output FILE: file to write (default: run.gsd for run.h5, run-TABLE.csv for a table, in the
        current folder); for matrices, the start of their names
    --table NAME: for csv: the table to write (default: the main ones, or the first with --output)
    --what: for matrices: the quantity to write (default: %(default)s)
    --model: for matrices of efficiencies: the model whose kernels they multiply (default:
        %(default)s); flocmod's settling kernel lacks Stokes's 1/18
    --curvilinear: for matrices of efficiencies: multiply by the collision efficiency of solid
        spheres that push water aside. spheres: computed for the study's spheres and forces, in a
        second or two for each pair; others: formulas from the literature. It is not known for
        flocs (default: no factor, an upper bound)
    """
    add = parser.add_argument
    add("format", choices=(*SUFFIXES, "csv", "matrix"))
    add("source")
    add("-o", "--output")
    add("--table")
    add("--what", choices=kernel_tables.QUANTITIES, default="efficiency")
    add("--model", choices=kernel_tables.MODELS, default="spheres")
    add("--curvilinear", choices=(kernel_tables.SPHERES, *kernel_tables.CORRECTIONS))
    add_allowed(parser)
    add_overwrite(parser)


def run(args: argparse.Namespace) -> int:
    """Write the files and print their paths; returns the exit code."""
    if args.format == "matrix":
        return export_matrices(args)
    if args.curvilinear is not None:
        raise UsageError(
            f"--curvilinear is for matrices, not {args.format}: export matrix, or leave it out"
        )
    return export_tables(args) if args.format == "csv" else export_motion(args)


def export_motion(args: argparse.Namespace) -> int:
    """Write a motion for a program that shows it."""
    suffix = SUFFIXES[args.format]
    path = Path(args.output or f"{Path(args.source).stem}{suffix}")
    check_outputs([path], args.overwrite, [args.source], endings=(suffix,))
    kind, file = open_kind(args.source, "motion")
    WRITERS[suffix](path, kind.motion(kind.read(file)), args.overwrite)
    print(path)
    return 0


def export_tables(args: argparse.Namespace) -> int:
    """Write tables of a file of any kind as CSV."""
    kind, file = open_kind(args.source)
    tables = kind.opened(file)
    names = [tables.known(args.table)] if args.table else tables.exported or list(tables.indices)
    found = {f"{Path(args.source).stem}-{name}.csv": name for name in names}
    if args.output:
        found = {args.output: names[0]}
    check_outputs(found, args.overwrite, [args.source])
    for path, name in found.items():
        labelled = tables.labelled(name)
        with unfinished(path, args.overwrite) as file:
            text = io.TextIOWrapper(file, "utf-8", newline="")
            labelled.write_csv(text, tables.indices[name])
            text.detach()  # which writes what it still holds
        print(path)
    return 0


def water_factors(path: Any, allowed: Any) -> dict[str, np.ndarray]:
    """Return {mechanism: (i, j)}: how often the equivalent spheres of a study touch with the water
    between them, over how often they do without."""
    from flocsim.ensembles.pairs.opened import StudyResults

    results = StudyResults(path, allowed)
    scene: Any = results.config.scene
    found: dict[str, np.ndarray] = {}
    for facts, (m, i, j) in zip(results.in_water(), scene.conditions, strict=True):
        count = len(scene.labels)
        factors = found.setdefault(scene.meeting[m], np.ones((count, count)))
        # Where none touches without water, none does with it.
        factors[i, j] = factors[j, i] = facts["water"] / (facts["alone"] or 1.0)
    return found


def export_matrices(args: argparse.Namespace) -> int:
    """Write a matrix for each mechanism, that the model and the factor have, and N."""
    kernel = read_results(args.source).kernel
    if kernel is None:
        raise UsageError(
            f"{args.source} is not from a kernel study and has no rates: run flocsim kernel with a "
            'config of scene.kind = "kernel"'
        )
    start = Path(args.output or Path(args.source).stem)
    start = start.with_suffix("") if start.suffix.lower() == ".csv" else start
    multiplies = args.what in kernel_tables.OF_MODELS
    factors: dict[str, np.ndarray] = {}
    if args.curvilinear == kernel_tables.SPHERES and multiplies:
        factors = water_factors(args.source, allowed_by(args))
    texts, without = {}, []
    for mechanism, count in itertools.product(kernel.mechanisms, kernel.vertices.tolist()):
        ending = [args.model, args.curvilinear or ""] if multiplies else []
        parts = [start.name, mechanism, f"N{count}", args.what, *ending]
        path = start.with_name(f"{'-'.join(filter(None, parts))}.csv")
        asked = mechanism, count, args.what, args.model, args.curvilinear
        try:
            texts[path] = kernel_tables.kernel_matrix(kernel, *asked, factors.get(mechanism))
        except UsageError as error:
            # As for a mechanism of which a model, or a factor, knows nothing.
            without.append(str(error))
    if not texts:
        raise UsageError(without[0])
    for words in dict.fromkeys(without):
        print(f"flocsim: left out: {words}", file=sys.stderr)
    check_outputs(texts, args.overwrite, [args.source])
    for path, text in texts.items():
        write_file(path, text.encode(), args.overwrite)
        print(path)
    return 0

"""Commands that take a file and show what is in it: `flocsim info`, for a person to read; `plot`,
as figures; `compare`, what one study has more of than another; `export`, in the formats of other
programs and models."""

import argparse
import io
import math
import sys
from pathlib import Path
from typing import Any

import numpy as np

from flocsim.commands import add_allowed, allowed_by
from flocsim.ensembles.config import FILES, contents_of
from flocsim.ensembles.config.sources import read_sources
from flocsim.ensembles.contents import compare, file_kind, studies, text_of, unfinished_text
from flocsim.errors import FileError, UsageError, visible
from flocsim.io.files import make_folder, unfinished, write_file
from flocsim.io.journal import journal_of
from flocsim.io.outputs import OVERWRITE_HELP, Output, check_outputs, data_rule
from flocsim.io.plots.results import MOST_ROWS
from flocsim.io.plots.style import FORMATS, mark_figure, save
from flocsim.io.results import kernel_tables
from flocsim.io.seals import held
from flocsim.io.trajectory import WRITERS

SUFFIXES = {suffix[1:]: suffix for suffix in WRITERS}
"""{format of an exported motion: how its files end}."""


def add_arguments_info(parser: argparse.ArgumentParser) -> None:
    parser.description = (
        "Print the contents of a file: conditions, counts, probabilities with 95 % "
        "intervals, and its origin; of a study that is running or was interrupted, the replicates "
        "so far, without touching it."
    )
    parser.add_argument("results", help="file written, or being written, by flocsim")
    parser.add_argument(
        "--config", action="store_true", help="print only the config that it was run with"
    )
    parser.add_argument(
        "--modules", action="store_true",
        help="print only the user's modules that it was run with",
    )  # fmt: skip
    parser.add_argument(
        "--water", action="store_true",
        help="print only how often the equivalent spheres of a study of pairs or rates touch, "
        "with and without the water that they push at each other (a second or two for each pair); "
        "of a shape library, how fast its flocs settle and turn",
    )  # fmt: skip
    add_allowed(parser)


def run_info(args: argparse.Namespace) -> int:
    journal = journal_of(args.results)
    if journal is not None:
        if args.config or args.modules or args.water:
            raise FileError(f"{journal} has no config: it belongs to a run that has not ended")
        # All kinds of studies, and the engine with them, are wanted here alone.
        from flocsim.ensembles.storage.unfinished import read_unfinished

        print(unfinished_text(read_unfinished(journal)))
        return 0
    if args.water:
        source = held(args.results)
        print("\n".join(file_kind(source, "water").water(source, allowed_by(args))))
    elif args.config or args.modules:
        kind = file_kind(source := held(args.results), "run")
        print_kept(args, kind.run(kind.read(source)))
    else:
        print(text_of(args.results))
    return 0


def print_kept(args, run):
    """Print the config, the modules, or both, that a file keeps; FileError where it has none."""
    if args.config:
        if not run.get("config"):
            raise FileError(f"{args.results} has no config: it was not written by flocsim ensemble")
        sys.stdout.write(str(run["config"]))
    if args.modules:
        try:
            modules = read_sources(run)
        except ValueError as error:
            raise FileError(f"{args.results} has no readable results: {error}") from error
        if not modules:
            raise FileError(f"{args.results} has no modules: its study used none, or was run by a "
                "version of flocsim that kept none")  # fmt: skip
        for place, each in modules.items():
            sys.stdout.write(f"# {visible(place, '')}\n{each['source'].rstrip()}\n")


def listed(figures):
    """A line for every figure: its name and the first line of its docstring."""
    told = {name: (draw.__doc__ or "").partition("\n")[0] for name, draw in figures.items()}
    return "\n".join(f"  {name:<8}  {text.removesuffix('.')}" for name, text in told.items())


def drawn() -> dict[str, Any]:
    """{kind of file, in words: {name: figure}}."""
    return {words: figures for name in FILES for words, figures in contents_of(name).drawn.items()}


def add_arguments_plot(parser: argparse.ArgumentParser) -> None:
    parser.formatter_class = argparse.RawDescriptionHelpFormatter
    parser.description = "\n".join(
        [
            "Draw the figures of a file, each to its own file.",
            *(f"Of {kind}:\n{listed(figures)}" for kind, figures in drawn().items()),
            "Of a running study, the figures of the replicates so far are drawn, marked as "
            "unfinished.",
            "Figures are numbered as in Tang et al. (2014).",
        ]
    )
    parser.add_argument("results", help="file written by flocsim ensemble or flocsim fit")
    parser.add_argument("--output-dir", default=".", metavar="DIR",
        help="folder for the figures, created if missing (default: the current one)")  # fmt: skip
    parser.add_argument("--format", default="png", choices=FORMATS, help="default: %(default)s")
    parser.add_argument("--figures", metavar="LIST",
        help="figures, separated by commas (default: all that the file has)")  # fmt: skip
    parser.add_argument("--animation", metavar="FILE.gif",
        help="for a swarm study: also write its first swarm as an animation")  # fmt: skip
    parser.add_argument("--overwrite", action="store_true", help=OVERWRITE_HELP)


def run_plot(args: argparse.Namespace) -> int:
    """Draw the figures asked for, print the path of each; returns the exit code."""
    names = None if args.figures is None else figure_names(args.figures)
    source = held(args.results)
    kind, content, remark, foot = read_content(source)
    figures = kind.figures(content)
    foreign = [name for name in names or () if name not in figures]
    if foreign:
        raise UsageError(f"{args.results} has no figure {foreign[0]}, only {', '.join(figures)}")
    folder = Path(args.output_dir)
    make_folder(folder, "--output-dir ")
    stem, rule = Path(args.results).stem, data_rule(args.overwrite)
    paths = {name: folder / f"{stem}-{label(name)}.{args.format}" for name in names or figures}
    animation = animation_of(args, kind)
    check_outputs([Output(path, rule) for path in (*paths.values(), *animation)], [args.results])
    if kind.rows_drawn & paths.keys() and not remark:
        content = kind.with_rows(source, content, MOST_ROWS if names is None else math.inf)
    for name, path in paths.items():
        figure = figures[name](content)
        if remark:
            mark_figure(figure, remark)
        save(figure, path, rule, foot)
        print(path)
    for path in animation:
        kind.animate(path, content, rule=rule)
        print(path)
    return 0


def animation_of(args, kind):
    """[path of the animation asked for]; UsageError where there can be none."""
    if not args.animation:
        return []
    if kind.animate is None:
        able = " or ".join(each.title for each in studies() if each.animate)
        raise UsageError(
            f"--animation is for {able}; for one collision use flocsim trajectory --animation"
        )
    if Path(args.animation).suffix.lower() != ".gif":
        raise UsageError(f"--animation {args.animation} must end in .gif")
    return [Path(args.animation)]


def label(name):
    return f"figure-{name}" if name.isdigit() else name


def read_content(path):
    """(Contents, what a file holds, what each figure of it has to say, and its source)."""
    if (journal := journal_of(path)) is not None:
        from flocsim.ensembles.storage.unfinished import read_unfinished

        begun = read_unfinished(journal)
        last = begun.sessions[-1]
        return contents_of(begun.kind), begun.results, begun.progress, str(last.get("source", ""))
    kind = file_kind(path)
    found = kind.read(path)
    return kind, found, kind.mark(found), kind.source(found)


def figure_names(text):
    """The names in a list such as "4,overview", each once; UsageError for an unknown one."""
    names = list(dict.fromkeys(name.strip() for name in text.split(",") if name.strip()))
    known = [name for figures in drawn().values() for name in figures]
    unknown = [name for name in names if name not in known]
    if unknown or not names:
        found = ", ".join(map(repr, unknown)) or "none"
        raise UsageError(f"--figures: found {found}; choose from {', '.join(known)}")
    return names


def add_arguments_compare(parser: argparse.ArgumentParser) -> None:
    parser.description = (
        "Print the differences between two results files, at every condition, or time, that both "
        "have, with 95 % intervals: of paired replicates where both have drawn the same ones (the "
        "same seed), otherwise of independent samples. What the studies differ in is printed first."
    )
    parser.add_argument("first", help="results file written by flocsim ensemble")
    parser.add_argument("second", help="results file to compare with it")
    known = "; ".join(
        f"of {kind.title} "
        + ", ".join(f"{name} ({words})" for name, words in kind.compared.items())
        for kind in studies() if kind.compared
    ).replace("%", "%%")  # fmt: skip
    parser.add_argument(
        "--quantity", "--probability", metavar="NAME",
        help=f"what to compare: {known} (default: the first)",
    )  # fmt: skip


def run_compare(args: argparse.Namespace) -> int:
    """Print the comparison; the exit code."""
    both = []
    for path in (args.first, args.second):
        kind = file_kind(source := held(path), "compare")
        both.append(kind.opened(source))
        print(f"{path}: {kind.source(both[-1]) or 'its source is not stated'}")
    comparison = compare(*both)
    print(comparison.table(*filter(None, [args.quantity])))
    return 0


def add_arguments_export(parser: argparse.ArgumentParser) -> None:
    parser.description = (
        "gsd: the motion saved by flocsim trajectory --save or Trajectory.save, or "
        "that of the first swarm of a study, for OVITO and HOOMD's tools, with lengths in um; "
        "vtkhdf: the same as outlines for ParaView, in m; csv: the tables of any file that "
        "flocsim wrote, their columns as docs/results.md has them, in SI units. For results of a "
        "kernel study, matrix: a square matrix for each mechanism and N, whose header says what it "
        "multiplies."
    )
    add = parser.add_argument
    add("format", choices=(*SUFFIXES, "csv", "matrix"))
    add("source", help="file that flocsim wrote")
    add("-o", "--output", metavar="FILE",
        help="file to write (default: run.gsd for run.h5, run-TABLE.csv for a table, in the "
        "current folder); for matrices, the start of their names")  # fmt: skip
    add("--table", metavar="NAME",
        help="for csv: the table to write (default: the main ones, or the first with --output)",
    )  # fmt: skip
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
    add_allowed(parser)
    add("--overwrite", action="store_true", help=OVERWRITE_HELP)


def run_export(args: argparse.Namespace) -> int:
    """Write the files and print their paths; returns the exit code."""
    if args.format == "matrix":
        return run_matrices(args)
    if args.curvilinear is not None:
        raise UsageError(
            f"--curvilinear is for matrices, not {args.format}: export matrix, or leave it out"
        )
    if args.format == "csv":
        return run_tables(args)
    suffix = SUFFIXES[args.format]
    path = Path(args.output or f"{Path(args.source).stem}{suffix}")
    if path.suffix.lower() != suffix:
        raise UsageError(f"--output {path}: the name must end in {suffix}")
    rule = data_rule(args.overwrite)
    check_outputs([Output(path, rule)], [args.source])
    kind = file_kind(source := held(args.source), "motion")
    t, position, velocity, shapes = kind.motion(kind.read(source))
    WRITERS[path.suffix.lower()](path, t, position, velocity, shapes, rule)
    print(path)
    return 0


def run_tables(args):
    """Write tables of a file of any kind as CSV and print their paths; the exit code."""
    kind = file_kind(source := held(args.source))
    tables = (kind.opened or kind.read)(source)
    names = [tables.known(args.table)] if args.table else tables.exported or list(tables.indices)
    found = {f"{Path(args.source).stem}-{name}.csv": name for name in names}
    if args.output:
        found = {args.output: names[0]}
    rule = data_rule(args.overwrite)
    check_outputs([Output(path, rule) for path in found], [args.source])
    for path, name in found.items():
        labelled = tables.labelled(name)
        with unfinished(path, rule) as (_, file):
            text = io.TextIOWrapper(file, "utf-8", newline="")
            labelled.write_csv(text, tables.indices[name])
            text.detach()  # which writes what it still holds
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


def water_factors(path, allowed):
    """{mechanism: (i, j)}: how often the equivalent spheres of a study touch with the water between
    them, over how often they do without."""
    from flocsim.ensembles.pairs.opened import open_results

    results = open_results(path, allowed)
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
    exact = water_factors(args.source, allowed_by(args)) if wanted else {}
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

"""`flocsim plot`: the paper's figures from a results file or a shape library; `flocsim compare`:
what one study has more of than another."""

import argparse
import math
from pathlib import Path
from typing import Any

from flocsim.ensembles.config.kinds import FILES, contents_of
from flocsim.ensembles.contents import compare, file_kind, studies
from flocsim.errors import UsageError
from flocsim.io.files import make_folder
from flocsim.io.journal import journal_of
from flocsim.io.outputs import OVERWRITE_HELP, Output, check_outputs, figure_rule
from flocsim.io.plots.results import MOST_ROWS
from flocsim.io.plots.style import FORMATS, mark_figure, save
from flocsim.io.seals import held


def listed(figures):
    """A line for every figure: its name and the first line of its docstring."""
    told = {name: (draw.__doc__ or "").partition("\n")[0] for name, draw in figures.items()}
    return "\n".join(f"  {name:<8}  {text.removesuffix('.')}" for name, text in told.items())


def drawn() -> dict[str, Any]:
    """{kind of file, in words: {name: figure}}."""
    return {words: figures for name in FILES for words, figures in contents_of(name).drawn.items()}


def add_arguments(parser: argparse.ArgumentParser) -> None:
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


def run(args: argparse.Namespace) -> int:
    """Draw the figures asked for, print the path of each; returns the exit code."""
    names = None if args.figures is None else figure_names(args.figures)
    source = held(args.results)
    kind, content, remark = read_content(source)
    figures = kind.figures(content)
    foreign = [name for name in names or () if name not in figures]
    if foreign:
        raise UsageError(f"{args.results} has no figure {foreign[0]}, only {', '.join(figures)}")
    folder = Path(args.output_dir)
    make_folder(folder, "--output-dir ")
    stem, rule = Path(args.results).stem, figure_rule(args.overwrite)
    paths = {name: folder / f"{stem}-{label(name)}.{args.format}" for name in names or figures}
    animation = animation_of(args, kind)
    check_outputs([Output(path, rule) for path in (*paths.values(), *animation)], [args.results])
    if kind.rows_drawn & paths.keys() and not remark:
        content = kind.with_rows(source, content, MOST_ROWS if names is None else math.inf)
    for name, path in paths.items():
        figure = figures[name](content)
        if remark:
            mark_figure(figure, remark)
        save(figure, path, rule)
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
    """(Contents, what a file holds, what each figure of it has to say)."""
    if (journal := journal_of(path)) is not None:
        from flocsim.ensembles.storage.unfinished import read_unfinished

        begun = read_unfinished(journal)
        return contents_of(begun.kind), begun.results, begun.progress
    kind = file_kind(path)
    found = kind.read(path)
    return kind, found, kind.mark(found)


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
    both = [file_kind(source := held(path), "compare").opened(source)
            for path in (args.first, args.second)]  # fmt: skip
    comparison = compare(*both)
    print(comparison.table(*filter(None, [args.quantity])))
    return 0

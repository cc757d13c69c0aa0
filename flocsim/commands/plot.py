"""`flocsim plot`: the figures of a file."""

import argparse
import inspect
from pathlib import Path
from typing import Any

from flocsim.commands import add_overwrite
from flocsim.ensembles.config import contents_of
from flocsim.ensembles.contents import Contents, open_kind, studies
from flocsim.errors import UsageError
from flocsim.io.files import make_folder
from flocsim.io.journal import journal_of
from flocsim.io.outputs import check_outputs
from flocsim.io.plots.style import FORMATS, mark_figure, save


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Draw the figures of a file, each to its own file; figures with a number are those of Tang et
    al. (2014). Of a running study, the figures of the replicates so far are drawn, marked as
    unfinished. Bars are 95 % sampling intervals; the numerical error is drawn as well where it is
    more than half of them in some condition.

    results: file written by flocsim ensemble or flocsim fit
    --output-dir DIR: folder for the figures, created if missing (default: the current one)
    --format: default: %(default)s
    --figures LIST: figures, separated by commas, as 4,5,6,8 or overview; all: all that the file has
      (default: of pairs outcomes,overview,4,5,6,8, of others all)
    --numerics: draw the numerical error in any case, as thin bars
    --animation FILE.gif: for a swarm study: also write its first swarm as an animation
    """
    add = parser.add_argument
    add("results")
    add("--output-dir", default=".")
    add("--format", default="png", choices=FORMATS)
    add("--figures")
    add("--numerics", action="store_true")
    add("--animation")
    add_overwrite(parser)


def run(args: argparse.Namespace) -> int:
    """Draw the figures asked for, print the path of each; returns the exit code."""
    kind, content, remark, foot = read_content(args.results)
    figures = kind.figures(content)
    names = [name for name in kind.drawn if name in figures]
    if args.figures is not None:
        names = list(dict.fromkeys(map(str.strip, args.figures.split(","))))
    if not names or names == ["all"]:
        names = list(figures)
    if foreign := [name for name in names if name not in figures]:
        raise UsageError(f"{args.results} has no figure {foreign[0]!r}, only {', '.join(figures)}")
    folder, stem, rule = Path(args.output_dir), Path(args.results).stem, args.overwrite
    make_folder(folder, "--output-dir ")
    # Figure 4 is written to study-figure-4.png.
    paths = {
        name: folder / f"{stem}-{'figure-' * name.isdigit()}{name}.{args.format}" for name in names
    }
    if args.animation and kind.animate is None:
        able = " or ".join(each.title for each in studies() if each.animate)
        raise UsageError(
            f"--animation is for {able}; for one collision use flocsim trajectory --animation"
        )
    animation = list(filter(None, [args.animation]))
    check_outputs(animation, rule, [args.results], endings=(".gif",))
    check_outputs(paths.values(), rule, [args.results])
    for name, path in paths.items():
        draw = figures[name]
        thin = args.numerics and "numerics" in inspect.signature(draw).parameters
        figure = draw(content, numerics=True) if thin else draw(content)
        if remark:
            mark_figure(figure, remark)
        save(figure, path, rule, foot)
        print(path)
    for path in animation:
        kind.animate(path, content, rule=rule)
        print(path)
    return 0


def read_content(path: Any) -> tuple[Contents, Any, str, str]:
    """Return (Contents, what a file holds, what each figure of it has to say, and its source)."""
    if (journal := journal_of(path)) is not None:
        from flocsim.ensembles.storage.unfinished import read_unfinished

        begun = read_unfinished(journal)
        last = begun.sessions[-1]
        return contents_of(begun.kind), begun.results, begun.progress, str(last.get("source", ""))
    kind, file = open_kind(path)
    found = kind.read(file)
    return kind, found, kind.mark(found), kind.source(found)

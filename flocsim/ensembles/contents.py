"""What a file holds, of whatever kind it is: the contract of a kind of file.

Each kind gives its Contents, by which `open`, `info`, `plot`, `report`, `compare`, `sweep` and
`export` read it and show it; they know no kind themselves. `flocsim.ensembles.config` is the
table of all. `open_any` is `flocsim.open`, what a script has of a file; `compare` what two of one
kind differ in, and Differences what comparisons of all kinds have in common.
"""

import contextlib
import importlib
import os
from collections import Counter
from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from typing import Any, ClassVar

import attrs
import numpy as np

from flocsim.ensembles.config import FILES, STUDIES, contents_of
from flocsim.ensembles.config.sources import Allowed
from flocsim.errors import FileError, UsageError, visible
from flocsim.io.groups import UNREADABLE, FileFormat
from flocsim.io.hdf5 import Unfit, open_hdf5
from flocsim.io.labelled import Column, Labelled, Tables, with_unit
from flocsim.io.results.run_group import source_line, stored
from flocsim.io.terminal import aligned, rows_along

Facts = list[tuple[str, str]]
"""[(name, value)]."""

Figures = Mapping[str, Callable[..., Any]]
"""{name: function that returns a matplotlib Figure}, the first line of whose docstring is its
help."""

Row = Callable[[tuple[int, ...]], Sequence[str]]
"""Gives the cells of a table at a place along its axes."""

SAID_APART = ("config", "preset", "shapes", "identity", "failed", "overrides", "history",
              "warnings", "modules")  # fmt: skip
"""What the group ``run`` holds, of any kind, besides what is printed as it is."""

MOST_FAILURES = 10


@attrs.frozen
class Summary:
    """What a file says of itself: facts; warnings, and what failed, a line each."""

    facts: Facts
    warnings: list[str] = attrs.Factory(list)
    failed: list[str] = attrs.Factory(list)


@attrs.frozen
class Example:
    """A motion to watch: ``heading`` names it, ``title`` says which; ``data`` is for the script of
    a page, and None where it could not be run again, which ``reason`` says."""

    heading: str
    title: str
    data: Mapping[str, Any] | None = None
    reason: str = ""


def later(module: str, name: str) -> Any:
    """Return a function of a module of flocsim that is loaded when it is called, as a static
    method: what shows a file has no need of the engine."""
    return staticmethod(
        lambda *args, **more: getattr(importlib.import_module(f"flocsim.{module}"), name)(
            *args, **more
        )
    )


class Contents:
    """What the commands ask of a kind of file; ``found`` is what `read` gives.

    A subclass gives ``title``, what such a file holds in words, its ``file`` (or `read`), and
    `summary`. All else has a default, and an ability that is None is refused in one line.
    """

    title: str
    file: FileFormat
    first: Sequence[str] = ()
    """Figures that a page shows first."""
    on_examples: str = ""
    """What a page says of the motions that `examples` gives."""
    compared: Mapping[str, str] = {}
    """{name: words} of what can be compared."""
    swept: Sequence[str] = ()
    """Groups of results that sweeps join, the first being printed; none: they cannot be run."""
    swept_table: Any = None
    """(that group, Labelled) → (heads, row) of `rows_along` at the values of the swept keys."""
    detailed: Any = None
    """(found, whether to add numerical errors, whether all columns) → its numbers as text."""
    drawn: Sequence[str] = ()
    """Figures that `flocsim plot` draws where none is named; none: all."""
    compare: Any = None
    """(opened, opened) → Tables of differences, whose ``table(name)`` is text."""
    animate: Any = None
    """(path, found, rule) writes a GIF."""
    motion: Any = None
    """(found) → (times, positions, velocities, shapes)."""
    water: Any = None
    """(path, allowed modules) → lines on what slow flow makes of it."""

    def read(self, path: Any) -> Any:
        """Return what a file holds; FileError for one that is absent, damaged, or of another
        kind."""
        return self.file.read(path)

    def summary(self, found: Any) -> Summary:
        """Return what a file says of itself; ValueError where that cannot be read."""
        raise NotImplementedError

    def rows(self, found: Any) -> list[list[str]]:
        """Return its numbers as cells of a table, heads first; [] where there is only `table`."""
        return []

    def table(self, found: Any) -> str:
        """Return its numbers as text."""
        return "\n".join(aligned(self.rows(found)))

    def figures(self, found: Any) -> Figures:
        """Return the figures that a file has."""
        return {}

    def source(self, found: Any) -> str:
        """Return of which preset, flocs, replicates and version it is, in a line."""
        return source_line(found.run, self.counts(found))

    def counts(self, found: Any) -> Sequence[int]:
        """Return the numbers of replicates of all conditions, or of swarms; () if not known."""
        return ()

    def answer(self, found: Any) -> str:
        """Return what a study found, in one sentence; "" where there is none."""
        return ""

    def setting(self, found: Any) -> str:
        """Return of which preset, weight and water it is, in one sentence; "" where unknown."""
        return ""

    def mark(self, found: Any) -> str:
        """Return what each figure has to say, as that it is not complete; "" for nothing."""
        return ""

    def opened(self, path: Any, allowed: Allowed | None = None) -> Any:
        """Return what a script has of it; ``allowed``: modules that may be imported."""
        return self.read(path)

    def examples(self, opened: Any) -> list[Example]:
        """Return motions that are worth watching, of what `opened` gives."""
        return []

    def outlines(self, opened: Any) -> dict[str, Any]:
        """Return {name of a floc: its Shape}, of those that a study draws from."""
        return {}

    # What rank 0 asks of a kind of study.

    results: Any = None
    """(study, beginning, count, run, output) → results of so many replicates of each condition,
    written to the output."""
    old_rows: Any = None
    """(path) → context manager of a results file that is to be extended, as OldResults."""
    so_far: Any = None
    """(store, what the study's session asked for) → (results so far, how many of those that
    progress counts are there, and of how many)."""

    def running(self, found: Any) -> Facts:
        """Return facts of an Unfinished, a study that has not ended."""
        return []

    def facts(self, study: Any) -> dict[str, Any]:
        """Return what the results say of a study besides their tables, as JSON can hold it."""
        return {}

    def verdict(self, found: Any) -> tuple[int, str]:
        """Return (exit code, what to say of replicates without an outcome; "" for nothing)."""
        return 0, ""

    def stop_rule(self, study: Any, store: Any) -> Callable[[int], bool]:
        """Return a function: are so many replicates of each condition enough?"""
        return lambda n: False

    def dry_run(self, config: Any, ranks: int, pilot: bool, verbose: bool) -> str:
        """Return what a study would do."""
        from flocsim.ensembles.kind import study_of  # which needs the engine

        return str(study_of(config, []).title)


def open_kind(path: str | os.PathLike, ability: str = "read") -> tuple[Contents, Any]:
    """Open a file whose kind has an ability, a field of Contents: return (Contents, open file).

    The open file stands for its path, whatever takes its place meanwhile. FileError for one of
    another kind, or that is absent or damaged. What does not say its kind is read as the first,
    whose reader says what is wrong.
    """
    file, name = path, ""
    with contextlib.suppress(Unfit):
        file = open_hdf5(path)
        name = file.kind
    if name in FILES and getattr(contents_of(name), ability) is not None:
        return contents_of(name), file
    able = [each for each in map(contents_of, FILES) if getattr(each, ability) is not None]
    if name:
        what = contents_of(name).title if name in FILES else f'"{name}"'
        titles = " or ".join(each.title for each in able)
        raise FileError(f"{path} holds {what}: name a file with {titles}")
    return able[0], file


def studies() -> list[Contents]:
    """The Contents of all kinds of studies."""
    return [contents_of(name) for name in STUDIES]


def text_of(path: object, kind: Contents, found: Any, table: str | None = None) -> str:
    """Return what `flocsim info` prints of a file; ``table``: instead of its usual one."""
    try:
        said, mark = kind.summary(found), kind.mark(found)
    except UNREADABLE as error:
        raise FileError(f"{path} has no readable {kind.title}: {error}") from error
    head = f"{path}: {kind.title}; {mark}" if mark else f"{path}: {kind.title}"
    return page_of(head, kind.source(found), said, table or kind.table(found))


def page_of(head: str, source: str, said: Summary, table: str) -> str:
    """Return all of these as lines; what a file says is shown, and steers no terminal."""
    width = max(len(name) for name, _ in said.facts)
    lines = [head, *filter(None, [source]), ""]
    lines += [f"{name:<{width}}  {value}" for name, value in said.facts]
    for word, notes in (("warning", said.warnings), ("failed", said.failed[:MOST_FAILURES])):
        lines += ["", *(f"{word}: {each}" for each in notes)] if notes else []
    if len(said.failed) > MOST_FAILURES:
        lines.append(f"and {len(said.failed) - MOST_FAILURES} more in run/failed")
    lines += ["", *table.split("\n")] if table else []
    return "\n".join(visible(line, "") for line in lines)


def info_of(path: str | os.PathLike) -> str:
    """Return what `flocsim info` prints of the file at a path."""
    kind, file = open_kind(path)
    return text_of(path, kind, kind.read(file))


def unfinished_text(found: Any) -> str:
    """What an Unfinished has so far; nothing of it is final."""
    kind, last = contents_of(found.kind), found.sessions[-1]
    facts = [*kind.running(found), ("begun", f"{last['date']} by {last['command']}")]
    if found.unread:
        facts.append(("damaged", f"{found.unread} records, left out"))
    reasons = Counter(str(note["why"]) for note in found.notes)
    failed = [f"{count} times {why}" for why, count in reasons.most_common(MOST_FAILURES)]
    said, source = Summary(facts, [], failed), str(last.get("source", ""))
    return page_of(f"{found.path}: {found.progress}", source, said, kind.table(found.results))


def study_summary(
    facts: Facts, run: Mapping[str, Any], note_words: Callable[[dict], str],
    apart: Collection[str] = (), more: Iterable[str] = (),
) -> Summary:  # fmt: skip
    """Return the Summary of a study: facts, and what the group ``run`` says but ``apart``.

    ``note_words`` tells of a failed replicate; ``more``: warnings besides the stored ones.
    """
    warnings, failed = stored(run, "warnings"), stored(run, "failed")
    origin: Facts = []
    for name, value in run.items():
        if name in SAID_APART or name in apart or value == "":
            continue
        if isinstance(value, float):
            value = f"{value:.6g} s" if "time" in name else f"{value:.6g}"
        origin.append((name.replace("_", " "), str(value)))
    return Summary(facts + origin, [*map(str, warnings), *more],
                   list(map(note_words, failed)))  # fmt: skip


def open_any(
    path: str | os.PathLike, folder: str | os.PathLike | None = None, own: Collection[str] = ()
) -> Any:
    """Open any file that flocsim wrote.

    Parameters
    ----------
    path : path
        Name of the file.
    folder : path, optional
        Folder of the modules of the study's own classes, and of its shape library. By default the
        library is looked for beside the results, and no module is imported.
    own : collection of str
        Names of installed modules that may be imported, as in ``own=["mine"]``.

    Returns
    -------
    StudyResults, SwarmResults, SweepResults or another class
        Depends on the kind of file. Replicates of pairs are read when first used.

    Raises
    ------
    FileError
        If the file is absent, damaged or of another kind.

    Notes
    -----
    Opening a file runs no code unless ``folder`` or ``own`` allows it.
    """
    own = [own] if isinstance(own, str) else own
    kind, file = open_kind(path)
    return kind.opened(file, Allowed(folder, own))


MEANINGS = {
    "first": "in the first file",
    "second": "in the second file",
    "difference": "second minus first",
    "difference_low": "difference, lower 95 % bound",
    "difference_high": "difference, upper 95 % bound",
    "n_first": "how many count in the first file",
    "n_second": "how many count in the second file",
    "change_low": "change of the difference if all runs were exact: lower 95 % bound",
    "change_high": "change of the difference if all runs were exact: upper 95 % bound",
}
"""The arrays of a comparison of one quantity; changes by numerics, last, only where they are
known."""


@attrs.frozen(eq=False, repr=False)
class Differences(Tables):
    """Differences between two results, as `flocsim.compare` returns them.

    Attributes
    ----------
    paired : bool
        Whether both studies drew the same replicates.
    pairs : int
        Number of replicates that both have, if paired.
    axes : dict of str to Column
        The conditions, or times, that both have.
    arrays : dict of str to dict of str to array
        {quantity: {name: values}} along these axes; the names are those of MEANINGS.
    changes : tuple of str
        Lines on the differences between the two studies themselves.
    """

    paired: bool
    pairs: int
    axes: dict[str, Column]
    arrays: dict[str, dict[str, np.ndarray]]
    changes: tuple[str, ...] = ()
    quantities: ClassVar[Mapping[str, tuple[str, str]]] = {}
    """{quantity: (unit, meaning)}, the first being the one that is meant where none is named."""
    noun: ClassVar[str] = "replicates"
    digits: ClassVar[str] = ".4g"

    @property
    def indices(self) -> dict[str, list[str]]:  # type: ignore[override]
        """{quantity: the axes along which it lies}."""
        return {name: list(self.axes) for name in self.quantities}

    def labelled(self, quantity: str) -> Labelled:
        """Return the arrays of one quantity with their axes.

        Parameters
        ----------
        quantity : str
            Name of the quantity.

        Returns
        -------
        Labelled

        Raises
        ------
        UsageError
            If there is no such quantity.
        """
        unit, text = self.quantities[self.known(quantity)]
        columns = {
            name: Column(tuple(self.axes), values, {
                "units": "1" if name.startswith("n_") else unit,
                "long_name": f"{text}: {MEANINGS[name]}",
            }) for name, values in self.arrays[quantity].items()
        }  # fmt: skip
        return Labelled(self.axes, columns, {self.word: text, "paired": int(self.paired)})

    def table(self, quantity: str | None = None, numerics: bool = False) -> str:
        """Return the differences of one quantity as text.

        Parameters
        ----------
        quantity : str, optional
            Name of the quantity; the first by default.
        numerics : bool
            Add how much each difference would change if all runs were exact. This is also added if
            it exceeds half of the widest interval somewhere.

        Returns
        -------
        str
            A table; a star marks intervals, including the numerical error, that do not contain 0.
        """
        quantity = self.known(quantity)
        unit, text = self.quantities[quantity]
        arrays = self.arrays[quantity]
        width = arrays["difference_high"] - arrays["difference_low"]
        known = "change_low" in arrays
        error = np.maximum(-arrays["change_low"], arrays["change_high"]) if known else np.zeros(1)
        shown = known and (numerics or bool(np.any(error > 0.5 * np.nanmax(width, initial=0.0))))

        def row(place: tuple[int, ...]) -> Sequence[str]:
            at = {name: float(values[place]) for name, values in arrays.items()}
            values = (f"{at[name]:{self.digits}}" for name in ("first", "second"))
            added = [f"{at['change_low']:+.3f} {at['change_high']:+.3f}"] if shown else []
            n = f"{at['n_first']:.0f}/{at['n_second']:.0f}"
            return n, *values, self.interval(at), *added, self.star(at)

        axes = {with_unit(k, each.about["units"]): each.values for k, each in self.axes.items()}
        heads = "n", "first", "second", "difference [low, high]", *["numerics"] * shown, ""
        both = f"the {self.pairs} {self.noun} that both have, paired"
        how = both if self.paired else "independent samples"
        title = f"{with_unit(text, unit)}, second minus first: {how}"
        rows = rows_along(axes, heads, row)
        lines = [*self.changes, title, "", *aligned(rows), "[low, high]: 95 % sampling interval."]
        if known and np.isfinite(error).any():
            most = f"±{np.nanmax(error):.3f} at most in any condition (95 %)"
            lines.append(f"Numerical error: exact runs would change a difference by {most}.")
        stars = f"{sum(cells[-1] == '*' for cells in rows)} of {len(rows) - 1} differences"
        lines.append(f"{stars} are significant (*), numerical error included; by chance 1 in 20.")
        return "\n".join(lines)

    def interval(self, at: Mapping[str, float]) -> str:
        """Return "+0.030 [+0.010, +0.050]" of the MEANINGS of a difference, or "–"."""
        if np.isnan(at["difference"]):
            return "–"
        form = f"+{self.digits}"
        low, high = at["difference_low"], at["difference_high"]
        return f"{at['difference']:{form}} [{low:{form}}, {high:{form}}]"

    def star(self, at: Mapping[str, float]) -> str:
        """Return "*" where 0 is outside the interval and what numerics may add to it, else ""."""
        low, high = (
            at[f"difference{end}"] + float(np.nan_to_num(at.get(f"change{end}", 0.0)))
            for end in ("_low", "_high")
        )
        return "*" if low > 0.0 or high < 0.0 else ""


def stored_in(results: Any, name: str = "identity") -> dict[str, Any]:
    """What the group ``run`` of results has as JSON, by default what their rows follow from;
    FileError where nobody can read it."""
    try:
        found: dict[str, Any] = stored(results.run, name)
        return found
    except ValueError as error:
        where = getattr(results, "path", "a file")
        raise FileError(f"{where} has no readable results: {error}") from error


def changes_between(first: Any, second: Any) -> tuple[str, ...]:
    """Lines on what the studies of two files differ in."""
    from flocsim.ensembles.storage.identity import differences  # which needs the engine

    lines = differences(*map(stored_in, (first, second)))
    return tuple(
        line.replace(" in the file, ", " in the first, ").replace(" now", " in the second")
        for line in lines
    )


def common(ours: Any, theirs: Any, axis: str) -> list:
    """The values of an axis that both have, in the order of the first; UsageError for none."""
    ours, theirs = (np.asarray(each).tolist() for each in (ours, theirs))
    both = [value for value in ours if value in theirs]
    if not both:
        raise UsageError(
            f"the two files have no {axis} in common: {', '.join(map(str, ours))} and "
            f"{', '.join(map(str, theirs))}"
        )
    return both


def compare(first: Any, second: Any) -> Differences:
    """Compare two results, over the conditions (of swarms, the times) that both have.

    Parameters
    ----------
    first, second : StudyResults or SwarmResults
        Results of the same kind of study.

    Returns
    -------
    Comparison or SwarmComparison
        Differences, second minus first, with 95 % intervals. Replicates are paired if both studies
        drew the same ones, that is, have the same seed.

    Raises
    ------
    UsageError
        If they have no condition in common, or are of two kinds.
    """
    name, other = (getattr(each, "format", "") for each in (first, second))
    if name != other or name not in STUDIES or contents_of(name).compare is None:
        words = " and ".join(type(each).__name__ for each in (first, second))
        able = ", or ".join(f"two {each.title}" for each in studies() if each.compare)
        raise UsageError(f"{able} can be compared: found {words}")
    found: Differences = contents_of(name).compare(first, second)
    differences = [each["difference"] for each in found.arrays.values()]
    if not found.paired or found.changes or np.any(np.nan_to_num(differences)):
        return found
    # Of a study and itself all is known exactly.
    exact = ("difference_low", "difference_high", "change_low", "change_high")
    arrays = {
        quantity: {k: each["difference"] if k in exact else v for k, v in each.items()}
        for quantity, each in found.arrays.items()
    }
    same = "Both files hold the same replicates of one study."
    return attrs.evolve(found, arrays=arrays, changes=(same,))

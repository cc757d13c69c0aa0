"""One study at several values of its keys, joined in one file with the swept keys as dimensions.

Every value is a part: a study with a results file and an identity of its own, in a folder beside
the joined file, NAME.parts. The identities are known before the first part is run, and a part is
joined only if its file has just this one. So a sweep that was stopped goes on there, and a cluster
may fill it by `flocsim ensemble`.
"""

import itertools
import json
import os
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from flocsim.ensembles.config.schema import TABLES, TOP_KEYS, Config, keys_of
from flocsim.ensembles.contents import (
    Contents,
    Figures,
    Summary,
    open_any,
    stored_in,
    studies,
)
from flocsim.ensembles.kind import ORDER, flocs_of, study_of
from flocsim.ensembles.script_study import Study
from flocsim.ensembles.storage.identity import differences, identity_of
from flocsim.ensembles.storage.resume import WAYS
from flocsim.errors import UsageError
from flocsim.fields import is_number
from flocsim.io.files import Rule, make_folder
from flocsim.io.labelled import Column, Labelled
from flocsim.io.outputs import check_outputs
from flocsim.io.results.run_group import SOURCE
from flocsim.io.results.schema import AXES
from flocsim.io.results.sweep_file import SweepResults, Swept, read_sweep, write_sweep
from flocsim.io.seals import held
from flocsim.io.terminal import in_words, rows_along

Facts = dict[str, Any]

FIXED = ("seed", "scene.types", "scene.pairs", "scene.classes", "scene.delta", "shapes.vertices")
NO_PHYSICS = ("output", "stop")
"""Keys, and tables, that cannot be swept: they are dimensions already, or no physics."""


def sweep(
    study: Study, over: Mapping[str, Sequence], output: str | os.PathLike, *, jobs: int = 1,
    mode: str = "new", overwrite: bool = False, quiet: bool = True,
    tell: Callable[[str], object] = lambda line: None,
) -> SweepResults:  # fmt: skip
    """Run a study at every value of some keys, and join the results in one file.

    Parameters
    ----------
    study : Study
        The study; all values share its seed, so that replicates are paired.
    over : mapping of str to sequence
        {dotted key: values}; several keys make a grid.
    output : path
        Joined results file.
    jobs : int
        Number of processes on this machine.
    mode : "new" or "resume"
        "resume" continues, extends or reuses existing parts, as `Study.run` does.
    overwrite : bool
        Whether to rename an existing file instead of raising UsageError.
    quiet : bool
        False prints what the command prints.
    tell : callable
        Function that receives a line of text for each part.

    Returns
    -------
    SweepResults

    Raises
    ------
    UsageError
        If a key is unknown, a value does not fit, a file is in the way, or a part belongs to
        another study.
    """
    output = Path(output)
    parts = planned(study, over, output)
    swept = swept_keys(over, [part.config for part in parts.values()])
    wanted = wanted_of(parts)
    rule: Rule = overwrite
    if mode == "resume" and output.exists():
        for name, each in read_joined(output).swept.items():
            if name not in swept or not set(each.values) <= set(swept[name].values):
                raise UsageError(
                    f"{output} has other values of {each.key}: ask for these too, or name another "
                    "file"
                )
        rule = held(output)
    check_outputs([output], rule, [study.path], WAYS)
    make_folder(next(iter(parts)).parent)
    # A part that is whole already is taken as it is; any other is run as a study of its own.
    found = []
    for number, (path, part) in enumerate(parts.items(), 1):
        tell(f"{number} of {len(parts)}: {path}")
        there = open_any(path) if mode == "resume" and os.path.lexists(path) else None
        if there is None or unlike(there, *wanted[path]):
            part.run(jobs, output=path, mode=mode, overwrite=overwrite, quiet=quiet)
            there = open_any(path)
            ends_early = part.config.stop.half_width is not None
            if line := unlike(there, *wanted[path], ends_early):
                raise UsageError(
                    f"{path} is not the study that the sweep began with: {line}; undo that, and "
                    "resume with --overwrite, which keeps it under another name"
                )
        found.append(there)
    shared = {name: {str(each.run.get(name, "")) for each in found} for name in SOURCE}
    source = {name: words.pop() for name, words in shared.items() if len(words) == 1}
    results = SweepResults(output, swept, joined(swept, found), source)
    write_sweep(results, rule)
    return results


def unlike(results: Any, identity: Facts, asked: Facts, ends_early: bool = False) -> str:
    """Return what keeps results from being a whole part of this identity, with what was asked for;
    "" for nothing. A rule may have ended it early, with fewer replicates."""
    if (kind := joined_of(results)) is None:
        return "it is of another kind"
    if lines := differences(stored_in(results), identity):
        return lines[0]
    # What was asked for, as far as the axes of the results say it; types of swarms are all alike.
    axes = results.labelled(kind.swept[0]).axes
    has = {k: axes[v].values.tolist() for k, v in zip(ORDER, AXES, strict=True) if v in axes}
    alone = axes.get("replicate")
    has["replicates"] = results.count if alone is None else len(alone.values)
    for name, there in has.items():
        here = asked[name]
        if there != here and not (ends_early and name == "replicates" and there < here):
            return f"{name} are {listed(there)} in the file, {listed(here)} now"
    return ""


def listed(values: Any) -> str:
    """Return one value, or several, as text."""
    return ", ".join(map(in_words, np.ravel(values).tolist()))


def planned(study: Study, over: Mapping[str, Sequence], output: Path) -> dict[Path, Study]:
    """Return {its results file: Study} of every value; UsageError for keys that cannot be swept."""
    values = {key: list(each) for key, each in over.items()}
    if not values or not all(values.values()):
        raise UsageError("a sweep needs at least one key and one value: --over KEY=VALUE,VALUE")
    for key in values:
        if key in FIXED or key.split(".")[0] in NO_PHYSICS:
            raise UsageError(f"{key} cannot be swept: it is a dimension already, or not physics")
    folder = output.with_name(f"{output.stem}.parts")
    return {
        folder / f"{number:04d}.h5": study.with_(dict(zip(values, point, strict=True)))
        for number, point in enumerate(itertools.product(*values.values()))
    }


def wanted_of(parts: Mapping[Path, Study]) -> dict[Path, tuple[Facts, Facts]]:
    """Return (identity, what was asked for) of each part; UsageError where they differ in an axis
    and could not be joined.

    All of the study's modules and libraries were read once, for all parts (`Study.with_`).
    """
    found: dict[Path, tuple[Facts, Facts]] = {}
    first: Facts = {}
    drawn: tuple[Any, list] = None, []
    for path, part in parts.items():
        config = part.config
        if drawn[0] != (config.shapes, config.seed):
            drawn = (config.shapes, config.seed), flocs_of(config)
        study = study_of(config, drawn[1])
        asked = json.loads(json.dumps(study.asked()))
        found[path], first = (identity_of(study), asked), first or asked
        for axis in study.in_common:
            if (there := first[axis]) != (here := asked[axis]):
                raise UsageError(
                    f"the parts of a sweep cannot be joined: {axis} are {listed(there)} in the "
                    f"first, {listed(here)} in {path}; run them one by one"
                )
    return found


def swept_keys(over: Mapping[str, Sequence], configs: Sequence[Config]) -> dict[str, Swept]:
    """Return {name of the dimension: Swept}: the key's last part, or all of it where two are alike.

    Values are those that the configs have, in SI, where they are numbers; else as they were given.
    """
    lasts = [key.rpartition(".")[2] for key in over]
    lengths = [len(values) for values in over.values()]
    groups = (group for each in kinds_joined() for group in each.file.groups.values())
    taken = {axis for group in groups for axis in group.index}
    swept = {}
    for axis, (key, last) in enumerate(zip(over, lasts, strict=True)):
        clash = lasts.count(last) > 1 or last in taken
        name = key.replace(".", "_") if clash else last
        stride = int(np.prod(lengths[axis + 1 :]))
        found = [value_of(configs[stride * place], key) for place in range(lengths[axis])]
        values = [value for value, _ in found]
        if not all(map(is_number, values)):
            values = [str(each) for each in list(over[key])]
        if len(set(values)) < len(values):
            raise UsageError(f"{key} has the same value twice: {', '.join(map(str, over[key]))}")
        swept[name] = Swept(key, values, found[0][1])
    return swept


def value_of(config: Config, key: str) -> tuple[Any, str]:
    """Return (value, unit) of a dotted key of a config; (None, "1") where it has none by itself."""
    table, *rest = key.split(".")
    owner: Any = config
    if table == "forces" and rest and rest[0] in config.force_names:
        owner = config.forces[config.force_names.index(rest[0])]
        rest = rest[1:]
    elif table in TABLES:
        owner = getattr(config, table)
    elif table in TOP_KEYS:
        rest = [table]
    field = keys_of(type(owner)).get(rest[0]) if len(rest) == 1 else None
    if field is None:
        return None, "1"
    unit = getattr(field.metadata.get("reader"), "unit", "")
    return getattr(owner, field.name, None), unit or "1"


def joined(swept: dict[str, Swept], parts: Sequence[Any]) -> dict[str, Labelled]:
    """Return the groups of all parts, stacked along the swept keys as first axes."""
    kind = joined_of(parts[0])
    assert kind is not None, "results of a kind that sweeps can run"
    lengths = [len(each.values) for each in swept.values()]
    coordinates = {name: each.column(name) for name, each in swept.items()}
    found = {}
    for group in kind.swept:
        labelled = [each.labelled(group) for each in parts]

        def stacked(kind, name, labelled=labelled):
            columns = [getattr(each, kind)[name] for each in labelled]
            values = np.stack([each.values for each in columns])
            shape = (*lengths, *columns[0].values.shape)
            return Column((*swept, *columns[0].axes), values.reshape(shape), columns[0].about)

        columns = {name: stacked("columns", name) for name in labelled[0].columns}
        # Sizes, which are no axes, may follow from what is swept, as from limits of measured flocs.
        axes = {
            name: each if each.axes == (name,) else stacked("axes", name)
            for name, each in labelled[0].axes.items()
        }
        found[group] = Labelled(coordinates | axes, columns)
    return found


def kinds_joined() -> list[Contents]:
    """Return the kinds of studies that sweeps can run."""
    return [each for each in studies() if each.swept]


def joined_of(results: Any) -> Contents | None:
    """Return the kind of results; None for one that sweeps cannot run."""
    name = getattr(results, "format", "")
    return next((each for each in kinds_joined() if each.file.name == name), None)


def read_joined(path: str | os.PathLike) -> SweepResults:
    """The SweepResults in a joined file; FileError for one that is absent, damaged, of another kind
    or version."""
    return read_sweep(path, [(each.file, each.swept) for each in kinds_joined()])


class SweepFiles(Contents):
    """What commands show of the joined file of a sweep."""

    title = "a sweep"
    read = staticmethod(read_joined)

    def summary(self, found: SweepResults) -> Summary:
        """Return the swept keys, by the names of their dimensions, and their values."""
        return Summary([
            (f"{each.key} (as {name})", f"{listed(each.values)} {each.unit}".removesuffix(" 1"))
            for name, each in found.swept.items()
        ])  # fmt: skip

    def answer(self, found: SweepResults) -> str:
        """Return what was swept."""
        keys = " and ".join(each.key for each in found.swept.values())
        return f"How outcomes depend on {keys}."

    def rows(self, found: SweepResults) -> list[list[str]]:
        """Return numbers at every value."""
        kind = next(each for each in kinds_joined() if {*each.swept} == found.groups.keys())
        table = found.labelled(kind.swept[0])
        axes = {
            name: table.axes[name].values for name in table.shared_axes
            if name not in ("replicate", "time")
        }  # fmt: skip
        return rows_along(axes, *kind.swept_table(table))

    def counts(self, found: SweepResults) -> Sequence[int]:
        """Return the numbers of replicates of all conditions, or of swarms of all values."""
        table = found.labelled(next(iter(found.groups)))
        if "n_total" not in table.columns:
            return (len(table.axes["replicate"].values),)
        numbers: list[int] = table.columns["n_total"].values.ravel().tolist()
        return numbers

    def figures(self, found: SweepResults) -> Figures:
        """Return figures along a swept key."""
        from flocsim.io.plots.curves import SWEEP_FIGURES

        return SWEEP_FIGURES.get(next(iter(found.groups)), {})


CONTENTS = SweepFiles()

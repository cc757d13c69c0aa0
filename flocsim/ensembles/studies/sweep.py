"""One study at several values of its keys, joined in one file with the swept keys as dimensions.

Every value has a results file of its own in a folder beside the joined one, NAME.parts: a sweep
that was stopped goes on there, and a cluster may fill it by `flocsim ensemble`.
"""

import itertools
import os
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from flocsim.ensembles.config.schema import TABLES, TOP_KEYS, Config, keys_of
from flocsim.ensembles.studies.opened import GROUPS, StudyResults, open_results
from flocsim.ensembles.studies.study import WAYS, Study
from flocsim.errors import FileError, UsageError
from flocsim.fields import is_number
from flocsim.io.files import held
from flocsim.io.labelled import Column, DataFrame, Dataset, Labelled
from flocsim.io.opening import kind_of
from flocsim.io.outputs import Output, check_outputs, data_rule, extension_rule
from flocsim.io.results.schema import RADII
from flocsim.io.results.swarm_file import FORMAT as SWARM_FORMAT
from flocsim.io.results.swarm_file import SwarmResults, read_swarm
from flocsim.io.results.sweep_file import FORMAT, Swept, read_sweep, write_sweep

JOINED = ("probabilities", "pooled")
"""The groups of the parts that are joined; the rows stay in the parts."""

MOST_PARTS = 10_000
FIXED = (
    "seed", "output.file", "scene.types", "scene.pairs", "scene.classes", "scene.delta",
    "shapes.vertices",
)  # fmt: skip
"""Keys that are no dimension of a sweep: they are dimensions already, or no physics."""


class SweepResults:
    """A joined file as `flocsim.open` gives it; ``swept`` {dimension: Swept} are its keys."""

    def __init__(self, path: Path, swept: dict[str, Swept], groups: dict[str, Labelled]) -> None:
        self.path, self.swept, self.groups = path, swept, groups

    def labelled(self, group: str) -> Labelled:
        """The arrays of a group; UsageError for an unknown one."""
        if group not in self.groups:
            raise UsageError(f"group must be one of {', '.join(self.groups)}, found {group!r}")
        return self.groups[group]

    def to_xarray(self, group: str = "probabilities") -> Dataset:
        """A group, "probabilities" or "pooled", with the swept keys as its first dimensions."""
        return self.labelled(group).to_xarray()

    def to_pandas(self, group: str = "probabilities") -> DataFrame:
        """The same as a DataFrame, a row for each value and condition."""
        return self.labelled(group).to_pandas((*self.swept, *GROUPS[group][1]))

    def __repr__(self) -> str:
        over = ", ".join(f"{each.key}: {len(each.values)} values" for each in self.swept.values())
        return f"SweepResults({str(self.path)!r}: {over})"


def sweep(
    study: Study, over: Mapping[str, Sequence], output: str | os.PathLike, *, jobs: int = 1,
    mode: str = "new", overwrite: bool = False, quiet: bool = True,
    tell: Callable[[str], object] = lambda line: None, ways: str = WAYS,
) -> SweepResults:  # fmt: skip
    """Run a Study at every value of some keys, and join the results in the file ``output``.

    ``over``: {dotted key: values}; several keys make a grid. ``mode`` "resume" goes on with what is
    there, extends it, or takes it as it is, as Study.run does with each part; ``tell`` is given a
    line for each; ``ways``: what to say where a file is in the way. All values have the study's
    seed: what differs between them is paired. UsageError for a key that is none, a value that does
    not fit, or a file in the way.
    """
    parts = planned(study, over, Path(output))
    rule = data_rule(overwrite)
    if mode == "resume" and Path(output).exists():
        read_sweep(Path(output))  # what is replaced has to be a sweep
        rule = extension_rule(output)
    check_outputs([Output(output, rule, ways=ways)], [study.path])
    folder = parts_folder(Path(output))
    try:
        folder.mkdir(exist_ok=True)
    except OSError as error:
        raise FileError(f"{folder} could not be made: {error.strerror}") from error
    found = []
    for number, (path, part) in enumerate(parts, 1):
        tell(f"{number} of {len(parts)}: {path}")
        found.append(part.run(jobs, output=path, mode=mode, overwrite=overwrite, quiet=quiet))
    swept = swept_keys(over, [part.config for _, part in parts])
    write_sweep(Path(output), swept, joined(swept, found), rule)
    return open_sweep(output)


def parts_folder(output: Path) -> Path:
    """Where the results of the single values lie."""
    return output.with_name(f"{output.stem}.parts")


def planned(study: Study, over: Mapping[str, Sequence], output: Path) -> list[tuple[Path, Study]]:
    """(its results file, Study) of every value; UsageError for keys that cannot be swept."""
    values = {key: list(each) for key, each in over.items()}
    if not values or not all(values.values()):
        raise UsageError("a sweep is over at least one key and one value: --over KEY=VALUE,VALUE")
    if int(np.prod([len(each) for each in values.values()], dtype=object)) > MOST_PARTS:
        raise UsageError(f"a sweep has at most {MOST_PARTS} values")
    for key in values:
        if key in FIXED or key.split(".")[0] == "output":
            raise UsageError(f"{key} cannot be swept: it is a dimension already, or no physics")
    folder = parts_folder(output)
    found = []
    for number, point in enumerate(itertools.product(*values.values())):
        part = study.with_(dict(zip(values, point, strict=True)))
        found.append((folder / f"{number:04d}.h5", part))
    return found


def swept_keys(over: Mapping[str, Sequence], configs: Sequence[Config]) -> dict[str, Swept]:
    """{name of the dimension: Swept}: the key's last part, or all of it where two are alike.

    Values are those that the configs have, in SI, where they are numbers; else as they were given.
    """
    lasts = [key.rpartition(".")[2] for key in over]
    lengths = [len(values) for values in over.values()]
    swept = {}
    for axis, (key, last) in enumerate(zip(over, lasts, strict=True)):
        clash = lasts.count(last) > 1 or any(last in axes for _, axes in GROUPS.values())
        name = key.replace(".", "_") if clash else last
        stride = int(np.prod(lengths[axis + 1 :]))
        found = [value_of(configs[stride * place], key) for place in range(lengths[axis])]
        values = [value for value, _ in found]
        if not all(map(is_number, values)):
            values = [str(each) for each in list(over[key])]
        if len(set(values)) < len(values):
            raise UsageError(f"{key} has one value twice: {', '.join(map(str, over[key]))}")
        swept[name] = Swept(key, values, found[0][1])
    return swept


def value_of(config: Config, key: str) -> tuple[Any, str]:
    """(value, unit) of a dotted key in a config; (None, "1") where it has none by itself."""
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
    return getattr(owner, field.name, None), field.metadata.get("unit") or "1"


def joined(swept: dict[str, Swept], parts: Sequence[StudyResults]) -> dict[str, Labelled]:
    """The groups of all parts with the swept keys as first axes."""
    lengths = [len(each.values) for each in swept.values()]
    coordinates = {name: each.column(name) for name, each in swept.items()}
    found = {}
    for group in JOINED:
        labelled = [each.labelled(group) for each in parts]

        def stacked(kind, name, labelled=labelled):
            columns = [getattr(each, kind)[name] for each in labelled]
            values = np.stack([each.values for each in columns])
            shape = (*lengths, *columns[0].values.shape)
            return Column((*swept, *columns[0].axes), values.reshape(shape), columns[0].about)

        columns = {name: stacked("columns", name) for name in labelled[0].columns}
        # Sizes may follow from what is swept, as from the limits of measured flocs.
        axes = labelled[0].axes | {name: stacked("axes", name) for name in RADII}
        found[group] = Labelled(coordinates | axes, columns)
    return found


def open_sweep(path: str | os.PathLike) -> SweepResults:
    """The SweepResults in a joined file; FileError for one that is absent, damaged or none."""
    swept, groups = read_sweep(path)
    return SweepResults(Path(path), swept, groups)


def open_any(
    path: str | os.PathLike, folder: str | os.PathLike | None = None
) -> StudyResults | SweepResults | SwarmResults:
    """What a file of `flocsim ensemble`, `flocsim swarm` or `flocsim sweep` holds, checked.

    ``folder``: where the config of a study lay, its shape library and its own modules (default:
    where the results lie). FileError for a file that is absent, damaged, or of another kind.
    """
    source = held(path)
    kind = kind_of(source)
    if kind == SWARM_FORMAT:
        return read_swarm(source)
    return open_sweep(source) if kind == FORMAT else open_results(source, folder)

"""Which parameter matters: elasticities of Pr[A], one parameter at a time on the same draws."""

import math
import os
from collections.abc import Callable, Sequence
from pathlib import Path

import attrs
import numpy as np

from flocsim.ensembles.pairs.comparison import Comparison, compare, with_change
from flocsim.ensembles.pairs.opened import open_results
from flocsim.ensembles.studies.study import WAYS, Study
from flocsim.ensembles.studies.sweep import parts_folder, sweep, value_of
from flocsim.errors import UsageError
from flocsim.fields import is_number
from flocsim.io.terminal import aligned

RATIO = 2.0
"""Of the larger to the smaller value of a parameter."""


@attrs.frozen(eq=False)
class Elasticities:
    """dPr[A]/d ln p of parameters: ``keys`` and their ``values`` (SI); ``ratio`` of the larger to
    the smaller value that was run, the geometric mean of which is the value; ``types``,
    ``vertices``, ``delta`` the conditions; ``value``, ``low``, ``high`` (key, type, vertices,
    delta), the 95 % interval paired; ``change_low``, ``change_high`` what numerics change."""

    keys: tuple[str, ...]
    values: tuple[float, ...]
    ratio: float
    types: tuple[str, ...]
    vertices: np.ndarray
    delta: np.ndarray
    value: np.ndarray
    low: np.ndarray
    high: np.ndarray
    change_low: np.ndarray
    change_high: np.ndarray

    def matters(self, place: tuple[int, ...]) -> bool:
        """Whether 0 is outside the interval, numerics included."""
        return self.words(place).endswith("*")

    def words(self, place: tuple[int, ...]) -> str:
        """The interval of sampling, and what numerics change."""
        ends = self.low, self.high, self.change_low, self.change_high
        return with_change(*(float(each[place]) for each in ends))

    def table(self) -> str:
        """A row for each parameter and condition; a star where 0 is outside the interval."""
        rows = [("parameter", "at", "type", "N", "delta", "dPr[A]/dln p", "[95 %] numerics")]
        for place in np.ndindex(self.value.shape):
            k, t, v, d = place
            names = (self.keys[k], f"{self.values[k]:g}", self.types[t], str(self.vertices[v]),
                     f"{self.delta[d]:g}")  # fmt: skip
            value = float(self.value[place])
            known = not math.isnan(value)
            rows.append((*names, *((f"{value:+.3f}", self.words(place)) if known else ("-", "-"))))
        return "\n".join(aligned(rows))


def elasticities(
    study: Study, keys: Sequence[str], output: str | os.PathLike, *, ratio: float = RATIO,
    jobs: int = 1, mode: str = "new", overwrite: bool = False, quiet: bool = True,
    tell: Callable[[str], object] = lambda line: None, ways: str = WAYS,
) -> Elasticities:  # fmt: skip
    """Run a Study of pairs with each parameter multiplied by √ratio and divided by it.

    The difference of Pr[A] over ln ratio, replicate by replicate on the same draws, by Newcombe's
    paired interval. Each parameter is a sweep of two values, in a file ``output`` with its key
    behind the name; ``mode`` and others as in `sweep`. UsageError for a key without a number above
    0, for swarms, and as `sweep` raises it.
    """
    if not ratio > 1.0 or not math.isfinite(ratio):
        raise UsageError(f"the ratio of an elasticity must be above 1 and finite, found {ratio:g}")
    if not keys or len(set(keys)) < len(keys):
        raise UsageError("give at least one key, each only once, for elasticities")
    if study.config.scene.kind != "binary":
        raise UsageError("elasticities are for probabilities of pairs: sweep the key instead")
    values = [number_of(study, key) for key in keys]
    found: list[Comparison] = []
    for key, value in zip(keys, values, strict=True):
        path = Path(output).with_name(f"{Path(output).stem}-{key.replace('.', '-')}.h5")
        both = [value / math.sqrt(ratio), value * math.sqrt(ratio)]
        sweep(study, {key: both}, path, jobs=jobs, mode=mode, overwrite=overwrite, quiet=quiet,
              tell=tell, ways=ways)  # fmt: skip
        ends = (parts_folder(path) / f"{number:04d}.h5" for number in (0, 1))
        found.append(compare(*(open_results(each, study.path.parent) for each in ends)))
    arrays = {
        name: np.stack([each.arrays["pr_a"][column] for each in found]) / math.log(ratio)
        for name, column in COLUMNS.items()
    }
    axes = found[0]
    return Elasticities(tuple(keys), tuple(values), ratio, axes.types, axes.vertices, axes.delta,
                        **arrays)  # fmt: skip


COLUMNS = {
    "value": "difference", "low": "difference_low", "high": "difference_high",
    "change_low": "change_low", "change_high": "change_high",
}  # fmt: skip


def number_of(study: Study, key: str) -> float:
    """The value of a parameter (SI); UsageError where it is not a number above 0."""
    value, _ = value_of(study.config, key)
    if not is_number(value) or not value > 0.0:
        raise UsageError(
            f"{key} has no elasticity: its value is {value!r}; name a key whose value is a number "
            "above 0 in the config, or sweep it"
        )
    return float(value)

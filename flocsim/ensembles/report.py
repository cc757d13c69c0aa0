"""The table of a study for the terminal."""

import itertools
from collections.abc import Callable, Mapping

import numpy as np

from flocsim.errors import FlocsimError
from flocsim.io.confidence import efficiency, wilson
from flocsim.io.results.events import FEW, HOOK, MOST_UNKNOWN, events_of
from flocsim.io.results.kernel_group import ESTIMATES, Kernel
from flocsim.io.results.run_group import describe_note, stored
from flocsim.io.results.schema import CLASSES, Results
from flocsim.io.terminal import aligned
from flocsim.process import WITHHELD

OTHER = ("missed", "held", "undecided", "failed")
"""Outcomes that stand together in the column "other"."""

FURTHER = ("collided", "inside", *OTHER)
"""Counts that have columns of their own only where all are asked for."""

LEGEND = (
    "A, B: contact inside the zone, then stick, part; C, D: the same outside; Pr[A]: A + C of all.",
    "[low, high]: 95 % sampling interval; –: no pair touched; other: no contact, or no outcome.",
)
"""Lines below a table of probabilities."""


def format_table(results: Results, numerics: bool, every: bool = False) -> str:
    """Return counts and probabilities with 95 % intervals, one row per condition, a block per type.

    Parameters
    ----------
    results : Results
    numerics : bool
        Add the change of each probability if all replicates were run exactly (95 %).
    every : bool
        Add the fraction of A and C that hang by their shapes (the others stick), and all counts.

    Returns
    -------
    str
        Lines of up to 100 characters, unless columns are added; without a final line end.
    """
    columns = columns_of(results, numerics, every)
    conditions = list(np.ndindex(results.shape))
    lines = aligned([[*columns], *([cell(at) for cell in columns.values()] for at in conditions)])
    found = lines[:1]
    for (t, *first), line in zip(conditions, lines[1:], strict=True):
        found += [line] if any(first) else [f"type {type_in_words(results, t)}", line]
    return "\n".join([*found, *LEGEND, *[GRAZE] * (1.0 in results.delta)])


def type_in_words(results: Results, t: int) -> str:
    """Return "I: r_i = 16.41 µm, r_j = 23.02 µm", or the name alone where radii are not fixed."""
    radii = {name: 1e6 * float(values[t]) for name, values in results.radii.items()}
    known = ", ".join(f"{name} = {radius:.4g} µm" for name, radius in radii.items() if radius > 0.0)
    return f"{results.types[t]}: {known}" if known else results.types[t]


def columns_of(
    results: Results, numerics: bool, every: bool
) -> dict[str, Callable[[tuple[int, ...]], str]]:
    """Return {head of a column: (index of a condition) → its cell}."""
    table, changes, outlines = results.probabilities, results.numerics, results.outlines
    found: dict[str, Callable[[tuple[int, ...]], str]] = {
        "N": lambda at: str(results.vertices[at[1]]),
        "δ": lambda at: f"{results.delta[at[2]]:g}",
        "n": lambda at: str(table["n_total"][at]),
    }

    def interval(name: str) -> Callable[[tuple[int, ...]], str]:
        ends = [table[name + end] for end in ("", "_low", "_high")]
        return lambda at: with_interval(*(each[at] for each in ends))

    def change(group: Mapping[str, np.ndarray], name: str) -> Callable[[tuple[int, ...]], str]:
        return lambda at: between(group[f"{name}_low"][at], group[f"{name}_high"][at])

    def count(name: str, *of_class: int) -> Callable[[tuple[int, ...]], str]:
        return lambda at: str(table[f"n_{name}"][(*at, *of_class)])

    for name, head in (("pr_inside", "Pr[inside]"), ("pr_a", "Pr[A]")):
        found[f"{head} [low, high]"] = interval(name)
        if numerics and changes:
            found[f"numerics {head}"] = change(changes, f"{name}_change")
    if outlines:
        found["outlines Pr[A]"] = change(outlines, "pr_a_shape")
    found |= {name: count("class", k) for k, name in enumerate(CLASSES)}
    if not every:
        return found | {"other": lambda at: others(table, at)}
    found["hang"] = lambda at: number(table["pr_bond"][(*at, HOOK - 1)])
    return found | {name: count(name) for name in FURTHER}


def others(table: Mapping[str, np.ndarray], at: tuple[int, ...]) -> str:
    """Return "3 missed, 2 held"; 0 for none."""
    counts = {name: int(table[f"n_{name}"][at]) for name in OTHER}
    return ", ".join(f"{count} {name}" for name, count in counts.items() if count) or "0"


GRAZE = "δ = 1: outlines just graze, or miss, by construction; it says little about collisions."


def efficiency_lines(results: Results) -> list[str]:
    """Return a table of efficiencies with their 95 % intervals: the aggregations per approach
    integrated over delta; none where it does not reach from 0 to 1."""
    known = [efficiency(results.probabilities, results.delta, axial) for axial in (False, True)]
    if None in known:
        return []
    found = np.array(known)  # (planar or axial, value or end, type, vertices)
    rows = [
        [results.types[t], str(results.vertices[v]),
         *(with_interval(value[t, v], low[t, v], high[t, v]) for value, low, high in found)]
        for t, v in np.ndindex(results.shape[:2]) if np.isfinite(found[0, 0, t, v])
    ]  # fmt: skip
    heads = ["type", "N", "planar [low, high]", "axial [low, high]"]
    about = "Efficiency: fraction of approaches that aggregate, over δ (planar) or δ² (axial)."
    return ["", *aligned([heads, *rows]), about] if rows else []


RECTILINEAR = (
    "upper bounds: bodies approach along straight paths, or along those of the flow, because the "
    "water displaced by one does not move the other (no hydrodynamic interaction)"
)
"""What is to be known of all widths and kernels."""

IN_WATER = "for the effect of the water on equivalent spheres: flocsim info FILE --water"
"""Where that is to be had."""

KERNEL_HEADER = (
    "i", "j", "W_c [µm]", "W_a [µm]", "α [low, high]", "β₂ [m²/s]", "β₃ [m³/s] [low, high]", "E₃",
)  # fmt: skip
KERNEL_LEGEND = (
    "i, j: size classes; W_c, W_a: capture widths of pairs that touch, that aggregate; α: those "
    "that",
    "aggregate of those that touch; β₂, β₃: kernels in the plane, in space; E₃: β₃ over that of "
    "spheres",
    "that aggregate wherever straight paths touch; [low, high]: 95 % sampling interval.",
)
"""Columns of rates, and lines below their tables."""


def kernel_lines(kernel: Kernel, numerics: bool) -> list[str]:
    """Return the rates of a kernel study as tables of text: one for each mechanism and N.

    ``numerics``: add the change of α if all encounters were run exactly.
    """
    lines = [f"capture widths and kernels, {RECTILINEAR}", IN_WATER]
    if kernel.water:
        lines = ["capture widths and kernels, with hydrodynamic interaction"]
    pairs = list(itertools.combinations_with_replacement(range(len(kernel.labels)), 2))
    head = [*KERNEL_HEADER, *["numerics α"] * numerics]
    for m, mechanism in enumerate(kernel.mechanisms):
        for v, count in enumerate(kernel.vertices):
            met = (kernel.arrays["checked"][m, v] >= 0.0) & (kernel.arrays["width_c"][m, v] != 0.0)
            rows = [kernel_row(kernel, (m, v, i, j), numerics) for i, j in pairs if met[i, j]]
            lines += ["", f"{mechanism}, N = {count}", *aligned([head, *rows])]
    edge = np.nanmax(kernel.arrays["edge"], initial=0.0)
    if edge > 0.0:
        lines.append(
            f"warning: up to {100.0 * edge:.2g} % of what aggregates came from the outermost "
            "offsets: attraction may reach farther than was sampled"
        )
    return [*lines, *KERNEL_LEGEND]


def kernel_row(kernel: Kernel, at: tuple[int, ...], numerics: bool) -> list[str]:
    """Return the cells of one pair of size classes."""
    found = {name: float(values[at]) for name, values in kernel.arrays.items()}

    def cell(name: str, form: str = ".3f", scale: float = 1.0, interval: bool = True) -> str:
        value, low, high = (scale * found[name + end] for end in ("", "_low", "_high"))
        return with_interval(value, low, high, form, interval)

    return [
        kernel.labels[at[2]], kernel.labels[at[3]],
        cell("width_c", ".2f", 1e6, False), cell("width_a", ".2f", 1e6, False),
        cell("alpha"), cell("beta2", ".3g", 1.0, False), cell("beta3", ".3g"),
        cell("efficiency3", interval=False),
        *[between(found["alpha_change_low"], found["alpha_change_high"])] * numerics,
    ]  # fmt: skip


def with_interval(
    value: float, low: float, high: float, form: str = ".3f", interval: bool = True
) -> str:
    """Return "0.600 [0.570, 0.631]"; the interval alone where the value is not known, "–" where
    neither is. ``interval``: False for a known value alone."""
    if np.isnan(high):
        return number(value, form)
    ends = f"[{low:{form}}, {high:{form}}]"
    if np.isnan(value):
        return ends
    return f"{value:{form}} {ends}" if interval else f"{value:{form}}"


def number(value: float, form: str = ".3f") -> str:
    """Return a number, or "–" where it is not known."""
    return "–" if np.isnan(value) else f"{value:{form}}"


def between(low: float, high: float) -> str:
    """Return "−0.021 +0.045" of the ends of a change, "–" where they are not known."""
    return "–" if np.isnan(low) else f"{-abs(low):+.3f} {high:+.3f}".replace("-", "−")


def touch_lines(results: Results) -> list[str]:
    """Return what share of the decided pairs of a brownian study touched before they escaped, for
    each type and N; none of other studies. Those that are held apart did not."""
    if not stored(results.run, "equivalent_spheres"):
        return []
    table, lines = results.probabilities, []
    for t, v in np.ndindex(results.shape[:2]):
        names = ("n_collided", "n_missed", "n_held")
        touched, *others = (int(table[name][t, v].sum()) for name in names)
        if decided := touched + sum(others):
            low, high = (float(end) for end in wilson(touched, decided))
            lines.append(
                f"type {results.types[t]}, N = {results.vertices[v]}: {touched / decided:.4f} "
                f"[{low:.4f}, {high:.4f}] touched before they escaped"
            )
    return lines


MOST_UNDECIDED = "most_undecided"
"""Name in the group ``run`` of the share of a condition that may be undecided or failed."""

SCRAMBLES = "scrambles"
"""Name there of how many scrambles of a Sobol sequence replicates are points of; 0 for none."""


def most_undecided(results: Results) -> float:
    """That share; of files that do not say, the default."""
    return float(results.run.get(MOST_UNDECIDED, MOST_UNKNOWN))


def shares_undecided(results: Results) -> np.ndarray:
    """What share of each condition is undecided or failed: of its replicates; of the encounters
    where there are rates."""
    if results.kernel is not None:
        return results.kernel.arrays["undecided"]
    table = results.probabilities
    with np.errstate(invalid="ignore"):
        return (table["n_undecided"] + table["n_failed"]) / table["n_total"]


def too_many_undecided(results: Results) -> bool:
    """Whether more of a condition is undecided or failed than may be, or a rate is left open."""
    if np.any(shares_undecided(results) > most_undecided(results)):
        return True
    if results.kernel is None:
        return False
    arrays = results.kernel.arrays
    return any(
        np.any(np.isnan(arrays[name]) & ~np.isnan(arrays[f"{name}_high"])) for name in ESTIMATES
    )


def verdict(found: Results) -> tuple[int, str]:
    """Return the exit code of a study and what to say of replicates without an outcome, or "".

    An error where not one has come to an outcome, WITHHELD where more of them are undecided than
    may be. Fewer are reported of rates alone.
    """
    table, rates = found.probabilities, found.kernel is not None
    total, failed, undecided = (
        int(table[name].sum()) for name in ("n_total", "n_failed", "n_undecided")
    )
    too_many = too_many_undecided(found)
    if not failed + undecided or not (too_many or rates):
        return 0, ""
    none = failed + undecided == total
    ends = f"{failed} failed and {undecided} are undecided"
    line = f"no replicate has reached an outcome, {ends}"
    if not none:
        largest = 100.0 * np.nanmax(shares_undecided(found), initial=0.0)
        line = f"warning: of {total} {'points' if rates else 'replicates'} {ends}, up to "
        line += f"{largest:.2g} % of {'a pair' if rates else 'a condition'}"
        line += f", more than stop.undecided = {most_undecided(found):g} allows" * too_many
    line += ", so that rates have no estimate" * (too_many and rates)
    if undecided:
        line += ": raise integrator.max_steps or scene.time_limit, for another output"
    notes = stored(found.run, "failed")
    line += f"; the first: {describe_note(notes[0])}" if notes else ""
    return FlocsimError.exit_code if none else WITHHELD * too_many, line


def numerics_line(results: Results) -> str:
    """Return the numerical error of a study in one line."""
    table = results.probabilities
    checked, flipped = (int(table[name].sum()) for name in ("n_checked", "n_flipped"))
    if not checked:
        return "Numerical error: not known, as no replicate was run again."
    line = f"Numerical error: {flipped or 'none'} of {checked} re-runs changed its outcome"
    # A single flip counts much where hardly any pair touched.
    errors = table["pr_a_numerical"][events_of(table)["pr_a"].trials >= FEW]
    if not np.isfinite(errors).any():
        return f"{line}."
    most = f"at most ±{np.nanmax(errors):.3f} wherever {FEW} pairs or more touched (95 %)"
    return f"{line}; Pr[A] is uncertain by {most}."


def outlines_line(results: Results) -> str:
    """Return by how much Pr[A] would change with outlines cut otherwise; "" where not known."""
    if not results.outlines or not np.isfinite(results.outlines["pr_a_shape_low"]).any():
        return ""
    least, most = (
        extreme(results.outlines[f"pr_a_shape_{end}"])
        for end, extreme in (("low", np.nanmin), ("high", np.nanmax))
    )
    return (
        "Outlines: cut closer or wider, within their bands, Pr[A] would change by "
        f"{between(least, most).replace(' ', ' to ')} at most in any condition (95 %)."
    )

"""The table of a study for the terminal."""

import itertools
from collections.abc import Callable, Sequence

import numpy as np

from flocsim.errors import FlocsimError
from flocsim.io.confidence import efficiency, wilson
from flocsim.io.results.events import HOOK, MOST_UNKNOWN
from flocsim.io.results.kernel_group import ESTIMATES, Kernel
from flocsim.io.results.run_group import describe_note, stored
from flocsim.io.results.schema import CLASSES, Results
from flocsim.io.terminal import aligned
from flocsim.process import WITHHELD

WIDTH = 110
"""Columns of a wide terminal; the table is set more openly where this leaves room."""

EFFICIENCY = "aggregations per approach over delta, in the plane and axially [95 %]"
"""What the efficiencies are."""


def format_table(results: Results) -> str:
    """Return counts and probabilities with their errors, one row per condition, a block per type.

    Pr +- sampling error (longer side of the 95 % interval) +- numerical error (95 % bound); of a
    study whose outlines were cut closer and wider as well, between what Pr[A] would change by that
    (95 %).

    Plain ASCII apart from the names; up to 110 columns for counts below 1e5; "-" where there was no
    event to estimate a probability from. A line below says of delta = 1 that it grazes. Of the
    aggregations some hang by their shapes, as statics shows, and the others stick. Returns text
    without a final line end.
    """
    conditions = list(np.ndindex(results.shape))
    columns = columns_of(results)
    cells = [[column(place) for column in columns.values()] for place in conditions]
    rows = [*zip(*(head.split("/") for head in columns), strict=True), *cells]
    lines = aligned(rows)
    if len(max(lines, key=len)) > WIDTH:
        lines = aligned(rows, gap=" ")
    found = lines[:2]
    for (t, *first), line in zip(conditions, lines[2:], strict=True):
        found += [line] if any(first) else [f"type {results.types[t]}", line]
    return "\n".join([*found, *graze_lines(results.delta)])


def columns_of(results: Results) -> dict[str, Callable[[tuple[int, ...]], str]]:
    """Return {head of a column, in two lines: (place of a condition) → its cell}."""
    table, outlines = results.probabilities, results.outlines

    def count(name: str, *place_of_class: int) -> Callable[[tuple[int, ...]], str]:
        return lambda place: str(table[name][(*place, *place_of_class)])

    def hanging(place: tuple[int, ...]) -> str:
        value = table["pr_bond"][(*place, HOOK - 1)]
        return "-" if np.isnan(value) else share(value)

    found = {
        "/N": lambda place: str(results.vertices[place[1]]),
        "del-/ta": lambda place: f"{results.delta[place[2]]:g}",
        "/n": count("n_total"),
        "col-/lided": count("n_collided"),
        "in-/side": count("n_inside"),
        "Pr[inside]/95 %  num.": lambda place: with_errors(table, "pr_inside", place),
        "Pr[A]/95 %  num.": lambda place: with_errors(table, "pr_a", place),
    }
    if outlines:
        found["of Pr[A]/shape"] = lambda place: shape_error(outlines, place)
    found["of A/hang"] = hanging
    found |= {f"/{name}": count("n_class", place) for place, name in enumerate(CLASSES)}
    found["mis-/sed"] = count("n_missed")
    if np.any(table["n_held"]):  # it takes colloids that repel each other
        found["/held"] = count("n_held")
    return found | {"unde-/cided": count("n_undecided"), "fail-/ed": count("n_failed")}


GRAZE = "delta 1: by construction the outlines just graze, or miss; it says little about collisions"


def graze_lines(delta: Sequence[float] | np.ndarray) -> list[str]:
    """What to say of a displacement by all of delta_max, where there is one."""
    return [GRAZE] if 1.0 in np.asarray(delta) else []


def efficiency_lines(results: Results) -> list[str]:
    """Return lines on efficiencies with their 95 % intervals: the aggregations per approach
    integrated over delta; none where it does not reach from 0 to 1."""
    table, delta = results.probabilities, results.delta
    planar, axial = efficiency(table, delta, False), efficiency(table, delta, True)
    if planar is None or axial is None:
        return []
    lines = []
    for t, v in np.ndindex(results.shape[:2]):
        if np.isfinite(planar[0][t, v]):
            first, second = (
                f"{e[t, v]:.3f} [{lo[t, v]:.3f}, {hi[t, v]:.3f}]" for e, lo, hi in (planar, axial)
            )
            lines.append(f"type {results.types[t]}, N = {results.vertices[v]}: {first}   {second}")
    return [f"efficiency: {EFFICIENCY}", *lines] if lines else []


RECTILINEAR = (
    "upper bounds: bodies approach along straight paths, or along those of the flow, because the "
    "water displaced by one does not move the other (no hydrodynamic interaction)"
)
"""What is to be known of all widths and kernels."""

IN_WATER = "for the effect of the water on equivalent spheres: flocsim info FILE --water"
"""Where that is to be had."""

KERNEL_HEADER = (
    ("class", "", "width [um]", "", "alpha", "beta2", "beta3 [m3/s]", "over ref."),
    ("i", "j", "touched", "aggregated", "95 %    num.", "[m2/s]", "+- 95 %", "sphere"),
)


def kernel_lines(kernel: Kernel) -> list[str]:
    """Return the rates of a kernel study as tables of text: one for each mechanism and N."""
    lines = [f"capture widths and kernels, {RECTILINEAR}", IN_WATER]
    if kernel.water:
        lines = ["capture widths and kernels, with hydrodynamic interaction"]
    pairs = list(itertools.combinations_with_replacement(range(len(kernel.labels)), 2))
    for m, mechanism in enumerate(kernel.mechanisms):
        for v, count in enumerate(kernel.vertices):
            met = (kernel.arrays["checked"][m, v] >= 0.0) & (kernel.arrays["width_c"][m, v] != 0.0)
            rows = [kernel_row(kernel, (m, v, i, j)) for i, j in pairs if met[i, j]]
            table = aligned([*KERNEL_HEADER, *rows], gap=" ")
            lines += ["", f"{mechanism}, N = {count}", *table]
    edge = np.nanmax(kernel.arrays["edge"], initial=0.0)
    if edge > 0.0:
        lines.append(
            f"warning: up to {100.0 * edge:.2g} % of what aggregates came from the outermost "
            "offsets: attraction may reach farther than was sampled"
        )
    return lines


def kernel_row(kernel, place):
    """Return the cells of one pair of size classes."""
    found = {name: float(values[place]) for name, values in kernel.arrays.items()}

    def cell(name, form, scale=1.0, spread=None):
        ends = (scale * found[name + end] for end in ("", "_low", "_high"))
        return with_spread(*ends, form, spread)

    few, (least, most) = "{:.3g}".format, (found[f"alpha_change{end}"] for end in ("_low", "_high"))
    added = " -" if np.isnan(least) else f" {signed(least)} {signed(most)}"
    return (
        kernel.labels[place[2]], kernel.labels[place[3]],
        cell("width_c", "{:.2f}".format, 1e6), cell("width_a", "{:.2f}".format, 1e6),
        cell("alpha", share, spread=share) + ("" if np.isnan(found["alpha"]) else added),
        cell("beta2", few), cell("beta3", few, spread="{:.1g}".format),
        cell("efficiency3", "{:.3f}".format),
    )  # fmt: skip


def with_spread(value, low, high, form, spread=None):
    """Return an estimate, with its error by a function ``spread``; its ends where it is not known,
    "-" where neither is."""
    if np.isnan(value):
        return "-" if np.isnan(high) else f"[{form(low)}, {form(high)}]"
    return form(value) + (f" +-{spread(max(value - low, high - value))}" if spread else "")


def signed(change):
    """Return "-.040" or "+.040"."""
    return f"{'-' if change < 0.0 else '+'}{share(abs(change))}"


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


def undecided_line(results: Results) -> str:
    """Return what `verdict` says, without the word warning."""
    return verdict(results)[1].removeprefix("warning: ")


def checked_line(results: Results) -> str:
    """How many replicates were run again, and how many of them flipped; "" for none."""
    table = results.probabilities
    checked, flipped = (int(table[name].sum()) for name in ("n_checked", "n_flipped"))
    if not checked:
        return ""
    low, high = (100.0 * float(end) for end in wilson(flipped, checked))
    thrice, late = (int(table[name].sum()) for name in ("n_third", "n_third_flipped"))
    third = f"; {thrice} of them were run a third time, {late} of which ended differently from the"
    return (
        f"{checked} replicates were run again more accurately, {flipped} of them flipped: "
        f"{100.0 * flipped / checked:.2g} % [{low:.2g}, {high:.2g}]"
        f"{f'{third} second' if thrice else ''}"
    )


def change_lines(results: Results) -> list[str]:
    """Between what Pr[A] would change if all were run exactly, and if outlines were cut otherwise,
    in the conditions where it is most.

    A line for each of the two that is known.
    """
    shape = "shape: with outlines cut closer or wider, within their bands,"
    return [
        f"{what} Pr[A] would change by {worst} at most, 95 %"
        for what, group, name in (
            ("if all replicates were exact,", results.numerics, "pr_a_change"),
            (shape, results.outlines, "pr_a_shape"),
        )
        if (worst := worst_changes(results, group, name))
    ]


def worst_changes(results, group, name):
    """Return the lowest and the highest change in a group of tables; "" for none."""
    if not group or not np.isfinite(group[f"{name}_low"]).any():
        return ""
    words = []
    for end, worst_of in (("_low", np.nanargmin), ("_high", np.nanargmax)):
        values = group[name + end]
        t, v, d = np.unravel_index(worst_of(values), values.shape)
        words.append(
            f"{values[t, v, d]:+.3f} (type {results.types[t]}, N = {results.vertices[v]}, "
            f"delta {results.delta[d]:g})"
        )
    return " to ".join(words)


def with_errors(table, name, place):
    """Return a probability +- sampling error +- numerical error, e.g. ".600 +-.031 +-.004".

    The longer side of the 95 % interval; "-" for a numerical error of which nothing is known, and
    the interval alone where the value is not.
    """
    *known, numerical = (table[name + end][place] for end in ("", "_low", "_high", "_numerical"))
    cell = with_spread(*known, share, share)
    if np.isnan(known[0]):
        return cell
    return f"{cell} {'-' if np.isnan(numerical) else f'+-{share(numerical)}':>6}"


def shape_error(outlines, place):
    """By how much Pr[A] would change with other outlines, e.g. "-.021 +.045"."""
    low, high = (outlines[f"pr_a_shape{end}"][place] for end in ("_low", "_high"))
    return "-" if np.isnan(low) else f"-{share(-low)} +{share(high)}"


def share(value):
    """Three decimals in four characters: ".345", "1.00"."""
    text = f"{value:.3f}"
    return text[1:] if text.startswith("0") else text[:4]

"""The table of a study for the terminal."""

import itertools
from collections.abc import Sequence

import numpy as np

from flocsim.errors import FlocsimError, visible
from flocsim.io.confidence import efficiency, wilson
from flocsim.io.results.events import HOOK, MOST_UNKNOWN
from flocsim.io.results.kernel_group import ESTIMATES, Kernel
from flocsim.io.results.run_group import describe_note, stored
from flocsim.io.results.schema import CLASSES, Results
from flocsim.process import WITHHELD

ENDS = {
    "n_missed": ("mis-", "sed"),
    "n_held": ("", "held"),
    "n_undecided": ("unde-", "cided"),
    "n_failed": ("fail-", "ed"),
}
"""Columns of replicates that did not collide or have no class; those held only where there are any,
as they take colloids that repel each other."""

HEADER = (
    ("", "N"),
    ("del-", "ta"),
    ("", "n"),
    ("col-", "lided"),
    ("in-", "side"),
    ("Pr[inside]", "95 %  num."),
    ("Pr[A]", "95 %  num."),
    ("of A", "hang"),
    *(("", name) for name in CLASSES),
)
SHAPE_COLUMN = 7
"""Where the error by the shape stands, behind Pr[A]."""

WIDTH = 110
"""Columns of a wide terminal; the table is set more openly where this leaves room."""

EFFICIENCY = "aggregations per approach over delta, in the plane and axially [95 %]"
"""What the efficiencies are."""


def format_table(results: Results) -> str:
    """Counts and probabilities with their errors, one row per condition, a block per type.

    Pr +- sampling error (longer side of the 95 % interval) +- numerical error (95 % bound); of a
    study whose outlines were cut closer and wider as well, between what Pr[A] would change by that
    (95 %).

    Plain ASCII apart from the names; up to 110 columns for counts below 1e5; "-" where there was no
    event to estimate a probability from. A line below says of delta = 1 that it grazes. Of the
    aggregations some hang by their shapes, as statics shows, and the others stick. Returns text
    without a final line end.
    """
    conditions = list(np.ndindex(results.shape))
    ends = [n for n in ENDS if n != "n_held" or np.any(results.probabilities[n])]
    rows = [condition_row(results, place, ends) for place in conditions]
    header = list(HEADER)
    if results.outlines:
        header.insert(SHAPE_COLUMN, ("of Pr[A]", "shape"))
    upper, lower = zip(*header, *(ENDS[name] for name in ends), strict=True)
    widths = [max(map(len, column)) for column in zip(upper, lower, *rows, strict=True)]
    if sum(widths) + 2 * len(widths) <= WIDTH:
        widths = [width + 1 for width in widths]
    lines = [align(upper, widths), align(lower, widths)]
    for place, row in zip(conditions, rows, strict=True):
        if place[1:] == (0, 0):
            lines.append(f"type {results.types[place[0]]}")
        lines.append(align(row, widths))
    return "\n".join([*lines, *graze_lines(results.delta)])


GRAZE = "delta 1: by construction the outlines just graze, or miss; it says little about collisions"


def graze_lines(delta: Sequence[float] | np.ndarray) -> list[str]:
    """What to say of a displacement by all of delta_max, where there is one."""
    return [GRAZE] if 1.0 in np.asarray(delta) else []


def efficiency_rows(results: Results) -> list[tuple[str, int, str, str]]:
    """(type, N, in the plane, axially) of efficiencies with their 95 % intervals: the aggregations
    per approach integrated over delta; none where delta does not reach from 0 to 1."""
    planar, axial = (
        efficiency(results.probabilities, results.delta, each) for each in (False, True)
    )
    if planar is None or axial is None:
        return []
    rows = []
    for t, name in enumerate(results.types):
        for v, count in enumerate(results.vertices):
            if np.isfinite(planar[0][t, v]):
                first, second = (f"{e[t, v]:.3f} [{lo[t, v]:.3f}, {hi[t, v]:.3f}]"
                                 for e, lo, hi in (planar, axial))  # fmt: skip
                rows.append((str(name), int(count), first, second))
    return rows


def efficiency_lines(results: Results) -> list[str]:
    """The efficiency_rows as a table of text."""
    lines = [
        f"type {visible(name, '')}, N = {count}: {planar}   {axial}"
        for name, count, planar, axial in efficiency_rows(results)
    ]
    return [f"efficiency: {EFFICIENCY}", *lines] if lines else []


RECTILINEAR = (
    "upper bounds: bodies approach along straight paths, or along those of the flow, because the "
    "water displaced by one does not move the other (no hydrodynamic interaction)"
)
"""What is to be known of all widths and kernels."""

IN_WATER = "for the effect of the water on equivalent spheres: flocsim info FILE --water"
"""Where that is to be had."""

KERNEL_HEADER = (
    ("class", "i"), ("", "j"), ("width [um]", "touched"), ("", "aggregated"),
    ("alpha", "95 %    num."), ("beta2", "[m2/s]"), ("beta3 [m3/s]", "+- 95 %"),
    ("over ref.", "sphere"),
)  # fmt: skip


def kernel_lines(kernel: Kernel) -> list[str]:
    """The rates of a kernel study as tables of text: one for each mechanism and N."""
    lines = [f"capture widths and kernels, {RECTILINEAR}", IN_WATER]
    if kernel.water:
        lines = ["capture widths and kernels, with hydrodynamic interaction"]
    for m, mechanism in enumerate(kernel.mechanisms):
        for v, count in enumerate(kernel.vertices):
            rows = [
                kernel_row(kernel, (m, v, i, j))
                for i, j in itertools.combinations_with_replacement(range(len(kernel.labels)), 2)
                if kernel.arrays["checked"][m, v, i, j] >= 0.0
            ]
            rows = [row for row in rows if row]
            upper, lower = zip(*KERNEL_HEADER, strict=True)
            widths = [max(map(len, column)) for column in zip(upper, lower, *rows, strict=True)]
            lines += ["", f"{mechanism}, N = {count}", align(upper, widths), align(lower, widths)]
            lines += [align(row, widths) for row in rows]
    edge = np.nanmax(kernel.arrays["edge"], initial=0.0)
    if edge > 0.0:
        lines.append(
            f"warning: up to {100.0 * edge:.2g} % of what aggregates came from the outermost "
            "offsets: attraction may reach farther than was sampled"
        )
    return lines


def kernel_row(kernel, place):
    """One pair of size classes; nothing for bodies that do not meet."""
    found = {name: float(values[place]) for name, values in kernel.arrays.items()}
    if found["width_c"] == 0.0:
        return ()

    def told(name, form, scale=1.0, spread=None):
        """An estimate with its error by a function ``spread``; where it is not known, its ends."""
        value, low, high = (scale * found[name + end] for end in ("", "_low", "_high"))
        if np.isnan(value):
            return "-" if np.isnan(high) else f"[{form(low)}, {form(high)}]"
        return form(value) + (f" +-{spread(max(value - low, high - value))}" if spread else "")

    few, (least, most) = "{:.3g}".format, (found[f"alpha_change{end}"] for end in ("_low", "_high"))
    added = "" if np.isnan(found["alpha"]) else (
        " -" if np.isnan(least) else f" {signed(least)} {signed(most)}"
    )  # fmt: skip
    return (
        visible(kernel.labels[place[2]], ""), visible(kernel.labels[place[3]], ""),
        told("width_c", "{:.2f}".format, 1e6), told("width_a", "{:.2f}".format, 1e6),
        told("alpha", share, spread=share) + added, told("beta2", few),
        told("beta3", few, spread="{:.1g}".format), told("efficiency3", "{:.3f}".format),
    )  # fmt: skip


def signed(change):
    """ "-.040" or "+.040"."""
    return f"{'-' if change < 0.0 else '+'}{share(abs(change))}"


def touch_lines(results: Results) -> list[str]:
    """What share of the decided pairs of a brownian study touched before they escaped, for each
    type and N; none of other studies. Those that are held apart did not."""
    if not stored(results.run, "equivalent_spheres"):
        return []
    table, lines = results.probabilities, []
    for t, v in itertools.product(range(len(results.types)), range(len(results.vertices))):
        touched, missed, held = (
            int(table[name][t, v].sum()) for name in ("n_collided", "n_missed", "n_held")
        )
        decided = touched + missed + held
        where = f"type {visible(results.types[t], '')}, N = {results.vertices[v]}"
        if decided:
            low, high = (float(end) for end in wilson(touched, decided))
            told = f"{touched / decided:.4f} [{low:.4f}, {high:.4f}]"
            lines.append(f"{where}: {told} touched before they escaped")
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


def undecided_line(results: Results) -> str:
    """What to say where replicates are undecided or have failed: of pairs where there are more of
    them than may be, of rates where there are any; "" else."""
    table = results.probabilities
    total, failed, undecided = (
        int(table[name].sum()) for name in ("n_total", "n_failed", "n_undecided")
    )
    too_many = too_many_undecided(results)
    if not failed + undecided or not (too_many or results.kernel is not None):
        return ""
    notes = stored(results.run, "failed")
    first = f"; the first: {describe_note(notes[0])}" if notes else ""
    advice = (
        ": raise integrator.max_steps or scene.time_limit, for another output" if undecided else ""
    )
    ends = f"{failed} failed and {undecided} are undecided"
    if failed + undecided == total:
        return f"no replicate has reached an outcome, {ends}{advice}{first}"
    share = np.nanmax(shares_undecided(results), initial=0.0)
    what, of_what = ("points", "a pair's encounters") if results.kernel is not None else (
        "replicates", "those of a condition"
    )  # fmt: skip
    limit = f", more than stop.undecided = {most_undecided(results):g} allows" if too_many else ""
    open_ = ", so that rates have no estimate" if too_many and results.kernel is not None else ""
    return (
        f"of {total} {what} {ends}, up to {100.0 * share:.2g} % of {of_what}{limit}: intervals "
        f"include every outcome that they could have had{open_}{advice}{first}"
    )


def verdict(found: Results) -> tuple[int, str]:
    """0, or the code of an error where not one replicate has come to an outcome, or where more are
    undecided than may be; and what to say of those that have none."""
    line = undecided_line(found)
    if not line:
        return 0, ""
    counts = found.probabilities
    if (counts["n_failed"] + counts["n_undecided"]).sum() == counts["n_total"].sum():
        return FlocsimError.exit_code, line
    return (WITHHELD if too_many_undecided(found) else 0), f"warning: {line}"


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
    """The lowest and the highest change in a group of tables, where they are; "" for none."""
    if not group or not np.isfinite(group[f"{name}_low"]).any():
        return ""
    low, high = group[f"{name}_low"], group[f"{name}_high"]
    told = []
    for values, worst in ((low, np.nanargmin(low)), (high, np.nanargmax(high))):
        t, v, d = np.unravel_index(worst, values.shape)
        told.append(
            f"{values[t, v, d]:+.3f} (type {visible(results.types[t], '')}, "
            f"N = {results.vertices[v]}, delta {results.delta[d]:g})"
        )
    return f"{told[0]} to {told[1]}"


def condition_row(results, place, ends):
    (_, v, d), table, outlines = place, results.probabilities, results.outlines
    counts = ("n_total", "n_collided", "n_inside")
    return (
        str(results.vertices[v]),
        f"{results.delta[d]:g}",
        *(str(table[name][place]) for name in counts),
        with_errors(table, "pr_inside", place),
        with_errors(table, "pr_a", place),
        *([shape_error(outlines, place)] if outlines else []),
        hanging(table, place),
        *(str(number) for number in table["n_class"][place]),
        *(str(table[name][place]) for name in ends),
    )


def with_errors(table, name, place):
    """A probability +- sampling error +- numerical error, e.g. ".600 +-.031 +-.004".

    The longer side of the 95 % interval; "-" for a numerical error of which nothing is known, and
    the interval alone where the value is not.
    """
    value, low, high, numerical = (
        table[name + end][place] for end in ("", "_low", "_high", "_numerical")
    )
    if np.isnan(value):
        return "-" if np.isnan(high) else f"[{share(low)}, {share(high)}]"
    added = "-" if np.isnan(numerical) else f"+-{share(numerical)}"
    return f"{share(value)} +-{share(max(value - low, high - value))} {added:>6}"


def shape_error(outlines, place):
    """By how much Pr[A] would change with other outlines, e.g. "-.021 +.045"."""
    low, high = (outlines[f"pr_a_shape{end}"][place] for end in ("_low", "_high"))
    return "-" if np.isnan(low) else f"-{share(-low)} +{share(high)}"


def hanging(table, place):
    """The share of aggregations that hang by a hook."""
    value = table["pr_bond"][place][HOOK - 1]
    return "-" if np.isnan(value) else share(value)


def share(value):
    """Three decimals in four characters: ".345", "1.00"."""
    text = f"{value:.3f}"
    return text[1:] if text.startswith("0") else text[:4]


def align(cells, widths):
    return " ".join(cell.rjust(width) for cell, width in zip(cells, widths, strict=True)).rstrip()

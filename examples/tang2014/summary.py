"""summary.md: all the numbers of a finished study that docs/reproduction.md shows, and more."""

import attrs
import numpy as np
import steps
from claims.resampling import counts_of
from claims.robust import ALWAYS, contradicting
from claims.table import changed_verdicts, claims_table, page_table
from claims.trends import mean_of, with_delta
from claims.verdicts import interval_of
from exceptions import flocs_against
from output import marked, write_page

from flocsim.io.confidence import proportion
from flocsim.io.results.schema import CLASSES
from flocsim.io.terminal import markdown_table

FLIP_KINDS = ("outcome", "aggregation", "zone")
MOST_FLIPS, MOST_UNDECIDED = 0.5, 0.1
"""Goals [%]: outcome flips among the replicates run again, undecided among all."""
HEADS = {"flocsim": "flocsim", "paper": "the paper's finder and fit"}
"""Ways from picture to polygon: {name: head of their column}."""
MOST_NAMED = 3
"""Flocs that are named of those whose pairs contradict a claim."""
HEADLINES = (6, 8, 12, 13, 15, 16, 18, 19)
"""Claims that carry the paper's headline, held against flocs of real weight."""
MOST_OPEN = 1.0
"""Share [%] of a reading's collisions without an outcome that needs a word of caution."""
BESIDE = {"pr_inside": "Pr[C inside]", "pr_a_inside": "Pr[A|inside]",
         "pr_a_outside": "Pr[A|outside]"}  # fmt: skip


def write_summary(folder, studies, changes, ways, readings, zones):
    """Write the page: each part stands between marks, as in docs/reproduction.md.

    ``studies``: {name: Results}, flocsim's and clay's; ``ways``: {name: Findings of all claims},
    flocsim's, the paper's own and clay's; ``readings``: {name: (Results, Findings about
    collisions)}; ``zones``: {type: D_0 [m]}.
    """
    study, clay = studies["flocsim"], studies["clay"]
    fitted = {HEADS[name]: found for name, found in ways.items() if name in HEADS}
    headline = {"clay": ways["clay"], "tang2014": ways["flocsim"]}
    parts = {
        "run": run_text(study),
        "times": times(folder),
        "totals": totals(study),
        "totals-clay": totals(clay),
        "flips": flips_table(changes),
        "claims": page_table(fitted),
        "clay": page_table(headline, HEADLINES, quoted=False),
        "against": against(study),
        "exceptions": exceptions(study, zones),
        "beside": beside_table(study),
    }
    parts |= {f"in-full-{name}": claims_table(found) for name, found in ways.items()}
    if readings:
        parts["readings"] = changed_verdicts({name: each for name, (_, each) in readings.items()})
        parts["reading-totals"] = readings_totals(readings)
    path = folder / "summary.md"
    write_page(path, "\n\n".join(marked(*part) for part in parts.items()) + "\n")
    print(path)


def times(folder):
    """Wall time of every step."""
    goes = steps.taken(folder / "steps.csv")
    rows = [(name, f"{sum(each):.0f}", len(each)) for name, each in goes.items()]
    rows.append(("all", f"{sum(sum(each) for each in goes.values()):.0f}", ""))
    return markdown_table(("step", "wall time [s]", "goes"), rows)


def run_text(study):
    """Where and on what the study ran."""
    run = study.run
    return (
        f"**{study.count} replicates in each of {np.prod(study.shape)} conditions.** "
        f"flocsim {run['flocsim_version']}, {run['date']}, {run['processor']}, Python "
        f"{run['python_version']}, numpy {run['numpy_version']}, numba {run['numba_version']}. The "
        f"study on {run['ranks']} rank{'s' if run['ranks'] > 1 else ''}: {run['computed']} "
        f"replicates in {run['wall_time']:.0f} s, "
        f"{run['computed'] / max(run['wall_time'], 1e-9):.0f} a second."
    )


def totals(study):
    """What became of the replicates, by type and in all."""
    table = study.probabilities
    names = ("total", "missed", "undecided", "failed", "collided")
    counts = [table[f"n_{name}"].sum(axis=(1, 2)) for name in names]
    rows = np.column_stack([*counts, table["n_class"].sum(axis=(1, 2))])
    lines = [(name, *row) for name, row in zip(study.types, rows, strict=True)]
    all_of_them = markdown_table(("type", *names, *CLASSES), [*lines, ("all", *rows.sum(axis=0))])
    total, _, undecided, failed = rows.sum(axis=0)[:4]
    share = 100.0 * undecided / total
    return (
        f"{all_of_them}\n\nUndecided {share:.3f} % (goal: at most {MOST_UNDECIDED} %: "
        f"{reached(share <= MOST_UNDECIDED)}), failed {failed} (goal: 0: {reached(failed == 0)})."
    )


def reached(flag):
    return "reached" if flag else "**not reached**"


def flips_table(changes):
    """How many of the replicates that were run again changed."""
    rows = []
    for kind in FLIP_KINDS:
        among = changes.checked if kind == "outcome" else changes.both
        changed, count = np.count_nonzero(getattr(changes, kind)), np.count_nonzero(among)
        value, low, high = (100.0 * float(each) for each in proportion(changed, count))
        rows.append((kind, changed, count, f"{value:.2f}", f"[{low:.2f}, {high:.2f}]"))
    heads = ("flips of", "replicates", "among", "share [%]", "95 %")
    flag = reached(float(rows[0][3]) <= MOST_FLIPS)
    return f"{markdown_table(heads, rows)}\n\nOutcome flips (goal: at most {MOST_FLIPS} %): {flag}."


def against(study):
    """How many replicates contradict each claim about every collision, and their flocs."""
    rows = []
    for number in ALWAYS:
        flags = contradicting(study, number)
        counts, pairs = flocs_against(study, (number,))
        often = ", ".join(f"{name} ({times})" for name, times in counts.most_common(MOST_NAMED))
        if pairs:
            rows.append((number, np.count_nonzero(flags), pairs, often))
    heads = ("claim", "replicates against it", "pairs of flocs", "flocs in most of these pairs")
    return (
        markdown_table(heads, rows) if rows else "No replicate contradicts (6), (7), (9) or (10)."
    )


def exceptions(study, zones):
    """The replicates that contradict a claim about every collision, one row each."""
    heads = ("claims", "type", "replicate", "flocs i, j", "conditions", "N", "δ", "d_c / D_0")
    numbers = {}
    for number in ALWAYS:
        for row in rows_against(study, zones, number):
            numbers.setdefault(row, []).append(str(number))
    rows = [(", ".join(each), *row) for row, each in numbers.items()]
    return markdown_table(heads, rows)


def rows_against(study, zones, number):
    """The rows of one claim."""
    flags = contradicting(study, number)
    for kind, name in enumerate(study.types):
        for k in np.flatnonzero(flags[kind].any(axis=(0, 1))):
            place = kind, *np.nonzero(flags[kind][..., k]), k
            ratios = study.replicates["d_c_collision"][place] / zones[name]
            where = listed(study.vertices[place[1]]), listed(study.delta[place[2]])
            reach = f"{ratios.min():.3f} to {ratios.max():.3f}"
            flocs = " and ".join(floc_names(study, place))
            yield name, k, flocs, len(ratios), *where, reach


def floc_names(study, place):
    """The names of the flocs of i and j; the first, where conditions differ."""
    for body in ("floc_i", "floc_j"):
        number = int(study.replicates[body][place][0])
        yield study.flocs[number] if number >= 0 else "sphere"


def listed(values):
    """Distinct values, the first and last of many."""
    shown = [f"{value:g}" for value in np.unique(values)]
    return ", ".join(shown) if len(shown) <= 5 else f"{shown[0]} … {shown[-1]}"


def below_largest(counts):
    """The Counts without δ = δ_max, where few collide."""
    kept = counts.delta < 1.0
    arrays = {
        name: getattr(counts, name)[..., kept, :] for name in ("collided", "inside", "classes")
    }
    return attrs.evolve(counts, delta=counts.delta[kept], **arrays)


def change_with_vertices(counts, values):
    """Values (vertices, delta, sample) at the largest N less those at the smallest N > 1."""
    first, last = counts.polygons[0], counts.polygons[-1]
    return mean_of(values[last] - values[first], axis=0)


def beside_table(study):
    """Statistics beside the claims, chosen after the results were seen: where trends end."""
    whole = counts_of(study)
    part = below_largest(whole)
    low, high = (whole.vertices[whole.polygons[place]] for place in (0, -1))
    rows = []
    for name, shown in BESIDE.items():
        cells = [cell(with_delta(part, getattr(part, name)[k])) for k in range(len(part.types))]
        rows.append((f"τ({shown}, δ) below δ_max", *cells))
        cells = [cell(change_with_vertices(whole, getattr(whole, name)[k]))
                 for k in range(len(whole.types))]  # fmt: skip
        rows.append((f"{shown} at N = {high} less N = {low}, mean over δ", *cells))
    return markdown_table(("statistic", *(f"Type {name}" for name in whole.types)), rows)


def cell(samples):
    """ "-0.69 [-1.00, -0.21]"; "-" for what is not there."""
    value, low, high = interval_of(samples)
    return "-" if not np.isfinite(low) else f"{value:.3f} [{low:.3f}, {high:.3f}]"


def readings_totals(readings):
    """What became of the replicates under every reading."""
    names = ("total", "missed", "undecided", "failed")
    rows = []
    for name, (results, _) in readings.items():
        table = results.probabilities
        counts = [table[f"n_{each}"].sum() for each in names]
        seconds = results.run["wall_time"]
        rows.append((name, *counts, *table["n_class"].sum(axis=(0, 1, 2)), f"{seconds:.0f}"))
    table = markdown_table(("reading", *names, *CLASSES, "wall time [s]"), rows)
    return "\n\n".join([table, *(text for row in rows if (text := caution(row)))])


def caution(row):
    """A sentence on a reading of which too much stayed open to judge it; "" otherwise."""
    name, total, missed, undecided, failed = row[:5]
    share = 100.0 * (undecided + failed) / max(total - missed, 1)
    if share <= MOST_OPEN:
        return ""
    return (
        f"**{name}**: {share:.0f} % of the collisions are undecided or failed; its verdicts are "
        "about the others only."
    )

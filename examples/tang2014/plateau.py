"""Why Pr[A] does not depend on H_A over three decades: the explanation, tested.

    python examples/tang2014/plateau.py [--library shapes.h5] [--replicates 200] [-o DIR]

The explanation: the attraction is held at its cut-off d_min, so that it is at most
H_A r*/(6 d_min²); a pair is bound if that exceeds the largest load L of settling and if the pair,
turning, brings its centres to where the attraction exceeds L, which is geometry. It predicts that

1. equivalent spheres, which always come near enough, aggregate always above H* = 6 d_min² L/r*
   and never below;
2. so do spheropolygons, as far as they come near: curves for several d_min are one against H_A/H*;
3. at the preset a replicate aggregates if and only if its d_c comes below r_i + r_j + d*, where
   H_A r*/(6 d*²) = L.

Writes plateau.png, .pdf and plateau.md.
"""

import numpy as np
from output import marked, save_all, write_page
from sweeps import TYPES, config_of, parse_arguments, sweep, transition

from flocsim.ensembles.collision.start import only_one
from flocsim.ensembles.study import Study
from flocsim.forces import VanDerWaals
from flocsim.forces.settling import terminal_motion
from flocsim.io.confidence import proportion
from flocsim.io.plots.style import graded_colours, house_style, new_figure, set_probability_axis
from flocsim.io.terminal import markdown_table
from flocsim.io.trajectory import centre_distance

CUT_OFFS = (0.5e-9, 1e-9, 2e-9, 4e-9)
RATIOS = np.geomspace(0.2, 20.0, 11)
"""H_A/H* of the sweeps."""
ASIDE = 1.08
"""Factor that keeps the curves of the figure apart: they would cover each other."""
SHARE, VERTICES = 0.5, 16
SHOWN = 0
"""Place of the type that the figure shows."""


def pair_of(study, kind):
    """(r*, L) of a type: reduced radius [m] and the largest load of settling on a bond [N]."""
    radius_i, radius_j = study.pairings[kind].radii
    system = study.encounter(kind, 1, np.zeros(4)).system
    motions = [terminal_motion(system, body) for body in system.bodies]
    drift = np.hypot(*(motions[1][0] - motions[0][0]))
    reduced = radius_i * radius_j / (radius_i + radius_j)
    return reduced, drift / (motions[0][1] + motions[1][1])


def attraction_at(config, hamaker, cut_off=None):
    """Changes of the config: H_A and d_min."""
    force = {"hamaker": float(hamaker)} | ({"d_min": cut_off} if cut_off else {})
    return config({"forces": {"van_der_waals": force}})


def cut_off_sweeps(make, pairs):
    """[(d_min, Sweep against H_A/H* of the first type)]; the types differ in H*, so all are run."""
    found = []
    for cut_off in CUT_OFFS:
        for kind, (reduced, load) in enumerate(pairs):
            critical = 6.0 * cut_off**2 * load / reduced
            one = sweep(f"d_min {cut_off:g} m, Type {TYPES[kind]}, H_A/H*", RATIOS,
                        lambda x, k=kind, c=critical, d=cut_off: attraction_at(
                            lambda change: make({"scene": {"types": [TYPES[k]]}}, change), c * x, d
                        ))  # fmt: skip
            found.append((cut_off, kind, critical, one))
    return found


def sphere_transition(make, kind, critical, cut_off):
    """(low, high) of H_A/H*: equivalent spheres depart at the one and aggregate at the other."""
    low, high = 0.1, 10.0
    scene = {"scene": {"types": [TYPES[kind]]}, "shapes": {"vertices": [1]}}
    while high > 1.01 * low:
        middle = float(np.sqrt(low * high))
        config = attraction_at(lambda change: make(scene, change), middle * critical, cut_off)
        bound = Study(config).run(0, 1, SHARE, 0)["outcome"] in (0, 2)
        low, high = (low, middle) if bound else (middle, high)
    return low, high


def spheres_table(make, pairs):
    """Where equivalent spheres begin to aggregate."""
    rows = []
    for cut_off in CUT_OFFS:
        for kind, (reduced, load) in enumerate(pairs):
            critical = 6.0 * cut_off**2 * load / reduced
            low, high = sphere_transition(make, kind, critical, cut_off)
            rows.append((f"{1e9 * cut_off:g}", TYPES[kind], f"{critical:.3g}",
                         f"{low:.3f} to {high:.3f}"))  # fmt: skip
    return markdown_table(
        ("d_min [nm]", "type", "H* [J]", "never below, always above H_A/H*"), rows
    )


def sweeps_table(found):
    """Where half of the way is made, by cut-off and type."""
    rows = []
    for cut_off, kind, critical, one in found:
        value, low, high = transition(one, 0, 0.5)
        rows.append((f"{1e9 * cut_off:g}", TYPES[kind], f"{critical:.2e}", f"{value:.2f}",
                     f"[{low:.2f}, {high:.2f}]"))  # fmt: skip
    return markdown_table(("d_min [nm]", "type", "H* [J]", "half of Pr[A] at H_A/H*", "95 %"), rows)


def nearest_approach(study, kind, replicate):
    """(outcome, least d_c − r_i − r_j [m] from the collision on) of a replicate."""
    draw = study.draw(kind, VERTICES, SHARE, replicate)
    run = draw.begin(study.driver(draw.encounter), study.config.integrator.max_steps, record=True)
    row = draw.row(run, run.to_end())
    times, position, _ = run.motion()
    distance = centre_distance(position)
    after = distance[times >= row["t_collision"]] if row["inside"] <= 1 else distance
    radius_i, radius_j = study.pairings[kind].radii
    return row["outcome"], after.min() - radius_i - radius_j


def approaches(study, kind):
    """(aggregated, least gap [m]) of all decided collisions of a type."""
    found = [nearest_approach(study, kind, k) for k in range(study.config.replicates)]
    outcome, gap = np.array(found).T
    decided = outcome < len("ABCD")
    return outcome[decided] % 2 == 0, gap[decided]


def approach_table(study, pairs, found):
    """How often "came within d*" and "aggregated" agree."""
    hamaker = only_one(study.config.forces, VanDerWaals).hamaker
    rows, reaches = [], []
    for kind, ((reduced, load), (bound, gap)) in enumerate(zip(pairs, found, strict=True)):
        reach = np.sqrt(hamaker * reduced / (6.0 * load))
        near = gap < reach
        agree = proportion(np.sum(near == bound), len(bound))
        shown = f"{100.0 * float(agree[0]):.1f}"
        limits = "[{:.1f}, {:.1f}]".format(*(100.0 * float(each) for each in agree[1:]))
        counts = [np.sum(near & bound), np.sum(near & ~bound), np.sum(~near & bound),
                  np.sum(~near & ~bound)]  # fmt: skip
        rows.append((TYPES[kind], f"{1e9 * reach:.1f}", *counts, shown, limits))
        reaches.append(reach)
    heads = ("type", "d* [nm]", "near, bound", "near, departed", "far, bound", "far, departed",
             "agree [%]", "95 %")  # fmt: skip
    return markdown_table(heads, rows), reaches


def figure(found, approach, reach):
    """Left: the curves for all cut-offs against H_A/H*; right: least gaps by outcome."""
    with house_style():
        whole = new_figure(6.6, 2.7)
        left, right = whole.subplots(1, 2)
        colours = graded_colours(len(CUT_OFFS))
        shown = [(cut_off, one) for cut_off, kind, _, one in found if kind == SHOWN]
        for place, ((cut_off, one), colour) in enumerate(zip(shown, colours, strict=True)):
            shifted = RATIOS * ASIDE ** (place - 0.5 * (len(shown) - 1))
            value, low, high = (band[:, 0] for band in one.bands)
            left.errorbar(shifted, value, np.clip([value - low, high - value], 0.0, None),
                          color=colour, marker="o", ms=3, lw=0.9, elinewidth=0.7,
                          label=f"{1e9 * cut_off:g} nm")  # fmt: skip
        left.set_xscale("log")
        left.axvline(1.0, color="0.6", lw=0.8, ls=":")
        set_probability_axis(left)
        left.set_xlabel("$H_A / H^*$")
        left.set_ylabel(r"$\Pr[A]$")
        left.legend(title="cut-off", loc="lower right")
        draw_approach(right, *approach, reach)
        left.set_title(f"Type {TYPES[SHOWN]}, N = {VERTICES}")
        return whole


def draw_approach(axes, bound, gap, reach):
    """The least gap of every replicate, in order of size, by what became of it."""
    order = np.argsort(gap)
    share = (np.arange(len(gap)) + 0.5) / len(gap)
    for flag, colour, word in ((True, "#0072B2", "aggregated"), (False, "#E69F00", "departed")):
        chosen = bound[order] == flag
        axes.plot(1e6 * gap[order][chosen], share[chosen], "o", ms=2.5, color=colour, label=word)
    axes.axvline(1e6 * reach, color="0.4", lw=0.8, ls=":")
    axes.set_xlabel("least $d_c - r_i - r_j$ [µm]")
    axes.set_ylabel("share of the collisions")
    axes.legend(loc="upper left")


def main():
    arguments = parse_arguments(__doc__)

    def make(*changes):
        return config_of(arguments.library, arguments.replicates, *changes)

    study = Study(make())
    pairs = [pair_of(study, kind) for kind in range(len(TYPES))]
    found = [approaches(study, kind) for kind in range(len(TYPES))]
    table, reaches = approach_table(study, pairs, found)
    swept = cut_off_sweeps(make, pairs)
    save_all(figure(swept, found[SHOWN], reaches[SHOWN]), arguments.output / "plateau")
    parts = {
        "spheres": spheres_table(make, pairs),
        "cut-offs": sweeps_table(swept),
        "approaches": table,
    }
    text = "\n\n".join(marked(*part) for part in parts.items()) + "\n"
    write_page(arguments.output / "plateau.md", text)
    print(text)


if __name__ == "__main__":
    main()

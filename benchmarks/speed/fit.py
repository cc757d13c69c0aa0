"""Relative errors and CPU times of fits on real silhouettes, against the paper's optimiser.

    python -m benchmarks.speed.fit [--quick] [--markdown] [--images DIR]

Means over flocs come with half their 95 % interval (Student).  `even` is the start of `paper`: N
points evenly on the outline, drawn in by r.  The paper counts V over the whole picture anew for
every trial move; that time is computed: its number of counts times the time of one.
"""

import time
from functools import cache

import numpy as np
from scipy import stats

from benchmarks.pictures import PICTURES, checked, silhouettes
from benchmarks.reporting import Table, parse_arguments, print_heading
from flocsim.geometry.fit import fit_mask, search
from flocsim.geometry.fit.coverage import (
    compiled,
    cover,
    leaves_room,
    move_vertex,
    neighbours,
    padded,
)
from flocsim.geometry.fit.search import even_start, inset, searched, trace_outline
from flocsim.geometry.fit.simple import stays_simple

COUNTS = (4, 8, 16, 28, 64)
CLASSES = {"14 to 26 px": (14.0, 26.0), "4 to 5 px": (4.0, 5.0)}
GOALS = {
    ("14 to 26 px", 4): 15.5, ("14 to 26 px", 8): 6.4, ("14 to 26 px", 16): 2.9,
    ("14 to 26 px", 28): 1.6, ("14 to 26 px", 64): 0.7,
    ("4 to 5 px", 4): 12.5, ("4 to 5 px", 8): 5.1, ("4 to 5 px", 16): 1.5,
}  # fmt: skip
REPEATS = 5
MOVES = 1000
"""Moves of each vertex that an annealer tries."""
STEPS = np.array([8.0, 4.0, 2.0, 1.0, 0.5, 0.25])


class Fits:
    """Fits of silhouettes, each made once: RE [%] and CPU time [ms]."""

    def __init__(self, flocs, every):
        """``flocs`` [(mask, r_eq)], of which every 1st, 2nd, … of a class is taken."""
        self.flocs, self.every = flocs, every
        self.measure = cache(self._measure)

    def masks(self, low, high):
        """The masks with low ≤ r_eq ≤ high [px]."""
        return [mask for mask, radius in self.flocs if low <= radius <= high][:: self.every]

    def _measure(self, low, high, vertices, radius=1.0, method="pattern"):
        """(RE (n,), ms (n,)) of a class."""
        masks = self.masks(low, high)
        fit_mask(masks[0], vertices=vertices, radius=radius, method=method)
        rows = []
        for mask in masks:
            began = time.process_time()
            fit = fit_mask(mask, vertices=vertices, radius=radius, method=method)
            rows.append((fit.relative_error, 1e3 * (time.process_time() - began)))
        return np.array(rows).T


def with_half(values):
    """A mean and half its 95 % interval, as text."""
    half = stats.t.ppf(0.975, len(values) - 1) * np.std(values, ddof=1) / np.sqrt(len(values))
    return f"{np.mean(values):.2f} ± {half:.2f}"


def error_table(fits):
    """RE by class and N at r = 1 px beside the goals."""
    table = Table(
        "Relative error [%] of the default fit at r = 1 px",
        ("r_eq", "N", "flocs", "RE", "goal", "every 4th", "worst", "circle", "median ms", "max ms"),
    )
    for name, bounds in CLASSES.items():
        circle = fits.measure(*bounds, 1)[0].mean()
        for count in COUNTS:
            errors, times = fits.measure(*bounds, count)
            goal = GOALS.get((name, count), "")
            table.add(name, count, len(errors), with_half(errors), goal, errors[::4].mean(),
                      errors.max(), circle, np.median(times), times.max())  # fmt: skip
    return table


def paper_counts(mask, vertices):
    """(ms of the paper's motion if it counts V over the whole picture, number of counts)."""
    room, _ = padded(mask, vertices, 1.0)
    start = even_start(room, vertices, 1.0)
    settings = search.FORCE, search.DAMPING, search.SPACING
    steps = compiled(search.damped_descent)(
        room, np.array(start), np.array(start), 1.0, *settings, search.TIME_STEP,
        search.PATIENCE,
    )  # fmt: skip
    began = time.process_time()
    for _ in range(20):
        searched(room, start, 1.0, search.NO_STEPS)
    each = (time.process_time() - began) / 20
    return 1e3 * each * steps * (4 * vertices + 1), steps * (4 * vertices + 1)


def method_table(fits):
    """The default against the paper's optimiser."""
    table = Table(
        "The default (pattern) against the paper's damped dynamics, r = 1 px, 14 to 26 px",
        ("N", "RE even", "RE paper", "RE pattern", "ms paper", "ms pattern", "ratio",
         "ms paper, whole picture", "ratio"),
    )  # fmt: skip
    bounds = CLASSES["14 to 26 px"]
    for count in COUNTS:
        even = fits.measure(*bounds, count, method="even")[0].mean()
        theirs, ours = (fits.measure(*bounds, count, method=m) for m in ("paper", "pattern"))
        whole = np.mean([paper_counts(mask, count)[0] for mask in fits.masks(*bounds)])
        ms_theirs, ms_ours = theirs[1].mean(), ours[1].mean()
        table.add(count, even, with_half(theirs[0]), with_half(ours[0]), ms_theirs, ms_ours,
                  ms_theirs / ms_ours, whole, whole / ms_ours)  # fmt: skip
    return table


def time_table(fits):
    """CPU times of fits of flocs near 40 px."""
    table = Table(
        "CPU ms of one fit of a floc near 40 px, r = 1 px, the fastest of five",
        ("r_eq", "N = 4", "N = 16", "N = 64", "RE at N = 64"),
    )
    for mask, radius in [f for f in fits.flocs if 38.0 <= f[1] <= 43.0]:
        cells = [fastest(mask, count) for count in (4, 16, 64)]
        table.add(f"{radius:.1f}", *cells, fit_mask(mask, vertices=64).relative_error)
    return table


def fastest(mask, vertices):
    """CPU ms of the fastest of several fits."""
    times = []
    for _ in range(REPEATS):
        began = time.process_time()
        fit_mask(mask, vertices=vertices)
        times.append(1e3 * (time.process_time() - began))
    return min(times)


def radius_table(fits, method):
    """RE by spheroradius, N and class, and the change with r floc by floc (claim 3)."""
    table = Table(
        f"Relative error [%] by spheroradius (claim 3), r_eq > 8 px, method {method}",
        ("N", "r = 1 px", "r = 2 px", "r = 4 px", "2 − 1", "4 − 2"),
    )
    rows = {n: [fits.measure(8.0, 99.0, n, r, method)[0] for r in (1.0, 2.0, 4.0)] for n in COUNTS}
    rows["all"] = np.mean(list(rows.values()), axis=0)
    for count, (one, two, four) in rows.items():
        table.add(count, with_half(one), with_half(two), with_half(four), with_half(two - one),
                  with_half(four - two))  # fmt: skip
    return table


def annealed(mask, vertices, radius, draws, hot):
    """Simulated annealing of V over the vertices, changed in place.

    draws (moves, 4): two normal numbers, two from 0 to 1; hot [px]: the temperature, which falls
    to a hundredth with the size of moves, 4 to 0.25 px.
    """
    odd, near = cover(vertices, radius, mask.shape)
    count, moves = len(vertices), len(draws)
    for move in range(moves):
        done = move / moves
        size, heat = 4.0 * 0.0625**done, hot * 0.01**done
        k = int(draws[move, 2] * count)
        before, here, after = neighbours(vertices, k)
        new = here[0] + size * draws[move, 0], here[1] + size * draws[move, 1]
        if not leaves_room(mask.shape, new, radius + 1.0):
            continue
        change, _ = move_vertex(mask, odd, near, before, here, after, new, radius, False)
        if change > 0 and draws[move, 3] >= np.exp(-change / heat):
            continue
        if stays_simple(vertices, k, new[0], new[1]):
            move_vertex(mask, odd, near, before, here, after, new, radius, True)
            vertices[k, 0], vertices[k, 1] = new


def best_of_annealer(mask, vertices, starts, rng):
    """The least RE [%] that an annealer comes to from random points of the outline."""
    room, _ = padded(mask, vertices, 1.0)
    outline, least = trace_outline(room), np.inf
    hot = 0.01 * mask.sum() / vertices
    for _ in range(starts):
        points = outline[np.sort(rng.choice(len(outline), vertices, replace=False))]
        place = np.array(inset(points, room, 1.0))
        moves = MOVES * vertices
        draws = np.column_stack([rng.standard_normal((moves, 2)), rng.uniform(size=(moves, 2))])
        compiled(annealed)(room, place, 1.0, draws, hot)
        least = min(least, searched(room, place, 1.0, STEPS)[1])
    return 100 * least / mask.sum()


def annealer_table(fits, starts):
    """The default against the best that an annealer comes to."""
    table = Table(
        f"RE [%] against the best of {starts} starts of an annealer, r = 1 px, 14 to 26 px",
        ("N", "flocs", "default", "annealer", "the lower of both", "default above that %",
         "s default", "s annealer"),
    )  # fmt: skip
    bounds = CLASSES["14 to 26 px"]
    for count in (4, 8, 16, 32, 64):
        rng, began = np.random.default_rng(count), time.process_time()
        masks = fits.masks(*bounds)
        least = np.array([best_of_annealer(m, count, starts, rng) for m in masks])
        spent = time.process_time() - began
        found, times = fits.measure(*bounds, count)
        both = np.minimum(found, least).mean()
        table.add(count, len(masks), found.mean(), least.mean(), both,
                  100 * (found.mean() / both - 1), 1e-3 * times.sum(), spent)  # fmt: skip
    return table


def main():
    """Print the tables."""
    arguments = parse_arguments(__doc__, images=PICTURES)
    images = checked(arguments.images, "silhouettes")
    print_heading()
    flocs = silhouettes(images)
    fits = Fits(flocs, every=4 if arguments.quick else 1)
    error_table(fits).print(arguments.markdown)
    time_table(fits).print(arguments.markdown)
    annealer_table(Fits(flocs, every=4), 15 if arguments.quick else 150).print(arguments.markdown)
    method_table(fits).print(arguments.markdown)
    sample = Fits(flocs, every=8 if arguments.quick else 3)
    for method in ("pattern", "paper"):
        radius_table(sample, method).print(arguments.markdown)


if __name__ == "__main__":
    main()

"""Relative errors and CPU times of fits on real silhouettes, against the paper's optimiser.

    python -m benchmarks.speed.fit [--quick] [--markdown] [--images DIR]

Means over flocs come with half their 95 % interval (Student).  `even` is the start of `paper`: N
points evenly on the outline, drawn in by r.  The paper counts V over the whole picture anew for
every trial move; that time is computed: its number of counts times the time of one.
"""

import time
from functools import cache, partial

import numpy as np
from scipy import stats

from benchmarks.pictures import PICTURES, checked, silhouettes
from benchmarks.reporting import Table, begin, cpu_of
from flocsim.geometry.fit import fit_mask, search
from flocsim.geometry.fit.coverage import padded
from flocsim.geometry.fit.search import even_start, searched

COUNTS = (4, 8, 16, 28, 64)
CLASSES = {"14 to 26 px": (14.0, 26.0), "4 to 5 px": (4.0, 5.0)}
GOALS = {
    ("14 to 26 px", 4): 15.5, ("14 to 26 px", 8): 6.4, ("14 to 26 px", 16): 2.9,
    ("14 to 26 px", 28): 1.6, ("14 to 26 px", 64): 0.7,
    ("4 to 5 px", 4): 12.5, ("4 to 5 px", 8): 5.1, ("4 to 5 px", 16): 1.5,
}  # fmt: skip
REPEATS = 5


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
        fit = partial(fit_mask, vertices=vertices, radius=radius, method=method)
        found = [cpu_of(fit, mask) for mask in masks]
        return np.array([(each.relative_error, 1e3 * spent) for spent, each in found]).T


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
    _, steps = search.paper_fit(room, start, 1.0)
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
    fit = partial(fit_mask, vertices=vertices)
    return 1e3 * min(cpu_of(fit, mask)[0] for _ in range(REPEATS))


def main():
    """Print the tables."""
    arguments = begin(__doc__, images=PICTURES)
    flocs = silhouettes(checked(arguments.images, "silhouettes"))
    fits = Fits(flocs, every=4 if arguments.quick else 1)
    error_table(fits).print()
    time_table(fits).print()
    method_table(fits).print()


if __name__ == "__main__":
    main()

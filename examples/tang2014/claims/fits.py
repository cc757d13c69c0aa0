"""Claims 1 to 5, 20 to 22 and 25: relative errors (RE, paper eq. 2) of fits, and flocs' sizes."""

import itertools

import attrs
import numpy as np

from flocsim.io.plots.shapes import CLASS_LIMIT

from .resampling import RESAMPLES, SEED, resampled_means
from .trends import kendall
from .verdicts import MissingData, above, always, below, everywhere, within

SPHERE_ERROR = 32.0
"""RE [%] that spheres reach, as the paper says."""
BEST_ERROR = 1.0
BEST_VERTICES = 64
ERRORS = (0.5, 20.0)
"""RE [%] of spheropolygons, from the best to the worst, as the abstract says."""
LEAST_AT = 28
"""N at which RE of small flocs is least, as the paper says."""
CONSTANT = 0.25
"""Range of RE over N, over its mean, up to which it counts as relatively constant."""


def errors_of(entries, large=None, radius=None):
    """(N (k,), RE [%] (flocs, k)) of one spheroradius [px] (default: the least) and size class."""
    radius = min(entry.spheroradius for entry in entries) if radius is None else radius
    members = [
        entry for entry in entries
        if entry.spheroradius == radius
        and large in (None, entry.equivalent_radius > CLASS_LIMIT)
    ]  # fmt: skip
    if not members:
        raise MissingData("a size class has no flocs")
    counts = sorted(members[0].fits)
    errors = [[entry.fits[n].relative_error for n in counts] for entry in members]
    return np.array(counts), np.array(errors)


def class_name(large):
    """Of a size class, at 1 µm a pixel."""
    return f"r_eq {'>' if large else '≤'} {CLASS_LIMIT:g} px"


def sphere_error(entries):
    """(1) The mean RE of equivalent spheres in both classes."""
    for large in (False, True):
        counts, errors = errors_of(entries, large)
        if 1 not in counts:
            raise MissingData("the library has no spheres")
        means = resampled_means(errors[:, counts == 1])[:, 0]
        yield above(f"mean RE [%] of spheres, {class_name(large)}", means, SPHERE_ERROR)


def polygon_error(entries):
    """(2) RE of spheropolygons less that of spheres, the largest over N."""
    for large in (False, True):
        counts, errors = errors_of(entries, large)
        differences = resampled_means(errors[:, counts > 1] - errors[:, counts == 1])
        what = f"largest mean RE less that of spheres, {class_name(large)}"
        yield below(what, differences.max(axis=1))
        less = errors[:, counts > 1] < errors[:, counts == 1]
        yield always(f"spheropolygons with RE below their sphere's, {class_name(large)}",
                     int(less.sum()), less.size)  # fmt: skip


def radius_error(entries):
    """(3) RE at r less RE at the next larger r: the mean over N and flocs, and "in all tests"."""
    radii = sorted({entry.spheroradius for entry in entries})
    if len(radii) < 2:
        raise MissingData("the library has one spheroradius; fit with --radius 1,2,4")
    for small, large in itertools.pairwise(radii):
        counts, less = errors_of(entries, radius=small)
        _, more = errors_of(entries, radius=large)
        means = resampled_means((less - more)[:, counts > 1].mean(axis=1))
        yield below(f"RE(r = {small:g} px) - RE(r = {large:g} px) [%]", means)
        tests = {}
        for size in (False, True):
            counts, less = errors_of(entries, size, small)
            _, more = errors_of(entries, size, large)
            for n, samples in zip(counts, resampled_means(less - more).T, strict=True):
                if n > 1:
                    tests[f"{class_name(size)} N={n}"] = below("", samples)
        yield everywhere(f"RE rises from r = {small:g} to {large:g} px, each class and N", tests)


def error_trend(entries):
    """(4) Kendall's τ of the mean RE with N, large flocs."""
    counts, errors = errors_of(entries, large=True)
    means = resampled_means(errors[:, counts > 1])
    yield below(f"τ(RE, N), {class_name(True)}", kendall(means.T))


def best_error(entries):
    """(5) The mean RE at N = 64."""
    found = []
    for large in (False, True):
        counts, errors = errors_of(entries, large)
        if BEST_VERTICES not in counts:
            raise MissingData(f"the library has no N = {BEST_VERTICES}")
        found.append(resampled_means(errors[:, counts == BEST_VERTICES])[:, 0])
    best = min(found, key=lambda means: means[0])
    yield below(f"least class mean of RE [%], N = {BEST_VERTICES}", best, BEST_ERROR)


def range_of_errors(entries):
    """(20) Spheropolygons' mean RE of both classes, r = 1: from 0.5 % or less to 20 % at most."""
    found = []
    for large in (False, True):
        counts, errors = errors_of(entries, large)
        found.append(resampled_means(errors[:, counts > 1]))
    means = np.concatenate(found, axis=1)
    yield below("least class mean of RE [%], N > 1", means.min(axis=1), ERRORS[0])
    yield below("largest class mean of RE [%], N > 1", means.max(axis=1), ERRORS[1])


def least_error_at(entries):
    """(21) Small flocs, r = 1: the mean RE is least at N = 28."""
    counts, errors = errors_of(entries, large=False)
    if LEAST_AT not in counts:
        raise MissingData(f"the library has no N = {LEAST_AT}")
    counts, errors = counts[counts > 1], errors[:, counts > 1]
    least = counts[np.argmin(resampled_means(errors), axis=1)].astype(float)
    yield within(f"N of the least mean RE, {class_name(False)}", least, LEAST_AT, LEAST_AT)


def constant_error(entries):
    """(22) Small flocs at larger r: the mean RE changes little with N."""
    radii = sorted({entry.spheroradius for entry in entries})[1:]
    if not radii:
        raise MissingData("the library has one spheroradius; fit with --radius 1,2,4")
    for radius in radii:
        counts, errors = errors_of(entries, False, radius)
        means = resampled_means(errors[:, counts > 1])
        spread = (means.max(axis=1) - means.min(axis=1)) / means.mean(axis=1)
        what = f"range of mean RE over N, over its mean, {class_name(False)}, r = {radius:g} px"
        yield below(what, spread, CONSTANT)


def sizes(entries):
    """(25) r_eq of the flocs: more small ones than large ones, the mean above the median.

    The paper's: 2,596 flocs of 1.69 to 35.55 µm, mean 6.53, median 5.44 µm (Fig. 2).
    """
    radius = min(entry.spheroradius for entry in entries)
    found = np.array([e.equivalent_radius for e in entries if e.spheroradius == radius])
    drawn = np.random.default_rng(SEED).integers(0, len(found), (RESAMPLES, len(found)))
    drawn = found[np.vstack([np.arange(len(found)), drawn])]
    ratios = drawn.mean(axis=1) / np.median(drawn, axis=1)
    part = above("mean r_eq over the median", ratios, 1.0)
    note = (f"{len(found)} flocs, {found.min():.2f} to {found.max():.2f} px, mean "
            f"{found.mean():.2f}, median {np.median(found):.2f}")  # fmt: skip
    yield attrs.evolve(part, note=note)

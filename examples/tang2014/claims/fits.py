"""Claims 1 to 5: relative errors (RE, paper eq. 2) of the fits, from a shape library's entries."""

import itertools

import numpy as np

from flocsim.io.shapes.fit_report import CLASS_LIMIT

from .resampling import resampled_means
from .trends import kendall
from .verdicts import MissingData, above, below

SPHERE_ERROR = 32.0
"""RE [%] that spheres reach, as the paper says."""
BEST_ERROR = 1.0
BEST_VERTICES = 64


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


def radius_error(entries):
    """(3) RE at r less RE at the next larger r, mean over N and flocs."""
    radii = sorted({entry.spheroradius for entry in entries})
    if len(radii) < 2:
        raise MissingData("the library has one spheroradius; fit with --radius 1,2,4")
    for small, large in itertools.pairwise(radii):
        counts, less = errors_of(entries, radius=small)
        _, more = errors_of(entries, radius=large)
        means = resampled_means((less - more)[:, counts > 1].mean(axis=1))
        yield below(f"RE(r = {small:g} px) - RE(r = {large:g} px) [%]", means)


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

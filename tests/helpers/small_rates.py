"""Rates of a kernel study, and strengths of bonds, that nobody computed."""

import math

import numpy as np

from flocsim.ensembles.strength.distribution import strengths_of
from flocsim.ensembles.strength.opening import FAILED, HOLDS, OPENED, OPENS_AT_LEAST, Opening
from flocsim.io.results.kernel_group import KERNEL, Kernel

AXES = ("I", "III"), np.array([1, 16]), np.array([0.0, 0.5])


def some_kernel():
    """Two mechanisms, two N, two classes; bodies of one size do not settle onto each other."""
    shape = (2, 2, 2, 2)
    arrays = {name: np.arange(1.0, 17.0).reshape(shape) * (k + 1) for k, name in enumerate(KERNEL)}
    for values in arrays.values():
        values[...] = 0.5 * (values + np.swapaxes(values, 2, 3))
    diagonal = np.arange(2)
    arrays["beta3_reference"][0, :, diagonal, diagonal] = 0.0
    arrays["efficiency3"][0, :, diagonal, diagonal] = np.nan
    return Kernel(
        ("settling", "shear"), np.array([1, 32]), ("5um", "10um"), np.array([5e-6, 1e-5]), arrays
    )


def mixed(complete=True):
    """One doublet of each kind in one condition."""
    openings = [
        Opening(1.0, 2.0, OPENED, 9, 1e-11), Opening(math.nan, 0.5, OPENS_AT_LEAST, 1, 1e-11),
        Opening(64.0, math.nan, HOLDS, 21, 1e-10), Opening(4.0, math.nan, FAILED, 3, 1e-9),
    ]  # fmt: skip
    places = np.array([[1, 0, 1, k, 2] for k in range(4)])
    bound = np.zeros((2, 2, 2), dtype=np.int64)
    bound[1, 0, 1] = 6
    about = {"flow": "shear", "precision": 0.005, "asked": 4, "complete": complete}
    return strengths_of(AXES, bound, places, openings, about)

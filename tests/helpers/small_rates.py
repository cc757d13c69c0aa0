"""Rates of a kernel study, and strengths of bonds, that nobody computed."""

import math

import numpy as np

from flocsim.io.results.kernel_group import KERNEL, Kernel
from flocsim.io.results.strength_file import (
    FAILED,
    HOLDS,
    OPENED,
    OPENS_AT_LEAST,
    strengths_of,
)

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
    columns = {
        "type": [1] * 4, "vertices": [0] * 4, "delta": [1] * 4, "replicate": range(4),
        "bond": [2] * 4, "holds": [1.0, math.nan, 64.0, 4.0], "opens": [2.0, 0.5, *[math.nan] * 2],
        "status": [OPENED, OPENS_AT_LEAST, HOLDS, FAILED], "runs": [9, 1, 21, 3],
        "tolerance": [1e-11, 1e-11, 1e-10, 1e-9],
    }  # fmt: skip
    columns = {name: np.array(values) for name, values in columns.items()}
    bound = np.zeros((2, 2, 2), dtype=np.int64)
    bound[1, 0, 1] = 6
    about = {"flow": "shear", "precision": 0.005, "complete": complete}
    return strengths_of(AXES, bound, columns, about)

"""Where the real pictures are: not part of the project, tests that need them skip without them."""

import csv
import os
from pathlib import Path

import numpy as np
import pytest

IMAGES = Path(os.environ.get("FLOCSIM_IMAGES", Path(__file__).parents[3] / "shared/images"))


def real_image(name):
    """The path of a real picture; skips the test where there is none."""
    if not (IMAGES / name).exists():
        pytest.skip(f"no real picture {IMAGES / name}: set FLOCSIM_IMAGES to their folder")
    return IMAGES / name


def silhouettes():
    """Pairs (mask, r_eq [px]) of real flocs."""
    packed = np.load(real_image("silhouettes/flocs_open.npz"))
    with open(real_image("silhouettes/flocs_open.csv"), newline="") as table:
        rows = list(csv.DictReader(table))
    return [
        (unpack(packed[row["key"]], shape), float(row["r_eq_px"]))
        for row, shape in zip(rows, packed["shapes"], strict=True)
    ]


def unpack(bits, shape):
    """A mask of the given shape from its packed bits."""
    return np.unpackbits(bits)[: shape.prod()].reshape(shape).astype(bool)

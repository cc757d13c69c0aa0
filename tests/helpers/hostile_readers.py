"""Readers of every kind of file, each with the maker of hostile ones: valid files that are changed
through h5py, in their bytes, in their JSON, and sealed again (tests/helpers/hostile_files.py)."""

import contextlib
import itertools
import math
import random
import warnings

import numpy as np

from flocsim.errors import ConfigError, FlocsimError
from tests.helpers import hostile_files
from tests.helpers.hostile_files import hdf5_file


def read_results_file(path):
    """Read it in all ways."""
    from flocsim.ensembles.contents import info_of
    from flocsim.io.results.file import read_results

    dict(read_results(path).replicates)
    info_of(path)


def read_kernel_file(path):
    """Read it, and make the tables for other models."""
    from flocsim.io.results.file import read_results
    from flocsim.io.results.kernel_tables import kernel_matrix

    read_results_file(path)
    kernel = read_results(path).kernel
    if kernel is not None:
        for mechanism in kernel.mechanisms:
            for vertices in kernel.vertices.tolist():
                kernel_matrix(kernel, mechanism, vertices)


def read_strengths_file(path):
    """Read it, describe it, draw it."""
    from flocsim.io.plots.curves import over_rate
    from flocsim.io.results.strength_file import read_strengths, table_of

    found = read_strengths(path)
    table_of(found)
    over_rate(found)


def read_library_file(path):
    """Read it, and make the shapes."""
    from flocsim.ensembles.contents import info_of
    from flocsim.io.shape_library import read_library

    entries = read_library(path)
    for entry in entries:
        for fit in entry.fits.values():
            assert np.isfinite(fit.table.place).all() and np.isfinite(fit.table.radius).all()
            assert math.isfinite(fit.shape.area)
        assert math.isfinite(entry.equivalent_radius / entry.spheroradius)
    info_of(path)


def read_picture_file(path):
    """Read it as a picture and as a mask, and look for flocs."""
    from flocsim.io.images.masks import read_masks, segment_mask
    from flocsim.io.images.pictures import segment
    from flocsim.io.images.reading import read_grey

    try:
        grey = read_grey(path)
        assert np.isfinite(grey).all() and grey.min() >= 0.0 and grey.max() <= 1.0
        if grey.size < 20_000:
            segment(grey)
    finally:
        for _, mask in read_masks(path):
            if mask.size < 20_000:
                segment_mask(mask)


def read_masks_file(path):
    """Read the masks and look for flocs."""
    from flocsim.io.images.masks import read_masks, segment_mask

    for _, mask in read_masks(path):
        assert mask.ndim == 2 and mask.min() >= 0
        if mask.size < 20_000:
            segment_mask(mask)


def read_swarm_file(path):
    """Read it, describe it, and make the shapes."""
    from flocsim.ensembles.contents import info_of
    from flocsim.io.plots.swarm import shape_of
    from flocsim.io.results.swarm_file import SWARMS

    found = SWARMS.read(path)
    replicates, _, bodies = found.groups["snapshots"]["cluster"].shape
    for replicate in range(min(replicates, 3)):
        for body in range(min(bodies, 5)):
            assert math.isfinite(shape_of(found, replicate, body).area)
    info_of(path)


def read_sweep_file(path):
    """Read it, and describe it."""
    from flocsim.ensembles.contents import info_of
    from flocsim.ensembles.sweep import read_joined

    read_joined(path)
    info_of(path)


def read_trajectory_file(path):
    """Read it; the motion that was believed is one."""
    from flocsim.io.trajectory import read_trajectory

    found = read_trajectory(path)
    assert np.isfinite(found.position).all() and len(found.shapes) == found.position.shape[1]


MAKERS = {
    "results": (hdf5_file(hostile_files.valid_results), read_results_file),
    "kernels": (hdf5_file(hostile_files.valid_kernel), read_kernel_file),
    "libraries": (hdf5_file(hostile_files.valid_library), read_library_file),
    "compounds": (hdf5_file(hostile_files.valid_compounds), read_library_file),
    "strengths": (hdf5_file(hostile_files.valid_strengths), read_strengths_file),
    "swarms": (hdf5_file(hostile_files.valid_swarm), read_swarm_file),
    "sweeps": (hdf5_file(hostile_files.valid_sweep), read_sweep_file),
    "trajectories": (hdf5_file(hostile_files.valid_trajectory), read_trajectory_file),
    "pictures": (hostile_files.picture_file, read_picture_file),
    "masks": (hostile_files.masks_file, read_masks_file),
}


def made(kind, number, folder):
    """Return the file of a number; a change that its library refuses to write is left out."""
    for attempt in itertools.count():
        with contextlib.suppress(Exception):
            return MAKERS[kind][0](random.Random(f"{kind} {number} {attempt}"), folder)


def is_refused(read, path):
    """Return True for a file that is refused in plain words, False for one that is read."""
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            read(path)
    except FlocsimError as error:
        lines = str(error).split("\n")
        assert all(line.isprintable() for line in lines), repr(str(error))
        assert len(lines) == 1 or isinstance(error, ConfigError), str(error)
        return True
    return False

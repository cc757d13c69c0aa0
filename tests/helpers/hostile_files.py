"""Valid small files of every kind that flocsim reads, and such with something done to them.

A `valid_…` gives the HDF5 data of a file. Each maker `…_file` takes a ``random.Random`` and a
folder and returns the path of a new, changed file; checksums are right, as anyone can make them.
"""

import contextlib
import io
import json
from functools import cache

import attrs
import h5py
import numpy as np
from PIL import Image

from flocsim import Sphere
from flocsim.ensembles.contents import open_any
from flocsim.ensembles.sweep import joined
from flocsim.io.results.schema import POOLED
from flocsim.io.results.sweep_file import SweepResults, Swept, write_sweep
from flocsim.io.shape_library import ShapeEntry, StoredFit, write_library
from flocsim.io.trajectory import write_trajectory
from tests.helpers.compound_shapes import beads, cross, framed
from tests.helpers.results_files import write_results
from tests.helpers.sealed import read_sealed, seal
from tests.helpers.small_rates import mixed, some_kernel
from tests.helpers.small_study import VALID, write_star_library
from tests.helpers.swarm_study import make_swarm_results
from tests.helpers.synthetic_results import make_results

ODD_WORDS = (0, 1, 2**31 - 1, 2**31, 2**32 - 1, 2**62, 2**63, 2**64 - 1)
ODD_VALUES = (
    None, True, -1, 0, 3, 2**31, 2**63, 10**40, 0.5, -0.0, 1e308, "", "I", "\x1b[31m", "a\nb",
    "\ud800", "x" * 10_000, [], [1], {}, {"a": {}}, [[[[[[[[[[[[]]]]]]]]]]]],
)  # fmt: skip
ODD_TEXTS = ("nan", "1e999", "-Infinity", "[" * 5000, '"\\ud800"', "{", "", "9" * 5000, "\x1b[2J")
ODD_NUMBERS = (0, 1, 5, 200, -1, 2**31 - 1, 2**62, np.nan, np.inf, -np.inf, 1e300, 1.5)


def flip(rng, data, most=8):
    """Return bytes with some of them changed: bits, odd words, pieces from elsewhere, gaps."""
    found = bytearray(data)
    for _ in range(rng.randint(1, most)):
        place, kind = rng.randrange(max(len(found), 1)), rng.randrange(4)
        if not found:
            break
        if kind == 0:
            found[place] ^= 1 << rng.randrange(8)
        elif kind == 1:
            word = rng.choice([*ODD_WORDS, rng.randrange(len(found))])
            found[place : place + 8] = word.to_bytes(8, rng.choice(["little", "big"]))
        elif kind == 2:
            other, length = rng.randrange(len(found)), rng.randint(1, 64)
            found[place : place + length] = found[other : other + length]
        else:
            del found[place : place + rng.choice([1, 4, 16, len(found)])]
    return bytes(found)


def written(folder, name, data):
    """Return the path of a file of these bytes."""
    path = folder / name
    path.write_bytes(data)
    return path


# Valid HDF5 files ------------------------------------------------------------------------------


@cache
def valid_results(folder):
    """Return the HDF5 data of a small results file."""
    results = make_results(types=("I", "III"), vertices=(1, 8), delta=(0.0, 0.7), count=5)
    notes = [{"type": "I", "vertices": 1, "delta": 0.0, "replicate": 1, "why": "odd"}]
    run = results.run | {
        "config": VALID, "identity": json.dumps({"seed": 1}), "failed": json.dumps(notes),
        "history": json.dumps([{"date": "2020", "command": "x"}]), "overrides": "{}",
    }  # fmt: skip
    write_results(folder / "valid.h5", attrs.evolve(results, flocs=("a", "b", "c", "d"), run=run))
    return read_sealed(folder / "valid.h5")


@cache
def valid_library(folder):
    """Return the HDF5 data of a small shape library."""
    write_star_library(folder / "valid-library.h5", vertices=(1, 4, 8))
    return read_sealed(folder / "valid-library.h5")


@cache
def valid_compounds(folder):
    """Return the HDF5 data of a small library of shapes with holes and of several parts."""
    fits = {}
    for make in (framed, beads, cross):
        shape = make(1e-6)
        fits[len(shape.vertices)] = StoredFit(shape.parts, 1.0)
    entry = ShapeEntry("a floc", "flocs.png", 1e-6, (0.0, 0.0), 100, 8.0, 1.0, fits)
    write_library(folder / "valid-compounds.h5", [entry])
    return read_sealed(folder / "valid-compounds.h5")


@cache
def valid_kernel(folder):
    """Return the HDF5 data of a small results file of a kernel study."""
    kernel = some_kernel()
    vertices = tuple(kernel.vertices.tolist())
    results = make_results(types=("I", "III"), vertices=vertices, delta=(1.0,), count=5)
    write_results(folder / "valid-kernel.h5", attrs.evolve(results, kernel=kernel))
    return read_sealed(folder / "valid-kernel.h5")


@cache
def valid_strengths(folder):
    """Return the HDF5 data of a small file of strengths of bonds."""
    mixed().write(folder / "valid-strengths.h5")
    return read_sealed(folder / "valid-strengths.h5")


@cache
def valid_swarm(folder):
    """Return the HDF5 data of a small results file of swarms."""
    make_swarm_results().write(folder / "valid-swarm.h5")
    return read_sealed(folder / "valid-swarm.h5")


@cache
def valid_sweep(folder):
    """Return the HDF5 data of a small joined file of a sweep."""
    results = make_results(types=("I",), vertices=(1, 8), delta=(0.0, 0.7), count=5)
    results = attrs.evolve(results, pooled={name: np.zeros(results.shape[:2]) for name in POOLED})
    write_results(folder / "part.h5", results)
    parts = [open_any(folder / "part.h5")] * 2
    swept = {"potential": Swept("forces.double_layer.potential", [-0.02, -0.03], "V")}
    path = folder / "valid-sweep.h5"
    write_sweep(SweepResults(path, swept, joined(swept, parts)))
    return read_sealed(path)


@cache
def valid_trajectory(folder):
    """Return the HDF5 data of a small trajectory file, of a sphere and a shape with a hole."""
    rng = np.random.default_rng(4)
    arrays = np.sort(rng.random(5)), rng.random((5, 2, 3)), rng.random((5, 2, 3))
    path = folder / "valid-trajectory.h5"
    write_trajectory(path, (*arrays, (Sphere(2e-6), framed(1e-6))), {"replicate": 3, "end": "I"})
    return read_sealed(path)


# Changed HDF5 files ----------------------------------------------------------------------------


def change_json(rng, value):
    """Return a JSON value with something odd somewhere in it."""
    if isinstance(value, dict) and value and rng.random() < 0.85:
        key = rng.choice(list(value))
        changed = dict(value)
        if rng.random() < 0.15:
            del changed[key]
        else:
            changed[key] = change_json(rng, value[key])
        return changed
    if isinstance(value, list) and value and rng.random() < 0.7:
        place = rng.randrange(len(value))
        return [*value[:place], change_json(rng, value[place]), *value[place + 1 :]]
    return rng.choice(ODD_VALUES)


def change_values(rng, file, path):
    """Put odd values into a dataset; into a text, as JSON has it, an odd one or odd parts."""
    dataset = file[path]
    if not isinstance(dataset, h5py.Dataset) or dataset.size == 0:
        return
    if dataset.dtype.kind == "O" and dataset.shape == ():
        try:
            changed = json.dumps(change_json(rng, json.loads(dataset.asstr()[()])))
        except (ValueError, RecursionError):
            changed = rng.choice(ODD_TEXTS)
        dataset[()] = changed
    elif dataset.dtype.kind == "O":
        dataset[rng.randrange(dataset.shape[0])] = rng.choice(ODD_TEXTS)
    else:
        with np.errstate(all="ignore"):
            flat = np.array(dataset[()]).reshape(-1).astype(float)
            flat[rng.randrange(flat.size) :: rng.choice([1, 2, 10**9])] = rng.choice(ODD_NUMBERS)
            dataset[...] = flat.reshape(dataset.shape).astype(dataset.dtype)


def changed_hdf5(rng, data):
    """Return HDF5 data with one or two things changed through h5py."""
    image = io.BytesIO(data)
    with h5py.File(image, "r+") as file:
        for _ in range(rng.randint(1, 2)):
            paths: list = []
            file.visit(paths.append)
            path = rng.choice(paths)
            # What h5py itself refuses to write stays as it is.
            with contextlib.suppress(ValueError, TypeError, KeyError, OSError, RuntimeError):
                if rng.random() < 0.7:
                    change_values(rng, file, path)
                    continue
                del file[path]
                file[path] = rng.choice([np.zeros((3, 2)), np.arange(5), h5py.SoftLink("/run")])
    return image.getvalue()


def hdf5_file(valid):
    """Return a maker of sealed files, changed through h5py or in their bytes, or cut short."""

    def make(rng, folder):
        data, kind = valid(folder), rng.randrange(8)
        if kind < 4:
            data = changed_hdf5(rng, data)
        elif kind < 7:
            data = flip(rng, data)
        else:
            data = data[: rng.randrange(len(data))]
        return written(folder, "bad.h5", seal(data))

    return make


# Pictures and masks ----------------------------------------------------------------------------


def picture_file(rng, folder):
    """Return a picture of some format and mode with a floc or two, changed in its bytes."""
    height, width = rng.choice([(1, 1), (1, 40), (40, 50), (60, 30)])
    y, x = np.mgrid[:height, :width]
    grey = (40.0 + 10 * np.sin(x) + 150 * (np.hypot(x - 20, y - 20) < 9)).astype("u1")
    suffix, file = rng.choice(["png", "jpeg", "bmp", "tiff"]), io.BytesIO()
    mode = rng.choice(["L", "1"] if suffix == "bmp" else ["L", "1", "RGB", "CMYK"])
    if suffix == "tiff" and rng.random() < 0.4:
        # Of kinds that Pillow does not read: 16-bit colours, floats of half size, planes.
        import tifffile

        kind = rng.choice(["u2", "f2", "f4", "i2", "c8", "u8"])
        shape = rng.choice([(20, 30, 3), (20, 30), (3, 20, 30), (2, 20, 30, 3)])
        tifffile.imwrite(file, np.zeros(shape, kind), photometric="minisblack")
    else:
        Image.fromarray(grey).convert("RGB" if suffix == "png" else mode).save(file, suffix)
    return written(folder, f"p.{suffix}", flip(rng, file.getvalue(), 3))


def masks_file(rng, folder):
    """Return a .npz file of two masks, changed in its bytes."""
    np.savez_compressed(file := io.BytesIO(), a=np.eye(20, dtype=bool), b=np.arange(60) // 30)
    return written(folder, "m.npz", flip(rng, file.getvalue()))

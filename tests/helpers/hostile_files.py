"""Files of every kind that flocsim reads, made by an enemy: valid ones with something done to them.

Each maker takes a ``random.Random`` and a folder and returns the path of a new file; checksums are
right, since anyone can make them.
"""

import io
import json
import os
import struct
import zipfile
import zlib
from functools import cache

import attrs
import h5py
import numpy as np
from PIL import Image

from flocsim import Sphere
from flocsim.ensembles.contents import open_any
from flocsim.ensembles.kind import Condition, layout
from flocsim.ensembles.storage.row_store import key_of
from flocsim.ensembles.sweep import joined
from flocsim.geometry.shapes.cores import table_of
from flocsim.io.journal import CHUNK, SESSION
from flocsim.io.results.schema import POOLED, blank
from flocsim.io.results.strength_file import write_strengths
from flocsim.io.results.swarm_file import write_swarm
from flocsim.io.results.sweep_file import SweepResults, Swept, write_sweep
from flocsim.io.seals import seal
from flocsim.io.shape_library import ShapeEntry, StoredFit, write_library
from flocsim.io.trajectory import write_trajectory
from tests.helpers.compound_shapes import beads, cross, framed
from tests.helpers.journals import write_records
from tests.helpers.results_files import write_results
from tests.helpers.sealed import read_sealed
from tests.helpers.small_rates import mixed, some_kernel
from tests.helpers.small_study import VALID, write_star_library
from tests.helpers.swarm_study import make_swarm_results
from tests.helpers.synthetic_results import make_results

ODD_NUMBERS = (0, 1, 2, 3, 4, 7, 8, 0x10, 0x7F, 0x80, 0xFE, 0xFF)
ODD_WORDS = (0, 1, 2**31 - 1, 2**31, 2**32 - 1, 2**62, 2**63, 2**64 - 1)
ODD_VALUES = (
    None, True, -1, 0, 3, 2**31, 2**63, 10**40, 0.5, -0.0, 1e308, "", "I", "\x1b[31m", "a\nb",
    "\ud800", "x" * 10_000, [], [1], {}, {"a": {}}, [[[[[[[[[[[[]]]]]]]]]]]],
)  # fmt: skip
ODD_TEXTS = ("nan", "1e999", "-Infinity", "[" * 5000, '"\\ud800"', "{", "", "9" * 5000, "\0")


def flip(rng, data, most=8):
    """Bytes with some of them changed: bits, odd numbers, odd addresses, pieces from elsewhere."""
    found = bytearray(data)
    for _ in range(rng.randint(1, most)):
        place, kind = rng.randrange(max(len(found), 1)), rng.randrange(6)
        if not found:
            break
        if kind == 0:
            found[place] ^= 1 << rng.randrange(8)
        elif kind == 1:
            found[place] = rng.choice(ODD_NUMBERS)
        elif kind == 2:
            word = rng.choice([*ODD_WORDS, rng.randrange(len(found))])
            place -= place % 8
            found[place : place + 8] = word.to_bytes(8, rng.choice(["little", "big"]))
        elif kind == 3:
            other, length = rng.randrange(len(found)), rng.randint(1, 64)
            found[place : place + length] = found[other : other + length]
        elif kind == 4:
            found[place : place + 4] = rng.choice(ODD_WORDS[:5]).to_bytes(4, "big")
        else:
            del found[place : place + rng.choice([1, 4, 16, len(found)])]
    return bytes(found)


def written(folder, name, data):
    """A file of these bytes."""
    path = folder / name
    path.write_bytes(data)
    return path


# Results and libraries -------------------------------------------------------------------------


@cache
def valid_results(folder):
    """The HDF5 data of a small results file."""
    results = make_results(types=("I", "III"), vertices=(1, 8), delta=(0.0, 0.7), count=5)
    notes = [{"type": "I", "vertices": 1, "delta": 0.0, "replicate": 1, "why": "odd"}]
    run = results.run | {
        "config": VALID, "identity": json.dumps({"seed": 1}), "failed": json.dumps(notes),
        "history": json.dumps([{"date": "2020", "command": "x"}]), "overrides": "{}",
        "cpus": json.dumps([{"cpu": "a", "compiled_for": "a", "features": [], "numpy": [],
                             "libm": []}]),
    }  # fmt: skip
    write_results(folder / "valid.h5", attrs.evolve(results, flocs=("a", "b", "c", "d"), run=run))
    return read_sealed(folder / "valid.h5")


@cache
def valid_library(folder):
    """The HDF5 data of a small shape library."""
    write_star_library(folder / "valid-library.h5", vertices=(1, 4, 8))
    return read_sealed(folder / "valid-library.h5")


@cache
def valid_compounds(folder):
    """The HDF5 data of a small library of shapes with holes and of several parts."""
    fits = {}
    for make in (framed, beads, cross):
        shape = make(1e-6)
        table = table_of(shape.parts)
        fits[len(shape.vertices)] = StoredFit(shape.vertices, shape.radius, 1.0, table)
    entry = ShapeEntry("a floc", "flocs.png", 1e-6, (0.0, 0.0), 100, 8.0, 1.0, fits)
    write_library(folder / "valid-compounds.h5", [entry])
    return read_sealed(folder / "valid-compounds.h5")


@cache
def valid_kernel(folder):
    """The HDF5 data of a small results file of a kernel study."""
    kernel = some_kernel()
    vertices = tuple(kernel.vertices.tolist())
    results = make_results(types=("I", "III"), vertices=vertices, delta=(1.0,), count=5)
    write_results(folder / "valid-kernel.h5", attrs.evolve(results, kernel=kernel))
    return read_sealed(folder / "valid-kernel.h5")


@cache
def valid_strengths(folder):
    """The HDF5 data of a small file of strengths of bonds."""
    write_strengths(folder / "valid-strengths.h5", mixed())
    return read_sealed(folder / "valid-strengths.h5")


def objects_of(file):
    """The paths of all groups and datasets of an open HDF5 file."""
    found = []
    file.visit(found.append)
    return found


ELSEWHERE = os.devnull
"""Where hostile files say that their data lie: HDF5 opens it for writing too, so that it must be a
place in which nothing can be overwritten, whoever runs the tests."""


def change_values(rng, file, path):
    """Odd values in a dataset."""
    dataset = file[path]
    if not isinstance(dataset, h5py.Dataset) or dataset.size == 0:
        return
    if dataset.external or dataset.is_virtual:
        return  # what is written there would go into another file
    values = dataset[()]
    if dataset.dtype.kind == "O":
        texts = [*ODD_TEXTS, *(each for each in ODD_VALUES if isinstance(each, str))]
        text = rng.choice(texts).encode("utf-8", "replace").decode().replace("\0", "")
        if dataset.shape == ():
            dataset[()] = text
        else:
            dataset[rng.randrange(dataset.shape[0])] = text
        return
    odd = (0, 1, 5, 7, 200, 255, -1, -5, 2**31 - 1, 2**62, np.nan, np.inf, -np.inf, 1e300, 1.5)
    values = np.array(values)
    with np.errstate(all="ignore"):
        flat = values.reshape(-1).astype(float)
        flat[rng.randrange(flat.size) :: rng.choice([1, 2, 10**9])] = rng.choice(odd)
        dataset[...] = flat.reshape(values.shape).astype(dataset.dtype)


def replace_dataset(rng, file, path):
    """Another dataset in its place: of another type or shape, packed, elsewhere, or a link."""
    found = file[path]
    group, name = found.parent, path.rpartition("/")[2]
    values = found[()] if isinstance(found, h5py.Dataset) else np.zeros(3)
    del file[path]
    kind, shape = rng.randrange(12), np.shape(values)
    number = np.zeros(shape) if np.asarray(values).dtype.kind == "O" else np.asarray(values)
    if kind == 0:
        group[name] = number.astype(rng.choice(["i1", "f4", ">f8", "c16", "u8", "i2"]))
    elif kind == 1:
        group[name] = np.zeros((*shape, 2))
    elif kind == 2:
        group.create_dataset(name, (2**20, 2**20), "u1", chunks=(2**10, 2**10), compression="gzip")
    elif kind == 3:
        group.create_dataset(name, (4,), "u1", external=[(ELSEWHERE, 0, 4)])
    elif kind == 4:
        group[name] = h5py.SoftLink("/" + rng.choice(["replicates", "fits", name, "."]))
    elif kind == 5:
        group[name] = h5py.ExternalLink(ELSEWHERE, "/")
    elif kind == 6:
        plan = h5py.VirtualLayout(shape=(4,), dtype="f8")
        plan[:] = h5py.VirtualSource("other.h5", "x", shape=(4,))
        group.create_virtual_dataset(name, plan)
    elif kind == 7:
        group.create_group(name)
    elif kind == 8:
        group[name] = group  # a hard link to itself
    elif kind == 9:
        group.create_dataset(name, (3,), "f8", maxshape=(None,), chunks=(3,))
    elif kind == 10:
        group[name] = h5py.Empty("f8")
    else:
        group[name] = np.array([(1, 2.0)], dtype=[("a", "i4"), ("b", "f8")])


def change_attributes(rng, file, path):
    """An attribute more, another, or none."""
    attributes = file[path].attrs
    names = [*attributes, "extra", "format", "kind", "schema_version", "units"]
    name = rng.choice(names)
    if rng.random() < 0.2 and name in attributes:
        del attributes[name]
        return
    odd = (1, 2, -1, 0.5, "x", "a b c", "\x1b[2J", [1, 2], np.zeros((2, 2)), np.float32(1), b"x",
           h5py.Empty("f8"), "y" * 30_000)  # fmt: skip
    attributes[name] = rng.choice(odd)


def changed_hdf5(rng, data):
    """The HDF5 data with one or two things changed through h5py."""
    image = io.BytesIO(data)
    with h5py.File(image, "r+") as file:
        for _ in range(rng.randint(1, 2)):
            paths = objects_of(file)
            path = rng.choice(paths)
            work = rng.choice([change_values, change_values, replace_dataset, change_attributes])
            try:
                if rng.random() < 0.1:
                    del file[path]
                elif rng.random() < 0.05:
                    file.move(path, path + "x")
                else:
                    work(rng, file, rng.choice([path, path]))
            except (ValueError, TypeError, KeyError, OSError, OverflowError, RuntimeError):
                pass  # h5py itself refuses to write it
    return image.getvalue()


def hostile_hdf5(rng, data):
    """Sealed data, changed through h5py or in its bytes; now and then not even sealed."""
    kind = rng.randrange(8)
    if kind < 4:
        data = changed_hdf5(rng, data)
    elif kind < 7:
        # Most bytes are values: those that describe them are at the places of its small blocks.
        data = flip(rng, data)
    else:
        data = data[: rng.randrange(len(data))]
    return seal(data) if rng.random() < 0.97 else flip(rng, seal(data))


def results_file(rng, folder):
    """A hostile results file."""
    return written(folder, "r.h5", hostile_hdf5(rng, valid_results(folder)))


def library_file(rng, folder):
    """A hostile shape library."""
    return written(folder, "l.h5", hostile_hdf5(rng, valid_library(folder)))


def compounds_file(rng, folder):
    """A hostile library of shapes with holes and of several parts."""
    return written(folder, "c.h5", hostile_hdf5(rng, valid_compounds(folder)))


def kernel_file(rng, folder):
    """A hostile results file of a kernel study."""
    return written(folder, "k.h5", hostile_hdf5(rng, valid_kernel(folder)))


def strengths_file(rng, folder):
    """A hostile file of strengths of bonds."""
    return written(folder, "b.h5", hostile_hdf5(rng, valid_strengths(folder)))


@cache
def valid_swarm(folder):
    """The HDF5 data of a small results file of swarms."""
    write_swarm(folder / "valid-swarm.h5", make_swarm_results())
    return read_sealed(folder / "valid-swarm.h5")


def swarm_file(rng, folder):
    """A hostile results file of swarms."""
    return written(folder, "s.h5", hostile_hdf5(rng, valid_swarm(folder)))


@cache
def valid_sweep(folder):
    """The HDF5 data of a small joined file of a sweep."""
    results = make_results(types=("I",), vertices=(1, 8), delta=(0.0, 0.7), count=5)
    results = attrs.evolve(results, pooled=blank(POOLED, results.shape[:2]))
    write_results(folder / "part.h5", results)
    parts = [open_any(folder / "part.h5")] * 2
    swept = {"potential": Swept("forces.double_layer.potential", [-0.02, -0.03], "V")}
    path = folder / "valid-sweep.h5"
    write_sweep(SweepResults(path, swept, joined(swept, parts), "{}"))
    return read_sealed(path)


def sweep_file(rng, folder):
    """A hostile file of a sweep."""
    return written(folder, "w.h5", hostile_hdf5(rng, valid_sweep(folder)))


@cache
def valid_trajectory(folder):
    """The HDF5 data of a small trajectory file, of a sphere and a shape with a hole."""
    rng = np.random.default_rng(4)
    arrays = np.sort(rng.random(5)), rng.random((5, 2, 3)), rng.random((5, 2, 3))
    path = folder / "valid-trajectory.h5"
    write_trajectory(path, *arrays, (Sphere(2e-6), framed(1e-6)), {"replicate": 3, "end": "I"})
    return read_sealed(path)


def trajectory_file(rng, folder):
    """A hostile trajectory file."""
    return written(folder, "t.h5", hostile_hdf5(rng, valid_trajectory(folder)))


# Journals --------------------------------------------------------------------------------------


def journal_parts(identity, key, rows):
    """[(kind, condition, first, description, data)] of a valid journal."""
    session = {
        "identity": identity, "short": key, "layout": layout(), "date": "2020", "command": "x",
        "cpus": [{"cpu": "a", "compiled_for": "a", "features": [], "numpy": [], "libm": []}],
    }  # fmt: skip
    note = {"type": "I", "vertices": 1, "delta": 0.0, "replicate": 1, "why": "odd"}
    about = {"identity": key, "session": 1, "notes": [note]}
    return [
        (SESSION, "", 0, session, b""),
        *((CHUNK, key_of(Condition(name, 1, 0.0)), 0, about, rows.tobytes())
          for name in ("I", "III")),
    ]  # fmt: skip


def change_json(rng, value):
    """A JSON value with something odd somewhere in it."""
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


def odd_condition(rng, condition, first):
    """Another name of a condition, or another number of a replicate."""
    if rng.random() < 0.5:
        return json.dumps(change_json(rng, json.loads(condition or "[]"))), first
    return condition, rng.choice([-1, 1, 2**40, 2**62])


def journal_file(rng, folder, parts):
    """A hostile journal of the ``parts`` of a valid one."""
    records = []
    for kind, condition, first, description, data in parts:
        if rng.random() < 0.5:
            description = change_json(rng, description)
        words = json.dumps(description).encode()
        if rng.random() < 0.1:
            words = rng.choice(ODD_TEXTS).encode("utf-8", "replace")
        if rng.random() < 0.3 and data:
            data = flip(rng, data)
        if rng.random() < 0.05:
            kind = rng.choice(["", "else", "session", "part"])
        if rng.random() < 0.1:
            condition, first = odd_condition(rng, condition, first)
        records.append((kind, condition, first, words, data))
    rng.shuffle(records) if rng.random() < 0.2 else None
    path = write_records(folder / "j.h5.journal", records)
    if rng.random() < 0.3:
        path.write_bytes(flip(rng, path.read_bytes()))
    return path


# Pictures and masks ----------------------------------------------------------------------------


def grey_array(rng):
    """A small picture with a floc or two."""
    height, width = rng.choice([(1, 1), (1, 40), (40, 1), (2, 3), (40, 50), (60, 30)])
    y, x = np.mgrid[:height, :width]
    found = 40.0 + 10 * np.sin(x) + 150 * (np.hypot(x - 20, y - 20) < 9)
    return found.astype("u1")


@cache
def picture_bytes(number):
    """The bytes of a valid picture of some kind."""
    import random

    rng = random.Random(number)
    grey = grey_array(rng)
    mode = rng.choice(["L", "1", "P", "RGB", "RGBA", "I;16", "F", "I", "CMYK", "LA"])
    kinds = {"png": "PNG", "jpg": "JPEG", "bmp": "BMP", "tif": "TIFF"}
    suffix = rng.choice(list(kinds))
    image = Image.fromarray(grey)
    image = Image.fromarray(grey.astype("u2")) if mode == "I;16" else image.convert(mode)
    more = {}
    if suffix == "tif":
        packing = rng.choice([None, "tiff_lzw", "tiff_deflate", "packbits", "raw", "jpeg"])
        more = {"compression": packing, "save_all": rng.random() < 0.1}
    file = io.BytesIO()
    try:
        image.save(file, kinds[suffix], **more)
    except (OSError, ValueError, KeyError):
        image.convert("L").save(file, kinds[suffix])
    return suffix, file.getvalue()


def tiff_bytes(rng):
    """A TIFF of a kind that Pillow does not read: 16-bit colours, floats of half size, planes."""
    import tifffile

    file = io.BytesIO()
    kind = rng.choice(["u2", "f2", "f4", "i2", "c8", "u8", "i8"])
    shape = rng.choice([(20, 30, 3), (20, 30), (3, 20, 30), (2, 20, 30, 3)])
    values = (np.arange(np.prod(shape)).reshape(shape) % 250).astype(kind)
    packing = rng.choice([None, "zlib"])
    tifffile.imwrite(file, values, compression=packing, photometric="minisblack")
    return file.getvalue()


def ome_bytes(rng):
    """An OME-TIFF with odd sizes of its axes and pixels."""
    import tifffile

    file, grey = io.BytesIO(), grey_array(rng)
    sizes = {"axes": "YX", "PhysicalSizeX": 1.000001, "PhysicalSizeY": 1.000001}
    tifffile.imwrite(file, grey, metadata=sizes, ome=True)
    odd = [b"-1", b"0", b"nan", b"inf", b"1e-300", b"1e300", b"99999999999", b"x", b"1"]
    data = file.getvalue()
    for name in (b"SizeC", b"SizeZ", b"SizeT", b"PhysicalSizeX", b"PhysicalSizeY"):
        before, mark, rest = data.partition(name + b'="')
        old, _, after = rest.partition(b'"')
        if mark and rng.random() < 0.6:
            # Of the same length, since offsets lie behind it.
            new = rng.choice(odd)[: len(old)].rjust(len(old))
            data = before + mark + new + b'"' + after
    return data


def changed_tags(rng, data):
    """A TIFF with odd numbers in the place of the values of some of its tags."""
    import tifffile

    found = bytearray(data)
    with tifffile.TiffFile(io.BytesIO(data)) as tiff:
        tags = list(tiff.pages[0].tags.values())
        order = "little" if tiff.byteorder == "<" else "big"
    for tag in rng.sample(tags, min(len(tags), rng.randint(1, 2))):
        value = rng.choice([*ODD_NUMBERS, 40_000, 32773, 34925])
        found[tag.valueoffset : tag.valueoffset + 2] = value.to_bytes(2, order)
    return bytes(found)


def repaired_png(data):
    """A PNG whose chunks have right checksums again."""
    found, place = bytearray(data[:8]), 8
    while place + 12 <= len(data):
        (length,) = struct.unpack_from(">I", data, place)
        body = data[place + 4 : place + 8 + min(length, len(data))]
        found += data[place : place + 4] + body + struct.pack(">I", zlib.crc32(body))
        place += 12 + length
    return bytes(found)


def picture_file(rng, folder):
    """A hostile picture."""
    suffix, data = picture_bytes(rng.randrange(60))
    if rng.random() < 0.2:
        suffix, data = "tif", tiff_bytes(rng)
    elif rng.random() < 0.1:
        suffix, data = "ome.tif", ome_bytes(rng)
    if suffix.endswith("tif") and rng.random() < 0.5:
        data = changed_tags(rng, data)
    elif rng.random() < 0.9:
        data = flip(rng, data, most=3)
    if suffix == "png" and rng.random() < 0.8:
        data = repaired_png(data)
    if rng.random() < 0.1:
        data = data[: rng.randrange(len(data) + 1)]
    if rng.random() < 0.05:
        suffix = rng.choice(["png", "jpg", "tif", "bmp"])
    return written(folder, f"p.{suffix}", data)


def npy_bytes(rng):
    """A valid .npy file of some type and shape, or one whose head lies."""
    kind = rng.choice(["?", "u1", "i8", "u8", "f8", "f4", "c16", "S3", "U2", "O", "i4,f8", ">i4"])
    shape = rng.choice([(0,), (0, 5), (), (7,), (1, 1), (12, 9), (3, 4, 5)])
    values = np.zeros(shape, kind)
    if values.size and values.dtype.kind in "iuf":
        odd = [0, 1, 2, 2**62, 2**31, -1, np.nan, np.inf, 3]
        with np.errstate(all="ignore"):
            picked = np.array([rng.choice(odd) for _ in range(values.size)], float)
            values = picked.astype(values.dtype).reshape(shape)
    file = io.BytesIO()
    np.save(file, values, allow_pickle=True)
    data = file.getvalue()
    if rng.random() < 0.4:
        sizes = rng.choice(["(1000000, 1000000)", "(-1, 5)", "(2, 2)", "(9223372036854775807, 2)",
                            "([],)", "(1.5, 2)", "(" * 300, "(True, 3)", "(1, 1, 1)"])  # fmt: skip
        head = f"{{'descr': '{kind}', 'fortran_order': {rng.choice(['True', 'False', '1'])}, "
        head = (head + f"'shape': {sizes}, }}").encode()
        length = len(head) if rng.random() < 0.9 else rng.choice(ODD_WORDS[:2])
        data = b"\x93NUMPY\x01\0" + struct.pack("<H", length) + head + data[80:]
    return data


def masks_file(rng, folder):
    """A hostile .npy or .npz file of masks."""
    if rng.random() < 0.4:
        data = npy_bytes(rng)
        return written(folder, "m.npy", flip(rng, data) if rng.random() < 0.3 else data)
    file = io.BytesIO()
    names = ["a.npy", "b", "../../x.npy", "a", "\x1b[31m.npy", "shapes.npy", "d/", "x" * 300]
    with zipfile.ZipFile(file, "w", rng.choice([zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED])) as zip:
        for _ in range(rng.randint(0, 4)):
            name = rng.choice(names)
            if name in zip.namelist():
                continue
            if name == "shapes.npy" and rng.random() < 0.8:
                inner = io.BytesIO()
                rows = [[rng.choice([0, 1, 8, -1, 2**40]), rng.choice([0, 3, 8])]] * rng.randint(
                    0, 3
                )
                np.save(inner, np.array(rows, rng.choice(["i8", "f8", "u1", "i4"])))
                zip.writestr(name, inner.getvalue())
            else:
                zip.writestr(name, npy_bytes(rng))
    data = file.getvalue()
    return written(folder, "m.npz", flip(rng, data) if rng.random() < 0.5 else data)


# Texts -----------------------------------------------------------------------------------------

PIECES = (
    "a.", "[", "]", "{", "}", '"', "'", '"""', "'''", "=", ",", "\n", "#", "\\", "\\u0000",
    "1", "e", "nan", "inf", "-", " ", "seed", "[scene]\n", "delta = [", "0x", "1979-05-27",
    "\x1b", "\u202e", "\ud800", "κ", "\0", "class = 'own:X'\n", "[[forces.a]]\n", "9" * 5000,
    "k" * 300, "1 um",
)  # fmt: skip


def config_text(rng):
    """A text that is nearly a config, or made of pieces of such, some of them very often."""
    if rng.random() < 0.5:
        text, place = VALID, rng.randrange(len(VALID))
        piece = rng.choice(PIECES) * rng.choice([1, 1, 2, 10, 3000])
        return text[:place] + piece + text[place + rng.choice([0, 1, 20]) :]
    many = [rng.choice(PIECES) * rng.choice([1, 1, 1, 5, 500]) for _ in range(rng.randint(1, 30))]
    return "".join(many)


def config_file(rng, folder):
    """A hostile config."""
    return written(folder, "c.toml", config_text(rng).encode("utf-8", "surrogatepass"))

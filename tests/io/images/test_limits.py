"""Pictures and masks from an enemy: sizes, labels, packings, names, what only looks like one."""

import io
import os
import struct
import zipfile
import zlib

import numpy as np
import pytest
from PIL import Image

from flocsim.errors import ImageError
from flocsim.io.images import masks, reading
from flocsim.io.images.masks import read_masks, segment_mask
from flocsim.io.images.reading import read_grey
from flocsim.io.images.stacks import Plane

SQUARE = np.zeros((20, 30), "u1")
SQUARE[4:16, 5:20] = 1


def refused(path, match=None, reader=read_masks):
    """The file is refused in one line that names it."""
    with pytest.raises(ImageError, match=match) as caught:
        reader(path)
    assert path.name in str(caught.value)
    assert str(caught.value).isprintable()


def saved(path, array):
    np.save(path, array, allow_pickle=True)
    return path


@pytest.mark.parametrize("suffix", [".npy", ".tif"])
@pytest.mark.parametrize("label", [2**62, 2**63 + 5])
def test_labels_may_be_any_numbers(tmp_path, suffix, label):
    """A table as long as the largest label ended the process."""
    import tifffile

    labels = np.zeros((20, 40), "u8")
    labels[3:15, 3:15], labels[3:15, 20:36] = label, 7
    path = tmp_path / f"m{suffix}"
    np.save(path, labels) if suffix == ".npy" else tifffile.imwrite(path, labels)
    [(_, mask)] = read_masks(path)
    assert mask.max() == 2
    assert sorted(region.area for region in segment_mask(mask).regions) == [144, 192]


@pytest.mark.parametrize("kind", ["c16", "S3", "U2", "O", "M8[s]", "i4,f8"])
def test_values_that_are_no_numbers_are_refused(tmp_path, kind):
    refused(
        saved(tmp_path / "m.npy", np.zeros((4, 5), kind)), "not numbers or flags|cannot be read"
    )


@pytest.mark.parametrize("value", [np.nan, np.inf])
def test_numbers_that_are_not_finite_are_refused(tmp_path, value):
    values = np.zeros((4, 5))
    values[1, 1] = value
    refused(saved(tmp_path / "m.npy", values), "not finite")


def test_too_many_labels_are_refused(tmp_path):
    labels = np.arange(masks.MOST_LABELS + 2, dtype="i4").reshape(2, -1)
    refused(saved(tmp_path / "m.npy", labels), "more than 100000")


def head(shape, descr="'|u1'"):
    """The head of an .npy file of this shape."""
    text = f"{{'descr': {descr}, 'fortran_order': False, 'shape': {shape}, }}".encode()
    return b"\x93NUMPY\x01\0" + struct.pack("<H", len(text)) + text


@pytest.mark.parametrize(
    "data",
    [
        head("(100000, 100000)"), head("(9223372036854775807, 2)"), head("(1000, 1000)"),
        head("(-1, 5)"), head("(2, 2)", "'|O'") + bytes(32), head("(" * 400), b"",
        head("(2, 2)") + b"\0", b"\x93NUMPY\x09\0",
    ],
)  # fmt: skip
def test_heads_that_lie_are_refused(tmp_path, data):
    (tmp_path / "m.npy").write_bytes(data)
    refused(tmp_path / "m.npy", "cannot be read")
    with zipfile.ZipFile(tmp_path / "m.npz", "w") as archive:
        archive.writestr("a.npy", data)
    refused(tmp_path / "m.npz", "cannot be read")


def npy(array):
    file = io.BytesIO()
    np.save(file, array)
    return file.getvalue()


def test_an_archive_that_unpacks_to_very_much_is_refused(tmp_path):
    with zipfile.ZipFile(tmp_path / "m.npz", "w", zipfile.ZIP_DEFLATED) as archive:
        for name in "abc":
            archive.writestr(name, npy(np.zeros((600, 600), "u1")))
    refused(tmp_path / "m.npz", "after decompression", lambda path: read_masks(path, 1e6))
    with zipfile.ZipFile(tmp_path / "m.npz", "w", zipfile.ZIP_DEFLATED) as archive:
        for number in range(400):
            archive.writestr(f"{number}", npy(np.zeros((100, 100), "u1")))
    refused(tmp_path / "m.npz", "after decompression", lambda path: read_masks(path, 2e6))


def png(width, height, data=b""):
    """A PNG of 8-bit grey with right checksums."""

    def chunk(kind, body):
        sum_ = struct.pack(">I", zlib.crc32(kind + body))
        return struct.pack(">I", len(body)) + kind + body + sum_

    head = struct.pack(">IIBBBBB", width, height, 8, 0, 0, 0, 0)
    return b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", head) + chunk(b"IDAT", data) + chunk(b"IEND", b"")


@pytest.mark.parametrize("reader", [read_grey, read_masks])
@pytest.mark.parametrize(
    ("size", "said"),
    [((100_000, 100_000), "more than the"), ((2**31 - 1, 1), "more than|cannot be read"),
     ((0, 5), "cannot be read|empty"), ((10_000, 10_000), "100 Mpixel need about 5 GB"),
     ((50, 50), "cannot be read")],
)  # fmt: skip
def test_pictures_that_promise_too_much_are_refused(tmp_path, reader, size, said):
    (tmp_path / "p.png").write_bytes(png(*size, zlib.compress(bytes(100))[:-6]))
    refused(tmp_path / "p.png", said, reader)


def test_a_part_of_a_picture_needs_less_memory(tmp_path):
    """What is cropped is decoded in full, but worked on only in part."""
    Image.new("1", (3000, 3000)).save(tmp_path / "p.png")
    refused(tmp_path / "p.png", "give --memory 0.5", lambda path: read_grey(path, memory=1e8))
    assert read_grey(tmp_path / "p.png", Plane(crop=(5, 5, 40, 30)), 1e8).shape == (30, 40)
    assert read_grey(tmp_path / "p.png", memory=5e8).shape == (3000, 3000)


@pytest.mark.parametrize("ending", ["png", "tif", "jpg"])
@pytest.mark.parametrize(
    "data",
    [
        b"%!PS-Adobe-3.0 EPSF-3.0\n%%BoundingBox: 0 0 9 9\n%%EndComments\n",  # runs Ghostscript
        b"P5 2 2 255\n\0\1\2\3", b"GIF89a\1\0\1\0\0\0\0;", b"RIFF\0\0\0\0WEBPVP8 ", b"", b"\0" * 99,
    ],
)  # fmt: skip
def test_only_the_four_formats_are_opened(tmp_path, environment, ending, data):
    ghostscript = tmp_path / "gs"
    ghostscript.write_text(f"#!/bin/sh\ntouch {tmp_path}/was-run\n")
    ghostscript.chmod(0o755)
    environment["PATH"] = str(tmp_path) + os.pathsep + environment["PATH"]
    (tmp_path / f"p.{ending}").write_bytes(data)
    refused(tmp_path / f"p.{ending}", "cannot be read", read_grey)
    assert not (tmp_path / "was-run").exists()


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="needs named pipes")
@pytest.mark.parametrize("name", ["p.png", "m.npy", "m.npz"])
def test_what_is_no_ordinary_file_is_refused_at_once(tmp_path, name):
    os.mkfifo(tmp_path / name)
    refused(tmp_path / name, "not an ordinary file")
    (tmp_path / "folder.png").mkdir()
    refused(tmp_path / "folder.png", "not an ordinary file")


def test_a_very_large_file_is_refused(tmp_path):
    Image.fromarray(SQUARE).save(tmp_path / "p.bmp")
    os.truncate(tmp_path / "p.bmp", reading.LARGEST_FILE + 1)  # of which the disk has the beginning
    refused(tmp_path / "p.bmp", "larger than", read_grey)

"""Pages, channels and pixel sizes of TIFF files as microscopes and ImageJ write them."""

import numpy as np
import pytest
import tifffile

from flocsim.errors import ImageError
from flocsim.io.images.reading import read_grey, read_pixels
from flocsim.io.images.stacks import Plane, Stack, pixel_size_in, planes_of, stack_of

ALL: list[int] = []
RNG = np.random.default_rng(4)


def planes(*shape, dtype="u1"):
    return RNG.integers(0, 200, (*shape, 12, 20)).astype(dtype)


def chosen(path, pages=None, channel=None, crop=None):
    return planes_of(path, stack_of(path), pages, channel, crop)


@pytest.mark.parametrize("count", [2, 3, 4, 8])
@pytest.mark.parametrize("kind", ["plain", "grey", "imagej", "ome", "16 bit"])
def test_every_page_is_that_of_the_file(tmp_path, count, kind):
    """Three and four planes too, which some programs store as colours."""
    data, path = planes(count, dtype="u2" if kind == "16 bit" else "u1"), tmp_path / "s.tif"
    if kind == "ome":
        tifffile.imwrite(path := tmp_path / "s.ome.tif", data, metadata={"axes": "ZYX"})
    elif kind == "imagej":
        tifffile.imwrite(path, data, imagej=True, metadata={"axes": "ZYX"})
    else:
        with pytest.warns() if kind != "grey" and count in (3, 4) else nothing():
            more = {"photometric": "minisblack"} if kind == "grey" else {}
            tifffile.imwrite(path, data, **more)
    with pytest.raises(ImageError, match=f"holds {count} pages; choose with --page 1, "):
        chosen(path)
    with pytest.raises(ImageError, match=f"holds {count} pictures; choose with --page"):
        read_pixels(path)
    found = chosen(path, ALL)
    assert [name for name, _ in found] == [f":{k + 1}" for k in range(count)]
    for (_, plane), page in zip(found, data, strict=True):
        np.testing.assert_array_equal(read_pixels(path, plane), page)
    [(name, plane)] = chosen(path, [count], crop=(3, 2, 10, 5))
    assert name == f":{count}"
    np.testing.assert_array_equal(read_pixels(path, plane), data[-1][2:7, 3:13])
    with pytest.raises(ImageError, match=f"has no page {count + 1}, only {count}"):
        chosen(path, [count + 1])


def nothing():
    import contextlib

    return contextlib.nullcontext()


@pytest.mark.parametrize("kind", ["ome", "imagej"])
def test_channels_are_told_from_pages(tmp_path, kind):
    data = planes(2, 3)
    path = tmp_path / ("s.ome.tif" if kind == "ome" else "s.tif")
    about = {"axes": "TCYX"} | ({"Channel": {"Name": ["DAPI", "b", "c"]}} if kind == "ome" else {})
    tifffile.imwrite(path, data, imagej=kind == "imagej", metadata=about)
    with pytest.raises(ImageError, match=r"has 3 channels.*choose with --channel 1"):
        chosen(path, ALL)
    for channel in (1, 2, 3):
        for (_, plane), page in zip(chosen(path, ALL, str(channel)), data, strict=True):
            np.testing.assert_array_equal(read_pixels(path, plane), page[channel - 1])
    if kind == "ome":
        assert chosen(path, [1], "DAPI") == chosen(path, [1], "1")
    with pytest.raises(ImageError, match="has no channel 4"):
        chosen(path, [1], "4")


def test_a_colour_is_a_channel(tmp_path):
    data = RNG.integers(0, 255, (12, 20, 3)).astype("u1")
    tifffile.imwrite(tmp_path / "c.tif", data, photometric="rgb")
    [(name, plane)] = chosen(tmp_path / "c.tif", channel="2")
    assert name == ""
    np.testing.assert_array_equal(read_pixels(tmp_path / "c.tif", plane), data[..., 1])
    with pytest.raises(ImageError, match="has no channel 4, only 3"):
        read_pixels(tmp_path / "c.tif", Plane(sample=3))


@pytest.mark.parametrize(("value", "unit"), [(0.95, "µm"), (950.0, "nm"), (9.5e-4, "mm")])
def test_ome_says_how_large_a_pixel_is(tmp_path, value, unit):
    about = {"axes": "YX"} | {f"PhysicalSize{axis}": value for axis in "XY"}
    about |= {f"PhysicalSize{axis}Unit": unit for axis in "XY"}
    tifffile.imwrite(tmp_path / "a.ome.tif", planes(), metadata=about)
    path = tmp_path / "a.ome.tif"
    assert pixel_size_in(path, stack_of(path)) == pytest.approx(0.95e-6)


@pytest.mark.parametrize(
    ("unit", "metres"), [("um", 1e-6), ("micron", 1e-6), ("\\u00B5m", 1e-6), ("cm", 1e-2)]
)
def test_imagej_says_how_large_a_pixel_is(tmp_path, unit, metres):
    path = tmp_path / "a.tif"
    tifffile.imwrite(path, planes(), imagej=True, resolution=(2.0, 2.0), metadata={"unit": unit})
    assert pixel_size_in(path, stack_of(path)) == pytest.approx(0.5 * metres)


def test_dots_per_inch_say_nothing_of_a_floc(tmp_path):
    path = tmp_path / "a.tif"
    tifffile.imwrite(path, planes(), resolution=(300, 300), resolutionunit="inch")
    assert pixel_size_in(path, stack_of(path)) is None
    tifffile.imwrite(path, planes(), imagej=True, resolution=(2, 2), metadata={"unit": "pixel"})
    assert pixel_size_in(path, stack_of(path)) is None


def test_pixels_that_are_not_square_are_refused(tmp_path):
    path = tmp_path / "a.tif"
    tifffile.imwrite(path, planes(), imagej=True, resolution=(2, 3), metadata={"unit": "um"})
    with pytest.raises(ImageError, match=r"5e-07 m wide and 3\.333e-07 m high"):
        pixel_size_in(path, stack_of(path))


def test_crops_stay_inside(tmp_path):
    tifffile.imwrite(tmp_path / "a.tif", planes())
    with pytest.raises(ImageError, match="--crop 15,0,6,3 reaches beyond its 20 × 12 pixels"):
        read_pixels(tmp_path / "a.tif", Plane(crop=(15, 0, 6, 3)))


def test_what_a_file_says_falsely_is_not_believed(tmp_path):
    """More planes than it has; a text that is no XML; an ending that lies."""
    path = tmp_path / "a.tif"
    tifffile.imwrite(path, planes(2), description="ImageJ=1.54\nimages=9\nslices=9\n",
                     metadata=None, photometric="minisblack")  # fmt: skip
    assert stack_of(path).sizes == (2,)
    tifffile.imwrite(path, planes(), description="<?xml version='1.0'?><OME broken", metadata=None)
    assert stack_of(path).frame_count == 1
    path.write_bytes(b"no picture")
    assert stack_of(path) == Stack()


@pytest.mark.parametrize("compression", [None, "zlib"])
@pytest.mark.parametrize("order", "<>")
@pytest.mark.parametrize("dtype", ["?", "u1", "u2", "u4", "u8", "i1", "i2", "i4", "f4", "f8"])
@pytest.mark.parametrize("photometric", ["minisblack", "rgb", "miniswhite"])
def test_numbers_of_every_type_are_read_right_or_refused(
    tmp_path, compression, order, dtype, photometric
):
    grey = np.linspace(0, 1, 63).reshape(7, 9)
    white = 1 if dtype[0] in "?f" else np.iinfo(dtype).max * 0.999
    stored = (grey > 0.5) if dtype == "?" else (grey * white).astype(dtype)
    wanted = stored.astype(float) if dtype == "?" else grey
    if photometric == "rgb":
        stored = np.stack([stored] * 3, axis=-1)
    path = tmp_path / "p.tif"
    tifffile.imwrite(
        path, stored, photometric=photometric, byteorder=order, compression=compression
    )
    try:
        found = read_grey(path)
    except ImageError as error:
        assert "save it" in str(error) or "no value is known as black" in str(error)
        return
    wanted = 1 - wanted if photometric == "miniswhite" else wanted
    assert found == pytest.approx(wanted, abs=0.04)

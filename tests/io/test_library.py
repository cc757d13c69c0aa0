"""The shape library: what is written is read, and nothing else is."""

from types import SimpleNamespace

import attrs
import h5py
import numpy as np
import pytest

from flocsim.errors import FileError, UsageError
from flocsim.geometry.fit import fit_mask
from flocsim.geometry.shapes.cores import scaled_parts
from flocsim.geometry.shapes.shape import Sphere
from flocsim.io.images.pictures import segment
from flocsim.io.images.regions import mask_measures, with_holes
from flocsim.io.shape_library import (
    StoredFit,
    make_entry,
    read_library,
    write_library,
)
from tests.helpers.compound_shapes import beads
from tests.helpers.sealed import read_sealed, seal

PIXEL = 0.95e-6


def picture():
    """Two flocs on black, an L and a disk, shaded so that they are no lettering."""
    grey = np.zeros((60, 80))
    grey[10:40, 10:18] = grey[32:40, 10:35] = 0.6
    y, x = np.mgrid[:60, :80]
    disk = np.hypot(x - 60, y - 25) < 9
    grey[disk] = 0.7 + 0.02 * (x - 60)[disk]
    return grey


@pytest.fixture(scope="module")
def entries():
    regions = segment(picture(), noise_scale=0).regions
    return [
        entry_of(region, {n: fit_mask(region.mask, vertices=n) for n in (1, 2, 6)}, name="é 1.png")
        for region in regions
    ]


def entry_of(region, *fits, name="a.png"):
    """The entry of a region of a picture."""
    measures = {region.label: mask_measures(region.mask)}
    taken = SimpleNamespace(name=name, pixel_size=PIXEL, measures=measures)
    return make_entry(taken, region, [{1.0: each} for each in fits], 1.0)


def test_entries_survive_the_file(tmp_path, entries):
    write_library(tmp_path / "s.h5", entries)
    read = read_library(tmp_path / "s.h5")
    assert [entry.floc_id for entry in read] == ["é 1.png#1", "é 1.png#2"]
    for old, new in zip(entries, read, strict=True):
        for name in ("image", "pixel_size", "centroid", "area", "equivalent_radius",
                     "spheroradius", "measures"):  # fmt: skip
            assert getattr(new, name) == getattr(old, name)
        assert list(new.fits) == [1, 2, 6]
        for n, fit in new.fits.items():
            assert all(map(np.array_equal, fit.table, old.fits[n].table))
            assert fit.relative_error == old.fits[n].relative_error


def test_shapes_are_in_metres_around_the_centroid_of_the_floc(entries):
    for entry in entries:
        assert isinstance(entry.fits[1].shape, Sphere)
        assert entry.fits[1].shape.area == pytest.approx(entry.area * PIXEL**2)
        assert np.allclose(entry.fits[1].table.place, 0, atol=1e-15)
        shape = entry.fits[6].shape
        assert shape.area == pytest.approx(entry.area * PIXEL**2, rel=0.05)
        # The fit covers the floc, so the two centroids agree to a fraction of a pixel.
        assert np.hypot(*shape.centroid) < 0.5 * PIXEL


def changed(path, change):
    """The library with its HDF5 content changed and sealed anew."""
    import io

    content = io.BytesIO(read_sealed(path))
    with h5py.File(content, "r+") as file:
        change(file)
    path.write_bytes(seal(content.getvalue()))


def as_version_1(file):
    """Store fits as version 1 did: with one radius, without parts, measures or population."""
    for group in file["fits"].values():
        group["radius"] = group["point_radius"][:, 0]
        for name in ("part", "ring", "point_radius"):
            del group[name]
    del file["measures"], file["population"]
    file.attrs["schema_version"] = 1


def test_libraries_of_version_1_are_read(tmp_path, entries):
    path = tmp_path / "s.h5"
    write_library(path, entries, {})
    changed(path, as_version_1)
    for found, wanted in zip(read_library(path), entries, strict=True):
        assert found.floc_id == wanted.floc_id and found.measures.perimeter > 0.0
        for count, fit in found.fits.items():
            np.testing.assert_array_equal(fit.table.place, wanted.fits[count].table.place)
            np.testing.assert_array_equal(fit.table.radius, wanted.fits[count].table.radius)


def cut_vertices(file):
    values = file["fits/6/vertices"][()]
    del file["fits/6/vertices"]
    file["fits/6/vertices"] = values[:, :5]


def put_nan(file):
    file["fits/6/vertices"][0, 0, 0] = np.nan


@pytest.mark.parametrize(
    "change",
    [
        lambda file: file.attrs.__setitem__("schema_version", 0),
        lambda file: file.__delitem__("flocs/centroid"),
        lambda file: file.__delitem__("fits"),
        lambda file: file.create_group("fits/many"),
        cut_vertices,
        put_nan,
    ],
)
def test_unknown_content_is_refused(tmp_path, entries, change):
    path = tmp_path / "s.h5"
    write_library(path, entries)
    changed(path, change)
    with pytest.raises(FileError, match=r"s\.h5") as caught:
        read_library(path)
    assert "\n" not in str(caught.value)


def test_what_cannot_be_written_is_refused(tmp_path, entries):
    with pytest.raises(FileError):
        write_library(tmp_path / "no folder" / "s.h5", entries)
    with pytest.raises(UsageError, match="at least one floc"):
        write_library(tmp_path / "s.h5", [])
    with pytest.raises(UsageError, match="twice"):
        write_library(tmp_path / "s.h5", [entries[0], entries[0]])
    fits = {
        count: attrs.evolve(fit, parts=scaled_parts(fit.parts, 1e6))
        for count, fit in entries[0].fits.items()
    }
    with pytest.raises(UsageError, match=r"reaches .* m, .* pixels really 0.5 m\?"):
        write_library(tmp_path / "s.h5", [attrs.evolve(entries[0], fits=fits, pixel_size=0.5)])
    assert not list(tmp_path.iterdir())


def holed_entries():
    """Flocs of a picture with a hole in one of them, at two numbers of vertices."""
    y, x = np.mgrid[:60, :80]
    grey = picture()
    grey[np.hypot(x - 60, y - 25) < 4] = 0.0
    found = segment(grey, noise_scale=0)
    regions = [with_holes(region, found.holes) for region in found.regions]
    return [
        entry_of(region, {n: fit_mask(region.mask, vertices=n, holes=True) for n in (1, 8, 16)})
        for region in regions
    ]


def test_holes_survive_the_file(tmp_path):
    entries = holed_entries()
    path = tmp_path / "s.h5"
    write_library(path, entries)
    read = read_library(path)
    assert [entry.fits[16].shape.is_compound for entry in read] == [False, True]
    for old, new in zip(entries, read, strict=True):
        for n in (8, 16):
            one, other = old.fits[n].shape, new.fits[n].shape
            assert one.is_compound == other.is_compound
            assert other.area == one.area
            assert all(map(np.array_equal, one.parts[0].rings, other.parts[0].rings))
            # Eight corners are few for an outline and a hole.
            near = 0.1 if n == 16 else 0.3
            assert other.area == pytest.approx(new.area * PIXEL**2, rel=near)
    write_library(tmp_path / "again.h5", read)
    assert read_sealed(tmp_path / "again.h5") == read_sealed(path)


def test_composites_are_kept(tmp_path):
    """Of several radii, which no picture gives, but a library of one's own may have."""
    shape = beads(1e-6)
    entry = holed_entries()[0]
    entry = attrs.evolve(entry, fits={len(shape.vertices): StoredFit(shape.parts, 0.0)})
    write_library(tmp_path / "s.h5", [entry])
    [again] = read_library(tmp_path / "s.h5")
    there = again.fits[len(shape.vertices)].shape
    assert [part.radius for part in there.parts] == [part.radius for part in shape.parts]
    assert there.area == pytest.approx(shape.area, rel=1e-12)


def test_weights_and_bands_are_kept_and_bad_ones_refused(tmp_path, entries):
    assert all(e.radius_low <= e.equivalent_radius <= e.radius_high for e in entries)
    entries = [
        attrs.evolve(each, weight=1.5, radius_low=0.9 * each.equivalent_radius,
                     radius_high=1.2 * each.equivalent_radius)
        for each in entries
    ]  # fmt: skip
    write_library(tmp_path / "a.h5", entries)
    for before, after in zip(entries, read_library(tmp_path / "a.h5"), strict=True):
        assert (after.weight, after.radius_low, after.radius_high) == (
            before.weight, before.radius_low, before.radius_high,
        )  # fmt: skip
    write_library(tmp_path / "b.h5", [attrs.evolve(each, weight=-1.0) for each in entries])
    with pytest.raises(FileError, match="population/weight"):
        read_library(tmp_path / "b.h5")


def test_ends_of_bands_survive_the_file_and_have_the_vertices_of_the_fits(tmp_path):
    """Their origin is the centroid of the floc as it was cut: a band that is the floc itself, with
    a wider margin, has its very vertices."""
    region = segment(picture(), noise_scale=0).regions[0]
    region = attrs.evolve(region, band=tuple(np.pad(region.mask, by) for by in (1, 3)))
    masks = region.mask, *region.band
    entry = entry_of(region, *({n: fit_mask(mask, vertices=n) for n in (1, 6)} for mask in masks))
    for end in (entry.closer, entry.wider):
        np.testing.assert_allclose(end[6].table.place, entry.fits[6].table.place, atol=1e-12)
    write_library(tmp_path / "s.h5", [entry])
    [found] = read_library(tmp_path / "s.h5")
    assert found.is_banded
    np.testing.assert_array_equal(found.wider[6].table.place, entry.wider[6].table.place)


def test_ends_of_bands_are_written_where_all_flocs_have_them(tmp_path, entries):
    one = attrs.evolve(entries[0], closer=entries[0].fits, wider=entries[0].fits)
    write_library(tmp_path / "s.h5", [one, entries[1]])
    assert not any(each.is_banded for each in read_library(tmp_path / "s.h5"))

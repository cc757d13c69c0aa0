"""Hostile HDF5 with a right checksum: refused by its bytes, before the HDF5 library has them."""

import io
import os
import shutil

import h5py
import numpy as np
import pytest

from flocsim.errors import FileError
from flocsim.io.hdf5 import Unfit, structure_of
from flocsim.io.results.file import read_overview, read_results
from flocsim.io.seals import seal
from flocsim.io.shape_library import read_library, read_settings
from tests.helpers.results_files import write_results
from tests.helpers.sealed import read_sealed
from tests.helpers.small_study import write_star_library
from tests.helpers.synthetic_results import make_results
from tests.helpers.tiers import rest_slow

SMALL = {"types": ("I", "II"), "vertices": (1, 8), "delta": (0.0, 0.7), "count": 5}


@pytest.fixture(scope="module")
def written(tmp_path_factory):
    """The results file that each test gets a copy of."""
    path = tmp_path_factory.mktemp("written") / "r.h5"
    write_results(path, make_results(**SMALL))
    return path


@pytest.fixture
def results(written, tmp_path):
    """A results file."""
    return shutil.copy(written, tmp_path / "r.h5")


@pytest.fixture
def library(tmp_path):
    """A shape library."""
    write_star_library(tmp_path / "l.h5", vertices=(1, 4))
    return tmp_path / "l.h5"


def changed(path, change):
    """The file with its HDF5 content changed through h5py and sealed anew."""
    image = io.BytesIO(read_sealed(path))
    with h5py.File(image, "r+") as file:
        change(file)
    path.write_bytes(seal(image.getvalue()))


def replaced(path, old, new, place=0):
    """The file with bytes replaced, at their first occurrence after a place, and sealed anew."""
    data = bytearray(read_sealed(path))
    start = data.index(old, place) if old else place
    data[start : start + len(new)] = new
    path.write_bytes(seal(bytes(data)))


def refused(path, match=None):
    """Every reader of the file refuses it, in one line that names it."""
    reading = read_results if path.name.startswith("r") else read_library
    with pytest.raises(FileError, match=match) as caught:
        reading(path)
    assert str(path) in str(caught.value)
    assert str(caught.value).isprintable()
    return str(caught.value)


def virtual(file, name):
    plan = h5py.VirtualLayout(shape=(4,), dtype="f8")
    plan[:] = h5py.VirtualSource("other.h5", "x", shape=(4,))
    file.create_virtual_dataset(name, plan)


def external(file, name):
    file.create_dataset(name, (4,), "u1", external=[(os.devnull, 0, 4)])


def bomb(file, name):
    file.create_dataset(name, (2**20, 2**20), "u1", chunks=(2**10, 2**10), compression="gzip")


def fill(file, name):
    file.create_dataset(name, (2**20,), "f8", fillvalue=7.0)


INSTEAD = {
    "external": (external, "values in another file"),
    "virtual": (virtual, "chunked, compressed|another dataset|flocsim does not write"),
    "packed": (bomb, "filters or compression"),
    "filled": (fill, "flocsim does not write|value of its own|bytes of values"),
    "soft link": (lambda f, n: f.__setitem__(n, h5py.SoftLink("/run")), "link"),
    "external link": (lambda f, n: f.__setitem__(n, h5py.ExternalLink(os.devnull, "/")), "link"),
    "hard link": (lambda f, n: f.__setitem__(n, f[n.partition("/")[0]]), None),
    "group": (lambda f, n: f.create_group(n), "unknown group"),
    "empty": (lambda f, n: f.__setitem__(n, h5py.Empty("f8")), "shape that flocsim"),
    "resizable": (lambda f, n: f.create_dataset(n, (3,), "f8", maxshape=(9,)), "resizable|chunked"),
    "float32": (lambda f, n: f.__setitem__(n, np.zeros(3, "f4")), "a type that flocsim"),
    "big-endian": (lambda f, n: f.__setitem__(n, np.zeros(3, ">f8")), "a type that flocsim"),
    "complex": (lambda f, n: f.__setitem__(n, np.zeros(3, "c16")), "a type that flocsim"),
    "another type": (lambda f, n: f.__setitem__(n, np.zeros(3, "i4")), "holds i4, expected"),
    "another rank": (lambda f, n: f.__setitem__(n, np.zeros((1,) * 6)), "expected"),
    "text": (lambda f, n: f.__setitem__(n, "a"), "holds text, expected"),
}


@pytest.mark.parametrize("kind", INSTEAD)
@pytest.mark.parametrize(
    ("fixture", "name"),
    [("results", "replicates/d_c_max"), ("results", "probabilities/pr_a"),
     ("library", "fits/4/radius"), ("library", "flocs/pixel_size")],
)  # fmt: skip
def test_what_stands_instead_of_values_is_refused(request, fixture, name, kind):
    path = request.getfixturevalue(fixture)
    put, said = INSTEAD[kind]

    def change(file):
        del file[name]
        put(file, name)

    changed(path, change)
    refused(path, said)


def test_a_file_of_the_system_is_not_read_as_storage(results):
    def change(file):
        del file["run/preset"]
        file.create_dataset("run/preset", (4,), "u1", external=[(os.devnull, 0, 4)])

    changed(results, change)
    refused(results)
    for reader in (read_overview, read_settings):
        with pytest.raises(FileError, match=r"readable results|complete"):
            reader(results)


def test_a_text_of_many_values_is_refused(library):
    """A long text that a thousand flocs share would be a thousand long texts in memory."""
    data = bytearray(read_sealed(library))
    with h5py.File(io.BytesIO(bytes(data))) as file:
        start = file["flocs/id"].id.get_offset()
    data[start + 16 : start + 32] = data[start : start + 16]
    library.write_bytes(seal(bytes(data)))
    refused(library, "several values")


@pytest.mark.parametrize(
    "mark", rest_slow([b"GCOL", b"HEAP", b"TREE", b"SNOD"], lambda mark: mark == b"TREE")
)
def test_no_odd_number_in_a_heap_or_a_tree_keeps_the_reader(library, mark):
    """The HDF5 library goes round in circles for ever on some of these."""
    whole = library.read_bytes()
    start = read_sealed(library).index(mark)
    for place in range(start + 4, start + 100):
        for odd in (0, 1, 8, 255):
            replaced(library, b"", bytes([odd]), place)
            try:
                read_library(library)
            except FileError as error:
                assert str(error).isprintable()
            library.write_bytes(whole)


def test_two_things_on_the_same_bytes_are_refused(results):
    data = read_sealed(results)
    with h5py.File(io.BytesIO(data)) as file:
        first, second = (file[f"replicates/{n}"].id.get_offset() for n in ("angle_i", "angle_j"))
    replaced(results, first.to_bytes(8, "little"), second.to_bytes(8, "little"))
    refused(results, "the same bytes")


@pytest.mark.parametrize("more", [b"x", bytes(4096)])
def test_what_lies_before_or_behind_is_refused(results, more):
    data = read_sealed(results)
    results.write_bytes(seal(data + more))
    refused(results, "superblock")
    with pytest.raises(Unfit):
        structure_of(io.BytesIO(more + data), len(more + data))


def test_the_newest_format_is_refused_not_followed(tmp_path):
    image = io.BytesIO()
    with h5py.File(image, "w", libver="latest") as file:
        file.attrs["format"] = "flocsim results"
    (tmp_path / "r.h5").write_bytes(seal(image.getvalue()))
    refused(tmp_path / "r.h5", "not the one that h5py writes")


def put(name, place, value):
    """A change of one value of a dataset."""

    def change(file):
        file[name][place] = value

    return change


@pytest.mark.parametrize(
    ("name", "place", "value", "said"),
    [
        ("replicates/outcome", (0, 0, 0, 0), 8, "outcome are impossible"),
        ("replicates/outcome", (0, 0, 0, 0), 200, "outcome are impossible"),
        ("replicates/inside", ..., 2, "inside are impossible"),
        ("replicates/crossed_zone", (0, 0, 0, 1), 9, "crossed_zone are impossible"),
        ("replicates/bond", (0, 0, 0, 1), 4, "bond are impossible"),
        ("replicates/failure", (0, 0, 0, 1), 3, "replicates/failure"),
        ("replicates/steps", (1, 0, 0, 1), -1, "steps are impossible"),
        ("replicates/floc_i", (1, 0, 0, 1), -2, "floc_i are impossible"),
        ("replicates/angle_i", (1, 0, 0, 1), np.nan, "angle_i are impossible"),
        ("replicates/t_end", (1, 0, 0, 1), np.inf, "t_end are impossible"),
        ("replicates/type", 0, "X", "replicates/type is not probabilities/type"),
        ("replicates/vertices", 0, 99, "replicates/vertices is not"),
        ("probabilities/pr_a", (0, 0, 0), 1.5, "outside"),
        ("probabilities/n_total", (0, 0, 0), 6, "contradict"),
        ("probabilities/n_class", (0, 0, 0, 0), -1, "negative"),
        ("probabilities/n_bond", (0, 0, 0, 0), 7, "contradict"),
        ("probabilities/class", 0, "Z", "other words"),
        ("probabilities/bond", 0, "glue", "other words"),
    ],
)
def test_values_that_no_run_has_given_are_refused(results, name, place, value, said):
    changed(results, put(name, place, value))
    refused(results, said)


@pytest.mark.parametrize(
    ("name", "place", "value"),
    [
        ("flocs/pixel_size", 0, 0.0), ("flocs/pixel_size", 0, np.nan),
        ("flocs/equivalent_radius", 0, -1.0), ("flocs/spheroradius", 1, np.inf),
        ("flocs/centroid", (0, 1), np.nan), ("flocs/area", 0, -5),
        ("flocs/id", 1, "star 8"), ("fits/4/radius", 0, -1e-6), ("fits/4/radius", 0, np.nan),
        ("fits/4/vertices", (0, 0, 0), 1e300), ("fits/1/radius", 0, 0.0),
        ("fits/4/relative_error", 0, np.nan),
    ],
)  # fmt: skip
def test_values_that_no_floc_has_are_refused(library, name, place, value):
    changed(library, put(name, place, value))
    refused(library)


def test_names_and_numbers_of_vertices_are_refused(library):
    whole = library.read_bytes()
    for name in ("fits/0", "fits/4x", "fits/-1", "fits/99999", "fits/\x1b[31m", "fits/٤"):
        changed(library, lambda file, name=name: file.move("fits/4", name))
        refused(library)
        library.write_bytes(whole)


def test_settings_of_a_library_are_plain_words_and_numbers(library):
    changed(library, lambda file: file.attrs.update({"method": "pattern", "inscribed": True}))
    assert read_settings(library) == {"method": "pattern", "inscribed": True}
    changed(library, lambda file: file.attrs.create("method", np.zeros((3, 3))))
    refused(library, "method")


def test_a_control_letter_in_a_type_is_refused(results):
    def change(file):
        for group in ("probabilities", "replicates"):
            file[f"{group}/type"][0] = "\x1b[31m"

    changed(results, change)
    refused(results, "unprintable")


def test_a_sound_file_is_walked_without_reading_its_values(results):
    data = read_sealed(results)
    nodes = structure_of(io.BytesIO(data), len(data))
    assert nodes["replicates/outcome"].type == "u1"
    assert nodes["replicates/outcome"].shape == (2, 2, 2, 5)
    assert nodes["probabilities"].type is None
    assert nodes["replicates/outcome"].attributes["units"] == ("text", ())

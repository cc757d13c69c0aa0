"""Trajectory files: what is written can be read, by any HDF5 library."""

import io

import h5py
import numpy as np
import pytest

from flocsim import Sphere, SpheroPolygon
from flocsim.__main__ import main
from flocsim.errors import FileError
from flocsim.io.hdf5 import open_hdf5
from flocsim.io.trajectory import DATASETS, TRAJECTORY, read_trajectory, write_trajectory
from tests.helpers.compound_shapes import beads, framed
from tests.helpers.sealed import read_sealed, seal

SHAPES = (Sphere(2e-6), SpheroPolygon([[0, 0], [4e-6, 0], [0, 3e-6]], 5e-7))


def motion(count=5):
    """Times (k,), positions and velocities (k, 2, 3) of random numbers."""
    rng = np.random.default_rng(4)
    return np.sort(rng.random(count)), rng.random((count, 2, 3)), rng.random((count, 2, 3))


def written(path, **facts):
    """The motion that was written to the path."""
    arrays = motion()
    write_trajectory(path, (*arrays, SHAPES), facts)
    return arrays


def test_arrays_come_back_with_units(tmp_path):
    times, position, velocity = written(tmp_path / "m.h5")
    with h5py.File(tmp_path / "m.h5") as file:
        for name, array in (("time", times), ("position", position), ("velocity", velocity)):
            np.testing.assert_array_equal(file[name][()], array)
        for name, (_, units, text) in DATASETS.items():
            assert (file[name].attrs["units"], file[name].attrs["long_name"]) == (units, text)


def test_shapes_and_facts_come_back(tmp_path):
    written(tmp_path / "m.h5", config='preset = "si"', replicate=17, zone_distance=4.5e-5)
    with h5py.File(tmp_path / "m.h5") as file:
        for body, shape in enumerate(SHAPES):
            np.testing.assert_array_equal(file[f"vertices_{body}"][()], shape.vertices)
            assert set(file[f"point_radius_{body}"]) == {shape.radius}
            assert file[f"vertices_{body}"].attrs["units"] == "m"
        assert file.attrs["kind"] == "flocsim trajectory"
        assert file.attrs["config"] == 'preset = "si"'
        assert file.attrs["replicate"] == 17
        assert file.attrs["zone_distance"] == 4.5e-5


def test_the_same_motion_gives_the_same_sealed_bytes(tmp_path):
    written(tmp_path / "a.h5", replicate=1)
    written(tmp_path / "b.h5", replicate=1)
    assert (tmp_path / "a.h5").read_bytes() == (tmp_path / "b.h5").read_bytes()


def test_what_was_written_is_read_back(tmp_path):
    times, position, velocity = written(tmp_path / "m.h5", replicate=17, status="FINISHED")
    found = read_trajectory(tmp_path / "m.h5")
    assert open_hdf5(tmp_path / "m.h5").kind == TRAJECTORY.name
    for array, again in zip((times, position, velocity), (found.t, found.position, found.velocity),
                            strict=True):  # fmt: skip
        np.testing.assert_array_equal(array, again)
    assert [type(each) for each in found.shapes] == [Sphere, SpheroPolygon]
    assert found.shapes[1].radius == SHAPES[1].radius
    assert found.facts == {"replicate": 17, "status": "FINISHED"}


def test_info_and_plot_read_it(in_tmp, capsys):
    written(in_tmp / "m.h5", replicate=17)
    assert main(["info", "m.h5"]) == 0
    told = capsys.readouterr().out
    assert "a trajectory" in told and "5 states" in told and "replicate        17" in told
    assert main(["plot", "m.h5"]) == 0
    assert capsys.readouterr().out.split() == ["m-strip.png", "m-distance.png"]


def test_a_file_with_other_numbers_is_refused(tmp_path):
    times, position, velocity = motion()
    position[2, 1, 0] = np.nan
    write_trajectory(tmp_path / "m.h5", (times, position, velocity, SHAPES), {})
    with pytest.raises(FileError, match="has no readable trajectory: its arrays"):
        read_trajectory(tmp_path / "m.h5")


def test_holes_and_parts_come_back(tmp_path):
    times, position, velocity = motion()
    shapes = (framed(1e-6), beads(1e-6))
    write_trajectory(tmp_path / "m.h5", (times, position, velocity, shapes), {})
    again = read_trajectory(tmp_path / "m.h5")
    for one, other in zip(shapes, again.shapes, strict=True):
        assert other.area == pytest.approx(one.area, rel=1e-12)
        assert [len(part.rings) for part in other.parts] == [len(part.rings) for part in one.parts]
        assert [part.radius for part in other.parts] == [part.radius for part in one.parts]


def changed(path, change):
    """Change the HDF5 content of a file and seal it anew."""
    image = io.BytesIO(read_sealed(path))
    with h5py.File(image, "r+") as file:
        change(file)
    path.write_bytes(seal(image.getvalue()))


def as_version_2(file):
    """Store the first body as version 2 did one without holes or parts: with one radius."""
    file["vertices_0"].attrs["radius"] = file["point_radius_0"][0]
    for name in ("part_0", "ring_0", "point_radius_0"):
        del file[name]
    file.attrs["schema_version"] = 2


def test_trajectories_of_version_2_are_read(tmp_path):
    write_trajectory(tmp_path / "m.h5", (*motion(), SHAPES), {})
    changed(tmp_path / "m.h5", as_version_2)
    for one, other in zip(SHAPES, read_trajectory(tmp_path / "m.h5").shapes, strict=True):
        assert (other.area, other.radius) == pytest.approx((one.area, one.radius), rel=1e-12)


def other_ring(file):
    file["ring_0"][5] = 3


def one_short(file):
    column = file["part_0"][:-1]
    del file["part_0"]
    file["part_0"] = column


@pytest.mark.parametrize("change", [other_ring, one_short])
def test_rings_that_cannot_be_are_refused(tmp_path, change):
    write_trajectory(tmp_path / "m.h5", (*motion(), (framed(1e-6), beads(1e-6))), {})
    changed(tmp_path / "m.h5", change)
    with pytest.raises(FileError, match="has no readable trajectory"):
        read_trajectory(tmp_path / "m.h5")

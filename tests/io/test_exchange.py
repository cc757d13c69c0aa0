"""Motion read back by the programs that it is written for: VTK, gsd, OVITO, xarray."""

import h5py
import numpy as np
import pytest
import shapely

from flocsim import Composite, Sphere, SpheroPolygon
from flocsim.__main__ import main
from flocsim.errors import UsageError
from flocsim.io.trajectory import (
    MOST_FRAMES,
    outer_ring,
    placed,
    rings_of,
    write_gsd,
    write_trajectory,
    write_vtkhdf,
)
from tests.helpers.compound_shapes import beads, framed

SHAPES = (
    SpheroPolygon([[0, 0], [9e-6, 0], [9e-6, 6e-6], [1e-6, 5e-6]], 5e-7),
    Sphere(2e-6),
)
TURNS = np.linspace(0.1, 2 * np.pi - 0.1, 24)
RING = SpheroPolygon(
    [[r * np.cos(a), r * np.sin(a)] for r, turns in ((9e-6, TURNS), (7e-6, TURNS[::-1]))
     for a in turns], 1e-6,
)  # fmt: skip
"""A C whose ends, swept by the disk, touch: an outline with a hole."""


def motion(count=7):
    """Times (k,), places and velocities (k, 2, 3) of bodies some µm apart."""
    rng = np.random.default_rng(4)
    times = np.sort(rng.random(count))
    position = rng.random((count, 2, 3)) * [3e-5, 3e-5, 6.0]
    return times, position, rng.random((count, 2, 3)) * [1e-3, 1e-3, 50.0]


def area_of(ring):
    """The area [m²] within a ring, above 0 where it goes round counter-clockwise."""
    x, y = ring.T
    return 0.5 * float(np.sum(x * np.roll(y, -1) - np.roll(x, -1) * y))


@pytest.mark.parametrize("shape", [*SHAPES, RING, framed(1e-6), beads(1e-6)])
def test_outlines_are_placed_where_the_shapes_are(shape):
    place = np.array([[3e-6, -2e-6, 0.7]])
    rings = rings_of(shape)
    assert all((area_of(ring) < 0.0) == hole for ring, hole in rings)
    assert sum(area_of(ring) for ring, _ in rings) == pytest.approx(shape.area, rel=2e-2)
    # Holes fill up. Arcs are cut at other places where a shape is turned: the area is the same.
    moved, there = (
        shapely.union_all([shapely.Polygon(ring) for ring in outlines])
        for outlines in ([placed(ring, place)[0] for ring, _ in rings], shape.outline(*place[0]))
    )
    assert moved.symmetric_difference(there).area < 5e-3 * shape.area


def test_disks_that_touch_in_a_point_get_one_outer_ring():
    pair = Composite([(Sphere(1e-6), (0.0, 0.0)), (Sphere(2e-6), (3e-6, 0.0))])
    assert [hole for _, hole in rings_of(pair)] == [False, False]
    joined = outer_ring(pair)
    assert pair.area < area_of(joined) < 1.1 * pair.area
    middle = shapely.Polygon(joined).centroid
    assert [1e6 * middle.x, 1e6 * middle.y] == pytest.approx([0.0, 0.0], abs=0.1)


@pytest.mark.parametrize("shapes", [SHAPES, (RING, SHAPES[0]), (framed(1e-6), beads(1e-6))])
def test_vtk_reads_the_outlines_at_every_time(tmp_path, shapes):
    hdf = pytest.importorskip("vtkmodules.vtkIOHDF", reason="needs flocsim[formats]")
    from vtkmodules.util.numpy_support import vtk_to_numpy

    times, position, velocity = motion()
    write_vtkhdf(tmp_path / "m", (times, position, velocity, shapes))
    reader = hdf.vtkHDFReader()
    reader.SetFileName(str(tmp_path / "m"))
    assert reader.CanReadFile(str(tmp_path / "m"))
    reader.UpdateInformation()
    assert reader.GetNumberOfSteps() == len(times)
    rings = [rings_of(shape) for shape in shapes]
    for step in (0, 3, len(times) - 1, 1):
        reader.SetStep(step)
        reader.Update()
        data = reader.GetOutput()
        assert reader.GetTimeValue() == pytest.approx(times[step], rel=1e-12)
        assert data.GetNumberOfPolys() == sum(map(len, rings)) == data.GetNumberOfCells()
        points = vtk_to_numpy(data.GetPoints().GetData())
        bodies = vtk_to_numpy(data.GetCellData().GetArray("body"))
        holes = vtk_to_numpy(data.GetCellData().GetArray("hole"))
        cells = [(n, *ring) for n, each in enumerate(rings) for ring in each]
        for cell, (body, ring, hole) in enumerate(cells):
            found = data.GetCell(cell).GetPointIds()
            ids = [found.GetId(k) for k in range(found.GetNumberOfIds())]
            expected = placed(ring, position[step : step + 1, body])[0]
            np.testing.assert_allclose(points[ids, :2], expected, rtol=1e-12, atol=1e-18)
            assert bodies[cell] == body and holes[cell] == hole
        assert not points[:, 2].any()


def test_gsd_reads_bodies_with_polygons(tmp_path):
    hoomd = pytest.importorskip("gsd.hoomd", reason="needs flocsim[formats]")
    times, position, velocity = motion()
    write_gsd(tmp_path / "m.gsd", (times, position, velocity, SHAPES))
    with hoomd.open(tmp_path / "m.gsd") as frames:
        assert len(frames) == len(times)
        for step, frame in enumerate(frames):
            assert frame.log["time"][0] == times[step]
            places = frame.particles.position
            np.testing.assert_allclose(places[:, :2], 1e6 * position[step, :, :2], rtol=1e-6)
            w, _, _, z = frame.particles.orientation.T
            turned = np.angle(np.exp(1j * (2.0 * np.arctan2(z, w) - position[step, :, 2])))
            np.testing.assert_allclose(turned, 0.0, atol=1e-6)
            np.testing.assert_allclose(frame.log["particles/spin"], velocity[step, :, 2])
            np.testing.assert_allclose(
                frame.particles.velocity[:, :2], 1e6 * velocity[step, :, :2], rtol=1e-6
            )
            half = 0.5 * frame.configuration.box[0]
            assert np.abs(places).max() < half and frame.configuration.dimensions == 2
        polygon, sphere = frame.particles.type_shapes
    assert sphere == {"type": "Sphere", "diameter": 4.0}
    assert polygon["type"] == "Polygon"
    ring = np.array(polygon["vertices"])
    np.testing.assert_allclose(ring, 1e6 * rings_of(SHAPES[0])[0][0])
    assert area_of(ring) == pytest.approx(1e12 * SHAPES[0].area, rel=2e-2)


def test_ovito_reads_places_and_shapes(tmp_path):
    pytest.importorskip("gsd", reason="needs flocsim[formats]")
    ovito = pytest.importorskip("ovito.io", reason="needs flocsim[formats]", exc_type=ImportError)
    times, position, velocity = motion()
    write_gsd(tmp_path / "m.gsd", (times, position, velocity, SHAPES))
    pipeline = ovito.import_file(str(tmp_path / "m.gsd"))
    assert pipeline.source.num_frames == len(times)
    for step in (0, len(times) - 1):
        data = pipeline.compute(step)
        places = np.asarray(data.particles.positions)
        np.testing.assert_allclose(places[:, :2], 1e6 * position[step, :, :2], rtol=1e-6)
        types = data.particles.particle_types.types
        assert [each.name for each in types] == ["body 0", "body 1"]
        mesh = types[0].mesh
        corners = np.asarray(mesh.get_vertices())
        assert np.ptp(corners[:, 0]) == pytest.approx(
            1e6 * np.ptp(rings_of(SHAPES[0])[0][0][:, 0]), rel=1e-5
        )
        assert 2.0 * types[1].radius == pytest.approx(4.0)


def test_without_gsd_one_line_says_what_to_install(tmp_path, uninstalled):
    uninstalled("gsd")
    with pytest.raises(UsageError, match=r"gsd is not installed: pip install 'flocsim\[formats\]'"):
        write_gsd(tmp_path / "m.gsd", (*motion(), SHAPES))
    assert not list(tmp_path.iterdir())


def test_the_command_writes_what_a_file_of_motion_holds(in_tmp, capsys):
    hoomd = pytest.importorskip("gsd.hoomd", reason="needs flocsim[formats]")
    times, position, velocity = motion()
    write_trajectory("m.h5", (times, position, velocity, SHAPES), {"steps": 6})
    assert main(["export", "gsd", "m.h5"]) == 0
    assert capsys.readouterr().out == "m.gsd\n"
    with hoomd.open("m.gsd") as frames:
        assert frames[3].log["time"][0] == times[3]
        found = frames[3].particles.position[:, :2]
    np.testing.assert_allclose(found, 1e6 * position[3, :, :2], rtol=1e-6)
    assert main(["export", "gsd", "m.h5"]) == 2
    assert "already exists and is left as it is" in capsys.readouterr().err
    assert main(["export", "gsd", "m.h5", "-o", "m.xyz"]) == 2
    assert main(["export", "gsd", "absent.h5"]) == 74
    assert main(["export", "vtkhdf", "m.h5"]) == 0
    with h5py.File("m.vtkhdf") as file:
        np.testing.assert_array_equal(file["VTKHDF/Steps/Values"], times)


def test_long_motions_are_thinned_and_keep_their_ends(tmp_path):
    times, position, velocity = motion(1001)
    write_vtkhdf(tmp_path / "m.vtkhdf", (times, position, velocity, SHAPES))
    with h5py.File(tmp_path / "m.vtkhdf") as file:
        values = file["VTKHDF/Steps/Values"][()]
    assert len(values) == MOST_FRAMES and values[[0, -1]].tolist() == times[[0, -1]].tolist()

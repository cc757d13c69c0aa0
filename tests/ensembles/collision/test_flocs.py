"""The flocs of a study: grown or read, chosen by size, resized exactly."""

import attrs
import numpy as np
import pytest

from flocsim import Sphere, SpheroPolygon
from flocsim.ensembles.collision import flocs as flocs_module
from flocsim.ensembles.collision.flocs import Floc, FlocPool, load_flocs, nearest_in_ratio
from flocsim.ensembles.config.schema import ShapesConfig
from flocsim.ensembles.storage.identity import shape_numbers
from flocsim.errors import ConfigError
from flocsim.io.shape_library import read_library
from tests.helpers.small_study import grown, write_star_library

ROD = SpheroPolygon([[-4e-6, 0.0], [4e-6, 0.0]], 1e-6)


def test_synthetic_flocs_follow_from_the_seed():
    shapes = ShapesConfig(vertices=(1, 4), pool=2)
    first, again, other = (load_flocs(shapes, seed) for seed in (7, 7, 8))
    assert [floc.name for floc in first] == ["synthetic#0", "synthetic#1"]
    for floc, same, different in zip(first, again, other, strict=True):
        assert list(floc.shapes) == [4]
        np.testing.assert_array_equal(floc.shapes[4].vertices, same.shapes[4].vertices)
        assert not np.array_equal(floc.shapes[4].vertices, different.shapes[4].vertices)


def test_a_larger_pool_keeps_the_flocs_of_a_smaller_one():
    few, more = grown(1, (1, 4, 16), 2), load_flocs(ShapesConfig(vertices=(4,), pool=3), 1)
    for floc, same in zip(few, more, strict=False):
        np.testing.assert_array_equal(floc.shapes[4].vertices, same.shapes[4].vertices)


@pytest.fixture
def library(tmp_path):
    """A library of three stars with N = 4 and 8."""
    write_star_library(tmp_path / "stars.h5", vertices=(4, 8))
    return tmp_path / "stars.h5"


def from_library(path, vertices):
    """The flocs of a library for these N."""
    return load_flocs(ShapesConfig(source="library", file=path, vertices=vertices), 1)


def test_flocs_of_a_library_have_their_size_in_spheroradii(library):
    flocs = from_library(library, (1, 4))
    assert [floc.name for floc in flocs] == ["star 8", "star 16", "star 24"]
    assert [floc.ratio for floc in flocs] == [8.0, 16.0, 24.0]
    assert all(list(floc.shapes) == [4] for floc in flocs)


def test_a_library_that_lacks_a_number_of_vertices(library):
    with pytest.raises(ConfigError, match=r"asks for N = 16, but .* holds N = 4, 8: fit again"):
        from_library(library, (4, 16))


def flocs_of(ratios):
    """Flocs of these ratios, without shapes."""
    return [Floc(str(ratio), ratio, {}) for ratio in ratios]


def test_the_nearest_in_ratio_come_first():
    values = [4.0, 16.0, 8.0, 16.0]
    assert nearest_in_ratio(values, 16.0, 3) == [1, 3, 2]
    # As a ratio: 8 is as far from 16 as 32 is.
    assert nearest_in_ratio([32.1, 8.0], 16.0, 1) == [1]
    assert nearest_in_ratio(values, 5.0, 100) == [0, 2, 1, 3]


def test_the_two_bodies_are_two_flocs_where_there_are_two():
    pool = FlocPool(flocs_of([10.0] * 5), 1e-6, 5)
    numbers = np.random.default_rng(0).random((500, 4))
    chosen = [pool.choose(each, 1e-5, 2e-5) for each in numbers]
    assert all(first != second for first, second in chosen)
    assert set(chosen) == {(a, b) for a in range(5) for b in range(5) if a != b}
    assert pool.choose([0.0, 0.0, 0.999999, 0.999999], 1e-5, 2e-5) == (4, 3)


def test_a_pool_of_one_serves_both_bodies():
    pool = FlocPool(flocs_of([10.0]), 1e-6, 5)
    assert pool.choose([0.5] * 4, 1e-5, 2e-5) == (0, 0)


def test_each_body_draws_from_flocs_of_its_own_size(library):
    pool = FlocPool(from_library(library, (4,)), 1e-6, 1)
    assert pool.choose([0.5] * 4, 7e-6, 25e-6) == (0, 2)


@pytest.mark.parametrize("size", [2e-6, 4.62e-6, 16.41e-6, 23.02e-6, 1e-4])
def test_shapes_are_resized_exactly_and_once(size):
    pool = FlocPool(grown(1, (1, 4, 16), 2), 1e-6, 2)
    for vertices in (4, 16):
        shape = pool.shape(0, vertices, size)
        assert isinstance(shape, SpheroPolygon)
        assert shape.equivalent_radius == pytest.approx(size, rel=1e-12)
        assert shape.radius == pytest.approx(1e-6, rel=1e-9)
        assert pool.shape(0, vertices, size) is shape


def test_the_sphere_is_the_same_whatever_the_floc():
    pool = FlocPool([], 1e-6, 2)
    sphere = pool.shape(None, 1, 5e-6)
    assert isinstance(sphere, Sphere)
    assert pool.shape(7, 1, 5e-6) is sphere


def test_flocs_keep_their_measured_size(library):
    flocs = load_flocs(ShapesConfig(source="library", file=library, vertices=(1, 4), size="own"), 1)
    pool = FlocPool(flocs, 1e-6, 3, own_size=True)
    for place, entry in enumerate(read_library(library)):
        size = entry.equivalent_radius * entry.pixel_size
        assert pool.shape(place, 1, 1e-3).radius == pytest.approx(size, rel=1e-12)
        kept = pool.shape(place, 4, 1e-3)
        assert kept.equivalent_radius == pytest.approx(size, rel=1e-12)
        share = size / entry.fits[4].shape.equivalent_radius
        assert kept.radius == pytest.approx(share * entry.fits[4].shape.radius, rel=1e-12)


def measured(sizes):
    """Flocs of these sizes [m], without shapes."""
    return [Floc(str(size), 1.0, {}, size=size) for size in sizes]


def test_of_two_measured_flocs_the_larger_comes_from_above():
    pool = FlocPool(measured([3e-6, 5e-6, 4e-6, 20e-6]), 1e-6, 3, own_size=True)
    numbers = np.random.default_rng(0).random((500, 4))
    sizes = [[pool.flocs[k].size for k in pool.choose(each, 4e-6, 4e-6)] for each in numbers]
    assert all(i < j < 20e-6 for i, j in sizes)
    assert len({tuple(each) for each in sizes}) == 3


def test_two_flocs_of_one_measured_size_are_no_pair():
    pool = FlocPool(measured([3e-6, 3e-6, 9e-6]), 1e-6, 2, own_size=True)
    assert {pool.choose([0.0, 0.0, n, n], 3e-6, 3e-6) for n in (0.1, 0.6, 0.9)} == {(0, 2), (1, 2)}


def test_a_library_of_one_measured_size_is_refused(tmp_path):
    write_star_library(tmp_path / "one.h5", vertices=(4,), ratios=(8.0,))
    shapes = ShapesConfig(source="library", file=tmp_path / "one.h5", vertices=(4,), size="own")
    with pytest.raises(
        ConfigError, match=r"needs flocs of at least two sizes, but .* holds 1 floc"
    ):
        load_flocs(shapes, 1)


def test_pairs_alike_in_their_error():
    of_i, of_j = {4: 30.0, 8: 21.0, 16: 12.0, 64: 12.0}, {4: 20.0, 8: 12.0, 16: 5.0, 64: 50.0}
    flocs = [Floc("i", 8.0, {}, of_i), Floc("j", 9.0, {}, of_j)]
    pool = FlocPool(flocs, 1e-6, 1, by_error=True)
    found = {n: pool.vertices_of(0, 1, n) for n in (1, 4, 8, 16, 64)}
    # Of 16 and 64 vertices, which are equally wrong, the nearer to N; a sphere meets a sphere.
    assert found == {1: (1, 1), 4: (8, 4), 8: (16, 8), 16: (16, 16), 64: (4, 64)}
    assert FlocPool(flocs, 1e-6, 1).vertices_of(0, 1, 4) == (4, 4)


def test_pairs_alike_in_their_error_may_have_any_fit_of_the_library(library):
    shapes = ShapesConfig(source="library", file=library, vertices=(4,), pairs_alike_in="error")
    assert all(list(floc.shapes) == list(floc.errors) == [4, 8] for floc in load_flocs(shapes, 1))


def test_a_floc_that_is_kept_is_the_one_that_was_grown_bit_by_bit(
    environment, tmp_path, monkeypatch
):
    load_flocs(ShapesConfig(vertices=(1, 4, 9), pool=1), 4)  # compiles what the suite has anyway
    environment["FLOCSIM_CACHE"] = str(tmp_path)
    tmp_path.chmod(0o700)
    shapes = ShapesConfig(vertices=(1, 4, 9), pool=2)
    grown = load_flocs(shapes, 3)
    assert len(list(tmp_path.glob("flocsim_floc-*"))) == 4
    monkeypatch.setattr(flocs_module, "fit_mask", None)  # nothing is fitted
    for before, now in zip(grown, load_flocs(shapes, 3), strict=True):
        assert before.errors == now.errors
        for vertices in (4, 9):
            np.testing.assert_array_equal(
                shape_numbers(before.shapes[vertices]), shape_numbers(now.shapes[vertices])
            )
    with pytest.raises(TypeError):
        load_flocs(attrs.evolve(shapes, fractal_dimension=1.5), 3)

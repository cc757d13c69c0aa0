"""Inner functions are linked, not compiled by themselves, and compute the same."""

import numpy as np
import pytest

from flocsim import Body, Sphere, System, composer
from flocsim import numba_internals as linking
from flocsim.composer import compose
from flocsim.forces import StokesDrag


def root(x):
    return inner(x) + twice(x)


def inner(x):
    return np.sqrt(twice(x))


def twice(x):
    return 2.0 * x


@pytest.fixture
def fresh(monkeypatch, tmp_path):
    """Nothing compiled before is at hand."""
    monkeypatch.setenv("FLOCSIM_CACHE", str(tmp_path))
    monkeypatch.setattr(composer, "_composed", {})
    linking.pipeline.cache_clear()
    yield monkeypatch
    linking.pipeline.cache_clear()


def test_this_numba_can_do_it():
    assert linking.pipeline() is not None


def test_a_numba_that_is_not_what_it_was_compiles_the_usual_way(fresh):
    fresh.setattr(linking, "NEEDED", ("what_numba_has_not",))
    assert linking.pipeline() is None
    assert compose(root, {})(2.0) == root(2.0)


def test_inner_functions_have_no_machine_code(fresh):
    made = []
    real = linking.linked_library

    def noting(base):
        kind = real(base)
        made.append(kind)
        return kind

    fresh.setattr(linking, "linked_library", noting)
    assert compose(root, {})(2.0) == root(2.0)
    assert len(made) == 1
    assert made[0].get_pointer_to_function(None, "inner") == 0


@pytest.mark.slow
def test_motion_is_the_same_to_the_last_bit(fresh):
    system = System([Body(Sphere(5e-6), velocity=(1e-3, 0.0), density=2650.0)], [StokesDrag()])
    linked = system.run(1e-4)
    fresh.setattr(composer, "_composed", {})
    fresh.setattr(composer, "pipeline", lambda: None)
    fresh.setenv("FLOCSIM_CACHE", str(composer.cache_path() / "other"))
    usual = system.run(1e-4)
    assert np.array_equal(linked.position, usual.position)
    assert linked.steps == usual.steps

"""Who meets whom: pairs drawn from the measured distribution, by size classes."""

import attrs
import numpy as np
import pytest

from flocsim.ensembles.collision.flocs import Floc, FlocPool
from flocsim.ensembles.collision.pairings import (
    SizeClass,
    TwoClasses,
    TwoSizes,
    quantile,
    size_classes,
)
from flocsim.ensembles.config.pair_scene import PairScene
from flocsim.errors import ConfigError
from tests.helpers.tiers import rest_slow

SIZES = (9e-6, 2e-6, 4e-6, 4e-6, 6e-6, 12e-6)


def flocs_of(sizes):
    """Flocs of these sizes [m], without shapes."""
    return [Floc(str(size), 1.0, {}, size=size) for size in sizes]


def pair_of(sizes=SIZES, places=(0, 0), **words):
    classes = size_classes(PairScene(pairs="measured", **words), flocs_of(sizes))
    return TwoClasses("pair", *(classes[place] for place in places))


def drawn(pair, sizes=SIZES, count=100):
    """(sizes of i and j, share of each pair) from a grid of random numbers, evenly spread."""
    grid = (np.arange(count) + 0.5) / count
    found = {}
    for a in grid:
        for b in grid:
            places = pair.choose((0.0, 0.0, a, b))
            found[places] = found.get(places, 0) + 1 / count**2
    return found, [[sizes[places[body]] for places in found] for body in (0, 1)]


@pytest.mark.parametrize(
    ("weight", "power", "count"),
    rest_slow(
        [("area", 2, 100), ("number", 0, 300), ("area", 2, 300), ("volume", 3, 300)],
        lambda weight, power, count: count == 100,
    ),
)
def test_two_flocs_are_drawn_independently_but_for_one_size(weight, power, count):
    found, _ = drawn(pair_of(weight=weight), count=count)
    weights = np.array(SIZES) ** power / np.sum(np.array(SIZES) ** power)
    wanted = {
        (i, j): 2.0 * weights[i] * weights[j]
        for i in range(6) for j in range(6) if SIZES[i] < SIZES[j]
    }  # fmt: skip
    total = sum(wanted.values())
    assert found.keys() == wanted.keys()
    for places, share in wanted.items():
        assert found[places] == pytest.approx(share / total, abs=0.01)


def test_the_larger_comes_from_above_and_the_spans_hold_all():
    pair = pair_of()
    _, (of_i, of_j) = drawn(pair)
    assert all(i < j for i, j in zip(of_i, of_j, strict=True))
    assert pair.spans == ((min(of_i), max(of_i)), (min(of_j), max(of_j)))
    assert pair.spans == ((2e-6, 9e-6), (4e-6, 12e-6))
    assert pair.fastest == (2e-6, 12e-6) and pair.largest == (9e-6, 12e-6)


@pytest.mark.slow
def test_the_radii_are_the_medians_over_the_pairs():
    rng = np.random.default_rng(1)
    sizes = rng.uniform(2e-6, 30e-6, 41).tolist()
    pair = pair_of(sizes, weight="area")
    found, of_bodies = drawn(pair, sizes, 200)
    for radius, of_body in zip(pair.radii, of_bodies, strict=True):
        below = sum(w for w, size in zip(found.values(), of_body, strict=True) if size < radius)
        upto = sum(w for w, size in zip(found.values(), of_body, strict=True) if size <= radius)
        assert below < 0.51 and upto > 0.49
    assert pair.radii[0] < pair.radii[1]


def test_limits_and_borders_choose_the_flocs():
    words = {"min_radius": 3e-6, "max_radius": 10e-6, "classes": (5e-6,)}
    sizes = (2e-6, 3e-6, 4e-6, 6e-6, 10e-6, 11e-6)
    _, (of_i, of_j) = drawn(pair_of(sizes, (0, 1), **words), sizes)
    assert set(of_i) == {3e-6, 4e-6} and set(of_j) == {6e-6, 10e-6}


def test_classes_of_equal_weight_and_one_size_in_one_class():
    def numbers(count, sizes=SIZES, **words):
        scene = PairScene(pairs="measured", classes=count, **words)
        return [each.sizes.tolist() for each in size_classes(scene, flocs_of(sizes))]

    assert numbers(2) == [[2e-6, 4e-6, 4e-6], [6e-6, 9e-6, 12e-6]]
    many = np.linspace(1e-6, 20e-6, 400).tolist()
    first, second = numbers(2, many, weight="volume")
    shares = [np.sum(np.array(each) ** 3) for each in (first, second)]
    assert shares[0] / sum(shares) == pytest.approx(0.5, abs=0.01)


def test_which_flocs_are_drawn_does_not_depend_on_the_order_of_the_library():
    pair, other = pair_of(), pair_of(SIZES[::-1])
    for a, b in np.random.default_rng(2).random((200, 2)):
        one, two = pair.choose((0, 0, a, b)), other.choose((0, 0, a, b))
        assert [SIZES[k] for k in one] == [SIZES[::-1][k] for k in two]


@pytest.mark.parametrize("number", [0.0, 0.5, np.nextafter(1.0, 0.0)])
def test_a_quantile_is_never_a_floc_without_weight(number):
    weights = np.array([0.0, 0.1, 0.2, 0.3, 0.0])
    assert weights[quantile(weights, number)] > 0.0


@pytest.mark.parametrize(
    ("words", "why"),
    [
        ({"min_radius": 20e-6}, "max_radius: it holds 6 flocs of 2 to 12 um"),
        ({"classes": (3e-6,)}, "class to3um holds 1 of one size, which never meet"),
        ({"classes": (15e-6,)}, "class from15um holds 0, which never meet"),
        ({"classes": 6}, "class q1 holds 1 of one size"),
    ],
)
def test_classes_without_a_pair_are_refused(words, why):
    with pytest.raises(ConfigError, match=why):
        pair_of(**words)


def test_types_of_measured_sizes_span_the_flocs_that_are_drawn():
    pool = FlocPool(flocs_of(SIZES), 1e-6, 2, own_size=True)
    pair = TwoSizes("I", (4e-6, 9e-6), pool)
    _, (of_i, of_j) = drawn(pair)
    (low_i, high_i), (low_j, high_j) = pair.spans
    assert low_i <= min(of_i) <= max(of_i) <= high_i
    assert low_j <= min(of_j) <= max(of_j) <= high_j
    assert pair.spans == ((4e-6, 9e-6), (9e-6, 12e-6))
    resized = TwoSizes("I", (4e-6, 9e-6), FlocPool([], 1e-6, 2))
    assert resized.fastest == resized.largest == (4e-6, 9e-6)


def test_a_floc_counts_for_as_many_as_its_pictures_have_hidden():
    flocs = [attrs.evolve(each, weight=k + 1.0) for k, each in enumerate(flocs_of(SIZES))]
    (alone,) = size_classes(PairScene(pairs="measured"), flocs)
    expected = [flocs[place].weight for place in alone.places]
    assert np.allclose(alone.weights, np.array(expected) / sum(expected))


def test_flocs_whose_sizes_differ_by_less_than_their_errors_do_not_meet():
    sizes = np.array([5e-6, 5.0001e-6, 7e-6])
    one = SizeClass("all", np.arange(3), sizes, np.full(3, 1.0 / 3.0))
    pairing = TwoClasses("pair", one, one)
    numbers = np.random.default_rng(1).random((200, 4))
    drawn = {pairing.choose(each) for each in numbers}
    assert drawn == {(0, 2), (1, 2)}
    (_, _), (smaller, larger) = pairing.distribution()
    np.testing.assert_allclose(smaller, [1 / 9, 1 / 9, 0.0])
    np.testing.assert_allclose(larger, [0.0, 0.0, 2 / 9])

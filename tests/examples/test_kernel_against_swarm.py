"""The comparison of kernels with swarms of examples/: what it counts, and what is known of it."""

import numpy as np
import pytest

from tests.helpers.example_script import example_script


@pytest.fixture(scope="module")
def example():
    return example_script("kernel_against_swarm")


def bonds(*rows):
    """The group of rows (replicate, time, later, earlier, kind), as a file has them."""
    names = ("replicate", "time", "later", "earlier", "kind")
    columns = np.array(rows, "i4").T
    return {f"bond_{name}": column for name, column in zip(names, columns, strict=True)}


CERTIFICATE, HOOK = 1, 2


@pytest.fixture
def two_swarms(example):
    """Contacts and Flocs of two swarms of four: in the first 1 touches 0 at once and is held later,
    2 joins them, and 3 touches 2 and parts; in the second 3 touches 2, parts, and comes again."""
    contacts = example.contacts_of(bonds(
        (0, 1, 1, 0, 0), (0, 2, 1, 0, CERTIFICATE), (0, 3, 1, 0, 0),
        (0, 3, 2, 1, CERTIFICATE), (0, 1, 3, 2, HOOK), (0, 2, 3, 2, 0),
        (1, 1, 3, 2, 0), (1, 3, 3, 2, CERTIFICATE),
    ))  # fmt: skip
    radius = np.array([[1.0, 1.0, 2.0, 2.5], [1.0, 1.5, 2.0, 2.5]]) * 1e-6
    kind = np.array([[0, 0, 1, 1], [0, 0, 1, 1]])
    return contacts, example.Flocs(radius, 1e3 * radius, kind, np.array([2.0, 4.0]))


def test_a_contact_counts_from_its_touch_where_it_lasts(example, two_swarms):
    contacts, _ = two_swarms
    found = zip(contacts.replicate, contacts.bodies.tolist(), contacts.first, contacts.stop,
                strict=True)  # fmt: skip
    assert sorted(found) == [(0, [1, 0], 1, 4), (0, [2, 1], 3, 4), (1, [3, 2], 3, 4)]
    assert [contacts.clusters(0, place, 4)[0] for place in range(4)] == [4, 3, 3, 2]


def test_meetings_of_single_flocs_are_counted_by_class(example, two_swarms):
    contacts, flocs = two_swarms
    clusters, made, chances = example.meetings(contacts, flocs, np.arange(4.0))
    assert clusters.tolist() == [[4, 3, 3, 2], [4, 4, 4, 3]]
    # That 2 joins a cluster is no meeting of single flocs.
    assert made[:, -1].tolist() == [[[1, 0], [0, 0]], [[0, 0], [0, 1]]]
    # The two of one size never meet; after the first step, 0 and 1 are single no more.
    assert chances[0, -1] == pytest.approx(np.array([[0.0, 4.0], [0.0, 3.0]]) / 2.0)
    assert chances[1, -1] == pytest.approx(np.array([[3.0, 12.0], [0.0, 3.0]]) / 4.0)


def test_flocs_that_are_not_at_their_own_speed_meet_more_often(example, two_swarms):
    contacts, flocs = two_swarms
    velocity = np.zeros((2, 1, 4, 3))
    velocity[:, 0, :, 1] = -flocs.speed
    assert example.quickening(contacts, flocs, velocity, np.zeros(1)) == pytest.approx(1.0)
    # 0 and 1 of the second swarm, at 1 and 1.5 mm/s, are pushed 1.2 mm/s apart sideways.
    velocity[1, 0, 0, 0] = 1.2e-3
    found = example.quickening(contacts, flocs, velocity, np.zeros(1))
    assert found[0, 0] == pytest.approx(1.3 / 0.5) and found[1, 1] == pytest.approx(1.0)


def test_an_interval_is_students(example):
    values = np.array([[1.0], [2.0], [4.0]])
    # t of 2 degrees of freedom at .975 is 4.303.
    assert example.half_width(values) == pytest.approx(4.3027 * np.sqrt(7.0 / 9.0), rel=1e-4)
    assert example.ratio(3.0 * values, values) == (pytest.approx(3.0), pytest.approx(0.0))


def test_a_constant_kernel_halves_the_number_in_its_time(example):
    # dN/dt = −½ β N²: N = N₀/(1 + ½ β N₀ t), whatever the classes.
    parts = example.compositions(2)
    start, beta = np.array([3.0e9, 2.0e9]), 2e-9
    times = np.linspace(0.0, 0.01, 5)
    n = example.decline(np.full((len(parts), len(parts)), beta), parts, start, times)
    assert n.sum(axis=1) == pytest.approx(5.0e9 / (1.0 + 0.5 * beta * 5.0e9 * times), rel=1e-6)
    assert n[:, :-1] @ parts == pytest.approx(np.tile(start, (5, 1)), rel=1e-6)


def test_clusters_settle_as_their_flocs_do_in_the_mean_over_drag(example):
    # Two classes of one size each: r = 1 and 2 µm, w = 1 and 4 mm/s.
    radius = np.array([[1.0, 2.0]]) * 1e-6
    flocs = example.Flocs(radius, np.array([[1e-3, 4e-3]]), np.array([[0, 1]]), np.ones(1))
    parts = example.compositions(2, 2)
    alone = np.array([[0.0, 7.0], [7.0, 0.0]])
    beta = example.kernel_of_clusters(parts, alone, np.full((2, 2), 0.5), radius[0], flocs)
    assert beta[:2, :2].tolist() == alone.tolist()
    one, pair = parts.tolist().index([1, 0]), parts.tolist().index([1, 1])
    # V = (1·1 + 2·4)/3 mm/s, R = √5 µm.
    expected = 0.5 * 2.0 * (1.0 + np.sqrt(5.0)) * 1e-6 * 2e-3
    assert beta[one, pair] == pytest.approx(expected) == beta[pair, one]
    assert beta[parts.tolist().index([2, 0]), one] == pytest.approx(0.0, abs=1e-20)

"""Mergers and break-ups from the clusters of two snapshots."""

import numpy as np
import pytest

from flocsim.io.results.swarm_file import EVENTS, events_of


def found(*labels):
    """Rows without their replicate, of the snapshots of one swarm."""
    events = events_of(np.array([labels]))
    assert not events["event_replicate"].any()
    return np.column_stack([*events.values()])[:, 1:].tolist()


@pytest.mark.parametrize(
    ("before", "after", "events"),
    [
        ([0, 0, 1, 2], [0, 0, 1, 2], []),
        ([0, 0, 1, 2], [1, 1, 0, 2], []),
        ([0, 0, 1, 2], [0, 0, 0, 1], [[1, 2, 1, 3, 2, 1]]),
        ([0, 0, 0, 1], [0, 1, 0, 2], [[1, 1, 2, 3, 2, 1]]),
        ([0, 1, 2, 2], [0, 0, 0, 0], [[1, 3, 1, 4, 2, 1]]),
        ([0, 0, 1, 1], [0, 1, 1, 1], [[1, 2, 2, 4, 2, 2]]),
        ([0, 1, 2, 2], [0, 0, 1, 2], [[1, 2, 1, 2, 1, 1], [1, 1, 2, 2, 1, 1]]),
        # A body that left, a wall, and a time that is not known.
        ([0, 0, 1], [0, -2, 0], [[1, 2, 1, 2, 1, 1]]),
        ([-1, 0, 1], [-1, 0, 0], [[1, 2, 1, 2, 1, 1]]),
        ([0, 1, 2], [-1, -1, -1], []),
    ],
)
def test_what_became_of_clusters(before, after, events):
    assert found(before, after) == events


def test_backwards_mergers_are_break_ups():
    random = np.random.default_rng(2)
    labels = random.integers(0, 12, (40, 30))
    forth, back = events_of(labels[None]), events_of(labels[None, ::-1])
    turned = {**back, "event_before": back["event_after"], "event_after": back["event_before"]}
    turned["event_time"] = len(labels) - back["event_time"]
    ties = forth["event_before"] != forth["event_after"]
    rows = [
        sorted(zip(*(each[name][mask].tolist() for name in EVENTS), strict=True))
        for each, mask in ((forth, ties), (turned, back["event_before"] != back["event_after"]))
    ]
    assert rows[0] == rows[1]


def test_every_replicate_has_its_own():
    labels = np.array([[[0, 1], [0, 0]], [[0, 0], [0, 1]]])
    events = events_of(labels)
    assert events["event_replicate"].tolist() == [0, 1]
    assert events["event_before"].tolist() == [2, 1]
    assert all(column.dtype == np.int32 for column in events.values())

"""From what a journal has of swarms to their results: replicates put together, old ones first."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from flocsim.ensembles.swarms.checks import Form
from flocsim.ensembles.swarms.records import Found, Read, part_in
from flocsim.io.results.swarm_file import (
    AXES,
    BONDS,
    CLUSTERS,
    COMPONENTS,
    COUNTS,
    ENDLESS,
    GONE,
    POINTS,
    RINGS,
    SwarmResults,
    events_of,
)

PLACED = ("bond_replicate", "cluster_replicate", "event_replicate")
"""Columns that count replicates."""

Groups = dict[str, dict[str, np.ndarray]]


def groups_of(form: Form, found: list[Found], read: Read) -> Groups:
    """{group: {column: array}} of replicates, one after another, but for their ends."""
    per_body = [part_in(own.bodies, read).arrays for own in found]
    points = max(len(each["points"]) for each in per_body)
    counts = np.array([each["count"] for each in per_body])
    groups: Groups = {}
    groups["bodies"] = {
        name: np.array([each[name] for each in per_body])
        for name in ("r_eq", "spheroradius", "mass", "floc", "box")
    } | {
        "first_point": np.cumsum(counts, axis=1) - counts, "point_count": counts,
    }  # fmt: skip
    for name in (*POINTS, *RINGS):
        groups["bodies"][name] = np.array([filled_up(each[name], points) for each in per_body])
    shape = len(found), form.moments
    numbers = {name: np.full(shape, np.nan) for name in COUNTS}
    by_class = np.full((*shape, form.classes), np.nan)
    motion = np.full((*shape, form.bodies, 6), np.nan)
    labels = np.full((*shape, form.bodies), -1, dtype=np.int32)
    bonds = [np.zeros((0, len(BONDS)), dtype=np.int32)]
    rows = [np.zeros((0, len(CLUSTERS)))]
    for row, own in enumerate(found):
        for place, record in own.moments.items():
            part = part_in(record, read)
            for name, values in numbers.items():
                value = part.facts.get(name)
                values[row, place] = np.nan if value is None else value
            labels[row, place] = part.arrays["cluster"]
            left = labels[row, place] == GONE
            motion[row, place] = np.where(left[:, None], np.nan, part.arrays["motion"])
            by_class[row, place] = part.arrays["counts"]
            pairs = part.arrays["bonds"]
            at = np.broadcast_to(np.array([row, place], np.int32), (len(pairs), 2))
            bonds.append(np.concatenate([at, pairs], axis=1))
            known = part.arrays["clusters"]
            size = np.bincount(labels[row, place][labels[row, place] >= 0], minlength=len(known))
            at = np.broadcast_to(np.array([row, place]), (len(known), 2))
            rows.append(np.column_stack([at, np.arange(len(known)), size, known]))
    groups["counts"] = numbers | {"n_class": by_class}
    groups["snapshots"] = {
        "position": motion[..., :3], "velocity": motion[..., 3:], "cluster": labels,
    }  # fmt: skip
    groups["events"] = events_of(labels)
    together = np.concatenate(bonds)
    together = together[np.lexsort(together.T[::-1])]
    groups["bonds"] = dict(zip(BONDS, together.T.copy(), strict=True))
    groups["clusters"] = {
        name: column.astype(kind)
        for (name, (kind, _, _)), column in zip(
            CLUSTERS.items(), np.concatenate(rows).T, strict=True
        )
    }
    for name in ENDLESS:
        column = groups["clusters"][name]
        column[column < 0.0] = np.nan
    return groups


def appended(old: Groups, new: Groups) -> Groups:
    """The groups of some replicates, and of others behind them."""
    many = len(old["bodies"]["r_eq"])
    points = max(each["bodies"]["points"].shape[1] for each in (old, new))
    groups: Groups = {}
    for group, columns in new.items():
        groups[group] = {}
        for name, column in columns.items():
            parts = [old[group][name], column + many if name in PLACED else column]
            if name in POINTS | RINGS:
                parts = [
                    np.array([filled_up(each, points) for each in part]).reshape(
                        -1, points, *part.shape[2:]
                    )
                    for part in parts
                ]
            groups[group][name] = np.concatenate(parts).astype(column.dtype)
    return groups


def results_from(
    form: Form, groups: Groups, run: Mapping[str, Any], replicates: np.ndarray | None = None
) -> SwarmResults:
    """The SwarmResults of whole groups; ``replicates``: their numbers, 0, 1, … unless given."""
    count, points = groups["bodies"]["points"].shape[:2]
    scales = {
        "replicate": np.arange(count) if replicates is None else replicates,
        "time": np.array(form.times), "class": np.array([0.0, *form.bounds]),
        "body": np.arange(form.bodies), "component": np.array(COMPONENTS),
        "axis": np.array(AXES), "point": np.arange(points),
        "bond": np.arange(len(groups["bonds"]["bond_kind"])),
        "row": np.arange(len(groups["clusters"]["cluster_bodies"])),
        "event": np.arange(len(groups["events"]["event_time"])),
    }  # fmt: skip
    return SwarmResults(scales, groups, dict(run))


def filled_up(column: np.ndarray, rows: int) -> np.ndarray:
    """A column of core points with zeros behind them, so many rows in all."""
    return np.pad(column, ((0, rows - len(column)), *[(0, 0)] * (column.ndim - 1)))

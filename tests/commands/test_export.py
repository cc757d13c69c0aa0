"""`flocsim export csv`: the tables of every kind of file, as any program reads them."""

import csv

import attrs
import numpy as np
import pytest

from flocsim.__main__ import main
from flocsim.ensembles.pairs.opened import StudyResults
from flocsim.geometry.shapes.shape import Sphere
from flocsim.io.results.schema import OUTCOMES
from flocsim.io.results.strength_file import STATUS
from flocsim.io.results.sweep_file import SweepResults, Swept, write_sweep
from flocsim.io.shape_library import read_library
from flocsim.io.trajectory import write_trajectory
from tests.helpers.results_files import write_results
from tests.helpers.small_rates import mixed, some_kernel
from tests.helpers.small_study import write_star_library
from tests.helpers.swarm_study import make_swarm_results
from tests.helpers.synthetic_results import make_results


@pytest.fixture(autouse=True)
def folder(in_tmp):
    """The current folder."""
    return in_tmp


def exported(capsys, *words):
    """{file: its rows as dicts} that the command writes."""
    assert main(["export", "csv", *words]) == 0
    names = capsys.readouterr().out.split()
    found = {}
    for name in names:
        with open(name, encoding="utf-8", newline="") as file:
            found[name] = list(csv.DictReader(file))
    return found


def numbers(rows, name):
    """A column as numbers, NaN where a cell is empty."""
    return np.array([float(row[name] or "nan") for row in rows])


def test_pairs_give_probabilities_and_replicates(capsys):
    results = make_results(vertices=(1, 4), delta=(0.0, 1.0), count=12)
    write_results("study.h5", results)
    found = exported(capsys, "study.h5")
    assert [*found] == ["study-probabilities.csv", "study-replicates.csv"]
    places, rows = found.values()
    assert len(places) == np.prod(results.shape)
    for name in ("n_total", "pr_a", "pr_a_low"):
        np.testing.assert_array_equal(numbers(places, name), results.probabilities[name].ravel())
    assert numbers(places, "n_class_C").tolist() == (
        results.probabilities["n_class"][..., 2].ravel().tolist()
    )
    assert [*rows[0]][:4] == ["type", "vertices", "delta", "replicate"]
    codes = results.replicates["outcome"].ravel()
    assert [row["outcome"] for row in rows] == [OUTCOMES[code] for code in codes]
    expected = results.replicates["d_c_collision"].ravel()
    np.testing.assert_array_equal(numbers(rows, "d_c_collision"), expected)
    assert np.isnan(expected).any() and "nan" not in {row["d_c_collision"] for row in rows}


def test_rates_give_a_row_for_every_pair_of_classes(capsys):
    results = make_results(types=("I", "III"), vertices=(1, 32), delta=(1.0,), count=5)
    write_results("kernel.h5", attrs.evolve(results, kernel=some_kernel()))
    found = exported(capsys, "kernel.h5", "-o", "rates.csv")
    [rows] = found.values()
    assert len(rows) == 2 * 2 * 2 * 2
    first = rows[1]
    labels = [first[name] for name in ("mechanism", "vertices", "i", "j")]
    assert labels == ["settling", "1", "5um", "10um"]
    assert (float(first["r_i"]), float(first["r_j"])) == (5e-6, 1e-5)
    assert rows[0]["efficiency3"] == "", "bodies of one size do not settle onto each other"
    assert "kernel-replicates.csv" in exported(capsys, "kernel.h5")
    assert StudyResults("kernel.h5").labelled("kernel").axes["r_j"].axes == ("j",)


def test_swarms_give_what_is_counted_over_time(capsys):
    results = make_swarm_results()
    results.write("swarm.h5")
    found = exported(capsys, "swarm.h5")
    assert [*found] == ["swarm-counts.csv", "swarm-clusters.csv", "swarm-events.csv"]
    rows = found["swarm-counts.csv"]
    expected = results.groups["counts"]["clusters"].ravel()
    np.testing.assert_array_equal(numbers(rows, "clusters"), expected)
    [rows] = exported(capsys, "swarm.h5", "--table", "snapshots").values()
    position = results.groups["snapshots"]["position"]
    np.testing.assert_array_equal(numbers(rows, "position_x"), position[..., 0].ravel())


def test_strengths_give_every_doublet(capsys):
    found = mixed()
    found.write("s.h5")
    written = exported(capsys, "s.h5")
    assert [*written] == ["s-doublets.csv", "s-conditions.csv"]
    rows = written["s-doublets.csv"]
    assert [row["status"] for row in rows] == [STATUS[code] for code in found.column("status")]
    np.testing.assert_array_equal(numbers(rows, "opens"), found.column("opens"))


def test_sweeps_have_their_keys_first(capsys):
    one = make_swarm_results().labelled("counts")
    swept = Swept("fluid.viscosity", [1e-3, 2e-3], "Pa s")
    columns = {
        name: attrs.evolve(each, axes=("viscosity", *each.axes), values=np.stack([each.values] * 2))
        for name, each in one.columns.items()
    }
    joined = attrs.evolve(
        one, axes={"viscosity": swept.column("viscosity"), **one.axes}, columns=columns
    )
    write_sweep(SweepResults("all.h5", {"viscosity": swept}, {"counts": joined}))
    [(name, rows)] = exported(capsys, "all.h5").items()
    assert name == "all-counts.csv"
    assert [*rows[0]][:3] == ["viscosity", "replicate", "time"]
    half = len(rows) // 2
    assert [row["viscosity"] for row in rows] == ["0.001"] * half + ["0.002"] * half


def test_libraries_give_their_flocs(capsys):
    write_star_library("l.h5", vertices=(1, 4))
    entries = read_library("l.h5")
    found = exported(capsys, "l.h5")
    [(name, rows)] = found.items()
    assert name == "l-flocs.csv"
    assert [row["floc"] for row in rows] == [each.floc_id for each in entries]
    assert numbers(rows, "centroid_x").tolist() == [each.centroid[0] for each in entries]
    assert numbers(rows, "equivalent_radius").tolist() == [
        each.equivalent_radius for each in entries
    ]


def test_trajectories_give_every_state(capsys):
    times = np.linspace(0.0, 1.0, 5)
    position, velocity = np.random.default_rng(1).random((2, 5, 2, 3))
    shapes = [Sphere(1e-6), Sphere(2e-6)]
    write_trajectory("run.h5", (times, position, velocity, shapes), {})
    [(name, rows)] = exported(capsys, "run.h5").items()
    assert name == "run-motion.csv"
    assert [*rows[0]][:3] == ["time", "body", "position_x"]
    np.testing.assert_array_equal(numbers(rows, "velocity_angle"), velocity[..., 2].ravel())
    assert numbers(rows, "body").tolist() == [0, 1] * 5


def test_files_are_kept_and_wrong_words_are_refused(capsys):
    write_results("study.h5", make_results(types=("I",), vertices=(1,), delta=(0.0,), count=3))
    exported(capsys, "study.h5")
    for words, why in (
        ([], "already exists and is left as it is"),
        (["--table", "numbers"], "group must be one of probabilities"),
        (["--table", "outlines"], "has no group outlines"),
    ):
        assert main(["export", "csv", "study.h5", *words]) == 2
        error = capsys.readouterr().err
        assert why in error and error.count("\n") == 1
    exported(capsys, "study.h5", "--overwrite")

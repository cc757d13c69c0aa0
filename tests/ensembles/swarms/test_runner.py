"""Swarm studies end to end: the same bytes however they are run, nothing lost, all that reads
the file."""

import json
import os
import re
import shutil
import signal
import subprocess
import sys
import time

import numpy as np
import pytest

import flocsim
from flocsim.__main__ import main
from flocsim.ensembles.kind import Overseer
from flocsim.ensembles.swarms.results import decoded
from flocsim.ensembles.swarms.study import SwarmStudy
from flocsim.errors import UsageError
from flocsim.io import terminal
from flocsim.io.journal import PART
from flocsim.io.results.swarm_file import SWARMS
from flocsim.swarms import runner
from tests.helpers.journals import records_in
from tests.helpers.swarm_study import swarm_config, write_swarm_study
from tests.helpers.waiting import PATIENCE


@pytest.fixture(scope="module")
def finished(tmp_path_factory):
    """The folder of a study that has run."""
    folder = tmp_path_factory.mktemp("swarm")
    path = write_swarm_study(folder)
    code = main(["swarm", str(path), "--quiet", "-o", str(folder / "swarm.h5")])
    assert code == 0 and not (folder / "swarm.h5.journal").exists()
    return folder


def same(one, other):
    """Whether two files have the same bytes in all columns."""
    a, b = columns_of(one), columns_of(other)
    return all(values.tobytes() == b[name].tobytes() for name, values in a.items())


def columns_of(path):
    """{(group, column): array} of a file."""
    found = SWARMS.read(path)
    return {
        (name, column): found.groups[name][column]
        for name, group in found.kind.groups.items() for column in group.columns
    }  # fmt: skip


def test_what_is_written_agrees_with_itself(finished):
    results = flocsim.open(finished / "swarm.h5")
    counts, moments = results.groups["counts"], results.groups["snapshots"]
    assert counts["clusters"][:, 0].tolist() == [12.0, 12.0]
    assert counts["n_class"].sum(axis=2).tolist() == counts["clusters"].tolist()
    for k in range(2):
        for t in range(4):
            labels = moments["cluster"][k, t]
            assert len(set(labels.tolist())) == counts["clusters"][k, t]
            assert np.bincount(labels).max() == counts["largest"][k, t]
    half, largest = counts["median_error"], counts["error"]
    assert (half[:, 1:] > 0.0).all() and (half <= largest).all() and (half < largest).any()
    fell = moments["position"][:, -1, :, 1] - moments["position"][:, 0, :, 1]
    assert fell.max() < 0.0
    bonds = results.groups["bonds"]
    kinds = ("touching", "certificate", "hook", "rest")
    for k, t, place in np.ndindex(2, 4, 4):
        rows = (bonds["bond_replicate"] == k) & (bonds["bond_time"] == t)
        found = int(np.sum(rows & (bonds["bond_kind"] == place)))
        assert found == counts[f"bonds_{kinds[place]}"][k, t]
    assert len(bonds["bond_kind"]) > 0
    clusters = results.groups["clusters"]
    for k, t in np.ndindex(counts["clusters"].shape):
        rows = (clusters["cluster_replicate"] == k) & (clusters["cluster_time"] == t)
        label = results.groups["snapshots"]["cluster"][k, t]
        assert clusters["cluster_number"][rows].tolist() == [*range(label.max() + 1)]
        assert clusters["cluster_bodies"][rows].tolist() == np.bincount(label).tolist()
        assert clusters["cluster_bodies"][rows].max() == counts["largest"][k, t]
        share = clusters["cluster_mass"][rows] / clusters["cluster_mass"][rows].sum()
        assert share @ clusters["cluster_speed"][rows] == pytest.approx(counts["settling"][k, t])
        assert share @ clusters["cluster_gyration"][rows] == pytest.approx(counts["gyration"][k, t])
        inside = (bonds["bond_replicate"] == k) & (bonds["bond_time"] == t)
        assert clusters["cluster_bonds"][rows].sum() == inside.sum()
        alone = clusters["cluster_bodies"][rows] == 1
        together = np.bincount(label, results.groups["bodies"]["r_eq"][k])
        assert clusters["cluster_hydrodynamic"][rows][alone] == pytest.approx(together[alone])
        assert np.all(clusters["cluster_hydrodynamic"][rows][~alone] < together[~alone])
    assert results.groups["ends"]["finished"].tolist() == [1, 1]
    assert json.loads(results.run["identity"])["seed"] == 4


def run_parts(config, halts=(), left=None, replicate=0):
    """([(name, data)] of the parts that a replicate saves, its row); it is asked to halt at some
    looks."""
    parts, looks, study = [], iter(range(10**9)), SwarmStudy(config)
    overseer = Overseer(
        lambda: next(looks) in halts, lambda name, about, data: parts.append((name, data))
    )
    row, _ = study.run_task(study.conditions[0], replicate, overseer, left)
    return parts, row


def moments_in(parts):
    """The data of snapshots."""
    return [data for name, data in parts if name.startswith("moment")]


@pytest.fixture
def often(monkeypatch):
    """A swarm is looked at, and said to be where it is, all the time."""
    monkeypatch.setattr(runner, "LOOK_SECONDS", 1e-5)
    monkeypatch.setattr(terminal, "LINE_SECONDS", 0.0)


def test_a_replicate_is_left_within_a_window_and_goes_on_to_the_same_bytes(tmp_path, often):
    config = swarm_config(tmp_path)
    whole, _ = run_parts(config)
    parts, left, times = [], None, 0
    while True:
        found, ended = run_parts(config, halts=range(2, 10**9) if times < 6 else (), left=left)
        parts += found
        if ended:
            break
        times += 1
        left = decoded(found[-1][1])
    assert times > 1
    assert moments_in(whole) == moments_in(parts)


def test_how_far_a_swarm_is_is_told_while_it_runs(tmp_path, often, capsys):
    """In whole lines where no terminal is; within windows, too."""
    path = write_swarm_study(tmp_path)
    assert main(["swarm", str(path), "-o", str(tmp_path / "told.h5")]) == 0
    output = capsys.readouterr().out
    lines = [line for line in output.splitlines() if "; swarm " in line]
    assert lines
    for line in lines:
        assert re.search(r"\d of 8 snapshots.*; swarm [01] at [\d.e-]+ s, \d+ steps further$", line)
    assert "\r" not in output


@pytest.mark.parametrize("leaving", ["remove", "reenter"])
def test_what_leaves_is_told_and_resumed(tmp_path, leaving):
    """A box without a floor: the same snapshots from any state on, what left counted once."""
    config = swarm_config(tmp_path, {"scene": {"periodic": "x", "leaving": leaving}})
    whole, ended = run_parts(config)
    assert ended
    moments = list(map(decoded, moments_in(whole)))
    last, gone = moments[-1], int(np.sum(moments[-1]["cluster"] == -2))
    if leaving == "remove":
        assert last["removed"] == gone > 0 and last["reentered"] == 0
        assert last["clusters"] <= 12 - gone
    else:
        assert last["reentered"] > 0 and last["removed"] == gone == 0
        highest = max(each["position"][:, 1].max() for each in moments[1:])
        assert highest > moments[0]["position"][:, 1].max()
    first, ended = run_parts(config, halts={8})
    assert not ended
    rest, _ = run_parts(config, left=decoded(first[-1][1]))
    assert moments_in([*first, *rest]) == moments_in(whole)


def start(folder, *words):
    """The command in a process of its own, which is given the time to save its state."""
    code = "import sys; from flocsim import __main__, process; process.PATIENCE = 600.0; "
    code += "sys.exit(__main__.main(sys.argv[1:]))"
    return subprocess.Popen(
        [sys.executable, "-c", code, "swarm", "swarm.toml", *words],
        cwd=folder, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True,
    )  # fmt: skip


@pytest.mark.parametrize(
    ("number", "jobs"),
    [pytest.param(signal.SIGKILL, 2, marks=pytest.mark.slow), (signal.SIGTERM, 1)],
)
def test_a_run_that_is_ended_goes_on_to_the_same_bytes(finished, in_tmp, capsys, number, jobs):
    write_swarm_study(in_tmp)
    with start(in_tmp, "--set", "scene.checkpoint=1e-3") as process:
        until = time.monotonic() + PATIENCE
        journal = in_tmp / "swarm.h5.journal"
        while time.monotonic() < until and process.poll() is None:
            if any(each["name"] == "state" for each in records_in(journal, PART)):
                process.send_signal(number)
                break
            time.sleep(0.002)
        said, _ = process.communicate(timeout=PATIENCE)
    assert journal.exists(), said
    if number == signal.SIGTERM:
        assert process.returncode == 75 and said.endswith(" --resume\n")
    assert main(["info", "swarm.h5"]) == 0
    assert re.search(r"unfinished: \d of 8 snapshots so far", capsys.readouterr().out)
    assert main(["swarm", "swarm.toml", "--resume", "--jobs", str(jobs)]) == 0
    said = capsys.readouterr()
    assert "left out" not in said.out + said.err
    assert same(finished / "swarm.h5", in_tmp / "swarm.h5")
    assert not journal.exists()


def test_a_bed_at_rest_leaves_a_state_to_go_on_from(tmp_path):
    """Steps without an end, or of the other method, are no reason to begin anew."""
    scene = {"floor": True, "periodic": "x", "duration": 4.0, "every": 1.0, "area_fraction": 0.4}
    config = swarm_config(tmp_path, {"scene": scene})
    whole, ended = run_parts(config)
    assert ended
    for look in (2, 10, 20):
        first, ended = run_parts(config, halts={look})
        assert not ended and first[-1][0] == "state"
        rest, _ = run_parts(config, left=decoded(first[-1][1]))
        assert moments_in([*first, *rest]) == moments_in(whole)


def test_what_is_there_is_left_alone(finished, in_tmp, capsys):
    os.chdir(finished)
    before = (finished / "swarm.h5").read_bytes()
    assert main(["swarm", "swarm.toml"]) == UsageError.exit_code
    assert main(["swarm", "swarm.toml", "--resume", "--seed", "9"]) == UsageError.exit_code
    fewer = ["swarm", "swarm.toml", "--resume", "--replicates", "1", "--quiet"]
    assert main(fewer) == 0
    said = capsys.readouterr().err.splitlines()
    assert len(said) == 2 and "already exists" in said[0]
    assert "seed is 4 in the file, 9 now" in said[1]
    assert main(["swarm", "swarm.toml", "--resume"]) == 0
    assert "2 replicates, of which 0 were run" in capsys.readouterr().out
    assert (finished / "swarm.h5").read_bytes() == before


def test_more_replicates_leave_the_first_ones_as_they_are(finished, in_tmp):
    """And are those of a study of as many from the start; of flocs with other numbers of points."""
    write_swarm_study(in_tmp)
    shutil.copy(finished / "swarm.h5", in_tmp / "swarm.h5")
    more = ["--replicates", "3", "--quiet"]
    assert main(["swarm", "swarm.toml", "--resume", *more]) == 0
    assert main(["swarm", "swarm.toml", "-o", "fresh.h5", *more]) == 0
    assert same(in_tmp / "swarm.h5", in_tmp / "fresh.h5")
    before, after = (columns_of(each / "swarm.h5") for each in (finished, in_tmp))
    for name, values in before.items():
        assert after[name][: len(values)].tobytes() == values.tobytes()
    assert SWARMS.read(in_tmp / "swarm.h5").run["sessions"] == 2


def test_all_that_reads_the_file(finished, in_tmp, capsys):
    file = str(finished / "swarm.h5")
    assert main(["info", file]) == 0
    said = capsys.readouterr().out
    assert "2 of 12 bodies, 2 completed" in said and "means over 2 swarms" in said
    assert main(["plot", file, "--animation", "s.gif"]) == 0
    names = {path.name for path in in_tmp.iterdir()}
    assert names == {
        "swarm-snapshots.png", "swarm-clusters.png", "swarm-sizes.png", "swarm-speed.png", "s.gif",
    }  # fmt: skip


def test_a_dry_run_runs_nothing(in_tmp, capsys):
    write_swarm_study(in_tmp)
    assert main(["swarm", "swarm.toml", "--dry-run"]) == 0
    said = capsys.readouterr().out
    assert "2 swarms of 12 bodies" in said and "bodies cover 0.2000" in said
    assert [path.name for path in in_tmp.iterdir()] == ["swarm.toml"]

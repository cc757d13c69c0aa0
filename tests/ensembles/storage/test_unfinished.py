"""What a running study has so far: the same counts as the rows, without lock or touch."""

import numpy as np
import pytest

from flocsim.__main__ import main
from flocsim.ensembles.estimates.statistics import EXACT_RUNS
from flocsim.ensembles.kind import COLUMNS, ROW, Condition, layout
from flocsim.ensembles.storage.identity import short
from flocsim.ensembles.storage.row_store import RowStore
from flocsim.ensembles.storage.unfinished import read_unfinished
from flocsim.errors import FileError
from flocsim.io.journal import SESSION, Journal, as_text, journal_of
from tests.helpers.synthetic_results import make_results
from tests.helpers.tabulate import tabulate

RESULTS = make_results(types=("I", "III"), vertices=(1, 8), delta=(0.0, 1.0), count=40)
ASKED = {"types": ["I", "III"], "vertices": [1, 8], "delta": [0.0, 1.0], "replicates": 40}


def write_journal(path):
    """A locked journal: all of type I, of type III replicates 10 to 25 at N = 8, delta = 0."""
    session = {
        "kind": "flocsim results", "identity": {}, "layout": layout(), "date": "2020",
        "command": "x y", "processor": "z", "asked": ASKED,
    }  # fmt: skip
    journal = Journal(path)
    journal.add(SESSION, as_text(session))
    pieces = [((0, v, d), 0, 40) for v in range(2) for d in range(2)] + [((1, 1, 0), 10, 25)]
    for (t, v, d), first, stop in pieces:
        rows = np.zeros(stop - first, ROW)
        for name in COLUMNS:
            rows[name] = RESULTS.replicates[name][t, v, d, first:stop]
        rows["failure"] = 0
        condition = Condition(
            RESULTS.types[t], int(RESULTS.vertices[v]), float(RESULTS.delta[d])
        )  # fmt: skip
        # Some replicates twice, as a run that was killed while it wrote leaves them.
        for part in ([0, 30], [20, 40]) if first == 0 else ([0, 15],):
            add_rows(journal, condition, first + part[0], rows[slice(*part)])
    return journal


def add_rows(journal, condition, first, rows):
    RowStore(journal, (condition,), identity=short({}), session=1).add(0, first, rows)


def test_the_counts_are_those_of_the_rows_there_are(tmp_path):
    journal = write_journal(tmp_path / "r.h5.journal")
    before = {each: each.read_bytes() for each in tmp_path.glob("r.h5.journal*")}
    found = read_unfinished(tmp_path / "r.h5.journal")
    codes = [RESULTS.replicates[name] for name in ("outcome", "inside", "bond")]
    again = [RESULTS.replicates[name] for name in EXACT_RUNS[3:]]
    whole = tabulate(*codes, *again)
    part = tabulate(*(each[1:, 1:, :1, 10:25] for each in [*codes, *again]))
    for name in ("n_class", "pr_a", "pr_a_low", "n_checked"):
        table = found.results.probabilities[name]
        assert np.array_equal(table[0], whole[name][0], equal_nan=True), name
        assert np.array_equal(table[1, 1, 0], part[name][0, 0, 0], equal_nan=True), name
    # The numerical error looks at all conditions of an N.
    numerical = found.results.probabilities["pr_inside_numerical"]
    assert np.isfinite(numerical[0]).all() and np.isnan(numerical[1, 0]).all()
    assert found.results.probabilities["n_total"].tolist() == [
        [[40, 40], [40, 40]],
        [[0, 0], [15, 0]],
    ]
    assert found.progress == "unfinished: 175 of 320 replicates so far"
    now = {each: each.read_bytes() for each in tmp_path.glob("r.h5.journal*")}
    assert {k.name for k in before if before[k] != now[k]} <= {"r.h5.journal-shm"}
    journal.release()


def test_info_and_plot_of_results_that_are_not_there_yet(in_tmp, capsys):
    journal = write_journal(in_tmp / "r.h5.journal")  # and locked by this job
    for name in ("r.h5", "r.h5.journal"):
        assert main(["info", name]) == 0
        told = capsys.readouterr().out
        assert "unfinished: 175 of 320 replicates so far" in told
        assert "0 to 40 in each of 8 conditions, 40 planned" in told
    assert main(["plot", "r.h5", "--figures", "delta,outcomes"]) == 0
    assert capsys.readouterr().out.split() == ["r-delta.png", "r-outcomes.png"]
    journal.release()


def test_what_has_no_replicate_yet_is_said_in_one_line(tmp_path):
    journal = Journal(tmp_path / "r.h5.journal")
    with pytest.raises(FileError, match="has only just begun"):
        read_unfinished(tmp_path / "r.h5.journal")
    journal.release()


def test_finished_results_are_read_themselves(tmp_path):
    write_journal(tmp_path / "r.h5.journal").release()
    assert journal_of(tmp_path / "r.h5") == tmp_path / "r.h5.journal"
    (tmp_path / "r.h5").write_bytes(b"")
    assert journal_of(tmp_path / "r.h5") is None


def test_what_is_read_grows_with_the_rows_and_not_with_their_numbers(tmp_path):
    """Replicates 2**40 and on are counted as any: nothing is done for those before."""
    journal = write_journal(tmp_path / "r.h5.journal")
    rows = np.zeros(4, ROW)
    for name in COLUMNS:
        rows[name] = RESULTS.replicates[name][1, 0, 0, :4]
    rows["failure"] = 0
    add_rows(journal, Condition("III", 1, 0.0), 2**40 - 4, rows)
    journal.release()
    found = read_unfinished(tmp_path / "r.h5.journal")
    assert found.results.probabilities["n_total"][1].tolist() == [[4, 0], [15, 0]]

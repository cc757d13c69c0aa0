"""The journal of a study that runs: an SQLite database that one job writes and any number read."""

import os
import random
import signal
import sqlite3
import subprocess
import sys
import time

import pytest

from flocsim.errors import FileError
from flocsim.io import journal as module
from flocsim.io.journal import CHUNK, PART, SESSION, Journal, Record, journal_of, read_journal
from tests.helpers.journals import leave

WRITER = """
import sys
from pathlib import Path
from flocsim.io.journal import CHUNK, Journal
journal, first = Journal(Path(sys.argv[1])), int(sys.argv[2])
while True:
    journal.add(CHUNK, "c", first, {"n": first}, first.to_bytes(8, "little") * 500)
    print(first, flush=True)
    first += 1
"""


@pytest.fixture
def path(tmp_path):
    """Where the journal is."""
    return tmp_path / "r.h5.journal"


def filled(path, count=20, kind=CHUNK):
    """A journal with some records, open."""
    journal = Journal(path)
    for first in range(count):
        journal.add(kind, '["I", 4, 0.5]', first, {"n": first}, bytes([first]) * 5000)
    return journal


def copied(journal, folder):
    """The files of an open journal in a folder of their own, as a kill would leave them."""
    folder.mkdir()
    for each in journal.path.parent.glob(f"{journal.path.name}*"):
        (folder / each.name).write_bytes(each.read_bytes())
    return folder / journal.path.name


def firsts(journal):
    return [record.first for record in journal.records()]


def test_what_is_written_is_read(path):
    journal = Journal(path)
    number = journal.add(SESSION, "", 0, {"words": "é"})
    journal.add(PART, "[1]", 7, {"name": "state"}, b"old")
    assert journal.add(PART, "[1]", 7, {"name": "state"}, b"new", 2) == 2
    expected = [
        Record(number, SESSION, "", 0, {"words": "é"}, b""),
        Record(2, PART, "[1]", 7, {"name": "state"}, b"new"),
    ]
    assert list(journal.records()) == expected
    journal.release()
    assert list(Journal(path).records()) == expected
    assert list(Journal().records()) == []


def test_a_killed_writer_loses_no_acknowledged_record(path):
    rng, acknowledged = random.Random(1), -1
    for _ in range(6):
        writer = subprocess.Popen(
            [sys.executable, "-c", WRITER, str(path), str(acknowledged + 1)],
            stdout=subprocess.PIPE, text=True,
        )  # fmt: skip
        assert writer.stdout is not None
        writer.stdout.readline()
        time.sleep(rng.uniform(0.0, 0.3))
        writer.send_signal(signal.SIGKILL)
        lines = writer.communicate()[0].split("\n")[:-1]
        acknowledged = max(acknowledged + 1, *(int(line) for line in lines), 0)
        journal = Journal(path)
        found = list(journal.records())
        assert [each.first for each in found][: acknowledged + 1] == list(range(acknowledged + 1))
        assert all(each.data == each.first.to_bytes(8, "little") * 500 for each in found)
        assert (journal.lost, journal.damaged, journal.salvaged) == (0, [], None)
        acknowledged = found[-1].first
        journal.release()


def test_one_job_writes_and_others_read(path, monkeypatch):
    journal = filled(path)
    with read_journal(path) as reader:
        journal.add(CHUNK, "c", 99, {}, b"after the reader began")
        journal.sync()
        assert firsts(reader) == list(range(20))
    monkeypatch.setattr(module, "LOCK_SECONDS", 0.1)
    with pytest.raises(FileError, match=r"r.h5.journal is being written by another job"):
        Journal(path)
    journal.release()
    assert [each.name for each in path.parent.iterdir()] == [path.name]
    with read_journal(path) as reader:
        assert firsts(reader)[-1] == 99


def test_any_damage_costs_what_it_hits_and_nothing_wrong_is_read(path, tmp_path):
    filled(path).release()
    rng, data = random.Random(2), path.read_bytes()
    whole = list(Journal(path).records())
    for number in range(40):
        damaged = bytearray(data)
        for _ in range(rng.choice((1, 1, 50))):
            damaged[rng.randrange(100, len(data))] ^= 1 << rng.randrange(8)
        place = tmp_path / str(number) / path.name
        place.parent.mkdir()
        place.write_bytes(damaged)
        journal = Journal(place)
        if journal.problem:
            continue
        found = list(journal.records())
        assert all(each in whole for each in found)
        assert len(found) == len(whole) or journal.damaged or journal.salvaged
        journal.discard(journal.damaged)
        journal.add(CHUNK, "c", 0, {}, b"goes on")
        journal.release()
        assert [*found][:-1] == list(Journal(place).records())[: len(found) - 1]


def test_a_chunk_that_is_damaged_while_it_is_needed_is_refused(path):
    filled(path).release()
    data = bytearray(path.read_bytes())
    data[data.index(bytes([7]) * 1000) + 10] ^= 1
    path.write_bytes(data)
    with read_journal(path) as reader:
        with pytest.raises(FileError, match="is damaged, or was changed after it was written"):
            list(reader.chunks('["I", 4, 0.5]', -1, 20))
        assert [each.first for each in reader.chunks('["I", 4, 0.5]', 9, 12)] == [10, 11]


def test_a_journal_that_is_only_looked_at_stays_as_it_is(path):
    filled(path).release()
    before = path.read_bytes()
    journal = Journal(path)
    list(journal.records())
    journal.release()
    assert path.read_bytes() == before


@pytest.mark.parametrize("share", [0.3, 0.6, 0.99])
def test_a_journal_that_was_cut_short_keeps_what_is_before_the_cut(path, share):
    filled(path).release()
    data = path.read_bytes()
    path.write_bytes(data[: int(share * len(data))])
    journal = Journal(path)
    assert journal.problem == ""
    found = firsts(journal)
    # Half a page is a damaged record, and a page a damaged database.
    assert journal.damaged or journal.salvaged == path.with_name(f"{path.name}.1")
    assert set(found) < set(range(20))
    journal.release()


def test_the_loss_of_the_log_is_noticed(path, tmp_path):
    journal = filled(path)
    place = copied(journal, tmp_path / "copy")
    place.with_name(f"{place.name}-wal").unlink()
    copy = Journal(place)
    assert copy.lost == 20 - len(firsts(copy))
    assert copy.lost > 0
    journal.release()


@pytest.mark.parametrize("what", ["nothing", "another"])
def test_the_log_of_another_database_is_not_taken_for_its_own(path, what):
    first = filled(path, count=5)
    aside = first.put_aside()
    for number in range(50, 90):
        first.add(CHUNK, "c", number, {}, bytes(5000))
    leave(first)
    if what == "nothing":
        path.unlink()
    else:
        os.replace(aside, path)
    assert path.with_name(f"{path.name}-wal").exists()
    assert firsts(Journal(path)) == ([] if what == "nothing" else list(range(5)))


def test_a_full_disk_leaves_the_journal_as_it_was(path):
    journal = filled(path)
    journal.db.execute(f"PRAGMA max_page_count={journal.path.stat().st_size // 4096 + 40}")
    with pytest.raises(FileError, match="could not be written: database or disk is full"):
        for first in range(20, 100):
            journal.add(CHUNK, "c", first, {}, bytes(5000))
    there = firsts(journal)
    assert there == list(range(len(there)))
    journal.release()
    assert firsts(Journal(path)) == there


def test_a_journal_without_anything_computed_is_removed(path):
    journal = Journal(path)
    journal.add(SESSION, "", 0, {})
    assert journal.is_blank
    journal.release()
    assert list(path.parent.iterdir()) == []
    path.write_bytes(b"")  # left by a job that was killed as it began
    assert Journal(path).is_blank


def test_a_journal_that_was_deleted_is_written_back(path):
    journal = filled(path)
    for each in path.parent.glob(f"{path.name}*"):
        each.unlink()
    journal.sync()
    journal.add(CHUNK, "c", 20, {}, b"more")
    journal.release()
    assert firsts(Journal(path)) == list(range(21))


def test_a_journal_that_was_replaced_is_kept_under_another_name(path):
    journal = filled(path)
    path.with_name("other").write_bytes(b"mine")
    os.replace(path.with_name("other"), path)
    with pytest.raises(FileError, match=r"was replaced by another file .* is in .*\.journal\.1"):
        journal.sync()
    journal.release()
    assert path.read_bytes() == b"mine"
    assert firsts(Journal(path.with_name(f"{path.name}.1"))) == list(range(20))


def test_what_another_program_writes_is_noticed(path):
    journal = filled(path)
    with sqlite3.connect(path) as other:
        other.execute("DELETE FROM record WHERE first=3")
    with pytest.raises(FileError, match="was changed by another program while this run wrote"):
        journal.add(CHUNK, "c", 20, {}, b"")


def test_a_journal_put_aside_makes_room_for_a_new_one(path):
    journal = filled(path)
    aside = journal.put_aside()
    assert aside == path.with_name(f"{path.name}.1")
    assert firsts(journal) == []
    journal.release()
    os.replace(aside, path)
    assert firsts(Journal(path)) == list(range(20))


@pytest.mark.parametrize(
    ("content", "said"),
    [
        (b"garbage" * 100, "is not a journal of flocsim, or is damaged at its start"),
        (b"\x93FLOCREC" + bytes(100), "was written by a version of flocsim that was never"),
        (b"SQLite format 3\0" + bytes(5000), "is not a journal of flocsim"),
    ],
)
def test_what_is_no_journal_is_left_alone(path, content, said):
    path.write_bytes(content)
    journal = Journal(path)
    assert said in journal.problem
    with pytest.raises(FileError), read_journal(path) as reader:
        firsts(reader)
    journal.release()
    assert path.read_bytes() == content
    assert Journal(path).put_aside().read_bytes() == content


def test_a_database_of_another_program_is_no_journal(path):
    with sqlite3.connect(path) as other:
        other.execute("CREATE TABLE record(id INTEGER)")
    other.close()
    assert "is not a journal" in Journal(path).problem


@pytest.mark.parametrize("kind", ["pipe", "link", "dangling link", "folder", "device"])
def test_what_is_no_ordinary_file_is_refused_and_left_alone(path, kind):
    precious = path.with_name("precious")
    precious.write_text("mine")
    makers = {
        "pipe": lambda: os.mkfifo(path),
        "link": lambda: path.symlink_to(precious),
        "dangling link": lambda: path.symlink_to("elsewhere"),
        "folder": lambda: path.mkdir(),
        "device": lambda: path.symlink_to("/dev/zero"),
    }
    makers[kind]()
    with pytest.raises(FileError, match="is not an ordinary file"):
        Journal(path)
    assert precious.read_text() == "mine"
    assert not path.with_name("elsewhere").exists()


def test_a_file_system_without_locks_is_known(path, monkeypatch):
    monkeypatch.setattr(module, "lock", lambda descriptor: None)
    journal = filled(path)
    assert not journal.has_lock
    with read_journal(path) as reader:
        assert firsts(reader) == list(range(20))
    journal.release()
    assert firsts(Journal(path)) == list(range(20))


def test_a_journal_is_found_beside_its_results(path):
    assert journal_of(path.with_name("r.h5")) is None
    filled(path).release()
    assert journal_of(path.with_name("r.h5")) == journal_of(path) == path

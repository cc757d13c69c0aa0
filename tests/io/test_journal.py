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
from flocsim.io.journal import PART, ROWS, SESSION, Journal, as_text, journal_of, read_journal
from tests.helpers.journals import leave

KEY = '["I", 4, 0.5]'
WRITER = """
import sys
from pathlib import Path
from flocsim.io.journal import ROWS, Journal
journal, first = Journal(Path(sys.argv[1])), int(sys.argv[2])
while True:
    journal.add(ROWS, "id", 1, "c", first, 500, "[]", first.to_bytes(8, "little") * 500)
    print(first, flush=True)
    first += 1
"""


@pytest.fixture
def path(tmp_path):
    """Where the journal is."""
    return tmp_path / "r.h5.journal"


def add(journal, first):
    """Write down the rows of a chunk."""
    return journal.add(ROWS, "id", 1, KEY, first, 5, "[]", bytes([first]) * 5000)


def filled(path, count=20):
    """A journal with some chunks, open."""
    journal = Journal(path)
    for first in range(count):
        add(journal, first)
    return journal


def copied(journal, folder):
    """The files of an open journal in a folder of their own, as a kill would leave them."""
    folder.mkdir()
    for each in journal.path.parent.glob(f"{journal.path.name}*"):
        (folder / each.name).write_bytes(each.read_bytes())
    return folder / journal.path.name


def firsts(journal):
    return [record["first"] for record in journal.records(ROWS)]


def test_what_is_written_is_read(path):
    journal = Journal(path)
    number = journal.add(SESSION, as_text({"command": "é"}))
    for data in (b"old", b"new"):
        journal.add(PART, "id", number, "[1]", 7, "state", "{}", data)
    journal.release()
    journal = Journal(path)
    [session] = journal.records(SESSION)
    assert (session["id"], session["about"]) == (number, '{"command": "é"}')
    [part] = journal.records(PART)
    assert (part["first"], part["name"], part["data"]) == (7, "state", b"new")
    assert firsts(journal) == []


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
        found = list(journal.records(ROWS))
        assert [each["first"] for each in found][: acknowledged + 1] == [*range(acknowledged + 1)]
        assert all(each["data"] == each["first"].to_bytes(8, "little") * 500 for each in found)
        assert (journal.lost, journal.damaged, journal.is_damaged) == (0, set(), False)
        acknowledged = found[-1]["first"]
        journal.release()


def test_one_job_writes_and_others_read(path, at_once):
    journal = filled(path)
    with read_journal(path) as reader:
        add(journal, 99)  # after the reader began
        journal.sync()
        assert firsts(reader) == list(range(20))
    with pytest.raises(FileError, match=r"r.h5.journal is being written by another job"):
        Journal(path)
    journal.release()
    assert [each.name for each in path.parent.iterdir()] == [path.name]
    with read_journal(path) as reader:
        assert firsts(reader)[-1] == 99


def test_any_damage_is_noticed_and_nothing_wrong_is_read(path, tmp_path):
    filled(path).release()
    rng, data = random.Random(2), path.read_bytes()
    whole = [tuple(each) for each in Journal(path).records(ROWS)]
    for number in range(40):
        damaged = bytearray(data)
        for _ in range(rng.choice((1, 1, 50))):
            damaged[rng.randrange(100, len(data))] ^= 1 << rng.randrange(8)
        place = tmp_path / str(number) / path.name
        place.parent.mkdir()
        place.write_bytes(damaged)
        journal = Journal(place)
        if not journal.is_damaged:
            found = [tuple(each) for each in journal.records(ROWS)]
            assert set(found) <= set(whole)
            assert len(found) == len(whole) or journal.damaged
        journal.release()


def test_a_journal_that_is_only_looked_at_stays_as_it_is(path):
    filled(path).release()
    before = path.read_bytes()
    journal = Journal(path)
    firsts(journal)
    journal.release()
    assert path.read_bytes() == before


def test_the_loss_of_the_log_is_noticed(path, tmp_path):
    journal = filled(path)
    place = copied(journal, tmp_path / "copy")
    place.with_name(f"{place.name}-wal").unlink()
    copy = Journal(place)
    assert copy.lost == 20 - len(firsts(copy)) > 0
    copy.release()
    journal.release()


@pytest.mark.parametrize("what", ["nothing", "another"])
def test_the_log_of_another_database_brings_no_wrong_record(path, what):
    first = filled(path, count=5)
    aside = first.put_aside()
    for number in range(50, 90):
        add(first, number)
    leave(first)
    if what == "nothing":
        path.unlink()
    else:
        os.replace(aside, path)
    assert path.with_name(f"{path.name}-wal").exists()
    journal = Journal(path)
    if not journal.is_damaged:
        for each in journal.records(ROWS):
            assert each["data"] == bytes([each["first"]]) * 5000


def test_a_full_disk_leaves_the_journal_as_it_was(path):
    journal = filled(path)
    journal.db.execute(f"PRAGMA max_page_count={journal.path.stat().st_size // 4096 + 40}")
    with pytest.raises(FileError, match="could not be written: database or disk is full"):
        for first in range(20, 100):
            add(journal, first)
    there = firsts(journal)
    assert there == list(range(len(there)))
    journal.release()
    assert firsts(Journal(path)) == there


def test_a_journal_without_anything_computed_is_removed(path):
    journal = Journal(path)
    journal.add(SESSION, "{}")
    assert journal.is_blank
    journal.release()
    assert list(path.parent.iterdir()) == []
    path.write_bytes(b"")  # left by a job that was killed as it began
    assert Journal(path).is_blank


def test_a_journal_put_aside_makes_room_for_a_new_one(path):
    journal = filled(path)
    aside = journal.put_aside()
    assert aside == path.with_name("r.h5.1.journal")
    assert firsts(journal) == []
    journal.release()
    os.replace(aside, path)
    assert firsts(Journal(path)) == list(range(20))


@pytest.mark.parametrize("content", [b"garbage" * 100, b"SQLite format 3\0" + bytes(5000)])
def test_what_is_no_journal_is_left_alone(path, content):
    path.write_bytes(content)
    journal = Journal(path)
    assert journal.is_damaged
    with pytest.raises(FileError), read_journal(path) as reader:
        firsts(reader)
    journal.release()
    assert path.read_bytes() == content
    assert Journal(path).put_aside().read_bytes() == content


def test_a_database_of_another_program_is_no_journal(path):
    with sqlite3.connect(path) as other:
        other.execute("CREATE TABLE record(id INTEGER)")
    other.close()
    assert Journal(path).is_damaged


@pytest.mark.parametrize("kind", ["pipe", "folder", "device"])
def test_what_is_no_ordinary_file_is_refused_and_left_alone(path, kind):
    makers = {
        "pipe": lambda: os.mkfifo(path),
        "folder": lambda: path.mkdir(),
        "device": lambda: path.symlink_to("/dev/zero"),
    }
    makers[kind]()
    with pytest.raises(FileError, match="is not an ordinary file"):
        Journal(path)
    assert [each.name for each in path.parent.iterdir()] == [path.name]


def test_a_file_system_without_locks_is_known(path, monkeypatch):
    monkeypatch.setattr(module, "lock", lambda descriptor: None)
    journal = filled(path)
    assert not journal.lock.is_locked
    with read_journal(path) as reader:
        assert firsts(reader) == list(range(20))
    journal.release()
    assert firsts(Journal(path)) == list(range(20))


def test_a_journal_is_found_beside_its_results(path):
    assert journal_of(path.with_name("r.h5")) is None
    filled(path).release()
    assert journal_of(path.with_name("r.h5")) == journal_of(path) == path

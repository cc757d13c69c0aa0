"""The journal: records whole or not at all, every damage found, nothing wrong believed."""

import errno
import hashlib
import io
import os

import pytest
from hypothesis import given
from hypothesis import strategies as st

from flocsim.errors import FileError
from flocsim.io.journal import Journal, MemoryJournal, journal_path
from flocsim.io.records import (
    CHUNK,
    HEAD,
    MARK,
    SESSION,
    Damage,
    Record,
    encode,
    scan,
)

RECORDS = [
    encode(SESSION, {"short": "abc"}),
    encode(CHUNK, {"first": 0, "type": "κ"}, bytes(range(256)) * 3),
    encode(CHUNK, {"first": 1}, MARK + b"data that look like a head"),
    encode(CHUNK, {"first": 2}, b""),
]
WHOLE = b"".join(RECORDS)


def read(data):
    """What a scan finds in bytes."""
    return list(scan(io.BytesIO(data)))


def firsts(found):
    """The chunks among what was found."""
    return [r.description["first"] for r in found if isinstance(r, Record) and r.kind == CHUNK]


def test_what_is_written_is_read():
    found = read(WHOLE)
    assert [record.kind for record in found] == [SESSION, CHUNK, CHUNK, CHUNK]
    assert found[1].description == {"first": 0, "type": "κ"}
    for record in found[1:]:
        assert WHOLE[record.offset :][: record.length] in RECORDS[firsts([record])[0] + 1]


@given(st.integers(0, len(WHOLE) - 1), st.integers(0, 7))
def test_any_flipped_bit_is_found_and_costs_one_record(place, bit):
    data = bytearray(WHOLE)
    data[place] ^= 1 << bit
    found = read(bytes(data))
    damaged = [each for each in found if isinstance(each, Damage)]
    assert damaged
    assert len([each for each in found if isinstance(each, Record)]) == 3
    assert all(each.start <= place < each.stop or len(damaged) > 1 for each in damaged)


@given(st.integers(0, len(WHOLE)))
def test_what_is_cut_off_costs_what_it_cuts(place):
    found = read(WHOLE[:place])
    ends = [sum(map(len, RECORDS[: k + 1])) for k in range(4)]
    assert len([each for each in found if isinstance(each, Record)]) == sum(
        end <= place for end in ends
    )
    assert any(isinstance(each, Damage) for each in found) == (place not in [0, *ends])


@given(st.binary(max_size=300))
def test_any_bytes_can_be_scanned(data):
    stops = [each.stop for each in read(data) if isinstance(each, Damage)]
    assert stops == ([len(data)] if data else []) or MARK in data


def test_a_damaged_chunk_is_named():
    data = bytearray(WHOLE)
    data[len(RECORDS[0]) + len(RECORDS[1]) - 1] ^= 1
    [damage] = [each for each in read(bytes(data)) if isinstance(each, Damage)]
    assert damage.description["first"] == 0
    assert (damage.start, damage.stop) == (len(RECORDS[0]), len(RECORDS[0]) + len(RECORDS[1]))


def written(folder, data):
    """A journal file with these bytes."""
    path = folder / "r.h5.journal"
    path.write_bytes(data)
    return path


def test_a_half_written_record_is_cut_off_by_the_next(tmp_path):
    path = written(tmp_path, WHOLE[:-5])
    journal = Journal(path)
    assert (len(journal.records), len(journal.damage)) == (3, 1)
    offset = journal.append(RECORDS[1])
    assert offset == sum(map(len, RECORDS[:3]))
    assert journal.read(offset, len(RECORDS[1])) == RECORDS[1]
    journal.release()
    assert firsts(read(path.read_bytes())) == [0, 1, 0]


def test_damage_in_the_middle_stays_where_it_is(tmp_path):
    data = bytearray(WHOLE)
    data[len(RECORDS[0]) + 100] ^= 1
    journal = Journal(written(tmp_path, bytes(data)))
    journal.append(RECORDS[1])
    journal.release()
    assert journal.path.read_bytes() == bytes(data) + RECORDS[1]


def test_a_full_disk_leaves_the_journal_as_it_was(tmp_path, monkeypatch):
    journal = Journal(tmp_path / "r.h5.journal")

    def pwrite(descriptor, data, place, original=os.pwrite):
        if place > 10:  # it takes a few bytes, then none
            raise OSError(errno.ENOSPC, "No space left on device")
        return original(descriptor, bytes(data)[:20], place)

    monkeypatch.setattr(os, "pwrite", pwrite)
    with pytest.raises(FileError, match="No space left") as caught:
        journal.append(RECORDS[1])
    assert caught.value.exit_code == 74
    assert journal.path.read_bytes() == b""
    assert journal.end == 0
    monkeypatch.undo()
    assert journal.append(RECORDS[1]) == 0
    journal.release()
    assert journal.path.read_bytes() == RECORDS[1]


def test_a_journal_without_a_whole_chunk_holds_nothing(tmp_path):
    for data in (b"", MARK[:3], RECORDS[0], RECORDS[0] * 2 + RECORDS[1][:-1]):
        journal = Journal(written(tmp_path, data))
        assert journal.is_blank
        journal.begin_anew()
        journal.append(RECORDS[0])
        assert journal.path.read_bytes() == RECORDS[0]
        journal.release()
        assert not journal.path.exists()


def test_a_journal_with_rows_or_with_damage_stays(tmp_path):
    flipped = RECORDS[0] + RECORDS[1][:-1] + b"?"
    for data in (WHOLE, RECORDS[1], flipped, b"Dear diary,", flipped + RECORDS[0]):
        journal = Journal(written(tmp_path, data))
        assert not journal.is_blank
        journal.release()
        assert journal.path.read_bytes() == data


def test_a_first_chunk_makes_it_stay(tmp_path):
    journal = Journal(tmp_path / "r.h5.journal")
    journal.append(RECORDS[0])
    assert journal.is_blank
    journal.append(RECORDS[1])
    journal.release()
    assert journal.path.read_bytes() == RECORDS[0] + RECORDS[1]


def test_what_another_program_writes_there_is_found_before_it_is_written_over(tmp_path):
    journal = Journal(tmp_path / "r.h5.journal")
    journal.append(RECORDS[0])
    with open(journal.path, "ab") as other:
        other.write(RECORDS[2])
    with pytest.raises(FileError, match="was changed by another program"):
        journal.append(RECORDS[1])
    journal.release()
    assert firsts(read(journal.path.read_bytes())) == [1]


def test_a_journal_that_was_deleted_is_written_back_when_it_is_synced(tmp_path):
    journal = Journal(written(tmp_path, WHOLE))
    journal.path.unlink()
    journal.append(RECORDS[1])
    journal.sync()
    journal.append(RECORDS[1])
    assert journal.path.read_bytes() == WHOLE + RECORDS[1] * 2
    journal.remove()
    assert list(tmp_path.iterdir()) == []


def test_a_journal_put_aside_makes_room_for_a_new_one(tmp_path):
    journal = Journal(written(tmp_path, WHOLE))
    aside = journal.put_aside()
    journal.append(RECORDS[0])
    assert aside.read_bytes() == WHOLE
    assert journal.path.read_bytes() == RECORDS[0]
    journal.release()
    assert [path.name for path in tmp_path.iterdir()] == ["r.h5.journal.1"]


def test_many_marks_are_one_damaged_stretch():
    # Each promises a description as long as all that follows.
    head = HEAD.pack(MARK, CHUNK, 2**23, 0, b"", b"")
    data = head * 100_000
    assert [(each.start, each.stop) for each in read(data)] == [(0, len(data))]


@pytest.mark.parametrize("words", [b"[" * 100_000, b"[]", b"1", b"\xff", b"{" + b"9" * 9999])
def test_a_description_that_no_flocsim_wrote_is_damage(words):
    head = HEAD.pack(MARK, CHUNK, len(words), 0, hashlib.blake2b(b"", digest_size=16).digest(), b"")
    checked = head[: HEAD.size - 8]
    record = checked + hashlib.blake2b(checked + words, digest_size=8).digest() + words
    [damage] = read(record)
    assert isinstance(damage, Damage)


def test_a_journal_that_cannot_be_opened_is_told(tmp_path):
    with pytest.raises(FileError, match="could not be written"):
        Journal(tmp_path / "missing" / "r.h5.journal")
    (tmp_path / "r.h5").symlink_to(tmp_path / "elsewhere.h5")
    assert journal_path(tmp_path / "r.h5") == tmp_path / "elsewhere.h5.journal"


def test_a_journal_in_memory_reads_what_it_was_given():
    journal = MemoryJournal()
    assert [journal.append(record) for record in RECORDS[:2]] == [0, len(RECORDS[0])]
    assert journal.read(len(RECORDS[0]), len(RECORDS[1])) == RECORDS[1]

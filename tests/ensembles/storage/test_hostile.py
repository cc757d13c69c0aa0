"""What a resumed run takes from files that an enemy has written, with right checksums."""

import io
import json
import random

import h5py
import pytest

from flocsim.ensembles.parallel.communicator import Communicator
from flocsim.ensembles.runner import SharedError, run_to_file
from flocsim.ensembles.storage.resume import (
    NEW,
    RESUME,
    Beginning,
    refuse_other_sessions,
    take_journal,
)
from flocsim.ensembles.storage.row_store import RowStore
from flocsim.errors import FileError, FlocsimError
from flocsim.io.journal import CHUNK, SESSION, Journal
from flocsim.io.seals import seal
from tests.helpers.hostile_readers import JournalReader
from tests.helpers.journals import write_records
from tests.helpers.sealed import read_sealed
from tests.helpers.small_study import small_config

SPHERES = {"shapes": {"vertices": [1]}, "replicates": 3}


@pytest.fixture(scope="module")
def reader(tmp_path_factory):
    """Makes journals of a study of spheres."""
    return JournalReader(tmp_path_factory.mktemp("journals"))


def taken(reader, folder, records):
    """(Beginning, number of rows) of a journal of these (kind, condition, first, description or
    words, data)."""
    path = write_records(folder / "j.h5.journal", [
        (*key, about if isinstance(about, bytes) else json.dumps(about).encode(), data)
        for *key, about, data in records
    ])  # fmt: skip
    journal = Journal(path)
    try:
        start = Beginning(RowStore(journal, reader.study.conditions), reader.identity)
        refuse_other_sessions(start, reader.study)
        take_journal(start, reader.study)
        return start, sum(stop - first for each in start.found(2**50) for first, stop in each)
    finally:
        journal.release()


def test_a_sound_journal_is_taken(reader, tmp_path):
    start, rows = taken(reader, tmp_path, reader.parts)
    assert (rows, start.remarks, len(start.notes)) == (4, [], 2)


@pytest.mark.parametrize(
    "change",
    [
        {"first": -1}, {"first": 2**62}, {"data": b""}, {"data": b"1"}, {"condition": "[1, 1, 0]"},
        {"condition": '["I", "1", 0.0]'}, {"condition": '["I", 1]'}, {"condition": "null"},
        {"condition": "["}, {"identity": 5}, {"notes": 1}, {"notes": [1]},
        {"notes": [{"why": 1}]}, {"notes": {"a": 1}},
    ],
)  # fmt: skip
def test_a_chunk_of_another_form_is_passed_over(reader, tmp_path, change):
    session, (kind, condition, first, about, data), second = reader.parts
    key = kind, change.get("condition", condition), change.get("first", first)
    words = {name: each for name, each in change.items() if name in ("identity", "notes")}
    changed = *key, about | words, change.get("data", data)
    start, rows = taken(reader, tmp_path, [session, changed, second])
    assert rows == 2
    assert start.remarks and all(remark.isprintable() for remark in start.remarks)


@pytest.mark.parametrize(
    "words",
    [b"[]", b"1", b"null", b"", b"{", b"\xff", b'{"a": NaN}', b'{"a": 1e999}', b"[" * 10**5,
     b'{"a": ' * 500 + b"1" + b"}" * 500, b'{"type": "\\ud800"}',
     b'{"first": ' + b"9" * 5000 + b"}"],
)  # fmt: skip
@pytest.mark.parametrize("kind", [SESSION, CHUNK])
def test_a_description_that_is_none_is_damage(reader, tmp_path, kind, words):
    session, (_, condition, first, _, data), second = reader.parts
    odd = kind, condition, first, words, data
    start, rows = taken(reader, tmp_path, [session, odd, second])
    assert rows == 2
    assert "computed again" in start.remarks[0]


@pytest.mark.parametrize(
    "change",
    [{"identity": []}, {"identity": None}, {"short": 1}, {"layout": 5}, {"date": None},
     {"command": []}, {"cpus": 1}, {"cpus": [{}]}, {"cpus": [{"cpu": 1}]}],
)  # fmt: skip
def test_a_session_of_another_form_is_refused(reader, tmp_path, change):
    (*key, about, data), *chunks = reader.parts
    with pytest.raises(FileError, match="not begun by flocsim"):
        taken(reader, tmp_path, [(*key, about | change, data), *chunks])


def test_any_shuffled_journal_is_taken_or_refused(reader, tmp_path):
    for number in range(60):
        path = reader.make(random.Random(number), tmp_path)
        try:
            reader.read(path)
        except FlocsimError as error:
            assert str(error).isprintable()


@pytest.fixture(scope="module")
def finished(tmp_path_factory):
    """The bytes of a finished study's results file."""
    folder = tmp_path_factory.mktemp("finished")
    run_to_file(small_config(folder, SPHERES), Communicator(), folder / "r.h5", NEW)
    return read_sealed(folder / "r.h5")


def put(name, value):
    """A change of a scalar of the group ``run``."""

    def change(file):
        del file[f"run/{name}"]
        file[f"run/{name}"] = value

    return change


CHANGES = (
    [put("identity", text) for text in ("[]", "{", "[" * 10**5, "NaN", 7, "")]
    + [put(name, text) for name in ("failed", "history", "cpus")
       for text in ("{}", "[1]", '[{"a": ' * 50, 1.5)]
    + [put("failed", '[{"type": "I", "vertices": 1, "delta": "x", "replicate": 0, "why": "y"}]')]
    + [lambda file: file["replicates/failure"].attrs.modify("flag_meanings", "a b c")]
)  # fmt: skip


@pytest.mark.parametrize(
    "change",
    CHANGES[::2] + [pytest.param(each, marks=pytest.mark.slow) for each in CHANGES[1::2]],
)
def test_results_that_no_run_has_written_are_not_extended(tmp_path, finished, change):
    image = io.BytesIO(finished)
    with h5py.File(image, "r+") as file:
        change(file)
    before = seal(image.getvalue())
    (tmp_path / "r.h5").write_bytes(before)
    config = small_config(tmp_path, SPHERES | {"replicates": 4})
    with pytest.raises(SharedError) as caught:
        run_to_file(config, Communicator(), tmp_path / "r.h5", RESUME)
    error = caught.value.args[0]
    assert isinstance(error, FlocsimError)
    assert str(error).isprintable()
    assert (tmp_path / "r.h5").read_bytes() == before

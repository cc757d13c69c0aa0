"""The seal of pieces: what is whole is found whole, and whatever is changed is found changed."""

import io

import numpy as np
import pytest

from flocsim.errors import FileError
from flocsim.io.seals import (
    HDF5_SIGNATURE,
    PIECE,
    PIECES_LINE,
    PIECES_MARK,
    checked_sealed,
    digest_of,
    is_in_pieces,
    seal,
    size_of_pieces,
)
from tests.helpers.sealed import read_sealed

LENGTHS = (8, 3000, 1, 17, 2_000_000)


def seal_of_pieces(table):
    """The seal of pieces, as files of before have it."""
    content = table.tobytes()
    return content + PIECES_MARK + f"{len(table):016x} {digest_of(content).hex()}\n".encode()


def table_of(data, lengths=LENGTHS):
    """The table of pieces of these lengths."""
    table = np.zeros(len(lengths), PIECE)
    table["length"] = lengths
    place = 0
    for number, length in enumerate(lengths):
        table["digest"][number] = digest_of(data[place : place + length])
        place += length
    return table


@pytest.fixture(scope="module")
def sealed():
    """(data, the same in pieces and sealed)."""
    data = HDF5_SIGNATURE + np.random.default_rng(1).bytes(sum(LENGTHS) - 8)
    return data, data + seal_of_pieces(table_of(data))


def size_in(content):
    file = io.BytesIO(content)
    return size_of_pieces(file) if is_in_pieces(file) else None


def test_a_whole_file_is_read(sealed, tmp_path):
    data, content = sealed
    assert size_in(content) == len(data)
    (tmp_path / "a.h5").write_bytes(content)
    assert read_sealed(tmp_path / "a.h5") == data


def test_a_file_sealed_as_a_whole_is_read_as_ever(sealed, tmp_path):
    data, _ = sealed
    (tmp_path / "a.h5").write_bytes(seal(data))
    assert read_sealed(tmp_path / "a.h5") == data


def test_any_changed_byte_is_found(sealed):
    data, content = sealed
    rng = np.random.default_rng(2)
    inside = rng.integers(0, len(data), 20).tolist()
    behind = range(len(data), len(content))  # the table and the last line, all of them
    for place in [*inside, *behind]:
        changed = bytearray(content)
        changed[place] ^= 1 << int(rng.integers(8))
        assert size_in(bytes(changed)) is None, place


def test_cut_files_are_found(sealed):
    data, content = sealed
    for stop in (0, 1, PIECES_LINE, len(data), len(data) + 40, len(content) - 1):
        assert size_in(content[:stop]) is None


@pytest.mark.parametrize("number", [0, 4, 6, 2**40, 2**64 - 1])
def test_a_wrong_number_of_pieces_allocates_nothing(sealed, number):
    _, content = sealed
    end = content[-PIECES_LINE:]
    line = PIECES_MARK + f"{number:016x}".encode() + end[len(PIECES_MARK) + 16 :]
    assert size_in(content[:-PIECES_LINE] + line) is None


def test_lengths_that_do_not_make_up_the_file_are_found(sealed):
    data, _ = sealed
    for lengths in ((8, 3000), (*LENGTHS, 2**63), (2**64 - 1,)):
        table = np.zeros(len(lengths), PIECE)
        table["length"] = lengths
        assert size_in(data + seal_of_pieces(table)) is None


def test_what_is_wrong_is_one_line(sealed, tmp_path):
    _, content = sealed
    (tmp_path / "a.h5").write_bytes(content[:100] + b"?" + content[101:])
    damaged = pytest.raises(FileError, match="is damaged, its checksum is wrong")
    with damaged, checked_sealed(tmp_path / "a.h5"):
        pass

"""The checksum: what is whole is read, and whatever is changed is found changed."""

import numpy as np
import pytest

from flocsim.errors import FileError
from flocsim.io.seals import BLOCK, HDF5_SIGNATURE, SEAL_LENGTH, seal_file
from tests.helpers.sealed import read_sealed, seal

DATA = HDF5_SIGNATURE + np.random.default_rng(1).bytes(BLOCK + 1000)


@pytest.fixture
def sealed(tmp_path):
    """A sealed file."""
    (tmp_path / "a.h5").write_bytes(seal(DATA))
    return tmp_path / "a.h5"


def test_a_whole_file_is_read(sealed):
    assert read_sealed(sealed) == DATA


def test_an_open_file_is_sealed_as_its_bytes_are(tmp_path):
    with open(tmp_path / "b.h5", "w+b") as file:
        file.write(DATA)
        seal_file(file)
    assert (tmp_path / "b.h5").read_bytes() == seal(DATA)


def test_any_changed_byte_is_found(sealed):
    content, rng = sealed.read_bytes(), np.random.default_rng(2)
    inside = rng.integers(0, len(DATA), 20).tolist()
    for place in [*inside, *range(len(content) - SEAL_LENGTH, len(content))]:
        changed = bytearray(content)
        changed[place] ^= 1 << int(rng.integers(8))
        sealed.write_bytes(changed)
        with pytest.raises(FileError, match=r"a\.h5 [^\n]*$"):
            read_sealed(sealed)


@pytest.mark.parametrize("stop", [0, 1, SEAL_LENGTH, len(DATA), len(DATA) + 40])
def test_cut_files_are_found(sealed, stop):
    sealed.write_bytes(seal(DATA)[:stop])
    with pytest.raises(FileError, match=r"not an HDF5 file|does not end in flocsim's checksum"):
        read_sealed(sealed)

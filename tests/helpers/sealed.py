"""The HDF5 bytes of files that flocsim has sealed."""

import os

from flocsim.io.seals import SEAL_LENGTH, check_seal, open_file


def read_sealed(path: str | os.PathLike) -> bytes:
    """The HDF5 bytes of a sealed file; FileError if it is absent, of another kind or damaged."""
    with open_file(path) as file:
        check_seal(path, file)
        file.seek(0)
        return file.read()[:-SEAL_LENGTH]

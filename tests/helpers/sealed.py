"""The HDF5 bytes of files that flocsim has sealed."""

import os

from flocsim.io.seals import SEAL_LENGTH, checked_sealed


def read_sealed(path: str | os.PathLike) -> bytes:
    """The HDF5 bytes of a sealed file; FileError if it is absent, of another kind or damaged."""
    with checked_sealed(path) as file:
        return file.read()[:-SEAL_LENGTH]

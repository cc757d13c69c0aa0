"""The HDF5 bytes of files that flocsim has sealed."""

import os

from flocsim.io.seals import SEAL_LENGTH, SEAL_MARK, check_seal, digest_of, open_file


def seal(data: bytes) -> bytes:
    """Return the bytes of an HDF5 file with their checksum appended."""
    return data + SEAL_MARK + digest_of(data).hex().encode() + b"\n"


def read_sealed(path: str | os.PathLike) -> bytes:
    """The HDF5 bytes of a sealed file; FileError if it is absent, of another kind or damaged."""
    with open_file(path) as file:
        check_seal(path, file)
        file.seek(0)
        return file.read()[:-SEAL_LENGTH]

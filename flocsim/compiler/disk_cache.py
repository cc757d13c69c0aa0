"""Cache of compiled code, and of what takes long to compute, in files with a checksum.

Loading machine code runs it. A file is therefore read only if it belongs to the user or to root,
nobody else can write it, it is no link, and its checksum is right for its content and its name.
Nobody else can make such a file, wherever the folder is: another user's files have another owner,
and the user's own under a wrong name have a wrong checksum. Any other file is treated as absent:
the code is compiled again, and the file replaced.
"""

import contextlib
import hashlib
import os
import secrets
import stat
import warnings
from collections.abc import Callable
from pathlib import Path

DIGEST_SIZE = 32
SUFFIX = ".code"

WRITABLE_BY_OTHERS = stat.S_IWGRP | stat.S_IWOTH

# Of os.open: open no link, and wait for no pipe; systems without these flags ignore them.
SAFELY = getattr(os, "O_NOFOLLOW", 0) | getattr(os, "O_NONBLOCK", 0)


def cache_folder() -> Path:
    """Return the folder named by FLOCSIM_CACHE, else the user's own cache folder."""
    import platformdirs

    return Path(os.environ.get("FLOCSIM_CACHE") or platformdirs.user_cache_dir("flocsim"))


def file_name(name: str, key: str) -> str:
    """Return the file name for content called ``name``; ``key`` is what else it depends on."""
    return f"{name}-{hashlib.blake2b(key.encode(), digest_size=8).hexdigest()}{SUFFIX}"


def checksum(name: str, key: str, data: bytes) -> bytes:
    """Return the checksum of a file's content and name, with which the file begins."""
    head = f"{name}\0{key}\0".encode()
    return hashlib.blake2b(head + data, digest_size=DIGEST_SIZE).digest()


def open_safely(path: str, flags: int) -> int:
    """Open a file, but no link, and wait for no pipe."""
    return os.open(path, flags | SAFELY)


def read(name: str, key: str) -> bytes | None:
    """Return what was written under a name and a key, if it is unchanged; else None."""
    path = cache_folder() / file_name(name, key)
    with contextlib.suppress(OSError), open(path, "rb", opener=open_safely) as file:
        status = os.fstat(file.fileno())
        # Windows has no such owners: there, only the user can write to the user's folder.
        trusted = not hasattr(os, "getuid") or (
            status.st_uid in (0, os.getuid()) and not status.st_mode & WRITABLE_BY_OTHERS
        )
        if stat.S_ISREG(status.st_mode) and trusted:
            content = file.read()
            data = content[DIGEST_SIZE:]
            return data if content[:DIGEST_SIZE] == checksum(name, key, data) else None
    return None


def write(name: str, key: str, data: bytes) -> None:
    """Write data under a name and a key, replacing an existing file; warn where that fails."""
    folder = cache_folder()
    temporary = folder / f".{secrets.token_hex(12)}"
    try:
        folder.mkdir(parents=True, exist_ok=True)
        # Readers see the whole file or none; the mode does not depend on the user's umask.
        with open(temporary, "xb", opener=lambda path, flags: os.open(path, flags, 0o644)) as file:
            file.write(checksum(name, key, data) + data)
        os.replace(temporary, folder / file_name(name, key))
    except OSError as error:
        with contextlib.suppress(OSError):
            temporary.unlink()
        # Python shows a warning of one text and line once a process.
        warnings.warn(
            f"compiled code is not stored: the cache folder {folder} cannot be written "
            f"({error.strerror}); set FLOCSIM_CACHE to one that can",
            stacklevel=1,
        )


def has(name: str) -> bool:
    """Return True if something was written under a name, or nothing can be written.

    Makes the folder if it is missing, as it is about to be written to.
    """
    folder = cache_folder()
    with contextlib.suppress(OSError):
        folder.mkdir(parents=True, exist_ok=True)
    return any(folder.glob(f"{name}-*{SUFFIX}")) or not os.access(folder, os.W_OK)


def kept(name: str, key: str, make: Callable[[], bytes]) -> bytes:
    """Return what was written under a name and a key, else ``make()`` it and write it; the key must
    determine the result."""
    data = read(name, key)
    if data is None:
        data = make()
        write(name, key, data)
    return data

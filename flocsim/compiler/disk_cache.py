"""Files of compiled code, and of what takes long to compute, whose content is checked.

Loading compiled code runs what it says, so that a file is taken only where it is the user's or
root's, writable by nobody else, no link, and its checksum is right for its name. Nobody else can
make such a file, wherever the folder is: another user's files have another owner, and the user's
own under a wrong name has a wrong checksum. On any doubt there is no file, and the code is compiled
anew.

A package may bring such files of its own (.ci/package): of the engines that most studies need, in a
folder for each kind of processor. They are looked for last, held to the same, and never written.
"""

import contextlib
import hashlib
import os
import secrets
import stat
import time
import warnings
from collections.abc import Callable
from pathlib import Path

from flocsim.compiler.processor import shared_kind

MARK = b"flocsim compiled code 2\n"
DIGEST_SIZE = 32
SUFFIX = ".code"
UNFINISHED = ".unfinished"

# Bytes of the largest file that is read: an engine has one million.
LARGEST = 256 * 2**20

# Seconds after which a file that was never finished is removed: its writer was killed.
ABANDONED = 86_400.0

WRITABLE_BY_OTHERS = stat.S_IWGRP | stat.S_IWOTH

# Where the package has compiled code of its own, if it has any.
SHIPPED = Path(__file__).parent / "shipped"

_warned: set[str] = set()


def warn_once(text: str) -> None:
    """Warn, the first time that this is said in this process."""
    if text not in _warned:
        _warned.add(text)
        warnings.warn(text, stacklevel=2)


def own_folder() -> Path:
    """Return the user's own folder of compiled code."""
    import platformdirs

    return Path(platformdirs.user_cache_dir("flocsim"))


def folders() -> list[Path]:
    """Return where compiled code is kept: in FLOCSIM_CACHE, and in the user's own folder if that is
    not named or cannot be written."""
    first = Path(os.environ.get("FLOCSIM_CACHE") or own_folder())
    return [first] if is_writable(first) else [first, own_folder()]


def folders_to_read() -> list[Path]:
    """Return the folders in which compiled code may be, in the order in which they are asked: last
    what came with the package for processors such as this one."""
    return [*folders(), *([SHIPPED / kind] if (kind := shared_kind()) else [])]


def is_writable(folder: Path) -> bool:
    """Return True if files can be put into a folder, or it can be made."""
    while not os.path.exists(folder) and folder != folder.parent:
        folder = folder.parent
    return not os.path.isdir(folder) or os.access(folder, os.W_OK | os.X_OK)


def file_name(name: str, key: str) -> str:
    """Return the file of what is called ``name``; the key tells what else its content depends
    on."""
    return f"{name}-{hashlib.blake2b(key.encode(), digest_size=8).hexdigest()}{SUFFIX}"


def head_of(name: str, key: str, data: bytes) -> bytes:
    """Return how a file begins: with the checksum of its content and of what it is called."""
    hashed = hashlib.blake2b(f"{name}\0{key}\0".encode(), digest_size=DIGEST_SIZE)
    hashed.update(data)
    return MARK + hashed.digest()


def read(name: str, key: str) -> bytes | None:
    """Return what has been written under a name and a key, whole and unchanged; else None."""
    for folder in folders_to_read():
        content = content_of(folder / file_name(name, key))
        if content is None:
            continue
        start = len(MARK) + DIGEST_SIZE
        data = content[start:]
        if content[:start] == head_of(name, key, data):
            return data
        if folder.parent == SHIPPED:  # where nothing takes its place
            warn_once(
                f"compiled code in {folder} is damaged, and is compiled anew: install flocsim again"
            )
    return None


def has(name: str) -> bool:
    """Return True if something was written under a name; also where nothing can be kept."""
    found = any(any(folder.glob(f"{name}-*{SUFFIX}")) for folder in folders_to_read())
    return found or not any(map(is_writable, folders()))


def content_of(path):
    """Return the bytes of an ordinary file of the user's or root's that only they can write; else
    None."""
    flags = os.O_RDONLY
    for more in ("O_NOFOLLOW", "O_NONBLOCK", "O_CLOEXEC", "O_BINARY"):
        flags |= getattr(os, more, 0)
    with contextlib.suppress(OSError), open(os.open(path, flags), "rb") as file:
        found = os.fstat(file.fileno())
        # Windows keeps a user's files by other means.
        ours = not hasattr(os, "getuid") or (
            found.st_uid in (0, os.getuid()) and not found.st_mode & WRITABLE_BY_OTHERS
        )
        if stat.S_ISREG(found.st_mode) and ours and found.st_size <= LARGEST:
            return file.read()
    return None


def write(name: str, key: str, data: bytes) -> None:
    """Write data under a name and a key, in place of what is there; one warning where that
    fails."""
    folder = next(filter(is_writable, folders()), None)
    if folder is None:
        return
    try:
        folder.mkdir(parents=True, exist_ok=True)
        replace(folder / file_name(name, key), head_of(name, key, data) + data)
    except OSError as error:
        warn_once(
            f"no compiled code is kept: the cache folder {folder} cannot be written "
            f"({error.strerror}); set FLOCSIM_CACHE to one that can"
        )


def kept(name: str, key: str, make: Callable[[], bytes]) -> bytes:
    """Return what is kept under a name and a key; made, and kept, where there is nothing.

    The key has to tell everything that what is made follows from.
    """
    data = read(name, key)
    if data is None:
        data = make()
        write(name, key, data)
    return data


def replace(path, content):
    """Put a file in its place, whole or not at all; no two processes write to one name."""
    temporary = path.with_name(f".{secrets.token_hex(12)}{UNFINISHED}")
    flags = os.O_WRONLY | os.O_CREAT | os.O_EXCL | getattr(os, "O_BINARY", 0)
    try:
        with open(os.open(temporary, flags, 0o644), "wb") as file:
            file.write(content)
        os.replace(temporary, path)
    except BaseException:
        with contextlib.suppress(OSError):
            temporary.unlink()
        raise
    for each in path.parent.glob(f".*{UNFINISHED}"):  # what killed writers have left
        with contextlib.suppress(OSError):
            if time.time() - each.stat().st_mtime > ABANDONED:
                each.unlink()

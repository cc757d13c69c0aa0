"""Machine code on disk, and how it is loaded: files whose content is checked, in folders that
nobody else can write, and object files as numba has made them, loaded by LLVM alone.

Loading compiled code runs what it says, so that a file is taken only where its folder and all
folders above are the user's or root's and writable by nobody else (as OpenSSH's StrictModes asks of
keys), and where its checksum is right. The checksum finds damage and files under wrong names; it
is no secret, so that it keeps nobody out: the permissions do. On any doubt there is no file, and
the code is compiled anew.

A package may bring such files of its own (.ci/package): of the engines that most studies need, in a
folder for each kind of processor. They are looked for last, held to the same, and never written.

Loading numba, and all that it registers, takes longer than a short run; a function that allocates
nothing needs no more of it than an object file and the name of its entry. What such a function
returns is numbers: numba's way of calling puts them where a first pointer says, a second one tells
what was raised, and the answer is whether anything was.
"""

import contextlib
import ctypes
import hashlib
import json
import os
import pickle
import secrets
import stat
import struct
import threading
import time
import warnings
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from types import MappingProxyType
from typing import Any, NamedTuple

from flocsim.compiler.processor import shared_kind

MARK = b"flocsim compiled code 1\n"
DIGEST_SIZE = 32
SUFFIX = ".code"
UNFINISHED = ".unfinished"

LARGEST = 256 * 2**20
"""Bytes of the largest file that is read: an engine has one million."""

ABANDONED = 86_400.0
"""Seconds after which a file that was never finished is removed: its writer was killed."""

WRITABLE_BY_OTHERS = stat.S_IWGRP | stat.S_IWOTH

SHIPPED = Path(__file__).parent / "shipped"
"""Where the package has compiled code of its own, if it has any."""

LENT = b"numba_", b"NRT_", b"Py", b"_Py", b"__svml"
"""How names begin of what numba lends to compiled code, once it is loaded itself."""

_warned: set[str] = set()
_lock = threading.Lock()
_engines: list[Any] = []
_linked: dict[tuple[Any, ...], int] = {}


def warn_once(text: str) -> None:
    """A warning, the first time that it is given in this process."""
    if text not in _warned:
        _warned.add(text)
        warnings.warn(text, stacklevel=2)


def own_folder() -> Path:
    """The user's own folder of compiled code."""
    import platformdirs

    return Path(platformdirs.user_cache_dir("flocsim"))


def home_folder() -> Path | None:
    """The user's home: who can exchange that can do anything, so that no folder above matters."""
    import pwd

    try:
        return Path(os.path.realpath(pwd.getpwuid(os.getuid()).pw_dir))
    except KeyError:
        return None


def is_ours(found: os.stat_result) -> bool:
    """Whether something is the user's or root's."""
    return found.st_uid in (0, os.getuid())


def why_unsafe(folder: Path) -> str:
    """Why others could exchange what is in a folder, in words with the remedy; "" if they can't.

    ``folder`` is resolved (without links); parts that do not exist yet are left out. Above the
    folder itself a folder that all can write will do if it is sticky, as /tmp is: there
    nobody can rename or remove what is another's.
    """
    if not hasattr(os, "getuid"):
        return ""  # Windows keeps a user's folders by other means
    home = home_folder()
    for each in (folder, *folder.parents):
        with contextlib.suppress(OSError):  # what cannot be seen cannot be loaded either
            found = os.lstat(each)
            if not is_ours(found):
                try:
                    owner = each.owner()
                except KeyError:
                    owner = f"user {found.st_uid}"
                return (
                    f"{each} belongs to {owner}, not to you or root: "
                    "set FLOCSIM_CACHE to a folder of your own"
                )
            sticky = each != folder and found.st_mode & stat.S_ISVTX
            if found.st_mode & WRITABLE_BY_OTHERS and not sticky:
                return (
                    f"others can write into {each}: chmod go-w {each}, or set FLOCSIM_CACHE to a "
                    "folder that only you can write"
                )
        if each == home:
            break
    return ""


def resolved(folder: Path) -> Path:
    return Path(os.path.realpath(folder))


def folders() -> Iterator[Path]:
    """Where compiled code is looked for: in FLOCSIM_CACHE, and in the user's own folder if that is
    not named or cannot be written; only in those where nobody else can have put it."""
    named = os.environ.get("FLOCSIM_CACHE")
    first = resolved(Path(named) if named else own_folder())
    for folder in [first] if is_writable(first) else [first, resolved(own_folder())]:
        if reason := why_unsafe(folder):
            warn_once(f"no compiled code is kept: {reason}")
        else:
            yield folder


def shipped() -> Path | None:
    """The folder of compiled code that came with the package for processors such as this one; None
    without."""
    if not (kind := shared_kind()):
        return None
    folder = resolved(SHIPPED / kind)
    return folder if folder.is_dir() and not why_unsafe(folder) else None


def folders_to_read() -> Iterator[Path]:
    """The folders in which compiled code may be, in the order in which they are asked."""
    yield from folders()
    if (folder := shipped()) is not None:
        yield folder


def is_writable(folder: Path) -> bool:
    """Whether files can be put into a folder, or it can be made."""
    while not os.path.exists(folder) and folder != folder.parent:
        folder = folder.parent
    return not os.path.isdir(folder) or os.access(folder, os.W_OK | os.X_OK)


def file_name(name: str, key: str) -> str:
    """The file of what is called ``name``; the key tells what else its content depends on."""
    return f"{name}-{hashlib.blake2b(key.encode(), digest_size=8).hexdigest()}{SUFFIX}"


def digest(name: str, key: str, data: bytes) -> bytes:
    """The checksum of a file's content, which says what it is the content of as well."""
    hashed = hashlib.blake2b(f"{name}\0{key}\0".encode(), digest_size=DIGEST_SIZE)
    hashed.update(data)
    return hashed.digest()


def read(name: str, key: str) -> bytes | None:
    """What has been written under a name and a key, whole and unchanged; else None."""
    for folder in folders_to_read():
        content = content_of(folder / file_name(name, key))
        if content is None:
            continue
        start = len(MARK) + DIGEST_SIZE
        data = content[start:]
        if content[:start] == MARK + digest(name, key, data):
            return data
        if folder.parent == resolved(SHIPPED):  # where nothing takes its place
            warn_once(
                f"compiled code in {folder} is damaged, and is compiled anew: install flocsim again"
            )
    return None


def has(name: str) -> bool:
    """Whether something was written under a name; also where nothing can be kept."""
    found = any(any(folder.glob(f"{name}-*{SUFFIX}")) for folder in folders_to_read())
    return found or not any(map(is_writable, folders()))


def content_of(path):
    """The bytes of an ordinary file of the user's or root's that only they can write; else None."""
    flags = os.O_RDONLY
    for more in ("O_NOFOLLOW", "O_NONBLOCK", "O_CLOEXEC", "O_BINARY"):
        flags |= getattr(os, more, 0)
    with contextlib.suppress(OSError), open(os.open(path, flags), "rb") as file:
        found = os.fstat(file.fileno())
        ours = not hasattr(os, "getuid") or (
            is_ours(found) and not found.st_mode & WRITABLE_BY_OTHERS
        )
        if stat.S_ISREG(found.st_mode) and ours and found.st_size <= LARGEST:
            return file.read()
    return None


def write(name: str, key: str, data: bytes) -> None:
    """Keep data under a name and a key, in place of what is there; said once where that fails."""
    for folder in folders():
        if not is_writable(folder):
            continue
        try:
            make_folder(folder)
            if reason := why_unsafe(folder):
                warn_once(f"no compiled code is kept: {reason}")
            else:
                replace(folder / file_name(name, key), MARK + digest(name, key, data) + data)
        except OSError as error:
            warn_once(
                f"no compiled code is kept: the cache folder {folder} cannot be written "
                f"({error.strerror}); set FLOCSIM_CACHE to one that can"
            )
        return


def kept(name: str, key: str, make: Callable[[], bytes]) -> bytes:
    """What is kept under a name and a key; made, and kept, where there is nothing.

    The key has to tell everything that what is made follows from.
    """
    data = read(name, key)
    if data is None:
        data = make()
        write(name, key, data)
    return data


def make_folder(folder):
    """Make a folder and those above that are missing, writable by this user alone."""
    if not os.path.isdir(folder):
        make_folder(folder.parent)
        with contextlib.suppress(FileExistsError):
            os.mkdir(folder, 0o755)


def replace(path, content):
    """Put a file in its place, whole or not at all; no two processes write to one name."""
    temporary = path.with_name(f".{secrets.token_hex(12)}{UNFINISHED}")
    flags = os.O_WRONLY | os.O_CREAT | os.O_EXCL | getattr(os, "O_NOFOLLOW", 0)
    try:
        with open(os.open(temporary, flags | getattr(os, "O_BINARY", 0), 0o644), "wb") as file:
            file.write(content)
        os.replace(temporary, path)
    except BaseException:
        with contextlib.suppress(OSError):
            os.unlink(temporary)
        raise
    for each in path.parent.glob(f".*{UNFINISHED}"):  # by processes that were killed
        with contextlib.suppress(OSError):
            if time.time() - os.lstat(each).st_mtime > ABANDONED:
                os.unlink(each)


class Called(NamedTuple):
    """A unit that another one calls: its ``symbol``, the name of its ``function``, the ``types`` of
    its arguments in words, and what it is to have ``returned``, as for struct.unpack."""

    symbol: str
    function: str
    types: list[str]
    returned: str


class ObjectCode(NamedTuple):
    """``code``, an object file; ``entry``, its symbol; ``returned``, what it returns, as for
    struct.unpack; ``borrows``, whether it calls what only numba has; the units that it ``calls``.
    """

    code: bytes
    entry: str
    returned: str
    borrows: bool
    calls: tuple[Called, ...] = ()

    def packed(self) -> bytes:
        """As the disk has it."""
        return json.dumps(self[1:]).encode() + b"\n" + self.code

    @classmethod
    def unpacked(cls, data: bytes) -> "ObjectCode":
        head, code = data.split(b"\n", 1)
        entry, returned, borrows, calls = json.loads(head)
        return cls(code, entry, returned, borrows, tuple(Called(*each) for each in calls))

    def load(self, called: Mapping[str, int] = MappingProxyType({})) -> int:
        """The address of the entry; ``called`` {symbol: address} of the units that it calls. The
        code stays as long as the process lives."""
        import llvmlite.binding as llvm

        if self.borrows:
            import numba

            numba.njit("float64()")(lambda: 0.0)  # it lends once it has compiled something
        with _lock:
            llvm.initialize_native_target()
            llvm.initialize_native_asmprinter()
            # For the process as a whole, and yet for this file: those before are linked already.
            for symbol, address in called.items():
                llvm.add_symbol(symbol, address)
            machine = llvm.Target.from_default_triple().create_target_machine()
            # One of its own: symbols of two object files may have the same names.
            engine = llvm.create_mcjit_compiler(llvm.parse_assembly(""), machine)
            engine.add_object_file(llvm.ObjectFileRef.from_data(self.code))
            engine.finalize_object()
            _engines.append(engine)
            return engine.get_function_address(self.entry)


def link(code: ObjectCode, units: dict[str, ObjectCode]) -> int:
    """The address of a unit, linked with ``units`` {symbol: ObjectCode}, as far as it calls them;
    what is linked with the same ones is loaded once.

    ValueError where one returns another thing than its caller was compiled for.
    """
    if any(units[each.symbol].returned != each.returned for each in code.calls):
        raise ValueError("a unit was compiled for another one than it is linked with")
    called = {each.symbol: link(units[each.symbol], units) for each in code.calls}
    key = hashlib.blake2b(code.code, digest_size=16).digest(), code.entry, *called.items()
    if key not in _linked:
        _linked[key] = code.load(called)
    return _linked[key]


def function_at(entry: int, returned: str) -> Callable[[int], Any]:
    """The entry at an address as a function of an address, which runs without the interpreter's
    lock; ``returned`` as in ObjectCode."""
    kind = ctypes.CFUNCTYPE(ctypes.c_int32, ctypes.c_void_p, ctypes.c_void_p, ctypes.c_int64)
    call, layout = kind(entry), struct.Struct(f"@{returned}")

    def function(address):
        answer, raised = ctypes.create_string_buffer(layout.size or 8), ctypes.c_void_p()
        if call(ctypes.addressof(answer), ctypes.addressof(raised), address):
            raise exception_at(raised.value or 0)
        numbers = layout.unpack_from(answer)
        return numbers if len(numbers) > 1 else next(iter(numbers), None)

    return function


def exception_at(address: int) -> BaseException:
    """The exception that numba's compiled code tells of: a pickle (class, arguments, place)."""
    data = ctypes.c_void_p.from_address(address)
    size = ctypes.c_int32.from_address(address + ctypes.sizeof(data))
    kind, arguments, _ = pickle.loads(ctypes.string_at(data.value or 0, size.value))
    return kind(*(arguments or ()))

"""The journal of an unfinished study: an SQLite database beside the results, STUDY.h5.journal.

It has one table of records: sessions (how a run was started), chunks (rows of finished replicates),
copies of rows of older results, and parts (what is saved of unfinished replicates). Each record has
a checksum of its own, as SQLite has none of its pages.

One process writes, rank 0's, and any number may read meanwhile (SQLite's write-ahead log, WAL).
SQLite's own lock lasts for one transaction only; so the writer locks a second file, NAME.lock, as
long as it has the journal open. The same file says how many records were acknowledged, by which
the loss of a -wal file is recognised.
"""

import contextlib
import json
import os
import secrets
import sqlite3
import stat
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import attrs

from flocsim.errors import FileError
from flocsim.io.files import give_name, lock, names, ordinary_target, sync_folder, unwritable
from flocsim.io.json_text import read_json
from flocsim.io.seals import digest_of

SUFFIX = ".journal"
LOCK_SUFFIX, WAL_SUFFIX, INDEX_SUFFIX = ".lock", "-wal", "-shm"

SESSION, CHUNK, OLD, PART = "session", "chunk", "old", "part"
"""Kinds of records."""

SCHEMA = (
    "CREATE TABLE record(id INTEGER PRIMARY KEY, kind TEXT, condition TEXT, first INTEGER, "
    "about BLOB, data BLOB, digest BLOB)",
    "CREATE INDEX place ON record(condition, first)",
)

HEADER = b"SQLite format 3\0"
BEFORE_SQLITE = b"\x93FLOCREC"
"""How journals began before they were databases."""

SYNC_SECONDS = 5.0
"""Time between two syncs to the disk [s]: what a power cut may cost. A kill costs nothing."""

LOCK_SECONDS = 10.0
"""Time to wait for a job that is just ending, or for SQLite's own locks [s]."""

POLL_SECONDS = 0.05
"""Time between two attempts to get the lock [s]."""

MOST_COPIES = 1000
"""Names NAME.1, NAME.2, … that are tried for a file that is put aside."""

SMALLEST_RECORD = 64
"""Bytes; bounds how many records a damaged file can have."""


@attrs.frozen
class Record:
    """One record: ``condition`` is the name of a condition as JSON, ``first`` its replicate."""

    id: int
    kind: str
    condition: str
    first: int
    about: dict[str, Any]
    data: bytes


def digest_over(kind: str, condition: str, first: int, about: bytes, data: bytes) -> bytes:
    """Return the checksum of all that a record has."""
    return digest_of(b"\0".join([f"{kind} {condition} {first}".encode(), about, data]), 16)


def journal_path(results: str | Path) -> Path:
    """Return where the journal of a results file lies: beside it."""
    target = ordinary_target(results)
    return target.with_name(target.name + SUFFIX)


def journal_of(path: str | Path) -> Path | None:
    """Return the journal to read where a command is given this path: the path itself, or the
    journal beside results that are not there yet; None where there is neither."""
    place = Path(path)
    if place.name.endswith(SUFFIX) and place.is_file():
        return place
    try:
        beside = journal_path(path)
    except FileError:
        return None
    return beside if not os.path.lexists(path) and beside.is_file() else None


def beside(path: Path, suffix: str) -> Path:
    return path.with_name(path.name + suffix)


def head_of(path: Path) -> tuple[str, str]:
    """Return why a file is no journal ("" where it may be one), and the mark that a database got
    as it was made."""
    with open(path, "rb") as file:
        data = file.read(64)
    return problem_of(data[: len(HEADER)]), str(int.from_bytes(data[60:], "big"))


def problem_of(head: bytes) -> str:
    """Return why a file that begins so is no journal."""
    if head.startswith(BEFORE_SQLITE):
        return (
            "was written by a version of flocsim that was never released: finish the run with "
            "that version, or start over with --restart, which keeps it under another name"
        )
    return "" if head in (b"", HEADER) else NO_JOURNAL


NO_JOURNAL = "is not a journal of flocsim, or is damaged at its start: move it away"


def as_json(about: dict[str, Any]) -> bytes:
    return json.dumps(about, ensure_ascii=False).encode("utf-8", "replace")


def make_tables(db: sqlite3.Connection) -> None:
    db.execute("BEGIN")
    for statement in (*SCHEMA, f"PRAGMA user_version={secrets.randbits(31)}"):
        db.execute(statement)
    db.execute("COMMIT")


def connect(path: Path, options: str = "") -> sqlite3.Connection:
    """Open a database; whoever calls this lets one thread at a time use it."""
    db = sqlite3.connect(
        f"{path.absolute().as_uri()}{options}", uri=True, timeout=LOCK_SECONDS,
        isolation_level=None, check_same_thread=False,
    )  # fmt: skip
    # The file may be anyone's: no code in its schema is run, and damaged pages are noticed.
    db.execute("PRAGMA trusted_schema=OFF")
    db.execute("PRAGMA cell_size_check=ON")
    return db


def has_tables(db: sqlite3.Connection) -> bool:
    """Return True if a database has the tables of a journal, False if it is empty; FileError."""
    found = [sql for (sql,) in db.execute("SELECT sql FROM sqlite_master ORDER BY rowid")]
    if found and found != list(SCHEMA):
        raise sqlite3.DatabaseError("other tables")
    return bool(found)


@contextlib.contextmanager
def writing(path: Path) -> Iterator[None]:
    """Turn what SQLite or the system says of a failed write into a FileError."""
    try:
        yield
    except FileError:
        raise
    except (OSError, sqlite3.Error) as error:
        raise unwritable(path, error) from error


class JournalReader:
    """The records of an open journal; ``damaged`` has the ids of those that cannot be read."""

    def __init__(self, path: Path, db: sqlite3.Connection) -> None:
        self.path, self.db = path, db
        self.damaged: list[int] = []

    def record(self, id: int) -> Record | None:
        """Return a record; None where it is damaged or absent."""
        try:
            row = self.db.execute("SELECT * FROM record WHERE id=?", (id,)).fetchone()
            _, kind, condition, first, about, data, digest = row
            if digest != digest_over(kind, condition, first, about, data):
                return None
            return Record(id, kind, condition, first, read_json(about, {}), data)
        except (sqlite3.DatabaseError, TypeError, ValueError):
            return None

    def records(self, kind: str = "") -> Iterator[Record]:
        """Yield all intact records, or those of a kind, in order, and note the others."""
        self.damaged = []
        query = "SELECT id FROM record WHERE ?1 IN ('', kind) ORDER BY id"
        try:
            known = [id for (id,) in self.db.execute(query, (kind,))]
        except sqlite3.DatabaseError as error:
            raise FileError(f"{self.path} is damaged: {error}") from error
        for id in known:
            if (record := self.record(id)) is not None:
                yield record
            else:
                self.damaged.append(id)

    def intact(self, most: int) -> Iterator[Record]:
        """Yield what can be read of a damaged database, by trying all ids up to ``most``."""
        for id in range(1, most + 1):
            if (record := self.record(id)) is not None:
                yield record

    def chunks(self, condition: str, low: int, high: int) -> Iterator[Record]:
        """Yield the rows of a condition that begin between two replicates; FileError for damage."""
        try:
            found = self.db.execute(
                "SELECT id FROM record WHERE condition=? AND first>? AND first<? AND kind IN "
                f"('{CHUNK}', '{OLD}') ORDER BY first, id", (condition, low, high),
            ).fetchall()  # fmt: skip
        except sqlite3.Error:
            found = [(-1,)]
        for (id,) in found:
            if id in self.damaged:  # which is known by now
                continue
            if (record := self.record(id)) is None:
                raise FileError(
                    f"{self.path} is damaged, or was changed after it was written: run it again "
                    "with --resume, which computes what is missing"
                )
            yield record


@contextlib.contextmanager
def read_journal(path: Path) -> Iterator[JournalReader]:
    """Open a journal for reading, also while a run writes it; FileError if that is impossible."""
    try:
        problem, _ = head_of(path)
        if problem:
            raise FileError(f"{path} {problem}")
        # Without a log nothing is locked, and none is made: the folder may be read-only.
        db = connect(path, "?mode=ro" if beside(path, WAL_SUFFIX).exists() else "?immutable=1")
        db.execute("BEGIN")  # all that follows sees one state of a journal that grows
        is_begun = has_tables(db)
    except FileError:
        raise
    except (OSError, sqlite3.Error) as error:
        reason = getattr(error, "strerror", None) or error
        raise FileError(f"{path} could not be read: {reason}") from error
    with contextlib.closing(db):
        if not is_begun:
            raise FileError(f"{path} has only just begun: try again")
        yield JournalReader(path, db)


class Journal(JournalReader):
    """A journal that this process alone writes; in memory where there is no ``path``.

    ``problem`` says why a file that is there is no journal, which can only be put aside; ``lost``
    is how many records were acknowledged and are not there; ``salvaged`` where a damaged database
    was put aside, whose intact records are in this one.
    """

    problem, lost, synced, is_writing = "", 0, 0.0, False
    salvaged: Path | None = None
    version: int | None = None

    def __init__(self, path: Path | None = None) -> None:
        """Open and lock the journal at ``path``, or start one; FileError if impossible."""
        if path is None:
            super().__init__(Path("memory"), sqlite3.connect(
                ":memory:", isolation_level=None, check_same_thread=False
            ))  # fmt: skip
            self.lock: Lock | None = None
            make_tables(self.db)
            self.mark, self.last = 0, 0
            return
        self.path = path
        self.lock = Lock(beside(path, LOCK_SUFFIX))
        try:
            with writing(path):
                self.open()
        except FileError:
            self.lock.close()
            raise

    @property
    def has_lock(self) -> bool:
        """False on a file system without locks."""
        return self.lock is None or self.lock.is_locked

    def open(self) -> None:
        """Open the database and see that it is whole; what is intact of a damaged one is kept."""
        os.close(open_regular(self.path))
        self.lost, self.salvaged = 0, None
        self.problem, mark = head_of(self.path)
        if self.problem:
            return
        assert self.lock is not None, "a journal on the disk"
        words = self.lock.text.split()
        if len(words) == 2 and words[0] != mark:
            self.remove_log()  # of a database that was in this place before
        self.connect()
        try:
            if is_new := not has_tables(self.db):
                make_tables(self.db)
            is_whole = self.db.execute("PRAGMA integrity_check(1)").fetchone() == ("ok",)
        except sqlite3.OperationalError:
            raise
        except sqlite3.DatabaseError:
            is_whole = is_new = False
        if not is_whole:
            self.salvage()
        if not self.problem:
            self.note_last()
            if len(words) == 2 and (is_new or words[0] == str(self.mark)):
                self.lost = max(int(words[1]) - self.last, 0)

    def connect(self) -> None:
        # Without locks SQLite has no log that others could read meanwhile.
        self.db = connect(self.path, "" if self.has_lock or os.name == "nt" else "?vfs=unix-none")
        self.stat = os.stat(self.path)
        self.version, self.is_writing = None, False
        self.synced = time.monotonic()

    def begin_log(self) -> None:
        """From now on write through a log: a run that is refused leaves the file as it was."""
        if not self.is_writing and self.lock is not None:
            mode = "WAL" if self.has_lock else "DELETE"
            is_log = self.db.execute(f"PRAGMA journal_mode={mode}").fetchone() == ("wal",)
            # The log is synced every SYNC_SECONDS; without one every record is.
            self.db.execute(f"PRAGMA synchronous={'NORMAL' if is_log else 'FULL'}")
        self.is_writing = True

    def note_last(self) -> None:
        """Find the id of the last record, and by what the lock file knows this database."""
        (self.mark,) = self.db.execute("PRAGMA user_version").fetchone()
        (last,) = self.db.execute("SELECT max(id) FROM record").fetchone()
        self.last = int(last or 0)

    def acknowledge(self) -> None:
        """Write down how many records there are."""
        if self.lock is not None:
            self.lock.text = f"{self.mark} {self.last}"

    def salvage(self) -> None:
        """Copy the intact records of a damaged database into a new one, and put the old one
        aside; a ``problem`` where nothing can be read."""
        try:
            # Only so does SQLite read a file that was cut short.
            self.db.execute("PRAGMA writable_schema=ON")
            has_tables(self.db)
        except sqlite3.DatabaseError:
            self.problem = NO_JOURNAL
            self.db.close()
            return
        places = [self.path, beside(self.path, WAL_SUFFIX)]
        most = sum(each.stat().st_size for each in places if each.exists()) // SMALLEST_RECORD
        copy = beside(self.path, ".salvaged")
        copy.unlink(missing_ok=True)
        with contextlib.closing(connect(copy)) as db:
            make_tables(db)
            db.execute("BEGIN")
            for record in self.intact(most):
                about = as_json(record.about)
                rest = record.kind, record.condition, record.first, about, record.data
                row = record.id, *rest, digest_over(*rest)
                db.execute("INSERT INTO record VALUES (?, ?, ?, ?, ?, ?, ?)", row)
            db.execute("COMMIT")
        self.salvaged = self.rename()
        give_name(copy, self.path)
        copy.unlink(missing_ok=True)
        self.connect()

    @property
    def is_blank(self) -> bool:
        """Whether nothing in it was computed."""
        query = f"SELECT 1 FROM record WHERE kind IN ('{CHUNK}', '{PART}') LIMIT 1"
        return not self.problem and self.db.execute(query).fetchone() is None

    def add(
        self, kind: str, condition: str, first: int, about: dict, data: bytes = b"",
        id: int | None = None,
    ) -> int:  # fmt: skip
        """Append a record, or replace that with this id; its id. FileError where that fails, and
        then the journal is what it was before."""
        rest = kind, condition, first, as_json(about), data
        with writing(self.path):
            self.begin_log()
            self.refuse_others()
            found = self.db.execute(
                "INSERT OR REPLACE INTO record VALUES (?, ?, ?, ?, ?, ?, ?)",
                (id, *rest, digest_over(*rest)),
            ).lastrowid
            assert found is not None, "a row was inserted"
            self.last = max(self.last, found)
            if not self.db.in_transaction:
                self.acknowledge()
        self.sync_when_due()
        return found

    def refuse_others(self) -> None:
        """FileError where another program has written to the database: without locks it can."""
        (version,) = self.db.execute("PRAGMA data_version").fetchone()
        if self.version not in (None, version):
            raise FileError(
                f"{self.path} was changed by another program while this run wrote to it; what is "
                "intact in it is kept: make sure that nothing else writes there, and continue "
                "with --resume"
            )
        self.version = version

    @contextlib.contextmanager
    def together(self) -> Iterator[None]:
        """Add many records at once, all or none."""
        with writing(self.path):
            self.begin_log()
            self.db.execute("BEGIN")
        try:
            yield
        except BaseException:
            self.db.execute("ROLLBACK")
            raise
        with writing(self.path):
            self.db.execute("COMMIT")
        self.acknowledge()

    def discard(self, ids: list[int]) -> None:
        """Delete records, which are damaged or of no use."""
        with writing(self.path):
            self.db.executemany("DELETE FROM record WHERE id=?", [(id,) for id in ids])
            self.note_last()
        self.acknowledge()

    def sync_when_due(self) -> None:
        """Call `sync` where the last one is some seconds ago."""
        if time.monotonic() - self.synced > SYNC_SECONDS and not self.db.in_transaction:
            self.sync()

    def sync(self) -> None:
        """See that all records are on the disk, under the journal's own name.

        A name that somebody has deleted is given back; FileError where another file has it.
        """
        self.synced = time.monotonic()
        if self.lock is None:
            return
        with writing(self.path):
            self.db.execute("PRAGMA wal_checkpoint(PASSIVE)").fetchall()
            if not (self.is_in_place() and self.lock.is_in_place()):
                self.put_back()

    def is_in_place(self) -> bool:
        """Whether the name still leads to this very database."""
        try:
            return os.path.samestat(os.lstat(self.path), self.stat)
        except OSError:
            return False

    def put_back(self) -> None:
        """Where the name has gone, write the database anew and give it the name; FileError where
        the name is another file's by now: then the copy is left beside it."""
        assert self.lock is not None, "a journal on the disk"
        copy = self.free_file()
        with contextlib.closing(connect(copy)) as db:
            self.db.backup(db)
            db.execute("PRAGMA journal_mode=DELETE")
        try:
            self.lock.close()
            self.lock = Lock(self.lock.path)
            if self.is_in_place():
                copy.unlink()
                return
            self.db.close()
            give_name(copy, self.path)
        except (FileError, FileExistsError) as error:
            raise FileError(
                f"{self.path} was replaced by another file while this run wrote to it: what is "
                f"finished is in {copy}; move the other file away, rename {copy} to it, and "
                "continue with --resume"
            ) from error
        copy.unlink(missing_ok=True)
        self.remove_log()
        self.connect()
        self.acknowledge()

    def remove_log(self) -> None:
        """Delete what SQLite keeps beside a database."""
        for suffix in (WAL_SUFFIX, INDEX_SUFFIX):
            with contextlib.suppress(OSError):
                beside(self.path, suffix).unlink(missing_ok=True)

    def free_file(self) -> Path:
        """Return the path of a new empty file, the first of NAME.1, NAME.2, … to be had."""
        for number in range(1, MOST_COPIES):
            path = beside(self.path, f".{number}")
            with writing(path), contextlib.suppress(FileExistsError):
                os.close(os.open(path, os.O_RDWR | os.O_CREAT | os.O_EXCL, 0o666))
                return path
        raise FileError(f"{self.path}.1 to .{MOST_COPIES - 1} exist: move some of them away")

    def begin_anew(self) -> None:
        """Forget what is in it, where there is nothing that was computed."""
        assert self.is_blank, "a journal with rows in it"
        self.db.execute("DELETE FROM record")

    def put_aside(self) -> Path:
        """Keep the file under another name, which is returned, and start a new one in its place."""
        target = self.rename()
        self.open()
        return target

    def rename(self) -> Path:
        if not self.problem:
            self.fold_log()
        target = self.free_file()
        with writing(self.path):
            for suffix in (WAL_SUFFIX, ""):
                if os.path.lexists(beside(self.path, suffix)):
                    os.replace(beside(self.path, suffix), beside(target, suffix))
            self.remove_log()
            sync_folder(self.path.parent)
        return target

    def fold_log(self) -> bool:
        """Close the database as one plain file; False where its log could not be folded in."""
        try:
            query = "PRAGMA journal_mode=DELETE"
            return self.is_in_place() and self.db.execute(query).fetchone() == ("delete",)
        except sqlite3.Error:
            return False  # a full disk, or somebody who reads just now: the log stays beside it
        finally:
            self.db.close()

    def remove(self) -> None:
        """Delete the file, and no other of its name: what was in it is in the results."""
        self.db.close()
        if self.lock is None:
            return
        if self.is_in_place():
            with contextlib.suppress(OSError):
                self.path.unlink(missing_ok=True)
            self.remove_log()
        self.lock.remove()

    def release(self) -> None:
        """Close the file; none is left that holds nothing computed."""
        if self.lock is None or self.lock.descriptor < 0:
            return
        with contextlib.suppress(sqlite3.Error):
            if self.is_blank:
                self.remove()
                return
        if self.problem or self.fold_log():
            self.lock.remove()
        self.lock.close()


OPEN = os.O_RDWR | getattr(os, "O_NOFOLLOW", 0) | getattr(os, "O_NONBLOCK", 0)


def open_regular(path: Path) -> int:
    """Return a descriptor of the ordinary file at ``path``, which is made if there is none.

    FileError for a link, a pipe or a device; nothing here waits for the other end of a pipe.
    """
    with writing(path):
        if not os.path.lexists(path) or stat.S_ISREG(os.lstat(path).st_mode):
            return os.open(path, OPEN | os.O_CREAT, 0o666)
    raise FileError(f"{path} is not an ordinary file: move it away, or name another output")


class Lock:
    """The lock of a journal, a file beside it that one process at a time has locked; its ``text``
    says how many records were acknowledged.

    A lock holds for an inode, not for a name: a process that waited for it may have a file that
    was deleted since. So whoever gets it compares what is locked with what bears the name.
    """

    WIDTH = 40
    """Bytes of its text."""

    def __init__(self, path: Path) -> None:
        """Lock the file; FileError where another job keeps it."""
        self.path = path
        until = time.monotonic() + LOCK_SECONDS
        while True:
            self.descriptor = open_regular(path)
            with writing(path):
                locked = lock(self.descriptor)
            if locked is not False and self.is_in_place():
                break
            self.close()
            if time.monotonic() > until:
                raise FileError(
                    f"{path.with_suffix('')} is being written by another job: wait for it, or name "
                    "another output"
                )
            if locked is False:
                time.sleep(POLL_SECONDS)
        self.is_locked = bool(locked)
        with writing(path):
            sync_folder(path.parent)

    @property
    def text(self) -> str:
        return os.pread(self.descriptor, self.WIDTH, 0).decode("ascii", "replace")

    @text.setter
    def text(self, words: str) -> None:
        with contextlib.suppress(OSError):  # as on a full disk: it is no more than a check
            os.pwrite(self.descriptor, words.ljust(self.WIDTH).encode(), 0)

    def is_in_place(self) -> bool:
        """Whether the name still leads to this very file."""
        return names(self.path, self.descriptor)

    def remove(self) -> None:
        """Delete the file, if the name is still this file's, and let go of it."""
        with contextlib.suppress(OSError):
            if self.is_in_place():
                os.unlink(self.path)
        self.close()

    def close(self) -> None:
        """Let go of the lock."""
        if self.descriptor >= 0:
            with contextlib.suppress(OSError):
                os.close(self.descriptor)
        self.descriptor = -1

"""The journal of an unfinished study: an SQLite database beside the results, STUDY.h5.journal.

Three tables: sessions (how each run was started), rows (of finished replicates) and parts (what is
saved of unfinished ones). SQLite has no checksums of its pages, so every record carries one.

One process writes, rank 0's, and any number may read meanwhile (SQLite's write-ahead log, WAL).
SQLite's own lock lasts for one transaction only; so the writer locks a second file, NAME.lock, as
long as it has the journal open. The same file says how many records were acknowledged, by which
the loss of a -wal file is recognised.
"""

import contextlib
import json
import os
import sqlite3
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from flocsim.errors import FileError
from flocsim.io.files import lock, names, ordinary_target, set_aside, sync_folder, unwritable
from flocsim.io.seals import digest_of

SUFFIX = ".journal"
LOCK_SUFFIX, WAL_SUFFIX, INDEX_SUFFIX = ".lock", "-wal", "-shm"

SESSION, ROWS, PART = "session", "rows", "part"
"""The tables. ``identity`` is a digest of what the rows follow from, ``session`` the id of the run
that computed them, NULL for copies of rows of an older results file; ``condition`` is JSON."""

SCHEMA = (
    "CREATE TABLE session(id INTEGER PRIMARY KEY, about TEXT, digest BLOB)",
    "CREATE TABLE rows(id INTEGER PRIMARY KEY, identity TEXT, session INTEGER, condition TEXT, "
    "first INTEGER, count INTEGER, notes TEXT, data BLOB, digest BLOB)",
    "CREATE INDEX place ON rows(condition, first)",
    "CREATE TABLE part(id INTEGER PRIMARY KEY, identity TEXT, session INTEGER, condition TEXT, "
    "first INTEGER, name TEXT, about TEXT, data BLOB, digest BLOB, UNIQUE(condition, first, name))",
)

LAST = (
    "SELECT coalesce(max(last), 0) FROM (SELECT max(id) AS last FROM session "
    "UNION SELECT max(id) FROM rows UNION SELECT max(id) FROM part)"
)
"""The id of the last record: all tables count on together."""

SYNC_SECONDS = 5.0
"""Time between two syncs to the disk [s]: what a power cut may cost. A kill costs nothing."""

LOCK_SECONDS = 10.0
"""Time to wait for a job that is just ending, or for SQLite's own locks [s]."""

POLL_SECONDS = 0.05
"""Time between two attempts to get the lock [s]."""


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
    """Return the name of a file that belongs to a journal."""
    return path.with_name(path.name + suffix)


def as_text(value: Any) -> str:
    """Return a value as JSON; what is no letter becomes a question mark."""
    return json.dumps(value, ensure_ascii=False).encode("utf-8", "replace").decode()


def digest_over(values: tuple) -> bytes:
    """Return the checksum of a record."""
    return digest_of(b"\0".join(v if isinstance(v, bytes) else f"{v}".encode() for v in values), 16)


def connect(database: str) -> sqlite3.Connection:
    """Open a database; whoever calls this lets one thread at a time use it."""
    db = sqlite3.connect(
        database, uri=True, timeout=LOCK_SECONDS, isolation_level=None, check_same_thread=False
    )
    db.row_factory = sqlite3.Row
    db.text_factory = lambda text: text.decode("utf-8", "replace")  # of a damaged record
    # The file may be anyone's: no code in its schema is run, and damaged pages are noticed.
    db.execute("PRAGMA trusted_schema=OFF")
    db.execute("PRAGMA cell_size_check=ON")
    return db


def has_tables(db: sqlite3.Connection) -> bool:
    """Return True if a database has the tables of a journal, False if it is empty."""
    found = db.execute("SELECT sql FROM sqlite_master WHERE sql NOT NULL ORDER BY rowid").fetchall()
    if found and [sql for (sql,) in found] != list(SCHEMA):
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
    """The records of an open journal; ``damaged`` counts those that were met and cannot be read."""

    def __init__(self, path: Path, db: sqlite3.Connection) -> None:
        self.path, self.db, self.damaged = path, db, set[tuple[str, int]]()

    def records(self, table: str, where: str = "1", *values: Any) -> Iterator[sqlite3.Row]:
        """Yield the intact records of a table in the order of writing, and note the others."""
        try:
            for row in self.db.execute(f"SELECT * FROM {table} WHERE {where} ORDER BY id", values):
                id, *rest, digest = row
                if digest == digest_over(tuple(rest)):
                    yield row
                else:
                    self.damaged.add((table, id))
        except sqlite3.DatabaseError as error:
            raise FileError(f"{self.path} {DAMAGED} ({error})") from error


DAMAGED = "is damaged, or no journal of flocsim: --restart keeps it under another name"


@contextlib.contextmanager
def read_journal(path: Path) -> Iterator[JournalReader]:
    """Open a journal for reading, also while a run writes it; FileError if that is impossible."""
    # Without a log nothing is locked, and none is made: the folder may be read-only.
    options = "mode=ro" if beside(path, WAL_SUFFIX).exists() else "immutable=1"
    with contextlib.ExitStack() as opened:
        try:
            db = connect(f"{path.absolute().as_uri()}?{options}")
            opened.enter_context(contextlib.closing(db))
            db.execute("BEGIN")  # all that follows sees one state of a journal that grows
            is_begun = has_tables(db)
        except (OSError, sqlite3.Error) as error:
            raise FileError(f"{path} could not be read: {error}") from error
        if not is_begun:
            raise FileError(f"{path} has only just begun: try again")
        yield JournalReader(path, db)


class Journal(JournalReader):
    """A journal that this process alone writes.

    ``is_damaged`` says that a file that is there is no journal, or not whole: it can only be put
    aside. ``lost`` is how many records were acknowledged and are not there.
    """

    lost, last, synced, is_damaged = 0, 0, 0.0, False

    def __init__(self, path: Path) -> None:
        """Open and lock the journal at ``path``, or start one; FileError if impossible."""
        self.path = ordinary_target(path)
        self.lock = Lock(beside(self.path, LOCK_SUFFIX))
        try:
            with writing(self.path):
                self.open()
        except FileError:
            self.lock.close()
            raise

    def open(self) -> None:
        """Open the database, and see that it is whole."""
        # Without locks SQLite has no log that others could read meanwhile.
        options = "" if self.lock.is_locked or os.name == "nt" else "?vfs=unix-none"
        db = sqlite3.connect(":memory:")
        try:
            db = connect(f"{self.path.absolute().as_uri()}{options}")
            if not has_tables(db):
                db.execute("PRAGMA journal_mode=WAL")
                db.executescript(f"BEGIN; {'; '.join(SCHEMA)}; COMMIT;")
            # A commit is safe from a kill at once, and from a power cut with the next sync.
            db.execute("PRAGMA synchronous=NORMAL")
            # Records have checksums of their own; this is about the pages between them.
            whole = db.execute("PRAGMA integrity_check(1)").fetchone()[0]
            self.is_damaged = whole != "ok"
        except sqlite3.OperationalError:
            raise
        except sqlite3.DatabaseError:
            self.is_damaged = True
        super().__init__(self.path, db)
        self.stat, self.synced = os.stat(self.path), time.monotonic()
        if not self.is_damaged:
            (self.last,) = self.db.execute(LAST).fetchone()
            self.lost = max(self.lock.count - self.last, 0)

    @property
    def is_blank(self) -> bool:
        """Return True if nothing in it was computed."""
        computed = "SELECT id FROM rows WHERE session NOT NULL UNION SELECT id FROM part LIMIT 1"
        return not self.is_damaged and self.db.execute(computed).fetchone() is None

    def add(self, table: str, *values: Any) -> int:
        """Append a record, in the place of one with the same key; its id. FileError where that
        fails, and then the journal is what it was before."""
        row = (self.last + 1, *values, digest_over(values))
        with writing(self.path):
            marks = ", ".join("?" * len(row))
            self.db.execute(f"INSERT OR REPLACE INTO {table} VALUES ({marks})", row)
        self.last += 1
        if not self.db.in_transaction:
            self.acknowledge()
            self.sync_when_due()
        return self.last

    def acknowledge(self) -> None:
        """Write down how many records there are, outside the database."""
        self.lock.count = self.last

    @contextlib.contextmanager
    def together(self) -> Iterator[None]:
        """Change many records at once, all or none."""
        with writing(self.path):
            self.db.execute("BEGIN")
        try:
            yield
        except BaseException:
            self.db.execute("ROLLBACK")
            raise
        with writing(self.path):
            self.db.execute("COMMIT")
        self.acknowledge()

    def discard(self, table: str, where: str, *values: Any) -> None:
        """Delete records, which are damaged or of no use."""
        with writing(self.path):
            self.db.execute(f"DELETE FROM {table} WHERE {where}", values)

    def sync_when_due(self) -> None:
        """Call `sync` where the last one is some seconds ago."""
        if time.monotonic() - self.synced > SYNC_SECONDS:
            self.sync()

    def sync(self) -> None:
        """See that all records are on the disk."""
        self.synced = time.monotonic()
        with writing(self.path):
            self.db.execute("PRAGMA wal_checkpoint(PASSIVE)").fetchall()

    def put_aside(self) -> Path:
        """Keep the file under another name, which is returned, and start a new one in its place."""
        self.db.close()
        target = set_aside(self.path)
        assert target is not None, "it was opened"
        if (log := beside(self.path, WAL_SUFFIX)).exists():
            os.replace(log, beside(target, WAL_SUFFIX))
        self.is_damaged, self.last = False, 0
        self.acknowledge()
        with writing(self.path):
            self.open()
        return target

    def remove(self) -> None:
        """Delete the file, and no other of its name: what was in it is in the results."""
        self.db.close()
        with contextlib.suppress(OSError):
            if os.path.samestat(os.lstat(self.path), self.stat):
                for suffix in ("", WAL_SUFFIX, INDEX_SUFFIX):
                    beside(self.path, suffix).unlink(missing_ok=True)
        self.lock.remove()

    def release(self) -> None:
        """Close the file; none is left that holds nothing computed."""
        if self.lock.descriptor < 0:
            return
        with contextlib.suppress(sqlite3.Error):
            if self.is_blank:
                self.remove()
                return
            self.db.close()  # which folds the log in, if nobody reads just now
        if not beside(self.path, WAL_SUFFIX).exists():
            self.lock.remove()
        self.lock.close()


class Lock:
    """The lock of a journal, a file beside it that one process at a time has locked; its text is
    how many records were acknowledged.

    A lock holds for an inode, not for a name: a process that waited for it may have a file that
    was deleted since. So whoever gets it compares what is locked with what bears the name.
    """

    WIDTH = 20
    """Bytes of its text."""

    def __init__(self, path: Path) -> None:
        """Lock the file; FileError where another job keeps it."""
        self.path = path
        until = time.monotonic() + LOCK_SECONDS
        while True:
            with writing(path):
                self.descriptor = os.open(path, os.O_RDWR | os.O_CREAT, 0o666)
                locked = lock(self.descriptor)
            if locked is not False and names(path, self.descriptor):
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
    def count(self) -> int:
        text = os.pread(self.descriptor, self.WIDTH, 0).strip()
        return int(text) if text.isdigit() else 0

    @count.setter
    def count(self, number: int) -> None:
        with contextlib.suppress(OSError):  # as on a full disk: it is no more than a check
            os.pwrite(self.descriptor, str(number).ljust(self.WIDTH).encode(), 0)

    def remove(self) -> None:
        """Delete the file, if the name is still this file's, and let go of it."""
        with contextlib.suppress(OSError):
            if names(self.path, self.descriptor):
                os.unlink(self.path)
        self.close()

    def close(self) -> None:
        """Let go of the lock."""
        if self.descriptor >= 0:
            with contextlib.suppress(OSError):
                os.close(self.descriptor)
        self.descriptor = -1

"""Journals for tests: what one has, and how one is changed."""

import contextlib

from flocsim.errors import FileError
from flocsim.io.journal import (
    INDEX_SUFFIX,
    LOCK_SUFFIX,
    PART,
    ROWS,
    WAL_SUFFIX,
    connect,
    digest_over,
    read_journal,
)


def records_in(path, table=ROWS):
    """The records of a journal's table, also of one that is being written; none where it just
    begins."""
    try:
        with read_journal(path) as journal:
            return [dict(record) for record in journal.records(table)]
    except FileError:
        return []


def computed_in(path):
    """The records of rows that a journal's runs have computed."""
    return [each for each in records_in(path) if each["session"] is not None]


def rows_in(path):
    """How many rows a journal's runs have computed."""
    return sum(each["count"] for each in computed_in(path))


def has_begun(path):
    """Return True once something was computed for a journal."""
    # A swarm is shown from its first snapshot on, which follows its bodies.
    return path.exists() and bool(computed_in(path) or len(records_in(path, PART)) > 1)


def change(path, table, id, **values):
    """Change columns of a record of a journal that nobody writes, its checksum right."""
    with contextlib.closing(connect(str(path))) as db:
        record = dict(db.execute(f"SELECT * FROM {table} WHERE id=?", (id,)).fetchone()) | values
        record["digest"] = digest_over(tuple(record.values())[1:-1])
        marks = ", ".join("?" * len(record))
        db.execute(f"INSERT OR REPLACE INTO {table} VALUES ({marks})", tuple(record.values()))


def remove(path):
    """Delete a journal and what lies beside it."""
    for suffix in ("", WAL_SUFFIX, INDEX_SUFFIX, LOCK_SUFFIX):
        path.with_name(path.name + suffix).unlink(missing_ok=True)


def leave(journal):
    """Let go of a journal as a kill does: all of its files stay as they are."""
    files = list(journal.path.parent.glob(f"{journal.path.name}*"))
    contents = {each: each.read_bytes() for each in files}
    journal.db.close()
    for each, content in contents.items():
        each.write_bytes(content)
    journal.lock.close()

"""Journals for tests: what one has, and one made of any records."""

from flocsim.ensembles.kind import ROW
from flocsim.errors import FileError
from flocsim.io.journal import (
    CHUNK,
    INDEX_SUFFIX,
    LOCK_SUFFIX,
    PART,
    WAL_SUFFIX,
    connect,
    digest_over,
    make_tables,
    read_journal,
)


def records_in(path):
    """The records of a journal, also of one that is being written; none where it just begins."""
    try:
        with read_journal(path) as journal:
            return list(journal.records())
    except FileError:
        return []


def has_begun(path):
    """Return True once something was computed for a journal."""
    return path.exists() and any(each.kind in (CHUNK, PART) for each in records_in(path))


def rows_in(path, row=ROW):
    """How many rows a journal's runs have computed."""
    found = [each for each in records_in(path) if each.kind == CHUNK]
    return sum(len(each.data) // row.itemsize for each in found)


def write_records(path, parts):
    """Write a journal of records (kind, condition, first, about as bytes, data), their checksums
    right."""
    remove(path)
    db = connect(path)
    make_tables(db)
    db.execute("BEGIN")
    for part in parts:
        row = *part, digest_over(*part)
        db.execute("INSERT INTO record VALUES (NULL, ?, ?, ?, ?, ?, ?)", row)
    db.execute("COMMIT")
    db.close()
    return path


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

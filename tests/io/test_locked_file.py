"""A file that one job alone writes: no link, no pipe, no other file of the same name."""

import errno
import os

import pytest

from flocsim.errors import FileError
from flocsim.io import journal as module
from flocsim.io.journal import LockedFile


@pytest.fixture
def path(tmp_path):
    """Where the file is."""
    return tmp_path / "r.h5.journal"


def test_one_process_has_it(path, monkeypatch):
    monkeypatch.setattr(module, "LOCK_SECONDS", 0.1)
    first = LockedFile(path)
    with pytest.raises(FileError, match="is being written by another job"):
        LockedFile(path)
    first.close()
    LockedFile(path).unlink()
    assert list(path.parent.iterdir()) == []


@pytest.mark.parametrize("kind", ["pipe", "link", "dangling link", "folder", "device"])
def test_what_is_no_ordinary_file_is_refused_at_once_and_left_alone(path, kind):
    precious = path.with_name("precious")
    precious.write_text("mine")
    makers = {
        "pipe": lambda: os.mkfifo(path),
        "link": lambda: path.symlink_to(precious),
        "dangling link": lambda: path.symlink_to("elsewhere"),
        "folder": lambda: path.mkdir(),
        "device": lambda: path.symlink_to("/dev/zero"),
    }
    makers[kind]()
    with pytest.raises(FileError, match="is not an ordinary file"):
        LockedFile(path)
    assert precious.read_text() == "mine"
    assert not path.with_name("elsewhere").exists()


def test_a_link_that_comes_between_the_look_and_the_open_is_not_followed(path, monkeypatch):
    path.symlink_to(path.with_name("precious"))
    monkeypatch.setattr(module, "is_regular", lambda path: True)
    with pytest.raises(FileError, match="could not be written"):
        LockedFile(path)
    assert not path.with_name("precious").exists()


def test_a_pipe_that_comes_between_the_look_and_the_open_does_not_stall(path, monkeypatch):
    os.mkfifo(path)
    monkeypatch.setattr(module, "is_regular", lambda path: True)
    with pytest.raises(FileError, match="is not an ordinary file"):
        LockedFile(path)


def test_who_waited_gets_the_file_of_that_name_and_not_the_deleted_one(path, monkeypatch):
    first = LockedFile(path)
    others = []

    def turns(descriptor, original=module.lock):
        """Whoever waits has opened the file when its name is taken away and given to another."""
        if not others:
            first.unlink()
            others.append(None)
            others[0] = LockedFile(path)  # a third job is faster
            first.close()
        elif others[0] is not None and others[0].descriptor >= 0:
            locked = original(descriptor)
            assert locked is False  # the lock on what was deleted was worth nothing
            others[0].close()
            return locked
        return original(descriptor)

    monkeypatch.setattr(module, "lock", turns)
    got = LockedFile(path)
    assert others[0].descriptor < 0 and got.is_in_place()
    got.close()


def test_the_lock_of_a_file_that_was_replaced_before_it_was_got_is_not_believed(path, monkeypatch):
    path.write_text("old")

    def lock(descriptor, original=module.lock):
        if path.read_text() == "old":  # between opening and locking another job ends
            path.unlink()
            path.write_text("new")
        return original(descriptor)

    monkeypatch.setattr(module, "lock", lock)
    file = LockedFile(path)
    assert os.pread(file.descriptor, 10, 0) == b"new"
    file.close()


def test_only_ones_own_file_is_deleted(path):
    file = LockedFile(path)
    path.unlink()
    path.write_text("of another job")
    file.unlink()
    assert path.read_text() == "of another job"
    with pytest.raises(FileError, match="was replaced"):
        file.put_aside()
    file.close()
    file.unlink()  # a closed one deletes nothing
    file.close()
    assert path.read_text() == "of another job"


def test_a_file_put_aside_writes_over_none(path):
    path.with_name("r.h5.journal.1").write_text("older")
    path.write_text("old")
    file = LockedFile(path)
    assert file.put_aside() == path.with_name("r.h5.journal.2")
    file.close()
    assert path.with_name("r.h5.journal.1").read_text() == "older"
    assert path.with_name("r.h5.journal.2").read_text() == "old"
    assert not path.exists()


@pytest.mark.parametrize("links", [True, False])
def test_a_name_that_has_gone_is_given_back(path, monkeypatch, links):
    if not links:
        monkeypatch.setattr(os, "link", lambda *names: refuse(errno.EPERM))
    path.write_text("rows")
    file = LockedFile(path)
    path.unlink()
    file.put_back()
    assert path.read_text() == "rows"
    assert file.is_in_place()
    monkeypatch.setattr(module, "LOCK_SECONDS", 0.1)
    with pytest.raises(FileError, match="another job"):
        LockedFile(path)
    file.close()
    assert [each.name for each in path.parent.iterdir()] == [path.name]


@pytest.mark.parametrize("links", [True, False])
def test_a_name_that_another_has_taken_is_left_to_it(path, monkeypatch, links):
    if not links:
        monkeypatch.setattr(os, "link", lambda *names: refuse(errno.EPERM))
    path.write_text("rows")
    file = LockedFile(path)
    path.unlink()
    path.write_text("of another job")
    with pytest.raises(FileError, match=r"what is finished is in .*r.h5.journal.1"):
        file.put_back()
    file.close()
    assert path.read_text() == "of another job"
    assert path.with_name("r.h5.journal.1").read_text() == "rows"


def refuse(number):
    """Raise the OSError of a number."""
    raise OSError(number, os.strerror(number))


@pytest.mark.parametrize("number", [errno.ENOLCK, errno.EOPNOTSUPP, errno.ENOSYS])
def test_a_file_system_without_locks_is_known(path, monkeypatch, number):
    import fcntl

    monkeypatch.setattr(fcntl, "flock", lambda *words: refuse(number))
    file = LockedFile(path)
    assert not file.has_lock
    file.close()


def test_a_lock_that_fails_otherwise_is_told(path, monkeypatch):
    import fcntl

    monkeypatch.setattr(fcntl, "flock", lambda *words: refuse(errno.EIO))
    with pytest.raises(FileError, match="could not be written"):
        LockedFile(path)

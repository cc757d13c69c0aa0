"""Files are placed whole, under a name that is free or that may be given to them, or not at all."""

import errno
import os
import threading

import pytest

from flocsim.errors import FileError
from flocsim.io import files
from flocsim.io.files import (
    check_writable,
    fresh_beside,
    ordinary_target,
    set_aside,
    unfinished,
    write_file,
)
from flocsim.io.seals import held

needs_fcntl = pytest.mark.skipif(os.name == "nt", reason="needs POSIX")


def content(folder):
    """{name: bytes} of the files in a folder."""
    return {path.name: path.read_bytes() for path in folder.iterdir()}


def test_a_new_file_is_all_that_is_there(tmp_path):
    write_file(tmp_path / "a.txt", b"new")
    assert content(tmp_path) == {"a.txt": b"new"}
    (tmp_path / "usual").touch()
    assert os.stat(tmp_path / "a.txt").st_mode == os.stat(tmp_path / "usual").st_mode


def test_a_file_that_exists_is_kept_unless_a_rule_says_otherwise(tmp_path):
    (tmp_path / "a.h5").write_bytes(b"old")
    with pytest.raises(FileError, match=r"a\.h5 already exists and is left as it is"):
        write_file(tmp_path / "a.h5", b"new")
    assert content(tmp_path) == {"a.h5": b"old"}
    write_file(tmp_path / "a.h5", b"second", True)
    write_file(tmp_path / "a.h5", b"third", True)
    assert content(tmp_path) == {"a.h5": b"third", "a.1.h5": b"old", "a.2.h5": b"second"}
    write_file(tmp_path / "a.h5", b"fourth", held(tmp_path / "a.h5"))
    assert content(tmp_path) == {"a.h5": b"fourth", "a.1.h5": b"old", "a.2.h5": b"second"}


def test_what_appears_while_a_file_is_written_is_kept_and_so_is_the_work(tmp_path):
    said = r"a\.h5 has meanwhile been written.* computed is in .*a\.2\.h5"
    with pytest.raises(FileError, match=said), unfinished(tmp_path / "a.h5") as file:
        file.write(b"work")
        (tmp_path / "a.h5").write_bytes(b"other")
        (tmp_path / "a.1.h5").write_bytes(b"older")
    assert content(tmp_path) == {"a.h5": b"other", "a.1.h5": b"older", "a.2.h5": b"work"}


def test_work_is_kept_where_the_old_file_cannot_be_moved(tmp_path, monkeypatch):
    (tmp_path / "a.h5").write_bytes(b"old")

    def refuse(path):
        raise FileError("Operation not permitted")

    monkeypatch.setattr(files, "set_aside", refuse)
    with pytest.raises(FileError, match=r"could not be replaced.*computed is in .*a\.1\.h5"):
        write_file(tmp_path / "a.h5", b"new", True)
    assert content(tmp_path) == {"a.h5": b"old", "a.1.h5": b"new"}


def test_without_hard_links_nothing_is_replaced_either(tmp_path, monkeypatch):
    def no_links(*_, **__):
        raise OSError(errno.EPERM, "Operation not permitted")

    monkeypatch.setattr(files.os, "link", no_links)
    write_file(tmp_path / "a.h5", b"new")
    assert content(tmp_path) == {"a.h5": b"new"}
    said = r"computed is in .*b\.1\.h5"
    with pytest.raises(FileError, match=said), unfinished(tmp_path / "b.h5") as file:
        file.write(b"work")
        (tmp_path / "b.h5").write_bytes(b"other")
    assert content(tmp_path) == {"a.h5": b"new", "b.h5": b"other", "b.1.h5": b"work"}


def test_many_at_once_lose_none(tmp_path):
    """Whoever sets aside what whom has just written: every content is there in the end."""
    texts = [f"{number}".encode() for number in range(24)]
    threads = [
        threading.Thread(target=write_file, args=(tmp_path / "a.h5", text, True)) for text in texts
    ]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert sorted(content(tmp_path).values()) == sorted(texts)


def test_setting_aside_what_has_gone_is_no_error(tmp_path):
    assert set_aside(tmp_path / "a.h5") is None
    assert content(tmp_path) == {}


def test_what_a_killed_job_left_is_removed_after_a_day_and_what_is_written_is_not(tmp_path):
    old, new, other = (fresh_beside(tmp_path / name) for name in ("a.h5", "a.h5", "b.h5"))
    for path in (old, new, other):
        path.write_bytes(b"half")
    for path in (old, other):
        os.utime(path, (0.0, 0.0))
    write_file(tmp_path / "a.h5", b"whole")
    assert content(tmp_path) == {"a.h5": b"whole", new.name: b"half", other.name: b"half"}


def test_long_names_are_written_or_refused_at_once(tmp_path):
    most = os.pathconf(tmp_path, "PC_NAME_MAX") if hasattr(os, "pathconf") else 255
    write_file(tmp_path / ("m" * most), b"the temporary name is short")
    with pytest.raises(FileError, match="name too long"):
        check_writable(tmp_path / ("n" * (most + 1)))
    assert content(tmp_path).keys() == {"m" * most}


@needs_fcntl
@pytest.mark.parametrize(
    "kind", ["folder", "pipe", "to_folder", "to_pipe", "loop", "null", "stdout"]
)
def test_only_ordinary_files_are_written_to(tmp_path, kind):
    (tmp_path / "folder").mkdir()
    os.mkfifo(tmp_path / "pipe")
    (tmp_path / "to_folder").symlink_to(tmp_path / "folder")
    (tmp_path / "to_pipe").symlink_to(tmp_path / "pipe")
    (tmp_path / "loop").symlink_to(tmp_path / "loop")
    (tmp_path / "null").symlink_to(os.devnull)
    ends = os.pipe()
    (tmp_path / "stdout").symlink_to(f"/proc/self/fd/{ends[1]}")
    before = sorted(os.listdir(tmp_path))
    for call in (check_writable, lambda path: write_file(path, b"new", True), set_aside):
        with pytest.raises(FileError, match=rf"{kind}\b.*(not an ordinary|many levels)"):
            call(tmp_path / kind)
    assert sorted(os.listdir(tmp_path)) == before
    for end in ends:
        os.close(end)


@needs_fcntl
def test_links_are_written_through(tmp_path):
    (tmp_path / "there").mkdir()
    for name in ("old.h5", "new.h5"):
        (tmp_path / name).symlink_to(tmp_path / "there" / name)
    (tmp_path / "there/old.h5").write_bytes(b"old")
    assert ordinary_target(tmp_path / "new.h5") == tmp_path / "there/new.h5"
    write_file(tmp_path / "new.h5", b"new")
    write_file(tmp_path / "old.h5", b"newer", True)
    assert (tmp_path / "new.h5").is_symlink() and (tmp_path / "old.h5").is_symlink()
    found = content(tmp_path / "there")
    assert found == {"new.h5": b"new", "old.h5": b"newer", "old.1.h5": b"old"}


def test_a_full_disk_leaves_the_old_file_and_nothing_else(tmp_path):
    (tmp_path / "a.h5").write_bytes(b"old")
    with (
        pytest.raises(FileError, match=r"a\.h5 could not be written: No space left"),
        unfinished(tmp_path / "a.h5", True) as file,
    ):
        file.write(b"half")
        raise OSError(errno.ENOSPC, "No space left on device")
    assert content(tmp_path) == {"a.h5": b"old"}


@needs_fcntl
def test_a_folder_that_cannot_be_listed_can_still_be_written_to(tmp_path, monkeypatch):
    original = os.open

    def unreadable(path, flags, *more, **kwargs):
        if os.path.isdir(path):
            raise PermissionError(errno.EACCES, "Permission denied")
        return original(path, flags, *more, **kwargs)

    monkeypatch.setattr(files.os, "open", unreadable)
    write_file(tmp_path / "a.h5", b"new")
    assert (tmp_path / "a.h5").read_bytes() == b"new"

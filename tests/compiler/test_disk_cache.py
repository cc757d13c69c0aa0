"""Compiled code on disk: taken only where it is whole and nobody else can have put it there."""

import contextlib
import os
import pickle
import resource
import stat
import subprocess
import sys
import threading
from pathlib import Path

import pytest

from flocsim.compiler import composer
from flocsim.compiler.composer import compose
from flocsim.compiler.disk_cache import file_name, read, write
from tests.helpers.waiting import PATIENCE

ROOT = hasattr(os, "getuid") and os.getuid() == 0
only_root = pytest.mark.skipif(not ROOT, reason="gives files to other users")
NOBODY = 65534


@pytest.fixture
def folder(in_tmp, own_cache):
    """The cache folder, which is made when it is first needed."""
    return own_cache


def only_file(folder):
    [path] = folder.iterdir()
    return path


def doubled(x):
    return 2.0 * x


def entry(x):
    return doubled(x) + 1.0


def answer():
    """What a new process would compute: nothing compiled is at hand but on disk."""
    composer._composed.clear()
    return compose(entry, {})(3.0)


def test_what_was_written_is_read_by_its_name_and_key_only(folder):
    write("law", "key", b"code")
    assert read("law", "key") == b"code"
    assert read("law", "other") is None
    assert read("other", "key") is None
    assert stat.S_IMODE(only_file(folder).stat().st_mode) & 0o022 == 0


def test_no_flipped_bit_and_no_lost_end_is_believed(folder):
    write("law", "key", b"code of some length")
    path = only_file(folder)
    whole = path.read_bytes()
    for place in range(len(whole)):
        changed = bytearray(whole)
        changed[place] ^= 1 << place % 8
        path.write_bytes(changed)
        assert read("law", "key") is None
        path.write_bytes(whole[:place])
        assert read("law", "key") is None
    path.write_bytes(whole + b"\0")
    assert read("law", "key") is None
    write("law", "key", b"code of some length")
    assert path.read_bytes() == whole


class Planted:
    """A pickle that makes a folder."""

    def __reduce__(self):
        return os.mkdir, ("ran",)


DAMAGES = {
    "empty": lambda data: b"",
    "cut short": lambda data: data[: len(data) // 2],
    "a flipped bit": lambda data: data[:-50] + bytes([data[-50] ^ 1]) + data[-49:],
    "a planted pickle": lambda data: pickle.dumps(Planted()),
}


@pytest.mark.parametrize("damage", DAMAGES)
def test_damaged_code_is_compiled_anew_and_replaced(folder, damage):
    assert answer() == 7.0
    path = only_file(folder)
    path.write_bytes(DAMAGES[damage](path.read_bytes()))
    assert answer() == 7.0
    assert only_file(folder) == path
    before = path.stat().st_mtime_ns
    assert answer() == 7.0
    assert path.stat().st_mtime_ns == before
    assert not Path("ran").exists()


@only_root
def test_what_belongs_to_others_is_refused(folder):
    write("law", "key", b"code")
    path = only_file(folder)
    os.chown(path, NOBODY, NOBODY)
    assert read("law", "key") is None
    write("law", "key", b"code")
    assert path.stat().st_uid == 0


def test_a_file_that_others_can_write_and_a_link_are_replaced(folder, tmp_path):
    write("law", "key", b"code")
    path = only_file(folder)
    path.chmod(0o666)
    assert read("law", "key") is None
    write("law", "key", b"code")
    assert read("law", "key") == b"code"
    path.rename(tmp_path / "elsewhere")
    path.symlink_to(tmp_path / "elsewhere")
    assert read("law", "key") is None
    before = (tmp_path / "elsewhere").read_bytes()
    write("law", "key", b"new code")
    assert read("law", "key") == b"new code" and not path.is_symlink()
    assert (tmp_path / "elsewhere").read_bytes() == before


@contextlib.contextmanager
def full_disk(folder):
    """As one is that has 64 bytes left for each file."""
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (64, before[1]))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)


def file_in_the_way(folder):
    # It stops even the superuser, whom no permission bits would.
    folder.write_text("")
    return contextlib.nullcontext()


def name_that_is_too_long(folder):
    os.environ["FLOCSIM_CACHE"] = str(folder / ("x" * 300))
    return contextlib.nullcontext()


@pytest.mark.parametrize("trouble", [full_disk, file_in_the_way, name_that_is_too_long])
def test_a_folder_that_cannot_be_written_is_one_line_and_costs_no_result(folder, trouble):
    with (
        trouble(folder),
        pytest.warns(UserWarning, match=f"compiled code is not stored: .* {folder}") as caught,
    ):
        assert answer() == 7.0
    assert len(caught) == 1
    assert not list(folder.glob(".*"))  # nothing half written is left


def test_many_writers_at_once_leave_one_whole_file(folder):
    data = os.urandom(200_000)
    threads = [threading.Thread(target=write, args=("law", "key", data)) for _ in range(8)]
    for each in threads:
        each.start()
    for each in threads:
        each.join()
    assert read("law", "key") == data
    assert only_file(folder).name == file_name("law", "key")


RUN = """\
from flocsim.compiler.composer import compose
from flocsim.compiler import units
units.quiet = True

def inner(x):
    return 3.0 * x

def entry(x):
    return inner(x) + 1.0

print(compose(entry, {})(2.0))
"""


def test_another_process_finds_the_code_and_a_damaged_one_is_no_trouble(folder, tmp_path):
    script = tmp_path / "script.py"
    script.write_text(RUN)

    def run():
        done = subprocess.run(
            [sys.executable, script], capture_output=True, text=True, timeout=PATIENCE
        )
        assert (done.returncode, done.stdout, done.stderr) == (0, "7.0\n", "")

    run()
    path = only_file(folder)
    before = path.stat().st_mtime_ns
    run()
    assert path.stat().st_mtime_ns == before
    path.write_bytes(path.read_bytes()[:-1000])
    run()
    assert path.stat().st_mtime_ns != before

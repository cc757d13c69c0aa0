"""Hostile files of every kind are read or refused in one line."""

import os
import random
import sys
import traceback
from pathlib import Path

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from flocsim.__main__ import main
from tests.helpers import hostile_files
from tests.helpers.hostile_readers import KINDS, made, outcome, reader
from tests.helpers.tiers import rest_slow

EXAMPLES = settings().max_examples // 2


@pytest.fixture(scope="module")
def readers(tmp_path_factory):
    """{kind: (folder, maker, reader)}."""
    found = {}
    for kind in KINDS:
        folder = tmp_path_factory.mktemp(kind)
        found[kind] = (folder, *reader(kind, folder))
    return found


@pytest.mark.parametrize("kind", KINDS)
def test_any_file_is_read_or_refused_in_one_line(readers, kind):
    folder, make, read = readers[kind]

    @settings(
        max_examples=EXAMPLES, deadline=None, database=None,
        suppress_health_check=list(HealthCheck),
    )  # fmt: skip
    @given(st.integers(0, 10**6))
    def throw(number):
        what, why = outcome(read, made(make, kind, number, folder))
        assert what in ("read", "refused"), why

    throw()


@pytest.mark.parametrize("files", rest_slow([15, 60], lambda files: files == 15))
@pytest.mark.parametrize("kind", KINDS)
def test_some_are_read_and_some_are_refused(readers, kind, files):
    """Else the files would be so wrong, or so right, that they test nothing."""
    folder, make, read = readers[kind]
    ends = {
        outcome(read, made(make, kind, number, folder))[0]
        for number in random.Random(kind).sample(range(10**6), files)
    }
    assert ends <= {"read", "refused"}
    assert "refused" in ends


def run_forked(argv, folder):
    """(exit code, lines of both streams, CPU seconds, peak bytes) of a command in a fork."""
    out = folder / "out.txt"
    child = os.fork()
    if child == 0:
        with open(out, "wb") as file:
            os.dup2(file.fileno(), 1)
            os.dup2(file.fileno(), 2)
        sys.stdout, sys.stderr = (os.fdopen(number, "w") for number in (1, 2))
        code = 99
        try:
            code = main(argv)
        except SystemExit as end:
            code = end.code
        except BaseException:
            traceback.print_exc()
        sys.stdout.flush()
        sys.stderr.flush()
        os._exit(code)
    _, status, used = os.wait4(child, 0)
    lines = out.read_text("utf-8", "replace").splitlines()
    return (
        os.waitstatus_to_exitcode(status), lines, used.ru_utime + used.ru_stime,
        1024 * used.ru_maxrss,
    )  # fmt: skip


@pytest.mark.skipif(not hasattr(os, "fork"), reason="needs processes that fork")
@pytest.mark.parametrize("files", rest_slow([8, 150], lambda files: files == 8))
@pytest.mark.parametrize("kind", ["pictures", "masks"])
def test_fit_ends_with_plain_lines_and_little_work(tmp_path, capfd, kind, files):
    make, _ = reader(kind, tmp_path)
    options = ["--vertices", "4", "--overwrite", "-o", str(tmp_path / "o.h5")]
    with capfd.disabled():
        for number in range(files):
            path = made(make, f"fit {kind}", number, tmp_path)
            sized = [] if ".ome" in path.name else ["--pixel-size", "1e-6"]
            masks = ["--masks"] if kind == "masks" or number % 4 == 0 else []
            code, lines, seconds, peak = run_forked(
                ["fit", str(path), *sized, *masks, *options], tmp_path
            )
            ours = (str(path.name), "flocsim: ", "mean relative", "         N ", "1 (circle)",
                    "   ", "diameters", "perimeter-based", str(tmp_path), "warning: ",
                    "pixel size")  # fmt: skip
            foreign = [line for line in lines if not line.startswith(ours)]
            assert code in (0, 2, 70) and not foreign, (number, path, code, lines)
            assert not any("internal error" in line for line in lines), (number, lines)
            assert seconds < 10.0 and peak < 2**30, (number, seconds, peak, lines)


@pytest.mark.parametrize("files", rest_slow([60, 300], lambda files: files == 60))
def test_making_them_writes_into_no_other_file(tmp_path, monkeypatch, files):
    """Data that a file says lie elsewhere are somebody's: whoever runs this must not lose them."""
    precious = tmp_path / "precious"
    precious.write_bytes(b"root:x:0:0")
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(hostile_files, "ELSEWHERE", str(precious))
    replaced = hostile_files.valid_results(tmp_path)
    before = {path.name for path in tmp_path.iterdir()}
    for number in range(files):
        rng = random.Random(number)
        data = replaced
        for _ in range(3):
            data = hostile_files.changed_hdf5(rng, data)
    image = hostile_files.io.BytesIO(replaced)
    with hostile_files.h5py.File(image, "r+") as file:
        file.create_dataset("elsewhere", (4,), "u1", external=[(str(precious), 0, 4)])
        for number in range(50):
            hostile_files.change_values(random.Random(number), file, "elsewhere")
    assert precious.read_bytes() == b"root:x:0:0"
    assert {path.name for path in tmp_path.iterdir()} == before


def test_no_test_names_a_file_of_the_system_as_storage():
    found = [
        path for path in Path(__file__).parent.rglob("*.py")
        if path != Path(__file__) and any(
            each in path.read_text("utf-8") for each in ('external=[("/', 'ExternalLink("/')
        )
    ]  # fmt: skip
    assert found == []

"""Damaged and hand-made files of every kind are read or refused in one line."""

import os
import sys
import traceback

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from flocsim.__main__ import main
from tests.helpers.hostile_readers import KINDS, MAKERS, made, outcome, reader
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
    ends = set()

    @settings(
        max_examples=EXAMPLES, deadline=None, database=None,
        suppress_health_check=list(HealthCheck),
    )  # fmt: skip
    @given(st.integers(0, 10**6))
    def throw(number):
        what, why = outcome(read, made(make, kind, number, folder))
        ends.add(what)
        assert what in ("read", "refused"), why

    throw()
    assert "refused" in ends


def run_forked(argv, folder):
    """Return (exit code, lines of both streams, CPU seconds, peak bytes) of a command in a fork."""
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


needs_fork = pytest.mark.skipif(not hasattr(os, "fork"), reason="needs processes that fork")
OF_RESULTS = [kind for kind in MAKERS if kind not in ("pictures", "masks")]
LONG = {
    "report": ["-o", "out.html"], "strength": ["-o", "out.h5", "--count", "1"],
    "trajectory": ["-o", "out.png"], "plot": ["--format", "png", "--figures", "overview"],
}  # fmt: skip
"""What is tried in the slow run only."""


@needs_fork
@pytest.mark.parametrize(
    ("kind", "files"),
    [("results", 2), *(pytest.param(kind, 20, marks=pytest.mark.slow) for kind in OF_RESULTS)],
)
def test_commands_end_with_plain_lines_and_little_work(tmp_path, monkeypatch, kind, files):
    monkeypatch.chdir(tmp_path)
    make, _ = MAKERS[kind]
    for number in range(files):
        path = str(made(make, f"commands {kind}", number, tmp_path))
        lines = [["info", path], ["compare", path, path], ["export", "csv", path, "-o", "out.csv"]]
        if files > 2:
            lines += [[name, path, *more] for name, more in LONG.items()]
        for words in lines:
            code, printed, seconds, peak = run_forked(words, tmp_path)
            assert code in (0, 2, 65, 74), (number, words, code, printed)
            assert not any("Traceback" in line for line in printed), (number, printed)
            assert seconds < 20.0 and peak < 2**31, (number, words, seconds, peak)


@needs_fork
@pytest.mark.parametrize("files", rest_slow([8, 150], lambda files: files == 8))
@pytest.mark.parametrize("kind", ["pictures", "masks"])
def test_fit_ends_with_plain_lines_and_little_work(tmp_path, capfd, kind, files):
    make, _ = MAKERS[kind]
    options = ["--vertices", "4", "--overwrite", "-o", str(tmp_path / "o.h5")]
    with capfd.disabled():
        for number in range(files):
            path = made(make, f"fit {kind}", number, tmp_path)
            masks = ["--masks"] if kind == "masks" or number % 4 == 0 else []
            code, lines, seconds, peak = run_forked(
                ["fit", str(path), "--pixel-size", "1e-6", *masks, *options], tmp_path
            )
            ours = (str(path.name), "flocsim: ", "mean relative",
                    "diameters", "perimeter-based", str(tmp_path), "warning: ",
                    "pixel size")  # fmt: skip
            foreign = [line for line in lines if not line.startswith(ours)]
            assert code in (0, 2, 70) and not foreign, (number, path, code, lines)
            assert not any("internal error" in line for line in lines), (number, lines)
            assert seconds < 10.0 and peak < 2**30, (number, seconds, peak, lines)

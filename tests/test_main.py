"""The command `flocsim`: subcommands, exit codes, and output that nobody reads."""

import os
import subprocess
import sys

import pytest

from flocsim import __main__ as entry
from flocsim.io.results.file import read_results
from tests.helpers.results_files import write_results
from tests.helpers.small_study import command, run_command, write_small
from tests.helpers.synthetic_results import make_results
from tests.helpers.tiers import rest_slow
from tests.helpers.waiting import PATIENCE

NAMES = ("init", "fit", "shapes", "ensemble", "sweep", "check", "work-precision", "trajectory",
         "plot", "info", "compare", "report", "export")  # fmt: skip


def test_all_subcommands_have_help(capsys):
    for name in NAMES:
        with pytest.raises(SystemExit) as caught:
            entry.main([name, "--help"])
        assert caught.value.code == 0
        said = capsys.readouterr().out
        assert said.startswith(f"usage: flocsim {name}") and "%%" not in said and "%(" not in said


@pytest.mark.parametrize("words", [[], ["bogus"], ["plot"], ["trajectory", "--frames", "x", "c"]])
def test_wrong_usage_ends_with_2(capsys, words):
    with pytest.raises(SystemExit) as caught:
        entry.main(words)
    assert caught.value.code == 2
    assert "error: " in capsys.readouterr().err


@pytest.mark.slow
def test_the_path_of_a_new_user(tmp_path):
    for words in (
        ["init", "study.toml"],
        ["ensemble", "study.toml", "--dry-run"],
        ["trajectory", "study.toml", "--vertices", "1", "-o", "strip.png"],
    ):
        done = run_command(tmp_path, *words, module="flocsim")
        said = done.stderr.splitlines()
        told = [line for line in said if not line.startswith("flocsim: first run: compiling")]
        assert (done.returncode, told) == (0, [])
        assert done.stdout
    assert sorted(path.name for path in tmp_path.iterdir()) == ["strip.png", "study.toml"]


def test_flocsim_ensemble_is_the_ensemble_command(in_tmp, capsys):
    write_small(in_tmp, vertices="[1]")
    assert entry.main(["ensemble", "small.toml", "--quiet"]) == 0
    assert capsys.readouterr() == ("", "")
    assert entry.main(["info", "small.h5"]) == 0
    assert "12 A, 0 B, 0 C, 0 D, 0 missed" in capsys.readouterr().out
    assert entry.main(["plot", "small.h5", "--figures", "4,size"]) == 0
    said = capsys.readouterr()
    assert said.err == "" and len(said.out.splitlines()) == 2


@pytest.mark.parametrize(
    "words", rest_slow([["--dry-run"], ["--output", "a.h5"]], lambda words: False)
)
def test_a_reader_that_leaves_early_is_no_error(tmp_path, words):
    write_small(tmp_path, vertices="[1]", types='["III"]')  # the others settle implausibly fast
    job = subprocess.Popen(
        command("ensemble", "small.toml", *words, module="flocsim"),
        cwd=tmp_path, stdout=subprocess.PIPE, stderr=subprocess.PIPE,
    )  # fmt: skip
    job.stdout.close()
    errors = job.stderr.read()
    job.stderr.close()
    assert (job.wait(timeout=PATIENCE), errors) == (0, b"")
    # What was run is saved, whether anybody reads the table or not.
    assert (tmp_path / "a.h5").exists() == ("a.h5" in words)


@pytest.fixture(scope="module")
def study(tmp_path_factory):
    """A folder with a config of spheres and results of it."""
    folder = tmp_path_factory.mktemp("study")
    write_small(folder, vertices="[1]", types='["III"]')  # the others settle implausibly fast
    write_results(folder / "r.h5", make_results(types=("I",), vertices=(1,), delta=(0.0,), count=5))
    return folder


def in_shell(folder, line, **more):
    """A finished shell command line; FLOCSIM stands for the program."""
    program = f"{sys.executable} -m flocsim"
    return subprocess.run(
        ["bash", "-c", line.replace("FLOCSIM", program)], cwd=folder, capture_output=True,
        text=True, timeout=PATIENCE, env=os.environ | more,
    )  # fmt: skip


STREAMS = [
    ("FLOCSIM info r.h5 >&-", 74, "flocsim: standard output could not be written: it is"),
    ("FLOCSIM info r.h5 >/dev/full", 74, "flocsim: standard output could not be written: No"),
    (
        "FLOCSIM ensemble small.toml --dry-run >/dev/full",
        74,
        "flocsim: standard output could",
    ),
    ("FLOCSIM info r.h5 2>&-", 0, ""),
    ("FLOCSIM info no.h5 >&- 2>&-", 74, ""),
    ("FLOCSIM info no.h5 <&- >&-", 74, "flocsim: no.h5 could not be read"),
    ("FLOCSIM info $'\\e[31m\\n.h5'", 74, r"flocsim: \x1b[31m\n.h5 could not be read"),
    ("FLOCSIM info r.h5 $'\\e[31m'", 2, r"flocsim info: error: unrecognized arguments: \x1b[31m"),
]


@pytest.mark.parametrize(
    ("line", "code", "said"), rest_slow(STREAMS, lambda *case: STREAMS.index(case) % 4 == 0)
)
@pytest.mark.skipif(not os.path.exists("/dev/full"), reason="needs /dev/full")
def test_streams_that_are_closed_or_full_cost_one_line(study, line, code, said):
    done = in_shell(study, line)
    assert done.returncode == code
    lines = done.stderr.splitlines()
    assert len(lines) == bool(said)
    assert said in done.stderr


def test_a_study_is_whole_whoever_reads_its_table(study):
    done = in_shell(study, "FLOCSIM ensemble small.toml -o whole.h5 >&-")
    assert (done.returncode, len(done.stderr.splitlines())) == (0, 1)
    assert read_results(study / "whole.h5").count == 3


@pytest.mark.parametrize("words", rest_slow(
    ["ensemble small.toml -o not.h5", "trajectory small.toml -o not.png"],
    lambda words: words.startswith("ensemble"),
))  # fmt: skip
def test_without_a_compiler_it_says_so(study, words):
    done = in_shell(study, f"FLOCSIM {words} >/dev/null", NUMBA_DISABLE_JIT="1")
    assert done.returncode == 2
    assert done.stderr.splitlines()[-1].startswith("flocsim: NUMBA_DISABLE_JIT is set")
    assert len(done.stderr.splitlines()) == 1

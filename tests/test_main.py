"""The command `flocsim`: subcommands, exit codes, and output that nobody reads."""

import subprocess
import sys

import pytest

from flocsim import __main__ as entry
from flocsim.errors import ConfigError, FileError, FlocsimError
from tests.helpers.small_study import command, run_command, write_small

NAMES = ("init", "fit", "ensemble", "trajectory", "plot", "info")


def test_all_subcommands_have_help(capsys):
    for name in NAMES:
        with pytest.raises(SystemExit) as caught:
            entry.main([name, "--help"])
        assert caught.value.code == 0
        assert capsys.readouterr().out.startswith(f"usage: flocsim {name}")


@pytest.mark.parametrize("words", [[], ["bogus"], ["plot"], ["trajectory", "--frames", "x", "c"]])
def test_wrong_usage_ends_with_2(capsys, words):
    with pytest.raises(SystemExit) as caught:
        entry.main(words)
    assert caught.value.code == 2
    assert "error: " in capsys.readouterr().err


@pytest.mark.parametrize(
    ("error", "code", "said"),
    [
        (ConfigError("a.toml:3: wrong"), 2, "flocsim: a.toml:3: wrong\n"),
        (FileError("full"), 74, "flocsim: full\n"),
        (FlocsimError("odd"), 70, "flocsim: odd\n"),
        (KeyboardInterrupt(), 130, "flocsim: interrupted\n"),
    ],
)
def test_errors_are_one_line_and_an_exit_code(capsys, monkeypatch, error, code, said):
    def fail(arguments):
        raise error

    monkeypatch.setattr(entry.info, "run", fail)
    assert entry.main(["info", "x.h5"]) == code
    assert capsys.readouterr() == ("", said)


def test_the_path_of_a_new_user(tmp_path):
    for words in (
        ["init", "study.toml"],
        ["ensemble", "study.toml", "--dry-run"],
        ["trajectory", "study.toml", "--vertices", "1", "-o", "strip.png"],
    ):
        done = run_command(tmp_path, *words, module="flocsim")
        assert (done.returncode, done.stderr) == (0, "")
        assert done.stdout
    assert sorted(path.name for path in tmp_path.iterdir()) == ["strip.png", "study.toml"]


def test_flocsim_ensemble_is_the_ensemble_command(tmp_path):
    write_small(tmp_path, vertices="[1]")
    done = run_command(tmp_path, "ensemble", "small.toml", "--quiet", module="flocsim")
    assert (done.returncode, done.stdout, done.stderr) == (0, "", "")
    done = run_command(tmp_path, "info", "small.h5", module="flocsim")
    assert done.returncode == 0
    assert "12 A, 0 B, 0 C, 0 D, 0 missed" in done.stdout
    done = run_command(tmp_path, "plot", "small.h5", "--figures", "4,overview", module="flocsim")
    assert (done.returncode, done.stderr) == (0, "")
    assert len(done.stdout.splitlines()) == 2


@pytest.mark.parametrize("words", [["--dry-run"], ["--output", "a.h5"]])
def test_a_reader_that_leaves_early_is_no_error(tmp_path, words):
    write_small(tmp_path, vertices="[1]")
    job = subprocess.Popen(
        command("ensemble", "small.toml", *words, module="flocsim"),
        cwd=tmp_path, stdout=subprocess.PIPE, stderr=subprocess.PIPE,
    )  # fmt: skip
    job.stdout.close()
    errors = job.stderr.read()
    job.stderr.close()
    assert (job.wait(timeout=60), errors) == (0, b"")
    # What was run is saved, whether anybody reads the table or not.
    assert (tmp_path / "a.h5").exists() == ("a.h5" in words)


def test_importing_the_package_loads_nothing_heavy():
    code = (
        "import sys, flocsim, flocsim.__main__\n"
        "print({'h5py', 'matplotlib', 'skimage', 'mpi4py', 'numba'} & set(sys.modules))"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=60)
    assert (done.stdout, done.stderr) == ("set()\n", "")

"""run.py without installing anything: its usage, its decisions and its messages.

`call` and `usable` are replaced by doubles that note the commands and say what a real run says.
"""

import ast
import importlib.util
import os
import shutil
import signal
import subprocess
import sys
from functools import partial
from pathlib import Path

import pytest

from tests.helpers.waiting import PATIENCE, wait_until

posix = pytest.mark.skipif(os.name == "nt", reason="the stand-in for Python is a shell script")
RUN_PY = Path(__file__).resolve().parents[1] / "run.py"


class Stage:
    """A folder with a run.py in it whose commands are noted, not run."""

    def __init__(self, folder):
        shutil.copy(RUN_PY, folder)
        spec = importlib.util.spec_from_file_location("run_py", folder / "run.py")
        self.run_py = importlib.util.module_from_spec(spec)
        spec.loader.exec_module(self.run_py)
        self.commands, self.exit_codes = [], {}
        self.folder, self.stamp = folder, folder / ".venv" / "installed-by-run.txt"
        (folder / "pyproject.toml").write_text("[project]")
        # Of this copy, which nobody else imports.
        vars(self.run_py).update(call=self.call, usable=self.usable, WINDOWS=False)

    def call(self, *command):
        """The double of run.py's call."""
        line = " ".join(command)
        self.commands.append(line)
        if "-m venv" in line:
            self.add(".venv/bin/python")
        return next((code for part, code in self.exit_codes.items() if part in line), 0)

    def usable(self):
        """The double of run.py's usable."""
        return (self.folder / ".venv/bin/python").exists()

    def add(self, path):
        """An empty file in the folder."""
        (self.folder / path).parent.mkdir(parents=True, exist_ok=True)
        (self.folder / path).write_text("")

    def run(self, *arguments):
        """The commands that run.py gives for these arguments, and its exit code."""
        self.commands.clear()
        code = self.run_py.main(list(arguments))
        return list(self.commands), code


@pytest.fixture
def stage(in_tmp):
    folder = in_tmp / "a folder"
    folder.mkdir()
    return Stage(folder.resolve())


def real(*arguments, cwd=None):
    """The real run.py as a process of its own."""
    # Without installed packages (-S), as where nothing but Python is there.
    command = [sys.executable, "-S", str(RUN_PY), *arguments]
    return subprocess.run(command, cwd=cwd, capture_output=True, text=True)


@pytest.mark.parametrize("arguments", [[], ["dmeo"], ["demo", "-x"], ["setup", "all"], [""]])
def test_wrong_usage_exits_2_with_the_usage(arguments, tmp_path):
    done = real(*arguments, cwd=tmp_path)
    assert (done.returncode, done.stdout) == (2, "")
    assert done.stderr.startswith("usage: python3 run.py demo")


def test_old_python_is_told_so_in_one_line(monkeypatch, capsys):
    monkeypatch.setattr(sys, "version_info", (3, 10, 4, "final", 0))
    with pytest.raises(SystemExit) as stopped:
        exec(compile(RUN_PY.read_text(), "run.py", "exec"), {"__name__": "__main__"})
    message = capsys.readouterr().err
    assert stopped.value.code == 2 and message.count("\n") == 1
    assert "needs Python 3.11 or newer, found 3.10;" in message


def test_old_python_can_read_the_file():
    tree = ast.parse(RUN_PY.read_text(), feature_version=(3, 0))
    newer = (ast.JoinedStr, ast.Starred, ast.AnnAssign, ast.NamedExpr, ast.Match)
    calls = [node for node in ast.walk(tree) if isinstance(node, ast.Call)]
    unpacked = [argument for call in calls for argument in call.args[-1:]]
    found = [node for node in ast.walk(tree) if isinstance(node, newer) and node not in unpacked]
    assert not found, [f"line {node.lineno}: {ast.unparse(node)}" for node in found]


def test_demo_installs_once_then_runs_and_draws(stage, capsys):
    first, code = stage.run("demo")
    assert code == 0 and len(first) == 4
    assert first[0].endswith("-m venv --clear .venv")
    assert first[1] == ".venv/bin/python -m pip install -e .[mpi]"
    assert first[2:] == stage.run("demo")[0]
    assert "There is no mpirun in .venv" in capsys.readouterr().out
    stage.add(".venv/bin/mpirun")
    stage.add("quickstart_overview.png")
    study, plot = stage.run("demo")[0]
    python = ".venv/bin/python -m flocsim.ensemble examples/quickstart.toml"
    assert study == ".venv/bin/mpirun -n 2 " + python + " --resume"
    assert plot == ".venv/bin/flocsim plot quickstart.h5 --figures overview --overwrite"
    told = capsys.readouterr().out
    assert str(stage.folder / "quickstart.h5") in told and "quickstart_overview.png" in told


def test_failed_study_is_not_drawn_and_keeps_its_exit_code(stage, capsys):
    stage.exit_codes["flocsim.ensemble"] = 75
    commands, code = stage.run("demo")
    assert code == 75 and "flocsim.ensemble" in commands[-1]
    assert "results" not in capsys.readouterr().out


def test_pytest_gets_its_arguments_and_gives_the_exit_code(stage):
    stage.exit_codes["-m pytest"] = 5
    commands, code = stage.run("test", "-k", "wall", "-x")
    assert code == 5 and commands[-1] == ".venv/bin/python -m pytest -k wall -x"


@pytest.mark.parametrize(
    ("cores", "arguments"),
    [(None, ""), (1, ""), (2, " -n 2 --dist worksteal"), (64, " -n 8 --dist worksteal")],
)
def test_the_whole_suite_runs_on_all_cores(stage, monkeypatch, cores, arguments):
    monkeypatch.setattr(stage.run_py.os, "cpu_count", lambda: cores)
    assert stage.run("test")[0][-1] == f".venv/bin/python -m pytest{arguments}"


def test_install_is_repeated_only_when_something_new_is_needed(stage):
    def installs(command):
        return [line for line in stage.run(command)[0] if "pip install" in line]

    assert installs("demo") and not installs("demo")
    pip = ".venv/bin/python -m pip install -e "
    assert installs("setup") == [pip + ".[mpi,test,dev]"]
    assert installs("test") == [pip + ".[docs]", pip + ".[formats]"]
    assert not installs("setup") and not installs("test") and not installs("demo")
    (stage.folder / "pyproject.toml").write_text("[project]\nname = 'flocsim'")
    assert installs("demo") and installs("setup")


def test_what_only_some_tests_need_may_be_missing(stage, capsys):
    stage.exit_codes["[formats]"] = 1
    commands, code = stage.run("test")
    assert code == 0 and "-m pytest" in commands[-1]
    assert "could not install formats; their tests are skipped" in capsys.readouterr().out
    assert any("[formats]" in line for line in stage.run("test")[0])  # asked for again


def test_half_made_venv_is_made_anew(stage):
    (stage.folder / ".venv").mkdir()  # interrupted before it had a Python
    assert "--clear" in stage.run("setup")[0][0]
    stage.stamp.write_text(stage.run_py.UNFINISHED)  # killed while pip was at work
    assert "--clear" in stage.run("setup")[0][0]
    stage.stamp.unlink()  # made by hand, complete
    assert "pip install" in stage.run("setup")[0][0]


def test_failing_pip_is_one_line_and_keeps_what_was_there(stage, capsys):
    stage.run("demo")
    before = stage.stamp.read_text()
    stage.exit_codes["pip install"] = 1
    with pytest.raises(SystemExit) as stopped:
        stage.run("setup")
    message = capsys.readouterr().err
    assert stopped.value.code == 70 and message.count("\n") == 1 and "internet" in message
    assert stage.stamp.read_text() == before


@pytest.mark.parametrize("missing", ["venv", "ensurepip"])
def test_python_without_venv_names_the_package_to_install(stage, uninstalled, capsys, missing):
    uninstalled(missing)
    with pytest.raises(SystemExit) as stopped:
        stage.run("demo")
    assert stopped.value.code == 70 and not stage.commands
    assert "apt install python3-venv" in capsys.readouterr().err


@pytest.fixture
def installed(tmp_path):
    """Gives a maker of folders with the real run.py and a stand-in for .venv's Python."""

    def make(script):
        python = tmp_path / ".venv/bin/python"
        python.parent.mkdir(parents=True)
        python.write_text(f'#!/bin/sh\ncase "$*" in -c*|*pip*) exit 0;; esac\n{script}\n')
        python.chmod(0o755)
        (tmp_path / "run.py").write_text(RUN_PY.read_text())
        (tmp_path / "pyproject.toml").write_text("[project]")
        return [sys.executable, str(tmp_path / "run.py")]

    return make


@posix
def test_commands_are_shown_as_typed_and_their_exit_codes_returned(installed, tmp_path):
    command = [*installed("echo got $*; exit 7"), "test", "-k", "a b"]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True)
    shown = ["$ .venv/bin/python -m pytest -k 'a b'", "got -m pytest -k a b"]
    assert (done.returncode, done.stdout.splitlines()[-2:], done.stderr) == (7, shown, "")


@posix
def test_interrupt_waits_for_the_command_to_save_its_work(installed, tmp_path):
    save = "trap 'sleep 0.5; echo saved > work; exit 0' INT; echo ready; sleep 20"
    pipes = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, "text": True}
    heard = partial(signal.signal, signal.SIGINT, signal.SIG_DFL)  # a job of nohup ignores it
    process = subprocess.Popen(
        [*installed(save), "test"], start_new_session=True, preexec_fn=heard, **pipes
    )
    while process.stdout.readline().strip() != "ready":
        assert process.poll() is None
    # run.py itself has to be waiting by now, which it does asleep.
    state = Path(f"/proc/{process.pid}/stat")
    asleep = lambda: state.read_text().rpartition(")")[2].split()[0] == "S"  # noqa: E731
    assert not state.exists() or wait_until(asleep)
    os.killpg(process.pid, signal.SIGINT)
    assert process.communicate(timeout=PATIENCE)[1] == "run.py: interrupted\n"
    assert process.returncode == 130
    assert (tmp_path / "work").read_text() == "saved\n"

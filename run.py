"""From a bare checkout to results: `python3 run.py demo`, `test [pytest arguments]` or `setup`.

Needs nothing but Python and shows each command before running it. Keeps to the syntax of old
Pythons, so that they reach the version check instead of a SyntaxError.
"""

import sys

if sys.version_info < (3, 11):
    text = "run.py: flocsim needs Python 3.11 or newer, found {0}.{1}; try `python3.11 run.py`\n"
    sys.stderr.write(text.format(*sys.version_info))
    sys.exit(2)

import hashlib
import importlib.util
import os
import pathlib
import shlex
import subprocess

USAGE = """usage: python3 run.py demo          install into .venv, run a small study, draw it
       python3 run.py test [...]    install into .venv, run the tests; [...] goes to pytest
       python3 run.py setup         install into .venv what the demo and the tests need"""
HERE = pathlib.Path(__file__).resolve().parent
WINDOWS = os.name == "nt"
PROBE = "import pip, sys; sys.exit(sys.version_info < (3, 11))"
UNFINISHED = "unfinished"
MOST_WORKERS = 8  # many tests start ranks of their own


def stop(code, text):
    """Leave with this exit code and one line that says why."""
    sys.stderr.write(text + "\n")
    sys.exit(code)


def call(*command):
    """Show a command as one would type it, run it, and return its exit code."""
    sys.stdout.write("$ " + (subprocess.list2cmdline if WINDOWS else shlex.join)(command) + "\n")
    sys.stdout.flush()
    child = subprocess.Popen(command)
    try:
        code = child.wait()
    except KeyboardInterrupt:
        child.wait()  # Ctrl-C has reached it too: leave it the time to save its work
        raise
    return code if code >= 0 else 128 - code


def tool(name):
    """The path of a program in .venv, relative to this folder."""
    return os.path.join(".venv", "Scripts", name + ".exe") if WINDOWS else ".venv/bin/" + name


def usable():
    """Whether .venv holds a Python of the right version that has pip."""
    try:
        return subprocess.run([tool("python"), "-c", PROBE], capture_output=True).returncode == 0
    except OSError:
        return False


def make_venv():
    """Make .venv, or make it anew."""
    if not (importlib.util.find_spec("venv") and importlib.util.find_spec("ensurepip")):
        stop(70, "run.py: this Python lacks venv; on Debian or Ubuntu: apt install python3-venv")
    # The base Python: an activated .venv cannot make itself anew.
    if call(sys._base_executable, "-m", "venv", "--clear", ".venv") != 0:
        stop(70, "run.py: could not make .venv; remove what is there by that name and try again")


def install(*extras):
    """Install flocsim with these extras into .venv, unless that has been done already."""
    stamp = HERE / ".venv" / "installed-by-run.txt"
    recipe = (HERE / "pyproject.toml").read_bytes() + os.fsencode(HERE)  # a moved .venv breaks
    digest = hashlib.sha256(recipe).hexdigest()
    done = stamp.read_text().split() if stamp.exists() else []
    if UNFINISHED in done or not usable():
        make_venv()
        done = []
    if digest in done and set(extras) <= set(done):
        return
    stamp.write_text(UNFINISHED)
    if call(tool("python"), "-m", "pip", "install", "-e", ".[" + ",".join(extras) + "]") != 0:
        stamp.write_text(" ".join(done))
        stop(70, "run.py: pip could not install flocsim (see above); is there internet access?")
    stamp.write_text(" ".join((digest,) + extras))


def add(*extras):
    """Install more extras, whose tests are skipped where they cannot be had."""
    stamp = HERE / ".venv" / "installed-by-run.txt"
    done = stamp.read_text().split()
    if set(extras) <= set(done):
        return
    stamp.write_text(UNFINISHED)
    failed = call(tool("python"), "-m", "pip", "install", "-e", ".[" + ",".join(extras) + "]")
    stamp.write_text(" ".join(done if failed else done + list(extras)))
    if failed:
        print("run.py: could not install " + ", ".join(extras) + "; their tests are skipped")


def demo():
    """Run the quickstart study on two ranks, draw its overview, and say where both are."""
    install("mpi")
    study = [tool("python"), "-m", "flocsim.ensemble", "examples/quickstart.toml"]
    study.append("--resume")  # what an earlier demo has finished is not run again
    launchers = [tool("mpirun"), tool("mpiexec"), ".venv/Library/bin/mpiexec.exe"]
    found = [path for path in launchers if os.path.exists(path)]
    if not found:
        print("There is no mpirun in .venv: the study runs on one process.")
    code = call(*([found[0], "-n", "2"] if found else []) + study)
    code = code or call(
        tool("flocsim"), "plot", "quickstart.h5", "--figures", "overview", "--overwrite"
    )
    if code == 0:
        results = ["quickstart.h5"] + sorted(path.name for path in HERE.glob("quickstart*.png"))
        print("\nThe results are in\n  " + "\n  ".join(str(HERE / name) for name in results))
    return code


def all_cores():
    """Arguments with which pytest spreads the whole suite over the cores of this machine."""
    cores = min(os.cpu_count() or 1, MOST_WORKERS)
    return ["-n", str(cores), "--dist", "worksteal"] if cores > 1 else []


def main(arguments):
    """Do what the command line asks for and return the exit code."""
    command, rest = "".join(arguments[:1]), arguments[1:]
    if command not in ("demo", "test", "setup") or (rest and command != "test"):
        stop(2, USAGE)
    if pathlib.Path.cwd() != HERE:
        print("$ cd " + shlex.quote(str(HERE)))
        os.chdir(HERE)
    if command == "demo":
        return demo()
    install("mpi", "test", "dev")
    if command != "test":
        print("flocsim is installed: try " + tool("flocsim") + " --help, or go on with README.md")
        return 0
    add("docs")
    add("formats")
    return call(tool("python"), "-m", "pytest", *(rest or all_cores()))


if __name__ == "__main__":
    try:
        sys.exit(main(sys.argv[1:]))
    except OSError as problem:
        stop(70, "run.py: " + str(problem))
    except KeyboardInterrupt:
        stop(130, "run.py: interrupted")

"""Study: a config file, or a dict like one, that can be changed, looked at and run.

It runs by the command in a process of its own: a script's processes, signals and memory stay apart.
"""

import contextlib
import os
import signal
import subprocess
import sys
import tempfile
import warnings
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from flocsim.ensembles.config.loader import lay_over, load_any_config, nested
from flocsim.ensembles.config.pair_scene import PairScene
from flocsim.ensembles.config.schema import Config
from flocsim.ensembles.config.sources import Sources
from flocsim.ensembles.config.toml_text import parse, read_text_file, settings_of
from flocsim.ensembles.contents import open_any
from flocsim.ensembles.kind import kind_of, study_of
from flocsim.ensembles.pairs.opened import StudyResults, one_count_study, place_of, replicate_of
from flocsim.ensembles.parallel.communicator import StopRequested
from flocsim.ensembles.parallel.processes import launched_size
from flocsim.errors import ConfigError, FileError, FlocsimError, PlausibilityWarning, UsageError
from flocsim.process import INTERRUPTED, STOPPED, WITHHELD
from flocsim.trajectories.trajectory import Trajectory

SAVING = 30.0
"""Seconds that an interrupted run has to keep what it has finished."""

WARNING = "flocsim: warning: "

ROOT = Path(__file__).resolve().parents[2]
"""The folder that holds the package."""

INSTALLED = ("site-packages", "dist-packages")
"""Folders in which installed packages lie."""

STACK = 3
"""From `run_command` to the script that called Study.run."""


def run_command(words: Sequence[str], text: str, folder: Path, quiet: bool) -> None:
    """Run `flocsim WORDS` in a folder with a text as its standard input.

    What it prints is printed here, unless ``quiet``; then its warnings become Python's. Raises the
    FlocsimError that its exit code stands for, with its last words; KeyboardInterrupt where it was
    interrupted, once it has saved.
    """
    if (launched_size() or 0) > 1:
        raise UsageError(
            "Study.run starts its own processes and cannot be run under MPI: use "
            "`mpirun -n 2 flocsim ensemble FILE`"
        )
    environment = os.environ | {"PYTHONUNBUFFERED": "1"}
    if ROOT.name not in INSTALLED:  # this flocsim is not installed, but lies in a folder
        known = filter(None, [str(ROOT), os.environ.get("PYTHONPATH")])
        environment["PYTHONPATH"] = os.pathsep.join(known)
    # On Windows a virtual environment's Python is the child of a process that starts it.
    ends_with_this = [] if os.name == "nt" else ["--parent", str(os.getpid())]
    # -P: what lies beside a config is no part of Python.
    with subprocess.Popen(
        [sys.executable, "-P", "-m", "flocsim", *words, *ends_with_this],
        stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.STDOUT,
        cwd=folder, env=environment, encoding="utf-8", errors="replace",
    ) as process:  # fmt: skip
        assert process.stdin is not None and process.stdout is not None
        said: list[str] = []
        try:
            with contextlib.suppress(BrokenPipeError):  # it says why
                process.stdin.write(text)
                process.stdin.close()
            for line in process.stdout:
                said.append(line.rstrip("\n"))
                if not quiet:
                    print(said[-1])
                elif said[-1].startswith(WARNING):
                    warnings.warn(said[-1].removeprefix(WARNING), PlausibilityWarning, STACK)
            process.wait()
        except BaseException:
            process.send_signal(signal.SIGINT)
            try:
                process.wait(SAVING)
            except subprocess.TimeoutExpired:
                process.kill()
            raise
    if process.returncode in (INTERRUPTED, -signal.SIGINT):
        raise KeyboardInterrupt
    if process.returncode not in (0, WITHHELD):  # that is a warning, said already
        raise error_of(process.returncode, said)


def error_of(code: int, said: Sequence[str]) -> FlocsimError:
    """Return the error that an exit code stands for, with the last line that was printed."""
    last = next((line for line in reversed(said) if line.strip()), "without output")
    last = last.removeprefix("flocsim: ")
    last += '; continue with mode="resume"' if code == STOPPED else ""
    kinds = {kind.exit_code: kind for kind in (UsageError, FileError, StopRequested)}
    return kinds.get(code, FlocsimError)(last if code > 0 else f"the run was killed: {last}")


MODES = ("new", "resume", "restart")


class Study:
    """A study as a config file describes it.

    Parameters
    ----------
    source : path or mapping
        A TOML file, or a nested dict with the same keys.
    folder : path, optional
        Folder of a dict's shape library and of the modules of your own classes; the current folder
        by default.

    Raises
    ------
    ConfigError
        If a value is wrong; the message has one line per problem.
    FileError
        If the file cannot be read.

    Examples
    --------
    >>> study = Study({"preset": "tang2014", "replicates": 10, "shapes": {"vertices": [1]}})
    >>> study.with_(replicates=20).config.replicates
    20
    """

    def __init__(
        self, source: str | os.PathLike | Mapping[str, Any], folder: str | os.PathLike | None = None
    ) -> None:
        if isinstance(source, Mapping):
            place = Path("." if folder is None else folder) / "study.toml"
            if not place.parent.is_dir():
                raise UsageError(f"{place.parent} is not a folder: name an existing one")
            text = "".join(f"{key} = {value}\n" for key, value in settings_of(source))
            self._take(place, text, {})
        elif folder is None:
            self._take(Path(source), read_text_file(source), {})
        else:
            raise UsageError("folder is for a dict; for a file, the file's own folder is used")

    def _take(
        self, path: Path, text: str, overrides: dict[str, Any], sources: Sources | None = None
    ) -> None:
        self.path, self.text, self.overrides = path, text, overrides
        self.sources = sources or Sources(text)
        self.config: Config = load_any_config(path, overrides, self.sources)

    def with_(self, changes: Mapping[str, Any] | None = None, /, **keys: Any) -> "Study":
        """Return a Study with other values.

        Parameters
        ----------
        changes : mapping, optional
            A nested dict, or {"forces.contact.k_n": "10 N/m"} with dotted keys; False leaves out a
            force, as in ``{"forces.double_layer": False}``.
        **keys
            Top-level keys by name, as in ``seed=3`` or ``scene={"delta": [0.0]}``.

        Returns
        -------
        Study
            A new study; it uses the modules and libraries that this one has already read.

        Raises
        ------
        ConfigError
            If a value is wrong.
        """
        found: dict[str, Any] = {}
        for key, value in {**(changes or {}), **keys}.items():
            if not isinstance(key, str) or not all(key.split(".")):
                raise ConfigError(f"keys are words separated by dots, found {key!r}")
            try:
                found = lay_over(found, nested([(key.split("."), value)]))
            except TypeError:
                raise ConfigError(f"{key} cannot be given here") from None
        study = Study.__new__(Study)
        study._take(self.path, self.text, lay_over(self.overrides, found), self.sources)
        return study

    def run(
        self, jobs: int = 1, *, output: str | os.PathLike | None = None, mode: str = "new",
        overwrite: bool = False, quiet: bool = True,
    ) -> Any:  # fmt: skip
        """Run all missing replicates, as `flocsim ensemble` does, and return the results.

        Parameters
        ----------
        jobs : int
            Number of processes on this machine; no ``if __name__ == "__main__"`` is needed.
        output : path, optional
            Results file, instead of the config's. If neither names one, results are in memory only,
            and an interrupted run is lost.
        mode : "new", "resume" or "restart"
            "resume" continues an unfinished run, extends finished results, or returns them as they
            are.
        overwrite : bool
            Whether to rename an existing file instead of raising UsageError.
        quiet : bool
            False prints what the command prints.

        Returns
        -------
        StudyResults or SwarmResults
            As from `flocsim.open`.

        Raises
        ------
        UsageError
            If a file is in the way, or belongs to another study.
        FileError
            If a file cannot be written.
        """
        if mode not in MODES:
            raise UsageError(f"mode must be one of {', '.join(MODES)}, found {mode!r}")
        in_memory = output is None and mode == "new" and not self.names_output
        with tempfile.TemporaryDirectory() if in_memory else contextlib.nullcontext() as scratch:
            target = Path(self.config.output.file if output is None else output)
            target = Path(scratch, target.name) if scratch else target
            words = ["ensemble", "-", "-o", os.path.abspath(target), "--jobs", str(jobs)]
            words += [f"--{mode}"] if mode != "new" else []
            words += ["--overwrite"] if overwrite else []
            words += ["--quiet"] if quiet else []
            for key, value in settings_of(self.overrides):
                words += ["--set", f"{key}={value}"]
            run_command(words, self.text, self.path.parent, quiet)
            # Modules are those that this very study has imported, whatever the file names.
            found = open_any(target, own=self.sources.named)
            if isinstance(found, StudyResults):
                found.folder = self.path.parent
                if in_memory:
                    found.load_all()
            return found

    @property
    def names_output(self) -> bool:
        """True if the config names a results file."""
        return "file" in lay_over(parse(self.path, self.text), self.overrides).get("output", {})

    def check(self) -> None:
        """Check the attraction zone, sizes, forces and shape library without running the study.

        Raises
        ------
        UsageError
            If the study cannot run.
        """
        kind_of(self.config).check(self.config)
        study_of(self.config).prepare()

    def replicate(
        self, replicate: int = 0, type: str | None = None, vertices: int | None = None,
        delta: float | None = None,
    ) -> Trajectory:  # fmt: skip
        """Run one replicate, and return its motion.

        Parameters
        ----------
        replicate : int
            Index of the replicate, from 0.
        type : str, optional
            Collision type; the first by default.
        vertices : int, optional
            N; the last by default.
        delta : float, optional
            Displacement δ/δ_max; the first by default.

        Returns
        -------
        Trajectory
            Its ``row`` has the row of the table of replicates, in words.

        Raises
        ------
        UsageError
            If the study has no such replicate, or is not a study of pairs.
        """
        if not isinstance(self.config.scene, PairScene):
            raise UsageError(
                f"a replicate of a {self.config.scene.kind} is not a collision: run the study, and "
                "look at its results"
            )
        place = place_of(self.config, type, vertices, delta)
        return replicate_of(replicate, place, one_count_study(self.config, place[1]))

    def __repr__(self) -> str:
        scene, vertices = self.config.scene, self.config.shapes.vertices
        count = len(scene.names) * len(vertices) * len(scene.delta)
        over = f", {len(list(settings_of(self.overrides)))} changed" if self.overrides else ""
        return f"Study({str(self.path)!r}: {count} conditions × {self.config.replicates}{over})"

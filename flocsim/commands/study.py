"""`flocsim study frames/*.png --pixel-size 0.95e-6 -o kaolin/`: from pictures to a report.

Every step is a command that could be typed, and is shown as such. All is kept in one folder. What
the study has made there is listed in its record, with checksums: it replaces these files as long
as nobody has changed them, and no others.
"""

import contextlib
import json
import os
import shlex
import signal
import subprocess
import sys
from argparse import ArgumentParser, Namespace
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import attrs

from flocsim import __version__
from flocsim.commands import add_command, add_overwrite, add_settings
from flocsim.commands.fit import length
from flocsim.commands.fit_pictures import list_pictures
from flocsim.commands.sweep import interrupt
from flocsim.ensembles.cli import program
from flocsim.ensembles.contents import open_kind
from flocsim.errors import FileError, UsageError
from flocsim.io.arguments import Parser, positive, several, whole
from flocsim.io.files import make_folder, write_file
from flocsim.io.journal import Lock
from flocsim.io.json_text import read_json
from flocsim.io.seals import digest_of, held
from flocsim.io.terminal import duration
from flocsim.process import INTERRUPTED, STOPPED, WITHHELD, handle

PRESETS = {"clay": ("clay", 0.1), "tang2014": ("paper", 0.2), "si": ("measured", 0.1)}
"""Presets: the kind of `flocsim init` with each, and CPU seconds of one replicate of all its
conditions, on a processor of 2020."""

USUAL_REPLICATES = 100
"""Of the configs that `flocsim init` writes."""

SECONDS_OF_PICTURE, SECONDS_OF_STUDY = 3.0, 15.0
"""CPU seconds that a picture, and the start, figures and report of a study take."""

FIGURES = "overview,outcomes"
"""Figures that are drawn as files; the report has them all."""

OF_FIT = ("flocs", "min_radius", "drop")
"""Options of `flocsim fit` that are handed on."""

RECORD = "study.json"
FORM = {"flocsim": str, "source": {}, "made": {}, "making": {}, "shown": {}}
"""Name of the record, and its pattern of `flocsim.io.json_text`: of what the shapes were made;
{file: checksum} of what the study has made; {pattern of files: those that were there before} of
what it is at; {report: what it shows}."""

LAST_SECONDS = 30.0
"""Seconds that a stopped run has to save what it has finished."""


def add_arguments(parser: ArgumentParser) -> None:
    """Find the flocs in pictures, let pairs of them settle onto each other, and write a report of
    what becomes of them: at their real weight in sea water and, beside it, under the conditions of
    Tang et al. (2014). Each step is shown as the command that does it.

      flocsim study frames/*.png --pixel-size 0.95e-6 -o kaolin/

    Given once more, the command goes on where it was stopped, or with more replicates. A config
    in the folder may be edited: it is used as it is.

    images IMAGE: picture, or folder of pictures
    --pixel-size LENGTH: length of a pixel's side, e.g. '0.95 um', or in metres: 0.95e-6 (default:
        as given in an OME-TIFF or ImageJ file)
    --output FOLDER: folder to make, and to go on in (default: %(default)s)
    --replicates K: pairs in each condition (default: as the configs say, 100)
    --preset LIST: presets, separated by commas, of clay, tang2014 and si (default: %(default)s)
    --flocs: whether flocs are brighter or darker than the background (default: found by itself)
    --min-radius PX: smallest r_eq of a floc (default: 4)
    --drop LIST: flocs to leave out, by their numbers in the overlays: 023.png#3,025.png#5
    --masks: treat the files as masks or labels, not pictures
    --jobs K: number of processes (default: one for each core, here %(default)s)
    --overwrite: make anew what other pictures, or another config, have given; each old file is
        kept, clay.h5 as clay.1.h5
    """
    add = parser.add_argument
    add("images", nargs="+")
    add("--pixel-size", type=checked_length)
    add("-o", "--output", default="study")
    add("--replicates", type=whole)
    add("--preset", type=several(known_preset), default="clay,tang2014")
    add("--flocs", choices=("bright", "dark"))
    add("--min-radius", type=positive)
    add("--drop")
    add("--masks", action="store_true")
    add("--jobs", type=whole, default=cores())
    add_settings(parser)
    add_overwrite(parser)


def checked_length(text: str) -> str:
    """Return a pixel size as it was typed; ArgumentTypeError for none."""
    length(text)
    return text


def known_preset(text: str) -> str:
    """Return the name of a preset; ArgumentTypeError, by argparse, for another."""
    if text not in PRESETS:
        raise ValueError
    return text


def cores() -> int:
    """Return how many cores this process may use."""
    affinity = getattr(os, "sched_getaffinity", None)
    return len(affinity(0)) if affinity else os.cpu_count() or 1


@attrs.define
class StudyFolder:
    """A folder that `flocsim study` made, locked, with its record; `open_folder` gives it."""

    path: Path
    record: dict[str, Any]

    def save(self) -> None:
        """Write the record over the old one."""
        path = self.path / RECORD
        write_file(path, json.dumps(self.record, indent=1).encode(), held(path))

    def matching(self, pattern: str) -> set[str]:
        """Return the files of a pattern, by their paths in the folder."""
        return {path.relative_to(self.path).as_posix() for path in self.path.glob(pattern)}

    def is_own(self, name: str) -> bool:
        """Return True if a file still is as the study has made it."""
        return self.record["made"].get(name) == checksum(self.path / name)

    @contextlib.contextmanager
    def making(self, pattern: str) -> Iterator[None]:
        """Replace the study's own files of a pattern by what the block makes."""
        for name in filter(self.is_own, self.matching(pattern)):
            (self.path / name).unlink()
        # Written beforehand, so that files of a process that is killed are known as well.
        self.record["making"][pattern] = sorted(self.matching(pattern))
        self.save()
        try:
            yield
        finally:
            self.adopt()

    def adopt(self) -> None:
        """Note as made what has come since the study began to make it."""
        for pattern, before in self.record["making"].items():
            for name in self.matching(pattern) - set(before):
                self.record["made"][name] = checksum(self.path / name)
        self.record["making"] = {}
        self.save()


def checksum(path: Path) -> str:
    """Return the checksum of a file as text."""
    return digest_of(path.read_bytes(), 16).hex() if path.is_file() else ""


@contextlib.contextmanager
def open_folder(path: Path) -> Iterator[StudyFolder]:
    """Make the folder of a study, or open the one that is there, for this process alone.

    UsageError for a folder that has files and was not made by `flocsim study`; FileError where
    another study runs in it, or nothing can be written.
    """
    record = path / RECORD
    if path.is_dir() and not record.exists() and any(path.iterdir()):
        raise UsageError(f"{path} has files and was not made by flocsim study: name another by -o")
    make_folder(path, "--output ")
    lock = Lock(path / f"{RECORD}.lock")
    try:
        found = {"flocsim": __version__, "source": {}, "made": {}, "making": {}, "shown": {}}
        if record.exists():
            try:
                found = read_json(record.read_bytes(), FORM)
            except (OSError, ValueError) as error:
                raise FileError(f"{record} is no record of a study: {error}") from error
        folder = StudyFolder(path, found)
        folder.adopt()
        yield folder
    finally:
        lock.remove()


def run(args: Namespace) -> int:
    """Do what is missing of a study and say what it found; return the exit code."""
    handle(interrupt)
    try:
        return make_study(args)
    except KeyboardInterrupt as error:
        again = shlex.join([*program(), *sys.argv[1:]])
        who = str(error) or "stopped by SIGINT"
        print(f"flocsim: {who}: what was finished is kept, go on with\n{again}", file=sys.stderr)
        return STOPPED


def make_study(args: Namespace) -> int:
    """Take all steps that are missing; return the exit code."""
    pictures = list_pictures(args.images, args.masks)
    if missing := [path for path in pictures if not path.is_file()]:
        raise UsageError(f"{missing[0]} is not a file: name pictures, or a folder of pictures")
    presets = list(dict.fromkeys(args.preset))
    with open_folder(Path(args.output)) as folder:
        say_estimate(args, len(pictures), presets)
        fit_shapes(args, pictures, folder)
        reports = ["report.html", *(f"report-{name}.html" for name in presets[1:])]
        codes, said = [], []
        for preset, report in zip(presets, reports, strict=True):
            code = run_preset(args, preset, folder)
            codes.append(code)
            if code in (0, WITHHELD):
                show(args, preset, report, folder)
                kind, file = open_kind(folder.path / f"{preset}.h5")
                found = kind.read(file)
                said += [f"\n{kind.setting(found)}", kind.answer(found), folder.path / report]
        print("\n".join(map(str, said)))
    return max(codes)


def say_estimate(args: Namespace, pictures: int, presets: Sequence[str]) -> None:
    """Say about how long it takes, where nothing is there yet."""
    replicates = args.replicates or USUAL_REPLICATES
    work = SECONDS_OF_PICTURE * pictures + replicates * sum(PRESETS[name][1] for name in presets)
    seconds = work / args.jobs + SECONDS_OF_STUDY * len(presets)
    cores = f"{args.jobs} core{'s' * (args.jobs > 1)}"
    print(f"about {duration(seconds)} on {cores}, and a minute or two more the first time, when "
          "flocsim is compiled; Ctrl-C loses nothing")  # fmt: skip


def typed(path: str | os.PathLike) -> str:
    """Return a path as an argument that is not taken for an option."""
    return f"./{path}" if str(path).startswith("-") else str(path)


def call(*words: str) -> None:
    """Show a command of flocsim and run it in this process."""
    print(f"\n$ {shlex.join(['flocsim', *words])}", flush=True)
    parser = Parser(prog="flocsim")
    add_command(parser.add_subparsers(), words[0])
    arguments = parser.parse_args(words)
    if code := arguments.run(arguments):
        raise SystemExit(code)


def call_apart(*words: str) -> int:
    """Show a command of flocsim, run it as a process and return its exit code."""
    print(f"\n$ {shlex.join(['flocsim', *words])}", flush=True)
    process = subprocess.Popen([*program(), *words])
    try:
        code = process.wait()
    except KeyboardInterrupt:
        process.send_signal(signal.SIGINT)  # where the signal was meant for this process alone
        with contextlib.suppress(subprocess.TimeoutExpired):
            process.wait(LAST_SECONDS)
        raise
    if code in (STOPPED, INTERRUPTED) or code < 0:
        raise KeyboardInterrupt
    return code


def fit_shapes(args: Namespace, pictures: Sequence[Path], folder: StudyFolder) -> None:
    """Fit the flocs of the pictures, unless the folder has them; UsageError where it has others."""
    options: list[str] = []
    for name in OF_FIT:
        value = getattr(args, name)
        options += [] if value is None else [f"--{name.replace('_', '-')}", f"{value:g}"
                    if isinstance(value, float) else value]  # fmt: skip
    options += ["--masks"] if args.masks else []
    size = length(args.pixel_size) if args.pixel_size else None
    source = {
        "pictures": sorted([path.name, checksum(path)] for path in pictures),
        "pixel_size": size, "options": options,
    }  # fmt: skip
    shapes, before = folder.path / "shapes.h5", folder.record["source"]
    if shapes.exists() and before == source:
        print(f"{shapes} has the flocs of these pictures")
        return
    if shapes.exists() and before and not args.overwrite:
        changed = [name.replace("_", " ") for name in source if source[name] != before.get(name)]
        raise UsageError(
            f"{shapes} was made with other {' and '.join(changed)}: name another folder by -o, or "
            "add --overwrite, which keeps the old files under other names"
        )
    # Without a source the shapes of a process that is killed now are not taken for the new ones.
    folder.record["source"] = {}
    words = ["fit", *map(typed, args.images), *options]
    words += ["--pixel-size", args.pixel_size] if args.pixel_size else []
    words += ["--vertices", "4,16,64", "--radius", "1", "--jobs", str(args.jobs)]
    words += ["-o", typed(shapes), "--overlay", typed(folder.path / "outlines.png")]
    with folder.making("outlines*.png"):
        call(*words, *["--overwrite"] * shapes.exists())
    folder.record["source"] = source
    folder.save()


def run_preset(args: Namespace, preset: str, folder: StudyFolder) -> int:
    """Write a config, unless there is one, and run what is missing of its study; return the exit
    code."""
    config, shapes = folder.path / f"{preset}.toml", typed(folder.path / "shapes.h5")
    if not config.exists():
        with folder.making(config.name):
            call("init", typed(config), "--kind", PRESETS[preset][0], "--shapes", shapes)
    elif not folder.is_own(config.name):
        print(f"\n{config} has been edited, and is used as it is")
    words = ["ensemble", typed(config), "-o", typed(folder.path / f"{preset}.h5"), "--resume"]
    words += ["--jobs", str(args.jobs)] if args.jobs > 1 else []
    words += ["--replicates", str(args.replicates)] if args.replicates else []
    words += [word for each in args.settings for word in ("--set", each)]
    return call_apart(*words, *["--overwrite"] * args.overwrite)


def show(args: Namespace, preset: str, report: str, folder: StudyFolder) -> None:
    """Draw the figures of results and write their report, unless they are there."""
    results, rule = folder.path / f"{preset}.h5", ["--overwrite"] * args.overwrite
    shown = [preset, checksum(results), __version__]
    if folder.record["shown"].get(report) == shown and (folder.path / report).exists():
        print(f"{folder.path / report} shows these results already")
        return
    with folder.making(f"figures/{preset}-*.png"):
        figures = typed(folder.path / "figures")
        call("plot", typed(results), "--output-dir", figures, "--figures", FIGURES, *rule)
    with folder.making(report):
        call("report", typed(results), "-o", typed(folder.path / report), *rule)
    folder.record["shown"][report] = shown
    folder.save()

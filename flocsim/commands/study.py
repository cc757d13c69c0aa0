"""`flocsim study frames/*.png --pixel-size 0.95e-6 -o kaolin/`: from pictures to a report.

Every step is a command that could be typed, and is shown as such. All is kept in one folder. What
the study has made there is listed in its record, with checksums: it replaces these files as long
as nobody has changed them, and no others.
"""

import contextlib
import json
import os
import shlex
import subprocess
import sys
from argparse import ArgumentParser, Namespace
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import attrs

from flocsim import __version__
from flocsim.commands import add_overwrite, add_settings
from flocsim.commands.fit import length
from flocsim.commands.fit_pictures import list_pictures
from flocsim.commands.sweep import interrupt
from flocsim.ensembles.cli import program
from flocsim.ensembles.contents import open_kind
from flocsim.errors import FileError, UsageError
from flocsim.io.arguments import whole
from flocsim.io.files import make_folder, write_file
from flocsim.io.images.review import checksum_of
from flocsim.io.journal import Lock
from flocsim.io.json_text import read_json
from flocsim.io.seals import held, sha256_of
from flocsim.io.shape_library import read_settings
from flocsim.process import INTERRUPTED, SIGNALS, STOPPED, WITHHELD, deferred, handle

KINDS = {"clay": "clay", "tang2014": "paper", "si": "measured"}
"""Presets, and the kind of `flocsim init` with each."""

FIGURE = "outcomes"
"""The figure that is drawn as a file, too; the report has more."""

REPORT = "report.html"
RECORD = "study.json"
FORM: dict[str, Any] = {"source": {}, "made": {}, "shown": {}}
"""The record of a folder, as a pattern of `flocsim.io.json_text`: of what the shapes were made;
{file: checksum} of what the study has made, "" while it makes it; {figure or report: the results
that it shows}."""


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
    --preset: preset to run; may be repeated (default: clay and tang2014)
    --reviewed FILE: leave out flocs, as chosen on the page shapes-review.html of the folder
    --fit OPTIONS: further options of flocsim fit, as --fit='--flocs bright --neck 0'
    --jobs K: number of processes (default: one for each core, here %(default)s)
    --overwrite: make anew what other pictures, or another config, have given; each old file is
        kept, clay.h5 as clay.1.h5
    """
    affinity = getattr(os, "sched_getaffinity", None)  # not on all systems
    add = parser.add_argument
    add("images", nargs="+")
    add("--pixel-size", type=length)
    add("-o", "--output", default="study")
    add("--replicates", type=whole)
    add("--preset", action="append", choices=KINDS)
    add("--reviewed")
    add("--fit", type=shlex.split, default=[])
    add("--jobs", type=whole, default=len(affinity(0)) if affinity else os.cpu_count() or 1)
    add_settings(parser)
    add_overwrite(parser)


@attrs.define
class StudyFolder:
    """A folder that `flocsim study` made, with its record; `open_folder` gives it, locked."""

    path: Path
    record: dict[str, Any]

    def save(self) -> None:
        """Write the record over the old one."""
        path = self.path / RECORD
        write_file(path, json.dumps(self.record, indent=1).encode(), held(path))

    def is_own(self, name: str) -> bool:
        """Return True if a file is there as the study has made it, or was making it."""
        path = self.path / name
        return path.exists() and self.record["made"].get(name) in ("", sha256_of(path))

    def make(self, name: str, *words: str, of: Sequence[Path] = ()) -> None:
        """Run a command that writes this file, in the place of the study's own one of that name.

        ``of``: the results that it shows; a file that is there and shows them is left as it is.
        """
        made, shown = self.record["made"], [*map(sha256_of, of), __version__]
        path = self.path / name
        if of and path.exists() and self.record["shown"].get(name) == shown:
            return
        if self.is_own(name):
            path.unlink()
        if not path.exists():
            made[name] = ""
        self.save()
        call(*words)
        made[name], self.record["shown"][name] = sha256_of(path), shown
        self.save()


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
        known = read_json(record.read_bytes(), FORM) if record.exists() else {}
        folder = StudyFolder(path, {name: known.get(name, {}) for name in FORM})
        folder.save()
        yield folder
    except ValueError as error:
        raise FileError(f"{record} is no record of a study: {error}") from error
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
    except OSError as error:
        raise error if isinstance(error, FileError) else FileError(str(error)) from error


def make_study(args: Namespace) -> int:
    """Take all steps that are missing; return the exit code."""
    pictures = list_pictures(args.images, "--masks" in args.fit)
    if missing := [path for path in pictures if not path.is_file()]:
        raise UsageError(f"{missing[0]} is not a file: name pictures, or a folder of pictures")
    presets = list(dict.fromkeys(args.preset or ["clay", "tang2014"]))
    with open_folder(Path(args.output)) as folder:
        fit_shapes(args, pictures, folder)
        code = max(run_preset(args, preset, folder) for preset in presets)
        every = [folder.path / f"{preset}.h5" for preset in dict.fromkeys([*presets, *KINDS])]
        results = [path for path in every if path.exists()]
        words = ["report", *map(str, results), "-o", str(folder.path / REPORT)]
        folder.make(REPORT, *words, *["--overwrite"] * args.overwrite, of=results)
        for path in results:
            kind, file = open_kind(path)
            found = kind.read(file)
            print("", kind.setting(found), kind.answer(found), sep="\n")
        if doubt := read_settings(folder.path / "shapes.h5").get("warning"):
            print(f"\nwarning: {doubt}")
        print(f"\nall on one page: {folder.path / REPORT}")
        review = folder.path / "shapes-review.html"
        print(f"choose flocs by eye on {review}; then add --reviewed FILE --overwrite")
    return code


def call(*words: str) -> int:
    """Show a command of flocsim and run it; return its exit code, 0 or WITHHELD.

    KeyboardInterrupt where it was stopped; where it failed, which it has said, SystemExit.
    """
    print(f"\n$ {shlex.join(['flocsim', *words])}", flush=True)
    # In a process group of its own, since Ctrl-C in the midst of imports shows where it came.
    # A signal waits until the process is known, as nobody could stop it otherwise.
    process = None
    try:
        with deferred(*SIGNALS):
            process = subprocess.Popen([*program(), *words], process_group=0)
        code = process.wait()
    except KeyboardInterrupt:
        if process is not None:
            process.terminate()
            process.wait()
        raise
    if code in (STOPPED, INTERRUPTED) or code < 0:
        raise KeyboardInterrupt(f"stopped with flocsim {words[0]}")
    if code not in (0, WITHHELD):
        raise SystemExit(code)
    return code


def fit_shapes(args: Namespace, pictures: Sequence[Path], folder: StudyFolder) -> None:
    """Fit the flocs of the pictures, unless the folder has them; UsageError where it has others."""
    source = {
        "pictures": sorted([path.name, sha256_of(path)] for path in pictures),
        "pixel_size": args.pixel_size,
        "options": args.fit,
        "choices": None if args.reviewed is None else checksum_of(Path(args.reviewed)),
    }
    shapes, before = folder.path / "shapes.h5", folder.record["source"]
    if shapes.exists() and before == source:
        print(f"{shapes} has the flocs of these pictures")
        return
    changed = [name.replace("_", " ") for name, of in source.items() if before.get(name) != of]
    if shapes.exists() and before and not args.overwrite:
        raise UsageError(
            f"{shapes} was made from other {' and '.join(changed)}: name another folder by -o, or "
            "add --overwrite, which keeps the old file under another name"
        )
    # Without a source the shapes of a process that is killed now are not taken for the new ones.
    folder.record["source"] = {}
    folder.save()
    words = ["fit", *args.images, *args.fit]
    words += ["--pixel-size", repr(args.pixel_size)] * (args.pixel_size is not None)
    words += ["--vertices", "4,16,64", "--radius", "1", "--jobs", str(args.jobs)]
    words += ["--reviewed", args.reviewed] if args.reviewed is not None else []
    words += ["-o", str(shapes), "--review"]
    # Files of a fit that found nothing, or was stopped, are kept under other names.
    call(*words, *["--overwrite"] * any(folder.path.glob("shapes*")))
    folder.record["source"] = source
    folder.save()


def run_preset(args: Namespace, preset: str, folder: StudyFolder) -> int:
    """Do what is missing of the study with a preset: config, results and figures; return the exit
    code of its run."""
    shapes, config, results, figures = (
        str(folder.path / name)
        for name in ("shapes.h5", f"{preset}.toml", f"{preset}.h5", "figures")
    )
    rule = ["--overwrite"] * args.overwrite
    if not Path(config).exists():
        words = ["init", config, "--kind", KINDS[preset], "--shapes", shapes]
        folder.make(f"{preset}.toml", *words)
    elif not folder.is_own(f"{preset}.toml"):
        print(f"\n{config} has been edited, and is used as it is")
    words = ["ensemble", config, "-o", results, "--resume", *rule]
    words += ["--jobs", str(args.jobs)] * (args.jobs > 1)
    words += ["--replicates", str(args.replicates)] * (args.replicates is not None)
    code = call(*words, *(word for each in args.settings for word in ("--set", each)))
    words = ["plot", results, "--output-dir", figures, "--figures", FIGURE, *rule]
    folder.make(f"figures/{preset}-{FIGURE}.png", *words, of=[Path(results)])
    return code

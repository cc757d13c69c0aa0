"""The steps of the study: each shows its command, is timed, and is noted in steps.csv."""

import csv
import datetime
import shlex
import subprocess
import sys
import time

HEADS = ("finished", "step", "seconds", "command")


def call(folder, name, *words):
    """Show a command, run it, note its time; its failure ends this process, same exit code."""
    words = [str(word) for word in words]
    print("$ " + shlex.join(words), flush=True)
    began = time.monotonic()
    code = subprocess.run(words).returncode
    if code != 0:
        sys.exit(code)
    seconds = time.monotonic() - began
    print(f"  {seconds:.0f} s", flush=True)
    note(folder / "steps.csv", name, seconds, shlex.join(words))


def check(path):
    """End this process where something else lies in the place of the table of steps."""
    if path.exists():
        with path.open("rb") as file:
            if file.readline().split() != [",".join(HEADS).encode()]:
                print(f"{path} is no table of steps: name another folder by -o", file=sys.stderr)
                sys.exit(2)


def note(path, name, seconds, command):
    fresh = not path.exists()
    now = datetime.datetime.now(datetime.UTC).isoformat(timespec="seconds")
    with path.open("a", newline="", encoding="utf-8") as file:
        rows = csv.writer(file, lineterminator="\n")
        rows.writerows([HEADS] if fresh else [])
        rows.writerow([now, name, f"{seconds:.1f}", command])


def taken(path):
    """{step: [seconds of each go]}, in the order of the first goes."""
    steps = {}
    if path.exists():
        with path.open(newline="", encoding="utf-8") as file:
            for row in csv.DictReader(file):
                steps.setdefault(row["step"], []).append(float(row["seconds"]))
    return steps

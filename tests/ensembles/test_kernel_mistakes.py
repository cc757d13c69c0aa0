"""What users get wrong in a kernel: one line each, with force, file and line, before all else."""

import re

import pytest

from flocsim.__main__ import main
from tests.helpers.small_study import SMALL, write_small

FORCE = """\
import math, random, time
import attrs
import numpy as np
from numpy.random import rand
from flocsim.forces import BodyForce, CentreForce, ContactForce, SurfaceForce
GENERATOR = np.random.default_rng(1)

@attrs.frozen
class Own({kind}):
    @staticmethod
    def kernel(view):
{body}
"""
KERNEL_LINE = FORCE[: FORCE.index("    @staticmethod")].count("\n") + 1

SEEN = {"BodyForce": "view.vy", "ContactForce": "view.overlap", "CentreForce": "view.gap",
        "SurfaceForce": "view.gap"}  # fmt: skip
ZEROS = {"BodyForce": ", 0.0, 0.0", "ContactForce": ", 0.0"}
NEVER = "if 0.0123 < X < 0.0124:\n    "
"""A branch that no sample reaches."""

MISTAKES = {
    "nan": ("return math.log(X - X)Z", "gives (nan|no number|-inf)"),
    "fractional power": ("return (-1e-9 - abs(X))**1.5Z", "gives no real number at"),
    "division by zero": ("return 1e-12/(X - X)Z", "gives (inf|no number)"),
    "pole at touching": ("return 1e-23/XZ", "gives (inf|no number) at a gap of 0 m"),
    "no return": ("x = X", "returns None"),
    "array": ("return np.zeros(2)[0]Z", "function zeros.* without arrays and lists"),
    "array in a branch": (NEVER + "a = np.ones(2)\nreturn 0.0Z", "without arrays and lists"),
    "list": ("return sum([X, 1.0])Z", "without arrays and lists"),
    "comprehension": ("return max([X for k in range(3)])Z", "without arrays and lists"),
    "random": ("return random.gauss(0.0, 1.0)Z", "draws random numbers"),
    "np.random": ("return np.random.normal()Z", "draws random numbers"),
    "from np.random": ("return rand()Z", "draws random numbers"),
    "generator": ("return GENERATOR.normal()Z", "draws random numbers"),
    "one part more": ("return X, 0.0Z", r"returns \(.*; it must return"),
    "one more in a branch": (NEVER + "return X, 0.0Z\nreturn 0.0Z", "Can't unify return"),
    "what numba has not": ("return time.time()Z", "cannot be compiled: .*own.py:"),
}  # fmt: skip


@pytest.mark.parametrize("kind", SEEN)
def test_each_mistake_is_one_line(kind, tmp_path, capsys):
    """All of a kind in one test, for each needs its own folder."""
    for number, (name, (text, said)) in enumerate(MISTAKES.items()):
        if name == "pole at touching" and "gap" not in SEEN[kind]:
            continue
        folder = tmp_path / str(number)
        folder.mkdir()
        body = text.replace("X", SEEN[kind]).replace("Z", ZEROS.get(kind, ""))
        lines = [f"        {line}" for line in body.split("\n")]
        (folder / "own.py").write_text(FORCE.format(kind=kind, body="\n".join(lines)))
        forces = "contact = false\n" if kind == "ContactForce" else ""
        study = SMALL + f'[forces]\n{forces}[forces.own]\nclass = "own:Own"\n'
        path = write_small(folder, study, vertices="[1]")
        assert main(["ensemble", str(path), "--dry-run"]) == 2, name
        error = capsys.readouterr().err.strip()
        assert "\n" not in error and "Own" in error, (name, error)
        assert KERNEL_LINE <= int(re.search(r"own\.py:(\d+)", error)[1]) < KERNEL_LINE + 6, error
        assert re.search(said, error), (name, error)

"""Whatever is edited, replaced or asked for otherwise while a sweep goes on: its joined file has
the labels and the physics of its parts, or there is none, and one line says which part differs."""

import os
import shutil
from pathlib import Path
from tempfile import mkdtemp

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

import flocsim
from flocsim.errors import FileError, FlocsimError, UsageError
from tests.helpers import parts_here
from tests.helpers.small_study import write_small, write_star_library
from tests.helpers.tiers import rest_slow

HAMAKER = "forces.van_der_waals.hamaker"
OWN = """\
import attrs
from flocsim.forces import CentreForce
@attrs.frozen
class Brush(CentreForce):
    strength: float = 1e-4
    @property
    def reach(self):
        return 2e-7
    @staticmethod
    def kernel(pair, strength, reach):
        return {} * strength * (reach - pair.gap)
"""
STUDY = """\
preset = "tang2014"
seed = 1
replicates = 2
[scene]
types = ["I"]
delta = [0.0]
[shapes]
{shapes}
vertices = [{vertices}]
[forces.brush]
class = "brush:Brush"
"""


def write_study(folder, factor=1.0, ratios=None):
    """A study with a force of its own, and a library where flocs of these ratios are given."""
    (folder / "brush.py").write_text(OWN.format(factor))
    shapes, vertices = "", 1
    if ratios:
        (folder / "stars.h5").unlink(missing_ok=True)
        write_star_library(folder / "stars.h5", ratios=ratios)
        shapes, vertices = 'source = "library"\nfile = "stars.h5"', 4
    text = STUDY.format(shapes=shapes, vertices=vertices)
    return flocsim.Study(write_small(folder, text, "s.toml"))


@pytest.fixture
def edits(tmp_path):
    """(folder, {number of a part: what is done before it is run}) of sweeps in this process."""
    done, count = {}, iter(range(100))
    with parts_here.used(lambda: done.get(next(count), lambda: None)()):
        yield tmp_path, done


def edit_module(folder):
    (folder / "brush.py").write_text(OWN.format(7.0))


def edit_library(folder):
    write_star_library(folder / "new.h5", ratios=(9.0, 17.0, 25.0))
    os.replace(folder / "new.h5", folder / "stars.h5")


EDITS = [(edit_module, None, at) for at in (0, 1)]
EDITS += [(edit_library, (8.0, 16.0), at) for at in (0, 1)]


@pytest.mark.parametrize(
    ("edit", "ratios", "at"),
    rest_slow(EDITS, lambda edit, ratios, at: edit is edit_module and at == 1),
)
def test_an_edit_ends_the_sweep_at_the_part_that_has_it(edits, edit, ratios, at):
    folder, done = edits
    study = write_study(folder, ratios=ratios)
    output, over = folder / "x.h5", {HAMAKER: [1e-20, 1e-19]}
    done[at] = lambda: edit(folder)
    with pytest.raises(UsageError, match=rf"000{at}.h5 is not the study that the sweep") as caught:
        flocsim.sweep(study, over, output)
    assert "\n" not in str(caught.value) and not output.exists()
    if at > 0:  # what is edited does not go on with the sweep
        with pytest.raises(UsageError, match=r"0000.h5 belongs to another study"):
            flocsim.sweep(flocsim.Study(folder / "s.toml"), over, output, mode="resume")
    study = write_study(folder, ratios=ratios)
    found = flocsim.sweep(study, over, output, mode="resume", overwrite=True)
    check(found, folder / "x.parts")


def test_a_joined_file_loses_no_value(edits):
    folder, _ = edits
    study = write_study(folder)
    flocsim.sweep(study, {HAMAKER: [1e-20]}, folder / "x.h5")
    shutil.rmtree(folder / "x.parts")
    with pytest.raises(UsageError, match=f"has other values of {HAMAKER}"):
        flocsim.sweep(study, {HAMAKER: [1e-19]}, folder / "x.h5", mode="resume")


def check(found, folder):
    """Labels, axes, numbers and physics of a joined file are those of its parts."""
    table = found.labelled("probabilities")
    [name] = found.swept
    parts = [flocsim.open(path) for path in sorted(folder.glob("????.h5"))]
    assert len(parts) == len(found.swept[name].values)
    kinds = [{k: v for k, v in part.stored("identity").items() if k.startswith("kernels.")}
             for part in parts]  # fmt: skip
    assert all(kind == kinds[0] for kind in kinds)
    for place, (label, part) in enumerate(zip(found.swept[name].values, parts, strict=True)):
        if name == "hamaker":
            assert part.stored("identity")[HAMAKER] == label
        else:
            assert part.count == label
        for axis in ("type", "vertices", "delta"):
            assert table.axes[axis].values.tolist() == part.labelled().axes[axis].values.tolist()
        for column, values in part.probabilities.items():
            np.testing.assert_array_equal(table.columns[column].values[place], values)


ASKED = st.fixed_dictionaries({
    "key": st.sampled_from([HAMAKER, "replicates"]),
    "values": st.lists(st.sampled_from([1, 2, 3]), min_size=1, max_size=3, unique=True),
    "delta": st.lists(st.sampled_from([0.0, 0.3, 0.9]), min_size=1, max_size=2, unique=True),
    "replicates": st.integers(1, 2),
    "factor": st.sampled_from([1.0, 1.0, 7.0]),
})  # fmt: skip
BETWEEN = ("nothing", "parts gone", "one replaced", "one gone")


@pytest.mark.slow
@pytest.mark.parametrize("examples", [60])
def test_two_sweeps_one_upon_the_other_have_right_labels(one_process, examples):
    @settings(max_examples=examples, deadline=None, derandomize=True,
              suppress_health_check=list(HealthCheck))  # fmt: skip
    @given(ASKED, ASKED, st.sampled_from(BETWEEN), st.booleans())
    def resumed(first, second, between, alike):
        folder = Path(mkdtemp())
        if alike:  # or else most are refused at once
            second = first | {"values": [*first["values"], *second["values"]]}
            second["values"] = list(dict.fromkeys(second["values"]))
        one = attempt(folder, first, "new")
        assert one is not None
        rows = {path.name: flocsim.open(path).count for path in folder.glob("x.parts/*.h5")}
        change(folder / "x.parts", between)
        before = (folder / "x.h5").read_bytes()
        found = attempt(folder, second, "resume")
        if found is None:
            assert (folder / "x.h5").read_bytes() == before
        for path in folder.glob("x.parts/*.h5") if between == "nothing" else ():
            assert flocsim.open(path).count >= rows.get(path.name, 0)
        shutil.rmtree(folder)

    resumed()


def attempt(folder, asked, mode):
    """The joined file of a sweep, checked; None where it was refused, in a line."""
    values = asked["values"]
    if asked["key"] == HAMAKER:
        values = [10.0 ** (each - 21) for each in values]
    changes = {"scene.delta": asked["delta"], "replicates": asked["replicates"]}
    study = write_study(folder, asked["factor"]).with_(changes)
    try:
        found = flocsim.sweep(study, {asked["key"]: values}, folder / "x.h5", mode=mode)
    except FlocsimError as error:
        assert "\n" not in str(error) and isinstance(error, UsageError | FileError)
        return None
    check(found, folder / "x.parts")
    check(flocsim.open(folder / "x.h5"), folder / "x.parts")
    return found


def change(folder, what):
    """Do to the parts of a sweep what users do."""
    first = folder / "0000.h5"
    if what == "parts gone":
        shutil.rmtree(folder)
    elif what == "one gone":
        first.unlink()
    elif what == "one replaced":
        shutil.copyfile(max(folder.glob("*.h5")), folder / "copy")
        os.replace(folder / "copy", first)


@pytest.mark.parametrize(
    ("over", "changes", "text"),
    [
        ({"stop.half_width": [0.1, 0.05]}, {}, "cannot be swept"),
        ({"scene.sizes": [["10 um", "20 um"], ["10 um", "15 um"]]},
         {"scene": {"kind": "kernel", "sizes": ["10 um", "20 um"]}}, "types are settling"),
    ],
)  # fmt: skip
def test_parts_that_have_other_axes_are_not_begun(tmp_path, over, changes, text):
    source = {"preset": "tang2014", "shapes": {"vertices": [1]}, **changes}
    with pytest.raises(UsageError, match=text):
        flocsim.sweep(flocsim.Study(source, tmp_path), over, tmp_path / "x.h5")
    assert not (tmp_path / "x.parts").exists()

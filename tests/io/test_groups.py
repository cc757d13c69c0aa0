"""A kind of file is declared once: it is written, read, checked and shown from that."""

import io

import h5py
import numpy as np
import pytest

from flocsim.errors import FileError
from flocsim.io.groups import FileFormat, Group, declared
from flocsim.io.hdf5 import open_hdf5
from tests.helpers.sealed import read_sealed, seal

SCALES = {
    "replicate": ("i8", "1", "number of the replicate"),
    "class": ("text", "1", "class"),
    "touch": ("i8", "1", "number of the touch"),
}
SPEEDS = {"speed": ("f8", "m s-1", "mean downward velocity")}
ENDS = {"end": ("u1", "1", "how it ended"), "steps": ("i8", "1", "accepted steps")}
CODES = {"end": ((0, 1, 255), ("fell", "stuck", "unknown"))}
FLOCS = Group.of(
    declared(SPEEDS, ("replicate", "class")) | declared(ENDS, ("replicate",), CODES, low=0), SCALES
)
TOUCHES = Group.of(
    declared({"of": ("i4", "1", "replicate")}, ("touch",), low=0, along={"of": "replicate"}), SCALES
)
LONE = FileFormat(
    "lone", 3, "results of lone flocs", {"flocs": FLOCS, "touches": TOUCHES}, oldest=2,
    optional=("touches",),
)  # fmt: skip
VALUES = {
    "replicate": [0, 1, 2], "class": ["small", "large"], "speed": np.arange(6.0).reshape(3, 2),
    "end": [1, 0, 255], "steps": [5, 6, 7], "touch": [0, 1], "of": [2, 0],
}  # fmt: skip
RUN = {"config": "seed = 1\n", "seed": 1, "wall_time": 0.5, "checked": True}


@pytest.fixture
def path(tmp_path):
    """A file of flocs and touches."""
    groups = {"flocs": FLOCS.labelled(VALUES), "touches": TOUCHES.labelled(VALUES)}
    LONE.write(tmp_path / "a.h5", groups, RUN, {"about": "words"})
    return tmp_path / "a.h5"


def test_what_is_written_is_read(path):
    found = LONE.read(path)
    assert found.run == RUN and found.attributes["about"] == "words"
    assert open_hdf5(path).kind == found.format == "lone"
    for group in LONE.groups:
        for name, values in found.groups[group].items():
            assert values.tolist() == np.asarray(VALUES[name]).tolist()


def test_a_group_is_shown_with_axes_units_and_words(path):
    found = LONE.read(path)
    assert found.indices == {"flocs": ["replicate"], "touches": ["touch"]}
    speed = found.labelled("flocs").columns["speed"]
    assert speed.axes == ("replicate", "class") and speed.about["units"] == "m s-1"
    file = io.StringIO()
    found.labelled("flocs").write_csv(file, found.indices["flocs"])
    assert file.getvalue().splitlines()[:2] == [
        "replicate,speed_small,speed_large,end,steps", "0,0.0,1.0,stuck,5"
    ]  # fmt: skip


def test_an_optional_group_may_be_left_out(tmp_path):
    LONE.write(tmp_path / "a.h5", {"flocs": FLOCS.labelled(VALUES)})
    assert list(LONE.read(tmp_path / "a.h5").groups) == ["flocs"]


def test_columns_are_filled_a_part_at_a_time(tmp_path):
    def fill(group):
        for row in range(3):
            for name in FLOCS.columns:
                group[name][row] = np.asarray(VALUES[name])[row]

    LONE.write(tmp_path / "a.h5", {"flocs": FLOCS.labelled(VALUES)}, fill={"flocs": fill})
    LONE.write(tmp_path / "b.h5", {"flocs": FLOCS.labelled(VALUES)})
    one, other = (LONE.read(tmp_path / name).groups["flocs"] for name in ("a.h5", "b.h5"))
    assert all(np.array_equal(one[name], other[name]) for name in one)


def remove(name):
    return lambda file: file.__delitem__(name)


def put(name, place, value):
    return lambda file: file[name].__setitem__(place, value)


def instead(name, values):
    def change(file):
        del file[name]
        file[name] = values

    return change


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (remove("flocs/speed"), "flocs/speed is missing"),
        (remove("touches/of"), "touches/of is missing"),
        (remove("flocs"), "is missing"),
        (lambda file: file.create_dataset("flocs/more", data=1.0), "flocs/more is unknown"),
        (lambda file: file.create_dataset("more", data=[1.0]), "more is unknown"),
        (instead("flocs/steps", np.zeros(3)), "flocs/steps holds f8 of shape"),
        (instead("flocs/steps", np.zeros((3, 1), int)), "expected i8 along replicate"),
        (instead("flocs/steps", np.zeros(4, int)), "flocs/steps holds i8 of shape"),
        (put("flocs/steps", 0, -1), "flocs/steps has impossible values"),
        (put("flocs/end", 0, 2), "flocs/end has impossible values"),
        (put("flocs/class", 0, "\x1b[31m"), "flocs/class has impossible values"),
        (put("touches/of", 0, 3), "touches/of has impossible values"),
        (lambda file: file.attrs.__setitem__("format", "else"), 'is a "else" file: name a file'),
        (lambda file: file.attrs.__delitem__("format"), "is a file of another kind"),
        (lambda file: file.attrs.__delitem__("schema_version"), "has schema version None"),
        (lambda file: file.attrs.__setitem__("schema_version", 1), "or run the study again"),
        (lambda file: file.attrs.__setitem__("schema_version", 4), "reads 3: read it with"),
    ],
)
def test_what_is_not_as_declared_is_refused_in_one_line(path, change, said):
    image = io.BytesIO(read_sealed(path))
    with h5py.File(image, "r+") as file:
        change(file)
    path.write_bytes(seal(image.getvalue()))
    with pytest.raises(FileError, match=said) as caught:
        LONE.read(path)
    assert str(path) in str(caught.value) and "\n" not in str(caught.value)


def test_a_full_disk_is_one_line_and_leaves_nothing(tmp_path):
    """Errors of writing never reach HDF5, which can crash on them."""

    def fail(group):
        raise OSError(28, "No space left on device")

    with pytest.raises(FileError, match=r"a\.h5 could not be written: No space left"):
        LONE.write(tmp_path / "a.h5", {"flocs": FLOCS.labelled(VALUES)}, fill={"flocs": fail})
    assert list(tmp_path.iterdir()) == []

"""`flocsim trajectory`: one replicate as pictures and as a file."""

import h5py
import numpy as np
import pytest

from flocsim.__main__ import main
from flocsim.commands import trajectory
from tests.helpers.rounding import to_rounding
from tests.helpers.sealed import read_sealed, seal
from tests.helpers.small_study import write_small
from tests.helpers.tiers import rest_slow


@pytest.fixture
def folder(in_tmp):
    """The current folder, with the small config in it."""
    write_small(in_tmp)
    return in_tmp


def call(capsys, *words):
    """(exit code, lines of output, lines of errors) of `flocsim trajectory`; two frames where the
    words name no number."""
    few = [] if "--frames" in words else ["--frames", 2]
    code = main(["trajectory", *map(str, [*words, *few])])
    output, errors = capsys.readouterr()
    return code, output.splitlines(), errors.splitlines()


def test_a_strip_of_frames_the_distance_and_the_motion(folder, capsys):
    words = ["--distance", "d.svg", "--save", "motion.h5", "--type", "III", "--vertices", 4]
    words += ["--frames", 5]
    code, output, errors = call(capsys, "small.toml", *words)
    assert (code, errors) == (0, [])
    assert output[0].startswith("type III, N = 4, delta = 0, replicate 0: A; collision at ")
    assert output[1].startswith("preset tang2014 · ") and "flocs grown by flocsim" in output[1]
    assert output[2:] == ["small-III-4-0-0.png", "d.svg", "motion.h5"]
    assert (folder / "small-III-4-0-0.png").read_bytes().startswith(b"\x89PNG")
    assert b"<svg" in (folder / "d.svg").read_bytes()
    with h5py.File(folder / "motion.h5") as file:
        assert file["position"].shape == (len(file["time"]), 2, 3)
        assert file["vertices_0"].shape == (4, 2)
        assert file.attrs["config"] == (folder / "small.toml").read_text()
    sealed = read_sealed(folder / "motion.h5")
    assert seal(sealed) == (folder / "motion.h5").read_bytes()


def test_forces_and_an_animation(folder, monkeypatch, capsys):
    from PIL import Image

    monkeypatch.setattr(trajectory, "ANIMATION_FRAMES", 4)
    words = ["--type", "III", "--vertices", 1, "--forces", "f.png", "--animation", "a.gif"]
    code, output, errors = call(capsys, "small.toml", *words, "--set", "scene.start_gap=1e-6")
    assert (code, errors, output[3:]) == (0, [], ["f.png", "a.gif"])
    with Image.open(folder / "a.gif") as animation:
        assert animation.n_frames == 4
        assert animation.info["loop"] == 0


@pytest.mark.slow
def test_set_changes_the_scene(folder, capsys):
    words = ["small.toml", "--vertices", 4, "--replicate", 1, "--overwrite"]
    lines = [call(capsys, *words, *more)[1][0] for more in ([], ["--set", "zone.root=inner"])]
    assert lines[0].split(";")[1] == lines[1].split(";")[1]  # the same touch
    assert [line.split(";")[0][-1] for line in lines] == ["B", "D"]


def test_the_motion_is_that_of_the_ensembles_replicate(folder, capsys):
    from flocsim.io.results.file import read_results

    write_small(folder, types='["I"]', vertices="[16]", delta="[0.0]")
    assert main(["ensemble", "small.toml", "--quiet"]) == 0
    words = ["--replicate", 2, "--type", "I", "--vertices", 16, "--delta", 0, "--save", "m.h5"]
    assert call(capsys, "small.toml", *words)[0] == 0
    table = read_results(folder / "small.h5").replicates
    with h5py.File(folder / "m.h5") as file:
        assert file["time"][-1] == table["t_end"][0, 0, 0, 2]
        # numpy's hypot in the one, the compiled one in the other.
        apart = np.hypot(*(file["position"][-1, 1, :2] - file["position"][-1, 0, :2]))
        assert apart == to_rounding(table["d_c_last"][0, 0, 0, 2])
        assert file["position"][0, :, 2].tolist() == [
            table["angle_i"][0, 0, 0, 2],
            table["angle_j"][0, 0, 0, 2],
        ]


@pytest.mark.parametrize(
    ("more", "said"),
    rest_slow(
        [
            ('types = ["III"]\ntime_limit = 1e-4', "undecided (time limit)"),
            ("", "missed; end at "),
        ],
        lambda more, said: more == "",
    ),
)
def test_other_ends_are_drawn_as_well(folder, capsys, more, said):
    write_small(folder, types=more.removeprefix("types = ") or '["III"]', delta="[1.5]")
    code, output, errors = call(capsys, "small.toml", "--distance", "d.png")
    assert (code, errors) == (0, [])
    assert said in output[0]
    assert "collision" not in output[0]


WRONG = [
    (["--type", "II"], 2, "--type must be one of I, III, found II"),
    (["--vertices", 3], 2, "--vertices must be one of 1, 4, 16, found 3"),
    (["--delta", 0.3], 2, "--delta must be one of 0.0, 1.0, found 0.3"),
    (["--delta", "nan"], 2, "--delta must be one of 0.0, 1.0, found nan"),
    (["--replicate", -1], 2, "replicate must be a whole number of at least 0, found -1"),
    (["--set", "seed=-3"], 2, "seed must be an integer from 0"),
    (["-o", "strip.gif"], 2, "strip.gif: its name must end in .png or .pdf or .svg"),
    (["--distance", "d"], 2, "d: its name must end in .png"),
    (["-o", "no/folder.png"], 74, "no/folder.png could not be written"),
    (["--save", "no/folder.h5"], 74, "no/folder.h5 could not be written"),
    (["--save", "small.toml"], 2, "writing small.toml would replace small.toml"),
]


@pytest.mark.parametrize(("words", "code", "said"), WRONG)
def test_wrong_options_are_one_line_before_anything_runs(folder, capsys, words, code, said):
    found, output, errors = call(capsys, "small.toml", *words)
    assert (found, output, len(errors)) == (code, [], 1)
    assert said in errors[0]
    assert [path.name for path in folder.iterdir()] == ["small.toml"]


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"preset": '"tang2014-literal"'}, "flocsim: no attraction zone"),
        ({"seed": "="}, "flocsim: small.toml:2: not valid TOML"),
    ],
)
def test_wrong_configs_are_one_line(folder, capsys, changes, said):
    write_small(folder, **changes)
    code, output, errors = call(capsys, "small.toml")
    assert (code, output, len(errors)) == (2, [], 1)
    assert errors[0].startswith(said)


def test_an_animation_is_a_gif(folder, capsys):
    code, output, errors = call(capsys, "small.toml", "--animation", "a.mp4")
    assert (code, output) == (2, [])
    assert errors == ["flocsim: a.mp4: its name must end in .gif"]

"""`flocsim fit` from pictures to the shape library."""

import argparse

import numpy as np
import pytest
from PIL import Image
from real_images import real_image

from flocsim.commands import fit
from flocsim.errors import FileError, UsageError
from flocsim.io.shape_library import read_library


def run(*arguments):
    """The exit code of `flocsim fit` with the arguments."""
    parser = argparse.ArgumentParser(prog="flocsim")
    fit.add_parser(parser.add_subparsers(required=True))
    args = parser.parse_args(["fit", *map(str, arguments)])
    return args.run(args)


@pytest.fixture
def frame(tmp_path):
    """A folder with one picture of three dark flocs, a larger and two smaller ones."""
    y, x = np.mgrid[:150, :200]
    grey = np.full((150, 200), 0.8)
    for cx, cy, r in ((50, 50, 20), (130, 90, 9), (160, 40, 4.6)):
        angle = np.arctan2(y - cy, x - cx)
        grey[np.hypot(x - cx, y - cy) < r * (1 + 0.25 * np.cos(4 * angle))] = 0.1
    (tmp_path / "frames").mkdir()
    Image.fromarray((255 * grey).astype(np.uint8)).save(tmp_path / "frames/a.png")
    return tmp_path / "frames"


def test_pictures_become_a_library(tmp_path, frame, capsys):
    library = tmp_path / "shapes.h5"
    assert run(frame, "--pixel-size", "0.5e-6", "--vertices", "16,4,4", "-o", library) == 0
    printed = capsys.readouterr()
    assert "a.png: 3 dark flocs; foreground" in printed.out
    assert "r_eq <= 5 px (1)" in printed.out and "r_eq > 5 px (2)" in printed.out
    assert "1 (circle)" in printed.out
    assert printed.err == ""
    entries = read_library(library)
    assert [entry.floc_id for entry in entries] == ["a.png#1", "a.png#2", "a.png#3"]
    assert all(list(entry.fits) == [1, 4, 16] for entry in entries)
    assert all(entry.pixel_size == 0.5e-6 for entry in entries)
    table = next(line for line in printed.out.splitlines() if line.split()[0] == "16")
    mean = np.mean([entry.fits[16].relative_error for entry in entries])
    assert float(table.split()[-1]) == pytest.approx(mean, abs=0.006)


def test_only_the_largest_flocs(tmp_path, frame, capsys):
    options = ("--pixel-size", "1e-6", "--vertices", "4", "-o", tmp_path / "s.h5")
    assert run(frame / "a.png", *options, "--max-flocs", "2") == 0
    assert "the 2 largest fitted" in capsys.readouterr().out
    areas = [entry.area for entry in read_library(tmp_path / "s.h5")]
    assert run(frame / "a.png", *options) == 0
    every = [entry.area for entry in read_library(tmp_path / "s.h5")]
    assert sorted(areas) == sorted(every)[1:]


def test_unusable_pictures_are_skipped_in_one_line_each(tmp_path, frame, capsys):
    (frame / "b.png").write_bytes(b"no picture")
    options = ("--pixel-size", "1e-6", "--vertices", "4", "-o", tmp_path / "s.h5")
    assert run(frame, tmp_path / "absent.png", *options) == 0
    errors = capsys.readouterr().err.splitlines()
    assert len(errors) == 2
    assert "b.png" in errors[0] and "absent.png" in errors[1]


def test_nothing_fitted_is_an_error_and_writes_nothing(tmp_path, capsys):
    (tmp_path / "empty").mkdir()
    assert run(tmp_path / "empty", "--pixel-size", "1e-6", "-o", tmp_path / "s.h5") == 2
    assert "holds no pictures" in capsys.readouterr().err
    assert not (tmp_path / "s.h5").exists()


def test_pictures_of_one_name_stay_apart(tmp_path, frame):
    (frame / "more").mkdir()
    (frame / "more/a.png").write_bytes((frame / "a.png").read_bytes())
    options = ("--pixel-size", "1e-6", "--vertices", "4", "-o", tmp_path / "s.h5")
    assert run(frame / "a.png", frame / "more", frame / "a.png", *options) == 0
    assert len(read_library(tmp_path / "s.h5")) == 6


def test_overlays_are_drawn(tmp_path, frame):
    options = ("--pixel-size", "1e-6", "--vertices", "8", "-o", tmp_path / "s.h5")
    assert run(frame, *options, "--overlay", tmp_path / "one.png") == 0
    with Image.open(tmp_path / "one.png") as drawn:
        red, _, blue = (np.asarray(drawn.convert("RGB"), int)[..., k] for k in range(3))
    assert np.count_nonzero(red - blue > 100) > 300
    (frame / "c.png").write_bytes((frame / "a.png").read_bytes())
    assert run(frame, *options, "--overlay", tmp_path / "two.png") == 0
    assert (tmp_path / "two-a.png").exists() and (tmp_path / "two-c.png").exists()


def test_a_spheroradius_above_the_flocs_is_told_once(tmp_path, frame, capsys):
    options = ("--pixel-size", "1e-6", "--vertices", "4,8", "-o", tmp_path / "s.h5")
    assert run(frame, *options, "--radius", "5") == 0
    errors = capsys.readouterr().err.splitlines()
    assert len(errors) == 1 and "not below r_eq of 1 floc," in errors[0]


@pytest.mark.parametrize(
    ("option", "value"),
    [
        ("--pixel-size", "0"),
        ("--pixel-size", "nan"),
        ("--pixel-size", "one"),
        ("--radius", "-1"),
        ("--min-radius", "inf"),
        ("--vertices", "4,,8"),
        ("--vertices", "0"),
        ("--vertices", "2.5"),
        ("--max-flocs", "0"),
        ("--overlay", "picture.gif"),
    ],
)
def test_wrong_numbers_are_named(frame, option, value):
    arguments = ["--pixel-size=1e-6", f"{option}={value}"]
    with pytest.raises(UsageError, match=option) as caught:
        run(frame, *arguments)
    assert caught.value.exit_code == 2


def test_the_pixel_size_is_needed(frame, capsys):
    with pytest.raises(SystemExit) as caught:
        run(frame)
    assert caught.value.code == 2
    assert "--pixel-size" in capsys.readouterr().err


def test_an_output_that_cannot_be_written_stops_before_the_work(tmp_path, frame, capsys):
    for output in (tmp_path / "no folder/s.h5", tmp_path):
        with pytest.raises(FileError) as caught:
            run(frame, "--pixel-size", "1e-6", "-o", output)
        assert caught.value.exit_code == 74
    assert capsys.readouterr().out == ""


def test_an_interrupt_leaves_no_file(tmp_path, frame, capsys, monkeypatch):
    def interrupt(*_):
        raise KeyboardInterrupt

    monkeypatch.setattr(fit, "fit_region", interrupt)
    assert run(frame, "--pixel-size", "1e-6", "-o", tmp_path / "s.h5") == 130
    assert "interrupted" in capsys.readouterr().err
    assert not (tmp_path / "s.h5").exists()


def test_a_real_frame(tmp_path, capsys):
    options = ("--pixel-size", "0.95e-6", "--vertices", "4,16", "--max-flocs", "4")
    assert run(real_image("flocpy/024.png"), *options, "-o", tmp_path / "s.h5") == 0
    assert "024.png: 21 dark flocs" in capsys.readouterr().out
    for entry in read_library(tmp_path / "s.h5"):
        errors = [entry.fits[n].relative_error for n in (1, 4, 16)]
        assert errors == sorted(errors, reverse=True)

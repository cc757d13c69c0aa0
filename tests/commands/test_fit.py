"""`flocsim fit` from pictures to the shape library."""

import argparse
import csv
import re

import numpy as np
import pytest
from PIL import Image

from flocsim.__main__ import main
from flocsim.commands import add_command, fit_pictures
from flocsim.errors import FileError, UsageError
from flocsim.io.shape_library import read_library, read_settings
from tests.helpers.choices import choose


def run(*arguments):
    """The exit code of `flocsim fit` with the arguments."""
    parser = argparse.ArgumentParser(prog="flocsim")
    add_command(parser.add_subparsers(required=True), "fit")
    args = parser.parse_args(["fit", *map(str, arguments)])
    return args.run(args)


def code_of(*arguments):
    """The exit code of the command `flocsim fit`, also where its words are refused."""
    try:
        return main(["fit", *map(str, arguments)])
    except SystemExit as end:
        return end.code


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
    assert re.search(r"3 flocs, r = 1 px: .* at N = 1, .* at N = 4, .* at N = 16", printed.out)
    assert printed.err == ""
    entries = read_library(library)
    assert [entry.floc_id for entry in entries] == ["a.png#1", "a.png#2", "a.png#3"]
    assert all(list(entry.fits) == [1, 4, 16] for entry in entries)
    assert all(entry.pixel_size == 0.5e-6 for entry in entries)
    mean = np.mean([entry.fits[16].relative_error for entry in entries])
    assert f"{mean:.2f} at N = 16" in printed.out


@pytest.mark.parametrize(
    ("options", "kept"),
    [((), 1), (("--max-error", "60"), 2), (("--max-error", "1e-9"), 0), (("--vertices", "8"), 2)],
)
def test_flocs_whose_fit_is_too_far_off_are_left_out(tmp_path, capsys, options, kept):
    y, x = np.mgrid[:200, :400]
    grey = np.full(x.shape, 0.8)
    for cx, arms in ((100, 9), (300, 2)):
        angle = np.arctan2(y - 100, x - cx)
        grey[np.hypot(x - cx, y - 100) < 40 * (1 + 0.35 * np.cos(arms * angle))] = 0.1
    Image.fromarray((255 * grey).astype(np.uint8)).save(tmp_path / "a.png")
    library = tmp_path / "s.h5"
    common = ("--pixel-size", "1e-6", "--neck", "0", "--vertices", "16", "-o", library)
    code = code_of(tmp_path / "a.png", *common, *options)
    assert (code == 0) == (kept > 0)
    if kept:
        assert len(read_library(library)) == kept
        rows = list(csv.DictReader(library.with_suffix(".csv").read_text().splitlines()))
        reasons = [row["left_out_because"] for row in rows]
        assert reasons == [""] * kept + ["RE above 10 %"] * (2 - kept)
        assert all(float(row["re_percent_r1_N16"]) > 10 for row in rows[1:2] if kept == 1)
    assert ("--max-error" in capsys.readouterr().err) == (kept < 2)


def test_a_pixel_size_with_its_unit(tmp_path, frame):
    options = ("--vertices", "4", "--min-radius", "12", "-o", tmp_path / "s.h5")
    assert run(frame, "--pixel-size", "0.95 um", *options) == 0
    assert [entry.pixel_size for entry in read_library(tmp_path / "s.h5")] == [0.95e-6]


def test_a_doubtful_pixel_size_is_told_and_kept(tmp_path, frame, capsys):
    options = ("--vertices", "4", "--min-radius", "12", "-o", tmp_path / "s.h5")
    assert run(frame, "--pixel-size", "8.6 mm", *options) == 0
    [line] = capsys.readouterr().err.splitlines()
    assert line.startswith(
        "flocsim: warning: the pixel size = 0.0086 m is implausible: the side of a"
    )
    assert line.removeprefix("flocsim: warning: ") == read_settings(tmp_path / "s.h5")["warning"]


def test_unusable_pictures_are_skipped_in_one_line_each(tmp_path, frame, capsys):
    (frame / "b.png").write_bytes(b"no picture")
    options = ("--pixel-size", "1e-6", "--vertices", "4", "-o", tmp_path / "s.h5")
    assert run(frame, tmp_path / "absent.png", *options) == 0
    errors = capsys.readouterr().err.splitlines()
    assert len(errors) == 2
    assert "b.png" in errors[0] and "absent.png" in errors[1]


def test_nothing_fitted_is_an_error_and_writes_nothing(tmp_path, capsys):
    (tmp_path / "empty").mkdir()
    assert code_of(tmp_path / "empty", "--pixel-size", "1e-6", "-o", tmp_path / "s.h5") == 2
    assert "holds no pictures" in capsys.readouterr().err
    assert not (tmp_path / "s.h5").exists()
    options = ("--pixel-size", "1e-6", "--vertices", "4", "-o", tmp_path / "s.h5")
    assert code_of(tmp_path / "absent.png", *options) == 2
    assert "nothing was fitted" in capsys.readouterr().err
    # Else the call that is right would find its table in the way.
    assert sorted(path.name for path in tmp_path.iterdir()) == ["empty"]


def test_pictures_of_one_name_stay_apart(tmp_path, frame):
    (frame / "more").mkdir()
    (frame / "more/a.png").write_bytes((frame / "a.png").read_bytes())
    options = ("--pixel-size", "1e-6", "--vertices", "4", "-o", tmp_path / "s.h5")
    assert run(frame / "a.png", frame / "more", frame / "a.png", *options) == 0
    assert len(read_library(tmp_path / "s.h5")) == 6


def test_the_summary_lists_every_region(tmp_path, frame):
    options = ("--pixel-size", "0.5e-6", "--vertices", "4,8", "-o", tmp_path / "s.h5")
    assert run(frame, *options, "--min-radius", "6", "--max-radius", "16") == 0
    with open(tmp_path / "s.csv", newline="") as table:
        rows = list(csv.DictReader(table))
    assert [row["left_out_because"] for row in rows] == ["", "too large", "too small"]
    (entry,) = read_library(tmp_path / "s.h5")
    assert float(rows[0]["r_eq_m"]) == pytest.approx(0.5e-6 * entry.equivalent_radius, rel=1e-3)
    for name in ("perimeter", "aspect_ratio", "circularity", "solidity", "feret_max", "feret_min"):
        head = name if name in rows[0] else f"{name}_px"
        assert float(rows[0][head]) == pytest.approx(getattr(entry.measures, name), rel=1e-4)
        assert rows[1][head] == rows[2][head] == ""
    for n in (1, 4, 8):
        error = float(rows[0][f"re_percent_r1_N{n}"])
        assert error == pytest.approx(entry.fits[n].relative_error, abs=1e-4)
    assert rows[1]["re_percent_r1_N4"] == ""


def test_two_processes_write_the_same_bytes(tmp_path, frame, capsys):
    (frame / "b.png").write_bytes((frame / "a.png").read_bytes()[:300])
    told = []
    for jobs in ("1", "2"):
        options = ("--pixel-size", "1e-6", "--vertices", "4,16", "--jobs", jobs)
        assert run(frame, *options, "-o", tmp_path / f"{jobs}.h5") == 0
        told.append(capsys.readouterr())
    for ending in ("h5", "csv"):
        one, two = ((tmp_path / f"{jobs}.{ending}").read_bytes() for jobs in "12")
        assert one == two
    assert told[0].err == told[1].err and "b.png" in told[0].err
    assert told[0].out.replace("1.h5", "2.h5").replace("1.csv", "2.csv") == told[1].out


def test_several_spheroradii_go_to_one_library(tmp_path, frame, capsys):
    options = ("--pixel-size", "1e-6", "--vertices", "8", "--radius", "2,1")
    assert run(frame, *options, "-o", tmp_path / "s.h5") == 0
    entries = read_library(tmp_path / "s.h5")
    assert [e.floc_id for e in entries[::3]] == ["a.png#1 r=1", "a.png#1 r=2"]
    assert [e.fits[8].shape.radius for e in entries[::3]] == [1e-6, 2e-6]
    printed = capsys.readouterr().out
    assert "r = 1 px" in printed and "r = 2 px" in printed


def test_the_library_is_drawn_and_described(tmp_path, frame, capsys):
    run(frame, "--pixel-size", "1e-6", "--vertices", "4,8", "-o", tmp_path / "s.h5")
    for name, words in (("plot", ["--output-dir", tmp_path]), ("info", [])):
        parser = argparse.ArgumentParser()
        add_command(parser.add_subparsers(), name)
        args = parser.parse_args([name, str(tmp_path / "s.h5"), *map(str, words)])
        assert args.run(args) == 0
    printed = capsys.readouterr().out
    assert "s-figure-2.png" in printed and "s-figure-3.png" in printed
    assert "3 of 1 picture" in printed and "method         pattern" in printed
    for number in (2, 3):
        assert (tmp_path / f"s-figure-{number}.png").stat().st_size > 5000


def test_masks_are_taken_as_they_are(tmp_path, capsys):
    mask = np.zeros((40, 50), np.uint8)
    mask[0:12, 5:20] = mask[20:35, 25:45] = 255
    np.savez(tmp_path / "masks.npz", one=mask)
    options = ("--pixel-size", "1e-6", "--vertices", "4", "--masks", "-o", tmp_path / "s.h5")
    assert run(tmp_path / "masks.npz", *options) == 0
    entries = read_library(tmp_path / "s.h5")
    assert [entry.floc_id for entry in entries] == ["masks.npz:one#1", "masks.npz:one#2"]
    assert [entry.area for entry in entries] == [180, 300]
    assert "2 masked flocs" in capsys.readouterr().out


def test_masks_among_pictures_are_left_out_in_a_line_each(tmp_path, frame, capsys):
    mask = np.zeros((40, 50), np.uint8)
    mask[5:12, 5:20] = mask[20:35, 25:45] = 255
    labels = mask.astype(np.uint16)
    labels[5:12, 5:20] = 2
    Image.fromarray(mask).save(frame / "a_mask.png")
    Image.fromarray(labels).save(frame / "a_labels.tif")
    options = ("--pixel-size", "1e-6", "--vertices", "4", "-o", tmp_path / "s.h5")
    assert run(frame, *options) == 0
    lines = capsys.readouterr().err.splitlines()
    for line, name in zip(lines, ("a_labels.tif", "a_mask.png"), strict=True):
        assert f"{name}: was left out, as it holds masks or labels: give --masks" in line
    assert {entry.image for entry in read_library(tmp_path / "s.h5")} == {"a.png"}
    assert code_of(frame / "a_mask.png", *options, "--overwrite") == 2


def test_a_photograph_given_as_a_mask_is_refused_and_the_masks_are_fitted(tmp_path, frame, capsys):
    noise = np.random.default_rng(1).integers(0, 255, (60, 60)).astype(np.uint8)
    Image.fromarray(noise).save(frame / "noise.png")
    options = ("--pixel-size", "1e-6", "--vertices", "4", "--masks", "-o", tmp_path / "s.h5")
    assert run(frame, *options) == 0
    (line,) = capsys.readouterr().err.splitlines()
    assert "noise.png: is a photograph, not a mask" in line


QUICK = ("--pixel-size", "1e-6", "--vertices", "4")


def flocs_of(library):
    """{name: (area, vertices)} of a library's flocs."""
    entries = read_library(library)
    return {each.floc_id: (each.area, each.fits[4].table.place.tolist()) for each in entries}


def test_label_images_are_read_back_as_the_same_flocs(tmp_path, frame):
    (frame / "b.bmp").write_bytes(b"no picture")
    out = ("--masks-out", tmp_path / "labels")
    assert run(frame, *QUICK, "-o", tmp_path / "s.h5", *out) == 0
    assert [path.name for path in (tmp_path / "labels").iterdir()] == ["a.png"]
    again = ("--masks", "--min-radius", "1", "-o", tmp_path / "again.h5")
    assert run(tmp_path / "labels", *QUICK, *again) == 0
    assert flocs_of(tmp_path / "s.h5") == flocs_of(tmp_path / "again.h5")
    with Image.open(tmp_path / "labels/a.png") as picture:
        assert picture.mode == "I;16" and set(np.unique(picture)) == {0, 1, 2, 3}
    with pytest.raises(UsageError, match=r"labels/a\.png already exists"):
        run(frame, *QUICK, "-o", tmp_path / "more.h5", *out)
    with pytest.raises(UsageError, match="which is an input: name another"):
        run(frame, *QUICK, "-o", tmp_path / "more.h5", "--masks-out", frame, "--overwrite")


def test_an_edited_label_image_counts_and_numbers_stay(tmp_path, frame):
    """One floc left, with another's number; a second one painted in."""
    assert run(frame, *QUICK, "--review", "-o", tmp_path / "all.h5") == 0
    choices = choose(tmp_path / "all-review.html", {"a.png#1": "reject", "a.png#2": "reject"})
    options = ("--reviewed", choices, "--masks-out", tmp_path / "labels")
    assert run(frame, *QUICK, *options, "-o", tmp_path / "s.h5") == 0
    assert list(flocs_of(tmp_path / "s.h5")) == ["a.png#3"]
    masks = (tmp_path / "labels", *QUICK, "--masks", "--overwrite", "-o", tmp_path / "m.h5")
    assert run(*masks) == 0
    assert flocs_of(tmp_path / "m.h5") == flocs_of(tmp_path / "s.h5")
    with Image.open(tmp_path / "labels/a.png") as picture:
        labels = np.array(picture)
    labels[100:120, 100:130] = 9
    Image.fromarray(labels).save(tmp_path / "labels/a.png")
    assert run(*masks) == 0
    assert {k: v[0] for k, v in flocs_of(tmp_path / "m.h5").items() if k[-1] == "9"} == {
        "a.png#9": 600
    }


def test_a_threshold_of_ones_own(tmp_path, frame, capsys):
    options = (*QUICK, "--overwrite", "-o", tmp_path / "s.h5")
    areas = {}
    for threshold in ("0.2", "0.6"):
        assert run(frame, *options, "--threshold", threshold) == 0
        assert f"threshold {threshold}" in capsys.readouterr().out
        areas[threshold] = sum(entry.area for entry in read_library(tmp_path / "s.h5"))
    assert areas["0.2"] > 1.02 * areas["0.6"]


def test_areas_are_kept_on_request(tmp_path, frame):
    options = ("--pixel-size", "1e-6", "--vertices", "4", "--preserve-area")
    assert run(frame, *options, "-o", tmp_path / "s.h5") == 0
    for entry in read_library(tmp_path / "s.h5"):
        assert entry.fits[4].shape.area == pytest.approx(entry.area * 1e-12, rel=1e-8)


@pytest.mark.slow
def test_holes_are_kept_on_request(tmp_path, capsys):
    """In pictures and in masks, from there to figures, tables and the list of flocs."""
    y, x = np.mgrid[:300, :400]
    floc = (np.hypot(x - 60, y - 60) < 40) & (np.hypot(x - 52, y - 66) > 14)
    (tmp_path / "frames").mkdir()
    Image.fromarray(np.where(floc, 30, 200).astype(np.uint8)).save(tmp_path / "frames/a.png")
    np.save(tmp_path / "mask.npy", floc)
    pixel = ("--pixel-size", "1e-6", "--vertices", "16", "--radius", "2")
    for source in ((tmp_path / "frames",), (tmp_path / "mask.npy", "--masks")):
        plain, kept = tmp_path / "plain.h5", tmp_path / "kept.h5"
        assert run(*source, *pixel, "-o", plain, "--overwrite") == 0
        assert run(*source, *pixel, "--holes", "-o", kept, "--overwrite") == 0
        [filled], [open_one] = read_library(plain), read_library(kept)
        assert open_one.area == pytest.approx(floc.sum(), rel=0.01)
        assert filled.area == pytest.approx(floc.sum() + np.pi * 14**2, rel=0.01)
        assert open_one.fits[16].shape.is_compound and not filled.fits[16].shape.is_compound
        assert open_one.fits[16].shape.area == pytest.approx(1e-12 * floc.sum(), rel=0.03)
        assert read_settings(kept)["holes"] and "holes" not in read_settings(plain)
    capsys.readouterr()
    shapes_parser = argparse.ArgumentParser(prog="flocsim")
    add_command(shapes_parser.add_subparsers(required=True), "shapes")
    args = shapes_parser.parse_args(["shapes", "select", str(kept), "-o", str(tmp_path / "s.h5")])
    assert args.run(args) == 0
    [again] = read_library(tmp_path / "s.h5")
    assert again.fits[16].shape.area == open_one.fits[16].shape.area


def test_shapes_lie_inside_their_flocs_on_request(tmp_path, frame, capsys):
    options = ("--pixel-size", "1e-6", "--vertices", "4")
    areas = []
    for more in ([], ["--inscribed"]):
        assert run(frame, *options, *more, "-o", tmp_path / "s.h5", "--overwrite") == 0
        areas.append([entry.fits[4].shape.area for entry in read_library(tmp_path / "s.h5")])
    assert sum(areas[1]) < sum(areas[0])
    for more in (["--preserve-area"], ["--method", "paper"]):
        with pytest.raises(UsageError, match="--inscribed needs"):
            run(frame, *options, "--inscribed", *more)


def test_a_floc_too_thin_to_inscribe_a_shape_in_is_left_out(tmp_path, capsys):
    mask = np.zeros((40, 50), np.uint8)
    mask[10, 5:40] = 255
    options = ("--pixel-size", "1e-6", "--vertices", "4", "--masks", "--min-radius", "1")
    options += ("--inscribed", "-o", tmp_path / "s.h5")
    np.savez(tmp_path / "thin.npz", one=mask)
    with pytest.raises(UsageError, match="nothing was fitted"):
        run(tmp_path / "thin.npz", *options)
    assert not (tmp_path / "s.h5").exists()
    mask[20:35, 5:25] = 255
    np.savez(tmp_path / "both.npz", one=mask)
    assert run(tmp_path / "both.npz", *options) == 0
    assert re.search(r"both.npz:one#1: .* inside the floc .* left out", capsys.readouterr().err)
    assert [entry.floc_id for entry in read_library(tmp_path / "s.h5")] == ["both.npz:one#2"]
    assert "not fitted" in (tmp_path / "s.csv").read_text("utf-8")


def test_the_median_of_frames_stands_for_the_light(tmp_path, capsys):
    """A stain on the lens is in every frame: no floc for the median, one for the surface."""
    (tmp_path / "frames").mkdir()
    y, x = np.mgrid[:150, :200]
    for k in range(5):
        grey = np.where(np.hypot(x - 160, y - 30) < 8, 0.3, 0.8)
        grey[np.hypot(x - 40, y - 20 - 25 * k) < 9] = 0.1
        Image.fromarray((255 * grey).astype(np.uint8)).save(tmp_path / f"frames/{k}.png")
    counts = {}
    for way in ("surface", "median"):
        options = ("--pixel-size", "1e-6", "--vertices", "4", "--background", way)
        run(tmp_path / "frames", *options, "-o", tmp_path / f"{way}.h5")
        counts[way] = len(read_library(tmp_path / f"{way}.h5"))
    assert counts == {"surface": 10, "median": 5}
    with pytest.raises(UsageError, match="at least 3 frames"):
        run(tmp_path / "frames/0.png", *options)


@pytest.mark.parametrize(
    ("option", "value"),
    [
        ("--pixel-size", "0"),
        ("--pixel-size", "nan"),
        ("--pixel-size", "one"),
        ("--pixel-size", "-1 um"),
        ("--pixel-size", "1 kg"),
        ("--pixel-size", "inf"),
        ("--radius", "-1"),
        ("--min-radius", "inf"),
        ("--vertices", "4,,8"),
        ("--vertices", "0"),
        ("--vertices", "2.5"),
        ("--crop", "1,2,3"),
        ("--crop", "0,0,0,5"),
        ("--page", "x"),
        ("--page", "1,"),
        ("--page", "0"),
        ("--radius", "1,,2"),
        ("--jobs", "0"),
        ("--neck", "1.5"),
        ("--max-blur", "0"),
        ("--saturated", "1"),
        ("--threshold", "0"),
        ("--threshold", "1.5"),
    ],
)
def test_wrong_values_are_named(frame, capsys, option, value):
    assert code_of(frame, "--pixel-size=1e-6", f"{option}={value}") == 2
    [line] = capsys.readouterr().err.splitlines()
    assert option in line


def test_the_pixel_size_is_needed(tmp_path, frame):
    with pytest.raises(UsageError, match="does not state the size of a pixel"):
        run(frame, "-o", tmp_path / "s.h5")


def test_an_output_that_cannot_be_written_stops_before_the_work(tmp_path, frame, capsys):
    for output in (tmp_path / "no folder/s.h5", tmp_path):
        with pytest.raises(FileError) as caught:
            run(frame, "--pixel-size", "1e-6", "-o", output)
        assert caught.value.exit_code == 74
    assert capsys.readouterr().out == ""


def test_an_interrupt_leaves_no_file(tmp_path, frame, capsys, monkeypatch):
    def interrupt(*_):
        raise KeyboardInterrupt

    monkeypatch.setattr(fit_pictures, "fit_region", interrupt)
    assert code_of(frame, "--pixel-size", "1e-6", "-o", tmp_path / "s.h5") == 130
    assert capsys.readouterr().err == "flocsim: interrupted\n"
    assert not (tmp_path / "s.h5").exists()


@pytest.mark.slow
def test_a_stack_is_fitted_page_by_page_at_the_size_that_it_gives(tmp_path, capsys):
    import tifffile

    y, x = np.mgrid[:160, :200]
    pages = [
        (200 * (np.hypot(x - 40, y - 40) < radius)).astype("u1") + np.uint8(20)
        for radius in (10, 15, 20)
    ]
    path = tmp_path / "s.tif"
    tifffile.imwrite(path, np.array(pages), imagej=True, resolution=(2.0, 2.0),
                     metadata={"axes": "ZYX", "unit": "um"})  # fmt: skip
    options = ("--vertices", "4", "-o", tmp_path / "s.h5", "--overwrite")
    assert code_of(path, *options) == 2
    assert (
        "holds 3 pages; choose with --page 1, --page 1,3 or --page all" in capsys.readouterr().err
    )
    assert run(path, *options, "--page", "all", "--masks-out", tmp_path / "masks") == 0
    assert capsys.readouterr().out.count(", pixel size 0.5 um\n") == 3
    entries = read_library(tmp_path / "s.h5")
    assert [each.floc_id for each in entries] == ["s.tif:1#1", "s.tif:2#1", "s.tif:3#1"]
    for entry, radius in zip(entries, (10, 15, 20), strict=True):
        assert entry.measured_radius == pytest.approx(0.5e-6 * radius, rel=0.05)
    assert len(list(tmp_path.glob("masks/s*.png"))) == 3
    assert run(path, *options, "--page", "2", "--pixel-size", "1 um", "--crop", "5,5,70,70") == 0
    (entry,) = read_library(tmp_path / "s.h5")
    assert entry.measured_radius == pytest.approx(15e-6, rel=0.05)
    assert entry.centroid == pytest.approx((35.0, 35.0), abs=0.5)


def test_pages_of_masks_are_refused(tmp_path, frame):
    with pytest.raises(UsageError, match="--page, --channel and --crop apply to pictures"):
        run(frame, "--pixel-size", "1e-6", "-o", tmp_path / "s.h5", "--masks", "--page", "1")


@pytest.mark.slow
def test_every_fit_is_drawn(tmp_path, frame):
    options = ("--pixel-size", "1e-6", "--vertices", "4", "-o", tmp_path / "s.h5")
    assert run(frame, *options, "--fits", tmp_path / "f") == 0
    names = sorted(path.name for path in (tmp_path / "f").iterdir())
    assert names == ["a-1.png", "a-2.png", "a-3.png"]


@pytest.mark.slow
def test_both_ends_of_bands_are_fitted_on_request(tmp_path, frame, capsys):
    """Closer ones are smaller, wider ones larger; the flocs themselves are as without."""
    options = ("--pixel-size", "1e-6", "--vertices", "4,16")
    assert run(frame, *options, "-o", tmp_path / "a.h5") == 0
    assert run(frame, *options, "--band", "-o", tmp_path / "b.h5") == 0
    libraries = (read_library(tmp_path / name) for name in ("a.h5", "b.h5"))
    for plain, banded in zip(*libraries, strict=True):
        assert not plain.is_banded and list(banded.closer) == [1, 4, 16]
        np.testing.assert_array_equal(plain.fits[16].table.place, banded.fits[16].table.place)
        sizes = [each[16].shape.equivalent_radius
                 for each in (banded.closer, banded.fits, banded.wider)]  # fmt: skip
        assert sizes == sorted(sizes)
        assert sizes[0] / 1e-6 == pytest.approx(banded.radius_low, rel=0.05)
    capsys.readouterr()
    with pytest.raises(UsageError, match="--band excludes --holes, and --masks"):
        run(frame, *options, "--band", "--masks", "-o", tmp_path / "c.h5")


def drawn_flocs():
    """A grey picture with two bright flocs."""
    y, x = np.mgrid[:200, :300]
    grey = 40 + 3 * np.sin(x / 5) + 160 * (np.hypot(x - 90, y - 80) < 30)
    return grey + 160 * (np.hypot(x - 220, y - 120) < 22)


@pytest.mark.parametrize("finder", ["steepest", "paper"])
def test_both_finders_find_the_same_flocs_on_even_light(tmp_path, capsys, finder):
    Image.fromarray(drawn_flocs().astype("u1")).save(tmp_path / "p.png")
    library = tmp_path / "o.h5"
    words = ["fit", str(tmp_path / "p.png"), "--pixel-size", "1e-6", "--vertices", "4"]
    assert main([*words, "--finder", finder, "-o", str(library)]) == 0
    assert "2 bright flocs" in capsys.readouterr().out
    sizes = sorted(1e6 * entry.measured_radius for entry in read_library(library))
    assert sizes == pytest.approx([22, 30], rel=0.02)


@pytest.mark.parametrize(
    ("words", "said"),
    [(["--finder", "paper", "--threshold", "0.2"], "--threshold does not apply"),
     (["--finder", "paper", "--noise-scale", "2"], "--noise-scale does not apply"),
     (["--finder", "paper", "--cutoff", "0.7"], "--cutoff: takes"),
     (["--cutoff", "0.1"], "--finder paper only")],
)  # fmt: skip
def test_options_of_the_other_finder_are_refused(tmp_path, capsys, words, said):
    assert code_of(tmp_path / "p.png", "--pixel-size", "1e-6", *words) == 2
    assert said in capsys.readouterr().err


@pytest.mark.parametrize("dtype", ["u4", "f4"])
def test_one_hot_pixel_does_not_hide_the_flocs(tmp_path, capsys, dtype):
    import tifffile

    grey = drawn_flocs().astype(dtype) * (2**23 if dtype == "u4" else 1)
    grey[5, 7] = np.iinfo(dtype).max if dtype == "u4" else 1e6
    tifffile.imwrite(tmp_path / "p.tif", grey)
    words = ["fit", str(tmp_path / "p.tif"), "--pixel-size", "1e-6", "--vertices", "4"]
    assert main([*words, "-o", str(tmp_path / "o.h5")]) == 0
    assert "2 bright flocs" in capsys.readouterr().out


@pytest.mark.parametrize("side", ["1e-300", "nan"])
def test_pixel_sizes_of_files_are_possible(tmp_path, capsys, side):
    import tifffile

    sizes = {f"PhysicalSize{axis}": side for axis in "XY"}
    units = {f"PhysicalSize{axis}Unit": "m" for axis in "XY"}
    path = tmp_path / "p.ome.tif"
    tifffile.imwrite(path, drawn_flocs().astype("u1"), metadata={"axes": "YX", **sizes, **units})
    assert main(["fit", str(path), "-o", str(tmp_path / "o.h5")]) == 2
    assert "--pixel-size" in capsys.readouterr().err


def test_arrays_among_pictures_are_told_to_be_masks(tmp_path, capsys):
    np.savez(tmp_path / "m.npz", a=np.ones((9, 9), bool))
    assert main(["fit", str(tmp_path / "m.npz"), "--pixel-size", "1e-6"]) == 2
    assert ".npz files hold masks, not pictures: give --masks" in capsys.readouterr().err

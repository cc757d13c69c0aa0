"""`flocsim shapes`: what is listed, selected and merged of libraries."""

import attrs
import numpy as np
import pytest

from flocsim.__main__ import main
from flocsim.commands.shapes import LIBRARY, Library
from flocsim.geometry.shapes.cores import Part
from flocsim.geometry.shapes.outline import ShapeMeasures
from flocsim.io.shape_library import (
    ShapeEntry,
    StoredFit,
    read_library,
    read_settings,
    write_library,
)


def entry(name, radius, pixel=1e-6, spheroradius=1.0, counts=(1, 4)):
    corners = np.array([(1.0, 0.0), (0.0, 1.0), (-1.0, 0.0), (0.0, -1.0)]) * radius * pixel
    fits = {n: StoredFit((Part((corners[:n],), pixel),), 10.0 / n) for n in counts}
    image = name.partition("#")[0]
    area = int(np.pi * radius**2)
    return ShapeEntry(name, image, pixel, (3.0, 4.0), area, radius, spheroradius, fits)


@pytest.fixture
def libraries(in_tmp):
    one = [entry("a.png#1", 5.0), entry("a.png#2", 10.0), entry("b,c.png#1", 20.0)]
    write_library("one.h5", one, {"method": "pattern", "inscribed": False})
    two = [entry("a.png#1", 6.0, 2e-6), entry("d.png#1", 7.0, 2e-6)]
    write_library("two.h5", two, {"method": "even", "inscribed": False})
    return in_tmp


def names(path):
    return [each.floc_id for each in read_library(path)]


def refused(capsys, *words):
    try:
        assert main(["shapes", *words]) == 2
    except SystemExit as end:
        assert end.code == 2
    output, errors = capsys.readouterr()
    [line] = errors.splitlines()
    assert output == ""
    return line


def test_all_flocs_are_listed_with_their_measured_size(libraries, capsys):
    assert main(["shapes", "list", "one.h5", "two.h5"]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert lines[0] == "one.h5: 3 flocs" and lines[8] == "two.h5: 2 flocs"
    for line, expected in ((3, ["a.png#2", "10", "1", "1"]), (10, ["a.png#1", "12", "2", "1"])):
        assert [*lines[line].split()[:4], lines[line].split()[-1]] == [*expected, "2.50"]


def test_shape_measures_are_listed_and_what_is_published_of_a_population(libraries, capsys):
    disc = ShapeMeasures(20 * np.pi, 1.0, 1.0, 1.0, 20.0, 20.0)
    flocs = [attrs.evolve(entry(f"a.png#{k}", 10.0 * k), measures=disc) for k in (1, 2, 3)]
    write_library("measured.h5", flocs)
    assert main(["shapes", "list", "measured.h5"]) == 0
    head, *rows, number, volume, dimension = capsys.readouterr().out.splitlines()[1:]
    wanted = ["62.83", "20", "20", "1.000", "1.000", "1.000"]
    assert all(row.split()[4:10] == wanted for row in rows) and "solidity" in head
    assert number.startswith("diameters 2 r_eq by number: D10 20, D50 40, D90 60 um")
    assert volume.startswith("diameters 2 r_eq by volume: D10 ") and "D50 5" in volume
    assert dimension.startswith("perimeter-based fractal dimension D_f2 0.000 ±")


@pytest.mark.parametrize(
    ("words", "left"),
    [
        (("--keep", "a.png#2,a.png#1"), ["a.png#1", "a.png#2"]),
        (("--drop", "a.png#2"), ["a.png#1", "b,c.png#1"]),
        (("--picture", "a*"), ["a.png#1", "a.png#2"]),
        (("--min-radius", "8e-6", "--max-radius", "10e-6"), ["a.png#2"]),
        (("--picture", "a.png", "--max-radius", "6e-6"), ["a.png#1"]),
    ],
)
def test_flocs_are_selected(libraries, capsys, words, left):
    before = {each.floc_id: each for each in read_library("one.h5")}
    assert main(["shapes", "select", "one.h5", *words, "-o", "some.h5"]) == 0
    assert f"some.h5: {len(left)} floc" in capsys.readouterr().out
    assert names("some.h5") == left
    for each in read_library("some.h5"):
        for field in ("image", "pixel_size", "centroid", "area", "equivalent_radius"):
            assert getattr(each, field) == getattr(before[each.floc_id], field)
        assert all(map(np.array_equal, each.fits[4].table, before[each.floc_id].fits[4].table))
    assert read_settings("some.h5") == {"method": "pattern", "inscribed": False}
    assert main(["shapes", "list", "one.h5", *words]) == 0
    assert f"one.h5: {len(left)} floc" in capsys.readouterr().out


def test_a_name_stands_for_all_spheroradii_of_a_floc(libraries):
    write_library("r.h5", [entry(f"a.png#{k} r={r}", 9.0, 1e-6, r) for k in (1, 2) for r in (1, 2)])
    assert main(["shapes", "select", "r.h5", "--keep", "a.png#1", "-o", "s.h5"]) == 0
    assert names("s.h5") == ["a.png#1 r=1", "a.png#1 r=2"]
    assert main(["shapes", "select", "r.h5", "--drop", "a.png#1 r=2", "-o", "t.h5"]) == 0
    assert names("t.h5") == ["a.png#1 r=1", "a.png#2 r=1", "a.png#2 r=2"]


def test_figures_count_a_floc_of_several_spheroradii_once(in_tmp):
    fits = [entry(f"a.png#{k} r={r}", 9.0, 1e-6, r) for k in (1, 2) for r in (1, 2)]
    assert LIBRARY.source(Library(fits, {})) == "2 flocs of 1 picture"


def test_merged_flocs_keep_sizes_and_get_names_of_their_own(libraries, capsys):
    (libraries / "later").mkdir()
    write_library("later/two.h5", [attrs.evolve(entry("a.png#1", 8.0), image="x.png")])
    assert main(["shapes", "merge", "one.h5", "two.h5", "later/two.h5", "-o", "all.h5"]) == 0
    assert "all.h5: 6 flocs of 3 libraries" in capsys.readouterr().out
    merged = read_library("all.h5")
    assert [(e.floc_id, e.image, e.pixel_size, e.equivalent_radius) for e in merged] == [
        ("a.png#1", "a.png", 1e-6, 5.0), ("a.png#2", "a.png", 1e-6, 10.0),
        ("b,c.png#1", "b,c.png", 1e-6, 20.0), ("two/a.png#1", "two/a.png", 2e-6, 6.0),
        ("two/d.png#1", "two/d.png", 2e-6, 7.0), ("two/two/a.png#1", "two/two/x.png", 1e-6, 8.0),
    ]  # fmt: skip
    settings = {"method": "pattern, even, unknown", "inscribed": "False, unknown"}
    assert read_settings("all.h5") == settings


def test_what_cannot_be_is_said_in_one_line(libraries, capsys):
    write_library("other.h5", [entry("e.png#1", 5.0, counts=(1, 3))])
    assert "fit both at the same --vertices" in refused(
        capsys, "merge", "one.h5", "other.h5", "-o", "x.h5"
    )
    assert "no floc 'z#1'" in refused(capsys, "select", "one.h5", "--keep", "z#1", "-o", "x.h5")
    small = ("--max-radius", "1e-9", "-o", "x.h5")
    assert "none of 3 flocs" in refused(capsys, "select", "one.h5", *small)
    for output, told in (("one.h5", "which is an input"), ("two.h5", "already exists")):
        assert told in refused(capsys, "select", "one.h5", "-o", output)
    assert "which is an input" in refused(
        capsys, "merge", "one.h5", "two.h5", "-o", "two.h5", "--overwrite"
    )
    assert "--min-radius: takes" in refused(
        capsys, "select", "one.h5", "--min-radius", "8 um", "-o", "x.h5"
    )

"""`flocsim fit --review` and --reviewed: flocs are chosen by eye on a page, and only those."""

import csv
import json
import re
from html import unescape

import numpy as np
import pytest
from PIL import Image

from flocsim.__main__ import main
from flocsim.io.images.review import LARGEST
from flocsim.io.shape_library import read_library, read_settings
from tests.helpers.browser import open_page
from tests.helpers.choices import choices_on, choose

QUICK = ["--pixel-size", "1e-6", "--vertices", "4", "--min-radius", "6"]


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A folder with pictures a.png and b.png of two flocs and a speck each, and their page."""
    path = tmp_path_factory.mktemp("review")
    y, x = np.mgrid[:150, :200]
    grey = np.full((150, 200), 0.8)
    for cx, cy, r in ((50, 50, 20), (130, 90, 9), (160, 40, 4.6)):
        angle = np.arctan2(y - cy, x - cx)
        grey[np.hypot(x - cx, y - cy) < r * (1 + 0.25 * np.cos(4 * angle))] = 0.1
    (path / "frames").mkdir()
    for name in ("a.png", "b.png"):
        Image.fromarray((255 * grey).astype(np.uint8)).save(path / "frames" / name)
    assert main(["fit", str(path / "frames"), *QUICK, "--review", "-o", str(path / "s.h5")]) == 0
    return path


@pytest.fixture
def page(folder):
    return folder / "s-review.html"


def fit(folder, *words, options=QUICK):
    """The exit code of `flocsim fit` on the pictures of a folder; its library is c.h5."""
    library = ["--overwrite", "-o", str(folder / "c.h5")]
    return main(["fit", str(folder / "frames"), *map(str, words), *options, *library])


def names_in(folder):
    return [entry.floc_id for entry in read_library(folder / "c.h5")]


def refusal(capsys, folder, *words, **more):
    """(exit code, the line) of a fit that is refused."""
    capsys.readouterr()
    code = fit(folder, *words, **more)
    [line] = capsys.readouterr().err.splitlines()
    return code, line


def test_the_page_has_every_region_and_loads_nothing(page):
    text = page.read_text("utf-8")
    assert "default-src 'none'; img-src data:" in text
    assert not re.search("(?:src|href)='(?!data:image/jpeg;base64,)", text)
    titles = re.findall("<title>(.*?)</title></path>", text)
    assert len(titles) == 6
    assert re.match(r"a.png, floc 1; r_eq \d+\.\d µm \(.* px\); RE .* % at N = 4", titles[0])
    assert titles[2].endswith("left out: too small")


def test_the_command_says_how_to_go_on(folder, capsys):
    assert fit(folder, "--review") == 0
    last = capsys.readouterr().out.splitlines()[-1]
    assert last.startswith(
        f"{folder / 'c-review.html'}: choose flocs on this page, save the choices"
    )
    assert "--reviewed reviewed.json --overwrite" in last


def test_flocs_are_rejected_and_added(folder, page, capsys):
    everything = read_library(folder / "s.h5")
    choices = choose(page, {"a.png#1": "reject", "b.png#3": "keep"})
    assert fit(folder, "--reviewed", choices) == 0
    assert "a.png: 1 dark floc; rejected: 1 by eye, 1 too small" in capsys.readouterr().out
    assert names_in(folder) == ["a.png#2", "b.png#1", "b.png#2", "b.png#3"]
    kept = {entry.floc_id: entry.area for entry in read_library(folder / "c.h5")}
    assert kept.items() >= {each.floc_id: each.area for each in everything[1:]}.items()
    with open(folder / "c.csv", newline="") as table:
        rows = {(r["picture"], r["floc"]): r["left_out_because"] for r in csv.DictReader(table)}
    assert rows["a.png", "1"] == "rejected by eye" and rows["a.png", "3"] == "too small"
    assert rows["b.png", "3"] == ""


def test_choices_are_where_they_were_when_the_page_is_made_again(folder, page):
    choices = choose(page, {"a.png#1": "reject", "b.png#3": "keep"})
    assert fit(folder, "--reviewed", choices, "--review") == 0
    assert choices_on(folder / "c-review.html") == json.loads(choices.read_text())


def test_no_choice_changes_nothing(folder, page):
    assert fit(folder, "--reviewed", choose(page)) == 0
    assert (folder / "c.csv").read_bytes() == (folder / "s.csv").read_bytes()
    before = read_settings(folder / "s.h5")
    assert read_settings(folder / "c.h5") == before | {"chosen": "by eye"}


def test_regions_can_be_added_where_the_filters_left_nothing(folder, capsys):
    strict = [*QUICK, "--max-radius", "7"]
    assert fit(folder, "--review", options=strict) == 2
    assert "nothing was fitted" in capsys.readouterr().err
    choices = choose(folder / "c-review.html", {"a.png#2": "keep"})
    assert fit(folder, "--reviewed", choices, options=strict) == 0
    assert names_in(folder) == ["a.png#2"]


@pytest.mark.parametrize(
    ("options", "said"),
    [
        ([*QUICK[:-1], "4"], "other regions are found in a.png now"),
        ([*QUICK, "--max-radius", "15"], "other regions are found in a.png now"),
        ([*QUICK, "--crop", "0,5,200,140"], "other regions are found in a.png now"),
        ([*QUICK, "--crop", "0,0,100,140"], "other regions are found in a.png now"),
    ],
)
def test_options_that_find_other_flocs_are_refused(folder, page, capsys, options, said):
    code, line = refusal(capsys, folder, "--reviewed", choose(page), options=options)
    assert code == 2 and said in line
    assert line.endswith("that it was made with, or choose again with --review")


def test_other_pictures_are_refused(folder, page, capsys, tmp_path):
    (tmp_path / "frames").mkdir()
    for name in ("a.png", "b.png"):
        (tmp_path / "frames" / name).write_bytes((folder / "frames" / name).read_bytes())
    choices = choose(page)
    assert fit(tmp_path, "--reviewed", choices) == 0
    (tmp_path / "frames/b.png").rename(tmp_path / "frames/c.png")
    assert "there are no choices for c.png" in refusal(capsys, tmp_path, "--reviewed", choices)[1]
    (tmp_path / "frames/c.png").unlink()
    assert "b.png is not among them" in refusal(capsys, tmp_path, "--reviewed", choices)[1]
    with Image.open(tmp_path / "frames/a.png") as picture:
        picture.point(lambda grey: grey + 1).save(tmp_path / "frames/a.png")
    code, line = refusal(capsys, tmp_path, "--reviewed", choices)
    assert code == 2 and "a.png is another file, or has changed since then" in line


@pytest.mark.parametrize(
    "text",
    ["", "no JSON", "[]", "{}", '{"pictures": 3}', '{"pictures": [{"picture": "a.png"}]}', "\0\xff",
     "[" * 10**6, '{"pictures":' * 10**5, "9" * 10**5, b" " * (LARGEST + 1), b"\xff\xfe\x00"],
    ids=range(12),
)  # fmt: skip
def test_files_of_no_choices_are_refused(folder, tmp_path, capsys, text):
    path = tmp_path / "reviewed.json"
    path.write_bytes(text if isinstance(text, bytes) else text.encode())
    code, line = refusal(capsys, folder, "--reviewed", path)
    assert code == 2 and f"{path} holds no choices" in line and len(line) < 400


@pytest.mark.parametrize(
    "wrong",
    [{"x_px": 10**4000}, {"area_px": 10**400}, {"y_px": float("nan")}, {"x_px": 1e308},
     {"floc": -1}, {"floc": True}, {"area_px": "3"}, {"choice": "perhaps"}, {"choice": None}],
    ids=str,
)  # fmt: skip
def test_impossible_values_are_refused(folder, page, capsys, wrong):
    code, line = refusal(capsys, folder, "--reviewed", choose(page, **wrong))
    assert code == 2 and "reviewed.json" in line and len(line) < 400


def test_files_that_are_not_there_are_refused(folder, tmp_path, capsys):
    for path in (tmp_path / "absent.json", tmp_path):
        assert refusal(capsys, folder, "--reviewed", path)[0] == 2


def test_choices_are_never_overwritten(folder, page, capsys):
    choices = choose(page).rename(folder / "d.h5")
    words = ["fit", str(folder / "frames"), *QUICK, "--overwrite", "--reviewed", str(choices)]
    assert main([*words, "-o", str(choices)]) == 2
    assert "is an input" in capsys.readouterr().err
    choices.unlink()


def test_names_of_pictures_cannot_become_code(folder, tmp_path):
    hostile = "<script>x'\"&@CHOICES@.png"
    (tmp_path / "frames").mkdir()
    (tmp_path / "frames" / hostile).write_bytes((folder / "frames/a.png").read_bytes())
    assert fit(tmp_path, "--review") == 0
    page = tmp_path / "c-review.html"
    text = page.read_text("utf-8")
    assert "<script>x" not in text and text.count("<script") == 2
    assert hostile in unescape(text) and choices_on(page)["pictures"][0]["picture"] == hostile
    assert fit(tmp_path, "--reviewed", choose(page, {f"{hostile}#1": "reject"})) == 0
    assert names_in(tmp_path) == [f"{hostile}#2"]


def test_label_images_are_reviewed_as_well(tmp_path):
    labels = np.zeros((60, 80), np.uint8)
    labels[10:30, 10:30], labels[35:50, 40:70] = 7, 9
    (tmp_path / "frames").mkdir()
    np.savez(tmp_path / "frames/m.npz", one=labels)
    assert fit(tmp_path, "--masks", "--review") == 0
    choices = choose(tmp_path / "c-review.html", {"m.npz:one#7": "reject"})
    assert fit(tmp_path, "--masks", "--reviewed", choices) == 0
    assert names_in(tmp_path) == ["m.npz:one#9"]


ACT = """<script>
const outline = document.querySelectorAll('path[data-place]')[1];
const middle = box => [box.left + box.width / 2, box.top + box.height / 2];
const [x, y] = middle(outline.getBoundingClientRect());
document.elementFromPoint(x, y).dispatchEvent(
  new MouseEvent('click', {bubbles: true, clientX: x, clientY: y}));
for (const key of ['Enter', ' ', 'Enter']) {
  document.querySelectorAll('path[data-place]')[2].dispatchEvent(
    new KeyboardEvent('keydown', {key, bubbles: true}));
}
HTMLAnchorElement.prototype.click = function () { document.body.dataset.name = this.download; };
URL.createObjectURL = blob => { blob.text().then(text => {
  document.body.dataset.saved = text; }); return '#'; };
document.querySelector('#save').click();
const root = document.documentElement;
document.body.dataset.overflow = root.scrollWidth - root.clientWidth;
</script></body>"""


@pytest.mark.parametrize("width", [390, 1280])
def test_a_click_rejects_a_floc_and_a_key_adds_one(folder, page, tmp_path, width):
    acted = tmp_path / "acted.html"
    acted.write_text(page.read_text("utf-8").replace("</body>", ACT), "utf-8")
    dom, said, _ = open_page(acted, tmp_path, width=width)
    assert not said
    [shown] = re.findall('<output id="count"[^>]*>(.*?)</output>', dom)
    assert shown == "4 flocs, 1 rejected, 1 added"
    assert 'data-name="reviewed.json"' in dom and 'data-overflow="0"' in dom
    saved = unescape(re.search('data-saved="(.*?)"', dom, re.DOTALL)[1])
    expected = choose(page, {"a.png#2": "reject", "a.png#3": "keep"})
    assert json.loads(saved) == json.loads(expected.read_text())

"""Scale bars and their writing are found and left out, and nothing else is."""

import io

import numpy as np
import pytest
from PIL import Image, ImageDraw, ImageFont
from scipy.ndimage import gaussian_filter

from flocsim.io.images.annotations import without_annotations
from flocsim.io.images.pictures import segment
from flocsim.io.images.reading import read_grey
from flocsim.io.images.regions import ANNOTATION
from tests.helpers.real_images import real_image
from tests.helpers.tiers import rest_slow

SIZE = (320, 420)


def flocs(dark, noise=0.02, seed=0):
    """Grey of six flocs in the upper half."""
    y, x = np.mgrid[: SIZE[0], : SIZE[1]]
    grey = np.full(SIZE, 0.75 if dark else 0.15)
    for k, (cx, cy) in enumerate((60 + 60 * k, 70 + 30 * (k % 2)) for k in range(6)):
        angle = np.arctan2(y - cy, x - cx)
        near = np.hypot(x - cx, y - cy) < (9 + k) * (1 + 0.2 * np.cos(3 * angle))
        grey[near] += -0.4 if dark else 0.4
    return np.clip(grey + np.random.default_rng(seed).normal(0, noise, SIZE), 0, 1)


def with_bar(grey, colour, place, size, text, boxed, jpeg):
    picture = Image.fromarray((255 * grey).astype("u1"))
    draw = ImageDraw.Draw(picture)
    (x, y), (length, width) = place, size
    if boxed:
        draw.rectangle([x - 8, y - 30, x + length + 8, y + width + 6], fill=255 - colour)
    draw.rectangle([x, y, x + length, y + width], fill=colour)
    if text:
        draw.text((x + 5, y - 26), "50 µm", fill=colour, font=ImageFont.load_default(18))
    if jpeg:
        packed = io.BytesIO()
        picture.save(packed, "JPEG", quality=90)
        picture = Image.open(packed)
    return np.asarray(picture) / 255.0


@pytest.mark.parametrize("number", rest_slow(range(48), lambda number: number % 20 == 5))
def test_bars_are_no_flocs_and_flocs_stay(number):
    dark, white, text, boxed = (bool(number >> k & 1) for k in range(4))
    place = ((12, 295), (290, 300), (150, 250))[number % 3]
    size = ((60, 3), (110, 8), (85, 12))[number // 16]
    plain = flocs(dark, seed=number)
    grey = with_bar(plain, 255 * white, place, size, text, boxed, jpeg=number % 5 == 0)
    replaced = without_annotations(grey)[1]
    assert replaced[place[1] : place[1] + size[1], place[0] : place[0] + size[0]].all()
    found, before = segment(grey), segment(plain)
    annotated = [any(r.reason == ANNOTATION for r in each.rejected) for each in (found, before)]
    assert annotated == [True, False]
    assert len(before.regions) == len(found.regions) == 6
    for one, other in zip(found.regions, before.regions, strict=True):
        assert one.equivalent_radius == pytest.approx(other.equivalent_radius, rel=0.03)


def drawn_on(plain, mark, colour):
    """The picture of uint8 with a mark in a colour."""
    picture = Image.fromarray((255 * plain).astype("u1"))
    draw = ImageDraw.Draw(picture)
    if mark.isalpha():
        draw.text((150, 230), mark, fill=colour, font=ImageFont.load_default(56))
        return picture
    length, width = {"fat": (90, 40), "hairline": (120, 1), "capped": (120, 4)}[mark[1:]]
    draw.rectangle([150, 280, 149 + length, 279 + width], fill=colour)
    for x in (150, 150 + length - width) if mark == "-capped" else ():
        draw.rectangle([x, 272, x + width - 1, 291], fill=colour)
    draw.text((160, 236), "20 nm", fill=colour, font=ImageFont.load_default(28))
    return picture


@pytest.mark.parametrize("mark", ["-fat", "-hairline", "-capped", "B", "E", "K"])
@pytest.mark.parametrize("scale", [0.7, 1.0, 1.6])
@pytest.mark.parametrize("dark", [True, False])
def test_bars_and_letters_of_any_form_are_no_flocs_in_resized_figures(mark, scale, dark):
    size = tuple(int(scale * side) for side in SIZE[::-1])
    plain, marked = (
        np.asarray(picture.resize(size, Image.Resampling.BICUBIC)) / 255.0
        for picture in (Image.fromarray((255 * flocs(dark)).astype("u1")),
                        drawn_on(flocs(dark), mark, 0 if dark else 255))
    )  # fmt: skip
    found, before = segment(marked), segment(plain)
    assert len(found.regions) == len(before.regions)
    left_out = [each for each in found.rejected if each.reason == "scale bar or lettering"]
    assert left_out and all(each.centroid[1] > 200 * scale for each in left_out)


@pytest.mark.parametrize("bright", [True, False])
@pytest.mark.parametrize("blur", [0.0, 1.0, 2.0])
def test_aggregates_and_rods_of_one_tone_are_flocs(bright, blur):
    y, x = np.mgrid[:300, :400]
    inside = np.zeros(x.shape, bool)
    for k in range(8):  # a row of beads that touch, and one along a diagonal
        inside |= np.hypot(x - 60 - 15 * k, y - 60) < 8
        inside |= np.hypot(x - 250 - 11 * k, y - 150 - 10 * k) < 8
    inside |= np.hypot((x - 80) / 5, y - 200) < 7
    covered = gaussian_filter(inside.astype(float), blur)
    assert not without_annotations(0.1 + 0.9 * covered if bright else 0.9 - 0.9 * covered)[1].any()


@pytest.mark.parametrize("dark", [True, False])
@pytest.mark.parametrize("noise", [0.0, 0.3])
def test_pictures_without_a_bar_stay_as_they_are(dark, noise):
    grey = flocs(dark, noise)
    same, replaced = without_annotations(grey)
    assert same is grey and not replaced.any()


@pytest.mark.parametrize(
    "name", ["flocpy/023.png", "safas/clayflocs.png", "soot_tem/201805A_A6_004_half.png"]
)
def test_nothing_of_real_pictures_is_taken_for_a_bar(name):
    assert not without_annotations(read_grey(real_image(name)))[1].any()

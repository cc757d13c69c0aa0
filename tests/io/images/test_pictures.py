"""Pictures → flocs: synthetic pictures with known outlines, damaged files, the real pictures."""

from itertools import product

import numpy as np
import pytest
from PIL import Image

from flocsim.errors import ImageError
from flocsim.io.images.pictures import segment
from flocsim.io.images.reading import read_grey
from tests.helpers.real_images import real_image
from tests.helpers.tiers import rest_slow

PLACES = [(60, 70, 24), (170, 80, 15), (250, 180, 30), (90, 190, 10), (330, 60, 18), (170, 230, 12)]
"""x, y and mean radius [px] of the synthetic flocs."""


def wavy_disk(x, y, radius, shape, oversampling=4):
    """Coverage (0 … 1) of a three-lobed floc, and its true equivalent radius."""
    window = [np.arange(max(0, int(c - 1.3 * radius)), min(n, int(c + 1.3 * radius) + 2))
              for c, n in zip((y, x), shape, strict=True)]  # fmt: skip
    parts = (np.arange(oversampling) + 0.5) / oversampling - 0.5
    fine, across = ((pixels[:, None] + parts).ravel() for pixels in window)
    dy, dx = fine[:, None] - y, across[None, :] - x
    inside = np.hypot(dx, dy) <= radius * (1 + 0.25 * np.cos(3 * np.arctan2(dy, dx)))
    cover = np.zeros(shape)
    cover[np.ix_(*window)] = inside.reshape(
        len(window[0]), oversampling, len(window[1]), oversampling
    ).mean(axis=(1, 3))
    return cover, radius * np.sqrt(1 + 0.25**2 / 2)


def synthetic(flocs="dark", vignette=0.8, noise=0.02, shape=(300, 400), seed=1):
    """A grey picture with the flocs at PLACES, and their equivalent radii in the order of y."""
    covers, radii = zip(*(wavy_disk(*place, shape) for place in PLACES), strict=True)
    cover = np.sum(covers, axis=0)
    y, x = np.mgrid[-1 : 1 : shape[0] * 1j, -1 : 1 : shape[1] * 1j]
    light = 1 - 0.5 * vignette * (x**2 + y**2)
    lost, scattered = 0.8 * light * (1 - 0.85 * cover), 0.1 * light + 0.7 * cover
    grey = lost if flocs == "dark" else scattered
    return grey + noise * np.random.default_rng(seed).standard_normal(shape), np.array(radii)


def found_radii(segmentation):
    """Equivalent radii of the regions nearest to PLACES."""
    centres = np.array([region.centroid for region in segmentation.regions])
    sizes = np.array([region.equivalent_radius for region in segmentation.regions])
    nearest = [np.argmin(np.hypot(*(centres - place[:2]).T)) for place in PLACES]
    return sizes[nearest]


@pytest.mark.parametrize("flocs", ["dark", "bright"])
@pytest.mark.parametrize("vignette", rest_slow([0.0, 0.5, 0.8], lambda vignette: vignette == 0.8))
@pytest.mark.parametrize("noise", [0.0, 0.02])
def test_equivalent_radii_come_out_within_one_percent(flocs, vignette, noise):
    grey, radii = synthetic(flocs, vignette, noise)
    found = segment(grey)
    assert found.flocs == flocs
    assert len(found.regions) == len(PLACES)
    ratio = found_radii(found) / radii
    assert abs(ratio.mean() - 1) < 0.01
    assert np.all(abs(ratio - 1) < 0.04)


def test_upside_down_and_transposed_pictures_give_the_same_flocs():
    grey = synthetic()[0]
    areas = sorted(region.area for region in segment(grey).regions)
    for turned in (grey[::-1], grey[:, ::-1], grey.T):
        again = sorted(region.area for region in segment(turned).regions)
        assert again == pytest.approx(areas, rel=0.01)  # the noise is told by other pixels


def test_brightness_and_contrast_of_the_camera_do_not_matter():
    grey = synthetic(noise=0.0)[0]
    areas = [region.area for region in segment(grey).regions]
    dimmer = [region.area for region in segment(0.6 * grey).regions]
    assert np.allclose(areas, dimmer, rtol=0.01)


def disks(*places, shape=(120, 120)):
    """A bright-on-black picture of disks (x, y, radius)."""
    y, x = np.mgrid[: shape[0], : shape[1]]
    return sum((np.hypot(x - cx, y - cy) <= r) * 0.9 for cx, cy, r in places)


def test_border_and_small_regions_are_rejected_with_the_reason():
    found = segment(disks((60, 60, 15), (0, 30, 10), (100, 100, 2.5)))
    assert len(found.regions) == 1
    assert found.rejected_by_reason() == {"too small": 1, "at the border": 1}
    large = segment(disks((60, 60, 15), (100, 100, 6)), max_radius=10)
    assert large.rejected_by_reason() == {"too large": 1}
    assert len(segment(disks((60, 60, 15), (100, 100, 2.5)), min_radius=1).regions) == 2


def blurred(grey, sigma):
    from scipy.ndimage import gaussian_filter

    return gaussian_filter(grey, sigma)


@pytest.mark.parametrize("sigma", [3.0, 6.0, 9.0])
def test_blur_is_that_of_the_lens(sigma):
    """Known optics: a disk much larger than the blur has a Gaussian edge of that deviation."""
    picture = blurred(disks((150, 150, 60), shape=(300, 300)), sigma)
    (region,) = segment(picture, max_blur=np.inf, background=np.zeros((300, 300))).regions
    assert region.blur == pytest.approx(np.hypot(sigma, 1.0), rel=0.15)


def test_blurred_flocs_are_rejected_with_the_reason():
    sharp = disks((60, 60, 15), shape=(200, 200))
    soft = 2.0 * blurred(disks((140, 140, 15), shape=(200, 200)), 10.0)
    found = segment(sharp + soft)
    assert len(found.regions) == 1 and found.rejected_by_reason() == {"out of focus": 1}
    assert found.regions[0].blur < 2 < found.rejected[0].blur
    assert len(segment(sharp + soft, max_blur=np.inf).regions) == 2


@pytest.mark.parametrize("scale", [1.0, 2.0, 4.0])
def test_focus_is_relative_to_the_size(scale):
    """The same floc, the same blur: what is soft is soft at any magnification."""
    places, shape = (60 * scale, 60 * scale, 18 * scale), (int(120 * scale), int(120 * scale))
    for share, kept in ((0.12, 1), (0.35, 0)):
        picture = blurred(disks(places, shape=shape), share * 18 * scale)
        found = segment(picture, background=np.zeros(shape), threshold=0.4)
        assert len(found.regions) == kept


def test_touching_flocs_are_parted_at_their_neck():
    row, column = np.mgrid[:120, :120]
    neck = (abs(row - 60) <= 2) & (abs(column - 60) < 20)
    picture = np.maximum(disks((35, 60, 18), (85, 60, 20)), 0.9 * neck)
    parts = segment(picture).regions
    assert len(parts) == 2 and len(segment(picture, neck=0).regions) == 1
    assert sorted(part.area for part in parts) == pytest.approx([1018 + 35, 1257 + 25], abs=60)
    wide = np.maximum(picture, 0.9 * ((abs(row - 60) <= 14) & (abs(column - 60) < 20)))
    assert len(segment(wide, background=np.zeros((120, 120))).regions) == 1


def test_a_chain_of_beads_is_one_aggregate_and_pairs_are_two_flocs():
    chain = disks(*((20 + 19 * k, 30 + 6 * (k % 2), 10) for k in range(5)), shape=(160, 160))
    pair = disks((30, 110, 10), (50, 110, 10), shape=(160, 160))
    dark = {"background": np.zeros((160, 160)), "threshold": 0.4}
    found = segment(chain, **dark)
    assert len(found.regions) == 1 and found.left_whole == 1
    assert len(segment(chain, neck=0.5, **dark).regions) == 5
    assert len(segment(pair, **dark).regions) == 2 and segment(pair, **dark).left_whole == 0
    both = segment(np.maximum(chain, pair), **dark)
    assert len(both.regions) == 2 and both.left_whole == 2  # of one picture, of one kind
    pairs = disks(*((x, y, 10) for x in (30, 50) for y in (20, 60, 100, 140)), shape=(160, 160))
    assert len(segment(pairs, **dark).regions) == 8


@pytest.mark.slow
def test_soot_is_not_cut_at_its_necks():
    grey = read_grey(real_image("soot_tem/201805A_A6_004_half.png"))
    whole, cut = segment(grey), segment(grey, neck=0.5)
    assert whole.left_whole > 0 and cut.left_whole == 0
    assert len(whole.regions) == len(segment(grey, neck=0).regions) < len(cut.regions)


def test_a_floc_thicker_in_its_middle_keeps_its_rim():
    """Thin at the sharp rim, dark in the middle: Otsu's level alone would cut the rim away."""
    y, x = np.mgrid[-250:250, -250:250]
    square = (x**2 + y**2) / 50.0**2
    grey = 0.8 * (1.0 - np.where(square < 1, 0.15 + 0.6 * (1 - np.minimum(square, 1)) ** 2, 0.0))
    (region,) = segment(blurred(grey, 1.0)).regions
    assert region.equivalent_radius == pytest.approx(50, rel=0.02)


def test_a_given_background_takes_the_place_of_the_surface():
    y, x = np.mgrid[:200, :200]
    light = 0.6 + 0.2 * np.sin(x / 9.0) * np.cos(y / 7.0)
    grey = light * np.where(np.hypot(x - 100, y - 100) < 15, 0.2, 1.0)
    (region,) = segment(grey, background=light).regions
    assert region.equivalent_radius == pytest.approx(15, rel=0.03)
    with pytest.raises(ImageError, match="background"):
        segment(grey, background=light[1:])


def agreement(found, true):
    """Intersection over union of a Segmentation's foreground with a mask."""
    return (found.foreground & true).sum() / (found.foreground | true).sum()


@pytest.mark.slow
@pytest.mark.parametrize("scales", rest_slow([[1, 4], [1, 2, 3, 4]], lambda each: len(each) == 2))
def test_the_soot_agrees_with_a_human_mask_at_every_noise_scale(scales):
    grey = read_grey(real_image("soot_tem/201805A_A6_004_half.png"))
    human = read_grey(real_image("soot_tem/201805A_A6_004_half_mask.png")) > 0.5
    shares = [agreement(segment(grey, noise_scale=scale), human) for scale in scales]
    assert min(shares) >= 0.9 and max(shares) - min(shares) <= 0.035
    assert len(segment(grey).regions) < 10 and segment(grey).alarms == []


@pytest.mark.parametrize("noise", [0.0, 0.04, 0.06, 0.1])
def test_layers_stay_together(noise):
    """Discs that overlap: two layers are darker than Otsu's level, one is not."""
    row, column = np.mgrid[:200, :300]
    places = [(60 + 17 * (k % 3), 60 + 14 * k, 15) for k in range(12)] + [
        (150, 80, 18),
        (150, 95, 18),
    ]
    layers = sum((np.hypot(row - y, column - x) < r).astype(float) for y, x, r in places)
    grey = 0.8 * blurred(0.65**layers, 1.0)
    grey += noise * np.random.default_rng(2).standard_normal(grey.shape)
    found = segment(grey)
    # Two of them are 7 px apart, where the noise may bridge the gap.
    assert len(found.regions) in ((5,) if noise < 0.1 else (4, 5)) and found.alarms == []
    assert agreement(found, layers > 0) >= 0.95


@pytest.mark.parametrize(
    ("sigma", "noise"),
    rest_slow(
        product([0.0, 1.0, 2.0, 3.0], [0.0, 0.02]), lambda sigma, noise: sigma == 100 * noise
    ),
)
def test_focus_does_not_select_by_size_and_bands_hold_the_size(sigma, noise):
    radii = np.linspace(4.6, 16.0, 40)
    shape = (420, 660)
    places = [(40 + 64 * (k % 10), 50 + 100 * (k // 10), r) for k, r in enumerate(radii)]
    covers = [wavy_disk(x, y, r, shape) for x, y, r in places]
    true = np.array([radius for _, radius in covers])
    grey = 0.8 * (1.0 - 0.6 * blurred(np.sum([cover for cover, _ in covers], axis=0), sigma))
    grey += noise * np.random.default_rng(4).standard_normal(shape)
    found = segment(grey)
    assert len(found.regions) >= 39  # the least may come out below 4 px
    centres = np.array([region.centroid for region in found.regions])
    away = np.array([np.hypot(*(centres - place[:2]).T) for place in places])
    order, true = away.argmin(axis=1)[away.min(axis=1) < 5], true[away.min(axis=1) < 5]
    sizes = np.array([found.regions[k].equivalent_radius for k in order])
    bands = np.array([found.regions[k].radius_band for k in order])
    assert sizes.mean() == pytest.approx(true.mean(), rel=0.02)
    assert ((bands[:, 0] <= true) & (true <= bands[:, 1])).mean() >= 0.93


def test_what_speaks_against_an_outline_is_said():
    """A soft picture, most of which is left out, and a floc in shreds."""
    soft = blurred(disks((60, 60, 15), (140, 140, 15), shape=(200, 200)), 9.0)
    found = segment(soft + disks((150, 40, 6), shape=(200, 200)), threshold=0.3)
    assert any("was rejected" in alarm for alarm in found.alarms)
    row, column = np.mgrid[:200, :200]
    shreds = (np.hypot(row - 100, column - 100) < 60) & (row % 14 < 11) & (column % 14 < 11)
    assert any("fragments" in alarm for alarm in segment(0.9 * shreds, neck=0).alarms)


def test_holes_are_filled_and_diagonal_pixels_belong_together():
    ring = disks((60, 60, 25)) - disks((60, 60, 10))
    assert len(segment(ring).regions) == 1
    assert abs(segment(ring).regions[0].equivalent_radius - 25) < 0.5
    blocks = np.zeros((80, 80))
    blocks[20:40, 20:40] = blocks[40:60, 40:60] = 1.0
    assert len(segment(blocks, noise_scale=0, neck=0).regions) == 1


@pytest.mark.parametrize(
    "grey",
    [np.zeros((40, 50)), np.full((40, 50), 0.5), np.ones((1, 1)), np.linspace(0, 1, 30)[None]],
)
def test_pictures_without_flocs_give_none(grey):
    assert segment(grey).regions == ()


def test_pure_noise_gives_no_flocs():
    noise = 0.5 + 0.1 * np.random.default_rng(3).standard_normal((300, 300))
    assert segment(noise).regions == ()


GREY = np.linspace(0, 255, 12 * 17).reshape(12, 17).astype(np.uint8)


@pytest.mark.parametrize("suffix", ["png", "bmp", "tif"])
@pytest.mark.parametrize("mode", ["L", "RGB", "RGBA", "P"])
def test_grey_survives_every_lossless_format(tmp_path, suffix, mode):
    if (suffix, mode) == ("bmp", "RGBA"):
        pytest.skip("BMP with transparency is not a format that cameras write")
    path = tmp_path / f"grey.{suffix}"
    Image.fromarray(GREY).convert(mode).save(path)
    assert np.allclose(read_grey(path), GREY / 255, atol=1e-9)


def test_jpeg_is_near_and_sixteen_bit_exact(tmp_path):
    Image.fromarray(GREY).save(tmp_path / "grey.jpg", quality=95)
    assert np.allclose(read_grey(tmp_path / "grey.jpg"), GREY / 255, atol=0.05)
    deep = GREY.astype(np.uint16) * 257
    for name in ("deep.png", "deep.tif"):
        Image.fromarray(deep).save(tmp_path / name)
        assert np.allclose(read_grey(tmp_path / name), deep / 65535, atol=1e-9)


def test_colour_becomes_luminance_and_transparency_background(tmp_path):
    colour = np.zeros((4, 4, 3), np.uint8)
    colour[..., 1] = 255
    Image.fromarray(colour).save(tmp_path / "green.png")
    assert np.allclose(read_grey(tmp_path / "green.png"), 0.7154)
    clear = np.dstack([GREY, GREY, GREY, np.full_like(GREY, 255)])
    clear[:6, :, 3] = 0
    Image.fromarray(clear).save(tmp_path / "clear.png")
    assert np.allclose(read_grey(tmp_path / "clear.png")[:6], np.median(GREY[6:]) / 255)


def test_files_that_are_no_pictures_are_named(tmp_path):
    Image.fromarray(GREY).resize((200, 200)).save(tmp_path / "whole.png")
    data = (tmp_path / "whole.png").read_bytes()
    contents = {
        "cut.png": data[: len(data) // 2],
        "empty.png": b"",
        "text.jpg": b"not a picture",
        "text.tif": b"II*\0not a picture",
    }
    for name, content in contents.items():
        (tmp_path / name).write_bytes(content)
    for path in [tmp_path / name for name in contents] + [tmp_path / "absent.png", tmp_path]:
        with pytest.raises(ImageError, match=path.name) as caught:
            read_grey(path)
        assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("name", "flocs", "least", "most"),
    rest_slow([
        ("safas/brightfield_flocs.png", "bright", 4, 9),
        ("safas/clayflocs.png", "dark", 4, 6),
        ("safas/clearfloc.png", "dark", 1, 1),
        ("safas/darkfield_highgray_mudflocs.png", "dark", 28, 40),
        ("safas/darkfield_noisy_mudflocs_left.png", "dark", 40, 80),
        ("sandi/FlocCAM-image2.jpg", "dark", 10, 20),
        ("sandi/Stereomicroscope-image1.jpg", "bright", 12, 25),
        ("soot_tem/201805A_A6_004_half.png", "dark", 5, 9),
        *((f"flocpy/{frame}.png", "dark", 10, 20) for frame in ("023", "024", "025")),
    ], lambda name, *_: name.endswith("clayflocs.png")),
)  # fmt: skip
def test_every_real_picture_gives_flocs(name, flocs, least, most):
    found = segment(read_grey(real_image(name)))
    assert found.flocs == flocs
    assert least <= len(found.regions) <= most
    assert found.foreground_share < 0.2

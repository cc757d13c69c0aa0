"""Masks given directly: every format, labels, and what is no mask."""

import numpy as np
import pytest
from PIL import Image
from scipy.ndimage import gaussian_filter

from flocsim.errors import ImageError
from flocsim.io.images.masks import AGREEING, agreement, is_mask, read_masks, segment_mask
from tests.helpers.real_images import real_image

MASK = np.zeros((30, 40), np.uint8)
MASK[0:10, 3:15] = MASK[15:28, 20:36] = 1
HOLED = MASK.copy()
HOLED[20:23, 25:28] = 0


def areas(path):
    """Areas of the flocs of every mask in a file, by the mask's name."""
    return {name: [r.area for r in segment_mask(mask).regions] for name, mask in read_masks(path)}


@pytest.mark.parametrize("name", ["m.png", "m.tif", "m.bmp", "m.jpg"])
@pytest.mark.parametrize("inside", [1, 255])
def test_pictures_of_two_values_are_masks(tmp_path, name, inside):
    if name == "m.jpg" and inside == 1:
        inside = 200
    Image.fromarray(MASK * inside).save(
        tmp_path / name, **({"quality": 95} if "jpg" in name else {})
    )
    assert areas(tmp_path / name) == {name: [120, 208]}


def test_bits_colours_and_holes(tmp_path):
    Image.fromarray(HOLED.astype(bool)).save(tmp_path / "bits.png")
    Image.fromarray(np.dstack([HOLED * 255] * 3)).save(tmp_path / "colour.png")
    assert areas(tmp_path / "bits.png") == {"bits.png": [120, 208]}
    assert areas(tmp_path / "colour.png") == {"colour.png": [120, 208]}


def test_labels_keep_touching_flocs_apart(tmp_path):
    labels = np.zeros((20, 30), np.uint16)
    labels[2:12, 2:12], labels[2:12, 12:25] = 300, 7
    Image.fromarray(labels).save(tmp_path / "labels.png")
    np.save(tmp_path / "labels.npy", labels)
    assert sorted(areas(tmp_path / "labels.png")["labels.png"]) == [100, 130]
    assert sorted(areas(tmp_path / "labels.npy")["labels.npy"]) == [100, 130]


def test_a_label_in_two_places_is_two_flocs():
    labels = np.zeros((20, 40), int)
    labels[2:12, 2:12] = labels[2:12, 15:28] = 4
    labels[2:12, 28:38] = 9
    found = segment_mask(labels).regions
    assert [(r.area, r.bbox) for r in found] == [
        (100, (2, 2, 12, 12)), (130, (2, 15, 12, 28)), (100, (2, 28, 12, 38))
    ]  # fmt: skip
    assert found[1].centroid == (21.0, 6.5)
    assert [r.label for r in found] == [4, 10, 9]


def test_a_floc_keeps_the_number_of_its_label():
    labels = np.zeros((30, 30), int)
    labels[2:12, 2:12] = 7
    assert [r.label for r in segment_mask(labels).regions] == [7]
    labels[15:25, 15:25] = 3
    found = segment_mask(labels, min_radius=1)
    assert sorted((r.label, r.bbox[0]) for r in found.regions) == [(3, 15), (7, 2)]
    assert [r.label for r in segment_mask((labels > 0) * 255).regions] == [1, 2]


def test_a_label_in_a_hole_of_another_is_a_floc_of_its_own():
    labels = np.zeros((40, 40), int)
    labels[5:35, 5:35], labels[15:25, 15:25] = 1, 2
    assert [(r.label, r.area) for r in segment_mask(labels).regions] == [(1, 800), (2, 100)]


def test_an_empty_mask_has_no_flocs():
    assert segment_mask(np.zeros((5, 5), int)).regions == ()


def test_archives_plain_and_packed(tmp_path):
    np.savez(tmp_path / "plain.npz", a=MASK, b=MASK.astype(bool))
    assert areas(tmp_path / "plain.npz") == {"plain.npz:a": [120, 208], "plain.npz:b": [120, 208]}
    np.savez(tmp_path / "packed.npz", m0=np.packbits(MASK), shapes=np.array([MASK.shape]))
    assert areas(tmp_path / "packed.npz") == {"packed.npz:m0": [120, 208]}


def test_small_and_large_masks_are_rejected_with_the_reason():
    found = segment_mask(MASK.astype(int), min_radius=7)
    assert [r.area for r in found.regions] == [208]
    assert found.rejected_by_reason() == {"too small": 1}
    assert segment_mask(MASK.astype(int), max_radius=7).rejected_by_reason() == {"too large": 1}


@pytest.mark.parametrize(
    "content", [np.linspace(0, 1, 12).reshape(3, 4), np.zeros(5), np.arange(-2, 4).reshape(2, 3)]
)
def test_arrays_that_are_no_masks_are_refused(tmp_path, content):
    np.save(tmp_path / "m.npy", content)
    with pytest.raises(ImageError, match=r"m\.npy.*mask"):
        read_masks(tmp_path / "m.npy")


def photograph(sigma=0.0, shape=(80, 100)):
    """Grey levels (0 … 255) of two bright flocs on black, with the noise of a camera."""
    y, x = np.mgrid[: shape[0], : shape[1]]
    grey = sum(200.0 * np.exp(-((np.hypot(x - c, y - 40) / 15) ** 4)) for c in (25, 70))
    grey += 12.0 * np.random.default_rng(1).standard_normal(shape)
    return np.clip(gaussian_filter(grey, sigma), 0, 255).astype(np.uint8)


@pytest.mark.parametrize("suffix", ["png", "tif", "bmp", "jpg", "npy"])
@pytest.mark.parametrize("sigma", [0.0, 1.0])
def test_a_photograph_is_no_mask(tmp_path, suffix, sigma):
    path = tmp_path / f"photo.{suffix}"
    grey = photograph(sigma)
    np.save(path, grey) if suffix == "npy" else Image.fromarray(grey).save(path)
    with pytest.raises(ImageError, match=r"photo.*is a photograph, not a mask: .* without --masks"):
        read_masks(path)


@pytest.mark.parametrize("side", [5, 9])
def test_labels_that_cover_everything_are_no_photograph(side):
    """The least like neighbours that flocs of these sizes can have: squares side by side."""
    count = 12
    numbers = np.random.default_rng(2).permutation(count * count).reshape(count, count) + 1
    labels = np.kron(numbers, np.ones((side, side), int))
    assert agreement(labels) > AGREEING and is_mask(np.pad(labels, 1).astype(np.uint16))


@pytest.mark.parametrize(
    "name", ["safas/clearfloc.png", "flocpy/023.png", "sandi/Stereomicroscope-image1.jpg"]
)
def test_real_photographs_are_no_masks(name):
    with pytest.raises(ImageError, match="is a photograph"):
        read_masks(real_image(name))

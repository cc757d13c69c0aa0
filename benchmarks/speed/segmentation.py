"""Finding flocs: time and outcome on real pictures, r_eq on known outlines.

    python -m benchmarks.speed.segmentation [--quick] [--markdown] [--images DIR]

Known outlines: real silhouettes put on a 1920×1080 frame with a vignette, blurred by 1 px, with
noise; large frames: the same on 20 megapixels, with specks of one to three pixels.
"""

import numpy as np
from scipy.ndimage import gaussian_filter

from benchmarks.pictures import PICTURES, checked, silhouettes
from benchmarks.reporting import Table, begin, cpu_of
from flocsim.io.images.pictures import segment
from flocsim.io.images.reading import read_grey

SEGMENTED = (
    "flocpy/023.png", "flocpy/024.png", "flocpy/025.png", "safas/brightfield_flocs.png",
    "safas/clayflocs.png", "safas/darkfield_highgray_mudflocs.png",
    "safas/darkfield_noisy_mudflocs_left.png", "sandi/FlocCAM-image2.jpg",
    "sandi/Stereomicroscope-image1.jpg", "soot_tem/201805A_A6_004_half.png",
)  # fmt: skip
HUMAN = "soot_tem/201805A_A6_004_half_mask.png"
FRAME = (1080, 1920)
CELL = 150
BLUR = 1.0
LARGE = (4000, 5000)


def picture_table(images):
    """Time and outcome of every picture."""
    table = Table(
        "Segmentation at the default options",
        ("picture", "pixels", "s", "flocs", "border", "blurred", "small", "foreground %", "IoU"),
    )
    human = read_grey(images / HUMAN) > 0.5
    segment(read_grey(images / SEGMENTED[-1]))
    for name in SEGMENTED:
        grey = read_grey(images / name)
        spent, found = cpu_of(segment, grey)
        left = found.rejected_by_reason()
        both = (found.foreground & human, found.foreground | human) if "soot" in name else None
        table.add(
            name, f"{grey.shape[1]}×{grey.shape[0]}", spent, len(found.regions),
            *(left.get(why, 0) for why in ("at the border", "out of focus", "too small")),
            100 * found.foreground_share, both[0].sum() / both[1].sum() if both else "",
        )  # fmt: skip
    return table


def known_frame(masks, seed, shape=FRAME, cell=CELL, specks=0):
    """A cover (0 … 1) of masks on a grid of cells and of specks, and the place of each mask."""
    rng = np.random.default_rng(seed)
    cover, places = np.zeros(shape), []
    for top, left in rng.integers(4, np.array(shape) - 4, (specks, 2)):
        reach = np.arange(-3, 4)
        disc = np.hypot(*np.meshgrid(reach, reach)) <= rng.uniform(1.0, 3.5)
        cover[top - 3 : top + 4, left - 3 : left + 4][disc] = rng.uniform(0.1, 1.0)
    for number, mask in enumerate(masks):
        row, column = divmod(number, shape[1] // cell)
        spare = cell - np.array(mask.shape) - 8
        top, left = (row, column) * np.array(cell) + 4 + rng.integers(0, spare + 1)
        cover[top : top + mask.shape[0], left : left + mask.shape[1]] = mask
        places.append((left + mask.shape[1] / 2, top + mask.shape[0] / 2))
    return gaussian_filter(cover, BLUR), np.array(places)


def known_grey(cover, flocs, vignette, noise, seed):
    """The frame as a camera would see it."""
    y, x = np.ogrid[-1 : 1 : cover.shape[0] * 1j, -1 : 1 : cover.shape[1] * 1j]
    light = 1.0 - 0.5 * vignette * (x**2 + y**2)
    grey = 0.8 * light * (1 - 0.8 * cover) if flocs == "dark" else 0.1 * light + 0.7 * cover
    return grey + noise * np.random.default_rng(seed).standard_normal(cover.shape)


def known_table(flocs):
    """r_eq found against r_eq known."""
    table = Table(
        "Found/known r_eq of real silhouettes on a synthetic frame",
        ("flocs", "vignette", "noise", "put", "found", "mean ratio", "deviation"),
    )
    usable = [f for f in flocs if f[1] > 5 and max(f[0].shape) < CELL - 8][::2][:70]
    for polarity in ("dark", "bright"):
        for vignette, noise in ((0.0, 0.0), (0.8, 0.0), (0.8, 0.02), (0.8, 0.04)):
            cover, places = known_frame([mask for mask, _ in usable], seed=1)
            found = segment(known_grey(cover, polarity, vignette, noise, 2), neck=0)
            centres = np.array([region.centroid for region in found.regions])
            sizes = np.array([region.equivalent_radius for region in found.regions])
            away = np.hypot(*(centres[:, None] - places[None]).transpose(2, 0, 1))
            near = away.argmin(axis=0)
            ratio = (sizes[near] / [r for _, r in usable])[away.min(axis=0) < 20]
            table.add(polarity, vignette, noise, len(usable), len(ratio), f"{ratio.mean():.4f}",
                      f"{ratio.std():.4f}")  # fmt: skip
    return table


def large_frames(flocs):
    """(name, grey) of frames of 20 megapixels: many flocs, and few among specks."""
    small = [mask for mask, _ in flocs if max(mask.shape) < 96]
    many = [small[k % len(small)] for k in range(1600)]
    few = [mask for mask, _ in flocs if max(mask.shape) < 292]
    for masks, cell, specks in ((many, 105, 0), (few, 300, 8000)):
        cover, _ = known_frame(masks, 1, LARGE, cell, specks)
        name = f"{len(masks):,} flocs, {specks:,} specks"
        yield name, known_grey(cover, "dark", 0.6, 0.02, 2)


def large_table(flocs):
    """CPU time of frames of 20 megapixels."""
    table = Table(
        "Frames of 20 megapixels at the default options", ("frame", "CPU s", "flocs", "left out")
    )
    for name, grey in large_frames(flocs):
        spent, found = cpu_of(segment, grey)
        table.add(name, spent, len(found.regions), len(found.rejected))
    return table


def main():
    """Print the tables."""
    arguments = begin(__doc__, packages=["scikit-image"], images=PICTURES)
    images = checked(arguments.images)
    picture_table(images).print()
    known = silhouettes(images)
    known_table(known).print()
    large_table(known).print()


if __name__ == "__main__":
    main()

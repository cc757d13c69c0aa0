"""Pictures whose flocs are known: layers under noise, blur that may select, bands, necks.

    python -m benchmarks.accuracy.drawn_pictures [--quick] [--markdown] [--images DIR]

Layered: aggregates of overlapping discs, each of which takes a share of the light; IoU of the
foreground, regions for bodies. Blurred: real silhouettes under one blur, made three times smaller,
so that they begin at half of the least size: by known size, kept of put, r_eq found over known,
share of known sizes within the bands.
Crowded: the same flocs before halos, discs so blurred that none is in focus.
"""

import numpy as np
from scipy.ndimage import gaussian_filter, label

from benchmarks.pictures import PICTURES, checked, silhouettes
from benchmarks.reporting import Table, begin
from flocsim.io.images.outlines import EIGHT, filled
from flocsim.io.images.pictures import segment
from flocsim.io.images.reading import read_grey

SOOT = "soot_tem/201805A_A6_004_half"
FRAME = (600, 800)
BLURS = (0.0, 1.0, 2.0, 3.0)
NOISES = (0.0, 0.04, 0.1)
SMALLER = 3
SIZES = ((2, 4), (4, 6), (6, 8), (8, 20))
FALSE = 0.3
"""Share of known flocs in a region below which it is of something else."""
HALOS = (100, 300, 600)


def aggregate(rng, discs, radius, spread):
    """Centres (n, 2) of discs that overlap, each with one before it."""
    places = [(0.0, 0.0)]
    while len(places) < discs:
        y, x = places[rng.integers(len(places))]
        angle, away = rng.uniform(0.0, 2.0 * np.pi), 2.0 * radius * rng.uniform(0.55, spread)
        places.append((y + away * np.cos(angle), x + away * np.sin(angle)))
    found = np.array(places)
    return found - 0.5 * (found.min(axis=0) + found.max(axis=0))


def layered(seed, absorbed, noise, spread=0.9):
    """(grey, true mask) of six aggregates under a vignette."""
    rng = np.random.default_rng(seed)
    row, column = np.mgrid[: FRAME[0], : FRAME[1]]
    layers = np.zeros(FRAME)
    for cell in range(6):
        centre = np.array([(cell // 3 + 0.5) * FRAME[0] / 2, (cell % 3 + 0.5) * FRAME[1] / 3])
        radius = rng.uniform(8.0, 16.0)
        places = aggregate(rng, int(rng.integers(4, 25)), radius, spread)
        inside = np.abs(places).max(axis=1) + radius < FRAME[1] / 6 - 12
        for y, x in places[inside] + centre:
            layers += np.hypot(row - y, column - x) < radius
    down, across = np.mgrid[-1 : 1 : FRAME[0] * 1j, -1 : 1 : FRAME[1] * 1j]
    light = 0.8 * (1.0 - 0.15 * (down**2 + across**2))
    grey = light * gaussian_filter((1.0 - absorbed) ** layers, 1.0)
    return np.clip(grey + noise * rng.standard_normal(FRAME), 0.0, 1.0), filled(layers > 0)


def agreement(found, true):
    return (found & true).sum() / (found | true).sum()


def layered_table(seeds):
    """IoU and counts by the share of light that a layer takes, and noise."""
    columns = ("taken by a layer", "noise", "least IoU", "mean IoU", "bodies", "regions", "parted")
    table = Table("Layered aggregates", columns)
    for absorbed in (0.18, 0.35):
        for noise in NOISES:
            pairs = [layered(seed, absorbed, noise) for seed in seeds]
            found = [segment(grey) for grey, _ in pairs]
            shares = [agreement(f.foreground, t) for f, (_, t) in zip(found, pairs, strict=True)]
            bodies = sum(label(true, EIGHT)[1] for _, true in pairs)
            regions = [region for each in found for region in each.regions]
            parted = sum(region.parted == region.parted for region in regions)
            table.add(absorbed, noise, min(shares), np.mean(shares), bodies, len(regions), parted)
    return table


def placed_in_rows(masks, side, gap):
    """Labels of masks in rows on a square frame."""
    labels, x, y, lowest = np.zeros((side, side), int), gap, gap, 0
    for number, mask in enumerate(masks, start=1):
        height, width = mask.shape
        if x + width + gap > side:
            x, y, lowest = gap, y + lowest + gap, 0
        if y + height + gap > side:
            break
        labels[y : y + height, x : x + width][mask] = number
        x, lowest = x + width + gap, max(lowest, height)
    return labels


def blurred_frame(cover, blur, noise, vignette):
    """The grey of flocs that cover so much of each pixel, 1000 × 1000."""
    down, across = np.mgrid[-1:1:1000j, -1:1:1000j]
    light = 0.8 * (1.0 - 0.5 * vignette * (down**2 + across**2))
    grey = light * (1.0 - 0.6 * gaussian_filter(cover, blur))
    grey += noise * np.random.default_rng(1).standard_normal(grey.shape)
    return np.clip(grey, 0.0, 1.0)


def blurred_table(masks):
    """What is kept of flocs of each size under one blur, and how large it comes out."""
    columns = ("blur px", "noise", "vignette", "known r_eq px", "put", "kept",
               "r_eq found/known", "deviation", "within bands %")  # fmt: skip
    table = Table("Silhouettes under one blur, by size; the least size is 4 px", columns)
    fine = placed_in_rows(masks, 1000 * SMALLER, 40 * SMALLER)
    labels = fine[SMALLER // 2 :: SMALLER, SMALLER // 2 :: SMALLER]
    put = np.sqrt(np.bincount(fine.ravel())[1:] / np.pi) / SMALLER
    cover = (fine > 0).reshape(1000, SMALLER, 1000, SMALLER).mean(axis=(1, 3))
    for blur in BLURS:
        for noise, vignette in ((0.02, 0.6), (0.05, 0.8)):
            regions = segment(blurred_frame(cover, blur, noise, vignette)).regions
            known, found, low, high = np.array(compared(regions, labels, put)[0]).T
            for least, most in SIZES:
                here = (least <= known) & (known < most)
                there = np.count_nonzero((least <= put) & (put < most))
                ratio = found[here] / known[here]
                within = np.mean((low <= known)[here] & (known <= high)[here]) if here.any() else 1
                table.add(blur, noise, vignette, f"{least} to {most}", there, len(ratio),
                          ratio.mean() if len(ratio) else "", ratio.std() if len(ratio) else "",
                          100 * within if len(ratio) else "")  # fmt: skip
    return table


def compared(regions, labels, put):
    """Of regions and known flocs, ``put`` their r_eq: [(known, found, band low, high)] of those
    found, and the number of regions that are not mainly of known flocs."""
    kept, false = [], 0
    for region in regions:
        top, left, bottom, right = region.bbox
        under = labels[top:bottom, left:right][region.mask[1:-1, 1:-1]]
        if np.mean(under > 0) < FALSE:
            false += 1
            continue
        known = put[np.bincount(under[under > 0]).argmax() - 1]
        kept.append((known, region.equivalent_radius, *region.radius_band))
    return kept, false


def crowded_frame(masks, halos, noise, seed):
    """(grey, labels) of the masks before so many halos."""
    rng = np.random.default_rng(seed)
    labels = placed_in_rows([masks[k] for k in rng.permutation(len(masks))], 1000, 40)
    grey = 0.8 * (1.0 - 0.6 * gaussian_filter((labels > 0).astype(float), 1.2))
    for _ in range(halos):
        (y, x), radius = rng.uniform(0, 1000, 2), rng.uniform(8.0, 35.0)
        blur, taken = max(rng.uniform(5.0, 20.0), 0.35 * radius), rng.uniform(0.05, 0.5)
        reach = int(radius + 4 * blur) + 2
        box = tuple(slice(max(0, int(c) - reach), int(c) + reach) for c in (y, x))
        row, column = np.mgrid[:1000, :1000][(slice(None), *box)]
        disc = np.hypot(row - y, column - x) < radius
        grey[box] *= 1.0 - taken * gaussian_filter(disc.astype(float), blur)
    return np.clip(grey + noise * rng.standard_normal(grey.shape), 0.0, 1.0), labels


def crowded_table(masks, seeds):
    """What is found of sharp flocs before halos."""
    columns = ("halos", "noise", "put", "kept", "false", "r_eq found/known", "deviation",
               "off by > 10 %", "within bands %")  # fmt: skip
    table = Table("Silhouettes of 4 to 20 px before halos", columns)
    for halos in HALOS:
        for noise in (0.0, 0.02):
            frames = [crowded_frame(masks, halos, noise, seed) for seed in seeds]
            sizes = [np.sqrt(np.bincount(at.ravel())[1:] / np.pi) for _, at in frames]
            each = [compared(segment(grey, flocs="dark").regions, at, put)
                    for (grey, at), put in zip(frames, sizes, strict=True)]  # fmt: skip
            known, found, low, high = np.array([row for kept, _ in each for row in kept]).T
            ratio, put = found / known, sum(map(len, sizes))
            table.add(halos, noise, put, len(known), sum(false for _, false in each),
                      ratio.mean(), ratio.std(), np.sum(np.abs(ratio - 1.0) > 0.1),
                      100 * np.mean((low <= known) & (known <= high)))  # fmt: skip
    return table


def soot_table(images):
    """A real aggregate of many layers against a human's mask."""
    table = Table("Soot against a human's mask", ("noise scale", "IoU", "regions"))
    grey, human = read_grey(images / f"{SOOT}.png"), read_grey(images / f"{SOOT}_mask.png") > 0.5
    for scale in (1, 2, 3, 4):
        found = segment(grey, noise_scale=scale)
        table.add(scale, agreement(found.foreground, human), len(found.regions))
    return table


def main():
    """Print the tables."""
    arguments = begin(__doc__, packages=["scikit-image"], images=PICTURES)
    images = checked(arguments.images, "soot_tem", "silhouettes")
    soot_table(images).print()
    layered_table(range(2 if arguments.quick else 8)).print()
    masks = [mask for mask, _ in silhouettes(images) if max(mask.shape) < 72][:80]
    blurred_table([mask for mask, _ in silhouettes(images) if max(mask.shape) < 200]).print()
    crowded_table(masks, range(1 if arguments.quick else 3)).print()


if __name__ == "__main__":
    main()

"""What a picture would show without flocs: noise, uneven light, and what a program has burnt in.

Scale bars, their text and the boxes around them are left out. A bar is told by what no floc has:
all its pixels are of one grey, the brightest or the darkest of the picture, they fill a rectangle
along the axes, and the picture changes at once at its sides.
"""

import numpy as np

SURFACE_ROUNDS = 15
"""Rounds of reweighting; the surface moves by less than a grey level after about ten."""

SURFACE_SAMPLES = 120
"""Points along the longer side that the surface is fitted to: plenty for a degree of 6."""

RIM = 0.08
"""Share of a picture's sides within which the light is told, where a floc covers much of it."""

RIM_DEGREE = 2
"""Degree of the surface that is begun there: light falls off to the sides like this, mostly."""

CLEARLY = 1.5
"""Ratio of what two surfaces leave at the rim, above which they differ by more than chance."""

MORE = 0.02
"""The same of the shares of a picture that lie on them."""

FEWEST_FRAMES = 3
"""The median of fewer frames still shows their flocs."""

NOISE_SAMPLES = 500
"""Points along the longer side that tell the noise."""

DARKEST = 0.01
"""Added before taking logarithms: about the black level of 8-bit cameras."""

ONE_THREAD = 2**18
"""Multiplications of a matrix product up to which OpenBLAS starts no threads: on a machine where
others keep the cores busy these wait for each other, and take thirty times as long as one alone."""

STRIP = 64
"""Rows of a picture that are worked on at once: what is made of them stays in the cache."""

SAME = 0.02
"""Greys that differ by less are one: packing as JPEG scatters them."""

STANDING_OUT = 0.1
"""Least contrast of a bar against what lies beside it."""

FULL = 0.97
"""Share of its box that a rectangle fills."""

LONG, SLENDER = 16, 4.0
"""Least length [px], and times the width, of a bar."""

BOXED = 0.02
"""Least share of a rectangle that writing on it covers: a plain stout one may be anything."""

LARGEST = 0.25
"""Share of the picture above which a rectangle of one grey is its background."""

AROUND, TALL = 0.6, 60
"""Writing lies within this share of a bar's length, and letters are no taller [px]."""

MARGIN = 2
"""Pixels around what is burnt in whose greys are mixed with it."""


def low_pass(grey: np.ndarray, scale: float) -> np.ndarray:
    """`grey` with detail finer than `scale` [px] removed: exp(−½ (k·scale)²) in Fourier space.

    The cosine transform is the Fourier transform of the picture mirrored at its edges, so that
    opposite edges do not bleed into each other.
    """
    from scipy import fft

    spectrum = fft.dctn(grey, norm="ortho")
    for axis, size in enumerate(grey.shape):
        wavenumber = np.pi * np.arange(size) / size
        gain = np.exp(-0.5 * (wavenumber * scale) ** 2).astype(grey.dtype)
        spectrum *= np.expand_dims(gain, 1 - axis)
    return fft.idctn(spectrum, norm="ortho", overwrite_x=True)


def robust_deviation(values: np.ndarray) -> float:
    """The standard deviation of a normal bulk, blind to outliers: 1.4826 × median |v − median|."""
    return 1.4826 * float(np.median(np.abs(values - np.median(values))))


def stride_of(shape: tuple[int, ...]) -> int:
    """Which pixels, along both sides, tell the noise of a picture: every so many."""
    return max(1, max(shape) // NOISE_SAMPLES)


def sampled(picture: np.ndarray) -> np.ndarray:
    """The pixels of a picture that tell its noise."""
    stride = stride_of(picture.shape)
    return picture[::stride, ::stride]


def strips(picture: np.ndarray) -> list[slice]:
    """The rows of a picture, STRIP at a time."""
    return [slice(top, min(top + STRIP, len(picture))) for top in range(0, len(picture), STRIP)]


def smooth_surface(grey: np.ndarray, degree: int, logarithmic: bool = False) -> np.ndarray:
    """The light without flocs: a polynomial surface, fitted robustly, of the same shape as `grey`;
    for light that falls off by a factor it is fitted to the logarithm.

    Least squares over products of Legendre polynomials of total degree ≤ `degree`, reweighted
    w = 1/(1 + (residual/1.5σ)²)² so that pixels of flocs lose their say; σ is the robust deviation.
    """
    places = (np.linspace(-1.0, 1.0, n) if n > 1 else np.zeros(1) for n in grey.shape)
    rows, columns = (np.polynomial.legendre.legvander(along, degree) for along in places)
    step = max(1, -(-max(grey.shape) // SURFACE_SAMPLES))
    values = grey[::step, ::step].astype(float)
    if logarithmic:
        values = np.log(np.maximum(values, 0.0) + DARKEST)
    basis = np.einsum("yi,xj->yxij", rows[::step], columns[::step])
    orders = np.add.outer(np.arange(degree + 1), np.arange(degree + 1))
    coefficients = np.zeros(orders.shape)
    rim = np.ones(values.shape, bool)
    down, across = (max(1, round(RIM * n)) for n in values.shape)
    rim[down : values.shape[0] - down, across : values.shape[1] - across] = False
    coefficients[orders <= degree] = _surface_fit(
        basis[..., orders <= degree].reshape(values.size, -1), values.ravel(),
        orders[orders <= degree], rim.ravel(),
    )  # fmt: skip
    surface = (rows @ coefficients).astype(grey.dtype) @ columns.T.astype(grey.dtype)
    if logarithmic:
        np.exp(surface, out=surface)
        surface -= DARKEST
    return surface


def _surface_fit(basis, values, orders, rim):
    """The coefficients of the light.

    A floc that covers much of the picture draws the surface into itself, and is then hollow or in
    pieces. So a second fit begins at the rim of the picture, which few flocs reach, at a low order,
    and spreads inwards from there over what is as the rim is. It is taken where the first one
    leaves clearly more at the rim, or less of the picture lies on it.
    """
    every = np.ones(len(values), bool)
    first = _reweighted_fit(basis, values, every, np.ones(len(values)))
    if rim.all():
        return first
    low = orders <= RIM_DEGREE
    begun = _reweighted_fit(basis[:, low], values, rim, rim.astype(float))
    weights = _weights(values - basis[:, low] @ begun, rim)
    second = _reweighted_fit(basis, values, rim, weights)
    residuals = [values - basis @ each for each in (first, second)]
    left = [robust_deviation(each[rim]) + 1e-3 for each in residuals]
    near = [float(np.mean(np.abs(each) < min(left))) for each in residuals]
    if left[0] > CLEARLY * left[1]:
        return second
    return second if left[1] < CLEARLY * left[0] and near[1] > near[0] + MORE else first


def _weights(residual, told):
    """Weights of samples; ``told``: those that tell where the light lies, and how it scatters."""
    centre = np.median(residual[told])
    deviation = robust_deviation(residual[told]) + 1e-3
    return 1.0 / (1.0 + ((residual - centre) / (1.5 * deviation)) ** 2) ** 2


def _reweighted_fit(basis, values, told, weights):
    size = max(1, ONE_THREAD // basis.shape[1] ** 2)
    blocks = [slice(first, first + size) for first in range(0, len(basis), size)]
    for _ in range(SURFACE_ROUNDS):
        weighted = basis * (weights * weights)[:, None]
        # Legendre products are near orthogonal: the normal equations are safe, and fast.
        normal = sum(weighted[block].T @ basis[block] for block in blocks)
        solution = np.linalg.lstsq(normal, np.einsum("nk,n->k", weighted, values), rcond=None)[0]
        weights = _weights(values - np.einsum("nk,k->n", basis, solution), told)
    return solution


def without_annotations(grey: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(the picture with the greys around them in the place of scale bars and their writing, (h, w)
    bool of what was replaced).

    grey: (h, w) in [0, 1]. The picture itself, and nothing replaced, where there is none.
    """
    from scipy.ndimage import binary_dilation, label

    found = np.zeros(grey.shape, bool)
    labels = np.empty(grey.shape, np.int32)
    for flat in (grey <= grey.min() + SAME, grey >= grey.max() - SAME):
        label(flat, np.ones((3, 3), int), output=labels)
        found |= burnt_in(grey, labels)
    if not found.any():
        return grey, found
    found = binary_dilation(found, np.ones((3, 3), bool), iterations=MARGIN)
    return filled_from_around(grey, found), found


def burnt_in(grey, labels):
    """What of the numbered pieces (h, w), all of one grey, is a bar or writing beside it."""
    from scipy.ndimage import binary_fill_holes, find_objects

    boxes = find_objects(labels)
    found = np.zeros(grey.shape, bool)
    for number, box in enumerate(boxes, 1):
        height, width = (side.stop - side.start for side in box)
        if max(height, width) < LONG or height * width > LARGEST * grey.size:
            continue
        part = labels[box] == number
        if part.sum() < 0.3 * part.size:
            continue
        whole = binary_fill_holes(part)
        slender = max(height, width) >= SLENDER * min(height, width)
        written = whole.sum() - part.sum() >= BOXED * whole.sum() and min(height, width) >= 5
        if whole.sum() < FULL * whole.size or not (slender or written):
            continue
        if min(height, width) < 2 or not stands_out(grey, box):
            continue
        found[box] |= whole
        if slender:
            found |= writing(labels, boxes, box, grey.shape)
    return found


def stands_out(grey, box):
    """Whether a rectangle differs at once from what lies two pixels beside its long sides."""
    rows, columns = box
    if rows.stop - rows.start > columns.stop - columns.start:
        return stands_out(grey.T, (columns, rows))
    beside = (row for row in (rows.start - 3, rows.stop + 2) if 0 <= row < len(grey))
    apart = [np.abs(grey[row, columns] - np.median(grey[box])) for row in beside]
    return bool(apart) and all(np.mean(each > STANDING_OUT) > 0.9 for each in apart)


def writing(labels, boxes, bar, shape):
    """Pixels of the bar's grey in pieces no larger than letters, above, below or beside it."""
    length = max(side.stop - side.start for side in bar)
    reach = int(np.clip(AROUND * length, 12, 2 * TALL))
    near = tuple(slice(max(side.start - reach, 0), min(side.stop + reach, size))
                 for side, size in zip(bar, shape, strict=True))  # fmt: skip
    found = np.zeros(shape, bool)
    for number in np.unique(labels[near]):
        if number == 0:
            continue
        box = boxes[number - 1]
        inside = all(
            a.start <= b.start and b.stop <= a.stop for a, b in zip(near, box, strict=True)
        )
        if inside and max(side.stop - side.start for side in box) <= min(TALL, reach):
            found[box] |= labels[box] == number
    return found


def filled_from_around(grey, found):
    """The picture with the median of the pixels around it in each part of what was found."""
    from scipy.ndimage import binary_dilation, find_objects, label

    result = grey.copy()
    labels, _ = label(binary_dilation(found, iterations=MARGIN))
    for number, box in enumerate(find_objects(labels), 1):
        wide = tuple(slice(max(side.start - 6, 0), side.stop + 6) for side in box)
        ring = ~found[wide] & (labels[wide] != number)
        inside = found[wide] & (labels[wide] == number)
        values = grey[wide][ring] if ring.any() else grey[~found]
        result[wide][inside] = np.median(values) if values.size else 0.0
    return result

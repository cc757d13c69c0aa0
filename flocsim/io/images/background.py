"""What a picture would show without flocs: noise and uneven light."""

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

"""Noise and uneven light: what a picture would show without flocs."""

from collections.abc import Sequence

import numpy as np

SURFACE_ROUNDS = 15
"""Rounds of reweighting; the surface moves by less than a grey level after about ten."""

SURFACE_SAMPLES = 120
"""Points along the longer side that the surface is fitted to: plenty for a degree of 6."""

FEWEST_FRAMES = 3
"""The median of fewer frames still shows their flocs."""

NOISE_SAMPLES = 500
"""Points along the longer side that tell the noise."""

DARKEST = 0.01
"""Added before taking logarithms: about the black level of 8-bit cameras."""


def low_pass(grey: np.ndarray, scale: float) -> np.ndarray:
    """`grey` with detail finer than `scale` [px] removed: exp(−½ (k·scale)²) in Fourier space.

    The cosine transform is the Fourier transform of the picture mirrored at its edges, so that
    opposite edges do not bleed into each other.
    """
    from scipy import fft

    spectrum = fft.dctn(grey, norm="ortho")
    for axis, size in enumerate(grey.shape):
        wavenumber = np.pi * np.arange(size) / size
        gain = np.exp(-0.5 * (wavenumber * scale) ** 2)
        spectrum *= np.expand_dims(gain, 1 - axis)
    return fft.idctn(spectrum, norm="ortho")


def median_frame(frames: Sequence[np.ndarray]) -> np.ndarray:
    """The light of a fixed camera: per pixel the median of frames (h, w) of one shape."""
    return np.median(np.stack(frames), axis=0)


def robust_deviation(values: np.ndarray) -> float:
    """The standard deviation of a normal bulk, blind to outliers: 1.4826 × median |v − median|."""
    return 1.4826 * float(np.median(np.abs(values - np.median(values))))


def noise_deviation(fine: np.ndarray) -> float:
    """robust_deviation of a sample of the detail that the low pass took out."""
    stride = max(1, max(fine.shape) // NOISE_SAMPLES)
    return robust_deviation(fine[::stride, ::stride])


def smooth_surface(grey: np.ndarray, degree: int) -> np.ndarray:
    """The light without flocs: a polynomial surface, fitted robustly, of the same shape as `grey`.

    Least squares over products of Legendre polynomials of total degree ≤ `degree`, reweighted
    w = 1/(1 + (residual/1.5σ)²)² so that pixels of flocs lose their say; σ is the robust deviation.
    """
    places = (np.linspace(-1.0, 1.0, n) if n > 1 else np.zeros(1) for n in grey.shape)
    rows, columns = (np.polynomial.legendre.legvander(along, degree) for along in places)
    step = max(1, -(-max(grey.shape) // SURFACE_SAMPLES))
    sample = grey[::step, ::step]
    basis = np.einsum("yi,xj->yxij", rows[::step], columns[::step])
    terms = np.add.outer(np.arange(degree + 1), np.arange(degree + 1)) <= degree
    coefficients = np.zeros(terms.shape)
    coefficients[terms] = _reweighted_fit(
        basis[..., terms].reshape(sample.size, -1), sample.ravel()
    )
    return rows @ coefficients @ columns.T


def light_surface(grey: np.ndarray, degree: int) -> np.ndarray:
    """As smooth_surface, for light that falls off by a factor: fitted to the logarithm of grey."""
    return np.exp(smooth_surface(np.log(np.maximum(grey, 0.0) + DARKEST), degree)) - DARKEST


def _reweighted_fit(basis, values):
    weights = np.ones_like(values)
    for _ in range(SURFACE_ROUNDS):
        weighted = basis * (weights * weights)[:, None]
        # Legendre products are near orthogonal: the normal equations are safe, and fast.
        solution = np.linalg.lstsq(weighted.T @ basis, weighted.T @ values, rcond=None)[0]
        residual = values - basis @ solution
        deviation = robust_deviation(residual) + 1e-3
        weights = 1.0 / (1.0 + ((residual - np.median(residual)) / (1.5 * deviation)) ** 2) ** 2
    return solution

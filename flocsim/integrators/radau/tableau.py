"""Butcher tableau of Radau IIA with three stages, and its transformation to eigenvectors.

Order 5, stage order 3, stiffly accurate, L-stable. The inverse of the matrix has one real and two
conjugate complex eigenvalues µ. Along their eigenvectors the 9n equations of a Newton iteration
decouple into a real and a complex system of 3n each, as in RADAU5 (Hairer & Wanner, Solving
Ordinary Differential Equations II, 1996, section IV.8).
"""

from flocsim.state.work import FIRST_STAGE

SECOND_STAGE, THIRD_STAGE = FIRST_STAGE + 1, FIRST_STAGE + 2
"""States of the later stages. The third one is the end of the step."""

# √6, from which all coefficients follow.
ROOT = 6.0**0.5

NODES = ((4.0 - ROOT) / 10.0, (4.0 + ROOT) / 10.0, 1.0)
"""Times c of the stages, as fractions of the step."""

MATRIX = (
    ((88.0 - 7.0 * ROOT) / 360.0, (296.0 - 169.0 * ROOT) / 1800.0, (-2.0 + 3.0 * ROOT) / 225.0),
    ((296.0 + 169.0 * ROOT) / 1800.0, (88.0 + 7.0 * ROOT) / 360.0, (-2.0 - 3.0 * ROOT) / 225.0),
    ((16.0 - ROOT) / 36.0, (16.0 + ROOT) / 36.0, 1.0 / 9.0),
)
"""Runge–Kutta matrix A: x_i − x_0 = h Σ A_ij v_j."""

ESTIMATE = ((-13.0 - 7.0 * ROOT) / 3.0, (-13.0 + 7.0 * ROOT) / 3.0, -1.0 / 3.0)
"""Weights of the stages' increments in the embedded error estimate of order 3, over γ₀ = 1/µ of the
real eigenvalue (Hairer & Wanner, IV.8.20)."""


REAL, COMPLEX = range(2)
"""The two decoupled systems: of the real eigenvalue, and of the complex pair."""

EIGENVALUES = ((3.637834252744486 + 0j), (2.681082873627755 + 3.0504301992474168j))
"""µ of the inverse of MATRIX: the real one, and the one of the pair with positive imaginary part,
both as complex numbers. Eigenvalues, eigenvectors and inverse are written out: the last digits of
numpy.linalg differ between processors, and results would differ with them."""

TO_EIGENBASIS = (
    (
        (4.325579890063147 + 6.491557772339113e-17j),
        (0.33919925181581756 + 5.090488663855051e-18j),
        (0.5417705399358723 - 1.3675263666638026e-18j),
    ),
    (
        (2.2975051835980302 + 0.2764848745290874j),
        (0.180163598667932 - 1.4140735657756325j),
        (-0.26205284301838094 + 0.3277088735980011j),
    ),
)
"""Rows of T⁻¹, which transform stage values to the eigenvectors."""

FROM_EIGENBASIS = (
    ((0.09123239487089321 + 0j), (0.128458062178301 - 0.02730865475132216j)),
    ((0.2417179327071084 + 0j), (-0.1856359510309568 + 0.34824890439657535j)),
    ((0.9660481826150926 + 0j), (-0.9094035176468618 + 0j)),
)
"""Columns of T, which transform back. The conjugate of the complex column is implied."""

INVERSE = (
    (3.2247448713915885, 1.1678400846904056, -0.25319726474218096),
    (-3.5678400846904053, 0.7752551286084111, 1.053197264742181),
    (5.531972647421811, -7.531972647421809, 5.0),
)
"""A⁻¹: h dv_i/dt = Σ A⁻¹_ij (v_j − v_0)."""

"""Radau IIA with three stages, order 5: stiffly accurate, L-stable, stage order 3.

The inverse of its matrix has one real and two conjugate eigenvalues; Newton's method is decoupled
along their vectors, as in RADAU5 (Hairer & Wanner, Solving Ordinary Differential Equations II,
1996, section IV.8).
"""

from flocsim.state.work import FIRST_STAGE

SECOND_STAGE, THIRD_STAGE = FIRST_STAGE + 1, FIRST_STAGE + 2
"""States of the later stages; the third one is the end of the step."""

ROOT = 6.0**0.5

NODES = ((4.0 - ROOT) / 10.0, (4.0 + ROOT) / 10.0, 1.0)
"""Where the stages lie in the step."""

MATRIX = (
    ((88.0 - 7.0 * ROOT) / 360.0, (296.0 - 169.0 * ROOT) / 1800.0, (-2.0 + 3.0 * ROOT) / 225.0),
    ((296.0 + 169.0 * ROOT) / 1800.0, (88.0 + 7.0 * ROOT) / 360.0, (-2.0 - 3.0 * ROOT) / 225.0),
    ((16.0 - ROOT) / 36.0, (16.0 + ROOT) / 36.0, 1.0 / 9.0),
)
"""Weights of the stages' rates in the stages' increments."""

ESTIMATE = ((-13.0 - 7.0 * ROOT) / 3.0, (-13.0 + 7.0 * ROOT) / 3.0, -1.0 / 3.0)
"""Weights of the stages' increments in the error estimate of order 3 (Hairer & Wanner, IV.8.20)."""


REAL, PAIR = range(2)
"""The systems that Newton's method is decoupled into: of the real eigenvalue, of the pair."""

EIGENVALUES = ((3.637834252744486 + 0j), (2.681082873627755 + 3.0504301992474168j))
"""The real eigenvalue of the inverse of MATRIX and the one of the pair above the axis (all complex
numbers). They, their vectors and the inverse are written down: numpy.linalg would give other last
digits on other processors, and with them other code."""

TO_VECTORS = (
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
"""Rows that take stages to the eigenvectors."""

FROM_VECTORS = (
    ((0.09123239487089321 + 0j), (0.128458062178301 - 0.02730865475132216j)),
    ((0.2417179327071084 + 0j), (-0.1856359510309568 + 0.34824890439657535j)),
    ((0.9660481826150926 + 0j), (-0.9094035176468618 + 0j)),
)
"""Columns that take them back, the pair's other half being the conjugate."""

INVERSE = (
    (3.2247448713915885, 1.1678400846904056, -0.25319726474218096),
    (-3.5678400846904053, 0.7752551286084111, 1.053197264742181),
    (5.531972647421811, -7.531972647421809, 5.0),
)
"""Weights of the stages' increments in the stages' rates."""

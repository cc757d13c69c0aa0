"""How a force ends at some gap without a jump."""

FADES_FROM = 0.5
"""Share of the cut from which on a force fades."""


def fading(gap, cut):
    """(w, dw/dgap): 1 up to half the cut, 0 from the cut on, a cubic without a kink between."""
    left = (cut - gap) / ((1.0 - FADES_FROM) * cut)
    if left >= 1.0:
        return 1.0, 0.0
    if left <= 0.0:
        return 0.0, 0.0
    slope = -6.0 * left * (1.0 - left) / ((1.0 - FADES_FROM) * cut)
    return left * left * (3.0 - 2.0 * left), slope

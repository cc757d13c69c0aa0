"""Counts of an ensemble, and of resamples of it: what the intervals of the claims come from.

A replicate has the same orientations and flocs in every condition, so that conditions are not
independent: whole replicates are drawn anew, with replacement, in all conditions at once (the
bootstrap of clusters; A. C. Davison & D. V. Hinkley, Bootstrap Methods, 1997, ch. 3.8).
"""

import attrs
import numpy as np

from flocsim.io.results.schema import CLASSES, NOT_APPLICABLE

from .verdicts import MissingData

RESAMPLES = 500
SEED = 20140601
"""Fixed, so that the same results give the same table."""


@attrs.frozen(eq=False)
class Counts:
    """Counts on axes (type, vertices, delta, sample); sample 0 is the ensemble as it is.

    ``collided``, ``inside``; ``classes`` has the class A–D as its first axis.
    """

    types: tuple
    vertices: np.ndarray
    delta: np.ndarray
    collided: np.ndarray
    inside: np.ndarray
    classes: np.ndarray

    def type(self, name):
        """The place of a collision type; MissingData where the results have no such type."""
        if name not in self.types:
            raise MissingData(f"there is no Type {name}")
        return self.types.index(name)

    @property
    def polygons(self):
        """Places of the spheropolygons, N > 1, in the order of N; MissingData without."""
        places = [k for k in np.argsort(self.vertices) if self.vertices[k] > 1]
        if not places:
            raise MissingData("there are no spheropolygons")
        return places

    @property
    def pr_inside(self):
        """Pr[C inside]."""
        return ratio(self.inside, self.collided)

    @property
    def pr_a_inside(self):
        """Pr[A | C inside] over decided collisions."""
        return ratio(self.classes[0], self.classes[0] + self.classes[1])

    @property
    def pr_a_outside(self):
        """Pr[A | C outside] over decided collisions."""
        return ratio(self.classes[2], self.classes[2] + self.classes[3])

    @property
    def pr_a(self):
        """Pr[A] over decided collisions."""
        return ratio(self.classes[0] + self.classes[2], self.classes.sum(axis=0))

    @property
    def pr_class(self):
        """Pr[class], the class as the first axis, over decided collisions."""
        return ratio(self.classes, self.classes.sum(axis=0))


def ratio(part, whole):
    """part/whole, NaN where whole is 0."""
    with np.errstate(divide="ignore", invalid="ignore"):
        return part / whole


def weights(count, resamples, seed=SEED):
    """How often each of ``count`` things is drawn, (count, 1 + resamples); once in the first."""
    rng = np.random.default_rng(seed)
    drawn = rng.multinomial(count, np.full(count, 1.0 / count), size=resamples)
    return np.vstack([np.ones(count, dtype=drawn.dtype), drawn]).T.astype(np.float32)


def counted(flags, drawn):
    """Σ over the last axis of flags, for every column of weights; exact below 2²⁴."""
    return flags.astype(np.float32) @ drawn


def counts_of(results, resamples=RESAMPLES):
    """The Counts of Results that hold their replicates."""
    outcome, inside = (results.replicates[name] for name in ("outcome", "inside"))
    drawn = weights(outcome.shape[-1], resamples)
    classes = [counted(outcome == code, drawn) for code in range(len(CLASSES))]
    return Counts(
        results.types, results.vertices, results.delta,
        counted(inside != NOT_APPLICABLE, drawn), counted(inside == 1, drawn), np.stack(classes),
    )  # fmt: skip


def resampled_means(values, resamples=RESAMPLES):
    """Means over the first axis, flocs, and of resamples of it: (1 + resamples, …)."""
    values = np.asarray(values, dtype=float)
    drawn = weights(len(values), resamples).T / len(values)
    return np.tensordot(drawn, values, axes=1)

"""Who meets whom: for every collision type, pair of radii or pair of size classes, which two flocs
a replicate draws, and between which sizes they are.

Of measured flocs, two are drawn independently of each other, each with its weight; two of one size
settle alike and never meet, so that such pairs are drawn anew. Of two, the larger, which settles
faster, is j. What is drawn follows from the flocs and two random numbers alone: the flocs lie in
the order of their sizes, so that a number means the same quantile at any weight.
"""

import abc
import math
from collections.abc import Sequence
from typing import Any

import attrs
import numpy as np

from flocsim.ensembles.collision.flocs import Floc, FlocPool, pool_of
from flocsim.ensembles.config.pair_scene import SETTLING, PairScene
from flocsim.ensembles.config.schema import Config
from flocsim.ensembles.kind import Numbers
from flocsim.errors import ConfigError, plural

EXPONENTS = {"number": 0, "area": 2, "volume": 3}
"""Power of r_eq by which a floc's weight grows."""

SAME_SIZE = 1e-3
"""Relative difference up to which two sizes are one: outlines of pictures do not tell them apart,
and such flocs settle at nearly the same speed."""

Span = tuple[float, float]
"""The least and the largest equivalent radius [m]."""


class Pairing(abc.ABC):
    """One collision type of a study: its ``name``, and ``radii`` (r_i, r_j) [m] that stand for it.

    ``spans``: between which equivalent radii bodies i and j are; ``meeting``: what brings them
    together.
    """

    name: str
    meeting: str
    radii: tuple[float, float]
    spans: tuple[Span, Span]

    @abc.abstractmethod
    def choose(self, numbers: Numbers) -> tuple[int, int]:
        """Places of the flocs of i and j for a replicate's random numbers."""

    @property
    @abc.abstractmethod
    def drawn(self) -> set[int]:
        """Indices of the flocs that `choose` may return."""

    @property
    def fastest(self) -> tuple[float, float]:
        """r_i and r_j [m] of the pair that meets at the highest speed."""
        return self.spans[0][0], self.spans[1][1]

    @property
    def largest(self) -> tuple[float, float]:
        """The largest r_i and r_j [m]."""
        return self.spans[0][1], self.spans[1][1]


@attrs.frozen(eq=False)
class TwoSizes(Pairing):
    """Two bodies of given radii, or of about these where flocs keep their own sizes."""

    name: str
    radii: tuple[float, float]
    pool: FlocPool
    meeting: str = SETTLING

    @property
    def spans(self) -> tuple[Span, Span]:  # type: ignore[override]
        if not self.pool.own_size:
            return tuple((radius, radius) for radius in self.radii)  # type: ignore[return-value]
        sizes = self.pool.near(self.radii)
        return (sizes[0], sizes[-2]), (sizes[1], sizes[-1])

    @property
    def drawn(self) -> set[int]:
        return {k for radius in self.radii for k in self.pool.by_size(radius)[: self.pool.pool]}

    def choose(self, numbers: Numbers) -> tuple[int, int]:
        return self.pool.choose(numbers, *self.radii)


@attrs.frozen(eq=False)
class SizeClass:
    """Measured flocs of one class: their ``places``, ``sizes`` [m] in ascending order, ``weights``
    of the sum 1."""

    label: str
    places: np.ndarray
    sizes: np.ndarray
    weights: np.ndarray

    @property
    def weights_beside(self) -> tuple[np.ndarray, np.ndarray]:
        """For each floc the weights of all that are smaller, and of all that are larger."""
        sums = np.append(0.0, np.cumsum(self.weights))
        first = np.searchsorted(self.sizes, self.sizes * (1.0 - SAME_SIZE), side="left")
        stop = np.searchsorted(self.sizes, self.sizes * (1.0 + SAME_SIZE), side="right")
        return sums[first], sums[-1] - sums[stop]


@attrs.frozen(eq=False)
class TwoClasses(Pairing):
    """Two flocs drawn from two size classes, or from one; ``radii`` are medians over the pairs."""

    name: str
    first: SizeClass
    second: SizeClass
    meeting: str = SETTLING
    radii: tuple[float, float] = attrs.field(init=False)
    spans: tuple[Span, Span] = attrs.field(init=False)

    def __attrs_post_init__(self):
        sizes, joint = self.distribution()
        medians = [float(x[quantile(w, 0.5)]) for x, w in zip(sizes, joint, strict=True)]
        object.__setattr__(self, "radii", tuple(medians))
        spans = [(x[w > 0.0].min(), x[w > 0.0].max()) for x, w in zip(sizes, joint, strict=True)]
        object.__setattr__(self, "spans", tuple(tuple(map(float, each)) for each in spans))

    @property
    def drawn(self) -> set[int]:
        return {*self.first.places.tolist(), *self.second.places.tolist()}

    def distribution(self) -> tuple[list[np.ndarray], list[np.ndarray]]:
        """(sizes [m], weights) of bodies i and j over all pairs."""
        both = (self.first, self.second)
        weights = [each.weights for each in both]
        if self.first is self.second:
            # i is the smaller of two: its weight times that of all that are larger, and the reverse
            # for j.
            below, above = self.first.weights_beside
            weights = [weights[0] * above, weights[0] * below]
        return [each.sizes for each in both], weights

    def choose(self, numbers: Numbers) -> tuple[int, int]:
        """Two flocs of unlike sizes, as if drawn until they are."""
        own, other = self.first, self.second
        # Redrawing until sizes differ favours flocs of rare sizes.
        chances = own.weights * sum(own.weights_beside) if own is other else own.weights
        one = quantile(chances, numbers[2])
        alike = np.abs(other.sizes / own.sizes[one] - 1.0) <= SAME_SIZE
        two = quantile(np.where(alike, 0.0, other.weights), numbers[3])
        pair = int(own.places[one]), int(other.places[two])
        return pair if own.sizes[one] < other.sizes[two] else pair[::-1]


def quantile(weights: np.ndarray, number: float) -> int:
    """The place at which the running sum of weights passes a share ``number`` in [0, 1) of it."""
    sums = np.cumsum(weights)
    place = int(np.searchsorted(sums, number * sums[-1], side="right"))
    # A product rounded up to the sum itself would be past the last floc that has a weight.
    return min(place, int(np.flatnonzero(weights)[-1]))


def within_limits(scene: Any, flocs: Sequence[Floc]) -> np.ndarray:
    """Places of the measured flocs between `min_radius` and `max_radius` of a scene, in the order
    of their sizes; ConfigError where there is none."""
    sizes = np.array([floc.measured_size for floc in flocs], float)
    low, high = scene.min_radius or 0.0, scene.max_radius or math.inf
    order = np.argsort(sizes, kind="stable")
    found = order[(sizes[order] >= low) & (sizes[order] <= high)]
    if not len(found):
        raise ConfigError(
            "no floc of the library lies between scene.min_radius and max_radius: it holds "
            f"{plural(len(flocs), 'floc')} of {in_words(sizes)}"
        )
    return found


def drawing_weights(scene: Any, flocs: Sequence[Floc]) -> np.ndarray:
    """How often measured flocs are drawn: for as many as each stands for, by number or size."""
    sizes = np.array([floc.measured_size for floc in flocs])
    counts = np.array([floc.weight for floc in flocs])
    return counts * (sizes / sizes.max()) ** EXPONENTS[scene.weight or "number"]


def size_classes(scene: PairScene, flocs: Sequence[Floc]) -> list[SizeClass]:
    """The classes of ``[scene] pairs = "measured"``; ConfigError for one without flocs."""
    order = within_limits(scene, flocs)
    chosen = np.array([flocs[place].measured_size for place in order.tolist()])
    weights = drawing_weights(scene, [flocs[place] for place in order.tolist()])
    if isinstance(scene.classes, tuple):
        number = np.searchsorted(scene.classes, chosen, side="right")
    else:
        # All classes have the same weight; one size is in one class.
        count = scene.classes or 1
        _, inverse = np.unique(chosen, return_inverse=True)
        each = np.bincount(inverse, weights)
        middle = (np.cumsum(each) - 0.5 * each) / each.sum()
        number = np.minimum((count * middle).astype(int), count - 1)[inverse]
    classes = []
    for place, label in enumerate(scene.class_labels):
        mine = np.flatnonzero(number == place)
        if len(mine) < 2 or chosen[mine[-1]] <= (1.0 + SAME_SIZE) * chosen[mine[0]]:
            raise ConfigError(
                f"scene.classes: of {len(order)} flocs of {in_words(chosen)}, class {label} holds "
                f"{len(mine)}{' of one size' if len(mine) else ''}, which never meet: "
                "give fewer or wider classes, or a library of more flocs"
            )
        share = weights[mine] / weights[mine].sum()
        classes.append(SizeClass(label, order[mine], chosen[mine], share))
    return classes


def class_facts(pairings: Sequence[Pairing]) -> list[dict]:
    """[{label, low, high [m], flocs}] of the size classes of measured flocs, the smallest first."""
    classes: dict[str, SizeClass] = {}
    for pairing in pairings:
        if isinstance(pairing, TwoClasses):
            classes |= {each.label: each for each in (pairing.first, pairing.second)}
    return [
        {"label": each.label, "low": float(each.sizes[0]), "high": float(each.sizes[-1]),
         "flocs": len(each.sizes)}
        for each in classes.values()
    ]  # fmt: skip


def in_words(sizes):
    return f"{1e6 * np.min(sizes):.3g} to {1e6 * np.max(sizes):.3g} um"


def pairings_of(
    config: Config, flocs: Sequence[Floc], pool: FlocPool | None = None
) -> tuple[Pairing, ...]:
    """The Pairing of every collision type of a config, in its order.

    ``flocs``: all of the study; for bodies of given radii that are only looked at, none. ``pool``:
    theirs, where there is one.
    """
    scene = config.scene
    pool = pool or pool_of(config.shapes, flocs)
    if not scene.is_measured:
        return tuple(
            TwoSizes(name, radii, pool, scene.meeting_of(place))
            for place, (name, radii) in enumerate(scene.given)
        )
    classes = size_classes(scene, flocs)
    return tuple(
        TwoClasses(name, classes[a], classes[b], scene.meeting_of(place))
        for place, (name, (a, b)) in enumerate(zip(scene.names, scene.class_pairs, strict=True))
    )

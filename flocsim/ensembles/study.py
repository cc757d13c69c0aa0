"""Studies of pairs and of rates: all conditions of a config, and any one replicate of them.

A study of rates draws its pairs at offsets that stand for all at which they come, and its
replicates are points of a scrambled Sobol sequence.
"""

import hashlib
import time
from collections.abc import Callable, Iterable, Sequence
from functools import partial
from typing import Any, ClassVar

import attrs
import numpy as np

from flocsim.compiler.composer import is_on_disk
from flocsim.compiler.fingerprint import fingerprint
from flocsim.ensembles.collision.batch import Batches, Halted, Reasons
from flocsim.ensembles.collision.draw import (
    FAILED,
    FAILURES,
    LONGEST_REASON,
    MORE_STEPS,
    NO_FLOC,
    SAMPLE,
    Draw,
    as_draws,
    columns_of,
    draws,
    exact_methods,
    further_runs,
    orientations,
    point,
    points_of,
)
from flocsim.ensembles.collision.encounter import Encounter
from flocsim.ensembles.collision.equivalent import kinds, placed_system, sphere_pairs
from flocsim.ensembles.collision.flocs import Floc, FlocPool, load_flocs, pool_of
from flocsim.ensembles.collision.mechanisms import make_encounter
from flocsim.ensembles.collision.outcomes import OBSERVER
from flocsim.ensembles.collision.pairings import Pairing, pairings_of
from flocsim.ensembles.collision.start import zone_distance
from flocsim.ensembles.config.kernel_scene import KernelScene
from flocsim.ensembles.config.pair_scene import BROWNIAN, SETTLING, PairScene
from flocsim.ensembles.config.schema import BAND, CUT, Config
from flocsim.ensembles.diagnose.preflight import check_study, study_warnings
from flocsim.ensembles.kind import COLUMNS, Code, Condition, Numbers, Overseer, StudyKind
from flocsim.integrators.base import Integrator
from flocsim.integrators.loop.driver import advance, drive
from flocsim.io.results.events import flips_easily
from flocsim.io.results.schema import BAND_ENDS, FURTHER_RUNS, OUTCOMES, RADII, UNKNOWN

TRIED_AGAIN = ("step budget", "stalled", "too deep", "not finite")
"""Failures behind which more steps, or shorter ones, may come to an outcome."""


BATCH_SECONDS, MOST_AT_A_TIME = 0.1, 256
"""Time for which replicates run before their rows are handed in, and most of them."""


def says_outcome(row: Any) -> bool:
    """Whether a row says what became of a pair."""
    return OUTCOMES[row["outcome"]] not in UNKNOWN


@attrs.define(eq=False)
class Study(StudyKind):
    """Every replicate of a config. All that is random follows from (seed, replicate).

    ``flocs`` are grown or read unless given; ``pairings`` say who meets whom in every collision
    type; ``exact`` has the more exact methods of second and third runs, None where there are none.
    """

    config: Config
    flocs: list[Floc] = attrs.field(
        default=attrs.Factory(lambda self: self.flocs_of(self.config), takes_self=True)
    )
    scenes: ClassVar[Sequence[type]] = (PairScene,)
    format: ClassVar[str] = "flocsim results"
    check = staticmethod(check_study)
    pairings: tuple[Pairing, ...] = attrs.field(init=False)
    floc_pool: FlocPool = attrs.field(init=False)
    pools: dict[str, FlocPool] = attrs.field(init=False)
    encounters: dict[tuple, Encounter] = attrs.field(init=False, factory=dict)
    first: dict[str, Encounter] = attrs.field(init=False, factory=dict)
    batches: Batches = attrs.field(init=False, factory=Batches)
    at_a_time: int = attrs.field(init=False, default=4)
    exact: tuple[Integrator, Integrator] | None = attrs.field(init=False)

    def __attrs_post_init__(self):
        config = self.config
        self.exact = exact_methods(config.integrator.method)
        self.floc_pool = pool_of(config.shapes, self.flocs)
        ends = BAND_ENDS if self.is_banded else ()
        self.pools = {end: self.floc_pool.cut(end) for end in ends}
        self.pairings = pairings_of(config, self.flocs, self.floc_pool)

    @staticmethod
    def flocs_of(config: Config) -> list[Floc]:
        """Grow or read the flocs of a study: none for spheres alone, unless of measured sizes."""
        needed = any(n > 1 for n in config.shapes.vertices) or config.shapes.size == "own"
        return load_flocs(config.shapes, config.seed) if needed else []

    @property
    def flocs_in_words(self) -> str:
        """Return which flocs are drawn."""
        drawn = {floc for pairing in self.pairings for floc in pairing.drawn} if self.flocs else ()
        return self.config.shapes.described(len(self.flocs), len(drawn))

    def doubts(self) -> list[str]:
        """Return lines on what is implausible in the study."""
        return study_warnings(self.config, self.flocs)

    def identity_facts(self) -> dict[str, Any]:
        """Return what rows follow from besides config, flocs, code and machine."""
        config = self.config
        facts: dict[str, Any] = {"integrator.check_share": config.integrator.check_share}
        if self.point_scrambles:
            first = points_of(config.seed, self.point_scrambles, 0, SAMPLE * self.point_scrambles)
            facts["scene.points"] = first.sum(axis=0)
        for pairing, (name, pair) in zip(
            self.pairings, sphere_pairs(config, self.flocs), strict=True
        ):
            pieces = pair.system.pieces
            own = [*pieces.parameters, pieces.surface_reach, *pieces.smoothness, pieces.events]
            own += pieces.outlines if pieces.outlines[0] > 0.0 else ()
            own += pieces.layer if pieces.layer[2] > 0.0 else ()
            facts[f"numbers.{name}"] = np.array(own, float)
            # A force of the user's own may compute what the zone follows from.
            facts[f"types.{name}"] = [*pairing.radii, pair.zone_distance]
            if config.shapes.own is not None and self.flocs:
                # Its class computes how it grows at the sizes of each type.
                [floc] = self.flocs
                [n] = floc.shapes
                facts[f"flocs.{n} at the sizes of {name}"] = [
                    floc.resized(n, radius, config.shapes.radius) for radius in pairing.radii
                ]
        return facts | self.kernel_facts()

    def kernel_facts(self) -> dict[str, str]:
        """Return fingerprints of the compiled code for spheres and for polygons, by every method,
        of a type for each way to meet."""
        config, facts = self.config, {}
        meetings = {each.meeting: place for place, each in reversed([*enumerate(self.pairings)])}
        pairs = [pair for _, pair in sphere_pairs(config, self.flocs)]
        for pair in (pairs[place] for place in sorted(meetings.values())):
            for shapes in kinds(config, pair.shapes):
                system = placed_system(config, pair.system, shapes)
                name = system.family + (f" in {pair.meeting}" * (pair.meeting != SETTLING))
                laws = sorted(system.pieces.laws.items())
                codes = [fingerprint(advance, system.fillings(OBSERVER))]
                codes += [f"{law} {fingerprint(function, {})}" for law, function in laws]
                digest = hashlib.blake2b("\n".join(codes).encode(), digest_size=12)
                facts[f"kernels.{name}"] = digest.hexdigest()
        return facts

    @property
    def is_banded(self) -> bool:
        """Whether replicates are also run with their outlines cut closer and wider."""
        return self.config.shapes.outlines == BAND and bool(self.flocs)

    @property
    def radii(self) -> dict[str, np.ndarray]:
        """{r_i, r_j: (types,)} [m] that stand for the collision types."""
        columns = zip(*(each.radii for each in self.pairings), strict=True)
        return {name: np.array(values) for name, values in zip(RADII, columns, strict=True)}

    @property
    def point_scrambles(self) -> int:
        """Of how many scrambles of Sobol's sequence the replicates are points; 0 for none."""
        return self.config.scrambles

    def numbers(self, replicate: int) -> np.ndarray:
        """The random numbers of a replicate in [0, 1), see draws, or a point of Sobol's."""
        if self.point_scrambles:
            return point(self.config.seed, self.point_scrambles, replicate)
        return draws(self.config.seed, replicate)

    def share_of(self, encounter: Encounter, share: float, numbers: Numbers) -> float:
        """The share of a Draw with these random numbers in a condition of this ``share``."""
        return float(numbers[4]) if encounter.meeting == BROWNIAN else share

    def choose_flocs(self, condition: int, vertices: int, numbers: Numbers) -> tuple[int, int]:
        """Places of the flocs of i and j that a replicate's random numbers choose."""
        if vertices == 1 and not self.floc_pool.own_size:
            return NO_FLOC, NO_FLOC
        return self.pairings[condition].choose(numbers)

    def encounter(
        self, condition: int, vertices: int, numbers: Numbers, end: str = CUT
    ) -> Encounter:
        """The Encounter of the flocs that a replicate's random numbers choose; ``end``: their
        outlines cut closer or wider."""
        name, radii = self.pairings[condition].name, self.pairings[condition].radii
        flocs, pool = self.choose_flocs(condition, vertices, numbers), self.pools.get(end)
        pool = pool or self.floc_pool
        if pool.own_size and pool.sizes[flocs[0]] > pool.sizes[flocs[1]]:
            flocs = flocs[::-1]  # the larger settles faster, and is j
        key = (name, vertices, *flocs, end)
        if key not in self.encounters:
            counts = self.floc_pool.vertices_of(*flocs, vertices)
            shapes = [
                pool.shape(floc, count, radius)
                for floc, count, radius in zip(flocs, counts, radii, strict=True)
            ]
            if pool.own_size:
                radii = (shapes[0].equivalent_radius, shapes[1].equivalent_radius)
            zone = zone_distance(self.config.zone, self.config.forces, *radii)
            made = make_encounter(
                self.config, shapes, zone, self.pairings[condition].meeting, self.first.get(name)
            )
            self.first.setdefault(name, made)
            self.encounters[key] = made
        return self.encounters[key]

    def draw(
        self, condition: int, vertices: int, share: float, replicate: int, end: str = CUT
    ) -> Draw:
        """The Draw of a replicate: condition's place, N, share of δ_max, index; ``end``: with both
        outlines cut closer or wider."""
        numbers = self.numbers(replicate)
        encounter = self.encounter(condition, vertices, numbers, end)
        return Draw(
            encounter.keyed(self.config.seed, replicate), encounter.orientations(numbers),
            self.share_of(encounter, share, numbers),
            self.choose_flocs(condition, vertices, numbers),
        )  # fmt: skip

    def driver(self, encounter: Encounter, method: Integrator | None = None) -> Callable:
        """Return the compiled driver of one run at a time: for spheres or polygons, and a method.

        ``method``: another one than the encounter's.
        """
        return self.batches.driver(encounter, method or encounter.system.integrator, drive)

    def run(
        self, condition: int, vertices: int, share: float, replicate: int,
        halted: Callable[[], bool] = lambda: False,
    ) -> dict | None:  # fmt: skip
        """Run one replicate, as in `draw`, and those of its further runs that are due.

        Return its row; None where ``halted()``, looked at now and then, gives it up.
        """
        try:
            rows, reasons = self.run_all((condition, vertices, share), [replicate], halted)
        except Halted:
            return None
        if isinstance(why := reasons.get(0), Exception):
            raise why
        return dict(zip(COLUMNS, rows[0].tolist(), strict=True))

    def run_all(
        self, condition: tuple[int, int, float], replicates: Sequence[int],
        halted: Callable[[], bool] = lambda: False,
    ) -> tuple[np.ndarray, Reasons]:  # fmt: skip
        """Run replicates of a condition, with the further runs that are due.

        Parameters
        ----------
        condition : (int, int, float)
            Index of the collision type, number of vertices, share of δ_max.
        replicates : sequence of int
            Their indices in the condition.
        halted : callable, optional
            Asked now and then; True ends the runs.

        Returns
        -------
        rows : (k,) array of ROW
            A row for each replicate.
        reasons : dict
            Why some of them failed, by their positions.

        Raises
        ------
        Halted
            If ``halted()`` has returned True.
        """
        steps, usual = self.config.integrator.max_steps, self.config.integrator.method

        def run(indices: Iterable[int], most: int, method: Integrator, end: str = CUT) -> Any:
            draws = [partial(self.draw, *condition, replicates[each], end) for each in indices]
            return self.batches.run(draws, most, method, halted)

        rows, reasons = run(range(len(replicates)), steps, usual)
        # Those without an outcome, once more.
        attempts = [self.second_attempt(row) for row in rows]
        for method in (usual, *(self.exact or ())[:1]):
            again = [k for k, each in enumerate(attempts) if each and each[1] == method]
            found = run(again, MORE_STEPS * steps, method)[0] if again else ()
            for k, row in zip(again, found, strict=True):
                if says_outcome(row):
                    rows[k] = row
                    reasons.pop(k, None)

        def note(name: str, indices: list[int], *how: Any) -> None:
            """Run some as ``how`` says, and write what comes of it into columns of that name."""
            # Spheres of a given size have no outline to cut.
            same = name in BAND_ENDS and condition[1] == 1 and not self.floc_pool.own_size
            found = rows[indices] if same else run(indices, *how)[0]
            for column, of in columns_of(name).items():
                rows[column][indices] = found[of]

        whole = [k for k in range(len(rows)) if not isinstance(reasons.get(k), Exception)]
        for end in BAND_ENDS if self.is_banded else ():
            note(end, whole, MORE_STEPS * steps, usual, end)
        if self.exact is not None:
            wanted = {k: self.further_runs(replicates[k], rows[k]) for k in whole}
            for turn, (method, name) in enumerate(zip(self.exact, FURTHER_RUNS[:2], strict=True)):
                steps *= MORE_STEPS
                note(name, [k for k in whole if wanted[k] > turn], steps, method)
        return rows, reasons

    def further_runs(self, replicate: int, row: np.void) -> int:
        """Return how often a replicate with such a row is run again, more exactly."""
        easily = bool(flips_easily(row["outcome"], row["bond"]))
        wanted = self.config.integrator.check_share
        return further_runs(self.config.seed, replicate, wanted, easily)

    def second_attempt(self, row: Any) -> tuple[int, Integrator] | None:
        """(steps, method) by which a replicate is tried again whose row says nothing of its
        outcome; None where it is not.

        With more steps; more exactly, too, where the first did not end for lack of steps.
        """
        ran_out = FAILURES[row["failure"]] == "step budget"
        if FAILURES[row["failure"]] not in TRIED_AGAIN or (self.exact is None and not ran_out):
            return None
        method = self.config.integrator.method if ran_out or self.exact is None else self.exact[0]
        return MORE_STEPS * self.config.integrator.max_steps, method

    @property
    def kinds(self) -> list[Code]:
        """What stands for the kinds of compiled code that the study needs."""
        vertices = sorted({n > 1: n for n in self.config.shapes.vertices}.values())
        return [(0, n) for n in vertices]

    def uncompiled(self, kinds: Iterable[Code]) -> list[Code]:
        """Those whose engine is not on the disk."""
        delta = self.config.scene.delta[0]
        return [
            kind for kind in kinds
            if not is_on_disk(self.batches.driver(
                self.draw(*kind, delta, 0).encounter, self.config.integrator.method))
        ]  # fmt: skip

    def run_some(
        self, condition: Condition, first: int, stop: int, overseer: Overseer, left: Any = None
    ) -> tuple[np.ndarray, list[dict]]:
        """Run as many replicates as take some BATCH_SECONDS. An exception costs one alone: its row
        says that it has failed, and a note what is needed to run it again.

        Running out of memory is nobody's fault but the machine's, and ends the study.
        """
        name, vertices, share = condition
        place = [each.name for each in self.pairings].index(name), vertices, share
        replicates = range(first, min(first + min(self.at_a_time, MOST_AT_A_TIME), stop))
        began = time.monotonic()
        try:
            rows, reasons = self.run_all(place, replicates, overseer.halted)
        except Halted:
            return np.zeros(0, self.row), []
        each = (time.monotonic() - began) / len(replicates)
        self.at_a_time = min(max(int(BATCH_SECONDS / each), 1), 2 * len(replicates))
        notes = []
        for k in np.flatnonzero(self.has_failed(rows.__getitem__)).tolist():
            why = reasons.get(k, "")
            if isinstance(why, Exception):
                drawn = orientations(self.numbers(replicates[k]))
                rows["angle_i"][k], rows["angle_j"][k] = drawn
                text = f"{type(why).__name__}: {' '.join(str(why).split())}"[:LONGEST_REASON]
            else:
                text = FAILURES[rows["failure"][k]] + (f": {why}" if why else "")
            notes.append(self.note(condition, replicates[k], text))
        return rows, notes

    def has_failed(self, column: Callable[[str], np.ndarray]) -> np.ndarray:
        """Return flags of the rows of failed replicates."""
        return column("outcome") == FAILED


@attrs.define(eq=False)
class KernelStudy(Study):
    """Every replicate of a config whose scene is a KernelScene.

    A replicate is a point of a scrambled Sobol sequence, the same in all conditions: orientations,
    flocs, and the offset b of j's way from i's centre, which is share · (R_i + R_j).
    """

    scenes: ClassVar[Sequence[type]] = (KernelScene,)

    @property
    def point_scrambles(self) -> int:
        """Of how many scrambles of Sobol's sequence the replicates are points."""
        return self.scene.scrambles

    def numbers(self, replicate: int) -> np.ndarray:
        """The point of a replicate: two orientations, two choices of floc, the offset."""
        return as_draws(super().numbers(replicate))

    def share_of(self, encounter: Encounter, share: float, numbers: Numbers) -> float:
        """The offset of a replicate over R_i + R_j, as a number between −1 and somewhat over 1."""
        bounds = encounter.bounds(*np.array(encounter.orientations(numbers))[:, None])
        [offset] = encounter.offsets(*bounds, np.array(numbers[4:]))
        return float(offset) / encounter.outer

"""A study: all conditions of a config, and any one replicate of them by its number."""

import attrs
import numpy as np

from flocsim.ensembles.flocs import Wardrobe, load_flocs
from flocsim.ensembles.sampling import draws, orientations
from flocsim.ensembles.scene import OBSERVER, make_encounter, run_encounter
from flocsim.ensembles.zone import zone_distance
from flocsim.io.results_schema import REPLICATES

ROW = np.dtype([("place", "i8")] + [(name, kind) for name, (kind, _, _) in REPLICATES.items()])
"""One replicate: its place in the study, and its row of the results file."""


@attrs.define(eq=False)
class Study:
    """Every replicate of a config. All that is random follows from (seed, replicate)."""

    config: object
    flocs: list = None
    zones: dict = attrs.Factory(dict)
    encounters: dict = attrs.Factory(dict)
    drivers: dict = attrs.Factory(dict)
    wardrobe: Wardrobe = None

    def __attrs_post_init__(self):
        config = self.config
        self.zones = {
            name: zone_distance(config.zone, config.forces, radius_i, radius_j)
            for name, radius_i, radius_j in config.scene.conditions
        }
        if self.flocs is None:
            polygons = any(n > 1 for n in config.shapes.vertices)
            self.flocs = load_flocs(config.shapes, config.seed) if polygons else []
        self.wardrobe = Wardrobe(self.flocs, config.shapes.radius, config.shapes.pool)

    @property
    def shape(self):
        """(types, vertices, delta, replicates): how many there are of each."""
        scene = self.config.scene
        counts = (len(scene.conditions), len(self.config.shapes.vertices), len(scene.delta))
        return (*counts, self.config.replicates)

    @property
    def size(self):
        """Number of all replicates."""
        return int(np.prod(self.shape))

    def encounter(self, condition, vertices, numbers):
        """The Encounter that a replicate's random numbers choose, and its flocs' names."""
        name, radius_i, radius_j = self.config.scene.conditions[condition]
        flocs = (None, None)
        if vertices > 1:
            flocs = self.wardrobe.choose(numbers, radius_i, radius_j)
        key = (name, vertices, *flocs)
        if key not in self.encounters:
            shapes = [
                self.wardrobe.shape(floc, vertices, radius)
                for floc, radius in zip(flocs, (radius_i, radius_j), strict=True)
            ]
            self.encounters[key] = make_encounter(self.config, shapes, self.zones[name])
        return self.encounters[key]

    def driver(self, encounter):
        """The compiled driver of an encounter: one for spheres, one for polygons."""
        kind = encounter.system.spheres_only
        if kind not in self.drivers:
            self.drivers[kind] = encounter.system.compose(observer=OBSERVER)
        return self.drivers[kind]

    def run(self, condition, vertices, share, replicate, record=None):
        """Run one replicate: condition's place, N, share of δ_max, index. The row as a dict."""
        numbers = draws(self.config.seed, replicate)
        encounter = self.encounter(condition, vertices, numbers)
        driver = self.driver(encounter)
        angles = orientations(numbers)
        max_steps = self.config.integrator.max_steps
        return run_encounter(encounter, driver, angles, share, max_steps, record)

    def run_place(self, place):
        """Run the replicate at a place of the study (C order of ``shape``); the row as a tuple."""
        condition, v, d, replicate = np.unravel_index(place, self.shape)
        vertices = self.config.shapes.vertices[v]
        row = self.run(condition, vertices, self.config.scene.delta[d], int(replicate))
        return (place, *(row[name] for name in REPLICATES))

    @property
    def kinds(self):
        """Numbers of vertices that stand for the kinds of compiled code that the study needs."""
        vertices = self.config.shapes.vertices
        return sorted({n > 1: n for n in vertices}.values())

    def compile(self, kinds):
        """Compile, or load from the disk, what these numbers of vertices need, by running it."""
        for vertices in kinds:
            self.run(0, vertices, self.config.scene.delta[0], 0)

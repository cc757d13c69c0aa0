"""One replicate of a study run again, its motion kept as a Trajectory."""

import time
from collections.abc import Sequence
from typing import Any

import attrs

import flocsim.arrays as at
from flocsim.ensembles.collision.draw import FAILURES
from flocsim.ensembles.config.schema import METHODS, Config
from flocsim.ensembles.kernels import study_of
from flocsim.ensembles.pilot.choice import final_methods
from flocsim.ensembles.study import Study, says_outcome
from flocsim.errors import UsageError
from flocsim.fields import is_whole
from flocsim.integrators.base import Integrator
from flocsim.io.results.schema import FLAGS
from flocsim.run import Run
from flocsim.trajectories.replay import Origin
from flocsim.trajectories.trajectory import Trajectory

Place = tuple[int, int, float]
"""(place of the collision type, N, share of δ_max)."""


def place_of(config: Config, type: str | None, vertices: int | None, delta: float | None) -> Place:
    """The condition with these values: by default the first type, the last N, the first δ."""
    names = list(config.scene.names)
    return (
        chosen(type, names, "type", 0),
        config.shapes.vertices[chosen(vertices, config.shapes.vertices, "vertices", -1)],
        config.scene.delta[chosen(delta, config.scene.delta, "delta", 0)],
    )


def chosen(value: Any, known: Sequence, option: str, default: int) -> int:
    """The place of a value among those that there are; UsageError where it is none of them."""
    known = list(known)
    if value is None:
        value = known[default]
    if value not in known:
        raise UsageError(f"{option} must be one of {', '.join(map(str, known))}, found {value}")
    return known.index(value)


def with_one_count(config: Config, vertex_count: int) -> Config:
    """The config with one number of vertices: the flocs need no fits at the others."""
    return attrs.evolve(config, shapes=attrs.evolve(config.shapes, vertices=(vertex_count,)))


def one_count_study(
    config: Config, vertex_count: int, methods: dict[str, Integrator] | None = None
) -> Study:
    """The Study of `with_one_count`, by the methods of the whole one: a pilot may choose them."""
    one, methods = with_one_count(config, vertex_count), methods or final_methods(config)
    return study_of(one, methods=methods)


def recorded_methods(record: dict) -> dict[str, Integrator] | None:
    """{type: Integrator} that a pilot has chosen, as a results file has it; None for no record.
    UsageError for methods that are none."""
    for each in record.get("types", []):
        chosen(each["method"], tuple(METHODS), "the method chosen by a pilot", 0)
    return {
        each["name"]: METHODS[each["method"]](each["tolerance"]) for each in record.get("types", [])
    } or None


def replicate_of(replicate: int, place: Place, study: Study, most: int | None = None) -> Trajectory:
    """The Trajectory of one replicate of a `one_count_study`, its ``row`` in words.

    ``most`` steps, where they are less than the config's.
    """
    if not is_whole(replicate) or not replicate >= 0:
        raise UsageError(f"replicate must be a whole number of at least 0, found {replicate!r}")
    began, draw = time.perf_counter(), study.draw(*place, int(replicate))
    driver, system = study.driver(draw.encounter), draw.encounter.system

    def attempt(steps: int, method: Integrator | None = None) -> tuple[dict, Trajectory]:
        steps = steps if most is None else min(most, steps)

        def fresh(record: bool = False) -> Run:
            return draw.begin(driver, steps, integrator=method, record=record)

        run = fresh(record=True)
        status = run.to_end()
        row = draw.row(run, status)
        origin = Origin(
            system.bodies, system.forces, system.fluid, method or system.integrator, fresh, run,
            ((run.steps, float(run.clock[at.UNTIL])),),
        )  # fmt: skip
        lasted = time.perf_counter() - began
        return row, Trajectory.of(run, status, lasted, row=row_in_words(row), origin=origin)

    row, found = attempt(study.config.integrator.max_steps)
    if again := study.second_attempt(place[0], row):
        row, second = attempt(*again)
        return second if says_outcome(row) else found
    return found


def row_in_words(row: dict) -> dict:
    """A row of the table of replicates with the words of its codes."""
    words = {name: dict(zip(*flags, strict=True)) for name, flags in FLAGS.items()}
    found = {name: words[name][value] if name in words else value for name, value in row.items()}
    return found | {"failure": FAILURES[row["failure"]]}

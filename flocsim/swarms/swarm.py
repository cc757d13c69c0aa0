"""Swarm: many bodies in a fluid, and how they are moved from one common time to the next."""

import math
import os
import time as clock_time
from collections.abc import Callable, Iterable, Sequence
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import attrs
import numpy as np

from flocsim.arrays import BOUNDING_RADIUS, FREE
from flocsim.body import Body, Fluid
from flocsim.compiler.composer import compose
from flocsim.errors import UsageError
from flocsim.fields import in_unit
from flocsim.forces.base import Force
from flocsim.geometry.contact.separation import PERIODIC
from flocsim.hooks import observe
from flocsim.integrators.base import Integrator, Status
from flocsim.integrators.implicit import Implicit
from flocsim.swarms.arrays import BEGIN, END, HORIZON_AT, Swarm as SwarmArrays, swarm_of, with_links
from flocsim.swarms.islands import STRAYED, run_islands, watch_paths
from flocsim.swarms.neighbours import find_islands
from flocsim.swarms.windows import (
    CROWDED,
    LEAST_WANDER,
    LONGER,
    MORE_WANDER,
    MOST_TRIES,
    SHORTER,
    SPARSE,
    Bench,
    Islands,
    Runner,
    work_in,
)
from flocsim.system import System


class SwarmRun:
    """A swarm in progress."""

    def __init__(self, system: System, box, until, threads=1, max_steps=1_000_000_000):
        self.system, self.box, self.until = system, box, until
        scene = system.scene()
        self.scene = scene._replace(box=box)
        fillings = system.fillings({observe: watch_paths})
        if min(box) < math.inf:
            fillings |= PERIODIC
        from flocsim.laws import compiled_calls

        driver = compose(run_islands, {**compiled_calls(), **fillings})
        finder = compose(find_islands, {})
        most = int(np.diff(scene.first).max())
        benches = [Bench(self.scene, most) for _ in range(threads)]
        pool = ThreadPoolExecutor(threads) if threads > 1 else None
        self.runner = Runner(
            finder, driver, system.integrator, benches, max_steps, pool,
            np.zeros((8 * len(scene.bodies), 2), dtype=np.int64),
        )
        self.reach = max(0.0, scene.surface_reach, scene.centre_reach)
        wander = LEAST_WANDER * scene.bodies[:, BOUNDING_RADIUS]
        self.least = wander
        self.swarm = swarm_of(scene, *system.motion(), system.integrator.first_step, wander)
        self.swarm.times[HORIZON_AT] = until
        self.time, self.span = 0.0, self.first_span()
        self.windows = self.tries = self.steps = self.rejected = self.evaluations = 0
        self.body_steps = 0
        self.status = Status.PAUSED
        self.error = 0.0

    def first_span(self):
        free = self.swarm.bodies[:, FREE] == 1.0
        size = float(np.mean(self.swarm.bodies[free, BOUNDING_RADIUS]))
        motion = self.swarm.motion[free]
        spread = motion[:, 3:5] - motion[:, 3:5].mean(axis=0)
        speed = float(np.sqrt(np.mean(np.sum(spread**2, axis=1))))
        return min(0.3 * size / speed if speed > 0.0 else math.inf, 1e-3 * self.until)

    def window(self, stop):
        """Advance to the next common time, ``stop`` at the latest."""
        swarm, reach = self.swarm, self.reach
        span, tries, kept, parts = self.span, 0, {}, {}
        clusters = self.runner.islands_of(swarm, 0.0, 0.0, reach, self.box)
        while True:
            end = stop if span >= 0.999 * (stop - self.time) else self.time + span
            swarm.times[BEGIN], swarm.times[END] = self.time, end
            islands = self.runner.islands_of(swarm, end - self.time, 1.0, reach, self.box)
            free = int(np.sum(swarm.bodies[:, FREE]))
            all_in = len(islands.sizes) == 1
            keys = [islands.key(each) for each in range(len(islands.sizes))]
            fresh = [each for each, key in enumerate(keys) if key not in kept]
            chosen = subset(islands, fresh).sorted_by_size()
            parts_now = self.runner.run(swarm, chosen, all_in)
            self.tries += 1
            strayed = []
            links = np.concatenate([part[0] for part in parts_now])
            slips = np.concatenate([part[1] for part in parts_now])
            label = np.full(len(swarm.bodies), -1)
            for each in range(len(chosen.sizes)):
                own = chosen.members[chosen.starts[each] : chosen.starts[each + 1]]
                code = int(chosen.codes[each])
                self.steps += int(chosen.costs[each, 0])
                self.body_steps += int(chosen.costs[each, 0]) * len(own)
                self.rejected += int(chosen.costs[each, 1])
                self.evaluations += int(chosen.costs[each, 2])
                if code == Status.FINISHED:
                    label[own[swarm.bodies[own, FREE] == 1.0]] = each
                elif code == Status.STOPPED:
                    strayed.append(own)
                else:
                    self.status = Status(code)
                    self.failed = own
                    return
            owner = label[links[:, 0]]
            walls = swarm.bodies[links[:, 0], FREE] == 0.0
            owner[walls] = label[links[walls, 1]]
            kept = {key: value for key, value in kept.items() if key in set(keys)}
            for each in range(len(chosen.sizes)):
                if chosen.codes[each] == Status.FINISHED:
                    mine = owner == each
                    kept[chosen.key(each)] = (links[mine], slips[mine])
            if not strayed:
                break
            tries += 1
            for own in strayed:
                swarm.wander[own] = np.maximum(
                    2.0 * swarm.wander[own], MORE_WANDER * swarm.strayed[own]
                )
            if tries % MOST_TRIES == 0:
                span = 0.5 * (end - self.time)
                self.span = span
                kept = {}
        self.commit(kept.values())
        self.windows += 1
        crowded = work_in(islands) / work_in(clusters)
        if span <= self.span:
            if crowded > CROWDED:
                self.span = SHORTER * span
            elif crowded < SPARSE:
                self.span = LONGER * span
        self.time = end
        swarm = self.swarm
        swarm.wander[:] = np.maximum(self.least, np.maximum(
            MORE_WANDER * swarm.strayed, 0.7 * swarm.wander))

    def commit(self, parts):
        swarm = self.swarm
        free = swarm.bodies[:, FREE] == 1.0
        swarm.motion[free] = swarm.new_motion[free]
        swarm.carried[free] = swarm.new_carried[free]
        swarm.errors[free] = swarm.new_errors[free]
        swarm.steps[free] = swarm.new_steps[free]
        span = swarm.times[END] - swarm.times[BEGIN]
        fixed = ~free
        swarm.motion[fixed, :3] += span * swarm.motion[fixed, 3:]
        self.error = float(swarm.stated.max())
        self.swarm = with_links(swarm, list(parts))


def subset(islands: Islands, chosen: Sequence[int]) -> Islands:
    """Some of the islands."""
    sizes = islands.sizes[chosen] if len(chosen) else np.zeros(0, dtype=np.int64)
    starts = np.concatenate([[0], np.cumsum(sizes)]).astype(np.int64)
    members = (
        np.concatenate([islands.members[islands.starts[e] : islands.starts[e + 1]] for e in chosen])
        if len(chosen) else np.zeros(0, dtype=np.int64)
    )
    count = len(sizes)
    return Islands(members, starts, islands.codes[chosen], islands.costs[chosen])

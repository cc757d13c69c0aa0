"""Which force gives no number where a run could not go on.

A method tries shorter and shorter steps where a force is NaN or infinite, and ends as stalled, or
without any steps left. Looking at every force by itself where the run has ended, and at where it
would have gone next, tells such an end from one that the method alone is to blame for.
"""

import math
from typing import Any

import numpy as np

import flocsim.arrays as at
from flocsim.arrays import copy_of, counts_as_pair
from flocsim.compiler.composer import compose
from flocsim.compiler.linker import where
from flocsim.forces.check import asked_at
from flocsim.forces.codegen import Pieces, laws_of
from flocsim.geometry.contact.candidates import list_candidates
from flocsim.geometry.contact.points import locate_contacts
from flocsim.integrators.base import Status
from flocsim.integrators.rhs.orientation import oriented_now
from flocsim.integrators.rhs.surface_gap import flag_near, run_end, surface_view
from flocsim.integrators.rhs.views import body_view, centre_view, contact_view
from flocsim.run import Run

AHEAD = (0.0, *np.geomspace(1e-16, 1e-4, 25))
"""Times [s] behind the end of a run at which forces are looked at, at unchanged velocities."""

UNABLE = (Status.STEP_BUDGET, Status.STALLED, Status.NOT_FINITE)
"""Ends at which a force may be to blame that gives NaN or infinity."""

LARGEST = 1e100
"""Beyond such an answer, in SI units, the motion overflows."""

MAY_BE_INFINITE = ("slip_limit", "contact_event")
"""Laws of which only NaN is no answer."""


def locate(scene, work):
    """List the pairs of outlines that are near, and where they are; False without room."""
    room = list_candidates(scene, work)
    locate_contacts(scene, work, at.NOW)
    return room


def views_of(system, scene, work, time, located):
    """{first part of laws' names: [what they are shown]} in the state NOW; ``located(scene, work)``
    lists the pairs there (see locate)."""
    bodies = range(len(system.bodies))
    pairs = [(a, b) for a in bodies for b in range(a) if counts_as_pair(scene.bodies, a, b)]
    views = {
        "body": [body_view(scene, work, time, at.NOW, body) for body in bodies],
        "centre": [centre_view(scene, work, time, at.NOW, a, b) for a, b in pairs],
        "oriented": [oriented_now(scene, work, time, a, b) for a, b in pairs],
    }
    if located(scene, work):
        rows = range(work.tally[at.CANDIDATES])
        touching = [row for row in rows if work.geometry[at.NOW, row, at.GAP] < 0.0]
        flag_near(scene, work, at.NOW, 0.0)
        first, views["surface"] = 0, []
        while first < len(rows):
            end = run_end(work, first)
            views["surface"].append(surface_view(scene, work, time, at.NOW, first, end))
            first = end
        views["contact"] = [contact_view(scene, work, at.NOW, row) for row in touching]
    return views


def family(law):
    """Which views a law is shown: the key in views_of."""
    first = law.partition("_")[0]
    return {"velocity": "body", "position": "body", "slip": "contact"}.get(first, first)


def values_of(law, view, parameters, which):
    """What a law answers, as a tuple; as compiled where Python raises for what is no number."""
    try:
        answer = law(view, parameters, *which)
    except (ArithmeticError, ValueError):
        answer = compose(law, {})(view, parameters, *which)
    return answer if isinstance(answer, tuple) else (answer,)


def kernel_of(force, law, fluid):
    """The function of a force that a law calls."""
    if family(law) == "body":
        return force.kernel_in(fluid)
    if law.endswith("derivatives") and getattr(force, "slope", None) is not None:
        return force.slope
    return getattr(
        force, {"slip_limit": "slip_limit", "contact_event": "events"}.get(law, "kernel")
    )


@np.errstate(all="ignore")
def wrong_answer(force: Any, pieces: Pieces, views: dict[str, list], fluid: Any) -> str:
    """ "kernel (file:line) gives nan at …" of a force; "" where all of its answers are numbers.

    ``pieces``, of the force alone; ``views`` {"body", "centre", …: the views to ask for}.
    """
    parameters = np.array(pieces.parameters, dtype=float)
    for name, law in pieces.laws.items():
        each_event = range(pieces.events) if name == "contact_event" else [None]
        for view in views.get(family(name), ()):
            for event in each_event:
                which = () if event is None else (event,)
                most = math.inf if name in MAY_BE_INFINITE else LARGEST
                values = values_of(law, view, parameters, which)
                wrong = [value for value in values if not abs(value) <= most]
                if wrong:
                    what = where(kernel_of(force, name, fluid))
                    slope = "a slope of " if name.endswith("derivatives") else ""
                    return f"{what} gives {slope}{float(wrong[0])} at {asked_at(view)}"
    return ""


@np.errstate(all="ignore")
def force_to_blame(system: Any, run: Run) -> str:
    """The force of a System that gives NaN, or more than LARGEST, where a Run has ended, in words;
    or ""."""
    scene: Any = system.scene(jit=False)
    start = run.work.motion[at.NOW].copy()
    if not np.isfinite(start).all():
        return ""
    work = copy_of(run.work)
    used = system.pieces.used
    pieces = [(name, force, laws_of([force], system.fluid)) for name, force in used.items()]
    classes = [type(force) for force in used.values()]
    located = compose(locate, system.fillings(), jit=False)
    for ahead in AHEAD:
        work.motion[at.NOW] = start
        work.motion[at.NOW, :, : at.VELOCITY] += ahead * start[:, at.VELOCITY :]
        views = views_of(system, scene, work, run.clock[at.TIME] + ahead, located)
        for name, force, own in pieces:
            words = wrong_answer(force, own, views, system.fluid)
            if words:
                return f"{name}: {words}" if classes.count(type(force)) > 1 else words
    return ""

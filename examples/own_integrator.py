"""An integrator of one's own: a file beside the config, named there as class = "own_integrator:…".

    mpirun -n 2 flocsim ensemble examples/own_integrator.toml

or, from Python, System(bodies, forces, SemiImplicitEuler(step=2e-8)).
"""

import attrs

from flocsim.integrators.parts import (
    NEW,
    NOW,
    TIME,
    VELOCITY,
    FixedStep,
    acceleration,
    all_finite,
    evaluate,
    limit_slips,
    move_slips,
)  # fmt: skip


@attrs.frozen
class SemiImplicitEuler(FixedStep):
    """First the velocity, then the position with the new velocity: order 1, fixed ``step`` [s]."""

    @staticmethod
    def attempt(scene, work, clock, step):
        evaluate(scene, work, clock[TIME], NOW)
        for body in range(len(scene.bodies)):
            for axis in range(3):  # x, y, angle
                velocity = work.motion[NOW, body, VELOCITY + axis]
                velocity += step * acceleration(scene, work, NOW, body, axis)
                work.motion[NEW, body, VELOCITY + axis] = velocity
                work.motion[NEW, body, axis] = work.motion[NOW, body, axis] + step * velocity
        move_slips(scene, work, step)
        limit_slips(scene, work)
        return 0.0 if all_finite(work, NEW) else -1.0

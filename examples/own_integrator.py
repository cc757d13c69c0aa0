"""An integrator of one's own: a file beside the config, named there as class = "own_integrator:…".

    mpirun -n 2 flocsim ensemble examples/own_integrator.toml

or, from Python, System(bodies, forces, SemiImplicitEuler(step=2e-8)).
"""

import attrs

from flocsim.integrators.parts import (
    NEW,
    NOW,
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
        evaluate(scene, work, clock.time, NOW)
        for body in range(len(scene.bodies)):
            for axis in range(3):  # x, y, angle
                velocity = work.velocity[NOW, body, axis]
                velocity += step * acceleration(scene, work, NOW, body, axis)
                work.velocity[NEW, body, axis] = velocity
                work.place[NEW, body, axis] = work.place[NOW, body, axis] + step * velocity
        move_slips(scene, work, step)
        limit_slips(scene, work)
        return 0.0 if all_finite(work, NEW) else -1.0

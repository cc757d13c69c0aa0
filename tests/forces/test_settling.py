"""Terminal velocities against closed forms and the table of MODEL section 7."""

import math

import attrs
import numpy as np
import pytest

from flocsim import Body, Fluid, Sphere, System
from flocsim.errors import UsageError
from flocsim.fields import quantity
from flocsim.forces import BodyForce, Contact, Gravity, StokesDrag
from flocsim.forces.settling import terminal_motion

G, VISCOSITY = 9.81, 8.9e-4


def alone(radius=5e-6, forces=None, fluid=None, fixed=False, **weight):
    """A sphere and the System that it is alone in."""
    body = Body(Sphere(radius), fixed=fixed, **(weight or {"density": 2650.0}))
    forces = [Gravity(), StokesDrag()] if forces is None else forces
    return System([body], forces, fluid=fluid or Fluid()), body


@pytest.mark.parametrize("weight", [{"surface_density": 2.0}, {"density": 2650.0, "depth": 1e-5}])
def test_stokes_velocity_and_mobility(weight):
    system, body = alone(7e-6, **weight)
    velocity, mobility = terminal_motion(system, body)
    resistance = 6.0 * math.pi * VISCOSITY * 7e-6
    assert -velocity[1] == pytest.approx(body.mass * G / resistance, rel=1e-10)
    assert mobility == pytest.approx(1.0 / resistance, rel=1e-6)


def test_buoyancy_takes_the_displaced_weight_off():
    with_it, _ = terminal_motion(*alone(fluid=Fluid(buoyancy=True)))
    without, _ = terminal_motion(*alone())
    assert with_it[1] / without[1] == pytest.approx(1.0 - 997.0 / 2650.0, rel=1e-10)


def test_a_flow_carries_the_body_along():
    still, _ = terminal_motion(*alone())
    carried, _ = terminal_motion(*alone(fluid=Fluid(velocity=(3e-4, 1e-4))))
    np.testing.assert_allclose(carried - still, [3e-4, 1e-4], rtol=1e-9)


def test_without_gravity_nothing_settles():
    velocity, mobility = terminal_motion(*alone(forces=[StokesDrag()]))
    assert velocity.tolist() == [0.0, 0.0]
    assert mobility > 0.0


@pytest.mark.parametrize("forces", [[Gravity()], [], [Gravity(), Contact()]])
def test_without_drag_there_is_no_terminal_velocity(forces):
    with pytest.raises(UsageError, match=r"no terminal velocity.*add \[forces\.drag\]") as caught:
        terminal_motion(*alone(forces=forces))
    assert "\n" not in str(caught.value)


@attrs.frozen
class InertialDrag(BodyForce):
    """Drag that grows with the square of the speed."""

    factor: float = quantity("", above=0.0)

    @staticmethod
    def kernel(body, factor):
        """(fx, fy, torque)."""
        speed = math.hypot(body.vx, body.vy)
        return -factor * speed * body.vx, -factor * speed * body.vy, 0.0


@pytest.mark.parametrize("more", [[], [StokesDrag()]], ids=["alone", "with Stokes drag"])
def test_a_drag_that_is_not_linear(more):
    system, body = alone(forces=[Gravity(), InertialDrag(factor=1e-6), *more])
    velocity, _ = terminal_motion(system, body)
    fall = -velocity[1]
    linear = 6.0 * math.pi * VISCOSITY * 5e-6 if more else 0.0
    assert 1e-6 * fall**2 + linear * fall == pytest.approx(body.mass * G, rel=1e-8)

"""The empty scene: physics that a driver calls by name and the composer replaces.

A driver (the assembly, an integrator, an observer) calls these functions as globals. For every
scene the composer puts that scene's own functions in their place before it compiles; a slot that
a scene does not fill stays as it is here: nothing, at no cost.
"""

import math


def body_force(body, parameters):
    """(fx, fy, torque) of all body forces on one body."""
    return 0.0, 0.0, 0.0


def velocity_force(body, parameters):
    """The part of body_force whose kernels read the body's velocity."""
    return 0.0, 0.0, 0.0


def position_force(body, parameters):
    """The part of body_force whose kernels read the body's place."""
    return 0.0, 0.0, 0.0


def centre_force(pair, parameters):
    """Repulsion along the line of centres, all centre forces together."""
    return 0.0


def centre_slope(pair, parameters):
    """Derivative of centre_force by the gap."""
    return 0.0


def centre_damping(pair, parameters):
    """Minus the derivative of centre_force by the gap's rate."""
    return 0.0


def surface_force(pair, parameters):
    """Repulsion at the closest points, all surface forces together."""
    return 0.0


def surface_slope(pair, parameters):
    """Derivative of surface_force by the gap."""
    return 0.0


def surface_damping(pair, parameters):
    """Minus the derivative of surface_force by the gap's rate."""
    return 0.0


def surface_reach(parameters):
    """The gap beyond which no surface force acts: −1 where there are none."""
    return -1.0


def has_contact():
    """Whether the scene has a contact force at all."""
    return False


def contact_force(contact, parameters):
    """(normal, tangential) of all contact forces at one contact point."""
    return 0.0, 0.0


def slip_limit(contact, parameters):
    """The largest elastic tangential displacement that the contact holds."""
    return math.inf


def kink(contact, parameters):
    """A number that changes its sign where the contact forces have a kink."""
    return 1.0


def has_centre_force():
    """Whether the scene has a centre force at all."""
    return False


def reads_velocity():
    """Whether any body force depends on the velocity."""
    return False


def reads_position():
    """Whether any body force depends on the position."""
    return False


def skin_factor():
    """How far candidates are listed, in multiples of what suits many short steps."""
    return 1.0


def attempt(scene, work, clock, step):
    """One step of the integrator: the local error over the tolerance, or −1 where it failed."""
    return 0.0


def next_step(clock, step, ratio):
    """The size of the next step after one whose error was ``ratio`` times the tolerance."""
    return step


def awaits_touch(observed):
    """Whether a method of fixed steps, too, is to end a step where the first pair touches."""
    return False


def observe(scene, work, observed, time):
    """Watches every accepted step; a code other than 0 stops the run."""
    return 0

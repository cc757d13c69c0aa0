"""Numbers of MODEL sections 5 and 7, by root finding and one-dimensional integration."""

import numpy as np
from scipy.integrate import solve_ivp
from scipy.optimize import brentq, minimize_scalar

from tests.reference.forces import VACUUM_PERMITTIVITY


def balance(hamaker, potential, debye_length, permittivity=78.5):
    """S = H_A κ/(24π ε0 ε_r φ²); attraction equals repulsion where x² e^(−x) = S, x = κ d."""
    dielectric = VACUUM_PERMITTIVITY * permittivity
    return hamaker / (24 * np.pi * dielectric * potential**2 * debye_length)


def zone_gaps(hamaker, potential, debye_length, permittivity=78.5):
    """The gaps d_0 [m] where F_A = F_R, as (inner, outer), or None where they never balance.

    ln(F_A/F_R) = ln S + x − 2 ln x falls up to x = 2 and rises beyond, so one root lies on
    each side. r* cancels.
    """
    level = np.log(balance(hamaker, potential, debye_length, permittivity))

    def log_ratio(x):
        return level + x - 2 * np.log(x)

    if log_ratio(2.0) > 0:
        return None
    inner = brentq(log_ratio, 1e-150, 2.0, xtol=1e-300, rtol=1e-14)
    outer = brentq(log_ratio, 2.0, 10.0 - 4 * level, rtol=1e-14)
    return inner * debye_length, outer * debye_length


def greatest_repulsion(attraction, repulsion, reduced_radius, gaps):
    """The largest net repulsion [N] of two pair laws for gaps between the two given [m]."""

    def net(d):
        return attraction.repulsion(d, reduced_radius) + repulsion.repulsion(d, reduced_radius)

    best = minimize_scalar(lambda d: -net(d), bounds=gaps, options={"xatol": 1e-12})
    return net(best.x)


def stokes_drag(viscosity, equivalent_radius):
    """6πγ r_eq [N s/m]."""
    return 6 * np.pi * viscosity * equivalent_radius


def terminal_velocity(mass, g_effective, viscosity, equivalent_radius):
    """m g_eff/(6πγ r_eq) [m/s], downwards."""
    return mass * g_effective / stokes_drag(viscosity, equivalent_radius)


def relaxation_time(mass, viscosity, equivalent_radius):
    """τ = m/(6πγ r_eq) [s]."""
    return mass / stokes_drag(viscosity, equivalent_radius)


def impact(damping_ratio, tension):
    """One impact on ẍ = −x − 2 z ẋ (ω0 = 1, unit speed): (restitution, duration, greatest overlap).

    With tension the contact ends where the overlap x returns to 0 (z < 1; else it never does
    and the restitution is 0), without it where the force first vanishes, after which the body
    flies on at that speed.
    """
    z = damping_ratio
    if tension and z >= 1:
        return 0.0, np.inf, impact(z, tension=False)[2]

    def end(t, y):
        return y[0] if tension else y[0] + 2 * z * y[1]

    def turn(t, y):
        return y[1]

    end.terminal, end.direction = True, -1
    motion = solve_ivp(
        lambda t, y: [y[1], -y[0] - 2 * z * y[1]],
        (0.0, 1e3),
        [0.0, 1.0],
        method="DOP853",
        events=[end, turn],
        rtol=1e-12,
        atol=1e-14,
        max_step=0.05,
    )
    return -motion.y_events[0][-1][1], motion.t_events[0][-1], motion.y_events[1][0][0]

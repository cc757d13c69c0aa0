"""The drag of clusters: they settle at their own speed, and nothing else of a drag changes."""

import math

import attrs
import numpy as np
import pytest

from flocsim import Body, Fluid, Sphere, Swarm, System
from flocsim.errors import ConfigError, UsageError
from flocsim.forces import Contact, Gravity, StokesDrag, Thermal
from flocsim.forces.check import SAMPLE_BODIES
from flocsim.forces.codegen import laws_of
from flocsim.integrators import BackwardEuler, DormandPrince54, Overdamped, VelocityVerlet
from flocsim.swarms.placement import floor
from flocsim.swarms.together.clusters import Shielding
from tests.forces.test_shape_drag import STRAINED
from tests.helpers.small_study import small_config
from tests.helpers.swarm_scenes import WATER, R

TOUCHING = 1.9999 * R
LAWS = ("stokes", "schiller_naumann", "shape")
FORCES = [Gravity(), StokesDrag(clusters=True), Contact()]


def row(count, angle=0.0, start=(0.0, 0.0)):
    """Spheres that touch, along a direction."""
    way = TOUCHING * np.array([math.cos(angle), math.sin(angle)])
    return [Body(Sphere(R), tuple(start + k * way), density=1100.0) for k in range(count)]


def swarm_of(bodies, forces=FORCES, **options):
    return Swarm(bodies, forces, fluid=WATER, **options)


def shielding_of(swarm):
    """Q (n, 3) of the bodies of a swarm where they begin."""
    position, _ = swarm.system.motion()
    known = swarm.system.scene(jit=False).bodies.copy()
    Shielding(swarm.bodies, swarm.forces, swarm.gauge()).apply(known, position)
    return np.column_stack([known[f"shielding_{name}"] for name in ("xx", "xy", "yy")])


def velocity(bodies, forces=FORCES, **options):
    """The mean velocity at which bodies settle, in the end: at 1 ms it is 2e-5 short of that."""
    return swarm_of(bodies, forces, **options).run("2 ms").velocity[-1, :, :2].mean(axis=0)


@pytest.mark.slow
def test_a_doublet_settles_as_two_spheres_do():
    alone = velocity(row(1))[1]
    apart = velocity(row(2), [Gravity(), StokesDrag(), Contact()])[1]
    assert apart == pytest.approx(alone, rel=1e-6)
    assert velocity(row(2))[1] == pytest.approx(1.38 * alone, rel=5e-3)
    assert velocity(row(2, 0.5 * math.pi))[1] == pytest.approx(1.55 * alone, rel=5e-3)
    aslant = velocity(row(2, 0.25 * math.pi))
    assert aslant == pytest.approx([0.085 * alone, 1.465 * alone], rel=2e-2)


def test_it_follows_directions_of_the_whole_and_no_numbering():
    bodies = row(3, 0.3) + row(2, 2.0, (20.0 * R, 0.0)) + row(1, 0.0, (0.0, 30.0 * R))
    there = shielding_of(swarm_of(bodies))
    order = np.array([4, 0, 5, 2, 3, 1])
    again = shielding_of(swarm_of([bodies[each] for each in order]))
    assert again == pytest.approx(there[order], rel=1e-9)
    c, s = math.cos(1.1), math.sin(1.1)
    turned = [
        attrs.evolve(each, position=tuple(np.array([[c, -s], [s, c]]) @ each.position))
        for each in bodies
    ]
    xx, xy, yy = shielding_of(swarm_of(turned)).T
    back = np.array([[c, s], [-s, c]]) @ np.array([[xx, xy], [xy, yy]]).transpose(2, 0, 1)
    back = back @ np.array([[c, -s], [s, c]])
    assert back[:, 0, 0] == pytest.approx(there[:, 0], rel=1e-9)
    assert back[:, 0, 1] == pytest.approx(there[:, 1], abs=1e-9)
    assert there[5].tolist() == [1.0, 0.0, 1.0]


def test_a_cluster_across_the_seam_is_whole():
    side = 40.0 * R
    there = shielding_of(swarm_of(row(4, start=(5.0 * R, 5.0 * R)), box=(side, side)))
    across = shielding_of(swarm_of(row(4, start=(side - 3.0 * R, 5.0 * R)), box=(side, side)))
    assert across == pytest.approx(there, rel=1e-6)
    assert there[0, 0] < 0.8


def test_what_lies_on_a_wall_keeps_its_drag():
    lying = row(3, start=(0.0, R * 0.9999))
    assert shielding_of(swarm_of(lying))[0, 0] < 0.9
    on_floor = swarm_of([*lying, floor(20.0 * R, 0.0)])
    assert shielding_of(on_floor).tolist() == [[1.0, 0.0, 1.0]] * 4


@pytest.mark.parametrize("law", LAWS)
@pytest.mark.parametrize("fluid", [WATER, STRAINED])
def test_a_drag_in_a_cluster_is_that_alone_or_less_and_takes_energy(law, fluid):
    strain = law != "shape"
    alone, less = (
        laws_of([StokesDrag(law=law, strain=strain, clusters=clusters)], fluid)
        for clusters in (False, True)
    )
    rng = np.random.default_rng(5)
    body = SAMPLE_BODIES[0]._replace(
        resistance_xx=1e-4, resistance_yy=1.5e-4, resistance_xy=2e-5, resistance_xs=1e-11,
        resistance_ss=1e-14, strain_xx_x=1e-10, strain_xy_s=2e-15, vx=3e-4, vy=-1e-4, spin=2.0,
    )  # fmt: skip
    loads = [laws.laws["body_force"](body, laws.parameters) for laws in (alone, less)]
    assert loads[1] == pytest.approx(loads[0], rel=1e-12)
    still = laws_of([StokesDrag(law=law, clusters=True)], WATER)
    for _ in range(20):
        q = np.sqrt(rng.uniform(0.1, 1.0, size=2))
        c, s = math.cos(angle := rng.uniform(0.0, 6.0)), math.sin(angle)
        xx, xy, yy = (
            c * c * q[0] + s * s * q[1], c * s * (q[0] - q[1]), s * s * q[0] + c * c * q[1],
        )  # fmt: skip
        vx, vy, spin = rng.normal(size=3) * [1e-3, 1e-3, 10.0]
        view = body._replace(
            vx=vx, vy=vy, spin=spin, shielding_xx=xx, shielding_xy=xy, shielding_yy=yy
        )
        fx, fy, torque = still.laws["body_force"](view, still.parameters)
        assert fx * vx + fy * vy + torque * spin < 0.0


@pytest.mark.slow
@pytest.mark.parametrize(
    "method",
    [BackwardEuler(1e-8), DormandPrince54(1e-9), Overdamped(1e-9), VelocityVerlet("50 ns")],
    ids=lambda method: type(method).__name__,
)
def test_all_methods_of_swarms_have_it(method):
    there = velocity(row(2))[1]
    assert velocity(row(2), integrator=method)[1] == pytest.approx(there, rel=2e-2)


def test_refusals(tmp_path):
    with pytest.raises(UsageError, match="a System does not find clusters"):
        System(row(2), FORCES, fluid=Fluid()).run(1e-3)
    with pytest.raises(UsageError, match="would get too hot"):
        swarm_of(row(2), [*FORCES, Thermal(kick="1 ms")]).begin(1e-3)
    with pytest.raises(ConfigError, match=r"drag.clusters.* is for swarms: leave it out"):
        small_config(tmp_path, {"forces": {"drag": {"clusters": True}}})

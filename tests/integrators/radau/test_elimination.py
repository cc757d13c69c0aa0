"""The sparse systems of many bodies, held against dense ones by numpy."""

import numpy as np
import pytest

import flocsim.arrays as at
from flocsim import Body, Sphere, System
from flocsim.arrays import work_of
from flocsim.body import Fluid
from flocsim.forces import Contact, Gravity, StokesDrag
from flocsim.geometry.contact.candidates import list_candidates
from flocsim.geometry.contact.points import locate_contacts
from flocsim.integrators.events.first_event import set_modes
from flocsim.integrators.radau.contact_frames import gather_clusters
from flocsim.integrators.radau.elimination import factorise_sparse
from flocsim.integrators.radau.ordering import PATTERN
from flocsim.integrators.radau.stages import evaluate_states
from flocsim.integrators.radau.systems import solve_both
from flocsim.integrators.radau.tableau import EIGENVALUES
from flocsim.integrators.rhs.blocks import lower_block, own_block, upper_block
from flocsim.integrators.rhs.jacobian import assemble_jacobian

R = 5e-6
STEP = 1e-6


def packed(count, seed, fixed=()):
    """A crowd of discs, most of which overlap one another a little, its derivatives assembled."""
    rng = np.random.default_rng(seed)
    wide = int(np.ceil(np.sqrt(count)))
    bodies = []
    for body in range(count):
        row, column = divmod(body, wide)
        place = np.array([2.0 * R * column + R * (row % 2), 1.73 * R * row])
        place += 0.02 * R * rng.normal(size=2)
        velocity = tuple(1e-3 * rng.normal(size=2))
        bodies.append(
            Body(Sphere(R), tuple(place), 0.0, velocity, rng.normal(), density=2650.0,
                 fixed=body in fixed)
        )  # fmt: skip
    forces = [Gravity(), StokesDrag(), Contact(friction=0.4)]
    scene = System(bodies, forces, fluid=Fluid(buoyancy=True)).scene(jit=False)
    work = work_of(
        scene, *System(bodies).motion(), capacity=40 * count, blocks=60 * count, pairs=10 * count
    )
    assert list_candidates(scene, work)
    locate_contacts(scene, work, at.NOW)
    set_modes(scene, work)
    evaluate_states(scene, work, 0.0, 0.0, at.NOW, at.NOW + 1)
    gather_clusters(scene, work)
    assemble_jacobian(scene, work, 0.0, 1e-3)
    return scene, work


def dense(scene, work, which):
    """The same system as one matrix."""
    n, value = len(scene.bodies), EIGENVALUES[which]

    def block(number):
        return work.jacobian[0, number] + STEP / value * work.jacobian[1, number]

    matrix = np.zeros((n, 3, n, 3), dtype=complex)
    for body in range(n):
        inertia = scene.bodies[body, [at.MASS, at.MASS, at.INERTIA]]
        matrix[body, :, body] = block(body) + np.diag(value / STEP * inertia)
    for pair in range(work.tally[at.PAIRS]):
        a, b = work.pairs[pair, :2]
        matrix[a, :, b], matrix[b, :, a] = (
            block(lower_block(work, pair)),
            block(upper_block(work, pair)),
        )
    for body in np.flatnonzero(scene.bodies[:, at.FREE] == 0.0):
        matrix[body] = 0.0
        matrix[body, :, body] = np.eye(3)
    return matrix.reshape(3 * n, 3 * n)


def random_loads(scene, rng):
    """Forces and torques of the order of weights, none on fixed bodies."""
    n = len(scene.bodies)
    loads = np.zeros((2, n, 3), dtype=complex)
    loads[0] = rng.normal(size=(n, 3)) * [1e-12, 1e-12, 1e-17]
    loads[1] = rng.normal(size=(n, 3)) * [1e-12, 1e-12, 1e-17] + 1j * rng.normal(size=(n, 3)) * [
        1e-12,
        1e-12,
        1e-17,
    ]
    return (loads * scene.bodies[:, at.FREE][None, :, None]).reshape(2, -1)


def put_loads(work, loads):
    """Loads with the sums of clusters in the rows of their first bodies, as the method writes
    them."""
    work.loads[:] = loads
    for body, leader in enumerate(work.cluster):
        if leader != body:
            for axis in range(2):
                work.loads[:, 3 * leader + axis] += loads[:, 3 * body + axis]


@pytest.mark.parametrize("count, fixed", [(7, ()), (16, (0,)), (60, ()), (60, (3, 31))])
@pytest.mark.parametrize("seed", range(3))
def test_solutions_are_those_of_the_dense_systems(count, fixed, seed):
    scene, work = packed(count, seed, fixed)
    assert work.pairs[: work.tally[at.PAIRS], at.ACTING].sum() > count // 3
    assert factorise_sparse(scene, work, STEP, True)
    loads = random_loads(scene, np.random.default_rng(seed))
    put_loads(work, loads)
    solve_both(work)
    sizes = np.tile([1.0, 1.0, R], count)
    for which in range(2):
        expected = np.linalg.solve(dense(scene, work, which), loads[which])
        error = np.abs((work.loads[which] - expected) * sizes).max()
        assert error < 1e-9 * np.abs(expected * sizes).max()


@pytest.mark.parametrize("seed", range(3))
def test_momentum_is_balanced_to_rounding(seed):
    scene, work = packed(50, seed)
    assert factorise_sparse(scene, work, STEP, True)
    loads = random_loads(scene, np.random.default_rng(seed))
    put_loads(work, loads)
    solve_both(work)
    for leader in set(work.cluster.tolist()):
        of_it = np.flatnonzero(work.cluster == leader)
        for axis in range(2):
            # What the bodies take up, and what drag does, is what they were given in all.
            terms = []
            for body in of_it:
                own = own_block(work, body)
                drag = work.jacobian[0, own] + STEP / EIGENVALUES[0] * work.jacobian[1, own]
                x = work.loads[0, 3 * body : 3 * body + 3]
                mass = EIGENVALUES[0] / STEP * scene.bodies[body, at.MASS]
                terms += [mass * x[axis], drag[axis] @ x, -loads[0, 3 * body + axis]]
            assert abs(sum(terms)) < 1e-13 * max(np.abs(terms))


def test_a_chain_fills_in_nowhere():
    count = 40
    bodies = [Body(Sphere(R), (1.99 * R * k, 0.0), density=2650.0) for k in range(count)]
    system = System(bodies, [Contact()])
    scene = system.scene(jit=False)
    work = work_of(scene, *system.motion(), capacity=2000)
    assert list_candidates(scene, work)
    locate_contacts(scene, work, at.NOW)
    set_modes(scene, work)
    gather_clusters(scene, work)
    assemble_jacobian(scene, work, 0.0, 1e-3)
    assert factorise_sparse(scene, work, STEP, True)
    e = work.elimination
    right = e.lower[1:] - e.upper[:count]
    # Every body but the last is tied to one that comes later, and the first one's row to all.
    assert right.sum() == count - 1
    assert e.lower[count] == 2 * (count - 1) + count - 2


def test_the_pattern_is_kept_while_the_same_pairs_act():
    scene, work = packed(40, 1)
    assert factorise_sparse(scene, work, STEP, True)
    pattern = work.elimination.found[PATTERN]
    work.elimination.graph[:] = -7
    assert factorise_sparse(scene, work, 2.0 * STEP, True)
    assert np.all(work.elimination.graph == -7)
    assert work.elimination.found[PATTERN] == pattern
    # One more pair acts: the bodies are ordered anew.
    acting = work.pairs[: work.tally[at.PAIRS], at.ACTING]
    acting[np.flatnonzero(acting == 0)[0]] = 1
    assert factorise_sparse(scene, work, STEP, True)
    assert not np.all(work.elimination.graph == -7)

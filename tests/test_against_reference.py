"""The compiled right-hand side held against the plain reference, on scenes of every kind."""

import numpy as np
import pytest

from tests.helpers.fast_scene import (
    FORCES,
    GAPS,
    FastScene,
    random_case,
    shape_of,
    silenced,
)
from tests.helpers.tiers import rest_slow
from tests.reference.contacts import contacts
from tests.reference.forces import loads

SCENES = range(220)
ONE_BY_ONE = range(50)
UNCOMPILED = range(20)
FEW_QUICKLY = rest_slow(SCENES, lambda seed: seed < 25)

TOGETHER = {gap: tuple(name for name in FORCES if not name.endswith(other))
            for gap, other in zip(GAPS, GAPS[::-1], strict=True)}  # fmt: skip


def expected(case, names, fast):
    """The reference's loads, and the greatest force of any single law [N]."""
    parts = [
        loads(
            case.plain,
            case.laws(name, smoothing=fast.scene.smoothing),
            case.slips if name == "contact" else None,
        )
        for name in names
    ]
    scale = max(np.abs(part[:, :2]).max() for part in parts)
    return sum(parts), scale


def assert_loads(found, wanted, scale, case):
    """Forces to 1e-9 of the greatest one, torques to that times the largest body."""
    size = max(shape_of(body).bounding_radius for body in case.plain.bodies)
    error = np.abs(found - wanted)
    assert error[:, :2].max() <= 1e-9 * scale
    assert error[:, 2].max() <= 1e-9 * scale * size + 1e-9 * np.abs(wanted[:, 2]).max()


def slips_of(case, names):
    """Tangential displacements, where a contact law is there to hold them."""
    return case.slips if "contact" in names else None


@pytest.mark.parametrize("gap", GAPS)
@pytest.mark.parametrize("seed", FEW_QUICKLY)
def test_all_forces_together_compiled(seed, gap):
    case, names = random_case(seed), TOGETHER[gap]
    fast = FastScene(silenced(case, *names))
    assert_loads(fast.loads(slips_of(case, names)), *expected(case, names, fast), case)


@pytest.mark.parametrize("seed", FEW_QUICKLY)
def test_contact_pairs(seed):
    plain = random_case(seed).plain
    fast = FastScene(silenced(random_case(seed), "contact"))
    fast.loads()
    found, wanted = fast.overlapping(), contacts(plain)
    keys = [key if key in found else fast.other_way_round(key) for key in wanted.pair_keys()]
    assert sorted(found) == sorted(keys)
    for row, key in enumerate(keys):
        side = 1.0 if key == wanted.pair_keys()[row] else -1.0
        geometry = found[key]
        assert -geometry.gap == pytest.approx(wanted.overlap[row], rel=1e-9, abs=1e-18)
        normal = geometry.normal_x, geometry.normal_y
        assert normal == pytest.approx(side * wanted.normal[row], abs=1e-9)
        assert fast.contact_point(key, geometry) == pytest.approx(wanted.point[row], abs=1e-15)


@pytest.mark.parametrize("name", FORCES)
@pytest.mark.parametrize("seed", rest_slow(ONE_BY_ONE, lambda seed: seed < 10))
def test_every_force_alone(seed, name):
    # Uncompiled, each scene is made of this one force's code, all other forces left out.
    case = random_case(seed)
    fast = FastScene(case.system(name), jit=False)
    assert_loads(fast.loads(slips_of(case, [name])), *expected(case, [name], fast), case)


@pytest.mark.parametrize("seed", UNCOMPILED)
def test_compiled_and_uncompiled_code_agree(seed):
    case = random_case(seed)
    compiled, plain = (FastScene(case.system(), jit=jit).loads(case.slips) for jit in (True, False))
    assert compiled == pytest.approx(plain, rel=1e-13, abs=1e-14 * np.abs(plain).max())

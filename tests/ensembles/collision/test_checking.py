"""Which replicates are run again and how: few, random, and the same whatever else is asked for."""

import math

import attrs
import numpy as np
import pytest

from flocsim.ensembles.collision.draw import (
    FAILED,
    THIRD_OF,
    count_checks,
    exact_method,
    exact_methods,
    expected_checks,
    further_runs,
)
from flocsim.ensembles.diagnose.dry_run import checked_words
from flocsim.ensembles.kind import Overseer
from flocsim.ensembles.storage.identity import differences, identity_of
from flocsim.integrators import DormandPrince54, Implicit, Overdamped, VelocityVerlet
from flocsim.integrators.parts import FixedStep
from flocsim.io.results.schema import NOT_APPLICABLE
from tests.helpers.small_study import small_config, small_study

POLYGONS = {"shapes": {"vertices": (4,), "pool": 2}, "scene": {"types": ("I",), "delta": (0.0,)}}
CHECKS, THIRDS = (
    tuple(f"{run}_{name}" for name in ("outcome", "inside", "bond")) for run in ("checked", "third")
)


@pytest.mark.parametrize("share", ["auto", 0.0, 0.03, 0.5, 1.0])
@pytest.mark.parametrize("seed", [1, 2, 77])
def test_of_the_first_so_many_just_as_many_are_checked_as_are_said_to_be(seed, share):
    runs = np.array([further_runs(seed, k, share) for k in range(3000)])
    chosen, third = np.cumsum(runs > 0), np.sum(runs > 1)
    for count in (1, 2, 10, 100, 999, 3000):
        assert chosen[count - 1] == count_checks(seed, count, share)
        assert abs(chosen[count - 1] - expected_checks(count, share)) < 1.0
    assert chosen[-1] == {0.0: 0, 1.0: 3000}.get(share, chosen[-1])
    # Of these the first, and then one in THIRD_OF.
    assert third == math.ceil(chosen[-1] / THIRD_OF) and (share == 0.0 or max(runs[:40]) == 2)


def test_auto_checks_the_first_replicates_and_later_a_fixed_fraction():
    wanted = {n: expected_checks(n, "auto") for n in (1, 3, 24, 60, 1000, 10**6)}
    assert wanted == {1: 1, 3: 3, 24: 24, 60: 24, 1000: 35, 10**6: 35_000}
    easily = {n: expected_checks(n, "auto", easily=True) for n in (10, 72, 90, 1000)}
    assert easily == {10: 10, 72: 72, 90: 72, 1000: 105}
    assert max(np.diff([expected_checks(n, "auto", easily=True) for n in range(3000)])) <= 1.0


def test_methods_are_made_more_exact_and_no_other():
    for method in (Implicit(1e-9), DormandPrince54(1e-9), Overdamped(1e-9)):
        exact = exact_method(method)
        assert exact == attrs.evolve(method, tolerance=1e-11)
    assert exact_method(VelocityVerlet(4e-8)) == VelocityVerlet(1e-8)
    for first, third in ((1e-6, 1e-11), (1e-7, 1e-12), (1e-9, 1e-12), (1e-12, 1e-15)):
        assert exact_methods(Implicit(first))[1] == Implicit(third)


@attrs.frozen
class Unchangeable(FixedStep):
    """A method whose step is nobody's business."""

    step: float = attrs.field(init=False, default=1e-6)

    @staticmethod
    def attempt(scene, work, clock, step):
        return 0.0


def with_method(config, method, **options):
    integrator = attrs.evolve(config.integrator, own=method, name=None, **options)
    return attrs.evolve(config, integrator=integrator)


def test_a_method_without_tolerance_and_step_is_not_checked(tmp_path):
    assert exact_method(Unchangeable()) is None
    config = small_config(tmp_path, {"shapes": {"vertices": (1,)}})
    for share in ("auto", 0.2):
        assert "not known" in checked_words(with_method(config, Unchangeable(), check_share=share))


def test_the_dry_run_says_how_many_and_at_what(tmp_path):
    config = small_config(tmp_path, {"replicates": 1000, "shapes": {"vertices": (1,)}})
    words = checked_words(config)
    assert f"{count_checks(1, 1000, 'auto')} re-runs of each condition" in words
    assert "1e-11 m" in words
    off = small_config(tmp_path, {"integrator": {"check_share": 0.0}})
    assert "not known" in checked_words(off)


def test_a_second_run_is_that_of_the_tighter_tolerance_and_changes_nothing_else(tmp_path):
    all_of_them = small_study(tmp_path, POLYGONS | {"integrator": {"check_share": 1.0}})
    none = small_study(tmp_path, POLYGONS | {"integrator": {"check_share": 0.0}})
    exact, most_exact = (
        small_study(tmp_path, POLYGONS | {"integrator": {"check_share": 0.0, "tolerance": each}})
        for each in (1e-11, 1e-12)
    )
    place = 0, *all_of_them.conditions[0][1:]
    for k in range(6):
        row, plain, tighter = (each.run(*place, k) for each in (all_of_them, none, exact))
        assert [plain[name] for name in CHECKS + THIRDS] == [NOT_APPLICABLE] * 6
        codes = [tighter[name] for name in ("outcome", "inside", "bond")]
        assert [row[name] for name in CHECKS] == codes
        if k == 0:
            third = most_exact.run(*place, k)
            codes = [third[name] for name in ("outcome", "inside", "bond")]
            assert [row[name] for name in THIRDS] == codes
        else:
            assert [row[name] for name in THIRDS] == [NOT_APPLICABLE] * 3
        blank = dict.fromkeys(CHECKS + THIRDS, NOT_APPLICABLE)
        assert {**row, **blank} == pytest.approx(plain, nan_ok=True)
        assert tighter["steps"] > plain["steps"]


def test_an_error_in_a_second_run_costs_no_replicate(tmp_path, monkeypatch):
    study = small_study(tmp_path, POLYGONS | {"integrator": {"check_share": 1.0}})
    whole = study.run(0, *study.conditions[0][1:], 0)

    def broken(self, original=Implicit.fresh_clock):
        if self in study.exact:
            raise ValueError("no second run")
        return original(self)

    monkeypatch.setattr(Implicit, "fresh_clock", broken)
    [row], notes = study.run_some(study.conditions[0], 0, 1, Overseer())
    assert not notes
    assert [row[name] for name in CHECKS] == [FAILED, NOT_APPLICABLE, NOT_APPLICABLE]
    assert (row["outcome"], row["steps"]) == (whole["outcome"], whole["steps"])


def test_rows_of_another_share_are_rows_of_another_study(tmp_path):
    spheres = {"shapes": {"vertices": (1,)}}
    one, other = (
        identity_of(small_study(tmp_path, spheres | {"integrator": {"check_share": share}}))
        for share in ("auto", 0.1)
    )
    assert differences(one, other) == ['integrator.check_share is "auto" in the file, 0.1 now']

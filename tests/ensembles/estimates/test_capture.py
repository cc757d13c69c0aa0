"""From points to capture widths and kernels: rows that are made up, and runs of spheres."""

import math
from itertools import product

import numpy as np
import pytest

from flocsim.ensembles.collision.draw import points_of
from flocsim.ensembles.config.schema import StopConfig
from flocsim.ensembles.estimates.capture import (
    estimate,
    numerics_of,
    ratio_of,
    weighted,
)
from flocsim.ensembles.kind import study_of
from flocsim.ensembles.report import kernel_lines, too_many_undecided, verdict
from flocsim.ensembles.runner import run
from flocsim.io.results.kernel_group import ESTIMATES, WHAT
from flocsim.io.results.schema import NOT_APPLICABLE, OUTCOMES
from tests.helpers.kernel_study import kernel_config
from tests.helpers.tiers import rest_slow

BARE = "[forces]\nvan_der_waals = false\ndouble_layer = false"


def made_up(study, place, catches, flips=()):
    """(Weighted, rows) of a condition in which a pair is caught where ``catches(b/R)``."""
    count = study.config.replicates
    points = points_of(study.config.seed, study.scene.scrambles, 0, count)
    rows = {name: np.full(count, -1) for name in ("floc_i", "floc_j")}
    encounter = study.encounter(place, 1, study.numbers(0))
    drawn = [study.numbers(k) for k in range(count)]
    shares = np.array([study.share_of(encounter, 1.0, each) for each in drawn])
    caught = catches(shares)
    rows["outcome"] = np.where(caught, 0, OUTCOMES.index("missed"))
    rows["inside"] = np.where(caught, 1, NOT_APPLICABLE)
    rows["bond"] = np.where(caught, 1, NOT_APPLICABLE)
    for which, every in (("checked", 8), ("third", 32)):
        checked = np.arange(0, count, every)
        for name in ("outcome", "inside", "bond"):
            again = rows[f"{which}_{name}"] = np.full(count, NOT_APPLICABLE)
            again[checked] = rows[name][checked]
            again[[k for k in flips if k % every == 0]] = (
                OUTCOMES.index("missed") if name == "outcome" else NOT_APPLICABLE
            )
    return weighted(study, (place, 1), rows, points), rows


CASES = [("settling", 1.0), ("shear", 10.0), ("extension", 10.0)]


@pytest.mark.parametrize(("meeting", "rate"), CASES)
def test_spheres_have_the_rectilinear_kernels(tmp_path, meeting, rate):
    scene = "" if meeting == "settling" else f"rate = {rate}"
    config = kernel_config(tmp_path, meeting=f'"{meeting}"', scene=scene, replicates=4096)
    study = study_of(config)
    place = config.scene.names.index(f"{meeting}:10um-20um")
    points, rows = made_up(study, place, lambda share: np.abs(share) <= 1.0)
    found = estimate(points, rows, 4)
    size = 3e-5
    speed = math.hypot(*study.encounter(place, 1, study.numbers(0)).drift)
    plane = {"settling": 2.0 * size * speed, "shear": rate * size**2,
             "extension": 2.0 * rate * size**2}[meeting]  # fmt: skip
    space = {"settling": math.pi * size**2 * speed, "shear": 4.0 / 3.0 * rate * size**3,
             "extension": 8.0 / 3.0 * rate * size**3}[meeting]  # fmt: skip
    assert found["beta2_reference"] == pytest.approx(plane, rel=1e-12, abs=0.0)
    assert found["beta3_reference"] == pytest.approx(space, rel=1e-12, abs=0.0)
    for name, exact in (("beta2", plane), ("beta3", space), ("width_a", 2.0 * size)):
        assert found[name] == pytest.approx(exact, rel=5e-3, abs=0.0), name
        slack = 1e-3 * exact
        assert found[f"{name}_low"] - slack <= exact <= found[f"{name}_high"] + slack, name
    assert found["alpha"] == 1.0 and found["alpha_low"] < 1.0
    assert found["efficiency3"] == pytest.approx(1.0, rel=5e-3)
    assert found["undecided"] == 0.0


def test_both_signs_count_by_themselves(tmp_path):
    config = kernel_config(tmp_path, replicates=4096)
    points, rows = made_up(study_of(config), 0, lambda b: (b > 0.2) & (b < 0.5))
    found = estimate(points, rows, 4)
    assert found["width_a"] == pytest.approx(0.3 * 3e-5, rel=0.01)


@pytest.mark.parametrize(("meeting", "rate"), CASES)
def test_flips_change_rates_by_their_weight_and_with_their_sign(tmp_path, meeting, rate):
    scene = "" if meeting == "settling" else f"rate = {rate}"
    config = kernel_config(tmp_path, meeting=f'"{meeting}"', scene=scene, replicates=512)
    study = study_of(config)
    points, rows = made_up(study, 0, lambda b: np.abs(b) < 0.9)
    caught = np.flatnonzero((rows["outcome"] == 0) & (rows["checked_outcome"] == 0))[:2]
    points, rows = made_up(study, 0, lambda b: np.abs(b) < 0.9, flips=caught)
    found = estimate(points, rows, 4)
    # Both fall out, by the second run; the third says the same.
    for name in (*WHAT, "alpha"):
        gained, lost, *third = found[f"{name} changes"].sum(axis=0)
        assert (gained, lost, *third) == (0, 2, 0, 0)
    assert found["flips_a"] == pytest.approx(2 / 64)
    exactly = np.delete(np.arange(512), caught)
    weight = points.plane
    now = np.sum((weight * (rows["outcome"] == 0))[exactly])
    assert found["beta2 shift"] == pytest.approx(now / 512 - found["beta2"])
    assert found["beta2 largest"] == pytest.approx(weight.max() / 512)
    told = numerics_of(found)
    for name in ESTIMATES:
        low, high = (told[f"{name}_change{end}"] for end in ("_low", "_high"))
        if math.isnan(found[name]):
            assert math.isnan(low)
            continue
        assert (
            low <= found[f"{name} shift"] * (1.0 + 1e-9) + 1e-30 and high >= found[f"{name} shift"]
        )
        assert told[f"{name}_numerical"] == max(abs(low), high)
        assert low >= -found[name]
    assert abs(told["beta2_change_low"]) > told["beta2_change_high"]


UNDECIDED = OUTCOMES.index("undecided")


SHARES = (0.01, 0.05, 0.2, 0.6, 1.0)
WHICH = ("any", "captures", "misses", "touched")


def is_in_turn(meeting, rate, share, which):
    """Each share of each selection, in one of the meetings."""
    number = SHARES.index(share) + WHICH.index(which)
    return CASES[number % len(CASES)] == (meeting, rate)


@pytest.mark.parametrize(
    ("meeting", "rate", "share", "which"),
    rest_slow(((*case, *more) for case in CASES for more in product(SHARES, WHICH)), is_in_turn),
)
def test_the_unknown_cannot_leave_the_interval(tmp_path, meeting, rate, share, which):
    """Whatever points are undecided or have failed, and whatever they would have come to."""
    scene = "" if meeting == "settling" else f"rate = {rate}"
    config = kernel_config(tmp_path, meeting=f'"{meeting}"', scene=scene, replicates=128)
    study = study_of(config)
    rng = np.random.default_rng([int(100 * share), len(which)])
    for _ in range(4):
        start, width = rng.uniform(-0.9, 0.4), rng.uniform(0.1, 0.9)
        points, rows = made_up(study, 0, lambda b, s=start, w=width: (b > s) & (b < s + w))
        lost = rng.random(128) < 0.4 * rng.random()  # touched, and parted again
        rows["outcome"] = np.where(lost & (rows["outcome"] == 0), 1, rows["outcome"])
        truth = estimate(points, rows, 4)
        touched = rows["inside"] != NOT_APPLICABLE
        of = {"any": True, "captures": rows["outcome"] == 0, "misses": ~touched, "touched": touched}
        unknown = (rng.random(128) < share) & of[which]
        kept = rng.random(128) < 0.5  # of those that touch, some are seen to
        rows["outcome"] = np.where(unknown, UNDECIDED + (rng.random(128) < 0.3), rows["outcome"])
        rows["inside"] = np.where(unknown & ~kept, NOT_APPLICABLE, rows["inside"])
        found = estimate(points, rows, 4)
        for name in ESTIMATES:
            value, low, high = (found[name + end] for end in ("", "_low", "_high"))
            assert np.isnan(truth[name]) or low <= truth[name] * (1 + 1e-12), name
            assert np.isnan(truth[name]) or high >= truth[name] * (1 - 1e-12), name
            assert np.isnan(value) or low <= value * (1 + 1e-12) <= high * (1 + 2e-12), name
        assert np.isnan(found["alpha_high"]) or 0.0 <= found["alpha_low"] <= 1.0
        assert np.isnan(found["alpha_high"]) or found["alpha_high"] <= 1.0
        assert np.isnan(found["beta2"]) == (found["undecided"] > StopConfig().undecided)


def test_what_is_undecided_flips_nothing(tmp_path):
    config = kernel_config(tmp_path, replicates=512)
    points, rows = made_up(study_of(config), 0, lambda b: np.abs(b) < 0.9)
    rows["checked_outcome"][:] = np.where(
        rows["checked_outcome"] == NOT_APPLICABLE, NOT_APPLICABLE, UNDECIDED
    )
    for name in ("checked_inside", "third_outcome", "third_inside"):
        rows[name][:] = NOT_APPLICABLE
    found = estimate(points, rows, 4)
    assert np.isnan(found["flips_a"]) and found["checked"] == 64
    assert not any(found[f"{name} shift"] for name in ESTIMATES)
    # They may have come to anything, and so may as many of those that were not run again.
    told = numerics_of(found)
    assert told["beta2_change_low"] < -0.9 * found["beta2"]


@pytest.mark.slow
def test_a_study_cut_short_holds_the_rates_of_the_whole(tmp_path):
    """The same points, some of them without the steps that they need."""
    about = {"preset": "tang2014", "meeting": '["shear"]', "scene": 'rate = "10 1/s"',
             "sizes": '["5 um", "8 um"]'}  # fmt: skip
    whole, cut = (
        run(kernel_config(tmp_path, **about, more=f"[integrator]\nmax_steps = {steps}"))
        for steps in (100_000, 15)
    )
    there, here = whole.kernel.arrays, cut.kernel.arrays
    assert there["undecided"].max() == 0.0 and here["undecided"].min() > StopConfig().undecided
    for name in ESTIMATES:
        assert np.all(here[f"{name}_low"] <= there[name]), name
        assert np.all(there[name] <= here[f"{name}_high"]), name
    assert np.isnan(here["beta2"]).all() and here["alpha_high"].max() <= 1.0
    assert too_many_undecided(cut) and not too_many_undecided(whole)
    assert "undecided" in verdict(cut)[1] and verdict(whole)[1] == ""
    assert "[0.00, " in "\n".join(kernel_lines(cut.kernel, numerics=False))


def test_intervals_are_students_of_the_scrambles():
    values = np.array([1.0, 2.0, 3.0, 4.0])
    mean, low, high = ratio_of(values, np.ones(4), 0.0)
    half = 3.18244630528371 * values.std(ddof=1) / 2.0
    assert (mean, low, high) == pytest.approx((2.5, max(2.5 - half, 0.0), 2.5 + half))
    # Four scrambles that agree up to a point do not know the mean to better than that.
    assert ratio_of(np.ones(4), np.ones(4), 0.1)[2] == pytest.approx(1.0 + 1.591223 * 0.05)
    assert ratio_of(values, 2.0 * values, 0.0) == pytest.approx((0.5, 0.5, 0.5))
    assert np.isnan(ratio_of(values, 0.0 * values, 0.0)).all()


@pytest.mark.parametrize("all_touch", [True, False])
def test_where_all_points_agree_the_interval_is_wilsons_at_their_number(tmp_path, all_touch):
    points, rows = made_up(study_of(kernel_config(tmp_path)), 0, lambda b: (b > -9.0) == all_touch)
    found, rare = estimate(points, rows, 4), 3.841459 / (32 + 3.841459)
    low, high = found["width_a_low"], found["width_a_high"]
    if all_touch:
        assert low <= found["width_a"] * (1.0 - rare) * (1.0 + 1e-6) <= high
        assert found["alpha_low"] == pytest.approx(1.0 - rare) and found["alpha_high"] == 1.0
    else:
        assert (found["width_a"], low) == (0.0, 0.0)
        assert high == pytest.approx(rare * np.mean(points.width))


@pytest.mark.slow
def test_intervals_cover_what_they_say(tmp_path):
    covered = []
    for seed in range(60):
        config = kernel_config(tmp_path, replicates=256)
        study = study_of(config)
        object.__setattr__(study.config, "seed", seed)
        points, rows = made_up(study, 0, lambda b: np.abs(b) < 0.77)
        found = estimate(points, rows, 4)
        covered.append(found["width_a_low"] <= 2 * 0.77 * 3e-5 <= found["width_a_high"])
    # 60 trials of 0.95 are below 0.88 once in a hundred times.
    assert np.mean(covered) >= 0.88


def test_a_study_ends_with_its_kernel(tmp_path):
    config = kernel_config(
        tmp_path, meeting='["settling", "shear"]', scene='rate = "10 1/s"', more=BARE
    )
    results = run(config)
    kernel = results.kernel
    assert kernel.mechanisms == ("settling", "shear") and kernel.labels == ("10um", "20um")
    arrays = kernel.arrays
    # Without attraction nothing is sampled beyond where spheres touch.
    assert arrays["width_c"][0, 0, 0, 1] == pytest.approx(6e-5, rel=1e-9, abs=0.0)
    assert arrays["width_c"][0, 0, 0, 0] == 0.0 and np.isnan(arrays["alpha"][0, 0, 0, 0])
    assert arrays["width_c"][1, 0, 1, 1] == pytest.approx(8e-5, rel=1e-9, abs=0.0)
    assert np.array_equal(arrays["beta2"], np.swapaxes(arrays["beta2"], 2, 3), equal_nan=True)
    assert np.all(arrays["checked"][1] > 0)

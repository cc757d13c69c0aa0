"""What a study says in one sentence, and of which preset, weight and water."""

import json

import numpy as np
import pytest

from flocsim.ensembles.estimates.statistics import COUNTED
from flocsim.ensembles.estimates.summary import sums_of, tables_of
from flocsim.ensembles.pairs.answer import answer_sentence, setting_sentence
from flocsim.io.results.schema import BONDS, NOT_APPLICABLE, OUTCOMES, Results

A, B, MISSED, UNDECIDED, HELD = (
    OUTCOMES.index(name) for name in ("A", "B", "missed", "undecided", "held")
)
HOOK = 1 + BONDS.index("hook")
REAL = {"shapes": "12 flocs of shapes.h5"}


def results(rows, vertices=(1, 64), types=("I",), run=REAL, hooks=0, radii=None):
    """Results of one displacement from the outcomes of every replicate, {(type, N): codes}; the
    first ``hooks`` aggregated pairs of each condition hang."""
    count = len(next(iter(rows.values())))
    shape = (len(types), len(vertices), 1, count)
    codes = {name: np.full(shape, NOT_APPLICABLE) for name in COUNTED}
    for (kind, n), outcomes in rows.items():
        place = types.index(kind), vertices.index(n), 0
        outcomes = np.array(outcomes)
        codes["outcome"][place] = outcomes
        codes["inside"][place] = np.where(outcomes <= B, 1, NOT_APPLICABLE)
        bonded = np.flatnonzero(outcomes == A)
        codes["bond"][(*place, bonded)] = np.where(np.arange(len(bonded)) < hooks, HOOK, 1)
    every = tuple(codes.values())
    sums = sums_of(lambda first, stop: tuple(x[..., first:stop] for x in every), 1, 0, count)
    more = {} if radii is None else {"radii": {name: np.array(radii) for name in ("r_i", "r_j")}}
    return Results(
        types, np.array(vertices), np.array([0.0]), None, run=dict(run), count=count,
        **more, **tables_of(sums),
    )  # fmt: skip


def test_answer_says_how_many_of_touching_pairs_stick_and_how_many_spheres():
    found = results({("I", 1): [A] * 100, ("I", 64): [A] * 40 + [B] * 40 + [MISSED] * 20})
    assert answer_sentence(found) == (
        "Of pairs that touch, 50 % [39, 61] stick (N = 64, real outlines); spheres of the same "
        "size: 100 %."
    )


def test_answer_gives_the_lowest_and_highest_of_several_types():
    rows = {("I", 4): [A] * 20 + [B] * 80, ("III", 4): [A] * 60 + [B] * 40}
    found = results(rows, (4,), ("I", "III"), {"shapes": "4 synthetic flocs grown by flocsim"})
    assert answer_sentence(found) == (
        "Of pairs that touch, 20 % [13, 29] (type I) to 60 % [50, 69] (type III) stick (N = 4, "
        "grown outlines)."
    )


def test_answer_of_spheres_alone_names_no_outlines():
    found = results({("I", 1): [A] * 60}, (1,), run={"shapes": "spheres"})
    assert answer_sentence(found) == "Of pairs of spheres that touch, 100 % [94, 100] stick."


def test_answer_says_what_the_probability_leaves_out():
    held = results({("I", 64): [HELD] * 50}, (64,))
    assert answer_sentence(held) == (
        "No pair touched (N = 64, real outlines); 50 of 50 pairs are held apart and never touch."
    )
    open_ended = results({("I", 64): [A] * 30 + [B] * 5 + [UNDECIDED] * 5}, (64,))
    assert answer_sentence(open_ended) == (
        "Of pairs that touch, 86 % [62, 94] stick (N = 64, real outlines); 5 of 40 pairs have no "
        "outcome."
    )


def test_answer_says_how_many_hang_by_their_shapes():
    found = results({("I", 64): [A] * 40 + [B] * 40}, (64,), hooks=10)
    assert "50 % [39, 61] stick, 25 % of them by hooking (N" in answer_sentence(found)


@pytest.mark.parametrize(("stick", "shown"), [(1, "0.1 %"), (999, "99.9 %"), (1000, "100 %")])
def test_answer_rounds_nothing_to_all_or_none(stick, shown):
    found = results({("I", 64): [A] * stick + [B] * (1000 - stick)}, (64,))
    assert f"touch, {shown} [" in answer_sentence(found)


def setting_of(config, **overrides):
    """The sentence of a study that was run with this config."""
    run = {"config": config, "overrides": json.dumps(overrides)}
    return setting_sentence(results({("I", 1): [A]}, (1,), run=run))


@pytest.mark.parametrize(
    ("config", "sentence"),
    [
        (
            "preset = 'clay'",
            "Preset clay: real weight, water of 15 °C and 35 g/kg of salt, surface potential "
            "15 mV, Debye length 0.341 nm, Hamaker constant 2e-20 J.",
        ),
        (
            "preset = 'clay'\n[fluid]\nsalinity = 5.0",
            "Preset clay with your values for fluid: real weight, water of 15 °C and 5 g/kg "
            "of salt, surface potential 15 mV, Debye length 0.959 nm, Hamaker constant 2e-20 J.",
        ),
        (
            "preset = 'si'\n[fluid]\ntemperature = '10 degC'\nionic_strength = '10 mmol/l'",
            "Preset si with your values for fluid and forces: 2650 kg/m³, water of 10 °C and "
            "an ionic strength of 0.01 mol/l, surface potential 15 mV, Debye length 3.06 nm, "
            "Hamaker constant 4.7e-20 J.",
        ),
        ("not TOML", ""),
    ],
)
def test_setting_names_preset_weight_and_water_of_the_config(config, sentence):
    assert setting_of(config) == sentence


def test_setting_says_how_heavy_the_flocs_of_the_paper_are():
    assert setting_of("preset = 'tang2014'").startswith(
        "Preset tang2014: 2 kg/m² of projected area, no buoyancy, water of 0.89 mPa s, surface"
    )


def test_setting_heeds_values_laid_over_the_config():
    found = setting_of("preset = 'tang2014'", preset="clay", fluid={"temperature": 283.15})
    assert (
        "your values for fluid: real weight, water of 10 °C and 35 g/kg of salt, surface" in found
    )


@pytest.mark.parametrize(
    ("potential", "said"),
    [("0.03", "30 mV"), ("'30 mV'", "30 mV"), ("['15 mV', '-40 mV']", "15 mV and -40 mV")],
)
def test_setting_says_the_potential_of_one_body_or_of_two(potential, said):
    found = setting_of(f"preset = 'clay'\n[forces.double_layer]\npotential = {potential}")
    assert f"surface potential {said}, Debye" in found


@pytest.mark.parametrize("config", ["forces = 1", "fluid = 1", "bodies = 'x'", "preset = ['clay']"])
def test_setting_of_a_damaged_config_is_a_sentence(config):
    assert setting_of(config).endswith(".")

"""Every claim holds on results made to fit it, and fails where just it is broken."""

import attrs
import numpy as np
import pytest

from examples.tang2014.claims import check_claims
from examples.tang2014.claims.robust import contradicting
from examples.tang2014.claims.sentences import SENTENCES
from examples.tang2014.claims.table import changed_verdicts, page_table
from tests.helpers.paper_like import DELTA, VERTICES, paper_fits, paper_results, relabelled


def verdicts(results=None, entries=None):
    """{number: verdict}."""
    touches = first_touches() if results and entries else None
    return {each.number: each.verdict for each in check_claims(results, entries, touches)}


def first_touches(thirds=30, alike=600, count=600):
    """Rows of several.py: so many collisions with a third floc, and alone the same outcome."""
    return [
        {"area fraction": fraction, "third": float(k < thirds), "together": 1.0,
         "alone": float(k < alike)}
        for fraction in (0.01, 0.04) for k in range(count)
    ]  # fmt: skip


def failing(results=None, entries=None):
    """The numbers of the claims that fail."""
    return {number for number, verdict in verdicts(results, entries).items() if verdict == "fails"}


def test_all_claims_hold_where_made_to():
    found = verdicts(paper_results(), paper_fits())
    assert list(found) == list(range(1, 27))
    assert set(found.values()) == {"holds"}, found


def test_without_data_nothing_is_decided():
    assert set(verdicts().values()) == {"undecided"}


def sphere_departs(outcome, inside):
    outcome[0, 0, 0, 5] = 1


def small_outside(outcome, inside):
    outcome[2, 1, 4, 7], inside[2, 1, 4, 7] = 3, 0


def no_class_c(outcome, inside):
    chosen = outcome[0, -1, 0]
    chosen[chosen == 2] = 3


def undecided_collision(outcome, inside):
    outcome[1, 1, 1, 0] = 5


def bound_outside(outcome, inside):
    outcome[:2, 1:][outcome[:2, 1:] == 3] = 2


def bound_outside_in_one(outcome, inside):
    outcome[0, 1:, :-1][outcome[0, 1:, :-1] == 3] = 2


def one_condition_stays(outcome, inside):
    outcome[2, 3, 0] = 0


def all_depart_outside(outcome, inside):
    outcome[:2, 1:][outcome[:2, 1:] == 2] = 3


@pytest.mark.parametrize(
    ("change", "broken"),
    [
        (sphere_departs, {6}),
        (small_outside, {7, 10}),
        (no_class_c, {11}),
        (undecided_collision, set()),
        (bound_outside, {11, 15, 16, 17}),
        (all_depart_outside, {11, 15, 17}),
        (bound_outside_in_one, {11, 15, 16, 17, 24}),
        (one_condition_stays, {13}),
    ],
)
def test_a_claim_fails_where_it_is_broken(change, broken):
    assert failing(paper_results(change)) == broken


def test_the_replicates_that_contradict_are_found():
    results = paper_results(small_outside)
    for number, places in ((6, []), (7, [[2, 1, 4, 7]]), (9, []), (10, [[2, 1, 4, 7]])):
        assert np.argwhere(contradicting(results, number)).tolist() == places


@pytest.mark.parametrize(
    ("names", "broken"),
    [
        ({"vertices": (1, *VERTICES[:0:-1])}, {12, 13, 15, 17, 18, 19}),
        ({"delta": DELTA[::-1]}, {11, 12, 13, 15, 19, 23}),
        ({"types": ("II", "I", "III")}, {8, 14, 15, 17, 18, 23}),
        ({"types": ("I", "III", "II")}, {7, 8, 10, 12, 14}),
    ],
)
def test_claims_see_what_is_where(names, broken):
    assert failing(relabelled(paper_results(), **names)) == broken


@pytest.mark.parametrize(
    ("entries", "broken"),
    [
        (paper_fits(sphere=20.0), {1}),
        (paper_fits(sphere=1.0), {1, 2}),
        (paper_fits(scale=30.0), {2, 5, 20}),
        (paper_fits(scale=0.0), {3, 4, 21}),
        (paper_fits(scale=-1.0), {3, 4, 21}),
    ],
)
def test_claims_about_fits_fail_where_broken(entries, broken):
    assert failing(entries=entries) == broken


def refitted(vertices, error, chosen):
    """The fits, of some entries one with another RE."""
    return [
        attrs.evolve(entry, fits=entry.fits | {
            vertices: attrs.evolve(entry.fits[vertices], relative_error=error)
        }) if chosen(entry) else entry for entry in paper_fits()
    ]  # fmt: skip


def test_an_error_that_varies_with_vertices_is_seen():
    entries = refitted(16, 60.0, lambda entry: entry.spheroradius == 2.0)
    assert 22 in failing(entries=entries)


def test_sizes_of_which_most_are_large_are_seen():
    entries = [attrs.evolve(each, equivalent_radius=25.0 / each.equivalent_radius)
               for each in paper_fits()]  # fmt: skip
    assert 25 not in failing(entries=entries)
    entries = [attrs.evolve(each, equivalent_radius=40.0 - each.equivalent_radius)
               for each in paper_fits()]  # fmt: skip
    assert verdicts(entries=entries)[25] == "fails"


def test_swarms_are_judged_by_how_often_and_by_how_a_third_floc_matters():
    def parts(**changes):
        return check_claims(touches=first_touches(**changes))[25].parts

    assert [part.verdict for part in parts(thirds=180)] == ["fails", "fails", "holds", "holds"]
    assert [part.verdict for part in parts(thirds=2)[:2]] == ["holds", "holds"]
    # Two rows each of a third floc do not decide alone.
    assert parts(thirds=2)[3].verdict == "undecided"
    assert parts(thirds=200, alike=300)[2].verdict == "fails"
    assert parts(thirds=0) == ()


def test_one_spheroradius_leaves_its_claim_open():
    found = check_claims(entries=paper_fits(radii=(1.0,)))
    assert found[2].verdict == "undecided"
    assert "--radius 1,2,4" in found[2].note


def first_replicates(count):
    """The Results of just these, which are as random as all."""
    results = paper_results()
    replicates = {name: array[..., :count] for name, array in results.replicates.items()}
    return relabelled(results, replicates=replicates, count=count)


def test_few_replicates_leave_weak_effects_open():
    found = verdicts(first_replicates(30))
    assert "fails" not in found.values()
    assert {13, 17} <= {number for number, verdict in found.items() if verdict == "undecided"}


def test_too_few_replicates_decide_nothing():
    assert set(verdicts(first_replicates(29)).values()) == {"undecided"}


def test_the_table_of_the_page_shows_what_decides_each_claim():
    ways = {
        "one": check_claims(paper_results(bound_outside), paper_fits(), first_touches()),
        "other": check_claims(paper_results()),
    }
    lines = page_table(ways).splitlines()
    assert len(lines) == 2 + 26
    assert lines[2].endswith("**holds** | – |") and SENTENCES[1] in lines[2]
    (outside,) = [line for line in lines if line.startswith("| 15 |")]
    assert "**fails**" in outside and "**holds**" in outside
    assert len(page_table(ways, numbers=(6, 8), quoted=False).splitlines()) == 2 + 2


def test_readings_show_where_their_verdicts_differ():
    readings = {"tang2014": check_claims(paper_results()), "alike": check_claims(paper_results()),
                "other": check_claims(paper_results(small_outside))}  # fmt: skip
    assert changed_verdicts(readings).splitlines()[2:] == [
        "| alike | none |", "| other | (7) fails, (10) fails |"
    ]  # fmt: skip

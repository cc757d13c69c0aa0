"""`flocsim info` tells what a file holds."""

import pytest

from flocsim.__main__ import main
from flocsim.ensembles.contents import info_of
from flocsim.ensembles.pairs.results import CONTENTS
from flocsim.io.shape_library import SHIPPED
from tests.helpers.results_files import write_results
from tests.helpers.small_rates import mixed
from tests.helpers.synthetic_results import make_results


def test_how_many_stick_and_how_many_hang_is_told(tmp_path):
    results = make_results(types=("I",), vertices=(1, 8), delta=(0.0, 0.7))
    write_results(tmp_path / "r.h5", results)
    lines = info_of(tmp_path / "r.h5").splitlines()
    (told,) = [line for line in lines if line.startswith("bonds")]
    held = [int((results.replicates["bond"] == code).sum()) for code in (1, 2, 3)]
    assert min(held) > 0
    assert told.split("  ")[-1].strip() == "{} certificate, {} hook, {} rest".format(*held)
    # And of each condition what share of Pr[A] hangs.
    share = results.probabilities["pr_bond"][0, 0, 0, 1]
    table = CONTENTS.table(results, every=True).splitlines()
    assert "hang" in table[0].split()
    assert f"{share:.3f}" in table[2].split()


@pytest.mark.parametrize("complete", [True, False])
def test_strengths_are_told_and_whether_they_are_complete(tmp_path, complete):
    found = mixed(complete)
    found.write(tmp_path / "s.h5")
    text = info_of(tmp_path / "s.h5")
    assert ("unfinished" in text.splitlines()[0]) is not complete
    told = "4 doublets" if complete else "4 doublets so far; continue with --resume"
    assert f"tested     {told}\n" in text
    assert "2 at 1e-11 m, 1 at 1e-10 m, 1 at 1e-09 m" in text
    assert "1 opened, 1 opens at least rate, 1 holds at most rate, 1 failed" in text
    assert text.splitlines()[-1].split()[:5] == ["III", "1", "0.5", "6", "4"]


@pytest.mark.slow
def test_flocs_of_a_library_are_known_in_water(capsys):
    assert main(["info", str(SHIPPED), "--water"]) == 0
    heading, columns, *rows = capsys.readouterr().out.splitlines()
    assert "24 flocs, as prisms" in heading and columns.split()[:2] == ["floc", "sinks"]
    assert len(rows) == 24
    most, least, turns, b, error = (float(each) for each in rows[0].split()[1:])
    assert 0.6 < least <= most < 1.0 and 0.1 < turns < most and 0.0 <= b < 1.0 and error < 30.0

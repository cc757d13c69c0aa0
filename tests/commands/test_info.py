"""`flocsim info` tells what a file holds."""

from flocsim.commands.info import results_text
from flocsim.io.results.file import read_overview, write_results
from tests.helpers.synthetic_results import make_results


def test_how_many_stick_and_how_many_hang_is_told(tmp_path):
    results = make_results(types=("I",), vertices=(1, 8), delta=(0.0, 0.7))
    write_results(tmp_path / "r.h5", results)
    lines = results_text("r.h5", *read_overview(tmp_path / "r.h5")).splitlines()
    (told,) = [line for line in lines if line.startswith("bonds")]
    held = [int((results.replicates["bond"] == code).sum()) for code in (1, 2, 3)]
    assert min(held) > 0
    assert told.split("  ")[-1].strip() == "{} certificate, {} hook, {} rest".format(*held)
    # And of each condition what share of Pr[A] hangs.
    share = results.probabilities["pr_bond"][0, 0, 0, 1]
    (heads,) = [line.split() for line in lines if line.split()[:2] == ["N", "ta"]]
    row = lines[-4].replace("[", "").replace("]", "").split()
    assert "hang" in heads
    assert f"{share:.3f}"[1:] in row

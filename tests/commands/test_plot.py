"""`flocsim plot` and `flocsim info`, called as the command line calls them."""

import argparse
import os
import shutil
import subprocess
import sys

import attrs
import numpy as np
import pytest

from flocsim.commands import add_command
from flocsim.ensembles.pairs.results import CONTENTS
from flocsim.errors import FileError, UsageError
from flocsim.io.plots.results import FIGURES
from flocsim.io.results.run_group import provenance
from tests.helpers.results_files import write_results
from tests.helpers.synthetic_results import make_results

CONFIG = 'preset = "si"\nseed = 3\n'


def call(command, *words):
    """Parse the words as the `flocsim` command does, and run."""
    parser = argparse.ArgumentParser(prog="flocsim")
    add_command(parser.add_subparsers(), command)
    args = parser.parse_args([command, *map(str, words)])
    return args.run(args)


@pytest.fixture(scope="module")
def written(tmp_path_factory):
    """A results file as an ensemble would leave it."""
    path = tmp_path_factory.mktemp("written") / "study.h5"
    run = provenance(CONFIG, 3) | {"wall_time": 12.345678, "ranks": 2}
    write_results(path, make_results(count=8, run=run))
    return path


@pytest.fixture
def study(written, tmp_path):
    """A copy of it."""
    return shutil.copy(written, tmp_path / "study.h5")


def test_figures_are_drawn_into_a_new_folder(study, capsys, tmp_path):
    folder = tmp_path / "a" / "b"
    assert (
        call("plot", study, "--figures", "4,size", "--output-dir", folder, "--format", "svg") == 0
    )
    printed = capsys.readouterr().out.split("\n")[:-1]
    names = ["study-figure-4.svg", "study-size.svg"]
    assert printed == [str(folder / name) for name in names]
    assert sorted(os.listdir(folder)) == names


@pytest.mark.slow
@pytest.mark.parametrize(
    ("words", "names"),
    [((), ["outcomes", "overview", "4", "5", "6", "8"]), (("--figures", "all"), list(FIGURES))],
)
def test_the_default_set_is_what_the_help_says(words, names, capsys, in_tmp):
    write_results("small.h5", make_results(types=("I",), vertices=(1,), delta=(0.0,), count=8))
    assert call("plot", "small.h5", *words) == 0
    labels = [f"figure-{name}" if name.isdigit() else name for name in names]
    assert capsys.readouterr().out.split() == [f"small-{label}.png" for label in labels]
    if not words:
        with pytest.raises(SystemExit):
            call("plot", "--help")
        assert ",".join(names) in capsys.readouterr().out


@pytest.mark.slow
def test_chosen_figures_go_to_the_current_folder(study, capsys, in_tmp):
    assert call("plot", "study.h5", "--figures", "overview, 8,8") == 0
    assert capsys.readouterr().out == "study-overview.png\nstudy-figure-8.png\n"
    assert (in_tmp / "study-overview.png").read_bytes().startswith(b"\x89PNG")


@pytest.mark.parametrize("figures", ["7", "4,figure", "", ","])
def test_unknown_figures_are_refused(study, figures):
    with pytest.raises(UsageError, match=f"no figure '.*', only {', '.join(FIGURES)}"):
        call("plot", study, "--figures", figures)


def test_an_impossible_folder_is_told(study):
    with pytest.raises(FileError, match="--output-dir"):
        call("plot", study, "--output-dir", study)


def facts_printed(text):
    """The lines of `flocsim info` as a dict of name and value."""
    pairs = (line.split("  ", 1) for line in text.splitlines() if "  " in line)
    return {name: value.strip() for name, value in pairs if name}


def test_info_tells_conditions_and_origin(study, capsys):
    assert call("info", study) == 0
    text = capsys.readouterr().out
    facts = facts_printed(text)
    assert facts["vertices"] == "1 (sphere), 4, 16, 64"
    assert facts["delta / delta_max"] == "0, 0.25, 0.5, 0.75, 1"
    assert facts["replicates"] == "8 in each of 60 conditions"
    assert facts["numpy version"] == np.__version__
    assert facts["wall time"] == "12.3457 s"
    assert facts["seed"] == "3"
    assert CONFIG not in text
    made = make_results(count=8)
    a, failed, undecided = (int(np.sum(made.replicates["outcome"] == code)) for code in (0, 6, 5))
    assert facts["outcomes"].startswith(f"{a} A, ")
    assert f"{undecided} undecided, {failed} failed" in facts["outcomes"]
    checked, flipped = (made.probabilities[name].sum() for name in ("n_checked", "n_flipped"))
    assert f"Numerical error: {flipped} of {checked} re-runs changed its outcome" in text


def test_info_ends_with_the_table_of_probabilities(study, capsys):
    call("info", study)
    table = CONTENTS.table(make_results(count=8))
    assert capsys.readouterr().out.endswith(f"\n\n{table}\n")


def test_columns_of_numerics_are_there_when_asked_for_or_large(study, capsys):
    results = make_results(count=8)
    changes = {f"{name}_change_{end}": np.zeros(results.shape)
               for name in ("pr_a", "pr_inside") for end in ("low", "high")}  # fmt: skip
    for error, heads in ((0.0, ["", "numerics Pr[A]"]), (0.9, ["numerics Pr[A]"] * 2)):
        some = {f"{n}_numerical": np.full(results.shape, error) for n in ("pr_a", "pr_inside")}
        table = results.probabilities | some
        changed = attrs.evolve(results, probabilities=table, numerics=changes)
        for asked, head in zip((False, True), heads, strict=True):
            text = CONTENTS.table(changed, numerics=asked)
            (first,) = [line for line in text.splitlines() if "Pr[A] [" in line]
            assert ("numerics" in first) == bool(head) and head in first
    call("info", study, "--all")
    (heads,) = [line for line in capsys.readouterr().out.splitlines() if "Pr[A] [" in line]
    assert heads.split()[-1] == "failed" and "other" not in heads


def test_info_gives_the_config_back_exactly(study, capsys):
    assert call("info", study, "--config") == 0
    assert capsys.readouterr().out == CONFIG


def test_info_without_config_text(tmp_path, capsys):
    write_results(tmp_path / "bare.h5", make_results(count=2, run={}))
    assert call("info", tmp_path / "bare.h5") == 0
    assert "preset" not in capsys.readouterr().out
    with pytest.raises(FileError, match="no config"):
        call("info", tmp_path / "bare.h5", "--config")


def test_the_parsers_load_nothing_heavy():
    code = (
        "import argparse, sys\n"
        "from flocsim.commands import add_command\n"
        "s = argparse.ArgumentParser().add_subparsers()\n"
        "add_command(s, 'info'), add_command(s, 'plot')\n"
        "print([m for m in ('h5py', 'matplotlib') if m in sys.modules])"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"

"""The command `flocsim ensemble` without a launcher: options, messages, exit codes."""

import subprocess
import sys

import numpy as np
import pytest

from flocsim.__main__ import main
from flocsim.ensembles import cli
from flocsim.io.results.file import read_results
from tests.helpers.results_files import same_data
from tests.helpers.small_study import problems, run_command, write_small, write_star_library
from tests.helpers.waiting import PATIENCE


def call(capsys, *words):
    """(exit code, output, errors) of the command, run in this process."""
    code = main(["ensemble", *map(str, words)])
    return code, *capsys.readouterr()


def failure(capsys, *words):
    """(exit code, the one line of errors) of a command that stops before it runs anything."""
    code, output, errors = call(capsys, *words)
    assert output == ""
    [line] = errors.splitlines()
    return code, line


def test_a_run_prints_its_table_and_writes_its_file(folder, capsys):
    code, output, errors = call(capsys, "small.toml")
    assert code == 0
    assert errors == ""
    lines = output.splitlines()
    assert lines[0].startswith("12 replicates: 2 types x 1 vertex count x 2 displacements")
    assert "type I: r_i = 16.41 µm, r_j = 23.02 µm" in lines
    assert lines[-1].startswith("small.h5: 12 replicates, of which 12 were run now, in ")
    assert read_results(folder / "small.h5").replicates["outcome"].shape == (2, 1, 2, 3)


def test_quiet_prints_nothing_but_warnings(folder, capsys):
    heavier = ("--set", "bodies.surface_density=3")
    code, output, errors = call(capsys, "small.toml", "--quiet", *heavier)
    assert (code, output, problems(errors)) == (0, "", [])
    assert errors.startswith("flocsim: warning: a body of r_eq = 23.02 um")
    assert (folder / "small.h5").exists()


def test_options_replace_the_configs_values(folder, capsys):
    words = ["--seed", 9, "--replicates", 2, "--output", "other.h5", "--quiet"]
    code, output, errors = call(capsys, "small.toml", *words)
    assert (code, output, problems(errors)) == (0, "", [])
    assert not (folder / "small.h5").exists()
    results = read_results(folder / "other.h5")
    assert results.replicates["outcome"].shape[-1] == 2
    assert results.run["seed"] == 9
    # The same as a config that says so itself.
    write_small(folder, name="same.toml", vertices="[1]", seed=9, replicates=2)
    assert call(capsys, "same.toml", "--quiet")[0] == 0
    assert same_data(folder / "small.h5", folder / "other.h5") == []


def test_a_dry_run_says_what_would_happen_and_writes_nothing(folder, capsys):
    code, output, errors = call(capsys, "small.toml", "--dry-run", "--verbose", "-o", "no/where.h5")
    assert (code, errors) == (0, "")
    assert output.startswith("12 pairs: 4 conditions of 3 replicates, seed 1, on 1 rank; ")
    for said in ("D_0 = 45.35 um", "settling alone: i 60.29 mm/s", "in:  StokesDrag(",
                 "nothing was run (--dry-run)"):  # fmt: skip
        assert said in output
    assert [path.name for path in folder.iterdir()] == ["small.toml"]


def test_a_dry_run_names_what_is_left_out(folder, capsys):
    write_small(folder, name="weak.toml", text=(folder / "small.toml").read_text()
                + '[zone]\ndistance = "1 um"\n[forces.van_der_waals]\nhamaker = 0\n')  # fmt: skip
    code, output, _ = call(capsys, "weak.toml", "--dry-run", "--verbose")
    assert code == 0
    assert "out: VanDerWaals: " in output


WRONG = [
    ({}, ["--output", "."], 74, ". is not an ordinary file"),
    ({}, ["--output", "no/folder.h5"], 74, "no/folder.h5 could not be written: No such file"),
    ({}, ["--output", "small.toml"], 2, "writing small.toml would replace small.toml"),
    ({}, ["--output", ""], 2, "output.file must be a string that is not blank"),
    ({}, ["--seed", -1], 2, "seed must be an integer from 0"),
    ({}, ["--replicates", 0], 2, "replicates must be an integer from 1"),
    ({"replicates": "="}, [], 2, "small.toml:3: not valid TOML"),
    ({"pool": 'pool = "many"'}, [], 2, "small.toml:9: "),
    ({"preset": '"tang2014-literal"'}, [], 2, "no attraction zone"),
    ({"types": '["I"]\npairs = [[1e-5, 2e-5]]'}, [], 2, "excludes"),
    ({"vertices": "[1, 4]\nradius = 4.7e-6"}, [], 2,
     "leaves no room for a core in a body of r_eq = 4.62e-06 m"),
    ({"vertices": '[4]\nsource = "library"\nfile = "small.toml"'}, [], 74,
     "flocsim: small.toml is not an HDF5 file"),
]  # fmt: skip


@pytest.mark.parametrize(("changes", "words", "code", "said"), WRONG)
def test_what_is_wrong_is_one_line(folder, capsys, changes, words, code, said):
    write_small(folder, **({"vertices": "[1]"} | changes))
    found, line = failure(capsys, "small.toml", *words)
    assert found == code
    assert said in line


MORE = [
    ('[integrator]\nname = "implicite"', "found 'implicite' (did you mean 'implicit'?)"),
    ('[integrator]\nname = "velocity_verlet"', "needs step, the fixed step"),
    ("[forces]\ndrag = false", "no terminal velocity"),
    ("[forces]\ncontact = false", "colliding bodies need a contact force"),
    ("[forces]\ngravity = false", "settle at the same speed"),
]


@pytest.mark.parametrize(("more", "said"), MORE)
@pytest.mark.parametrize("words", [[], ["--dry-run"]], ids=["run", "dry run"])
def test_a_study_that_cannot_be_run_says_so_before_it_starts(folder, capsys, more, said, words):
    path = folder / "small.toml"
    path.write_text(f"{path.read_text()}{more}\n")
    code, line = failure(capsys, "small.toml", *words)
    assert code == 2
    assert said in line


def test_bodies_that_never_meet_are_found_out(folder, capsys):
    path = folder / "small.toml"
    pairs = 'pairs = [["20 um", "10 um"]]'
    path.write_text(path.read_text().replace('types = ["I", "III"]', pairs))
    code, line = failure(capsys, "small.toml")
    assert code == 2
    assert "(above) settles at 36.74 mm/s and never reaches the receiving" in line


@pytest.mark.parametrize("ranks", [None, pytest.param(2, marks=pytest.mark.slow)])
def test_a_library_without_the_wanted_number_of_vertices(folder, ranks):
    write_star_library(folder / "stars.h5", vertices=(4, 8))
    write_small(folder, vertices='[1, 4, 16]\nsource = "library"\nfile = "stars.h5"', pool=10)
    done = run_command(folder, "small.toml", ranks=ranks)
    assert (done.returncode, done.stdout) == (2, "")
    [line] = done.stderr.splitlines()
    assert "asks for N = 16, but stars.h5 holds N = 4, 8: fit again" in line


def test_no_config_is_not_a_traceback(folder, capsys):
    assert failure(capsys, "other.toml") == (
        2,
        "flocsim: other.toml: no such file; `flocsim init other.toml` writes one",
    )
    code, line = failure(capsys, ".")
    assert code == 2
    assert "Is a directory" in line


@pytest.mark.parametrize("words", [[], ["small.toml", "--seed", "x"], ["small.toml", "--bogus"]])
def test_wrong_arguments_end_with_2(folder, capsys, words):
    with pytest.raises(SystemExit) as caught:
        main(["ensemble", *words])
    assert caught.value.code == 2
    assert "flocsim ensemble: error: " in capsys.readouterr().err


@pytest.mark.parametrize(
    ("error", "code", "said"),
    [
        (KeyboardInterrupt, 130, "flocsim: interrupted; continue with --resume\n"),
        (MemoryError, 70, "flocsim: out of memory: use fewer ranks on each machine\n"),
        (ZeroDivisionError, 70, "flocsim: internal error, please report it:\nTraceback"),
    ],
)
def test_other_ends(folder, capsys, monkeypatch, error, code, said):
    def end(*_):
        raise error

    monkeypatch.setattr(cli, "study", end)
    found, output, errors = call(capsys, "small.toml")
    assert (found, output, errors[: len(said)]) == (code, "", said)


def test_the_module_is_a_command(folder):
    done = run_command(folder, "small.toml", "--replicates", 1, "--quiet")
    assert (done.returncode, done.stdout, problems(done.stderr)) == (0, "", [])
    outcome = read_results(folder / "small.h5").replicates["outcome"]
    assert np.all(outcome[:, :, 0] == 0)


def test_help_is_quick_and_loads_no_numba(folder):
    code = "import sys; from flocsim.__main__ import main\ntry:\n    main(['ensemble', '--help'])\n"
    code += "finally:\n    print({'numba', 'h5py', 'matplotlib'} & set(sys.modules))"
    done = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, timeout=PATIENCE
    )
    assert done.stdout.endswith("set()\n")

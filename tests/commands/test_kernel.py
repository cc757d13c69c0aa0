"""`flocsim kernel`, end to end: run, resume, ranks, info, figures, tables."""

import numpy as np
import pytest

import flocsim
from flocsim.__main__ import main
from flocsim.hydrodynamics import encounters
from flocsim.io.results.file import read_results
from tests.helpers.kernel_study import kernel_text
from tests.helpers.results_files import same_data
from tests.helpers.tiers import rest_slow

SHEAR = {
    "meeting": '["shear"]',
    "scene": 'rate = "10 1/s"',
    "more": "[forces]\nvan_der_waals = false\ndouble_layer = false",
    "replicates": 8,
    "scrambles": 2,
}


@pytest.fixture
def folder(in_tmp):
    (in_tmp / "kernel.toml").write_text(kernel_text(**SHEAR), "utf-8")
    return in_tmp


def test_a_study_is_run_described_drawn_and_exported(folder, capsys):
    both = SHEAR | {"meeting": '["settling", "shear"]'}
    (folder / "kernel.toml").write_text(kernel_text(**both), "utf-8")
    assert main(["kernel", "kernel.toml"]) == 0
    told = capsys.readouterr().out
    assert "settling, N = 1" in told and "shear, N = 1" in told
    assert "upper bounds" in told and "no hydrodynamic interaction" in told
    assert "60.00" in told, "the width 2R of 10 and 20 um"
    assert main(["info", "kernel.h5"]) == 0
    assert "upper bounds" in capsys.readouterr().out
    assert main(["plot", "kernel.h5"]) == 0
    assert main(["export", "csv", "kernel.h5"]) == 0
    assert main(["export", "matrix", "kernel.h5", "--model", "flocmod"]) == 0
    printed = capsys.readouterr().out.split()
    assert printed == [
        "kernel-kernels.png", "kernel-efficiency.png",
        "kernel-kernel.csv", "kernel-probabilities.csv", "kernel-replicates.csv",
        "kernel-settling-N1-efficiency-flocmod.csv", "kernel-shear-N1-efficiency-flocmod.csv",
    ]  # fmt: skip
    assert all((folder / name).stat().st_size > 200 for name in printed)
    assert main(["export", "matrix", "kernel.h5", "--curvilinear", "burd"]) == 0
    printed = capsys.readouterr().out.split()
    assert printed == [
        "kernel-settling-N1-efficiency-spheres-burd.csv",
        "kernel-shear-N1-efficiency-spheres-burd.csv",
    ]
    assert "1 - (1 + 5p + 2.5p^2)/(1 + p)^5" in (folder / printed[1]).read_text("utf-8")
    assert main(["export", "csv", "kernel.h5", "--curvilinear", "burd"]) == 2
    assert "--curvilinear is for matrices, not csv" in capsys.readouterr().err
    words = ["export", "matrix", "kernel.h5", "--what", "beta3", "--curvilinear", "burd"]
    assert main(words) == 2
    assert "not beta3: use efficiency" in capsys.readouterr().err
    kernel = flocsim.open("kernel.h5").kernel
    assert kernel.arrays["width_c"][0, 0, 0, 1] == pytest.approx(6e-5, rel=1e-12)


def test_a_mechanism_without_a_factor_is_named(folder, capsys):
    text = kernel_text(**SHEAR | {"meeting": '["shear", "extension"]'})
    (folder / "kernel.toml").write_text(text, "utf-8")
    assert main(["kernel", "kernel.toml", "--quiet"]) == 0
    capsys.readouterr()
    assert main(["export", "matrix", "kernel.h5", "--curvilinear", "hill"]) == 0
    told = capsys.readouterr()
    assert told.out.split() == ["kernel-shear-N1-efficiency-spheres-hill.csv"]
    assert told.err.count("\n") == 1 and "hill has no curvilinear factor for extension" in told.err


@pytest.mark.parametrize(
    ("meeting", "sizes", "known"),
    rest_slow(
        [
            (["shear"], ["5 um"], {"shear:5um-5um": 0.257}),
            (
                ["settling", "shear"], ["5 um", "10 um"],
                {"settling:5um-10um": None, "shear:5um-5um": 0.257, "shear:5um-10um": None,
                 "shear:10um-10um": 0.159},
            ),
        ],
        lambda meeting, sizes, known: False,
    ),
)  # fmt: skip
def test_equivalent_spheres_are_known_in_water(folder, monkeypatch, capsys, meeting, sizes, known):
    """``known``: alpha of quartz in water at 10 1/s; by steps as long as 2 % allow."""
    monkeypatch.setattr(encounters, "STEP", 3.0 * encounters.STEP)
    monkeypatch.setattr(encounters, "SMOOTHNESS", 3.0 * encounters.SMOOTHNESS)
    changes = {"more": "[forces]\ndouble_layer = false", "meeting": meeting, "sizes": sizes}
    (folder / "kernel.toml").write_text(kernel_text(**SHEAR | changes), "utf-8")
    assert main(["kernel", "kernel.toml", "--quiet"]) == 0
    assert main(["info", "kernel.h5", "--water"]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert [line.partition(": equivalent")[0] for line in lines] == list(known)
    for line, alpha in zip(lines, known.values(), strict=True):
        assert alpha is None or float(line.split()[4]) == pytest.approx(alpha, rel=0.02)
    assert main(["export", "matrix", "kernel.h5"]) == 0
    assert main(["export", "matrix", "kernel.h5", "--curvilinear", "spheres"]) == 0
    names = capsys.readouterr().out.split()
    assert names[-1] == "kernel-shear-N1-efficiency-spheres-spheres.csv"
    of_shear = names[len(meeting) - 1 :: len(meeting)]
    plain, wet = (np.genfromtxt(name, delimiter=",")[-len(sizes) :, 1:] for name in of_shear)
    # Of spheres the product is what touches in water, closed in the plane as the efficiency is.
    ratio = wet / plain
    assert ratio == pytest.approx(ratio.T) and ratio[0, 0] == pytest.approx(0.257 / 1.124, rel=0.02)
    assert "Jeffrey and Onishi" in (folder / names[-1]).read_text("utf-8")


def test_spheres_too_unlike_for_water_are_refused_in_one_line(folder, capsys):
    sizes = "scene.sizes=['1 um', '60 um']"
    (folder / "kernel.toml").write_text(kernel_text(), "utf-8")
    assert main(["kernel", "kernel.toml", "--quiet", "--set", sizes]) == 0
    capsys.readouterr()
    for command in ("info kernel.h5 --water", "export matrix kernel.h5 --curvilinear spheres"):
        assert main(command.split()) == 2
        told = capsys.readouterr().err
        assert "0.02 to 50 times each other, found 60" in told and told.count("\n") == 1


def test_more_points_extend_a_study_as_if_run_at_once(folder):
    assert main(["kernel", "kernel.toml", "--quiet"]) == 0
    assert main(["kernel", "kernel.toml", "--quiet", "--replicates", "16", "--resume"]) == 0
    assert main(["kernel", "kernel.toml", "--quiet", "--replicates", "16", "-o", "b.h5"]) == 0
    assert not same_data("kernel.h5", "b.h5"), "nothing differs"
    assert read_results("b.h5").count == 16


@pytest.mark.slow
def test_another_scramble_is_another_study(folder, capsys):
    assert main(["kernel", "kernel.toml", "--quiet"]) == 0
    words = ["kernel", "kernel.toml", "--quiet", "--resume", "--set", "scene.scrambles=8"]
    assert main(words) == 2
    assert "scene.scrambles" in capsys.readouterr().err


def test_what_is_no_kernel_study_is_refused(folder, capsys):
    (folder / "two.toml").write_text('preset = "si"\nreplicates = 1\n', "utf-8")
    assert main(["kernel", "two.toml"]) == 2
    assert 'kind = "kernel"' in capsys.readouterr().err
    assert main(["kernel", "kernel.toml", "--replicates", "30"]) == 2
    assert "times a power of 2" in capsys.readouterr().err


def test_a_file_without_rates_has_no_matrices(folder, capsys):
    text = 'preset = "si"\nreplicates = 1\n[scene]\ntypes = ["I"]\ndelta = [0.0]\n'
    (folder / "two.toml").write_text(text + "[shapes]\nvertices = [1]\n", "utf-8")
    assert main(["ensemble", "two.toml", "--quiet"]) == 0
    assert main(["export", "matrix", "two.h5"]) == 2
    assert "two.h5 is not from a kernel study" in capsys.readouterr().err


def test_a_dry_run_says_what_would_be_run(folder, capsys):
    assert main(["kernel", "kernel.toml", "--dry-run"]) == 0
    assert "shear:10um-20um" in capsys.readouterr().out


@pytest.mark.slow
def test_a_replicate_can_be_looked_at(folder, capsys):
    assert main(["kernel", "kernel.toml", "--quiet"]) == 0
    words = "trajectory kernel.toml --type shear:10um-20um --delta 1 --replicate 3 -o a.png"
    assert main(words.split()) == 0
    row = read_results("kernel.h5").replicates["outcome"][1, 0, 0, 3]
    told = capsys.readouterr().out
    assert ("missed" in told) == (row == 4)
    assert np.isfinite(read_results("kernel.h5").kernel.arrays["beta3"]).all()


@pytest.fixture
def cut_short(in_tmp):
    """The current folder, with a study that has too few steps to decide anything."""
    about = {"preset": "tang2014", "meeting": '["shear"]', "scene": 'rate = "10 1/s"',
             "sizes": '["5 um", "8 um"]', "more": "[integrator]\nmax_steps = 15",
             "replicates": 8, "scrambles": 2}  # fmt: skip
    (in_tmp / "kernel.toml").write_text(kernel_text(**about), "utf-8")
    return in_tmp


@pytest.mark.slow
def test_rates_that_are_left_open_have_a_code_of_their_own(cut_short, capsys):
    assert main(["kernel", "kernel.toml", "--quiet"]) == 65
    [line] = [each for each in capsys.readouterr().err.splitlines() if "undecided" in each]
    assert "rates have no estimate" in line and "raise integrator.max_steps" in line
    assert main(["info", "kernel.h5"]) == 0 and line[17:80] in capsys.readouterr().out
    assert main(["plot", "kernel.h5"]) == 0
    assert main(["export", "matrix", "kernel.h5"]) == 0
    assert (
        "an empty cell is unknown"
        in (cut_short / "kernel-shear-N1-efficiency-spheres.csv").read_text()
    )


@pytest.mark.slow
def test_rates_that_are_left_open_are_warned_of(cut_short):
    with pytest.warns(flocsim.errors.PlausibilityWarning, match="rates have no estimate"):
        again = flocsim.Study("kernel.toml").run(output="again.h5")
    assert np.isnan(again.kernel.arrays["beta2"]).all()

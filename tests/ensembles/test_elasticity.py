"""Elasticities of Pr[A]: differences of two studies on the same draws over a logarithm."""

import math

import numpy as np
import pytest

import flocsim
from flocsim.__main__ import main
from flocsim.ensembles.script_study import Study
from flocsim.ensembles.sweep import elasticities
from tests.helpers import parts_here
from tests.helpers.small_study import write_small

KEYS = ("forces.contact.k_n", "forces.van_der_waals.hamaker")


@pytest.fixture(scope="module")
def config(tmp_path_factory):
    """A study of few replicates."""
    folder = tmp_path_factory.mktemp("elasticity")
    return write_small(folder, replicates=6, types='["III"]', delta="[0.0]", vertices="[1]")


@pytest.mark.slow
def test_an_elasticity_is_the_paired_difference_over_the_logarithm(config, tmp_path, monkeypatch):
    parts_here.use(monkeypatch)
    found = elasticities(Study(config), KEYS, tmp_path / "e.png", ratio=4.0)
    assert found.keys == KEYS and found.value.shape == (2, 1, 1, 1)
    for k, key in enumerate(KEYS):
        folder = tmp_path / f"e-{key.replace('.', '-')}.parts"
        first, second = (flocsim.open(folder / f"000{number}.h5") for number in (0, 1))
        compared = flocsim.compare(first, second).arrays["pr_a"]
        value = compared["difference"] / math.log(4.0)
        np.testing.assert_array_equal(found.value[k], value)
        np.testing.assert_array_equal(found.low[k], compared["difference_low"] / math.log(4.0))
        ends = [each.stored("identity")[f"{key}"] for each in (first, second)]
        assert ends[1] / ends[0] == pytest.approx(4.0)
        assert math.sqrt(ends[0] * ends[1]) == pytest.approx(found.values[k])
    assert KEYS[0] in found.table()


def test_the_command_prints_a_table_writes_a_figure_and_goes_on(
    config, tmp_path, monkeypatch, capsys
):
    parts_here.use(monkeypatch)
    words = ["sweep", str(config), "--elasticities", KEYS[0], "-o", str(tmp_path / "f.svg")]
    assert main(words) == 0
    told = capsys.readouterr().out
    assert "dPr[A]/dln p" in told and (tmp_path / "f.svg").read_text().startswith("<?xml")
    assert main([*words, "--resume"]) == 0
    assert told.splitlines()[-3:] == capsys.readouterr().out.splitlines()[-3:]


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["--elasticities", "forces.contact.nothing"], "forces.contact.nothing"),
        (["--elasticities", "scene.receiver"], "its value is 'free'"),
        (["--elasticities", "seed"], "cannot be swept"),
        (["--elasticities", "forces.contact.k_n", "--ratio", "1"], "must be above 1"),
        (["--elasticities", "forces.contact.k_n", "--over", "seed=1,2"], "needs one of"),
        ([], "needs one of"),
        (["--over", "forces.contact.k_n=1,2", "--ratio", "2"], "--ratio is for"),
    ],
)
def test_what_has_no_elasticity_is_said(config, tmp_path, monkeypatch, capsys, words, said):
    monkeypatch.chdir(tmp_path)
    assert main(["sweep", str(config), *words]) == 2
    assert said in capsys.readouterr().err
    assert not any(path.suffix in (".h5", ".png") for path in tmp_path.iterdir())

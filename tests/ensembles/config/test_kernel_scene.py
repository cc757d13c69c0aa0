"""[scene] kind = "kernel": which pairs of classes there are, and what is refused in one line."""

import pytest

from flocsim.ensembles.config.loader import load_any_config, load_config
from flocsim.errors import ConfigError
from tests.helpers.kernel_study import kernel_config, kernel_text


def refused(folder, **changes):
    with pytest.raises(ConfigError) as error:
        kernel_config(folder, **changes)
    return str(error.value)


def test_all_pairs_of_classes_meet_by_all_mechanisms_but_equal_settlers(tmp_path):
    scene = kernel_config(
        tmp_path, meeting='["settling", "shear"]', scene='rate = "5 1/s"'
    ).scene  # fmt: skip
    assert scene.names == (
        "settling:10um-20um", "shear:10um-10um", "shear:10um-20um", "shear:20um-20um",
    )  # fmt: skip
    assert scene.conditions == ((0, 0, 1), (1, 0, 0), (1, 0, 1), (1, 1, 1))
    assert [scene.meeting_of(k) for k in range(4)] == ["settling", *["shear"] * 3]
    assert dict(scene.given)["shear:10um-20um"] == (1e-5, 2e-5)
    assert scene.rate == 5.0


def test_one_mechanism_may_be_a_word(tmp_path):
    assert kernel_config(tmp_path, meeting='"settling"').scene.meeting == ("settling",)


def test_replicates_are_4096_where_nothing_is_said(tmp_path):
    path = tmp_path / "kernel.toml"
    path.write_text(kernel_text(scrambles=8).replace("replicates = 32\n", ""), "utf-8")
    assert load_any_config(path).replicates == 4096


def test_measured_classes_have_their_pairs(tmp_path):
    text = kernel_text(more='source = "library"\nfile = "synthetic"', vertices="[16]")
    text = text.replace('sizes = ["10 um", "20 um"]', 'pairs = "measured"\nclasses = 2')
    path = tmp_path / "kernel.toml"
    path.write_text(text, "utf-8")
    config = load_any_config(path)
    assert config.scene.names == ("settling:q1-q1", "settling:q1-q2", "settling:q2-q2")
    assert config.shapes.size == "own"


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"meeting": '"shear"'}, 'needs rate, the rate of the flow, as in rate = "10 1/s"'),
        ({"scene": 'rate = "1 1/s"'}, "rate: applies only with meeting = 'shear' or 'extension'"),
        ({"meeting": '"brownian"'}, "must be"),
        ({"replicates": 33}, "scene.scrambles = 4 times a power of 2"),
        ({"replicates": 24}, "found 24, give 16 or 32"),
        ({"sizes": '["20 um", "10 um"]'}, "ascending"),
        ({"sizes": '["20 um"]'}, "settle equally fast"),
        ({"scene": 'receiver = "fixed"'}, "receiver: applies only with kind = 'binary': remove it"),
        ({"scene": "delta = [0.0]"}, "delta"),
        ({"more": "[stop]\nhalf_width = 0.1"}, "stop.half_width"),
        ({"more": "[fluid]\ngradient = [0.0, 1.0, 0.0, 0.0]"}, "fluid.gradient"),
        ({"scene": 'pairs = "measured"'}, "sizes"),
        ({"scene": "far = 0.0"}, "far"),
    ],
)
def test_contradictions_are_refused(tmp_path, changes, words):
    assert words in refused(tmp_path, **changes)


def test_two_bodies_may_meet_in_a_flow(tmp_path):
    path = tmp_path / "study.toml"
    path.write_text('preset = "si"\n[scene]\nmeeting = "shear"\nrate = "3 1/s"\n', "utf-8")
    scene = load_config(path).scene
    assert (scene.meeting, scene.rate) == ("shear", 3.0)

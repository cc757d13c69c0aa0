"""law = "outline" in a config: where it goes, and where it is refused."""

import pytest

from flocsim.errors import ConfigError
from tests.helpers.small_study import load_text

SETTLING = """
preset = "si"
[scene]
types = ["III"]
[forces.van_der_waals]
law = "outline"
depth = "5 um"
wavelength = "100 nm"
"""


def test_it_goes_with_pairs_that_settle(tmp_path):
    [force] = [
        each
        for each in load_text(tmp_path, SETTLING).forces
        if type(each).__name__ == "VanDerWaals"
    ]
    assert (force.acts_on, force.depth, force.wavelength) == ("outlines", 5e-6, 1e-7)


TURNED = """
import attrs, math
from flocsim.forces import OrientedForce

@attrs.frozen
class Faces(OrientedForce):
    @staticmethod
    def kernel(pair):
        return 1e-19 * math.cos(pair.angle_i) / (1.0 + pair.centre_distance)
"""


@pytest.mark.parametrize(
    ("scene", "words"),
    [
        ("", ""),
        ('meeting = "extension"\nrate = 10.0', "Faces depends on the angles of the bodies, which"),
    ],
)
def test_so_do_forces_that_ask_how_bodies_are_turned(tmp_path, scene, words):
    (tmp_path / "faces_turned.py").write_text(TURNED)
    text = f'preset = "si"\n[scene]\n{scene}\n[forces.faces]\nclass = "faces_turned:Faces"\n'
    if words:
        with pytest.raises(ConfigError, match=words):
            load_text(tmp_path, text)
    else:
        assert load_text(tmp_path, text).forces[-1].acts_on == "orientations"


@pytest.mark.parametrize(
    ("scene", "more", "words"),
    [
        ('meeting = "extension"\nrate = 10.0', "", "only settling pairs can have"),
        ('meeting = "brownian"', '[forces.thermal]\ntemperature = "298 K"', "only settling pairs"),
        ("", '[forces.thermal]\ntemperature = "298 K"', "cannot be combined with"),
    ],
)
def test_elsewhere_it_is_refused(tmp_path, scene, more, words):
    text = SETTLING.replace("[scene]\n", f"[scene]\n{scene}\n") + more
    with pytest.raises(ConfigError, match=words):
        load_text(tmp_path, text)

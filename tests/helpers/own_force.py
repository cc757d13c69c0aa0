"""A study with a force of a user's own, in two modules beside the config."""

from tests.helpers.small_study import SMALL, write_small

OWN = """\
import attrs
from flocsim.forces import CentreForce
from neighbour import FACTOR


@attrs.frozen
class Pull(CentreForce):
    @staticmethod
    def kernel(pair):
        return FACTOR * 1e-9
"""
OWN_STUDY = SMALL + '[forces.mine]\nclass = "own_pull:Pull"\n'


def write_own(folder, factor="-1.0"):
    """The small study with a force of its own, whose module imports one beside it."""
    (folder / "own_pull.py").write_text(OWN)
    (folder / "neighbour.py").write_text(f"FACTOR = {factor}\n")
    return write_small(folder, OWN_STUDY, vertices="[1]", replicates="5")

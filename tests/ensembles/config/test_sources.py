"""Files are read once: a config made of what was read is the same, whatever became of them."""

import os
import sys

import pytest

from flocsim.ensembles.config.loader import load_config
from flocsim.ensembles.config.sources import Sources
from tests.helpers.own_force import write_own


@pytest.fixture
def forgotten():
    """Forget the modules of one's own before and after."""

    def forget():
        for name in ("own_pull", "neighbour"):
            sys.modules.pop(name, None)

    forget()
    yield forget
    forget()


def factor_of(config):
    """The number that the kernel reads."""
    return config.forces[-1].kernel.__globals__["FACTOR"]


def test_what_was_handed_out_is_used_whatever_the_files_say_by_now(tmp_path, forgotten):
    path = write_own(tmp_path)
    sources = Sources()
    first = load_config(path, sources=sources)
    assert set(sources.modules) == {"own_pull.py", "neighbour.py"}
    forgotten()
    write_own(tmp_path, "+7.0")
    path.write_text(path.read_text().replace("seed = 1", "seed = 9"))
    (tmp_path / "own_pull.py").unlink()
    again = load_config(path, sources=sources)
    assert (again.seed, factor_of(again), again.text) == (1, -1.0, first.text)


def test_an_edited_neighbour_is_read_anew_within_the_same_second(tmp_path, forgotten):
    for factor in ("-1.0", "-2.0"):  # of one length
        path = write_own(tmp_path, factor)
        assert factor_of(load_config(path)) == float(factor)
        forgotten()


def test_only_modules_below_the_config_are_handed_out(tmp_path, forgotten):
    write_own(tmp_path)
    (tmp_path / "neighbour.py").write_text("import colorsys, pack.inner\nFACTOR = 1.0\n")
    (tmp_path / "pack").mkdir()
    (tmp_path / "pack" / "__init__.py").write_text("")
    (tmp_path / "pack" / "inner.py").write_text("x = 1\n")
    sources = Sources()
    load_config(tmp_path / "small.toml", sources=sources)
    inner = {os.path.join("pack", "__init__.py"), os.path.join("pack", "inner.py")}
    assert set(sources.modules) == {"own_pull.py", "neighbour.py", *inner}

"""A figure of flocsim's is told from a photograph, and from one that was touched up by hand."""

import io
import xml.etree.ElementTree as ElementTree

import numpy as np
import pytest
from PIL import Image, ImageSequence

from flocsim.io.outputs import PLACES, is_marked, is_own, marked
from flocsim.io.plots.collision import draw_distance
from flocsim.io.plots.style import FORMATS, save


@pytest.fixture(scope="module")
def figures(tmp_path_factory):
    """A folder with figure.png, .pdf and .svg as flocsim saves them."""
    folder = tmp_path_factory.mktemp("figures")
    for name in FORMATS:
        save(draw_distance([0.0, 1.0], [1e-5, 2e-5]), folder / f"figure.{name}")
    return folder


@pytest.mark.parametrize("name", FORMATS)
def test_its_own_figures_are_known(figures, name):
    assert is_own(figures / f"figure.{name}")


@pytest.mark.parametrize("name", FORMATS)
def test_one_that_was_changed_is_not(figures, tmp_path, name):
    data = (figures / f"figure.{name}").read_bytes()
    for place in (len(data) // 2, 20, len(data) - 40):
        changed = bytearray(data)
        changed[place] ^= 1
        (tmp_path / f"figure.{name}").write_bytes(changed)
        assert not is_own(tmp_path / f"figure.{name}")
    for other in (b"", data[:30], data + b"more", data[: len(data) // 2]):
        assert not is_marked(other, f".{name}")


def test_marked_files_are_sound(figures):
    with Image.open(figures / "figure.png") as picture:
        picture.load()
        assert picture.text["flocsim"].startswith("blake2b-256 ")
    ElementTree.parse(figures / "figure.svg")
    assert b"%%EOF" in (figures / "figure.pdf").read_bytes()[-1024:]


def test_animations_and_pages_are_marked_too():
    frames = [Image.fromarray(np.full((8, 8), grey, np.uint8)) for grey in (0, 100, 200)]
    buffer = io.BytesIO()
    frames[0].save(buffer, "GIF", save_all=True, append_images=frames[1:], loop=0)
    data = marked(buffer.getvalue(), ".gif")
    assert is_marked(data, ".gif") and not is_marked(buffer.getvalue(), ".gif")
    with Image.open(io.BytesIO(data)) as animation:
        assert len(list(ImageSequence.Iterator(animation))) == 3
    assert is_marked(marked(b"# Page\n", ".md"), ".md")
    assert not is_marked(marked(b"# Page\n", ".md") + b"A note.\n", ".md")


def test_photographs_are_not_its_own(tmp_path):
    for name in PLACES:
        (tmp_path / f"photo{name}").write_bytes(b"bytes of a photograph " * 20)
        assert not is_own(tmp_path / f"photo{name}")
    Image.fromarray(np.zeros((9, 9), np.uint8)).save(tmp_path / "photo.png")
    assert not is_own(tmp_path / "photo.png")
    assert not is_own(tmp_path / "absent.png") and not is_own(tmp_path)

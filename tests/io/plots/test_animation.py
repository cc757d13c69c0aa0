"""The animated GIF."""

import attrs
import numpy as np
import pytest
from PIL import Image

from flocsim.errors import UsageError
from flocsim.io.plots.collision import write_animation

SQUARE = 1e-6 * np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]])


@attrs.frozen(eq=False)
class Falling:
    """Frames of a square that falls onto another."""

    times: np.ndarray
    outlines: list
    contacts: list
    centre_distance: np.ndarray
    paths: tuple


def falling(count):
    """Frames of ``count`` instants."""
    heights = np.linspace(6e-6, 2e-6, count)
    outlines = [[[SQUARE], [SQUARE + [0.0, height]]] for height in heights]
    paths = (np.zeros((count, 2)), np.column_stack([np.zeros(count), heights]))
    return Falling(np.linspace(0.0, 1e-3, count), outlines, [()] * count, heights, paths)


def written(path, count):
    """The GIF of so many frames."""
    frames = falling(count)
    write_animation(path, frames, (frames.times, frames.centre_distance), 3e-6, "falls")
    return path


def test_all_frames_are_there_and_differ(tmp_path):
    with Image.open(written(tmp_path / "a.gif", 4)) as animation:
        assert (animation.n_frames, animation.info["loop"]) == (4, 0)
        pictures = []
        for place in range(4):
            animation.seek(place)
            pictures.append(animation.convert("RGB").tobytes())
    assert len(set(pictures)) == 4


def test_the_same_frames_are_the_same_bytes(tmp_path):
    pair = [written(tmp_path / name, 2).read_bytes() for name in ("a.gif", "b.gif")]
    assert pair[0] == pair[1]


def test_lengths_must_agree(tmp_path):
    frames = attrs.evolve(falling(3), contacts=[()])
    with pytest.raises(UsageError, match="as many"):
        write_animation(tmp_path / "a.gif", frames, (frames.times, frames.centre_distance))

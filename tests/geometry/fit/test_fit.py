"""Masks → spheropolygons, against a plain count of pixels and known outlines."""

import warnings
from itertools import product

import numpy as np
import pytest

from flocsim.errors import ShapeError, UsageError
from flocsim.geometry.fit import fit_mask
from flocsim.geometry.fit.search import NO_STEPS, searched
from flocsim.geometry.shapes.outline import simplicity_fault
from tests.helpers.tiers import rest_slow


def count_errors(mask, vertices, radius):
    """V of the swept polygon against the mask: a search without steps."""
    return searched(mask, vertices, radius, NO_STEPS)[1]


def blob(seed, size=41, radius=13.0):
    """A rugged star-shaped floc (non-convex), as a mask."""
    rng = np.random.default_rng(seed)
    strengths, phases = rng.normal(0, 0.12, 6), rng.uniform(0, 2 * np.pi, 6)
    y, x = np.mgrid[:size, :size] - size // 2
    angle = np.arctan2(y, x)
    waves = [s * np.cos((k + 2) * angle + p)
             for k, (s, p) in enumerate(zip(strengths, phases, strict=True))]  # fmt: skip
    return np.hypot(x, y) <= radius * np.clip(1 + sum(waves), 0.3, None)


def plain_cover(vertices, radius, x, y):
    """Even-odd rule and distance to the edges, pixel by pixel, as the definition says."""
    inside = np.zeros(x.shape, bool)
    near = np.zeros(x.shape, bool)
    for (ax, ay), (bx, by) in zip(vertices, np.roll(vertices, -1, axis=0), strict=True):
        across = (ay > y) != (by > y)
        with np.errstate(divide="ignore", invalid="ignore"):
            inside ^= across & (x < ax + (y - ay) / (by - ay) * (bx - ax))
        share = ((x - ax) * (bx - ax) + (y - ay) * (by - ay)) / ((bx - ax) ** 2 + (by - ay) ** 2)
        share = np.clip(share, 0, 1)
        near |= np.hypot(x - ax - share * (bx - ax), y - ay - share * (by - ay)) <= radius
    return inside | near


BORDER = 1e-12
"""A pixel's centre so near to the outline, as a share of r, is on either side of it: the compiled
count squares where numpy's takes a root, so that the two may round it to different sides."""


def plain_wrong(mask, fit, radius):
    """Where (h, w) a shape of this spheroradius differs from the mask, with room around it."""
    padded = np.pad(mask, 20)
    row, column = np.mgrid[: padded.shape[0], : padded.shape[1]] - 20
    return plain_cover(fit.vertices, radius, column, -row) != padded


def assert_error_of_definition(mask, fit):
    """RE [%] is that of the paper's eq. 2, pixels on the outline taken as either."""
    inner, outer = (plain_wrong(mask, fit, fit.radius * (1 + sign * BORDER)) for sign in (-1, 1))
    wrong = fit.relative_error * mask.sum() / 100
    assert fit.wrong_pixels == round(wrong)
    assert wrong == pytest.approx(fit.wrong_pixels, abs=1e-9)
    assert np.sum(inner & outer) <= fit.wrong_pixels <= np.sum(inner | outer)


@pytest.mark.parametrize(
    ("method", "vertices", "radius"),
    rest_slow(
        product(["pattern", "paper", "even"], [2, 3, 4, 9, 32], [0.7, 2.3]),
        lambda method, vertices, radius: radius == (0.7 if vertices in (2, 9) else 2.3),
    ),
)
def test_relative_error_is_that_of_the_definition(method, vertices, radius):
    for seed in range(3):
        mask = blob(seed)
        fit = fit_mask(mask, vertices=vertices, radius=radius, method=method)
        assert_error_of_definition(mask, fit)
        assert fit.vertices.shape == (vertices, 2)
        assert vertices == 2 or simplicity_fault(fit.vertices) is None


@pytest.mark.parametrize("vertices", [4, 16, 64])
def test_the_search_beats_even_spacing_and_the_circle(vertices):
    for seed in range(4):
        found = fit_mask(blob(seed), vertices=vertices).relative_error
        even = fit_mask(blob(seed), vertices=vertices, method="even").relative_error
        assert found < even or found == 0
        assert found < fit_mask(blob(seed), vertices=1).relative_error


def test_known_spheropolygons_are_found_again():
    row, column = np.mgrid[:60, :60]
    core = np.array([(10.3, -12.2), (47.1, -9.4), (44.8, -46.9), (27.2, -25.1), (12.6, -44.0)])
    mask = plain_cover(core, 3.0, column, -row)
    fit = fit_mask(mask, vertices=5, radius=3.0)
    assert fit.relative_error < 1.0
    # As sets of corners: every true one has a fitted one within about a pixel.
    distances = np.hypot(*(core[:, None] - fit.vertices[None]).transpose(2, 0, 1))
    assert distances.min(axis=1).max() < 1.5


def test_the_body_stands_as_in_the_picture():
    """A floc that is wide at the top of the picture is wide at large y."""
    mask = np.zeros((40, 40), bool)
    mask[5:12, 5:35] = mask[5:35, 17:23] = True
    fit = fit_mask(mask, vertices=8)
    top = fit.vertices[fit.vertices[:, 1] > fit.vertices[:, 1].max() - 6]
    bottom = fit.vertices[fit.vertices[:, 1] < fit.vertices[:, 1].min() + 6]
    assert np.ptp(top[:, 0]) > 2 * np.ptp(bottom[:, 0])
    assert fit.shape.area == pytest.approx(mask.sum(), rel=0.03)


def test_equal_area_circle():
    mask = np.zeros((30, 50), bool)
    mask[4:24, 10:40] = True
    fit = fit_mask(mask, vertices=1, radius=99.0)
    assert fit.radius == fit.shape.radius == pytest.approx(np.sqrt(600 / np.pi))
    assert np.allclose(fit.vertices, [[24.5, -13.5]])
    row, column = np.mgrid[-30:60, -30:80]
    circle = np.hypot(column - 24.5, row - 13.5) <= fit.radius
    wrong = np.count_nonzero(circle != np.pad(mask, 30))
    assert fit.relative_error == pytest.approx(100 * wrong / 600)


def test_shifted_and_padded_masks_give_the_same_shape():
    mask = blob(5)
    fit, moved = fit_mask(mask, vertices=12), fit_mask(np.pad(mask, ((7, 2), (3, 9))), vertices=12)
    assert moved.relative_error == fit.relative_error
    assert np.allclose(moved.vertices - fit.vertices, (3, -7))
    assert np.allclose(moved.shape.vertices, fit.shape.vertices)


def test_the_same_mask_gives_the_same_bytes():
    first, again = (fit_mask(blob(6), vertices=20) for _ in range(2))
    assert first.vertices.tobytes() == again.vertices.tobytes()


def test_scaled_is_in_metres():
    fit = fit_mask(blob(7), vertices=8)
    shape = fit.scaled(0.95e-6)
    assert shape.area == pytest.approx(fit.shape.area * 0.95e-6**2)
    assert shape.radius == pytest.approx(0.95e-6)
    for wrong in (0, -1e-6, float("nan"), "1e-6"):
        with pytest.raises(UsageError, match="pixel size"):
            fit.scaled(wrong)


def awkward_masks():
    """A pixel, a line, a diagonal, a comb, a spiral and two blocks that share a corner."""
    pixel, line = np.ones((1, 1), bool), np.ones((1, 30), bool)
    comb = np.zeros((21, 31), bool)
    comb[:3], comb[:, ::3] = True, True
    spiral = np.zeros((40, 40), bool)
    t = np.linspace(0, 5 * np.pi, 4000)
    spiral[(20 + 1.15 * t * np.sin(t)).astype(int), (20 + 1.15 * t * np.cos(t)).astype(int)] = True
    blocks = np.kron(np.eye(2), np.ones((6, 6))).astype(bool)
    return [pixel, line, np.eye(20, dtype=bool), comb, spiral, blocks]


@pytest.mark.parametrize(
    ("vertices", "method"),
    rest_slow(
        product([2, 3, 5, 16, 64, 150], ["pattern", "paper", "even"]),
        lambda vertices, method: vertices in (3, 16),
    ),
)
def test_awkward_masks_give_simple_polygons(vertices, method):
    for mask in awkward_masks():
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            fit = fit_mask(mask, vertices=vertices, method=method)
        assert_error_of_definition(mask, fit)
        assert len(fit.shape.vertices) == vertices


def test_warns_when_the_radius_is_not_below_the_floc():
    small = blob(1, size=13, radius=3.0)
    with pytest.warns(UserWarning, match="use r < r_eq"):
        fit_mask(small, vertices=8, radius=4.0)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        fit_mask(small, vertices=8, radius=1.0)


@pytest.mark.parametrize("mask", [np.zeros((5, 5)), np.eye(5)[::2], np.full((5, 5), 0.5), [1, 1]])
def test_masks_that_are_not_one_floc_are_refused(mask):
    with pytest.raises(ShapeError, match="mask"):
        fit_mask(mask, vertices=4)


@pytest.mark.parametrize(
    ("options", "named"),
    [
        ({"vertices": 0}, "vertices"),
        ({"vertices": 4.0}, "vertices"),
        ({"vertices": True}, "vertices"),
        ({"vertices": 4, "radius": 0.0}, "spheroradius"),
        ({"vertices": 4, "radius": float("nan")}, "spheroradius"),
        ({"vertices": 4, "method": "best"}, "method"),
    ],
)
def test_wrong_options_are_named(options, named):
    with pytest.raises(UsageError, match=named):
        fit_mask(blob(0), **options)


def test_the_search_beats_the_papers_dynamics():
    for vertices in (4, 16):
        fits = [[fit_mask(blob(seed), vertices=vertices, method=method).wrong_pixels
                 for seed in range(3)] for method in ("pattern", "paper")]  # fmt: skip
        assert sum(fits[0]) < sum(fits[1])


@pytest.mark.parametrize("method", ["pattern", "paper", "even"])
@pytest.mark.parametrize("vertices", [3, 4, 16])
@pytest.mark.parametrize("radius", [1.0, 4.0])
def test_the_area_is_kept_on_request(method, vertices, radius):
    mask = blob(2)
    options = {"vertices": vertices, "radius": radius, "method": method}
    fit = fit_mask(mask, preserve_area=True, **options)
    assert fit.shape.area == pytest.approx(mask.sum(), rel=1e-9)
    assert_error_of_definition(mask, fit)
    assert simplicity_fault(fit.vertices) is None


def test_an_area_below_the_disk_cannot_be_kept():
    with pytest.raises(UsageError, match="area cannot"), warnings.catch_warnings():
        warnings.simplefilter("ignore")
        fit_mask(blob(1, size=13, radius=3.0), vertices=8, radius=4.0, preserve_area=True)


def test_the_outline_lies_in_the_middle_of_its_play():
    """V leaves half a pixel of play; the area says where in it the outline belongs."""
    for seed in range(6):
        mask = blob(seed)
        fit = fit_mask(mask, vertices=48)
        assert fit.shape.area == pytest.approx(mask.sum(), rel=0.02)


def test_the_order_of_a_mask_in_memory_does_not_matter():
    mask = blob(0)
    fits = [fit_mask(each, vertices=6) for each in (mask, np.asfortranarray(mask))]
    assert np.array_equal(fits[0].vertices, fits[1].vertices)


@pytest.mark.parametrize("radius", [0.5, 1.0, 2.0])
def test_more_vertices_are_not_worse_on_small_flocs(radius):
    masks = [blob(seed, size=19, radius=4.0) for seed in range(8)]
    wrong = [
        sum(fit_mask(mask, vertices=n, radius=radius).wrong_pixels for mask in masks)
        for n in (8, 16, 28, 40, 64, 128)
    ]
    assert wrong == sorted(wrong, reverse=True)


@pytest.mark.slow
def test_turned_and_mirrored_masks_fit_as_well():
    for seed in range(2):
        masks = [blob(seed), np.rot90(blob(seed)), blob(seed)[::-1]]
        errors = [fit_mask(mask, vertices=12).relative_error for mask in masks]
        assert np.ptp(errors) < 1.0


def plain_outside(mask, fit):
    """Pixels that the shape covers and that are not the mask's, by the definition."""
    return np.count_nonzero(plain_wrong(mask, fit, fit.radius * (1 - BORDER)) & ~np.pad(mask, 20))


@pytest.mark.parametrize("vertices", rest_slow([2, 3, 4, 9, 32], lambda n: n in (3, 9)))
@pytest.mark.parametrize("radius", [1.0, 2.3])
def test_an_inscribed_shape_covers_nothing_outside_of_its_mask(vertices, radius):
    for seed in range(4):
        mask = blob(seed)
        fit = fit_mask(mask, vertices=vertices, radius=radius, inscribed=True)
        assert plain_outside(mask, fit) == 0
        assert_error_of_definition(mask, fit)
        assert vertices == 2 or simplicity_fault(fit.vertices) is None


def test_what_cannot_be_inscribed_is_said():
    with pytest.raises(ShapeError, match="lies inside the floc"):
        fit_mask(np.ones((1, 30), bool), vertices=4, inscribed=True)
    for options in ({"method": "even"}, {"preserve_area": True}):
        with pytest.raises(UsageError, match="inscribed fit needs"):
            fit_mask(blob(0), vertices=4, inscribed=True, **options)

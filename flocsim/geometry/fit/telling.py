"""The points that tell most of an outline: plain Python, compiled by fit_search."""

import numpy as np


def triangle(points, before, k, after):
    """Twice the area of the triangle of three of the points."""
    ux, uy = points[before, 0] - points[k, 0], points[before, 1] - points[k, 1]
    wx, wy = points[after, 0] - points[k, 0], points[after, 1] - points[k, 1]
    return abs(ux * wy - uy * wx)


def telling_points(points, count):
    """The `count` points that tell most of a closed outline (Visvalingam and Whyatt 1993).

    The point that spans the smallest triangle with its neighbours is left out, again and again.
    """
    size = len(points)
    before, after = np.arange(size) - 1, np.arange(size) + 1
    before[0], after[size - 1] = size - 1, 0
    areas = np.empty(size)
    for k in range(size):
        areas[k] = triangle(points, before[k], k, after[k])
    for _ in range(size - count):
        k = np.argmin(areas)
        areas[k] = np.inf
        left, right = before[k], after[k]
        after[left], before[right] = right, left
        areas[left] = triangle(points, before[left], left, right)
        areas[right] = triangle(points, left, right, after[right])
    return points[np.isfinite(areas)]

"""Directions of pairs on the coordinates of their two bodies, and products of them."""

from flocsim.layout import NOW


def normal_rows(work, row):
    """Entries of a pair's normal direction on its two bodies, now."""
    g = work.geometry
    nx, ny = g[NOW, row, 0], g[NOW, row, 1]
    return (nx, ny, g[NOW, row, 3]), (-nx, -ny, -g[NOW, row, 5])


def tangent_rows(work, row):
    """Entries of a pair's tangential direction on its two bodies, now."""
    g = work.geometry
    tx, ty = -g[NOW, row, 1], g[NOW, row, 0]
    return (tx, ty, g[NOW, row, 4]), (-tx, -ty, -g[NOW, row, 6])


def add_product(work, which, a, b, out, by, weight):
    """weight · outᵀ by of two directions, each with its entries on bodies a and b."""
    if weight == 0.0:
        return
    matrix = work.jacobian
    for i in range(3):
        for j in range(3):
            matrix[which, 3 * a + i, 3 * a + j] += weight * out[0][i] * by[0][j]
            matrix[which, 3 * a + i, 3 * b + j] += weight * out[0][i] * by[1][j]
            matrix[which, 3 * b + i, 3 * a + j] += weight * out[1][i] * by[0][j]
            matrix[which, 3 * b + i, 3 * b + j] += weight * out[1][i] * by[1][j]

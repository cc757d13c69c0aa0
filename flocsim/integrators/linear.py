"""Small dense linear systems, in place: compiles fast, unlike numpy.linalg inside a kernel.

A system is an (m, m + 1) array, the load in its last column.
"""


def pivot_row(system, which, column):
    """The row at or below the diagonal with the largest entry of the column."""
    best = column
    for row in range(column + 1, system.shape[1]):
        if abs(system[which, row, column]) > abs(system[which, best, column]):
            best = row
    return best


def swap_rows(system, which, a, b):
    """Exchange two equations."""
    for column in range(system.shape[2]):
        kept = system[which, a, column]
        system[which, a, column] = system[which, b, column]
        system[which, b, column] = kept


def eliminate(system, which, pivot):
    """Subtract the pivot's equation from all below it."""
    for row in range(pivot + 1, system.shape[1]):
        share = system[which, row, pivot] / system[which, pivot, pivot]
        if share != 0.0:
            for column in range(pivot + 1, system.shape[2]):
                system[which, row, column] -= share * system[which, pivot, column]


def solve_in_place(system, which):
    """Solve one of the stacked systems by elimination with row pivoting; x replaces the load.

    Returns False for a singular matrix; the matrix is overwritten.
    """
    size = system.shape[1]
    for pivot in range(size):
        best = pivot_row(system, which, pivot)
        if not abs(system[which, best, pivot]) > 0.0:
            return False
        if best != pivot:
            swap_rows(system, which, pivot, best)
        eliminate(system, which, pivot)
    for row in range(size - 1, -1, -1):
        for column in range(row + 1, size):
            system[which, row, size] -= system[which, row, column] * system[which, column, size]
        system[which, row, size] /= system[which, row, row]
    return True

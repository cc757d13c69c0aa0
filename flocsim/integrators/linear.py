"""Small dense complex systems, factorised in place: compiles fast, unlike numpy.linalg in a kernel.

System k is (m, m + 2): the matrix, then its factors; the load, then the solution; the pivots.
"""


def pivot_row(system, which, column):
    """The row at or below the diagonal with the largest entry of the column."""
    best = column
    largest = abs(system[which, best, column])
    for row in range(column + 1, system.shape[1]):
        size = abs(system[which, row, column])
        if size > largest:
            best = row
            largest = size
    return best


def swap_rows(system, which, a, b, columns):
    """Exchange the first columns of two rows."""
    for column in range(columns):
        kept = system[which, a, column]
        system[which, a, column] = system[which, b, column]
        system[which, b, column] = kept


def eliminate(system, which, pivot):
    """Subtract the pivot's row from all below it, and keep the shares in their places."""
    size = system.shape[1]
    reciprocal = 1.0 / system[which, pivot, pivot]
    for row in range(pivot + 1, size):
        if system[which, row, pivot] != 0.0:
            share = system[which, row, pivot] * reciprocal
            system[which, row, pivot] = share
            for column in range(pivot + 1, size):
                system[which, row, column] -= share * system[which, pivot, column]


def factorise(system, which):
    """Factorise a matrix with row pivoting; False where it is singular."""
    size = system.shape[1]
    for pivot in range(size):
        best = pivot_row(system, which, pivot)
        if not abs(system[which, best, pivot]) > 0.0:
            return False
        system[which, pivot, size + 1] = best
        if best != pivot:
            swap_rows(system, which, pivot, best, size)
        eliminate(system, which, pivot)
    return True


def order_load(system, which):
    """Bring the load into the order of the pivots."""
    size = system.shape[1]
    for row in range(size):
        other = int(system[which, row, size + 1].real)
        kept = system[which, row, size]
        system[which, row, size] = system[which, other, size]
        system[which, other, size] = kept


def solve(system, which):
    """Replace the load of a factorised system by the solution."""
    size = system.shape[1]
    order_load(system, which)
    for row in range(size):
        for column in range(row):
            system[which, row, size] -= system[which, row, column] * system[which, column, size]
    for row in range(size - 1, -1, -1):
        for column in range(row + 1, size):
            system[which, row, size] -= system[which, row, column] * system[which, column, size]
        system[which, row, size] /= system[which, row, row]

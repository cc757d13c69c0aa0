"""Small dense complex systems, factorised in place: compiles fast, unlike numpy.linalg in a kernel.

System k is (m, m): the matrix, then its factors.
"""


def magnitude(value):
    """|re| + |im|, which tells pivots apart as well as the modulus does, without its root."""
    return abs(value.real) + abs(value.imag)


def factorise(system, pivots, which):
    """Factorise a matrix with row pivoting (pivots (2, m)); False where it is singular.

    In the places of the pivots are their reciprocals: complex division takes long.
    """
    size = system.shape[1]
    for pivot in range(size):
        best = pivot
        largest = magnitude(system[which, best, pivot])
        for row in range(pivot + 1, size):
            entry = magnitude(system[which, row, pivot])
            if entry > largest:
                best = row
                largest = entry
        if not largest > 0.0:
            return False
        pivots[which, pivot] = best
        if best != pivot:
            for column in range(size):
                kept = system[which, pivot, column]
                system[which, pivot, column] = system[which, best, column]
                system[which, best, column] = kept
        # Subtract the pivot's row from all below it, and keep the shares in their places.
        reciprocal = 1.0 / system[which, pivot, pivot]
        system[which, pivot, pivot] = reciprocal
        for row in range(pivot + 1, size):
            if system[which, row, pivot] != 0.0:
                share = system[which, row, pivot] * reciprocal
                system[which, row, pivot] = share
                for column in range(pivot + 1, size):
                    system[which, row, column] -= share * system[which, pivot, column]
    return True


def solve_dense(system, pivots, loads, which):
    """Replace the load of a factorised system, loads (2, m), by the solution."""
    size = system.shape[1]
    for row in range(size):
        other = pivots[which, row]
        kept = loads[which, row]
        loads[which, row] = loads[which, other]
        loads[which, other] = kept
    for row in range(size):
        for column in range(row):
            loads[which, row] -= system[which, row, column] * loads[which, column]
    for row in range(size - 1, -1, -1):
        for column in range(row + 1, size):
            loads[which, row] -= system[which, row, column] * loads[which, column]
        loads[which, row] *= system[which, row, row]

"""Small dense systems, factorised in place: compiles fast, unlike numpy.linalg in a kernel.

System k is (m, m): the matrix, then its factors. That of the real eigenvalue is real, though it
stands in an array of complex numbers: its imaginary parts are neither read nor of any use, as
complex products take four times as many real ones.
"""

from flocsim.integrators.radau.tableau import REAL


def magnitude(value):
    """|re| + |im|, which tells pivots apart as well as the modulus does, without its root."""
    return abs(value.real) + abs(value.imag)


def reciprocal(value):
    """1/value, without Python's guards against overflow, which pivots come nowhere near."""
    size = value.real * value.real + value.imag * value.imag
    return complex(value.real / size, -value.imag / size)


def subtract_pivot(system, which, row, pivot):
    """Subtract a pivot's row from one below it, and keep the share in its place."""
    if which == REAL:
        part = system[which, row, pivot].real * system[which, pivot, pivot].real
        system[which, row, pivot] = complex(part, 0.0)
        for column in range(pivot + 1, system.shape[1]):
            left = system[which, row, column].real - part * system[which, pivot, column].real
            system[which, row, column] = complex(left, 0.0)
        return
    share = system[which, row, pivot] * system[which, pivot, pivot]
    system[which, row, pivot] = share
    for column in range(pivot + 1, system.shape[1]):
        system[which, row, column] -= share * system[which, pivot, column]


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
        system[which, pivot, pivot] = reciprocal(system[which, pivot, pivot])
        for row in range(pivot + 1, size):
            if system[which, row, pivot] != 0.0:
                subtract_pivot(system, which, row, pivot)
    return True


def subtract_known(system, loads, which, row, first, last):
    """Subtract from a load what the solutions from ``first`` to before ``last`` leave in it."""
    if which == REAL:
        left = loads[which, row].real
        for column in range(first, last):
            left -= system[which, row, column].real * loads[which, column].real
        loads[which, row] = complex(left, 0.0)
        return
    rest = loads[which, row]
    for column in range(first, last):
        rest -= system[which, row, column] * loads[which, column]
    loads[which, row] = rest


def solve_dense(system, pivots, loads, which):
    """Replace the load of a factorised system, loads (2, m), by the solution."""
    size = system.shape[1]
    for row in range(size):
        other = pivots[which, row]
        kept = loads[which, row]
        loads[which, row] = loads[which, other]
        loads[which, other] = kept
    for row in range(size):
        subtract_known(system, loads, which, row, 0, row)
    for row in range(size - 1, -1, -1):
        subtract_known(system, loads, which, row, row + 1, size)
        loads[which, row] *= system[which, row, row]

"""LU factors of small dense systems with row pivoting, in place.

System k is an (m, m) matrix, then its factors. The system of the real eigenvalue is stored as
complex numbers, too, but its imaginary parts are neither read nor meaningful: complex products take
four times as many operations. Hand-written code compiles much faster than numpy.linalg in a kernel.
"""

from flocsim.integrators.radau.tableau import REAL


def magnitude(value):
    """Return |re| + |im|, which ranks pivots as well as the modulus does, without a square root."""
    return abs(value.real) + abs(value.imag)


def reciprocal(value):
    """Return 1/value, without Python's guards against overflow: pivots are far from it."""
    size = value.real * value.real + value.imag * value.imag
    return complex(value.real / size, -value.imag / size)


def eliminate_row(system, which, row, pivot):
    """Eliminate one column of a row below a pivot; store the factor of L in its place."""
    if which == REAL:
        # Real system: real arithmetic only.
        real_factor = system[which, row, pivot].real * system[which, pivot, pivot].real
        system[which, row, pivot] = complex(real_factor, 0.0)
        for column in range(pivot + 1, system.shape[1]):
            rest = system[which, row, column].real - real_factor * system[which, pivot, column].real
            system[which, row, column] = complex(rest, 0.0)
        return
    factor = system[which, row, pivot] * system[which, pivot, pivot]
    system[which, row, pivot] = factor
    for column in range(pivot + 1, system.shape[1]):
        system[which, row, column] -= factor * system[which, pivot, column]


def factorise_dense(system, pivots, which):
    """Factorise a matrix with row pivoting; pivots (2, m). Return False if it is singular.

    The diagonal holds reciprocals of the pivots, because complex division is slow.
    """
    size = system.shape[1]
    for pivot in range(size):
        best = pivot
        # Find the largest entry of the column.
        largest = magnitude(system[which, best, pivot])
        for row in range(pivot + 1, size):
            entry = magnitude(system[which, row, pivot])
            if entry > largest:
                best = row
                largest = entry
        if not largest > 0.0:
            return False
        pivots[which, pivot] = best
        # Swap rows.
        if best != pivot:
            for column in range(size):
                swapped = system[which, pivot, column]
                system[which, pivot, column] = system[which, best, column]
                system[which, best, column] = swapped
        # Eliminate the column below the pivot; zeros are common where bodies do not touch.
        system[which, pivot, pivot] = reciprocal(system[which, pivot, pivot])
        for row in range(pivot + 1, size):
            if system[which, row, pivot] != 0.0:
                eliminate_row(system, which, row, pivot)
    return True


def substitute_known(system, loads, which, row, first, last):
    """Subtract the known unknowns from ``first`` up to but excluding ``last`` from the load of a
    row."""
    if which == REAL:
        rest = loads[which, row].real
        for column in range(first, last):
            rest -= system[which, row, column].real * loads[which, column].real
        loads[which, row] = complex(rest, 0.0)
        return
    remaining = loads[which, row]
    for column in range(first, last):
        remaining -= system[which, row, column] * loads[which, column]
    loads[which, row] = remaining


def solve_dense(system, pivots, loads, which):
    """Replace the load of a factorised system, loads (2, m), by its solution."""
    size = system.shape[1]
    for row in range(size):
        # Apply the row swaps.
        other = pivots[which, row]
        swapped = loads[which, row]
        loads[which, row] = loads[which, other]
        loads[which, other] = swapped
    for row in range(size):
        # Forward substitution.
        substitute_known(system, loads, which, row, 0, row)
    # Backward substitution.
    for row in range(size - 1, -1, -1):
        substitute_known(system, loads, which, row, row + 1, size)
        loads[which, row] *= system[which, row, row]

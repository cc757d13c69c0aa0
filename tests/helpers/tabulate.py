"""The table of probabilities of codes that a test gives."""

import numpy as np
from numpy.typing import ArrayLike

from flocsim.ensembles.estimates.numerical import count_changes
from flocsim.ensembles.estimates.statistics import count
from flocsim.ensembles.estimates.summary import table_from
from flocsim.io.results.schema import NOT_APPLICABLE


def tabulate(
    outcome: ArrayLike, inside: ArrayLike, bond: ArrayLike,
    checked_outcome: ArrayLike = NOT_APPLICABLE, checked_inside: ArrayLike = NOT_APPLICABLE,
    checked_bond: ArrayLike = NOT_APPLICABLE, third_outcome: ArrayLike = NOT_APPLICABLE,
    third_inside: ArrayLike = NOT_APPLICABLE, third_bond: ArrayLike = NOT_APPLICABLE,
) -> dict[str, np.ndarray]:  # fmt: skip
    """Counts and probabilities of every condition, over the last axis of the arrays.

    ``outcome``, ``inside``, ``bond``: codes as in the results file, (…, replicate), in practice
    (type, vertices, delta, replicate). Returns a dict of arrays (…), (…, 4) for the classes A–D and
    (…, 3) for the kinds of bond: the counts ``n_*`` (see `count`, `count_changes`), the
    probabilities of `probabilities` and their `numerical_errors`. ``checked_…``, ``third_…``:
    those of second and third runs, none by default.
    """
    first = tuple(map(np.asarray, (outcome, inside, bond)))
    again, third = (
        tuple(np.broadcast_to(np.asarray(codes), first[0].shape) for codes in run)
        for run in (
            (checked_outcome, checked_inside, checked_bond),
            (third_outcome, third_inside, third_bond),
        )
    )
    return table_from(count(*first) | count_changes(first, again, third))

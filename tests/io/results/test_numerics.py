"""Where the numerical error is worth a column, a bar, or a line alone."""

import attrs
import numpy as np
import pytest

from flocsim.io.results.numerics import numerics_matter
from tests.helpers.synthetic_results import make_results


def with_error(error, name="pr_a"):
    """Results whose interval of a probability is 0.4 to 0.6, with a numerical error in one
    condition."""
    made = make_results(count=8)
    some = np.zeros(made.shape)
    changed = {f"{each}_numerical": some for each in ("pr_a", "pr_inside")}
    changed |= {f"{name}_low": some + 0.4, f"{name}_high": some + 0.6}
    one = some.copy()
    one[1, 2, 3] = error
    return attrs.evolve(
        made, probabilities=made.probabilities | changed | {f"{name}_numerical": one}
    )


@pytest.mark.parametrize("name", ["pr_a", "pr_inside"])
def test_an_error_above_half_of_the_half_width_matters(name):
    assert numerics_matter(with_error(0.051, name))
    assert not numerics_matter(with_error(0.049, name))


def test_conditions_without_re_runs_do_not_count():
    assert not numerics_matter(with_error(np.nan))

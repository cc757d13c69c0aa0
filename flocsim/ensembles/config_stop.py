"""The table [stop] of a config file: when a study ends before all replicates are run."""

import attrs

from flocsim.ensembles.config_fields import items_reader, optional_quantity, read_by, whole
from flocsim.ensembles.values import read_choice
from flocsim.fields import quantity

ESTIMATES = ("pr_inside", "pr_a_given_inside", "pr_a_given_outside", "pr_a")


@attrs.frozen
class StopConfig:
    """[stop]: when to end before all `replicates` are run.

    With `half_width`, the rule looks at fixed numbers of replicates (`least`, then 5/4 as many
    each time), the same for any number of ranks, and the study ends at the first at which the 95 %
    interval of every estimate in every condition is narrow enough. A condition without events
    holds nothing up. As any sequential rule, it makes intervals cover a little less often than
    they say.
    """

    half_width: float | None = optional_quantity(
        "", above=0.0, at_most=0.5, help="largest half-width of the 95 % intervals; none: run all"
    )
    of: tuple = read_by(
        items_reader(lambda value: read_choice(value, ESTIMATES), "a list of estimates"),
        f"a list of {', '.join(ESTIMATES)}",
        default=("pr_inside", "pr_a"),
        help="the estimates whose intervals count",
    )
    least: int = whole(1, 10**9, default=100, help="replicates after which the rule first looks")
    failed: float = quantity(
        "",
        at_least=0.0,
        at_most=1.0,
        default=0.1,
        help="share of all replicates that may fail; a study of more is given up, exit code 70",
    )

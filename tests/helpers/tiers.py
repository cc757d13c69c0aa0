"""Which cases of a test are in the default run, and which only in that of `-m slow`."""

from collections.abc import Callable, Iterable
from typing import Any

import pytest
from hypothesis import given, settings


def rest_slow(cases: Iterable[Any], quick: Callable[..., bool]) -> list[Any]:
    """The cases of a parametrize, those marked slow of which ``quick`` says no.

    A case of several values is a tuple, and ``quick`` gets them one by one.
    """
    rows = [case if isinstance(case, tuple) else (case,) for case in cases]
    return [pytest.param(*row, marks=[] if quick(*row) else [pytest.mark.slow]) for row in rows]


def given_often(few: int, many: int, *strategies: Any, **options: Any) -> Callable:
    """Makes a test of a property that holds for all that hypothesis draws: for ``few`` examples,
    in the slow run for ``many``; ``options`` as settings has them."""

    def decorate(holds):
        def test(examples):
            settings(max_examples=examples, **options)(given(*strategies)(holds))()

        test.__name__, test.__doc__, test.__module__ = (
            holds.__name__, holds.__doc__, holds.__module__,
        )  # fmt: skip
        cases = rest_slow([few, many], lambda examples: examples == few)
        return pytest.mark.parametrize("examples", cases)(test)

    return decorate

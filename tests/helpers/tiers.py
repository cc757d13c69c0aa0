"""Which cases of a test are in the default run, and which only in that of `-m slow`."""

from collections.abc import Callable, Iterable
from typing import Any

import pytest


def rest_slow(cases: Iterable[Any], quick: Callable[..., bool]) -> list[Any]:
    """The cases of a parametrize, those marked slow of which ``quick`` says no.

    A case of several values is a tuple, and ``quick`` gets them one by one.
    """
    rows = [case if isinstance(case, tuple) else (case,) for case in cases]
    return [pytest.param(*row, marks=[] if quick(*row) else [pytest.mark.slow]) for row in rows]

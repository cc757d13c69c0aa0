"""How long tests wait for what is to happen: until it does, on however busy a machine."""

import time
from collections.abc import Callable

PATIENCE = 600.0
"""Seconds after which a test gives up: others may use the processors, and caches may be empty."""


def wait_until(holds: Callable[[], object]) -> bool:
    """Return True as soon as a condition holds, False where it does not within PATIENCE."""
    end = time.monotonic() + PATIENCE
    while not holds():
        if time.monotonic() > end:
            return False
        time.sleep(0.02)
    return True

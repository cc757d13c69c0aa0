"""What processes of flocsim.ensembles.strength.processes are given in its tests."""

import operator
import os
import time
from functools import partial

from flocsim.errors import UsageError


def adding(offset):
    """Adds to what it is asked."""
    return partial(operator.add, offset)


def refusing(words):
    """Refuses whatever it is asked."""
    raise UsageError(words)


def dying():
    """Dies of the first task."""
    return os._exit


def sleeping():
    """Says which process it is in, at once, and never comes back from a second task."""
    return asleep


def asleep(task):
    if task > 1:
        time.sleep(600.0)
    return os.getpid()

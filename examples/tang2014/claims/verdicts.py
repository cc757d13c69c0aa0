"""From a statistic with its interval to a verdict: holds, fails or undecided.

The rules know no claim, and were fixed before any result was seen: a claim holds where the whole
95 % interval agrees with it, fails where none of it does, and is undecided in between.
"""

import attrs
import numpy as np

from flocsim.io.confidence import proportion

HOLDS, FAILS, UNDECIDED = "holds", "fails", "undecided"

ENOUGH = 0.95
"""What "always" needs the lower bound of a probability to reach."""

RARE = 0.01
"""Below this upper bound an event that was never seen counts as one that does not occur."""


class MissingData(Exception):
    """The results or the shapes lack what a claim is about; the argument says what."""


@attrs.frozen
class Part:
    """One statistic of a claim: what it is, its value, 95 % interval, verdict, and a remark."""

    what: str
    value: float
    low: float
    high: float
    verdict: str
    note: str = ""


@attrs.frozen
class Finding:
    """A claim by its number in the docs, its words, and what its parts came to."""

    number: int
    claim: str
    parts: tuple
    note: str = ""

    @property
    def verdict(self):
        """Fails with any part, holds with all of them, otherwise undecided."""
        verdicts = {part.verdict for part in self.parts}
        if FAILS in verdicts:
            return FAILS
        return HOLDS if verdicts == {HOLDS} else UNDECIDED


def interval_of(samples):
    """(value, low, high) of samples: the first is the estimate, the others its resamples."""
    value, resamples = samples[0], samples[1:]
    if not np.isfinite(value) or np.isnan(resamples).mean() > 0.5:
        return float(value), np.nan, np.nan
    low, high = np.nanpercentile(resamples, [2.5, 97.5])
    return float(value), float(low), float(high)


def within(what, samples, least, most):
    """Whether a statistic lies between two levels."""
    value, low, high = interval_of(samples)
    if least <= low and high <= most:
        verdict = HOLDS
    else:
        verdict = FAILS if high < least or low > most else UNDECIDED
    return Part(what, value, low, high, verdict)


def above(what, samples, level=0.0):
    """Whether a statistic is above a level."""
    value, low, high = interval_of(samples)
    verdict = HOLDS if low > level else FAILS if high <= level else UNDECIDED
    return Part(what, value, low, high, verdict)


def below(what, samples, level=0.0):
    """Whether a statistic is below a level."""
    part = above(what, -samples, -level)
    return attrs.evolve(part, value=-part.value, low=-part.high, high=-part.low)


def always(what, happened, trials, note=""):
    """Whether an event happens every time: one exception refutes it."""
    value, low, high = (float(each) for each in proportion(happened, trials))
    verdict = HOLDS if low >= ENOUGH else UNDECIDED
    if happened < trials:
        verdict = FAILS
    return Part(what, value, low, high, verdict, note or f"{happened} of {trials}")


def occurs(what, count, trials):
    """Whether an event happens at all."""
    value, low, high = (float(each) for each in proportion(count, trials))
    verdict = FAILS if high < RARE else UNDECIDED
    return Part(what, value, low, high, HOLDS if count else verdict, f"{count} of {trials}")


def everywhere(what, parts):
    """Whether a claim of single conditions, Parts by their names, is right in all of them.

    It fails where it fails in any, and holds where it holds in all.
    """
    verdicts = [part.verdict for part in parts.values()]
    counts = {verdict: verdicts.count(verdict) for verdict in (HOLDS, FAILS)}
    value, low, high = (float(each) for each in proportion(counts[HOLDS], len(verdicts)))
    verdict = FAILS if counts[FAILS] else HOLDS if counts[HOLDS] == len(verdicts) else UNDECIDED
    against = [name for name, part in parts.items() if part.verdict == FAILS]
    shown = f", against: {', '.join(against[:3])}{', …' if len(against) > 3 else ''}"
    note = f"{counts[HOLDS]} of {len(verdicts)} conditions{shown if against else ''}"
    return Part(what, value, low, high, verdict, note)

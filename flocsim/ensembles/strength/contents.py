"""What a file of `flocsim strength` holds, for the commands."""

from collections import Counter
from typing import Any

from flocsim.ensembles.contents import Contents, Facts, Figures, Summary
from flocsim.io.results.run_group import source_line
from flocsim.io.results.strength_file import STATUS, STRENGTHS, Strengths, table_of


def facts_of(found: Strengths) -> Facts:
    """What has been tested, and what was found, also of a survey that has not ended."""
    statuses = Counter(found.column("status").tolist())
    ends = [f"{count} {STATUS[code].replace('_', ' ')}"
            for code, count in sorted(statuses.items())]  # fmt: skip
    used = Counter(found.column("tolerance").tolist())
    needed = [f"{count} at {tolerance:g} m" for tolerance, count in sorted(used.items())]
    told = found.progress if found.complete else f"{found.progress} so far; continue with --resume"
    facts = [("tested", told), ("found", ", ".join(ends)), ("tolerance", ", ".join(needed))]
    return facts + [
        (name.replace("_", " "), str(value)) for name, value in found.about.items()
        if name not in ("complete", "shapes", "preset")
    ]  # fmt: skip


class StrengthFiles(Contents):
    """What commands show of a file of `flocsim strength`."""

    title = "strengths of bonds"
    file = STRENGTHS
    table = staticmethod(table_of)

    def summary(self, found: Strengths) -> Summary:
        """Return what a file says of itself."""
        return Summary(facts_of(found))

    def figures(self, found: Any) -> Figures:
        """Return the one figure."""
        from flocsim.io.plots.curves import STRENGTH_FIGURES

        return STRENGTH_FIGURES

    def mark(self, found: Strengths) -> str:
        """Return that a survey has not ended."""
        return "" if found.complete else f"unfinished: {found.progress}"

    def source(self, found: Strengths) -> str:
        """Return of which preset, flocs, bonds and version it is."""
        return source_line(found.about, found.table("n_tested").ravel().tolist())


CONTENTS = StrengthFiles()

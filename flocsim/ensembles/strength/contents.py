"""What a file of `flocsim strength` holds, for the commands."""

from collections import Counter

from flocsim.ensembles.contents import Contents, Facts, Summary
from flocsim.io.plots.curves import STRENGTH_FIGURES
from flocsim.io.results.run_group import source_line
from flocsim.io.results.strength_file import STATUS, Strengths, read_strengths, table_of


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


CONTENTS = Contents(
    title="strengths of bonds", read=read_strengths,
    summary=lambda found: Summary(facts_of(found)), table=table_of,
    figures=lambda found: STRENGTH_FIGURES, drawn={"a file of flocsim strength": STRENGTH_FIGURES},
    mark=lambda found: "" if found.complete else f"unfinished: {found.progress}",
    source=lambda found: source_line(found.about),
    opened=lambda path, allowed=None: read_strengths(path),
)  # fmt: skip

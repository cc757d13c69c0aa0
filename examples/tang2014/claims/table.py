"""The claims as a table in Markdown: every part with its value, interval and verdict."""

from flocsim.io.terminal import markdown_table


def number_text(value):
    """Three digits, no zero below 0; "-" for what is not there."""
    return "-" if value != value else f"{value + 0.0:.3g}"


def interval_text(part):
    """ "[low, high]"."""
    return f"[{number_text(part.low)}, {number_text(part.high)}]"


def rows_of(finding):
    """The rows of one claim."""
    head = f"**{finding.number}** {finding.claim}"
    if not finding.parts:
        yield head, finding.note, "", "", finding.verdict
    for place, part in enumerate(finding.parts):
        verdict = part.verdict if len(finding.parts) > 1 else f"**{part.verdict}**"
        what = f"{part.what} ({part.note})" if part.note else part.what
        yield (
            head if place == 0 else "",
            what,
            number_text(part.value),
            interval_text(part),
            verdict,
        )
    if len(finding.parts) > 1:
        yield "", "", "", "", f"**{finding.verdict}**"


def claims_table(findings):
    """A table with a row for every part of every Finding."""
    heads = ("claim", "statistic", "value", "95 %", "verdict")
    return markdown_table(heads, [row for finding in findings for row in rows_of(finding)])


def verdicts_table(readings):
    """Claims against readings: ``readings`` is {name: Findings}; cells are verdicts."""
    first = next(iter(readings.values()))
    rows = []
    for place, finding in enumerate(first):
        verdicts = [
            found[place].verdict if found[place].parts else "-" for found in readings.values()
        ]
        rows.append((f"{finding.number} {finding.claim}", *verdicts))
    return markdown_table(("claim", *readings), rows)

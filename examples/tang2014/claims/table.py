"""The claims as tables in Markdown: in full, in a row for each, and by reading."""

from flocsim.io.terminal import markdown_table

from .sentences import SENTENCES


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


def deciding_part(finding):
    """Return the index of the first Part that has the verdict of its Finding."""
    return [part.verdict for part in finding.parts].index(finding.verdict)


def part_text(finding, index):
    """Return "value [low, high], **verdict**": of one Part, and of the whole Finding."""
    if not finding.parts:
        return "–"
    part = finding.parts[index]
    return f"{number_text(part.value)} {interval_text(part)}, **{finding.verdict}**"


def page_table(ways, numbers=None, quoted=True):
    """Return a table with a row for each claim, in the statistic that decides it the first way.

    ``ways`` is {name: Findings}; ``numbers``: the claims shown, all by default; ``quoted``: give
    the paper's words, too.
    """
    columns = [{found.number: found for found in findings} for findings in ways.values()]
    rows = []
    for number, finding in columns[0].items():
        if (numbers is None or number in numbers) and finding.parts:
            index = deciding_part(finding)
            others = len(finding.parts) - 1  # further parts of the claim
            more = f" (+{others})" if others else ""
            cells = [part_text(found[number], index) for found in columns]
            claim = [SENTENCES[number], finding.claim] if quoted else [finding.claim]
            rows.append((number, *claim, finding.parts[index].what + more, *cells))
    heads = ["the paper", "read as"] if quoted else ["claim"]
    return markdown_table(("", *heads, "statistic that decides", *ways), rows)


def changed_verdicts(readings):
    """Return a table of the verdicts that differ from those of the first of {name: Findings}."""
    own, *others = readings.items()
    verdicts = {finding.number: finding.verdict for finding in own[1]}
    rows = []
    for name, findings in others:
        changed = [f"({found.number}) {found.verdict}" for found in findings
                   if found.verdict != verdicts[found.number]]  # fmt: skip
        rows.append((name, ", ".join(changed) or "none"))
    return markdown_table(("reading", f"verdicts other than under {own[0]}"), rows)

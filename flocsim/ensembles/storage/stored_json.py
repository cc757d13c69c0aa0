"""What a results file and a journal hold as JSON, and the form that each has to have; on what kind
of CPU rows were computed, in words.

A kind of CPU is all that decides the last digits of rows beside the code. Compiled code is made for
the CPU at hand (a fused multiply-add rounds once, where two operations round twice), numpy and the
C library choose among their own variants. On one kind of CPU a replicate is the same bytes always;
between kinds it may differ in its last digits, and a collision that is close to a decision may end
otherwise.
"""

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from flocsim.ensembles.chunks import NOTE
from flocsim.io.records import matches, read_json

CPU = {"cpu": str, "compiled_for": str, "features": [str], "numpy": [str], "libm": [str]}
SESSION = {"identity": {}, "short": str, "layout": str, "date": str, "command": str}
"""The description of a journal's session, as a pattern of `flocsim.io.records`."""

TRIED = {"method": str, "tolerance": float, "flips": int, "cost": float}
CHOSEN = {
    "name": str, "method": str, "tolerance": float, "replicates": int, "reference": float,
    "expected": float, "bound": float, "tried": [TRIED],
}  # fmt: skip
CHOICE = {
    "of": str, "target": float, "half_width": float, "cost": float, "types": [CHOSEN],
}  # fmt: skip
"""What a pilot has chosen, as `flocsim.ensembles.pilot.choice.Choice` says."""

SETTLED = {
    "type": str, "body": str, "radius": float, "speed": float, "reynolds": float, "stokes": float,
}  # fmt: skip
"""A body at its terminal speed: flocsim.plausibility.settling.Settled."""

SPHERES = {
    "type": str, "release": float, "escape": float, "diffusion": float,
}  # fmt: skip
"""Of a brownian study: `flocsim.ensembles.equivalent_spheres.sphere_facts`; three numbers more,
each of which may be none."""

SIZE_CLASS = {"label": str, "low": float, "high": float, "flocs": int}
"""A size class of measured flocs: `flocsim.ensembles.collision.pairings.class_facts`."""

FORMS: dict[str, tuple[Any, Any]] = {
    # name in the group ``run``: (pattern, what it is where there is none)
    "identity": ({}, {}),
    "failed": ([NOTE], []),
    "history": ([{}], []),
    "cpus": ([CPU], []),
    "overrides": ({}, {}),
    "accuracy": (CHOICE, {}),
    "warnings": ([str], []),
    "settling": ([SETTLED], []),
    "size_classes": ([SIZE_CLASS], []),
    "equivalent_spheres": ([SPHERES], []),
}


def stored(run: Mapping[str, Any], name: str) -> Any:
    """The value that the group ``run`` of a results file has as JSON under a name of FORMS.

    Its default where there is none. Raises ValueError, naming it, for a text that no flocsim wrote.
    """
    pattern, default = FORMS[name]
    if name not in run:
        return default
    try:
        return read_json(run[name], pattern)
    except ValueError as error:
        raise ValueError(f"run/{name} cannot be read: {error}") from error


def is_session(description: dict) -> bool:
    """Whether a record's description, whoever wrote it, can be that of a session."""
    accuracy = description.get("accuracy", {})
    return (
        matches(description, SESSION)
        and matches(description.get("cpus", []), [CPU])
        and (accuracy == {} or matches(accuracy, CHOICE))
    )


MOST_FEATURES = 4
"""Features by which a message tells two kinds apart."""


def distinct(kinds: Sequence[dict]) -> list[dict]:
    """Each kind once, in the order in which they come."""
    return [kind for place, kind in enumerate(kinds) if kind not in kinds[:place]]


def describe_kind(kind: dict, others: Sequence[dict] = ()) -> str:
    """A kind in words: its name, and what it has that one of the others has not."""
    words = [kind["cpu"]]
    if kind["compiled_for"] != kind["cpu"]:
        words.append(f"compiled for {kind['compiled_for']}")
    for name, title in (("features", ""), ("numpy", "numpy with "), ("libm", "")):
        own = [each for each in kind[name] if any(each not in other[name] for other in others)]
        if own:
            more = ", …" if len(own) > MOST_FEATURES else ""
            words.append(f"{title}{', '.join(own[:MOST_FEATURES])}{more}")
    return words[0] if len(words) == 1 else f"{words[0]} ({'; '.join(words[1:])})"


def mixture_warnings(path: object, found: Sequence[dict], now: Sequence[dict]) -> Iterator[str]:
    """Lines that warn of rows of several kinds in one file.

    ``found``: kinds of the rows that the file at ``path`` has already; ``now``: those of the ranks
    that add to them.
    """
    kinds = distinct([*found, *now])
    names = [describe_kind(kind, [each for each in kinds if each != kind]) for kind in kinds]
    end = "the file will have rows of both kinds, which may differ in their last digits"
    if len(now) > 1:
        here = " and ".join(names[kinds.index(kind)] for kind in now)
        yield f"the ranks run on different kinds of CPU, {here}: {end}"
    elif any(kind not in found for kind in now) and found:
        there = " and ".join(names[kinds.index(kind)] for kind in found)
        here = names[kinds.index(now[0])]
        yield f"{path} has rows of another kind of CPU, {there}, and this is {here}: {end}"

"""What a results file and a journal hold as JSON, and the form that each has to have."""

from collections.abc import Mapping
from typing import Any

from flocsim.ensembles.chunks import NOTE
from flocsim.io.json_text import matches, read_json

CPU = {"cpu": str, "compiled_for": str, "features": [str], "numpy": [str], "libm": [str]}
SESSION = {"identity": {}, "short": str, "layout": str, "date": str, "command": str}
"""The description of a journal's session, as a pattern of `flocsim.io.json_text`."""

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

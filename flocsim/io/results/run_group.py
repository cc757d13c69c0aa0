"""The group ``run`` of a results file: where a result came from, config, seed, versions, machine,
date and command line; what it and a journal have as JSON, the form of each, and in words.
"""

import contextlib
import datetime
import platform
import re
import shlex
import sys
from collections.abc import Mapping, Sequence
from importlib import metadata
from typing import Any

from flocsim.io.json_text import read_json

NOTE = {"type": str, "vertices": int, "delta": float, "replicate": int, "why": str}
"""What is kept of a failed replicate, as a pattern of `flocsim.io.json_text`."""

SESSION_FORM = {"identity": {}, "layout": str, "date": str, "command": str, "processor": str}
"""The description of a journal's session, as a pattern of `flocsim.io.json_text`."""

FORMS: dict[str, Any] = {
    "identity": {}, "failed": [NOTE], "history": [{}], "overrides": {}, "warnings": [str],
    "settling": [object], "size_classes": [{}], "equivalent_spheres": [object],
}  # fmt: skip
"""Names in the group ``run`` of what it has as JSON, and their patterns."""


def stored(run: Mapping[str, Any], name: str) -> Any:
    """Return what the group ``run`` of a results file has as JSON under a name of FORMS, empty
    where it has none.

    Raises ValueError, naming it, for a text that no flocsim wrote.
    """
    form = FORMS[name]
    try:
        return read_json(run[name], form) if name in run else type(form)()
    except ValueError as error:
        raise ValueError(f"run/{name} cannot be read: {error}") from error


def describe_note(note: dict) -> str:
    """Return a failed replicate for messages, with the words that run it again."""
    why = re.sub("^too deep", "overlap exceeded half the summed spheroradii", note["why"])
    return (
        f"{why} (flocsim trajectory CONFIG --type {note['type']} --vertices {note['vertices']} "
        f"--delta {note['delta']!r} --replicate {note['replicate']})"
    )


def class_words(facts: Sequence[dict]) -> str:
    """Return size classes in a line; "" where there is one at most."""
    told = (
        f"{each['label']} {1e6 * each['low']:.4g} to {1e6 * each['high']:.4g} um "
        f"({each['flocs']} flocs)"
        for each in facts
    )
    return f"size classes, r_eq: {', '.join(told)}" if len(facts) > 1 else ""


def sphere_words(facts: dict) -> str:
    """Return the facts of one collision type in a line."""
    free, touch, stability = (
        "no number" if facts[name] is None else f"{facts[name]:.4g}"
        for name in ("free", "touch", "stability")
    )
    return (
        f"released {1e6 * facts['release']:.4g} um apart, escaped at {1e6 * facts['escape']:.4g} "
        f"um, D = {facts['diffusion']:.4g} m2/s; equivalent spheres touch with probability {free} "
        f"without forces between them, {touch} with them; stability ratio W = {stability}"
    )


def water_words(facts: dict) -> str:
    """Return the facts of one collision type in a line."""
    return (
        f"{facts['type']}: equivalent spheres touch {facts['water']:.4g} times as often as on "
        f"undisturbed paths with the water between them, {facts['alone']:.4g} times without it"
    )


SOURCE = ("shapes", "preset", "flocsim_version")
"""Names in the group ``run`` of what the source line is made of."""


def source_line(run: Mapping[str, Any], counts: Sequence[int] = ()) -> str:
    """Return which preset, flocs, replicates and version results are of, as far as it is known.

    ``run``: the group; ``counts``: numbers of replicates of the conditions.

    >>> run = {"shapes": "12 flocs of shapes.h5", "preset": "si", "flocsim_version": "0.2.0"}
    >>> source_line(run, [60, 60])
    'preset si · 12 flocs of shapes.h5 · n = 60 · flocsim 0.2.0'
    """
    least, most = (min(counts), max(counts)) if len(counts) else ("", "")
    n = f"{least}" if least == most else f"{least} to {most}"
    forms = {"preset {}": run.get("preset"), "{}": run.get("shapes"), "n = {}": n,
             "flocsim {}": run.get("flocsim_version")}  # fmt: skip
    return " · ".join(form.format(value) for form, value in forms.items() if value)


PACKAGES = ("flocsim", "numpy", "numba", "h5py")


def provenance(config_text: str, seed: int, kernel_fingerprint: str = "") -> dict[str, str | int]:
    """Return the scalars of the group ``run`` of a results file.

    ``config_text`` is the config file as the user wrote it, ``seed`` the whole number that keys
    all random draws, ``kernel_fingerprint`` the hash of the compiled kernels' source. Returns a
    dict of text and numbers: config, seed, kernel_fingerprint, <package>_version, python_version,
    processor, platform, hostname, date [UTC, ISO 8601] and command. No package is imported for it.
    """
    versions = {f"{name}_version": package_version(name) for name in PACKAGES}
    facts = {
        "config": config_text,
        "seed": int(seed),
        "kernel_fingerprint": kernel_fingerprint,
        **versions,
        "python_version": platform.python_version(),
        "processor": processor(),
        "platform": platform.platform(),
        "hostname": platform.node(),
        "date": now(),
        "command": shlex.join(sys.argv),
    }
    return {name: storable(value) for name, value in facts.items()}


def now() -> str:
    """Return date and time [UTC, ISO 8601]."""
    return datetime.datetime.now(datetime.UTC).isoformat(timespec="seconds")


def package_version(name: str) -> str:
    """Return the installed version; for a package run from its folder, what it says of itself."""
    try:
        return metadata.version(name)
    except metadata.PackageNotFoundError:
        return str(getattr(sys.modules.get(name), "__version__", "unknown"))


def processor() -> str:
    """Return the processor's name, as far as the system gives it."""
    with contextlib.suppress(OSError), open("/proc/cpuinfo", encoding="utf-8") as file:
        for line in file:
            if line.startswith("model name"):
                return line.partition(":")[2].strip()
    return platform.processor() or platform.machine()


def storable(value: Any) -> Any:
    """Return text without the lone surrogates and zero characters that HDF5 cannot hold."""
    if not isinstance(value, str):
        return value
    return value.encode("utf-8", "replace").decode().replace("\0", "?")

"""The group ``run`` of a results file: where a result came from, config, seed, versions, machine,
date and command line; and what it says as JSON, in words.
"""

import contextlib
import datetime
import platform
import re
import shlex
import sys
from collections.abc import Sequence
from importlib import metadata
from typing import Any


def describe_note(note: dict) -> str:
    """A failed replicate for messages, with the words that run it again."""
    why = re.sub("^too deep", "overlap exceeded half the summed spheroradii", note["why"])
    return (
        f"{why} (flocsim trajectory CONFIG --scene "
        f"{note['type']},{note['vertices']},{note['delta']!r} --replicate {note['replicate']})"
    )


def class_words(facts: Sequence[dict]) -> str:
    """Size classes in a line; "" where there is one at most."""
    told = (
        f"{each['label']} {1e6 * each['low']:.4g} to {1e6 * each['high']:.4g} um "
        f"({each['flocs']} flocs)"
        for each in facts
    )
    return f"size classes, r_eq: {', '.join(told)}" if len(facts) > 1 else ""


def sphere_words(facts: dict) -> str:
    """The facts of one collision type in a line."""
    free, touch, stability = (
        "no number" if facts[name] is None else f"{facts[name]:.4g}"
        for name in ("free", "touch", "stability")
    )
    return (
        f"released {1e6 * facts['release']:.4g} um apart, escaped at {1e6 * facts['escape']:.4g} "
        f"um, D = {facts['diffusion']:.4g} m2/s; equivalent spheres touch with probability {free} "
        f"without forces between them, {touch} with them; stability ratio W = {stability}"
    )


def choice_lines(record: dict) -> list[str]:
    """A choice for people: a line for each type, and one on what was asked for."""
    lines = []
    for each in record["types"]:
        mine = [tried for tried in each["tried"] if tried["method"] == each["method"]]
        seen = ", ".join(f"{tried['flips']} at {tried['tolerance']:g} m" for tried in mine)
        from_pilot = f"of {each['replicates']} replicates {seen}" if seen else "no pilot: too few"
        lines.append(
            f"{each['name']}: {each['method']}, {each['tolerance']:g} m, expected flips "
            f"{100.0 * each['expected']:.2g} % ({from_pilot})"
            + ("" if each["bound"] <= record["target"] else "; the tightest setting")
        )
    lines.append(
        f"target: flips below {100.0 * record['target']:.2g} %, a fifth of a sampling error of "
        f"{100.0 * record['half_width']:.2g} %"
    )
    return lines


def water_words(facts: dict) -> str:
    """The facts of one collision type in a line."""
    return (
        f"{facts['type']}: equivalent spheres touch {facts['water']:.4g} times as often as on "
        f"undisturbed paths with the water between them, {facts['alone']:.4g} times without it"
    )


PACKAGES = ("flocsim", "numpy", "numba", "h5py")


def provenance(config_text: str, seed: int, kernel_fingerprint: str = "") -> dict[str, str | int]:
    """Scalars for the group ``run`` of a results file.

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
    """Date and time [UTC, ISO 8601]."""
    return datetime.datetime.now(datetime.UTC).isoformat(timespec="seconds")


def package_version(name: str) -> str:
    """The installed version; for a package run from its folder, what it says of itself."""
    try:
        return metadata.version(name)
    except metadata.PackageNotFoundError:
        return str(getattr(sys.modules.get(name), "__version__", "unknown"))


def processor() -> str:
    """The processor's name, as far as the system gives it."""
    with contextlib.suppress(OSError), open("/proc/cpuinfo", encoding="utf-8") as file:
        for line in file:
            if line.startswith("model name"):
                return line.partition(":")[2].strip()
    return platform.processor() or platform.machine()


def storable(value: Any) -> Any:
    """Text without the lone surrogates and zero characters that HDF5 cannot hold."""
    if not isinstance(value, str):
        return value
    return value.encode("utf-8", "replace").decode().replace("\0", "?")

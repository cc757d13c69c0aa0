"""Where a result came from: config, seed, versions, machine, date and command line."""

import contextlib
import datetime
import platform
import shlex
import sys
from importlib import metadata
from typing import Any

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

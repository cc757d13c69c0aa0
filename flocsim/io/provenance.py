"""Where a result came from: config, seed, versions, machine, date and command line."""

import datetime
import platform
import shlex
import sys
from importlib import metadata

PACKAGES = ("flocsim", "numpy", "numba", "h5py")


def provenance(config_text, seed, kernel_fingerprint=""):
    """Scalars for the group ``run`` of a results file.

    ``config_text`` is the config file as the user wrote it, ``seed`` the whole number that keys
    all random draws, ``kernel_fingerprint`` the hash of the compiled kernels' source. Returns a
    dict of text and numbers: config, seed, kernel_fingerprint, <package>_version, python_version,
    platform, hostname, date [UTC, ISO 8601] and command. No package is imported for it.
    """
    versions = {f"{name}_version": package_version(name) for name in PACKAGES}
    facts = {
        "config": config_text,
        "seed": int(seed),
        "kernel_fingerprint": kernel_fingerprint,
        **versions,
        "python_version": platform.python_version(),
        "platform": platform.platform(),
        "hostname": platform.node(),
        "date": datetime.datetime.now(datetime.UTC).isoformat(timespec="seconds"),
        "command": shlex.join(sys.argv),
    }
    return {name: storable(value) for name, value in facts.items()}


def package_version(name):
    """The installed version; for a package run from its folder, what it says of itself."""
    try:
        return metadata.version(name)
    except metadata.PackageNotFoundError:
        return str(getattr(sys.modules.get(name), "__version__", "unknown"))


def storable(value):
    """Text without the lone surrogates and zero characters that HDF5 cannot hold."""
    if not isinstance(value, str):
        return value
    return value.encode("utf-8", "replace").decode().replace("\0", "?")

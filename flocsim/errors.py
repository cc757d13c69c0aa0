"""Every error that a user can meet, each with the exit code that the command line gives it.

A message is one line: what was found, where, and what to do about it.
"""


class FlocsimError(Exception):
    """The root of all flocsim's errors; the command line prints its message and no traceback."""

    exit_code = 70


class UsageError(FlocsimError):
    """A wrong argument, of a command or of a library call."""

    exit_code = 2


class ConfigError(UsageError):
    """Wrong entries of a config file; each line names the key, the finding, the remedy."""


class RangeError(UsageError, ValueError):
    """A value outside what a field takes."""


class ShapeError(UsageError, ValueError):
    """Vertices or a radius that do not make a body."""


class KernelError(UsageError):
    """A force's kernel that cannot be used: it names the force, the file and the line."""


class ImageError(UsageError):
    """A file that holds no usable picture, or a picture without usable regions."""


class FileError(FlocsimError, OSError):
    """A file that could not be read or written."""

    exit_code = 74


class ZoneError(UsageError):
    """There is no attraction zone: the attraction and the repulsion never balance."""

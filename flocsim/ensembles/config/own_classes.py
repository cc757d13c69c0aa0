"""A user's own force classes, named in the config as "module:Class"."""

import contextlib
import importlib
import importlib.util
import inspect
import os
import sys
import traceback
from pathlib import Path

import attrs

from flocsim.ensembles.config.values import misfit
from flocsim.errors import ConfigError
from flocsim.forces import BodyForce, ContactForce, Force, PairForce

KINDS = (BodyForce, PairForce, ContactForce)
SOURCE = "__flocsim_source__"


def load_force_class(name, folder):
    """The force class ``name`` = "module:Class"; the module lies in ``folder`` or is installed.

    Misfit for a name of another form. ConfigError, of one line without the key, for a module that
    is missing or raises, and for a class that is missing or is no force.
    """
    module_name, class_name = split_name(name)
    module = load_module(module_name, folder)
    if not hasattr(module, class_name):
        known = [key for key, value in vars(module).items() if is_own_force(value, module)]
        raise ConfigError(
            f"{described(module)} has no {class_name!r}; its forces: {', '.join(known) or 'none'}"
        )
    return checked(getattr(module, class_name), f"{class_name} of {described(module)}")


def split_name(name):
    """("module", "Class") of "module:Class"."""
    module_name, _, class_name = name.partition(":")
    if not all(part.isidentifier() for part in [*module_name.split("."), class_name]):
        raise misfit("'module:Class' such as 'mine:Yukawa'", name)
    return module_name, class_name


def load_module(name, folder):
    """The module, from ``folder`` where a file of its name lies there, else as installed."""
    path = folder / f"{name}.py"
    try:
        with searched_first(folder):
            return run_file(name, path) if path.is_file() else importlib.import_module(name)
    except (Exception, SystemExit) as error:
        raise ConfigError(why_not(name, folder, error)) from error


@contextlib.contextmanager
def searched_first(folder):
    """Let a module import its neighbours while it loads, and leave sys.path as it was."""
    entry = str(folder.resolve())
    sys.path.insert(0, entry)
    try:
        yield
    finally:
        with contextlib.suppress(ValueError):
            sys.path.remove(entry)


def run_file(name, path):
    """Run a module's file, under its name in sys.modules so that pickle and inspect find it.

    A file that has not changed is not run again. It is compiled here: Python's cache tells
    versions by a time in whole seconds and could bring back the physics before the last edit.
    """
    file, source = str(path.resolve()), path.read_bytes()
    known = sys.modules.get(name)
    if known is not None and is_current(known, file, source):
        return known
    spec = importlib.util.spec_from_file_location(name, file)
    module = importlib.util.module_from_spec(spec)
    sys.modules[name] = module
    try:
        exec(compile(source, file, "exec"), vars(module))
    except BaseException:
        del sys.modules[name]
        raise
    setattr(module, SOURCE, (file, source))
    return module


def is_current(known, file, source):
    """Whether a loaded module is what the file holds; ConfigError if it is somebody else's."""
    if hasattr(known, SOURCE):
        return getattr(known, SOURCE) == (file, source)
    if os.path.realpath(getattr(known, "__file__", None) or "") == file:
        return True
    raise ConfigError(f"{file} has the name of a module that is already loaded: rename it")


def why_not(name, folder, error):
    """One line on why a module could not be loaded, with the file and line that raised."""
    if isinstance(error, ConfigError):
        return str(error)
    if isinstance(error, ModuleNotFoundError) and f"{name}.".startswith(f"{error.name}."):
        return f"there is no module {name!r}, neither {folder / name}.py nor installed"
    what = " ".join(f"{type(error).__name__}: {error}".split())
    if isinstance(error, SyntaxError) and error.filename:
        what = f"{error.filename}:{error.lineno}: {error.msg}"
    elif frame := frame_to_blame(error, folder):
        what = f"{frame.filename}:{frame.lineno}: {what}"
    return f"importing module {name!r} failed: {what}"


def frame_to_blame(error, folder):
    """The innermost frame in the user's folder, else the innermost that is not Python's import."""
    frames = [
        frame
        for frame in traceback.extract_tb(error.__traceback__)
        if frame.filename != __file__ and not frame.filename.startswith("<")
    ]
    own = [frame for frame in frames if Path(frame.filename).parent == folder.resolve()]
    return next(reversed(own or frames), None)


def described(module):
    """A module for messages."""
    return f"module {module.__name__!r} ({getattr(module, '__file__', None) or 'built in'})"


def is_own_force(value, module):
    """Whether the value is a force class that the module itself defines."""
    return (
        inspect.isclass(value) and issubclass(value, Force) and value.__module__ == module.__name__
    )


def checked(force_class, where):
    """The class, once it is found to be a force that can be made; else ConfigError."""
    if not (inspect.isclass(force_class) and issubclass(force_class, KINDS)):
        raise ConfigError(
            f"{where} is no force: subclass flocsim.forces.BodyForce, CentreForce, SurfaceForce "
            "or ContactForce"
        )
    if force_class.kernel is Force.kernel:
        raise ConfigError(f"{where} has no static method `kernel`, which computes the force")
    if "__attrs_attrs__" not in vars(force_class):
        raise ConfigError(f"{where} is not decorated: put @attrs.frozen above the class")
    return force_class


def force_fields(force_class):
    """Key in the config → attrs field, for all fields that the class is made with."""
    return {field.alias: field for field in attrs.fields(force_class) if field.init}

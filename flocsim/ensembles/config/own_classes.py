"""Classes of a user's own, named in the config as "module:Class": forces, integrators, shapes.

The module lies beside the config file or is installed; the attrs fields of the class are its keys.
"""

import contextlib
import importlib
import inspect
import os
import sys
import traceback
from numbers import Real
from pathlib import Path
from typing import Any

import attrs
import numpy as np

from flocsim.ensembles.config.sources import Neighbours, Sources, place
from flocsim.ensembles.config.values import misfit
from flocsim.errors import ConfigError
from flocsim.fields import is_number
from flocsim.forces import BodyForce, ContactForce, PairForce
from flocsim.geometry.shapes.shape import Shape
from flocsim.integrators import Integrator


@attrs.frozen
class Kind:
    """What a class named in the config has to be, and how messages call it."""

    name: str
    bases: tuple[type, ...]
    advice: str
    example: str


FORCE = Kind(
    "force",
    (BodyForce, PairForce, ContactForce),
    "flocsim.forces.BodyForce, CentreForce, SurfaceForce or ContactForce",
    "mine:Yukawa",
)
INTEGRATOR = Kind(
    "integrator", (Integrator,), "flocsim.integrators.Integrator", "mine:SemiImplicitEuler"
)
SHAPE = Kind("shape", (Shape,), "flocsim.geometry.shapes.shape.Shape", "mine:Rod")


def named_class(kind: Kind, help: str) -> dict[str, Any]:
    """Metadata of a field for an object of the class that the key ``class`` names."""
    return {"key": "class", "own": kind, "allowed": '`"module:Class"`', "help": help}


def full_name(own: object) -> str:
    """ "module:Class" of an object."""
    return f"{type(own).__module__}:{type(own).__qualname__}"


def load_class(name: object, folder: Path, kind: Kind, sources: Sources) -> type:
    """The class ``name`` = "module:Class" of a Kind; the module lies in ``folder`` or is installed.

    ``sources``: what of it has been read already, by rank 0 of a job. Misfit for a name of another
    form. ConfigError, of one line without the key, for a module that
    is missing or raises, and for a class that is missing, of another kind, or not whole.
    """
    if not isinstance(name, str):
        raise misfit("a string 'module:Class'", name)
    module_name, _, class_name = name.partition(":")
    if not all(part.isidentifier() for part in [*module_name.split("."), class_name]):
        raise misfit(f"'module:Class' such as {kind.example!r}", name)
    module = load_module(name, folder, sources)
    where = f"module {module.__name__!r} ({getattr(module, '__file__', None) or 'built in'})"
    if not hasattr(module, class_name):
        known = [
            key
            for key, value in vars(module).items()
            if inspect.isclass(value)
            and issubclass(value, kind.bases)
            and value.__module__ == module.__name__
        ]
        raise ConfigError(
            f"{where} has no {class_name!r}; its {kind.name}s: {', '.join(known) or 'none'}"
        )
    found = getattr(module, class_name)
    wrong = why_unfit(found, kind)
    if wrong:
        raise ConfigError(f"{class_name} of {where} {wrong}")
    return found


def why_unfit(found, kind):
    """What is wrong with a class of this kind, in words; "" where nothing is."""
    if not (inspect.isclass(found) and issubclass(found, kind.bases)):
        return f"is not a subclass of {kind.advice}"
    if inspect.isabstract(found):
        return f"does not define {', '.join(sorted(found.__abstractmethods__))}"
    if "__attrs_attrs__" not in vars(found):
        return "is not decorated: put @attrs.frozen above the class"
    return ""


def check_integrator(integrator: Integrator) -> None:
    """ConfigError unless an integrator of the user's own has all that the driver reads of it."""
    for name in ("tolerance", "first_step", "largest_step"):
        value: Any = getattr(integrator, name)
        if isinstance(value, bool) or not isinstance(value, Real) or not float(value) > 0.0:
            raise ConfigError(f"{name} must be a number above 0, found {value!r}")
    dict(integrator.fillings)  # what it raises is told like a wrong value


def check_shape(shape: Shape) -> None:
    """ConfigError unless a shape of the user's own is one that can be a body of any size."""
    points = np.asarray(shape.vertices, float)
    if points.ndim != 2 or points.shape[1] != 2 or not np.isfinite(points).all():
        raise ConfigError(
            f"vertices must be finite core points of shape (N, 2), found {points.shape}"
        )
    if len(points) < 2:
        raise ConfigError(
            "one core point is a sphere: leave class out and give vertices = [1], or have two "
            "core points and more"
        )
    for name in ("radius", "area", "second_moment"):
        value = getattr(shape, name)
        if not is_number(value) or value <= 0.0:
            raise ConfigError(f"{name} must be a finite number above 0, found {value!r}")
    larger = shape.scaled(2.0)
    if not np.isclose(larger.equivalent_radius, 2.0 * shape.equivalent_radius, rtol=1e-9, atol=0):
        raise ConfigError("scaled(2.0) must return a shape of four times the area")


def load_module(name, folder, sources):
    """Import the module of a class: of ``folder`` where it has a file of that name, else as
    installed. A stored config imports only what is allowed, or ConfigError.

    Files are run anew where they have changed. sys.path is left as it was; ``sources`` has all
    that was read.
    """
    named, (name, _, _) = name, name.partition(":")
    allowed, before = sources.allowed, sys.path[:]
    finder = Neighbours(sources, folder.resolve())
    importlib.invalidate_caches()
    try:
        if allowed is None or name not in allowed.own:
            file = finder.file_of(name)
            if allowed is not None and (allowed.folder is None or file is None):
                raise ConfigError(refusal(named, allowed.folder))
            finder.forget_changed()
            if file is not None:
                refuse_namesake(name.partition(".")[0], finder)
            sys.meta_path.insert(0, finder)
            # Extension modules and folders without __init__.py are found by Python itself.
            sys.path[:0] = [str(finder.folder)] if allowed is None else []
        module = importlib.import_module(name)
        # The source of what lies elsewhere is known by its name.
        source = getattr(module, "__file__", None) or ""
        if source.endswith(".py") and place(source, folder) not in sources.modules:
            with contextlib.suppress(OSError):
                sources.modules[module.__name__] = Path(source).read_bytes()
        sources.named.add(name)
        return module
    except (Exception, SystemExit) as error:
        raise ConfigError(why_not(name, folder, error)) from error
    finally:
        sys.path[:] = before
        with contextlib.suppress(ValueError):
            sys.meta_path.remove(finder)


def refusal(name, folder):
    """Why a class of a stored config was not loaded, and how to allow it, in one line."""
    module, lacking = name.partition(":")[0], f"{folder} does not have it; " if folder else ""
    return (
        f"{name} was not loaded, because a file does not decide which code is run: {lacking}"
        'name the folder that its module is in (--folder DIR, or folder="DIR") or, if it is '
        f'installed, the module (--own {module}, or own=["{module}"])'
    )


def refuse_namesake(top, finder):
    """ConfigError where a module of this name, but not of this file, is loaded already."""
    file, known = finder.file_of(top), getattr(sys.modules.get(top), "__file__", None) or ""
    if top in sys.modules and os.path.realpath(known) != os.path.realpath(file):
        raise ConfigError(f"{file} has the same name as a module that is already loaded: rename it")


def why_not(name, folder, error):
    """One line on why a module could not be loaded, with the file and line that raised."""
    if isinstance(error, ConfigError):
        return str(error)
    if isinstance(error, ModuleNotFoundError) and f"{name}.".startswith(f"{error.name}."):
        return f"there is no module {name!r}, neither {folder / name}.py nor installed"
    what = " ".join(f"{type(error).__name__}: {error}".split())
    if isinstance(error, SyntaxError) and error.filename:
        what = f"{error.filename}:{error.lineno}: {error.msg}"
    else:
        # The innermost frame in the user's folder, or that is not Python's import.
        frames = [each for each in traceback.extract_tb(error.__traceback__)
                  if each.filename != __file__ and not each.filename.startswith("<")]  # fmt: skip
        own = [each for each in frames if Path(each.filename).parent == folder.resolve()]
        for frame in (own or frames)[-1:]:
            what = f"{frame.filename}:{frame.lineno}: {what}"
    return f"importing module {name!r} failed: {what}"

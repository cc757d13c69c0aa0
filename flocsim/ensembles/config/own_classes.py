"""Classes of a user's own, named in the config as "module:Class": forces, integrators, shapes.

The module lies beside the config file or is installed; the attrs fields of the class are its keys.
"""

import contextlib
import importlib
import inspect
import sys
import traceback
from numbers import Real
from pathlib import Path
from typing import Any

import numpy as np

from flocsim.ensembles.config.sources import Neighbours, Sources, place
from flocsim.errors import ConfigError, suggestion
from flocsim.fields import is_number, refused
from flocsim.forces import BodyForce, ContactForce, PairForce
from flocsim.geometry.shapes.shape import Shape
from flocsim.integrators import Integrator

FORCE = (BodyForce, PairForce, ContactForce)
"""The classes of which a force of the user's own is a subclass."""


def full_name(own: object) -> str:
    """Return "module:Class" of an object."""
    return f"{type(own).__module__}:{type(own).__qualname__}"


def load_class(name: object, folder: Path, bases: tuple[type, ...], sources: Sources) -> type:
    """Return the class ``name`` = "module:Class", from ``folder`` or as installed.

    ``sources``: what of it has been read already, by rank 0 of a job. RangeError for a name of
    another form. ConfigError, of one line without the key, for a module that is missing or raises,
    and for a class that is missing, not a subclass of ``bases``, or not whole.
    """
    module_name, _, class_name = name.partition(":") if isinstance(name, str) else ("", "", "")
    if not all(part.isidentifier() for part in [*module_name.split("."), class_name]):
        raise refused("class", "'module:Class'", name)
    module = load_module(str(name), folder, sources)
    where = f"module {module.__name__!r} ({getattr(module, '__file__', None) or 'built in'})"
    found: Any = getattr(module, class_name, None)
    if found is None:
        raise ConfigError(f"{where} has no {class_name!r}{suggestion(class_name, vars(module))}")
    wrong = ""
    if not (isinstance(found, type) and issubclass(found, bases)):
        names = " or ".join(f"{each.__module__}.{each.__qualname__}" for each in bases)
        wrong = f"is not a subclass of {names}"
    elif inspect.isabstract(found):
        lacking = getattr(found, "__abstractmethods__", ())
        wrong = f"does not define {', '.join(sorted(lacking))}"
    elif "__attrs_attrs__" not in vars(found):
        wrong = "is not decorated: put @attrs.frozen above the class"
    if wrong:
        raise ConfigError(f"{class_name} of {where} {wrong}")
    return found


def check_integrator(integrator: Integrator) -> None:
    """ConfigError unless an integrator of the user's own has all that the driver reads of it."""
    for name in ("tolerance", "first_step", "largest_step"):
        value: Any = getattr(integrator, name)
        if isinstance(value, bool) or not isinstance(value, Real) or not float(value) > 0.0:
            raise ConfigError(f"{name} must be a number above 0, found {value!r}")
    dict(integrator.fillings)  # what it raises is reported like a wrong value


def check_shape(shape: Shape) -> None:
    """ConfigError unless a shape of the user's own is one that can be a body of any size."""
    points = np.asarray(shape.vertices, float)
    if points.ndim != 2 or points.shape[1] != 2 or not np.isfinite(points).all():
        raise ConfigError(f"vertices must be finite points of shape (N, 2), found {points.shape}")
    if len(points) < 2:
        raise ConfigError("one core point is a sphere: leave class out and give vertices = [1]")
    for name in ("radius", "area", "second_moment"):
        value = getattr(shape, name)
        if not is_number(value) or value <= 0.0:
            raise ConfigError(f"{name} must be a finite number above 0, found {value!r}")
    larger = shape.scaled(2.0)
    if not np.isclose(larger.equivalent_radius, 2.0 * shape.equivalent_radius, rtol=1e-9, atol=0):
        raise ConfigError("scaled(2.0) must return a shape of four times the area")


def load_module(named: str, folder: Path, sources: Sources) -> Any:
    """Import the module of a class, of ``folder`` if it has a file of that name, else as installed.

    A stored config imports only what is allowed, or ConfigError. Files are run anew where they have
    changed. sys.path is left as it was; ``sources`` has all that was read.
    """
    name, allowed, before = named.partition(":")[0], sources.allowed, sys.path[:]
    finder = Neighbours(sources, folder.resolve())
    importlib.invalidate_caches()
    try:
        if allowed is None or name not in allowed.own:
            file = finder.file_of(name)
            if allowed is not None and (allowed.folder is None or file is None):
                lacking = f"{allowed.folder} does not have it; " if allowed.folder else ""
                raise ConfigError(
                    f"{named} was not loaded, because a file does not decide which code is run: "
                    f"{lacking}"
                    'name the folder that its module is in (--folder DIR, or folder="DIR") or, if '
                    f'it is installed, the module (--own {name}, or own=["{name}"])'
                )
            finder.forget_changed()
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
    except ConfigError:
        raise
    except (Exception, SystemExit) as error:
        if isinstance(error, ModuleNotFoundError) and f"{name}.".startswith(f"{error.name}."):
            what = f"there is no module {name!r}, neither {folder / name}.py nor installed"
            raise ConfigError(what) from error
        # The innermost line of the user's own that raised.
        lines = [
            f"{each.filename}:{each.lineno}: "
            for each in traceback.extract_tb(error.__traceback__)
            if Path(each.filename).is_relative_to(folder.resolve())
        ]
        what = " ".join(f"{''.join(lines[-1:])}{type(error).__name__}: {error}".split())
        raise ConfigError(f"importing module {name!r} failed: {what}") from error
    finally:
        sys.path[:] = before
        with contextlib.suppress(ValueError):
            sys.meta_path.remove(finder)

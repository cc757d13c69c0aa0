"""A config file → Config: TOML, with what lies under it (the preset) and over it (`--set`), made
into the classes of the schema; every problem reported at once, with its line.
"""

import contextlib
import copy
import os
from collections.abc import Iterable, Iterator, Mapping, Sequence
from operator import itemgetter
from pathlib import Path
from typing import Any

import attrs

from flocsim.body import Fluid
from flocsim.ensembles.config.own_classes import FORCE, load_class
from flocsim.ensembles.config.pair_scene import (
    MEASURED,
    SOBOL,
    SOBOL_SCRAMBLES,
    PairScene,
    Problem,
    applies,
    uneven_points,
)
from flocsim.ensembles.config.schema import (
    BAND,
    EXCLUSIVE,
    FOLLOWING,
    FORCES,
    PRESETS,
    SCENES,
    STUDY_KEYS,
    TABLES,
    TOP_KEYS,
    Config,
    keys_of,
)
from flocsim.ensembles.config.sources import Sources
from flocsim.ensembles.config.toml_text import STANDARD_INPUT, key_lines, parse
from flocsim.errors import ConfigError, suggestion, visible
from flocsim.fields import is_number, list_words, number, refused, several
from flocsim.io.shape_library import NAME_OF_SHIPPED, SHIPPED

MOST_SHOWN = 50
"""Problems of one file that are reported."""


def value_at(table: Any, name: str) -> Any:
    """Return the value of a dotted key in nested dicts; None where there is none."""
    for key in name.split("."):
        table = table.get(key) if isinstance(table, Mapping) else None
    return table


def lay_over(below: Mapping[str, Any], above: Mapping[str, Any]) -> dict[str, Any]:
    """Return nested dicts with everything that ``above`` gives put over them.

    A key replaces those below that it excludes, or that follow from it. A value None in ``above``
    counts as not given.
    """
    merged: dict[str, Any] = copy.deepcopy(dict(below))
    replaced = [*EXCLUSIVE, *((other, key) for key, other in EXCLUSIVE)]
    replaced += [(each, key) for key, sources in FOLLOWING.items() for each in sources]
    for key, gone in replaced:
        table, _, last = gone.rpartition(".")
        inner = value_at(merged, table)
        if value_at(above, key) is not None and isinstance(inner, dict):
            inner.pop(last, None)
    return merge(merged, above)


def merge(below: dict[str, Any], above: Mapping[str, Any]) -> dict[str, Any]:
    """Put every value of nested dicts into others, in place; tables are merged."""
    for key, value in above.items():
        if isinstance(value, Mapping):
            inner = below.get(key)
            below[key] = merge(inner if isinstance(inner, dict) else {}, value)
        elif value is not None:
            below[key] = value
    return below


def parse_setting(text: str) -> tuple[list[str], Any]:
    """Return (keys, value) of "scene.delta=[0.0, 0.5]"; a value that is no TOML is a string.

    So `--set forces.contact.k_n='10 N/m'` needs no quotes within quotes.
    """
    key, equals, value = text.partition("=")
    keys = [part.strip() for part in key.split(".")]
    if not equals or not all(keys):
        raise ConfigError(f"--set {text!r}: write KEY=VALUE, e.g. --set scene.delta='[0.0, 0.5]'")
    try:
        table = parse("--set", f"value = {value.strip()}\n")
    except ConfigError:
        table = {}
    return keys, table["value"] if len(table) == 1 else value.strip()


def nested(settings: Iterable[tuple[list[str], Any]]) -> dict[str, Any]:
    """Return {"scene": {"delta": …}} of (keys, value) pairs; later ones win."""
    table: dict[str, Any] = {}
    for keys, value in settings:
        for key in reversed(keys):
            value = {key: value}
        merge(table, value)
    return table


def settings_in(texts: Iterable[str]) -> dict[str, Any]:
    """Return the nested dict that texts such as "scene.delta=[0.0, 0.5]" give."""
    return nested(map(parse_setting, texts))


def read_value(value: Any, field: attrs.Attribute) -> Any:
    """Return the value of a field as its reader has it.

    A field that declares none, of a user's own class, takes a number, a text, a flag or numbers.
    """
    if "reader" in field.metadata:
        return field.metadata["reader"].read(value, field.name)
    if isinstance(value, list):
        return several(number(), distinct=False).read(value, field.name)
    is_float = field.type in (float, "float")
    if "own" in field.metadata or (isinstance(value, str | bool) and not is_float):
        return value
    if not is_number(value):
        hint = " (the field declares no unit: see flocsim.fields.quantity)"
        allowed = "a finite number in SI units"
        raise refused(field.name, allowed, value, hint if isinstance(value, str) else "")
    return float(value) if is_float else value


def problem(place: str, error: Exception) -> Problem:
    """Return what an error says of a key or a table."""
    # A user's class may raise anything; attrs puts the text first, then objects.
    text = error.args[0] if error.args and isinstance(error.args[0], str) else error
    text = " ".join(str(text).split()) or type(error).__name__
    key = place.rpartition(".")[2]
    begins = text.startswith((f"{key} ", f"{key}["))
    return place, text.removeprefix(key) if begins else f": {text}"


def unknown(place: str, known: Iterable[str]) -> Problem:
    """Return what is said of an unknown key."""
    table, _, key = place.rpartition(".")
    owners = [kind for kind, each in SCENES.items() if table == "scene" and key in keys_of(each)]
    if owners:
        return place, f": applies only with kind = {list_words(owners)}: remove it"
    return place, f": unknown key{suggestion(key, known)}; known: {', '.join(known) or 'none'}"


@attrs.define
class Reading:
    """Makes the parts of a Config of nested dicts; what is wrong is noted in ``found``.

    ``folder`` is where the file lies, and the modules and libraries that it names; ``sources`` has
    what was read of them.
    """

    folder: Path
    sources: Sources
    found: list[Problem] = attrs.Factory(list)

    def note(self, place: str, text: str) -> None:
        """Note what is wrong at a dotted key."""
        self.found.append((place, text))

    def parts(self, table: dict[str, Any]) -> dict[str, Any]:
        """Return the arguments of Config that a whole file gives."""
        self.found += [unknown(key, TOP_KEYS) for key in table if key not in TOP_KEYS]
        # Of two keys that exclude each other the second is reported, and left out of what follows.
        for key, other in EXCLUSIVE:
            if value_at(table, key) is not None and value_at(table, other) is not None:
                around, _, last = other.rpartition(".")
                del value_at(table, around)[last]
                word = key.removeprefix(f"{around}.")
                self.note(other, f": excludes {word}, which is given too: remove one of them")
        parts: dict[str, Any] = {}
        for key in STUDY_KEYS.keys() & table.keys():
            try:
                parts[key] = STUDY_KEYS[key].metadata["reader"].read(table[key], key)
            except ValueError as error:
                self.found.append(problem(key, error))
        scene = SCENES.get(str(value_at(table, "scene.kind")), PairScene)
        where = value_at(table, "scene.pairs"), value_at(table, "shapes.source")
        if where == (MEASURED, "library"):
            table["shapes"].setdefault("size", "own")
        for name, some_class in (TABLES | {"scene": scene}).items():
            parts[name] = self.made(some_class, table.get(name, {}), name)
        if parts["shapes"] is not None and parts["shapes"].source == "library":
            file = self.library(parts["shapes"].file)
            parts["shapes"] = attrs.evolve(parts["shapes"], file=file)
        if parts["fluid"] is not None:
            self.add_water(table, parts["fluid"])
        forces = self.forces(table.get("forces", {}))
        return parts | {"forces": tuple(forces.values()), "force_names": tuple(forces)}

    def made(self, some_class: type, table: Any, place: str) -> Any:
        """Return an object of a class with the values of a table; None where something is wrong."""
        if not isinstance(table, dict):
            return self.note(place, f"{refused('', f'a table [{place}]', table)}")
        keys, given = keys_of(some_class), dict(table)
        if "class" in keys and "class" in table:
            # All keys but those of flocsim that stay beside it are the parameters of that class.
            beside = {key for key, field in keys.items() if field.metadata.get("beside_class")}
            own = {key: given.pop(key) for key in table if key not in beside}
            given["class"] = self.own_object(keys["class"].metadata["own"], own, place)
            if given["class"] is None:
                return None
            for key in beside & keys_of(type(given["class"])).keys():
                text = f": {key} is a key of flocsim's own: rename the field"
                return self.note(f"{place}.class", text)
        # A key that applies only with another one may be given where it changes nothing.
        for key, field in keys.items():
            other, words, elsewhere = field.metadata.get("only_for", ("", (), None))
            if other and key in given:
                usual = keys[other].metadata.get("usual", keys[other].default)
                if not applies(table.get(other, usual), words):
                    value = given.pop(key)
                    with contextlib.suppress(ValueError):
                        value = field.metadata["reader"].read(value, key)
                    if value != elsewhere:
                        text = f": applies only with {other} = {list_words(words)}: remove it"
                        self.note(f"{place}.{key}", text)
        # All keys are read before the class is made, so that all problems are reported at once.
        count = len(self.found)
        values: dict[str, Any] = {}
        needed = [key for key, field in keys.items() if field.default is attrs.NOTHING]
        if lacking := [key for key in needed if key not in given]:
            self.note(place, f": needs {', '.join(lacking)}")
        for key, value in given.items():
            inner = f"{place}.{key}"
            if key not in keys:
                self.found.append(unknown(inner, keys))
            elif isinstance(value, dict) and "table" in keys[key].metadata:
                values[str(keys[key].alias)] = self.made(keys[key].metadata["table"], value, inner)
            else:
                try:
                    values[str(keys[key].alias)] = read_value(value, keys[key])
                except ValueError as error:
                    self.found.append(problem(inner, error))
        if len(self.found) > count:
            return None
        try:
            return some_class(**values)
        except Exception as error:  # of a class of the user's own, too
            # What a class says of its values together may begin with a key.
            word = str(error).partition(" ")[0]
            self.found.append(problem(f"{place}.{word}" if word in keys else place, error))

    def own_object(self, bases: tuple[type, ...], table: dict[str, Any], place: str) -> Any:
        """Return an object of the user's class that a table names; None if something is wrong."""
        try:
            own_class = load_class(table["class"], self.folder, bases, self.sources)
        except (ConfigError, ValueError) as error:
            return self.found.append(problem(f"{place}.class", error))
        parameters = {key: value for key, value in table.items() if key != "class"}
        return self.made(own_class, parameters, place)

    def library(self, name: Any) -> Any:
        """Return the path of a shape library, pinned; noted where there is none."""
        path = self.folder / name
        if str(name) == NAME_OF_SHIPPED and not os.path.lexists(path):
            return SHIPPED
        if not os.path.isfile(path):
            text = f": {path} is not a file: name a library written by `flocsim fit`, or "
            self.note("shapes.file", f'{text}"{NAME_OF_SHIPPED}", the one included in flocsim')
        return self.sources.library(path)

    def add_water(self, table: dict[str, Any], fluid: Fluid) -> None:
        """Put what follows from the water into the tables of forces; note it where it is given."""
        for name, sources in FOLLOWING.items():
            around, _, key = name.rpartition(".")
            inner = value_at(table, around)
            given = [each for each in sources if value_at(table, each) is not None]
            if around == "fluid" or not given or not isinstance(inner, dict):
                continue
            value = getattr(fluid, key)
            if key in inner:
                self.note(name, f": follows from {given[0]}, which gives {value:.4g}: remove it")
            elif value is not None:
                inner[key] = value

    def forces(self, tables: Any) -> dict[str, Any]:
        """Return {name: force} in the fixed order, then the user's own as in the file."""
        if not isinstance(tables, dict):
            self.note("forces", f"{refused('', 'tables [forces.NAME]', tables)}")
            return {}
        made = {}
        for name in dict.fromkeys(name for name in (*FORCES, *tables) if name in tables):
            place, table = f"forces.{name}", tables[name]
            if name in FORCES:
                made[name] = None if table is False else self.made(FORCES[name], table, place)
            elif isinstance(table, dict) and "class" in table:
                made[name] = self.own_object(FORCE, table, place)
            else:
                known = f"known: {', '.join(FORCES)}, or one of your own by class = 'module:Class'"
                self.note(place, f": unknown force{suggestion(name, FORCES)}; {known}")
        if not tables or all(table is False for table in tables.values()):
            text = ": there are none: add [forces.gravity], [forces.drag], …, or a preset"
            self.note("forces", text)
        return {name: force for name, force in made.items() if force is not None}


def load_config(
    path: str | os.PathLike, overrides: dict | None = None, sources: Sources | None = None
) -> Config:
    """Read the config of a study of pairs or kernels.

    Parameters
    ----------
    path : path
        TOML file.
    overrides : dict, optional
        Nested dict of values that replace those of the file; None counts as not given.
    sources : Sources, optional
        Texts of the file and of modules that have already been read.

    Returns
    -------
    Config
        Checked, with the values of its preset filled in; SI units.

    Raises
    ------
    ConfigError
        If a value is wrong, with one line per problem; also for a study of another kind.
    """
    config = load_any_config(path, overrides, sources)
    if not isinstance(config.scene, PairScene):
        text = f'{path} has scene.kind = "{config.scene.kind}", and is not one of two bodies: '
        raise ConfigError(text + "run it with `flocsim ensemble`")
    return config


def load_any_config(
    path: str | os.PathLike, overrides: dict | None = None, sources: Sources | None = None
) -> Config:
    """Return the config file at ``path`` as a Config, checked and with its preset filled in.

    ``overrides``: nested dict laid over the file, e.g. ``{"output": {"file": "b.h5"}}``; None
    values in it count as not given. ``sources``: what of the file and of the modules that it names
    has been read already; all that is read now is noted there. Raises ConfigError with one line per
    problem, "FILE:LINE: key …: what was found, what is allowed". The Config's ``scene`` is one of
    SCENES.
    """
    sources, overrides = sources or Sources(), overrides or {}
    text, folder = sources.text(path), Path(path).parent
    reading = Reading(folder, sources)
    try:
        given = lay_over(parse(path, text), overrides)
        parts = reading.parts(lay_over(PRESETS.get(str(given.get("preset")), {}), given))
    except RecursionError as error:
        raise ConfigError(f"{path}: nested too deeply") from error
    found = reading.found
    if any(place not in TABLES and "." not in place and place != "forces" for place, _ in found):
        # Without the preset that was meant, what it would have given is not missing.
        found = [each for each in found if each[0] not in ("bodies", "forces")]
    refuse(found, path, text, overrides)
    if value_at(given, "output.file") is None:
        stem = "study" if str(path) == STANDARD_INPUT else Path(path).stem
        parts["output"] = attrs.evolve(parts["output"], file=f"{stem}.h5")
    config = Config(
        text=text, folder=folder, overrides=overrides, modules=dict(sources.modules), **parts
    )
    found = [(place, f": {words}") for place, words in contradictions(config, given)]
    refuse(found, path, text, overrides)
    return config


def refuse(
    found: Sequence[Problem], path: str | os.PathLike, text: str, overrides: Mapping[str, Any]
) -> None:
    """Raise ConfigError with one line per problem, in the order of the file; nothing without."""
    lines, located = key_lines(text) if found else {}, []
    for place, words in found[:MOST_SHOWN]:
        around = place
        while around and around not in lines:
            around = around.rpartition(".")[0]
        number = lines.get(around, 0)
        where = f"{path}:{number}" if number else f"{path}"
        if value_at(overrides, place) is not None:
            where, number = f"override of {path}", -1
        shown = place if place.isprintable() else repr(place)[1:-1]
        located.append((number, visible(f"{where}: {shown}{words}", keep="")))
    if located:
        raise ConfigError("\n".join(line for _, line in sorted(located, key=itemgetter(0))))


def contradictions(config: Config, given: Mapping[str, Any]) -> Iterator[Problem]:
    """Yield what does not go together though each table is right by itself."""
    for name in sorted(config.scene.without & given.keys()):
        yield name, f"is for binary collisions: leave it out of a {config.scene.kind}"
    density, fluid = config.bodies.density, config.fluid
    solid: Any = getattr(density, "solid", density)
    if fluid.buoyancy and solid is None:
        yield "fluid.buoyancy", "true needs bodies.density in the place of surface_density"
    elif fluid.buoyancy and solid <= fluid.density:
        text = f"{solid:g} kg/m^3 does not sink in the fluid of {fluid.density:g} kg/m^3: "
        yield "bodies.density", text + "give a larger density, or fluid.buoyancy = false"
    if config.sampling == SOBOL and config.scene.kind == "binary":
        yield from uneven_points(config, SOBOL_SCRAMBLES, f"{SOBOL_SCRAMBLES} scrambles")
    if config.shapes.outlines == BAND and config.scene.kind != "binary":
        text = '"band" is for studies of two bodies: run this one with "closer" and with "wider"'
        yield "shapes.outlines", text
    yield from config.scene.problems(config)

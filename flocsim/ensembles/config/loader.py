"""A config file → Config: TOML read strictly, every problem told at once with its line; what
is laid over it, preset, file, `--set key=value` of the command line; what keys exclude and imply.
"""

import os
from collections.abc import Collection, Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any

import attrs

from flocsim.body import Fluid, FractalDensity
from flocsim.ensembles.config import toml_text
from flocsim.ensembles.config.own_classes import FORCE, load_class
from flocsim.ensembles.config.pair_scene import (
    MEASURED,
    PAIR_SCENES,
    SOBOL,
    SOBOL_SCRAMBLES,
    PairScene,
    Problem,
    SettlingScene,
    uneven_points,
)
from flocsim.ensembles.config.presets import PRESETS
from flocsim.ensembles.config.schema import (
    ALTERNATIVES,
    BAND,
    FOLLOWING,
    FORCES,
    INSTEAD_OF,
    SCENES,
    SOBOL_REPLICATES,
    STUDY_KEYS,
    TABLES,
    TOP_KEYS,
    WATER,
    BodiesConfig,
    Config,
    keys_of,
)
from flocsim.ensembles.config.sources import Sources
from flocsim.ensembles.config.values import (
    Misfit,
    Problems,
    dotted,
    misfit,
    reader_of,
    show,
)
from flocsim.errors import ConfigError, suggestion
from flocsim.fields import list_words
from flocsim.io.shape_library import NAME_OF_SHIPPED, SHIPPED


def lay_over(below: Mapping, above: Mapping, path: tuple[str, ...] = ()) -> dict[str, Any]:
    """``below`` with everything that ``above`` gives put over it; tables are merged.

    A key replaces those below that it excludes, or that follow from it. A value None in ``above``
    counts as not given. A table over ``false`` starts afresh.
    """
    given = {key: value for key, value in above.items() if value is not None}
    gone = excluded_by(".".join(path), given.keys())
    merged = {key: value for key, value in below.items() if key not in gone}
    merged = merged if path else without_following(merged, given)
    for key, value in given.items():
        if isinstance(value, dict) and len(path) < toml_text.DEEPEST_TABLE:
            under = merged.get(key)
            value = lay_over(under if isinstance(under, dict) else {}, value, (*path, key))
        merged[key] = value
    return merged


def excluded_by(table: str, given: Collection[str]) -> set[str]:
    """The keys of a table that do not go with the given ones."""
    alternatives = ALTERNATIVES.get(table, ())
    chosen = [keys for keys in alternatives if keys & set(given)]
    found = set().union(*(keys for keys in alternatives if chosen and keys not in chosen))
    for key, others in INSTEAD_OF.get(table, {}).items():
        found |= others if key in given else set()
        found |= {key} if others & set(given) else set()
    return found


def without_following(below: Mapping[str, Any], above: Mapping[str, Any]) -> dict[str, Any]:
    """A config's nested dicts without what follows from the water that those above them tell."""
    left: dict[str, Any] = dict(below)
    fluid = above.get("fluid")
    told = {key for key in WATER if isinstance(fluid, Mapping) and fluid.get(key) is not None}
    for (*tables, key), sources in FOLLOWING.items() if told else ():
        table = left
        for name in tables:
            inner = table.get(name)
            if not isinstance(inner, Mapping):
                break
            table[name] = table = dict(inner)
        else:
            if told & set(sources):
                table.pop(key, None)
    return left


def of_water(fluid: Fluid) -> dict[tuple[str, str], float]:
    """(force, key) → value that follows from the water: each holds where its force is."""
    values = {
        ("double_layer", "permittivity"): fluid.permittivity,
        ("double_layer", "debye_length"): fluid.debye_length,
        ("thermal", "temperature"): fluid.temperature,
    }
    told = {key for key in WATER if getattr(fluid, key) is not None}
    return {
        place: value
        for place, value in values.items()
        if value is not None and told & set(FOLLOWING["forces", *place])
    }


def implied(table: Mapping[str, Any]) -> dict[str, Any]:
    """Values that follow from others of a config's nested dicts, where they are not given."""
    scene, shapes = (table.get(name) for name in ("scene", "shapes"))
    found: dict[str, Any] = {}
    if usual := scene_class(table).usual_replicates:
        found["replicates"] = usual
    elif table.get("sampling") == SOBOL:
        found["replicates"] = SOBOL_REPLICATES
    if not isinstance(scene, Mapping) or not isinstance(shapes, Mapping):
        return found
    if scene.get("pairs") != MEASURED or shapes.get("source") != "library":
        return found
    return found | {"shapes": {"size": "own"}}


def scene_class(table: Mapping[str, Any]) -> Any:
    """The class of a config's [scene], by its kind and meeting; of unknown ones SettlingScene,
    whose keys tell that."""
    scene = table.get("scene")
    given = scene if isinstance(scene, Mapping) else {}
    kind, meeting = (str(given.get(key)) for key in ("kind", "meeting"))
    if kind in SCENES and kind not in PAIR_SCENES:
        return SCENES[kind]
    return PAIR_SCENES.get(meeting, SettlingScene)


def elsewhere(key: str, scene: type) -> dict[str, attrs.Attribute]:
    """{`meeting = "brownian"`: field} of every other kind of [scene] that has a key."""
    found = {}
    for word, each in SCENES.items():
        if key in keys_of(each):
            tag = f'kind = "{word}"'
            if word in PAIR_SCENES:
                binary = scene in PAIR_SCENES.values()
                tag = f'meeting = "{word}"' if binary else 'kind = "binary"'
            found[tag] = keys_of(each)[key]
    return found


def parse_setting(text: str) -> tuple[list[str], Any]:
    """(keys, value) of "scene.delta=[0.0, 0.5]"; a value that is no TOML is a string.

    So `--set forces.contact.k_n='10 N/m'` needs no quotes within quotes.
    """
    key, equals, value = text.partition("=")
    keys = [part.strip() for part in key.split(".")]
    if not equals or not all(keys):
        raise ConfigError(f"--set {text!r}: write KEY=VALUE, e.g. --set scene.delta='[0.0, 0.5]'")
    value = value.strip()
    try:
        table = toml_text.parse("--set", f"value = {value}\n")
    except ConfigError:
        return keys, value
    return keys, table["value"] if len(table) == 1 else value


def nested(settings: Iterable[tuple[list[str], Any]]) -> dict[str, Any]:
    """{"scene": {"delta": …}} of (keys, value) pairs; ConfigError where two cannot both hold."""
    table: dict[str, Any] = {}
    for keys, value in settings:
        inner = table
        for key in keys[:-1]:
            inner = inner.setdefault(key, {})
            if not isinstance(inner, dict):
                raise ConfigError(f"--set {'.'.join(keys)}: {key} has been set to a value already")
        inner[keys[-1]] = value
    return table


DEFAULTS = {"source": "synthetic"}
"""Of keys that others go with."""


def load_config(
    path: str | os.PathLike, overrides: dict | None = None, sources: Sources | None = None
) -> Config:
    """The config file of a study of binary collisions: see `load_any_config`; ConfigError for one
    of another kind."""
    config = load_any_config(path, overrides, sources)
    if not isinstance(config.scene, PairScene):
        kind = config.scene.kind
        raise ConfigError(
            f'{path} describes a study of kind "{kind}" (scene.kind), not one of two bodies: '
            "run it with `flocsim ensemble`, and look at its results with `flocsim info` and "
            "`flocsim plot`"
        )
    return config


def load_any_config(
    path: str | os.PathLike, overrides: dict | None = None, sources: Sources | None = None
) -> Config:
    """The config file at ``path`` as a Config, checked and with its preset filled in.

    ``overrides``: nested dict laid over the file, e.g. ``{"output": {"file": "b.h5"}}``; None
    values in it count as not given. ``sources``: what of the file and of the modules that it names
    has been read already; all that is read now is noted there. Raises ConfigError with one line per
    problem, "FILE:LINE: key …: what was found, what is allowed". The Config's ``scene`` is one of
    SCENES.
    """
    sources = sources or Sources()
    text = sources.text(path)
    overrides, folder = overrides or {}, Path(path).parent
    problems = Problems(file=str(path), text=text, overrides=overrides)
    table = lay_over(toml_text.parse(path, text), overrides)
    given, preset = table.keys(), table.get("preset")
    if isinstance(preset, str):
        table = lay_over(PRESETS.get(preset, {}), table)
    table = lay_over(implied(table), table)
    reader = Reader(folder, problems, sources)
    scene = scene_class(table)
    for name in scene.without & given:
        problems.note(
            (name,), f"is for binary collisions: leave it out of a {table['scene']['kind']}"
        )
    parts = reader.config_parts(table)
    problems.raise_if_any()
    if "file" not in table.get("output", {}):
        stem = "study" if str(path) == toml_text.STANDARD_INPUT else Path(path).stem
        parts["output"] = attrs.evolve(parts["output"], file=f"{stem}.h5")
    return Config(
        text=text, folder=folder, overrides=overrides, modules=dict(sources.modules), **parts
    )


@attrs.frozen
class Reader:
    """Reads the tables of one config file; what is wrong is noted in ``problems`` and left out.

    ``folder`` is where the file lies, and the modules and libraries that it names; ``sources`` has
    what was read of them.
    """

    folder: Path
    problems: Problems
    sources: Sources

    def config_parts(self, table):
        for key in table:
            if key not in TOP_KEYS:
                self.problems.unknown((key,), TOP_KEYS)
        given = {key: table[key] for key in STUDY_KEYS if key in table}
        parts = self.values(STUDY_KEYS, given, ())
        for name, table_class in (TABLES | {"scene": scene_class(table)}).items():
            parts[name] = self.table(name, table_class, table.get(name, {}))
        forces = self.forces(self.in_water(table.get("forces", {}), parts["fluid"]))
        parts |= {"forces": tuple(forces.values()), "force_names": tuple(forces)}
        if not self.problems.at("preset", "bodies", "fluid", "scene", "shapes"):
            for place, text in contradictions(parts):
                self.problems.note(place, text)
        return parts

    def table(self, name, table_class, table):
        """One top-level table as its class; None where something in it is wrong."""
        if not isinstance(table, dict):
            self.problems.misfit((name,), misfit(f"a table [{name}]", table))
            return None
        keys, own = keys_of(table_class), {}
        self.check_alternatives(name, table, keys)
        if "class" in keys and "class" in table:
            beside = [key for key, field in keys.items() if field.metadata.get("beside_class")]
            others = {*beside, *set().union(*ALTERNATIVES[name])} - {"class"}
            parameters = {key: table[key] for key in table if key not in others}
            table = {key: table[key] for key in beside if key in table}
            kind = keys["class"].metadata["own"]
            own = {"own": self.own_object(kind, (name,), parameters, beside)}
        if name == "scene":
            table = self.without_keys_of_others(table_class, table)
        values = self.values(keys, table, (name,)) | own
        if "file" in values and values.get("source") == "library":
            values["file"] = self.library(values["file"])
        # Without the preset that was meant, what it would have given is not missing.
        if self.problems.at(name) or (name == "bodies" and self.problems.at("preset")):
            return None
        return self.made(table_class, values, (name,))

    def without_keys_of_others(self, scene, table):
        """The table [scene] without the keys of other kinds of it, each of which is noted unless
        it says what is so anyway."""
        fixed = {each.name: each.default for each in attrs.fields(scene) if not each.init}
        others = {key: elsewhere(key, scene) for key in table if key not in keys_of(scene)}
        owners = {key: found for key, found in others.items() if found}
        for key, found in owners.items():
            try:
                said = reader_of(next(iter(found.values())))(table[key])
            except Misfit as error:
                self.problems.misfit(("scene", key), error)
                continue
            if said != fixed.get(key):
                self.problems.note(
                    ("scene", key), f"applies only with {' or '.join(found)}: remove it"
                )
        return {key: value for key, value in table.items() if key not in owners}

    def check_alternatives(self, name, table, keys):
        present = [sorted(each & table.keys()) for each in ALTERNATIVES.get(name, ())]
        first, *others = [each for each in present if each] or [[]]
        for key in [key for each in others for key in each]:
            text = f"excludes {first[0]}, which is given too: remove one of them"
            self.problems.note((name, key), text)
        for key, against in INSTEAD_OF.get(name, {}).items():
            # A class of the user's own may have parameters of these names.
            for other in sorted(against & table.keys()) if key in table and not others else ():
                text = f"excludes {key}, which is given too: remove one of them"
                self.problems.note((name, other), text)
        for key in [key for key in table if key in keys and "class" not in table]:
            other, word = keys[key].metadata.get("only_for", ("", ""))
            given = table.get(other, DEFAULTS.get(other))
            if other and given != word:
                found = f"but {other} is {show(given)}" if given else f"and there is no {other}"
                self.problems.note(
                    (name, key), f'applies only with {other} = "{word}", {found}: remove it'
                )

    def library(self, name):
        path = self.folder / name
        if str(name) == NAME_OF_SHIPPED and not os.path.lexists(path):
            return SHIPPED
        if not os.path.isfile(path):
            what = "is not an ordinary file" if os.path.exists(path) else "does not exist"
            text = (
                f"{path} {what}; name a library written by `flocsim fit`, or "
                f'"{NAME_OF_SHIPPED}", the one included in flocsim'
            )
            self.problems.note(("shapes", "file"), text)
        return self.sources.library(path)

    def in_water(self, table, fluid):
        """The tables of the forces with what follows from the water; noted where it is given."""
        found = table if isinstance(table, dict) else {}
        for (name, key), value in (of_water(fluid) if fluid else {}).items():
            if not isinstance(found.get(name), dict):
                continue
            if key in found[name]:
                text = f"follows from the water of [fluid], which gives {value:.4g}: remove it"
                self.problems.note(("forces", name, key), text)
            found = found | {name: {key: value} | found[name]}
        return found or table

    def forces(self, table):
        """{name: force} in the fixed order, then the user's own as in the file."""
        if not isinstance(table, dict):
            self.problems.misfit(("forces",), misfit("tables [forces.NAME]", table))
            return {}
        names = [*(n for n in FORCES if n in table), *(n for n in table if n not in FORCES)]
        made = {name: self.force(name, table[name]) for name in names}
        made = {name: force for name, force in made.items() if force is not None}
        if not made and not self.problems.at("preset", "forces"):
            self.problems.note(
                ("forces",), "there are none: add [forces.gravity], [forces.drag], …, or a preset"
            )
        return made

    def force(self, name, table):
        """The force of the table [forces.NAME], None where it is left out or wrong."""
        place = ("forces", name)
        if table is False and name in FORCES:
            return None
        if not isinstance(table, dict):
            hint = suggestion(name, FORCES) if name not in FORCES else ""
            wrong = misfit(f"a table [{dotted(place)}] or false", table, hint)
            self.problems.misfit(place, wrong)
            return None
        if name in FORCES:
            return self.object_of(FORCES[name], table, place)
        if "class" in table:
            return self.own_object(FORCE, place, table)
        self.problems.note(
            place,
            f"unknown force{suggestion(name, FORCES)}; known: {list_words(FORCES)}; a force of "
            "your own needs class = 'module:Class'",
        )
        return None

    def own_object(self, kind, place, table, beside=()):
        """An object of the user's own class that a table names; ``beside`` are keys of flocsim's.

        None, and a note, where something is wrong with it.
        """
        try:
            own_class = load_class(table["class"], self.folder, kind, self.sources)
        except Misfit as error:
            self.problems.misfit((*place, "class"), error)
            return None
        except ConfigError as error:
            self.problems.note((*place, "class"), str(error))
            return None
        taken = [key for key in keys_of(own_class) if key in beside]
        if taken:
            self.problems.note(
                (*place, "class"),
                f"its parameter {taken[0]} has the same name as one of flocsim's own keys: rename "
                "it",
            )
            return None
        parameters = {key: value for key, value in table.items() if key != "class"}
        return self.object_of(own_class, parameters, place, beside)

    def object_of(self, some_class, table, place, beside=()):
        """An object of the class with the values of a table; None where something is wrong."""
        before = len(self.problems.found)
        values = self.values(keys_of(some_class), table, place, beside)
        fine = len(self.problems.found) == before
        return self.made(some_class, values, place) if fine else None

    def values(self, keys, table, place, beside=()):
        """Key → value of every key of a table that is known and fits."""
        values = {}
        for key, value in table.items():
            if key not in keys:
                self.problems.unknown((*place, key), [*keys, *beside])
                continue
            try:
                values[key] = reader_of(keys[key])(value)
            except Misfit as error:
                self.problems.misfit((*place, key), error)
        missing = [
            key + field.metadata.get("as_in", "")
            for key, field in keys.items()
            if field.default is attrs.NOTHING and key not in table
        ]
        if missing:
            self.problems.note(place, f"needs {', '.join(missing)}")
        return values

    def made(self, some_class, values, place):
        """An object of the class; None, and a note, where it refuses the values together."""
        try:
            return some_class(**values)
        except Exception as error:
            # A user's class may raise anything; attrs puts the text first, then objects.
            text = error.args[0] if error.args and isinstance(error.args[0], str) else error
            self.problems.note(place, " ".join(str(text).split()) or type(error).__name__)
            return None


def contradictions(parts: Mapping[str, Any]) -> Iterator[Problem]:
    """What does not go together though each is right by itself; ``parts``: a config's tables."""
    yield from weight_contradictions(parts["bodies"], parts["fluid"])
    if parts.get("sampling") == SOBOL and isinstance(parts["scene"], tuple(PAIR_SCENES.values())):
        yield from uneven_points(parts, SOBOL_SCRAMBLES, f"{SOBOL_SCRAMBLES} scrambles")
    if parts["shapes"].outlines == BAND and parts["scene"].kind != "binary":
        text = '"band" is for studies of two bodies; run this one with "closer" and with "wider"'
        yield ("shapes", "outlines"), f"{text}, and compare the results"
    yield from parts["scene"].problems(parts)


def weight_contradictions(bodies: BodiesConfig, fluid: Fluid) -> Iterator[Problem]:
    """What of the bodies' weight does not go with buoyancy."""
    if not fluid.buoyancy:
        return
    if bodies.density is None:
        text = "true needs bodies.density, but bodies.surface_density is given: give density and "
        yield ("fluid", "buoyancy"), text + "depth instead, or buoyancy = false"
        return
    fractal = isinstance(bodies.density, FractalDensity)
    solid = bodies.density.solid if isinstance(bodies.density, FractalDensity) else bodies.density
    if solid <= fluid.density:
        text = f"{solid:g} kg/m^3 does not sink in the fluid of {fluid.density:g} kg/m^3: "
        place = ("bodies", "density", "solid") if fractal else ("bodies", "density")
        yield place, text + "give a larger density, or fluid.buoyancy = false"

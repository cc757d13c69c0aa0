"""A config file → Config: TOML read strictly, every problem told at once with its line."""

import os
from pathlib import Path

import attrs

from flocsim.body import Fluid
from flocsim.ensembles.config.force_tables import read_forces
from flocsim.ensembles.config.layers import clashes, lay_over
from flocsim.ensembles.config.presets import PRESETS
from flocsim.ensembles.config.problems import Problems
from flocsim.ensembles.config.schema import (
    BodiesConfig,
    Config,
    IntegratorConfig,
    OutputConfig,
    SceneConfig,
    ShapesConfig,
    StopConfig,
    ZoneConfig,
)
from flocsim.ensembles.config.tables import make, read_values
from flocsim.ensembles.config.toml_text import parse, read_text_file
from flocsim.ensembles.config.values import (
    Misfit,
    misfit,
    read_choice,
    show,
    suggestion,
)

TABLES = {
    "scene": SceneConfig,
    "shapes": ShapesConfig,
    "bodies": BodiesConfig,
    "fluid": Fluid,
    "zone": ZoneConfig,
    "integrator": IntegratorConfig,
    "stop": StopConfig,
    "output": OutputConfig,
}
"""Name of a top-level table → class; [forces] is read by itself."""

STUDY_KEYS = ("seed", "replicates")
TOP_KEYS = ("preset", *STUDY_KEYS, *TABLES, "forces")
ONLY_FOR = {
    "file": "library",
    "fractal_dimension": "synthetic",
    "primary_particles": "synthetic",
}
"""Key of [shapes] → the only source that it goes with."""


def load_config(path, overrides=None):
    """The config file at ``path`` as a Config, checked and with its preset filled in.

    ``overrides``: nested dict laid over the file, e.g. ``{"output": {"file": "b.h5"}}``; None
    values in it count as not given. Raises ConfigError with one line per problem,
    "FILE:LINE: key …: what was found, what is allowed".
    """
    text = read_text_file(path)
    overrides = overrides or {}
    problems = Problems(file=str(path), text=text, overrides=overrides)
    own = lay_over(parse(path, text), overrides)
    preset = read_preset(own, problems)
    table = lay_over(PRESETS.get(preset, {}), own)
    parts = read_parts(table, Path(path).parent, problems)
    problems.raise_if_any()
    folder = Path(path).parent
    return Config(preset=preset, text=text, folder=folder, overrides=overrides, **parts)


def read_preset(table, problems):
    """The preset's name, None without one or with one that does not exist."""
    try:
        return read_choice(table["preset"], tuple(PRESETS)) if "preset" in table else None
    except Misfit as error:
        problems.misfit(("preset",), error)
        return None


def read_parts(table, folder, problems):
    """Everything of the Config that comes from the tables, by attribute name."""
    for key in [key for key in table if key not in TOP_KEYS]:
        problems.note(
            (key,), f"unknown key{suggestion(key, TOP_KEYS)}; known: {', '.join(TOP_KEYS)}"
        )
    study = {key: attrs.fields_dict(Config)[key] for key in STUDY_KEYS}
    parts = read_values(
        study, {key: table[key] for key in STUDY_KEYS if key in table}, (), problems
    )
    for name, table_class in TABLES.items():
        parts[name] = read_table(name, table_class, table.get(name, {}), folder, problems)
    parts["forces"], parts["force_names"] = read_forces(table.get("forces", {}), folder, problems)
    if not problems.at("preset", "bodies", "fluid"):
        check_buoyancy(parts["bodies"], parts["fluid"], problems)
    return parts


def read_table(name, table_class, table, folder, problems):
    """One top-level table as its class; None where something in it is wrong."""
    if not isinstance(table, dict):
        problems.misfit((name,), misfit(f"a table [{name}]", table))
        return None
    check_keys_agree(name, table, problems)
    values = read_values(attrs.fields_dict(table_class), table, (name,), problems)
    if "file" in values and values.get("source") == "library":
        values["file"] = find_library(folder / values["file"], problems)
    # Without the preset that was meant, what it would have given is not missing.
    if problems.at(name) or (name == "bodies" and problems.at("preset")):
        return None
    return make(table_class, values, (name,), problems)


def check_keys_agree(name, table, problems):
    """Note keys of one table that exclude each other."""
    for key, other in clashes(table, (name,)):
        problems.note((name, key), f"excludes {other}, which is given too: remove one of them")
    if name == "shapes":
        check_source(table, problems)


def check_source(table, problems):
    """Note keys of [shapes] that belong to the other source."""
    source = table.get("source", "synthetic")
    for key in [key for key in ONLY_FOR if key in table and source != ONLY_FOR[key]]:
        text = f'goes with source = "{ONLY_FOR[key]}", but source is {show(source)}: remove it'
        problems.note(("shapes", key), text)


def find_library(path, problems):
    """The path of the shape library, noted where no file is there."""
    if not os.path.isfile(path):
        what = "is no ordinary file" if os.path.exists(path) else "does not exist"
        problems.note(("shapes", "file"), f"{path} {what}; name a library that `flocsim fit` wrote")
    return path


def check_buoyancy(bodies, fluid, problems):
    """Buoyancy needs the density of the solid, and bodies that sink."""
    if not fluid.buoyancy:
        return
    if bodies.density is None:
        problems.note(
            ("fluid", "buoyancy"),
            "true needs bodies.density, but bodies.surface_density is given: give density and "
            "depth instead, or buoyancy = false",
        )
    elif bodies.density <= fluid.density:
        problems.note(
            ("bodies", "density"),
            f"{bodies.density:g} kg/m^3 does not sink in the fluid of {fluid.density:g} kg/m^3: "
            "give a larger density, or fluid.buoyancy = false",
        )

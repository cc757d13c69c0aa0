"""The tables [forces.NAME] of a config file: flocsim's own forces and the user's."""

from flocsim.ensembles.config.own_classes import force_fields, load_force_class
from flocsim.ensembles.config.problems import dotted
from flocsim.ensembles.config.tables import make, read_values
from flocsim.ensembles.config.values import Misfit, list_words, misfit, suggestion
from flocsim.errors import ConfigError
from flocsim.forces import Contact, DoubleLayer, Gravity, StokesDrag, VanDerWaals

FORCES = {
    "gravity": Gravity,
    "drag": StokesDrag,
    "van_der_waals": VanDerWaals,
    "double_layer": DoubleLayer,
    "contact": Contact,
}
"""Name of the table [forces.NAME] → class, in the order of Config.forces."""


def read_forces(table, folder, problems):
    """(forces, names), in the fixed order; what is wrong is noted and left out."""
    if not isinstance(table, dict):
        problems.misfit(("forces",), misfit("tables [forces.NAME]", table))
        return (), ()
    names = [*(name for name in FORCES if name in table), *(n for n in table if n not in FORCES)]
    made = {name: read_force(name, table[name], folder, problems) for name in names}
    made = {name: force for name, force in made.items() if force is not None}
    if not made and not problems.at("preset", "forces"):
        problems.note(
            ("forces",), "there are none: add [forces.gravity], [forces.drag], …, or a preset"
        )
    return tuple(made.values()), tuple(made)


def read_force(name, entry, folder, problems):
    """The force of the table [forces.NAME], None where it is left out or wrong."""
    place = ("forces", name)
    if entry is False and name in FORCES:
        return None
    if not isinstance(entry, dict):
        hint = suggestion(name, FORCES) if name not in FORCES else ""
        problems.misfit(place, misfit(f"a table [{dotted(place)}] or false", entry, hint))
        return None
    force_class = FORCES.get(name) or read_force_class(name, entry, folder, problems)
    if force_class is None:
        return None
    own_key = () if name in FORCES else ("class",)
    values = {key: value for key, value in entry.items() if key not in own_key}
    before = len(problems.found)
    values = read_values(force_fields(force_class), values, place, problems)
    return make(force_class, values, place, problems) if len(problems.found) == before else None


def read_force_class(name, entry, folder, problems):
    """The class of a user's own force, None and a note where there is none."""
    if "class" not in entry:
        known = list_words(FORCES)
        problems.note(
            ("forces", name),
            f"unknown force{suggestion(name, FORCES)}; known: {known}; a force of your own needs "
            "class = 'module:Class'",
        )
        return None
    try:
        if not isinstance(entry["class"], str):
            raise misfit("a string 'module:Class'", entry["class"])
        return load_force_class(entry["class"], folder)
    except Misfit as error:
        problems.misfit(("forces", name, "class"), error)
    except ConfigError as error:
        problems.note(("forces", name, "class"), str(error))
    return None

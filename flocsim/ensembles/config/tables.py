"""One table of a config file: its values, and the object that they make."""

import attrs

from flocsim.ensembles.config.values import Misfit, reader_of, suggestion


def read_values(fields, table, place, problems):
    """Key → value of every key that is known and fits; the others are noted."""
    values = {}
    for key, value in table.items():
        if key not in fields:
            known = f"known: {', '.join(fields)}" if fields else "there are none here"
            problems.note((*place, key), f"unknown key{suggestion(key, fields)}; {known}")
            continue
        try:
            values[key] = reader_of(fields[key])(value)
        except Misfit as error:
            problems.misfit((*place, key), error)
    missing = [key for key, field in fields.items() if is_required(field) and key not in table]
    if missing:
        problems.note(place, f"needs {', '.join(missing)}")
    return values


def is_required(field):
    """Whether an attrs field has no default."""
    return field.default is attrs.NOTHING


def make(some_class, values, place, problems):
    """An object of the class; None, and a note, where it refuses the values together."""
    try:
        return some_class(**values)
    except Exception as error:
        # A user's class may raise anything; attrs puts the text first, then objects.
        text = error.args[0] if error.args and isinstance(error.args[0], str) else error
        problems.note(place, " ".join(str(text).split()) or type(error).__name__)
        return None

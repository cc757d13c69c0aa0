"""Tables laid over one another: preset, config file, command line."""

DEEPEST_TABLE = 2
"""[forces.NAME] lies two keys deep; what is nested further is no table of the schema."""

ALTERNATIVES = {
    ("scene",): ({"types"}, {"pairs"}),
    ("bodies",): ({"surface_density"}, {"density", "depth"}),
    ("zone",): ({"root"}, {"distance"}, {"centre"}),
}
"""Table → sets of keys that exclude each other: one of them replaces the others from below."""


def lay_over(below, above, path=()):
    """``below`` with everything that ``above`` gives put over it; tables are merged.

    A value None in ``above`` counts as not given. A table over ``false`` starts afresh.
    """
    given = {key: value for key, value in above.items() if value is not None}
    gone = replaced(given, path)
    merged = {key: value for key, value in below.items() if key not in gone}
    for key, value in given.items():
        if isinstance(value, dict) and len(path) < DEEPEST_TABLE:
            under = merged.get(key)
            value = lay_over(under if isinstance(under, dict) else {}, value, (*path, key))
        merged[key] = value
    return merged


def replaced(given, path):
    """The keys of a table below that those given above exclude."""
    alternatives = ALTERNATIVES.get(path, ())
    chosen = [keys for keys in alternatives if keys & given.keys()]
    return set().union(*(keys for keys in alternatives if chosen and keys not in chosen))


def clashes(table, path):
    """Pairs (key, key that it excludes) within one table."""
    present = [keys & table.keys() for keys in ALTERNATIVES.get(path, ())]
    first, *others = [sorted(keys) for keys in present if keys] or [[]]
    return [(key, first[0]) for keys in others for key in keys]

"""Generated TOML texts: of any tables, and of one study in every notation that TOML has."""

import json
import string

from hypothesis import strategies as st

SPACE = st.sampled_from(["", " ", "  ", "\t"])
COMMENT = st.sampled_from(["", " # a.b.c.d.e.f.g = [", "  # \"'{", " #"])


def joined(*parts):
    """A strategy of texts made of a text of each part."""
    parts = [st.just(each) if isinstance(each, str) else each for each in parts]
    return st.tuples(*parts).map("".join)


FLOATS = st.floats().map(repr)
NUMBERS = st.one_of(
    FLOATS, st.integers(-(10**9), 10**9).map(str), st.integers(0, 10**6).map(hex),
    st.integers(0, 511).map(oct), st.integers(0, 255).map(bin), st.sampled_from(
        ["+1.5", "1_000", "1e-6", "1E+06", "-0.0", "1_0.0_1", "6.02e2_3", "+inf", "-nan"]
    ),
)  # fmt: skip
DATES = st.one_of(
    st.dates().map(str), st.times().map(str),
    st.datetimes().map(lambda each: each.isoformat("T") + "Z"),
)  # fmt: skip
PLAIN_TEXT = st.text(string.ascii_letters + string.digits + " .,#[]{}=µ", max_size=20)
STRINGS = st.one_of(
    PLAIN_TEXT.map(json.dumps), PLAIN_TEXT.map("'{}'".format),
    PLAIN_TEXT.map("'''\n{}\n'''".format),
    PLAIN_TEXT.map('"""{}\nseed = 3\n[scene]\n"""'.format),
)  # fmt: skip
SCALARS = st.one_of(NUMBERS, DATES, STRINGS, st.sampled_from(["true", "false"]))


def lists(items, **size):
    """Lists on one line and on many, with comments and a last comma."""
    comma = st.sampled_from([", ", ",", ",\n  ", " , # a, b]\n"])
    return st.builds(
        lambda found, comma, last: f"[{comma.join(found)}{last if found else ''}]",
        st.lists(items, **size), comma, st.sampled_from(["", ",", ", # c\n"]),
    )  # fmt: skip


def numbered(prefix, values):
    """{prefix}0 = …, {prefix}1 = …"""
    return [f"{prefix}{number} = {value}" for number, value in enumerate(values)]


INLINE = st.lists(SCALARS, max_size=3).map(
    lambda found: "{ " + ", ".join(numbered("x", found)) + " }"
)
VALUES = st.one_of(
    SCALARS, lists(SCALARS, max_size=30), lists(lists(SCALARS, max_size=3), max_size=4), INLINE
)
KEYS = st.sampled_from(
    ["k", '"k.q"', "'k q'", "k.a", "k . a . b . c . d . e . f", "1.2.3.4.5.6.7.8.9"]
)


@st.composite
def made_tables(draw):
    """Tables of keys, none twice."""
    lines = []
    for table in range(draw(st.integers(0, 3))):
        if table:
            lines.append(draw(st.sampled_from(["[t{}]", "[ t{} . 'u' ]", "[[t{}]]"])).format(table))
        for number, value in enumerate(draw(st.lists(VALUES, max_size=4))):
            key = draw(KEYS)
            lines.append(f"n{number}.{key}{draw(SPACE)}={draw(SPACE)}{value}{draw(COMMENT)}")
    return "\n".join(lines) + draw(st.sampled_from(["", "\n", "\n\n# end"]))


TABLES = made_tables()
"""Valid TOML, but no study."""

PLAIN = """preset = "tang2014"
seed = 7
replicates = 100
[scene]
types = ["I", "III"]
delta = [0.0, 0.1, 0.25, 0.5, 0.75, 1.0, 1.5]
[shapes]
vertices = [1, 4, 16]
radius = 1e-6
[forces.contact]
k_n = 10.0
"""
"""The study that STUDIES write."""

MEANT = "preset", "seed", "replicates", "scene", "shapes", "forces"
"""What is the same of all of them."""


def any_of(*texts):
    return st.sampled_from(texts)


def quoted(word):
    """A word in every kind of quotes."""
    return any_of(f'"{word}"', f"'{word}'", f'"""{word}"""', f"'''{word}'''", f"'''\n{word}'''")


def whole(number):
    """An integer in every notation."""
    digits = "_".join(str(number))
    return any_of(str(number), f"+{number}", digits, hex(number), oct(number), bin(number))


def list_text(items):
    """The given items as a list in any layout."""
    comma = st.sampled_from([", ", ",", ",\n  ", ", # a.b.c.d.e.f.g\n"])
    return st.builds(
        lambda found, comma, last: f"[{comma.join(found)}{last}]",
        st.tuples(*items), comma, any_of("", ",", ", # c\n"),
    )  # fmt: skip


def decimal(number):
    return any_of(repr(number), f"{number:.3f}", f"{number:e}", f"+{number}", f"{number:.6E}")


def entry(key, value, quote=True):
    """A line of a key, perhaps quoted."""
    keys = [key, f'"{key}"', f"'{key}'"] if quote else [key]
    return joined(any_of(*keys), SPACE, "=", SPACE, value, COMMENT, "\n")


@st.composite
def made_studies(draw):
    """The study of PLAIN: its values, keys and tables in any notation and order."""
    top = [
        entry("preset", quoted("tang2014")), entry("seed", whole(7)),
        entry("replicates", whole(100)),
    ]  # fmt: skip
    tables = {
        ("scene",): {
            "types": list_text([quoted("I"), quoted("III")]),
            "delta": list_text(map(decimal, [0.0, 0.1, 0.25, 0.5, 0.75, 1.0, 1.5])),
        },
        ("shapes",): {
            "vertices": list_text(map(whole, [1, 4, 16])),
            "radius": any_of("1e-6", "1.0E-06", "0.000001", "0.000_001", '"1 um"', "'1000 nm'"),
        },
        ("forces", "contact"): {"k_n": any_of("10", "1e1", "0xa", "1_0.0", '"10 N/m"')},
    }  # fmt: skip
    headed, dotted, inline = [], [], []
    for names, keys in tables.items():
        how = draw(st.integers(0, 2))
        if how == 0:
            header = draw(SPACE) + "[" + draw(SPACE) + draw(any_of(".", " . ")).join(names) + "]"
            rows = draw(st.permutations([draw(entry(*each)) for each in keys.items()]))
            headed.append(f"{header}{draw(COMMENT)}\n" + "".join(rows))
        elif how == 1:
            dot = draw(any_of(".", " . "))
            dotted += [
                draw(entry(dot.join([*names, key]), value, quote=False))
                for key, value in keys.items()
            ]
        else:
            rows = [f"{key} = {draw(value)}" for key, value in keys.items()]
            inline.append(".".join(names) + " = { " + ", ".join(rows) + " }\n")
    above = draw(st.permutations([*map(draw, top), *dotted, *inline]))
    return "".join(above) + "".join(draw(st.permutations(headed)))


STUDIES = made_studies()
"""Texts that all describe the study of PLAIN."""

"""The page of all keys, from the schema itself.

Write it anew with `python -m flocsim.ensembles.config.page > docs/config.md`.
"""

import inspect
import re

from flocsim.ensembles.config import presets
from flocsim.ensembles.config.kernel_scene import KernelScene
from flocsim.ensembles.config.presets import PRESETS
from flocsim.ensembles.config.schema import FORCES, STUDY_KEYS, TABLES, keys_of
from flocsim.ensembles.config.swarm_scene import SwarmScene
from flocsim.io.markdown import markdown_table

QUOTED_WORD = re.compile(r"['\"]([^\W\d][\w-]*)['\"]")

INTRODUCTION = """\
# The config file

A study is one TOML file; `flocsim init` writes an example. Every key is listed below with what it
takes, its default and its meaning. (This page is made from the schema by
`python -m flocsim.ensembles.config.page`.)

- **Quantities** are numbers in SI units, or strings with a unit, converted exactly:
  `radius = 1e-6` is `radius = "1 um"`. Units multiply by a space or `*`, divide by `/`, and have
  exponents: `"0.89 mPa s"`, `"1.2 g/cm^3"`, `"1.2 g cm-3"`, `"3 Pa^0.5"`, `"3 m^(1/2)"`. An energy
  may be in kT at a stated temperature: `"4 kT@293K"`. Another dimension is an error. The same texts
  stand in Python: `VanDerWaals(hamaker="5 zJ")`, `Sphere("5 um")`, `system.run("20 ms")`.
- **Nothing is guessed.** Unknown keys are errors, `2.7` and `3.0` are no integers, `true` is no
  number, and there is no `nan` and no `inf`. All errors are told at once, with file and line.
- **Presets** lie under the file: every value that the file gives replaces the preset's. Keys that
  exclude each other (`types` and `pairs`; `surface_density` and `density` with `depth`; `root`,
  `distance` and `centre`; `source` and `class`; `name` with `tolerance` or `step`, `class` and
  `accuracy`) replace each other too.
  `forces.contact = false` leaves out a force that the preset has.
- Without a preset, `[bodies]` needs a mass, and only the forces that have a table act, be the
  table empty.
"""

OWN_CLASSES = """\
## Forces, integrators and shapes of your own

```toml
[forces.steric]
class = "brush:StericBrush"    # brush.py beside the config file, or an installed module
strength = 1e-3
length = "10 nm"

[integrator]
class = "mine:SemiImplicitEuler"
step = "10 ns"                 # a parameter of the class
max_steps = 1_000_000          # flocsim's own key, as without a class

[shapes]
class = "mine:Rod"
slenderness = 4.0              # a parameter of the class
vertices = [1, 2]              # the equivalent sphere, and the rod of two core points
```

The other keys are the attrs fields of the class. A field made with `flocsim.fields.quantity("m")`
takes strings with a unit and checks the dimension; a plain `attrs.field()` takes numbers in SI.

- A **force** is a subclass of `flocsim.forces.BodyForce`, `CentreForce`, `SurfaceForce` or
  `ContactForce`. The name of its table is free, except for the five above.
- An **integrator** is a subclass of `flocsim.integrators.Integrator`.
- A **shape** is a subclass of `flocsim.geometry.shapes.shape.Shape` with two core points or more.
  It is made once and scaled as a whole, so that its r_eq is that of the body: its parameters count
  by their ratios. `vertices` may be its number of core points (the default), 1, or both.
"""


def schema_page() -> str:
    parts = [INTRODUCTION, "## At the top\n", key_table(STUDY_KEYS)]
    tables = TABLES | {f"forces.{name}": force for name, force in FORCES.items()}
    for name, table_class in tables.items():
        parts += [f"## [{name}]\n", about(table_class, name), key_table(keys_of(table_class))]
    for kind, scene in (("a swarm", SwarmScene), ("a kernel study", KernelScene)):
        parts.insert(place_of_shapes(parts), scene_section(kind, scene))
    parts += [OWN_CLASSES, "## Presets\n", about(presets, ""), preset_table()]
    return "\n".join(parts)


def place_of_shapes(parts):
    return parts.index("## [shapes]\n")


def scene_section(kind, scene):
    """The keys of [scene] where it is of another kind."""
    return f"## [scene] of {kind}\n\n{about(scene, 'scene')}\n{key_table(keys_of(scene))}"


def about(documented, name):
    """The docstring as Markdown, without the name of the table that is in the heading."""
    text = inspect.getdoc(documented).removeprefix(f"[{name}]: ").replace("``", "`")
    return text[0].upper() + text[1:] + "\n"


def key_table(keys):
    rows = [
        [f"`{key}`", takes(field), default_of(field), field.metadata.get("help", "")]
        for key, field in keys.items()
    ]
    return markdown_table(["key", "takes", "default", "meaning"], rows) + "\n"


def takes(field):
    metadata = field.metadata
    if metadata.get("flag"):
        return "`true` or `false`"
    words = metadata.get("allowed") or f"a list of {metadata['vector']} numbers"
    words = QUOTED_WORD.sub(r'`"\1"`', words)
    return f"{words} [{metadata['unit']}]" if metadata.get("unit") else words


def default_of(field):
    shown = field.metadata.get("shown") or as_toml(field.default)
    return shown if shown == "none" else f"`{shown}`"


def as_toml(value):
    """A value as TOML writes it; "none" for one that may be left out."""
    if value is None:
        return "none"
    if isinstance(value, tuple):
        return "[" + ", ".join(as_toml(item) for item in value) + "]"
    if isinstance(value, bool):
        return str(value).lower()
    return f'"{value}"' if isinstance(value, str) else repr(value)


def preset_table():
    """Every value of every preset; empty where it does not give a key, "on" for a bare table."""
    columns = [
        {key: "on" if value == {} else as_toml(value) for key, value in flat(preset)}
        for preset in PRESETS.values()
    ]
    keys = list(dict.fromkeys(key for column in columns for key in column))
    rows = [[f"`{key}`", *(column.get(key, "") for column in columns)] for key in keys]
    return markdown_table(["key", *(f"`{name}`" for name in PRESETS)], rows) + "\n"


def flat(table, around=""):
    """(dotted key, value) of all values in a nested table; an empty table is a value."""
    for key, value in table.items():
        if isinstance(value, dict) and value:
            yield from flat(value, f"{around}{key}.")
        else:
            yield f"{around}{key}", value


if __name__ == "__main__":
    print(schema_page(), end="")

"""The rooms of ARCHITECTURE.md: imports go one way, heavyweights stay in their rooms, files small.

Everything is read from the source with `ast`, without importing it.
"""

import ast
import fnmatch
import subprocess
import sys
import tomllib
from functools import cache
from pathlib import Path

import pytest

from flocsim.ensembles.config import STUDIES

ROOT = Path(__file__).resolve().parents[1]

# From the top of the house to its ground: a room may import from the rows below it, never from
# above, and not from a sibling in its row. `flocsim` is the package's own __init__.
ROWS = [
    ["ensemble"],
    ["__main__"],
    ["commands"],
    ["flocsim"],
    ["ensembles"],
    ["brownian", "swarms"],
    ["system"],
    ["trajectories"],
    ["io"],
    ["explain", "run"],
    ["bonds", "plausibility"],
    ["forces", "integrators"],
    ["body"],
    ["hydrodynamics"],
    ["geometry"],
    ["hooks"],
    ["state"],
    ["compiler", "fields", "tasks", "water"],
    ["constants", "errors", "process"],
]

# The same inside a room: its sub-rooms and files. A room's own __init__ may import all of them.
INNER_ROWS = {
    "compiler": [
        ["composer"],
        ["units"],
        ["fingerprint", "table_types"],
        ["accelerator", "by_pointer", "disk_cache", "object_code"],
        ["linker", "processor"],
    ],
    "geometry": [["fit"], ["contact"], ["shapes"]],
    "state": [
        ["work"],
        ["scene"],
        ["declared", "bodies", "clock", "contacts", "outlines", "views"],
        ["records"],
    ],
    "swarms": [
        ["swarm"],
        ["progress"],
        ["placement", "runner"],
        ["islands", "grouping", "together"],
        ["arrays"],
    ],
    "hydrodynamics": [["encounters", "rigid_bodies"], ["pair"], ["panels", "two_spheres"]],
    "integrators": [
        ["explicit"],
        ["implicit"],
        ["parts", "left_out"],
        ["loop"],
        ["backward_euler"],
        ["events"],
        ["exponential"],
        ["radau"],
        ["rhs"],
        ["amplification", "base"],
    ],
    "ensembles": [
        ["sweep"],
        ["cli", "script_study"],
        ["runner"],
        ["strength"],
        [folder.name for folder in STUDIES.values()],
        ["one_table"],
        ["report"],
        ["parallel"],
        ["estimates"],
        ["contents"],
        ["storage"],
        ["study"],
        ["diagnose"],
        ["collision"],
        ["kind"],
        ["config"],
    ],
    "io": [
        ["plots"],
        ["fit_report"],
        ["shape_library", "trajectory"],
        ["images", "results", "journal"],
        ["outputs", "groups", "json_text"],
        ["files", "hdf5", "labelled", "confidence", "terminal"],
        ["seals", "hdf5_child"],
    ],
}

# Slow to import or not always there: at home in these files only, and inside functions only.
HEAVYWEIGHTS = {
    "mpi4py": ["ensembles/parallel/processes.py"],
    "h5py": [
        "io/groups.py",
        "io/hdf5.py",
        "io/hdf5_child.py",
        "io/trajectory.py",
    ],
    "skimage": ["io/images/*.py"],
    "matplotlib": ["io/plots/*.py"],
    "shapely": ["geometry/shapes/outline.py"],
    "pint": ["*"],
    "gsd": ["io/trajectory.py"],
    "xarray": ["io/labelled.py"],
    "pandas": ["io/labelled.py"],
}
MOST_FILES = 16
"""Of a folder: more are found by their prefixes, not by their room."""


@cache
def package_sources():
    """Path inside the package → parsed file, for all of flocsim."""
    files = sorted((ROOT / "flocsim").rglob("*.py"))
    return {
        path.relative_to(ROOT / "flocsim").as_posix(): ast.parse(path.read_text("utf-8"))
        for path in files
    }


@pytest.fixture(scope="module", autouse=True)
def sources_are_let_go():
    """A hundred megabytes of trees are of no use to other tests."""
    yield
    package_sources.cache_clear()
    imports_of.cache_clear()


def room_of(path):
    """The room of a file, given by its path inside the package: "io/plots/style.py" → "io"."""
    first = path.split("/")[0].removesuffix(".py")
    return "flocsim" if first == "__init__" else first


def inner_room_of(path):
    """Its room inside that room: "io/plots/style.py" → "plots"; None for a room's __init__."""
    parts = path.removesuffix(".py").split("/")
    return parts[1] if len(parts) > 1 and parts[1] != "__init__" else None


def level_of(room, rows=ROWS):
    """The row of a room, counted from the top; None for a room that is not in the table."""
    return next((level for level, row in enumerate(rows) if room in row), None)


@cache
def imports_of(path, tree):
    """(line, dotted name) of each import, relative ones and import_module("…") included."""
    return list(find_imports(path, tree))


def find_imports(path, tree):
    here = ["flocsim", *path.split("/")[:-1]]
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            yield from ((node.lineno, alias.name) for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            anchor = here[: len(here) - node.level + 1] if node.level else []
            base = ".".join([*anchor, *filter(None, [node.module])])
            yield from ((node.lineno, f"{base}.{alias.name}") for alias in node.names)
        elif isinstance(node, ast.Call) and node.args:
            name = node.args[0]
            text = isinstance(name, ast.Constant) and isinstance(name.value, str)
            if text and "import" in ast.unparse(node.func):
                yield node.lineno, name.value


def room_imported(name, rooms):
    """The room that a dotted name leads to; None outside flocsim and for its version."""
    parts = name.split(".")
    if parts[0] != "flocsim" or parts[1:] == ["__version__"]:
        return None
    return parts[1] if len(parts) > 1 and parts[1] in rooms else "flocsim"


def wrong_doors(path, tree, rooms):
    """The imports of one file that go up, or sideways into a sibling room."""
    room = room_of(path)
    if level_of(room) is None:
        yield f"flocsim/{path}: no room is called {room}; give it a row in ARCHITECTURE.md and here"
        return
    for line, name in imports_of(path, tree):
        other = room_imported(name, rooms)
        if other == room:
            yield from wrong_inner_door(path, line, name)
        elif (
            other is not None and level_of(other) is not None and level_of(other) <= level_of(room)
        ):
            way = "sideways" if level_of(other) == level_of(room) else "up"
            yield f"flocsim/{path}:{line}: {room} imports {name}: {way} from {room} to {other}"


def wrong_inner_door(path, line, name):
    """The same between the sub-rooms of one room, if they are in the table."""
    rows, here = INNER_ROWS.get(room_of(path)), inner_room_of(path)
    there = (name.split(".")[2:] or [None])[0]
    if rows is None or here is None or here == there:
        return
    if level_of(here, rows) is None:
        yield f"flocsim/{path}: give {here} a row in ARCHITECTURE.md and in INNER_ROWS"
    elif level_of(there, rows) is None:
        yield f"flocsim/{path}:{line}: {here} imports {name}, its own room's __init__"
    elif level_of(there, rows) <= level_of(here, rows):
        yield f"flocsim/{path}:{line}: {here} imports {name}: up or sideways inside {room_of(path)}"


def misplaced_heavyweights(path, tree):
    """The heavyweights that one file imports away from their room, or outside a function."""
    functions = [node for node in ast.walk(tree) if isinstance(node, ast.FunctionDef)]
    for line, name in imports_of(path, tree):
        library = name.split(".")[0]
        homes = HEAVYWEIGHTS.get(library, ["*"])
        if not any(fnmatch.fnmatch(path, home) for home in homes):
            yield f"flocsim/{path}:{line}: {library} belongs in {', '.join(homes)} only"
        inside = any(function.lineno <= line <= function.end_lineno for function in functions)
        if library in HEAVYWEIGHTS and not inside:
            yield f"flocsim/{path}:{line}: import {library} inside the function that needs it"


def refuse(problems, headline=""):
    """Fail with one line per problem."""
    problems = list(problems)
    assert not problems, "\n".join([headline, *problems])


def test_imports_go_down_only():
    sources = package_sources()
    rooms = {room_of(path) for path in sources} | {room for row in ROWS for room in row}
    refuse(text for path, tree in sources.items() for text in wrong_doors(path, tree, rooms))


def test_heavyweights_stay_in_their_rooms():
    sources = package_sources()
    refuse(text for path, tree in sources.items() for text in misplaced_heavyweights(path, tree))


def test_importing_flocsim_loads_no_heavyweight():
    heavy = {*HEAVYWEIGHTS, "numba"}
    code = f"import sys, flocsim.__main__; print(*({heavy} & set(sys.modules)))"
    command = [sys.executable, "-c", code]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    assert not done.stdout.split(), f"importing flocsim also loads {done.stdout}"


def test_folders_can_be_seen_at_a_glance():
    counts = {}
    for path in (ROOT / "flocsim").rglob("*.py"):
        counts[path.parent] = counts.get(path.parent, 0) + 1
    full = (
        f"{folder.relative_to(ROOT)}: {n} files" for folder, n in counts.items() if n > MOST_FILES
    )
    refuse(full, f"folders of more than {MOST_FILES} files:")


def test_every_room_says_what_is_in_it():
    empty = (
        f"flocsim/{path}"
        for path, tree in package_sources().items()
        if path.endswith("__init__.py") and not ast.get_docstring(tree)
    )
    refuse(empty, "rooms without a paragraph that says what is in them:")


def test_version_is_one():
    project = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))["project"]
    body = package_sources()["__init__.py"].body
    stated = [ast.unparse(node) for node in body if isinstance(node, ast.Assign)]
    stated = [text for text in stated if text.startswith("__version__ = '")]
    assert stated in ([], [f"__version__ = '{project['version']}'"]), "pyproject.toml differs"

"""The rooms of ARCHITECTURE.md: imports go one way, heavyweights stay in their rooms, files small.

Everything is read from the source with `ast`, without importing it.
"""

import ast
import fnmatch
import itertools
import subprocess
import sys
import tomllib
from pathlib import Path
from statistics import median

import pytest

ROOT = Path(__file__).resolve().parents[1]

# From the top of the house to its ground: a room may import from the rows below it, never from
# above, and not from a sibling in its row. `flocsim` is the package's own __init__.
ROWS = [
    ["__main__"],
    ["commands"],
    ["ensemble"],
    ["flocsim"],
    ["ensembles"],
    ["system", "io"],
    ["explain"],
    ["forces", "integrators"],
    ["body", "state"],
    ["geometry"],
    [
        "composer",
        "linking",
        "typing_memory",
        "fingerprint",
        "slots",
        "layout",
        "fields",
        "constants",
        "errors",
        "interruption",
    ],
]
SIBLING_IMPORTS = {
    ("composer", "constants"),
    ("composer", "errors"),
    ("composer", "fingerprint"),
    ("composer", "linking"),
    ("composer", "typing_memory"),
    ("fingerprint", "errors"),
    ("fields", "errors"),
}

# Slow to import or not always there: at home in these files only, and inside functions only.
HEAVYWEIGHTS = {
    "mpi4py": ["ensembles/mpi.py"],
    "h5py": ["io/results.py", "io/results_layout.py", "io/shape_library.py", "io/trajectory.py"],
    "skimage": ["io/image_*.py"],
    "matplotlib": ["io/plots.py", "io/plot_*.py"],
    "shapely": ["geometry/outline.py"],
    "pint": ["*"],
}
LONGEST_FILE = 250
MEDIAN_FUNCTION = 10


def package_sources():
    """Path inside the package → parsed file, for all of flocsim."""
    files = sorted((ROOT / "flocsim").rglob("*.py"))
    return {
        path.relative_to(ROOT / "flocsim").as_posix(): ast.parse(path.read_text("utf-8"))
        for path in files
    }


def room_of(path):
    """The room of a file, given by its path inside the package: "io/plots.py" → "io"."""
    first = path.split("/")[0].removesuffix(".py")
    return "flocsim" if first == "__init__" else first


def level_of(room):
    """The row of a room, counted from the top; None for a room that is not in the table."""
    return next((level for level, row in enumerate(ROWS) if room in row), None)


def imports_of(path, tree):
    """(line, dotted name) of each import, relative ones and import_module("…") included."""
    here = ["flocsim", *path.split("/")[:-1]]
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            yield from ((node.lineno, alias.name) for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            anchor = here[: len(here) - node.level + 1] if node.level else []
            base = ".".join([*anchor, *filter(None, [node.module])])
            yield from ((node.lineno, f"{base}.{alias.name}") for alias in node.names)
        elif isinstance(node, ast.Call) and "import" in ast.unparse(node.func) and node.args:
            name = node.args[0]
            if isinstance(name, ast.Constant) and isinstance(name.value, str):
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
        if other in (None, room) or (room, other) in SIBLING_IMPORTS or level_of(other) is None:
            continue
        if level_of(other) <= level_of(room):
            way = "sideways" if level_of(other) == level_of(room) else "up"
            yield f"flocsim/{path}:{line}: {room} imports {name}: {way} from {room} to {other}"


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
    code = f"import sys, flocsim; print(*({set(HEAVYWEIGHTS)} & set(sys.modules)))"
    command = [sys.executable, "-c", code]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    assert not done.stdout.split(), f"`import flocsim` also loads {done.stdout}"


def test_table_agrees_with_architecture_page():
    page = (ROOT / "ARCHITECTURE.md").read_text("utf-8")
    drawn = [line.split() for line in page.splitlines() if line.startswith("    ")]
    rows = ROWS
    drawn = [set(words[: len(row)]) for words, row in zip(drawn, rows, strict=False)]
    assert drawn == [set(row) for row in rows], "ARCHITECTURE.md draws other rooms than this test"


def function_length(function):
    """Lines of a function, from `def` to its end, without the docstring."""
    first = function.body[0]
    words = first if ast.get_docstring(function, clean=False) is not None else None
    wordy = words.end_lineno - words.lineno + 1 if words else 0
    return function.end_lineno - function.lineno + 1 - wordy


def test_functions_are_short():
    nodes = [node for tree in package_sources().values() for node in ast.walk(tree)]
    functions = [node for node in nodes if isinstance(node, ast.FunctionDef)]
    middle = median(map(function_length, functions))
    assert middle < MEDIAN_FUNCTION, f"the median function has {middle} lines; split the long ones"


def test_files_are_short():
    files = sorted((ROOT / "flocsim").rglob("*.py"))
    lengths = [(path, len(path.read_text("utf-8").splitlines())) for path in files]
    long = (f"{path.relative_to(ROOT)}: {n} lines" for path, n in lengths if n > LONGEST_FILE)
    refuse(long, f"files above {LONGEST_FILE} lines, to be split by topic:")


def is_documented(owner, method, classes):
    """Whether a method has a docstring, its own or that of a base class in the package."""
    own = [node for node in owner.body if getattr(node, "name", None) == method]
    names = [ast.unparse(base).split(".")[-1] for base in owner.bases]
    bases = [classes[name] for name in names if classes.get(name) not in (None, owner)]
    inherited = any(is_documented(base, method, classes) for base in bases)
    return inherited or any(map(ast.get_docstring, own))


def undocumented(path, tree, classes):
    """The public names of one file that have no docstring."""
    public = path.endswith("__init__.py") or "/_" not in f"/{path}"
    if public and tree.body and not ast.get_docstring(tree):
        yield f"flocsim/{path}: the module"
    for node in tree.body:
        if not isinstance(node, (ast.FunctionDef, ast.ClassDef)) or node.name.startswith("_"):
            continue
        if not ast.get_docstring(node) and node.name != "main":
            yield f"flocsim/{path}:{node.lineno}: {node.name}"
        methods = [inner for inner in node.body if isinstance(inner, ast.FunctionDef)]
        for method in methods if isinstance(node, ast.ClassDef) else []:
            if not (method.name.startswith("_") or is_documented(node, method.name, classes)):
                yield f"flocsim/{path}:{method.lineno}: {node.name}.{method.name}"


def test_public_names_have_docstrings():
    sources = package_sources()
    nodes = [node for tree in sources.values() for node in tree.body]
    classes = {node.name: node for node in nodes if isinstance(node, ast.ClassDef)}
    found = (undocumented(path, tree, classes) for path, tree in sources.items())
    refuse(itertools.chain.from_iterable(found), "public names without a docstring:")


def test_version_is_one():
    project = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))["project"]
    body = package_sources()["__init__.py"].body
    stated = [ast.unparse(node) for node in body if isinstance(node, ast.Assign)]
    stated = [text for text in stated if text.startswith("__version__ = '")]
    assert stated in ([], [f"__version__ = '{project['version']}'"]), "pyproject.toml differs"


@pytest.mark.parametrize(
    ("path", "source", "count"),
    [
        ("state.py", "from flocsim.forces import base", 1),
        ("state.py", "from .forces.base import Force", 1),
        ("state.py", "import flocsim.geometry.shape", 0),
        ("state.py", "def f():\n    from flocsim import System", 1),
        ("forces/drag.py", "from flocsim.integrators import base", 1),
        ("forces/drag.py", "from ..integrators import base", 1),
        ("forces/drag.py", "from . import base\nfrom .base import Force", 0),
        ("composer.py", "from flocsim import constants, errors", 0),
        ("fields.py", "from flocsim.errors import RangeError", 0),
        ("io/provenance.py", "from flocsim import __version__", 0),
        ("io/plots.py", "import importlib\nimportlib.import_module('flocsim.ensembles.cli')", 1),
        ("attic.py", "", 1),
    ],
)
def test_wrong_doors_are_seen(path, source, count):
    rooms = {room for row in ROWS for room in row}
    assert len(list(wrong_doors(path, ast.parse(source), rooms))) == count


@pytest.mark.parametrize(
    ("path", "source", "count"),
    [
        ("io/plots.py", "def draw():\n    from matplotlib.figure import Figure", 0),
        ("io/plot_fit.py", "def draw():\n    import matplotlib", 0),
        ("io/plots.py", "import matplotlib", 1),
        ("io/results.py", "def draw():\n    import matplotlib.pyplot", 1),
        ("system.py", "import h5py", 2),
        ("system.py", "def f():\n    return __import__('h5py')", 1),
        ("ensembles/config.py", "import pint", 1),
        ("ensembles/config.py", "def f():\n    import pint", 0),
    ],
)
def test_misplaced_heavyweights_are_seen(path, source, count):
    assert len(list(misplaced_heavyweights(path, ast.parse(source)))) == count

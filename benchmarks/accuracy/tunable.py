"""A copy of the package whose numeric constants can be changed while its compiled code stays.

numba turns a constant of a module into machine code, so that each changed constant means minutes
of compiling. In the copy, functions read each constant from a table in memory instead: the source
``SAFETY * step`` becomes ``tuned(17) * step``. Compiled code reads the table at an address that is
the same in all processes, so that its cache on the disk stays valid, too. Each read also sets a
flag, which tells the constants that a run depends on.
"""

import ast
import importlib
import shutil
from collections.abc import Iterable
from pathlib import Path

import attrs

from benchmarks.reporting import ROOT

PACKAGE = "flocsim"

ROOMS = ("integrators", "geometry/contact", "forces", "bonds", "hooks.py", "run.py")
"""Folders and files of the package whose constants are listed."""

NUMBER, TUPLE, NUMBERING, DEFAULT = "number", "tuple", "numbering", "default"
"""Kinds of constants: a number, or an expression for one; several numbers; positions and labels;
default values of arguments and fields."""

NO_TRIAL = {
    "a position or a label": (
        "NO_BOND", "CERTIFICATE", "HOOK", "REST", "RELATIVE_ANGLE", "PAIR_MOTION", "COORDINATES",
        "NONE", "NODE_ROWS", "COMMON", "RELATIVE", "TENSION", "LOAD", "NOTHING", "EDGE", "LONE",
        "HALFWAY", "SECOND_STAGE", "THIRD_STAGE",
    ),
    "decides random numbers or hashes": (
        "KICK_STREAM", "SEED", "LOW", "FIRST_FACTOR", "SECOND_FACTOR", "FIRST_WEYL", "SECOND_WEYL",
        "ROUNDS", "WORD", "BASE", "MODULUS",
    ),
    "defined by mathematics or physics": (
        "EULER", "ROOT", "SPHERE_DRAG", "SPHERE_TURN", "RETARDATION", "FADE_COEFFICIENT",
    ),
}  # fmt: skip
"""{reason: names} of numbers that are not tuned, so that another value means nothing."""

HEADER = "from flocsim.tuned import tuned\n"

TABLE_SOURCE = '''\
"""The table of tuned constants, at a fixed address of every process."""

import ctypes
import mmap

from flocsim.compiler.fingerprint import Intrinsic

ADDRESS = 0x5A0000000000
VALUES = {values}

COUNT = len(VALUES)
SIZE = -(-16 * COUNT // mmap.PAGESIZE) * mmap.PAGESIZE
PRIVATE_AND_ANONYMOUS, NOT_OVER_ANOTHER = 0x22, 0x100000

map_memory = ctypes.CDLL(None, use_errno=True).mmap
map_memory.restype = ctypes.c_void_p
map_memory.argtypes = [ctypes.c_void_p, ctypes.c_size_t, *[ctypes.c_int] * 3, ctypes.c_long]
given = map_memory(
    ADDRESS, SIZE, mmap.PROT_READ | mmap.PROT_WRITE, PRIVATE_AND_ANONYMOUS | NOT_OVER_ANOTHER, -1, 0
)
if given != ADDRESS:
    raise MemoryError(f"no memory at {{ADDRESS:#x}}")
values = (ctypes.c_double * COUNT).from_address(ADDRESS)
flags = (ctypes.c_double * COUNT).from_address(ADDRESS + 8 * COUNT)
values[:] = VALUES


class Tuned(Intrinsic):
    """Reads a value of the table, and sets its flag; in Python and in compiled code."""

    def __call__(self, index):
        flags[index] = 1.0
        return values[index]


def compiled_read():
    """Return a function for compiled code that does the same."""
    from llvmlite import ir
    from numba import types
    from numba.extending import intrinsic

    word, double = ir.IntType(64), ir.DoubleType()

    def place(builder, index, start):
        offset = builder.mul(index, word(8))
        return builder.inttoptr(builder.add(offset, word(start)), double.as_pointer())

    @intrinsic
    def load(typing, index):
        def generate(context, builder, sig, args):
            index = context.cast(builder, args[0], sig.args[0], types.int64)
            builder.store(double(1.0), place(builder, index, ADDRESS + 8 * COUNT))
            return builder.load(place(builder, index, ADDRESS))

        return types.float64(index), generate

    known = {{"load": load, "__name__": __name__}}
    exec("def read(index):\\n    return load(index)\\n", known)
    return known["read"]


tuned = Tuned(f"tuned constants {{COUNT}} at {{ADDRESS}}", compiled_read)
'''


@attrs.frozen
class Constant:
    """A constant of a module, or a default value of a function or class in it.

    ``text`` is its value as written; ``documented`` if a comment or docstring explains it.
    """

    module: str
    name: str
    kind: str
    text: str
    documented: bool
    line: int

    @property
    def key(self) -> str:
        """The name by which results are stored."""
        return f"{self.module.removeprefix(PACKAGE + '.')}.{self.name}"

    @property
    def value(self) -> object:
        """The value that the module has."""
        return getattr(importlib.import_module(self.module), self.name)

    @property
    def left_out(self) -> str:
        """Why there is nothing to change; "" for a number that is tuned."""
        if self.kind != NUMBER:
            return f"a {self.kind}"
        for reason, names in NO_TRIAL.items():
            if self.name in names:
                return reason
        return "" if self.value else "zero"


def module_of(path: Path, root: Path = ROOT) -> str:
    """Return the dotted name of a file of the package."""
    parts = path.relative_to(root).with_suffix("").parts
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


def is_numeric(value: object) -> bool:
    """Return True for a number that is no flag and no member of an enum."""
    return type(value) in (int, float)


def has_numbers(value: object) -> bool:
    """Return True for a tuple of numbers, or of such tuples."""
    return (
        isinstance(value, tuple)
        and bool(value)
        and all(type(each) in (int, float, complex) or has_numbers(each) for each in value)
    )


def targets_of(statement: ast.stmt) -> list[str]:
    """Return the names to which a statement of a module assigns."""
    if isinstance(statement, ast.Assign):
        [target, *_] = statement.targets
    elif isinstance(statement, ast.AnnAssign):
        target = statement.target
    else:
        return []
    names = target.elts if isinstance(target, ast.Tuple) else [target]
    return [each.id for each in names if isinstance(each, ast.Name)]


def is_documented(statement: ast.stmt, after: ast.stmt | None, lines: list[str]) -> bool:
    """Return True if a comment before or in the statement, or a text after it, explains it."""
    before = lines[statement.lineno - 2].strip() if statement.lineno > 1 else ""
    own = lines[statement.lineno - 1 : statement.end_lineno]
    text = (
        isinstance(after, ast.Expr)
        and isinstance(after.value, ast.Constant)
        and isinstance(after.value.value, str)
    )
    comments = [line.partition("#")[2].strip() for line in own]
    return text or before.startswith("#") or any(each not in ("", "fmt: skip") for each in comments)


def defaults_in(tree: ast.Module) -> Iterable[tuple[str, ast.expr]]:
    """Yield (name, value) of numeric defaults of arguments, and of fields of classes."""
    for node in ast.walk(tree):
        if isinstance(node, ast.FunctionDef):
            names = node.args.posonlyargs + node.args.args
            given = list(zip(reversed(names), reversed(node.args.defaults), strict=False))
            given += [
                (name, value)
                for name, value in zip(node.args.kwonlyargs, node.args.kw_defaults, strict=True)
                if value is not None
            ]
            yield from ((f"{node.name}({name.arg})", value) for name, value in given)
        elif isinstance(node, ast.ClassDef):
            for each in node.body:
                if isinstance(each, ast.AnnAssign) and isinstance(each.target, ast.Name):
                    found = {k.arg: k.value for k in getattr(each.value, "keywords", ())}
                    value = found.get("default", each.value)
                    if value is not None:
                        yield f"{node.name}.{each.target.id}", value


def constants_in(path: Path) -> list[Constant]:
    """Return the numeric constants of a file, in order."""
    source = path.read_text("utf-8")
    tree, lines, module = ast.parse(source), source.splitlines(), module_of(path)
    loaded, found = importlib.import_module(module), []
    for statement, after in zip(tree.body, [*tree.body[1:], None], strict=True):
        names = targets_of(statement)
        numbered = isinstance(statement, ast.Assign) and isinstance(statement.value, ast.Call)
        for name in names:
            value = getattr(loaded, name, None)
            if not (is_numeric(value) or has_numbers(value)):
                continue
            kind = NUMBER if is_numeric(value) else TUPLE
            if numbered and getattr(statement.value.func, "id", "") == "range":
                kind = NUMBERING
            text = repr(value) if len(names) > 1 else ast.unparse(statement.value)
            known = is_documented(statement, after, lines)
            found.append(Constant(module, name, kind, text, known, statement.lineno))
    for name, value in defaults_in(tree):
        if isinstance(value, ast.Constant) and is_numeric(value.value):
            text, known = ast.unparse(value), is_documented(value, None, lines)
            found.append(Constant(module, name, DEFAULT, text, known, value.lineno))
    return found


def all_constants(root: Path = ROOT) -> list[Constant]:
    """Return the constants of all ROOMS."""
    folder = root / PACKAGE
    paths = [path for room in ROOMS for path in sorted_files(folder / room)]
    return [constant for path in paths for constant in constants_in(path)]


def sorted_files(path: Path) -> list[Path]:
    """Return the Python files at or below a path."""
    return [path] if path.is_file() else sorted(path.rglob("*.py"))


class Rewrite(ast.NodeTransformer):
    """Replaces reads of constants inside functions; ``known`` {(module alias or "", name): index,
    whether it is a whole number}. What is read while the module is loaded stays."""

    def __init__(self, known):
        self.known, self.depth = known, 0
        self.inside: set[int] = set()
        self.outside: set[int] = set()

    def visit_FunctionDef(self, node):
        """Visit defaults and decorators as what they are, parts of the module."""
        node.args = self.visit(node.args)
        node.decorator_list = [self.visit(each) for each in node.decorator_list]
        own = {n.id for n in ast.walk(node) if isinstance(n, ast.Name) and not is_load(n)}
        own |= {each.arg for each in ast.walk(node.args) if isinstance(each, ast.arg)}
        shadowed = {key: self.known.pop(key) for key in list(self.known) if key[1] in own}
        self.depth += 1
        node.body = [self.visit(each) for each in node.body]
        self.depth -= 1
        self.known |= shadowed
        return node

    def visit_Lambda(self, node):
        self.depth += 1
        node.body = self.visit(node.body)
        self.depth -= 1
        return node

    def visit_Name(self, node):
        return self.replaced(node, ("", node.id)) if is_load(node) else node

    def visit_Attribute(self, node):
        if isinstance(node.value, ast.Name) and is_load(node):
            return self.replaced(node, (node.value.id, node.attr))
        return self.generic_visit(node)

    def replaced(self, node, key):
        """Return a read of the table in the place of a read of a constant."""
        if key not in self.known:
            return node
        index, whole = self.known[key]
        (self.inside if self.depth else self.outside).add(index)
        if not self.depth:
            return node
        text = f"int(tuned({index}))" if whole else f"tuned({index})"
        return ast.copy_location(ast.parse(text, mode="eval").body, node)


def is_load(node: ast.expr) -> bool:
    """Return True if a name or attribute is read."""
    return isinstance(getattr(node, "ctx", None), ast.Load)


def names_known(tree: ast.Module, module: str, indices: dict) -> dict:
    """Return {(module alias or "", name): (index, whether it is whole)} of the constants that a
    module can read; ``indices`` {(module, name): the same}."""
    known = {("", name): found for (home, name), found in indices.items() if home == module}
    for node in ast.walk(tree):
        if isinstance(node, ast.ImportFrom) and node.module:
            for each in node.names:
                alias, full = each.asname or each.name, f"{node.module}.{each.name}"
                if (node.module, each.name) in indices:
                    known["", alias] = indices[node.module, each.name]
                known |= {
                    (alias, name): found for (home, name), found in indices.items() if home == full
                }
    return known


def make_copy(folder: Path, constants: list[Constant]) -> tuple[set[int], set[int]]:
    """Write a copy of the package and of the benchmarks in which the constants, by their indices,
    are read from the table. Return the indices of those that functions read, and of those that are
    read while modules are loaded."""
    indices = {
        (each.module, each.name): (index, type(each.value) is int)
        for index, each in enumerate(constants)
    }
    shutil.rmtree(folder, ignore_errors=True)
    for name in (PACKAGE, "benchmarks"):
        shutil.copytree(ROOT / name, folder / name, ignore=shutil.ignore_patterns("__pycache__"))
    inside: set[int] = set()
    outside: set[int] = set()
    for path in sorted_files(folder / PACKAGE):
        tree = ast.parse(path.read_text("utf-8"))
        rewrite = Rewrite(names_known(tree, module_of(path, folder), indices))
        tree = rewrite.visit(tree)
        inside |= rewrite.inside
        outside |= rewrite.outside
        if rewrite.inside:
            first = 1 if ast.get_docstring(tree) is not None else 0
            tree.body[first:first] = ast.parse(HEADER).body
            path.write_text(ast.unparse(ast.fix_missing_locations(tree)) + "\n", "utf-8")
    numbers = tuple(float(each.value) for each in constants)
    (folder / PACKAGE / "tuned.py").write_text(TABLE_SOURCE.format(values=numbers), "utf-8")
    return inside, outside


def dependents(constants: list[Constant]) -> dict[int, list[int]]:
    """Return {index: indices of constants of the same module whose expressions read it}, each
    after those that it depends on."""
    found: dict[int, list[int]] = {}
    for index, each in enumerate(constants):
        for other, later in enumerate(constants):
            if other != index and later.module == each.module:
                names = {n.id for n in ast.walk(ast.parse(later.text)) if isinstance(n, ast.Name)}
                if each.name in names:
                    found.setdefault(index, []).append(other)
    return found

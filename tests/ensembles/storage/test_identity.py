"""The identity of a study: it changes with every file that its rows depend on."""

import ast
import functools
import shutil

import pytest

from flocsim.ensembles.storage import identity
from flocsim.ensembles.storage.identity import PACKAGE, physics_digest, physics_files
from tests.helpers.tiers import rest_slow

ENTRIES = (
    "ensembles/study.py", "ensembles/collision/encounter.py", "ensembles/collision/mechanisms.py",
)  # fmt: skip
"""From these files a replicate reaches all that it runs."""

NOT_PHYSICS = {
    "errors.py": "messages; a row is what comes without an error",
    "water.py": "what follows of [fluid] and forces is compared itself",
    "explain.py": "text for people",
    "plausibility.py": "text for people",
    "geometry/fit/": "makes flocs, and these are compared themselves",
    "io/shape_library.py": "reads flocs, and these are compared themselves",
    "io/hdf5.py": "reads flocs, and these are compared themselves",
    "io/hdf5_child.py": "reads flocs, and these are compared themselves",
    "ensembles/diagnose/preflight.py": "what is refused, or looks implausible",
    "ensembles/kind.py": "what is asked of studies, and how rows are stored",
    "io/results/run_group.py": "text for people",
    "trajectories/": "what a run was, for people; a row is what comes of the Run itself",
    "io/plots/": "draws",
    "io/trajectory.py": "writes motions",
    "io/results/kernel_group.py": "rates, which follow from rows",
    "io/groups.py": "how arrays are stored; flocs that are read are compared themselves",
    "io/labelled.py": "how rates are named",
    "io/outputs.py": "what may be written to",
    "process.py": "what the system allows; a row is what comes without an error",
    "io/files.py": "how files are written",
    "io/seals.py": "how files are sealed",
    "io/json_text.py": "how descriptions in files are parsed",
    "ensembles/config/": "reads values, and these are compared themselves",
}
"""What a replicate imports without its rows depending on it, and why."""


def file_of(dotted):
    """The file that a dotted name of flocsim leads to; that of its module where it names a part."""
    parts = dotted.split(".")[1:]
    while parts:
        place = PACKAGE.joinpath(*parts)
        for path in (place.with_suffix(".py"), place / "__init__.py"):
            if path.exists():
                return path
        parts.pop()
    return PACKAGE / "__init__.py"


def imports_of(path):
    """The files of flocsim that one imports, inside functions as well."""
    for node in ast.walk(ast.parse(path.read_text("utf-8"))):
        names = []
        if isinstance(node, ast.Import):
            names = [alias.name for alias in node.names]
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{path}: a relative import"
            names = [f"{node.module}.{alias.name}" for alias in node.names]
        yield from (file_of(name) for name in names if name.partition(".")[0] == "flocsim")


@functools.cache
def reached():
    """Every file of flocsim that a replicate imports, directly or through others."""
    found, todo = set(), [PACKAGE / entry for entry in ENTRIES]
    while todo:
        path = todo.pop()
        if path not in found:
            found.add(path)
            todo += imports_of(path)
    return {path.relative_to(PACKAGE).as_posix() for path in found}


@pytest.fixture(scope="module")
def copy(tmp_path_factory):
    """A copy of the package that may be edited."""
    folder = tmp_path_factory.mktemp("copy") / "flocsim"
    shutil.copytree(PACKAGE, folder, ignore=shutil.ignore_patterns("__pycache__"))
    return folder


def is_exempt(name):
    """Whether a file stands in NOT_PHYSICS, by itself or by its folder."""
    return any(name == each or (each[-1] == "/" and name.startswith(each)) for each in NOT_PHYSICS)


def looked_at():
    """The names of the files that the identity looks at."""
    return {path.relative_to(PACKAGE).as_posix() for path in physics_files()}


def test_all_that_rows_depend_on_is_looked_at():
    unseen = {name for name in reached() if not is_exempt(name)} - looked_at()
    assert unseen == set(), "add them to PHYSICS, or to NOT_PHYSICS with a reason"


@pytest.mark.parametrize("every", rest_slow([12, 1], lambda every: every > 1))
def test_an_edit_in_any_file_that_rows_depend_on_changes_the_identity(copy, every):
    names = looked_at()
    assert len(names) > 50
    before, unseen = physics_digest(copy), []
    for name in sorted(names)[::every]:
        path = copy / name
        source = path.read_text("utf-8")
        path.write_text(source + "\nEDITED = 1.0\n", "utf-8")
        if physics_digest(copy) == before:
            unseen.append(name)
        path.write_text(source, "utf-8")
    assert unseen == []
    assert physics_digest(copy) == before


ROOMS = [name for name in identity.PHYSICS if not name.endswith(".py")]


@pytest.mark.parametrize("folder", rest_slow(ROOMS, lambda folder: folder == ROOMS[0]))
def test_a_new_file_in_a_new_room_changes_the_identity(copy, folder):
    before = physics_digest(copy)
    room = copy / folder / "new_room"
    room.mkdir()
    (room / "fit_of_a_force.py").write_text("STRENGTH = 1.0\n")
    assert physics_digest(copy) != before
    shutil.rmtree(room)


def test_every_exception_is_still_needed():
    found = reached()
    for each in NOT_PHYSICS:
        assert any(name == each or name.startswith(each) for name in found), each

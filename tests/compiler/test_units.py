"""Units of machine code: shared by engines, made anew where they differ, never mixed up."""

import numpy as np
import pytest

from flocsim.compiler import disk_cache, units
from flocsim.compiler.composer import compose
from flocsim.compiler.linker import apart, postponed
from flocsim.errors import KernelError


@apart
def law(x):
    return x * x


def cubed(x):
    return x * x * x


def whole(x):
    return 3


@apart
def energy(values, x):
    total = 0.0
    for k in range(values.shape[0]):
        total += law(values[k]) + x
    return total


def drive(values, x):
    return energy(values, x), law(x) + 1.0


def watched(values, x):
    return energy(values, x), law(x) - 1.0


@apart
def checked(x):
    return (0.5, 2.0)[int(x)], x > 0.0


def drive_checked(x):
    number, large = checked(x)
    return number if large else -number


def not_there(x):
    return -1.0


@postponed(not_there)
def rare(x):
    return law(x) + 100.0


@apart
def common(x):
    return x


def drive_rarely(x):
    return x, common(x)


VALUES = np.array([1.0, 2.0, 3.0])


@pytest.fixture
def made(new_process, monkeypatch):
    """Names of the functions with which compiled units begin, in the order in which they end."""
    names = []
    real = units.Engine.compiled

    def compiled(self, entry, *more):
        code = real(self, entry, *more)
        names.append(entry.__name__)
        return code

    monkeypatch.setattr(units.Engine, "compiled", compiled)
    return names


def files(folder):
    return {path.name: path.read_bytes() for path in folder.glob(f"*{disk_cache.SUFFIX}")}


def test_each_marked_function_is_a_unit_that_computes_what_python_does(made, own_cache):
    assert compose(drive, {})(VALUES, 2.0) == drive(VALUES, 2.0)
    assert made == ["law", "energy", "drive"]
    assert sum(name.startswith("flocsim_unit_") for name in files(own_cache)) == 2


def test_two_engines_share_their_units(made, own_cache):
    compose(drive, {})(VALUES, 2.0)
    before = files(own_cache)
    assert compose(watched, {})(VALUES, 2.0) == watched(VALUES, 2.0)
    assert made == ["law", "energy", "drive", "watched"]
    after = files(own_cache)
    assert len(after) == len(before) + 1 and before.items() <= after.items()


def test_what_fills_a_hook_is_linked_to_what_calls_the_hook(made):
    first, second = compose(drive, {}), compose(drive, {law: cubed})
    assert first(VALUES, 2.0) == (14.0 + 6.0, 5.0)
    assert second(VALUES, 2.0) == (36.0 + 6.0, 9.0)
    assert first(VALUES, 2.0) == (14.0 + 6.0, 5.0)
    # The sum is compiled once: it knows the law by its name.
    assert made == ["law", "energy", "drive", "cubed", "drive"]


def test_a_unit_that_returns_other_types_has_its_callers_compiled_anew(made):
    compose(drive, {})(VALUES, 2.0)
    assert compose(drive, {law: whole})(VALUES, 2.0) == (15.0, 4.0)
    assert made[3:] == ["whole", "energy", "drive"]
    assert compose(drive, {law: cubed})(VALUES, 2.0) == (42.0, 9.0)


def test_an_engine_whose_unit_was_compiled_for_another_one_since_is_compiled_anew(
    made, new_process
):
    compose(drive, {})(VALUES, 2.0)
    compose(drive, {law: whole})(
        VALUES, 2.0
    )  # the sum's file is now of one that adds whole numbers
    new_process()
    assert compose(drive, {})(VALUES, 2.0) == drive(VALUES, 2.0)
    assert compose(drive, {law: whole})(VALUES, 2.0) == (15.0, 4.0)


@pytest.mark.parametrize("again", [drive, watched])
@pytest.mark.parametrize("harm", ["removed", "cut", "exchanged"])
def test_a_unit_that_is_missing_or_damaged_is_compiled_anew(
    made, own_cache, new_process, again, harm
):
    compose(drive, {})(VALUES, 2.0)
    found = sorted(own_cache.glob("flocsim_unit_*"))
    if harm == "exchanged":
        content = [path.read_bytes() for path in found]
        for path, other in zip(found, reversed(content), strict=True):
            path.write_bytes(other)
    for path in found[:1] if harm != "exchanged" else []:
        path.unlink() if harm == "removed" else path.write_bytes(path.read_bytes()[:-9])
    new_process()
    assert compose(again, {})(VALUES, 2.0) == again(VALUES, 2.0)
    assert len(made) > 3
    count = len(made)
    new_process()
    assert compose(again, {})(VALUES, 2.0) == again(VALUES, 2.0)
    assert len(made) == count


def test_what_a_unit_raises_ends_what_calls_it(made):
    driver = compose(drive_checked, {})
    assert (driver(1.0), driver(0.0)) == (2.0, -0.5)
    with pytest.raises(KernelError, match="a kernel has raised an exception"):
        driver(2.0)


def test_what_is_postponed_is_compiled_where_it_is_asked_for_and_nothing_else_anew(
    made, new_process
):
    function = compose(drive_rarely, {common: rare})
    assert function(2.0) == (2.0, -1.0)
    assert made == ["not_there", "drive_rarely"]
    assert function.whole(2.0) == (2.0, 104.0)
    assert made == ["not_there", "drive_rarely", "law", "rare"]
    assert function(2.0) == (2.0, -1.0)
    new_process()
    again = compose(drive_rarely, {common: rare})
    assert again.whole(2.0) == (2.0, 104.0)
    assert again(2.0) == (2.0, -1.0)
    assert len(made) == 4
    assert compose(drive_rarely, {common: rare}, jit=False)(2.0) == (2.0, 104.0)


def test_what_is_postponed_is_compiled_also_where_nothing_can_be_kept(own_cache, new_process):
    own_cache.write_text("")  # no folder, whoever asks
    with pytest.warns(UserWarning, match="compiled code is not stored"):
        function = compose(drive_rarely, {common: rare})
        assert function(2.0) == (2.0, -1.0)
        assert function.whole(2.0) == (2.0, 104.0)

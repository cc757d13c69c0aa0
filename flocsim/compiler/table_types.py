"""The numba types of what lies in a table of words (flocsim.compiler.by_pointer), and what compiled
code does with them. Imports numba: only where something is compiled.

Inside compiled code ``work`` is a pointer into the table, ``work.place`` another, and
``work.place[state, body, axis]`` a load through that; ``contacts[row].gap`` is a load of one field
of a record. No word of a table changes while compiled code runs, and LLVM is told so: it reads each
of them once.

Arrays lie in C order; indices are whole numbers from 0 on, neither checked nor counted from the
end. Fewer indices than axes give a part of an array; there are no slices. Sizes that never change
are declared with the field, as ``motion: Annotated[np.ndarray, ("rows", "n", 6)]``, and become
constants.
"""

import operator
from collections.abc import Callable, Iterable, Iterator
from hashlib import blake2b
from typing import Any

import numpy as np
from llvmlite import ir
from numba import carray, from_dtype, njit, types

# The class that numba.extending.infer_getattr, which is public, takes subclasses of.
from numba.core.typing.templates import AttributeTemplate
from numba.extending import (
    infer_getattr,
    intrinsic,
    lower_builtin,
    lower_getattr_generic,
    lower_setattr_generic,
    models,
    register_model,
    type_callable,
)

from flocsim.compiler.by_pointer import sizes_of

WORD = ir.IntType(64)

# Letters of the struct module for what compiled functions are given and return.
LETTERS = {
    "": types.none, "?": types.boolean, "d": types.float64, "q": types.int64,
    "Q": types.uint64, "f": types.float32, "i": types.int32,
}  # fmt: skip


def digest(what: object) -> str:
    """Return a short hash: a type's name is in the name of every function that is given it."""
    return blake2b(repr(what).encode(), digest_size=6).hexdigest()


class Table(types.Type):
    """A tuple whose fields have names: {name: (type, position in the table)}."""

    def __init__(self, name, kinds):
        self.words, self.fields = 0, {}
        for each, kind in kinds.items():
            self.fields[each] = kind, self.words
            self.words += words_in(kind)
        super().__init__(f"{name}_{digest(kinds)}")


class Row(types.Type):
    """A record: {name: (type, offset in bytes)}."""

    words = 1

    def __init__(self, dtype):
        self.fields = {name: (from_dtype(kind), at) for name, (kind, at) in dtype.fields.items()}
        self.size = dtype.itemsize
        super().__init__(f"row_{digest(dtype)}")


class Elements(types.Type):
    """An array; ``sizes`` that never change, 0 for others."""

    def __init__(self, dtype, sizes):
        self.dtype, self.sizes, self.ndim = dtype, sizes, len(sizes)
        self.words = 1 + self.ndim
        self.fields = {"shape": (types.UniTuple(types.intp, self.ndim), 1)}
        super().__init__(f"elements_{dtype}_{'_'.join(map(str, sizes))}")


class Part(types.Type):
    """The part of an array at the first ``taken`` indices, all whole numbers: the array, and how
    many such parts lie before."""

    def __init__(self, of, taken):
        self.of, self.taken, self.dtype, self.ndim = of, taken, of.dtype, of.ndim - taken
        super().__init__(f"part_{taken}_{of}")


class PointerModel(models.PrimitiveModel):
    """An address, of words in the table or of a record."""

    def __init__(self, manager, kind):
        super().__init__(manager, kind, WORD.as_pointer())


for each in (Table, Elements, Row):
    register_model(each)(PointerModel)


@register_model(Part)
class PartModel(models.StructModel):
    """The array, and a number."""

    def __init__(self, manager, kind):
        super().__init__(manager, kind, [("of", kind.of), ("before", types.intp)])


def parts_of(kind: Any) -> list[Any]:
    """Return the types in the tuple that a numba type is; of any other, that type alone."""
    given: Any = kind  # numba has no annotations
    return list(given.types) if isinstance(kind, types.BaseTuple) else [kind]


def words_in(kind: Any) -> int:
    """Return how many words of a table hold a value of a numba type."""
    if isinstance(kind, types.BaseTuple):
        return sum(words_in(each) for each in parts_of(kind))
    return getattr(kind, "words", 1)


def type_from(kinds: Iterator[Any], sizes: tuple[int, ...] = ()) -> Any:
    """Return the numba type of the next argument in a flat tuple of types (by_pointer.table_of);
    ``sizes``: those that an array always has."""
    kind = next(kinds)
    if kind is None:
        return types.none
    if isinstance(kind, np.dtype):
        return Row(kind)
    if isinstance(kind, str):
        return LETTERS[kind]
    first, count = kind
    if not isinstance(first, type):
        dtype = Row(first) if isinstance(first, np.dtype) else from_dtype(np.dtype(first))
        return Elements(dtype, sizes or (0,) * count)
    if not hasattr(first, "_fields"):
        return types.Tuple.from_types([type_from(kinds) for _ in range(count)])
    declared = sizes_of(first)
    found = {name: type_from(kinds, declared.get(name, ())) for name in first._fields}
    if all(isinstance(each, types.Number) for each in found.values()):
        return types.NamedTuple(list(found.values()), first)
    return Table(first.__name__, found)


def types_within(given: Iterable[Any]) -> dict[str, Any]:
    """Return {text: numba type} of numbers, of some types and of all that they are made of."""
    found = {str(each): each for each in LETTERS.values()}
    more = list(given)
    for kind in more:  # grows
        if str(kind) not in found:
            found[str(kind)] = kind
            more += [each for each, _ in kind.fields.values()] if isinstance(kind, Table) else []
            more += getattr(kind, "types", ()) or filter(None, [getattr(kind, "dtype", None)])
    return found


# Loads and stores. Each carries the name of what it reads (TBAA), from which LLVM knows that a
# store to one field leaves all others as they are; without the names a run takes 6 % longer.


def named(builder, access, name):
    """Tell LLVM that a load or store touches nothing of another name."""
    module = builder.module
    root = module.add_metadata(["flocsim"])
    tag = module.add_metadata([name, root, WORD(0)])
    access.set_metadata("tbaa", module.add_metadata([tag, tag, WORD(0)]))
    return access


def read_word(builder, table, at):
    """Load a word of a table."""
    load = builder.load(builder.gep(table, [WORD(at)], inbounds=True))
    load.set_metadata("invariant.load", builder.module.add_metadata([]))
    return load


def value_at(context, builder, kind, table, at):
    """Return the value of a numba type that begins at a position of a table."""
    if isinstance(kind, Table | Elements):
        return builder.gep(table, [WORD(at)], inbounds=True)
    if isinstance(kind, types.BaseTuple):
        values = []
        for each in kind.types:
            values.append(value_at(context, builder, each, table, at))
            at += words_in(each)
        return context.make_tuple(builder, kind, values)
    if kind == types.none:
        return context.get_dummy_value()
    word = read_word(builder, table, at)
    if isinstance(kind, Row):
        return builder.inttoptr(word, WORD.as_pointer())
    if kind == types.float64:
        return builder.bitcast(word, ir.DoubleType())
    return context.cast(builder, word, types.int64, kind)


def size(builder, kind, value, axis):
    """Return a size of an array."""
    known = kind.sizes[axis]
    return WORD(known) if known else read_word(builder, value, 1 + axis)


def data_of(context, builder, kind, value):
    """Return the address of an array's data."""
    element = WORD if isinstance(kind.dtype, Row) else context.get_data_type(kind.dtype)
    return builder.inttoptr(read_word(builder, value, 0), element.as_pointer())


def place_of_element(context, builder, kind, value, index, given):
    """Return the address of an element of an array or of a part of one, or of a part, as the model
    of parts has it; ``index`` is the type of the numbers ``given``."""
    parts, numbers = (index,), [given]
    if isinstance(index, types.BaseTuple):
        parts = index.types
        numbers = [builder.extract_value(given, each) for each in range(len(parts))]
    of, taken, offset = kind, 0, None
    if isinstance(kind, Part):
        of, taken = kind.of, kind.taken
        value, offset = (builder.extract_value(value, each) for each in range(2))
    for axis, (part, number) in enumerate(zip(parts, numbers, strict=True), taken):
        number = context.cast(builder, number, part, types.intp)
        if offset is not None:
            offset = builder.mul(offset, size(builder, of, value, axis), flags=["nsw"])
            number = builder.add(offset, number, flags=["nsw"])
        offset = number
    if len(parts) < kind.ndim:
        found = context.get_value_type(Part(of, taken + len(parts)))(ir.Undefined)
        return builder.insert_value(builder.insert_value(found, value, 0), offset, 1)
    if isinstance(kind.dtype, Row):
        offset = builder.mul(offset, WORD(kind.dtype.size // 8), flags=["nsw"])
    return builder.gep(data_of(context, builder, kind, value), [offset], inbounds=True)


def place_of_field(context, builder, kind, value, name):
    """Return the address of a field of a record."""
    number, offset = kind.fields[name]
    place = builder.gep(value, [WORD(offset // 8)], inbounds=True)
    return builder.bitcast(place, context.get_data_type(number).as_pointer())


PLAIN = types.float64, types.int64
"""Elements that are stored as they are computed with; of others numba knows how."""


def indices_in(kind: Any, index: Any) -> int:
    """Return how many whole numbers an index of an array or a part is; 0 where it is another."""
    parts = parts_of(index)
    whole = all(isinstance(each, types.Integer) for each in parts)
    return len(parts) if isinstance(kind, Elements | Part) and whole else 0


class Attributes(AttributeTemplate):
    """The types of fields, and of the shape of an array."""

    def generic_resolve(self, kind, name):
        """Return the type of a field; None without."""
        return kind.fields.get(name, (None,))[0]


for each in (Table, Row, Elements):
    infer_getattr(type(f"Attributes{each.__name__}", (Attributes,), {"key": each}))


@lower_getattr_generic(Table)
def table_field(context, builder, kind, value, name):
    """Read a field of a table."""
    return value_at(context, builder, kind.fields[name][0], value, kind.fields[name][1])


@lower_getattr_generic(Row)
def row_field(context, builder, kind, value, name):
    """Read a field of a record."""
    place = place_of_field(context, builder, kind, value, name)
    return named(builder, builder.load(place), f"{kind}.{name}")


@lower_setattr_generic(Row)
def set_row_field(context, builder, sig, args, name):
    """Write a field of a record."""
    place = place_of_field(context, builder, sig.args[0], args[0], name)
    named(builder, builder.store(args[1], place), f"{sig.args[0]}.{name}")


@lower_getattr_generic(Elements)
def shape(context, builder, kind, value, name):
    """Return the sizes of an array."""
    sizes = [size(builder, kind, value, axis) for axis in range(kind.ndim)]
    return context.make_tuple(builder, kind.fields[name][0], sizes)


@type_callable(len)
def type_len(context):
    """Return the type of ``len`` of an array."""
    return lambda value: types.intp if isinstance(value, Elements | Part) else None


@lower_builtin(len, Elements)
@lower_builtin(len, Part)
def length(context, builder, sig, args):
    """Return the first size of an array or of a part."""
    kind, value = sig.args[0], args[0]
    if isinstance(kind, Part):
        return size(builder, kind.of, builder.extract_value(value, 0), kind.taken)
    return size(builder, kind, value, 0)


@type_callable(operator.getitem)
def type_getitem(context):
    """Return the type of an element or a part."""

    def element(value, index):
        count = indices_in(value, index)
        if 0 < count < value.ndim:
            of, taken = (value.of, value.taken) if isinstance(value, Part) else (value, 0)
            return Part(of, taken + count)
        return value.dtype if count else None

    return element


@type_callable(operator.setitem)
def type_setitem(context):
    """Return the type of an assignment to an element."""

    def element(value, index, given):
        whole = 0 < indices_in(value, index) == value.ndim
        return types.none(value, index, value.dtype) if whole else None

    return element


@lower_builtin(operator.getitem, Elements, types.Any)
@lower_builtin(operator.getitem, Part, types.Any)
def getitem(context, builder, sig, args):
    """Read an element; a record, or a part, is read where its fields or elements are."""
    kind = sig.return_type
    place = place_of_element(context, builder, sig.args[0], args[0], sig.args[1], args[1])
    if isinstance(kind, Row | Part):
        return place
    if kind in PLAIN:
        return named(builder, builder.load(place), str(kind))
    return context.unpack_value(builder, kind, place)


@lower_builtin(operator.setitem, Elements, types.Any, types.Any)
@lower_builtin(operator.setitem, Part, types.Any, types.Any)
def setitem(context, builder, sig, args):
    """Write an element; a record is copied field by field."""
    kind = sig.args[2]
    place = place_of_element(context, builder, sig.args[0], args[0], sig.args[1], args[1])
    if isinstance(kind, Row):
        for name in kind.fields:
            source = place_of_field(context, builder, kind, args[2], name)
            target = place_of_field(context, builder, kind, place, name)
            tag = f"{kind}.{name}"
            named(builder, builder.store(named(builder, builder.load(source), tag), target), tag)
    elif kind in PLAIN:
        named(builder, builder.store(args[2], place), str(kind))
    else:
        context.pack_value(builder, kind, args[2], place)


@intrinsic
def pointer_to(typing, elements):
    """Return the address of an array's data, as a C pointer."""

    def generate(context, builder, sig, args):
        return data_of(context, builder, elements, args[0])

    return types.CPointer(elements.dtype)(elements), generate


@njit
def as_array(elements):
    """Return an array of a table as numba has them."""
    return carray(pointer_to(elements), elements.shape)


# Calls. A compiled function is called as a C function that is given the address at which its answer
# goes, then its arguments, and returns 0, or 1 where it has raised an exception.


def letters_of(kind: Any) -> str | None:
    """Return the letters (struct) of numbers that are returned; None for what is neither a number
    nor a tuple of numbers."""
    known = {each: letter for letter, each in LETTERS.items()}
    found = [known.get(types.unliteral(each)) for each in parts_of(kind)]
    return None if None in found else "".join(map(str, found))


def type_of_letters(letters: str) -> Any:
    """Return the numba type of numbers that are returned."""
    if len(letters) < 2:
        return LETTERS[letters]
    return types.Tuple.from_types([LETTERS[each] for each in letters])


def argument_at(kind: Any, at: int, whole: bool) -> Any:
    """Return a function for compiled code: ``read(address)`` of the argument at a position of a
    table; ``whole``: an array is one as numba has them."""

    @intrinsic
    def read(typing, address):
        def generate(context, builder, sig, args):
            table = builder.inttoptr(args[0], WORD.as_pointer())
            return value_at(context, builder, kind, table, at)

        return kind(address), generate

    if not whole:
        return read
    call: Any = read  # inside compiled code it takes no typing context
    return njit(lambda address: as_array(call(address)))


def answer_to(note: Callable[[Any], None], letters: str | None = None) -> Any:
    """Return a function for compiled code: ``put(address, value)``, as numbers of such letters;
    ``note`` is told the type."""

    @intrinsic
    def put(typing, address, value):
        kind = types.unliteral(value) if letters is None else type_of_letters(letters)
        note(kind)

        def generate(context, builder, sig, args):
            builder.store(args[1], builder.inttoptr(args[0], args[1].type.as_pointer()))
            return context.get_dummy_value()

        return types.none(address, kind), generate

    return put


def call_of(names: tuple[str, ...], target: Callable[[tuple[Any, ...]], tuple[str, str]]) -> Any:
    """Return a function, to be compiled: it calls that for which ``target(numba types)`` gives
    (symbol, letters of its answer), with arguments of such names. Without a symbol, the first of
    them is its address, and it takes arrays as C pointers."""

    def typed(*given):
        given = tuple(map(types.unliteral, given))
        symbol, letters = target(given)
        kind = type_of_letters(letters)

        def generate(context, builder, sig, args):
            with builder.goto_entry_block():  # in a loop, the stack would grow
                answer = builder.alloca(context.get_value_type(kind))
            handed = [builder.ptrtoint(answer, WORD), *args]
            if not symbol:
                handed[1:] = [
                    data_of(context, builder, each, value) if isinstance(each, Elements) else value
                    for each, value in zip(given[1:], args[1:], strict=True)
                ]
            called = ir.FunctionType(WORD, [each.type for each in handed])
            if symbol:
                function = builder.module.globals.get(symbol)
                function = function or ir.Function(builder.module, called, symbol)
            else:
                function = builder.inttoptr(args[0], called.as_pointer())
            failed = builder.call(function, handed)
            values = [failed, builder.load(answer)]
            return context.make_tuple(builder, sig.return_type, values)

        return types.Tuple.from_types([types.int64, kind])(*given), generate

    # numba's intrinsics have as many arguments as their functions.
    taken, known = ", ".join(names), {"typed": typed, "intrinsic": intrinsic}
    exec(
        f"@intrinsic\ndef pair(typing, {taken}):\n    return typed({taken})\n\n"
        f"def call({taken}):\n    failed, answer = pair({taken})\n"
        "    if failed != 0:\n        raise RuntimeError\n    return answer\n",
        known,
    )
    return known["call"]

"""The numba types of what lies in a table of words (flocsim.compiler.by_pointer), and what compiled
code does with them. Imports numba: only where something is compiled.

Inside compiled code ``work`` is a pointer into the table, ``work.place`` another, and
``work.place[state, body, axis]`` a load through that; ``contacts[row].gap`` is a load of one field
of a record. No word of a table changes while compiled code runs, and LLVM is told so: it reads each
of them once.

Arrays lie in C order; indices are whole numbers from 0 on, one for each axis, neither checked nor
counted from the end; there are no slices. Sizes that never change are declared with the field, as
``motion: Annotated[np.ndarray, ("rows", "n", 6)]``, and become constants.
"""

import operator
from collections.abc import Callable
from hashlib import blake2b
from typing import Any

import numpy as np
from llvmlite import ir
from numba import from_dtype, types

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

from flocsim.compiler.by_pointer import Stacked, letter_of, sizes_of
from flocsim.errors import KernelError

WORD = ir.IntType(64)

# Numbers that compiled functions are given and return, by their letters in struct and numpy.
LETTERS = {letter: from_dtype(np.dtype(letter)) for letter in "?dqQfi"}


class Addressed(types.Type):
    """What is handed over by its address, with fields: {name: (type, position)}."""

    # Words of a table that hold it: one, its address, unless it lies in the table itself.
    words = 1

    def __init__(self, name, fields):
        self.fields = fields
        # A type's name is in the name of every function that is given it.
        digest = blake2b(repr(fields).encode(), digest_size=6).hexdigest()
        super().__init__(f"{name}_{digest}")


class Table(Addressed):
    """A tuple whose fields have names: positions in words of the table."""

    def __init__(self, name, kinds):
        self.words, fields = 0, {}
        for each, kind in kinds.items():
            fields[each] = kind, self.words
            self.words += words_in(kind)
        super().__init__(name, fields)


class Row(Addressed):
    """A record: positions in bytes."""

    def __init__(self, dtype):
        self.size = dtype.itemsize
        fields = {name: (from_dtype(kind), at) for name, (kind, at) in dtype.fields.items()}
        super().__init__(f"row_{self.size}", fields)


class Elements(Addressed):
    """An array of numbers, records or tables; ``sizes`` that never change, 0 for others."""

    def __init__(self, dtype, sizes):
        self.dtype, self.sizes, self.ndim = dtype, sizes, len(sizes)
        # The address of the data, then one size for each axis.
        self.words = 1 + self.ndim
        fields = {"shape": (types.UniTuple(types.intp, self.ndim), 1)}
        super().__init__(f"elements_{dtype}_{'_'.join(map(str, sizes))}", fields)


class PointerModel(models.PrimitiveModel):
    """An address, of words in the table or of a record."""

    def __init__(self, manager, kind):
        super().__init__(manager, kind, WORD.as_pointer())


for each in (Table, Elements, Row):
    register_model(each)(PointerModel)


def parts_of(kind: Any) -> list[Any]:
    """Return the types in the tuple that a numba type is; of any other, that type alone."""
    given: Any = kind  # numba has no annotations
    return list(given.types) if isinstance(kind, types.BaseTuple) else [kind]


def words_in(kind: Any) -> int:
    """Return how many words of a table hold a value of a numba type."""
    if isinstance(kind, types.BaseTuple):
        return sum(words_in(each) for each in parts_of(kind))
    return getattr(kind, "words", 1)


def type_of(value: Any, sizes: tuple[int, ...] = ()) -> Any:
    """Return the numba type of an argument; ``sizes``: those that an array always has."""
    if isinstance(value, np.void):
        return Row(value.dtype)
    if isinstance(value, Stacked):
        return Elements(type_of(value.one), (0,))
    if isinstance(value, np.ndarray):
        dtype = Row(value.dtype) if value.dtype.names else from_dtype(value.dtype)
        return Elements(dtype, sizes or (0,) * value.ndim)
    if not isinstance(value, tuple):
        return type_of_letters(letter_of(value))
    named: Any = type(value)
    if not hasattr(named, "_fields"):
        return types.Tuple.from_types([type_of(each) for each in value])
    declared = sizes_of(named)
    found = {
        name: type_of(each, declared.get(name, ()))
        for name, each in zip(named._fields, value, strict=True)
    }
    # Numbers alone are a view, as kernels receive it: handed over by value.
    if all(isinstance(each, types.Number) for each in found.values()):
        return types.NamedTuple(list(found.values()), named)
    return Table(named.__name__, found)


# Loads and stores. Each carries the name of what it reads (TBAA), from which LLVM knows that a
# store to one field leaves all others as they are; without the names a run takes 6 % longer.


def tagged(builder, access, name):
    """Tell LLVM that a load or store touches nothing of another name."""
    module = builder.module
    root = module.add_metadata(["flocsim"])
    tag = module.add_metadata([name, root, WORD(0)])
    access.set_metadata("tbaa", module.add_metadata([tag, tag, WORD(0)]))
    return access


def load(context, builder, kind, place, name):
    """Return the number of a numba type at an address."""
    data = tagged(builder, builder.load(place), name)
    return context.data_model_manager[kind].from_data(builder, data)


def store(context, builder, kind, value, place, name):
    """Write a number of a numba type to an address."""
    data = context.data_model_manager[kind].as_data(builder, value)
    tagged(builder, builder.store(data, place), name)


def read_word(builder, table, at):
    """Load a word of a table."""
    # An invariant load may be moved out of loops and past any store.
    load = builder.load(builder.gep(table, [WORD(at)], inbounds=True))
    load.set_metadata("invariant.load", builder.module.add_metadata([]))
    return load


def value_at(context, builder, kind, table, at):
    """Return the value of a numba type that begins at a position of a table."""
    # These lie in the table: nothing is read before a field or an element is asked for.
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
    # A word holds the 64 bits of a double as they are, and other numbers as an integer.
    if kind == types.float64:
        return builder.bitcast(word, ir.DoubleType())
    return context.cast(builder, word, types.int64, kind)


def size(builder, kind, value, axis):
    """Return a size of an array."""
    # A constant size lets LLVM compute offsets when it compiles.
    known = kind.sizes[axis]
    return WORD(known) if known else read_word(builder, value, 1 + axis)


def place_of_element(context, builder, kind, value, index, given):
    """Return the address of an element of an array; ``index`` is the type of the numbers
    ``given``."""
    parts, numbers = parts_of(index), [given]
    if isinstance(index, types.BaseTuple):
        numbers = [builder.extract_value(given, each) for each in range(len(parts))]
    offset = WORD(0)
    for axis, (part, number) in enumerate(zip(parts, numbers, strict=True)):
        number = context.cast(builder, number, part, types.intp)
        # C order by Horner's rule, (i₀ n₁ + i₁) n₂ + i₂ …; nsw: indices never overflow.
        if axis:
            offset = builder.mul(offset, size(builder, kind, value, axis), flags=["nsw"])
            number = builder.add(offset, number, flags=["nsw"])
        offset = number
    # Records and tables are addressed in words: each field of a record is one word long.
    element = WORD
    if isinstance(kind.dtype, Row | Table):
        words = kind.dtype.size // 8 if isinstance(kind.dtype, Row) else kind.dtype.words
        offset = builder.mul(offset, WORD(words), flags=["nsw"])
    else:
        element = context.get_data_type(kind.dtype)
    data = builder.inttoptr(read_word(builder, value, 0), element.as_pointer())
    return builder.gep(data, [offset], inbounds=True)


def place_of_field(context, builder, kind, value, name):
    """Return the address of a field of a record."""
    number, offset = kind.fields[name]
    place = builder.gep(value, [WORD(offset // 8)], inbounds=True)
    return builder.bitcast(place, context.get_data_type(number).as_pointer())


def is_element(kind: Any, index: Any) -> bool:
    """Return True if an index, whole numbers for all axes, is that of an element of an array."""
    parts = parts_of(index)
    whole = all(isinstance(each, types.Integer) for each in parts)
    return isinstance(kind, Elements) and whole and len(parts) == kind.ndim


@infer_getattr
class Attributes(AttributeTemplate):
    """The types of fields, and of the shape of an array."""

    key = Addressed

    def generic_resolve(self, kind, name):
        """Return the type of a field; None without."""
        return kind.fields.get(name, (None,))[0]


@lower_getattr_generic(Addressed)
def get_field(context, builder, kind, value, name):
    """Read a field of a table or a record, or the shape of an array."""
    number, at = kind.fields[name]
    if isinstance(kind, Elements):
        sizes = [size(builder, kind, value, axis) for axis in range(kind.ndim)]
        return context.make_tuple(builder, number, sizes)
    if isinstance(kind, Table):
        return value_at(context, builder, number, value, at)
    place = place_of_field(context, builder, kind, value, name)
    return load(context, builder, number, place, f"{kind}.{name}")


@lower_setattr_generic(Row)
def set_field(context, builder, sig, args, name):
    """Write a field of a record."""
    kind = sig.args[0]
    place = place_of_field(context, builder, kind, args[0], name)
    store(context, builder, kind.fields[name][0], args[1], place, f"{kind}.{name}")


@type_callable(operator.getitem)
def type_getitem(context):
    """Return the type of an element."""
    return lambda value, index: value.dtype if is_element(value, index) else None


@type_callable(operator.setitem)
def type_setitem(context):
    """Return the type of an assignment to an element."""
    return lambda value, index, given: (
        types.none(value, index, value.dtype) if is_element(value, index) else None
    )


@lower_builtin(operator.getitem, Elements, types.Any)
def getitem(context, builder, sig, args):
    """Read an element; a record or a table is read where its fields are."""
    kind = sig.return_type
    place = place_of_element(context, builder, sig.args[0], args[0], sig.args[1], args[1])
    if isinstance(kind, Row | Table):
        return place
    return load(context, builder, kind, place, str(kind))


@lower_builtin(operator.setitem, Elements, types.Any, types.Any)
def setitem(context, builder, sig, args):
    """Write an element; a record is copied field by field."""
    kind = sig.args[2]
    place = place_of_element(context, builder, sig.args[0], args[0], sig.args[1], args[1])
    if not isinstance(kind, Row):
        return store(context, builder, kind, args[2], place, str(kind))
    for name, (number, _) in kind.fields.items():
        value = get_field(context, builder, kind, args[2], name)
        set_field(context, builder, types.none(kind, number), (place, value), name)


# Calls. A compiled function is called as a C function of two addresses: that at which its answer
# goes, and that of its arguments. It returns 0, or 1 where it has raised an exception.


def letters_of(kind: Any) -> str:
    """Return the letters of what is returned: a number, a tuple of numbers, or None."""
    known = {each: letter for letter, each in LETTERS.items()} | {types.none: ""}
    try:
        return "".join(known[types.unliteral(each)] for each in parts_of(kind))
    except KeyError:
        raise KernelError(f"a compiled function returns {kind}: let it return numbers") from None


def type_of_letters(letters: str) -> Any:
    """Return the numba type of numbers of such letters; that of None for ""."""
    kinds = [LETTERS[each] for each in letters] or [types.none]
    return types.Tuple.from_types(kinds) if len(kinds) > 1 else kinds[0]


def at_address(builder, address, kind):
    """Return an address as a pointer to values of a type of LLVM."""
    return builder.inttoptr(address, kind.as_pointer())


def reader(given: Any, table: bool = False) -> Any:
    """Return a function for compiled code: ``read(address)`` of a tuple of arguments of such types,
    in a table or as `call_of` hands them over."""
    kind = types.Tuple.from_types(given)

    @intrinsic
    def read(typing, address):
        def generate(context, builder, sig, args):
            if table:
                return value_at(context, builder, kind, at_address(builder, args[0], WORD), 0)
            return builder.load(at_address(builder, args[0], context.get_value_type(kind)))

        return kind(address), generate

    return read


@intrinsic
def put(typing, address, value):
    """Write what a compiled function returns to an address."""

    def generate(context, builder, sig, args):
        builder.store(args[1], at_address(builder, args[0], args[1].type))
        return context.get_dummy_value()

    return types.none(address, types.unliteral(value)), generate


def call_of(target: Callable[[list[Any]], tuple[str, str]]) -> Any:
    """Return a function, to be compiled: it calls that for which ``target(numba types)`` gives
    (symbol, letters of its answer). Without a symbol, the first argument is its address."""

    @intrinsic
    def pair(typing, given):
        kinds = [types.unliteral(each) for each in parts_of(given)]
        # Without a symbol, the first value is the address and no argument of the callee.
        symbol, letters = target(kinds)
        handed = types.Tuple.from_types(kinds if symbol else kinds[1:])
        kind = type_of_letters(letters)

        def generate(context, builder, sig, args):
            values = [builder.extract_value(args[0], each) for each in range(len(kinds))]
            with builder.goto_entry_block():  # in a loop, the stack would grow
                answer = builder.alloca(context.get_value_type(kind))
                place = builder.alloca(context.get_value_type(handed))
            packed = context.make_tuple(builder, handed, values[-len(handed) :])
            builder.store(packed, place)
            called = ir.FunctionType(WORD, [WORD, WORD])
            # Declare a unit once in a module; its address is filled in when the code is loaded.
            if symbol:
                known = builder.module.globals.get(symbol)
                function = known or ir.Function(builder.module, called, symbol)
            else:
                function = at_address(builder, values[0], called)
            failed = builder.call(function, [builder.ptrtoint(x, WORD) for x in (answer, place)])
            values = [failed, builder.load(answer)]
            return context.make_tuple(builder, sig.return_type, values)

        return types.Tuple.from_types([types.int64, kind])(given), generate

    def call(*given):
        # Exceptions do not pass from one unit to another: raise again what the callee has reported.
        failed, answer = pair(given)
        if failed != 0:
            raise RuntimeError
        return answer

    return call

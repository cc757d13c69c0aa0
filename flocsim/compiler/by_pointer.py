"""Arguments of compiled functions, handed over by one pointer.

numba passes an array as seven to eleven numbers, and a tuple of arrays as those of all of them: a
run's state would be some four hundred numbers in every call. Here a call hands over the address of
a table of words. There an array is the address of its data, then its sizes; a tuple is what is in
it, one behind the other; a number is one word. Inside compiled code ``work`` is a pointer into the
table, ``work.place`` another, and ``work.place[state, body, axis]`` a load through that. No word
changes while compiled code runs, which LLVM is told, so that it reads each once.

Arrays lie in C order; indices are whole numbers from 0 on, neither checked nor counted from the
end. Whatever is not one element of an array (a row, a slice) is an array as numba has them. Sizes
that are always the same are said where a tuple with names is declared, as
``motion: Annotated[np.ndarray, ("rows", "n", 6)]``, and become constants.
"""

import ctypes
import functools
import operator
import struct
import weakref
from collections.abc import Sequence
from hashlib import blake2b
from typing import Any, get_type_hints

import numpy as np

from flocsim.errors import KernelError

LAYOUTS: dict[tuple[Any, ...], str] = {}
"""{what the arguments are: how struct.pack makes a table of them}."""


def address_of(array):
    """Where the numbers of an array begin; as its buffer tells, which takes a fifth of the time,
    or, where that cannot be had (empty, read-only, with gaps), as numpy does."""
    if array.size:
        try:
            return ctypes.addressof(ctypes.c_char.from_buffer(array))
        except (TypeError, ValueError, BufferError):
            pass
    return array.__array_interface__["data"][0]


KEPT: dict[int, tuple[Any, list[Any], list[Any]]] = {}
"""{id of a tuple: (it, its words, what they are)} of those that stay (see keep)."""


def keep(value: tuple, owner: Any) -> None:
    """Let tables be made of a tuple in a fraction of the time as long as its owner lives; its
    arrays stay where they are. One that is kept stays with its first owner."""
    if id(value) in KEPT:
        return
    words: list[Any] = []
    kinds: list[Any] = []
    flatten(value, words, kinds)
    KEPT[id(value)] = value, words, kinds
    weakref.finalize(owner, KEPT.pop, id(value), None)


def flatten(value, words, kinds):
    """Append an argument to the words of a table, and what it is to ``kinds``."""
    if isinstance(value, np.ndarray):
        words.append(address_of(value))
        words.extend(value.shape)
        kind = value.dtype if value.dtype.names else value.dtype.char
        if value.flags.c_contiguous:
            kinds.append((kind, value.ndim))
        else:
            words.extend(value.strides)
            kinds.append((kind, value.ndim, "A"))
    elif isinstance(value, np.record):
        words.append(value.__array_interface__["data"][0])
        kinds.append(value.dtype)
    elif isinstance(value, tuple):
        if (kept := KEPT.get(id(value))) is not None:
            words += kept[1]
            kinds += kept[2]
            return
        kinds.append((type(value), len(value)))
        for each in value:
            flatten(each, words, kinds)
    elif value is None or callable(value):
        # A law of a scene that runs uncompiled: nothing that compiled code could use.
        words.append(0)
        kinds.append(None)
    else:
        words.append(value)
        kinds.append("d" if isinstance(value, float) else "q")


def table_of(arguments: Sequence[Any]) -> tuple[np.ndarray, tuple[Any, ...]]:
    """The arguments as a table (words,) for ``argument_at``, and what they are, to compile for."""
    words: list[Any] = []
    found: list[Any] = []
    for each in arguments:
        flatten(each, words, found)
    kinds = tuple(found)
    if kinds not in LAYOUTS:
        LAYOUTS[kinds] = "".join("d" if isinstance(each, float) else "q" for each in words)
    return np.frombuffer(struct.pack(LAYOUTS[kinds], *words), np.int64), kinds


def told_kinds(kinds: tuple[Any, ...]) -> str:
    """What the arguments are, in words that differ where what is compiled may: with the names of
    fields in their order, and sizes that are declared."""
    return " ".join(
        f"{each[0].__name__}{each[0]._fields}{sizes_of(each[0])}"
        if isinstance(each, tuple) and hasattr(each[0], "_fields")
        else repr(each)
        for each in kinds
    )


def words_in(kind):
    """How many words of a table hold a value of a numba type."""
    from numba import types

    if isinstance(kind, types.Array):
        return 1 + (1 if kind.layout == "C" else 2) * kind.ndim  # the address, sizes and strides
    if isinstance(kind, types.BaseTuple):
        return sum(map(words_in, kind.types))
    return kind.words if hasattr(kind, "words") else 1


@functools.cache
def kinds_of_types():
    """(Table, Elements): the numba types of a tuple with names and of an array in a table, with
    all that numba has to know of them."""
    from llvmlite import ir
    from numba import from_dtype
    from numba.core import types
    from numba.core.datamodel import models, register_default
    from numba.core.imputils import lower_builtin, lower_getattr_generic, lower_setattr_generic
    from numba.core.typing.templates import (
        AbstractTemplate,
        AttributeTemplate,
        infer_getattr,
        infer_global,
        signature,
    )
    from numba.np.arrayobj import make_array, populate_array

    word = ir.IntType(64)

    class Table(types.Type):
        """A tuple whose fields have names."""

        def __init__(self, name, fields):
            self.fields = fields
            self.places, place = {}, 0
            for each, kind in fields:
                self.places[each] = place
                place += words_in(kind)
            self.words = place
            # A hash, because the name of a type is in the name of every function that is given one.
            told = blake2b(repr(fields).encode(), digest_size=6)
            super().__init__(f"{name}_{told.hexdigest()}")

    class Elements(types.Type):
        """An array of numbers."""

        def __init__(self, dtype, ndim, sizes):
            self.dtype, self.ndim, self.sizes = dtype, ndim, sizes
            self.words = 1 + ndim
            self.array = types.Array(dtype, ndim, "C")
            super().__init__(f"elements_{dtype}_{'_'.join(map(str, sizes))}")

    class Row(types.Type):
        """A record: a row of named numbers."""

        def __init__(self, dtype):
            self.numbers = {
                name: (from_dtype(kind), offset) for name, (kind, offset) in dtype.fields.items()
            }
            self.size = dtype.itemsize
            self.words = 1
            told = blake2b(repr(dtype).encode(), digest_size=6)
            super().__init__(f"row_{told.hexdigest()}")

    @register_default(Row)
    class RowModel(models.DataModel):
        """A row by its address; in an array, the words themselves."""

        def get_value_type(self):
            return word.as_pointer()

        get_argument_type = get_return_type = get_value_type

        def get_data_type(self):
            return ir.ArrayType(word, self._fe_type.size // 8)

        def as_data(self, builder, value):
            return builder.load(builder.bitcast(value, self.get_data_type().as_pointer()))

        def as_argument(self, builder, value):
            return value

        from_argument = as_return = from_return = as_argument

        def load_from_data_pointer(self, builder, ptr, align=None):
            return builder.bitcast(ptr, self.get_value_type())

    @register_default(Table)
    @register_default(Elements)
    class PointerModel(models.PrimitiveModel):
        """A pointer into the table."""

        def __init__(self, manager, kind):
            super().__init__(manager, kind, word.as_pointer())

    def marked(builder, load, name, *parts):
        load.set_metadata(name, builder.module.add_metadata(parts))
        return load

    def read_word(builder, table, place):
        """A word of a table, which stays what it is."""
        pointer = builder.gep(table, [word(place)], inbounds=True)
        return marked(builder, builder.load(pointer), "invariant.load")

    def value_at(context, builder, kind, table, place):
        """A value of a numba type that begins at a place of a table."""
        if isinstance(kind, Table | Elements):
            return builder.gep(table, [word(place)], inbounds=True)
        if isinstance(kind, types.Array):
            pointer = builder.gep(table, [word(place)], inbounds=True)
            return whole(
                context, builder, Elements(kind.dtype, kind.ndim, (0,) * kind.ndim), pointer, kind
            )
        if isinstance(kind, types.BaseTuple):
            values = []
            for each in kind.types:
                values.append(value_at(context, builder, each, table, place))
                place += words_in(each)
            return context.make_tuple(builder, kind, values)
        if kind == types.none:
            return context.get_dummy_value()
        found = read_word(builder, table, place)
        if isinstance(kind, Row):
            return builder.inttoptr(found, word.as_pointer())
        if kind == types.float64:
            return builder.bitcast(found, ir.DoubleType())
        return context.cast(builder, found, types.int64, kind)

    def size(builder, kind, value, axis):
        known = kind.sizes[axis]
        return word(known) if known else read_word(builder, value, 1 + axis)

    def sizes(builder, kind, value):
        return [size(builder, kind, value, axis) for axis in range(kind.ndim)]

    def data(context, builder, kind, value):
        element = context.get_data_type(kind.dtype).as_pointer()
        return builder.inttoptr(read_word(builder, value, 0), element)

    def whole(context, builder, kind, value, array):
        """The array as numba has them."""
        found = make_array(array)(context, builder)
        itemsize = context.get_abi_sizeof(context.get_data_type(kind.dtype))
        lengths, strides = sizes(builder, kind, value), [word(itemsize)]
        if array.layout == "C":
            for length in lengths[:0:-1]:
                strides.insert(0, builder.mul(strides[0], length))
        else:
            first = 1 + kind.ndim
            strides = [read_word(builder, value, first + axis) for axis in range(kind.ndim)]
        populate_array(
            found, data(context, builder, kind, value), lengths, strides, word(itemsize), None
        )
        return found._getvalue()

    def is_element(kind, index):
        parts = index.types if isinstance(index, types.BaseTuple) else (index,)
        return len(parts) == kind.ndim and all(isinstance(each, types.Integer) for each in parts)

    def element(context, builder, kind, value, index, place):
        """The address of an element."""
        parts, given = (index,), [place]
        if isinstance(index, types.BaseTuple):
            parts = index.types
            given = [builder.extract_value(place, each) for each in range(len(parts))]
        offset = None
        for axis, (part, number) in enumerate(zip(parts, given, strict=True)):
            number = context.cast(builder, number, part, types.intp)
            if offset is not None:
                length = size(builder, kind, value, axis)
                number = builder.add(
                    builder.mul(offset, length, flags=["nsw"]), number, flags=["nsw"]
                )
            offset = number
        return builder.gep(data(context, builder, kind, value), [offset], inbounds=True)

    plain = {types.float64: "number", types.int64: "integer"}

    def aliases(builder, kind, access):
        """Tell LLVM that numbers and integers never lie in one place."""
        module = builder.module
        root = module.add_metadata(["flocsim"])
        named = module.add_metadata([plain[kind], root, word(0)])
        return marked(builder, access, "tbaa", named, named, word(0))

    @infer_getattr
    class Fields(AttributeTemplate):
        key = Table

        def generic_resolve(self, table, name):
            return dict(table.fields).get(name)

    @lower_getattr_generic(Table)
    def field(context, builder, kind, value, name):
        return value_at(context, builder, dict(kind.fields)[name], value, kind.places[name])

    @infer_getattr
    class Sizes(AttributeTemplate):
        key = Elements

        def resolve_shape(self, kind):
            return types.UniTuple(types.intp, kind.ndim)

    @lower_getattr_generic(Elements)
    def shape(context, builder, kind, value, name):
        lengths = types.UniTuple(types.intp, kind.ndim)
        return context.make_tuple(builder, lengths, sizes(builder, kind, value))

    @infer_getattr
    class RowFields(AttributeTemplate):
        key = Row

        def generic_resolve(self, row, name):
            return row.numbers[name][0] if name in row.numbers else None

    def field_at(context, builder, kind, value, name):
        """The address of a number of a row, and its type."""
        typed, offset = kind.numbers[name]
        place = builder.gep(value, [word(offset // 8)], inbounds=True)
        return builder.bitcast(place, context.get_data_type(typed).as_pointer()), typed

    def named(builder, kind, name, access):
        """Tell LLVM that this number is none of another name."""
        module = builder.module
        root = module.add_metadata(["flocsim"])
        tag = module.add_metadata([f"{kind.name}.{name}", root, word(0)])
        return marked(builder, access, "tbaa", tag, tag, word(0))

    @lower_getattr_generic(Row)
    def get_number(context, builder, kind, value, name):
        place, _ = field_at(context, builder, kind, value, name)
        return named(builder, kind, name, builder.load(place))

    @lower_setattr_generic(Row)
    def set_number(context, builder, sig, args, name):
        value, given = args
        place, _ = field_at(context, builder, sig.args[0], value, name)
        named(builder, sig.args[0], name, builder.store(given, place))
        return context.get_dummy_value()

    @infer_global(len)
    class Length(AbstractTemplate):
        def generic(self, args, kws):
            if isinstance(args[0], Elements):
                return signature(types.intp, *args)
            return None

    @lower_builtin(len, Elements)
    def length(context, builder, sig, args):
        return size(builder, sig.args[0], args[0], 0)

    @infer_global(operator.getitem)
    class GetItem(AbstractTemplate):
        def generic(self, args, kws):
            kind, index = args
            if not isinstance(kind, Elements):
                return None
            if is_element(kind, index):
                return signature(kind.dtype, *args)
            found = self.context.resolve_function_type(operator.getitem, (kind.array, index), {})
            return found and signature(found.return_type, kind, found.args[1])

    @lower_builtin(operator.getitem, Elements, types.Any)
    def getitem(context, builder, sig, args):
        (kind, index), (value, place) = sig.args, args
        if is_element(kind, index):
            pointer = element(context, builder, kind, value, index, place)
            if kind.dtype in plain:
                return aliases(builder, kind.dtype, builder.load(pointer))
            return context.unpack_value(builder, kind.dtype, pointer)
        inner = signature(sig.return_type, kind.array, index)
        call = context.get_function(operator.getitem, inner)
        return call(builder, (whole(context, builder, kind, value, kind.array), place))

    @infer_global(operator.setitem)
    class SetItem(AbstractTemplate):
        def generic(self, args, kws):
            kind, index, given = args
            if not isinstance(kind, Elements):
                return None
            if is_element(kind, index):
                return signature(types.none, kind, index, kind.dtype)
            inner = kind.array, index, given
            found = self.context.resolve_function_type(operator.setitem, inner, {})
            return found and signature(types.none, kind, *found.args[1:])

    @lower_builtin(operator.setitem, Elements, types.Any, types.Any)
    def setitem(context, builder, sig, args):
        (kind, index, given), (value, place, number) = sig.args, args
        if is_element(kind, index):
            pointer = element(context, builder, kind, value, index, place)
            if kind.dtype in plain:
                aliases(builder, kind.dtype, builder.store(number, pointer))
            elif isinstance(kind.dtype, Row):
                pointer = builder.bitcast(pointer, word.as_pointer())
                for name in kind.dtype.numbers:
                    source, _ = field_at(context, builder, kind.dtype, number, name)
                    target, _ = field_at(context, builder, kind.dtype, pointer, name)
                    copied = named(builder, kind.dtype, name, builder.load(source))
                    named(builder, kind.dtype, name, builder.store(copied, target))
            else:
                context.pack_value(builder, kind.dtype, number, pointer)
            return context.get_dummy_value()
        inner = signature(types.none, kind.array, index, given)
        call = context.get_function(operator.setitem, inner)
        return call(builder, (whole(context, builder, kind, value, kind.array), place, number))

    return Table, Elements, value_at, data, Row


def is_array(kind: Any) -> bool:
    """Whether a numba type is an array in C order, of a table or as numba has them."""
    from numba import types

    elements = kinds_of_types()[1]
    return isinstance(kind, elements) or (isinstance(kind, types.Array) and kind.layout == "C")


def address_of_data(context: Any, builder: Any, kind: Any, value: Any) -> Any:
    """The address of an array's data, in LLVM's terms; what is no array stays what it is."""
    _, elements, _, data, _ = kinds_of_types()
    if isinstance(kind, elements):
        return data(context, builder, kind, value)
    return context.make_array(kind)(context, builder, value).data if is_array(kind) else value


@functools.cache
def sizes_of(named: Any) -> dict[str, tuple[int, ...]]:
    """{field: sizes} that a tuple with names declares; 0: it may be any."""
    hints = get_type_hints(named, include_extras=True)
    declared = {name: getattr(hint, "__metadata__", ()) for name, hint in hints.items()}
    return {
        name: tuple(each if isinstance(each, int) else 0 for each in found[0])
        for name, found in declared.items()
        if found
    }


def type_of(value: Any, *, arrays: bool, sizes: tuple[int, ...] = ()) -> Any:
    """The numba type of an argument; ``arrays``: whether arrays are such as numba has them;
    ``sizes``: those that an array always has.

    Raises KernelError for an array of another order than C, but where they are numba's.
    """
    from numba import from_dtype, types

    table, elements, _, _, row = kinds_of_types()
    if isinstance(value, np.ndarray):
        dtype = row(value.dtype) if value.dtype.names else from_dtype(value.dtype)
        if arrays:
            return types.Array(dtype, value.ndim, "C" if value.flags.c_contiguous else "A")
        if not value.flags.c_contiguous:
            raise KernelError(f"an array (shape {value.shape}) does not lie in C order")
        return elements(dtype, value.ndim, sizes or (0,) * value.ndim)
    if hasattr(value, "_fields"):
        known = sizes_of(type(value))  # type: ignore[arg-type]
        kinds = [
            type_of(each, arrays=arrays, sizes=known.get(name, ()))
            for name, each in zip(value._fields, value, strict=True)
        ]
        if all(isinstance(kind, types.Number) for kind in kinds):
            return types.NamedTuple(kinds, type(value))
        return table(type(value).__name__, tuple(zip(value._fields, kinds, strict=True)))
    if isinstance(value, tuple):
        return types.Tuple.from_types([type_of(each, arrays=arrays) for each in value])
    if isinstance(value, np.record):
        return row(value.dtype)
    if value is None or callable(value):
        return types.none
    if isinstance(value, bool | np.bool_):
        return types.boolean
    return types.float64 if isinstance(value, float) else types.int64


def types_within(given: Sequence[Any]) -> dict[str, Any]:
    """{words: numba type} of some types, of what they are made of, and of numbers."""
    from numba import types

    found = {str(each): each for each in (types.float64, types.int64, types.boolean)}
    more = list(given)
    for kind in more:  # grows
        if str(kind) not in found:
            found[str(kind)] = kind
            more += [each for _, each in kind.fields] if hasattr(kind, "places") else []
            more += [kind.array] if hasattr(kind, "array") else []
    return found


def argument_at(kind: Any, place: int) -> Any:
    """A function for compiled code: the argument of a type at a place of a table at an address."""
    from llvmlite import ir
    from numba.extending import intrinsic

    _, _, value_at, _, _ = kinds_of_types()

    def generate(context, builder, typed, values):
        table = builder.inttoptr(values[0], ir.IntType(64).as_pointer())
        return value_at(context, builder, kind, table, place)

    @intrinsic
    def argument(typing, address):
        return kind(address), generate

    return argument

"""Records of arrays and numbers that compiled functions take as one pointer.

A named tuple would be passed to every function by value, with all its arrays, of which a scene has a hundred: its
compilation would take minutes.
"""

import typing
import zlib
from typing import Any

import numpy as np
from llvmlite import ir
from numba import from_dtype, types
from numba.core import cgutils
from numba.core.typing.templates import AttributeTemplate
from numba.extending import (
    NativeValue,
    infer_getattr,
    lower_getattr_generic,
    models,
    register_model,
    typeof_impl,
    unbox,
)
from numba.np.arrayobj import populate_array
from numba.np.numpy_support import as_dtype

_WORD = ir.IntType(64)
_NUMBERS = {float: types.float64, int: types.int64, bool: types.boolean}
_WORDS = {types.float64: np.float64, types.int64: np.int64, types.boolean: np.int64}


class RecordType(types.Type):
    """Compile-time type of a `Record`: the types of its fields, and their places in its block of words.

    Parameters
    ----------
    schema : type of NamedTuple
        Fields are numbers, arrays (of one dimension unless ``Annotated`` with their number), or named tuples.
    """

    def __init__(self, schema: type) -> None:
        self.layout: dict[str, tuple[int, types.Type]] = {}
        self.nested: dict[str, RecordType] = {}
        self.dtypes: dict[str, np.dtype[Any]] = {}
        offset = 0
        for name, hint in typing.get_type_hints(schema, include_extras=True).items():
            kind = _NUMBERS.get(hint)
            if hasattr(hint, "_fields"):
                kind = self.nested[name] = RecordType(hint)
            elif kind is None:
                kind = _array(hint)
            if isinstance(kind, types.Array):
                self.dtypes[name] = as_dtype(kind.dtype)
            self.layout[name] = (offset, kind)
            offset += 1 + (kind.ndim if isinstance(kind, types.Array) else 0)
        self.words = offset
        # Compiled code on disk is found by this name: it must change with the layout.
        super().__init__(name=f"{schema.__name__}_{zlib.crc32(repr(self.layout).encode()):08x}")


def _array(hint: Any) -> types.Array:
    dimensions = 1
    if typing.get_origin(hint) is typing.Annotated:
        hint, dimensions = typing.get_args(hint)
    element = typing.get_args(hint)[-1]  # the argument of NDArray, in a dtype before numpy 2.5
    (element,) = typing.get_args(element) or (element,)
    return types.Array(from_dtype(np.dtype(element)), dimensions, "C")


class Record:
    """The fields of a named tuple, nested ones included, laid out for kernels; keeps them alive.

    Arrays are shared, not copied, and must be C-contiguous. A record refers to the same arrays for all its life.

    Parameters
    ----------
    kind : RecordType
    fields : NamedTuple
    """

    __slots__ = ("_block", "_kept", "address", "fields", "kind")

    address: int

    def __init__(self, kind: RecordType, fields: Any) -> None:
        words: list[int] = []
        self._kept: list[Any] = []
        for name, value in zip(fields._fields, fields, strict=True):
            expected = kind.layout[name][1]
            if name in kind.nested:
                value = Record(kind.nested[name], value)
                words.append(value.address)
            elif isinstance(expected, types.Array):
                if value.dtype != kind.dtypes[name] or value.ndim != expected.ndim or not value.flags.c_contiguous:
                    raise TypeError(
                        f"{type(fields).__name__}.{name}: found {value.dtype}, {value.ndim}-D; not {expected}"
                    )
                words.append(value.__array_interface__["data"][0])  # quicker than value.ctypes.data
                words.extend(value.shape)
            else:
                number = np.float64(value) if expected == types.float64 else np.int64(value)
                words.append(int(number.view(np.int64)))
            self._kept.append(value)
        self._block = np.array(words, dtype=np.int64)
        self.address = int(self._block.ctypes.data)
        self.kind = kind
        self.fields = fields

    def point(self, name: str, address: int) -> None:
        """Replace a nested record by the record at `address`, which the caller keeps alive."""
        self._block[self.kind.layout[name][0]] = address


class Records:
    """Many records of one kind, as views of arrays whose first axis is the record's number.

    Parameters
    ----------
    kind : RecordType
    fields : NamedTuple
        As for `Record`, each field with one more axis in front, of length `count`, or 1 if all records share the value;
        numbers may be plain numbers.
    count : int

    Attributes
    ----------
    addresses : list of int
        Address of each record.
    """

    def __init__(self, kind: RecordType, fields: Any, count: int) -> None:
        self._kind, self._fields, self._kept = kind, fields, []
        number = np.arange(count)
        block = self._block = np.zeros((count, kind.words), dtype=np.int64)
        for name, value in zip(fields._fields, fields, strict=True):
            offset, expected = kind.layout[name]
            if name in kind.nested:
                nested = Records(kind.nested[name], value, count)
                self._kept.append(nested)
                block[:, offset] = nested.addresses
            elif isinstance(expected, types.Array):
                if value.dtype != kind.dtypes[name] or value.ndim != expected.ndim + 1 or not value.flags.c_contiguous:
                    raise TypeError(f"{type(fields).__name__}.{name}: found {value.dtype}, {value.ndim}-D")
                block[:, offset] = value.__array_interface__["data"][0]
                if len(value) > 1:
                    block[:, offset] += number * value.strides[0]
                block[:, offset + 1 : offset + value.ndim] = value.shape[1:]
            else:
                block[:, offset] = np.asarray(value, _WORDS[expected]).view(np.int64)
        self.addresses: list[int] = (block.ctypes.data + number * block.strides[0]).tolist()

    def __getitem__(self, number: int) -> Record:
        record = Record.__new__(Record)
        record._block, record._kept, record.kind = self._block[number], [self], self._kind
        record.address = self.addresses[number]
        record.fields = type(self._fields)._make(value[number] for value in self._fields)
        return record


@register_model(RecordType)
class _RecordModel(models.PrimitiveModel):
    """The address of the block."""

    def __init__(self, manager: Any, kind: RecordType) -> None:
        super().__init__(manager, kind, _WORD)


@typeof_impl.register(Record)
def _type_of(record: Record, _context: Any) -> RecordType:
    return record.kind


@unbox(RecordType)
def _unbox(_kind: RecordType, record: Any, context: Any) -> NativeValue:
    address = context.pyapi.object_getattr_string(record, "address")
    value = context.pyapi.long_as_longlong(address)
    context.pyapi.decref(address)
    return NativeValue(value)


@infer_getattr
class _RecordFields(AttributeTemplate):
    key = RecordType

    def generic_resolve(self, kind: RecordType, name: str) -> types.Type | None:
        return kind.layout[name][1] if name in kind.layout else None


@lower_getattr_generic(RecordType)
def _field(context: Any, builder: Any, record: RecordType, address: Any, name: str) -> Any:
    offset, kind = record.layout[name]
    block = builder.inttoptr(address, _WORD.as_pointer())

    def word(place: int) -> Any:
        loaded = builder.load(builder.gep(block, [ir.Constant(_WORD, offset + place)]))
        # Blocks never change, so a word read in a loop need be read only once.
        loaded.set_metadata("invariant.load", builder.module.add_metadata([]))
        return loaded

    if isinstance(kind, types.Array):
        element = context.get_data_type(kind.dtype)
        shape = [word(1 + axis) for axis in range(kind.ndim)]
        size = context.get_constant(types.intp, context.get_abi_sizeof(element))
        strides = [size]
        for length in reversed(shape[1:]):
            strides.insert(0, builder.mul(strides[0], length))
        array = context.make_array(kind)(context, builder)
        populate_array(
            array,
            data=builder.inttoptr(word(0), element.as_pointer()),
            shape=cgutils.pack_array(builder, shape),
            strides=cgutils.pack_array(builder, strides),
            itemsize=size,
            meminfo=None,
        )
        return array._getvalue()
    if kind == types.float64:
        return builder.bitcast(word(0), ir.DoubleType())
    if kind == types.boolean:
        return builder.trunc(word(0), ir.IntType(1))
    return word(0)

"""How functions are compiled: kernels, that callers absorb, and units, that are compiled once by themselves."""

import ctypes
from collections.abc import Callable
from functools import cached_property
from typing import Any

import llvmlite.binding as llvm
import numpy as np
from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.extending import intrinsic, models, register_model

from solvers.absorbed import PlainCompiler, absorbed, inlined
from solvers.kept import kept_callback

_WORD = ir.IntType(64)
_C = {types.float64: ctypes.c_double, types.boolean: ctypes.c_bool}  # records are passed by address
_NOWHERE = 1
_MOST_ITERATIONS = 1000  # of a root finder that halves an interval at worst every few
_MONOTONIC = 1  # the clock that does not jump


kernel = absorbed
inner_kernel = inlined


class Unit(types.ExternalFunction):
    """A compiled function that others call through its symbol, and Python, without the interpreter's lock, as it is.

    Callers do not absorb it: its code is optimized once.
    """

    def __init__(self, function: Callable[..., Any], signature: Any, needs: tuple["Unit", ...] = ()) -> None:
        super().__init__(f"{function.__module__}.{function.__name__}", signature)
        self.function = function
        self.needs = needs
        self.compiled: Any = None

    @property
    def address(self) -> int:
        """Where its code is."""
        self.compile()
        return int(self.compiled.address)

    @cached_property
    def call(self) -> Callable[..., Any]:
        """The function for Python; records are passed by their addresses."""
        self.compile()
        kinds: list[Any] = [_C.get(kind, ctypes.c_int64) for kind in (self.sig.return_type, *self.sig.args)]
        return ctypes.CFUNCTYPE(*kinds)(self.compiled.address)

    def compile(self) -> None:
        """Compile it, or load it from disk; the units it calls must be compiled, or among what it needs."""
        if self.compiled is None:
            for other in self.needs:
                other.compile()
            self.compiled = self.compile_to_disk()
            llvm.add_symbol(self.symbol, self.compiled.address)

    def compile_to_disk(self) -> Any:
        """Compile it; the units it calls must be declared."""
        return kept_callback(self.function, self.sig, PlainCompiler, nopython=True, error_model="numpy")

    def declare(self) -> None:
        """Let units that call it be compiled, but not run, without it."""
        if self.compiled is None:
            llvm.add_symbol(self.symbol, _NOWHERE)


register_model(Unit)(models.OpaqueModel)

UNITS: dict[str, Unit] = {}


def unit(
    result: types.Type, *arguments: types.Type, needs: tuple[Unit, ...] = ()
) -> Callable[[Callable[..., Any]], Unit]:
    """Make the decorated function a unit; one must be defined after those it calls.

    Of these, it `needs` those that are not compiled for every run.
    """

    def build(function: Callable[..., Any]) -> Unit:
        defined = Unit(function, result(*arguments), needs)
        UNITS[defined.symbol] = defined
        return defined

    return build


@intrinsic
def call(typing_context: Any, address: Any, one: Any, two: Any, three: Any, four: Any) -> Any:
    """Call the function at `address` with four whole numbers; it returns one."""

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        function = ir.FunctionType(_WORD, [_WORD] * 4)
        return builder.call(builder.inttoptr(arguments[0], function.as_pointer()), arguments[1:])

    return types.int64(types.int64, types.int64, types.int64, types.int64, types.int64), generate


@intrinsic
def find_root(
    typing_context: Any, brentq: Any, function: Any, record: Any, low: Any, high: Any, absolute: Any, relative: Any
) -> Any:
    """Root between `low` and `high` of a unit that takes a number and a record, by SciPy's function at `brentq`."""

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        finder, _, *numbers = arguments
        real, integer = ir.DoubleType(), ir.IntType(32)
        sought = ir.FunctionType(real, [real, _WORD])
        find = ir.FunctionType(real, [sought.as_pointer(), real, real, _WORD, real, real, integer, _WORD])
        machine, start, end, *tolerances = numbers
        return builder.call(
            builder.inttoptr(finder, find.as_pointer()),
            [
                cgutils.get_or_insert_function(builder.module, sought, function.symbol),
                *(start, end, machine, *tolerances),
                *(ir.Constant(integer, _MOST_ITERATIONS), ir.Constant(_WORD, 0)),
            ],
        )

    return types.float64(types.int64, function, record, *(types.float64,) * 4), generate


@intrinsic
def address_of(typing_context: Any, record: Any) -> Any:
    """Address of a record."""

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        return arguments[0]

    return types.int64(record), generate


@intrinsic
def _clock_gettime(typing_context: Any, address: Any, target: Any) -> Any:
    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        number = ir.IntType(32)
        function = builder.inttoptr(arguments[0], ir.FunctionType(number, [number, _WORD]).as_pointer())
        return builder.call(function, [ir.Constant(number, _MONOTONIC), arguments[1]])

    return types.int32(types.int64, types.int64), generate


@kernel
def seconds(address: int, ticks: np.ndarray) -> float:
    """Read the clock whose function is at `address` (0 for none); `ticks` is (2,) int64 scratch."""
    if address == 0:
        return 0.0
    _clock_gettime(address, ticks.ctypes.data)
    return ticks[0] + 1e-9 * ticks[1]

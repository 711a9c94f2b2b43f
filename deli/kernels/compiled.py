"""How functions are compiled: kernels, that callers absorb, and units, that are compiled once by themselves."""

import ctypes
from collections.abc import Callable
from typing import Any

import llvmlite.binding as llvm
import numpy as np
from llvmlite import ir
from numba import cfunc, njit, types
from numba.extending import intrinsic, models, register_model

_WORD = ir.IntType(64)
_C = {types.float64: ctypes.c_double, types.boolean: ctypes.c_bool}  # records are passed by address
_MONOTONIC = 1  # the clock that does not jump


def kernel(function: Callable[..., Any]) -> Any:
    """Compile a function for the units that call it, each of which absorbs it and is kept on disk as a whole."""
    dispatcher = njit(nogil=True, error_model="numpy")(function)
    resolve = dispatcher.get_call_template

    def without_literals(arguments: Any, keywords: Any) -> Any:
        # A function called with 0 and with n would be compiled twice.
        return resolve([types.unliteral(argument) for argument in arguments], keywords)

    dispatcher.get_call_template = without_literals
    return dispatcher


class Unit(types.ExternalFunction):
    """A compiled function that others call through its symbol, and Python, without the interpreter's lock, as it is.

    Callers do not absorb it: its code is optimized once, and a change of it recompiles it alone.
    """

    def __init__(self, symbol: str, signature: Any, compiled: Any) -> None:
        super().__init__(symbol, signature)
        self._compiled = compiled
        kinds = (signature.return_type, *signature.args)
        self.call = ctypes.CFUNCTYPE(*(_C.get(kind, ctypes.c_int64) for kind in kinds))(compiled.address)


register_model(Unit)(models.OpaqueModel)


def unit(result: types.Type, *arguments: types.Type) -> Callable[[Callable[..., Any]], Any]:
    """Compile the decorated function now, or load it from disk."""

    def build(function: Callable[..., Any]) -> Unit:
        signature = result(*arguments)
        compiled = cfunc(signature, nopython=True, cache=True, error_model="numpy")(function)
        symbol = f"{function.__module__}.{function.__name__}"
        llvm.add_symbol(symbol, compiled.address)
        return Unit(symbol, signature, compiled)

    return build


@intrinsic
def call(typing_context: Any, address: Any, one: Any, two: Any, three: Any, four: Any) -> Any:
    """Call the function at `address` with four whole numbers; it returns one."""

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        function = ir.FunctionType(_WORD, [_WORD] * 4)
        return builder.call(builder.inttoptr(arguments[0], function.as_pointer()), arguments[1:])

    return types.int64(types.int64, types.int64, types.int64, types.int64, types.int64), generate


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

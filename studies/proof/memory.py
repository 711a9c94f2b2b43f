"""Access of compiled code to Python's memory, by symbols with addresses from Python."""

from typing import Any

import llvmlite.binding as llvm
from llvmlite import ir
from numba import types
from numba.extending import intrinsic

_BYTE = ir.IntType(8)


def store(symbol: str, place: int) -> Any:
    """Return a function for compiled code that sets the n-th byte at an address."""
    llvm.add_symbol(symbol, place)

    @intrinsic
    def mark(typing_context: Any, number: Any) -> Any:
        def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
            start = _external(builder.module, symbol)
            builder.store(_BYTE(1), builder.gep(start, arguments))
            return context.get_dummy_value()

        return types.none(types.int64), generate

    return mark


def equals(symbol: str, place: int) -> Any:
    """Return a function for compiled code that returns whether the word at an address is n."""
    llvm.add_symbol(symbol, place)

    @intrinsic
    def compare(typing_context: Any, number: Any) -> Any:
        def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
            word = builder.bitcast(_external(builder.module, symbol), arguments[0].type.as_pointer())
            return builder.icmp_signed("==", builder.load(word), arguments[0])

        return types.boolean(types.int64), generate

    return compare


def _external(module: ir.Module, symbol: str) -> ir.GlobalVariable:
    return module.globals.get(symbol) or ir.GlobalVariable(module, _BYTE, symbol)

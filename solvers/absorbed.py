"""Compilation of functions that only other compiled functions call."""

from collections.abc import Callable
from typing import Any

from numba import njit, types
from numba.core.codegen import JITCodeLibrary
from numba.core.compiler import Compiler
from numba.core.compiler_machinery import PassManager
from numba.core.typed_passes import (
    AnnotateTypes,
    IRLegalization,
    NativeLowering,
    NoPythonBackend,
    NopythonTypeInference,
    PreLowerStripPhis,
)
from numba.core.untyped_passes import FixupArgs, IRProcessing, ReconstructSSA, TranslateByteCode

_PASSES = (
    TranslateByteCode,
    FixupArgs,
    IRProcessing,
    ReconstructSSA,
    NopythonTypeInference,
    PreLowerStripPhis,
    IRLegalization,
    AnnotateTypes,
    NativeLowering,
    NoPythonBackend,
)


def absorbed(function: Callable[..., Any]) -> Any:
    """Compile a function for compiled callers. Each caller absorbs its code and optimizes it with its own.

    Numba optimizes a function with its callees, and once more with each of its callers, into machine code that
    nobody runs, and adds wrappers for calls from Python. This decorator leaves both out; they took half of the time.
    A call of such a function from Python crashes.
    """
    return _absorb(function, False)


def inlined(function: Callable[..., Any]) -> Any:
    """Compile a function as `absorbed` does, and replace every call by its code.

    Otherwise the optimizer keeps one copy of a function with several callers, and a call hands it an array as seven
    numbers. A short function in an inner loop costs less than such a call.
    """
    return _absorb(function, True)


def _absorb(function: Callable[..., Any], everywhere: bool) -> Any:
    dispatcher = njit(
        error_model="numpy",
        no_cpython_wrapper=True,
        no_cfunc_wrapper=True,
        forceinline=everywhere,
        pipeline_class=_AbsorbedCompiler,
    )(function)
    resolve = dispatcher.get_call_template

    def without_literals(arguments: Any, keywords: Any) -> Any:
        # A function called with 0 and with n would be compiled twice.
        return resolve([types.unliteral(argument) for argument in arguments], keywords)

    dispatcher.get_call_template = without_literals
    return dispatcher


class _Codegen:
    """A code generator for functions without an address, and thus without a place for their environment."""

    def __init__(self, codegen: Any) -> None:
        self._codegen = codegen

    def __getattr__(self, name: str) -> Any:
        return getattr(self._codegen, name)

    def set_env(self, name: str, environment: Any) -> None:
        """Do nothing, because nothing refers to the environment."""


class _AbsorbedLibrary(JITCodeLibrary):
    """The code of a function and of its callees, before optimization."""

    def __init__(self, codegen: Any, name: str) -> None:
        super().__init__(_Codegen(codegen), name)

    def add_llvm_module(self, module: Any) -> None:
        module.data_layout = self._codegen._data_layout
        self._final_module.link_in(module)

    def finalize(self) -> None:
        for library in dict.fromkeys(self._linking_libraries):
            self._reload_init.update(library._reload_init)
            self._final_module.link_in(library._get_module_for_linking(), preserve=True)
        self._finalized = True


class PlainCompiler(Compiler):
    """Numba's compiler without its passes for closures, exceptions, arrays in expressions and literal arguments."""

    def define_pipelines(self) -> list[PassManager]:
        """Return the only pipeline."""
        manager = PassManager("plain")
        for step in _PASSES:
            manager.add_pass(step, step.__name__)
        manager.finalize()
        return [manager]


class _AbsorbedCompiler(PlainCompiler):
    def __init__(self, typing: Any, target: Any, library: Any, *rest: Any) -> None:
        super().__init__(typing, target, _AbsorbedLibrary(target.codegen(), "absorbed"), *rest)

"""Look into code that numba compiles: what of it has run, and what it does when it is changed in one place.

Tracers see Python alone. Here modules are changed as they are imported: their syntax trees get calls that the compiled
code turns into a read or a write of memory that Python sees as well.
"""

import ast
import ctypes
import mmap
import os
import re
from collections.abc import Callable
from importlib.abc import MetaPathFinder
from importlib.machinery import ModuleSpec, PathFinder, SourceFileLoader
from pathlib import Path
from typing import Any

ROOT = Path(__file__).parents[2]
DECORATORS = {"absorbed", "inlined", "inner_kernel", "kernel", "njit", "unit"}
DECORATED = re.compile(rf"^@({'|'.join(DECORATORS)})\b", re.MULTILINE)


def compiled_functions(tree: ast.AST) -> list[ast.FunctionDef]:
    """The functions of a module that numba compiles."""

    def name(decorator: ast.expr) -> str | None:
        called = decorator.func if isinstance(decorator, ast.Call) else decorator
        return called.id if isinstance(called, ast.Name) else None

    return [
        node
        for node in ast.walk(tree)
        if isinstance(node, ast.FunctionDef) and DECORATORS & {name(each) for each in node.decorator_list}
    ]


def modules() -> list[Path]:
    """The files that hold such functions, in a fixed order."""
    files = sorted([*ROOT.glob("deli/**/*.py"), *ROOT.glob("solvers/**/*.py")])
    return [file for file in files if DECORATED.search(file.read_text())]


class Importer(MetaPathFinder):
    """Change modules as they are imported.

    Parameters
    ----------
    change : function of a path and its syntax tree, which it changes
    names : function that returns what the changed trees call, by name; called when the first of them is imported
    files : the modules to change
    """

    def __init__(
        self, change: Callable[[Path, ast.Module], None], names: Callable[[], dict[str, Any]], files: list[Path]
    ) -> None:
        self._change, self._names, self._files = change, names, {str(file) for file in files}

    def find_spec(self, name: str, path: Any, target: Any = None) -> ModuleSpec | None:
        spec = PathFinder.find_spec(name, path, target) if name.partition(".")[0] in ("deli", "solvers") else None
        if spec is None or spec.origin not in self._files:
            return None
        spec.loader = _Loader(name, spec.origin, self._change, self._names)
        return spec


class _Loader(SourceFileLoader):
    def __init__(self, name: str, path: str, change: Any, names: Any) -> None:
        super().__init__(name, path)
        self._change, self._names = change, names

    def get_code(self, name: str) -> Any:  # which would look for bytecode on disk, and keep it there
        tree = ast.parse(Path(self.path).read_text())
        self._change(Path(self.path), tree)
        return compile(ast.fix_missing_locations(tree), self.path, "exec", dont_inherit=True)

    def exec_module(self, module: Any) -> None:
        vars(module).update(self._names())
        super().exec_module(module)


def shared_bytes(file: Path, size: int) -> mmap.mmap:
    """Bytes that all processes share, so that what one has written is there however it ends."""
    descriptor = os.open(file, os.O_RDWR | os.O_CREAT)
    try:
        os.ftruncate(descriptor, size)
        return mmap.mmap(descriptor, size)
    finally:
        os.close(descriptor)


def address(buffer: mmap.mmap) -> int:
    return ctypes.addressof(ctypes.c_char.from_buffer(buffer))

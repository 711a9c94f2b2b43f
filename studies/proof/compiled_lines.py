"""A plugin of coverage.py that counts the lines of compiled functions: `[tool.coverage.run]` in ``pyproject.toml``.

Run as a program after the tests, it adds the counted lines to coverage's data.
"""

import ast
import os
import sys
from functools import cache
from itertools import accumulate
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).parent))
import compiled_code

MARKS = compiled_code.ROOT / ".coverage-compiled"


@cache
def _lengths() -> dict[Path, int]:
    """Return the number of marks of each file: one for each line, and one before the first."""
    return {file: len(file.read_text().splitlines()) + 1 for file in compiled_code.modules()}


def _starts() -> dict[Path, int]:
    return dict(zip(_lengths(), accumulate(_lengths().values(), initial=0), strict=False))


def _mark_lines(file: Path, tree: ast.Module) -> None:
    start = _starts()[file]
    for function in compiled_code.compiled_functions(tree):
        for node in list(ast.walk(function)):
            for block in (getattr(node, name, None) for name in ("body", "orelse")):
                if isinstance(block, list):
                    block[:] = [each for statement in block for each in (_mark(start + statement.lineno), statement)]


def _mark(number: int) -> ast.stmt:
    return ast.parse(f"_ran({number})").body[0]


@cache
def _names() -> dict[str, Any]:
    import memory  # numba, that not every process needs

    marks = compiled_code.shared_bytes(MARKS, sum(_lengths().values()))
    return {"_ran": memory.store("deli_lines", compiled_code.address(marks)), "_marks": marks}


def coverage_init(registry: Any, options: Any) -> None:
    """Called by coverage.py in every process that it measures."""
    os.environ.setdefault("NUMBA_CACHE_DIR", f"{MARKS}-code")
    sys.meta_path.insert(0, compiled_code.Importer(_mark_lines, _names, compiled_code.modules()))


def main() -> None:
    from coverage import CoverageData

    marks = MARKS.read_bytes()
    lines = {
        str(file): [line for line in range(_lengths()[file]) if marks[start + line]]
        for file, start in _starts().items()
    }
    data = CoverageData(basename=str(compiled_code.ROOT / ".coverage"), suffix="compiled")
    data.add_lines(lines)
    data.write()
    MARKS.unlink()


if __name__ == "__main__":
    main()

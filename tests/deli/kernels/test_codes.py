"""No code that a kernel returns is dropped: it is looked at, on every path, before the next one or the end."""

import ast
import textwrap
from pathlib import Path

import pytest
from code_flow import HANDED_ON, Flow, functions, leaves_code, returns_code

from deli import integrators, kernels

KERNELS = sorted(Path(kernels.__file__).parent.glob("*.py"))
CALLERS = sorted(Path(integrators.__file__).parent.glob("*.py"))
TREES = {path: ast.parse(path.read_text()) for path in KERNELS + CALLERS}


def coded_functions() -> dict[Path, set[str]]:
    """Names, as each module of the kernels knows them, of functions that return a code."""
    found: dict[Path, set[str]] = {path: {"call", "bound.call"} for path in TREES}
    by_module = {f"deli.kernels.{path.stem}": path for path in KERNELS}
    while True:
        before = sum(map(len, found.values()))
        for path, tree in TREES.items():
            for node in ast.walk(tree):
                if isinstance(node, ast.ImportFrom) and node.module in by_module:
                    there = found[by_module[node.module]]
                    found[path] |= {alias.name for alias in node.names if alias.name in there}
            if path in KERNELS:
                found[path] |= {each.name for each in functions(tree) if returns_code(each, found[path])}
        if sum(map(len, found.values())) == before:
            return found


CODED = coded_functions()
LEAVING = HANDED_ON | {each.name for path in KERNELS for each in functions(TREES[path]) if leaves_code(each)}


@pytest.mark.parametrize("path", TREES, ids=lambda path: f"{path.parent.name}.{path.stem}")
def test_every_code_is_looked_at(path: Path) -> None:
    for function in functions(TREES[path]):
        assert Flow(CODED[path], LEAVING).follow(function) == [], f"{path.name}: {function.name}"


def test_the_functions_that_return_codes_are_known() -> None:
    known = {f"{path.stem}.{name}" for path, names in CODED.items() for name in names}
    for expected in (
        "solve.solve", "turning.turn_back", "turning._tangent", "forces.hessian", "iterates.floor", "shadow.shadow",
        "collision._collide", "landing.land", "step._attempt", "direct.move", "nonsmooth_alpha._carry",
        "contacts.find_gaps", "reflection._pass", "smooth.smooth_step",
    ):  # fmt: skip
        assert expected in known
    assert {"connect", "strayed", "rate", "presses", "_closed", "has_strayed"}.isdisjoint(set().union(*CODED.values()))
    assert {"gap_after", "energy_after", "find_root"} == LEAVING


@pytest.mark.parametrize(
    ("body", "said"),
    [
        ("solve(m)", "not bound"),
        ("code = solve(m)", "at the end"),
        ("code = solve(m)\nreturn 1.0", "is not returned"),
        ("code = solve(m)\ncode = solve(m)\nreturn code", "overwritten"),
        ("code, z = solve(m)\nreturn z", "is not returned"),
        ("if solve(m) == DONE:\n    z = 1\nreturn z", "not bound"),
        ("code = solve(m)\nif code == DONE:\n    z = 1\nreturn z", "is not returned"),
        ("for k in range(3):\n    code = solve(m)\nreturn code", "overwritten"),
        ("code = solve(m)\nif code == DONE:\n    code = solve(m)\nelse:\n    z = 1\nreturn DONE", "is not returned"),
        ("if call(m) != ANSWERED:\n    z = 1\nreturn DONE", "is not returned"),
        ("z = find_root(m)\nreturn z", "is not returned"),
        ("code = solve(m)\nif code != DONE:\n    return code\nreturn DONE", None),
        ("code = solve(m)\nif code == DONE:\n    code = solve(m)\nif code != DONE:\n    return code\nreturn z", None),
        ("code = REFRESH if z else solve(m)\nreturn find(m) if code == DONE else code", None),
        ("z = find_root(m)\nreturn work.meeting[2], z", None),
        ("while True:\n    code = solve(m)\n    if code != DONE or z:\n        return code\n    z = 1", None),
        ("if call(m) != ANSWERED:\n    return RAISED\nreturn solve(m)", None),
        ("code = DONE if call(m) == ANSWERED else RAISED\nreturn code", None),
    ],
)
def test_what_counts_as_dropped(body: str, said: str | None) -> None:
    (function,) = functions(ast.parse("def f(m, z, work):\n" + textwrap.indent(body, "    ")))
    dropped = Flow({"solve", "find", "call"}, {"find_root"}).follow(function)
    assert bool(dropped) == (said is not None)
    assert said is None or said in dropped[0]

"""The order of the packages: who may import whom, without circles, as CONTRIBUTING.md says."""

import re
from collections.abc import Iterator
from graphlib import TopologicalSorter
from pathlib import Path

import grimp
import pytest

from deli.kernels import build

ROOT = Path(__file__).parents[1]


@pytest.fixture(scope="module")
def graph():
    return grimp.build_graph("deli", "solvers", exclude_type_checking_imports=True)


@pytest.fixture(scope="module")
def typed_graph():
    return grimp.build_graph("deli", "solvers")


def table() -> Iterator[tuple[set[str], set[str]]]:
    """Rows of the layout's table: modules or packages, and those that they may import."""
    for row in re.findall(r"^\| (`(?:deli|solvers)/\S*`.*) \|$", (ROOT / "CONTRIBUTING.md").read_text(), re.MULTILINE):
        first, *_, last = row.split(" | ")
        yield ({_module(name) for name in re.findall(r"`([^`]+)`", cell)} for cell in (first, last))


def _module(path: str) -> str:
    return path.removesuffix(".py").removesuffix("/__init__").strip("/").replace("/", ".")


def part_of(module: str, parts: set[str]) -> str:
    """The entry of the table that a module belongs to: the longest name that it begins with."""
    return max((name for name in parts if f"{module}.".startswith(f"{name}.")), key=len, default="")


def test_each_row_imports_what_the_table_says(graph):
    rows = [(members, {*allowed}) for members, allowed in table()]
    parts = {part for members, _ in rows for part in members}
    assert len(rows) > 20
    for members, allowed in rows:
        found = {
            part_of(other, parts)
            for module in graph.modules
            if part_of(module, parts) in members
            for other in graph.find_modules_directly_imported_by(module)
            if part_of(other, parts) != part_of(module, parts)
        }
        assert found == allowed, members


def test_each_module_has_a_row_of_its_own(graph):
    parts = {part for members, _ in table() for part in members}
    assert {part_of(module, parts) for module in graph.modules if module != "deli"} == parts - {"deli"}


def test_a_row_imports_rows_above_it():
    above: set[str] = set()
    for members, allowed in table():
        above |= members
        assert allowed <= above, members


def test_no_modules_import_each_other_in_a_circle(typed_graph):
    order = {module: typed_graph.find_modules_directly_imported_by(module) for module in typed_graph.modules}
    del order["deli"]  # names its exports for type checkers
    assert [*TopologicalSorter(order).static_order()]


def test_the_digest_of_compiled_code_reads_all_its_sources():
    graph = grimp.build_graph("deli", "solvers", exclude_type_checking_imports=True, include_external_packages=True)
    wanted, todo = set(), {module for module in graph.modules if module.startswith("deli.kernels.")}
    while todo:
        module = todo.pop()
        wanted.add(module)
        imported = graph.find_modules_directly_imported_by(module)
        if imported & {"numba", "solvers.absorbed", "deli.kernels.compiled"}:  # what it imports may be compiled with it
            todo |= {name for name in imported if name.startswith(("deli.", "solvers."))} - wanted
    read = {".".join(path.relative_to(ROOT).with_suffix("").parts) for path in build.sources()}
    assert wanted - {"deli.kernels"} <= read
    assert {"solvers.absorbed", "solvers.native_factor", "deli.mechanics.tables"} <= wanted

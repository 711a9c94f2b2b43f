"""Configs that nobody means: each is refused in one line that names the key, or it runs."""

import inspect
import re
import tomllib

import pytest
from hostile_judging import judge, sizes, try_all, words
from hostile_values import (
    CONFIG_FILES,
    LITERALS,
    NUMBERS,
    OTHERS,
    ROOT,
    WORDS,
    changed_structure,
    changed_text,
    nested_tables,
)  # fmt: skip
from hypothesis import strategies as st

import deli
from deli.integrators.registry import METHODS

README = re.findall(r"```toml\n(.*?)```", (ROOT / "README.md").read_text(), re.DOTALL)
SHIPPED = [path.read_text() for path in CONFIG_FILES] + [text for text in README if "[axes]" not in text]
SHORT = ("--set", "steps=2", "--set", "record.every=1")
RUN = st.sampled_from(["check", "check", "dry", "dry", "run"])


@pytest.fixture
def tried(victim, tmp_path):
    """Carry out one config in the given way, and judge what became of it."""
    place = tmp_path / "config.toml"
    (tmp_path / "inside").mkdir()

    def carry_out(case):
        content, way = case
        place.write_bytes(content if isinstance(content, bytes) else content.encode())
        output = ("-o", "inside/run.nc", "--overwrite", "--quiet")
        command = {"check": ("check",), "dry": ("run", "--dry-run", *output), "run": ("run", *SHORT, *output)}[way]
        judge(victim.run(tmp_path, *command[:1], place.name, *command[1:]), *words(content))

    yield carry_out
    assert {path.name for path in tmp_path.iterdir()} <= {"config.toml", "inside"}


@sizes(30, 4000)
def test_shipped_configs_with_other_entries(tried, examples):
    tables = st.sampled_from([tomllib.loads(text) for text in SHIPPED])
    try_all(st.tuples(tables.flatmap(changed_structure), RUN), examples, tried)


@sizes(30, 2500)
def test_shipped_configs_with_other_letters(tried, examples):
    try_all(st.tuples(st.sampled_from(SHIPPED).flatmap(changed_text), RUN), examples, tried)


@sizes(20, 1500)
def test_tables_of_any_shape(tried, examples):
    try_all(st.tuples(nested_tables(), RUN), examples, tried)


PARAMETERS = [
    (name, f"scene.{key}")
    for name in deli.scenes.available()
    for key in [*inspect.signature(inspect.unwrap(deli.scenes.get(name))).parameters, "perturbation"]
]
SETTINGS = [
    ("newtons_cradle", key)
    for key in (
        "step_size",
        "steps",
        "duration",
        "skip",
        "contact_tolerance",
        "solvers",
        "solvers.default",
        "solvers.position",
        "solvers.default.backend",
        "solvers.reflection.tolerance",
        "solvers.default.options",
        "solvers.default.polish",
        "solvers.default.warm_start",
        "record",
        "record.every",
        "record.output",
        "record.subproblems",
        "scene",
        "method",
        "scene.name",
        "method.name",
        "method.scheme",
        "",
        ".",
        "scene.",
        "__class__",
        "a.b.c",
        "a" * 3000,
    )
] + [("point_mass", f"method.{key}") for method in METHODS.values() for key in inspect.signature(method).parameters]


SMALL = {"disc_pile": ("scene.rows=3", "scene.columns=3"), "hard_sphere_gas": ("scene.spheres=20",)}


def fewer(scene, key):
    """Overrides that make a scene of many bodies small, where they are not what is tried."""
    return [part for text in SMALL.get(scene, ()) if not text.startswith(f"{key}=") for part in ("--set", text)]


@sizes(40, 2500)
def test_overrides(victim, tmp_path, examples):
    """Every parameter of every scene and method, and every setting, with every extreme value, run for two steps."""

    def check(case):
        (scene, key), literal = case
        override = f"{key}={literal}"[:100_000]
        short = () if key in ("steps", "duration", "record.every") else SHORT
        way = ("--dry-run",) if key in ("steps", "duration", "step_size") else ()
        arguments = (scene, *short, *fewer(scene, key), "--set", override, "-o", "x.nc", "--overwrite", "-q", *way)
        judge(victim.run(tmp_path, "run", *arguments), key.rpartition(".")[2], scene)

    try_all(st.tuples(st.sampled_from(PARAMETERS + SETTINGS), LITERALS), examples, check)


@pytest.mark.long
@pytest.mark.parametrize(("scene", "key"), PARAMETERS)
def test_every_parameter_with_every_number(victim, tmp_path, scene, key):
    for literal in (*NUMBERS, *WORDS[:6], *OTHERS[:12]):
        override = ("--set", f"{key}={literal}")
        arguments = ("run", scene, *SHORT, *fewer(scene, key), *override, "-o", "x.nc", "--overwrite", "-q")
        judge(victim.run(tmp_path, *arguments), key.rpartition(".")[2], scene)

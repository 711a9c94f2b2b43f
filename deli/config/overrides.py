"""Changes of a config's table: expansion of short forms, and ``key.path=value`` overrides."""

import re
from collections.abc import Iterable, Mapping
from typing import Any

from deli.config.reading import MOST_DEPTH, parse_toml, refuse_unusable
from deli.errors import InputError

BARE_STRING = re.compile(r"[A-Za-z_./~][\w./:~-]*")
SHORT_FORMS = {"scene": "name", "method": "name", "solvers": "default"}
CHOICE_KEYS = {"backend", "tolerance", "polish", "warm_start", "options"}
EXCLUSIVE = {"steps": "duration", "duration": "steps"}


def expand(table: Mapping[str, Any]) -> dict[str, Any]:
    """Return a copy with tables in place of short forms.

    Short forms are ``scene = "pogo_stick"``, ``method = "gvi"``, ``solvers = "osqp"``,
    ``solvers = {backend = "osqp"}``, and names in place of tables for single subproblems.
    """
    copy = {key: _copied(value) for key, value in table.items()}
    for key, inner in SHORT_FORMS.items():
        if isinstance(copy.get(key), str):
            copy[key] = {inner: copy[key]}
    return _expand_solvers(copy)


def _expand_solvers(table: dict[str, Any]) -> dict[str, Any]:
    choices = table.get("solvers")
    if isinstance(choices, dict):
        if CHOICE_KEYS & set(choices):
            choices = {"default": choices}
        table["solvers"] = {
            name: {"backend": choice} if isinstance(choice, str) else choice for name, choice in choices.items()
        }
    return table


def apply_overrides(table: dict[str, Any], overrides: Iterable[str]) -> dict[str, Any]:
    """Apply ``key.path=value`` texts in order; one of steps and duration replaces the other.

    Raises
    ------
    InputError
        If a text has no ``=``, a value is neither TOML nor a bare word, or a path leads through a value.
    """
    for text in overrides:
        path, equals, value = text.partition("=")
        keys = [key.strip() for key in path.split(".")]
        if not equals or not all(keys) or len(keys) > MOST_DEPTH:
            raise InputError(f"--set {text}: expected key=value, such as step_size=0.01 or scene.balls=3.")
        parsed = parse_value(text, value.strip())
        try:
            refuse_unusable({".".join(keys): parsed})
            override(table, keys, parsed)
        except InputError as error:
            raise InputError(f"--set {text}: {error}") from error
    return _expand_solvers(table)


def assign(table: dict[str, Any], key: str, value: Any) -> None:
    """Set a dotted key of a table without short forms, such that the result has none either.

    A table as value is merged into the present table, or replaces it if the value has an identity of its own: the
    ``name`` of a scene or a method, or the ``backend`` of a solver.

    Raises
    ------
    InputError
        If the path leads through a value.
    """
    keys = key.split(".")
    if isinstance(value, Mapping) and not {"name", "backend"} & set(value):
        for inner, entry in value.items():
            assign(table, f"{key}.{inner}", entry)
        return
    if keys[0] == "solvers" and len(keys) == 1:
        keys = ["solvers", "default"]
    override(table, keys, _copied(value))
    _expand_solvers(table)


def override(table: dict[str, Any], keys: list[str], value: Any) -> None:
    """Set one entry of a table, at a path of keys."""
    if len(keys) == 1:
        if keys[0] in SHORT_FORMS and isinstance(value, str):
            keys = [keys[0], SHORT_FORMS[keys[0]]]
        table.pop(EXCLUSIVE.get(keys[0], ""), None)
    if keys[:1] == ["scene"] and keys[-1] == "name" and table.get("scene", {}).get("name") != value:
        table["scene"] = {}
    inner = table
    for index, key in enumerate(keys[:-1]):
        inner = inner.setdefault(key, {})
        if not isinstance(inner, dict):
            path = ".".join(keys[: index + 1])
            raise InputError(f"{path} is {inner!r}, not a table.")
    inner[keys[-1]] = value


def parse_value(text: str, value: str) -> Any:
    """Read a value in TOML's syntax; a bare word is a string."""
    try:
        parsed = parse_toml(f"value = {value}")
    except InputError as error:
        if BARE_STRING.fullmatch(value):
            return value
        raise InputError(
            f"--set {text}: {value!r} is neither a TOML value nor a bare word ({error}); quote strings."
        ) from error
    if len(parsed) > 1:
        raise InputError(f"--set {text}: {value!r} is more than one value.")
    return parsed["value"]


def _copied(value: Any) -> Any:
    if isinstance(value, Mapping):
        return {key: _copied(item) for key, item in value.items()}
    return [_copied(item) for item in value] if isinstance(value, list) else value

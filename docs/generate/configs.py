"""The keys of configs and of studies, from the models that check them."""

import inspect
from collections.abc import Iterator
from typing import Any, get_args

from pydantic import BaseModel
from pydantic_core import PydanticUndefined

from deli.config.models import PerturbationTable, RecordTable, RunTable, SolversTable, SolverTable, method_model
from deli.integrators.registry import METHODS
from deli.studies.model import AxisTable, LimitsTable, StudyTable, ZipTable
from generate.markdown import code, paragraphs, table

_TABLES = {
    "At the top": (RunTable, ""),
    "`[record]`": (RecordTable, ""),
    "`[solvers]`": (SolversTable, ""),
    "A solver": (
        SolverTable,
        "An entry of `[solvers]` is the name of a backend, or such a table. Entries without a `backend` take missing "
        "keys from `default`.",
    ),
    "`scene.perturbation`": (PerturbationTable, ""),
}
_STUDY = {
    "At the top of a study": StudyTable,
    "An entry of `[axes]`": AxisTable,
    "An entry of `[[zip]]`": ZipTable,
    "`[limits]`": LimitsTable,
}


def page() -> str:
    """Return the page."""
    parts = [
        "# Config keys",
        "A config is a TOML file for `deli run`. `--set key=value` changes any key, `deli check FILE` checks all. A "
        "key that is wrong is refused with its path, the value that was found, and the values that are allowed.",
        "The keys of `[scene]` besides `name` and `perturbation` are the [parameters of the scene](scenes.md).",
    ]
    for title, (model, text) in _TABLES.items():
        parts += [f"## {title}", _about(model), text, _keys(model)]
    parts.append("## `[method]`")
    for name, method in METHODS.items():
        parts += [f'### `name = "{name}"`', _first_line(method), _keys(method_model(method), skip=("name",))]
    parts += ["## Studies", "A study is a TOML file for `deli study`. It varies keys of a config."]
    for title, model in _STUDY.items():
        parts += [f"### {title}", _about(model), _keys(model)]
    return paragraphs(*parts)


def _keys(model: type[BaseModel], skip: tuple[str, ...] = ()) -> str:
    rows = list(_rows(model, skip))
    return table(("key", "type", "default"), rows) if rows else "It has no settings."


def _rows(model: type[BaseModel], skip: tuple[str, ...]) -> Iterator[tuple[str, str, str]]:
    for name, field in model.model_fields.items():
        if name in skip:
            continue
        bounds = [str(bound) for bound in field.metadata if not callable(getattr(bound, "func", None))]
        kind = _kind(field.annotation) + (f" ({', '.join(bounds)})" if bounds else "")
        yield code(name), kind, _default(field)


def _kind(annotation: Any) -> str:
    if annotation is Any:
        return "see below"
    options = [option for option in get_args(annotation) if option is not type(None)]
    if options and getattr(annotation, "__origin__", None) not in (dict, list):
        names = [repr(o) if isinstance(o, str) else getattr(o, "__name__", str(o)) for o in options]
        return " or ".join(code(name) for name in names)
    return code(getattr(annotation, "__name__", str(annotation)))


def _default(field: Any) -> str:
    if field.default_factory is not None:
        return "empty"
    if field.default is PydanticUndefined:
        return "required"
    return "none" if field.default is None else code(repr(field.default))


def _about(model: type[BaseModel]) -> str:
    return inspect.cleandoc(model.__doc__ or "").split("\n\n")[0]


def _first_line(documented: object) -> str:
    return (inspect.getdoc(documented) or "").split("\n\n")[0].replace("\n", " ")

"""The shape of a config as pydantic models, and the messages of refusals."""

import dataclasses
import difflib
import functools
import inspect
from collections.abc import Callable, Iterable, Iterator
from typing import Annotated, Any, Literal, get_args, get_origin, get_type_hints

from pydantic import BaseModel, BeforeValidator, ConfigDict, Field, create_model
from pydantic_core import ErrorDetails, PydanticCustomError

import solvers
from deli.integrators.integrator import Integrator
from solvers.registry import CHAINS, REFERENCE

PLAIN_TYPES = (bool, int, float, str)


class Table(BaseModel):
    """A table of a config, which refuses unknown keys and values of another type."""

    model_config = ConfigDict(extra="forbid", strict=True, allow_inf_nan=False)


def _backend(name: Any) -> Any:
    if not isinstance(name, str) or name.startswith(REFERENCE):
        return name
    known = {info.name: info for info in solvers.backends()}
    if name not in known and name not in CHAINS:
        raise PydanticCustomError("unknown", "{allowed}", {"allowed": listed(name, [*CHAINS, *known])})
    if name in known and not known[name].installed:
        raise PydanticCustomError("unknown", "it is not installed: {install}", {"install": known[name].install})
    return name


def _options(options: Any) -> Any:
    """Refuse options that name files, because the output is the only file that a config may name."""
    if isinstance(options, dict):
        for name in options:
            if "file" in name.lower():
                raise PydanticCustomError("unknown", f"{name} names a file, which a config must not; leave it out")
    return options


class SolverTable(Table):
    """The choice of a backend, its tolerance and its options."""

    backend: Annotated[str, BeforeValidator(_backend)] = "auto"
    tolerance: float = Field(default=1e-9, gt=0, lt=1)
    polish: bool = True
    warm_start: bool = False
    options: Annotated[dict[str, Any], BeforeValidator(_options)] = {}


class SolversTable(Table):
    """Solver choices by subproblem; `default` is the choice for all others."""

    default: SolverTable = Field(default_factory=SolverTable)
    reflection: SolverTable | None = None
    position: SolverTable | None = None
    projection: SolverTable | None = None


def _most(value: Any) -> Any:
    if not isinstance(value, int) or (value < 1 and not isinstance(value, bool)):
        raise PydanticCustomError("unknown", "allowed: true, false, or the largest number of subproblems, 1 or more")
    return value


class PerturbationTable(Table):
    """Normal noise on a scene's initial state: the seed, and a standard deviation for every coordinate."""

    seed: int = Field(default=0, ge=0)
    position: float = Field(default=0.0, ge=0)
    momentum: float = Field(default=0.0, ge=0)


class RecordTable(Table):
    """The interval of recorded rows, the file (relative to the current directory), and the number of subproblems."""

    every: int = Field(default=1, ge=1)
    output: str | None = None
    subproblems: Annotated[Any, BeforeValidator(_most)] = False


class RunTable(Table):
    """The entries of a config except its scene and its method."""

    step_size: float = Field(gt=0)
    steps: int | None = Field(default=None, ge=1)
    duration: float | None = Field(default=None, gt=0)
    skip: bool = True
    contact_tolerance: float = Field(default=1e-8, gt=0, lt=1)
    solvers: SolversTable = Field(default_factory=SolversTable)
    record: RecordTable = Field(default_factory=RecordTable)


@functools.cache
def config_model(scene: type[Table], method: type[Table]) -> type[Table]:
    """Return the model of a config from the models of its scene's and its method's tables."""
    return create_model("Config", __base__=RunTable, scene=(scene, ...), method=(method, ...))


@functools.cache
def scene_model(build: Callable[..., Any]) -> type[Table]:
    """Return the model of a scene's table from the signature of the function that builds the scene."""
    function = inspect.unwrap(build)
    hints = get_type_hints(function)
    fields: dict[str, Any] = {
        key: (hints[key] if hints[key] in PLAIN_TYPES else Numbers, parameter.default)
        for key, parameter in inspect.signature(function).parameters.items()
    }
    perturbed: Any = (PerturbationTable | None, None)
    return create_model("Scene", __base__=Table, name=(str, ...), **{**fields, "perturbation": perturbed})


@functools.cache
def method_model(method: type[Integrator]) -> type[Table]:
    """Return the model of a method's table from the fields of its class."""
    hints, choices = get_type_hints(method), method.CHOICES
    fields: dict[str, Any] = {
        field.name: (Literal[choices[field.name]] if field.name in choices else hints[field.name], field.default)
        for field in dataclasses.fields(method)
    }
    return create_model("Method", __base__=Table, name=(str, ...), **fields)


def _numbers(value: Any) -> Any:
    if isinstance(value, list):
        return [_numbers(entry) for entry in value]
    if value is not None and (isinstance(value, bool) or not isinstance(value, int | float)):
        raise PydanticCustomError("numbers", "a number or a list of numbers is allowed")
    return value


Numbers = Annotated[Any, BeforeValidator(_numbers)]


def unknown(path: str, found: Any, allowed: Iterable[str]) -> str:
    """Return a message about an unknown name."""
    return f"{path} is {found!r}; {listed(found, allowed)}."


def listed(found: Any, allowed: Iterable[str]) -> str:
    """Return a list of the allowed names, preceded by a similar name if there is one."""
    names = list(allowed)
    close = difflib.get_close_matches(str(found), names, n=1)
    hint = f"did you mean {close[0]!r}? " if close else ""
    return f"{hint}allowed: {', '.join(names)}"


def say(error: ErrorDetails, model: type[BaseModel]) -> str:
    """Return one of pydantic's errors as a sentence: key, value found, values allowed."""
    path = ".".join(str(part) for part in error["loc"])
    if error["type"] == "extra_forbidden":
        *parents, key = error["loc"]
        return f"{path} is an unknown key; {listed(key, _keys(model, parents))}."
    if error["type"] == "missing":
        return f"{path} is missing."
    if error["type"] == "literal_error":
        names = error["ctx"]["expected"].replace("'", "").replace(" or ", ", ").split(", ")
        return unknown(path, error["input"], names)
    message = error["msg"].removeprefix("Input should be ")
    allowed = message if error["type"] in ("unknown", "numbers") else f"allowed: {message}"
    return f"{path} is {error['input']!r}; {allowed}."


def _keys(model: type[BaseModel], parents: Iterable[Any]) -> list[str]:
    inner, path = model, iter(parents)
    for parent in path:
        annotation = inner.model_fields[parent].annotation
        if get_origin(annotation) in (dict, list):
            next(path)  # all entries have the same model
        models = {found.__name__: found for found in _models(annotation)}
        if len(models) > 1:  # the kind selects the model
            kind = next(path)
            models = {name: found for name, found in models.items() if found.model_fields["kind"].default == kind}
        (inner,) = models.values()
    return list(inner.model_fields)


def _models(annotation: Any) -> Iterator[type[BaseModel]]:
    """Yield the models within an annotation."""
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        yield annotation
    for part in get_args(annotation):
        yield from _models(part)

"""The registry of scenes by name: their functions, their parameters, and the default numbers of their runs."""

from __future__ import annotations

import dataclasses
import functools
import inspect
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any, ParamSpec

import numpy as np

from deli.errors import InputError
from deli.mechanics.scene import Scene
from deli.scenes.perturbation import perturb, read_perturbation

Parameters = ParamSpec("Parameters")

_BUILDERS: dict[str, Callable[..., Scene]] = {}
_DEFAULTS: dict[str, dict[str, Any]] = {}


def scene(
    *, step_size: float, duration: float, scheme: str
) -> Callable[[Callable[Parameters, Scene]], Callable[Parameters, Scene]]:
    """Register the decorated function as a scene of its own name, with default numbers of a run, the paper's if given.

    The returned scene carries that name and all keyword values, defaults included, in plain Python types; a parameter
    left at None is not recorded. Calling the function with these values makes the same scene again. Besides its own
    parameters, the function takes a `perturbation` of the initial state, see `deli.scenes.perturbation`.
    """

    def register(build: Callable[Parameters, Scene]) -> Callable[Parameters, Scene]:
        name = build.__name__
        signature = inspect.signature(build)

        @functools.wraps(build)
        def checked(*args: Parameters.args, **keywords: Parameters.kwargs) -> Scene:
            perturbation = keywords.pop("perturbation", None)
            unknown = [key for key in keywords if key not in signature.parameters]
            if unknown or args:
                found = repr(unknown[0]) if unknown else f"a value without a name, {args[0]!r}"
                allowed = ", ".join([*signature.parameters, "perturbation"])
                raise InputError(f"scene {name}: found {found}; its parameters, by keyword, are: {allowed}")
            bound = signature.bind(**keywords)
            bound.apply_defaults()
            values = {key: _plain(value) for key, value in bound.arguments.items() if value is not None}
            with _finite(name, values):
                built = build(**keywords)  # type: ignore[call-arg]
                if perturbation is not None:
                    values["perturbation"] = read_perturbation("perturbation", perturbation)
                    built = perturb(built, values["perturbation"])
                return dataclasses.replace(built, name=name, parameters=values)

        _BUILDERS[name] = checked
        _DEFAULTS[name] = {"step_size": step_size, "duration": duration, "scheme": scheme}
        return checked

    return register


@contextmanager
def _finite(name: str, values: dict[str, Any]) -> Iterator[None]:
    """Refuse parameters that overflow in Python's arithmetic; numpy's infinities are refused by the scene itself."""
    try:
        with np.errstate(all="ignore"):
            yield
    except (OverflowError, ZeroDivisionError) as error:
        wide = [key for key, value in values.items() if _is_extreme(value)] or list(values)
        found = ", ".join(f"{key} = {values[key]!r}" for key in wide)
        raise InputError(f"scene {name}: its numbers overflow, or vanish ({found}); choose other units") from error


def _is_extreme(value: Any) -> bool:
    return isinstance(value, int | float) and value != 0 and not 1e-100 < abs(value) < 1e100


def available() -> list[str]:
    """Return the names of all scenes.

    Examples
    --------
    >>> import deli
    >>> deli.scenes.available()[:3]
    ['lennard_jones', 'newtons_cradle', 'nonlinear_oscillator']
    """
    return list(_BUILDERS)


def get(name: str) -> Callable[..., Scene]:
    """Return the function that builds the scene called ``name``.

    Examples
    --------
    >>> import deli
    >>> deli.scenes.get("point_mass")(mass=2.0).mass
    array([2.])
    """
    return _BUILDERS[_known(name)]


def defaults(name: str) -> dict[str, Any]:
    """Return the default step_size, duration and scheme of a run of the scene called ``name``.

    Examples
    --------
    >>> import deli
    >>> deli.scenes.defaults("point_mass")
    {'step_size': 0.01, 'duration': 20.0, 'scheme': 'midpoint'}
    """
    return dict(_DEFAULTS[_known(name)])


def _known(name: str) -> str:
    if not isinstance(name, str) or name not in _BUILDERS:
        raise InputError(f"scene: found {name!r}; choose one of {', '.join(_BUILDERS)}")
    return name


def _plain(value: Any) -> Any:
    if isinstance(value, np.ndarray | np.generic):
        return value.tolist()
    if isinstance(value, list | tuple):
        return [_plain(entry) for entry in value]
    return value

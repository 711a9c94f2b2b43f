"""``deli scenes``, ``deli methods``, ``deli backends``: the lists of scenes, methods and backends."""

import dataclasses
import inspect
from typing import Annotated

import typer

from deli.commands.console import console, guarded
from deli.errors import InputError


@guarded
def scenes(
    name: Annotated[str | None, typer.Argument(metavar="[NAME]", help="Show this scene's parameters.")] = None,
) -> None:
    """List the scenes, or show one scene's parameters and documentation."""
    from rich.table import Table

    from deli import scenes as registry

    if name is None:
        table = Table("scene", "description", "step size", "duration", "scheme")
        for known in registry.available():
            paper = registry.defaults(known)
            summary = _first_line(registry.get(known))
            table.add_row(known, summary, *(str(paper[key]) for key in ("step_size", "duration", "scheme")))
        console().print(table)
        return
    if name not in registry.available():
        from deli.config.models import listed

        raise InputError(f"{name!r} is not a scene; {listed(name, registry.available())}.")
    build = inspect.unwrap(registry.get(name))
    table = Table("parameter", "default", title=name, title_justify="left")
    for key, parameter in inspect.signature(build).parameters.items():
        table.add_row(f"scene.{key}", "derived" if parameter.default is None else repr(parameter.default))
    table.add_row("scene.perturbation", "none; { seed = 0, position = 0.0, momentum = 0.0 } adds normal noise")
    console().print(table)
    console().print(inspect.getdoc(build) or "", soft_wrap=True)


@guarded
def methods() -> None:
    """List the methods with their settings; the first value of each is the default."""
    from rich.table import Table

    from deli.integrators.registry import METHODS

    table = Table("method", "description", "settings")
    for name, method in METHODS.items():
        rows = []
        for field in dataclasses.fields(method):
            values = [
                str(field.default),
                *(str(v) for v in method.CHOICES.get(field.name, ()) if v != field.default),
            ]
            rows.append(f"{field.name} = {' | '.join(values)}")
        table.add_row(name, _first_line(method), "\n".join(rows))
    console().print(table)


@guarded
def backends() -> None:
    """List the backends with their versions, or how to install them, and the settings that a tolerance t determines."""
    from rich.table import Table

    from deli.recording.provenance import backend_version
    from solvers import backends as known_backends
    from solvers.registry import CHAINS
    from solvers.tolerances import TOLERANCES

    table = Table("backend", "version", "a tolerance t sets")
    for chain, members in CHAINS.items():
        found = f"settings of {', then '.join(members)}: the next one solves if one fails; others solve large programs"
        table.add_row(chain, "-", found)
    for info in known_backends():
        mapping = ", ".join(f"{key} = {factor:g} t" for key, factor in TOLERANCES.get(info.name, {}).items())
        found = backend_version(info.name) if info.installed else f"not installed: {info.install}"
        table.add_row(info.name, found, mapping)
    console().print(table)


def _first_line(documented: object) -> str:
    line = (inspect.getdoc(documented) or "").split("\n\n")[0].replace("\n", " ").removeprefix("Return ")
    return line[:1].upper() + line[1:]

"""The help of every command."""

import inspect
from typing import Any

import typer

from deli.cli import app
from generate.markdown import code, paragraphs, table


def page() -> str:
    """Return the page."""
    group: Any = typer.main.get_command(app)
    parts = ["# Commands", inspect.cleandoc(group.help or ""), "`deli COMMAND --help` prints the same."]
    for name, command in group.commands.items():
        context = command.context_class(command, info_name=name)
        parts += [f"## `deli {name}`", inspect.cleandoc(command.help or ""), _parameters(command, context)]
    return paragraphs(*parts)


def _parameters(command: Any, context: Any) -> str:
    rows = []
    for parameter in command.get_params(context):
        argument = parameter.param_type_name == "argument"
        options = [*parameter.opts, *parameter.secondary_opts]
        names = [parameter.metavar or parameter.name.upper()] if argument else options
        default = parameter.default
        shown = "" if default in (None, False, ()) or callable(default) else code(default)
        rows.append((", ".join(code(name) for name in names), getattr(parameter, "help", "") or "", shown))
    return table(("argument or option", "meaning", "default"), rows)

"""The scenes: a picture, the numbers they are run with, and their parameters."""

import inspect

from deli import scenes
from generate.markdown import code, paragraphs, table


def page() -> str:
    """Return the page."""
    parts = [
        "# Scenes",
        "`deli run NAME` runs a scene with the numbers below, `deli.scenes.NAME(...)` builds it in Python. Each takes "
        "a `perturbation` of its initial state besides its own parameters.",
    ]
    for name in scenes.available():
        build = inspect.unwrap(scenes.get(name))
        usual = scenes.defaults(name)
        text, _, rest = (inspect.getdoc(build) or "").partition("\nParameters\n")
        rows = [
            (code(key), "derived" if parameter.default is None else code(parameter.default))
            for key, parameter in inspect.signature(build).parameters.items()
        ]
        parts += [
            f"## `{name}`",
            f"![{name}](scene_{name}.png){{w=480px}}",
            f"Run with a step size of {usual['step_size']:g} for {usual['duration']:g} units of time, scheme "
            f"`{usual['scheme']}`.",
            f"```text\n{text.strip()}\n```",
            table(("parameter", "default"), rows),
            f"```text\n{rest.lstrip('-').strip()}\n```" if rest else "",
        ]
    return paragraphs(*parts)

"""The functions and classes that users call, by their purpose, from their docstrings."""

from collections.abc import Mapping

import deli
import solvers
from generate.markdown import paragraphs

SECTIONS: Mapping[str, tuple[str, tuple[str, ...]]] = {
    "Scenes": ("deli", ("Scene", "Potential", "Constraints")),
    "Families of forces": ("deli", ("Gravity", "RadialPowers", "Springs", "LennardJones")),
    "Families of constraints": (
        "deli",
        ("Planes", "SpheresApart", "SpheresInside", "SpheresOutside", "Rods", "AnchoredRods"),
    ),
    "Methods": (
        "deli",
        (
            *("GVI", "DiscreteSmooth", "Collision", "Direct", "Newmark"),
            *("MoreauJean", "NonsmoothAlpha", "SolveIvp"),
        ),
    ),
    "Runs": (
        "deli",
        ("simulate", "simulate_ensemble", "open_run", "reflect", "replay", "load_subproblem", "open_study"),
    ),
    "Errors": ("deli", ("DeliError", "InputError", "StepError", "Interrupted")),
    "Ready-made scenes": ("deli.scenes", tuple(deli.scenes.__all__)),
    "Impacts": ("deli.impacts", ("cradle", "bernoulli", "rack")),
    "Metrics": ("deli.metrics", tuple(deli.metrics.__all__)),
    "Plots": ("deli.plotting", tuple(deli.plotting.__all__)),
    "Compiled cvxpy problems": ("solvers", tuple(solvers.__all__)),
}
MODULES = {"__version__", "impacts", "metrics", "plotting", "scenes"}
"""Exports of deli that are neither functions nor classes."""


def page() -> str:
    """Return the page.

    Raises
    ------
    ValueError
        If a name that deli exports stands in no section.
    """
    listed = {name for home, names in SECTIONS.values() if home == "deli" for name in names}
    if listed ^ (set(deli.__all__) - MODULES):
        raise ValueError(f"the API page and deli.__all__ differ: {sorted(listed ^ (set(deli.__all__) - MODULES))}")
    parts = []
    for title, (home, names) in SECTIONS.items():
        entries = "\n".join(f"   {home}.{name}" for name in names)
        parts.append(
            f"## {title}\n\n```{{eval-rst}}\n.. autosummary::\n   :toctree: api\n   :nosignatures:\n\n{entries}\n```"
        )
    return paragraphs("# Functions and classes", *parts)

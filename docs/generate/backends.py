"""The backends: the packages they need, and the settings that a tolerance makes."""

from generate.markdown import code, paragraphs, table
from solvers import can
from solvers.registry import BUILTIN, CHAINS
from solvers.tolerances import FLOORS, LIMITS, TOLERANCES


def page() -> str:
    """Return the page."""
    rows = []
    for name, (_, package) in BUILTIN.items():
        meant = ", ".join(f"`{key}` = {factor:g} t" + _floor(name, key) for key, factor in TOLERANCES[name].items())
        limits = ", ".join(f"`{key}` = {limit:g}" for key, limit in LIMITS[name].items())
        rows.append(
            (code(name), code(package), meant, limits, *(_yes(name, what) for what in ("sparse", "warm_starts")))
        )
    chains = [
        f"- `{chain}` is a chain, for small programs {', then '.join(code(member) for member in members)}. If the "
        "answer of a member is not verified, the next member solves, and the dataset counts that. [Large programs]"
        "(../how_to/swap_a_backend.md) have other members."
        for chain, members in CHAINS.items()
    ]
    return paragraphs(
        "# Backends",
        "A tolerance t bounds the scaled residuals that deli recomputes for every answer. Each backend gets a "
        "tolerance in its own norms that is at least as strict ([tolerances](../explanation/tolerances.md)).",
        table(("backend", "package", "a tolerance t sets", "limits", "sparse matrices", "warm starts"), rows),
        "\n".join(chains),
        "`cvxpy:NAME` is any installed solver of cvxpy, called through `problem.solve()`: slow and independent.",
    )


def _floor(name: str, key: str) -> str:
    return f" (at least {FLOORS[name, key]:g})" if (name, key) in FLOORS else ""


def _yes(name: str, what: str) -> str:
    return "yes" if can(name, what) else "no"

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
        f"- `{chain}` is a chain: {', then '.join(code(member) for member in members)}. The next member takes over "
        "where one is not verified, and the dataset counts it."
        for chain, members in CHAINS.items()
    ]
    return paragraphs(
        "# Backends",
        "A tolerance t bounds the scaled residuals that deli recomputes for every answer. Each backend is set to a "
        "tolerance of its own that is at least as strict; [Tolerances](../explanation/tolerances.md) says why.",
        table(("backend", "package", "a tolerance t sets", "limits", "sparse matrices", "warm starts"), rows),
        "\n".join(chains),
        "`cvxpy:NAME` is any solver that cvxpy has installed, called through `problem.solve()`: slow and independent.",
    )


def _floor(name: str, key: str) -> str:
    return f" (at least {FLOORS[name, key]:g})" if (name, key) in FLOORS else ""


def _yes(name: str, what: str) -> str:
    return "yes" if can(name, what) else "no"

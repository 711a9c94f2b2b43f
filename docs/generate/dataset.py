"""The schema of a run's dataset."""

from deli.recording.schema import CONVENTIONS, UNITS_NOTE, Schema
from generate.markdown import code, paragraphs, table

_GROUPS = {
    "trajectory": "One row for each recorded state. Row 0 is the initial state.",
    "solver_stats": "One row for each interval between recorded states and each of the three subproblems, summed over "
    "the integration steps of the interval.",
    "subproblems": "Only in runs with `record.subproblems`: the convex problems that solvers got. Lists of "
    "different lengths follow each other along ragged dimensions; the variables with `sample_dimension` "
    "count the entries of each problem.",
}


def page() -> str:
    """Return the page."""
    schema = Schema(dof=6, dimension=3, memory=_remembered(), subproblems=True)
    parts = [
        "# The dataset",
        f"A run is an `xarray.DataTree`, in memory and in its netCDF file (conventions `{CONVENTIONS}`). {UNITS_NOTE}",
        "Root attributes say how the run came about: `title`, `config` and `scene` (TOML), versions of deli, of its "
        "libraries and of the backends that solved something, `machine`, `start`, `end`, `wall_time`, `outcome`, the "
        "components of momentum that the scene conserves, and `citation`, the reference of deli and its method.",
    ]
    for group, variables in schema.groups.items():
        rows = [
            (code(v.name), ", ".join(v.dims), code(v.dtype), v.units, v.long_name + _flags(v.extra)) for v in variables
        ]
        parts += [
            f"## Group `{group}`",
            _GROUPS.get(group, ""),
            table(("variable", "dimensions", "type", "units", "meaning"), rows),
        ]
    return paragraphs(*parts)


def _remembered() -> tuple[str, ...]:
    from deli.integrators.registry import METHODS

    return tuple(dict.fromkeys(name for method in METHODS.values() for name in method.MEMORY))


def _flags(extra: object) -> str:
    if not isinstance(extra, dict) or "flag_values" not in extra:
        return ""
    pairs = zip(extra["flag_values"], extra["flag_meanings"].split(), strict=True)
    return ": " + ", ".join(f"{value} {meaning}" for value, meaning in pairs)

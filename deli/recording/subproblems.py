"""Subproblems in a dataset: the numbers of each, one after the other along ragged dimensions."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from deli.recording.variable import Block, Variable
from deli.subproblems.choices import SUBPROBLEMS
from deli.subproblems.posed import PosedSubproblem

LEFT_OUT = "left_out"
ORIGIN = "origin"  # of problems in a library, which come from several runs
COUNTED = {"variable": "variables", "row": "rows", "entry": "entries", "metric_entry": "metric_entries"}
"""Ragged dimensions, and the variable that counts the places of each problem along them."""


def _of_problem(name: str, long_name: str, dtype: str = "i8", **extra: Any) -> Variable:
    return Variable(name, ("problem",), dtype, "1", long_name, extra)


def _count(dimension: str, long_name: str) -> Variable:
    """Return a count of a contiguous ragged array, in the sense of the CF conventions."""
    return _of_problem(COUNTED[dimension], long_name, sample_dimension=dimension)


_KIND = {"flag_values": np.arange(len(SUBPROBLEMS), dtype=np.int8), "flag_meanings": " ".join(SUBPROBLEMS)}
SUBPROBLEM_VARIABLES = (
    _of_problem("subproblem", "which convex subproblem of an integration step", "i1", **_KIND),
    _of_problem("step", "integration steps taken before the step that posed the problem"),
    _of_problem("solve", "number among the solves of the same subproblem in the step, counted from 0"),
    _count("variable", "variables of the problem"),
    _count("row", "rows of the problem, equations first"),
    _of_problem("equalities", "rows that are equations; they may depend on each other"),
    _count("entry", "coefficients of the rows"),
    _count("metric_entry", "entries of the metric's upper triangle, row by row; 0 where the metric is the identity"),
    _of_problem("primal_residual", "scaled primal residual of the answer; nan without one", "f8"),
    _of_problem("dual_residual", "scaled dual residual of the answer; nan without one", "f8"),
    _of_problem("complementarity", "scaled complementarity residual of the answer; nan without one", "f8"),
    Variable("linear", ("variable",), "f8", "1", "linear term of the objective, scaled: no unit"),
    Variable("velocity", ("variable",), "f8", "1", "the answer, sqrt(M) v in the problem's own scale; nan without one"),
    Variable("bounds", ("row",), "f8", "1", "right-hand side, a lower bound of inequalities"),
    Variable("multiplier", ("row",), "f8", "1", "multiplier of the answer, nonnegative on inequalities"),
    Variable("active", ("row",), "i1", "1", "1 where the multiplier exceeds the slack, and on equations"),
    Variable("row_entries", ("row",), "i8", "1", "coefficients of the row", {"sample_dimension": "entry"}),
    Variable("column", ("entry",), "i4", "1", "variable that the coefficient belongs to, from 0"),
    Variable("value", ("entry",), "f8", "1", "coefficient; rows have unit length"),
    Variable("metric", ("metric_entry",), "f8", "1", "entry of the metric"),
    Variable(LEFT_OUT, (), "i8", "1", "subproblems that were solved and not recorded, because the limit was reached"),
)


def pack(problems: Sequence[PosedSubproblem]) -> Block:
    """Return the arrays of all problems, by the names of variables in `deli.recording.schema`."""
    uppers = [() if one.metric is None else one.metric[np.triu_indices(one.variables)] for one in problems]
    residuals = np.array([one.residuals(one.z, one.y) for one in problems]).reshape(-1, 3)
    return {
        "subproblem": _integers([one.subproblem for one in problems], "i1"),
        "step": _integers([one.step for one in problems]),
        "solve": _integers([one.solve for one in problems]),
        "variables": _integers([one.variables for one in problems]),
        "rows": _integers([one.rows for one in problems]),
        "equalities": _integers([one.equalities for one in problems]),
        "entries": _integers([one.value.size for one in problems]),
        "metric_entries": _integers([len(upper) for upper in uppers]),
        "primal_residual": residuals[:, 0],
        "dual_residual": residuals[:, 1],
        "complementarity": residuals[:, 2],
        "linear": _joined([-one.wish for one in problems]),
        "velocity": _joined([one.z for one in problems]),
        "bounds": _joined([one.bounds for one in problems]),
        "multiplier": _joined([one.y for one in problems]),
        "active": _joined([one.active for one in problems], "i1"),
        "row_entries": _joined([np.diff(one.start) for one in problems], "i8"),
        "column": _joined([one.column for one in problems], "i4"),
        "value": _joined([one.value for one in problems]),
        "metric": _joined(uppers),
    }


def unpack(arrays: Mapping[str, np.ndarray]) -> list[PosedSubproblem]:
    """Return the problems whose arrays `pack` returned."""
    ends = {dimension: np.cumsum(arrays[counts]).tolist() for dimension, counts in COUNTED.items()}
    problems = []
    for number, kind in enumerate(arrays["subproblem"].tolist()):
        part = {dimension: slice(end[number - 1] if number else 0, end[number]) for dimension, end in ends.items()}
        size, upper = int(arrays["variables"][number]), arrays["metric"][part["metric_entry"]]
        metric = None
        if upper.size:
            metric = np.zeros((size, size))
            metric[np.triu_indices(size)] = metric.T[np.triu_indices(size)] = upper
        problems.append(
            PosedSubproblem(
                subproblem=kind,
                step=int(arrays["step"][number]),
                solve=int(arrays["solve"][number]),
                equalities=int(arrays["equalities"][number]),
                start=np.concatenate(([0], np.cumsum(arrays["row_entries"][part["row"]]))),
                column=arrays["column"][part["entry"]].astype(np.int64),
                value=arrays["value"][part["entry"]],
                bounds=arrays["bounds"][part["row"]],
                wish=-arrays["linear"][part["variable"]],
                metric=metric,
                z=arrays["velocity"][part["variable"]],
                y=arrays["multiplier"][part["row"]],
            )
        )
    return problems


def find_fault(arrays: Mapping[str, np.ndarray]) -> str:
    """Return the fault of the first array of `pack` that does not fit the others, or an empty text."""
    sizes, rows, entries = (arrays[name] for name in ("variables", "rows", "entries"))
    if not ((arrays["subproblem"] >= 0) & (arrays["subproblem"] < len(SUBPROBLEMS))).all():
        return f"subproblem names others than {', '.join(SUBPROBLEMS)}"
    if not (sizes > 0).all():
        return "variables has a problem without variables"
    if not ((arrays["equalities"] >= 0) & (arrays["equalities"] <= rows)).all():
        return "equalities has more equations than rows, or a number below 0"
    triangles = sizes * (sizes + 1) // 2
    if not ((arrays["metric_entries"] == 0) | (arrays["metric_entries"] == triangles)).all():
        return "metric_entries is neither 0 nor the size of a triangle of the problem's variables"
    if not (arrays["row_entries"] >= 0).all():
        return "row_entries has a number below 0"
    through = np.concatenate(([0], np.cumsum(arrays["row_entries"])))[np.concatenate(([0], np.cumsum(rows)))]
    if not np.array_equal(np.diff(through), entries):
        return "row_entries does not add up to entries"
    if not ((arrays["column"] >= 0) & (arrays["column"] < np.repeat(sizes, entries))).all():
        return "column names variables that a problem does not have"
    return ""


def taken(arrays: Mapping[str, np.ndarray], steps: int) -> Block:
    """Return the arrays of the problems that were posed before `steps` steps had been taken."""
    ends = places(arrays, int(np.searchsorted(arrays["step"], steps)))
    dims = {variable.name: variable.dims for variable in SUBPROBLEM_VARIABLES}
    return {name: values[: ends[dims[name][0]]] if dims[name] else values for name, values in arrays.items()}


def places(counts: Mapping[str, np.ndarray], problems: int) -> dict[str, int]:
    """Return the ends of the first `problems` problems along each ragged dimension."""
    return {"problem": problems, **{name: int(counts[count][:problems].sum()) for name, count in COUNTED.items()}}


def _integers(values: Sequence[int], dtype: str = "i8") -> np.ndarray:
    return np.array(values, dtype=dtype)


def _joined(parts: Sequence[Any], dtype: str = "f8") -> np.ndarray:
    joined: np.ndarray = np.concatenate([np.zeros(0, dtype), *parts]).astype(dtype)
    return joined

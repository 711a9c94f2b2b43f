"""Recorded subproblems, solved again by several backends."""

import os
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

import solvers
from deli.errors import InputError
from deli.kernels.build import ready
from deli.recording import provenance
from deli.recording.reading import read_subproblems
from deli.replaying.contenders import STATUSES, Contender, Outcome, Reference
from deli.running.progress import ProgressBar
from deli.shipped import FOLDER
from deli.subproblems.choices import SUBPROBLEMS, SolverChoice, parse_choices
from deli.version import __version__
from solvers import Status

LIBRARY = FOLDER / "library" / "subproblems.nc"
"""Easy and hard problems from deli's scenes."""
LIMIT = 1.0
REPEAT = 5


def replay(
    path: str | os.PathLike[str] | None = None,
    *,
    backends: Iterable[str] | None = None,
    tolerance: float = 1e-9,
    polish: bool = True,
    repeat: int = REPEAT,
    limit: float = LIMIT,
    progress: bool = False,
) -> xr.Dataset:
    """Solve the subproblems in a file with several backends, and verify every answer.

    Parameters
    ----------
    path : path, optional
        A run recorded with ``subproblems=True``; deli's own library if left out.
    backends : iterable of str
        Names as for `deli.simulate`; all that are installed if left out.
    tolerance : float
        Largest scaled KKT residual of a solved problem.
    polish : bool
        Polish answers, as runs do; False shows the answers of the backends alone.
    repeat : int
        Number of timed solves of each problem; times are medians.
    limit : float
        Seconds that a problem may take. A problem that takes longer counts as not solved, and is solved only once.
    progress : bool
        Show a bar, on a terminal or in a notebook.

    Returns
    -------
    xarray.Dataset
        By ``problem``: its origin and sizes, ``reference_residual`` and ``recorded_error``. By ``problem`` and
        ``backend``: ``claimed`` (the backend's own verdict), ``verified`` (residuals within the tolerance, and time
        within the limit), ``status``, ``time`` and ``solver_time`` in seconds, ``iterations``, ``polished``, the three
        residuals, and ``error``, the distance ``|z − z*|`` to a polished reference solution. The residuals of the
        reference are at most 1e-13, or the machine's epsilon times the multipliers where these are large.

    Raises
    ------
    InputError
        If the file has no subproblems, or a backend is not known or not installed.

    Examples
    --------
    >>> import deli, pathlib, tempfile
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     file = pathlib.Path(folder) / "run.nc"
    ...     run = deli.simulate(
    ...         deli.scenes.pogo_stick(), deli.GVI(), step_size=0.1, steps=10, output=file, skip=False, subproblems=True
    ...     )
    ...     data = deli.replay(file, backends=["native", "clarabel"], repeat=1)
    >>> data["backend"].values.tolist()
    ['native', 'clarabel']
    >>> data["verified"].all("problem").values.tolist()
    [True, True]
    """
    names = list(dict.fromkeys(solvers.available() if backends is None else backends))
    choices = {name: _choice(name, tolerance, polish) for name in names}
    if not names:
        raise InputError("backends is empty; name at least one, or leave it out for all that are installed.")
    if isinstance(repeat, bool) or not isinstance(repeat, int) or repeat < 1:
        raise InputError(f"repeat is {repeat!r}; allowed: a whole number >= 1.")
    if not (isinstance(limit, int | float) and limit > 0):
        raise InputError(f"limit is {limit!r}; allowed: a number of seconds > 0.")
    file = LIBRARY if path is None else Path(path)
    problems, origins = read_subproblems(file)
    ready()
    reference, contenders = Reference(), [Contender(choice) for choice in choices.values()]
    outcomes: list[list[Outcome]] = []
    exact, recorded = np.full(len(problems), np.nan), np.full(len(problems), np.nan)
    errors = np.full((len(problems), len(names)), np.nan)
    with ProgressBar("replay", len(problems), 0, progress, "problems") as bar:
        for number, posed in enumerate(problems):
            outcomes.append([contender.solve(posed, repeat, limit) for contender in contenders])
            solution, exact[number] = reference.solve(posed)
            recorded[number] = np.linalg.norm(posed.z - solution)
            with np.errstate(over="ignore"):  # an answer may be arbitrarily far off
                errors[number] = [np.linalg.norm(outcome.z - solution) for outcome in outcomes[-1]]
            if bar.active:
                bar.update(number + 1)
    kinds = np.array([posed.subproblem for posed in problems], dtype=np.int8)
    sizes = {name: [getattr(posed, name) for posed in problems] for name in ("step", "solve", *_SIZES)}
    return xr.Dataset(
        {
            "subproblem": ("problem", kinds, {"long_name": "which convex subproblem", **_flags(SUBPROBLEMS)}),
            "origin": ("problem", np.array(origins), {"long_name": "where the problem comes from"}),
            **{name: ("problem", values, {"units": "1", **_SAID[name]}) for name, values in sizes.items()},
            "reference_residual": ("problem", exact, _said("largest residual of the reference solution; nan: none")),
            "recorded_error": ("problem", recorded, _said("distance of the recorded answer to the reference")),
            **{name: (("problem", "backend"), *column) for name, column in _columns(outcomes, limit).items()},
            "error": (("problem", "backend"), errors, _said("distance of the answer to the reference solution")),
        },
        coords={"problem": np.arange(len(problems)), "backend": names},
        attrs=_attributes(file, names, tolerance, polish, repeat, limit),
    )


_SIZES = ("variables", "rows", "equalities")


def _said(long_name: str, units: str = "1") -> dict[str, Any]:
    return {"units": units, "long_name": long_name}


_SAID = {
    "step": _said("integration steps taken before the step that posed the problem"),
    "solve": _said("number among the solves of the same subproblem in the step"),
    "variables": _said("variables of the problem"),
    "rows": _said("rows of the problem"),
    "equalities": _said("rows that are equations"),
}


def _flags(meanings: Iterable[str]) -> dict[str, Any]:
    names = list(meanings)
    return {"flag_values": np.arange(len(names), dtype=np.int8), "flag_meanings": " ".join(names)}


def _columns(outcomes: list[list[Outcome]], limit: float) -> dict[str, tuple[np.ndarray, dict[str, Any]]]:
    """Return values by problem and backend, with their attributes."""

    def table(value: Any, dtype: Any = float) -> np.ndarray:
        return np.array([[value(outcome) for outcome in row] for row in outcomes], dtype=dtype)

    residuals = ("primal_residual", "dual_residual", "complementarity")
    verified = table(lambda outcome: outcome.status == Status.SOLVED and outcome.time <= limit, bool)
    columns = {
        "claimed": (table(lambda outcome: outcome.claimed, bool), _said("the backend says that it solved the problem")),
        "verified": (verified, _said("recomputed residuals are within the tolerance, and the time within the limit")),
        "status": (
            table(lambda outcome: STATUSES.index(outcome.status), np.int8),
            {"long_name": "verdict on the answer", **_flags(STATUSES)},
        ),
        "time": (table(lambda outcome: outcome.time), _said("median time from data to checked answer", "s")),
        "solver_time": (table(lambda outcome: outcome.solver_time), _said("median time inside the backend", "s")),
        "iterations": (table(lambda outcome: outcome.iterations, int), _said("iterations, as the backend counts them")),
        "polished": (table(lambda outcome: outcome.polished, bool), _said("the polish replaced the backend's answer")),
    }
    for place, name in enumerate(residuals):
        columns[name] = (table(lambda outcome, k=place: outcome.residuals[k]), _said("scaled residual, recomputed"))
    return columns


def _choice(name: str, tolerance: float, polish: bool) -> SolverChoice:
    return parse_choices({"backend": name, "tolerance": tolerance, "polish": polish})["position"]


def _attributes(
    file: Path, names: list[str], tolerance: float, polish: bool, repeat: int, limit: float
) -> dict[str, Any]:
    single = [member for name in names for member in solvers.members(name)]
    return {
        "title": f"subproblems of {file.name} solved again",
        "file": str(file),
        "tolerance": tolerance,
        "polish": int(polish),
        "repeat": repeat,
        "limit": float(limit),
        "deli_version": __version__,
        "backend_versions": provenance.backend_versions(single),
        "machine": provenance.machine(),
        "date": provenance.now(),
    }

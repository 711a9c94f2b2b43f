"""Small projections whose answers are known by hand, and the cvxpy model they are put into."""

from dataclasses import dataclass, field

import cvxpy as cp
import numpy as np


@dataclass(frozen=True)
class Known:
    """minimize 1/2 v'Mv - (Mw)'v subject to N v >= b, F v == d, and its answer."""

    name: str
    metric: np.ndarray
    linear: np.ndarray
    gradients: np.ndarray
    bounds: np.ndarray
    equations: np.ndarray
    targets: np.ndarray
    velocity: np.ndarray | None = None
    impulse: np.ndarray | None = None  # None where it is not unique
    reaction: np.ndarray | None = None
    tags: frozenset = field(default_factory=frozenset)

    def model(self, parametric_metric=False):
        n = self.linear.size
        v = cp.Variable(n, name="velocity")
        linear = cp.Parameter(n, name="linear")
        metric = cp.Parameter((n, n), PSD=True, name="metric") if parametric_metric else self.metric
        constraints = []
        if self.bounds.size:
            gradients = cp.Parameter(self.gradients.shape, name="gradients")
            constraints.append(gradients @ v >= cp.Parameter(self.bounds.size, name="bounds"))
        if self.targets.size:
            equations = cp.Parameter(self.equations.shape, name="equations")
            constraints.append(equations @ v == cp.Parameter(self.targets.size, name="targets"))
        return cp.Problem(cp.Minimize(0.5 * cp.quad_form(v, metric) + linear @ v), constraints)

    def values(self, parametric_metric=False):
        values = {"linear": self.linear}
        if self.bounds.size:
            values |= {"gradients": self.gradients, "bounds": self.bounds}
        if self.targets.size:
            values |= {"equations": self.equations, "targets": self.targets}
        if parametric_metric:
            values["metric"] = self.metric
        return values


def known(name, metric, wish, rows=(), bounds=(), equations=(), targets=(), linear=None, **answer):
    metric = np.diag(np.asarray(metric, dtype=float)) if np.ndim(metric) == 1 else np.asarray(metric, dtype=float)
    n = len(metric)
    linear = -metric @ np.asarray(wish, dtype=float) if linear is None else np.asarray(linear, dtype=float)
    tags = frozenset(answer.pop("tags", ()))
    arrays = {key: np.asarray(value, dtype=float) for key, value in answer.items()}
    return Known(
        name,
        metric,
        linear,
        np.asarray(rows, dtype=float).reshape(-1, n),
        np.asarray(bounds, dtype=float),
        np.asarray(equations, dtype=float).reshape(-1, n),
        np.asarray(targets, dtype=float),
        tags=tags,
        **arrays,
    )


SOLVABLE = [
    known("unconstrained", [1, 2, 4], [1, 1, 1], velocity=[1, 1, 1]),
    known("one active row", [1, 2], [1, -1], [[0, 1]], [0], velocity=[1, 0], impulse=[2]),
    known("one inactive row", [1, 2], [1, 1], [[0, 1]], [0], velocity=[1, 1], impulse=[0]),
    known(
        "several rows",
        [1, 2, 1],
        [-1, -1, 5],
        [[1, 0, 0], [0, 1, 0], [0, 0, 1]],
        [0, 0, 0],
        velocity=[0, 0, 5],
        impulse=[1, 2, 0],
    ),
    known("equality only", [1, 1, 1], [1, 2, 3], equations=[[1, 1, 1]], targets=[0], velocity=[-1, 0, 1], reaction=[2]),
    known(
        "mixed",
        [1, 1],
        [0, 0],
        [[1, 0]],
        [0.75],
        [[1, 1]],
        [1],
        velocity=[0.75, 0.25],
        impulse=[0.5],
        reaction=[-0.25],
    ),
    known("redundant rows", [1, 1], [1, -1], [[0, 1], [0, 1], [0, 2], [0, 1]], [0, 0, 0, -1], velocity=[1, 0]),
    known(
        "redundant equations",
        [1, 1, 1],
        [1, 2, 3],
        equations=[[1, 1, 1], [1, 1, 1], [2, 2, 2]],
        targets=[0, 0, 0],
        velocity=[-1, 0, 1],
    ),
    known(
        "rank-deficient gradients",
        [1, 1, 1],
        [1, 0, -1],
        [[-1, 1, 0], [0, -1, 1], [-1, 0, 1]],
        [0, 0, 0],
        velocity=[0, 0, 0],
    ),
    known(
        "square of gradients",
        [1, 1, 1],
        [0, 0, -1],
        [[1, 0, 1], [-1, 0, 1], [0, 1, 1], [0, -1, 1]],
        [0, 0, 0, 0],
        velocity=[0, 0, 0],
    ),
    known(
        "nearly parallel gradients",
        [1, 1],
        [-2, -1e-6],
        [[1, 0], [1, 1e-6]],
        [0, 0],
        velocity=[0, 0],
        tags={"nearly parallel"},
    ),
    known("weakly active row", [1, 1], [1, 0], [[0, 1]], [0], velocity=[1, 0], impulse=[0], tags={"weak"}),
    known("padding rows only", [1, 3], [1, -2], [[0, 0], [0, 0]], [-1, -1], velocity=[1, -2], impulse=[0, 0]),
    known("padded rows", [1, 2], [1, -1], [[0, 1], [0, 0], [0, 0]], [0, -1, -1], velocity=[1, 0], impulse=[2, 0, 0]),
    known("unequal masses", [1e-3, 1e3], [-1, -1], [[1, 1]], [0], velocity=[999999 / 1000001 + 0.0, -999999 / 1000001]),
    known("semidefinite metric", [1, 0], None, [[0, 1]], [-3], linear=[-1, 1], velocity=[1, -3], impulse=[1]),
    known("full metric", [[2, 1], [1, 2]], [-1, -1], [[1, 0]], [0], velocity=[0, -1.5], impulse=[1.5]),
]

INFEASIBLE = [
    known("opposed rows", [1, 1], [0, 0], [[1, 0], [-1, 0]], [1, 0]),
    known("opposed equations", [1, 1], [0, 0], equations=[[1, 0], [1, 0]], targets=[0, 1]),
    known("row against equation", [1, 1], [0, 0], [[1, 0]], [1], [[1, 0]], [0]),
]

UNBOUNDED = [known("no curvature", [1, 0], None, [[1, 0]], [-1], linear=[0, 1])]

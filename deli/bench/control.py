"""Predictive control: sparse programs in which some variables have no curvature of their own."""

import cvxpy as cp
import numpy as np

from deli.bench.raw import Numbers

STATES, INPUTS = 4, 2


def build(horizon: int) -> cp.Problem:
    """Build the problem of steering a linear system to rest within bounds, from the Parameter ``start``."""
    random = np.random.default_rng(0)
    system = np.eye(STATES) + 0.1 * random.normal(size=(STATES, STATES))
    system /= max(1.0, np.abs(np.linalg.eigvals(system)).max())
    steering = random.normal(size=(STATES, INPUTS))
    state, force = cp.Variable((STATES, horizon + 1), name="state"), cp.Variable((INPUTS, horizon), name="force")
    cost = cp.sum_squares(state[:, 1:]) + 0.1 * cp.sum_squares(force)
    motion = state[:, 1:] == system @ state[:, :-1] + steering @ force
    start = state[:, 0] == cp.Parameter(STATES, name="start")
    return cp.Problem(cp.Minimize(cost), [start, motion, cp.abs(force) <= 1, cp.abs(state) <= 10])


def draw(random: np.random.Generator) -> Numbers:
    """Return values of the Parameters."""
    return {"start": random.uniform(-3.0, 3.0, STATES)}

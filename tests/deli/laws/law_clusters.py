"""Clusters of touching contacts for the laws of reflection, and an independent reflection of them by NNLS."""

from dataclasses import dataclass

import numpy as np
from hypothesis import assume
from hypothesis import strategies as st
from scipy.optimize import nnls

import deli

CURVATURE = {"midpoint": -1.0 / 12.0, "verlet": 1.0 / 6.0}  # c in W = M⁻¹ + c h² M⁻¹V″M⁻¹
CONTACT_TOLERANCE = 1e-8
EQUAL = 1e-12  # relative difference of two speeds that differ by rounding alone


@dataclass(frozen=True)
class Cluster:
    """Touching contacts with gradients G (rows, dof) and bilateral F (rows, dof), under V = q·Kq/2, at q = 0."""

    mass: np.ndarray
    momentum: np.ndarray
    gradients: np.ndarray
    bilateral: np.ndarray
    stiffness: np.ndarray

    def scene(self) -> deli.Scene:
        def rows(matrix: np.ndarray) -> deli.Constraints | None:
            return deli.Constraints(value=lambda q: matrix @ q, jacobian=lambda q: matrix) if len(matrix) else None

        return deli.Scene(
            mass=self.mass,
            position=np.zeros_like(self.mass),
            momentum=self.momentum,
            potential=deli.Potential(
                energy=lambda q: 0.5 * q @ self.stiffness @ q,
                gradient=lambda q: self.stiffness @ q,
                hessian=lambda q: self.stiffness,
            ),
            unilateral=rows(self.gradients),
            bilateral=rows(self.bilateral),
        )

    def metric(self, energy: str, scheme: str) -> np.ndarray:
        """W of the energy ½p·Wp that a reflection is to conserve, at the step size `step_size`."""
        inverse = np.diag(1.0 / self.mass)
        if energy == "hamiltonian":
            return inverse
        return inverse + CURVATURE[scheme] * self.step_size**2 * inverse @ self.stiffness @ inverse

    @property
    def step_size(self) -> float:
        """One with which the curvature changes W by less than a fifth."""
        root = np.sqrt(self.mass)
        frequency = np.abs(np.linalg.eigvalsh(self.stiffness / np.outer(root, root))).max()
        return float(1.0 / np.sqrt(frequency)) if frequency > 0 else 1.0

    def approach(self, momentum: np.ndarray) -> np.ndarray:
        """Normal velocities as fractions of the speed of the whole, negative where a contact closes."""
        norms = np.sqrt((self.gradients**2 / self.mass).sum(axis=1))
        speed = np.sqrt(momentum @ (momentum / self.mass))
        return self.gradients @ (momentum / self.mass) / (norms * speed)

    def outside_cone(self, impulse: np.ndarray) -> float:
        """How far an impulse is from all Gλ + Fν with λ >= 0, as a fraction of it, in the metric of the mass."""
        root = np.sqrt(self.mass)
        columns = np.vstack([self.gradients, self.bilateral, -self.bilateral]) / root
        columns /= np.linalg.norm(columns, axis=1)[:, None]
        size = np.linalg.norm(impulse / root)
        return nnls(columns.T, impulse / root)[1] / size if size else 0.0


def tangent(momentum: np.ndarray, mass: np.ndarray, bilateral: np.ndarray) -> np.ndarray:
    """The momentum less what would change a bilateral constraint: F·M⁻¹p = 0 to rounding, whatever the rank of F."""
    root = np.sqrt(mass)
    vectors, sizes, _ = np.linalg.svd((bilateral / root).T, full_matrices=False)
    vectors = vectors[:, sizes > 1e-12 * sizes.max(initial=1.0)]
    velocity = momentum / root
    for _ in range(2):
        velocity = velocity - vectors @ (vectors.T @ velocity)
    return root * velocity


def reflected(cluster: Cluster, operator: str, order: str, metric: np.ndarray) -> np.ndarray | None:
    """Algorithms 2 and 3 by nonnegative least squares: min ½z·Wz with z = 2p + Ĝλ, λ >= 0, and p ← z − p.

    None where a pass does not open its own contacts: one can approach in M⁻¹ and recede in W, and then no impulse both
    opens it and conserves ½p·Wp. With W = M⁻¹ that does not happen.
    """
    mass, p = cluster.mass, cluster.momentum
    norms = np.sqrt((cluster.gradients**2 / mass).sum(axis=1))
    normals = np.array([tangent(row, mass, cluster.bilateral) for row in cluster.gradients / norms[:, None]])
    factor = np.linalg.cholesky(metric).T
    last = -1
    for _ in range(10_000):
        approach = cluster.approach(p)
        closing = np.flatnonzero(approach < -CONTACT_TOLERANCE)
        if not len(closing):
            return p
        if order == "fastest":
            speeds = -approach[closing]
            closing = closing[speeds >= (1.0 - EQUAL) * speeds.max()][:1]
        elif operator == "sequential":
            last = next((int(row) for row in closing if row > last), int(closing[0]))
            closing = np.array([last])
        elif operator == "moreau":
            closing = np.flatnonzero(approach <= CONTACT_TOLERANCE)
        impulses = nnls((normals[closing] @ factor.T).T, -2.0 * factor @ p)[0]
        p = p + impulses @ normals[closing]
        if (cluster.approach(p)[closing] < -CONTACT_TOLERANCE).any():
            return None
    raise AssertionError("the reference did not end")


@st.composite
def clusters(draw: st.DrawFn) -> Cluster:
    """Contacts that a common motion opens, with rows that repeat or depend on each other and on bilateral ones.

    Small integers make that frequent, and keep angles from being so small that reflections go on for long.
    """
    dof = draw(st.integers(1, 5))
    vectors = st.lists(st.integers(-2, 2), min_size=dof, max_size=dof).filter(any).map(np.array)
    opening = draw(vectors)
    across = draw(st.lists(vectors, max_size=3))
    bilateral = [(opening @ opening) * row - (row @ opening) * opening for row in across]
    bilateral = np.array([row for row in bilateral if row.any()], dtype=float).reshape(-1, dof)
    gradients = []
    for row in draw(st.lists(vectors, min_size=1, max_size=5)):
        opened = row @ opening
        scale = draw(st.sampled_from([1e-3, 1.0, 1e3]))
        gradients.append(scale * (row + opening if opened == 0 else np.sign(opened) * row))
    mass = np.array(draw(st.lists(st.sampled_from([0.25, 0.5, 1.0, 2.0, 4.0]), min_size=dof, max_size=dof)))
    raw = draw(st.lists(st.integers(-8, 8), min_size=dof, max_size=dof).filter(any))
    momentum = tangent(np.array(raw, dtype=float), mass, bilateral)
    assume(np.linalg.norm(momentum) > 1e-2)
    square = np.array(draw(st.lists(vectors, min_size=dof, max_size=dof)), dtype=float)
    return Cluster(mass, momentum, np.array(gradients, dtype=float), bilateral, 0.5 * (square + square.T))

"""Energies of a scene: the Hamiltonian, and the second-order numerical Hamiltonian of each scheme."""

from __future__ import annotations

from typing import Any

import numpy as np

from deli.errors import InputError, StepError
from deli.mechanics.arrays import Array
from deli.mechanics.scene import Scene
from deli.mechanics.schemes import Scheme
from solvers.distribution import install_line

NO_HESSIAN = (
    'energy "numerical": the potential has no hessian; pass hessian=... to deli.Potential, or leave out its '
    "gradient as well and write energy with jax.numpy: " + install_line("jax")
)


def kinetic_energy(scene: Scene, p: Array) -> Any:
    """Return p.M^-1 p / 2, shape (..., dof) -> (...)."""
    return 0.5 * (p * p / scene.mass).sum(axis=-1)


def potential_energy(scene: Scene, q: Array) -> Any:
    """Return V(q), shape (..., dof) -> (...)."""
    return scene.potential.energy(q)


def hamiltonian(scene: Scene, q: Array, p: Array) -> Any:
    """Return H(q, p) = p.M^-1 p / 2 + V(q), shapes (..., dof) -> (...)."""
    return kinetic_energy(scene, p) + potential_energy(scene, q)


def numerical_hamiltonian(scene: Scene, scheme: Scheme, q: Array, p: Array, step_size: float) -> Any:
    """Return the second-order numerical Hamiltonian H2, which the scheme conserves in free flight to O(h^4).

    With v = M^-1 p, a = M^-1 grad V,

    - verlet: H2 = H + h^2 (v.V'' v / 12 - grad V.a / 24)
    - midpoint: H2 = H - h^2 (v.V'' v + grad V.a) / 24

    Parameters
    ----------
    scene
        The scene.
    scheme
        The scheme of the steps.
    q, p
        States, shape (..., dof).
    step_size
        h, in units of time.

    Raises
    ------
    InputError
        Where the potential has no hessian.
    """
    flat_q, flat_p = q.reshape(-1, scene.dof), p.reshape(-1, scene.dof)
    correction = np.empty(len(flat_q))
    for k, (position, momentum) in enumerate(zip(flat_q, flat_p, strict=True)):
        v, gradient = momentum / scene.mass, scene.potential.gradient(position)
        curvature = scene.potential.curvature(position, v)
        if curvature is None:
            raise InputError(NO_HESSIAN)
        force = gradient @ (gradient / scene.mass)
        correction[k] = scheme.numerical_curvature * curvature + scheme.numerical_force * force
    return hamiltonian(scene, q, p) + step_size**2 * correction.reshape(q.shape[:-1])


def reflection_metric(scene: Scene, scheme: Scheme, q: Array, step_size: float) -> Array:
    """Return W(q) = M^-1 + c h^2 M^-1 V'' M^-1, for which p.W p / 2 is the part of H2 that a reflection changes.

    c = 1/6 (verlet) or -1/12 (midpoint).

    Parameters
    ----------
    scene
        The scene.
    scheme
        The scheme of the steps.
    q
        Configuration, shape (dof,).
    step_size
        h, in units of time.

    Raises
    ------
    InputError
        Where the potential has no hessian.
    StepError
        If W is not positive definite: h is too large for this configuration.
    """
    factor = 2.0 * scheme.numerical_curvature
    hessian = potential_hessian(scene, q)
    with np.errstate(all="ignore"):
        metric = factor * step_size * step_size * hessian / np.outer(scene.mass, scene.mass)
        metric[np.diag_indices_from(metric)] += 1.0 / scene.mass
    if not np.isfinite(metric).all():
        raise StepError(f"energy 'numerical': the metric of a step of {step_size:g} is not finite; use a smaller one.")
    try:
        np.linalg.cholesky(metric)
    except np.linalg.LinAlgError as error:
        root = np.sqrt(scene.mass)
        strongest = float(np.linalg.eigvalsh(-factor * hessian / np.outer(root, root)).max())
        below = f"a step_size below {strongest**-0.5:.3g}" if strongest > 0.0 else "a smaller one"
        raise StepError(
            f"energy 'numerical': step_size {step_size:g} is too large for the {scheme.name} scheme's numerical "
            f"Hamiltonian, which is not positive definite in the momentum here; take {below}, or energy = 'hamiltonian'"
        ) from error
    return metric


def potential_hessian(scene: Scene, q: Array) -> Array:
    """Return V''(q), shape (dof, dof), and refuse a potential without a hessian."""
    hessian = scene.potential.hessian(q)
    if hessian is None:
        raise InputError(NO_HESSIAN)
    return hessian

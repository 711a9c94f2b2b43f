"""Energy, gradient and hessian of a potential."""

import math

import numpy as np

from deli.kernels.codes import ANSWERED, DONE, ENERGY, GRADIENT, HESSIAN, RAISED
from deli.kernels.compiled import call, kernel
from deli.kernels.machine import Machine
from deli.mechanics.tables import SPRING, Terms

SHORTEST = 1e-150  # stands in for the length of a spring whose ends coincide


@kernel
def _pair(kind: int, strength: float, length: float, square: float) -> tuple[float, float, float]:
    """Return φ, φ′/r and φ″ of a pair term at r² = square."""
    if kind == SPRING:
        r = math.sqrt(square)
        stretch = r - length
        return 0.5 * strength * stretch * stretch, strength - strength * length / max(r, SHORTEST), strength
    ratio = length * length / square
    sixth = ratio * ratio * ratio
    energy = strength * sixth * (sixth - 1.0)
    return (
        energy,
        strength * sixth * (6.0 - 12.0 * sixth) / square,
        strength * sixth * (156.0 * sixth - 42.0) / square,
    )


@kernel
def _power(square: float, half: float) -> float:
    """Return square ** half, by products for whole powers, because products have fewer roundings."""
    count = int(half)
    if half != count or abs(count) > 8:
        return square**half
    result = 1.0
    for _ in range(abs(count)):
        result *= square
    return result if count >= 0 else 1.0 / result


@kernel
def table_energy(terms: Terms, q: np.ndarray) -> float:
    """Return V of the terms."""
    dimension = terms.centre.shape[1]
    total = 0.0
    for k in range(q.size):
        total += terms.weight[k] * q[k]
    for pair in range(terms.kind.size):
        first, second = terms.first[pair] * dimension, terms.second[pair] * dimension
        square = 0.0
        for axis in range(dimension):
            square += (q[first + axis] - q[second + axis]) ** 2
        total += _pair(terms.kind[pair], terms.strength[pair], terms.length[pair], square)[0]
    for term in range(terms.body.size):
        body = terms.body[term] * dimension
        square = 0.0
        for axis in range(dimension):
            square += (q[body + axis] - terms.centre[term, axis]) ** 2
        total += terms.coefficient[term] * _power(square, 0.5 * terms.exponent[term])
    return total


@kernel
def table_gradient(terms: Terms, q: np.ndarray, out: np.ndarray) -> None:
    """Write ∇V of the terms."""
    dimension = terms.centre.shape[1]
    for k in range(q.size):
        out[k] = terms.weight[k]
    for pair in range(terms.kind.size):
        first, second = terms.first[pair] * dimension, terms.second[pair] * dimension
        square = 0.0
        for axis in range(dimension):
            square += (q[first + axis] - q[second + axis]) ** 2
        slope = _pair(terms.kind[pair], terms.strength[pair], terms.length[pair], square)[1]
        for axis in range(dimension):
            force = slope * (q[first + axis] - q[second + axis])
            out[first + axis] += force
            out[second + axis] -= force
    for term in range(terms.body.size):
        body = terms.body[term] * dimension
        square = 0.0
        for axis in range(dimension):
            square += (q[body + axis] - terms.centre[term, axis]) ** 2
        exponent = terms.exponent[term]
        slope = terms.coefficient[term] * exponent * _power(square, 0.5 * exponent - 1.0)
        for axis in range(dimension):
            out[body + axis] += slope * (q[body + axis] - terms.centre[term, axis])


@kernel
def table_hessian(terms: Terms, q: np.ndarray, out: np.ndarray) -> None:
    """Write V″ of the terms."""
    dimension = terms.centre.shape[1]
    for i in range(q.size):
        for j in range(q.size):
            out[i, j] = 0.0
    for pair in range(terms.kind.size):
        first, second = terms.first[pair] * dimension, terms.second[pair] * dimension
        square = 0.0
        for axis in range(dimension):
            square += (q[first + axis] - q[second + axis]) ** 2
        _, slope, curvature = _pair(terms.kind[pair], terms.strength[pair], terms.length[pair], square)
        if square == 0.0:  # no direction at coincident bodies: the same curvature in all of them
            slope, square = curvature, 1.0
        along = (curvature - slope) / square
        for i in range(dimension):
            x = along * (q[first + i] - q[second + i])
            for j in range(dimension):
                entry = x * (q[first + j] - q[second + j])
                if i == j:
                    entry += slope
                out[first + i, first + j] += entry
                out[second + i, second + j] += entry
                out[first + i, second + j] -= entry
                out[second + i, first + j] -= entry
    for term in range(terms.body.size):
        body = terms.body[term] * dimension
        square = 0.0
        for axis in range(dimension):
            square += (q[body + axis] - terms.centre[term, axis]) ** 2
        exponent = terms.exponent[term]
        slope = terms.coefficient[term] * exponent * _power(square, 0.5 * exponent - 1.0)
        along = slope * (exponent - 2.0) / square if square > 0.0 else 0.0
        for i in range(dimension):
            x = along * (q[body + i] - terms.centre[term, i])
            for j in range(dimension):
                out[body + i, body + j] += x * (q[body + j] - terms.centre[term, j])
            out[body + i, body + i] += slope


@kernel
def ask(machine: Machine, what: int, q: np.ndarray) -> int:
    """Call a function that is not compiled for the configuration q; its answer is in `mail`."""
    mail, hooks = machine.mail, machine.hooks
    for k in range(q.size):
        mail.at[k] = q[k]
    return DONE if call(hooks.evaluate, what, 0, 0, 0) == ANSWERED else RAISED


@kernel
def energy(machine: Machine, q: np.ndarray) -> tuple[int, float]:
    """Return a code and V(q)."""
    system, mail = machine.system, machine.mail
    total = table_energy(system.terms, q)
    if not system.other_forces:
        return DONE, total
    code = ask(machine, ENERGY, q)
    return code, total + mail.energy[0]


@kernel
def gradient(machine: Machine, q: np.ndarray, out: np.ndarray) -> int:
    """Write ∇V(q); return a code."""
    system, mail = machine.system, machine.mail
    table_gradient(system.terms, q, out)
    if not system.other_forces:
        return DONE
    code = ask(machine, GRADIENT, q)
    for k in range(q.size):
        out[k] += mail.gradient[k]
    return code


@kernel
def hessian(machine: Machine, q: np.ndarray) -> int:
    """Write V″(q) to ``mail.hessian``; return a code."""
    system, mail = machine.system, machine.mail
    if system.other_forces:  # the function answers for the whole potential
        return ask(machine, HESSIAN, q)
    table_hessian(system.terms, q, mail.hessian)
    return DONE

"""The nonsmooth generalized-alpha method."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from deli.integrators.integrator import Integrator, Ranges
from deli.integrators.recipe import Recipe, Weights
from deli.kernels.codes import MOVING
from deli.mechanics.scene import Scene


@dataclass(frozen=True)
class NonsmoothAlpha(Integrator):
    """Nonsmooth generalized-alpha method (Brüls, Acary and Cardona 2014): contacts in positions and in velocities.

    With v = M⁻¹p, the gradients G and F of g and f, and the new position x, one step solves for the smooth motion

        M ã⁺ = −∇V(x) + F(x)η,   F(x)ᵀṽ = 0,   (1 − α_m) a⁺ + α_m a = (1 − α_f) ã⁺ + α_f ã
        x̃ = q + h v + h² [(½ − β) a + β a⁺],   ṽ = v + h [(1 − γ) a + γ a⁺]

    corrects its position, and lets its velocity jump at the contacts closed at x, those with ν > 0 or g(x) = 0

        M(x − x̃) = G(x)ν + F(x)κ,    0 ≤ ν ⊥ g(x) ≥ 0,   f(x) = 0
        M(v⁺ − ṽ) = G(x)Λ + F(x)μ,   0 ≤ Λ ⊥ G(x)ᵀv⁺ + e G(q)ᵀv ≥ 0,   F(x)ᵀv⁺ = 0

    where α_m = (2ρ − 1)/(ρ + 1), α_f = ρ/(ρ + 1), γ = ½ + α_f − α_m and β = (γ + ½)²/4. Gaps never become negative.
    Without contacts the method is of second order, and with ρ < 1 it dissipates the frequencies that a step does not
    resolve. Contact forces are of first order, because the smooth motion does not include them. Each impact changes the
    energy by O(h), because positions are corrected and e refers to the approach speed at the start of the step. Against
    a plane, under gravity, energy is lost. Between round bodies that pass obliquely the approach slows down within the
    step, so that e = 1 adds energy, more for faster bodies, and energy grows without bound in finite time. If several
    contacts close at once, Newton's restitution holds at each of them, which does not transmit an impact along a row of
    balls.

    The step depends on a and ã besides q and p: they are recorded as ``auxiliary_acceleration`` and
    ``smooth_acceleration``, and begin as −M⁻¹∇V(q). "g(x) = 0" holds to the contact tolerance.

    Parameters
    ----------
    spectral_radius : float
        Spectral radius at infinite frequency, 0 ≤ ρ ≤ 1; 1 is the trapezoidal rule.
    restitution : float
        Coefficient of restitution, 0 ≤ e ≤ 1.

    Raises
    ------
    InputError
        For ρ or e out of range.

    Examples
    --------
    >>> import deli
    >>> run = deli.simulate(deli.scenes.quartic_wall(), deli.NonsmoothAlpha(restitution=0.5), step_size=0.01, steps=500)
    >>> energy = run["trajectory"].hamiltonian
    >>> [round(float(energy[step]), 3) for step in (0, 500)]  # one impact leaves a quarter of the energy
    [0.25, 0.063]
    """

    RANGES: ClassVar[Ranges] = {"spectral_radius": (0.0, 1.0), "restitution": (0.0, 1.0)}
    MEMORY: ClassVar[tuple[str, ...]] = ("auxiliary_acceleration", "smooth_acceleration")

    spectral_radius: float = 0.8
    restitution: float = 1.0

    def recipe(self) -> Recipe:
        """Return the numbers of the generalized-alpha method."""
        recurrence = _recurrence(float(self.spectral_radius))
        return Recipe(
            unit="deli.kernels.nonsmooth_alpha.advance_and_jump",
            weights=(0.0, 0.0, recurrence[0][2]),
            rows=MOVING,
            restitution=float(self.restitution),
            recurrence=recurrence,
            memory=len(self.MEMORY),
            begin=_free_fall,
        )


def _free_fall(scene: Scene, position: np.ndarray) -> np.ndarray:
    return np.tile(-scene.potential.gradient(position) / scene.mass, (2, 1))


def _recurrence(rho: float) -> tuple[Weights, ...]:
    """Return the weights of a, ã and ã⁺ in (x̃ − q − h v)/h², in (ṽ − v)/h and in a⁺, a row each."""
    alpha_m, alpha_f = (2.0 * rho - 1.0) / (rho + 1.0), rho / (rho + 1.0)
    gamma = 0.5 + alpha_f - alpha_m
    beta = 0.25 * (gamma + 0.5) ** 2
    old, before, new = (weight / (1.0 - alpha_m) for weight in (-alpha_m, alpha_f, 1.0 - alpha_f))
    position = (0.5 - beta + beta * old, beta * before, beta * new)
    velocity = (1.0 - gamma + gamma * old, gamma * before, gamma * new)
    return position, velocity, (old, before, new)

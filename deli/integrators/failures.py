"""The messages for the codes with which kernels fail."""

from typing import TYPE_CHECKING

from deli.errors import StepError
from deli.kernels import codes
from deli.mechanics.energies import reflection_metric
from deli.subproblems.reflection import SELECTIONS

if TYPE_CHECKING:
    from deli.integrators.bound import Bound


def explain(code: int, bound: "Bound") -> BaseException:
    """Return the exception for the code with which a kernel has returned.

    Raises
    ------
    StepError
        If the metric of a numerical Hamiltonian is not positive definite; the message names the largest step size.
    """
    raised = bound.forget()
    if raised is not None:
        return raised
    if code == codes.RAISED:  # a signal ended a Python function before its first line
        return KeyboardInterrupt()
    report, scheme = bound.work.report, bound.recipe.numerical
    if code == codes.UNCONVERGED:
        return StepError(
            f"position: the update with {report[0]:.0f} unilateral and {report[1]:.0f} bilateral constraints "
            f"did not converge: scaled residuals are primal {report[2]:.1e}, dual {report[3]:.1e}, "
            f"complementarity {report[4]:.1e} where {report[5]:.0e} is allowed; use a smaller step_size, "
            f"polish = true or a tighter tolerance, or a potential with a hessian."
        )
    operator, _ = SELECTIONS[bound.method.operator]
    if code == codes.NO_DIRECTION:
        return StepError(
            f"reflection: {operator!r} turns back and forth between {report[0]:.0f} contacts, because there is "
            f"no momentum at which all of them separate; use a smaller step_size, so that fewer of them are met "
            f"at once."
        )
    if code == codes.TOO_MANY_PASSES:
        return StepError(
            f"reflection: {operator!r} left {report[0]:.0f} of {report[1]:.0f} contacts approaching "
            f"(fastest at {report[3]:.2e}) after {report[2]:.0f} passes; try another operator or a smaller "
            f"step_size."
        )
    if code == codes.ACCUMULATED:
        return StepError(
            f"collision: unilateral constraint {report[0]:.0f} is met again at once, after {report[1]:.0f} events "
            f"of the step, {report[2]:.6g} into its {bound.step_size:g}: contacts rest or slide, or impacts "
            f"accumulate, which collision integrators cannot follow; use deli.GVI."
        )
    if code == codes.UNBALANCED:
        return StepError(
            f"collision: no impulse at unilateral constraint {report[0]:.0f} conserves the discrete energy, "
            f"{report[2]:.6g} into the step of {bound.step_size:g}; use a smaller step_size or another energy."
        )
    if code == codes.PENETRATED:
        return StepError(
            f"closed loop: unilateral constraint {report[0]:.0f} is violated by {-report[1]:.1e} after the "
            f"solver's best step; use polish = true or a tighter tolerance, or a larger contact_tolerance."
        )
    if code == codes.NO_SHADOW:
        return StepError(
            f"reflection: the smooth steps of size {bound.step_size:g} that define the shadow energy did not "
            "converge, or no impulse conserves it; use a smaller step_size, or energy = 'hamiltonian'."
        )
    if code == codes.INDEFINITE and scheme is not None:
        reflection_metric(bound.scene, scheme, bound.work.q, bound.step_size)  # its message names the largest step size
        return StepError("reflection: the metric of the numerical Hamiltonian is not positive definite to rounding.")
    return StepError("the state is no longer finite; use a smaller step_size.")

"""The errors deli raises on purpose: what the user can mend, and what a step could not do."""

__all__ = ["DeliError", "InputError", "StepError"]


class DeliError(Exception):
    """Base of every error deli raises on purpose."""


class InputError(DeliError, ValueError):
    """The input is at fault: the message names it, what was found, what is allowed and what to do."""


class StepError(DeliError):
    """A time step could not be computed: a subproblem failed, or the step size is out of range."""

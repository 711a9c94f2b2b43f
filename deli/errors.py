"""The errors that deli raises on purpose: inputs that the user can mend, and steps that could not be taken."""

__all__ = ["DeliError", "InputError", "StepError"]


class DeliError(Exception):
    """Base of every error that deli raises on purpose.

    Examples
    --------
    >>> import deli
    >>> try:
    ...     deli.scenes.newtons_cradle(balls=0)
    ... except deli.DeliError as error:
    ...     print(error)
    balls of newtons_cradle: found 0; it must be >= 1
    """


class InputError(DeliError, ValueError):
    """An input that is not allowed: the message names it, its value, the allowed values and the remedy.

    Examples
    --------
    >>> import deli
    >>> deli.simulate(deli.scenes.point_mass(), deli.GVI(), step_size=-0.1, steps=10)
    Traceback (most recent call last):
    ...
    deli.errors.InputError: step_size is -0.1; allowed: a finite number > 0.
    """


class StepError(DeliError):
    """A time step that could not be computed: a subproblem failed, or the step size is out of range.

    Functions that take one step or one reflection raise it. A run that meets it ends with the last good state, and its
    attribute ``outcome`` has the message.

    Examples
    --------
    >>> from deli import scenes
    >>> from deli.reflect import reflect
    >>> reflect(scenes.pogo_stick(), [5.0, 0.0], [-1.0, -2.0], energy="numerical", step_size=1.0)
    Traceback (most recent call last):
    ...
    deli.errors.StepError: energy 'numerical': step_size 1 is too large for the midpoint scheme's ...
    """

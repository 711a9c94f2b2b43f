"""Exceptions of the compile layer."""


class SolverError(Exception):
    """A problem, parameter, option or backend that cannot be used.

    Examples
    --------
    >>> import cvxpy as cp
    >>> import solvers
    >>> x = cp.Variable(2, name="x", integer=True)
    >>> solvers.compile(cp.Problem(cp.Minimize(cp.sum_squares(x))))
    Traceback (most recent call last):
    solvers.errors.SolverError: Variable 'x' has the attribute integer: only continuous Variables are allowed
    """


class UnknownBackendError(SolverError, ValueError):
    """A name of a backend that the registry does not have.

    Examples
    --------
    >>> import solvers
    >>> solvers.members("clarable")
    Traceback (most recent call last):
    solvers.errors.UnknownBackendError: unknown backend 'clarable'; allowed: auto, clarabel, daqp, ...
    """


class ParameterError(SolverError, ValueError):
    """A parameter value that is missing, misshapen, not finite or outside its declared attributes.

    Examples
    --------
    >>> import cvxpy as cp
    >>> import solvers
    >>> x, b = cp.Variable(name="x"), cp.Parameter(name="b", nonneg=True)
    >>> compiled = solvers.compile(cp.Problem(cp.Minimize(cp.square(x)), [x >= b]))
    >>> compiled.solve(b=-1.0)
    Traceback (most recent call last):
    solvers.errors.ParameterError: parameter 'b' is declared nonnegative and holds -1
    """


class NotInstalledError(SolverError, ImportError):
    """A backend without its package.

    Examples
    --------
    >>> import solvers
    >>> try:
    ...     names = solvers.members("highs")
    ... except solvers.NotInstalledError:  # because the package highspy is missing
    ...     names = solvers.members("native")
    >>> len(names)
    1
    """


class BackendError(SolverError):
    """A backend that raised an exception, which is the cause of this one.

    Examples
    --------
    >>> import cvxpy as cp
    >>> import solvers
    >>> def broken(program, tolerance, options):
    ...     raise ZeroDivisionError("step of length zero")
    >>> solvers.register("broken", broken)
    >>> x = cp.Variable(name="x")
    >>> solvers.compile(cp.Problem(cp.Minimize(cp.square(x))), "broken")
    Traceback (most recent call last):
    solvers.errors.BackendError: backend 'broken' raised ZeroDivisionError: step of length zero
    >>> solvers.unregister("broken")
    """

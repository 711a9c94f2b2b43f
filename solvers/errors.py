"""Exceptions of the compile layer."""


class SolverError(Exception):
    """A problem, parameter, option or backend that cannot be used as asked."""


class UnknownBackendError(SolverError, ValueError):
    """A backend name that nobody registered."""


class ParameterError(SolverError, ValueError):
    """A parameter value that is missing, misshapen, not finite or outside its declared attributes."""


class NotInstalledError(SolverError, ImportError):
    """A backend whose package is not installed."""


class BackendError(SolverError):
    """A backend that raised something; what it raised is the cause."""

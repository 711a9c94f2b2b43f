"""The arithmetic of a step, compiled by numba: functions of arrays, with calls back to Python where they are needed."""

LOGGERS = ("deli.kernels", "solvers")
"""Names of the loggers that say that something is compiled, and where its code goes."""

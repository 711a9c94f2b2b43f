"""The arithmetic of a step, compiled by numba: arrays in, arrays out, and calls back to Python where it is needed."""

LOGGERS = ("deli.kernels", "solvers")
"""Names of the loggers that say that something is compiled, and where its code goes."""

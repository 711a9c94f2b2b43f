"""The arithmetic of a step, compiled by numba: arrays in, arrays out, and calls back to Python where it is needed."""

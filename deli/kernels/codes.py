"""Numeric codes: results and requests of kernels, and kinds of rows, operators and subproblems."""

GENERALIZED, MOREAU, SEQUENTIAL, FASTEST = 0, 1, 2, 3  # what a pass reflects off, see `reflect`
REFLECTION, POSITION, PROJECTION = 0, 1, 2
# The rows of a position update: their gradients are those at q, or follow the constraints; or they are affine.
FROZEN, MOVING, AFFINE = 0, 1, 2

# What a kernel returns. After REFRESH, neighbours must be searched and the step tried again; above it, it failed.
DONE, REFRESH = 0, 1
RAISED, UNCONVERGED, NO_DIRECTION, TOO_MANY_PASSES, NOT_FINITE, INDEFINITE = 10, 11, 12, 13, 14, 15
ACCUMULATED, UNBALANCED, PENETRATED, NO_SHADOW = 16, 17, 18, 19

# What functions in Python return to kernels when they have done what they were asked. It is not zero, which is what
# kernels get where a signal ends such a function before its first line.
ANSWERED = 1

# What a kernel asks the function at `Hooks.evaluate` for, of the configuration in `Mail.at`.
ENERGY, GRADIENT, HESSIAN, SOFTEN, LEAST_GAP = 0, 1, 2, 3, 4
UNILATERAL, UNILATERAL_GRADIENTS, BILATERAL, BILATERAL_GRADIENTS = 5, 6, 7, 8

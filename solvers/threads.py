"""The lock around cvxpy."""

import threading

CVXPY = threading.RLock()
"""Lock that is held around every use of cvxpy, because cvxpy is not safe to use from several threads."""

"""What threads must not do at the same time."""

import threading

CVXPY = threading.RLock()
"""Held around every use of cvxpy, which is not safe to use from several threads."""

"""Recorded subproblems, solved again by every backend."""

"""Runs, from a checked plan to the last row."""

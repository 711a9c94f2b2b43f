"""Figures of a run: what it conserves over time, where it goes, and how backends compare on its subproblems."""

from deli.plotting.figures import check_picture, history, performance_profile, save, save_replay, trajectory

__all__ = ["check_picture", "history", "performance_profile", "save", "save_replay", "trajectory"]

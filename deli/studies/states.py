"""The states of a study's case."""

WAITING, RUNNING, DONE, FAILED = "waiting", "running", "done", "failed"
TIMED_OUT, OUT_OF_MEMORY, KILLED, INTERRUPTED = "timed out", "out of memory", "killed", "interrupted"
EXCLUDED = "excluded"
FAILURES = (FAILED, TIMED_OUT, OUT_OF_MEMORY, KILLED)
"""Ends that a rerun leaves as they are, except with ``--retry-failed``."""
ENDS = (DONE, *FAILURES, INTERRUPTED)

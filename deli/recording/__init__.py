"""Recording of runs: what is stored, where it comes from, and how it gets to disk."""

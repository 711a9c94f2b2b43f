"""Recording of runs: schema, provenance, files and their checks."""

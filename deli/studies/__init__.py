"""Studies: many runs from one file, on many processes, as one dataset."""

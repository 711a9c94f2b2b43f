"""The commands of the command line, one a file; each imports heavy modules only when it runs."""

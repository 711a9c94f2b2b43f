"""The command line, one command a file; heavy imports happen when a command runs."""

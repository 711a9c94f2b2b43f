"""The benchmark ``deli bench``: its parts, one a file."""

PARTS = ("steps", "skip", "backends", "scaling", "ensemble", "import")

"""What deli costs: the parts of ``deli bench``, one a file."""

PARTS = ("steps", "skip", "backends", "scaling", "ensemble", "import")

"""The folder of the files that come with deli: studies, configs of the paper's figures, the library of subproblems."""

from pathlib import Path

_PACKAGED = Path(__file__).with_name("data")
"""Where a wheel has them: `pyproject.toml` says so."""

FOLDER = _PACKAGED if _PACKAGED.is_dir() else Path(__file__).parents[1] / "studies"
"""Inside an installed package, or ``studies/`` of a checkout."""

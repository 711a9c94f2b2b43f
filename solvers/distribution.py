"""The distribution that installs the packages `deli` and `solvers`: its name, and how its extras are installed."""

DISTRIBUTION = "deli-contact"
"""Name of the distribution. The package index has other projects called ``deli`` and ``solvers``."""


def install_line(extra: str) -> str:
    """Return the words that tell a user how to install an extra.

    Parameters
    ----------
    extra : str
        A name of ``[project.optional-dependencies]`` in ``pyproject.toml``.

    Examples
    --------
    >>> install_line("jax")
    "pip install '.[jax]' (in a checkout of deli-contact)"
    """
    return f"pip install '.[{extra}]' (in a checkout of {DISTRIBUTION})"

"""The distribution that installs the packages `deli` and `solvers`: its name, and the command for its extras."""

DISTRIBUTION = "deli-contact"
"""Name of the distribution. The package index has other projects called ``deli`` and ``solvers``."""


def install_line(extra: str) -> str:
    """Return the command that installs an extra, with the place to run it.

    Parameters
    ----------
    extra : str
        A name of ``[project.optional-dependencies]`` in ``pyproject.toml``.

    Examples
    --------
    >>> from solvers.distribution import install_line
    >>> install_line("jax")
    "pip install '.[jax]' (in a checkout of deli-contact)"
    """
    return f"pip install '.[{extra}]' (in a checkout of {DISTRIBUTION})"

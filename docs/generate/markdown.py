"""Pieces of Markdown."""

from collections.abc import Iterable


def table(heads: Iterable[str], rows: Iterable[Iterable[object]]) -> str:
    """Return a table; bars in cells are escaped."""
    heads = list(heads)
    lines = [heads, ["---"] * len(heads), *rows]
    return "\n".join(f"| {' | '.join(_cell(cell) for cell in line)} |" for line in lines)


def _cell(cell: object) -> str:
    return " ".join(str(cell).split()).replace("|", "\\|")


def code(value: object) -> str:
    """Return a value in code type, or nothing for an empty text."""
    return f"`{value}`" if str(value) else ""


def paragraphs(*texts: str) -> str:
    """Return texts with empty lines between them."""
    return "\n\n".join(text for text in texts if text) + "\n"

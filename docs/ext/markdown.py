"""Markdown of tables and plain words."""

from __future__ import annotations

from collections.abc import Iterable, Sequence


def table(head: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """Return a table."""
    lines = [list(head), ["---"] * len(head), *(list(row) for row in rows)]
    return "\n".join(f"| {' | '.join(cells)} |" for cells in lines)


def words(text: str) -> str:
    """Return plain text as Markdown: what it would read as markup is escaped."""
    escaped = " ".join(text.split())
    for mark in ("\\", "|", "*", "_", "[", "]", "<", "$", "{", "}"):
        escaped = escaped.replace(mark, f"\\{mark}")
    return escaped


def code(text: str) -> str:
    """Return text as code, also within a table."""
    return f"`{text}`".replace("|", "\\|") if text else ""


def prose(text: str) -> str:
    """Return text in which code stands between backticks: the rest is escaped."""
    pieces = text.split("`")
    return "".join(code(one) if n % 2 else _spaced(one) for n, one in enumerate(pieces))


def _spaced(text: str) -> str:
    before, after = " " * (text[:1].isspace()), " " * (text[-1:].isspace() and bool(text.strip()))
    return f"{before}{words(text)}{after}"

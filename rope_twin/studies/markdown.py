"""Tables in the pages that commands write."""

from __future__ import annotations

from collections.abc import Iterable, Sequence


def table(rows: Iterable[Sequence[str]]) -> str:
    """Return the lines of a Markdown table; the first row is the head."""
    head, *others = rows
    lines = [f"| {' | '.join(row)} |" for row in (head, *others)]
    return "\n".join([lines[0], f"|{' --- |' * len(head)}", *lines[1:]])

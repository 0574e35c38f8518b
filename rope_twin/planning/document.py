"""Document of headings, texts, tables and pictures, numbered through, without a layout.

Texts mark code by `backticks`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any


@dataclass(frozen=True)
class Heading:
    """A heading with its number; level 1 or 2."""

    words: str
    level: int
    kind: str = "heading"


@dataclass(frozen=True)
class Text:
    """A paragraph, or a list of points."""

    lines: tuple[str, ...]
    kind: str = "paragraph"  # or "list"


@dataclass(frozen=True)
class Table:
    """A table; its head may be empty."""

    head: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]
    caption: str = ""
    words: tuple[int, ...] = ()  # columns of text, on the left; numbers stand on the right
    wide: tuple[int, ...] = ()  # columns that share what is left of the width
    groups: tuple[bool, ...] = ()  # whether a rule stands above a row
    kind: str = "table"


@dataclass(frozen=True)
class Figure:
    """A picture of matplotlib."""

    picture: Any
    caption: str
    name: str
    kind: str = "figure"


Block = Heading | Text | Table | Figure


@dataclass
class Report:
    """A report, in the order of reading."""

    title: str
    lead: str
    facts: tuple[tuple[str, str], ...]  # of the title block
    blocks: list[Block] = field(default_factory=list)
    _numbers: list[int] = field(default_factory=lambda: [0, 0])
    _tables: int = 0
    _figures: int = 0
    _appendix: bool = False

    def heading(self, words: str, level: int = 1) -> None:
        """Add a numbered heading."""
        self._numbers = (
            [self._numbers[0] + 1, 0] if level == 1 else [self._numbers[0], self._numbers[1] + 1]
        )
        first = chr(64 + self._numbers[0]) if self._appendix else str(self._numbers[0])
        number = first if level == 1 else f"{first}.{self._numbers[1]}"
        self.blocks.append(Heading(f"{number}  {words}", level))

    def appendix(self, words: str) -> None:
        """Add the heading of the first appendix; further headings have letters too."""
        self._appendix, self._numbers = True, [0, 0]
        self.heading(words)

    def text(self, *lines: str) -> None:
        """Add a paragraph for each."""
        self.blocks += [Text((line,)) for line in lines]

    def points(self, lines: Sequence[str]) -> None:
        """Add a list of points."""
        self.blocks.append(Text(tuple(lines), "list"))

    def table(
        self,
        caption: str,
        head: Sequence[str],
        rows: Sequence[Sequence[str]],
        words: Sequence[int] = (),
        wide: Sequence[int] = (),
        group: bool = False,
    ) -> None:
        """Add a table.

        group: rows of the same first cell belong together; it is written in the first of them.
        """
        self._tables += 1
        first = [row[0] for row in rows]
        new = [k == 0 or own != first[k - 1] for k, own in enumerate(first)]
        shown = [
            tuple(row) if not group or begins else ("", *row[1:])
            for row, begins in zip(rows, new, strict=True)
        ]
        rules = tuple(group and k > 0 and begins for k, begins in enumerate(new))
        caption = f"Table {self._tables}. {caption}"
        self.blocks.append(
            Table(tuple(head), tuple(shown), caption, tuple(words), tuple(wide), rules)
        )

    def figure(self, picture: Any, caption: str) -> None:
        """Add a picture; None is left out."""
        if picture is None:
            return
        self._figures += 1
        caption = f"Figure {self._figures}. {caption}"
        self.blocks.append(Figure(picture, caption, f"figure{self._figures}"))

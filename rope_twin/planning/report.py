"""Report as one HTML file and as PDF: headings, texts, tables and pictures, and their two layouts.

All are numbered through. Texts mark code by `backticks`.
"""

from __future__ import annotations

import io
import json
import re
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from rope_twin.errors import require

HTML_LAYOUT, PDF_LAYOUT = "report.html.j2", "report.typ"


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

    def heading(self, title: str, level: int = 1) -> None:
        """Add a numbered heading."""
        self._numbers = (
            [self._numbers[0] + 1, 0] if level == 1 else [self._numbers[0], self._numbers[1] + 1]
        )
        first = chr(64 + self._numbers[0]) if self._appendix else str(self._numbers[0])
        number = first if level == 1 else f"{first}.{self._numbers[1]}"
        self.blocks.append(Heading(f"{number}  {title}", level))

    def appendix(self, title: str) -> None:
        """Add the heading of the first appendix; further headings have letters too."""
        self._appendix, self._numbers = True, [0, 0]
        self.heading(title)

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
        new = [k == 0 or name != first[k - 1] for k, name in enumerate(first)]
        cells = [
            tuple(row) if not group or begins else ("", *row[1:])
            for row, begins in zip(rows, new, strict=True)
        ]
        rules = tuple(group and k > 0 and begins for k, begins in enumerate(new))
        caption = f"Table {self._tables}. {caption}"
        self.blocks.append(
            Table(tuple(head), tuple(cells), caption, tuple(words), tuple(wide), rules)
        )

    def figure(self, picture: Any, caption: str) -> None:
        """Add a picture; None is left out."""
        if picture is None:
            return
        self._figures += 1
        caption = f"Figure {self._figures}. {caption}"
        self.blocks.append(Figure(picture, caption, f"figure{self._figures}"))


def check_report() -> None:
    """Check, before any computation, that a report can be made.

    Raises:
        InputError: Jinja2 or typst is not installed.
    """
    require("jinja2", "a report needs it and it is not there", "planning", "Jinja2")
    require("typst", "a report needs it and it is not there", "planning")


def html_report(report: Report) -> bytes:
    """Return the report as one HTML file, pictures and styles in it."""
    import jinja2
    from markupsafe import Markup

    environment = jinja2.Environment(autoescape=True, undefined=jinja2.StrictUndefined)
    environment.filters["code"] = _code
    layout = Path(__file__).with_name(HTML_LAYOUT).read_text(encoding="utf-8")
    pictures = {
        block.name: Markup(_named(_svg(block, "none"), block.name))
        for block in report.blocks
        if isinstance(block, Figure)
    }
    return environment.from_string(layout).render(report=report, pictures=pictures).encode()


def pdf_report(report: Report) -> bytes:
    """Return the report as tagged PDF with typst's fonts; bit-identical when repeated."""
    import typst

    pictures = {
        f"{block.name}.svg": _svg(block, "path")
        for block in report.blocks
        if isinstance(block, Figure)
    }
    blocks = [
        {key: value for key, value in vars(block).items() if key != "picture"}
        for block in report.blocks
    ]
    content = {"title": report.title, "lead": report.lead, "facts": report.facts, "blocks": blocks}
    files = {
        "main.typ": Path(__file__).with_name(PDF_LAYOUT).read_bytes(),
        "content.json": json.dumps(content, ensure_ascii=False).encode(),
        **{name: text.encode() for name, text in pictures.items()},
    }
    # its type hints know no dict, which its documentation gives
    make: Any = typst.compile
    return bytes(make(files, format="pdf", ignore_system_fonts=True, timestamp=0))


def _code(text: str) -> Any:
    """Return words as HTML, `code` marked."""
    from markupsafe import Markup, escape

    parts = str(text).split("`")
    markup = (
        Markup("<code>{}</code>").format(part) if k % 2 else escape(part)
        for k, part in enumerate(parts)
    )
    return Markup("").join(markup)


def _svg(figure: Figure, fonts: str) -> str:
    """Return a figure as SVG; fonts: "none" for text, "path" for outlines."""
    import matplotlib

    sink = io.StringIO()
    with matplotlib.rc_context({"svg.hashsalt": figure.name, "svg.fonttype": fonts}):
        figure.picture.savefig(sink, format="svg", metadata={"Date": None, "Creator": None})
    return sink.getvalue()


def _named(svg: str, salt: str) -> str:
    """Return an SVG for HTML, the names of its parts its own."""
    text = svg[svg.index("<svg") :]
    text = re.sub(r'\bid="', f'id="{salt}_', text)
    return re.sub(r'(xlink:href="#|url\(#)', rf"\g<1>{salt}_", text)

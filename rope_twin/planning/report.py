"""Report of a plan as one HTML file and as PDF: two layouts of the same content."""

from __future__ import annotations

import io
import json
import re
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rope_twin.errors import require
from rope_twin.planning.document import Figure, Report
from rope_twin.planning.report_content import report_of
from rope_twin.whole_file import write_whole

if TYPE_CHECKING:
    from rope_twin.planning.run import PlanResult

HTML, PDF = "report.html", "report.pdf"
HTML_LAYOUT, PDF_LAYOUT = "report.html.j2", "report.typ"


def check_report() -> None:
    """Check, before any computation, that a report can be made.

    Raises:
        InputError: Jinja2 or typst is not installed.
    """
    require("jinja2", "a report needs it and it is not there", "planning", "Jinja2")
    require("typst", "a report needs it and it is not there", "planning")


def write_report(result: PlanResult, folder: Path) -> list[Path]:
    """Write the report as HTML and PDF into a folder that is there, and return both paths.

    Raises:
        InputError: Jinja2 or typst is not installed.
        OSError: a file cannot be written.
    """
    check_report()
    report = report_of(result)
    files = {folder / HTML: html_report(report), folder / PDF: pdf_report(report)}
    for path, data in files.items():
        write_whole(path, data)
    return list(files)


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
    """Return the report as PDF, tagged, with the fonts that typst brings: it repeats to the bit."""
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


def _code(words: str) -> Any:
    """Return words as HTML, `code` marked."""
    from markupsafe import Markup, escape

    parts = str(words).split("`")
    marked = (
        Markup("<code>{}</code>").format(part) if k % 2 else escape(part)
        for k, part in enumerate(parts)
    )
    return Markup("").join(marked)


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

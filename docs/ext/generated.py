"""Reference pages made from the program: a marker in a page is replaced before it is parsed.

A page holds a line like `<!-- generated: topics -->`; SECTIONS has the function that makes the
Markdown in its place. So the reference cannot differ from the program that it was built with.
"""

from __future__ import annotations

import re
from collections.abc import Callable

import command_line
import gallery
import interface
import keys
from sphinx.application import Sphinx
from sphinx.environment import BuildEnvironment

SECTIONS: dict[str, Callable[[], str]] = {
    "commands": command_line.overview,
    "command line": command_line.reference,
    "topics": interface.topics,
    "services": interface.services,
    "qos": interface.qos_profiles,
    "parameters": interface.parameters,
    "diagnostics": interface.diagnostics,
    "scene keys": keys.scene_keys_by_part,
    "scene gallery": gallery.scene_gallery,
    "ropes": gallery.rope_library,
    "load models": gallery.load_models,
}
MARKER = re.compile(r"^<!-- generated: ([a-z ]+) -->$", re.MULTILINE)
# What reStructuredText would read as markup in a docstring, outside of code between backticks.
MARKUP = re.compile(r"(`[^`]*`)|([*_|](?=\w)|(?<=\w)[_|](?!\w)|(?<=\w)\*)")


def setup(app: Sphinx) -> dict[str, bool]:
    """Register with Sphinx."""
    app.connect("source-read", fill_in)
    app.connect("env-get-outdated", pages_with_markers)
    app.connect("autodoc-process-docstring", escape_markup, priority=100)  # before napoleon
    return {"parallel_read_safe": True}


def fill_in(app: Sphinx, page: str, source: list[str]) -> None:
    """Replace the markers of a page by what the program gives."""
    source[0] = MARKER.sub(lambda found: SECTIONS[found[1]](), source[0])


def pages_with_markers(app: Sphinx, env: BuildEnvironment, *changes: set[str]) -> list[str]:
    """Return the pages to read again in every build: the program may have changed."""
    pages = env.found_docs
    return [page for page in pages if MARKER.search(env.doc2path(page).read_text("utf-8"))]


def escape_markup(
    app: Sphinx, what: str, name: str, item: object, options: object, lines: list[str]
) -> None:
    """Let docstrings be plain text with code between backticks."""
    if item is not None and what in ("class", "method", "function", "property", "attribute"):
        lines[:] = [MARKUP.sub(lambda found: found[1] or "\\" + found[2], one) for one in lines]

"""The generated reference has everything that the program has, and an explanation for it."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest

from rope_twin.cli import COMMANDS
from rope_twin.effects import EFFECTS
from rope_twin.scene.load import rope_presets, scene_names
from rope_twin.scene.reference import scene_keys
from rope_twin.topics import SERVICES, TOPICS

DOCS = Path(__file__).resolve().parents[2] / "docs"
sys.path.append(str(DOCS / "ext"))

import generated  # noqa: E402
import interface  # noqa: E402
import profiles  # noqa: E402

NAMES = {
    "commands": [f"`rope_twin {name}`" for name in COMMANDS],
    "topics": [f"| `{topic.name}` |" for topic in TOPICS],
    "services": [f"| `{one.name}` |" for one in SERVICES],
    "scene keys": [
        f"`{key.path.removeprefix('effects[].')}`" for key in scene_keys() if key.path != "effects"
    ],
    "ropes": [f"| `{name}` |" for name in rope_presets()],
    "load models": [f"## `{effect.name}`" for effect in EFFECTS],
}


@pytest.mark.parametrize("section", NAMES)
def test_sections_are_complete(section: str) -> None:
    text = generated.SECTIONS[section]()
    assert [name for name in NAMES[section] if name not in text] == []


def test_every_section_stands_on_one_page() -> None:
    pages = (path.read_text("utf-8") for path in (DOCS / "reference").glob("*.md"))
    markers = [marker for page in pages for marker in generated.MARKER.findall(page)]
    assert sorted(markers) == sorted(generated.SECTIONS)


def test_every_diagnostic_row_is_explained() -> None:
    assert interface.diagnostic_rows().keys() == interface.ROWS_MEAN.keys()


def test_every_scene_has_a_profile() -> None:
    """Where one is missing `python docs/ext/profiles.py` computes it."""
    assert sorted(profiles.stored_profiles()) == sorted(scene_names())


def test_docstrings_are_plain_text() -> None:
    lines = ["a*b of `c*d`, n_max and |x|, *args"]
    generated.escape_markup(None, "class", "x", object, None, lines)  # type: ignore[arg-type]
    assert lines == ["a\\*b of `c*d`, n\\_max and \\|x\\|, \\*args"]

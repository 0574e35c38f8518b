"""Scenes with a rope over a sheave: refusals in one sentence, and the system that is built."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from scene_text import assert_refused, written

from rope_twin import load_scene
from rope_twin.core import state as rows
from rope_twin.core.joined.joints import ANCHORED, FORCE, SECOND
from rope_twin.files import share_dir
from rope_twin.scene.joined_model import build_joined

LOOP = (share_dir() / "config" / "scenes" / "two_line_loop.yaml").read_text()
OWN_FIGURES = LOOP[LOOP.index("    mass_kg: 1500.0") : LOOP.index("hang_offs:")]
STRETCH = "    from: ascending\n    to: lower_sheave\n"


def spoilt(old: str, new: str) -> str:
    """Return the scene with its only occurrence of `old` replaced."""
    assert LOOP.count(old) == 1, f"'{old}' occurs {LOOP.count(old)} times"
    return LOOP.replace(old, new)


BAD: list[tuple[str, str, str, tuple[str, ...]]] = [
    ("one rope at a sheave", spoilt(STRETCH, "    from: ascending\n    to: descending\n"),
     "sheaves[0]", ("1 ropes end at 'lower_sheave'", "to two ropes")),
    ("no such sheave", spoilt(STRETCH, STRETCH.replace("lower_sheave", "lower_sheaf")),
     "ropes[3].to", ("no payload 'lower_sheaf'", "did you mean 'lower_sheave'?")),
    ("rope from a sheave", spoilt(STRETCH, "    from: lower_sheave\n    to: ascending\n"),
     "sheaves[0]", ("a rope begins at 'lower_sheave'", "`to: lower_sheave`")),
    ("straight from the winch",
     spoilt("    from: haulback_sheave\n    to: ascending\n",
            "    from: haulback_sheave\n    to: lower_sheave\n")
     .replace(STRETCH, "    from: descending\n    to: ascending\n"),
     "ropes[2]", ("goes from 'haulback_sheave' straight to a sheave", "a payload or a joint")),
    ("another make", spoilt("  - name: below_ascending\n    rope: hmpe_25mm",
                            "  - name: below_ascending\n    rope: hmpe_76mm"),
     "ropes[3]", ("are one rope and differ in material", "the same `rope`")),
    ("graded", spoilt(STRETCH, STRETCH + "    grading: {lowest_m: 1.0}\n"),
     "ropes[3]", ("is graded", "remove `grading`")),
    ("held by nothing", LOOP.replace(OWN_FIGURES, ""),
     "sheaves[0]", ("nothing holds 'lower_sheave' down", "give it a `tether` or a mass")),
    ("pushing tether", spoilt("force_n: 50000.0", "force_n: -5.0"),
     "sheaves[0].tether.force_n", ("-5",)),
    ("misspelt key", spoilt("friction: 0.01", "frction: 0.01"),
     "sheaves[0].frction", ("frction", "friction")),
    ("a name twice", spoilt("  - name: lower_sheave\n", "  - name: ascending\n"),
     "payloads[1].name", ("'ascending' is the name of another",)),
]  # fmt: skip


@pytest.mark.parametrize(("text", "place", "words"), [b[1:] for b in BAD], ids=[b[0] for b in BAD])
def test_invalid_sheaves_are_rejected(
    tmp_path: Path, text: str, place: str, words: tuple[str, ...]
) -> None:
    """One sentence with the place, what is wrong and what would be right."""
    assert_refused(text, place, words, tmp_path)


def test_a_rope_over_a_sheave_is_built_as_two_ropes(tmp_path: Path) -> None:
    """Their last nodes are there, they are damped alike, and the tether is a tie."""
    scene = load_scene(written(tmp_path, LOOP))
    system = build_joined(scene).system
    sheaves, joints = system.sheaves, system.joints
    assert sheaves is not None
    assert sheaves.of.tolist() == [-1, 0, -1, 0]
    assert sheaves.base[[1, 3]].tolist() == [900.0, 600.0]
    assert joints.upper[1] == joints.upper[3] != joints.lower[1] != joints.lower[3]
    assert (system.ropes[1].sections == system.ropes[3].sections).all()
    for r in (1, 3):
        rope = system.ropes[r]
        n = int(rope.state.counts[rows.ELEMENTS])
        point = joints.nodes[:3, joints.upper[r]]
        assert np.allclose(rope.state.nodes[:3, n], point)
        room = rope.state.s.shape[0] * rope.model.element_length
        assert room > 1500.0, "all of the rope may come to this side"
    assert joints.ties[SECOND, 0] == ANCHORED
    assert joints.ties[FORCE, 0] == 50000.0

"""Golden states: no result of the solver changes unnoticed.

On the processor and numba that made a scene's row the states are equal to the bit. Elsewhere
compiled code rounds otherwise, which slack and snap amplify without bound: there the first five
seconds of tension agree to a millionth of its mean, far below what any change of a model makes.
"""

from __future__ import annotations

import json
from typing import Any

import golden_states
import pytest

from rope_twin.scene.load import scene_names

GOLDEN: dict[str, Any] = json.loads(golden_states.FILE.read_text(encoding="utf-8"))
ELSEWHERE = 1e-6


def test_every_scene_has_golden_states() -> None:
    assert sorted(GOLDEN) == sorted(scene_names())


@pytest.mark.parametrize("name", scene_names())
def test_a_scene_keeps_its_golden_states(name: str) -> None:
    expected, found = GOLDEN[name], golden_states.golden(name)
    assert found["solver"] == expected["solver"], "raised on purpose? then write the file again"
    if found["machine"] == expected["machine"]:
        assert found == expected
        return
    assert len(found["tension_top_n"]) == len(expected["tension_top_n"])
    first, was = found["tension_top_n"][0], expected["tension_top_n"][0]
    assert first == pytest.approx(was, rel=ELSEWHERE)

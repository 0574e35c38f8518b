"""Golden states: no result of the solver changes unnoticed.

On the processor and numba that made a scene's row the states are equal to the bit. Elsewhere
compiled code rounds otherwise, which slack and snap amplify without bound: there the first five
seconds of tension agree to a millionth of its mean, far below what any change of a model makes.

Scenes that between them have every part of a step are run always. All of them, most of whose time
is compilation: `pytest -m "long or not long" test/stability/test_golden_states.py`.
"""

from __future__ import annotations

import golden_states
import pytest

from rope_twin.scene.load import load_scene, scene_names

GOLDEN = golden_states.rows()
ELSEWHERE = 1e-6
COVERING = golden_states.covering()
SCENES = [
    name if name in COVERING else pytest.param(name, marks=pytest.mark.long)
    for name in scene_names()
]


def test_every_scene_has_golden_states() -> None:
    assert sorted(GOLDEN) == sorted(scene_names())


@pytest.mark.parametrize("name", scene_names())
def test_the_parts_of_every_scene_are_known(name: str) -> None:
    assert golden_states.parts_of(load_scene(name)) == GOLDEN[name]["parts"], "write its row again"


@pytest.mark.parametrize("name", SCENES)
def test_a_scene_keeps_its_golden_states(name: str) -> None:
    expected = GOLDEN[name]
    alike = golden_states.machine() == expected["machine"]
    actual = golden_states.golden(name, golden_states.UNTIL_S if alike else golden_states.EVERY_S)
    assert actual["solver"] == expected["solver"], "raised on purpose? then write the file again"
    if alike:
        assert actual == expected
    else:
        assert actual["tension_top_n"] == pytest.approx(
            expected["tension_top_n"][:1], rel=ELSEWHERE
        )

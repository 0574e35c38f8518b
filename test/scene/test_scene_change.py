"""Numbers of a scene changed by path: the rules of a file, and one sentence per fault."""

from __future__ import annotations

import math

import pytest

from rope_twin import load_scene
from rope_twin.errors import SceneError
from rope_twin.scene.load import Change, change_scene
from rope_twin.scene.schema import Scene

SCENE = load_scene("deep_lift")


def with_change(path: str, value: float, multiply: bool = False) -> Scene:
    """deep_lift with one number changed."""
    return change_scene(SCENE, [Change(path, value, multiply)])


def test_numbers_are_set_and_multiplied() -> None:
    assert with_change("payloads[0].mass_kg", 18e3).payloads[0].mass_kg == 18e3
    stiff = with_change("ropes[0].rope.axial_stiffness_n", 2.0, multiply=True)
    assert stiff.ropes[0].rope.axial_stiffness_n == 2 * SCENE.ropes[0].rope.axial_stiffness_n
    assert with_change("ropes[0].elements", 50.0).ropes[0].elements == 50
    assert with_change("ship.hang_off_m[2]", 10.0).ship.hang_off_m == (0.0, 0.0, 10.0)
    assert with_change("winch.schedule[*].speed_m_per_s", 0.5, True).winch.schedule[2].speed_m_per_s == -0.25  # type: ignore[union-attr] # fmt: skip # noqa: E501
    box = with_change("payloads[0].shape.box.height_m", 3.0).payloads[0].shape
    assert (box.length_m, box.height_m) == (4.0, 3.0)  # type: ignore[union-attr]


def test_effects_go_by_name_and_lists_entirely() -> None:
    current, *others = with_change("effects.current.profile[*][1][*]", 0.5, True).effects
    assert current.profile[:2] == ((0.0, (0.25, 0.0)), (-200.0, (0.175, 0.075)))
    assert tuple(others) == SCENE.effects[1:]
    changed = with_change("effects.drag.normal", 1.2).effects
    assert [type(effect) for effect in changed] == [type(effect) for effect in SCENE.effects]
    assert changed[2].normal == 1.2


def test_changes_add_up_and_show_in_the_digest() -> None:
    first, second = Change("payloads[0].mass_kg", 1e4), Change("payloads[0].mass_kg", 2.0, True)
    assert change_scene(SCENE, [first, second]).payloads[0].mass_kg == 2e4
    assert change_scene(SCENE, [second, first]).payloads[0].mass_kg == 1e4
    assert change_scene(SCENE, []) is SCENE
    digests = [change_scene(SCENE, some).digest for some in ([first], [second], [])]
    assert len(set(digests)) == 3
    assert change_scene(SCENE, [first]) == change_scene(SCENE, [first])
    assert str(second) == "payloads[0].mass_kg*=2"


@pytest.mark.parametrize(
    ("path", "value", "words"),
    [
        ("payload[0].mass_kg", 1.0, "payload: unknown key; did you mean 'payloads'?"),
        ("payloads[1].mass_kg", 1.0, "payloads: no entry [1]; the list has [0] to [0]"),
        ("payloads.mass_kg", 1.0, "payloads: 'mass_kg' is not a list index"),
        (
            "payloads[0]",
            1.0,
            "payloads[0]: it is not a number but has parts; continue with one of name",
        ),
        ("payloads[0].mass", 1.0, "payloads[0].mass: unknown key; did you mean 'mass_kg'?"),
        ("payloads[0].mass_kg", 1e9, "payloads[0].mass_kg: 1e+09 kg is out of range; give 0 to"),
        ("payloads[0].mass_kg", math.nan, "payloads[0].mass_kg: nan kg is not finite"),
        ("payloads[0].mass_kg.x", 1.0, "payloads[0].mass_kg: it has no parts; end the path here"),
        ("payloads[0].name", 1.0, "payloads[0].name: it is not a number; only numbers can be"),
        ("payloads[0].shape", 1.0, "payloads[0].shape: no name; continue with one of box"),
        ("payloads[0].shape.height_m", 1.0, "the scene has no 'height_m' here; known: box"),
        (
            "ropes[0].rope",
            1.0,
            "ropes[0].rope: it is not a number but has parts; continue with one of",
        ),
        ("ropes[0].elements", 50.5, "ropes[0].elements: 50.5 is not a whole number"),
        ("ropes[0].length_m", 5e3, "5000 m is outside the winch's 100 to 3200 m"),
        ("ropes[0].damping.newton_seconds", 1e5, "ropes[0].damping: two dampings are given"),
        ("ropes[0].fixed_at_m[0]", 1.0, "ropes[0].fixed_at_m: it has no parts"),
        ("effects", 1.0, "effects: it is not a number but has parts; continue with one of current"),
        ("effects[0].normal", 1.0, "effects: no name; continue with one of current, weight"),
        ("effects.drg.normal", 1.0, "effects: the scene has no 'drg' here; did you mean 'drag'?"),
        ("effects.drag.normal", 12.0, "effects.drag.normal: 12 is out of range; give 0 to 10"),
        ("effects.current.profile", 1.0, "it is a list; name one entry like [0], or [*] for all"),
        ("effects.current.profile[0][0]", -500.0, "z = -200 m follows z = -500 m; order rows"),
        ("winch.schedule[9].at_s", 1.0, "winch.schedule: no entry [9]; the list has [0] to [3]"),
        ("winch[0]", 1.0, "winch: it is not a list; name one of speed_limit_m_per_s"),
        ("", 1.0, "'' is not a path; write it like payloads[0].mass_kg"),
        (".ropes[0].length_m", 1.0, "'.ropes[0].length_m' is not a path"),
        ("ropes[-1].length_m", 1.0, "'ropes[-1].length_m' is not a path"),
        ("ropes[0] .length_m", 1.0, "'ropes[0] .length_m' is not a path"),
    ],
)
def test_invalid_changes_are_rejected(path: str, value: float, words: str) -> None:
    with pytest.raises(SceneError) as refused:
        with_change(path, value)
    message = str(refused.value)
    assert words in message
    assert message.startswith(str(SCENE.path))
    assert "\n" not in message


def test_a_number_that_a_scene_leaves_out() -> None:
    """A number that it does not give can be set but not multiplied; a part cannot appear."""
    given = with_change("time.newton_tolerance_n", 5.0)
    assert given.time.newton_tolerance_n == 5.0
    with pytest.raises(SceneError, match="newton_tolerance_n: the scene does not give it; set it"):
        with_change("time.newton_tolerance_n", 5.0, multiply=True)
    bare = change_scene(SCENE, []).__class__(**{**vars(SCENE), "winch": None})
    with pytest.raises(SceneError, match="winch: the scene has no winch; add it to the scene"):
        change_scene(bare, [Change("winch.speed_limit_m_per_s", 1.0)])

"""Costs and changes of effects: a payload's weight, missing data, and the report."""

from __future__ import annotations

import argparse
import json
import math
from dataclasses import replace
from typing import Any

import pytest

from rope_twin import load_scene
from rope_twin.cli import scene as command
from rope_twin.effects import EFFECTS
from rope_twin.effects.current import CurrentParams
from rope_twin.effects.drag import DragParams
from rope_twin.effects.payload import PayloadParams, SplashZoneParams
from rope_twin.effects.rope_mass import AddedMassParams, WeightParams
from rope_twin.effects.waves import RegularWave, WavesParams
from rope_twin.errors import RopeTwinError
from rope_twin.scene.schema import Scene
from rope_twin.studies import effect_cost
from rope_twin.studies.effect_cost import EffectRow, effect_table, measure_effects, suggested

BY_NAME = {effect.name: effect for effect in EFFECTS}


def bare(*effects: Any) -> Scene:
    scene = load_scene("still_water")
    line = replace(scene.ropes[0], elements=8, length_m=200.0)
    return replace(scene, ropes=(line,), effects=effects)


def test_a_payload_changes_the_tension_by_its_weight(monkeypatch: pytest.MonkeyPatch) -> None:
    """155.9 kN in still water, mean and maximum; a step costs something."""
    some = tuple(BY_NAME[name] for name in ("payload", "net"))
    monkeypatch.setattr(effect_cost, "EFFECTS", some)
    said = []
    still = CurrentParams(profile=((0.0, (0.0, 0.0)),))
    usual = (
        still,
        WeightParams(),
        DragParams(normal=1.2, tangential=0.02),
        AddedMassParams(normal=1.0),
    )
    scene = bare(*usual, PayloadParams())  # at rest in still water
    study = measure_effects(scene, 2.0, lambda *words: said.append(words))
    payload, net = study.rows
    weight = (20000.0 - 1025.0 * 4.0) * 9.80665
    assert study.as_it_is.us_per_step > 0.0
    assert payload.listed
    assert payload.mean_change_n == pytest.approx(weight, rel=1e-6)
    assert payload.max_change_n == pytest.approx(weight, rel=1e-6)
    assert payload.us_per_step is not None
    assert net.why_not == "it needs width_m (width of a panel), height_m (height of a panel)"
    assert net.us_per_step is None
    assert said[-1] == (4, 4, "done")
    lines = list(effect_table(study))
    assert lines[4].split()[:2] == ["payload", "yes"]
    assert lines[4].split()[3:5] == ["+155.93", "+155.93"]
    assert lines[5].endswith(net.why_not)


def test_what_the_scene_knows_is_taken_and_else_what_is_usual() -> None:
    """A solid rod's E·π·d⁴/64; the box of the payload; the depth that the waves have, or more."""
    scene = bare(WeightParams(), PayloadParams())
    assert suggested(BY_NAME["splash_zone"], scene).height_m == 2.5
    assert suggested(BY_NAME["added_mass"], scene).normal == 1.0
    assert suggested(BY_NAME["drag"], scene).normal == 1.2
    lowest = scene.ship.hang_off_m[2] - scene.winch.max_line_out_m
    assert suggested(BY_NAME["current"], scene).profile[-1] == (lowest, (0.1, 0.0))
    assert suggested(BY_NAME["seabed"], scene).depth_m == 10.0 - lowest
    rope = scene.ropes[0].rope
    modulus = rope.tangent_n(0.0) / (math.pi * rope.diameter_m**2 / 4)
    rod = modulus * math.pi * rope.diameter_m**4 / 64
    assert suggested(BY_NAME["bending"], scene).stiffness_n_m2 == pytest.approx(rod)
    box = scene.payloads[0].shape
    assert suggested(BY_NAME["rigid_body"], scene).size_m[2] == box.height_m
    assert suggested(BY_NAME["fairing"], scene).face_m2 == box.length_m * box.width_m
    waves = WavesParams(regular=RegularWave(height_m=2.0, period_s=8.0), depth_m=300.0)
    assert suggested(BY_NAME["seabed"], bare(waves)).depth_m == 300.0
    ashore = replace(scene, payloads=(replace(scene.payloads[0], shape=None),))
    assert suggested(BY_NAME["rigid_body"], ashore).startswith("it needs size_m")


def test_what_breaks_a_rule_is_not_run() -> None:
    with pytest.raises(RopeTwinError, match="corrects the loads of `payload`"):
        effect_cost._sound(bare(SplashZoneParams(height_m=2.5)))


def test_the_command_tells_it_as_json(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    row = EffectRow("current", False, "", None, None, None, "no data")
    study = effect_cost.EffectStudy(
        "still_water", 2.0, 50, 0.01, effect_cost.SceneRun(9.0, 2e5, 3e5), 0.1, (row,)
    )
    monkeypatch.setattr(command, "measure_effects", lambda *given: study)
    args = argparse.Namespace(action="measure", scene="still_water", duration=2.0, json=True)
    assert command.run(args) == 0
    reported = json.loads(capsys.readouterr().out)
    assert reported["as_it_is"] == {"us_per_step": 9.0, "mean_n": 2e5, "max_n": 3e5}
    assert reported["rows"][0]["why_not"] == "no data"
    assert reported["rows"][0]["us_per_step"] is None

"""Scenes with a VIV model: refusals, and the time step and mesh that it needs."""

from __future__ import annotations

import math
import re
from dataclasses import replace
from pathlib import Path

import pytest
from scene_text import GOOD

from rope_twin import load_scene
from rope_twin.cli import main
from rope_twin.effects.coupled_vibration import ModalVibrationParams
from rope_twin.effects.wake_oscillator import WakeOscillatorParams
from rope_twin.errors import SceneError
from rope_twin.scene.lift import lift_figures
from rope_twin.scene.rope_warnings import sense_checks
from rope_twin.scene.schema import Scene
from rope_twin.scene.vortex import expected_pace, vortex_words
from validation.rigs import Rig

CABLE = Rig(
    length=300.0, elements=400, mass=1.728, EA=5e6, diameter=0.02, density=1025.0, load=10.2e3,
    volume=0.0, current=((0.0, (1.5, 0.0)), (-300.0, (1.5, 0.0))), drag=(1.2, 0.0), added_mass=1.0,
    step=0.01,
)  # fmt: skip


def shedding(rig: Rig) -> Scene:
    scene = rig.scene()
    return replace(scene, effects=(*scene.effects, WakeOscillatorParams()))


def test_lock_in_frequency_and_wave_length_of_a_cable() -> None:
    """f = St·U/d; the shortest wave is that at the lower end, where tension is least."""
    scene = shedding(CABLE)
    pace = expected_pace(scene, lift_figures(scene))
    assert pace is not None
    assert pace.frequency_hz == pytest.approx(0.17 * 1.5 / 0.02)
    per_metre = 1.728 + 1025.0 * 0.25 * math.pi * 0.02**2
    wave = math.sqrt(10.2e3 * 9.80665 / per_metre) / pace.frequency_hz
    assert pace.element_m == pytest.approx(wave / 20.0, rel=0.01)
    assert pace.step_s == pytest.approx(1.0 / (200.0 * pace.frequency_hz))


def test_a_mesh_too_coarse_for_viv_is_reported_with_its_cost() -> None:
    (words,) = [words for words in sense_checks(shedding(CABLE)) if "vortices" in words]
    assert "lock-in at 12.8 Hz requires elements below 0.86 m and steps below 0.39 ms" in words
    assert "26 times slower than this scene without it" in words
    fine = shedding(replace(CABLE, elements=400, step=0.0003))
    assert not [words for words in sense_checks(fine) if "vortices" in words]
    still = replace(shedding(CABLE), effects=(WakeOscillatorParams(),))
    assert expected_pace(still, lift_figures(still)) is None
    assert expected_pace(CABLE.scene(), lift_figures(CABLE.scene())) is None


def test_a_run_reports_its_viv_requirements_once(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Fine or too coarse; it said both in two forms."""
    scene = load_scene("viv_calm").path.read_text(encoding="utf-8")
    path = tmp_path / "calm.yaml"
    for elements, reported in (("180", "this scene gives 1.11 m"), ("20", "elements of 10 m and")):
        path.write_text(scene.replace("elements: 180", f"elements: {elements}"), encoding="utf-8")
        assert main(["run", str(path), "--speed", "0", "--duration", "0.1", "--no-record"]) == 0
        message = capsys.readouterr().err
        assert message.count("lock-in at 2.65 Hz requires elements below 1.3 m") == 1
        assert reported in message


def test_two_models_in_one_scene_are_an_error(tmp_path: Path) -> None:
    """One sentence that names both."""
    both = "  - strouhal_forcing: {}\n  - wake_oscillator: {}\n  - drag:"
    text = GOOD.replace("  - drag:", both)
    path = tmp_path / "two.yaml"
    path.write_text(text, encoding="utf-8")
    words = "strouhal_forcing and wake_oscillator are models of the same vortex shedding; keep one"
    with pytest.raises(SceneError, match=words):
        load_scene(path)
    one = "  - wake_oscillator: {set: qu}\n  - drag:"
    path.write_text(GOOD.replace("  - drag:", one), encoding="utf-8")
    with pytest.raises(SceneError, match="unknown set 'qu'; known: qu_metrikine, "):
        load_scene(path)


def test_a_modal_viv_model_needs_no_mesh_and_one_drag(tmp_path: Path) -> None:
    """Its lock-in is reported, no scene is too coarse for it, and it is a model like the others."""
    scene = CABLE.scene()
    scene = replace(scene, effects=(*scene.effects, ModalVibrationParams()))
    words = vortex_words(scene, lift_figures(scene))
    assert words.startswith(
        "modal_vibration: lock-in at 12.8 Hz is computed decoupled from the step"
    )
    assert not [reported for reported in sense_checks(scene) if "vortices" in reported]
    path = tmp_path / "beside.yaml"
    for more, words in (
        ("  - decomposed_force: {}\n  - wake_oscillator: {}", "keep one of them"),
        ("  - modal_vibration: {}\n  - decomposed_force: {}", "keep one of them"),
        ("  - modal_vibration: {band: [7.0, 5.0]}", "band from 7 to 5; give the lower one first"),
    ):
        path.write_text(GOOD.replace("  - drag:", f"{more}\n  - drag:"), encoding="utf-8")
        with pytest.raises(SceneError, match=words):
            load_scene(path)
    spread = "  - decomposed_force: {}\n  - drag: {over_reynolds: [[1000.0, 1.2], [100000.0, 1.0]],"
    path.write_text(re.sub(r"  - drag: *\{", spread, GOOD), encoding="utf-8")
    with pytest.raises(SceneError, match="`decomposed_force` amplifies one drag coefficient"):
        load_scene(path)

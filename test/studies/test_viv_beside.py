"""`rope_twin viv A --compare B`: what it tells of two runs is what their nodes did."""

from __future__ import annotations

import json
import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from rope_twin import load_scene
from rope_twin.cli import main
from rope_twin.effects.current import CurrentParams
from rope_twin.errors import InputError, SceneError
from rope_twin.studies.viv.beside import Shaken, run_shaken


def swung(modulation: float) -> Shaken:
    """2 Hz in a standing half wave of 0.5 d, its size swelling by a part of itself at 1/8 Hz."""
    share, t = np.linspace(0.0, 1.0, 31), 0.04 * np.arange(4000)
    size = 0.5 * (1.0 + modulation * np.sin(2.0 * math.pi * t / 8.0))
    motion = np.outer(size * np.sin(4.0 * math.pi * t), np.sin(math.pi * share))
    return Shaken("made_up", "a formula", 0.04, share, t, motion, 1e4 + 0.0 * t)


def test_figures_of_a_standing_wave() -> None:
    """rms 0.5/√2 at the middle, 2 Hz; what swells has side bands at 2 ± 1/8 Hz."""
    steady, swelling = swung(0.0).figures(), swung(0.6).figures()
    assert steady.rms_max_diameters == pytest.approx(0.5 / math.sqrt(2.0), rel=1e-3)
    assert steady.rms_max_at_share == pytest.approx(0.5)
    assert steady.frequency_hz == pytest.approx(2.0, abs=1e-3)
    assert steady.swelling < 0.01
    assert swelling.frequency_hz == pytest.approx(2.0, abs=1e-3)
    # a carrier of power 1 with two side bands of (0.6/2)² each
    side = 2.0 * 0.3**2 / (1.0 + 2.0 * 0.3**2)
    assert swelling.bandwidth_hz == pytest.approx(0.125 * math.sqrt(side), rel=0.05)
    assert swelling.swelling > 0.3


def test_heave_widens_what_constant_tension_keeps_narrow(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """The pair for 48 s, three waves counted: the same mean tension, which moves in one."""
    words = ["viv", "viv_in_heave", "--compare", "viv_calm", "--duration", "48"]
    assert main([*words, "--out", str(tmp_path), "--json"]) == 0
    told = json.loads(capsys.readouterr().out)
    heave, calm = told["runs"]
    assert [heave["scene"], calm["scene"]] == ["viv_in_heave", "viv_calm"]
    assert heave["tension_mean_n"] == pytest.approx(calm["tension_mean_n"], rel=0.03)
    assert heave["tension_max_n"] - heave["tension_min_n"] > 20e3
    assert calm["tension_max_n"] - calm["tension_min_n"] < 2e3
    assert heave["bandwidth_hz"] > 1.5 * calm["bandwidth_hz"]
    assert 0.3 < calm["rms_max_diameters"] < 1.0
    assert Path(told["files"][0]).stat().st_size > 20_000


def test_a_model_beside_the_step_is_set_beside_another() -> None:
    """Its own motion, at its own pace; heave in the scene moves the tension."""
    run = run_shaken(load_scene("vortices_modal"), 10.0)
    told = run.figures()
    assert run.every_s == pytest.approx(0.01)
    assert told.tension_max_n - told.tension_min_n > 3e3
    assert 0.05 < told.rms_max_diameters < 1.0
    assert 1.0 < told.frequency_hz < 2.66


def test_fast_vortices_are_sampled_often_enough() -> None:
    """The pipe's shed at 4.7 Hz at most: at 25 Hz theirs would be five samples."""
    run = run_shaken(load_scene("curved_pipe"), 4.5)
    assert 8.0 <= 1.0 / (4.68 * run.every_s) < 9.0


def test_what_has_no_vortices_or_no_current_is_refused() -> None:
    with pytest.raises(SceneError, match="effects: it lists no model of vortices; list one"):
        run_shaken(load_scene("smooth_2km"), 1.0)
    calm = load_scene("viv_calm")
    with pytest.raises(InputError, match=r"7.5 s are too short for vortices of 2.65 Hz; give 8 or"):
        run_shaken(calm, 7.5)
    still = tuple(
        CurrentParams(profile=((0.0, (0.0, 0.0)),)) if isinstance(own, CurrentParams) else own
        for own in calm.effects
    )
    with pytest.raises(SceneError, match="no current at the surface, so no direction across it"):
        run_shaken(replace(calm, effects=still), 1.0)

"""`rope_twin viv` of multi-line scenes: against one rope, and against a taut string."""

from __future__ import annotations

import json
import math
from pathlib import Path

import numpy as np
import pytest
from parted_lift import whole_and_parted

from rope_twin.cli import main
from rope_twin.scene.load import load_scene
from rope_twin.studies.viv_frequency_domain import count_fatigue, run_frequency_domain, spans_of
from rope_twin.vortex.fatigue import StressCurve
from rope_twin.vortex.modes import ModeSearch
from rope_twin.vortex.shedding import Shedding

G = 9.80665


def test_a_rope_in_two_parts_is_one_line() -> None:
    """Its modes, response and damage are those of the rope."""
    runs = []
    for scene in whole_and_parted():
        (lying,) = spans_of(scene)
        run = run_frequency_domain(lying, Shedding(), 30.0)
        runs.append((run, count_fatigue(run, scene, StressCurve(3.4e14, 4.0))))
    (one, wear), (two, worn) = runs
    assert two.scene.ropes == (1, 0)
    assert two.response.frequency == pytest.approx(one.response.frequency, rel=1e-3)
    assert one.rms().max() > 0.05
    assert two.rms() == pytest.approx(one.rms(), abs=0.02 * one.rms().max())
    assert two.from_top_m == pytest.approx(one.from_top_m, abs=0.01)
    largest = np.nanmax(wear.damage_per_year)
    assert np.nanmax(worn.damage_per_year) == pytest.approx(largest, rel=0.1)


def test_a_leg_of_a_bridle_is_a_taut_string() -> None:
    """Take half of the weight below over the cosine of its slope, with both ends held."""
    scene = load_scene("bridle_lift")
    found = {scene.ropes[own.ropes[0]].name: own for own in spans_of(scene)}
    assert list(found) == [line.name for line in scene.ropes]
    assert found["hoist"].span.end_mass is None
    assert found["leg_port"].span.end_mass is None
    sling = found["sling_port"].span.end_mass
    assert sling is not None
    assert sling > 8000.0
    density = scene.environment.water_density_kg_per_m3
    steel = 1.0 - density / 7850.0
    rope = scene.ropes[1].rope
    assert rope is not None
    volume = 0.25 * math.pi * rope.hydrodynamic_diameter_m**2
    half = 8000.0 - 1.5 * density + (50.0 + 750.0) * steel  # load, end of the bar, half the bar
    half += 6.0 * (rope.mass_kg_per_m - density * volume)
    tension = half * G / math.cos(math.radians(30.0))
    for name in ("leg_port", "leg_starboard"):
        span = found[name].span
        assert span.tension[0] == pytest.approx(tension, rel=5e-3)
        mass = rope.mass_kg_per_m + density * volume
        expected = [k / (2.0 * 8.0) * math.sqrt(tension / mass) for k in (1, 2)]
        modes = ModeSearch(span, 1.1 * expected[1]).found()
        assert modes.frequency == pytest.approx(expected, rel=0.03)  # on eight elements


def test_the_command_shows_each_line(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    words = ["viv", "bridle_lift", "--duration"]
    assert main([*words, "10", "--json", "--out", str(tmp_path)]) == 0
    reported = json.loads(capsys.readouterr().out)
    names = [line.name for line in load_scene("bridle_lift").ropes]
    assert [row["line"] for row in reported["lines"]] == names
    assert all((tmp_path / name / "along.parquet").exists() for name in names)
    assert main([*words, "2"]) == 0
    shown = capsys.readouterr().out
    assert shown.count("maximum rms A/D") == 5
    assert "sling_port, places below its upper end:" in shown

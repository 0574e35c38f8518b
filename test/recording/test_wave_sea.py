"""A ship that rides on the scene's waves: the water's phases, and what a scene may not say."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

from rope_twin.effects.waves import RegularWave, WavesParams, components_of
from rope_twin.errors import SceneError
from rope_twin.recording.motion_source import WaveSea, open_sea, sea_of_waves
from rope_twin.scene.load import load_scene
from rope_twin.sea.ship_motion import BoxHull, heave_response

G = 9.80665


def test_a_long_wave_lifts_the_ship_as_it_lifts_the_water() -> None:
    """20 s and 30 m out at the hang-off: heave, its rate and the surface are the wave's own."""
    params = WavesParams(regular=RegularWave(height_m=2.0, period_s=30.0), heading_deg=50.0)
    waves = components_of(params, G)
    sea = WaveSea(waves, BoxHull(length_m=20.0, breadth_m=5.0, draught_m=0.5), 30.0, -10.0)
    time = np.linspace(0.0, 60.0, 601)
    z, v, eta = sea.at(time)
    assert np.abs(eta - waves.elevation_m(30.0, -10.0, time)).max() < 1e-12
    assert np.abs(z - eta).max() < 0.02
    assert np.abs(np.gradient(z, time)[1:-1] - v[1:-1]).max() < 1e-4


def test_the_response_is_the_hulls() -> None:
    """Amplitude and lag behind the surface at 9 s are those of `heave_response`."""
    params = WavesParams(regular=RegularWave(height_m=2.0, period_s=9.0))
    sea = WaveSea(components_of(params, G), BoxHull(), 0.0, 0.0)
    time = np.arange(900) * 0.01
    z, _, eta = sea.at(time)
    turn = np.exp(-2j * np.pi * time / 9.0)
    response = (z @ turn) / (eta @ turn)
    assert response == pytest.approx(complex(heave_response(BoxHull(), np.array([1 / 9]))[0]))


def test_stretches_join() -> None:
    """Samples every 50 ms, each once, whatever the stretches, and of the same bits."""
    sea = sea_of_waves(load_scene("wave_zone"))
    assert sea is not None
    whole = sea.between(-100_000_000, 1_000_000_000)
    edges = [-100_000_000, 333, *range(300_000_000, 1_000_000_001, 50_000_000)]
    parts = [sample for a, b in pairwise(edges) for sample in sea.between(a, b)]
    assert [sample.stamp_ns for sample in whole] == list(range(-100_000_000, 1_000_000_000, 50_000_000))  # fmt: skip # noqa: E501
    assert parts == whole
    opened = open_sea(load_scene("wave_zone"))
    assert opened is not None
    assert opened.between(0, 10**8) == sea.between(0, 10**8)


@pytest.mark.parametrize(
    ("old", "new", "sentence"),
    [
        ("sea_state: {on_waves: {}}", "sea_state: {on_waves: {}, bag: sea_1p2m}", "keep one of"),
        ("sea_state: {on_waves: {}}", "sea_state: {on_waves: {}, start_s: 3.0}", "`start_s` and"),
        ("      seed: 7\n", "      seed: 7\n      ramp_s: 9.0\n", "builds up in 9 s"),
        ("      seed: 7\n", "      regular: {height_m: 1.0, period_s: 8.0}\n", "2 sea states"),
        ("      jonswap: {significant_height_m: 2.5, peak_period_s: 8.5}\n",
         "      measured: {file: ndbc_46042_1996, column: 1996-10-16T01Z}\n", "did you mean"),
        ("components: 200", "components: 1", "2 to 2000"),
    ],
)  # fmt: skip
def test_what_it_may_not_be(tmp_path: Path, old: str, new: str, sentence: str) -> None:
    """One sentence each."""
    good = load_scene("wave_zone").path.read_text()
    assert old in good
    path = tmp_path / "scene.yaml"
    path.write_text(good.replace(old, new))
    with pytest.raises(SceneError, match=sentence) as caught:
        load_scene(path)
    assert "\n" not in str(caught.value)


def test_without_waves_there_is_nothing_to_ride_on(tmp_path: Path) -> None:
    """`on_waves` asks for the effect."""
    good = load_scene("shallow_lift").path.read_text()
    path = tmp_path / "scene.yaml"
    path.write_text(good.replace("{bag: sea_1p2m}", "{on_waves: {}}"))
    with pytest.raises(SceneError, match="add the effect `waves`"):
        load_scene(path)


def test_other_components_other_sea() -> None:
    """The seed picks the phases, the heading turns them; the same twice is the same."""
    params = next(own for own in load_scene("wave_zone").effects if isinstance(own, WavesParams))
    first, again = components_of(params, G), components_of(params, G)
    other = components_of(replace(params, seed=8), G)
    assert (first.phase == again.phase).all()
    assert not (first.phase == other.phase).any()

"""Learning a lift that lands and is lifted again: nothing is learned near the seabed."""

from __future__ import annotations

from functools import cache
from pathlib import Path

import numpy as np
import pytest
from learned_lift import NOISE_N, motion
from scipy.interpolate import PchipInterpolator
from small_scene import SMALL_SCENE

from rope_twin.errors import InputError
from rope_twin.estimation.estimator import Estimator, begin_at_rest
from rope_twin.estimation.figures import INDEX
from rope_twin.estimation.hanging import (
    CLEAR_OF_BED_M,
    CLEAR_OF_SURFACE_M,
    LEAN,
    hanging_of,
    open_water,
)
from rope_twin.estimation.measured_lift import FORGETTING_S, MeasuredLift
from rope_twin.scene.load import Change, change_scene, load_scene
from rope_twin.scene.schema import Scene
from rope_twin.twin.ensemble.fleet import Fleet, FleetInputs

TRUTH = {"submerged_weight": 0.05, "oscillating_mass": -0.1, "payload_drag": 0.25}
TIMES_S = 0.0, 150.0, 180.0, 240.0, 300.0, 360.0, 425.0
LINE_M = 390.0, 384.0, 384.0, 401.5, 401.5, 384.0, 384.0  # it stands on the bed at 400 m meanwhile
STEP_S = 0.05


@cache
def landing() -> Scene:
    """Return a load of 20 t above a bed in 400 m that rises by 2 % to the east."""
    return load_scene("landing")


@cache
def measured() -> MeasuredLift:
    """Return seven minutes of a rope with TRUTH."""
    t = STEP_S * np.arange(round(TIMES_S[-1] / STEP_S) + 1)
    z, v, _, _ = motion(t, waves=0.5)
    way = PchipInterpolator(TIMES_S, LINE_M)
    fleet = Fleet(landing(), 1, elements=20, step_s=STEP_S)
    fleet.set_figures({name: float(np.exp(value)) for name, value in TRUTH.items()})
    record = fleet.advance(FleetInputs(z, v, way(t), way(t, 1)), interval_steps=20)
    assert record.payload_depth_m.max() > 400.0
    made = MeasuredLift(NOISE_N)
    noise = NOISE_N * np.random.default_rng(3).standard_normal(len(t) - 1)
    made.heave.extend(t, z, v)
    made.line_out.extend(t, way(t))
    made.tension.extend(t[1:], record.top_tension_n[:, 0] + noise)
    return made


@cache
def learned() -> Estimator:
    """Return an estimator that has learned from all of it."""
    made = begin_at_rest(landing(), measured(), tared=True)
    made.run()
    return made


@pytest.mark.long
def test_a_lift_that_lands_is_learned_before_and_after() -> None:
    """Figures lie within 2.5 sd in each block, and those on the bed change nothing of them."""
    results = learned().results
    assert [round(one.end_s) for one in results] == [120, 180, 240, 300, 360, 420]
    for one in results:
        for name, value in TRUTH.items():
            k = INDEX[name]
            assert abs(one.posterior.mean[k] - value) < 2.5 * one.posterior.sd[k], (one.end_s, name)
    assert [one.near > 0.0 for one in results] == [False, False, True, True, True, False]
    on_bed = results[3]
    assert on_bed.used == 0.0
    assert on_bed.near == 1.0
    assert np.allclose(on_bed.posterior.mean, results[2].posterior.mean)
    assert results[-1].used > 0.9


@pytest.mark.long
def test_means_near_the_bed_are_left_out_until_the_rope_has_forgotten_it() -> None:
    """Left out is what ends within CLEAR_OF_BED_M of the bed, and half a minute after it."""
    model = learned().model
    state = model.begin_at_rest(0.0)
    prediction = model.predict(learned().theta, state, 0.0, 420.0)
    kept = model.in_open_water(prediction, 0.0, np.ones(420 * 4))
    times = 0.25 * np.arange(1, len(kept) + 1)
    out = times[np.isnan(kept)]
    assert 200.0 < out[0] < 240.0  # on the way down
    assert np.isfinite(kept[times < out[0]]).all()
    assert 320.0 < out[-1] - FORGETTING_S < 340.0  # half way up it hangs free
    assert len(out) == pytest.approx(4.0 * (out[-1] - out[0]), abs=2)


def test_open_water_lies_between_splash_zone_and_bed() -> None:
    """The slope counts over the reach of the payload; a scene with neither has no limits."""
    water = open_water(landing(), NOISE_N)
    assert water.min_m == -np.inf
    assert water.max_m == pytest.approx(400.0 - CLEAR_OF_BED_M - 0.02 * LEAN * 400.0)
    calm = change_scene(
        load_scene("splash_zone"), [Change("effects.waves.jonswap.significant_height_m", 0.01)]
    )
    wet = open_water(calm, NOISE_N)
    assert wet.min_m == CLEAR_OF_SURFACE_M + 1.25
    assert wet.max_m == np.inf
    deep = open_water(load_scene("deep_lift"), NOISE_N)
    assert not deep.without(np.array([-5.0, 5.0, 5000.0])).any()
    assert wet.without(np.array([-5.0, 11.0, 12.0])).tolist() == [True, True, False]


def test_open_water_lies_below_the_waves(tmp_path: Path) -> None:
    """A regular wave's force a·ω²·exp(-k·z)·M is 0.3 times the noise there, as an RMS value."""
    path = tmp_path / "wave.yaml"
    wave = "  - waves: {regular: {height_m: 2.0, period_s: 8.0}}\n"
    path.write_text(SMALL_SCENE.replace("effects:\n", f"effects:\n{wave}"))
    scene = load_scene(path)
    omega, noise_n = 2.0 * np.pi / 8.0, 500.0
    force_n = np.sqrt(0.5) * omega**2 * hanging_of(scene).mass_kg
    exact = np.log(force_n / (0.3 * noise_n)) * 9.80665 / omega**2
    assert open_water(scene, noise_n).min_m == pytest.approx(exact, rel=0.01)


def test_too_little_water_is_refused() -> None:
    """A module between waves that are felt at 40 m and a bed at 45 m is never in open water."""
    with pytest.raises(InputError, match=r"waves reach down to .* deeper water"):
        open_water(load_scene("two_line_landing"), NOISE_N)

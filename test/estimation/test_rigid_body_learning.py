"""Learning of a rigid body on slings, whose own waves the twin does not know."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from learned_lift import motion

from rope_twin.errors import InputError
from rope_twin.estimation.estimator import begin_at_rest
from rope_twin.estimation.figures import INDEX, check_learnable, scene_prior
from rope_twin.estimation.hanging import hanging_of, open_water
from rope_twin.estimation.measured_lift import MeasuredLift
from rope_twin.estimation.report import base_values, derived_mass_kg
from rope_twin.scene.instruments import Learning
from rope_twin.scene.load import Change, change_scene, load_scene
from rope_twin.scene.schema import Scene
from rope_twin.twin.ensemble.fleet import Fleet, FleetInputs

STEP_S, SECONDS, TRUTHS = 0.02, 185.0, 12
FIGURES = "submerged_weight", "oscillating_mass", "payload_drag", "axial_stiffness"
NORMAL_90 = 1.6448536269514722


@cache
def deep(seed: int = 7) -> Scene:
    """Return the manifold 160 m deep, high above the bed, in waves of a seed.

    The load pin has no friction and the motion sensor no delay.
    """
    known = Learning(
        friction_pct=0.0, friction_uncertainty_pct=0.001,
        heave_delay_s=0.0, heave_delay_uncertainty_s=0.001,
    )  # fmt: skip
    made = change_scene(
        load_scene("manifold_lift"),
        [
            Change("ropes[0].length_m", 200.0),
            Change("winch.max_line_out_m", 900.0),
            Change("effects.seabed.depth_m", 1000.0),
            Change("effects.waves.depth_m", 1000.0),
            Change("effects.waves.seed", float(seed)),
        ],
    )
    return replace(made, learning=known)


def test_a_rigid_body_hangs_on_the_rope_with_its_hook() -> None:
    """Weight, mass and drag along z are those of body and hook."""
    hanging, g = hanging_of(deep()), 9.80665
    hook = 1500.0
    weight = (60000.0 - 1025.0 * 9.0 + hook * (1.0 - 1025.0 / 7850.0)) * g
    assert hanging.weight_n == pytest.approx(weight)
    assert hanging.mass_kg == pytest.approx(60000.0 + hook + 240000.0)
    assert hanging.drag_kg_per_m == pytest.approx(0.5 * 1025.0 * 110.0)
    prior = scene_prior(deep()).gaussian
    found = derived_mass_kg(base_values(deep()), prior, deep())
    assert found["mass_in_air_kg"] == pytest.approx(60000.0 + hook)
    assert found["added_mass_kg"] == pytest.approx(240000.0)


def test_waves_that_move_a_rigid_body_are_kept_out() -> None:
    """A manifold above a bed at 45 m is moved by waves wherever it hangs."""
    check_learnable(deep())
    noise_n = scene_prior(deep()).pin_noise_n
    assert 40.0 < open_water(deep(), noise_n).min_m < 120.0
    with pytest.raises(InputError, match="deeper water"):
        open_water(load_scene("manifold_lift"), noise_n)


@pytest.mark.long
def test_figures_of_a_rigid_body_are_covered() -> None:
    """Truths drawn from the prior, in waves that the scene has otherwise: 90 % intervals hold."""
    prior = scene_prior(deep(), tared=True)
    rng = np.random.default_rng(11)
    places = [INDEX[name] for name in FIGURES]
    truths = rng.standard_normal((TRUTHS, len(FIGURES))) * prior.sd[places]
    t = STEP_S * np.arange(round(SECONDS / STEP_S) + 1)
    z, v, _, _ = motion(t, waves=0.5)
    speed = np.interp(t, [0.0, 60.0, 70.0, SECONDS], [0.0, 0.0, 0.3, 0.3])
    line = 200.0 + np.concatenate([[0.0], np.cumsum(0.5 * STEP_S * (speed[1:] + speed[:-1]))])
    fleet = Fleet(deep(99), TRUTHS, elements=20, step_s=STEP_S)
    fleet.set_figures({name: np.exp(truths[:, k]) for k, name in enumerate(FIGURES)})
    record = fleet.advance(FleetInputs(z, v, line, speed), interval_steps=50)
    assert not record.failures
    deviations = []
    for k in range(TRUTHS):
        lift = MeasuredLift(prior.pin_noise_n)
        noise = prior.pin_noise_n * rng.standard_normal(len(t) - 1)
        lift.heave.extend(t, z, v)
        lift.line_out.extend(t, line)
        lift.tension.extend(t[1:], record.top_tension_n[:, k] + noise)
        estimator = begin_at_rest(deep(), lift, tared=True)
        estimator.run()
        last = estimator.results[-1].posterior
        deviations.append((last.mean[places] - truths[k]) / last.sd[places])
        print(
            k,
            np.round(deviations[-1], 2),
            truths[k].round(3),
            last.sd[places].round(4),
            record.top_tension_n[:, k].min().round(),
            [(round(b.used, 2), round(b.nis, 2)) for b in estimator.results],
        )
    covered = float((np.abs(deviations) < NORMAL_90).mean())
    assert covered > 0.85
    assert np.abs(deviations).max() < 3.0

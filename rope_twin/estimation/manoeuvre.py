"""Learning manoeuvres: what a minute with another motion of the winch would tell.

The Jacobian of a planned line motion in the present sea is computed by the same lanes; with it the
posterior expected after the manoeuvre follows without a measurement.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator

import numpy as np

from rope_twin.core.state import Floats
from rope_twin.estimation.estimator import BLOCK_S, BURN_IN_S, Estimator
from rope_twin.estimation.figures import Gaussian
from rope_twin.estimation.gauss_newton import TEMPER, inverse
from rope_twin.estimation.measured_lift import LINE_HZ, MeasuredLift, Series
from rope_twin.scene.schema import Scene

MINUTES = 1  # that a manoeuvre takes
SLOW_SHARE = 0.5  # of the winch's speed limit, for the second speed
PAUSE_S = 5.0


def planned_lines(scene: Scene, line_out_m: float) -> Iterator[tuple[str, Floats, Floats]]:
    """Return words, times over burn-in and block [s] and line out [m] of each manoeuvre.

    Without a winch there is none. A motion that the winch's range of line out does not have space
    for is left out.
    """
    winch = scene.winch
    if winch is None:
        return
    t = np.arange(0.0, BURN_IN_S + BLOCK_S + 2.0, 1.0 / LINE_HZ)
    fast = winch.speed_limit_m_per_s
    slow = SLOW_SHARE * fast
    part = 0.5 * (BLOCK_S - 2.0 * PAUSE_S)
    down_s = part * 2.0 / (1.0 + fast / slow)  # equal ways at both speeds
    ways = (
        ("hold the line for a minute", ()),
        (
            f"pay out at {fast:g} m/s and haul at {slow:g} m/s in one minute",
            ((down_s, fast), (PAUSE_S, 0.0), (down_s * fast / slow, -slow)),
        ),
        (
            f"haul at {fast:g} m/s and pay out at {slow:g} m/s in one minute",
            ((down_s, -fast), (PAUSE_S, 0.0), (down_s * fast / slow, slow)),
        ),
    )
    for words, legs in ways:
        speed = np.zeros_like(t)
        at = BURN_IN_S
        for seconds, value in legs:
            speed[(t >= at) & (t < at + seconds)] = value
            at += seconds
        smooth = _limited(speed, winch.acceleration_limit_m_per_s2 / LINE_HZ)
        line = line_out_m + np.cumsum(smooth) / LINE_HZ
        if winch.least_line_out_m <= line.min() and line.max() <= winch.most_line_out_m:
            yield words, t, line


def _limited(speed: Floats, most: float) -> Floats:
    """Return the speed with at most this change from sample to sample."""
    made, now = np.empty_like(speed), 0.0
    for k, wanted in enumerate(speed):
        now += float(np.clip(wanted - now, -most, most))
        made[k] = now
    return made


def expected_after(estimator: Estimator, scene: Scene) -> list[tuple[str, Gaussian]]:
    """Return each manoeuvre in words with the Gaussian expected after it.

    The sea is that of the last two minutes. Empty if too little was measured, or if the scene has
    no winch. The estimator's own state stays as it is.

    Raises:
        SolverError: the rope cannot be stepped.
    """
    model, noise = estimator.model, estimator.noise
    heave = model.lift.heave.table
    span = BURN_IN_S + BLOCK_S + 2.0
    if noise is None or not estimator.results or heave[-1, 0] - heave[0, 0] < span:
        return []
    recent = heave[heave[:, 0] >= heave[-1, 0] - span]
    posterior = estimator.results[-1].posterior
    line_out = float(model.lift.line_motion(np.array([estimator.state_s]))[0][0])
    state = dataclasses.replace(estimator.state, time_ns=0)
    measured, found = model.lift, []
    ramp_begin_s, model.ramp_begin_s = model.ramp_begin_s, -np.inf  # the ship moves already
    try:
        for words, t, line in planned_lines(scene, line_out):
            planned = MeasuredLift(measured.pin_noise_n)
            planned.heave.extend(recent[:, 0] - recent[0, 0], *recent[:, 1:].T)
            planned.line_out = Series(1)
            planned.line_out.extend(t, line)
            model.lift = planned
            prediction = model.predict(posterior.mean, state, 0.0, BURN_IN_S + BLOCK_S)
            _, J = model.linearised(prediction, BURN_IN_S)
            R = noise.covariance(estimator.autocovariances(len(J), BURN_IN_S + BLOCK_S))
            gained = TEMPER * J.T @ np.linalg.solve(R, J)
            covariance = inverse(inverse(posterior.covariance) + gained)
            found.append((words, Gaussian(posterior.mean, covariance)))
    finally:
        model.lift, model.ramp_begin_s = measured, ramp_begin_s
    return found

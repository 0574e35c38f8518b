"""Quantities of a convergence study, and the difference between two runs in each of them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from rope_twin.scene.card import PEAK, RMS
from rope_twin.studies.accuracy.run import Series, Vector

STILL = 1e-4  # of the mean: a tension that varies by less is still, and the mean is the scale
TAUT_S = 0.5  # a rope that is taut for so long after it was slack has snapped


@dataclass(frozen=True)
class Quantity:
    """One quantity of a run."""

    name: str
    unit: str  # of the error
    words: str
    of: str  # what the error is told in parts of


QUANTITIES = (
    Quantity(RMS, "%", "top tension, rms", "std"),
    Quantity("tension_mean", "%", "its mean", "mean"),
    Quantity("tension_std", "%", "its standard deviation", "std"),
    Quantity(PEAK, "%", "its highest", "highest"),
    Quantity("tension_trough", "%", "its lowest", "std"),
    Quantity("snap_peak", "%", "mean of the snaps' peaks", "itself"),
    Quantity("payload_depth", "m", "payload's depth, rms", ""),
    Quantity("slack_share", "%", "share of time slack", "the time"),
)
BY_NAME = {quantity.name: quantity for quantity in QUANTITIES}
Values = dict[str, float | None]


def values(series: Series) -> Values:
    """Return the quantities of a run, SI; RMS differences have no value of their own."""
    tension = series.tension_n
    return {
        "tension_mean_n": float(tension.mean()),
        "tension_std_n": float(tension.std()),
        "tension_max_n": float(tension.max()),
        "tension_min_n": float(tension.min()),
        "snap_peak_n": snap_peak_n(series),
        "payload_depth_mean_m": float(series.depth_m.mean()),
        "slack_share": float(series.slack.mean()),
    }


def differences(series: Series, truth: Series) -> Values:
    """Return the differences to a run with the same or a shorter step, signed where applicable.

    In the units of QUANTITIES; None where there is nothing to compare.
    """
    mine, theirs = values(series), values(truth)
    every = round(series.step_s / truth.step_s)
    there = truth.tension_n[every - 1 :: every][: len(series.tension_n)]
    apart = series.tension_n[: len(there)] - there
    mean, scale = float(truth.tension_n.mean()), tension_scale(truth)
    return {
        RMS: 100.0 * _rms(apart) / scale,
        "tension_mean": _change(mine, theirs, "tension_mean_n", mean),
        "tension_std": _change(mine, theirs, "tension_std_n", scale),
        PEAK: _change(mine, theirs, "tension_max_n", theirs["tension_max_n"]),
        "tension_trough": _change(mine, theirs, "tension_min_n", scale),
        "snap_peak": _change(mine, theirs, "snap_peak_n", theirs["snap_peak_n"]),
        "payload_depth": _rms(series.depth_m - truth.depth_m),
        "slack_share": _change(mine, theirs, "slack_share", 1.0),
    }


def tension_scale(series: Series) -> float:
    """Return the standard deviation of the top tension, or its mean if it is constant."""
    mean, spread = float(series.tension_n.mean()), float(series.tension_n.std())
    return spread if spread > STILL * abs(mean) else mean


def snap_peak_n(series: Series) -> float | None:
    """Return the mean of the peak top tensions after slack (snap loads); None: no snap."""
    edges = np.flatnonzero(np.diff(np.concatenate([[True], series.slack, [True]])))
    every = round(series.look_s / series.step_s)
    peaks = [
        series.tension_n[begin * every : end * every].max()
        for begin, end in zip(edges[::2], edges[1::2], strict=True)
        if begin > 0 and (end - begin) * series.look_s >= TAUT_S
    ]
    return float(np.mean(peaks)) if peaks else None


def _change(mine: Values, theirs: Values, name: str, scale: float | None) -> float | None:
    one, other = mine[name], theirs[name]
    if one is None or other is None or not scale:
        return None
    return 100.0 * (one - other) / scale


def _rms(apart: Vector) -> float:
    return float(np.sqrt(np.mean(apart**2)))

"""Results of learning in the units of the field, and which causes can be distinguished.

A figure is *learned* where the data halved its standard deviation, *weak* where they reduced it by
a tenth, *not observable* where they did not.

A learning manoeuvre is a minute with another motion of the winch, and may tell more. The Jacobian
of a planned line motion in the present sea is computed by the same lanes; with it the posterior
expected after the manoeuvre follows without a measurement.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass, replace
from typing import Any

import numpy as np

from rope_twin.core import state as rows
from rope_twin.core.state import Floats
from rope_twin.effects.current import CurrentParams
from rope_twin.estimation.estimator import (
    BLOCK_S,
    BURN_IN_S,
    LEAST_USED,
    POOR_NIS,
    BlockResult,
    Estimator,
)
from rope_twin.estimation.figures import (
    NAMES,
    REPORTED,
    ROPE_FIGURES,
    Gaussian,
    Prior,
    names_of,
    unit_of,
)
from rope_twin.estimation.hanging import hanging_of
from rope_twin.estimation.least_squares import TEMPER, inverse
from rope_twin.estimation.measured_lift import (
    LINE_HZ,
    MEAN_S,
    SMOOTHING_LEAVES,
    MeasuredLift,
    Series,
)
from rope_twin.estimation.noise import Bar, bar_of
from rope_twin.messages.reports import figure_unit
from rope_twin.scene.schema import Scene

SLOW_SHARE = 0.5  # of the winch's speed limit, for the second speed
PAUSE_S = 5.0
# of the load pin's noise in a mean, that the rounding of a line counter may be: coverage is 93 % at
# 0.5, 76 % at 0.9 and 63 % at 1.8 (docs/explanation/learning.md)
COUNTER_SHARE = 0.7


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
            for winch, own in measured.others.items():  # all winches run alike
                planned.others[winch] = MeasuredLift(own.pin_noise_n)
                out = float(own.line_motion(np.array([estimator.state_s]))[0][0])
                planned.others[winch].line_out.extend(t, line - line_out + out)
            model.lift = planned
            prediction = model.predict(posterior.mean, state, 0.0, BURN_IN_S + BLOCK_S)
            if len(prediction.near_s):
                continue  # nothing is learned near surface or seabed, nor is it advised to go there
            _, J = model.linearised(prediction, BURN_IN_S)
            count = len(J) // len(model.pins)
            R = noise.covariance(estimator.autocovariances(count, BURN_IN_S + BLOCK_S))
            heard = [len(one.tension.table) > 0 for one in measured.ropes]
            known = np.repeat(heard, count)
            solved = np.linalg.solve(R[np.ix_(known, known)], J[known])
            gained = TEMPER * J[known].T @ solved
            covariance = inverse(inverse(posterior.covariance) + gained)
            found.append((words, Gaussian(posterior.mean, covariance)))
    finally:
        model.lift, model.ramp_begin_s = measured, ramp_begin_s
    return found


NORMAL_90 = 1.6448536269514722  # half width of a 90 % interval in standard deviations
LEARNED, WEAK, NOT_OBSERVABLE = "learned", "weak", "not observable"
AT_LIMIT = "at limit"  # of the prior: no figure of this lift, however small its interval
LEARNED_BELOW, WEAK_BELOW = 0.5, 0.9  # posterior over prior standard deviation
LEAST_CORRELATION = 0.5  # that is reported
LEAST_GAIN = 0.15  # an action is proposed if it narrows a figure by this share


@dataclass(frozen=True)
class FigureEstimate:
    """One figure: before and after the lift was measured."""

    name: str
    unit: str
    prior: float
    value: float
    low: float  # 90 % interval
    high: float
    prior_sd: float  # relative [-] for the scene's figures, in `unit` for the instruments
    sd: float
    state: str  # LEARNED, WEAK, NOT_OBSERVABLE or AT_LIMIT
    correlated: str = ""  # with which figure it is most correlated
    correlation: float = 0.0
    advice: str = ""  # what would tell more
    applied: float | None = None  # value that the run took over; None: none
    applied_off_sds: float | None = None  # by so many posterior sd from what is learned now


def base_values(scene: Scene) -> dict[str, float]:
    """Return the scene's own value of each figure, in `figure_unit`.

    Weight, mass and drag are those of the payload, of a bridle the sums over all that hangs below
    the rope from the winch, slings left out. Drag is Cd·A; tangential drag the force per metre over
    the squared speed. Of a rope of several sections they are those of the uppermost. A scene
    without a figure has 0.
    """
    hanging, bar = hanging_of(scene), bar_of(scene)
    rope = hanging.rope
    density = scene.environment.water_density_kg_per_m3
    return {
        "submerged_weight": hanging.weight_n,
        "oscillating_mass": hanging.mass_kg,
        "payload_drag": 2.0 * hanging.drag_kg_per_m / density if density else 0.0,
        "axial_stiffness": float(rope.sections[rows.EA, -1]),
        "axial_damping": float(rope.sections[rows.C, -1]),
        "tangential_drag": float(bar.drag_kg_per_m2[-1]),
        "current": 0.0 if scene.listed(CurrentParams) is None else 1.0,
    }


def disagreement(estimator: Estimator) -> str:
    """Return how far the last minute's tension is from that computed, if none was learned from.

    "": something was learned, or there was too little taut rope to compare.
    """
    last = estimator.innovation
    if last is None or estimator.share(np.isfinite(last.residual_n)) < LEAST_USED:
        return ""
    if (estimator.results[-1].posterior.sd < estimator.prior.sd * (1.0 - 1e-6)).any():
        return ""
    begin_s, end_s = last.time_s[0] - 0.5 * MEAN_S, last.time_s[-1] + 0.5 * MEAN_S
    measured, _ = estimator.model.lift.means_of_pins(float(begin_s), float(end_s))
    both = [float(np.nanmedian(one)) for one in (measured, measured - last.residual_n)]
    return f"nothing is learned from {both[0]:.4g} N where the scene has {both[1]:.4g} N"


def estimates(
    base: dict[str, float],
    prior: Prior,
    posterior: Gaussian,
    advice: dict[str, str] | None = None,
    held: Sequence[str] = (),
) -> tuple[FigureEstimate, ...]:
    """Return the estimates of all figures that the scene has.

    base: `base_values` of the scene; advice: by figure, what would tell more; held: figures at the
    limit of the prior.
    """
    found = []
    names = prior.names
    hidden = [names.index(name) for name in NAMES if name not in REPORTED]
    correlation = posterior.correlation - np.eye(len(names))
    correlation[:, hidden] = 0.0
    for k, name in enumerate(names):
        if k in hidden or (name in ROPE_FIGURES and not base[name]):
            continue
        mean, sd, before = posterior.mean[k], posterior.sd[k], prior.sd[k]
        ends = mean + np.array([-NORMAL_90, 0.0, NORMAL_90]) * sd
        start = float(prior.mean[k])
        if name in ROPE_FIGURES:
            ends, start = base[name] * np.exp(ends), base[name] * np.exp(start)
        ratio = sd / before
        state = LEARNED if ratio < LEARNED_BELOW else WEAK if ratio < WEAK_BELOW else NOT_OBSERVABLE
        state = AT_LIMIT if name in held else state
        other = int(np.abs(correlation[k]).argmax())
        tied = abs(correlation[k, other]) >= LEAST_CORRELATION
        found.append(
            FigureEstimate(
                name=name,
                unit=figure_unit(name),
                prior=float(start),
                value=float(ends[1]),
                low=float(ends[0]),
                high=float(ends[2]),
                prior_sd=float(before),
                sd=float(sd),
                state=state,
                correlated=names[other] if tied else "",
                correlation=float(correlation[k, other]) if tied else 0.0,
                advice=(advice or {}).get(name, ""),
            )
        )
    return tuple(found)


def score_applied(
    found: Sequence[FigureEstimate], base: dict[str, float], applied: dict[str, float]
) -> tuple[FigureEstimate, ...]:
    """Return the estimates with what a run took over, and how far that was off.

    base: `base_values` of the scene; applied: factors on them, by figure.
    """
    return tuple(
        replace(
            one,
            applied=base[one.name] * applied[one.name],
            applied_off_sds=float(np.log(base[one.name] * applied[one.name] / one.value)) / one.sd,
        )
        if one.name in applied
        else one
        for one in found
    )


def after_measurement(posterior: Gaussian, k: int, sd: float) -> Gaussian:
    """Return the posterior after an independent measurement of number k of θ with this uncertainty.

    It is the exact conditioning of the Gaussian; the mean stays, as the result is not known.
    """
    column = posterior.covariance[:, k]
    return replace(
        posterior,
        covariance=posterior.covariance
        - np.outer(column, column) / (posterior.covariance[k, k] + sd * sd),
    )


def best_actions(
    posterior: Gaussian, actions: Sequence[tuple[str, Gaussian]], names: Sequence[str] = NAMES
) -> dict[str, str]:
    """Return for each figure the action that narrows it most, in words with both uncertainties.

    actions: what could be done, and the Gaussian expected after it; names: of θ.
    """
    found = {}
    for k, name in enumerate(names):
        sd = posterior.sd[k]
        words, after = min(
            ((words, float(one.sd[k])) for words, one in actions),
            key=lambda pair: pair[1], default=("", float(sd)),
        )  # fmt: skip
        if after < (1.0 - LEAST_GAIN) * sd:
            found[name] = f"{words}: {_spread(name, sd)} to {_spread(name, after)}"
    return found


def tare_action(prior: Prior, posterior: Gaussian) -> tuple[str, Gaussian]:
    """Return the action of a tare with an empty hook, and the Gaussian expected after it."""
    for k, sd in prior.biases:
        posterior = after_measurement(posterior, k, sd)
    return "tare", posterior


def _spread(name: str, sd: float) -> str:
    """Return one standard deviation in words."""
    if name in ROPE_FIGURES or unit_of(name) == "-":
        return f"±{100.0 * sd:.2g} %"
    return f"±{sd:.3g} {unit_of(name)}"


def derived_mass_kg(base: dict[str, float], posterior: Gaussian, scene: Scene) -> dict[str, float]:
    """Return mass in air and vertical added mass [kg] that follow from weight and mass.

    No tension depends on the mass in air by itself: m = W/g + ρ·V with the scene's volume V, and
    the added mass is what is left of the oscillating mass. Of a bridle they are those of hook, bars
    and payloads together.
    """
    hanging = hanging_of(scene)
    if not hanging.bodies:
        return {}
    water = scene.environment
    displaced = hanging.air_kg - base["submerged_weight"] / water.gravity_m_per_s2
    factor = np.exp(posterior.mean[: len(ROPE_FIGURES)])
    air = base["submerged_weight"] * factor[0] / water.gravity_m_per_s2 + displaced
    return {
        "mass_in_air_kg": float(air),
        "added_mass_kg": float(base["oscillating_mass"] * factor[1] - air),
    }


def table(found: Sequence[FigureEstimate]) -> list[tuple[str, ...]]:
    """Return the rows of a table for people, with a head."""
    head = ("figure", "value", "90 % interval", "prior", "prior sd", "sd", "state",
            "correlated with", "what would tell more")  # fmt: skip
    scored = any(one.applied is not None for one in found)
    lines: list[tuple[str, ...]] = [(*head, "taken over in the run")] if scored else [head]
    for one in found:
        tied = f"{one.correlated} {one.correlation:+.2f}" if one.correlated else "-"
        lines.append((
            f"{one.name} [{one.unit}]", f"{one.value:.4g}", f"{one.low:.4g} to {one.high:.4g}",
            f"{one.prior:.4g}", _spread(one.name, one.prior_sd), _spread(one.name, one.sd),
            one.state, tied, one.advice or "-",
            *([_applied_words(one)] if scored else []),
        ))  # fmt: skip
    return lines


def _applied_words(one: FigureEstimate) -> str:
    if one.applied is None or one.applied_off_sds is None:
        return "-"
    inside = "inside" if one.low <= one.applied <= one.high else "outside"
    return f"{one.applied:.4g}, {inside} ({one.applied_off_sds:+.1f} sd)"


def held_words(held: Sequence[str]) -> str:
    """Return that figures are at the limit of the prior, in words; "": none is."""
    listed = ", ".join(held)
    return f"at the limit of 4 prior sd: {listed}; check scene, units and signs" if held else ""


def not_measured(lift: MeasuredLift) -> list[str]:
    """Return which of several load pins is not measured, in words; empty: none."""
    named = {"the main winch": lift, **lift.others}
    mute = [name for name, one in named.items() if not len(one.tension.table)]
    if not mute or len(mute) == len(named):
        return []
    return [f"no tension of {', '.join(mute)}: learned from the other load pins alone"]


def counter_words(bars: Sequence[Bar], lift: MeasuredLift, pin_noise_n: Floats) -> list[str]:
    """Return a remark on line counters too coarse for their ropes, in words; empty: none is.

    The rounding of a start or stop, as far as the smoothing leaves it, moves the tension of a rope
    by its stiffness EA/L. The hidden figures take most of it, but on a stiff rope not enough.

    Args:
        bars: ropes from the ship.
        lift: what was measured of them.
        pin_noise_n: standard deviation of a mean of each load pin, (pins,) [N].
    """
    left_n = np.array([
        float(np.sqrt(SMOOTHING_LEAVES / 12.0)) * own.line_resolution_m()
        / float((bar.length_m / bar.EA_n).sum())
        for bar, own in zip(bars, lift.ropes, strict=True)
    ])  # fmt: skip
    worst = int((left_n / pin_noise_n).argmax())
    if left_n[worst] <= COUNTER_SHARE * pin_noise_n[worst]:
        return []
    sizes = (
        f"{left_n[worst] * 1e-3:.2g} kN, the load pin's noise is {pin_noise_n[worst] * 1e-3:.2g} kN"
    )
    what = "the intervals of the rope's figures may be too narrow"
    return [f"the line counter is coarse for a rope so stiff (its rounding is {sizes}): {what}"]


def left_out_words(last: BlockResult) -> list[str]:
    """Return why shares of the last minute were left out, in words, and if too little was left."""
    found = []
    if last.near > 0.0:
        where = "payload near the surface or the seabed"
        found.append(f"{last.near:.0%} of the last minute left out: {where}")
    if last.stopped > 0.0:
        where = "the load pin at an end of its range"
        found.append(f"{last.stopped:.0%} of the last minute left out: {where}")
    if last.used < LEAST_USED and not found:
        most = f"{last.used:.0%} of the last minute compared, {LEAST_USED:.0%} are needed"
        rate = f"tension comes below {LEAST_USED / MEAN_S:g} Hz"
        found.append(f"{most}: a sensor is missing, {rate}, or the rope is slack")
    if last.nis >= POOR_NIS:
        times = f"{np.sqrt(last.nis):.2g} times what sensors and heave explain"
        what = "learned with noise that large; check clocks and scene"
        found.append(f"the last minute's tension is off by {times}, whatever the figures: {what}")
    return found


def as_json(
    found: Sequence[FigureEstimate],
    results: Sequence[BlockResult],
    derived: dict[str, float],
    winches: Sequence[str] = (),
) -> dict[str, Any]:
    """Return all results for `--json`: figures, derived values, load pins, and the blocks.

    winches: further ones, whose load pins follow that of the main one.
    """
    blocks = [
        {
            "end_s": one.end_s, "used": one.used, "near": one.near,
            "stopped": one.stopped,
            "nis": None if np.isnan(one.nis) else one.nis,
            "held": list(one.held), "used_of_pins": list(one.used_of_pins),
            "mean": one.posterior.mean.tolist(),
            "sd": one.posterior.sd.tolist(),
        }
        for one in results
    ]  # fmt: skip
    return {
        "figures": [asdict(one) for one in found],
        "derived": derived,
        "pins": ["winch", *winches],
        "parameters": list(names_of(winches)),
        "blocks": blocks,
    }


def history(results: Sequence[BlockResult]) -> tuple[Floats, Floats, Floats]:
    """Return end times [s] (blocks,), and mean and sd of θ after each block (blocks, figures)."""
    return (
        np.array([one.end_s for one in results]),
        np.array([one.posterior.mean for one in results]),
        np.array([one.posterior.sd for one in results]),
    )

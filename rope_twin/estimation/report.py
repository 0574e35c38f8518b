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
    MIN_USED,
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
    for name, legs in ways:
        speed = np.zeros_like(t)
        time_s = BURN_IN_S
        for seconds, value in legs:
            speed[(t >= time_s) & (t < time_s + seconds)] = value
            time_s += seconds
        smooth = _limited(speed, winch.acceleration_limit_m_per_s2 / LINE_HZ)
        line = line_out_m + np.cumsum(smooth) / LINE_HZ
        if winch.min_line_out_m <= line.min() and line.max() <= winch.max_line_out_m:
            yield name, t, line


def _limited(speed: Floats, largest: float) -> Floats:
    """Return the speed with at most this change from sample to sample."""
    limited, now = np.empty_like(speed), 0.0
    for k, value in enumerate(speed):
        now += float(np.clip(value - now, -largest, largest))
        limited[k] = now
    return limited


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
    measured, expected = model.lift, []
    ramp_begin_s, model.ramp_begin_s = model.ramp_begin_s, -np.inf  # the ship moves already
    try:
        for name, t, line in planned_lines(scene, line_out):
            planned = MeasuredLift(measured.pin_noise_n)
            planned.heave.extend(recent[:, 0] - recent[0, 0], *recent[:, 1:].T)
            planned.line_out = Series(1)
            planned.line_out.extend(t, line)
            for winch, winch_lift in measured.others.items():  # all winches run alike
                planned.others[winch] = MeasuredLift(winch_lift.pin_noise_n)
                line_out_m = float(winch_lift.line_motion(np.array([estimator.state_s]))[0][0])
                planned.others[winch].line_out.extend(t, line - line_out + line_out_m)
            model.lift = planned
            prediction = model.predict(posterior.mean, state, 0.0, BURN_IN_S + BLOCK_S)
            if len(prediction.near_s):
                continue  # nothing is learned near surface or seabed, nor is it advised to go there
            _, J = model.linearised(prediction, BURN_IN_S)
            count = len(J) // len(model.pins)
            R = noise.covariance(estimator.autocovariances(count, BURN_IN_S + BLOCK_S))
            pins = [len(rope.tension.table) > 0 for rope in measured.ropes]
            known = np.repeat(pins, count)
            solved = np.linalg.solve(R[np.ix_(known, known)], J[known])
            gained = TEMPER * J[known].T @ solved
            covariance = inverse(inverse(posterior.covariance) + gained)
            expected.append((name, Gaussian(posterior.mean, covariance)))
    finally:
        model.lift, model.ramp_begin_s = measured, ramp_begin_s
    return expected


NORMAL_90 = 1.6448536269514722  # half width of a 90 % interval in standard deviations
LEARNED, WEAK, NOT_OBSERVABLE = "learned", "weak", "not observable"
AT_LIMIT = "at limit"  # of the prior: no figure of this lift, however small its interval
LEARNED_BELOW, WEAK_BELOW = 0.5, 0.9  # posterior over prior standard deviation
MIN_CORRELATION = 0.5  # that is reported
MIN_GAIN = 0.15  # an action is proposed if it narrows a figure by this share


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
    if last is None or estimator.share(np.isfinite(last.residual_n)) < MIN_USED:
        return ""
    if (estimator.results[-1].posterior.sd < estimator.prior.sd * (1.0 - 1e-6)).any():
        return ""
    begin_s, end_s = last.time_s[0] - 0.5 * MEAN_S, last.time_s[-1] + 0.5 * MEAN_S
    measured, _ = estimator.model.lift.means_of_pins(float(begin_s), float(end_s))
    both = [float(np.nanmedian(tension_n)) for tension_n in (measured, measured - last.residual_n)]
    return f"nothing is learned from {both[0]:.4g} N where the scene has {both[1]:.4g} N"


def estimates(
    base: dict[str, float],
    prior: Prior,
    posterior: Gaussian,
    advice: dict[str, str] | None = None,
    at_limit: Sequence[str] = (),
) -> tuple[FigureEstimate, ...]:
    """Return the estimates of all figures that the scene has.

    base: `base_values` of the scene; advice: by figure, what would tell more; at_limit: those at
    the limit of the prior.
    """
    figures = []
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
        state = AT_LIMIT if name in at_limit else state
        correlated = int(np.abs(correlation[k]).argmax())
        tied = abs(correlation[k, correlated]) >= MIN_CORRELATION
        figures.append(
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
                correlated=names[correlated] if tied else "",
                correlation=float(correlation[k, correlated]) if tied else 0.0,
                advice=(advice or {}).get(name, ""),
            )
        )
    return tuple(figures)


def score_applied(
    figures: Sequence[FigureEstimate], base: dict[str, float], applied: dict[str, float]
) -> tuple[FigureEstimate, ...]:
    """Return the estimates with what a run took over, and how far that was off.

    base: `base_values` of the scene; applied: factors on them, by figure.
    """
    return tuple(
        replace(
            figure,
            applied=base[figure.name] * applied[figure.name],
            applied_off_sds=float(np.log(base[figure.name] * applied[figure.name] / figure.value))
            / figure.sd,
        )
        if figure.name in applied
        else figure
        for figure in figures
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
    advice = {}
    for k, name in enumerate(names):
        sd = posterior.sd[k]
        words, after = min(
            ((words, float(belief.sd[k])) for words, belief in actions),
            key=lambda pair: pair[1], default=("", float(sd)),
        )  # fmt: skip
        if after < (1.0 - MIN_GAIN) * sd:
            advice[name] = f"{words}: {_spread(name, sd)} to {_spread(name, after)}"
    return advice


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


def table(figures: Sequence[FigureEstimate]) -> list[tuple[str, ...]]:
    """Return the rows of a table for people, with a head."""
    head = ("figure", "value", "90 % interval", "prior", "prior sd", "sd", "state",
            "correlated with", "what would tell more")  # fmt: skip
    scored = any(figure.applied is not None for figure in figures)
    lines: list[tuple[str, ...]] = [(*head, "taken over in the run")] if scored else [head]
    for figure in figures:
        tied = f"{figure.correlated} {figure.correlation:+.2f}" if figure.correlated else "-"
        lines.append((
            f"{figure.name} [{figure.unit}]", f"{figure.value:.4g}",
            f"{figure.low:.4g} to {figure.high:.4g}", f"{figure.prior:.4g}",
            _spread(figure.name, figure.prior_sd), _spread(figure.name, figure.sd), figure.state,
            tied, figure.advice or "-", *([_applied_words(figure)] if scored else []),
        ))  # fmt: skip
    return lines


def _applied_words(figure: FigureEstimate) -> str:
    if figure.applied is None or figure.applied_off_sds is None:
        return "-"
    inside = "inside" if figure.low <= figure.applied <= figure.high else "outside"
    return f"{figure.applied:.4g}, {inside} ({figure.applied_off_sds:+.1f} sd)"


def limit_words(at_limit: Sequence[str]) -> str:
    """Return that figures are at the limit of the prior, in words; "": none is."""
    listed = ", ".join(at_limit)
    return f"at the limit of 4 prior sd: {listed}; check scene, units and signs" if at_limit else ""


def not_measured(lift: MeasuredLift) -> list[str]:
    """Return which of several load pins is not measured, in words; empty: none."""
    named = {"the main winch": lift, **lift.others}
    mute = [name for name, rope in named.items() if not len(rope.tension.table)]
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
        float(np.sqrt(SMOOTHING_LEAVES / 12.0)) * rope_lift.line_resolution_m()
        / float((bar.length_m / bar.EA_n).sum())
        for bar, rope_lift in zip(bars, lift.ropes, strict=True)
    ])  # fmt: skip
    coarsest = int((left_n / pin_noise_n).argmax())
    if left_n[coarsest] <= COUNTER_SHARE * pin_noise_n[coarsest]:
        return []
    left_kn, noise_kn = left_n[coarsest] * 1e-3, pin_noise_n[coarsest] * 1e-3
    sizes = f"{left_kn:.2g} kN, the load pin's noise is {noise_kn:.2g} kN"
    effect = "the intervals of the rope's figures may be too narrow"
    return [f"the line counter is coarse for a rope so stiff (its rounding is {sizes}): {effect}"]


def left_out_words(last: BlockResult) -> list[str]:
    """Return why shares of the last minute were left out, in words, and if too little was left."""
    remarks = []
    if last.near > 0.0:
        where = "payload near the surface or the seabed"
        remarks.append(f"{last.near:.0%} of the last minute left out: {where}")
    if last.stopped > 0.0:
        where = "the load pin at an end of its range"
        remarks.append(f"{last.stopped:.0%} of the last minute left out: {where}")
    if last.used < MIN_USED and not remarks:
        compared = f"{last.used:.0%} of the last minute compared, {MIN_USED:.0%} are needed"
        rate = f"tension comes below {MIN_USED / MEAN_S:g} Hz"
        remarks.append(f"{compared}: a sensor is missing, {rate}, or the rope is slack")
    if last.nis >= POOR_NIS:
        times = f"{np.sqrt(last.nis):.2g} times what sensors and heave explain"
        effect = "learned with noise that large; check clocks and scene"
        remarks.append(
            f"the last minute's tension is off by {times}, whatever the figures: {effect}"
        )
    return remarks


def as_json(
    figures: Sequence[FigureEstimate],
    results: Sequence[BlockResult],
    derived: dict[str, float],
    winches: Sequence[str] = (),
) -> dict[str, Any]:
    """Return all results for `--json`: figures, derived values, load pins, and the blocks.

    winches: further ones, whose load pins follow that of the main one.
    """
    blocks = [
        {
            "end_s": result.end_s, "used": result.used, "near": result.near,
            "stopped": result.stopped,
            "nis": None if np.isnan(result.nis) else result.nis,
            "held": list(result.at_limit), "used_of_pins": list(result.used_of_pins),
            "mean": result.posterior.mean.tolist(),
            "sd": result.posterior.sd.tolist(),
        }
        for result in results
    ]  # fmt: skip
    return {
        "figures": [asdict(figure) for figure in figures],
        "derived": derived,
        "pins": ["winch", *winches],
        "parameters": list(names_of(winches)),
        "blocks": blocks,
    }

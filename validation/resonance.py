"""P12: forced heave of rope and payload over the depth, through resonance, while rope is paid out.

Closed form of a uniform rod with an end mass M' and a damping c linear in the strain rate, whose
top moves as a·e^(iωt): E = EA + iωc, x = ω·L·√(m/E), μ = M'/(m·L); the payload moves by
a/(cos x - μ·x·sin x), the tension at the top is a·(E·x/L)·(sin x + μ·x·cos x)/(cos x - μ·x·sin x).
Without damping both are infinite where x·tan x = m·L/M'. Weight and static stretch do not enter.
"""

from __future__ import annotations

import cmath
import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.optimize import brentq

from rope_twin.scene.schema import Winch
from rope_twin.studies.driven_twin import march
from rope_twin.studies.picture import Line, Panel, Vector
from validation.case import Case, Finding, Found, limited, shown, within, within_pct
from validation.rigs import Rig, faded, sine
from validation.vibration import MOVING, STEEL

PERIOD_S, HEAVE_M = 9.0, 0.5
OMEGA = 2.0 * math.pi / PERIOD_S
LOSS = 0.1  # ω·c/EA
FIRST_M = 1000.0
DEPTHS_M = (FIRST_M, 2000.0, 2600.0, 2750.0, 2900.0, 3500.0)
BETWEEN = slice(2, 5)  # the depths between which resonance is looked for
FADED, WAITED, FITTED = 3, 36, 4  # periods: of heave's build-up, then at each depth
PAYOUT_M_PER_S, GAIN_M_PER_S2 = 5.0, 0.1
EVERY = 10
TOLERANCE_PCT = 0.05
RIG = replace(
    STEEL, length=FIRST_M, elements=40, load=100e3, volume=10.0, added=(1e3, 1e3, 50e3),
    density=1025.0, step=0.025, damping=LOSS * STEEL.EA / OMEGA,
    winch=Winch(
        speed_limit_m_per_s=PAYOUT_M_PER_S, acceleration_limit_m_per_s2=GAIN_M_PER_S2,
        min_line_out_m=FIRST_M, max_line_out_m=4000.0,
    ),
)  # fmt: skip


@dataclass(frozen=True)
class Response:
    """Complex amplitudes per metre of heave at one depth."""

    depth: float  # paid-out length [m]
    payload: complex  # [m/m]
    tension: complex  # at the hang-off [N/m]


def closed_form(rig: Rig, omega: float, length: float) -> Response:
    """Return the response of the rod with its end mass."""
    E = rig.EA + 1j * omega * rig.damping
    x = omega * cmath.sqrt(rig.mass / E) * length
    share = MOVING / (rig.mass * length)
    below = cmath.cos(x) - share * x * cmath.sin(x)
    pull = E * x / length * (cmath.sin(x) + share * x * cmath.cos(x))
    return Response(length, 1.0 / below, pull / below)


def respond(depths: Sequence[float]) -> list[Response]:
    """Heave one twin without pause and pay out from depth to depth; its response at each."""
    speeds, windows = [], []
    time, length = 0.0, FIRST_M
    for depth in depths:
        if depth > length:
            speed = min(PAYOUT_M_PER_S, math.sqrt(GAIN_M_PER_S2 * (depth - length)))
            constant_s = (depth - length) / speed
            speeds += [(time, speed), (time + constant_s, 0.0)]
            time += constant_s + speed / GAIN_M_PER_S2
        windows.append((time + WAITED * PERIOD_S, time + (WAITED + FITTED) * PERIOD_S))
        time, length = windows[-1][1] + 1.0, depth
    heave = faded(sine(HEAVE_M, PERIOD_S), FADED * PERIOD_S)
    snapshots = march(RIG.twin(), heave, time, EVERY, speeds)
    rows = np.array(
        [(s.time_s, s.line_out_m, s.payload_position_m[2], s.tension_top_n) for s in snapshots]
    )
    return [_fit(rows[(rows[:, 0] > begin) & (rows[:, 0] <= end)]) for begin, end in windows]


def _fit(rows: Vector) -> Response:
    """Fit mean, sine and cosine to payload and tension."""
    angle = OMEGA * rows[:, 0]
    parts = np.stack([np.sin(angle), np.cos(angle), np.ones_like(angle)], axis=1)
    fitted = np.linalg.lstsq(parts, rows[:, 2:], rcond=None)[0]
    payload, tension = (complex(*column[:2]) / HEAVE_M for column in fitted.T)
    return Response(float(rows[:, 1].mean()), payload, tension)


def _resonance(responses: Sequence[Response]) -> float:
    """Return the depth at which the payload lags the heave by 90°: 1/H is a parabola there."""
    depth = [response.depth for response in responses]
    real = np.polyfit(
        depth, [(1.0 / response.payload).real for response in responses], len(responses) - 1
    )
    return float(brentq(lambda x: np.polyval(real, x), depth[0], depth[-1]))


def _heaved(depths: Sequence[float] = DEPTHS_M) -> Found:
    responses = respond(depths)
    exact = [closed_form(RIG, OMEGA, response.depth) for response in responses]
    findings: list[Finding] = []
    for ours, known in zip(responses, exact, strict=True):
        name = f"{ours.depth:.0f} m"
        findings += [
            within_pct(f"{name}: payload's motion over heave", abs(ours.payload),
                       abs(known.payload), TOLERANCE_PCT),
            within_pct(f"{name}: dynamic tension per metre of heave", abs(ours.tension),
                       abs(known.tension), TOLERANCE_PCT, "N"),
            limited(f"{name}: phase of the payload off",
                    abs(math.degrees(cmath.phase(ours.payload / known.payload))), 0.05, "°"),
        ]  # fmt: skip
    if len(responses) == len(DEPTHS_M):
        findings += _at_resonance(responses)
    return Found(tuple(findings), _panels(responses), NOTES)


def _at_resonance(responses: Sequence[Response]) -> list[Finding]:
    def lag(depth: float) -> float:
        return (1.0 / closed_form(RIG, OMEGA, depth).payload).real

    depths = [response.depth for response in responses[BETWEEN]]
    exact = float(brentq(lag, depths[0], depths[-1]))
    wave = OMEGA * math.sqrt(RIG.mass / RIG.EA)
    ours = _resonance(responses[BETWEEN])
    undamped = float(
        brentq(lambda L: wave * L * math.tan(wave * L) - RIG.mass * L / MOVING, *depths[::2])
    )
    return [
        within_pct("depth of resonance, payload 90° behind", ours, exact, TOLERANCE_PCT, "m"),
        within("the same against x·tan x = m·L/M', undamped", ours, undamped, 0.01 * undamped, "m"),
        shown("motion of the payload at most, over heave",
              max(abs(response.payload) for response in responses), "infinite without damping"),
    ]  # fmt: skip


def _panels(responses: Sequence[Response]) -> tuple[Panel, ...]:
    fine = np.linspace(0.9 * FIRST_M, 1.05 * max(DEPTHS_M), 300)
    exact = [closed_form(RIG, OMEGA, depth) for depth in fine]
    depth = [response.depth for response in responses]
    return (
        Panel("payload, heave of 9 s", "line out [m]", "motion over heave",
              (Line(fine, [abs(response.payload) for response in exact], "closed form"),
               Line(depth, [abs(response.payload) for response in responses], "ours", "ko"))),
        Panel("hang-off", "line out [m]", "dynamic tension per heave [kN/m]",
              (Line(fine, [1e-3 * abs(response.tension) for response in exact], "closed form"),
               Line(depth, [1e-3 * abs(response.tension) for response in responses], "ours",
                    "ko"))),
    )  # fmt: skip


NOTES = (
    "One twin: it heaves throughout and pays out from one depth to the next, with elements born at "
    "the hang-off; at each depth it waits until what the payout has stirred up has faded. The "
    "damping is linear in the strain rate, 5 % of critical at this period.",
)

CASES = (
    Case("P12", "resonance of rope and payload over the depth, 150 t on 76 mm steel wire",
         "closed form, rod with end mass", _heaved, 20.0, lambda: _heaved(DEPTHS_M[:1])),
)  # fmt: skip

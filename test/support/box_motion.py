"""Six-degree-of-freedom motion RAOs of a box-like hull in waves, for conceptual design.

Heave and pitch: closed-form expressions of Jensen, Mansour and Olsen (2004, Ocean Engineering 31,
61-85) at zero speed, with the effective wave number k_e = k·|cos β| along the hull; see
sea/ship_motion.py for the equation of motion and its simplifications. Pitch has the moment G =
κ·f·(24/((k_e·L)²·L))·(sin(k_e·L/2) - (k_e·L/2)·cos(k_e·L/2)) in place of the force F, which in long
waves is the slope k_e. Roll: one degree of freedom driven by the transverse wave slope, with a
natural period and damping. Surge, sway and yaw: the motion of the water averaged over the hull
(Froude-Krylov for a body with the mass of the displaced water).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from rope_twin.sea.rao_files import AMPLITUDES, COLUMNS, PHASES
from rope_twin.sea.raos import Answers, Responses
from rope_twin.sea.ship_motion import BoxHull
from rope_twin.sea.tables import Vector

GRAVITY_M_PER_S2 = 9.80665


@dataclass(frozen=True)
class Roll:
    """Roll natural period and damping: assumptions, as ships differ."""

    period_s: float = 11.0
    damping: float = 0.1  # damping ratio


def box_responses(
    hull: BoxHull, heading_deg: Vector, frequency_hz: Vector, roll: Roll | None = None
) -> Responses:
    """Return RAOs amidships for headings (h,) from 0 to 180° and frequencies (f,) above 0."""
    roll = roll or Roll()
    beta = np.radians(heading_deg)[:, None]
    omega = 2.0 * np.pi * frequency_hz[None, :]
    k = omega**2 / GRAVITY_M_PER_S2
    along, across = k * np.cos(beta), k * np.sin(beta)
    length, breadth = hull.length_m, hull.breadth_m
    kb = k * breadth * hull.block_coefficient
    damping = (2.0 * np.sin(0.5 * kb) * np.exp(-k * hull.draught_m)) ** 2 / kb
    f = np.sqrt((1.0 - k * hull.draught_m) ** 2 + damping**2)
    own = np.exp(-k * hull.draught_m) * f / (1.0 - 2.0 * k * hull.draught_m + 1j * damping)
    mean = _mean(0.5 * along * length) * _mean(0.5 * across * breadth)
    water = np.exp(-0.5 * k * hull.draught_m) * mean
    slope = _slope(along, length)
    r = omega * roll.period_s / (2.0 * np.pi)
    turn = -1j * across * mean * np.exp(-0.5 * k * hull.draught_m)
    answer: Answers = np.stack(
        [
            -1j * np.cos(beta) * water,
            -1j * np.sin(beta) * water,
            own * _mean(0.5 * along * length),
            turn / (1.0 - r * r + 2j * roll.damping * r),
            1j * own * slope,
            -np.sin(beta) * slope * np.exp(-0.5 * k * hull.draught_m),
        ]
    )
    words = (
        f"box of {length:g} m x {breadth:g} m x {hull.draught_m:g} m, block coefficient "
        f"{hull.block_coefficient:g}, rolling at {roll.period_s:g} s, damped {roll.damping:g} of "
        "critical"
    )
    return Responses(np.asarray(heading_deg), np.asarray(frequency_hz), answer, words)


def _mean(y: Vector) -> Vector:
    """Return the mean of cos over -y to y: sin(y)/y."""
    return np.asarray(np.sinc(y / np.pi))


def _slope(along: Vector, length: float) -> Vector:
    """Return the mean slope of a straight keel in a wave: `along` in long waves [1/m]."""
    y = 0.5 * along * length
    safe = np.where(np.abs(y) < 1e-3, 1.0, y)
    share = np.where(np.abs(y) < 1e-3, 1.0, 3.0 * (np.sin(safe) - safe * np.cos(safe)) / safe**3)
    return np.asarray(along * share)


def table_of(responses: Responses) -> str:
    """Return the table as text that `read_responses` reads."""
    lines = [f"# Responses of a {responses.source}", "# made by test/support/box_motion.py"]
    lines.append(",".join(COLUMNS))
    size, phase = np.abs(responses.answer), np.degrees(np.angle(responses.answer))
    size[3:] = np.degrees(size[3:])
    for i, heading in enumerate(responses.heading_deg):
        for j, frequency in enumerate(responses.frequency_hz):
            cells = [f"{heading:g}", f"{frequency:.4f}"]
            cells += [f"{value:.5g}" for value in size[:, i, j]]
            cells += [f"{value:.2f}" for value in phase[:, i, j]]
            lines.append(",".join(cells))
    assert len(AMPLITUDES) == len(PHASES) == len(size)
    return "\n".join(lines) + "\n"

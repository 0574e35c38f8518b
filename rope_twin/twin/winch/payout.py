"""Payout of a winch, and the tension feedback that it needs from its rope.

Tension feedback is the expected response of the rope to a change of pay-out speed within one step.
The tension is that of the last step. Over the next one the node below the hang-off continues with
its velocity, and responds to the change like the uppermost node of an endless chain of masses m·l
and springs k in one step h of the implicit Euler rule. Such a chain has at its end the stiffness

    D = (√(μ² + 4·k·μ) - μ)/2,   μ = m·l/h²,

which is k for long elements and √(EA·m)/h, the impedance over the step, for short ones. A drum that
uses F - h·D·(V' - parting) as the next tension is stable as long as the rope's true response is
less than twice that, and the step is shorter than half the time L/c that a wave takes along the
rope (otherwise its lower end responds within a step, which an endless chain does not). The reported
tension also includes the acceleration of the half element at the hang-off, which follows the payout
at once: for the drum that half element is inertia. Rope is counted unstretched, so V takes up V
times the stretch of the separation.
"""

from __future__ import annotations

import math
from math import sqrt
from typing import NamedTuple

import numpy as np

from rope_twin.core import state as rows
from rope_twin.core.state import Floats, Rope
from rope_twin.scene.schema import RopeLine


class Payout(NamedTuple):
    """Payout and its rate at one instant."""

    length_m: float
    speed_m_per_s: float  # + pays out


class LineTarget(NamedTuple):
    """Target speed of the line, and the lengths within which it must be able to stop."""

    speed_m_per_s: float
    low_m: float
    high_m: float


class TensionFeedback(NamedTuple):
    """Tension feedback: the rope at the end of the last step and its expected response.

    Its tension at the next step's end is free - hold·(V' - parting) - brace·(V' - V), with V and V'
    the pay-out speeds before and after that step.
    """

    pull_n: float  # tension at the hang-off
    free_n: float  # the same at a constant pay-out speed
    depth_m: float  # of its lower end below mean water level, less the heave of the hang-off
    separation_m_per_s: float  # separation rate of hang-off and the node below it, over the step
    hold: float  # response of the elastic rope [N·s/m]
    brace: float  # response of its damping and of the half element at the hang-off [N·s/m]

    def at_speed(self, V: float) -> float:
        """Return the tension at a zero pay-out speed after this one [N]."""
        return self.free_n + self.hold * self.separation_m_per_s + self.brace * V


class SpooledRope(NamedTuple):
    """Properties of the rope on a winch that its commands and its drum depend on."""

    diameter_m: float  # on the drum
    stretch: float  # maximum stretched over unstretched length, at break
    hang_off_m: float  # mean height of the hang-off above the mean water level


UNKNOWN_ROPE = SpooledRope(0.0, math.inf, 0.0)


class WinchStep(NamedTuple):
    """One time step of a winch."""

    begin_ns: int
    step_s: float
    heave_m_per_s: float  # velocity of the hang-off, up, at the step's end
    feedback: TensionFeedback | None  # tension feedback, if a component or command needs it


class HangOffMotion(NamedTuple):
    """Motion of a hang-off and its winch at the beginning of a step."""

    heave_m: float  # above its mean position
    payout_m_per_s2: float  # acceleration of the payout


def tension_feedback(
    rope: Rope, line: RopeLine, pull_n: float, border: Floats, course: HangOffMotion
) -> TensionFeedback:
    """Return the tension feedback of a rope to its winch.

    Args:
        rope: with the state at the end of the last step.
        line: its definition in the scene.
        pull_n: its tension at the hang-off then [N].
        border: hang-off at the beginning and end of the next step, (2, rows.MOTIONS) [m].
        course: motion of hang-off and winch at the beginning.
    """
    state, h = rope.state, rope.model.step
    n = int(state.counts[rows.ELEMENTS])
    places = state.nodes[rows.POSITION : rows.POSITION + 3]
    depth = course.heave_m - float(places[2, 0])
    way = places[:, n] - places[:, n - 1]
    long = float(np.linalg.norm(way))
    moved = (border[1, : rows.LINE] - border[0, : rows.LINE]) / h
    velocity = state.nodes[rows.VELOCITY : rows.VELOCITY + 3, n - 1]
    rest = float(state.s[n] - state.s[n - 1])
    stretch = long / rest
    parting = float(way @ (moved - velocity)) / (long * stretch)
    section = int(np.searchsorted(rope.sections[rows.END], 0.5 * (state.s[n] + state.s[n - 1])))
    mass = float(rope.sections[rows.PER_METRE, section]) * rest
    free = pull_n + 0.5 * mass * stretch * course.payout_m_per_s2
    if pull_n <= 0.0:
        return TensionFeedback(pull_n, free, depth, parting, 0.0, 0.5 * mass * stretch / h)
    stiffness = line.made_of[section].rope.dynamic_n(pull_n) / rest
    damping = float(rope.sections[rows.C, section]) / rest
    both, mu = stiffness + damping / h, mass / (h * h)
    share = 0.5 * stretch * (sqrt(mu * mu + 4.0 * both * mu) - mu) / both
    brace = share * damping + 0.5 * mass * stretch / h
    return TensionFeedback(pull_n, free, depth, parting, share * stiffness * h, brace)

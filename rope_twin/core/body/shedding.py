"""Vortices shed by a rigid body: a transverse force at its Strouhal frequency.

As of a payload that is a point (effects/payload_shedding.py), with the projected area of the body's
box across the flow, Σ a_k·|w_k|/|w| with its faces a_k, and the vertical n in place of the rope's
tangent: F = ½·ρ·C_L·(Σ a_k·|w_k|)·sin φ·(w × n) at the reference point of added mass and drag, for
the water's velocity w relative to it; a partly submerged body has its submerged share of it.

φ is that of the substep's start plus its rate, the mean of both ends, times the time since: of
second order. It is kept beside the records (core/body/state.py), in columns that only such a body
has.
"""

from __future__ import annotations

from math import cos, sin, sqrt
from typing import Any, NamedTuple

import numpy as np

from rope_twin.core.body import state as at
from rope_twin.core.body.change import NONE, add_change, moment_change
from rope_twin.core.body.parts import part
from rope_twin.core.body.rotation import along, cross, dot, inward, vector
from rope_twin.core.guards import SPEED2_MIN
from rope_twin.core.jit.decorators import jit_within
from rope_twin.core.state import Floats

PHASE, TIME, RATE = at.RECORD, at.RECORD + 1, at.RECORD + 2  # columns of a record
# Entries of the stage: explicit part of φ, factor on its rate [s], time; φ and rate when last
# evaluated.
HAT, WEIGHT, NOW, PHASE_NOW, RATE_NOW = range(at.STAGE, at.STAGE + 5)
OWN_COLUMNS, OWN_ENTRIES = 3, 5
UNKNOWN = -1.0  # marks the rate before the first stage


class Shedding(NamedTuple):
    """Component: the vortices of a body."""

    k: float  # ½·ρ·C_L [kg/m³]
    turns: float  # 2π·St/D [1/m]
    x: float  # faces normal to the body's axes [m²]
    y: float
    z: float


@part("foresee", Shedding)
def foresee(part: Any, body: Any, rope: Any, stage: Any, pose: Any) -> None:
    """Set the explicit part of φ; it is 0 in static equilibrium, whose time is 0."""
    s, record = body.stage, body.records[int(body.memory[0, 0])]
    if s[at.FRESH] > 0.0:
        record[PHASE], record[TIME], record[RATE] = 0.0, stage.time, UNKNOWN
    passed = stage.time - record[TIME]
    known = record[RATE] != UNKNOWN
    s[NOW] = stage.time
    s[WEIGHT] = 0.5 * passed if known else passed
    s[HAT] = record[PHASE] + (0.5 * passed * record[RATE] if known else 0.0)


@jit_within
def _sign(x: float) -> float:
    return 1.0 if x > 0.0 else -1.0


@part("act", Shedding)
def act(part: Any, body: Any, q: float, pose: Any) -> Any:
    """Return the force and its moment in body axes; subtract q times their derivatives."""
    _, R, v, spin = pose
    s, n = body.stage, R[2]
    h = along(vector(body.watered, 0), 1.0, vector(s, at.WET_ARM))
    against = inward(R, along(v, -1.0, vector(s, at.FLOW_NOW)))
    w = along(NONE, -1.0, along(against, 1.0, cross(spin, h)))
    speed = sqrt(dot(w, w) + SPEED2_MIN)
    s[RATE_NOW] = part.turns * speed
    s[PHASE_NOW] = s[HAT] + s[WEIGHT] * s[RATE_NOW]
    wave, slope = sin(s[PHASE_NOW]), cos(s[PHASE_NOW])
    side = cross(w, n)
    signs = part.x * _sign(w[0]), part.y * _sign(w[1]), part.z * _sign(w[2])
    faces, k = dot(signs, w), s[at.WET] * part.k
    f = along(NONE, k * faces * wave, side)
    for i in range(6):
        row = body.changes[i]
        psi, dspin = vector(row, at.D_TURN), vector(row, at.D_SPIN)
        dc = along(vector(row, at.D_SPEED), -1.0, cross(psi, against))
        dw = along(NONE, -1.0, along(dc, 1.0, cross(dspin, h)))
        turned = s[WEIGHT] * part.turns * dot(w, dw) / speed
        df = along(NONE, k * (dot(signs, dw) * wave + faces * slope * turned), side)
        dside = along(cross(dw, n), 1.0, cross(w, cross(n, psi)))
        df = along(along(df, k * faces * wave, dside), 1.0, cross(psi, f))
        add_change(body, i, -q, df, moment_change(h, df, cross(psi, h), f))
    return f, cross(h, f), sqrt(dot(f, f))


@part("keep", Shedding)
def keep(part: Any, body: Any, record: Any) -> None:
    """Store φ of the converged stage in the record of the body's motion."""
    s = body.stage
    record[PHASE], record[TIME], record[RATE] = s[PHASE_NOW], s[NOW], s[RATE_NOW]


@part("power", Shedding)
def power(part: Shedding, body: Any, pose: Any) -> float:
    """Return the power of the force [W]."""
    now = body.records[int(body.memory[0, 0])]
    h: Floats = body.watered + now[at.ARM_THEN : at.ARM_THEN + 3]
    u = now[at.WATER : at.WATER + 3]
    w = (u - pose.velocity) @ pose.turn - np.cross(pose.spin, h)
    faces = np.abs(w) @ np.array([part.x, part.y, part.z])
    force = now[at.WET_THEN] * part.k * faces * np.sin(now[PHASE]) * np.cross(w, pose.turn[2])
    return float(force @ pose.turn.T @ pose.speed(h))

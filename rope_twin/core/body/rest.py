"""Where a rigid body rests below a hook that holds still, in the water that flows there.

Its six equations F = 0, M = 0 are followed in a time of their own: implicit Euler steps of a body
without mass but with drag, whose step grows as the forces fall (pseudo-transient continuation,
Kelley and Keyes 1998, SIAM J. Numer. Anal. 35, 508). So it comes to rest where it would by itself,
and ends with Newton's speed. It turns freely about the vertical if nothing but the hook holds it.
"""

from __future__ import annotations

from math import cos, nan, sin, sqrt
from typing import Any

from rope_twin.core.body.balance import ROUND_OFF, eliminate
from rope_twin.core.body.change import NONE, unit
from rope_twin.core.body.loads import loads, pull_of
from rope_twin.core.body.parts import highest_floor
from rope_twin.core.body.rotation import along, dot, matrix_of, outward, put, turned, vector
from rope_twin.core.body.state import (
    ARM_HELD,
    FLOW_GROWS,
    FLOW_NOW,
    FROZEN,
    HOOK,
    LENGTH,
    MISS,
    RECORD,
    SHARE,
    STIFFNESS,
    WET,
    WET_ARM,
    WET_HELD,
    V,
    X,
)
from rope_twin.core.body.state import Q as ATTITUDE
from rope_twin.core.jit import jit

ROUNDS, BISECTIONS = 400, 60
RESTS = 1e-12  # of the weight: a force that counts as none
NUDGE = 1e-6  # of the reach, for slopes
FARTHEST = 0.2  # of the reach, and radians, in one round
FIRST, LEAST = 1.0, 1e-4  # drag over weight and reach
SOFT, STIFFER = 0.02, 10.0  # slings' first stretch, and how much stiffer they get each time
TINY_WEIGHT = 1e-3  # N, of what weighs nothing


@jit
def _lift(body: Any, drop: float) -> float:
    """What the slings of an upright body lift whose G is so far below the hook [N]."""
    total = 0.0
    for j in range(body.legs.shape[0]):
        r = vector(body.legs[j], 0)
        found = pull_of(body.legs[j], body.stage[SHARE], (-r[0], -r[1], drop - r[2]), NONE)
        total += found[0][2]
    return total


@jit
def _drop(body: Any) -> float:
    """How far G hangs below the hook, about: the slings lift the weight in water."""
    low, high = 0.0, 1.0
    for j in range(body.legs.shape[0]):
        leg = body.legs[j]
        high = max(
            high, leg[LENGTH] + body.reach + 1.0 + body.W / (body.stage[SHARE] * leg[STIFFNESS])
        )
    for _ in range(BISECTIONS):
        middle = 0.5 * (low + high)
        if _lift(body, middle) < body.W:
            low = middle
        else:
            high = middle
    return high


@jit
def _forces(body: Any, place: Any, attitude: Any) -> Any:
    """Force and moment in body axes."""
    pose = (place, matrix_of(attitude), NONE, NONE)
    return loads(body, 1.0, pose, (vector(body.stage, HOOK), NONE), (NONE, NONE))


@jit
def _moved(place: Any, attitude: Any, change: Any, turn: Any) -> Any:
    """Place and attitude after a change in body axes."""
    return along(place, 1.0, outward(matrix_of(attitude), change)), turned(attitude, turn)


@jit
def _take_slopes(body: Any, place: Any, attitude: Any, found: Any) -> None:
    """-dF/d(place, turn) into the matrix, the forces into its last column."""
    # `loads` clears the matrix that these go into: they wait in a record that nobody uses yet
    spare, (f, t) = body.records, found
    for k in range(6):
        size = NUDGE * body.reach if k < 3 else NUDGE
        change, turn = unit(k, size), unit(k - 3, size)
        there, so = _moved(place, attitude, change, turn)
        force, twist = _forces(body, there, so)
        row = spare[1 + k // 3]
        put(row, 6 * (k % 3), along((0.0, 0.0, 0.0), -1.0 / size, along(force, -1.0, f)))
        put(row, 6 * (k % 3) + 3, along((0.0, 0.0, 0.0), -1.0 / size, along(twist, -1.0, t)))
    for k in range(6):
        row = spare[1 + k // 3]
        for i in range(6):
            body.matrix[i, k] = row[6 * (k % 3) + i]
    for i in range(3):
        body.matrix[i, MISS] = f[i]
        body.matrix[3 + i, MISS] = t[i]


@jit
def _step(body: Any, drag: float) -> Any:
    """Change of place and turn in one round, at most as far as a round may go."""
    A = body.matrix
    for k in range(3):
        A[k, k] += drag / body.reach
        A[3 + k, 3 + k] += drag * body.reach
    eliminate(A)
    change, turn = (A[0, MISS], A[1, MISS], A[2, MISS]), (A[3, MISS], A[4, MISS], A[5, MISS])
    far = max(sqrt(dot(change, change)) / body.reach, sqrt(dot(turn, turn)))
    share = min(1.0, FARTHEST / (far + 1e-300))
    return along(NONE, share, change), along(NONE, share, turn)


@jit
def _miss(body: Any, found: Any) -> float:
    """Size of forces and moments [N]."""
    f, t = found
    return float(sqrt(dot(f, f)) + sqrt(dot(t, t)) / body.reach)


@jit
def _relax(body: Any, place: Any, attitude: Any, weight: float) -> Any:
    """Place and attitude of rest, and whether they are."""
    blur = ROUND_OFF * (body.reach + sqrt(dot(place, place))) * body.stiffness
    drag, enough = FIRST * weight, RESTS * weight + blur
    found = _forces(body, place, attitude)
    miss = _miss(body, found)
    for _ in range(ROUNDS):
        if not miss > enough:
            break
        _take_slopes(body, place, attitude, found)
        change, turn = _step(body, drag)
        there, so = _moved(place, attitude, change, turn)
        after = _forces(body, there, so)
        last, miss = miss, _miss(body, after)
        if not miss < 2.0 * last + 0.1 * weight:  # too far: slings are stiff where it swings
            drag, miss = 10.0 * drag, last
            continue
        place, attitude, found = there, so, after
        drag = max(drag * (min(miss / last, 0.5) if miss < last else 2.0), LEAST * weight)
    return place, attitude, miss <= enough


@jit
def _first_place(body: Any, hook: Any) -> Any:
    """Upright below the hook, or on what carries it there if that is higher."""
    place, lowest = along(hook, -_drop(body), (0.0, 0.0, 1.0)), 0.0
    for j in range(body.corners.shape[0]):
        lowest = min(lowest, body.corners[j, 2])
    return hook[0], hook[1], highest_floor(body.parts, body, place, place[2] + lowest) - lowest


@jit
def put_to_rest(body: Any, hook: Any) -> None:
    """Record 0 is the body at rest below the hook; not finite if it finds no rest.

    The stage tells the water, and the deck's height, in which it begins. Slings are soft at first,
    so that they give while the body finds its attitude, then ten times stiffer and so on until
    they are themselves.
    """
    s, record = body.stage, body.records[0]
    put(s, FROZEN, vector(s, FLOW_NOW))
    put(s, FLOW_GROWS, NONE)
    put(s, ARM_HELD, vector(s, WET_ARM))
    s[WET_HELD] = s[WET]
    put(s, HOOK, hook)
    weight = (body.m + body.displaced) * body.g + TINY_WEIGHT
    long = body.reach
    for j in range(body.legs.shape[0]):
        long = max(long, body.legs[j, LENGTH])
    s[SHARE] = min(1.0, weight / (SOFT * long * body.stiffness))
    half = 0.5 * body.heading
    place, attitude = _first_place(body, hook), (0.0, 0.0, sin(half), cos(half))
    place, attitude, rests = _relax(body, place, attitude, weight)
    while s[SHARE] < 1.0:
        s[SHARE] = min(1.0, STIFFER * s[SHARE])
        place, attitude, rests = _relax(body, place, attitude, weight)
    for k in range(RECORD):
        record[k] = 0.0
    put(record, X, place)
    for k in range(4):
        record[ATTITUDE + k] = attitude[k]
    put(record, V, NONE if rests else (nan, nan, nan))

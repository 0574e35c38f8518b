"""Where a rigid body rests below a hook that holds still, in the water that flows there.

Its six equations F = 0, M = 0 are followed in a time of their own: implicit Euler steps of a body
without mass but with drag, whose step grows as the forces fall (pseudo-transient continuation,
Kelley and Keyes 1998, SIAM J. Numer. Anal. 35, 508). So it comes to rest where it would by itself,
and ends with Newton's speed. It turns freely about the vertical if nothing but the hook holds it.

Without friction a body on a slope, or on the bed in a current, rests only where its slings end its
slide. Where that is far from below the hook, friction is asked whether it holds the body there: at
rest the regularised friction (core/body/contact.py) is that of a creep V, so what is sought is a
body that creeps steadily. V is taken as (x - x_0)·v_0/d_0 along the ground, x_0 the place below the
hook: a spring that yields where friction does. Water and hook go with it: they feel no motion.
"""

from __future__ import annotations

from math import atan, cos, nan, sin, sqrt
from typing import Any

from rope_twin.core.body.balance import ROUND_OFF, eliminate
from rope_twin.core.body.change import NONE, unit
from rope_twin.core.body.contact import CREEP
from rope_twin.core.body.loads import loads, pull_of
from rope_twin.core.body.parts import highest_floor
from rope_twin.core.body.rotation import along, dot, inward, matrix_of, outward, put, turned, vector
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
from rope_twin.core.guards import NONE_AT_ALL
from rope_twin.core.jit.decorators import jit

ROUNDS, BISECTIONS = 400, 60
RESTS = 1e-12  # of the weight: a force that counts as none
NUDGE = 1e-6  # of the reach, for slopes
FARTHEST = 0.2  # of the reach, and radians, in one round
FIRST, LEAST = 1.0, 1e-4  # drag over weight and reach
SOFT, STIFFER = 0.02, 10.0  # slings' first stretch, and how much stiffer they get each time
TINY_WEIGHT = 1e-3  # N, of what weighs nothing
NEAR = 0.25  # of the reach: as far as a body may slide from below the hook to rest
YIELDS = 0.1  # d_0 of the reach
FASTEST = 10.0 * CREEP  # friction that holds gives its last 0.5 % here [m/s]
SHORT = 1e-3  # for a slope of the ground [m]
RUBS = 1e-9  # of the weight: friction that counts
FAR_DOWN = -1e300


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
def creep_of(body: Any, place: Any, held: Any) -> Any:
    """Velocity along the ground of a body that is this far from where friction held it.

    held: that place, v_0/d_0, 0 without friction, and how far the body may go.
    """
    start, rate, _ = held
    if not rate > 0.0:
        return NONE
    x, y = rate * (place[0] - start[0]), rate * (place[1] - start[1])
    _, east, north = _ground(body, place)
    return x, y, east * x + north * y


@jit
def _forces_at(body: Any, place: Any, attitude: Any, creep: Any) -> Any:
    """Force and moment in body axes, of a body that creeps with water and hook over the ground."""
    s, flow, frozen = body.stage, vector(body.stage, FLOW_NOW), vector(body.stage, FROZEN)
    put(s, FLOW_NOW, along(flow, 1.0, creep))
    put(s, FROZEN, along(frozen, 1.0, creep))
    pose = (place, matrix_of(attitude), creep, NONE)
    found = loads(body, 1.0, pose, (vector(s, HOOK), creep), (NONE, NONE))
    put(s, FLOW_NOW, flow)
    put(s, FROZEN, frozen)
    return found


@jit
def _forces(body: Any, place: Any, attitude: Any, held: Any) -> Any:
    """Force and moment in body axes."""
    return _forces_at(body, place, attitude, creep_of(body, place, held))


@jit
def _moved(place: Any, attitude: Any, change: Any, turn: Any) -> Any:
    """Place and attitude after a change in body axes."""
    return along(place, 1.0, outward(matrix_of(attitude), change)), turned(attitude, turn)


@jit
def _take_slopes(body: Any, place: Any, attitude: Any, found: Any, held: Any) -> None:
    """-dF/d(place, turn) into the matrix, the forces into its last column."""
    # `loads` clears the matrix that these go into: they wait in a record that nobody uses yet
    spare, (f, t) = body.records, found
    for k in range(6):
        size = NUDGE * body.reach if k < 3 else NUDGE
        change, turn = unit(k, size), unit(k - 3, size)
        there, so = _moved(place, attitude, change, turn)
        force, twist = _forces(body, there, so, held)
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
    share = min(1.0, FARTHEST / (far + NONE_AT_ALL))
    return along(NONE, share, change), along(NONE, share, turn)


@jit
def _miss(body: Any, found: Any) -> float:
    """Size of forces and moments [N]."""
    f, t = found
    return float(sqrt(dot(f, f)) + sqrt(dot(t, t)) / body.reach)


@jit
def _is_near(place: Any, held: Any) -> bool:
    """Whether a body is as near to where it was put as it has to be."""
    start, _, far = held
    x, y = place[0] - start[0], place[1] - start[1]
    return bool(sqrt(x * x + y * y) <= far)


@jit
def _relax(body: Any, start: Any, weight: float, held: Any) -> Any:
    """Place and attitude of rest, and whether they are; the search ends where it goes too far."""
    place, attitude = start
    blur = ROUND_OFF * (body.reach + sqrt(dot(place, place))) * body.stiffness
    drag, enough = FIRST * weight, RESTS * weight + blur
    found = _forces(body, place, attitude, held)
    miss = _miss(body, found)
    for _ in range(ROUNDS):
        if not (miss > enough and _is_near(place, held)):
            break
        _take_slopes(body, place, attitude, found, held)
        change, turn = _step(body, drag)
        there, so = _moved(place, attitude, change, turn)
        after = _forces(body, there, so, held)
        last, miss = miss, _miss(body, after)
        if not miss < 2.0 * last + 0.1 * weight:  # too far: slings are stiff where it swings
            drag, miss = 10.0 * drag, last
            continue
        place, attitude, found = there, so, after
        drag = max(drag * (min(miss / last, 0.5) if miss < last else 2.0), LEAST * weight)
    return place, attitude, miss <= enough and _is_near(place, held)


@jit
def _ground(body: Any, place: Any) -> Any:
    """Height of what would carry the body below a place, and its slopes, east and north."""
    low = highest_floor(body.parts, body, place, FAR_DOWN)
    east = highest_floor(body.parts, body, along(place, SHORT, (1.0, 0.0, 0.0)), FAR_DOWN)
    north = highest_floor(body.parts, body, along(place, SHORT, (0.0, 1.0, 0.0)), FAR_DOWN)
    return low, (east - low) / SHORT, (north - low) / SHORT


@jit
def _start(body: Any, hook: Any) -> Any:
    """Place and attitude: upright below the hook, or flat on what carries it if that is higher."""
    place, lowest = along(hook, -_drop(body), (0.0, 0.0, 1.0)), 0.0
    for j in range(body.corners.shape[0]):
        lowest = min(lowest, body.corners[j, 2])
    half = 0.5 * body.heading
    attitude = (0.0, 0.0, sin(half), cos(half))
    low, east, north = _ground(body, place)
    steep = sqrt(east * east + north * north)
    if not low > place[2] + lowest:
        return place, attitude
    if steep > 0.0:
        lean = along(NONE, atan(steep) / steep, (north, -east, 0.0))
        attitude = turned(attitude, inward(matrix_of(attitude), lean))
    return (hook[0], hook[1], low - lowest * sqrt(1.0 + steep * steep)), attitude


@jit
def _softest(body: Any, weight: float) -> float:
    """The share of the slings' stiffness to begin with."""
    long = body.reach
    for j in range(body.legs.shape[0]):
        long = max(long, body.legs[j, LENGTH])
    return float(min(1.0, weight / (SOFT * long * body.stiffness)))


@jit
def _settle(body: Any, start: Any, weight: float, held: Any) -> Any:
    """Place and attitude of rest, and whether they are.

    Slings are soft at first, so that they give while the body finds its attitude, then ten times
    stiffer and so on until they are themselves.
    """
    s = body.stage
    s[SHARE] = _softest(body, weight)
    found = _relax(body, start, weight, held)
    while s[SHARE] < 1.0 and _is_near(found[0], held):
        s[SHARE] = min(1.0, STIFFER * s[SHARE])
        found = _relax(body, (found[0], found[1]), weight, held)
    s[SHARE] = 1.0
    return found


@jit
def _rest_of(body: Any, start: Any, weight: float) -> Any:
    """Place, attitude and creep of rest, and whether they are."""
    below, forever = start[0], -FAR_DOWN
    place, attitude, rests = _settle(body, start, weight, (below, 0.0, NEAR * body.reach))
    if rests:
        return place, attitude, NONE, rests
    held = (below, CREEP / (YIELDS * body.reach), forever)
    place, attitude, rests = _settle(body, start, weight, held)
    creep = creep_of(body, place, held)
    rubs = _miss(body, _forces_at(body, place, attitude, NONE)) > RUBS * weight
    if rests and rubs and dot(creep, creep) < FASTEST * FASTEST:
        return place, attitude, creep, rests
    place, attitude, rests = _settle(body, start, weight, (below, 0.0, forever))
    return place, attitude, NONE, rests


@jit
def put_to_rest(body: Any, hook: Any) -> None:
    """Record 0 is the body at rest below the hook; not finite if it finds no rest.

    The stage tells the water, and the deck's height, in which it begins.
    """
    s, record = body.stage, body.records[0]
    put(s, FROZEN, vector(s, FLOW_NOW))
    put(s, FLOW_GROWS, NONE)
    put(s, ARM_HELD, vector(s, WET_ARM))
    s[WET_HELD] = s[WET]
    put(s, HOOK, hook)
    weight = (body.m + body.displaced) * body.g + TINY_WEIGHT
    s[SHARE] = _softest(body, weight)
    place, attitude, creep, rests = _rest_of(body, _start(body, hook), weight)
    for k in range(RECORD):
        record[k] = 0.0
    put(record, X, place)
    for k in range(4):
        record[ATTITUDE + k] = attitude[k]
    put(record, V, creep if rests else (nan, nan, nan))

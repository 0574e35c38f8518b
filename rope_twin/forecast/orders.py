"""Orders to the winches that a forecast compares, and the line out that each gives.

Every order begins from the line out, the line speed and the compensation of the origin and keeps
the acceleration of the scene's winch, so that members under different orders differ by the order
alone. Active heave compensation is that of `twin.winch.components`, for all members at once: it
answers the hang-off of each member with the scene's efficiency, dead time, lag and limits.

An order is one to the whole lift, unless it names a winch. `hold`, `stop`, `continue`
and the compensation apply to each winch by itself; with `lower`, `haul` and `land` the other
winches keep up with the line speed of the main one, within their own acceleration and line out:
those that carry the load beside it pay out as it does, one at the other end of a loop over a sheave
takes in what it gives. Under an order to one winch the others go on at their speed.
"""

from __future__ import annotations

import math
import re
from collections import deque
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rope_twin.errors import InputError, did_you_mean
from rope_twin.quantity import read_quantity
from rope_twin.scene.load import Change, change_scene
from rope_twin.scene.rigging import meeting_points, payload_rope, places, winches_by_name
from rope_twin.scene.schema import WINCH, Scene, Winch
from rope_twin.scene.winch import HeaveCompensation

Floats = NDArray[np.float64]
Lines = Mapping[str, Floats]  # line out by winch, every sample [m]

CONTINUE, HOLD, STOP, LOWER, HAUL, LAND, COMPENSATION = (
    "continue", "hold", "stop", "lower", "haul", "land", "compensation",
)  # fmt: skip
KINDS = (CONTINUE, HOLD, STOP, LOWER, HAUL, LAND, COMPENSATION)
WITH_SPEED = (LOWER, HAUL, LAND)
SLACK_AFTER_LANDING_M = 2.0  # line paid out beyond first contact
MOST_ORDERS = 6  # compared at once: each takes as long as a forecast
LONGEST = 200  # characters of their text: a mistake is quoted in full
USUAL_ACCELERATION = 0.3  # m/s², of a scene without a winch
USUAL_SPEED = 0.5  # m/s, of `lower`, `haul` and `land` without one
_WORD = re.compile(r"([a-z]+)(?::([^@]+))?(?:@(.+))?")


@dataclass(frozen=True)
class Order:
    """One thing that a winch operator may do now."""

    kind: str  # of KINDS
    speed_m_per_s: float = 0.0  # above 0, of WITH_SPEED
    compensation: bool | None = None  # of COMPENSATION; None: as it is
    winch: str = ""  # that obeys, while the others go on as they do; "": all of them

    @property
    def name(self) -> str:
        """The order as it is written."""
        value = ""
        if self.kind in WITH_SPEED:
            value = f":{self.speed_m_per_s:g}"
        elif self.kind == COMPENSATION:
            value = f":{'on' if self.compensation else 'off'}"
        return f"{self.kind}{value}{'@' if self.winch else ''}{self.winch}"

    def of(self, winch: str) -> Order:
        """Return the order as it concerns one winch."""
        return self if self.winch in ("", winch) else Order(CONTINUE)


def read_order(word: str) -> Order:
    """Return the order that a word such as `hold`, `lower:0.5` or `stop@aft` stands for.

    Raises:
        InputError: no such order, or a speed that is none.
    """
    found = _WORD.fullmatch(word.strip())
    kind, value, winch = (found[1], found[2], found[3] or "") if found else (word, None, "")
    if kind not in KINDS:
        raise InputError("order", f"there is no '{kind}'", did_you_mean(kind, KINDS))
    if kind == COMPENSATION:
        if value not in ("on", "off"):
            remedy = "give compensation:on or compensation:off"
            raise InputError("order", f"'{word}' says neither on nor off", remedy)
        return Order(kind, compensation=value == "on", winch=winch)
    if kind not in WITH_SPEED:
        if value is not None:
            raise InputError("order", f"'{kind}' takes no value", f"write {kind}")
        return Order(kind, winch=winch)
    try:
        speed = USUAL_SPEED if value is None else read_quantity(value, "m/s")
    except ValueError:
        speed = math.nan
    if not speed > 0.0:
        remedy = f"give a speed above 0 in m/s or with a unit, like {kind}:0.5 or {kind}:20m/min"
        raise InputError("order", f"the speed of '{word}' is {value}", remedy)
    return Order(kind, speed, winch=winch)


def read_orders(words: str) -> tuple[Order, ...]:
    """Return `hold` and the orders of a text such as `lower:0.5 stop`, each once.

    Raises:
        InputError: no order, an unknown one, or more than MOST_ORDERS.
    """
    if len(words) > LONGEST:
        raise InputError("orders", f"a text of {len(words)} characters", f"give {LONGEST} at most")
    asked = words.split()
    if not 0 < len(asked) <= MOST_ORDERS:
        remedy = f"give one to {MOST_ORDERS}, like lower:0.5 stop"
        raise InputError("orders", f"there are {len(asked)}", remedy)
    return tuple(dict.fromkeys([Order(HOLD), *map(read_order, asked)]))


@dataclass(frozen=True)
class LineNow:
    """The line at the origin."""

    out_m: float
    speed_m_per_s: float  # commanded: without the compensation, positive = pay out
    compensated: bool = False  # whether active heave compensation is on
    stroke_m: float = 0.0  # of it, from its middle
    to_contact_m: float | None = None  # line to pay out until the payload lands; None: no seabed


@dataclass(frozen=True)
class LinePath:
    """Line out and its rate at step borders, (steps + 1,) or (steps + 1, members)."""

    out_m: Floats
    speed_m_per_s: Floats
    note: str = ""  # which limit holds the order back
    is_whole: bool = False  # what the compensation adds is in it


def check_order(order: Order, winch: Winch | None, now: LineNow) -> None:
    """Check that a scene can follow an order.

    Raises:
        InputError: no winch, a speed beyond its limit, no seabed to land on, or no compensation.
    """
    if order.kind in (CONTINUE, HOLD) and winch is None:
        return
    if winch is None:
        remedy = "the scene has no winch; ask for hold"
        raise InputError(f"order {order.name}", "nothing pays out or hauls in", remedy)
    if order.kind in WITH_SPEED and order.speed_m_per_s > winch.speed_limit_m_per_s:
        remedy = f"the winch reaches {winch.speed_limit_m_per_s:g} m/s"
        raise InputError(f"order {order.name}", "it is too fast", remedy)
    if order.kind == LAND and now.to_contact_m is None:
        raise InputError("order land", "the scene has no seabed", "add one to the scene")
    if order.kind == COMPENSATION and winch.heave_compensation is None:
        remedy = "give the scene's winch heave_compensation"
        raise InputError(f"order {order.name}", "there is no compensation", remedy)


def line_path(
    order: Order,
    now: LineNow,
    winch: Winch | None,
    steps: int,
    step_s: float,
    lead: Floats | None = None,
) -> LinePath:
    """Return the commanded line out over the steps after the origin, without compensation.

    The speed approaches that of the order with the winch's acceleration (with that of its
    emergency stop for `stop`) and slows down before its least and most line out. lead: line speed
    at the borders that a winch keeps up with, in place of that of the order, (steps + 1,) [m/s].

    Raises:
        InputError: the scene cannot follow the order.
    """
    if lead is None:
        check_order(order, winch, now)
    acceleration = winch.acceleration_limit_m_per_s2 if winch else USUAL_ACCELERATION
    if order.kind == STOP and winch and winch.emergency_stop:
        acceleration = winch.emergency_stop.deceleration_m_per_s2
    low = winch.least_line_out_m if winch else -math.inf
    high = winch.most_line_out_m if winch else math.inf
    if order.kind == LAND and now.to_contact_m is not None:
        high = min(high, now.out_m + now.to_contact_m + SLACK_AFTER_LANDING_M)
    own = {
        CONTINUE: now.speed_m_per_s, COMPENSATION: now.speed_m_per_s, HOLD: 0.0, STOP: 0.0,
        LOWER: order.speed_m_per_s, LAND: order.speed_m_per_s, HAUL: -order.speed_m_per_s,
    }[order.kind]  # fmt: skip
    out, speed = np.empty(steps + 1), np.empty(steps + 1)
    length, rate, note = now.out_m, now.speed_m_per_s, ""
    for k in range(steps + 1):
        out[k], speed[k] = length, rate
        target = own if lead is None else float(lead[min(k + 1, steps)])
        room = high - length if rate > 0.0 or target > 0.0 else length - low
        fastest = math.sqrt(2.0 * acceleration * max(room, 0.0))
        wanted = math.copysign(min(abs(target), fastest), target)
        if abs(wanted) < abs(target) and not note:
            note = f"stops at {high if target > 0.0 else low:g} m of line out"
        change = min(max(wanted - rate, -acceleration * step_s), acceleration * step_s)
        length, rate = length + (rate + 0.5 * change) * step_s, rate + change
    return LinePath(out, speed, note)


def compensation_path(
    params: HeaveCompensation,
    heave_rate: Floats,
    on_from: int,
    on_until: int,
    step_s: float,
) -> tuple[Floats, Floats]:
    """Return the line that active heave compensation pays out, and its rate, from `on_from` on.

    Args:
        params: of the scene's winch.
        heave_rate: of the hang-off at all borders [m/s], (borders, members); those before
            `on_from` fill dead time and lag.
        on_from: border at which the stroke is at its middle.
        on_until: border from which on the compensation is off and slows down.
        step_s: between borders.

    Returns:
        Line relative to border `on_from` [m] and rate [m/s], (borders - on_from, members) each. The
        rate there is that of an unlimited compensation.
    """
    borders = len(heave_rate)
    back = params.delay_s / step_s
    at = np.maximum(np.arange(borders) - back, 0.0)
    whole = np.minimum(at.astype(np.int64), borders - 2)
    part = (at - whole)[:, None]
    delayed = (1.0 - part) * heave_rate[whole] + part * heave_rate[whole + 1]
    lagged = delayed.copy()
    if params.lag_s > 0.0:
        keep = math.exp(-step_s / params.lag_s)
        for k in range(1, borders):  # exact for a velocity that is linear over the step
            bend = params.lag_s * (delayed[k] - delayed[k - 1]) / step_s
            lagged[k] = delayed[k] - bend + (lagged[k - 1] - delayed[k - 1] + bend) * keep
    limit, most = params.speed_limit_m_per_s, params.acceleration_limit_m_per_s2 * step_s
    target = np.clip(params.efficiency * lagged, -limit, limit)
    count = borders - on_from
    stroke, rate = np.empty((count, heave_rate.shape[1])), np.empty((count, heave_rate.shape[1]))
    stroke[0], rate[0] = 0.0, target[on_from] if on_from < on_until else 0.0
    for k in range(1, count):
        wanted = target[on_from + k] if on_from + k < on_until else np.zeros(rate.shape[1])
        new = rate[k - 1] + np.clip(wanted - rate[k - 1], -most, most)
        room = np.maximum(params.stroke_m - np.sign(new) * stroke[k - 1], 0.0)
        braking = np.sqrt(2.0 * params.acceleration_limit_m_per_s2 * room)
        rate[k] = np.clip(new, -braking, braking)
        stroke[k] = stroke[k - 1] + 0.5 * step_s * (rate[k - 1] + rate[k])
    return stroke, rate


def other_winches(scene: Scene) -> dict[str, tuple[int, Winch]]:
    """Return rope and data of each winch but the main one, by the name of its hang-off."""
    first = {line.from_: r for r, line in reversed(list(enumerate(scene.ropes)))}
    named = winches_by_name(scene).items()
    return {name: (first[name], winch) for name, winch in named if name != WINCH}


def hung_ropes(scene: Scene) -> list[str]:
    """Return the names of the ropes from a hang-off, that of the main winch first."""
    return [line.name for line in scene.ropes if line.from_ in places(scene)]


def senses(scene: Scene) -> dict[str, float]:
    """Return how each other winch goes with the main one, by name.

    1: it pays out as that does; -1: it hauls in, at the other end of a loop over a sheave; 0: its
    rope meets no rope of the main winch.
    """
    found, waiting = {0: 1.0}, deque([0])
    while waiting:
        r = waiting.popleft()
        for other, turned in _neighbours(scene, r):
            if other not in found:
                found[other] = -found[r] if turned else found[r]
                waiting.append(other)
    return {name: found.get(r, 0.0) for name, (r, _) in other_winches(scene).items()}


def _neighbours(scene: Scene, r: int) -> list[tuple[int, bool]]:
    """Return the ropes that meet a rope, or share a bar with it, and whether over a sheave."""
    line, sheaves = scene.ropes[r], {one.name for one in scene.sheaves}
    points = {line.from_, line.to}.intersection(meeting_points(scene))
    barred = {p for bar in scene.struts if points.intersection(bar.between) for p in bar.between}
    return [
        (k, end in sheaves)
        for k, other in enumerate(scene.ropes)
        for end in (other.from_, other.to)
        if k != r and end in points | barred
    ]


def check_lift_order(order: Order, scene: Scene, now: LineNow) -> None:
    """Check that the winches of a scene can follow an order; now: line of the main one.

    Raises:
        InputError: they cannot, or there is no such winch.
    """
    others = other_winches(scene)
    if order.winch:
        known = {WINCH: scene.winch} | {name: winch for name, (_, winch) in others.items()}
        if order.winch not in known:
            remedy = did_you_mean(order.winch, known)
            raise InputError(f"order {order.name}", f"no winch '{order.winch}'", remedy)
        if order.kind == LAND and others:
            remedy = "leave the winch out, or lower with it"
            raise InputError(f"order {order.name}", "all winches land the load", remedy)
        check_order(order, known[order.winch], now)
        return
    check_order(order, scene.winch, now)
    for name, (_, winch) in others.items():
        if order.kind in WITH_SPEED and order.speed_m_per_s > winch.speed_limit_m_per_s:
            remedy = f"it reaches {winch.speed_limit_m_per_s:g} m/s"
            raise InputError(f"order {order.name}", f"too fast for '{name}'", remedy)


def scene_at_line(
    scene: Scene, line_out_m: float, others_m: Mapping[str, float] | None = None
) -> Scene:
    """Return the scene with this line out at its beginning.

    line_out_m: of the main winch; others_m: of other winches, by name.

    Raises:
        SceneError: the line out is not possible.
    """
    ropes = {0: line_out_m}
    for name, (r, _) in other_winches(scene).items():
        ropes[r] = (others_m or {}).get(name, scene.ropes[r].length_m)
    changes = [
        Change(f"ropes[{r}].length_m", float(length))
        for r, length in ropes.items()
        if length != scene.ropes[r].length_m
    ]
    return change_scene(scene, changes)


def below_main_m(scene: Scene) -> float:
    """Return the length of rope between the main winch's rope and the payload [m]."""
    r, length, seen = payload_rope(scene), 0.0, set[int]()
    ends = [line.to for line in scene.ropes]
    while r != 0 and r not in seen and scene.ropes[r].from_ in ends:
        seen.add(r)
        length += scene.ropes[r].length_m
        r = ends.index(scene.ropes[r].from_)
    return length if r == 0 else 0.0

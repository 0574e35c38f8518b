"""Winch orders that a forecast compares, and the line out that follows from each.

Every order starts from the line out, line speed and compensation at the origin and is limited by
the acceleration of the scene's winch, so that members under different orders differ by the order
only. Active heave compensation is that of `twin.winch.components`, for all members at once: it
responds to the hang-off of each member with the scene's efficiency, dead time, lag and limits.

An order applies to the whole lift, unless it names a winch. `hold`, `stop`, `continue`
and the compensation apply to each winch by itself; with `lower`, `haul` and `land` the other
winches follow the line speed of the main one, within their own acceleration and line out: those
that carry the load with it pay out at its speed, one at the other end of a loop over a sheave hauls
in at that speed. Under an order to one winch the others continue at their speed.
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
MAX_ORDERS = 6  # compared at once: each takes as long as a forecast
MAX_TEXT = 200  # characters of their text: a mistake is quoted in full
USUAL_ACCELERATION = 0.3  # m/s², of a scene without a winch
USUAL_SPEED = 0.5  # m/s, of `lower`, `haul` and `land` without one
_WORD = re.compile(r"([a-z]+)(?::([^@]+))?(?:@(.+))?")


@dataclass(frozen=True)
class Order:
    """An action that a winch operator can take at the origin."""

    kind: str  # of KINDS
    speed_m_per_s: float = 0.0  # above 0, of WITH_SPEED
    compensation: bool | None = None  # of COMPENSATION; None: unchanged
    winch: str = ""  # that follows it, while the others continue; "": all of them

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
        InputError: no such order, or an invalid speed.
    """
    match = _WORD.fullmatch(word.strip())
    kind, value, winch = (match[1], match[2], match[3] or "") if match else (word, None, "")
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


def read_orders(text: str) -> tuple[Order, ...]:
    """Return `hold` and the orders of a text such as `lower:0.5 stop`, each once.

    Raises:
        InputError: no order, an unknown one, or more than MAX_ORDERS.
    """
    if len(text) > MAX_TEXT:
        raise InputError("orders", f"a text of {len(text)} characters", f"give {MAX_TEXT} at most")
    orders = text.split()
    if not 0 < len(orders) <= MAX_ORDERS:
        remedy = f"give one to {MAX_ORDERS}, like lower:0.5 stop"
        raise InputError("orders", f"there are {len(orders)}", remedy)
    return tuple(dict.fromkeys([Order(HOLD), *map(read_order, orders)]))


@dataclass(frozen=True)
class LineState:
    """The line at the origin."""

    out_m: float
    speed_m_per_s: float  # commanded: without the compensation, positive = pay out
    compensated: bool = False  # whether active heave compensation is on
    to_contact_m: float | None = None  # line to pay out until the payload lands; None: no seabed


@dataclass(frozen=True)
class LinePath:
    """Line out and its rate at step borders, (steps + 1,) or (steps + 1, members)."""

    out_m: Floats
    speed_m_per_s: Floats
    note: str = ""  # the active limit
    is_whole: bool = False  # includes the compensation


def check_order(order: Order, winch: Winch | None, line: LineState) -> None:
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
    if order.kind == LAND and line.to_contact_m is None:
        raise InputError("order land", "the scene has no seabed", "add one to the scene")
    if order.kind == COMPENSATION and winch.heave_compensation is None:
        remedy = "give the scene's winch heave_compensation"
        raise InputError(f"order {order.name}", "there is no compensation", remedy)


def line_path(
    order: Order,
    start: LineState,
    winch: Winch | None,
    steps: int,
    step_s: float,
    lead: Floats | None = None,
) -> LinePath:
    """Return the commanded line out over the steps after the origin, without compensation.

    The speed approaches that of the order with the winch's acceleration (with that of its
    emergency stop for `stop`) and slows down before its minimum and maximum line out. lead: line
    speed at the step borders to follow in place of that of the order, (steps + 1,) [m/s].

    Raises:
        InputError: the scene cannot follow the order.
    """
    if lead is None:
        check_order(order, winch, start)
    acceleration = winch.acceleration_limit_m_per_s2 if winch else USUAL_ACCELERATION
    if order.kind == STOP and winch and winch.emergency_stop:
        acceleration = winch.emergency_stop.deceleration_m_per_s2
    min_m = winch.min_line_out_m if winch else -math.inf
    max_m = winch.max_line_out_m if winch else math.inf
    if order.kind == LAND and start.to_contact_m is not None:
        max_m = min(max_m, start.out_m + start.to_contact_m + SLACK_AFTER_LANDING_M)
    order_speed = {
        CONTINUE: start.speed_m_per_s, COMPENSATION: start.speed_m_per_s, HOLD: 0.0, STOP: 0.0,
        LOWER: order.speed_m_per_s, LAND: order.speed_m_per_s, HAUL: -order.speed_m_per_s,
    }[order.kind]  # fmt: skip
    out, speed = np.empty(steps + 1), np.empty(steps + 1)
    length, rate, note = start.out_m, start.speed_m_per_s, ""
    for k in range(steps + 1):
        out[k], speed[k] = length, rate
        target = order_speed if lead is None else float(lead[min(k + 1, steps)])
        distance = max_m - length if rate > 0.0 or target > 0.0 else length - min_m
        fastest = math.sqrt(2.0 * acceleration * max(distance, 0.0))
        limited_speed = math.copysign(min(abs(target), fastest), target)
        if abs(limited_speed) < abs(target) and not note:
            note = f"stops at {max_m if target > 0.0 else min_m:g} m of line out"
        change = min(max(limited_speed - rate, -acceleration * step_s), acceleration * step_s)
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
    delay_steps = params.delay_s / step_s
    delayed_step = np.maximum(np.arange(borders) - delay_steps, 0.0)
    step = np.minimum(delayed_step.astype(np.int64), borders - 2)
    fraction = (delayed_step - step)[:, None]
    delayed = (1.0 - fraction) * heave_rate[step] + fraction * heave_rate[step + 1]
    lagged = delayed.copy()
    if params.lag_s > 0.0:
        decay = math.exp(-step_s / params.lag_s)
        for k in range(1, borders):  # exact for a velocity that is linear over the step
            slope_lag = params.lag_s * (delayed[k] - delayed[k - 1]) / step_s
            lagged[k] = (
                delayed[k] - slope_lag + (lagged[k - 1] - delayed[k - 1] + slope_lag) * decay
            )
    limit, max_change = params.speed_limit_m_per_s, params.acceleration_limit_m_per_s2 * step_s
    target = np.clip(params.efficiency * lagged, -limit, limit)
    count = borders - on_from
    stroke, rate = np.empty((count, heave_rate.shape[1])), np.empty((count, heave_rate.shape[1]))
    stroke[0], rate[0] = 0.0, target[on_from] if on_from < on_until else 0.0
    for k in range(1, count):
        set_point = target[on_from + k] if on_from + k < on_until else np.zeros(rate.shape[1])
        unlimited = rate[k - 1] + np.clip(set_point - rate[k - 1], -max_change, max_change)
        distance = np.maximum(params.stroke_m - np.sign(unlimited) * stroke[k - 1], 0.0)
        braking = np.sqrt(2.0 * params.acceleration_limit_m_per_s2 * distance)
        rate[k] = np.clip(unlimited, -braking, braking)
        stroke[k] = stroke[k - 1] + 0.5 * step_s * (rate[k - 1] + rate[k])
    return stroke, rate


def other_winches(scene: Scene) -> dict[str, tuple[int, Winch]]:
    """Return rope and data of each winch but the main one, by the name of its hang-off."""
    rope_of = {line.from_: r for r, line in reversed(list(enumerate(scene.ropes)))}
    winches = winches_by_name(scene).items()
    return {name: (rope_of[name], winch) for name, winch in winches if name != WINCH}


def suspended_ropes(scene: Scene) -> list[str]:
    """Return the names of the ropes from a hang-off, that of the main winch first."""
    return [line.name for line in scene.ropes if line.from_ in places(scene)]


def winch_directions(scene: Scene) -> dict[str, float]:
    """Return the direction of each other winch relative to the main one, by name.

    1: it pays out with the main one; -1: it hauls in, at the other end of a loop over a sheave; 0:
    its rope meets no rope of the main winch.
    """
    direction, queue = {0: 1.0}, deque([0])
    while queue:
        r = queue.popleft()
        for neighbour, reversed_ in _neighbours(scene, r):
            if neighbour not in direction:
                direction[neighbour] = -direction[r] if reversed_ else direction[r]
                queue.append(neighbour)
    return {name: direction.get(r, 0.0) for name, (r, _) in other_winches(scene).items()}


def _neighbours(scene: Scene, r: int) -> list[tuple[int, bool]]:
    """Return the ropes that meet a rope, or share a bar with it, and whether over a sheave."""
    line, sheaves = scene.ropes[r], {sheave.name for sheave in scene.sheaves}
    points = {line.from_, line.to}.intersection(meeting_points(scene))
    by_strut = {p for bar in scene.struts if points.intersection(bar.between) for p in bar.between}
    return [
        (k, end in sheaves)
        for k, other in enumerate(scene.ropes)
        for end in (other.from_, other.to)
        if k != r and end in points | by_strut
    ]


def check_lift_order(order: Order, scene: Scene, line: LineState) -> None:
    """Check that the winches of a scene can follow an order; now: line of the main one.

    Raises:
        InputError: they cannot, or there is no such winch.
    """
    others = other_winches(scene)
    if order.winch:
        winches = {WINCH: scene.winch} | {name: winch for name, (_, winch) in others.items()}
        if order.winch not in winches:
            remedy = did_you_mean(order.winch, winches)
            raise InputError(f"order {order.name}", f"no winch '{order.winch}'", remedy)
        if order.kind == LAND and others:
            remedy = "leave the winch out, or lower with it"
            raise InputError(f"order {order.name}", "all winches land the load", remedy)
        check_order(order, winches[order.winch], line)
        return
    check_order(order, scene.winch, line)
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
    r, length, visited = payload_rope(scene), 0.0, set[int]()
    lower_ends = [line.to for line in scene.ropes]
    while r != 0 and r not in visited and scene.ropes[r].from_ in lower_ends:
        visited.add(r)
        length += scene.ropes[r].length_m
        r = lower_ends.index(scene.ropes[r].from_)
    return length if r == 0 else 0.0

"""Winches of a scene beside the main one, as a forecast moves them.

An order of a forecast is one to the whole lift, unless it names a winch. `hold`, `stop`, `continue`
and the compensation apply to each winch by itself; with `lower`, `haul` and `land` the other
winches keep up with the line speed of the main one, within their own acceleration and line out:
those that carry the load beside it pay out as it does, one at the other end of a loop over a sheave
takes in what it gives. Under an order to one winch the others go on at their speed.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from rope_twin.errors import InputError, did_you_mean
from rope_twin.forecast.orders import LAND, WITH_SPEED, LineNow, Order, check_order
from rope_twin.scene.load import Change, change_scene
from rope_twin.scene.rigging import meeting_points, payload_rope, places, winches_by_name
from rope_twin.scene.schema import WINCH, Scene, Winch

Floats = NDArray[np.float64]
Lines = Mapping[str, Floats]  # line out by winch, every sample [m]


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
            right = did_you_mean(order.winch, known)
            raise InputError(f"order {order.name}", f"no winch '{order.winch}'", right)
        if order.kind == LAND and others:
            right = "leave the winch out, or lower with it"
            raise InputError(f"order {order.name}", "all winches land the load", right)
        check_order(order, known[order.winch], now)
        return
    check_order(order, scene.winch, now)
    for name, (_, winch) in others.items():
        if order.kind in WITH_SPEED and order.speed_m_per_s > winch.speed_limit_m_per_s:
            right = f"it reaches {winch.speed_limit_m_per_s:g} m/s"
            raise InputError(f"order {order.name}", f"too fast for '{name}'", right)


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

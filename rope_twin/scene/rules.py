"""What must hold between the values of a scene: references, order, limits.

Each rule yields its faults as (path in the file, what is wrong, what would be right); the reader
has already checked every value by itself.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator
from itertools import pairwise
from math import pi
from pathlib import Path

from rope_twin.effects import EFFECTS
from rope_twin.errors import did_you_mean
from rope_twin.scene.schema import Scene
from rope_twin.share import share_dir

Fault = tuple[str, str, str]
FASTEST_HEAVE_M_PER_S = 15.0  # as the twin believes at its input (twin/ship.py)


def faults(scene: Scene) -> Iterator[Fault]:
    """Every fault between the values of a scene, in the order of RULES."""
    for rule in RULES:
        yield from rule(scene)


def bag_path(scene: Scene) -> Path | None:
    """Where the bag of a scene lies (whether it exists or not); None without a bag."""
    bag = scene.sea_state.bag
    if not bag:
        return None
    if is_path(bag):
        return scene.path.parent / bag
    return share_dir() / "bags" / bag


def is_path(bag: str) -> bool:
    """Whether a bag is given by a path rather than by a name in bags/."""
    return "/" in bag or bag.startswith(".") or bag.endswith(".mcap")


def _names(scene: Scene) -> Iterator[Fault]:
    ropes = [line.name for line in scene.ropes]
    payloads = [payload.name for payload in scene.payloads]
    for key, names in (("ropes", ropes), ("payloads", payloads)):
        counts = Counter(names)
        for number, name in enumerate(names):
            if not name:
                yield f"{key}[{number}].name", "the name is empty", "give it a name"
            if counts[name] > 1:
                what = f"{counts[name]} {key} are named '{name}'"
                yield f"{key}[{number}].name", what, "give each its own name"


def _one_rope(scene: Scene) -> Iterator[Fault]:
    if len(scene.ropes) != 1:
        what = f"{len(scene.ropes)} ropes are given"
        yield "ropes", what, "give exactly one: this version steps one rope"


def _lower_ends(scene: Scene) -> Iterator[Fault]:
    names = [payload.name for payload in scene.payloads]
    for number, line in enumerate(scene.ropes):
        path = f"ropes[{number}]"
        if line.to and line.fixed_at_m:
            right = "keep `to` (a payload) or `fixed_at_m` (a fixed point)"
            yield path, "both `to` and `fixed_at_m` are given", right
        elif not line.to and not line.fixed_at_m:
            right = "add `to` (a payload's name) or `fixed_at_m` (a fixed point)"
            yield path, "its lower end is neither held nor loaded", right
        elif line.to and line.to not in names:
            right = did_you_mean(line.to, names) if names else "add it under `payloads`"
            yield f"{path}.to", f"there is no payload '{line.to}'", right


def _held_payloads(scene: Scene) -> Iterator[Fault]:
    held = {line.to for line in scene.ropes}
    for number, payload in enumerate(scene.payloads):
        if payload.name not in held:
            right = f"give `to: {payload.name}` to a rope, or leave the payload out"
            yield f"payloads[{number}]", f"no rope holds '{payload.name}'", right


def _payload_figures(scene: Scene) -> Iterator[Fault]:
    for number, payload in enumerate(scene.payloads):
        given = {
            "displaced_volume_m3": payload.displaced_volume_m3,
            "added_mass_kg": payload.added_mass_kg,
            "drag_area_m2": payload.drag_area_m2,
        }
        missing = [name for name, value in given.items() if value is None]
        if payload.shape is None and missing:
            what = f"without a shape {', '.join(missing)} cannot be known"
            yield f"payloads[{number}]", what, "add a shape, or these keys"


def _damping(scene: Scene) -> Iterator[Fault]:
    for number, line in enumerate(scene.ropes):
        given = (line.damping.newton_seconds, line.damping.fraction_of_first_axial_mode)
        if given.count(None) != 1:
            what = "no damping is given" if given.count(None) == 2 else "two dampings are given"
            right = "give exactly one of newton_seconds and fraction_of_first_axial_mode"
            yield f"ropes[{number}].damping", what, right


def _line_out(scene: Scene) -> Iterator[Fault]:
    winch = scene.winch
    if winch is None:
        return
    least, most = winch.least_line_out_m, winch.most_line_out_m
    if least >= most:
        what = f"{least:g} m is not below most_line_out_m ({most:g} m)"
        yield "winch.least_line_out_m", what, "give a smaller one"
        return
    for number, line in enumerate(scene.ropes):
        if not least <= line.length_m <= most:
            what = f"{line.length_m:g} m lies outside the winch's {least:g} to {most:g} m"
            right = "change it, or least_line_out_m or most_line_out_m of the winch"
            yield f"ropes[{number}].length_m", what, right


def _schedule(scene: Scene) -> Iterator[Fault]:
    winch = scene.winch
    if winch is None:
        return
    for number, row in enumerate(winch.schedule):
        if abs(row.speed_m_per_s) > winch.speed_limit_m_per_s:
            what = f"{row.speed_m_per_s:g} m/s is over the winch's {winch.speed_limit_m_per_s:g}"
            right = "slow it down, or raise speed_limit_m_per_s"
            yield f"winch.schedule[{number}].speed_m_per_s", what, right
    for number, (before, after) in enumerate(pairwise(winch.schedule), start=1):
        if after.at_s <= before.at_s:
            what = f"{after.at_s:g} s comes after {before.at_s:g} s in the list"
            yield f"winch.schedule[{number}].at_s", what, "order the rows by time, each time once"
    repeat, path = winch.schedule_repeats_every_s, "winch.schedule_repeats_every_s"
    if repeat is None:
        return
    if not winch.schedule:
        yield path, "there is no schedule to repeat", "add `schedule`, or leave this out"
    elif repeat <= winch.schedule[-1].at_s:
        what = f"{repeat:g} s cuts off the row at {winch.schedule[-1].at_s:g} s"
        yield path, what, "give more than the time of the last row"


def _effects(scene: Scene) -> Iterator[Fault]:
    names = {effect.params: effect.name for effect in EFFECTS}
    listed = [names[type(params)] for params in scene.effects]
    if "payload" in listed and not scene.payloads:
        yield "effects", "`payload` is listed but no payload is", "add `payloads`, or leave it out"


def _bag(scene: Scene) -> Iterator[Fault]:
    path = bag_path(scene)
    if path is None or path.is_dir() or path.is_file():
        return
    if is_path(scene.sea_state.bag):
        yield "sea_state.bag", f"there is no bag at {path}", "give a bag's folder or .mcap file"
        return
    known = [folder.name for folder in path.parent.glob("*") if folder.is_dir()]
    right = did_you_mean(scene.sea_state.bag, known) if known else "give the path of a bag"
    yield "sea_state.bag", f"there is no bag '{scene.sea_state.bag}' in bags/", right


def _regular_heave(scene: Scene) -> Iterator[Fault]:
    sea = scene.sea_state
    if sea.heave is None:
        return
    if sea.bag:
        what = f"both `bag` ('{sea.bag}') and `heave` are given"
        yield "sea_state", what, "keep the record or the sine"
    if not sea.loop:
        right = "leave `loop` out, it is for bags"
        yield "sea_state.loop", "a regular heave has no end to stop at", right
    fastest = 2.0 * pi * sea.heave.amplitude_m / sea.heave.period_s
    if fastest > FASTEST_HEAVE_M_PER_S:
        what = f"it moves the ship at up to {fastest:.1f} m/s"
        right = (
            f"a ship stays within {FASTEST_HEAVE_M_PER_S:g} m/s: lower it, or lengthen its period"
        )
        yield "sea_state.heave", what, right


RULES: tuple[Callable[[Scene], Iterator[Fault]], ...] = (
    _names,
    _one_rope,
    _lower_ends,
    _held_payloads,
    _payload_figures,
    _damping,
    _line_out,
    _schedule,
    _effects,
    _bag,
    _regular_heave,
)

"""Rules between the values of winches: limits, components, schedule, what they follow."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from itertools import pairwise

from rope_twin.errors import did_you_mean
from rope_twin.scene.rigging import winch_of, winches
from rope_twin.scene.schema import Fault, RopeLine, Rule, Scene
from rope_twin.scene.winch import (
    FOLLOWS,
    FOLLOWS_MEASURED,
    RAMP_TO_ZERO,
    SET_THE_BRAKE,
    SWITCHES,
    WHEN_COMMANDER_LOST,
    BendingSheave,
    Winch,
)


def line_out_faults(scene: Scene) -> Iterator[Fault]:
    """Check the limits of each winch, and that its line is between them."""
    for path, winch in winches(scene):
        least, most = winch.min_line_out_m, winch.max_line_out_m
        if least >= most:
            problem = f"{least:g} m is not below max_line_out_m ({most:g} m)"
            yield f"{path}.min_line_out_m", problem, "give a smaller one"
            return
    for number, line in enumerate(scene.ropes):
        own_winch = winch_of(scene, line)
        if own_winch and not own_winch.min_line_out_m <= line.length_m <= own_winch.max_line_out_m:
            reach = f"{own_winch.min_line_out_m:g} to {own_winch.max_line_out_m:g} m"
            problem = f"{line.length_m:g} m is outside the winch's {reach}"
            remedy = "change it, or min_line_out_m or max_line_out_m of the winch"
            yield f"ropes[{number}].length_m", problem, remedy


def _of_each(rule: Callable[[Winch], Iterator[Fault]]) -> Rule:
    """Return a rule of scenes from one of winches, whose paths begin at the winch."""

    def check(scene: Scene) -> Iterator[Fault]:
        for path, winch in winches(scene):
            for key, problem, remedy in rule(winch):
                yield f"{path}.{key}", problem, remedy

    return check


def _schedule(winch: Winch) -> Iterator[Fault]:
    for number, row in enumerate(winch.schedule):
        if row.speed_m_per_s is not None and abs(row.speed_m_per_s) > winch.speed_limit_m_per_s:
            problem = f"{row.speed_m_per_s:g} m/s exceeds the winch's {winch.speed_limit_m_per_s:g}"
            remedy = "slow it down, or raise speed_limit_m_per_s"
            yield f"schedule[{number}].speed_m_per_s", problem, remedy
    for number, (before, after) in enumerate(pairwise(winch.schedule), start=1):
        is_switch = after.at_s == before.at_s and bool(after.switch) != bool(before.switch)
        if after.at_s <= before.at_s and not is_switch:
            problem = f"{after.at_s:g} s comes after {before.at_s:g} s in the list"
            yield f"schedule[{number}].at_s", problem, "order the rows by time, each time once"
    repeat, where = winch.schedule_repeats_every_s, "schedule_repeats_every_s"
    if repeat is not None and not winch.schedule:
        yield where, "there is no schedule to repeat", "add `schedule`, or remove this"
    elif repeat is not None and repeat <= winch.schedule[-1].at_s:
        problem = f"{repeat:g} s cuts off the row at {winch.schedule[-1].at_s:g} s"
        yield where, problem, "give more than the time of the last row"


def _parts(winch: Winch) -> Iterator[Fault]:
    if winch.drive is not None and winch.drum is None:
        remedy = "add `drum: {core_radius_m: ..., turns_per_layer: ...}`"
        yield "drive", "a drive turns a drum, and there is none", remedy
    if winch.brake is not None and winch.drive is None:
        remedy = "add `drive: {inertia_kg_m2: ..., torque_limit_n_m: ...}`"
        yield "brake", "a brake acts on the inertia of a drive, and there is none", remedy


def _passive(winch: Winch) -> Iterator[Fault]:
    """A passive compensator gives way ahead of a winch that holds its line."""
    if winch.passive_compensation is not None and winch.drive is not None:
        problem = "it is between the rope and a winch that holds its line, and this one renders"
        yield "passive_compensation", problem, "remove it, or `drive` and `brake`"


def _sheave(scene: Scene) -> Iterator[Fault]:
    """Wires are thinner than their rope, and a sheave is wider than the rope."""
    for line in scene.ropes:
        thick = max(section.rope.diameter_m for section in line.made_of)
        for path, sheave in _passed(scene, line):
            if sheave.diameter_m <= thick:
                problem = f"{sheave.diameter_m:g} m is not wider than the rope's {thick:g} m"
                yield f"{path}.diameter_m", problem, "give about 20 times the rope's diameter"
            if (sheave.outer_wire_m or 0.0) > 0.5 * thick:
                problem = f"wires of {sheave.outer_wire_m:g} m do not fit a rope of {thick:g} m"
                yield f"{path}.outer_wire_m", problem, "give the diameter of one outer wire"


def _bend_order(winch: Winch) -> Iterator[Fault]:
    """Yield a drum that is not further inboard than the sheaves before it."""
    end_m = max((one.inboard_m + one.arc_m for one in winch.inboard_sheaves), default=0.0)
    if winch.drum is not None and winch.drum.inboard_m < end_m:
        place = f"the drum at {winch.drum.inboard_m:g} m"
        problem = f"{place} is outboard of a sheave, which ends at {end_m:g} m"
        yield "drum.inboard_m", problem, "give its distance from the hang-off along the rope"


def _passed(scene: Scene, line: RopeLine) -> Iterator[tuple[str, BendingSheave]]:
    """Yield the sheaves that a rope runs over, each with its path in the file."""
    for number, wheel in enumerate(scene.sheaves):
        if wheel.groove is not None and line.to == wheel.name:
            yield f"sheaves[{number}].groove", wheel.groove
    winch = winch_of(scene, line)
    if winch is None:
        return
    path = next(path for path, candidate in winches(scene) if candidate is winch)
    if winch.sheave is not None:
        yield f"{path}.sheave", winch.sheave
    for number, sheave in enumerate(winch.inboard_sheaves):
        yield f"{path}.inboard_sheaves[{number}]", sheave


def _commander(winch: Winch) -> Iterator[Fault]:
    """A winch supports its action for a lost commander."""
    key, action = "when_commander_lost", winch.when_commander_lost
    if action not in WHEN_COMMANDER_LOST:
        yield key, f"'{action}' is unknown", did_you_mean(action, WHEN_COMMANDER_LOST)
    elif action == SET_THE_BRAKE and winch.brake is None:
        remedy = f"add `brake` to it, or use {RAMP_TO_ZERO}"
        yield key, f"'{action}' but this winch has no brake", remedy


def _follows(winch: Winch) -> Iterator[Fault]:
    """A winch that follows its measured line out has no motion of its own."""
    if winch.follows not in FOLLOWS:
        yield "follows", f"'{winch.follows}' is unknown", did_you_mean(winch.follows, FOLLOWS)
    elif winch.follows == FOLLOWS_MEASURED and winch.passive_compensation is not None:
        problem = "the stroke of `passive_compensation` is not part of a measured line out"
        yield "follows", problem, "remove the compensator, or follow commands"


def _rows(winch: Winch) -> Iterator[Fault]:
    least, most = winch.min_line_out_m, winch.max_line_out_m
    for number, row in enumerate(winch.schedule):
        path = f"schedule[{number}]"
        if row.line_out_m is not None and not least <= row.line_out_m <= most:
            problem = f"{row.line_out_m:g} m is outside the winch's {least:g} to {most:g} m"
            remedy = "change it, or min_line_out_m or max_line_out_m"
            yield f"{path}.line_out_m", problem, remedy
        if row.tension_n is not None and winch.constant_tension is None:
            problem = "this winch has no constant-tension mode"
            remedy = "add `constant_tension: {gain_m_per_s_per_kn: ...}` to it"
            yield f"{path}.tension_n", problem, remedy
        if row.switch is not None and row.switch not in SWITCHES:
            remedy = did_you_mean(row.switch, SWITCHES)
            yield f"{path}.switch", f"'{row.switch}' is unknown", remedy
        elif row.switch is not None and getattr(winch, SWITCHES[row.switch]) is None:
            part = SWITCHES[row.switch]
            problem = f"'{row.switch}' but this winch has no {part.replace('_', ' ')}"
            yield f"{path}.switch", problem, f"add `{part}` to it"


def _depth(scene: Scene) -> Iterator[Fault]:
    """A rope with a fixed lower end has no payload depth to control."""
    for number, line in enumerate(scene.ropes):
        winch = winch_of(scene, line)
        rows = winch.schedule if winch is not None and line.fixed_at_m is not None else ()
        if any(row.payload_depth_m is not None for row in rows):
            problem = "its lower end is fixed, and the winch schedule gives a payload depth"
            yield f"ropes[{number}].fixed_at_m", problem, "give line_out_m instead"


WINCH_RULES: tuple[Rule, ...] = (
    line_out_faults,
    *map(_of_each, (_schedule, _parts, _passive)),
    _sheave,
    *map(_of_each, (_bend_order, _commander, _follows, _rows)),
    _depth,
)

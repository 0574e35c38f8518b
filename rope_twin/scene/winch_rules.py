"""Rules between the values of winches: limits, components, schedule, what they follow."""

from __future__ import annotations

from collections.abc import Iterator
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
    ScheduleRow,
    Winch,
)


def line_out_faults(scene: Scene) -> Iterator[Fault]:
    """Check the limits of each winch, and that its line is between them."""
    for path, winch in winches(scene):
        least, most = winch.least_line_out_m, winch.most_line_out_m
        if least >= most:
            problem = f"{least:g} m is not below most_line_out_m ({most:g} m)"
            yield f"{path}.least_line_out_m", problem, "give a smaller one"
            return
    for number, line in enumerate(scene.ropes):
        own_winch = winch_of(scene, line)
        if (
            own_winch
            and not own_winch.least_line_out_m <= line.length_m <= own_winch.most_line_out_m
        ):
            reach = f"{own_winch.least_line_out_m:g} to {own_winch.most_line_out_m:g} m"
            problem = f"{line.length_m:g} m is outside the winch's {reach}"
            remedy = "change it, or least_line_out_m or most_line_out_m of the winch"
            yield f"ropes[{number}].length_m", problem, remedy


def _schedule(scene: Scene) -> Iterator[Fault]:
    for path, winch in winches(scene):
        yield from _one_schedule(path, winch)


def _one_schedule(path: str, winch: Winch) -> Iterator[Fault]:
    for number, row in enumerate(winch.schedule):
        if row.speed_m_per_s is not None and abs(row.speed_m_per_s) > winch.speed_limit_m_per_s:
            problem = f"{row.speed_m_per_s:g} m/s exceeds the winch's {winch.speed_limit_m_per_s:g}"
            remedy = "slow it down, or raise speed_limit_m_per_s"
            yield f"{path}.schedule[{number}].speed_m_per_s", problem, remedy
    for number, (before, after) in enumerate(pairwise(winch.schedule), start=1):
        is_switch = after.at_s == before.at_s and bool(after.switch) != bool(before.switch)
        if after.at_s <= before.at_s and not is_switch:
            problem = f"{after.at_s:g} s comes after {before.at_s:g} s in the list"
            yield (
                f"{path}.schedule[{number}].at_s",
                problem,
                "order the rows by time, each time once",
            )
    repeat, where = winch.schedule_repeats_every_s, f"{path}.schedule_repeats_every_s"
    if repeat is None:
        return
    if not winch.schedule:
        yield where, "there is no schedule to repeat", "add `schedule`, or remove this"
    elif repeat <= winch.schedule[-1].at_s:
        problem = f"{repeat:g} s cuts off the row at {winch.schedule[-1].at_s:g} s"
        yield where, problem, "give more than the time of the last row"


def _parts(scene: Scene) -> Iterator[Fault]:
    for path, winch in winches(scene):
        if winch.drive is not None and winch.drum is None:
            problem = "a drive turns a drum, and there is none"
            yield f"{path}.drive", problem, "add `drum: {core_radius_m: ..., turns_per_layer: ...}`"
        if winch.brake is not None and winch.drive is None:
            problem = "a brake acts on the inertia of a drive, and there is none"
            yield (
                f"{path}.brake",
                problem,
                "add `drive: {inertia_kg_m2: ..., torque_limit_n_m: ...}`",
            )


def _passive(scene: Scene) -> Iterator[Fault]:
    """A passive compensator gives way ahead of a winch that holds its line."""
    for path, winch in winches(scene):
        if winch.passive_compensation is not None and winch.drive is not None:
            problem = "it is between the rope and a winch that holds its line, and this one renders"
            yield f"{path}.passive_compensation", problem, "remove it, or `drive` and `brake`"


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


def _bend_order(scene: Scene) -> Iterator[Fault]:
    """Yield a drum that is not further inboard than the sheaves before it."""
    for path, winch in winches(scene):
        ends = [sheave.inboard_m + sheave.arc_m for sheave in winch.inboard_sheaves]
        if winch.drum is not None and ends and winch.drum.inboard_m < max(ends):
            problem = (
                f"the drum at {winch.drum.inboard_m:g} m is outboard of a sheave, which ends at "
            )
            remedy = "give its distance from the hang-off along the rope"
            yield f"{path}.drum.inboard_m", f"{problem}{max(ends):g} m", remedy


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


def _commander(scene: Scene) -> Iterator[Fault]:
    """A winch supports its action for a lost commander."""
    for path, winch in winches(scene):
        key, action = f"{path}.when_commander_lost", winch.when_commander_lost
        if action not in WHEN_COMMANDER_LOST:
            yield key, f"'{action}' is unknown", did_you_mean(action, WHEN_COMMANDER_LOST)
        elif action == SET_THE_BRAKE and winch.brake is None:
            remedy = f"add `brake` to it, or use {RAMP_TO_ZERO}"
            yield key, f"'{action}' but this winch has no brake", remedy


def _follows(scene: Scene) -> Iterator[Fault]:
    """A winch that follows its measured line out has no motion of its own."""
    for path, winch in winches(scene):
        if winch.follows not in FOLLOWS:
            remedy = did_you_mean(winch.follows, FOLLOWS)
            yield f"{path}.follows", f"'{winch.follows}' is unknown", remedy
        elif winch.follows == FOLLOWS_MEASURED and winch.passive_compensation is not None:
            problem = "the stroke of `passive_compensation` is not part of a measured line out"
            yield f"{path}.follows", problem, "remove the compensator, or follow commands"


def _rows(scene: Scene) -> Iterator[Fault]:
    for path, winch in winches(scene):
        for number, row in enumerate(winch.schedule):
            for key, problem, right in _row(winch, row):
                yield f"{path}.schedule[{number}].{key}", problem, right


def _row(winch: Winch, row: ScheduleRow) -> Iterator[Fault]:
    least, most = winch.least_line_out_m, winch.most_line_out_m
    if row.line_out_m is not None and not least <= row.line_out_m <= most:
        problem = f"{row.line_out_m:g} m is outside the winch's {least:g} to {most:g} m"
        yield "line_out_m", problem, "change it, or least_line_out_m or most_line_out_m"
    if row.tension_n is not None and winch.constant_tension is None:
        problem = "this winch has no constant-tension mode"
        yield "tension_n", problem, "add `constant_tension: {gain_m_per_s_per_kn: ...}` to it"
    if row.switch is None:
        return
    if row.switch not in SWITCHES:
        yield "switch", f"'{row.switch}' is unknown", did_you_mean(row.switch, SWITCHES)
    elif getattr(winch, SWITCHES[row.switch]) is None:
        part = SWITCHES[row.switch]
        problem = f"'{row.switch}' but this winch has no {part.replace('_', ' ')}"
        yield "switch", problem, f"add `{part}` to it"


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
    _schedule,
    _parts,
    _passive,
    _sheave,
    _bend_order,
    _commander,
    _follows,
    _rows,
    _depth,
)

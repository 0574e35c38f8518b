"""Rules between the components of a winch, and between them and its schedule."""

from __future__ import annotations

from collections.abc import Callable, Iterator

from rope_twin.errors import did_you_mean
from rope_twin.scene.rules.fault import Fault
from rope_twin.scene.rules.rigging import winch_of, winches
from rope_twin.scene.schema import Scene
from rope_twin.scene.winch import (
    RAMP_TO_ZERO,
    SET_THE_BRAKE,
    SWITCHES,
    WHEN_COMMANDER_LOST,
    ScheduleRow,
    Winch,
)


def _parts(scene: Scene) -> Iterator[Fault]:
    for path, winch in winches(scene):
        if winch.drive is not None and winch.drum is None:
            what = "a drive turns a drum, and there is none"
            yield f"{path}.drive", what, "add `drum: {core_radius_m: ..., turns_per_layer: ...}`"
        if winch.brake is not None and winch.drive is None:
            what = "a brake acts on the inertia of a drive, and there is none"
            yield f"{path}.brake", what, "add `drive: {inertia_kg_m2: ..., torque_limit_n_m: ...}`"


def _sheave(scene: Scene) -> Iterator[Fault]:
    """Wires are thinner than their rope, and a sheave is wider than the rope."""
    for line in scene.ropes:
        winch = winch_of(scene, line)
        sheave = winch.sheave if winch is not None else None
        if winch is None or sheave is None:
            continue
        path = next(path for path, own in winches(scene) if own is winch)
        thick = max(section.rope.diameter_m for section in line.made_of)
        if sheave.diameter_m <= thick:
            what = f"{sheave.diameter_m:g} m is not wider than the rope's {thick:g} m"
            yield f"{path}.sheave.diameter_m", what, "give about 20 times the rope's diameter"
        if sheave.outer_wire_m > 0.5 * thick:
            what = f"wires of {sheave.outer_wire_m:g} m do not fit a rope of {thick:g} m"
            yield f"{path}.sheave.outer_wire_m", what, "give the diameter of one outer wire"


def _commander(scene: Scene) -> Iterator[Fault]:
    """A winch supports its action for a lost commander."""
    for path, winch in winches(scene):
        key, wanted = f"{path}.when_commander_lost", winch.when_commander_lost
        if wanted not in WHEN_COMMANDER_LOST:
            yield key, f"'{wanted}' is unknown", did_you_mean(wanted, WHEN_COMMANDER_LOST)
        elif wanted == SET_THE_BRAKE and winch.brake is None:
            right = f"add `brake` to it, or use {RAMP_TO_ZERO}"
            yield key, f"'{wanted}' but this winch has no brake", right


def _rows(scene: Scene) -> Iterator[Fault]:
    for path, winch in winches(scene):
        for number, row in enumerate(winch.schedule):
            for key, what, right in _row(winch, row):
                yield f"{path}.schedule[{number}].{key}", what, right


def _row(winch: Winch, row: ScheduleRow) -> Iterator[Fault]:
    least, most = winch.least_line_out_m, winch.most_line_out_m
    if row.line_out_m is not None and not least <= row.line_out_m <= most:
        what = f"{row.line_out_m:g} m is outside the winch's {least:g} to {most:g} m"
        yield "line_out_m", what, "change it, or least_line_out_m or most_line_out_m"
    if row.tension_n is not None and winch.constant_tension is None:
        what = "this winch has no constant-tension mode"
        yield "tension_n", what, "add `constant_tension: {gain_m_per_s_per_kn: ...}` to it"
    if row.switch is None:
        return
    if row.switch not in SWITCHES:
        yield "switch", f"'{row.switch}' is unknown", did_you_mean(row.switch, SWITCHES)
    elif getattr(winch, SWITCHES[row.switch]) is None:
        part = SWITCHES[row.switch]
        what = f"'{row.switch}' but this winch has no {part.replace('_', ' ')}"
        yield "switch", what, f"add `{part}` to it"


def _depth(scene: Scene) -> Iterator[Fault]:
    """A rope with a fixed lower end has no payload depth to control."""
    for number, line in enumerate(scene.ropes):
        winch = winch_of(scene, line)
        rows = winch.schedule if winch is not None and line.fixed_at_m is not None else ()
        if any(row.payload_depth_m is not None for row in rows):
            what = "its lower end is fixed, and the winch schedule gives a payload depth"
            yield f"ropes[{number}].fixed_at_m", what, "give line_out_m instead"


WINCH_RULES: tuple[Callable[[Scene], Iterator[Fault]], ...] = (
    _parts,
    _sheave,
    _commander,
    _rows,
    _depth,
)

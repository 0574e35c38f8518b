"""Winch commands: four control modes and switches, and their validation."""

from __future__ import annotations

import math
from typing import NamedTuple

from rope_twin.errors import did_you_mean, phrase
from rope_twin.scene.winch import SWITCHES
from rope_twin.scene.winch import Winch as WinchScene
from rope_twin.twin.winch.payout import SpooledRope

MAX_SPEED_M_PER_S = 10.0
MAX_DEPTH_M = 12_000.0
MAX_TENSION_N = 1e9

SPEED, LENGTH, DEPTH, TENSION = "speed", "length", "depth", "tension"
CONTROL_MODES = {  # unit of each control mode
    SPEED: "m/s",  # + pays out
    LENGTH: "m",  # payout to stop at
    DEPTH: "m",  # of the payload below the mean water level, to stop at
    TENSION: "N",  # to maintain at the hang-off
}
FEEDBACK_MODES = (DEPTH, TENSION)  # control modes that need tension feedback
EMERGENCY_STOP, RESET = "emergency_stop", "reset"
SET_BRAKE, RELEASE_BRAKE = "set_brake", "release_brake"
# Sent by the monitor of the commanders, never by a commander:
NEW_COMMANDER, COMMANDER_LOST = "new_commander", "commander_lost"
COMMANDER_EVENTS = (NEW_COMMANDER, COMMANDER_LOST)
COMPENSATE, STOP_COMPENSATING = "compensate", "stop_compensating"


class WinchCommand(NamedTuple):
    """Winch command: a control mode and its set-point in the unit of CONTROL_MODES, or a switch."""

    kind: str  # of CONTROL_MODES, SWITCHES or COMMANDER_EVENTS
    value: float = 0.0


class Fault(NamedTuple):
    """Reason of a rejection: the kind under which it is counted, and the message."""

    kind: str
    sentence: str


def find_fault(command: WinchCommand, winch: WinchScene | None, rope: SpooledRope) -> Fault | None:
    """Return why a winch of this scene with this rope can never execute a command; None: it can."""
    if winch is None:
        return _impossible("this scene has no winch", "add a winch to the scene")
    kind, value = command
    if kind in COMMANDER_EVENTS:
        return None
    if kind in SWITCHES:
        key = SWITCHES[kind]
        if getattr(winch, key) is None:
            what = f"'{kind}' but this winch has no {key.replace('_', ' ')}"
            return _impossible(what, f"add `{key}` to it in the scene")
        return None
    if kind not in CONTROL_MODES:
        return _impossible(f"'{kind}'", did_you_mean(kind, (*CONTROL_MODES, *SWITCHES)))
    if not math.isfinite(value):
        what = f"{kind} {value} {CONTROL_MODES[kind]}"
        return Fault("non_finite", phrase("winch command", what, "it must be a finite number"))
    return _out_of_reach(command, winch, rope)


def _out_of_reach(command: WinchCommand, winch: WinchScene, rope: SpooledRope) -> Fault | None:
    kind, value = command
    least, most = winch.least_line_out_m, winch.most_line_out_m
    if kind == SPEED and abs(value) > MAX_SPEED_M_PER_S:
        right = f"no winch runs faster than {MAX_SPEED_M_PER_S:g} m/s"
        return _impossible(f"speed {value:g} m/s", right)
    if kind == LENGTH and not least <= value <= most:
        right = f"this winch has {least:g} to {most:g} m out"
        return _impossible(f"length {value:g} m", right)
    if kind == DEPTH and not 0.0 <= value <= MAX_DEPTH_M:
        right = f"depth counts from the mean water level down, 0 to {MAX_DEPTH_M:g} m"
        return _impossible(f"depth {value:g} m", right)
    if kind == DEPTH and value > (deepest := most * rope.stretch - rope.hang_off_m):
        right = f"this winch's {most:g} m of rope reach {deepest:.1f} m, stretched until it breaks"
        return _impossible(f"depth {value:g} m", right)
    if kind == TENSION and winch.constant_tension is None:
        what = "'tension' but this winch has no constant tension"
        return _impossible(what, "add `constant_tension` to it in the scene")
    if kind == TENSION and not 0.0 <= value <= MAX_TENSION_N:
        right = f"a rope pulls with 0 to {MAX_TENSION_N:g} N"
        return _impossible(f"tension {value:g} N", right)
    return None


def _impossible(what: str, right: str) -> Fault:
    return Fault("impossible", phrase("winch command", what, right))

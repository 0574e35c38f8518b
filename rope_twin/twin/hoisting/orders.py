"""Winch commands: four control modes and switches, and their validation."""

from __future__ import annotations

import math
from typing import NamedTuple

from rope_twin.errors import did_you_mean, phrase
from rope_twin.scene.winch import SWITCHES
from rope_twin.scene.winch import Winch as WinchScene
from rope_twin.twin.hoisting.line import Hung

IMPOSSIBLE_M_PER_S = 10.0
DEEPEST_M = 12_000.0
LARGEST_TENSION_N = 1e9

SPEED, LENGTH, DEPTH, TENSION = "speed", "length", "depth", "tension"
MOTIONS = {  # unit of each control mode
    SPEED: "m/s",  # + pays out
    LENGTH: "m",  # payout to stop at
    DEPTH: "m",  # of the payload below the mean water level, to stop at
    TENSION: "N",  # to maintain at the hang-off
}
FEELING = (DEPTH, TENSION)  # control modes that need tension feedback
EMERGENCY_STOP, RESET = "emergency_stop", "reset"
SET_BRAKE, RELEASE_BRAKE = "set_brake", "release_brake"
# Sent by the monitor of the commanders, never by a commander:
NEW_COMMANDER, COMMANDER_LOST = "new_commander", "commander_lost"
SEAT_ORDERS = (NEW_COMMANDER, COMMANDER_LOST)
COMPENSATE, STOP_COMPENSATING = "compensate", "stop_compensating"


class Order(NamedTuple):
    """Winch command: a control mode with its set-point in the unit of MOTIONS, or a switch."""

    kind: str  # of MOTIONS, SWITCHES or SEAT_ORDERS
    value: float = 0.0


class Fault(NamedTuple):
    """Reason of a rejection: the kind under which it is counted, and the message."""

    kind: str
    sentence: str


def find_fault(order: Order, winch: WinchScene | None, hung: Hung) -> Fault | None:
    """Return why a winch of this scene with this rope can never execute a command; None: it can."""
    if winch is None:
        return _impossible("this scene has no winch", "add a winch to the scene")
    kind, value = order
    if kind in SEAT_ORDERS:
        return None
    if kind in SWITCHES:
        key = SWITCHES[kind]
        if getattr(winch, key) is None:
            what = f"'{kind}' but this winch has no {key.replace('_', ' ')}"
            return _impossible(what, f"add `{key}` to it in the scene")
        return None
    if kind not in MOTIONS:
        return _impossible(f"'{kind}'", did_you_mean(kind, (*MOTIONS, *SWITCHES)))
    if not math.isfinite(value):
        what = f"{kind} {value} {MOTIONS[kind]}"
        return Fault("non_finite", phrase("winch command", what, "it must be a finite number"))
    return _out_of_reach(order, winch, hung)


def _out_of_reach(order: Order, winch: WinchScene, hung: Hung) -> Fault | None:
    kind, value = order
    least, most = winch.least_line_out_m, winch.most_line_out_m
    if kind == SPEED and abs(value) > IMPOSSIBLE_M_PER_S:
        right = f"no winch runs faster than {IMPOSSIBLE_M_PER_S:g} m/s"
        return _impossible(f"speed {value:g} m/s", right)
    if kind == LENGTH and not least <= value <= most:
        right = f"this winch has {least:g} to {most:g} m out"
        return _impossible(f"length {value:g} m", right)
    if kind == DEPTH and not 0.0 <= value <= DEEPEST_M:
        right = f"depth counts from the mean water level down, 0 to {DEEPEST_M:g} m"
        return _impossible(f"depth {value:g} m", right)
    if kind == DEPTH and value > (deepest := most * hung.stretch - hung.hang_off_m):
        right = f"this winch's {most:g} m of rope reach {deepest:.1f} m, stretched until it breaks"
        return _impossible(f"depth {value:g} m", right)
    if kind == TENSION and winch.constant_tension is None:
        what = "'tension' but this winch has no constant tension"
        return _impossible(what, "add `constant_tension` to it in the scene")
    if kind == TENSION and not 0.0 <= value <= LARGEST_TENSION_N:
        right = f"a rope pulls with 0 to {LARGEST_TENSION_N:g} N"
        return _impossible(f"tension {value:g} N", right)
    return None


def _impossible(what: str, right: str) -> Fault:
    return Fault("impossible", phrase("winch command", what, right))

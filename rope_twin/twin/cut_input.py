"""Command to cut a rope: planned before a run or sent during it, and executed once.

A command is validated on arrival and kept until it is due.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import NamedTuple

from rope_twin.effects.bed_friction import BedFrictionParams
from rope_twin.effects.bending import BendingParams
from rope_twin.effects.net_curtain import NetCurtainParams
from rope_twin.effects.rigid_body import RigidBodyParams
from rope_twin.errors import InputError, did_you_mean, phrase
from rope_twin.scene.rigging import is_joined, winch_of
from rope_twin.scene.schema import Scene
from rope_twin.scene.vortex import model_beside, shedding_model
from rope_twin.twin.health import AHEAD_NS, InputCounter, too_late
from rope_twin.twin.snapshot import CutSnapshot, InputHealth

ANY = "rope"  # name in a message that means no particular rope
MIN_LENGTH_M = 1.0  # minimum length left at the hang-off, and at the lower end
AT_LOWER_END = math.inf  # the position closest to the lower end that is possible
_FORM = (
    "write PLACE@SECONDS: metres below the hang-off, or end, and twin time, like 1500@30, or "
    "leg:4@30 where ropes meet"
)


def plan_for(scene: Scene, words: str) -> PlannedCut | None:
    """Return the cut that `read_plan` reads, if it is possible in the scene.

    Raises:
        InputError: the words are no plan, or the cut is never possible.
    """
    plan = read_plan(words)
    if plan is None:
        return None
    if problem := _reason_not_possible(scene):
        raise InputError(f"cut {words}", problem, "run another scene for that")
    if fault := _unknown(scene, plan.rope):
        raise InputError(f"cut {words}", *fault)
    line = scene.ropes[rope_number(scene, plan.rope)]
    winch = winch_of(scene, line)
    max_m = winch.max_line_out_m if winch else line.length_m
    if max_m < plan.below_m < AT_LOWER_END:
        problem = f"this rope is never longer than {max_m:g} m"
        raise InputError(f"cut {words}", problem, f"give up to {max_m - MIN_LENGTH_M:g} m, or end")
    return plan


class CutInput:
    """Input of one cut command."""

    def __init__(self, scene: Scene) -> None:
        self.counter = InputCounter("cut")
        self.done: CutSnapshot | None = None
        self._whole = _reason_not_possible(scene)  # reason why no rope can be cut; "": possible
        self._scene = scene
        # due time [ns], metres below the upper end, number of the rope
        self._waiting: tuple[int, float, int] | None = None

    def submit(self, stamp_ns: int | None, below_m: float, now_ns: int, rope: str = "") -> str:
        """Submit a cut below the upper end (stamp None: at once); return "" or the rejection.

        below_m: unstretched distance below the upper end [m].
        """
        fault = self._fault(stamp_ns, below_m, now_ns)
        if fault is None and (unknown := _unknown(self._scene, rope)):
            fault = "impossible", *unknown
        if fault is not None:
            kind, problem, remedy = fault
            return self.counter.refuse(kind, phrase("cut", problem, remedy))
        at_ns = now_ns if stamp_ns is None else stamp_ns
        self._waiting = at_ns, float(below_m), rope_number(self._scene, rope)
        self.counter.accept(at_ns)
        return ""

    def steps_before(self, now_ns: int, step_ns: int, steps: int) -> int:
        """Return how many of the coming steps lie before the cut."""
        if self._waiting is None:
            return steps
        return min(steps, max(1, -(-(self._waiting[0] - now_ns) // step_ns)))

    def take(self, now_ns: int, length_m: Callable[[int], float]) -> tuple[float, int] | None:
        """Return the length of the lower part [m] and the rope number if a cut is due, else None.

        length_m: returns the unstretched length of a rope. A position beyond the rope's present
        length is rejected: the rope stays whole.
        """
        if self._waiting is None or self._waiting[0] > now_ns:
            return None
        _, below_m, rope = self._waiting
        self._waiting, line_out_m = None, length_m(rope)
        max_m = line_out_m - MIN_LENGTH_M
        if below_m == AT_LOWER_END:
            below_m = max_m
        if not MIN_LENGTH_M <= below_m <= max_m:
            problem = f"{below_m:g} m below the hang-off is not on the {line_out_m:.1f} m of rope"
            remedy = (
                f"right are {MIN_LENGTH_M:g} to {max_m:.1f} m, or the lower end; the rope is whole"
            )
            self.counter.refuse("impossible", phrase("cut", problem, remedy))
            return None
        return line_out_m - below_m, rope

    def health(self, now_ns: int) -> dict[str, InputHealth]:
        """Return the health of the input; empty before the first command."""
        received = self.counter.accepted or self.counter.refused
        return {"cut": self.counter.health(now_ns, False)} if received else {}

    def _fault(
        self, stamp_ns: int | None, below_m: float, now_ns: int
    ) -> tuple[str, str, str] | None:
        if self._whole:
            return "impossible", self._whole, "run another scene for that"
        if self.done is not None or self._waiting is not None:
            problem = "the rope is cut already" if self.done else "a cut is waiting already"
            return "repeated", problem, "a rope is cut once"
        if math.isnan(below_m):
            return "non_finite", "its place is not a number", "give metres below the hang-off"
        if below_m < MIN_LENGTH_M:
            remedy = f"at least {MIN_LENGTH_M:g} m of rope stay there"
            return "impossible", f"{below_m:g} m below the hang-off", remedy
        if stamp_ns is None:
            return None
        if stamp_ns < now_ns:
            problem, remedy = too_late(stamp_ns, now_ns)
            return "late", problem, f"{remedy}, or leave the stamp 0"
        if stamp_ns > now_ns + AHEAD_NS:
            problem = f"stamp {stamp_ns * 1e-9:.1f} s lies more than {AHEAD_NS * 1e-9:g} s ahead"
            return "impossible", problem, "sender and twin must share one clock"
        return None


def rope_number(scene: Scene, name: str) -> int:
    """Return the number of the rope of this name; 0 without a name or in a single-line scene."""
    names = [line.name for line in scene.ropes]
    return names.index(name) if is_joined(scene) and name in names else 0


def _unknown(scene: Scene, name: str) -> tuple[str, str] | None:
    """Return problem and remedy of an unknown rope name; None if it is valid."""
    names = [line.name for line in scene.ropes]
    if name in ("", ANY, *names):
        return None
    return f"there is no rope '{name}'", did_you_mean(name, names)


def _reason_not_possible(scene: Scene) -> str:
    if scene.sheaves:
        return "rope runs over a sheave in this scene; its ropes cannot be cut"
    model = shedding_model(scene)
    in_step = model and model_beside(scene) is None
    if in_step and scene.listed(BendingParams) is not None:
        return f"`{model}` together with `bending` does not support a cut rope's free end"
    if scene.listed(BendingParams) is not None and not is_joined(scene):
        for name, kind in (("net_curtain", NetCurtainParams), ("bed_friction", BedFrictionParams)):
            if scene.listed(kind) is not None:
                return f"`{name}` together with `bending` does not support a cut rope's free end"
    body = scene.listed(RigidBodyParams)
    if body is not None and body.deck is not None and body.deck.with_ship:
        return "the body stands on a deck that heaves with the ship; a cut part cannot follow it"
    return ""


class PlannedCut(NamedTuple):
    """A cut that is planned before a run begins."""

    at_ns: int  # twin time
    below_m: float  # unstretched rope between hang-off and cut; infinite: at the lower end
    rope: str = ""  # its name in a multi-line scene; "": the first


def read_plan(words: str) -> PlannedCut | None:
    """Return a cut from PLACE@SECONDS (`1500@30`, `end@30` or `leg:4@30`); None for no words.

    Raises:
        InputError: the words are no plan.
    """
    if not words:
        return None
    name, _, position_and_time = words.rpartition(":")
    position, _, time = position_and_time.partition("@")
    try:
        below_m = AT_LOWER_END if position.strip() == "end" else float(position)
        at_s = float(time)
    except ValueError as error:
        raise InputError(f"cut {words}", "that is no place and time", _FORM) from error
    if not (below_m >= MIN_LENGTH_M and 0.0 <= at_s < math.inf):
        problem = f"at {at_s:g} s, {below_m:g} m below the hang-off is not possible"
        remedy = f"the time is 0 or later, and at least {MIN_LENGTH_M:g} m of rope hang on"
        raise InputError(f"cut {words}", problem, remedy)
    return PlannedCut(round(at_s * 1e9), below_m, name.strip())

"""Variations of an ensemble's members, and boundary conditions, which equal members share."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

from rope_twin.scene.load import Change
from rope_twin.scene.rigging import is_joined, places, winch_of, winches_by_name
from rope_twin.scene.schema import WINCH, RopeLine, Scene, Triple
from rope_twin.twin.motion.boundary_conditions import (
    SharedBoundary,
    WinchMotion,
    is_known_in_advance,
)
from rope_twin.twin.motion.heave_track import HeaveSeries
from rope_twin.twin.winch.commands import CommandSample
from rope_twin.twin.winch.winch import spooled_rope, winch_of_rope


@dataclass(frozen=True)
class Variation:
    """Changes and inputs of one member."""

    changes: tuple[Change, ...] = ()  # of the scene's numbers
    heave: HeaveSeries | None = None  # None: the ship lies still
    commands: tuple[CommandSample, ...] | None = None  # of the winch; None: the scene's schedule


class Borders:
    """Boundary conditions of members; those with equal inputs share them."""

    def __init__(self) -> None:
        self._winches: dict[Any, WinchMotion] = {}
        self._borders: dict[Any, SharedBoundary] = {}

    def of(self, scene: Scene, own: Variation) -> SharedBoundary:
        """Return the boundary conditions of a member that is one rope."""
        return self._hung(scene, scene.ropes[0], own, scene.ship.hang_off_m)

    def course(self, scene: Scene, own: Variation) -> dict[int, SharedBoundary] | None:
        """Return the motion of the hang-offs of a multi-line scene, by rope.

        None: there is one rope, or the payout of a winch depends on its tension.
        """
        if not is_joined(scene) or not is_known(scene, own):
            return None
        points = places(scene)
        hung = [(r, line) for r, line in enumerate(scene.ropes) if line.from_ in points]
        return {r: self._hung(scene, line, own, points[line.from_]) for r, line in hung}

    def _hung(self, scene: Scene, line: RopeLine, own: Variation, at_m: Triple) -> SharedBoundary:
        """Return the motion of one hang-off at this place, and the payout of its winch."""
        winch, step_s = winch_of(scene, line), scene.time.step_s
        ship = replace(scene.ship, hang_off_m=at_m)
        commands = own.commands if line.from_ == WINCH else None
        answered = winch is not None and winch.heave_compensation is not None
        heaved = (ship, id(own.heave)) if answered else None
        joined = is_joined(scene)  # else the winch does not depend on the rope, and is shared
        spooled = spooled_rope(scene, line) if joined and winch is not None else None
        reeled = (line.from_, winch, line.length_m, commands, heaved, spooled)
        if reeled not in self._winches:
            made = winch_of_rope(scene, line) if joined else None
            own_motion = WinchMotion(winch, line.length_m, commands, step_s, made)
            self._winches[reeled] = own_motion
        moved = (ship, reeled, id(own.heave))
        if moved not in self._borders:
            shared = SharedBoundary(ship, self._winches[reeled], own.heave, step_s)
            self._borders[moved] = shared
        return self._borders[moved]


def is_known(scene: Scene, own: Variation) -> bool:
    """Return whether the payout of all winches is known in advance."""
    return all(
        is_known_in_advance(winch, own.commands if name == WINCH else None)
        for name, winch in winches_by_name(scene).items()
    )

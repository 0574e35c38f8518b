"""The ropes that a twin steps: one, or several that meet.

A twin has its first rope with that rope's winch and hang-off by itself; what is asked here is how
to step, and what there is besides. Of one rope there is nothing besides.
"""

from __future__ import annotations

from typing import Any, Protocol

from rope_twin.core.energy import measure
from rope_twin.core.joined.energy import SystemBorder, of_one
from rope_twin.core.state import PULL_X, PULL_Z, Boundary, Floats, Rope
from rope_twin.core.step import advance
from rope_twin.scene.arrays.build import build
from rope_twin.scene.rules.rigging import is_joined
from rope_twin.scene.schema import Scene
from rope_twin.twin.cutting.bare_end import without_load
from rope_twin.twin.cutting.parted import PartedRopes
from rope_twin.twin.cutting.severing import Place, sever
from rope_twin.twin.hoisting.no_other_winch import NoOtherWinch
from rope_twin.twin.hoisting.orders import Order
from rope_twin.twin.hung import HungRope, hung_rope
from rope_twin.twin.joined.joined import JoinedRopes
from rope_twin.twin.motion.hang_off import Moves
from rope_twin.twin.snapshot import Snapshot, first_rope
from rope_twin.twin.start import find_start


class Ropes(Protocol):
    """What a twin asks of its ropes."""

    first: Rope

    def find_start(self) -> Floats:
        """Bring them to rest; the first one's pull on its hang-off. Raises SceneError."""

    def offer(self, name: str, stamp_ns: int | None, order: Order, now_ns: int) -> str:
        """An order for another of the scene's winches than the first; "" or why it was refused."""

    def doubt(self) -> None:
        """Commands for those winches that are known for times to come may no longer hold."""

    def newest_ns(self) -> dict[str, int]:
        """Stamp of the newest accepted command of each of those, where there is one."""

    def feel(self, time_ns: int) -> bool:
        """Whether another winch asks what its rope is like for the step from this time on."""

    def prescribe(
        self, row: int, from_ns: int, step_s: float, heave: tuple[float, float], moves: Moves
    ) -> None:
        """Other hang-offs and their line out at border `row`.

        heave: of the ship, and its rate; moves: how poses move those that they move.
        """

    def advance(self, first: Rope, boundary: Boundary, time: float, pulls: Floats) -> int:
        """Step; boundary, pulls: of the first rope. As core's `advance`."""

    def part(self, first: Rope, border: Boundary, place: Place) -> tuple[Ropes, float]:
        """Cut a rope; what goes on, and how long the lower part is [m].

        border: of the first one, now in row 0. `first` of what goes on is the first rope then.
        Raises SolverError.
        """

    def length_m(self, r: int) -> float:
        """Unstretched length of a rope but the first [m]."""

    def lose(self, r: int, lost_m: float, left_m: float) -> None:
        """Tell the winch of a rope but the first how much was cut off, and how much hangs on."""

    def forget(self, done: int, prescribed: int) -> None:
        """Make the border after `done` steps the first one; so many after it are prescribed."""

    def prescribe_again(self) -> None:
        """Drop what is prescribed ahead to other ropes, whose winches go on from the last step."""

    def border(self, first: Boundary) -> Boundary:
        """Hang-offs and line out now, (ropes, MOTIONS); first: borders of the first rope."""

    def measure(self, first: Rope, pull: Floats, speed: float, time: float) -> SystemBorder:
        """Energy and power now; pull, speed: of the first rope on its hang-off, payout [m/s]."""

    def complete(self, shot: Snapshot, now_ns: int) -> Snapshot:
        """The first rope's snapshot with what there is besides."""

    def hung(self, first: Rope, shot: Snapshot) -> tuple[HungRope, ...]:
        """All ropes as they hang in a snapshot that is complete; first: the first rope now."""

    def lowest(self, first: Rope) -> Rope:
        """The rope at whose lower end the payload of one rope is; first: the first rope now."""

    def changing(self) -> dict[str, Any]:
        """What a restart needs besides."""

    def take_back(self, values: dict[str, Any], first: Rope) -> None:
        """Take out of the values what `changing` gave; first: the first rope as it is now."""


class OneRope(NoOtherWinch):
    """One rope: nothing besides."""

    def __init__(self, scene: Scene) -> None:
        self._scene = scene
        self.first = build(scene)

    def find_start(self) -> Floats:
        """Bring it to rest; its pull on the hang-off. Raises SceneError."""
        return find_start(self._scene, self.first)

    def advance(self, first: Rope, boundary: Boundary, time: float, pulls: Floats) -> int:
        """Step it."""
        return advance(first, boundary, pulls, time, len(pulls))

    def part(self, first: Rope, border: Boundary, place: Place) -> tuple[Ropes, float]:
        """Cut it."""
        parts = sever(first, border, place, without_load(first.effects))
        return PartedRopes(self._scene, parts.upper, parts.lower), parts.lost_m

    def measure(self, first: Rope, pull: Floats, speed: float, time: float) -> SystemBorder:
        """Of the one rope."""
        return of_one(measure(first, pull[PULL_X : PULL_Z + 1], time, speed))

    def complete(self, shot: Snapshot, now_ns: int) -> Snapshot:
        """As it is."""
        return shot

    def hung(self, first: Rope, shot: Snapshot) -> tuple[HungRope, ...]:
        """The one rope."""
        line = self._scene.ropes[0]
        return (hung_rope(line, first, first_rope(shot, line.name)),)

    def lowest(self, first: Rope) -> Rope:
        """The only one."""
        return first

    def changing(self) -> dict[str, Any]:
        """Nothing."""
        return {}

    def take_back(self, values: dict[str, Any], first: Rope) -> None:
        """Nothing."""


def ropes_of(scene: Scene, steps: int) -> Ropes:
    """The scene's ropes, with room for the borders of so many steps. Raises SceneError."""
    return JoinedRopes(scene, steps) if is_joined(scene) else OneRope(scene)

"""Part of the `Ropes` interface about further winches, for a single rope."""

from __future__ import annotations

from rope_twin.core.state import Boundary
from rope_twin.twin.motion.hang_off import Moves
from rope_twin.twin.winch.commands import WinchCommand


class SingleWinch:
    """Methods of `Ropes` about further winches and ropes, for a single rope, whole or cut."""

    def offer(self, name: str, stamp_ns: int | None, command: WinchCommand, now_ns: int) -> str:
        """Raise RuntimeError, as there is no other winch."""
        raise RuntimeError(f"there is no winch {name}")

    def invalidate(self) -> None:
        """Do nothing, as there is no other winch."""

    def newest_ns(self) -> dict[str, int]:
        """Return no stamps, as there is no other winch."""
        return {}

    def needs_feedback(self, time_ns: int) -> bool:
        """Return False, as there is no other winch."""
        return False

    def prescribe(
        self, row: int, from_ns: int, step_s: float, heave: tuple[float, float], moves: Moves
    ) -> None:
        """Do nothing, as there is no other hang-off."""

    def length_m(self, r: int) -> float:
        """Raise RuntimeError, as there is no other rope."""
        raise RuntimeError(f"there is no rope {r}: this scene has one")

    def adapt_to_cut(self, r: int, lost_m: float, left_m: float) -> None:
        """Raise RuntimeError, as there is no other rope."""
        raise RuntimeError(f"there is no rope {r}: this scene has one")

    def discard_prescribed(self) -> None:
        """Do nothing, as there is no other hang-off."""

    def border(self, first: Boundary) -> Boundary:
        """Return hang-off and paid-out length of the single rope, (1, MOTIONS)."""
        return Boundary(*(table[:1].copy() for table in first))

    def forget(self, done: int, prescribed: int) -> None:
        """Do nothing, as there are no other boundary conditions."""

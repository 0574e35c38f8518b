"""What ropes answer about winches besides the first one where there is none."""

from __future__ import annotations

from rope_twin.core.state import Boundary
from rope_twin.twin.hoisting.orders import Order
from rope_twin.twin.motion.hang_off import Moves


class NoOtherWinch:
    """That part of `Ropes` for a rope by itself, whole or cut."""

    def offer(self, name: str, stamp_ns: int | None, order: Order, now_ns: int) -> str:
        """There is no other winch, and nobody asks for one that is not there."""
        raise RuntimeError(f"there is no winch {name}")

    def doubt(self) -> None:
        """Nothing."""

    def newest_ns(self) -> dict[str, int]:
        """None."""
        return {}

    def feel(self, time_ns: int) -> bool:
        """There is no other winch."""
        return False

    def prescribe(
        self, row: int, from_ns: int, step_s: float, heave: tuple[float, float], moves: Moves
    ) -> None:
        """Nothing."""

    def length_m(self, r: int) -> float:
        """There is no other rope."""
        raise RuntimeError(f"there is no rope {r}: this scene has one")

    def lose(self, r: int, lost_m: float, left_m: float) -> None:
        """There is no other rope."""
        raise RuntimeError(f"there is no rope {r}: this scene has one")

    def prescribe_again(self) -> None:
        """Nothing."""

    def border(self, first: Boundary) -> Boundary:
        """Of the one rope that has any."""
        return Boundary(*(table[:1].copy() for table in first))

    def forget(self, done: int, prescribed: int) -> None:
        """Nothing."""

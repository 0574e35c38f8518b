"""How two lines around a sheave hang beside each other: nearest place, crossings, events."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Crossing:
    """Where two lines cross, seen from across the plane of their hang-offs."""

    depth_m: float
    angle_deg: float  # between the lines, 0 to 90
    gap_m: float  # by which they pass each other, across the plane of the hang-offs
    position_m: tuple[float, float, float] = (0.0, 0.0, 0.0)  # of the first line there


@dataclass(frozen=True)
class LineEvent:
    """Lines begin to cross, or end it."""

    time_s: float
    what: str  # "cross" or "part"
    depth_m: float
    angle_deg: float
    gap_m: float

    def words(self) -> str:
        """Like `the lines cross at 836 m, 0.08 degrees, 0.02 m apart`."""
        told = "the lines cross" if self.what == "cross" else "the lines part again"
        where = f"at {self.depth_m:.0f} m, {self.angle_deg:.2f} degrees"
        return f"{told} {where}, {self.gap_m:.2f} m apart"


@dataclass(frozen=True)
class Nearest:
    """Where the lines are nearest at one instant."""

    time_s: float
    depth_m: float
    distance_m: float  # horizontal


@dataclass(frozen=True)
class LinesShot:
    """How two lines around a sheave hang beside each other."""

    nearest: Nearest
    crossings: tuple[Crossing, ...]  # from the top down

"""Clearance results of two lines around a sheave: minimum distance, crossings, events."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Crossing:
    """Crossing of two lines, seen normal to the plane of their hang-offs."""

    depth_m: float
    angle_deg: float  # between the lines, 0 to 90
    gap_m: float  # distance of the lines normal to the plane of the hang-offs
    position_m: tuple[float, float, float] = (0.0, 0.0, 0.0)  # of the first line there


@dataclass(frozen=True)
class LineEvent:
    """Beginning or end of a crossing of two lines."""

    time_s: float
    what: str  # "cross" or "part"
    depth_m: float
    angle_deg: float
    gap_m: float

    def words(self) -> str:
        """Return a message like `the lines cross at 836 m, 0.08 degrees, 0.02 m apart`."""
        told = "the lines cross" if self.what == "cross" else "the lines part again"
        where = f"at {self.depth_m:.0f} m, {self.angle_deg:.2f} degrees"
        return f"{told} {where}, {self.gap_m:.2f} m apart"


@dataclass(frozen=True)
class Nearest:
    """Minimum distance of two lines at one instant."""

    time_s: float
    depth_m: float
    distance_m: float  # horizontal


@dataclass(frozen=True)
class LinesShot:
    """Clearance of two lines around a sheave."""

    nearest: Nearest
    crossings: tuple[Crossing, ...]  # from the top down

"""What a scene says of a bag with the ship's poses."""

from __future__ import annotations

from dataclasses import dataclass

from rope_twin.quantity import quantity, text


@dataclass(frozen=True, kw_only=True)
class RecordedPoses:
    """The ship's pose over time from a bag: an Odometry topic, or a PoseStamped."""

    bag: str = text("name in bags/, or path")
    topic: str = text("its topic; absent: ship/odometry, or the only one of such a type", "")
    rest_m: tuple[float, float, float] = quantity(
        "where the reference point rests in the record: east, north, up", "m", -1e8, 1e8,
        default=(0.0, 0.0, 0.0),
    )  # fmt: skip
    heading_deg: float = quantity(
        "where the bow points at rest in the record, from east to north", "°", -360.0, 360.0,
        default=0.0,
    )  # fmt: skip

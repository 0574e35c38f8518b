"""What moves the ship when no topic does: a record, a sine, a way, or the scene's own waves."""

from __future__ import annotations

from dataclasses import dataclass

from rope_twin.quantity import quantity, text
from rope_twin.sea.heave_response import BoxHull


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


@dataclass(frozen=True, kw_only=True)
class RegularHeave:
    """A sine, z = a·sin(2π·t/T), up from the rest position; the ship's ramp fades it in."""

    amplitude_m: float = quantity("amplitude, half the height from trough to crest", "m", 0.0, 30.0)
    period_s: float = quantity("period", "s", 2.0, 100.0)


@dataclass(frozen=True, kw_only=True)
class OnWaves:
    """The ship rides on the waves of the effect `waves`: same components, same phases."""

    hull: BoxHull = text("a box-like hull in head seas, which heaves only", BoxHull())
    responses: str = text("six degrees: name in config/responses/ or path of a table", "")
    heading_deg: float = quantity(
        "where the bow points with `responses`, from east to north", "°", -360.0, 360.0, default=0.0
    )


@dataclass(frozen=True, kw_only=True)
class SeaState:
    """What moves the ship when no topic does: a bag, a regular heave or the scene's own waves.

    With none of them it lies still.

    `bag` is a name in bags/ or a path; a path in a scene is relative to the scene's file.
    """

    bag: str = text("recorded heave to replay", "")
    heave: RegularHeave | None = text("a sine in place of a record", None)
    on_waves: OnWaves | None = text("ride on the scene's waves", None)
    path: str = text("table of the hang-off's way: t, x, y, z", "")
    poses: RecordedPoses | None = text("recorded poses of the ship to replay", None)
    start_s: float = quantity("offset into the bag or the sine", "s", 0.0, 1e6, default=0.0)
    loop: bool = text("start again at the end of the bag", True)

    @property
    def posed(self) -> bool:
        """Whether it tells the ship's pose and not only its heave."""
        told = bool(self.path or self.poses)
        return told or (self.on_waves is not None and bool(self.on_waves.responses))

    @property
    def moves(self) -> bool:
        """Whether there is anything that moves the ship."""
        return bool(self.bag or self.path or self.heave or self.on_waves or self.poses)

"""Motion of the ship without a live input: a record, a sine, prescribed motion, or waves."""

from __future__ import annotations

from dataclasses import dataclass

from rope_twin.quantity import quantity, text
from rope_twin.sea.heave_response import BoxHull


@dataclass(frozen=True, kw_only=True)
class RecordedPoses:
    """Time history of the ship's pose from a bag: an Odometry or a PoseStamped topic."""

    bag: str = text("bag: name in bags/, or path")
    topic: str = text("topic; default: ship/odometry, or the only one of such a type", "")
    rest_m: tuple[float, float, float] = quantity(
        "mean position of the reference point in the record: east, north, up", "m", -1e8, 1e8,
        default=(0.0, 0.0, 0.0),
    )  # fmt: skip
    heading_deg: float = quantity(
        "mean heading of the bow in the record: 0 east, 90 north", "°", -360.0, 360.0,
        default=0.0,
    )  # fmt: skip


@dataclass(frozen=True, kw_only=True)
class RegularHeave:
    """A sine, z = a·sin(2π·t/T), about the mean position; it builds up with the ship's ramp."""

    amplitude_m: float = quantity("amplitude, half of trough to crest", "m", 0.0, 30.0)
    period_s: float = quantity("period", "s", 2.0, 100.0)


@dataclass(frozen=True, kw_only=True)
class OnWaves:
    """Ship moved by RAOs in the waves of the effect `waves`: same components, same phases."""

    hull: BoxHull = text("box-like hull in head seas, heave only", BoxHull())
    responses: str = text("RAOs in six degrees of freedom: name in config/responses/ or path", "")
    heading_deg: float = quantity(
        "heading of the bow with `responses`: 0 east, 90 north", "°", -360.0, 360.0, default=0.0
    )


@dataclass(frozen=True, kw_only=True)
class SeaState:
    """Motion of the ship without a live input: a bag, a regular heave, or the scene's waves.

    With none of them it does not move. `bag` is a name in bags/ or a path; a path in a scene is
    relative to the scene's file.
    """

    bag: str = text("recorded heave to replay", "")
    heave: RegularHeave | None = text("regular heave instead of a record", None)
    on_waves: OnWaves | None = text("motion by RAOs in the scene's waves", None)
    path: str = text("prescribed motion of the hang-off, table of t, x, y, z", "")
    poses: RecordedPoses | None = text("recorded poses of the ship to replay", None)
    start_s: float = quantity("time offset into the bag or the sine", "s", 0.0, 1e6, default=0.0)
    loop: bool = text("repeat at the end of the bag", True)

    @property
    def posed(self) -> bool:
        """Return whether it gives the ship's pose and not only its heave."""
        told = bool(self.path or self.poses)
        return told or (self.on_waves is not None and bool(self.on_waves.responses))

    @property
    def moves(self) -> bool:
        """Return whether the ship moves."""
        return bool(self.bag or self.path or self.heave or self.on_waves or self.poses)

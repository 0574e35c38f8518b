"""What leaves the twin: a frozen copy of one instant, in SI, the unit in every name."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from rope_twin.scene.card import KnownError
from rope_twin.twin.findings import EnergyBalance, MaterialFatigue, RopeVibration, TensionBand
from rope_twin.twin.joined.lines_shot import LineEvent, LinesShot

Vector = NDArray[np.float64]


class SolverHealth(NamedTuple):
    """What the step had to do since the twin started."""

    steps: int = 0
    solves: int = 0
    solves_max_per_stage: int = 0
    substeps: int = 0
    substeps_max_per_step: int = 0
    rejected_substeps: int = 0
    unconverged_substeps: int = 0
    splits: int = 0
    merges: int = 0
    computing_s: float = 0.0
    recoveries: int = 0  # failed steps after which the twin went on (twin/recovery.py)
    recovered_ago_s: float = float("inf")  # twin time since the newest; inf: there was none
    recovery: str = ""  # why that step failed and what was done, in one sentence


class InputHealth(NamedTuple):
    """What became of the samples of one input (heave, winch command or current)."""

    accepted: int = 0
    late: int = 0
    repeated: int = 0
    non_finite: int = 0
    impossible: int = 0
    stuck: int = 0  # equal to those before them for too long
    unconfirmed: int = 0  # after a gap, until enough of them agree with each other
    recently_refused: int = 0  # within the last 60 s of twin time
    age_s: float = float("inf")  # of the newest accepted stamp, negative: ahead; inf: none yet
    stale: bool = False
    fault: str = ""  # why it cannot be relied on (ERROR)
    warning: str = ""  # what is wrong with it, or with a sample of the last minute (WARN)
    clock_offset_s: float | None = None  # arrival less stamp of its sender; None: not measured
    interval_s: float | None = None  # between its samples, the median; None: not measured
    note: str = ""  # one sentence on what is done about a gap, else on the newest refusal
    refusal: str = ""  # the newest one's sentence
    executed_late: int = 0  # of the accepted: commands that were executed after their stamp

    @property
    def refused(self) -> int:
        """Samples that did not reach the state."""
        kinds = (self.late, self.repeated, self.non_finite, self.impossible)
        return sum(kinds) + self.stuck + self.unconfirmed


@dataclass(frozen=True)
class BedContact:
    """How payload and rope stand to the seabed."""

    payload_height_m: float  # above the bed; negative by what it sinks in
    payload_push_n: float  # of the bed, normal to it
    rope_on_bed_m: float  # unstretched length of rope that lies on it
    rope_push_n: float

    @property
    def payload_landed(self) -> bool:
        """Whether the bed carries any of the payload."""
        return self.payload_push_n > 0.0


@dataclass(frozen=True)
class BodyShot:
    """A payload that is a rigid body; its slings or pin in the order of the scene."""

    quaternion: Vector  # x, y, z, w: turns its axes into those of the frame, (4,)
    angular_velocity_rad_per_s: Vector  # in its own axes, (3,)
    size_m: Vector  # its outline along them, (3,)
    leg_pull_n: Vector  # (legs,)
    leg_length_m: Vector  # from the hook to the body, (legs,)
    leg_end_m: Vector  # where they hold it, in the frame, (legs, 3)
    deck_push_n: float | None = None  # None: there is no deck
    deck_clearance_m: float | None = None  # of its lowest corner; negative by what it sinks in

    @property
    def turn(self) -> Vector:
        """The rotation matrix, (3, 3)."""
        q, w = self.quaternion[:3], self.quaternion[3]
        skew = np.cross(np.eye(3), q)
        return np.asarray(np.eye(3) + 2.0 * w * skew + 2.0 * skew @ skew)


@dataclass(frozen=True)
class WinchShot:
    """What a winch was told and what its parts do."""

    name: str
    mode: str  # speed, length, depth, tension, or emergency_stop
    target: float  # [m/s], [m], [m] or [N]
    at_limit: str  # one sentence if a limit holds it back
    figures: tuple[tuple[str, float], ...]  # of the parts that it has, the unit in the name
    off_schedule_s: float | None = None  # twin time at which its commands first differed from it


@dataclass(frozen=True)
class CutShot:
    """Where and when the rope was cut."""

    at_s: float  # twin time
    left_m: float  # unstretched rope that hung on below the hang-off then
    lost_m: float  # unstretched length of the lower part
    rope: str = ""  # which one, where several meet


@dataclass(frozen=True)
class RopeStrength:
    """The highest tension of a rope, beside what it bears and what it carries at rest."""

    name: str
    highest_n: float  # at its upper end in all steps since the start, and along it at snapshots
    breaking_load_n: float  # MBL of its weakest section
    static_n: float | None = None  # static tension at its upper end with the present line out
    dynamic_amplification: float | None = None  # highest tension over static since the start

    @property
    def utilisation(self) -> float:
        """Highest tension over MBL; above 1 a real rope has parted: the twin's goes on."""
        return self.highest_n / self.breaking_load_n


@dataclass(frozen=True)
class LimitBreach:
    """A limit of the scene that was broken (twin/limits.py)."""

    limit: str  # its key in the scene's `limits`
    where: str  # name of the rope or payload
    allowed: float  # in the unit of the key; of a bend radius [m]
    first_s: float  # twin time at which it was first broken
    last_s: float  # and last
    worst: float
    worst_s: float


@dataclass(frozen=True)
class Touchdown:
    """Where a rope first meets the seabed (twin/touchdown.py)."""

    name: str
    position_m: tuple[float, float, float]
    line_out_m: float  # unstretched, from the rope's upper end to it
    layback_m: float  # horizontal distance to the end that hangs: the upper one if it does
    tension_n: float
    angle_deg: float  # between bed and rope; 0: it lies down along the bed


@dataclass(frozen=True)
class Bend:
    """A bend of a rope, beside what it may be."""

    name: str  # of the rope
    radius_m: float  # of curvature; infinite: straight
    line_out_m: float  # unstretched, from the rope's upper end to it
    at_s: float  # twin time
    minimum_m: float  # minimum bend radius there; 0: none is given
    element_m: float  # length of the elements there: a shorter arc is not seen

    @property
    def tightness(self) -> float:
        """Minimum over radius, above 1 it is too tight; without a minimum the curvature [1/m]."""
        return (self.minimum_m or 1.0) / self.radius_m

    @property
    def too_tight(self) -> bool:
        """Whether the radius is below the minimum."""
        return self.radius_m < self.minimum_m


@dataclass(frozen=True)
class RopeBend:
    """The tightest bend of a rope (twin/tightest_bend.py)."""

    now: Bend
    position_m: tuple[float, float, float]
    tightest: Bend  # of all snapshots since the twin's start


@dataclass(frozen=True)
class RopeShot:
    """One of several ropes. Rows run from its upper end (row 0) down."""

    name: str
    node_position_m: Vector  # (nodes, 3)
    node_tension_n: Vector  # (nodes,) mean of the neighbouring elements; ends as measured there
    element_tension_n: Vector  # (nodes - 1,)
    tension_top_n: float  # its pull on the hang-off or joint at its upper end, or on its sheave
    line_out_m: float  # its unstretched length
    payout_speed_m_per_s: float  # + paying out
    band: TensionBand | None = None  # of a rope from the ship, where a run asks for it


@dataclass(frozen=True)
class PayloadShot:
    """One of several payloads."""

    name: str
    position_m: Vector  # (3,)
    velocity_m_per_s: Vector  # (3,)


@dataclass(frozen=True)
class StrutShot:
    """A bar between two payloads or joints."""

    name: str
    ends_m: Vector  # (2, 3)
    pull_n: float  # negative: it is pushed


@dataclass(frozen=True)
class SheaveShot:
    """A sheave that rope runs over."""

    name: str
    position_m: Vector  # (3,)
    passed_m: float  # rope that has run over it into the first rope that ends there, unstretched
    speed_m_per_s: float  # of that


@dataclass(frozen=True)
class Snapshot:
    """One instant of the twin. Rows run from the hang-off (row 0) down to the payload.

    Where ropes meet these are of the first rope, and its lower end stands for the payload. Of a
    rope that was cut they are of the part that hangs on; the payload is the lower part's.

    Frame `sea` (east, north, up; z = 0 at mean water level).
    """

    stamp_ns: int  # time since the twin's start [ns]
    step: int
    node_position_m: Vector  # (nodes, 3)
    node_velocity_m_per_s: Vector  # (nodes, 3)
    node_tension_n: Vector  # (nodes,) mean of the neighbouring elements; ends as measured there
    element_tension_n: Vector  # (nodes - 1,)
    arc_length_m: Vector  # (nodes,) unstretched, 0 at the hang-off
    tension_top_n: float  # magnitude of the rope's pull on the hang-off
    tension_top_min_n: float  # over the steps since the previous snapshot
    tension_top_max_n: float
    hang_off_force_n: Vector  # (3,) the rope's pull on the hang-off
    tension_payload_n: float
    hang_off_position_m: Vector  # (3,)
    hang_off_velocity_m_per_s: Vector  # (3,)
    heave_m: float  # hang-off above its rest position
    payload_position_m: Vector  # (3,)
    payload_velocity_m_per_s: Vector  # (3,)
    line_out_m: float  # unstretched rope below the hang-off
    payout_speed_m_per_s: float  # + paying out
    motion_ramp: float  # start-up fade-in of the ship's motion, 0 to 1
    step_s: float = 0.0  # length of the newest step
    winch_at_limit: str = ""  # one sentence if a limit of the winch holds it back
    doubtful: bool = False  # a step since the previous snapshot did not converge
    solver: SolverHealth = field(default_factory=SolverHealth)
    inputs: dict[str, InputHealth] = field(default_factory=dict)  # heave, winch_command, current
    card_error: KnownError = field(default_factory=KnownError)  # of the top tension
    strength: tuple[RopeStrength, ...] = ()  # of each rope of the scene
    breaches: tuple[LimitBreach, ...] = ()  # limits of the scene that were broken since the start
    seabed: BedContact | None = None  # only of a scene with a seabed
    touchdowns: tuple[Touchdown, ...] = ()  # of the ropes that touch it
    bends: tuple[RopeBend, ...] = ()  # of ropes with bending stiffness or a minimum bend radius
    body: BodyShot | None = None  # only of a scene whose payload is a rigid body
    winches: tuple[WinchShot, ...] = ()  # those that the scene has
    energy: EnergyBalance | None = None  # only of a run that keeps a ledger
    band: TensionBand | None = None  # only of a run that asks for it, once it is known
    no_band: str = ""  # why a run that asks for it has none now
    vibration: RopeVibration | None = None  # only of a run that asks for it, once it is known
    fatigue: MaterialFatigue | None = None  # only of a run that asks for it
    ropes: tuple[RopeShot, ...] = ()  # all of them where ropes meet, or one was cut; else none
    payloads: tuple[PayloadShot, ...] = ()  # likewise
    struts: tuple[StrutShot, ...] = ()  # likewise
    sheaves: tuple[SheaveShot, ...] = ()  # likewise
    cut: CutShot | None = None  # if the rope was cut
    lines: LinesShot | None = None  # of two lines around one sheave, as last looked at
    line_events: tuple[LineEvent, ...] = ()  # their crossings that began or ended since then

    @property
    def time_s(self) -> float:
        """Time since the twin's start [s]."""
        return self.stamp_ns * 1e-9


def amended(shot: Snapshot, **fields: Any) -> Snapshot:
    """Set fields of a snapshot that is still being made, which nobody else has seen yet.

    `dataclasses.replace` copies all fields and takes as long as all the rest of a snapshot.
    """
    vars(shot).update(fields)
    return shot


def first_rope(shot: Snapshot, name: str) -> RopeShot:
    """What a snapshot tells of its first rope, as it tells of the others."""
    return RopeShot(
        name=name,
        node_position_m=shot.node_position_m,
        node_tension_n=shot.node_tension_n,
        element_tension_n=shot.element_tension_n,
        tension_top_n=shot.tension_top_n,
        line_out_m=shot.line_out_m,
        payout_speed_m_per_s=shot.payout_speed_m_per_s,
    )

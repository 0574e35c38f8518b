"""What leaves the twin: a frozen copy of one instant, in SI, the unit in every name."""

from __future__ import annotations

from dataclasses import asdict, dataclass, field

import numpy as np
from numpy.typing import NDArray

from rope_twin.scene.card import KnownError

Vector = NDArray[np.float64]
LITTLE = 1e-4


@dataclass(frozen=True)
class SolverHealth:
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


@dataclass(frozen=True)
class InputHealth:
    """What became of the samples of one input (heave, winch command or current)."""

    accepted: int = 0
    late: int = 0
    repeated: int = 0
    non_finite: int = 0
    impossible: int = 0
    age_s: float = float("inf")  # since the newest accepted sample; inf: none yet
    stale: bool = False
    note: str = ""  # one sentence on the newest refusal or on what is done about a gap

    @property
    def refused(self) -> int:
        """Samples that did not reach the state."""
        return self.late + self.repeated + self.non_finite + self.impossible


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
class EnergyBalance:
    """Energy of rope and payload, and where it came from and went to since the count began [J].

    change = hang_off + passing + water - damped - residual.
    """

    since_s: float  # twin time at which the count began
    kinetic_j: float  # now, with the added mass
    elastic_j: float
    potential_j: float  # weight less buoyancy, 0 at the mean water level
    change_j: float  # of the sum of these three
    hang_off_j: float  # work of ship and winch: force times the material's velocity
    passing_j: float  # brought by rope that was paid out, less what hauled rope took away
    water_j: float  # work of the water: drag, mostly negative
    damped_j: float  # dissipated by the axial damper
    residual_j: float  # the rest: dissipated numerically if positive
    exchanged_j: float  # energy that went from any one of these accounts to another

    @property
    def residual_pct(self) -> float:
        """The residual in per cent of the energy exchanged.

        While little was (a rope at rest, or just set in motion), of a ten-thousandth of what is
        there: a residual is then round-off of that, or of how the work of few steps is summed.
        """
        there = abs(self.kinetic_j) + abs(self.elastic_j) + abs(self.potential_j)
        beside = max(self.exchanged_j, LITTLE * there)
        return 100.0 * self.residual_j / beside if beside > 0.0 else 0.0

    def figures(self) -> dict[str, float]:
        """All of it by name, with the residual in per cent."""
        return {**asdict(self), "residual_pct": self.residual_pct}


@dataclass(frozen=True)
class TensionBand:
    """Where the top tension of a converged solution lies, 95 % of the time (twin/error_band.py)."""

    low_n: float
    high_n: float
    bound_n: float  # of the error of tension_top_n; low_n is not below 0
    cost_pct: float  # time that the band has taken, of the time that all else took


@dataclass(frozen=True)
class RopeVibration:
    """How the rope shakes (twin/vibration.py). Rows run from the hang-off (row 0) down.

    An amplitude is √2 times the rms over some periods, over the rope's diameter.
    """

    model: str  # "motion": the twin's own; "modes", "decomposed": computed beside it
    cross_flow: Vector  # amplitude across current and rope [diameters], (nodes,)
    cross_flow_hz: Vector  # its frequency; 0 where nothing moves, (nodes,)
    in_line: Vector | None  # likewise with the current; None: the model has no such motion
    in_line_hz: Vector | None
    every_s: float  # how often a model beside the twin finds the rope's modes again; 0: it has none
    solves: int  # how often it has
    note: str  # one sentence if the modes could not be found again
    cost_pct: float = 0.0  # time that watching the rope has taken, of the twin's time

    @property
    def worst(self) -> int:
        """The node that moves most."""
        return int(self.cross_flow.argmax())


@dataclass(frozen=True)
class MaterialFatigue:
    """Fatigue used of each metre of the rope's material (twin/wear.py), from the lower end up."""

    curve: str  # name of the S-N curve
    counted_s: float  # over this time
    from_lower_end_m: Vector  # middle of each metre, unstretched
    from_hang_off_m: Vector  # where that is now; negative: aboard
    used: Vector  # Miner's sum; 1: it breaks
    bending: bool  # with the stress of bending

    @property
    def worst(self) -> int:
        """The metre that has used most."""
        return int(self.used.argmax())


@dataclass(frozen=True)
class WinchShot:
    """What a winch was told and what its parts do."""

    name: str
    mode: str  # speed, length, depth, tension, or emergency_stop
    target: float  # [m/s], [m], [m] or [N]
    at_limit: str  # one sentence if a limit holds it back
    figures: tuple[tuple[str, float], ...]  # of the parts that it has, the unit in the name


@dataclass(frozen=True)
class CutShot:
    """Where and when the rope was cut."""

    at_s: float  # twin time
    left_m: float  # unstretched rope that hung on below the hang-off then
    lost_m: float  # unstretched length of the lower part


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
    seabed: BedContact | None = None  # only of a scene with a seabed
    body: BodyShot | None = None  # only of a scene whose payload is a rigid body
    winches: tuple[WinchShot, ...] = ()  # those that the scene has
    energy: EnergyBalance | None = None  # only of a run that keeps a ledger
    band: TensionBand | None = None  # only of a run that asks for it, once it is known
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

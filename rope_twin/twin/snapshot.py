"""Snapshot of the twin: a frozen copy of one instant, in SI, with the unit in every name.

It includes the results of what a run may ask for: energy, error interval, vibration, fatigue, and
the clearance of two lines around a sheave.
"""

from __future__ import annotations

from dataclasses import asdict, dataclass, field, replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from rope_twin.scene.error_bound import KnownError
from rope_twin.twin.residual_tests import ResidualTests
from rope_twin.vortex.results import MaterialFatigue, RopeVibration

Vector = NDArray[np.float64]
MIN_EXCHANGED_FRACTION = 1e-4


class SolverHealth(NamedTuple):
    """Work of the solver since the twin started."""

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
    recoveries: int = 0  # failed steps recovered from (twin/recovery.py)
    recovered_ago_s: float = float("inf")  # twin time since the newest recovery; inf: none
    recovery: str = ""  # reason of the newest recovery and the action taken


BORDER = "border"  # among the inputs: a warning on inputs that did not reach the twin


class InputHealth(NamedTuple):
    """Counts and faults of one input (heave, winch command or current)."""

    accepted: int = 0
    late: int = 0
    repeated: int = 0
    non_finite: int = 0
    impossible: int = 0
    stuck: int = 0  # equal to the preceding samples for too long
    unconfirmed: int = 0  # after a gap, until enough samples agree with each other
    recently_refused: int = 0  # within the last 60 s of twin time
    age_s: float = float("inf")  # of the newest accepted stamp; negative: ahead, inf: none yet
    stale: bool = False
    fault: str = ""  # reason why the input is unreliable (ERROR)
    warning: str = ""  # warning on the input, or on a sample of the last minute (WARN)
    clock_offset_s: float | None = None  # arrival minus stamp; None: not measured
    interval_s: float | None = None  # median interval of the samples; None: not measured
    note: str = ""  # present handling of a gap, else the newest rejection
    refusal: str = ""  # message of the newest rejection
    executed_late: int = 0  # accepted commands that were executed after their stamp

    @property
    def refused(self) -> int:
        """Number of samples that were rejected."""
        kinds = (self.late, self.repeated, self.non_finite, self.impossible)
        return sum(kinds) + self.stuck + self.unconfirmed


@dataclass(frozen=True)
class ContactForce:
    """Contact with the hull, between ropes or between payloads."""

    name: str  # hull, ropes or payloads
    normal_n: float  # sum of all normal forces
    # of the largest of them (hull: middle of its element); NaN: nothing touches
    position_m: tuple[float, float, float]


@dataclass(frozen=True)
class BedContact:
    """Contact of payload and rope with the seabed."""

    payload_height_m: float  # of the lowest payload above the bed; negative: penetration
    payload_reaction_n: float  # reaction of the bed, normal to it, of all payloads
    rope_on_bed_m: float  # unstretched length of rope on the bed
    rope_reaction_n: float
    # height [m] and reaction [N] of each payload of a multi-line scene; else none
    several: tuple[tuple[float, float], ...] = ()

    @property
    def payloads(self) -> tuple[tuple[float, float], ...]:
        """Height [m] and reaction [N] of each payload."""
        return self.several or ((self.payload_height_m, self.payload_reaction_n),)

    @property
    def payload_landed(self) -> bool:
        """Whether the bed carries any of a payload."""
        return self.payload_reaction_n > 0.0


@dataclass(frozen=True)
class Landings:
    """Landings of payloads on the seabed since the start; speeds are those before contact."""

    count: int
    first_s: float
    first_m_per_s: float
    fastest_s: float
    fastest_m_per_s: float

    def then(self, time_s: float, speed_m_per_s: float) -> Landings:
        """Return these landings and one more."""
        if speed_m_per_s <= self.fastest_m_per_s:
            return replace(self, count=self.count + 1)
        return replace(self, count=self.count + 1, fastest_s=time_s, fastest_m_per_s=speed_m_per_s)


@dataclass(frozen=True)
class BodySnapshot:
    """State of a rigid-body payload; its slings or pin in the order of the scene."""

    quaternion: Vector  # x, y, z, w: rotation from its axes to those of the frame, (4,)
    angular_velocity_rad_per_s: Vector  # in its own axes, (3,)
    size_m: Vector  # its extent along its own axes, (3,)
    leg_tension_n: Vector  # tension of each sling, (legs,)
    leg_length_m: Vector  # from the hook to the body, (legs,)
    leg_end_m: Vector  # attachment points on the body, in the frame, (legs, 3)
    hook_m: Vector  # position of the hook that they lead to, (3,)
    deck_reaction_n: float | None = None  # reaction of the deck, or None if there is no deck
    deck_clearance_m: float | None = None  # of its lowest corner; negative: penetration

    @property
    def turn(self) -> Vector:
        """Rotation matrix from body axes to the frame, (3, 3)."""
        q, w = self.quaternion[:3], self.quaternion[3]
        skew = np.cross(np.eye(3), q)
        return np.asarray(np.eye(3) + 2.0 * w * skew + 2.0 * skew @ skew)


@dataclass(frozen=True)
class CompensatorSnapshot:
    """State of the heave compensator at the hook; its forces are positive in tension."""

    stroke_m: float  # extension beyond the retracted length; beyond its range: a stop deforms
    stroke_limit_m: float  # stroke between the stops
    stroke_rate_m_per_s: float
    tension_n: float
    gas_pressure_pa: float
    gas_force_n: float
    damper_n: float  # hydraulic damping
    friction_n: float  # of the seals
    stop_n: float  # pull of the stop at the stroke's end; negative: push of the other one
    water_n: float  # of the water's pressure on the rod
    active_n: float = 0.0  # of the active cylinder, positive against extension

    @property
    def at_stop(self) -> str:
        """The stop that the piston is at: "retracted", "extended" or ""."""
        if 0.0 < self.stroke_m < self.stroke_limit_m:
            return ""
        return "retracted" if self.stroke_m <= 0.0 else "extended"


SPEED, LENGTH, DEPTH, TENSION = "speed", "length", "depth", "tension"
CONTROL_MODES = {  # unit of each control mode
    SPEED: "m/s",  # + pays out
    LENGTH: "m",  # payout to stop at
    DEPTH: "m",  # of the payload below the mean water level, to stop at
    TENSION: "N",  # to maintain at the hang-off
}


@dataclass(frozen=True)
class WinchSnapshot:
    """Command in force and component states of a winch."""

    name: str
    mode: str  # speed, length, depth, tension, or emergency_stop
    target: float  # [m/s], [m], [m] or [N]
    at_limit: str  # message if a limit is active
    figures: tuple[tuple[str, float], ...]  # states of its components, unit in the name
    off_schedule_s: float | None = None  # twin time of the first deviation from the schedule


@dataclass(frozen=True)
class CutSnapshot:
    """Position and time of a cut."""

    at_s: float  # twin time
    left_m: float  # unstretched length left below the hang-off
    lost_m: float  # unstretched length of the lower part
    rope: str = ""  # name of the rope in a multi-line scene


@dataclass(frozen=True)
class RopeStrength:
    """Maximum tension of a rope, its MBL and its static tension."""

    name: str
    max_n: float  # at its upper end in every step since the start, along it at snapshots
    breaking_load_n: float  # MBL, of the section with the highest utilisation
    static_n: float | None = None  # static tension at its upper end at the present payout
    dynamic_amplification: float | None = None  # maximum over static at its upper end
    # of a rope of several sections: maximum tension of that section, and utilisation at present
    section_n: float | None = None
    utilisation_now: float | None = None
    top_max_n: float = 0.0  # at its upper end alone, in every step since the start

    @property
    def utilisation(self) -> float:
        """Maximum tension over MBL; above 1 a real rope has parted, the simulated one has not."""
        carried_n = self.max_n if self.section_n is None else self.section_n
        return carried_n / self.breaking_load_n


@dataclass(frozen=True)
class LimitBreach:
    """A limit of the scene that was exceeded (twin/run_record.py)."""

    limit: str  # its key in the scene's `limits`
    where: str  # name of the rope or payload
    allowed: float  # in the unit of the key; a bend radius in [m]
    first_s: float  # twin time at which it was first exceeded
    last_s: float  # twin time at which it was last exceeded
    worst: float
    worst_s: float


@dataclass(frozen=True)
class Residual:
    """Measured less computed value of one quantity at the time of the measurement."""

    name: str  # of the winch or payload
    quantity: str  # top_tension_n, line_out_m or payload_depth_m, in its unit
    at_s: float  # twin time of the newest measurement compared
    measured: float  # less the known offset of the instrument
    computed: float
    half_width: float | None  # the residual should lie within ± this (95 %); None: unknown
    instrument: float | None  # standard uncertainty of the instrument; None: unknown
    twin: float | None  # standard uncertainty of the computed value; None: unknown
    readings: int  # number of readings of the statistics, which cover the last 60 s
    mean: float
    rms: float
    outside: float | None  # fraction of the readings outside their interval; None: unknown
    span_s: float  # time covered by the readings
    sensors: str = ""  # their group in Snapshot.inputs
    tests: ResidualTests | None = None  # of the last minutes; None: too few, or no uncertainty
    explained: float | None = None  # largest mean by the scene's `learning`, without an interval

    @property
    def residual(self) -> float:
        """Measured less computed."""
        return self.measured - self.computed


OUTSIDE_FRACTION, OUTSIDE_SPAN_S = 0.25, 10.0  # of readings; 5 % are expected outside


def disagrees(residual: Residual) -> bool:
    """Return whether `simulation: residuals` warns: too many readings lie outside the interval, or,
    without one, their mean is beyond what is explained.
    """
    if residual.span_s < OUTSIDE_SPAN_S:
        return False
    if residual.outside is not None:
        return residual.outside > OUTSIDE_FRACTION
    return residual.explained is not None and abs(residual.mean) > residual.explained


class ForecastScore(NamedTuple):
    """Score of the latest forecasts of the top tension (twin/inputs.py)."""

    at_s: float  # twin time at which it came
    age_s: float  # of the newest input of the forecast, when that was ready
    coverage: float  # fraction of the measured tensions inside their 90 % bands; NaN: unknown
    judged: int  # number of forecasts evaluated for it
    factor: float  # on the spread of the members, mean over the lead


INPUT, NUMERICS, DISCRETISATION, VALIDITY, RESIDUAL, HISTORY = CAUSES = (
    "input", "numerics", "discretisation", "validity", "residual", "history",
)  # fmt: skip
UNPROVEN = 0.7  # at most, without a measurement or with an unknown discretisation error


@dataclass(frozen=True)
class Quality:
    """Quality index of one functional element (twin/quality.py)."""

    element: str  # top_tension, payload_depth, slack, fatigue or forecast
    index: float  # 0 to 1
    cause: str  # the component that limits it, or from which it still rises
    reason: str  # in words; "": nothing limits it
    components: tuple[float | None, ...]  # in the order of quality.CAUSES; None: unknown
    lowest: float  # since the end of the start-up
    lowest_at_s: float  # twin time
    lowest_reason: str


@dataclass(frozen=True)
class Touchdown:
    """Touchdown point of a rope (twin/contact.py)."""

    name: str
    position_m: tuple[float, float, float]
    line_out_m: float  # unstretched, from the rope's upper end to it
    layback_m: float  # horizontal distance to the suspended end: the upper one if it hangs
    tension_n: float
    angle_deg: float  # between bed and rope; 0: tangent to the bed


@dataclass(frozen=True)
class Bend:
    """A bend of a rope and the minimum bend radius there."""

    name: str  # of the rope
    radius_m: float  # of curvature; infinite: straight
    line_out_m: float  # unstretched, from the rope's upper end to it
    at_s: float  # twin time
    minimum_m: float  # minimum bend radius (MBR) there; 0: none is given
    element_m: float  # element length there: a shorter arc is not resolved

    @property
    def tightness(self) -> float:
        """MBR over radius, above 1 too tight; without an MBR the curvature [1/m]."""
        return (self.minimum_m or 1.0) / self.radius_m

    @property
    def too_tight(self) -> bool:
        """Whether the radius is below the MBR."""
        return self.radius_m < self.minimum_m


@dataclass(frozen=True)
class RopeBend:
    """Smallest bend radius of a rope, now and since the start (twin/run_record.py)."""

    now: Bend
    position_m: tuple[float, float, float]
    tightest: Bend  # smallest radius of all snapshots since the start
    # unstretched length of elements that are shorter now, where a stiff rope would be compressed
    compressed_m: float = 0.0


@dataclass(frozen=True)
class RopeSnapshot:
    """State of one of several ropes; rows run from its upper end (row 0) down."""

    name: str
    node_position_m: Vector  # (nodes, 3)
    node_tension_n: Vector  # (nodes,) mean of the neighbouring elements; ends as measured there
    element_tension_n: Vector  # (nodes - 1,)
    tension_top_n: float  # at the hang-off, connection or sheave at its upper end
    line_out_m: float  # unstretched length
    payout_speed_m_per_s: float  # + paying out
    error_interval: TensionInterval | None = None  # for ropes from the ship, if a run asks for it
    vibration: RopeVibration | None = None  # of a multi-line scene, as of the whole snapshot
    fatigue: MaterialFatigue | None = None  # likewise


@dataclass(frozen=True)
class PayloadSnapshot:
    """State of one of several payloads."""

    name: str
    position_m: Vector  # (3,)
    velocity_m_per_s: Vector  # (3,)


@dataclass(frozen=True)
class StrutSnapshot:
    """State of a bar between two payloads or connections."""

    name: str
    ends_m: Vector  # (2, 3)
    pull_n: float  # tension; negative: compression


@dataclass(frozen=True)
class SheaveSnapshot:
    """State of a sheave that a rope runs over."""

    name: str
    position_m: Vector  # (3,)
    passed_m: float  # unstretched length run over it into the first rope that ends there
    speed_m_per_s: float  # rate of passed_m


@dataclass(frozen=True)
class Snapshot:
    """One instant of the twin; rows run from the hang-off (row 0) down to the payload.

    In a multi-line scene these rows describe the first rope, with its lower end as payload. After a
    cut they describe the upper part; the payload is that of the lower part.

    Frame `map` (east, north, up; z = 0 at mean water level).
    """

    stamp_ns: int  # time since the twin's start [ns]
    step: int
    node_position_m: Vector  # (nodes, 3)
    node_velocity_m_per_s: Vector  # (nodes, 3)
    node_tension_n: Vector  # (nodes,) mean of the neighbouring elements; ends as measured there
    element_tension_n: Vector  # (nodes - 1,)
    arc_length_m: Vector  # (nodes,) unstretched, 0 at the hang-off
    tension_top_n: float  # tension at the hang-off, the magnitude of hang_off_force_n
    tension_top_min_n: float  # over the steps since the previous snapshot
    tension_top_max_n: float
    hang_off_force_n: Vector  # (3,) force of the rope on the hang-off
    tension_payload_n: float
    hang_off_position_m: Vector  # (3,)
    hang_off_velocity_m_per_s: Vector  # (3,)
    heave_m: float  # hang-off above its mean position
    payload_position_m: Vector  # (3,)
    payload_velocity_m_per_s: Vector  # (3,)
    line_out_m: float  # unstretched rope below the hang-off
    payout_speed_m_per_s: float  # + paying out
    motion_ramp: float  # build-up factor of the ship's motion, 0 to 1; 1: it lies still
    step_s: float = 0.0  # length of the newest step
    # factors on the forces of water, vortices and fairings, of a scene with a fluid ramp; else none
    fluid_factors: tuple[float, ...] = ()
    winch_at_limit: str = ""  # message if a limit of the winch is active
    not_converged: bool = False  # a step since the previous snapshot did not converge
    solver: SolverHealth = field(default_factory=SolverHealth)
    inputs: dict[str, InputHealth] = field(default_factory=dict)  # heave, winch_command, current
    study_error: KnownError = field(default_factory=KnownError)  # of the top tension, if known
    strength: tuple[RopeStrength, ...] = ()  # of each rope of the scene
    breaches: tuple[LimitBreach, ...] = ()  # limits of the scene exceeded since the start
    seabed: BedContact | None = None  # only of a scene with a seabed
    touchdowns: tuple[Touchdown, ...] = ()  # of the ropes that touch it
    landings: Landings | None = None  # None: no payload has landed
    contacts: tuple[ContactForce, ...] = ()  # of the effects of contact
    bends: tuple[RopeBend, ...] = ()  # of ropes with bending stiffness or a minimum bend radius
    body: BodySnapshot | None = None  # only of a scene whose payload is a rigid body
    compensator: CompensatorSnapshot | None = None  # only of a scene with one
    winches: tuple[WinchSnapshot, ...] = ()  # winches of the scene
    energy: EnergyBalance | None = None  # only of a run with an energy balance
    error_interval: TensionInterval | None = None  # if a run asks for it, once it is known
    no_error_interval: str = ""  # why a run that asks for it has none at present
    vibration: RopeVibration | None = None  # only of a run that asks for it, once it is known
    fatigue: MaterialFatigue | None = None  # only of a run that asks for it; of the first rope
    ropes: tuple[
        RopeSnapshot, ...
    ] = ()  # all ropes of a multi-line scene or after a cut; else none
    payloads: tuple[PayloadSnapshot, ...] = ()  # likewise
    struts: tuple[StrutSnapshot, ...] = ()  # likewise
    sheaves: tuple[SheaveSnapshot, ...] = ()  # likewise
    cut: CutSnapshot | None = None  # if a rope was cut
    lines: LinesSnapshot | None = None  # two lines around one sheave, at their last sampling
    line_events: tuple[LineEvent, ...] = ()  # line crossings that began or ended since then
    # force of the rope on its lower end, x, y, z, where the scene moves that end; else none
    lower_end_force_n: tuple[float, ...] = ()
    residuals: tuple[Residual, ...] = ()  # of measured quantities, once compared
    forecast_score: ForecastScore | None = None  # of received forecasts; None: none runs
    quality: tuple[Quality, ...] = ()  # index of each functional element

    @property
    def time_s(self) -> float:
        """Time since the twin's start [s]."""
        return self.stamp_ns * 1e-9


def amended(snapshot: Snapshot, **fields: Any) -> Snapshot:
    """Set fields of a snapshot that is still being built and not yet shared; return it.

    `dataclasses.replace` copies all fields, which takes as long as all the rest of a snapshot.
    """
    vars(snapshot).update(fields)
    return snapshot


def first_rope(snapshot: Snapshot, name: str) -> RopeSnapshot:
    """Return the first rope of a snapshot in the form of the other ropes."""
    return RopeSnapshot(
        name=name,
        node_position_m=snapshot.node_position_m,
        node_tension_n=snapshot.node_tension_n,
        element_tension_n=snapshot.element_tension_n,
        tension_top_n=snapshot.tension_top_n,
        line_out_m=snapshot.line_out_m,
        payout_speed_m_per_s=snapshot.payout_speed_m_per_s,
    )


def most_damaged(snapshot: Snapshot) -> tuple[str, MaterialFatigue] | None:
    """Return the rope with the largest damage ("" in a scene of one rope); None: not known."""
    known = [(rope.name, rope.fatigue) for rope in snapshot.ropes if rope.fatigue is not None]
    if not known:
        return None if snapshot.fatigue is None else ("", snapshot.fatigue)
    return max(known, key=lambda rope: float(rope[1].used.max()))


@dataclass(frozen=True)
class EnergyBalance:
    """Energy of rope and payload, its sources and its sinks, since the balance was opened [J].

    change = hang_off + passing + water - damped - residual.
    """

    since_s: float  # twin time at which the balance was opened
    kinetic_j: float  # now, with the added mass
    elastic_j: float
    potential_j: float  # weight less buoyancy, 0 at the mean water level
    change_j: float  # change of the sum of these three
    hang_off_j: float  # work of ship and winch: force times material velocity
    passing_j: float  # energy of rope paid out, less that of rope hauled in
    water_j: float  # work of the water: drag, mostly negative
    damped_j: float  # dissipated by the axial damper and a compensator, less what one drives
    residual_j: float  # remainder: numerical dissipation if positive
    exchanged_j: float  # energy moved between any two of these terms

    @property
    def residual_pct(self) -> float:
        """Residual as a percentage of the energy exchanged.

        While little was exchanged (a rope in static equilibrium, or just set in motion), the
        reference is a ten-thousandth of the stored energy: the residual is then its round-off, or
        that of the quadrature over few steps.
        """
        stored = abs(self.kinetic_j) + abs(self.elastic_j) + abs(self.potential_j)
        reference = max(self.exchanged_j, MIN_EXCHANGED_FRACTION * stored)
        return 100.0 * self.residual_j / reference if reference > 0.0 else 0.0

    def figures(self) -> dict[str, float]:
        """Return all values by name, with the residual in per cent."""
        return {**asdict(self), "residual_pct": self.residual_pct}


@dataclass(frozen=True)
class TensionInterval:
    """95 % discretisation-error interval of the top tension (`twin/error_interval.py`)."""

    low_n: float
    high_n: float
    bound_n: float  # half-width: bound of the error of tension_top_n; low_n is at least 0
    cost_pct: float  # CPU time of the interval, relative to all other work


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
        event = "the lines cross" if self.what == "cross" else "the lines part again"
        where = f"at {self.depth_m:.0f} m, {self.angle_deg:.2f} degrees"
        return f"{event} {where}, {self.gap_m:.2f} m apart"


@dataclass(frozen=True)
class Nearest:
    """Minimum distance of two lines at one instant."""

    time_s: float
    depth_m: float
    distance_m: float  # horizontal


@dataclass(frozen=True)
class LinesSnapshot:
    """Clearance of two lines around a sheave."""

    nearest: Nearest
    crossings: tuple[Crossing, ...]  # from the top down

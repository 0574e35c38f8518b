"""Schema of a scene: frozen dataclasses whose fields are the keys of the YAML file.

Every number has a description, unit and range (`quantity`), which the strict reader checks and
quotes in its errors. Effects have their own parameter classes (`rope_twin.effects`).
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any, Protocol, TypeVar, runtime_checkable

from rope_twin.effects.bending import BendingParams
from rope_twin.effects.payload import SplashZoneParams
from rope_twin.effects.payload_faces import FairingFace, NetPanels
from rope_twin.quantity import SparingRepr, quantity, text
from rope_twin.scene.instruments import Learning, Measured
from rope_twin.scene.rope_data import FatigueData, StiffnessTable
from rope_twin.scene.winch import Joint as Joint
from rope_twin.scene.winch import ScheduleRow as ScheduleRow
from rope_twin.scene.winch import Sheave as Sheave
from rope_twin.scene.winch import Strut as Strut
from rope_twin.scene.winch import Triple as Triple
from rope_twin.scene.winch import Winch as Winch
from rope_twin.sea.raos import NO_CONVENTIONS, RaoConventions
from rope_twin.sea.ship_motion import BoxHull

Fault = tuple[str, str, str]  # path in the scene's file, fault, remedy


@dataclass(frozen=True, kw_only=True)
class Rising:
    """Coefficients along z in ascent; the payload's own are then those of descent."""

    added_mass_kg: float | None = quantity("added mass in ascent", "kg", 0.0, 1e8, default=None)
    drag_area_m2: float | None = quantity(
        "drag coefficient times area in ascent", "m²", 0.0, 1e5, default=None
    )

    def check(self) -> str | None:
        """Return a fault if neither is given, or None."""
        if self.added_mass_kg is None and self.drag_area_m2 is None:
            return "no value is given; give added_mass_kg or drag_area_m2, or remove the key"
        return None


@runtime_checkable
class TwoWayShape(Protocol):
    """A shape with another drag in ascent than in descent."""

    def rising_drag_area_m2(self) -> float:
        """Return drag coefficient times projected area along z in ascent [m²]."""


STEEL_KG_PER_M3 = 7850.0  # density of masses "in air, of steel"
WINCH = "winch"  # the name by which ropes call the ship's first hang-off


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
    period_s: float = quantity("period", "s", 0.2, 100.0)


@dataclass(frozen=True, kw_only=True, repr=False)
class OnWaves(SparingRepr):
    """Ship moved by RAOs in the waves of the effect `waves`: same components, same phases."""

    _later = frozenset(("crane_tip_m", "conventions"))

    hull: BoxHull = text("box-like hull in head seas, heave only", BoxHull())
    responses: str = text(
        "RAOs in six degrees of freedom: name in config/responses/, or path of a CSV, OrcaFlex "
        "YAML, WAMIT .4 or Capytaine netCDF file", "",
    )  # fmt: skip
    heading_deg: float = quantity(
        "heading of the bow with `responses`: 0 east, 90 north", "°", -360.0, 360.0, default=0.0
    )
    crane_tip_m: Triple | None = quantity(
        "hang-off (crane tip) in the axes of the RAO file: x forward, y to port, z up; instead of "
        "ship.reference_m", "m", -1e3, 1e3, default=None,
    )  # fmt: skip
    conventions: RaoConventions = text(
        "conventions that the RAO file does not state", NO_CONVENTIONS
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
        prescribed = bool(self.path or self.poses)
        return prescribed or (self.on_waves is not None and bool(self.on_waves.responses))

    @property
    def moves(self) -> bool:
        """Return whether the ship moves."""
        return bool(self.bag or self.path or self.heave or self.on_waves or self.poses)


@dataclass(frozen=True, kw_only=True)
class Limits:
    """Limits of every rope and payload of the scene; a run that exceeds one ends with code 4."""

    tension_n: float | None = quantity("maximum tension of a rope", "N", 1.0, 1e9, default=None)
    utilisation: float = quantity(
        "maximum utilisation: tension over MBL, the highest of the rope's sections", "",
        1e-3, 100.0, default=1.0,
    )  # fmt: skip
    min_tension_n: float | None = quantity(
        "minimum tension along a rope; below it the line counts as slack", "N", 0.1, 1e9,
        default=None,
    )  # fmt: skip
    strain: float = quantity(
        "maximum strain, from the maximum tension and the rope's stiffness", "", 1e-4, 1.0,
        default=0.1,
    )  # fmt: skip
    bend_radius: bool = text("apply the ropes' minimum_bend_radius_m as a limit", False)
    payload_speed_m_per_s: float | None = quantity(
        "maximum speed of a payload", "m/s", 1e-3, 1e2, default=None
    )
    payload_depth_m: float | None = quantity(
        "maximum depth of a payload below the mean water level", "m", 0.0, 1.2e4, default=None
    )
    landing_speed_m_per_s: float | None = quantity(
        "maximum landing velocity of a payload on the seabed", "m/s", 1e-3, 1e2, default=None
    )
    bed_clearance_m: float | None = quantity(
        "minimum height of a payload above the seabed", "m", 1e-3, 1.2e4, default=None
    )
    line_clearance_m: float | None = quantity(
        "minimum horizontal distance of the two lines around a sheave", "m", 1e-3, 1e3,
        default=None,
    )  # fmt: skip


Params = TypeVar("Params")


@dataclass(frozen=True, kw_only=True)
class Rope:
    """Rope properties: a preset by name (config/ropes.yaml) or given in the scene."""

    diameter_m: float = quantity("nominal diameter", "m", 1e-3, 3.0)
    mass_kg_per_m: float = quantity("mass in air", "kg/m", 1e-3, 5e3)
    hydrodynamic_diameter_m: float = quantity(
        "hydrodynamic diameter (drag and volume)", "m", 1e-3, 3.0
    )
    axial_stiffness_n: float | None = quantity("axial stiffness EA", "N", 1e3, 1e12, default=None)
    axial_stiffness: StiffnessTable | None = text("stiffness table instead of EA", None)
    breaking_load_n: float = quantity("minimum breaking load MBL", "N", 1e2, 1e9)
    minimum_bend_radius_m: float | None = quantity(
        "minimum bend radius MBR; smaller radii are reported", "m", 1e-3, 1e3,
        default=None, only_judges=True,
    )  # fmt: skip
    drag_normal: float | None = quantity(
        "normal drag coefficient on the nominal diameter, instead of the scene's",
        "", 0.0, 10.0, default=None,
    )  # fmt: skip
    drag_tangential: float | None = quantity(
        "tangential drag coefficient on π times the nominal diameter, instead of the scene's",
        "", 0.0, 1.0, default=None,
    )  # fmt: skip
    about: str = text("description", "")
    source: str = text("source of the data", "")

    def check(self) -> str | None:
        """Return a fault unless exactly one stiffness is given, or None."""
        if (self.axial_stiffness_n is None) != (self.axial_stiffness is None):
            return None
        count = "no" if self.axial_stiffness is None else "a second"
        return (
            f"{count} axial stiffness is given; "
            "give axial_stiffness_n (EA) or axial_stiffness (a table), not both"
        )

    def strain_at(self, tension_n: float) -> float:
        """Return the strain under a static tension [N]; 0 without tension."""
        if self.axial_stiffness is not None:
            return self.axial_stiffness.strain_at(tension_n)
        return max(tension_n, 0.0) / self.tangent_n(tension_n)

    def tangent_n(self, tension_n: float) -> float:
        """Return the tangent EA at a static tension [N]."""
        if self.axial_stiffness is not None:
            return self.axial_stiffness.tangent_n(tension_n)
        assert self.axial_stiffness_n is not None, "checked when the scene was read"
        return self.axial_stiffness_n

    def dynamic_n(self, tension_n: float) -> float:
        """Return the stiffness [N] that fast motion about a static tension [N] meets."""
        if self.axial_stiffness is not None:
            return self.axial_stiffness.dynamic_n(tension_n)
        return self.tangent_n(tension_n)

    @property
    def is_fibre(self) -> bool:
        """Return whether the rope has a dynamic stiffness beside its static curve."""
        return self.axial_stiffness is not None and self.axial_stiffness.dynamic is not None


@dataclass(frozen=True, kw_only=True)
class RopeSection:
    """One section of a rope made of several materials."""

    rope: Rope = text("preset name, or its properties")
    length_m: float | None = quantity(
        "unstretched length; optional for the topmost section", "m", 0.5, 2e4, default=None
    )
    fatigue: FatigueData | None = text(
        "fatigue data of the section, instead of the rope's", None, only_judges=True
    )


@dataclass(frozen=True, kw_only=True)
class Grading:
    """Graded mesh near the lower end; exactly one of the first two."""

    lowest_m: float | None = quantity("length of the lowest element", "m", 0.05, 1e3, default=None)
    nodes_m: tuple[float, ...] | None = quantity(
        "unstretched distances of the lowest nodes from the lower end", "m", 0.01, 2e4,
        default=None,
    )  # fmt: skip
    growth: float = quantity(
        "length ratio of successive elements, up to the equal ones", "",
        1.01, 10.0, default=1.3,
    )  # fmt: skip


@dataclass(frozen=True, kw_only=True)
class Damping:
    """Structural damping; exactly one of the three."""

    newton_seconds: float | None = quantity(
        "c in T = EA·strain + c·strain rate", "N·s", 0.0, 1e10, default=None
    )
    fraction_of_first_axial_mode: float | None = quantity(
        "damping ratio of the first axial mode of rope and payload", "", 0.0, 0.5,
        default=None,
    )  # fmt: skip
    fraction_of_one_element: float | None = quantity(
        "damping ratio of a single element: depends on the mesh", "", 0.0, 2.0,
        default=None,
    )  # fmt: skip


@dataclass(frozen=True, kw_only=True)
class EndHarmonic:
    """Sine of the motion of a rope's lower end."""

    amplitude_m: Triple = quantity("amplitude along x, y, z", "m", -100.0, 100.0)
    period_s: float = quantity("period", "s", 0.5, 1e4)
    phase_deg: float = quantity("phase of the sine at t = 0", "°", -360.0, 360.0, default=0.0)


@dataclass(frozen=True, kw_only=True)
class EndMotion:
    """Motion of a rope's fixed lower end about its place; one of harmonics and from_outside."""

    harmonics: tuple[EndHarmonic, ...] = text("sum of sines", ())
    ramp_s: float = quantity("build-up time of the harmonics", "s", 0.1, 600.0, default=8.0)
    from_outside: bool = text(
        "another simulator moves it: lower_end/odometry, or the inputs of an FMU", False
    )

    def check(self) -> str | None:
        """Return a fault unless exactly one is given, or None."""
        if self.from_outside == (not self.harmonics):
            return None
        problem = "harmonics and from_outside" if self.harmonics else "neither of both"
        return f"{problem}; give harmonics, or from_outside: true"


@dataclass(frozen=True, kw_only=True, repr=False)
class RopeLine(SparingRepr):
    """One rope of the scene: winch to payload or fixed point, or between connections."""

    _later = frozenset(("end_motion",))
    _no_figures = frozenset(("fatigue",))  # it judges, and moves nothing

    name: str = text("name of the rope")
    from_: str = text("upper end: the winch, a hang-off, a joint or payload", WINCH)
    rope: Rope | None = text("preset name, or its properties", None)
    sections: tuple[RopeSection, ...] = text(
        "instead of `rope`: sections from the lower end up", ()
    )
    length_m: float = quantity("initial paid-out length, unstretched", "m", 1.0, 2e4)
    elements: int = quantity("initial number of elements", "", 3, 20000)
    damping: Damping = text("structural damping")
    to: str = text("payload or joint at the lower end; empty if fixed", "")
    fixed_at_m: Triple | None = quantity(
        "lower end fixed at x, y, z instead of a payload", "m", -2e4, 2e4, default=None
    )
    end_motion: EndMotion | None = text("motion of a fixed lower end; default: at rest", None)
    grading: Grading | None = text("graded mesh near the lower end; default: equal elements", None)
    bending: BendingParams | None = text(
        "multi-line scenes: its own bending stiffness, instead of the effect's", None
    )
    fatigue: FatigueData | None = text(
        "fatigue data of the rope, used by `--fatigue` alone", None, only_judges=True
    )

    @property
    def made_of(self) -> tuple[RopeSection, ...]:
        """Return its sections from the lower end up; a single one without a length if uniform."""
        return (RopeSection(rope=self.rope),) if self.rope is not None else self.sections

    @property
    def is_led(self) -> bool:
        """Return whether another simulator moves its lower end."""
        return self.end_motion is not None and self.end_motion.from_outside

    @cached_property
    def breaking_load_n(self) -> float:
        """Return the MBL of the weakest section [N]."""
        return min(section.rope.breaking_load_n for section in self.made_of)

    def lengths_m(self, line_out_m: float) -> list[float]:
        """Return the paid-out length of each section; the topmost one is unlimited."""
        lengths, remaining = [], line_out_m
        for number, section in enumerate(self.made_of, start=1):
            last = number == len(self.made_of) or section.length_m is None
            lengths.append(remaining if last else min(section.length_m or 0.0, remaining))
            remaining -= lengths[-1]
        return lengths


@dataclass(frozen=True, kw_only=True)
class FlexibleNet:
    """A net with nodes of its own between ropes, which carries tension from rope to rope."""

    name: str = text("name of the net")
    between: tuple[str, ...] = text("ropes that hold it, side by side, at least two")
    from_m: float = quantity(
        "lower edge of the net, from the lower end of each rope", "m", 0.0, 1e3, default=0.0
    )
    to_m: float = quantity("upper edge of the net, likewise", "m", 0.1, 1e3)
    width_m: float = quantity("unstretched width from one rope to the next", "m", 0.1, 500.0)
    columns: int = quantity("panels across, from one rope to the next", "", 1, 12, default=3)
    rows: int = quantity("panels in height", "", 1, 12, default=3)
    twine_m: float = quantity("diameter of the twine", "m", 1e-4, 0.05)
    bar_m: float = quantity("half-mesh (bar) length, knot to knot", "m", 1e-3, 2.0)
    twine_kg_per_m3: float = quantity(
        "density of the twine: polyamide 1140, polyethylene 950, polyester 1380", "kg/m³", 500.0,
        8000.0, default=1140.0,
    )  # fmt: skip
    twine_stiffness_n: float = quantity("axial stiffness EA of one twine", "N", 1.0, 1e8)
    twine_breaking_load_n: float = quantity("breaking load of one twine", "N", 1.0, 1e7)
    damping: Damping = text("structural damping of the twines of a border between panels")
    law: str = text("force law: aarsnes or loeland", "loeland")


class Shape(Protocol):
    """Interface of a payload's shape; axes x, y lateral, z vertical."""

    def volume_m3(self) -> float:
        """Return the displaced volume [m³]."""

    def added_mass_m3(self) -> Triple:
        """Return added mass over water density along x, y, z [m³]."""

    def drag_area_m2(self) -> Triple:
        """Return drag coefficient times projected area along x, y, z [m²]."""


@dataclass(frozen=True, kw_only=True, repr=False)
class Payload(SparingRepr):
    """A suspended payload; `shape` gives volume, added mass and drag, which keys override."""

    _spared = frozenset(("net", "fairing"))

    name: str = text("name of the payload")
    mass_kg: float = quantity("mass in air", "kg", 0.0, 1e7)
    shape: Shape | None = text("shape, as `box: {...}`", None)
    displaced_volume_m3: float | None = quantity("displaced volume", "m³", 0.0, 1e5, default=None)
    added_mass_kg: Triple | None = quantity(
        "added mass along x, y, z", "kg", 0.0, 1e8, default=None
    )
    drag_area_m2: Triple | None = quantity(
        "drag coefficient times area along x, y, z", "m²", 0.0, 1e5, default=None
    )
    rising: Rising | None = text("coefficients along z in ascent, if different", None)
    splash_zone: SplashZoneParams | None = text(
        "multi-line scenes: its own size, instead of the effect's", None
    )
    net: NetPanels | None = text("multi-line scenes: its own net, instead of the effect's", None)
    fairing: FairingFace | None = text(
        "multi-line scenes: its own fairing, instead of the effect's", None
    )


@dataclass(frozen=True, kw_only=True)
class HangOff:
    """Another point where a rope leaves the ship; it moves with the ship."""

    name: str = text("name of the hang-off")
    at_m: Triple = quantity("mean position: x, y, z", "m", -1e4, 1e4)
    winch: Winch | None = text("its winch; default: constant length", None)


@dataclass(frozen=True, kw_only=True)
class Ship:
    """Hang-off (crane tip or overboarding sheave), and build-up of the ship's motion."""

    hang_off_m: Triple = quantity(
        "mean position of the hang-off (crane tip): x, y, z", "m", -1e4, 1e4,
        default=(0.0, 0.0, 0.0),
    )  # fmt: skip
    reference_m: Triple | None = quantity(
        "mean position of the pose's reference point: x, y, z; default: hang-off", "m", -1e4, 1e4,
        default=None,
    )  # fmt: skip
    motion_ramp_s: float = quantity(
        "build-up time of the ship's motion", "s", 0.0, 600.0, default=8.0
    )
    max_heave_m: float = quantity(
        "maximum heave of a hang-off; larger samples are rejected", "m", 0.1, 30.0,
        default=15.0, only_judges=True,
    )  # fmt: skip
    max_hang_off_speed_m_per_s: float = quantity(
        "maximum speed of a hang-off; samples beyond are rejected", "m/s", 0.1, 15.0,
        default=7.0, only_judges=True,
    )  # fmt: skip
    max_hang_off_acceleration_m_per_s2: float = quantity(
        "maximum acceleration of a hang-off; samples beyond are rejected", "m/s²",
        0.1, 50.0, default=7.0, only_judges=True,
    )  # fmt: skip


@dataclass(frozen=True, kw_only=True)
class Environment:
    """Water density and gravity."""

    water_density_kg_per_m3: float = quantity("water density", "kg/m³", 0.0, 1500.0,
                                              default=1025.0)  # fmt: skip
    gravity_m_per_s2: float = quantity("gravity", "m/s²", 0.0, 30.0, default=9.80665)


@dataclass(frozen=True, kw_only=True)
class Time:
    """Time step and solver tolerance."""

    step_s: float = quantity("time step", "s", 1e-5, 0.2)
    newton_tolerance_n: float | None = quantity(
        "largest tension mismatch of an accepted stage; default 0.3 % of the static top tension, "
        "1 to 500 N", "N", 1e-6, 1e4, default=None,
    )  # fmt: skip


@dataclass(frozen=True, kw_only=True)
class AcceptedWarning:
    """A warning of `scene check` that the scene's author has accepted."""

    key: str = text("key of the warning as printed, like time.step_s")
    says: str = text("words of the warning")
    reason: str = text("justification")

    def check(self) -> str | None:
        """Return a fault if a field is empty, or None."""
        if self.key and self.says and self.reason:
            return None
        return "key, says or reason is empty; name one warning, and why it is accepted"

    def matches(self, warning: str) -> bool:
        """Return whether this is the warning."""
        return warning.startswith(f"{self.key}: ") and self.says in warning


@dataclass(frozen=True, kw_only=True)
class Scene:
    """A scene as written in its file, before anything is built from it."""

    name: str
    path: Path
    digest: str  # SHA-256 of the file's text
    about: str = text("description in one line")
    source: str = text("source of the data", "")
    look_at: str = text("what to look at in the results", "")
    ropes: tuple[RopeLine, ...] = text("the ropes")
    payloads: tuple[Payload, ...] = text("the payloads", ())
    joints: tuple[Joint, ...] = text("connections of ropes without a payload", ())
    nets: tuple[FlexibleNet, ...] = text("flexible nets between ropes", ())
    struts: tuple[Strut, ...] = text("spreader bars between payloads or joints", ())
    sheaves: tuple[Sheave, ...] = text("sheaves over which two ropes run as one", ())
    hang_offs: tuple[HangOff, ...] = text("further points where ropes leave the ship", ())
    winch: Winch | None = text("winch; default: constant length", None)
    ship: Ship = text("the ship", Ship())
    sea_state: SeaState = text("motion of the ship", SeaState())
    environment: Environment = text("water and gravity", Environment())
    effects: tuple[Any, ...] = text("load models, each as `- drag: {...}`", ())
    time: Time = text("time step and tolerance")
    accept: tuple[AcceptedWarning, ...] = text("accepted warnings of `scene check`", ())
    limits: Limits = text("limits of ropes and payloads", Limits())
    measured: Measured = text("instruments that measure tension, line out and depth", Measured())
    learning: Learning = text(
        "standard uncertainties from which a lift is learned", Learning(), only_judges=True
    )

    def listed(self, kind: type[Params]) -> Params | None:
        """Return the parameters of an effect by their class; None if the scene does not list it."""
        return next((effect for effect in self.effects if isinstance(effect, kind)), None)


Rule = Callable[[Scene], Iterator[Fault]]  # yields the faults of a scene by one relation

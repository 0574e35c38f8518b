"""What a scene is: frozen dataclasses whose fields are the keys of the YAML file.

Every number carries its meaning, unit and range (`quantity`), which the strict reader checks and
quotes in its errors. Effects bring their own parameter classes (`rope_twin.effects`).
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any, Protocol, TypeVar

from rope_twin.effects.bending import BendingParams
from rope_twin.effects.splash_zone import SplashZoneParams
from rope_twin.quantity import quantity, text
from rope_twin.scene.limits import Limits
from rope_twin.scene.rigging import WINCH, Joint, Sheave, Strut
from rope_twin.scene.rising import Rising
from rope_twin.scene.sea_state import SeaState
from rope_twin.scene.stiffness import StiffnessTable
from rope_twin.scene.winch import ScheduleRow as ScheduleRow
from rope_twin.scene.winch import Winch as Winch

Triple = tuple[float, float, float]
Params = TypeVar("Params")


@dataclass(frozen=True, kw_only=True)
class Rope:
    """A kind of rope: a preset by name (config/ropes.yaml) or written out in the scene."""

    diameter_m: float = quantity("nominal diameter", "m", 1e-3, 3.0)
    mass_kg_per_m: float = quantity("mass in air", "kg/m", 1e-3, 5e3)
    hydrodynamic_diameter_m: float = quantity("diameter for drag and volume", "m", 1e-3, 3.0)
    axial_stiffness_n: float | None = quantity("axial stiffness EA", "N", 1e3, 1e12, default=None)
    axial_stiffness: StiffnessTable | None = text("a table in its place", None)
    breaking_load_n: float = quantity("minimum breaking load", "N", 1e2, 1e9)
    minimum_bend_radius_m: float | None = quantity(
        "radius below which no bend of it may be; told of where one is", "m", 1e-3, 1e3,
        default=None, only_judges=True,
    )  # fmt: skip
    drag_normal: float | None = quantity(
        "drag coefficient across it on its nominal diameter, in place of the scene's",
        "", 0.0, 10.0, default=None,
    )  # fmt: skip
    drag_tangential: float | None = quantity(
        "drag coefficient along it on π times its nominal diameter, in place of the scene's",
        "", 0.0, 1.0, default=None,
    )  # fmt: skip
    about: str = text("what it is", "")
    source: str = text("where the figures come from", "")

    def check(self) -> str | None:
        """Exactly one of the two stiffnesses."""
        if (self.axial_stiffness_n is None) != (self.axial_stiffness is None):
            return None
        given = "no" if self.axial_stiffness is None else "a second"
        return (
            f"{given} axial stiffness is given; "
            "give axial_stiffness_n (EA) or axial_stiffness (a table), not both"
        )

    def strain_at(self, tension_n: float) -> float:
        """Strain under a static tension [N]; 0 where there is none."""
        if self.axial_stiffness is not None:
            return self.axial_stiffness.strain_at(tension_n)
        return max(tension_n, 0.0) / self.tangent_n(tension_n)

    def tangent_n(self, tension_n: float) -> float:
        """EA for small changes about a static tension [N]."""
        if self.axial_stiffness is not None:
            return self.axial_stiffness.tangent_n(tension_n)
        assert self.axial_stiffness_n is not None, "checked when it was read"
        return self.axial_stiffness_n


@dataclass(frozen=True, kw_only=True)
class RopeSection:
    """One of several ropes that are joined into one."""

    rope: Rope = text("preset name, or the figures themselves")
    length_m: float | None = quantity(
        "its unstretched length; the topmost may leave it out", "m", 0.5, 2e4, default=None
    )


@dataclass(frozen=True, kw_only=True)
class Grading:
    """Elements of other than equal length near the lower end; exactly one of the first two."""

    lowest_m: float | None = quantity("length of the lowest element", "m", 0.05, 1e3, default=None)
    nodes_m: tuple[float, ...] | None = quantity(
        "unstretched lengths from the lower end up to the first nodes above it", "m", 0.01, 2e4,
        default=None,
    )  # fmt: skip
    growth: float = quantity(
        "each element above the lowest is so many times the one below, up to the equal ones", "",
        1.01, 10.0, default=1.3,
    )  # fmt: skip


@dataclass(frozen=True, kw_only=True)
class Damping:
    """Structural damping; exactly one of the three."""

    newton_seconds: float | None = quantity(
        "c in T = EA·strain + c·strain rate", "N·s", 0.0, 1e10, default=None
    )
    fraction_of_first_axial_mode: float | None = quantity(
        "fraction of critical on the first axial mode of rope and payload", "", 0.0, 0.5,
        default=None,
    )  # fmt: skip
    fraction_of_one_element: float | None = quantity(
        "fraction of critical of a single element: changes with their number", "", 0.0, 2.0,
        default=None,
    )  # fmt: skip


@dataclass(frozen=True, kw_only=True)
class RopeLine:
    """One rope of the scene, from the winch to a payload or to a fixed point, or between others."""

    name: str = text("its name")
    from_: str = text("where its upper end is: the winch, a hang-off, a joint or payload", WINCH)
    rope: Rope | None = text("preset name, or the figures themselves", None)
    sections: tuple[RopeSection, ...] = text(
        "in place of `rope`: the ropes it is joined from, from the lower end up", ()
    )
    length_m: float = quantity("line out at the start, unstretched", "m", 1.0, 2e4)
    elements: int = quantity("number of elements at the start", "", 3, 20000)
    damping: Damping = text("structural damping")
    to: str = text("payload or joint at its lower end; empty if fixed", "")
    fixed_at_m: Triple | None = quantity(
        "lower end held at x, y, z instead of a payload", "m", -2e4, 2e4, default=None
    )
    grading: Grading | None = text("shorter elements near the lower end; absent: equal", None)
    bending: BendingParams | None = text(
        "where ropes meet: its own, in place of the effect's", None
    )

    @property
    def made_of(self) -> tuple[RopeSection, ...]:
        """Its sections from the lower end up; one without a length if it is all of one rope."""
        return (RopeSection(rope=self.rope),) if self.rope is not None else self.sections

    @property
    def thinnest_m(self) -> float:
        """Hydrodynamic diameter of the thinnest section."""
        return min(section.rope.hydrodynamic_diameter_m for section in self.made_of)

    @cached_property
    def breaking_load_n(self) -> float:
        """MBL of the weakest section [N]."""
        return min(section.rope.breaking_load_n for section in self.made_of)

    def lengths_m(self, line_out_m: float) -> list[float]:
        """How much of each section is out; the topmost goes on as far as the line out does."""
        lengths, left = [], line_out_m
        for number, section in enumerate(self.made_of, start=1):
            last = number == len(self.made_of) or section.length_m is None
            lengths.append(left if last else min(section.length_m or 0.0, left))
            left -= lengths[-1]
        return lengths


class Shape(Protocol):
    """What a payload's shape tells; axes x, y lateral, z vertical."""

    def volume_m3(self) -> float:
        """Displaced volume [m³]."""

    def added_mass_m3(self) -> Triple:
        """Added mass over the water's density along x, y, z [m³]."""

    def drag_area_m2(self) -> Triple:
        """Drag coefficient times projected area along x, y, z [m²]."""


@dataclass(frozen=True, kw_only=True)
class Payload:
    """What hangs on the rope. `shape` gives volume, added mass and drag; explicit keys win."""

    name: str = text("its name")
    mass_kg: float = quantity("mass in air", "kg", 0.0, 1e7)
    shape: Shape | None = text("one of the shapes, as `box: {...}`", None)
    displaced_volume_m3: float | None = quantity("volume", "m³", 0.0, 1e5, default=None)
    added_mass_kg: Triple | None = quantity(
        "added mass along x, y, z", "kg", 0.0, 1e8, default=None
    )
    drag_area_m2: Triple | None = quantity(
        "drag coefficient times area along x, y, z", "m²", 0.0, 1e5, default=None
    )
    rising: Rising | None = text("along z while it rises, if other than while it sinks", None)
    splash_zone: SplashZoneParams | None = text(
        "where ropes meet: its size, in place of the effect's", None
    )


@dataclass(frozen=True, kw_only=True)
class HangOff:
    """Another place where a rope leaves the ship; it moves with the ship."""

    name: str = text("its name")
    at_m: Triple = quantity("at rest: x, y, z", "m", -1e4, 1e4)
    winch: Winch | None = text("its winch; absent: the line out never changes", None)


@dataclass(frozen=True, kw_only=True)
class Ship:
    """Where the rope leaves the ship, and how its motion is faded in at the start."""

    hang_off_m: Triple = quantity(
        "hang-off at rest: x, y, z", "m", -1e4, 1e4, default=(0.0, 0.0, 0.0)
    )
    reference_m: Triple | None = quantity(
        "point whose pose is told, at rest: x, y, z; absent: the hang-off itself", "m", -1e4, 1e4,
        default=None,
    )  # fmt: skip
    motion_ramp_s: float = quantity(
        "the start from rest: motion fades in over this time", "s", 0.0, 600.0, default=8.0
    )
    max_heave_m: float = quantity(
        "largest heave of a hang-off up or down; samples beyond it are refused", "m", 0.1, 30.0,
        default=15.0, only_judges=True,
    )  # fmt: skip
    max_hang_off_speed_m_per_s: float = quantity(
        "highest speed of a hang-off; samples that would need more are refused", "m/s", 0.1, 15.0,
        default=7.0, only_judges=True,
    )  # fmt: skip
    max_hang_off_acceleration_m_per_s2: float = quantity(
        "highest acceleration of a hang-off; samples that would need more are refused", "m/s²",
        0.1, 50.0, default=7.0, only_judges=True,
    )  # fmt: skip


@dataclass(frozen=True, kw_only=True)
class Environment:
    """Water and gravity."""

    water_density_kg_per_m3: float = quantity("density of the water", "kg/m³", 0.0, 1500.0,
                                              default=1025.0)  # fmt: skip
    gravity_m_per_s2: float = quantity("gravity", "m/s²", 0.0, 30.0, default=9.80665)


@dataclass(frozen=True, kw_only=True)
class Time:
    """The step and how exactly it is solved."""

    step_s: float = quantity("time step", "s", 1e-5, 0.2)
    newton_tolerance_n: float | None = quantity(
        "largest tension mismatch of an accepted stage; default 0.3 % of the static top tension, "
        "1 to 500 N", "N", 1e-6, 1e4, default=None,
    )  # fmt: skip


@dataclass(frozen=True, kw_only=True)
class AcceptedWarning:
    """A warning of `scene check` that the scene's author has judged."""

    key: str = text("where the warning stands, as it is printed, like time.step_s")
    says: str = text("words of the warning")
    reason: str = text("why the scene is right as it is")

    def check(self) -> str | None:
        """Nothing is accepted without naming it."""
        if self.key and self.says and self.reason:
            return None
        return "key, says or reason is empty; name one warning, and why it is accepted"

    def matches(self, warning: str) -> bool:
        """Whether this is the warning."""
        return warning.startswith(f"{self.key}: ") and self.says in warning


@dataclass(frozen=True, kw_only=True)
class Scene:
    """A whole scene as written, before anything is built from it."""

    name: str
    path: Path
    digest: str  # SHA-256 of the file's text
    about: str = text("one line: what this is")
    source: str = text("where the figures come from", "")
    look_at: str = text("what to look at", "")
    ropes: tuple[RopeLine, ...] = text("the ropes")
    payloads: tuple[Payload, ...] = text("the payloads", ())
    joints: tuple[Joint, ...] = text("where ropes meet without a payload", ())
    struts: tuple[Strut, ...] = text("bars between payloads or joints", ())
    sheaves: tuple[Sheave, ...] = text("where rope runs from one rope into another", ())
    hang_offs: tuple[HangOff, ...] = text("where further ropes leave the ship", ())
    winch: Winch | None = text("the winch; absent: the line out never changes", None)
    ship: Ship = text("the ship", Ship())
    sea_state: SeaState = text("the sea that moves the ship", SeaState())
    environment: Environment = text("water and gravity", Environment())
    effects: tuple[Any, ...] = text("what is simulated, each as `- drag: {...}`", ())
    time: Time = text("step and tolerance")
    accept: tuple[AcceptedWarning, ...] = text("warnings of `scene check` that are accepted", ())
    limits: Limits = text("what ropes and payloads must stay within", Limits())

    def listed(self, kind: type[Params]) -> Params | None:
        """The parameters of an effect, told by their class; None if the scene does not list it."""
        return next((own for own in self.effects if isinstance(own, kind)), None)

"""Schema of a scene: frozen dataclasses whose fields are the keys of the YAML file.

Every number has a description, unit and range (`quantity`), which the strict reader checks and
quotes in its errors. Effects have their own parameter classes (`rope_twin.effects`).
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
        given = "no" if self.axial_stiffness is None else "a second"
        return (
            f"{given} axial stiffness is given; "
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


@dataclass(frozen=True, kw_only=True)
class RopeSection:
    """One section of a rope made of several materials."""

    rope: Rope = text("preset name, or its properties")
    length_m: float | None = quantity(
        "unstretched length; optional for the topmost section", "m", 0.5, 2e4, default=None
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
class RopeLine:
    """One rope of the scene: winch to payload or fixed point, or between connections."""

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
    grading: Grading | None = text("graded mesh near the lower end; default: equal elements", None)
    bending: BendingParams | None = text(
        "multi-line scenes: its own bending stiffness, instead of the effect's", None
    )

    @property
    def made_of(self) -> tuple[RopeSection, ...]:
        """Return its sections from the lower end up; a single one without a length if uniform."""
        return (RopeSection(rope=self.rope),) if self.rope is not None else self.sections

    @property
    def thinnest_m(self) -> float:
        """Return the hydrodynamic diameter of the thinnest section."""
        return min(section.rope.hydrodynamic_diameter_m for section in self.made_of)

    @cached_property
    def breaking_load_n(self) -> float:
        """Return the MBL of the weakest section [N]."""
        return min(section.rope.breaking_load_n for section in self.made_of)

    def lengths_m(self, line_out_m: float) -> list[float]:
        """Return the paid-out length of each section; the topmost one is unlimited."""
        lengths, left = [], line_out_m
        for number, section in enumerate(self.made_of, start=1):
            last = number == len(self.made_of) or section.length_m is None
            lengths.append(left if last else min(section.length_m or 0.0, left))
            left -= lengths[-1]
        return lengths


class Shape(Protocol):
    """Interface of a payload's shape; axes x, y lateral, z vertical."""

    def volume_m3(self) -> float:
        """Return the displaced volume [m³]."""

    def added_mass_m3(self) -> Triple:
        """Return added mass over water density along x, y, z [m³]."""

    def drag_area_m2(self) -> Triple:
        """Return drag coefficient times projected area along x, y, z [m²]."""


@dataclass(frozen=True, kw_only=True)
class Payload:
    """A suspended payload; `shape` gives volume, added mass and drag, which keys override."""

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
        "mean position of the hang-off (crane tip): x, y, z",
        "m",
        -1e4,
        1e4,
        default=(0.0, 0.0, 0.0),
    )
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

    def listed(self, kind: type[Params]) -> Params | None:
        """Return the parameters of an effect by their class; None if the scene does not list it."""
        return next((own for own in self.effects if isinstance(own, kind)), None)

"""Input decks of MoorDyn 2 and CableDyn, which reads nearly the same format, from a scene.

Both refer the drag coefficients to the diameter of the displaced volume, as a scene does, the axial
one to π times it, and have damping in N·s. A scene that a deck cannot represent is rejected.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from rope_twin.effects.current import CurrentParams
from rope_twin.effects.drag import DragParams
from rope_twin.effects.payload import PayloadParams
from rope_twin.effects.rope_mass import AddedMassParams, WeightParams
from rope_twin.errors import InputError
from rope_twin.interchange.moordyn import ABOVE_M
from rope_twin.interchange.moordyn_deck import (
    COUPLED,
    FREE,
    RULE,
    Deck,
    Line,
    LineType,
    Point,
    current_text,
    deck_text,
)
from rope_twin.scene.schema import Payload, Scene

TITLE = "rope_twin, bench peers"
SAYS = (AddedMassParams, CurrentParams, DragParams, PayloadParams, WeightParams)


@dataclass(frozen=True)
class Figures:
    """Properties in both decks, in SI units."""

    diameter: float  # that of the volume
    mass: float  # per metre
    EA: float
    length: float
    damping: float  # N·s
    Cdn: float
    Cdt: float
    Ca: float
    load: float  # the payload's mass
    volume: float
    area: float  # drag coefficient times area
    load_Ca: float  # added mass over displaced mass
    density: float
    gravity: float
    profile: tuple[tuple[float, tuple[float, float]], ...]  # z and velocity, from the surface down
    EI: float = 0.0
    lift: float = 0.0  # of MoorDyn's synchronisation model, with its own band; 0: without it

    @property
    def wave_speed(self) -> float:
        """Return the speed of axial waves [m/s]: √(EA/m)."""
        return math.sqrt(self.EA / self.mass)

    def frequency(self, segments: int) -> float:
        """Return the highest axial frequency of one element [rad/s]: 2·√(EA/m)/l0."""
        return 2.0 * self.wave_speed * segments / self.length

    def damping_ratio(self, segments: int) -> float:
        """Return the damping ratio of that mode: c·√(EA/m)/(EA·l0)."""
        return self.damping * self.wave_speed * segments / (self.EA * self.length)

    @property
    def hanging_m(self) -> float:
        """Return the depth of the lower end at rest: L + (W + w·L/2)·L/EA."""
        area = 0.25 * math.pi * self.diameter**2
        rope = 0.5 * (self.mass - self.density * area) * self.length
        pull = (self.load - self.density * self.volume + rope) * self.gravity
        return self.length * (1.0 + pull / self.EA)


def figures(scene: Scene) -> Figures:
    """Read them off.

    Raises:
        InputError: something of the scene has no place in a deck.
    """
    effects = {type(params): params for params in scene.effects}
    line, rope, load = scene.ropes[0], scene.ropes[0].rope, scene.payloads[0]
    drag, water = effects.get(DragParams), scene.environment
    added, current = effects.get(AddedMassParams), effects.get(CurrentParams)
    strange = sorted(kind.__name__ for kind in effects if kind not in SAYS)
    points = current.points if isinstance(current, CurrentParams) else ()
    if any(len(velocity) > 2 for _, velocity in points):
        raise InputError(f"scene {scene.name}", "its current has a vertical part", _RIGHT)
    if strange or rope is None or rope.axial_stiffness_n is None or line.damping is None:
        what = f"its {', '.join(strange)} cannot" if strange else "its rope cannot"
        raise InputError(f"scene {scene.name}", f"{what} be written in a deck", _RIGHT)
    area, mass = _load_figures(scene.name, load)
    displaced = water.water_density_kg_per_m3 * float(load.displaced_volume_m3 or 0.0)
    return Figures(
        diameter=rope.hydrodynamic_diameter_m,
        mass=rope.mass_kg_per_m,
        EA=rope.axial_stiffness_n,
        length=line.length_m,
        damping=float(line.damping.newton_seconds or 0.0),
        Cdn=drag.normal if isinstance(drag, DragParams) else 0.0,
        Cdt=drag.tangential if isinstance(drag, DragParams) else 0.0,
        Ca=added.normal if isinstance(added, AddedMassParams) else 0.0,
        load=load.mass_kg,
        volume=float(load.displaced_volume_m3 or 0.0),
        area=area,
        load_Ca=mass / displaced if displaced else 0.0,
        density=water.water_density_kg_per_m3,
        gravity=water.gravity_m_per_s2,
        profile=tuple((z, (east, north)) for z, (east, north) in points),
    )


_RIGHT = "take one of one uniform rope with damping in N·s, in a horizontal current at most"


def _load_figures(name: str, load: Payload) -> tuple[float, float]:
    """Return drag area and added mass, the same along all axes."""
    area, mass = set(load.drag_area_m2 or ()), set(load.added_mass_kg or ())
    if len(area) != 1 or len(mass) != 1:
        raise InputError(f"scene {name}", "its payload is not the same along all axes", _RIGHT)
    return area.pop(), mass.pop()


def moordyn_deck(given: Figures, segments: int, scheme: str, damping: float, step_s: float) -> str:
    """Return the deck for MoorDyn; negative damping: a fraction of an element's critical one."""
    rope = LineType(
        "rope", given.diameter, given.mass, given.EA, damping, given.EI, given.Cdn, given.Ca,
        given.Cdt, 0.0, (given.lift, 0.08, 0.18) if given.lift else (),  # Cl dF cF
    )  # fmt: skip
    load = (given.load, given.volume, given.area, given.load_Ca)
    points = (
        Point(1, COUPLED, (0.0, 0.0, 0.0)),
        Point(2, FREE, (0.0, 0.0, -given.hanging_m), *load),
    )
    options = (
        ("0", "writeLog"), ("1", "disableOutput"), ("1", "disableOutTime"),
        (repr(given.gravity), "g"), (repr(given.density), "WtrDnsty"),
        (repr(2.0 * given.length), "WtrDpth"), (scheme, "tScheme"), (repr(step_s), "dtM"),
        ("0", "TmaxIC"), ("1" if given.profile else "0", "Currents"),
    )  # fmt: skip
    lines = (Line(1, "rope", 2, 1, given.length, segments),)
    return deck_text(Deck(TITLE, (rope,), points, lines, options))


def cabledyn_deck(given: Figures, segments: int, step_s: float, seconds: float) -> str:
    """Return the deck for CableDyn, whose current has at most two rows."""
    current = "none current"
    if given.profile:
        (z1, (x1, y1)), (z2, (x2, y2)) = given.profile
        current = f"profile {z2!r} {x2!r} {y2!r} 0 {z1!r} {x1!r} {y1!r} 0 current"
    return "\n".join(
        [
            TITLE,
            f"{RULE} LINE TYPES {RULE}",
            "TypeName Diam MassDenInAir EA BA/-zeta EI Cd_n Cd_t Ca_n Ca_t",
            "(-) (m) (kg/m) (N) (N-s/-) (N-m^2) (-) (-) (-) (-)",
            f"rope {given.diameter!r} {given.mass!r} {given.EA!r} {given.damping!r} 0 "
            f"{given.Cdn!r} {given.Cdt!r} {given.Ca!r} 0",
            *_points(given),
            f"{RULE} LINES {RULE}",
            "ID NodeA NodeB Outputs",
            "(-) (-) (-) (-)",
            "1 2 1 -",
            f"{RULE} SECTIONS {RULE}",
            "LineID LineType Length NumSegs",
            "(-) (-) (m) (-)",
            f"1 rope {given.length!r} {segments}",
            f"{RULE} OPTIONS {RULE}",
            f"{given.gravity!r} g",
            f"{given.density!r} rhoW",
            f"{step_s!r} dtM",
            f"{step_s * math.ceil(seconds / step_s)!r} TMax",
            current,
            f"{RULE} OUTPUTS {RULE}",
            '"FairTen1"',
            f"{RULE} need this line {RULE}",
            "",
        ]
    )


def current_table(given: Figures) -> str:
    """Return the current profile for MoorDyn, from the bottom up."""
    rows = [(z, *velocity, 0.0) for z, velocity in reversed(given.profile)]
    rows += [(ABOVE_M, *given.profile[0][1], 0.0)] if given.profile else []
    return current_text(Deck(TITLE, (), (), (), (), tuple(rows)))


def _points(given: Figures) -> list[str]:
    return [
        f"{RULE} POINTS {RULE}",
        "Node Type X Y Z M V CdA CA",
        "(#) (word) (m) (m) (m) (kg) (m^3) (m^2) (-)",
        "1 Coupled 0 0 0 0 0 0 0",
        f"2 Free 0 0 {-given.hanging_m!r} {given.load!r} {given.volume!r} {given.area!r} "
        f"{given.load_Ca!r}",
    ]

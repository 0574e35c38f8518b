"""Keys of a plan file: scene, vessel, sea, phases, criteria and method."""

from __future__ import annotations

import hashlib
import math
from dataclasses import dataclass, replace
from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from rope_twin.effects.current import CurrentParams
from rope_twin.planning.seas import SeaState
from rope_twin.planning.slings import Slings
from rope_twin.planning.uncertainties import Uncertainty
from rope_twin.quantity import quantity, text
from rope_twin.scene.schema import Triple
from rope_twin.sea.raos import NO_CONVENTIONS, RaoConventions
from rope_twin.sea.spectrum import breaking_fault

if TYPE_CHECKING:
    from rope_twin.scene.schema import Scene

MAX_CELLS = 5_000
MAX_LEGS, MAX_SEEDS = 50, 10_000
MAX_HEIGHTS = 200


@dataclass(frozen=True, kw_only=True)
class Vessel:
    """Ship whose motion moves the crane tip."""

    responses: str = text(
        "RAOs in six degrees of freedom: name in config/responses/, or path of a CSV, OrcaFlex "
        "YAML, WAMIT .4 or Capytaine netCDF file"
    )
    crane_tip_m: Triple = quantity(
        "crane tip in the axes of the RAO file: ahead, to port, up; of one without an origin, from "
        "its reference point", "m", -500.0, 500.0
    )  # fmt: skip
    conventions: RaoConventions = text(
        "conventions that the RAO file does not state", NO_CONVENTIONS
    )
    bow_deg: float = quantity(
        "heading of the bow, for the current: 0 east, 90 north", "°", -360.0, 360.0, default=0.0
    )
    motion_factor: float = quantity(
        "factor on all RAOs, such as of a loading condition that is uncertain", "", 0.0, 10.0,
        default=1.0,
    )  # fmt: skip
    heave_factor: float = quantity("factor on the heave RAO besides", "", 0.0, 10.0, default=1.0)


@dataclass(frozen=True, kw_only=True)
class DesignCurrent:
    """Current of the plan, in place of the scene's: a design speed and its profile."""

    speed_m_per_s: float = quantity("design speed", "m/s", 0.0, 10.0)
    direction_deg: float = quantity(
        "where it sets to, from the bow to port: 0 from astern, 180 from ahead, as headings", "°",
        -360.0, 360.0,
    )  # fmt: skip
    profile: tuple[tuple[float, float], ...] = quantity(
        "rows of elevation z [m] and share of the design speed, from the surface down, linear "
        "between them; default: 1 at all depths", "", -12e3, 10.0, default=((0.0, 1.0),),
    )  # fmt: skip

    def check(self) -> str | None:
        """Return a fault of the profile, or None."""
        if not self.profile:
            return "profile is empty; leave it out, or give rows like [-100.0, 0.5]"
        if any(below >= above for (above, _), (below, _) in pairwise(self.profile)):
            return "heights of the profile do not descend; order the rows from the surface down"
        for z, share in self.profile:
            if z > 0.0 or share < 0.0:
                problem = f"the profile has the row [{z:g}, {share:g}]"
                return f"{problem}; give an elevation of at most 0 and a share of 0 or more"
        return None

    def towards(self, bow: float) -> CurrentParams:
        """Return the current over the water; bow: its heading from east to north [rad]."""
        angle = bow + math.radians(self.direction_deg)
        east, north = (self.speed_m_per_s * part for part in (math.cos(angle), math.sin(angle)))
        return CurrentParams(
            profile=tuple((z, (share * east, share * north)) for z, share in self.profile)
        )


@dataclass(frozen=True, kw_only=True)
class Heights:
    """Significant wave heights of the grid, on which the limit is found."""

    from_: float = quantity("lowest Hs", "m", 0.05, 20.0)
    to: float = quantity("highest Hs", "m", 0.05, 20.0)
    step: float = quantity("step of the grid", "m", 0.01, 5.0)

    @property
    def values(self) -> list[float]:
        """Return the grid [m]."""
        count = math.floor((self.to - self.from_) / self.step + 1e-9) + 1
        return [round(self.from_ + k * self.step, 9) for k in range(count)]

    def check(self) -> str | None:
        """Return a fault of the range, or None."""
        if self.from_ > self.to:
            return f"from {self.from_:g} m is above to {self.to:g} m; give the lower one as `from`"
        count = len(self.values)
        if count > MAX_HEIGHTS:
            return f"{count} heights; give at most {MAX_HEIGHTS}, with a larger `step`"
        return None


@dataclass(frozen=True, kw_only=True)
class SeaGrid:
    """Sea states: JONSWAP spectra over heights, peak periods and headings."""

    hs_m: Heights = text("significant wave heights: from, to, step")
    tp_s: tuple[float, ...] = quantity("peak periods", "s", 1.0, 40.0)
    headings_deg: tuple[float, ...] = quantity(
        "where the waves travel to, from the bow to port: 0 from astern, 180 head seas", "°",
        -180.0, 180.0,
    )  # fmt: skip
    gamma: float | None = quantity(
        "peak enhancement γ; default: from Tp/√Hs by DNV-RP-C205", "", 1.0, 10.0, default=None
    )
    spreading: float | None = quantity(
        "directional spreading exponent s, cos²ˢ form; default: the scene's, or long-crested", "",
        1.0, 100.0, default=None,
    )  # fmt: skip
    symmetric: bool = text(
        "limits of one side hold for the other: ship, crane tip and current are alike", False
    )

    def check(self) -> str | None:
        """Return a fault of the lists, or None."""
        for name, values in (("tp_s", self.tp_s), ("headings_deg", self.headings_deg)):
            if not values:
                return f"{name} is empty; give one value or more"
            twice = next((value for value in values if values.count(value) > 1), None)
            if twice is not None:
                return f"{name} has {twice:g} twice; keep one of them"
        if {-180.0, 180.0} <= set(self.headings_deg):
            return "headings_deg has 180 and -180, which are one heading; keep one of them"
        if any(b <= a for a, b in zip(self.tp_s, self.tp_s[1:], strict=False)):
            return "tp_s is not ascending; order it"
        sides = {heading > 0.0 for heading in self.headings_deg if heading % 180.0 != 0.0}
        if self.symmetric and len(sides) > 1:
            return "symmetric, and headings_deg has both sides; give those of one side"
        return None


@dataclass(frozen=True, kw_only=True)
class Lowering:
    """Lowering at constant speed through deep water; resonance may lie on the way."""

    from_m: float = quantity("depth of the payload at the start", "m", 1.0, 1.2e4)
    to_m: float = quantity("depth of the payload at the end", "m", 1.0, 1.2e4)
    speed_m_per_s: float = quantity("speed of the winch", "m/s", 0.01, 5.0)
    legs: int | None = quantity(
        "legs with a mesh and a sea of their own; default: each ends at 1.5 times its depth", "",
        1, MAX_LEGS, default=None,
    )  # fmt: skip

    def check(self) -> str | None:
        """Return a fault of the depths, or None."""
        if self.from_m < self.to_m:
            return None
        return (
            f"from_m {self.from_m:g} is not less than to_m {self.to_m:g}; give the lesser as from_m"
        )

    def borders_m(self) -> list[float]:
        """Return depths between which the legs run, in a constant ratio [m]."""
        ratio = self.to_m / self.from_m
        count = self.legs or max(1, math.ceil(math.log(ratio) / math.log(LEG_RATIO) - 1e-9))
        return [self.from_m * ratio ** (k / count) for k in range(count + 1)]


LEG_RATIO = 1.5


@dataclass(frozen=True, kw_only=True)
class AtDepth:
    """Payload hanging at a depth, the winch at rest but for its heave compensation."""

    depth_m: float = quantity("depth of the payload", "m", 1.0, 1.2e4)
    exposure_s: float = quantity("time that it hangs there", "s", 60.0, 10_800.0, default=1800.0)


@dataclass(frozen=True, kw_only=True)
class Landing:
    """Lowering onto the seabed at constant speed."""

    above_m: float = quantity("height above the seabed at the start", "m", 0.5, 100.0, default=5.0)
    speed_m_per_s: float = quantity("speed of the winch", "m/s", 0.01, 5.0)


@dataclass(frozen=True, kw_only=True)
class Splash:
    """Lowering through the splash zone at constant speed."""

    above_m: float = quantity("height of the payload's middle at the start", "m", 0.0, 100.0)
    below_m: float = quantity("depth of the payload's middle at the end", "m", 0.0, 200.0)
    speed_m_per_s: float = quantity("speed of the winch", "m/s", 0.01, 5.0)


@dataclass(frozen=True, kw_only=True)
class LiftedFrom:
    """Moving deck below the object: of another vessel, or a point of the plan's own."""

    responses: str = text("RAOs of the other vessel, as for `vessel`; default: the same vessel", "")
    point_m: Triple = quantity(
        "below the object, in the axes of its RAO file: ahead, to port, up", "m", -500.0, 500.0
    )
    conventions: RaoConventions = text(
        "conventions that the RAO file does not state", NO_CONVENTIONS
    )
    motion_factor: float = quantity("factor on all its RAOs", "", 0.0, 10.0, default=1.0)
    heave_factor: float = quantity("factor on its heave RAO besides", "", 0.0, 10.0, default=1.0)
    turn_deg: float = quantity(
        "its bow from the crane vessel's, to port", "°", -360.0, 360.0, default=0.0
    )
    apart_m: tuple[float, float] = quantity(
        "its reference point from that of the crane vessel: ahead, to port", "m", -1e3, 1e3,
        default=(0.0, 0.0),
    )  # fmt: skip

    def check(self) -> str | None:
        """Return a fault of a deck on the plan's own vessel, or None."""
        if not self.responses and (self.turn_deg or any(self.apart_m)):
            return "turn_deg and apart_m are of another vessel; give its `responses`"
        if not self.responses and (self.motion_factor, self.heave_factor) != (1.0, 1.0):
            return (
                "motion_factor and heave_factor are those of `vessel`; give another's `responses`"
            )
        return None


@dataclass(frozen=True, kw_only=True)
class LiftOff:
    """Lift off a deck in air, by hoisting at constant speed."""

    hoist_m: float = quantity("line taken in", "m", 0.1, 100.0)
    speed_m_per_s: float = quantity("speed of the winch, hoisting", "m/s", 0.01, 5.0)
    deck: LiftedFrom | None = text("moving deck; default: a fixed one", None)


@dataclass(frozen=True, kw_only=True)
class InAir:
    """Object hanging in air, such as while it is slewed over the side; the winch is at rest."""

    above_m: float = quantity("height of the rope's lower end above the water", "m", 0.5, 200.0)
    exposure_s: float = quantity("time that it hangs there", "s", 60.0, 10_800.0, default=1800.0)


@dataclass(frozen=True, kw_only=True)
class FromScene:
    """The scene as it is, with the schedules of its winches: for multi-line systems above all."""

    exposure_s: float = quantity("time that is counted", "s", 10.0, 10_800.0, default=1800.0)


KINDS = ("lift_off", "in_air", "splash_zone", "lowering", "at_depth", "landing", "from_scene")
BY_TWIN = ("lift_off", "from_scene")  # that a twin steps by itself


@dataclass(frozen=True, kw_only=True)
class Phase:
    """A phase of the operation; exactly one of the kinds."""

    name: str = text("its name; default: its kind", "")
    lowering: Lowering | None = text("lowering through deep water", None)
    at_depth: AtDepth | None = text("hanging at a depth", None)
    landing: Landing | None = text("landing on the seabed", None)
    splash_zone: Splash | None = text("lowering through the splash zone", None)
    lift_off: LiftOff | None = text("lift off a deck, in air", None)
    in_air: InAir | None = text("hanging in air, overboarding", None)
    from_scene: FromScene | None = text("the scene with its own winch schedules", None)

    @property
    def kind(self) -> str:
        """Return which of KINDS it is."""
        return next(kind for kind in KINDS if getattr(self, kind) is not None)

    @property
    def title(self) -> str:
        """Return its name, or its kind."""
        return self.name or self.kind

    @property
    def speed_m_per_s(self) -> float:
        """Return the speed of the winch; 0 at rest."""
        return float(getattr(getattr(self, self.kind), "speed_m_per_s", 0.0))

    def check(self) -> str | None:
        """Return a fault unless exactly one kind is given, or None."""
        kinds = [kind for kind in KINDS if getattr(self, kind) is not None]
        if len(kinds) == 1:
            return None
        problem = " and ".join(kinds) if kinds else "no kind of phase"
        return f"{problem} given; give exactly one of {', '.join(KINDS)}"


@dataclass(frozen=True, kw_only=True)
class Criteria:
    """Limits that a phase must keep; the characteristic value of each is judged."""

    swl_n: float | None = quantity(
        "largest dynamic hook load at the crane tip", "N", 1e2, 1e9, default=None
    )
    safety_factor: float | None = quantity(
        "factor on the largest hook load, below the MBL of the rope", "", 1.0, 20.0, default=None
    )
    uplift_share: float | None = quantity(
        "largest hydrodynamic uplift over the static submerged weight: slack (DNV-RP-N103)", "",
        0.1, 1.0, default=0.9,
    )  # fmt: skip
    min_tension_n: float | None = quantity(
        "minimum tension anywhere in the rope", "N", 0.0, 1e9, default=None
    )
    landing_speed_m_per_s: float | None = quantity(
        "largest landing velocity on the seabed", "m/s", 1e-3, 10.0, default=None
    )
    re_hit_m_per_s: float | None = quantity(
        "largest speed at which the deck may meet the object again after the lift-off", "m/s", 0.0,
        10.0, default=None,
    )  # fmt: skip
    offset_m: float | None = quantity(
        "largest lateral offset of the object from the crane tip, at rest; dynamic in a lift-off "
        "and in air", "m", 0.01, 1e4, default=None,
    )  # fmt: skip
    stroke_m: float | None = quantity(
        "largest stroke of the heave compensation, in either direction", "m", 1e-2, 100.0,
        default=None,
    )  # fmt: skip
    compensation_speed_m_per_s: float | None = quantity(
        "largest speed of the heave compensation", "m/s", 1e-2, 10.0, default=None
    )


@dataclass(frozen=True, kw_only=True)
class Seeds:
    """Number of seeds of a cell: it grows in steps of `start` until the interval is narrow."""

    start: int = quantity("seeds to begin with, and to add at a time", "", 3, 1000, default=8)
    most: int = quantity("most seeds of a cell", "", 3, MAX_SEEDS, default=64)

    def check(self) -> str | None:
        """Return a fault of the numbers, or None."""
        if self.start <= self.most:
            return None
        return f"start {self.start} is above most {self.most}; give the lesser one as start"


@dataclass(frozen=True, kw_only=True)
class Method:
    """Statistics of the extremes, and the accuracy of the runs."""

    percentile: float = quantity(
        "of the largest value of an exposure: the characteristic value", "%", 1.0, 99.9,
        default=90.0,
    )  # fmt: skip
    confidence: float = quantity("of the intervals", "", 0.5, 0.99, default=0.9)
    within: float = quantity(
        "half width of the interval at the limit, over the value", "", 1e-3, 1.0, default=0.05
    )
    height_within_m: float | None = quantity(
        "half width of the interval of the limiting Hs; default: whatever the seeds give", "m",
        0.01, 5.0, default=None,
    )  # fmt: skip
    seeds: Seeds = text("number of seeds", Seeds())
    seed: int = quantity("first random number of all seas", "", 0, 2**31 - 1, default=1)
    settle_s: float = quantity(
        "time after the ship's build-up that is not counted", "s", 0.0, 3600.0, default=60.0
    )
    error_within: float = quantity(
        "discretisation error aimed at, over the characteristic hook load", "", 1e-4, 0.5,
        default=0.02,
    )  # fmt: skip
    elements: int | None = quantity(
        "elements of the rope; default: by `error_within`", "", 3, 2000, default=None
    )
    step_s: float | None = quantity(
        "time step; default: by `error_within`", "s", 1e-4, 0.2, default=None
    )

    def check(self) -> str | None:
        """Return a fault if half of a setting is given, or None."""
        if (self.elements is None) == (self.step_s is None):
            return None
        key = "step_s" if self.elements is None else "elements"
        return f"{key} alone; give elements and step_s, or neither"


@dataclass(frozen=True, kw_only=True)
class Plan:
    """Plan of a lift as written in its file."""

    name: str
    path: Path
    digest: str  # SHA-256 of the file's text
    about: str = text("one line: the operation", "")
    source: str = text("source of the data", "")
    scene: str = text("scene with rope, payload and winch: a name, or its path from this file")
    vessel: Vessel | None = text("ship; default: that of the scene's `on_waves`", None)
    sea: SeaGrid = text("sea states")
    current: DesignCurrent | None = text("current; default: that of the scene", None)
    phases: tuple[Phase, ...] = text("phases of the operation")
    criteria: Criteria = text("limits", Criteria())
    slings: Slings | None = text("slings between rope and object", None)
    method: Method = text("statistics and accuracy", Method())
    uncertainties: tuple[Uncertainty, ...] = text("uncertain numbers, for sensitivity", ())

    @property
    def grid(self) -> list[tuple[int, int, int]]:
        """Return all cells as indices of phase, peak period and heading."""
        counts = len(self.phases), len(self.sea.tp_s), len(self.sea.headings_deg)
        return [(int(i), int(j), int(k)) for i, j, k in np.ndindex(*counts)]

    def heights_m(self, period: int, heading: int) -> list[float]:
        """Return the heights of the grid at which waves of a period do not break [m]."""
        heights_m = []
        for height in self.sea.hs_m.values:
            if breaking_fault(self.sea_state(height, period, heading).spectrum()):
                break
            heights_m.append(height)
        return heights_m

    def bow_of(self, scene: Scene) -> float:
        """Return the heading of the bow, from east to north [rad]."""
        if self.vessel is not None:
            return math.radians(self.vessel.bow_deg)
        riding = scene.sea_state.on_waves
        return math.radians(riding.heading_deg) if riding is not None else 0.0

    def in_current(self, scene: Scene) -> Scene:
        """Return the scene with the plan's current, where it gives one; its digest includes it."""
        if self.current is None:
            return scene
        current = self.current.towards(self.bow_of(scene))
        others = tuple(effect for effect in scene.effects if not isinstance(effect, CurrentParams))
        digest = hashlib.sha256(f"{scene.digest} {current}".encode()).hexdigest()
        return replace(scene, effects=(current, *others), digest=digest)

    def sea_state(self, height_m: float, period: int, heading: int) -> SeaState:
        """Return the sea state of a cell."""
        sea = self.sea
        return SeaState(
            height_m, sea.tp_s[period], sea.headings_deg[heading], sea.gamma, sea.spreading
        )

    def check(self) -> str | None:
        """Return a fault of the phases, or None."""
        if not self.phases:
            return "phases is empty; give one phase or more"
        names = [phase.title for phase in self.phases]
        twice = next((name for name in names if names.count(name) > 1), "")
        if twice:
            return f"two phases are called '{twice}'; give one of them a `name`"
        keys = [uncertainty.key for uncertainty in self.uncertainties]
        if double := next((key for key in keys if keys.count(key) > 1), ""):
            return f"uncertainties has '{double}' twice; keep one of them"
        cells = len(self.grid)
        if cells > MAX_CELLS:
            return f"{cells} cells of phase, Tp and heading; give at most {MAX_CELLS}"
        return None

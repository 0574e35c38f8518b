"""Static lines against MoorPy: P13 hanging, on the bed without and with friction, in two sections.

MoorPy (Hall and others, NREL, github.com/NREL/MoorPy) solves the elastic catenary with a part on
the bed (Jonkman 2007, Dynamics modeling and loads analysis of an offshore floating wind turbine,
NREL/TP-500-41958). PRINTED are the forces that its own test file states (tests/test_catenary.py,
`desired`); the others are what version 1.3.0 computes (`test/validation/test_moorpy_lines.py` has
it compute them again where it is installed). Ends: A the lower, B the upper one.

The twin has statics without friction of the bed. A line whose friction is mobilised all along, as
MoorPy assumes, is one that was pulled: here hauled in from 515 m to 500 m with the effect
`bed_friction`, slowly and with axial damping, for a line that swings back leaves friction of the
other sign behind.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from rope_twin.effects.bed_friction import BedFrictionParams
from rope_twin.effects.seabed import SeabedParams
from rope_twin.scene.schema import RopeSection, Scene, Winch
from rope_twin.studies.driven_twin import march, still
from rope_twin.studies.picture import Line, Panel
from rope_twin.twin.snapshot import Snapshot
from rope_twin.twin.twin import Twin
from validation.case import Case, Finding, Found, shown, within_pct
from validation.rigs import WATER, Rig, with_nothing_below

GRAVITY = Rig.gravity
FIRM = 1e8  # N/m³: the lying line sinks by 0.1 mm, MoorPy's not at all
DEEP = 100.0  # m


@dataclass(frozen=True)
class Lying:
    """Inputs of a line in MoorPy's terms, and the forces at its ends [N]."""

    name: str
    across: float  # from A to B [m]
    up: float
    length: float
    EA: float
    weight: float  # in water [N/m]; negative: the line floats
    on_bed: bool
    lower: tuple[float, float]  # horizontal and vertical at A
    upper: tuple[float, float]

    @property
    def tensions(self) -> tuple[float, float]:
        """Return the tension at A and at B."""
        return math.hypot(*self.lower), math.hypot(*self.upper)


PRINTED = (
    Lying("on the bed", 400.0, 200.0, 500.0, 7.51e12, 800.0, True,
          (96643.42815934008, 0.0), (-96643.42815934008, -237751.75535996316)),
    Lying("hanging", 400.0, 200.0, 500.0, 7.51e12, 200.0, False,
          (43694.580989249596, -22365.599350216216), (-43694.580989249596, -77634.40064978378)),
    Lying("hanging, 130 m", 89.9, 59.2, 130.0, 7.51e8, 881.05, False,
          (31373.229006023103, -26650.341270116318), (-31373.229006023103, -87886.15872988368)),
    Lying("floating upward", 37.96888656874307, 20.49078283711694, 100.0, 7.51e8,
          -881.0549577007893, False,
          (6428.437434537766, 53178.729367882406), (-6428.437434537766, 34926.76640219652)),
)  # fmt: skip
LYING_M = 202.81030580004602  # of the first, `LBot`
STRETCHING = replace(
    PRINTED[0], name="on the bed, EA 7.51e9 N", EA=7.51e9, lower=(96616.6710600883, 0.0),
    upper=(-96616.6710600883, -237729.68603492077),
)  # fmt: skip
FRICTION = 0.1
RUBBING = replace(
    PRINTED[0], name=f"on the bed, hauled in, friction {FRICTION:g}, EA 7.51e7 N", EA=7.51e7,
    lower=(77681.37227852001, 0.0), upper=(-94116.65892514391, -235647.133533761),
)  # fmt: skip
# two sections from A up: length [m], weight in water [N/m], EA [N]
SECTIONS = ((300.0, 800.0, 7.51e8), (250.0, 100.0, 5e7))
IN_SECTIONS = Lying(
    "two sections, the heavy one on the bed", 480.0, 190.0, 550.0, math.nan, math.nan, True,
    (70527.68872798, 0.0), (-70527.68872839, -77170.52874139),
)  # fmt: skip

HAULED_M, SPEED, WAIT_S, EVERY = 15.0, 0.02, 120.0, 100
HAULING = Winch(
    speed_limit_m_per_s=1.0, acceleration_limit_m_per_s2=1e-3, min_line_out_m=100.0,
    max_line_out_m=900.0,
)  # fmt: skip


def rig_of(line: Lying, elements: int) -> Rig:
    """Return the line with B at the hang-off, DEEP below the surface, in water without drag."""
    diameter = 0.4 if line.weight < 0.0 else 0.1
    weight = 0.0 if math.isnan(line.weight) else line.weight
    return Rig(
        length=line.length, elements=elements, diameter=diameter, density=WATER, EA=line.EA,
        mass=weight / GRAVITY + WATER * 0.25 * math.pi * diameter**2,
        hang_off=(0.0, 0.0, -DEEP), fixed_at=(line.across, 0.0, -DEEP - line.up),
    )  # fmt: skip


def bed_of(line: Lying) -> SeabedParams:
    """Return a bed at A."""
    return SeabedParams(depth_m=DEEP + line.up, friction=0.0, stiffness_n_per_m3=FIRM)


def scene_of(line: Lying, rig: Rig) -> Scene:
    """Return the scene of a rig, on a bed at A if the line lies: by the step of a payload there."""
    scene = rig.scene()
    if not line.on_bed:
        return scene
    return with_nothing_below(replace(scene, effects=(*scene.effects, bed_of(line))))


def sectioned(elements: int) -> Scene:
    """Return the scene of the line in two sections."""
    rig = replace(rig_of(IN_SECTIONS, elements), EA=1e8)
    scene = scene_of(IN_SECTIONS, rig)
    (line,) = scene.ropes
    assert line.rope is not None
    sections = tuple(
        RopeSection(
            rope=replace(
                line.rope, axial_stiffness_n=EA, mass_kg_per_m=weight / GRAVITY + rig.mass
            ),
            length_m=length,
        )
        for length, weight, EA in SECTIONS
    )
    return replace(scene, ropes=(replace(line, rope=None, sections=sections),))


def hauled(elements: int) -> Snapshot:
    """Return the line at rest after it was hauled in on a bed with friction."""
    rig = replace(
        rig_of(RUBBING, elements), length=RUBBING.length + HAULED_M, damping=1e7, step=0.05,
        drag=(1.2, 0.02), winch=HAULING,
    )  # fmt: skip
    scene = rig.scene()
    friction = BedFrictionParams(axial=FRICTION, lateral=FRICTION, slip_m=1e-4)
    twin = Twin(replace(scene, effects=(*scene.effects, bed_of(RUBBING), friction)))
    lasts_s = HAULED_M / SPEED
    speeds = [(1.0, -SPEED), (1.0 + lasts_s, 0.0)]
    *_, last = march(twin, still, lasts_s + WAIT_S, EVERY, speeds)
    return last


def slope_on_bed(snapshot: Snapshot) -> float:
    """Return the mean growth of the tension along the lying line [N/m], 10 m to 150 m from A."""
    from_a = snapshot.arc_length_m[-1] - snapshot.arc_length_m
    middle = 0.5 * (from_a[1:] + from_a[:-1])
    some = (middle > 10.0) & (middle < 150.0)
    return float(np.polyfit(middle[some], snapshot.element_tension_n[some], 1)[0])


def _ends(line: Lying, snapshot: Snapshot) -> list[Finding]:
    """Return the tensions at both ends; a number that no file prints says what computed it."""
    lower, upper = line.tensions
    findings = [
        within_pct(f"{line.name}: tension at A", snapshot.tension_payload_n, lower, 0.1, "N"),
        within_pct(f"{line.name}: tension at B", snapshot.tension_top_n, upper, 0.1, "N"),
    ]
    if line in PRINTED:
        return findings
    return [
        replace(finding, published=f"{finding.published} N (MoorPy 1.3.0)") for finding in findings
    ]


def _lines(elements: int = 500, rubbing: int = 600) -> Found:
    findings: list[Finding] = []
    drawn: list[Line] = []
    for line in (*PRINTED, STRETCHING):
        snapshot = Twin(scene_of(line, rig_of(line, elements))).snapshot()
        findings += _ends(line, snapshot)
        if line is PRINTED[0]:
            (touchdown,) = snapshot.touchdowns
            lying_m = line.length - touchdown.line_out_m
            findings.append(within_pct(f"{line.name}: lying length", lying_m, LYING_M, 0.1, "m"))
        if line is STRETCHING:
            quantity = f"{line.name}: tension at A, beside the line that hardly stretches"
            findings.append(
                shown(quantity, snapshot.tension_payload_n, f"{PRINTED[0].lower[0]:.6g}", "N")
            )
            continue
        drawn.append(_drawn(line.name, snapshot))
    snapshot = Twin(sectioned(elements)).snapshot()
    findings += _ends(IN_SECTIONS, snapshot)
    drawn.append(_drawn(IN_SECTIONS.name, snapshot))
    snapshot = hauled(rubbing)
    findings += _ends(RUBBING, snapshot)
    quantity = "friction: growth of the tension along the lying line"
    exact = FRICTION * RUBBING.weight
    slope = within_pct(quantity, slope_on_bed(snapshot), exact, 0.1, "N/m")
    findings.append(replace(slope, published=f"{exact:g}, μ·w"))
    panels = (
        Panel("Lines of MoorPy's tests, and in two sections", "x [m]", "z [m]", tuple(drawn)),
        Panel(f"Hauled in on a bed with friction {FRICTION:g}", "from A [m]", "tension [kN]",
              _tensions(snapshot)),
    )  # fmt: skip
    return Found(tuple(findings), panels, NOTES)


def _drawn(name: str, snapshot: Snapshot) -> Line:
    x, _, z = snapshot.node_position_m.T
    return Line(x[0] - x, z - z[0], name)


def _tensions(snapshot: Snapshot) -> tuple[Line, ...]:
    from_a = snapshot.arc_length_m[-1] - snapshot.arc_length_m
    middle = 0.5 * (from_a[1:] + from_a[:-1])
    low = middle < 250.0
    on_bed = middle[middle < 200.0]
    moorpy_kn = 1e-3 * (RUBBING.lower[0] + FRICTION * RUBBING.weight * on_bed)
    return (
        Line(middle[low], 1e-3 * snapshot.element_tension_n[low], "ours"),
        Line(on_bed[::20], moorpy_kn[::20], "MoorPy's at A, and 80 N/m", "k."),
    )


NOTES = (
    "Published: the forces that MoorPy's test file prints for its first lines, as tension "
    "√(H² + V²). With EA 7.51e9 N, with friction on the pulled line, and in two sections MoorPy "
    "1.3.0 computed the other number.",
    "MoorPy's test file has the line on the bed with friction 0.1 and 5 too, at an EA at which it "
    "does not stretch. A line that does not stretch mobilises no friction in a simulation over "
    "time, so the comparison is at EA 7.51e7 N. Statics alone have no friction.",
)

CASES = (
    Case("P13", "static lines: hanging, on the bed, with friction, in two sections",
         "MoorPy's test file and MoorPy 1.3.0", _lines, 12.0,
         lambda: _lines(100, 600)),
)  # fmt: skip

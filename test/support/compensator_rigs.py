"""A payload below a heave compensator on a short stiff rope, in vacuum unless said otherwise."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

from rigs import Rig

from rope_twin.effects.compensator import CompensatorParams
from rope_twin.scene.schema import Rope, RopeSection, Scene

UNIT_M, UNIT_KG_PER_M, STOP_N = 6.0, 200.0, 6e8  # eye to eye retracted; EA: stops of 1e8 N/m
RIG = Rig(
    length=36.0, elements=6, mass=10.0, EA=2e9, diameter=0.05, damping=2e5, load=50e3, step=0.01,
    tolerance=1.0,
)  # fmt: skip
GRAVITY = RIG.gravity
# The tension below the unit's middle at rest: payload and half of the unit.
LOAD_N = (RIG.load + 0.5 * UNIT_M * UNIT_KG_PER_M) * GRAVITY
AREA, STROKE, VOLUME, EXPONENT = 0.05, 4.0, 0.6, 1.3
PASSIVE = CompensatorParams(
    stroke_m=STROKE, piston_area_m2=AREA, gas_pressure_pa=LOAD_N / AREA, gas_volume_m3=VOLUME,
    exponent=EXPONENT,
)  # fmt: skip


def compensated(unit: CompensatorParams = PASSIVE, rig: Rig = RIG, *more: Any) -> Scene:
    """Return the rig's scene with a compensator as its lowest section."""
    scene = rig.scene()
    (line,) = scene.ropes
    body = Rope(
        diameter_m=0.5, mass_kg_per_m=UNIT_KG_PER_M, hydrodynamic_diameter_m=0.5,
        axial_stiffness_n=STOP_N, breaking_load_n=5e6,
    )  # fmt: skip
    assert line.rope is not None
    sections = (RopeSection(rope=body, length_m=UNIT_M), RopeSection(rope=line.rope))
    return replace(
        scene,
        ropes=(replace(line, rope=None, sections=sections),),
        effects=(*scene.effects, *more, unit),
    )

"""Conversion of a scene's sheaves to wheels and tethers of the core.

A rope that ends at a sheave has its last node there in the core, whichever end is higher, because
elements are added and removed there (core/joined/sheaves.py).
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from rope_twin.core.joined import ties
from rope_twin.core.joined.reeving import Wheel
from rope_twin.core.state import Floats
from rope_twin.scene.schema import STEEL_KG_PER_M3, RopeLine, Scene, Winch

LEAST_ELEMENTS = 2.0  # minimum remaining length of a stretch, in elements


def runs_over_sheave(scene: Scene, line: RopeLine) -> bool:
    """Return whether the rope ends at a sheave."""
    return any(line.to == sheave.name for sheave in scene.sheaves)


def ends_of(scene: Scene, line: RopeLine) -> tuple[str, str]:
    """Return the names of the points at the rope's first node and its last."""
    names = (line.to, line.from_)
    return names[::-1] if runs_over_sheave(scene, line) else names


def with_both_stretches(scene: Scene, number: int) -> Scene:
    """Return the scene with one rope as long as both stretches on its sheave together."""
    line = scene.ropes[number]
    both = [other for other in scene.ropes if other.to == line.to]
    length, elements = sum(o.length_m for o in both), sum(o.elements for o in both)
    ropes = list(scene.ropes)
    ropes[number] = replace(line, length_m=length, elements=elements)
    return replace(scene, ropes=tuple(ropes))


def room_for(scene: Scene, line: RopeLine) -> Winch:
    """Return the range of a stretch's length, as limits of a winch at its end."""
    both = sum(other.length_m for other in scene.ropes if other.to == line.to)
    return Winch(
        speed_limit_m_per_s=1.0,
        acceleration_limit_m_per_s2=1.0,
        least_line_out_m=max(1.0, LEAST_ELEMENTS * line.length_m / line.elements),
        most_line_out_m=both,
    )


def wheels(scene: Scene, joint_of: dict[str, int]) -> list[Wheel]:
    """Return the sheaves as wheels; a positive flow enters the first rope listed."""
    made = []
    water = scene.environment
    for sheave in scene.sheaves:
        into, out = (n for n, line in enumerate(scene.ropes) if line.to == sheave.name)
        sunk = sheave.mass_kg * (1.0 - water.water_density_kg_per_m3 / STEEL_KG_PER_M3)
        made.append(
            Wheel(
                point=joint_of[sheave.name],
                into=into,
                out=out,
                mass=sheave.mass_kg,
                weight=sunk * water.gravity_m_per_s2,
                inertia=sheave.wheel_inertia_kg,
                friction=sheave.friction,
            )
        )
    return made


def tethers(scene: Scene, joint_of: dict[str, int]) -> Floats:
    """Return the tethers of the sheaves as links, (TIE_ROWS, tethers)."""
    held = [sheave for sheave in scene.sheaves if sheave.tether is not None]
    made = np.zeros((ties.TIE_ROWS, len(held)))
    for column, sheave in zip(made.T, held, strict=True):
        tether = sheave.tether
        assert tether is not None
        column[ties.FIRST], column[ties.SECOND] = joint_of[sheave.name], ties.ANCHORED
        column[ties.AT : ties.AT + 3] = tether.at_m
        column[ties.FORCE], column[ties.LENGTH] = tether.force_n, tether.length_m
        column[ties.STIFFNESS] = tether.stiffness_n_per_m
        column[ties.DAMPING] = tether.damping_newton_seconds_per_m
    return made

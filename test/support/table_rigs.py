"""Ropes with a stiffness table."""

from __future__ import annotations

from dataclasses import replace

from rigs import Rig

from rope_twin.scene.rope_data import StiffnessTable
from rope_twin.scene.schema import Scene

HMPE = StiffnessTable(
    table=((0.0, 0.0), (0.001, 0.06e6), (0.002, 0.17e6), (0.004, 0.5e6), (0.008, 1.3e6))
)


def tabled(rig: Rig, table: StiffnessTable) -> Scene:
    """Return the scene of a rig with a stiffness table in place of EA."""
    scene = rig.scene()
    line = scene.ropes[0]
    assert line.rope is not None
    rope = replace(line.rope, axial_stiffness_n=None, axial_stiffness=table)
    return replace(scene, ropes=(replace(line, rope=rope),))

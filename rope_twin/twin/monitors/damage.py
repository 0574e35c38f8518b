"""Fatigue counts of the ropes of a scene, with what they run over.

Two ropes that run as one over a sheave share a count: its material is that of the first of them in
the scene, from its far end, and then that of the other.
"""

from __future__ import annotations

from dataclasses import replace

from rope_twin.effects.bending import BendingParams
from rope_twin.scene.fatigue import endurance, own_curve
from rope_twin.scene.model.grid import ends_m
from rope_twin.scene.model.joined import over_sheaves
from rope_twin.scene.schema import RopeLine, Scene
from rope_twin.scene.validation.rigging import winch_of
from rope_twin.scene.winch import BendingSheave
from rope_twin.vortex.fatigue import OWN, reach_m
from rope_twin.vortex.results import SEGMENT_M, DamageSettings, RopeDamage


def bending_stiffness_of(scene: Scene, line: RopeLine) -> float:
    """Return the bending stiffness of a rope [N·m²]; 0: none."""
    listed = [own for own in scene.effects if isinstance(own, BendingParams)]
    return sum((line.bending or own).stiffness_n_m2 for own in listed)


def damage_of(
    scene: Scene, number: int, curve: str, bends: bool = False, piece_m: float = SEGMENT_M
) -> RopeDamage | None:
    """Return the count of a rope of the scene; None: that of the rope before it on a sheave.

    curve: name of a fatigue curve, or OWN; bends: whether curvature will be given; piece_m: length
    of a piece of the count.

    Raises:
        InputError: the curve does not fit the rope.
    """
    line, pairs = scene.ropes[number], over_sheaves(scene)
    EI = bending_stiffness_of(scene, line)
    if number in (out for _, out in pairs):
        return None
    settings = DamageSettings(curve, bends, piece_m=piece_m)
    most = line.length_m
    for wheel, (into, out) in zip(scene.sheaves, pairs, strict=True):
        if number == into:
            other = scene.ropes[out]
            most += other.length_m
            line = replace(line, fatigue=line.fatigue or other.fatigue)
            settings = replace(settings, bends=False)
            if (groove := wheel.groove) is not None:
                settings = replace(
                    settings, path=groove.places(-0.5 * groove.arc_m), wires=_wires(line, groove)
                )
    if (winch := winch_of(scene, line)) is not None:
        most, path = winch.most_line_out_m, winch.bend_path()
        wires = _wires(line, winch.sheave) if winch.sheave else ()
        for sheave in winch.inboard_sheaves:
            wires += _wires(line, sheave, sheave.inboard_m)
        settings = replace(settings, path=path, reach_m=reach_m(path), wires=wires)
    own = own_curve(line) if curve == OWN else None
    settings = replace(settings, own=own, endurance=endurance(line))
    return RopeDamage(line, ends_m(line), most, settings, EI)


def _wires(
    line: RopeLine, sheave: BendingSheave, inboard_m: float = 0.0
) -> tuple[tuple[float, float], ...]:
    """Return place and bending stress of the outer wires over a sheave; none if none are given."""
    stress_pa = sheave.bending_stress_pa(line.made_of[0].rope.diameter_m)
    return ((inboard_m, stress_pa),) if stress_pa > 0.0 else ()

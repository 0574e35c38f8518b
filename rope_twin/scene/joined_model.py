"""Conversion of a multi-line scene to a System.

Each rope is built as if it carried the total suspended load alone, which determines its elements,
its damping (a ratio refers to that mode) and its tolerance; then it gets its own payload and
position. A rope that ends at a sheave has its last node there in the core, whichever end is higher,
because elements are added and removed there (core/joined/sheaves.py).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from rope_twin.core.joined import joints as ties
from rope_twin.core.joined.initial_guess import Link, guess_positions, initial_shape
from rope_twin.core.joined.joints import LOOSE, System, Wheel, new_system, reeve
from rope_twin.core.joined.payload_contact import PayloadContact
from rope_twin.core.state import ELEMENTS, POSITION, C, Floats, Rope
from rope_twin.effects.bending import BendingParams
from rope_twin.effects.net_curtain import NetCurtain, NetCurtainParams, facing
from rope_twin.effects.payload import SplashZoneParams
from rope_twin.effects.payload_contact import PayloadContactParams, placed
from rope_twin.effects.payload_faces import FairingParams, NetParams
from rope_twin.effects.payload_shedding import PayloadSheddingParams
from rope_twin.effects.rigid_body import RigidBodyParams
from rope_twin.scene.grid import find_payload, weight_n_per_m
from rope_twin.scene.lift import alone, point_figures
from rope_twin.scene.rigging import (
    body_payload,
    meeting_points,
    panels_beside,
    places,
    runs_over_sheave,
)
from rope_twin.scene.rope_model import build, build_effects, tables_of
from rope_twin.scene.schema import STEEL_KG_PER_M3, Payload, RopeLine, Scene, Strut
from rope_twin.scene.shapes import NOTHING, PayloadFigures, payload_figures
from rope_twin.scene.winch import Tether


def first_places(scene: Scene) -> dict[str, Floats]:
    """Return approximate positions of hang-offs, payloads and joints by name, (3,) each [m]."""
    feet = {
        f"foot of {line.name}, {number}": line.fixed_at_m
        for number, line in enumerate(scene.ropes)
        if line.fixed_at_m
    }
    ropes: list[Link] = [
        (line.from_, line.to or f"foot of {line.name}, {number}", line.length_m)
        for number, line in enumerate(scene.ropes)
    ]
    bars: list[Link] = [(*strut.between, strut.length_m) for strut in scene.struts]
    positions = guess_positions({**places(scene), **feet}, meeting_points(scene), ropes, bars)
    return {str(name): place for name, place in positions.items()}


def ends_of(scene: Scene, line: RopeLine) -> tuple[str, str]:
    """Return the names of the points at the rope's first node and its last."""
    names = (line.to, line.from_)
    return names[::-1] if runs_over_sheave(scene, line) else names


def with_both_stretches(scene: Scene, number: int) -> Scene:
    """Return the scene with one rope as long as both stretches on its sheave together."""
    line = scene.ropes[number]
    both = [candidate for candidate in scene.ropes if candidate.to == line.to]
    length, elements = sum(o.length_m for o in both), sum(o.elements for o in both)
    ropes = list(scene.ropes)
    ropes[number] = replace(line, length_m=length, elements=elements)
    return replace(scene, ropes=tuple(ropes))


def over_sheaves(scene: Scene) -> list[tuple[int, int]]:
    """Return the numbers of the two ropes that end at each sheave, in the order of the scene."""
    ends = [[r for r, line in enumerate(scene.ropes) if line.to == sheave.name]
            for sheave in scene.sheaves]  # fmt: skip
    return [(into, out) for into, out in ends]


def wheels(scene: Scene, joint_of: dict[str, int]) -> list[Wheel]:
    """Return the sheaves as wheels; a positive flow enters the first rope listed."""
    wheels, water = [], scene.environment
    for sheave, (into, out) in zip(scene.sheaves, over_sheaves(scene), strict=True):
        sunk = sheave.mass_kg * (1.0 - water.water_density_kg_per_m3 / STEEL_KG_PER_M3)
        wheels.append(Wheel(
            point=joint_of[sheave.name], into=into, out=out, mass=sheave.mass_kg,
            weight=sunk * water.gravity_m_per_s2, inertia=sheave.wheel_inertia_kg,
            friction=sheave.friction,
        ))  # fmt: skip
    return wheels


def links(scene: Scene, joint_of: dict[str, int]) -> Floats:
    """Return bars, which take compression, and tethers of sheaves, (TIE_ROWS, links)."""
    held = [(sheave.name, sheave.tether) for sheave in scene.sheaves if sheave.tether is not None]
    columns = np.zeros((ties.TIE_ROWS, len(scene.struts) + len(held)))
    both: list[Strut | Tether] = [*scene.struts, *(tether for _, tether in held)]
    for column, link in zip(columns.T, both, strict=True):
        column[ties.LENGTH], column[ties.STIFFNESS] = link.length_m, link.stiffness_n_per_m
        column[ties.DAMPING] = link.damping_newton_seconds_per_m
    for column, strut in zip(columns.T, scene.struts, strict=False):
        column[ties.FIRST], column[ties.SECOND] = (joint_of[name] for name in strut.between)
        column[ties.LEAST] = -np.inf
    for column, (name, tether) in zip(columns.T[len(scene.struts) :], held, strict=True):
        column[ties.FIRST], column[ties.SECOND] = joint_of[name], ties.ANCHORED
        column[ties.AT : ties.AT + 3], column[ties.FORCE] = tether.at_m, tether.force_n
    return columns


@dataclass(frozen=True)
class BuiltSystem:
    """Arrays of a multi-line scene."""

    system: System
    owners: dict[str, int]  # rope with this payload or joint at its lower end
    hang_off_m: Floats  # of each rope, (ropes, 3); NaN where the upper end is connected


def build_joined(scene: Scene) -> BuiltSystem:
    """Return ropes, connections and bars with an initial guess of their shape.

    Raises:
        SceneError: as for a scene of one rope.
    """
    owners: dict[str, int] = {}
    for number, line in enumerate(scene.ropes):
        if line.to:
            owners.setdefault(line.to, number)
    figures, where = point_figures(scene), first_places(scene)
    body = next(
        (payload for payload in scene.payloads if payload.name == body_payload(scene)), None
    )
    if body is not None:  # its bars are at the hook
        figures[body.name] = payload_figures(body, scene.environment.water_density_kg_per_m3)
    joint_of = {name: number for number, name in enumerate(_meetings(scene))}
    tables = any(section.rope.axial_stiffness for line in scene.ropes for section in line.made_of)
    ropes: list[Rope] = []
    for number, line in enumerate(scene.ropes):
        figures_below = figures.get(line.to, NOTHING) if owners.get(line.to) == number else NOTHING
        rope = _rope(scene, number, figures_below, joint_of)
        first, last = ends_of(scene, line)
        low = np.array(line.fixed_at_m) if line.fixed_at_m else where[first]
        n = int(rope.state.counts[ELEMENTS])
        rope.state.nodes[POSITION : POSITION + 3, : n + 1] = initial_shape(
            low, where[last], rope.state.s[: n + 1], _floats(scene, line)
        )
        first_free = 1 if line.fixed_at_m else 0
        tolerance = ropes[0].model.tolerance if ropes else rope.model.tolerance
        model = rope.model._replace(first_free=first_free, tolerance=tolerance)
        law = tables_of(line) if tables else None
        ropes.append(rope._replace(model=model, law=law))
    hang_offs = places(scene)
    unknown = (np.nan,) * 3
    ends = [[joint_of.get(name, LOOSE) for name in ends_of(scene, line)] for line in scene.ropes]
    lower, upper = (list(some) for some in zip(*ends, strict=True))
    system = new_system(tuple(ropes), lower, upper, links(scene, joint_of))
    return BuiltSystem(
        reeve(system, wheels(scene, joint_of)),
        owners,
        np.array([hang_offs.get(line.from_, unknown) for line in scene.ropes], dtype=float),
    )


def _rope(
    scene: Scene, number: int, payload_values: PayloadFigures, joint_of: Mapping[str, int]
) -> Rope:
    """Return a rope's arrays, with effects that act on what is at its lower end.

    joint_of: numbers of the connections by name. Without a payload there is no slamming.
    """
    single, line = alone(scene, number), scene.ropes[number]
    rope = build(single)
    if runs_over_sheave(scene, line):  # both sides have the damping of one rope
        both = build(alone(with_both_stretches(scene, number), number))
        rope.sections[C] = both.sections[C]
    effects = tuple(_own_params(scene, number, payload_values, params) for params in scene.effects)
    carries = payload_values is not NOTHING and line.to == body_payload(scene)
    two_way = any(figures.differs_rising for figures in point_figures(scene).values())
    relaxes = any(section.rope.is_fibre for line in scene.ropes for section in line.made_of)
    built = build_effects(
        replace(single, effects=effects), payload_values, carries, two_way, relaxes
    )
    net = scene.listed(NetCurtainParams)
    if net is not None and net.between:
        neighbours = _neighbours(scene, net, line.name)
        built = tuple(facing(e, neighbours) if isinstance(e, NetCurtain) else e for e in built)
    touching = scene.listed(PayloadContactParams)
    if touching is not None:
        built = tuple(
            placed(e, touching, joint_of) if isinstance(e, PayloadContact) else e for e in built
        )
    return rope._replace(effects=built)


def _neighbours(scene: Scene, net: NetCurtainParams, name: str) -> list[int]:
    """Return the numbers of the ropes that have a net between them and this one."""
    numbers = {line.name: number for number, line in enumerate(scene.ropes)}
    pairs = [pair for pair in net.between if name in pair]
    return [numbers[pair[pair[0] == name]] for pair in pairs]


def _own_params(scene: Scene, number: int, figures: PayloadFigures, params: Any) -> Any:
    """Return an effect's parameters for one rope."""
    line = scene.ropes[number]
    payload = find_payload(scene, line)
    carried = None if figures is NOTHING else payload
    if isinstance(params, SplashZoneParams):
        params = (payload.splash_zone if payload else None) or params
        return params if carried else replace(params, bottom_area_m2=0.0)
    if isinstance(params, NetParams):
        net = carried.net if carried else None
        return _of_payload(params, net, carried) or replace(params, panels=0)
    if isinstance(params, NetCurtainParams):
        params = panels_beside(line, params)
        return params if params.rope in ("", line.name) else replace(params, panels=0)
    if isinstance(params, FairingParams):
        fairing = carried.fairing if carried else None
        return _of_payload(params, fairing, carried) or replace(params, face_m2=0.0)
    if isinstance(params, PayloadSheddingParams):
        sheds = carried and params.payload in ("", carried.name)
        return params if sheds else replace(params, lift_coefficient=0.0)
    if isinstance(params, RigidBodyParams):
        name = body_payload(scene)
        bars = sum(0.5 * strut.mass_kg for strut in scene.struts if name in strut.between)
        params = replace(params, hook_mass_kg=params.hook_mass_kg + bars)
    if isinstance(params, BendingParams):
        params = line.bending or params
        if line.from_ not in places(scene):  # a connection is a hinge
            params = replace(params, clamped_along=None)
    return params


def _of_payload(params: Any, of_payload: Any, payload: Payload | None) -> Any:
    """Return the net or fairing of a payload: its own, or the effect's, or None."""
    if of_payload is not None:
        return replace(params, **vars(of_payload))
    return params if payload and params.payload in ("", payload.name) else None


def _floats(scene: Scene, line: RopeLine) -> bool:
    """Return whether the rope as a whole is lighter than water."""
    lengths = line.lengths_m(line.length_m)
    weights = (weight_n_per_m(section.rope, scene.environment) for section in line.made_of)
    return sum(w * length for w, length in zip(weights, lengths, strict=True)) < 0.0


def _meetings(scene: Scene) -> list[str]:
    """Return payloads and joints at which several ropes or a bar end, or that others touch."""
    ends = [name for line in scene.ropes for name in (line.from_, line.to)]
    ends += [name for strut in scene.struts for name in strut.between]
    points: list[Any] = [*scene.payloads, *scene.joints, *scene.sheaves]
    barred = {name for strut in scene.struts for name in strut.between}
    touching = scene.listed(PayloadContactParams)
    barred |= {body.name for body in touching.bodies} if touching is not None else set()
    return [point.name for point in points if ends.count(point.name) > 1 or point.name in barred]

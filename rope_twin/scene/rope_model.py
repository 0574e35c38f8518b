"""Conversion of a scene to arrays: model, initial state near equilibrium, effects."""

from __future__ import annotations

from collections.abc import Sequence
from math import ceil, pi, radians, sqrt
from typing import Any

import numpy as np
from numpy.polynomial.legendre import leggauss

from rope_twin.core import state as rows
from rope_twin.core.bed import Grid, Plane
from rope_twin.core.body.components import Shedding
from rope_twin.core.body.state import Afloat, GridBed, PlaneBed, RigidBody
from rope_twin.core.body.step import with_parts
from rope_twin.core.fibre import new_fibre
from rope_twin.core.loads.hooks import hooks_of, work_rows
from rope_twin.core.moved_end import HarmonicEnd, PrescribedEnd, prescribed_end
from rope_twin.core.payout import TRIALS
from rope_twin.core.state import (
    ELEMENTS,
    POSITION,
    SAME_PLACE,
    STEPS_PER_CALL,
    Floats,
    Model,
    State,
    Table,
    columns_for,
    new_state,
    new_work,
)
from rope_twin.core.state import Rope as CoreRope
from rope_twin.effects import EFFECTS, Surroundings
from rope_twin.effects.bed_friction import BedFrictionParams, GridFriction, PlaneFriction
from rope_twin.effects.bending import BendingParams
from rope_twin.effects.drag import DragParams
from rope_twin.effects.payload import Payload as PayloadEffect
from rope_twin.effects.payload import PayloadParams, SplashZone, SplashZoneParams, TwoWayPayload
from rope_twin.effects.payload_shedding import PayloadShedding
from rope_twin.effects.rigid_body import RigidBodyParams
from rope_twin.effects.rope_in_air import WettingParams
from rope_twin.effects.rope_mass import AddedMassParams, Weight
from rope_twin.effects.seabed import SeabedParams
from rope_twin.errors import SceneError
from rope_twin.scene.grid import (
    MAX_TOLERANCE_N,
    MIN_TOLERANCE_N,
    TOLERANCE_SHARE,
    ends_m,
    find_payload,
    is_compensated,
    min_line_out_m,
    node_coordinates,
    section_damping,
)
from rope_twin.scene.rigging import refuse_joined
from rope_twin.scene.rope_data import StiffnessTable, cubics
from rope_twin.scene.schema import EndMotion, RopeLine, Scene
from rope_twin.scene.shapes import NOTHING, PayloadFigures, payload_figures

COLUMNS = 3  # along each side of a partially submerged body
MIN_SHARE = 0.1  # of the weight in air: minimum load of a nearly buoyant body on the seabed


def meet(built: Sequence[Any], scene: Scene) -> tuple[Any, ...]:
    """Return the kernel data of a scene's effects, one of which is a rigid body."""
    (body,) = (built_effect for built_effect in built if isinstance(built_effect, RigidBody))
    parts, others = list(body.parts), []
    for built_effect in built:
        if isinstance(built_effect, SplashZone):
            (zone,) = (effect for effect in scene.effects if isinstance(effect, SplashZoneParams))
            parts[0] = _outline_columns(zone, body, scene.environment.water_density_kg_per_m3)
            continue
        if isinstance(built_effect, Plane | Grid):
            (params,) = (effect for effect in scene.effects if isinstance(effect, SeabedParams))
            parts.append(_bed(built_effect, params, body, _payload_friction(scene, params)))
            if body.here:  # the rope's end carries only the hook
                k = max(body.hook_weight, 0.0) / params.payload_penetration_m
                built_effect = built_effect._replace(soil=built_effect.soil._replace(k_payload=k))
        if isinstance(built_effect, PayloadShedding):
            a, b, c = (float(side) for side in body.size)
            parts.append(Shedding(built_effect.k, built_effect.turns, b * c, a * c, a * b))
            continue
        others.append(built_effect)
    joined = with_parts(body, tuple(parts))
    if body.here and isinstance(parts[0], Afloat):  # it may begin in the air
        joined = joined._replace(W=body.m * body.g + body.hook_weight)
    return tuple(joined if built_effect is body else built_effect for built_effect in others)


def _outline_columns(params: SplashZoneParams, body: RigidBody, density: float) -> Afloat:
    """Return columns over the body's outline."""
    places, weights = leggauss(COLUMNS)
    (a, b, _), (X, Y, Z) = body.size, body.middle
    columns = [
        (X + 0.5 * a * x, Y + 0.5 * b * y, Z, 0.25 * wx * wy, 0.5 * a * x, 0.5 * b * y)
        for x, wx in zip(places, weights, strict=True)
        for y, wy in zip(places, weights, strict=True)
    ]
    return Afloat(
        columns=np.array(columns, dtype=float),
        height=params.height_m,
        side_x=float(a) / COLUMNS,
        side_y=float(b) / COLUMNS,
        span_x=0.5 * float(a) / sqrt(3.0),
        span_y=0.5 * float(b) / sqrt(3.0),
        buoyancy_offset=body.buoyed - body.middle,
        slam=0.5 * density * params.slamming * params.bottom_area_m2,
    )


def _payload_friction(scene: Scene, bed: SeabedParams) -> float:
    """Return the friction coefficient of a payload, that across the rope with `bed_friction`."""
    sticks = scene.listed(BedFrictionParams)
    return bed.friction if sticks is None or sticks.lateral is None else sticks.lateral


def _bed(shape: Plane | Grid, params: SeabedParams, body: RigidBody, friction: float) -> Any:
    """Return the seabed below the corners."""
    weight = (body.m - body.displaced) * body.g
    k = max(weight, MIN_SHARE * body.m * body.g) / params.payload_penetration_m / body.carrying
    kind: Any = GridBed if isinstance(shape, Grid) else PlaneBed
    return kind(shape=shape, k=float(k), chi=shape.soil.chi, mu=friction)


SPLIT_ABOVE, MERGE_BELOW = 1.5, 0.4  # times the element length; leaves a hysteresis of 0.1
ABSORB_S = 1.0
SPARE_NODES = 4  # the hang-off, a top element not yet merged, and one to spare
# of the friction that holds an element: mismatches near all of it would push elements on, and a
# rope that sticks would never come to rest
TOLERANCE_STUCK_SHARE = 0.01


def build(scene: Scene) -> CoreRope:
    """Return the arrays of the scene's rope with a straight, stretched initial guess of its shape.

    Raises:
        SceneError: a multi-line scene, an effect without a kernel, or an incomplete payload.
    """
    refuse_joined(scene)
    line = scene.ropes[0]
    payload = find_payload(scene, line)
    density = scene.environment.water_density_kg_per_m3
    figures = payload_figures(payload, density) if payload else None
    effects = build_effects(scene, figures)
    sections = _sections(scene, line, figures)
    s = node_coordinates(line, min_line_out_m(scene), is_compensated(scene))
    tension = _static_tension(effects, sections, s)
    length = float(s[-1] - s[-2])
    model = Model(
        element_length=length,
        split_above=SPLIT_ABOVE * length,
        merge_below=MERGE_BELOW * length,
        absorb=ABSORB_S,
        first_free=1 if line.fixed_at_m is not None else 0,
        step=scene.time.step_s,
        tolerance=scene.time.newton_tolerance_n or _tolerance(tension, effects),
    )
    elements = len(s) - 1
    state = new_state(_node_capacity(scene, line, s))
    state.counts[ELEMENTS] = elements
    state.s[: elements + 1] = s
    _place(state, scene, line, tension)
    work = new_work(columns_for(state.s.shape[0]), work_rows(effects))
    law = tables_of(line) if any(section.rope.axial_stiffness for section in line.made_of) else None
    return CoreRope(model, state, work, sections, effects, law)


def _node_capacity(scene: Scene, line: RopeLine, s: Floats) -> int:
    """Return the node capacity of the arrays of a rope with nodes at these coordinates."""
    longest_m = scene.winch.max_line_out_m if scene.winch else line.length_m
    to_come = ceil((longest_m - line.length_m) / float(s[-1] - s[-2])) + len(line.made_of)
    return len(s) - 1 + to_come + SPARE_NODES + TRIALS


def build_effects(
    scene: Scene,
    figures: PayloadFigures | None,
    carries_body: bool = True,
    two_way: bool = False,
    relaxes: bool = False,
) -> tuple[Any, ...]:
    """Return the kernel data of the effects that the scene lists, in the order of EFFECTS.

    figures: of the payload at the lower end; carries_body: whether it is the scene's rigid body,
    if there is one; two_way: whether any payload of the scene differs in ascent and descent;
    relaxes: whether another rope of the scene has a dynamic stiffness.
    """
    water = scene.environment
    Ca = sum(params.normal for params in scene.effects if isinstance(params, AddedMassParams))
    tangential = sum(
        params.tangential for params in scene.effects if isinstance(params, AddedMassParams)
    )
    Cd = sum(params.normal for params in scene.effects if isinstance(params, DragParams))
    line = scene.ropes[0]
    room = _node_capacity(
        scene, line, node_coordinates(line, min_line_out_m(scene), is_compensated(scene))
    )
    density, gravity = water.water_density_kg_per_m3, water.gravity_m_per_s2
    EI = sum(params.stiffness_n_m2 for params in scene.effects if isinstance(params, BendingParams))
    bed = scene.listed(SeabedParams)
    surroundings = Surroundings(
        density, gravity, Ca, room, Cd, EI, two_way=two_way,
        friction=0.0 if bed is None else bed.friction,
        sticks=scene.listed(BedFrictionParams) is not None,
        added_mass_along=tangential,
        carries=scene.listed(PayloadParams) is not None,
        wets=scene.listed(WettingParams) is not None,
        diameter=max(part.rope.diameter_m for rope in scene.ropes for part in rope.made_of),
    )  # fmt: skip
    has_body = scene.listed(RigidBodyParams) is not None
    built = []
    for effect in EFFECTS:
        for params in scene.effects:
            if type(params) is effect.params:
                # a body hangs below the rope's end: for other effects that end is unloaded
                of_body = isinstance(params, RigidBodyParams)
                effect_figures = NOTHING if has_body and of_body != carries_body else figures
                built.append(effect.build(params, effect_figures, surroundings))
                if params is bed:
                    surroundings = surroundings._replace(bed=built[-1])
                if not hooks_of(type(built[-1])):
                    raise SceneError(f"effect '{effect.name}'", "it has no kernel", "register one")
    if relaxes or any(section.rope.is_fibre for section in line.made_of):
        built.append(new_fibre(room))
    if line.end_motion is not None:
        built.append(_moved_end(line, line.end_motion))
    return meet(built, scene) if has_body else tuple(built)


def _moved_end(line: RopeLine, motion: EndMotion) -> HarmonicEnd | PrescribedEnd:
    """Return the kernel data of the motion of a rope's lower end."""
    assert line.fixed_at_m is not None, "a rule of scenes"
    if motion.from_outside:
        return prescribed_end(line.fixed_at_m, STEPS_PER_CALL + 1)
    waves = [(*harmonic.amplitude_m, 2.0 * pi / harmonic.period_s, radians(harmonic.phase_deg))
             for harmonic in motion.harmonics]  # fmt: skip
    return HarmonicEnd(np.array(line.fixed_at_m), np.array(waves, dtype=float), motion.ramp_s)


def _sections(scene: Scene, line: RopeLine, figures: PayloadFigures | None) -> Floats:
    """Return the rope's properties per metre, (rows.SECTION_ROWS, sections)."""
    columns = np.zeros((rows.SECTION_ROWS, len(line.made_of)))
    columns[rows.END] = ends_m(line)
    columns[rows.C] = section_damping(scene, line, figures)
    if is_compensated(scene) and len(line.made_of) > 1:
        columns[rows.C, 0] = 0.0  # it has its own damping
    drag = scene.listed(DragParams)
    for column, section in zip(columns.T, line.made_of, strict=True):
        rope = section.rope
        d = rope.hydrodynamic_diameter_m
        frontal, skin = d, pi * d
        if drag is not None and rope.drag_normal is not None:
            frontal = rope.diameter_m * rope.drag_normal / drag.normal
        if drag is not None and rope.drag_tangential is not None:
            skin = pi * rope.diameter_m * rope.drag_tangential / drag.tangential
        column[rows.EA] = rope.tangent_n(0.0)
        if rope.axial_stiffness is not None and rope.axial_stiffness.dynamic is not None:
            column[rows.RELAXATION : rows.PER_METRE] = _fibre_figures(rope.axial_stiffness)
        column[rows.PER_METRE :] = rope.mass_kg_per_m, 0.25 * pi * d**2, frontal, skin, 1.0
    return columns


def _fibre_figures(stiffness: StiffnessTable) -> list[float]:
    """Return the rows RELAXATION to HIGHEST of a fibre rope's section."""
    dynamic, works = stiffness.dynamic, stiffness.working_curve
    assert dynamic is not None, "asked of fibre ropes only"
    per_tension = dynamic.per_mean_tension, dynamic.per_tension_amplitude
    law = [1.0 / dynamic.relaxation_s, dynamic.constant_n, *per_tension]
    if works is None:
        return [*law, 0.0, 0.0, 0.0]
    return [*law, works.permanent, works.curvature, works.max_mean_tension_n]


def tables_of(line: RopeLine) -> Table:
    """Return tension over strain of each section; a straight line where it has no table."""
    tables = []
    for rope in (section.rope for section in line.made_of):
        table = rope.axial_stiffness and rope.axial_stiffness.table
        tables.append(table or ((0.0, 0.0), (1.0, rope.tangent_n(0.0))))
    return cubics(tables)


def _static_tension(effects: tuple[Any, ...], sections: Floats, s: Floats) -> Floats:
    """Return the static tension [N] at these coordinates of a straight hanging rope."""
    ends = (PayloadEffect, TwoWayPayload, RigidBody)
    tension = np.full(len(s), sum(e.W for e in effects if isinstance(e, ends)), float)
    for effect in effects:
        if not isinstance(effect, Weight):
            continue
        low = 0.0
        for end, mass, volume in sections[[rows.END, rows.PER_METRE, rows.PER_METRE + 1]].T:
            weight = effect.g * (mass - effect.density * volume)
            tension += weight * np.clip(s - low, 0.0, end - low)
            low = end
    return tension


def _tolerance(tension: Floats, effects: tuple[Any, ...]) -> float:
    """Return the largest tension mismatch of an accepted stage [N].

    tension: of the straight hanging rope at its nodes, so it grows by the weight of each element.
    """
    tolerance = min(TOLERANCE_SHARE * abs(float(tension[-1])), MAX_TOLERANCE_N)
    for effect in effects:
        if isinstance(effect, PlaneFriction | GridFriction):
            weight = float(np.median(np.diff(tension)))
            stuck = min(effect.axial, effect.lateral) * effect.slip * weight
            tolerance = min(tolerance, TOLERANCE_STUCK_SHARE * stuck)
    return max(tolerance, MIN_TOLERANCE_N)


def _place(state: State, scene: Scene, line: RopeLine, tension: Floats) -> None:
    """Set the initial guess: hanging straight and stretched, or straight to the fixed end."""
    n = int(state.counts[ELEMENTS])
    top = np.array(scene.ship.hang_off_m)
    s = state.s[: n + 1]
    if line.fixed_at_m is not None:
        low = np.array(line.fixed_at_m)
        straight = low[:, None] + (top - low)[:, None] * (s / s[-1])
        state.nodes[POSITION : POSITION + 3, : n + 1] = straight
        return
    strain, begins = np.zeros(n), [0.0, *ends_m(line)[:-1]]
    for section, end in zip(line.made_of[::-1], begins[::-1], strict=True):
        for e in np.flatnonzero((s[:-1] >= end - SAME_PLACE) & (strain == 0.0)):
            strain[e] = section.rope.strain_at(0.5 * float(tension[e] + tension[e + 1]))
    depth: Floats = np.concatenate([[0.0], np.cumsum(np.diff(s) * (1.0 + strain))])
    state.nodes[POSITION, : n + 1] = top[0]
    state.nodes[POSITION + 1, : n + 1] = top[1]
    state.nodes[POSITION + 2, : n + 1] = top[2] - depth[-1] + depth

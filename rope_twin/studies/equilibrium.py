"""Static equilibrium of one rope or of a system, with what its modes are computed from.

For the small undamped motion of a rigid body on its slings about rest the unknowns are the
displacements of hook and centre of gravity G and the rotation ψ about G, in world axes. A sling
with the force f = T·n on the body at the arm a from G stretches by n·δ with δ = δ_hook - δ_G + a ×
ψ; its force changes by (k·n·nᵀ + T/l·(I - n·nᵀ))·δ, and its moment by that and by (ψ × a) × f =
a·(ψ·f) - ψ·(a·f); so does the moment of buoyancy. The mass is that of core/ body/loads: body, and
added mass at the reference point h, M_A·c with c = v + Ω × h. The change of drag with the attitude
is neglected, as for ropes.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np

from rope_twin.core.bed import Grid, Plane
from rope_twin.core.bed_shape import clearance
from rope_twin.core.body import state as at
from rope_twin.core.body.components import bed_forces, deck_forces
from rope_twin.core.body.loads import component_of
from rope_twin.core.body.state import LENGTH, Deck, GridBed, PlaneBed, RigidBody
from rope_twin.core.body.step import Pose, pose_of
from rope_twin.core.joined import joints as ties
from rope_twin.core.joined.joints import LOOSE, System
from rope_twin.core.joined.stack import FROM, INTO, POINT, SHEAVE_MASS, WHEEL, Sheaves
from rope_twin.core.joined.statics import solve_reeved_statics, weigh
from rope_twin.core.state import (
    BLOCK,
    ELEMENTS,
    END,
    FRONTAL,
    LINE,
    MOTIONS,
    PER_METRE,
    POSITION,
    STIFFNESS,
    TENSION,
    Floats,
    Rope,
)
from rope_twin.core.statics import solve_statics
from rope_twin.core.still_rope import SYMMETRIC, Couplings, Elastic, StillRope
from rope_twin.effects.bed_friction import BedFrictionParams
from rope_twin.effects.current import CurrentParams
from rope_twin.effects.payload import SplashZone
from rope_twin.effects.rope_in_air import WettingParams
from rope_twin.effects.seabed import SeabedParams
from rope_twin.errors import SceneError
from rope_twin.scene.joined_model import build_joined
from rope_twin.scene.rigging import winch_of
from rope_twin.scene.rope_model import build
from rope_twin.scene.schema import RopeLine, Scene
from rope_twin.twin.snapshot_builder import body_of

HOOK, CENTRE, TURN = slice(0, 3), slice(3, 6), slice(6, 9)  # of the unknowns


@dataclass(frozen=True)
class StillLine:
    """One of the ropes, n elements from its lower end up; both of its ends are nodes."""

    name: str
    place: Floats  # (3, n + 1)
    s: Floats  # unstretched from the upper end [m], (n + 1,)
    tension: Floats  # (n,)
    stiffness: Floats  # dT/dl of the elements [N/m], (n,)
    mass: Floats  # of the nodes, (n + 1, 3, 3)
    couplings: Couplings | None  # of bending
    held: Floats  # stiffness of surface and seabed at the nodes along x, y, z [N/m], (n + 1, 3)

    @property
    def directions(self) -> tuple[Floats, Floats]:
        """Return unit vectors (3, n) and lengths [m] of the elements."""
        span = np.diff(self.place, axis=1)
        length = np.sqrt((span * span).sum(axis=0))
        return span / length, length


@dataclass(frozen=True)
class AtRest(StillLine):
    """The rope of a scene at rest, whose last node is the hang-off."""

    scene: Scene
    first: int  # free node
    tangent: Floats  # at the free nodes, (3, n)
    rest: Floats  # unstretched lengths of the elements [m]
    lies: Any  # whether each node is on the seabed, (n + 1,)
    body: SuspendedBody | None  # below node 0, whose mass is then that of rope and hook alone

    @property
    def free_mass(self) -> Floats:
        """Return the mass of the free nodes, from the lower end up, (n, 3, 3)."""
        return self.mass[self.first : -1]

    @property
    def free_count(self) -> int:
        """Return the number of free nodes."""
        return len(self.free_mass)


def bring_to_rest(scene: Scene) -> AtRest:
    """Return the static equilibrium of the scene's rope in its current.

    Raises:
        SceneError: it cannot rest, is slack somewhere, or its rigid body does not hang clear.
    """
    rope, line = build(scene), scene.ropes[0]
    end = solve_statics(rope, line.length_m)
    if not end.found:
        raise SceneError(
            f"{scene.path}: ropes[0]", "no static equilibrium", "check what holds the rope"
        )
    still = StillRope(rope, line.length_m)
    position = still.place.copy()
    forces = still.forces(position)
    body = _body_of(scene, rope)  # as it rests at this place
    _check_taut(scene, 0, forces.tension)
    span = np.diff(position, axis=1)
    law: Elastic = still.elastic(np.sqrt((span * span).sum(axis=0)))
    direction = span / np.sqrt((span * span).sum(axis=0))
    mean = direction.copy()
    mean[:, 1:] += direction[:, :-1]
    first = still.first
    tangent = mean / np.sqrt((mean * mean).sum(axis=0))
    mass = forces.mass[SYMMETRIC]
    if body is not None:
        mass = StillRope(without_body(rope), line.length_m).forces(position).mass[SYMMETRIC]
    still.rest_at(position)
    couplings = still.couplings() if still.reach > 1 else None
    node_masses = np.append(np.moveaxis(mass, 2, 0), np.zeros((1, 3, 3)), axis=0)
    stiffness = _yielding(scene, line, forces.tension, law.stiffness)
    return AtRest(
        line.name, position, _from_top(still), forces.tension, stiffness, node_masses,
        couplings, _held(scene, rope, position), scene, first, tangent[:, first:], still.rest,
        lying(rope, position), body,
    )  # fmt: skip


def _yielding(scene: Scene, line: RopeLine, tension: Floats, stiffness: Floats) -> Floats:
    """Return the stiffness of a rope's elements [N/m], a passive compensator at its winch included.

    Its gas carries the static tension; the uppermost element and k/falls² are in series. The mass
    of the flying sheave is neglected.
    """
    stiffness, winch = stiffness.copy(), winch_of(scene, line)
    unit = None if winch is None else winch.passive_compensation
    if unit is not None:
        load_n, area = unit.falls * float(tension[-1]), unit.piston_area_m2
        ratio = (unit.gas_pressure_pa * area / load_n) ** (1.0 / unit.exponent)
        volume = unit.gas_volume_m3 * ratio
        spring = unit.exponent * load_n * area / volume
        if abs(unit.gas_volume_m3 - volume) > 0.5 * unit.stroke_m * area:  # at a stop
            spring += unit.stop_stiffness_n_per_m
        stiffness[-1] = 1.0 / (1.0 / stiffness[-1] + unit.falls**2 / spring)
    return stiffness


def lying(rope: Rope, position: Floats) -> Any:
    """Return whether each node is on the seabed, (nodes,); position: (3, nodes)."""
    bed = _bed_of(rope)
    return np.zeros(position.shape[1], bool) if bed is None else clearance(bed, position) <= 0.0


def _bed_of(rope: Rope) -> Plane | Grid | None:
    return next((effect for effect in rope.effects if isinstance(effect, Plane | Grid)), None)


def _held(scene: Scene, rope: Rope, position: Floats) -> Floats:
    """Return the stiffness of surface and seabed at the nodes along x, y, z [N/m], (nodes, 3).

    A payload in the surface has ρ·g·V/H. A node on the seabed has the stiffness of the soil, in all
    directions if there is friction: it sticks in a motion that is small.
    """
    held, lowest_m = np.zeros((position.shape[1], 3)), position[2, 0]
    zones = [effect for effect in rope.effects if isinstance(effect, SplashZone)]
    held[0, 2] = sum(one.lift / one.height for one in zones if abs(lowest_m) < 0.5 * one.height)
    bed, params = _bed_of(rope), scene.listed(SeabedParams)
    if bed is not None and params is not None:
        n, sticks = position.shape[1] - 1, scene.listed(BedFrictionParams) is not None
        soil = bed.soil.k * rope.work[FRONTAL, : n + 1]
        soil[0] += bed.soil.k_payload
        sideways = 1.0 if params.friction > 0.0 or sticks else 0.0
        held += (soil * lying(rope, position))[:, None] * np.array([sideways, sideways, 1.0])
    return held


def _from_top(still: StillRope) -> Floats:
    """Return the unstretched length from the upper end to each node [m], (n + 1,)."""
    return np.append(np.cumsum(still.rest[::-1])[::-1], 0.0)


def _check_taut(scene: Scene, number: int, tension: Floats) -> None:
    if not (tension > 0.0).all():
        slack = f"{(tension <= 0.0).sum()} of {len(tension)} elements are slack at rest"
        problem = f"{slack}, so it has no natural frequency"
        remedy = "give it weight, tension or a payload"
        raise SceneError(f"{scene.path}: ropes[{number}]", problem, remedy)


def _body_of(scene: Scene, rope: Rope) -> SuspendedBody | None:
    """Return the rigid body that hangs at rest below a rope; None if there is none."""
    body = body_of(rope)
    if body is None:
        return None
    return suspended_body(scene, body, rope.state.nodes[POSITION : POSITION + 3, 0])


def water_at(scene: Scene, z: Floats) -> Floats:
    """Return the scene's current at these heights [m/s], (3, n); 0 where its rope is in the air."""
    water = np.zeros((3, len(z)))
    for params in scene.effects:
        if isinstance(params, CurrentParams):
            rows = params.table[::-1]
            for k in range(3):
                water[k] += np.interp(z, rows[:, 0], rows[:, 1 + k])
    if scene.listed(WettingParams) is not None:
        water[:, z > 0.0] = 0.0
    return water


def speed_across(scene: Scene, position: Floats) -> Floats:
    """Return the speed of the current normal to a line at its nodes (3, nodes) [m/s].

    At both ends as well: the half of an element there sheds vortices too.
    """
    water = water_at(scene, position[2])
    direction = np.gradient(position, axis=1)
    direction /= np.sqrt((direction * direction).sum(axis=0))
    across = water - (water * direction).sum(axis=0) * direction
    return np.asarray(np.sqrt((across * across).sum(axis=0)))


def per_metre(rest: AtRest) -> Floats:
    """Return mass [kg] and volume [m³] per unstretched metre of each element, (2, elements)."""
    sections = build(rest.scene).sections
    middle = np.cumsum(rest.rest) - 0.5 * rest.rest
    index = np.searchsorted(sections[END], middle, side="right")
    return np.asarray(sections[PER_METRE : PER_METRE + 2, index])


def node_diameters(rest: AtRest) -> Floats:
    """Return the hydrodynamic diameter at each node, the mean of its elements [m]."""
    diameter = np.sqrt(4.0 * per_metre(rest)[1] / np.pi)
    padded = np.concatenate([diameter[:1], diameter, diameter[-1:]])
    return np.asarray(0.5 * (padded[1:] + padded[:-1]))


@dataclass(frozen=True)
class StillSystem:
    """Ropes at rest, and how their nodes follow the unknowns: joints, free nodes, flows."""

    scene: Scene
    lines: tuple[StillLine, ...]
    follow: Any  # sparse, (3·nodes of all ropes, unknowns)
    joint_mass: Floats  # what sheaves weigh themselves and wheels turn with, of each unknown [kg]
    tied: Any  # sparse stiffness of bars, tethers and slings [N/m], (unknowns, unknowns)
    system: System  # in equilibrium
    body: SuspendedBody | None = None  # its six unknowns are the last ones
    body_mass: Any = None  # sparse mass of it, (unknowns, unknowns)


def bring_system_to_rest(scene: Scene) -> StillSystem:
    """Return the static equilibrium of the scene's ropes in their current.

    Raises:
        SceneError: they cannot rest, are slack somewhere, or a rigid body does not hang clear.
    """
    model = build_joined(scene)
    system = model.system
    held = np.zeros((len(scene.ropes), MOTIONS))
    held[:, :LINE] = np.nan_to_num(model.hang_off_m)
    held[:, LINE] = [line.length_m for line in scene.ropes]
    if not solve_reeved_statics(system, held).found:
        remedy = "check what holds the ropes"
        raise SceneError(f"{scene.path}: ropes", "no static equilibrium", remedy)
    bodies = [_body_of(scene, rope) for rope in system.ropes]
    weigh(system._replace(ropes=tuple(without_body(rope) for rope in system.ropes)), held)
    lines = tuple(
        _line(scene, number, rope, held[number, LINE]) for number, rope in enumerate(system.ropes)
    )
    still = StillSystem(scene, lines, *_unknowns(system, lines), system)
    for r, body in enumerate(bodies):
        if body is not None:
            return _with_body(still, r, body)
    return still


def _with_body(still: StillSystem, r: int, body: SuspendedBody) -> StillSystem:
    """Return the system with six more unknowns for the body below rope r."""
    from scipy.sparse import csr_array, hstack

    joints, count = still.system.joints, still.follow.shape[1]
    wheels = 0 if still.system.sheaves is None else still.system.sheaves.figures.shape[1]
    line_numbers, _ = _numbers(still.system, still.lines, joints.nodes.shape[1] - wheels)
    hook = 3 * int(line_numbers[r][0])
    return replace(
        still,
        follow=hstack([still.follow, csr_array((still.follow.shape[0], 6))]).tocsr(),
        joint_mass=np.append(still.joint_mass, np.zeros(6)),
        tied=with_body(still.tied, body.stiffness, hook),
        body=body,
        body_mass=with_body(csr_array((count, count)), body.mass, hook),
    )


def with_body(ropes: Any, stiffness: Floats, hook: int) -> Any:
    """Return a sparse matrix of ropes with that of a body, (9, 9), whose rotation and centre are
    six more unknowns.

    hook: the first of its node's three unknowns.
    """
    from scipy.sparse import block_diag, coo_array, csr_array

    count = ropes.shape[0]
    indices = np.concatenate([hook + np.arange(3), count + np.arange(6)])
    row, column = np.meshgrid(indices, indices, indexing="ij")
    size = (count + 6, count + 6)
    added = coo_array((stiffness.ravel(), (row.ravel(), column.ravel())), shape=size)
    return block_diag([ropes, csr_array((6, 6))]).tocsr() + added.tocsr()


def _line(scene: Scene, number: int, rope: Rope, length_m: float) -> StillLine:
    """Return one rope as weighed in the equilibrium."""
    n = int(rope.state.counts[ELEMENTS])
    tension, name = rope.work[TENSION, :n].copy(), scene.ropes[number].name
    _check_taut(scene, number, tension)
    still = StillRope(rope, length_m)
    position: Floats = still.place.copy()
    mass = np.moveaxis(rope.work[BLOCK : BLOCK + 6, : n + 1][SYMMETRIC], 2, 0).copy()
    couplings = still.couplings() if still.reach > 1 else None
    stiffness = _yielding(scene, scene.ropes[number], tension, rope.work[STIFFNESS, :n])
    held = _held(scene, rope, position)
    return StillLine(name, position, _from_top(still), tension, stiffness, mass, couplings, held)


def _numbers(system: System, lines: tuple[StillLine, ...], points: int) -> tuple[list[Any], int]:
    """Return each node's index among connections and free nodes, or LOOSE; and their number."""
    joints, line_numbers, count = system.joints, [], points
    for r, rope in enumerate(system.ropes):
        n = lines[r].place.shape[1] - 1
        numbers = np.full(n + 1, LOOSE)
        free = range(int(rope.model.first_free), n)
        numbers[free.start : n] = count + np.arange(len(free))
        count += len(free)
        if joints.lower[r] != LOOSE:
            numbers[0] = joints.lower[r]
        if joints.upper[r] != LOOSE:
            numbers[n] = joints.upper[r]
        line_numbers.append(numbers)
    return line_numbers, count


def _unknowns(system: System, lines: tuple[StillLine, ...]) -> tuple[Any, Floats, Any]:
    """Return `follow`, `joint_mass` and `tied` of a system.

    Unknowns are three for each joint, three for each node that is no end and none that is held, and
    the flow over each sheave.
    """
    from scipy.sparse import coo_array

    joints, sheaves = system.joints, system.sheaves
    wheels = 0 if sheaves is None else sheaves.figures.shape[1]
    line_numbers, count = _numbers(system, lines, joints.nodes.shape[1] - wheels)
    node_numbers = np.concatenate(line_numbers)
    node = np.flatnonzero(node_numbers != LOOSE)
    axes = np.arange(3)
    rows = (3 * node[:, None] + axes).ravel()
    columns = (3 * node_numbers[node][:, None] + axes).ravel()
    values = np.ones(len(rows))
    mass = np.zeros(3 * count + wheels)
    if sheaves is not None:
        ends = np.cumsum([len(numbers) for numbers in line_numbers]) - 1
        for k in range(wheels):
            more = _over(sheaves, k, lines, ends)
            rows, values = np.append(rows, more[0]), np.append(values, more[1])
            columns = np.append(columns, np.full(len(more[0]), 3 * count + k))
            point = int(sheaves.figures[POINT, k])
            mass[3 * point : 3 * point + 3] += sheaves.figures[SHEAVE_MASS, k]
            mass[3 * count + k] += sheaves.figures[WHEEL, k]
    size = 3 * count + wheels
    follow = coo_array((values, (rows, columns)), shape=(3 * len(node_numbers), size)).tocsr()
    return follow, mass, _tied(joints.ties, joints.nodes[POSITION : POSITION + 3], size)


def _over(
    sheaves: Sheaves, k: int, lines: tuple[StillLine, ...], ends: Any
) -> tuple[Floats, Floats]:
    """Return rows and values by which the rope's last nodes follow the flow over sheave k.

    Rope that comes over goes down the one line and up the other, stretched as it is.
    """
    into_line, from_line = (int(sheaves.figures[row, k]) for row in (INTO, FROM))
    first, second = lines[into_line], lines[from_line]
    (t, t_length), (u, u_length) = first.directions, second.directions
    mean = 0.5 * (t_length[-1] / first.s[-2] + u_length[-1] / second.s[-2])
    rows = np.concatenate([3 * ends[into_line] + np.arange(3), 3 * ends[from_line] + np.arange(3)])
    return rows, np.concatenate([-mean * t[:, -1], mean * u[:, -1]])


def _tied(held: Floats, position: Floats, size: int) -> Any:
    """Return the axial and geometric stiffness of struts and tensioners."""
    from scipy.sparse import coo_array

    matrix = coo_array((size, size)).tocsr()
    for tie in held.T:
        first, second = int(tie[ties.FIRST]), int(tie[ties.SECOND])
        anchored = second == ties.ANCHORED
        end = tie[ties.AT : ties.AT + 3] if anchored else position[:, second]
        span = end - position[:, first]
        length = float(np.sqrt(span @ span))
        d = span / length
        force = max(tie[ties.FORCE] + tie[ties.STIFFNESS] * (length - tie[ties.LENGTH]),
                    tie[ties.LEAST])  # fmt: skip
        axial = tie[ties.STIFFNESS] if force > tie[ties.LEAST] else 0.0
        block = (axial - force / length) * np.outer(d, d) + force / length * np.eye(3)
        spots = [(first, first, 1.0)]
        if not anchored:
            spots += [(second, second, 1.0), (first, second, -1.0), (second, first, -1.0)]
        for i, j, sign in spots:
            row, column = np.meshgrid(3 * i + np.arange(3), 3 * j + np.arange(3), indexing="ij")
            entries = (sign * block).ravel(), (row.ravel(), column.ravel())
            matrix = matrix + coo_array(entries, shape=(size, size)).tocsr()
    return matrix


class SuspendedBody(NamedTuple):
    """A body at rest; the first three unknowns are the hook's."""

    stiffness: Floats  # (9, 9) [N/m], [N], [N·m]
    mass: Floats  # (9, 9) [kg], [kg·m], [kg·m²]
    reach: float  # largest distance of its points from G [m]


def suspended_body(scene: Scene, body: RigidBody, hook: Floats) -> SuspendedBody:
    """Return the body at rest below a hook at this position [m], (3,).

    Raises:
        SceneError: it is not fully submerged where the scene has a surface, or stands on something.
    """
    pose = pose_of(body)
    problem = _held_otherwise(body, pose)
    if problem:
        remedy = "lower or lift it until it hangs clear"
        raise SceneError(f"{scene.path}: effects.rigid_body", problem, remedy)
    K = np.zeros((9, 9))
    for leg in body.legs:
        arm = pose.turn @ leg[:3]
        force, stiffness = _sling(leg, hook - pose.centre - arm)
        follow = np.hstack([np.eye(3), -np.eye(3), _cross(arm)])
        K += follow.T @ stiffness @ follow
        K[TURN, TURN] += _turned(arm, force)
    lift = np.array([0.0, 0.0, body.displaced * body.g])
    K[TURN, TURN] += _turned(pose.turn @ body.buoyed, lift)
    return SuspendedBody(0.5 * (K + K.T), _mass(body, pose), float(body.reach))


class SuspendedMotion(NamedTuple):
    """Motion of a rigid body in a mode; energies are twice the kinetic energy at ω = 1."""

    centre: Floats  # of gravity, (3,)
    mass: Floats  # of its translation, (3, 3) [kg]
    energy: float
    largest: float  # motion of a point of it

    @classmethod
    def of(cls, body: SuspendedBody | None, vector: Floats) -> SuspendedMotion:
        """Return the motion of the body, whose unknowns are the last six; at rest without one."""
        if body is None:
            return cls(np.zeros(3), np.zeros((3, 3)), 0.0, 0.0)
        body_motion = vector[-6:]
        largest = np.linalg.norm(body_motion[:3]) + body.reach * np.linalg.norm(body_motion[3:])
        return cls(
            centre=body_motion[:3],
            mass=body.mass[CENTRE, CENTRE],
            energy=float(body_motion @ body.mass[3:, 3:] @ body_motion),
            largest=float(largest),
        )

    def along(self, direction: Floats) -> float:
        """Return the energy of the translation along a direction."""
        component = (self.centre @ direction) * direction
        return float(component @ self.mass @ component)

    @property
    def turning(self) -> float:
        """Return the energy of the rotation, with what it shares with the translation."""
        return max(self.energy - float(self.centre @ self.mass @ self.centre), 0.0)


def without_body(rope: Rope) -> Rope:
    """Return a rope that carries no body."""
    effects = (effect._replace(here=0.0) if isinstance(effect, RigidBody) else effect
               for effect in rope.effects)  # fmt: skip
    return rope._replace(effects=tuple(effects))


def _held_otherwise(body: RigidBody, pose: Pose) -> str:
    """Return what carries the body besides slings and water; or ""."""
    if body.stage[at.SUBMERGED] < 1.0:
        return "the body is not fully submerged, and a floating one has other modes"
    deck, bed = component_of(body, Deck), component_of(body, PlaneBed, GridBed)
    if deck is not None and deck_forces(deck, body, pose).any():
        return "the body stands on the deck, and has no modes of a hanging one"
    if bed is not None and bed_forces(bed, body, pose)[1].any():
        return "the body stands on the seabed, and has no modes of a hanging one"
    return ""


def _sling(leg: Floats, d: Floats) -> tuple[Floats, Floats]:
    """Return a sling's force on the body [N] and its stiffness [N/m]; zero if it is slack.

    d: from its point on the body to the hook.
    """
    k, length = leg[at.STIFFNESS], float(np.linalg.norm(d))
    if leg[LENGTH] == 0.0:  # a pin
        return k * d, k * np.eye(3)
    T, n = k * (length - leg[LENGTH]), d / length
    if T <= 0.0:
        return np.zeros(3), np.zeros((3, 3))
    axial = np.outer(n, n)
    return T * n, k * axial + T / length * (np.eye(3) - axial)


def _turned(arm: Floats, force: Floats) -> Floats:
    """Return minus the derivative of a constant force's moment to the rotation."""
    return np.asarray((arm @ force) * np.eye(3) - np.outer(arm, force))


def _mass(body: RigidBody, pose: Pose) -> Floats:
    """Return the mass of hook and body with added mass, (9, 9)."""
    added, h = np.diag(body.added[:3]), _cross(body.watered)
    inertia = np.zeros((6, 6))
    inertia[:3, :3] = body.m * np.eye(3) + added
    inertia[:3, 3:] = -added @ h
    inertia[3:, :3] = inertia[:3, 3:].T
    inertia[3:, 3:] = body.inertia + np.diag(body.added[3:]) + h.T @ added @ h
    axes = np.kron(np.eye(2), pose.turn)
    mass = np.zeros((9, 9))
    mass[HOOK, HOOK] = body.hook * np.eye(3)
    mass[3:, 3:] = axes @ inertia @ axes.T
    return mass


def _cross(a: Floats) -> Floats:
    """Return the matrix of a × ."""
    x, y, z = a
    return np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])

"""Static equilibrium of one rope or of a system, with what its modes are computed from."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from rope_twin.core.joined import joints as ties
from rope_twin.core.joined.joints import LOOSE, System
from rope_twin.core.joined.sheaves import (
    FROM,
    INTO,
    POINT,
    SHEAVE_MASS,
    WHEEL,
    Sheaves,
)
from rope_twin.core.joined.statics import solve_reeved_statics, weigh
from rope_twin.core.state import (
    BLOCK,
    ELEMENTS,
    LINE,
    MOTIONS,
    POSITION,
    STIFFNESS,
    TENSION,
    Floats,
    Rope,
)
from rope_twin.core.statics import solve_statics
from rope_twin.core.still_rope import SYMMETRIC, Couplings, Elastic, StillRope
from rope_twin.effects.current import CurrentParams
from rope_twin.errors import SceneError, phrase
from rope_twin.scene.model.joined import build_joined
from rope_twin.scene.model.rope import build
from rope_twin.scene.schema import Scene
from rope_twin.studies.modes.hung_body import HungBody, hung_body, without_body
from rope_twin.twin.snapshot_builder import body_of


@dataclass(frozen=True)
class AtRest:
    """A rope at rest; n free nodes from the lower end up, in the matrices' order."""

    scene: Scene
    first: int
    place: Floats  # (3, nodes)
    tension: Floats
    stiffness: Floats  # dT/dl of the elements [N/m]
    mass: Floats  # (3, 3, n)
    couplings: Couplings | None  # of bending, at all nodes but the hang-off's
    tangent: Floats  # at the free nodes, (3, n)
    s: Floats  # unstretched, of the free nodes from the hang-off [m]
    rest: Floats  # unstretched lengths of the elements [m]
    body: HungBody | None  # below node 0, whose mass is then that of rope and hook alone


def bring_to_rest(scene: Scene) -> AtRest:
    """Return the static equilibrium of the scene's rope in its current.

    Raises:
        SceneError: it cannot rest, is slack somewhere, or its rigid body does not hang clear.
    """
    rope, line = build(scene), scene.ropes[0]
    end = solve_statics(rope, line.length_m)
    if not end.found:
        raise SceneError(
            phrase(f"{scene.path}: ropes[0]", "no static equilibrium", "check what holds the rope")
        )
    still = StillRope(rope, line.length_m)
    place = still.place.copy()
    forces = still.forces(place)
    body = _body_of(scene, rope)  # as it rests at this place
    if not (forces.tension > 0.0).all():
        slack = int((forces.tension <= 0.0).sum())
        what = f"{slack} of {still.n} elements are slack at rest, so it has no natural frequency"
        raise SceneError(
            phrase(f"{scene.path}: ropes[0]", what, "give it weight, tension or a payload")
        )
    span = np.diff(place, axis=1)
    law: Elastic = still.elastic(np.sqrt((span * span).sum(axis=0)))
    direction = span / np.sqrt((span * span).sum(axis=0))
    mean = direction.copy()
    mean[:, 1:] += direction[:, :-1]
    first = still.first
    tangent = mean / np.sqrt((mean * mean).sum(axis=0))
    s = np.cumsum(still.rest[::-1])[::-1]
    mass = forces.mass[SYMMETRIC]
    if body is not None:
        mass = StillRope(without_body(rope), line.length_m).forces(place).mass[SYMMETRIC]
    still.rest_at(place)
    couplings = still.couplings() if still.reach > 1 else None
    return AtRest(
        scene, first, place, forces.tension, law.stiffness, mass[:, :, first:], couplings,
        tangent[:, first:], s[first:], still.rest, body,
    )  # fmt: skip


def _body_of(scene: Scene, rope: Rope) -> HungBody | None:
    """Return the rigid body that hangs at rest below a rope; None if there is none."""
    body = body_of(rope)
    if body is None:
        return None
    return hung_body(scene, body, rope.state.nodes[POSITION : POSITION + 3, 0])


def water_at(scene: Scene, z: Floats) -> Floats:
    """Return the scene's current at these heights [m/s], (3, n)."""
    water = np.zeros((3, len(z)))
    for params in scene.effects:
        if isinstance(params, CurrentParams):
            rows = params.table[::-1]
            for k in range(3):
                water[k] += np.interp(z, rows[:, 0], rows[:, 1 + k])
    return water


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

    @property
    def directions(self) -> tuple[Floats, Floats]:
        """Return unit vectors (3, n) and lengths [m] of the elements."""
        span = np.diff(self.place, axis=1)
        length = np.sqrt((span * span).sum(axis=0))
        return span / length, length


@dataclass(frozen=True)
class StillSystem:
    """Ropes at rest, and how their nodes follow the unknowns: joints, free nodes, flows."""

    scene: Scene
    lines: tuple[StillLine, ...]
    follow: Any  # sparse, (3·nodes of all ropes, unknowns)
    joint_mass: Floats  # what sheaves weigh themselves and wheels turn with, of each unknown [kg]
    tied: Any  # sparse stiffness of bars, tethers and slings [N/m], (unknowns, unknowns)
    system: System  # in equilibrium
    body: HungBody | None = None  # its six unknowns are the last ones
    body_mass: Any = None  # sparse mass of it, (unknowns, unknowns)


def bring_system_to_rest(scene: Scene) -> StillSystem:
    """Return the static equilibrium of the scene's ropes in their current.

    Raises:
        SceneError: they cannot rest, are slack somewhere, or a rigid body does not hang clear.
    """
    built = build_joined(scene)
    system = built.system
    held = np.zeros((len(scene.ropes), MOTIONS))
    held[:, :LINE] = np.nan_to_num(built.hang_off_m)
    held[:, LINE] = [line.length_m for line in scene.ropes]
    if not solve_reeved_statics(system, held).found:
        right = "check what holds the ropes"
        raise SceneError(phrase(f"{scene.path}: ropes", "no static equilibrium", right))
    found = [_body_of(scene, rope) for rope in system.ropes]
    weigh(system._replace(ropes=tuple(without_body(rope) for rope in system.ropes)), held)
    lines = tuple(
        _line(scene, number, rope, held[number, LINE]) for number, rope in enumerate(system.ropes)
    )
    still = StillSystem(scene, lines, *_unknowns(system, lines), system)
    for r, body in enumerate(found):
        if body is not None:
            return _with_body(still, r, body)
    return still


def _with_body(still: StillSystem, r: int, body: HungBody) -> StillSystem:
    """Return the system with six more unknowns for the body below rope r."""
    from scipy.sparse import block_diag, coo_array, csr_array, hstack

    joints, count = still.system.joints, still.follow.shape[1]
    wheels = 0 if still.system.sheaves is None else still.system.sheaves.figures.shape[1]
    at, _ = _numbers(still.system, still.lines, joints.nodes.shape[1] - wheels)
    own = np.concatenate([3 * int(at[r][0]) + np.arange(3), count + np.arange(6)])
    row, column = np.meshgrid(own, own, indexing="ij")
    size = (count + 6, count + 6)
    K, M = (
        coo_array((values.ravel(), (row.ravel(), column.ravel())), shape=size).tocsr()
        for values in (body.stiffness, body.mass)
    )
    none = csr_array((6, 6))
    return replace(
        still,
        follow=hstack([still.follow, csr_array((still.follow.shape[0], 6))]).tocsr(),
        joint_mass=np.append(still.joint_mass, np.zeros(6)),
        tied=block_diag([still.tied, none]).tocsr() + K,
        body=body,
        body_mass=M,
    )


def _line(scene: Scene, number: int, rope: Rope, length_m: float) -> StillLine:
    """Return one rope as weighed in the equilibrium."""
    n = int(rope.state.counts[ELEMENTS])
    tension, name = rope.work[TENSION, :n].copy(), scene.ropes[number].name
    if not (tension > 0.0).all():
        slack = int((tension <= 0.0).sum())
        what = f"{slack} of {n} elements are slack at rest, so it has no natural frequency"
        right = "give it weight, tension or a payload"
        raise SceneError(phrase(f"{scene.path}: ropes[{number}]", what, right))
    still = StillRope(rope, length_m)
    place: Floats = still.place.copy()
    s = np.append(np.cumsum(still.rest[::-1])[::-1], 0.0)
    mass = np.moveaxis(rope.work[BLOCK : BLOCK + 6, : n + 1][SYMMETRIC], 2, 0).copy()
    couplings = still.couplings() if still.reach > 1 else None
    stiffness = rope.work[STIFFNESS, :n].copy()
    return StillLine(name, place, s, tension, stiffness, mass, couplings)


def _numbers(system: System, lines: tuple[StillLine, ...], points: int) -> tuple[list[Any], int]:
    """Return each node's index among connections and free nodes, or LOOSE; and their number."""
    joints, at, count = system.joints, [], points
    for r, rope in enumerate(system.ropes):
        n = lines[r].place.shape[1] - 1
        own = np.full(n + 1, LOOSE)
        free = range(int(rope.model.first_free), n)
        own[free.start : n] = count + np.arange(len(free))
        count += len(free)
        if joints.lower[r] != LOOSE:
            own[0] = joints.lower[r]
        if joints.upper[r] != LOOSE:
            own[n] = joints.upper[r]
        at.append(own)
    return at, count


def _unknowns(system: System, lines: tuple[StillLine, ...]) -> tuple[Any, Floats, Any]:
    """Return `follow`, `joint_mass` and `tied` of a system.

    Unknowns are three for each joint, three for each node that is no end and none that is held, and
    the flow over each sheave.
    """
    from scipy.sparse import coo_array

    joints, sheaves = system.joints, system.sheaves
    wheels = 0 if sheaves is None else sheaves.figures.shape[1]
    at, count = _numbers(system, lines, joints.nodes.shape[1] - wheels)
    of = np.concatenate(at)
    node = np.flatnonzero(of != LOOSE)
    axes = np.arange(3)
    rows = (3 * node[:, None] + axes).ravel()
    columns = (3 * of[node][:, None] + axes).ravel()
    values = np.ones(len(rows))
    mass = np.zeros(3 * count + wheels)
    if sheaves is not None:
        ends = np.cumsum([len(own) for own in at]) - 1
        for k in range(wheels):
            more = _over(sheaves, k, lines, ends)
            rows, values = np.append(rows, more[0]), np.append(values, more[1])
            columns = np.append(columns, np.full(len(more[0]), 3 * count + k))
            point = int(sheaves.figures[POINT, k])
            mass[3 * point : 3 * point + 3] += sheaves.figures[SHEAVE_MASS, k]
            mass[3 * count + k] += sheaves.figures[WHEEL, k]
    size = 3 * count + wheels
    follow = coo_array((values, (rows, columns)), shape=(3 * len(of), size)).tocsr()
    return follow, mass, _tied(joints.ties, joints.nodes[POSITION : POSITION + 3], size)


def _over(
    sheaves: Sheaves, k: int, lines: tuple[StillLine, ...], ends: Any
) -> tuple[Floats, Floats]:
    """Return rows and values by which the rope's last nodes follow the flow over sheave k.

    Rope that comes over goes down the one line and up the other, stretched as it is.
    """
    into, out = (int(sheaves.figures[row, k]) for row in (INTO, FROM))
    one, other = lines[into], lines[out]
    (t, t_length), (u, u_length) = one.directions, other.directions
    mean = 0.5 * (t_length[-1] / one.s[-2] + u_length[-1] / other.s[-2])
    rows = np.concatenate([3 * ends[into] + np.arange(3), 3 * ends[out] + np.arange(3)])
    return rows, np.concatenate([-mean * t[:, -1], mean * u[:, -1]])


def _tied(held: Floats, place: Floats, size: int) -> Any:
    """Return the axial and geometric stiffness of struts and tensioners."""
    from scipy.sparse import coo_array

    matrix = coo_array((size, size)).tocsr()
    for tie in held.T:
        first, second = int(tie[ties.FIRST]), int(tie[ties.SECOND])
        anchored = second == ties.ANCHORED
        end = tie[ties.AT : ties.AT + 3] if anchored else place[:, second]
        span = end - place[:, first]
        length = float(np.sqrt(span @ span))
        d = span / length
        pull = max(tie[ties.FORCE] + tie[ties.STIFFNESS] * (length - tie[ties.LENGTH]),
                   tie[ties.LEAST])  # fmt: skip
        along = tie[ties.STIFFNESS] if pull > tie[ties.LEAST] else 0.0
        block = (along - pull / length) * np.outer(d, d) + pull / length * np.eye(3)
        spots = [(first, first, 1.0)]
        if not anchored:
            spots += [(second, second, 1.0), (first, second, -1.0), (second, first, -1.0)]
        for i, j, sign in spots:
            row, column = np.meshgrid(3 * i + np.arange(3), 3 * j + np.arange(3), indexing="ij")
            entries = (sign * block).ravel(), (row.ravel(), column.ravel())
            matrix = matrix + coo_array(entries, shape=(size, size)).tocsr()
    return matrix

"""Friction of the seabed that sticks: elastic up to a slip distance, then Coulomb's.

The friction of `seabed` is a function of the sliding velocity and vanishes at rest, so that
whatever lies under tension creeps. Here each node remembers the displacement e of the soil that it
drags along, tangential to the bed. It grows with the node's own displacement until |e| reaches the
slip distance s, and from there on turns with it:

    e = e_trial·min(1, s/|e_trial|),    e_trial = e_before + (x - x_before),
    F = -(N/s)·(μ_a·e_a + μ_l·e_l)

with the normal force N of `seabed` and the components of e along and across the rope. So it rises
linearly to μ·N over s and never vanishes at rest (elastic, perfectly plastic, with a radial return:
Simo and Hughes 1998, ch. 1). A node that leaves the bed forgets e. e is solved in the stage, with
the position. In static equilibrium it is 0: friction acts against displacements from there.

The payload rubs with the coefficient across the rope; the corners of a rigid body do so by the law
of `seabed`, and creep at rest. Omitted in the block: the change of N, and
while a node slides the change of the force along e.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import sqrt
from typing import Any, NamedTuple

import numpy as np

from rope_twin.core.bed import Grid, Plane
from rope_twin.core.bed_shape import beds_at, grid_bed, plane_bed
from rope_twin.core.integrator import TRAPEZOID
from rope_twin.core.jit.decorators import jit_within
from rope_twin.core.jit.functions import anywhere
from rope_twin.core.jit.rows import row, rows, span
from rope_twin.core.jit.wide import choose
from rope_twin.core.loads.accounts import account
from rope_twin.core.loads.hooks import has_active_set, kernel
from rope_twin.core.loads.memory import declare_internal_variables, new_memory
from rope_twin.core.state import (
    BLOCK,
    DIVISOR_MIN,
    FRONTAL,
    POSITION,
    RESIDUAL,
    TANGENT,
    VELOCITY,
    Floats,
)
from rope_twin.errors import InputError
from rope_twin.quantity import quantity

CARRIED = 3  # e [m]
# Further rows: e and position before the stage, the stage's own position, and whether the node has
# them (1); a ghost node has not.
BEFORE, PLACE, REACHED = 3 * CARRIED + 1, 3 * CARRIED + 4, 3 * CARRIED + 7
KNOWN = REACHED + 3
OWN_ROWS = KNOWN - 3 * CARRIED


@dataclass(frozen=True, kw_only=True)
class BedFrictionParams:
    """Coefficients along and across the rope, and the slip distance."""

    axial: float | None = quantity(
        "friction coefficient along the rope; default: that of `seabed`", "", 0.0, 2.0, default=None
    )
    lateral: float | None = quantity(
        "friction coefficient across the rope; default: that of `seabed`", "", 0.0, 2.0,
        default=None,
    )  # fmt: skip
    slip_m: float = quantity(
        "displacement at which the friction is fully mobilised", "m", 1e-4, 5.0, default=0.02
    )


class PlaneFriction(NamedTuple):
    """Kernel data of friction on a plane seabed."""

    memory: Floats  # see CARRIED and the rows after it, (rows, nodes)
    bed: Plane
    k_payload: float  # stiffness below the payload [N/m]
    axial: float  # μ_a/s [1/m]
    lateral: float  # μ_l/s [1/m]
    slip: float  # s [m]


class GridFriction(NamedTuple):
    """Kernel data of friction on a seabed of soundings; fields as of PlaneFriction."""

    memory: Floats
    bed: Grid
    k_payload: float
    axial: float
    lateral: float
    slip: float


def build(
    params: BedFrictionParams, payload: Any, environment: Any
) -> PlaneFriction | GridFriction:
    """Return the kernel data without displacement, on the scene's seabed.

    Raises:
        InputError: the scene has no seabed.
    """
    if environment.bed is None:
        raise InputError("bed_friction", "the scene has no seabed", "add `- seabed: {}`")
    axial = environment.friction if params.axial is None else params.axial
    lateral = environment.friction if params.lateral is None else params.lateral
    kind = PlaneFriction if isinstance(environment.bed, Plane) else GridFriction
    return kind(
        new_memory(CARRIED, OWN_ROWS, environment.room), environment.bed,
        float(environment.bed.soil.k_payload),
        axial / params.slip_m, lateral / params.slip_m, float(params.slip_m),
    )  # fmt: skip


@jit_within
def _dragged(memory: Any, i: int, position: Any, normal: Any, slip: float) -> Any:
    """Return e tangential to the bed, |e_trial|, and s/|e_trial|, at most 1."""
    x, y, z = position
    nx, ny, nz = normal
    ex = memory[BEFORE, i] + x - memory[PLACE, i]
    ey = memory[BEFORE + 1, i] + y - memory[PLACE + 1, i]
    ez = memory[BEFORE + 2, i] + z - memory[PLACE + 2, i]
    normal_part = ex * nx + ey * ny + ez * nz
    ex, ey, ez = ex - normal_part * nx, ey - normal_part * ny, ez - normal_part * nz
    size = sqrt(ex * ex + ey * ey + ez * ez)
    ratio = min(1.0, slip / (size + DIVISOR_MIN))
    return (ratio * ex, ratio * ey, ratio * ez), size, ratio


@jit_within
def _normal(east: float, north: float) -> Any:
    nz = 1.0 / sqrt(1.0 + east * east + north * north)
    return -east * nz, -north * nz, nz


@jit_within
def _pushed(soil: Any, k: Any, above: Any, normal: Any, v: Any) -> Any:
    """Return the normal force of the seabed, as its own kernel has it [N]."""
    speed = v[0] * normal[0] + v[1] * normal[1] + v[2] * normal[2]
    return k * max(-above * normal[2], 0.0) * max(1.0 - soil.chi * speed, 0.0)


def _register(effect_type: type, bed_at: Any) -> None:
    """Register the kernels of a kind of seabed; bed_at(bed, x, y): height and slopes."""

    @kernel("start", effect_type)
    def start(friction: Any, rope: Any, upto: int) -> None:
        """Begin without displacement: static equilibrium has no friction."""
        for i in range(friction.memory.shape[1] - 1):
            for k in range(CARRIED):
                friction.memory[k, i] = 0.0
            friction.memory[KNOWN, i] = 0.0

    @kernel("predict", effect_type, wide=True)
    def predict(friction: Any, rope: Any, stage: Any, kind: int, low: int, high: int) -> None:
        """Set e and position before the stage; before time 0 there is no friction."""
        memory, nodes = friction.memory, rope.state.nodes
        acts = 1.0 if stage.time > 0.0 else 0.0
        for k in range(3):
            e = memory[k if kind == TRAPEZOID else CARRIED + k, low:]
            reached = memory[REACHED + k, low:]
            before, start = memory[BEFORE + k, low:], memory[PLACE + k, low:]
            for i in range(high - low):
                before[i] = e[i]
                start[i] = nodes[POSITION + k, low + i] if kind == TRAPEZOID else reached[i]
        active = memory[KNOWN, low:]
        for i in range(high - low):
            active[i] = acts

    @kernel("load_nodes", effect_type, wide=True)
    def load_nodes(friction: Any, work: Any, stage: Any, low: int, high: int) -> None:
        """Add the friction, and its block (N/s)·p·(μ_l·(I - nnᵀ - ττᵀ) + μ_a·ττᵀ) less slip."""
        memory, soil, frontal = friction.memory, friction.bed.soil, row(work, FRONTAL, low)
        x, y, z = rows(work, POSITION, low)
        vx, vy, vz = rows(work, VELOCITY, low)
        tx, ty, tz = rows(work, TANGENT, low)
        Rx, Ry, Rz = rows(work, RESIDUAL, low)
        Axx, Axy, Axz, Ayy, Ayz, Azz = span(work, BLOCK, 6, low)
        for i in range(high - low):
            acts = memory[KNOWN, low + i] > 0.0
            if not anywhere(acts):
                continue
            height, east, north = bed_at(friction.bed, x[i], y[i])
            n = _normal(east, north)
            k = soil.k * frontal[i] + (friction.k_payload if low + i == 0 else 0.0)
            N = _pushed(soil, k, z[i] - height, n, (vx[i], vy[i], vz[i]))
            N = choose(acts, N, 0.0)
            if not anywhere(N > 0.0):
                continue
            (ex, ey, ez), size, ratio = _dragged(
                memory, low + i, (x[i], y[i], z[i]), n, friction.slip
            )
            normal_part = tx[i] * n[0] + ty[i] * n[1] + tz[i] * n[2]
            ax, ay, az = (
                tx[i] - normal_part * n[0],
                ty[i] - normal_part * n[1],
                tz[i] - normal_part * n[2],
            )
            inverse = 1.0 / sqrt(ax * ax + ay * ay + az * az + DIVISOR_MIN)
            ax, ay, az = ax * inverse, ay * inverse, az * inverse
            along = ex * ax + ey * ay + ez * az
            axial, lateral = N * (friction.axial - friction.lateral), N * friction.lateral
            Rx[i] -= lateral * ex + axial * along * ax
            Ry[i] -= lateral * ey + axial * along * ay
            Rz[i] -= lateral * ez + axial * along * az
            # stuck: the whole stiffness; sliding: that across e alone, shrunk with the return
            q, w = stage.p * ratio * lateral, stage.p * ratio * axial
            sliding = choose(ratio < 1.0, q / (size * size), 0.0)
            w = choose(ratio == 1.0, w, 0.0)
            fx, fy, fz = ex / ratio, ey / ratio, ez / ratio
            Axx[i] += q * (1.0 - n[0] * n[0]) - sliding * fx * fx + w * ax * ax
            Axy[i] += -q * n[0] * n[1] - sliding * fx * fy + w * ax * ay
            Axz[i] += -q * n[0] * n[2] - sliding * fx * fz + w * ax * az
            Ayy[i] += q * (1.0 - n[1] * n[1]) - sliding * fy * fy + w * ay * ay
            Ayz[i] += -q * n[1] * n[2] - sliding * fy * fz + w * ay * az
            Azz[i] += q * (1.0 - n[2] * n[2]) - sliding * fz * fz + w * az * az

    @kernel("settle", effect_type, wide=True)
    def settle(friction: Any, rope: Any, stage: Any, kind: int, upto: int) -> None:
        """Store e and position of the stage; e is 0 where nothing touches."""
        memory, work, soil = friction.memory, rope.work, friction.bed.soil
        x, y, z = rows(work, POSITION, 0)
        vx, vy, vz = rows(work, VELOCITY, 0)
        frontal = row(work, FRONTAL, 0)
        for i in range(upto):
            height, east, north = bed_at(friction.bed, x[i], y[i])
            n = _normal(east, north)
            k = soil.k * frontal[i] + (friction.k_payload if i == 0 else 0.0)
            N = _pushed(soil, k, z[i] - height, n, (vx[i], vy[i], vz[i]))
            (ex, ey, ez), _, _ = _dragged(memory, i, (x[i], y[i], z[i]), n, friction.slip)
            acts = choose(N > 0.0, memory[KNOWN, i], 0.0)
            memory[CARRIED, i], memory[CARRIED + 1, i] = acts * ex, acts * ey
            memory[CARRIED + 2, i] = acts * ez
            memory[REACHED, i], memory[REACHED + 1, i], memory[REACHED + 2, i] = x[i], y[i], z[i]

    account("power", effect_type)(power)
    declare_internal_variables(effect_type, CARRIED)
    has_active_set(effect_type)


def power(rub: Any, place: Any) -> Any:
    """Return the power of the friction [W]; what the soil stores elastically is given back."""
    e = rub.memory[:CARRIED, : place.position.shape[1]]
    bed, v, t = rub.bed, place.velocity, place.tangent
    height, east, north = beds_at(bed, place.position[0].copy(), place.position[1].copy())
    nz = 1.0 / np.sqrt(1.0 + east * east + north * north)
    normal = np.stack([-east * nz, -north * nz, nz])
    k = bed.soil.k * place.touching
    k[0] += rub.k_payload
    sunk = np.maximum((height - place.position[2]) * nz, 0.0)
    N = k * sunk * np.maximum(1.0 - bed.soil.chi * (v * normal).sum(axis=0), 0.0)
    flat = t - (t * normal).sum(axis=0) * normal
    flat = flat / np.sqrt((flat * flat).sum(axis=0) + DIVISOR_MIN)
    along = (e * flat).sum(axis=0)
    force = rub.lateral * e + (rub.axial - rub.lateral) * along * flat
    return -N * (force * v).sum(axis=0)


_register(PlaneFriction, plane_bed)
_register(GridFriction, grid_bed)

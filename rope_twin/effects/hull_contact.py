"""Contact of rope and payload with the hull: boxes fixed to the ship, solid or with an opening.

A hull, a keel or a ramp is a box; a moonpool is an opening through one, and is modelled by its four
walls. The boxes move with the hang-off, and do not turn with the ship. Inside a box, with the
distances g_f to its six faces, the penetration and the direction out of it are (derived)

    d = (Σ 1/g_f²)^-½,    m = -∇d = Σ (d/g_f)³·n_f,

so that d is the distance to a face that is much nearer than all others, and edges and corners are
rounded: a contact that is carried over an edge never jumps from face to face. At the relative speed
v_n = v·m away from the hull the normal force is that of Hunt and Crossley (1975), with
N = k·d·(1 - χ·v_n), at least 0. It is continuous at first contact and at lift-off, dissipative in
between, and never pulls.

Along the rope k is a stiffness per metre, and the force is integrated over the part of each element
that is inside a box (four-point Gauss-Legendre), with the share t of a point between both nodes
going to the upper one. So an element that cuts across an edge between its nodes is held there.
The payload is a point with a radius, and a stiffness of its own.

Friction sticks: each element has the displacement e that the rope, where it is pressed, has made
along the hull since it came into contact, at most the slip distance s (elastic, perfectly plastic,
with a radial return: Simo and Hughes 1998, ch. 1), and the force -μ·N·e/s. e is solved in the
stage, with the position; it is 0 in static equilibrium, and is forgotten at lift-off; elements that
merge keep that of the lower one. Payout moves
the rope along the hull too.

Blocks: a point's stiffness goes to each node with the share of its force, which is no less than the
stiffness coupled between them (the difference is positive semidefinite), so that Newton's method
descends. Omitted: the curvature of d, the change of friction with N.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from math import sqrt
from typing import Any, NamedTuple

import numpy as np

from rope_twin.core.boxes import depth_inside, is_beyond, is_near, part_inside
from rope_twin.core.integrator import GAMMA, TRAPEZOID
from rope_twin.core.jit.decorators import jit, jit_entry, jit_within
from rope_twin.core.jit.functions import anywhere
from rope_twin.core.jit.rows import row, rows, span
from rope_twin.core.jit.wide import ALL, bits, choose, whole
from rope_twin.core.loads.accounts import account
from rope_twin.core.loads.hooks import has_active_set, kernel, wide_kernel
from rope_twin.core.loads.memory import declare_internal_variables, new_memory
from rope_twin.core.state import (
    BLOCK,
    CORRECTION,
    DIVISOR_MIN,
    ELEMENTS,
    LENGTH,
    POSITION,
    RESIDUAL,
    REST,
    VELOCITY,
    Floats,
)
from rope_twin.quantity import quantity, text

Triple = tuple[float, float, float]
CARRIED = 3  # e [m], of the element above a node
KNOWN = 3 * CARRIED  # last column: number of nodes with internal variables
# Further rows: e before the stage, position before it and in it, relative to the hang-off
BEFORE, PLACE, REACHED = KNOWN + 1, KNOWN + 4, KNOWN + 7
# of an element, to be read at once: force on its lower and upper node, blocks of both, the normal
# force N, N·t and N·m
LOW, UP, BLOCK_LOW, BLOCK_UP, NORMAL = KNOWN + 10, KNOWN + 13, KNOWN + 16, KNOWN + 22, KNOWN + 28
SHARE, OUT, FRICTION = NORMAL + 1, NORMAL + 2, NORMAL + 5  # FRICTION: whether it acts, last column
SHIP = FRICTION + 1  # last column: position and velocity of the hang-off
COUNT = SHIP + 6  # last column: number of elements
OWN_ROWS = COUNT - KNOWN
WALL_M = 5.0  # thickness of the walls of an opening
_AT, _WEIGHT = np.polynomial.legendre.leggauss(4)
AT = tuple(float(0.5 + 0.5 * x) for x in _AT)
WEIGHT = tuple(float(0.5 * w) for w in _WEIGHT)


@dataclass(frozen=True, kw_only=True)
class HullBox:
    """One box of the hull, or an opening through it."""

    centre_m: Triple = quantity(
        "centre from the hang-off: forward, to port, up", "m", -500.0, 500.0
    )
    size_m: Triple = quantity("length, width and height", "m", 0.1, 1000.0)
    opening: bool = text(
        "the box is a vertical opening (moonpool), whose walls hold what is inside it", False
    )


@dataclass(frozen=True, kw_only=True)
class HullContactParams:
    """Boxes that move with the hang-off, and the contact with them."""

    boxes: tuple[HullBox, ...] = text("boxes of the hull, at least one")
    heading_deg: float = quantity(
        "direction of the boxes' length, from east to north", "°", -360.0, 360.0, default=0.0
    )
    stiffness_n_per_m2: float = quantity(
        "force per metre of rope over its penetration", "N/m²", 1e2, 1e9, default=1e5
    )
    payload_stiffness_n_per_m: float = quantity(
        "force on the payload over its penetration", "N/m", 1e2, 1e10, default=1e6
    )
    payload_radius_m: float = quantity(
        "distance of the payload's centre from the hull at first contact", "m", 0.0, 50.0,
        default=0.0,
    )  # fmt: skip
    damping_s_per_m: float = quantity(
        "damping χ of N = k·d·(1 - χ·v)", "s/m", 0.0, 10.0, default=0.5
    )
    friction: float = quantity("friction coefficient μ", "", 0.0, 2.0, default=0.2)
    slip_m: float = quantity(
        "displacement at which the friction is fully mobilised", "m", 1e-4, 1.0, default=0.02
    )

    def check(self) -> str | None:
        """Return a fault of the boxes, or None."""
        if not self.boxes:
            return "boxes is empty; give one box at least"
        for number, (centre, half) in enumerate(map(_halved, self.boxes)):
            grown = half + self.payload_radius_m
            if self.boxes[number].opening:
                if min(half[0], half[1]) <= self.payload_radius_m:
                    return f"boxes[{number}] is an opening that the payload does not fit through"
                if (np.abs(centre[:2]) > half[:2]).any():  # the hang-off may be above, or in it
                    return f"boxes[{number}] is an opening beside the hang-off; move its centre_m"
            elif (np.abs(centre) < grown).all():
                return f"boxes[{number}] holds the hang-off; move its centre_m, or make it smaller"
        return None


class HullContact(NamedTuple):
    """Kernel data of contact with the hull."""

    memory: Floats  # see CARRIED and the rows after it, (rows, nodes + 1)
    boxes: Floats  # centre from the hang-off and half sizes along the hull [m], (boxes, 6)
    bounds: Floats  # lower and upper corner of all boxes [m], (6,)
    cosine: float  # of the heading
    sine: float
    k: float  # stiffness per metre of rope [N/m²]
    k_payload: float  # [N/m]
    radius: float  # of the payload [m]
    chi: float  # χ [s/m]
    rub: float  # μ/s [1/m]
    slip: float  # s [m]


def build(params: HullContactParams, payload: Any, environment: Any) -> HullContact:
    """Return the kernel data, without friction."""
    carries = payload is not None and payload.mass_kg > 0.0
    boxes = np.array([box for hull_box in params.boxes for box in _solids(hull_box)])
    grown = boxes[:, 3:] + (params.payload_radius_m if carries else 0.0)
    low, high = (boxes[:, :3] - grown).min(axis=0), (boxes[:, :3] + grown).max(axis=0)
    heading = math.radians(params.heading_deg)
    return HullContact(
        memory=new_memory(CARRIED, OWN_ROWS, environment.room),
        boxes=boxes,
        bounds=np.concatenate([low, high]),
        cosine=math.cos(heading),
        sine=math.sin(heading),
        k=float(params.stiffness_n_per_m2),
        k_payload=float(params.payload_stiffness_n_per_m) if carries else 0.0,
        radius=float(params.payload_radius_m),
        chi=float(params.damping_s_per_m),
        rub=float(params.friction / params.slip_m),
        slip=float(params.slip_m),
    )


def _halved(box: HullBox) -> tuple[Floats, Floats]:
    return np.array(box.centre_m, dtype=float), 0.5 * np.array(box.size_m, dtype=float)


def _solids(box: HullBox) -> list[Floats]:
    """Return the box, or the walls of an opening, as centre and half sizes."""
    centre, half = _halved(box)
    if not box.opening:
        return [np.concatenate([centre, half])]
    walls = []
    for axis in (0, 1):
        for side in (-1.0, 1.0):
            middle, size = centre.copy(), half + np.array([WALL_M, WALL_M, 0.0])
            middle[axis] += side * (half[axis] + 0.5 * WALL_M)
            size[axis] = 0.5 * WALL_M
            walls.append(np.concatenate([middle, size]))
    return walls


@jit_within
def _in_hull(hull: Any, x: Any, y: Any, z: Any) -> Any:
    """Return a position relative to the hang-off, along the hull's axes."""
    memory, last = hull.memory, hull.memory.shape[1] - 1
    x, y, z = x - memory[SHIP, last], y - memory[SHIP + 1, last], z - memory[SHIP + 2, last]
    return hull.cosine * x + hull.sine * y, hull.cosine * y - hull.sine * x, z


@jit_within
def _is_level(hull: Any, z: Any, other: Any) -> Any:
    """Return whether an element between two heights reaches into those of the boxes."""
    ship = hull.memory[SHIP + 2, hull.memory.shape[1] - 1]
    return (min(z, other) < ship + hull.bounds[5]) & (max(z, other) > ship + hull.bounds[2])


@jit
def _press_point(
    hull: Any, column: Any, t: float, position: Any, v: Any, k: Any, weights: Any
) -> None:
    """Add the normal force on a point at the fraction t of an element to its rows.

    column: of `memory`, and the box; position: along the hull's axes; v: velocity relative to
    it; k: stiffness [N/m], and the radius of the point [m].
    """
    (i, j), (stiffness, radius), (p, q) = column, k, weights
    memory, boxes = hull.memory, hull.boxes
    d, X, Y, mz = depth_inside(
        position[0] - boxes[j, 0], position[1] - boxes[j, 1], position[2] - boxes[j, 2],
        boxes[j, 3] + radius, boxes[j, 4] + radius, boxes[j, 5] + radius,
    )  # fmt: skip
    mx, my = hull.cosine * X - hull.sine * Y, hull.sine * X + hull.cosine * Y
    gain = max(1.0 - hull.chi * (v[0] * mx + v[1] * my + v[2] * mz), 0.0)
    N = stiffness * d * gain
    pressed = N > 0.0
    if not anywhere(pressed):
        return
    along = choose(pressed, p * stiffness * gain + q * hull.chi * stiffness * d, 0.0)
    low = 1.0 - t
    memory[NORMAL, i] += N
    memory[SHARE, i] += N * t
    for r, m in enumerate((mx, my, mz)):
        memory[OUT + r, i] += N * m
        memory[LOW + r, i] += low * N * m
        memory[UP + r, i] += t * N * m
    for r, mm in enumerate((mx * mx, mx * my, mx * mz, my * my, my * mz, mz * mz)):
        memory[BLOCK_LOW + r, i] += low * along * mm
        memory[BLOCK_UP + r, i] += t * along * mm


@jit
def _press(hull: Any, i: int, ends: Any, rates: Any, length: Any, weights: Any) -> Any:
    """Set the rows of element i without friction; return whether it is pressed.

    ends, rates: positions and velocities of its nodes; length: unstretched [m], or of a single node
    (both ends alike) that of the rope lumped there.
    """
    memory, boxes, last = hull.memory, hull.boxes, hull.memory.shape[1] - 1
    pressed = _is_level(hull, ends[0][2], ends[1][2])
    if not anywhere(pressed):
        return pressed
    a, b = _in_hull(hull, *ends[0]), _in_hull(hull, *ends[1])
    pressed = pressed & is_near(hull.bounds, a, b)
    if not anywhere(pressed):
        return pressed
    for r in range(LOW, FRICTION):
        memory[r, i] = 0.0
    (ux, uy, uz), (wx, wy, wz) = rates
    sx, sy, sz = memory[SHIP + 3, last], memory[SHIP + 4, last], memory[SHIP + 5, last]
    ux, uy, uz, wx, wy, wz = ux - sx, uy - sy, uz - sz, wx - sx, wy - sy, wz - sz
    for j in range(boxes.shape[0]):
        start, end = part_inside(boxes, j, a, b)
        cuts = pressed & (end - start > 0.0)
        if anywhere(cuts):
            start, inside = choose(cuts, start, 0.0), choose(cuts, end - start, 0.0)
            for g in range(4):
                t = start + inside * AT[g]
                low = 1.0 - t
                position = (low * a[0] + t * b[0], low * a[1] + t * b[1], low * a[2] + t * b[2])
                v = (low * ux + t * wx, low * uy + t * wy, low * uz + t * wz)
                k = (hull.k * length * inside * WEIGHT[g], 0.0)
                _press_point(hull, (i, j), t, position, v, k, weights)
        if i == 0 and anywhere(hull.k_payload > 0.0):
            k = (choose(pressed, hull.k_payload, 0.0), hull.radius)
            _press_point(hull, (i, j), 0.0, a, (ux, uy, uz), k, weights)
    return memory[NORMAL, i] > 0.0


@jit_within
def _share_up(memory: Any, i: int) -> Any:
    """Return the share of its upper node in what presses on an element."""
    N = memory[NORMAL, i]
    return memory[SHARE, i] / choose(N > 0.0, N, 1.0)


@jit_within
def _dragged(hull: Any, i: int, ends: Any) -> Any:
    """Return e of a pressed element along the hull, |e_trial|, and s/|e_trial|, at most 1."""
    memory, last = hull.memory, hull.memory.shape[1] - 1
    (ax, ay, az), (bx, by, bz) = ends
    sx, sy, sz = memory[SHIP, last], memory[SHIP + 1, last], memory[SHIP + 2, last]
    t = _share_up(memory, i)
    low = 1.0 - t
    ex = memory[BEFORE, i] + low * (ax - sx - memory[PLACE, i])
    ey = memory[BEFORE + 1, i] + low * (ay - sy - memory[PLACE + 1, i])
    ez = memory[BEFORE + 2, i] + low * (az - sz - memory[PLACE + 2, i])
    ex += t * (bx - sx - memory[PLACE, i + 1])
    ey += t * (by - sy - memory[PLACE + 1, i + 1])
    ez += t * (bz - sz - memory[PLACE + 2, i + 1])
    nx, ny, nz = _normal(memory, i)
    out = ex * nx + ey * ny + ez * nz
    ex, ey, ez = ex - out * nx, ey - out * ny, ez - out * nz
    size = sqrt(ex * ex + ey * ey + ez * ez)
    ratio = min(1.0, hull.slip / (size + DIVISOR_MIN))
    return (ratio * ex, ratio * ey, ratio * ez), size, ratio


@jit_within
def _normal(memory: Any, i: int) -> Any:
    """Return the unit vector out of the hull of all that presses on an element; none: zeros."""
    x, y, z = memory[OUT, i], memory[OUT + 1, i], memory[OUT + 2, i]
    inverse = 1.0 / (sqrt(x * x + y * y + z * z) + DIVISOR_MIN)
    return x * inverse, y * inverse, z * inverse


@jit
def _rub(hull: Any, i: int, e: Any, size: Any, ratio: Any, p: float) -> None:
    """Add the friction of a pressed element with displacement e to its rows.

    The block is p·μ·N/s·(I - nnᵀ) while it sticks; while it slides that across e, shrunk with the
    return.
    """
    memory = hull.memory
    N = memory[NORMAL, i]
    t = _share_up(memory, i)
    nx, ny, nz = _normal(memory, i)
    q = p * ratio * hull.rub * N
    slide = choose(ratio < 1.0, q / (ratio * ratio * size * size), 0.0)
    ex, ey, ez = e
    blocks = (
        q * (1.0 - nx * nx) - slide * ex * ex, -q * nx * ny - slide * ex * ey,
        -q * nx * nz - slide * ex * ez, q * (1.0 - ny * ny) - slide * ey * ey,
        -q * ny * nz - slide * ey * ez, q * (1.0 - nz * nz) - slide * ez * ez,
    )  # fmt: skip
    for r in range(3):
        force = -hull.rub * N * e[r]
        memory[LOW + r, i] += (1.0 - t) * force
        memory[UP + r, i] += t * force
    for r in range(6):
        memory[BLOCK_LOW + r, i] += (1.0 - t) * blocks[r]
        memory[BLOCK_UP + r, i] += t * blocks[r]


@kernel("start", HullContact)
def start(hull: Any, rope: Any, upto: int) -> None:
    """Begin without displacement: static equilibrium has no friction."""
    for i in range(hull.memory.shape[1] - 1):
        for k in range(CARRIED):
            hull.memory[k, i] = 0.0


@kernel("predict", HullContact, wide=True)
def predict(hull: Any, rope: Any, stage: Any, kind: int, low: int, high: int) -> None:
    """Set the hang-off's motion, e and position before the stage; before time 0 no friction acts.

    Position is set of the node at `high` too; that of the rope at the hang-off before payout.
    """
    memory, work, nodes = hull.memory, rope.work, rope.state.nodes
    n, last = rope.state.counts[ELEMENTS], memory.shape[1] - 1
    for k in range(6):
        memory[SHIP + k, last] = work[POSITION + k, n]
    memory[COUNT, last] = 1.0 * n
    memory[FRICTION, last] = 1.0 if stage.time > 0.0 else 0.0
    for k in range(3):
        for i in range(low, high + 1):
            if kind == TRAPEZOID:
                memory[BEFORE + k, i] = memory[k, i]
                memory[PLACE + k, i] = nodes[POSITION + k, i] - nodes[POSITION + k, n]
            else:
                memory[BEFORE + k, i] = memory[CARRIED + k, i]
                memory[PLACE + k, i] = memory[REACHED + k, i]
    if high == n:
        paid = stage.V * stage.q * (2.0 if kind == TRAPEZOID else 2.0 * (1.0 - GAMMA) / GAMMA)
        x, y, z = (
            nodes[POSITION, n] - nodes[POSITION, n - 1],
            nodes[POSITION + 1, n] - nodes[POSITION + 1, n - 1],
            nodes[POSITION + 2, n] - nodes[POSITION + 2, n - 1],
        )
        inverse = paid / (sqrt(x * x + y * y + z * z) + DIVISOR_MIN)
        memory[PLACE, n] = x * inverse
        memory[PLACE + 1, n] = y * inverse
        memory[PLACE + 2, n] = z * inverse


@kernel("load_nodes", HullContact)
def load_nodes(hull: Any, work: Any, stage: Any, low: int, high: int) -> None:
    """Add the contact forces of the elements at these nodes; a node without elements is a point."""
    n = int(hull.memory[KNOWN, hull.memory.shape[1] - 1])
    _load(hull, work, stage, n, low, high)


@wide_kernel("load_nodes", HullContact)
def load_nodes_wide(hull: Any, work: Any, stage: Any, low: int, high: int) -> None:
    """Do the same in lanes, some of which may wait for the single-rope solver with other nodes."""
    n = whole(hull.memory[COUNT, hull.memory.shape[1] - 1])
    _load(hull, work, stage, n, low, high)


@jit
def _load(hull: Any, work: Any, stage: Any, n: int, low: int, high: int) -> None:
    """Add the contact forces at the nodes low <= i < high; n: number of elements."""
    memory = hull.memory
    acts = anywhere(memory[FRICTION, memory.shape[1] - 1] > 0.0)
    x, y, z = rows(work, POSITION, 0)
    vx, vy, vz = rows(work, VELOCITY, 0)
    Rx, Ry, Rz = rows(work, RESIDUAL, 0)
    Axx, Axy, Axz, Ayy, Ayz, Azz = span(work, BLOCK, 6, 0)
    rest, lump = row(work, REST, 0), row(work, LENGTH, 0)
    first = low if low >= n else max(low - 1, 0)
    for e in range(first, high):
        top = e + 1 if e < n else e
        ends = ((x[e], y[e], z[e]), (x[top], y[top], z[top]))
        rates = ((vx[e], vy[e], vz[e]), (vx[top], vy[top], vz[top]))
        length = rest[e] if e < n else lump[e]
        if not anywhere(_press(hull, e, ends, rates, length, (stage.p, stage.q))):
            continue
        if acts and e < n:
            drag, size, share = _dragged(hull, e, ends)
            _rub(hull, e, drag, size, share, stage.p)
        for upper in range(2):
            i = e + upper if e < n else e
            if i < low or i >= high:
                continue
            force, block = (UP, BLOCK_UP) if upper == 1 else (LOW, BLOCK_LOW)
            Rx[i] += memory[force, e]
            Ry[i] += memory[force + 1, e]
            Rz[i] += memory[force + 2, e]
            Axx[i] += memory[block, e]
            Axy[i] += memory[block + 1, e]
            Axz[i] += memory[block + 2, e]
            Ayy[i] += memory[block + 3, e]
            Ayz[i] += memory[block + 4, e]
            Azz[i] += memory[block + 5, e]


@kernel("settle", HullContact, wide=True)
def settle(hull: Any, rope: Any, stage: Any, kind: int, upto: int) -> None:
    """Store e and position of the stage; e is 0 where nothing touches."""
    memory, work, last = hull.memory, rope.work, hull.memory.shape[1] - 1
    x, y, z = rows(work, POSITION, 0)
    vx, vy, vz = rows(work, VELOCITY, 0)
    rest, acts = row(work, REST, 0), memory[FRICTION, last]
    for i in range(upto):
        ends = ((x[i], y[i], z[i]), (x[i + 1], y[i + 1], z[i + 1]))
        rates = ((vx[i], vy[i], vz[i]), (vx[i + 1], vy[i + 1], vz[i + 1]))
        for k in range(CARRIED):
            memory[CARRIED + k, i] = 0.0
        pressed = _press(hull, i, ends, rates, rest[i], (stage.p, stage.q))
        if anywhere(pressed):
            drag, _, _ = _dragged(hull, i, ends)
            for k in range(CARRIED):
                memory[CARRIED + k, i] = choose(pressed, acts * drag[k], 0.0)
    for i in range(upto + 1):
        memory[REACHED, i] = x[i] - memory[SHIP, last]
        memory[REACHED + 1, i] = y[i] - memory[SHIP + 1, last]
        memory[REACHED + 2, i] = z[i] - memory[SHIP + 2, last]


@jit_within
def _meets(hull: Any, a: Any, b: Any, radius: Any) -> Any:
    """Return whether the element from a to b, or a point a of this radius, is inside a box."""
    candidates = _is_level(hull, a[2], b[2])
    if not anywhere(candidates):
        return candidates
    a, b = _in_hull(hull, *a), _in_hull(hull, *b)
    candidates = candidates & is_near(hull.bounds, a, b)
    if not anywhere(candidates):
        return candidates
    boxes, outside = hull.boxes, candidates
    for j in range(boxes.shape[0]):
        start, end = part_inside(boxes, j, a, b)
        outside = outside & (end < start)
        if anywhere(radius >= 0.0):
            outside = outside & ((radius < 0.0) | is_beyond(boxes, j, a, radius))
        if not anywhere(outside):
            return candidates
    return candidates ^ outside


@jit_within
def _places(work: Any, p: Any, n: int, e: int) -> Any:
    """Return the ends of element e, now and after moving by p·delta."""
    x, y, z = rows(work, POSITION, 0)
    dx, dy, dz = rows(work, CORRECTION, 0)
    last = p if e + 1 < n else 0.0 * p
    a, b = (x[e], y[e], z[e]), (x[e + 1], y[e + 1], z[e + 1])
    c = (a[0] + p * dx[e], a[1] + p * dy[e], a[2] + p * dz[e])
    d = (b[0] + last * dx[e + 1], b[1] + last * dy[e + 1], b[2] + last * dz[e + 1])
    return (a, b), (c, d)


@jit_within
def _radius(hull: Any, e: int) -> Any:
    """Return the radius of the point at the lower end of element e; -1: there is none."""
    return choose(hull.k_payload > 0.0, hull.radius, -1.0) if e == 0 else -1.0


@kernel("unchanged", HullContact)
def unchanged(hull: Any, work: Any, stage: Any, n: int, share: float) -> bool:
    """Return whether nothing touches the hull, now and after the correction."""
    for e in range(n):
        (a, b), (c, d) = _places(work, share * stage.p, n, e)
        radius = _radius(hull, e)
        if _meets(hull, a, b, radius) or _meets(hull, c, d, radius):
            return False
    return True


@wide_kernel("unchanged", HullContact)
def unchanged_wide(hull: Any, work: Any, stage: Any, n: int, share: Any) -> int:
    """Return the lanes in which nothing does, as bits."""
    lanes = 0
    for e in range(n):
        (a, b), (c, d) = _places(work, share * stage.p, n, e)
        radius = _radius(hull, e)
        lanes |= bits(_meets(hull, a, b, radius) | _meets(hull, c, d, radius))
    return ALL - lanes


@jit
def _force_on(hull: Any, i: int, ends: Any, rates: Any, length: Any) -> Any:
    """Set the rows of element i, with friction of its present e; return whether it is pressed."""
    pressed, memory = _press(hull, i, ends, rates, length, (1.0, 0.0)), hull.memory
    if anywhere(pressed):
        stuck = 1.0 + 0.0 * memory[NORMAL, i]
        _rub(hull, i, (memory[0, i], memory[1, i], memory[2, i]), stuck, stuck, 1.0)
    return pressed


@kernel("pull", HullContact, wide=True)
def pull(hull: Any, work: Any, n: int) -> Any:
    """Return the share of the hang-off in what presses on the element below it [N]."""
    x, y, z = rows(work, POSITION, 0)
    vx, vy, vz = rows(work, VELOCITY, 0)
    i = n - 1
    ends = ((x[i], y[i], z[i]), (x[n], y[n], z[n]))
    rates = ((vx[i], vy[i], vz[i]), (vx[n], vy[n], vz[n]))
    pressed, memory = _force_on(hull, i, ends, rates, row(work, REST, 0)[i]), hull.memory
    return (
        choose(pressed, memory[UP, i], 0.0),
        choose(pressed, memory[UP + 1, i], 0.0),
        choose(pressed, memory[UP + 2, i], 0.0),
    )


@jit_entry
def _find_forces(hull: Any, x: Any, v: Any, rest: Any, lump: Any, force: Any) -> None:
    """Set the contact force of every node, (3, nodes), and the normal force of every element."""
    last = hull.memory.shape[1] - 1
    n = x.shape[1] - 1 if hull.memory[KNOWN, last] > 0.0 else 0
    for e in range(n if n > 0 else x.shape[1]):
        top = e + 1 if n > 0 else e
        ends = ((x[0, e], x[1, e], x[2, e]), (x[0, top], x[1, top], x[2, top]))
        rates = ((v[0, e], v[1, e], v[2, e]), (v[0, top], v[1, top], v[2, top]))
        if _force_on(hull, e, ends, rates, rest[e] if n > 0 else lump[e]):
            for k in range(3):
                force[k, e] += hull.memory[LOW + k, e]
                force[k, top] += hull.memory[UP + k, e]
            force[3, e] = hull.memory[NORMAL, e]


def contact_forces(hull: HullContact, position: Floats, velocity: Floats, arc: Floats) -> Floats:
    """Return the forces of the hull on the nodes [N], (4, nodes): x, y, z, and N of each element.

    position, velocity: of the nodes, (3, nodes); arc: their unstretched coordinates [m], (nodes,).
    """
    contact = hull._replace(memory=hull.memory.copy())  # its scratch rows stay those of the step
    lump = 0.5 * (np.diff(arc, prepend=arc[0]) + np.diff(arc, append=arc[-1]))
    force = np.zeros((4, position.shape[1]))
    _find_forces(
        contact, position.copy(), velocity.copy(), np.diff(arc, append=arc[-1]), lump, force
    )
    return force


def power(hull: HullContact, place: Any) -> Any:
    """Return the power of the contact [W]; what hull and friction store elastically is given back.

    The ship's motion brings a part of it.
    """
    if place.position.shape[1] < 2:
        return np.zeros(place.position.shape[1])
    contact = hull._replace(memory=hull.memory.copy())
    force = np.zeros((4, place.position.shape[1]))
    rest = np.diff(place.arc, append=place.arc[-1])
    _find_forces(
        contact, place.position.copy(), place.velocity.copy(), rest, place.length.copy(), force
    )
    return (force[:3] * place.velocity).sum(axis=0)


account("power", HullContact)(power)
declare_internal_variables(HullContact, CARRIED)
has_active_set(HullContact)

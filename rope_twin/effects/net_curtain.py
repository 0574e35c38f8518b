"""Net along a stretch of the rope, or between two: panels that bend with the ropes' nodes.

Each node carries the panel of its part of the stretch, whose edges are the rope's tangent and a
direction across it, with the force of core/loads/panel (Aarsnes, Rudi, Løland 1990; Løland 1991).
The far edge is held towards a horizontal heading c (by spreaders, a second rope, a shore), so that
the normal is n = t × c/|t × c|; or without a heading it is free and trails with the flow, which
then is in the panel's plane: C_D = 0.04, no lift. The net follows the rope's motion; its resultant
acts on the rope, the moment about the rope is the spreaders'.

Between two ropes (`between`) c points to the place on the other rope that is as high in the net,
so that each rope carries half of the width with the normal of its own slope and of both ropes'
distance, in space. A rope in the middle of a row of ropes has a half on either side. c is that of
the step's middle, extrapolated from its start. The net transmits no tension from rope to rope:
that is the part of ropes across (headline, footrope, spreaders), which the scene has.

Twine of diameter d in square meshes with bars l has the length 2/l per area of the net, and from it
mass and displaced volume. Twines move water only across themselves. Half of them lies along each of
two directions at right angles in the panel's plane, which sums to the added mass ½·ρ·V·(I + n·nᵀ)
(derived; Ca = 1 of a circular cylinder), whatever these directions are; the mean over all normals
around the rope, ½·ρ·V·(3/2·I - 1/2·t·tᵀ), is that of a free net. The acceleration a of waves adds
ρ·V·a and the added mass times a (Morison et al. 1950).

A node's share of net follows from its place on the rope's material, which it remembers; so the net
stays where it is when the winch runs, and with its part of a rope that is cut. Omitted in the
block: the changes of the normal and of the water. All of the net is taken to be in the water.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import cos, pi, radians, sin, sqrt
from typing import Any, NamedTuple

import numpy as np

from rope_twin.core.jit.decorators import jit, jit_exact, jit_exact_within, jit_within
from rope_twin.core.jit.functions import anywhere, by_width, fused
from rope_twin.core.jit.rows import column, row, rows
from rope_twin.core.jit.wide import ALL, bits, choose, whole
from rope_twin.core.joined.stack import facing_of
from rope_twin.core.loads.accounts import account
from rope_twin.core.loads.balance import add_to_node
from rope_twin.core.loads.hooks import Load, kernel, scales_with_ramp
from rope_twin.core.loads.memory import count_initialised, declare_internal_variables, new_memory
from rope_twin.core.loads.panel import (
    MAX_SOLIDITY,
    mesh_fault,
    meshed_solidity,
    panel_coefficients,
    panel_forces,
    panel_load,
    seen_by,
)
from rope_twin.core.payout import set_trials
from rope_twin.core.state import (
    ACCELERATION,
    DIVISOR_MIN,
    ELEMENTS,
    FLOW,
    FLOW_RATE,
    LENGTH,
    LINK2_MIN,
    POSITION,
    TANGENT,
    TANGENT2_MIN,
    VELOCITY,
    Floats,
)
from rope_twin.quantity import SparingRepr, quantity, text

CARRIED = 1  # material coordinate of the node in the rope as it was built [m]
PLACE, PLACE_NEXT = 0, CARRIED
SHARE = 3 * CARRIED + 1  # of the node's length that carries net
TOWARDS = SHARE + 1  # direction to a neighbour, three rows; those of the other neighbour follow
OWN_ROWS = TOWARDS + 5 - 3 * CARRIED
ALONE = -1.0  # in place of a neighbour's number


@dataclass(frozen=True, kw_only=True, repr=False)
class NetCurtainParams(SparingRepr):
    """Stretch of the rope, size and meshes of the net, and the heading of its far edge."""

    _later = frozenset(("between",))

    to_m: float = quantity("upper end of the net, from the rope's lower end", "m", 0.1, 1.5e4)
    from_m: float = quantity(
        "lower end of the net, from the rope's lower end", "m", 0.0, 1.5e4, default=0.0
    )
    width_m: float = quantity("width of the net across the rope, both sides", "m", 0.01, 500.0)
    twine_m: float = quantity("diameter of the twine", "m", 1e-4, 0.05)
    bar_m: float = quantity("half-mesh (bar) length, knot to knot", "m", 1e-3, 2.0)
    solidity: float | None = quantity(
        "solidity ratio: twine area over panel area; default: from twine_m and bar_m", "", 0.005,
        MAX_SOLIDITY, default=None,
    )  # fmt: skip
    twine_kg_per_m3: float = quantity(
        "density of the twine: polyamide 1140, polyethylene 950, polyester 1380", "kg/m³", 500.0,
        8000.0, default=1140.0,
    )  # fmt: skip
    heading_deg: float | None = quantity(
        "direction from the rope to the far edge, 0 east, 90 north; default: trails with the flow",
        "°", -360.0, 360.0, default=None,
    )  # fmt: skip
    panels: int = quantity("number of nets in a row, each behind the other", "", 1, 20, default=1)
    law: str = text("force law: aarsnes or loeland", "loeland")
    rope: str = text("multi-line scenes: the only rope with this net; default: each", "")
    between: tuple[tuple[str, str], ...] = text(
        "multi-line scenes: pairs of ropes that have the net between them, instead of a heading", ()
    )

    def check(self) -> str | None:
        """Return a fault of the stretch, meshes, solidity or force law, or None."""
        if self.from_m >= self.to_m:
            return f"a net from {self.from_m:g} m up to {self.to_m:g} m; give from_m below to_m"
        if self.between and (self.heading_deg is not None or self.rope):
            return "between two ropes it has no heading_deg or rope of its own; remove these"
        return mesh_fault(self.law, self.known_solidity(), self.twine_m, self.bar_m)

    def known_solidity(self) -> float:
        """Return the solidity as given, or that of knotless square meshes."""
        if self.solidity is None:
            return meshed_solidity(self.twine_m, self.bar_m)
        return self.solidity

    def twine_m3_per_m(self) -> float:
        """Return the volume of twine per metre of rope [m²]."""
        per_area = 2.0 / self.bar_m * 0.25 * pi * self.twine_m**2
        return self.panels * self.width_m * per_area


class NetCurtain(NamedTuple):
    """Kernel data, per metre of rope."""

    memory: Floats  # see PLACE and SHARE, (rows, nodes)
    along: float  # ½·ρ·width times the constant term of C_D [kg/m²]
    facing: float  # ½·ρ·width times the cos α term of C_D [kg/m²]
    lift: float  # ρ·width times the sin 2α term of C_L [kg/m²]
    mass: float  # of twine [kg/m]
    weight: float  # of twine in water [N/m]
    displaced: float  # mass of displaced water [kg/m]
    pushed: float  # the same, for the inertia of waves [kg/m]
    even: float  # share of I in the added mass, of `displaced`
    odd: float  # likewise of n·nᵀ
    low: float  # coordinates of its ends in the rope as it was built [m]
    high: float
    cx: float  # horizontal direction to the far edge; 0 of a free one
    cy: float
    trails: float  # 1: a free edge, with the tangent in place of the normal; else 0
    near: float  # share of the width at its first far edge, and at the second
    far: float
    left: float  # number of the rope at its first far edge, and at the second; ALONE: none
    right: float


scales_with_ramp(NetCurtain, "along", "facing", "lift", "pushed")
declare_internal_variables(NetCurtain, CARRIED)


class _Part(NamedTuple):
    """Coefficients of one node's panel [kg/m], as `panel_load` takes them."""

    along: float
    facing: float
    lift: float


def build(params: NetCurtainParams, payload: Any, environment: Any) -> NetCurtain:
    """Return the kernel data for meshes and water; `panels` 0 is a rope without net."""
    density, solidity = environment.water_density_kg_per_m3, params.known_solidity()
    along, facing, lift = panel_coefficients(params.law, solidity)
    scale = 0.5 * density * params.width_m * seen_by(params.panels, params.law, solidity)
    volume = params.twine_m3_per_m()
    mass, displaced = params.twine_kg_per_m3 * volume, float(density * volume)
    spanned, angle = bool(params.between), radians(params.heading_deg or 0.0)
    free = params.heading_deg is None and not spanned
    return NetCurtain(
        memory=new_memory(CARRIED, OWN_ROWS, environment.room),
        along=float(scale * along),
        facing=0.0 if free else float(scale * facing),
        lift=0.0 if free else float(2.0 * scale * lift),
        mass=float(mass),
        weight=float(environment.gravity_m_per_s2 * (mass - displaced)),
        displaced=displaced,
        pushed=displaced,
        even=0.75 if free else 0.5,
        odd=-0.25 if free else 0.5,
        low=float(params.from_m),
        high=float(params.to_m),
        cx=0.0 if free or spanned else cos(angle),
        cy=0.0 if free or spanned else sin(angle),
        trails=1.0 if free else 0.0,
        near=0.0 if spanned else 1.0,
        far=0.0,
        left=ALONE,
        right=ALONE,
    )


def facing(net: NetCurtain, neighbours: Sequence[int]) -> NetCurtain:
    """Return the kernel data of a rope with half a net towards each of these ropes, 2 at most."""
    left, right = (*map(float, neighbours), ALONE, ALONE)[:2]
    return net._replace(
        near=0.5 * (left != ALONE), far=0.5 * (right != ALONE), left=left, right=right
    )


@jit_within
def _covered(low: Any, high: Any, below: Any, above: Any) -> Any:
    """Return the share of a length of rope from `below` to `above` that carries net."""
    overlap = max(min(high, above) - max(low, below), 0.0)
    return overlap / (above - below + DIVISOR_MIN)


@jit
def _set_shares(net: Any, state: Any, low: int, high: int) -> None:
    """Set the shares of the nodes low <= i < high: of the half elements on either side."""
    n, s, base = state.counts[ELEMENTS], state.s, net.memory[PLACE, 0]
    for i in range(low, high):
        below = base + 0.5 * (s[max(i - 1, 0)] + s[i])
        above = base + 0.5 * (s[i] + s[min(i + 1, n)])
        net.memory[SHARE, i] = _covered(net.low, net.high, below, above)


@jit_within
def _normal(net: Any, t: Any, c: Any) -> Any:
    """Return t × c/|t × c|, 0 where they are parallel; the tangent t of a free net."""
    x, y, z = t[1] * c[2] - t[2] * c[1], t[2] * c[0] - t[0] * c[2], t[0] * c[1] - t[1] * c[0]
    inverse = 1.0 / sqrt(x * x + y * y + z * z + TANGENT2_MIN)
    free = net.trails
    return x * inverse + free * t[0], y * inverse + free * t[1], z * inverse + free * t[2]


@jit_within
def _panel(net: Any, size: Any, vectors: Any, q: float) -> Any:
    """Return the load of `size` metres of net; vectors: t, c, relative velocity, accelerations."""
    t, c, w, (x, y, z), (wx, wy, wz) = vectors
    n = _normal(net, t, c)
    nx, ny, nz = n
    panel = _Part(size * net.along, size * net.facing, size * net.lift)
    load = panel_load(panel, w, n, q)
    added, wave = size * net.displaced, size * net.pushed
    odd = net.odd * added
    across = odd * (x * nx + y * ny + z * nz)
    across -= net.odd * wave * (wx * nx + wy * ny + wz * nz)
    isotropic, wave = size * net.mass + net.even * added, (1.0 + net.even) * wave
    return Load(
        load.x - isotropic * x + wave * wx - across * nx,
        load.y - isotropic * y + wave * wy - across * ny,
        load.z - isotropic * z + wave * wz - across * nz - size * net.weight,
        load.xx + isotropic + odd * nx * nx,
        load.xy + odd * nx * ny,
        load.xz + odd * nx * nz,
        load.yy + isotropic + odd * ny * ny,
        load.yz + odd * ny * nz,
        load.zz + isotropic + odd * nz * nz,
    )


@jit_within
def _motion(nodes: Any, j: int) -> Any:
    """Return position and velocity of a node."""
    return (*column(nodes, POSITION, j), *column(nodes, VELOCITY, j))


@jit_exact_within
def _opposite_one(nodes: Any, coordinates: Any, last: int, at: float, j: int) -> Any:
    while j < last - 1 and coordinates[j + 1] < at:
        j += 1
    fraction = (at - coordinates[j]) / (coordinates[j + 1] - coordinates[j])
    return j, fraction, _motion(nodes, j), _motion(nodes, j + 1)


@jit_within
def _chosen(which: Any, a: Any, b: Any) -> Any:
    """Return motion a in the lanes `which`, else b."""
    return (
        choose(which, a[0], b[0]), choose(which, a[1], b[1]), choose(which, a[2], b[2]),
        choose(which, a[3], b[3]), choose(which, a[4], b[4]), choose(which, a[5], b[5]),
    )  # fmt: skip


@jit_exact_within
def _opposite_lanes(nodes: Any, coordinates: Any, last: int, at: Any, j: int) -> Any:
    while j < last - 1 and bits(coordinates[j + 1] < at) == ALL:
        j += 1
    low, high = coordinates[j], coordinates[j + 1]
    below, above = _motion(nodes, j), _motion(nodes, j + 1)
    k = j + 1
    while k < last and bits(coordinates[k] < at) != 0:
        beyond = coordinates[k] < at
        low, high = choose(beyond, coordinates[k], low), choose(beyond, coordinates[k + 1], high)
        below = _chosen(beyond, _motion(nodes, k), below)
        above = _chosen(beyond, _motion(nodes, k + 1), above)
        k += 1
    return j, (at - low) / (high - low), below, above


# The element at coordinate `at`, of those from j on (in lanes, the lowest of all lanes), the place
# in it from 0 to 1, and the motion of the nodes below and above.
_opposite = by_width(_opposite_one, _opposite_lanes)


@jit_exact_within
def _interpolated(fraction: Any, below: Any, above: Any) -> Any:
    """Return the value between two nodes."""
    return fused(1.0 - fraction, below, fraction * above)


@jit_exact
def _gather(net: Any, rope: Any, other: Any, row: int) -> None:
    """Set the directions from a rope's nodes to another rope in the rows from `row` on.

    other: its nodes, coordinates, number of elements, and internal variables. It says where a
    product and a sum are one (`fused`): in lanes LLVM would fuse others.
    """
    memory, nodes, s = net.memory, rope.state.nodes, rope.state.s
    other_nodes, coordinates, last, other_memory = other
    base = other_memory[PLACE, 0]
    n, half, j = rope.state.counts[ELEMENTS], 0.5 * rope.model.step, 0
    for i in range(n + 1):
        at = min(max(memory[PLACE, 0] + s[i] - base, 0.0), coordinates[last])
        j, fraction, below, above = _opposite(other_nodes, coordinates, last, at, j)
        square = LINK2_MIN
        for k in range(3):
            x = _interpolated(fraction, below[k], above[k]) - nodes[k, i]
            v = _interpolated(fraction, below[3 + k], above[3 + k]) - nodes[3 + k, i]
            toward = fused(half, v, x)
            memory[row + k, i] = toward
            square = fused(toward, toward, square)
        for k in range(3):
            memory[row + k, i] *= 1.0 / sqrt(square)
    for k in range(3):
        set_trials(memory, row + k, memory[row + k, n], rope)


@kernel("gather", NetCurtain, wide=True, exact=True)
def gather(net: Any, rope: Any, stack: Any, memories: Any) -> None:
    """Set the directions to the ropes at the net's far edges."""
    for side in range(2):
        p = whole(net.left if side == 0 else net.right)
        if p >= 0:
            _gather(net, rope, facing_of(stack, memories, p), TOWARDS + 3 * side)


@kernel("start", NetCurtain)
def start(net: Any, rope: Any, upto: int) -> None:
    """Note the nodes' places on the rope."""
    base = net.memory[PLACE, 0]
    for i in range(upto):
        net.memory[PLACE, i] = base + rope.state.s[i]


@kernel("predict", NetCurtain, wide=True)
def predict(net: Any, rope: Any, stage: Any, kind: int, low: int, high: int) -> None:
    """Set the nodes' shares of net, which the winch changes."""
    _set_shares(net, rope.state, low, high)


@kernel("load_nodes", NetCurtain, wide=True)
def load_nodes(net: Any, work: Any, stage: Any, low: int, high: int) -> None:
    """Add the forces of flow, weight and inertia; the block: q·dF/dw + m·I + added mass."""
    memory = net.memory
    share, length = memory[SHARE, low:], row(work, LENGTH, low)
    vx, vy, vz = rows(work, VELOCITY, low)
    ax, ay, az = rows(work, ACCELERATION, low)
    ux, uy, uz = rows(work, FLOW, low)
    wx, wy, wz = rows(work, FLOW_RATE, low)
    tx, ty, tz = rows(work, TANGENT, low)
    for i in range(high - low):
        for side in range(2):
            size = share[i] * length[i] * (net.near if side == 0 else net.far)
            if not anywhere(size > 0.0):
                continue
            at = TOWARDS + 3 * side
            dx, dy, dz = memory[at, low + i], memory[at + 1, low + i], memory[at + 2, low + i]
            vectors = (
                (tx[i], ty[i], tz[i]),
                (net.cx + dx, net.cy + dy, dz),
                (ux[i] - vx[i], uy[i] - vy[i], uz[i] - vz[i]),
                (ax[i], ay[i], az[i]),
                (wx[i], wy[i], wz[i]),
            )
            add_to_node(work, low + i, _panel(net, size, vectors, stage.q))


@kernel("settle", NetCurtain, wide=True)
def settle(net: Any, rope: Any, stage: Any, kind: int, upto: int) -> None:
    """Carry the places over; the ghost nodes take net where the hang-off is in the stretch."""
    memory, state = net.memory, rope.state
    n, base = state.counts[ELEMENTS], net.memory[PLACE, 0]
    for i in range(upto):
        memory[PLACE_NEXT, i] = base + state.s[i]
    _set_shares(net, state, upto, n + 1)
    top = base + state.s[n]
    set_trials(memory, SHARE, choose((net.low < top) & (top <= net.high), 1.0, 0.0), rope)


@account("kinetic", NetCurtain)
def kinetic(net: Any, place: Any) -> Any:
    """Return the kinetic energy of the twine, ½·m·v² [J]; added mass is in `power`."""
    v = place.velocity
    return 0.5 * net.mass * _sizes(net, place) * (v * v).sum(axis=0)


@account("potential", NetCurtain)
def potential(net: Any, place: Any) -> Any:
    """Return the twine's weight in water times z [J]."""
    return net.weight * _sizes(net, place) * place.position[2]


@account("power", NetCurtain)
def power(net: Any, place: Any) -> Any:
    """Return the power of the flow's force and of the water's inertia [W]."""
    t, w, total = place.tangent, place.flow - place.velocity, 0.0
    count, still = t.shape[1], np.array([[net.cx], [net.cy], [0.0]])
    nodes = slice(-2, -1) if count == 1 else slice(count)
    for at, width in ((TOWARDS, net.near), (TOWARDS + 3, net.far)):
        n = np.cross(t, still + net.memory[at : at + 3, nodes], axis=0)
        n = n / np.sqrt((n * n).sum(axis=0) + TANGENT2_MIN) + net.trails * t
        force = panel_forces(net, w, n) + net.pushed * place.flow_rate
        for size, a in ((net.pushed, place.flow_rate), (-net.displaced, place.acceleration)):
            force = force + size * (net.even * a + net.odd * (a * n).sum(axis=0) * n)
        total = total + width * force
    return _lengths(net, place) * (total * place.velocity).sum(axis=0)


def _lengths(net: Any, place: Any) -> Floats:
    """Return the length of rope with net at each node [m]; a place alone is at the sheave.

    Before the first step the nodes do not know their shares yet.
    """
    count = place.position.shape[1]
    if count_initialised(net) > 0:
        shares = net.memory[SHARE, -2:-1] if count == 1 else net.memory[SHARE, :count]
        return np.asarray(shares * place.length)
    s = place.arc
    if count == 1:
        return np.asarray(((net.low < s) & (s <= net.high)) * place.length)
    edges = np.concatenate([s[:1], 0.5 * (s[1:] + s[:-1]), s[-1:]])
    shares = np.diff(np.clip(edges, net.low, net.high)) / np.diff(edges)
    return np.asarray(shares * place.length)


def _sizes(net: Any, place: Any) -> Floats:
    """Return the length of rope with a net of full width, at each node [m]."""
    return np.asarray((net.near + net.far) * _lengths(net, place))

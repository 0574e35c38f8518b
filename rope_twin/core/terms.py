"""Hooks: where effects join the step, composed at compile time.

An effect is a NamedTuple of its own arrays and numbers. Its file registers kernels with
`@kernel(hook, Type)`. The *types* in the scene's tuple of effects pick the code: the walk over the
tuple is written out while numba compiles, so an absent effect leaves no code and no branch behind.
Plain Python (NUMBA_DISABLE_JIT=1) walks the same tuple with a loop.

- `flow(effect, work, stage, low, high)` adds water velocity to the rows FLOW of the nodes
  low <= i < high, at the stage's predicted positions; one of them may set FLOW_RATE.
- `load(effect, node, stage)` returns a Load: what the effect adds to one node. All effects' loads
  are summed in one loop over the nodes, in registers: one pass over memory however many there are.
- `load_end(effect, work, stage)` adds to the residual and block of node 0, the lower end.
- `couple(effect, work, stage, n)` adds forces between a node and the next two on either side: to
  the residuals and blocks, and to the rows LINK what the blocks c·I between the nodes have. The
  step then takes an elimination that knows of them.
- `pull(effect, work, n)` returns what such an effect adds to the rope's pull on the hang-off.
- `start`, `predict`, `load_nodes` and `settle` are those of effects that remember
  (core/remembering.py).

A kernel whose arithmetic holds for wide numbers too (core/lanes) says so with `wide=True`; a kernel
that branches on what differs from rope to rope has a wide twin, `@wide_kernel(hook, Type)`. Where
one of its effects has neither, a scene's rope is stepped by itself.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from math import sqrt
from typing import Any, NamedTuple

from numba.core import types
from numba.extending import overload

from rope_twin.core.jit import LINKED, jit, jit_within
from rope_twin.core.rows import rows, span
from rope_twin.core.state import (
    ACCELERATION,
    BLOCK,
    COUPLED_ROWS,
    DIRECTION,
    FLOW,
    FLOW_RATE,
    LINK,
    MASS,
    POSITION,
    PULL,
    PULL_X,
    RESIDUAL,
    TANGENT,
    VELOCITY,
    WORK_ROWS,
)

HOOKS = (
    "flow", "load", "load_end", "couple", "pull", "start", "predict", "load_nodes", "settle",
)  # fmt: skip
_KERNELS: dict[str, dict[type, Any]] = {hook: {} for hook in HOOKS}
_SWITCHING: set[type] = set()
_WIDE: dict[str, dict[type, Any]] = {hook: {} for hook in HOOKS}


class Node(NamedTuple):
    """A node as a load sees it."""

    x: float  # position [m]
    y: float
    z: float
    vx: float  # velocity [m/s]
    vy: float
    vz: float
    ax: float  # acceleration [m/s²]
    ay: float
    az: float
    tx: float  # unit tangent of the rope, upward
    ty: float
    tz: float
    ux: float  # water velocity [m/s]
    uy: float
    uz: float
    wx: float  # acceleration of the water [m/s²], where an effect sets it
    wy: float
    wz: float
    mass: float  # of the rope [kg]
    volume: float  # of displaced water [m³]
    frontal: float  # area that drag across the rope refers to [m²]
    skin: float  # area that drag along it refers to [m²]


class Load(NamedTuple):
    """What acts on a node: force less inertia, and minus its derivative to the acceleration.

    The derivative is q·d/dv + p·d/dx + d/da, as a symmetric block.
    """

    x: float  # [N]
    y: float
    z: float
    xx: float  # [kg]
    xy: float
    xz: float
    yy: float
    yz: float
    zz: float


def kernel(hook: str, effect: type, *, wide: bool = False) -> Callable[[Any], Any]:
    """Register a kernel of an effect's type for a hook; `wide`: it works on wide numbers too.

    Raises:
        ValueError: unknown hook, or a second kernel of this type for it.
    """
    if hook not in _KERNELS:
        raise ValueError(f"unknown hook '{hook}'; known: {', '.join(HOOKS)}")
    if effect in _KERNELS[hook]:
        raise ValueError(f"{effect.__name__} has a kernel for '{hook}' already")

    def register(function: Any) -> Any:
        compiled = jit_within(function) if hook == "load" else jit(function)
        _KERNELS[hook][effect] = compiled
        if wide:
            _WIDE[hook][effect] = compiled
        return compiled

    return register


def switching(effect: type) -> None:
    """Say that an effect's loads come and go: tensions alone do not tell convergence."""
    _SWITCHING.add(effect)


def switches(kinds: Iterable[type]) -> bool:
    """Whether one of these types of effects has loads that come and go."""
    return any(kind in _SWITCHING for kind in kinds)


def wide_kernel(hook: str, effect: type) -> Callable[[Any], Any]:
    """Register what takes the place of an effect's kernel where numbers are wide."""

    def register(function: Any) -> Any:
        _WIDE[hook][effect] = jit(function)
        return _WIDE[hook][effect]

    return register


def all_wide(kinds: Iterable[type]) -> bool:
    """Whether ropes with effects of these types can be stepped in lanes."""
    kinds = tuple(kinds)
    wide = all(kind in _WIDE[hook] for kind in kinds for hook in hooks_of(kind))
    return wide and not switches(kinds)


def hooks_of(effect: type) -> tuple[str, ...]:
    """The hooks that an effect's type takes part in."""
    return tuple(hook for hook in HOOKS if effect in _KERNELS[hook])


def couples(kinds: Iterable[type]) -> bool:
    """Whether one of these types of effects couples nodes beyond their neighbours."""
    return any(kind in _KERNELS["couple"] for kind in kinds)


def work_rows(effects: tuple[Any, ...]) -> int:
    """How many rows of scratch the step needs for these effects."""
    return COUPLED_ROWS if couples(map(type, effects)) else WORK_ROWS


def kernel_of(hook: str, effect: type) -> Any:
    """The kernel of an effect's type for a hook, which it has."""
    return _KERNELS[hook][effect]


def kernels_by_place(hook: str, effects: Any) -> dict[int, Any]:
    """The kernels of a hook by the effect's place in the tuple (of numba's types); "": none."""
    known = _KERNELS.get(hook, {})
    found = {i: known.get(effect.instance_class) for i, effect in enumerate(effects)}
    return {i: call for i, call in found.items() if call is not None}


def _kernels(hook: str, effects: Any, work: Any) -> dict[int, Any]:
    """The kernels of a hook by the effect's place in the tuple (of numba's types)."""
    known = (_KERNELS if isinstance(work, types.Array) else _WIDE)[hook]
    found = {i: known.get(effect.instance_class) for i, effect in enumerate(effects)}
    return {i: call for i, call in found.items() if call is not None}


def written_out(head: str, lines: list[str], calls: dict[int, Any], **names: Any) -> Any:
    """The function of these lines, in which kernel_0, kernel_1 ... are the calls.

    Written as text because numba compiles a recursive walk as one library per effect, each
    optimised again with all below it.
    """
    scope = {f"kernel_{i}": call for i, call in calls.items()} | names
    exec("\n    ".join([f"def written_out({head}):", *lines]), scope)
    return scope["written_out"]


def add_flow(effects: Any, work: Any, stage: Any, low: Any, high: Any) -> Any:
    """Add every effect's water velocity for the nodes low <= i < high."""
    for effect in effects:
        if type(effect) in _KERNELS["flow"]:
            _KERNELS["flow"][type(effect)](effect, work, stage, low, high)


@overload(add_flow, jit_options=LINKED, strict=False)
def _compose_flow(effects: Any, work: Any, stage: Any, low: Any, high: Any) -> Any:
    calls = _kernels("flow", effects, work)
    lines = [f"kernel_{i}(effects[{i}], work, stage, low, high)" for i in calls]
    return written_out("effects, work, stage, low, high", [*lines, "return None"], calls)


def add_end(effects: Any, work: Any, stage: Any) -> Any:
    """Add every effect's load at the lower end."""
    for effect in effects:
        if type(effect) in _KERNELS["load_end"]:
            _KERNELS["load_end"][type(effect)](effect, work, stage)


@overload(add_end, jit_options=LINKED, strict=False)
def _compose_end(effects: Any, work: Any, stage: Any) -> Any:
    calls = _kernels("load_end", effects, work)
    lines = [f"kernel_{i}(effects[{i}], work, stage)" for i in calls]
    return written_out("effects, work, stage", [*lines, "return None"], calls)


@jit
def _clear_links(work: Any, n: int) -> None:
    """No couplings yet, and nothing at the hang-off's node, which the loads leave out."""
    for i in range(n + 1):
        work[LINK, i] = work[LINK + 1, i] = 0.0
    for k in range(3):
        work[RESIDUAL + k, n] = 0.0
    for k in range(6):
        work[BLOCK + k, n] = 0.0


def add_couplings(effects: Any, work: Any, stage: Any, n: Any) -> Any:
    """Add every effect's forces between nodes that are not neighbours."""
    if couples(map(type, effects)):
        _clear_links(work, n)
    for effect in effects:
        if type(effect) in _KERNELS["couple"]:
            _KERNELS["couple"][type(effect)](effect, work, stage, n)


@overload(add_couplings, jit_options=LINKED, strict=False)
def _compose_couplings(effects: Any, work: Any, stage: Any, n: Any) -> Any:
    calls = _kernels("couple", effects, work)
    lines = [f"kernel_{i}(effects[{i}], work, stage, n)" for i in calls]
    lines = ["clear(work, n)", *lines] if calls else []
    return written_out(
        "effects, work, stage, n", [*lines, "return None"], calls, clear=_clear_links
    )


@jit
def _add_to_pull(force: Any, pull: Any, row: int) -> None:
    """A force on the hang-off joins the pull of step `row`."""
    square = 0.0
    for k in range(3):
        pull[row, PULL_X + k] += force[k]
        square += pull[row, PULL_X + k] ** 2
    pull[row, PULL] = sqrt(square)


def add_pull(effects: Any, work: Any, n: Any, pull: Any, row: Any) -> Any:
    """Add what effects that couple nodes bring to the rope's pull on the hang-off."""
    for effect in effects:
        if type(effect) in _KERNELS["pull"]:
            _add_to_pull(_KERNELS["pull"][type(effect)](effect, work, n), pull, row)


@overload(add_pull, jit_options=LINKED, strict=False)
def _compose_pull(effects: Any, work: Any, n: Any, pull: Any, row: Any) -> Any:
    calls = _kernels("pull", effects, work)
    lines = [f"add(kernel_{i}(effects[{i}], work, n), pull, row)" for i in calls]
    lines.append("return None")
    return written_out("effects, work, n, pull, row", lines, calls, add=_add_to_pull)


def _sum_loads(effects: Any, node: Any, stage: Any) -> Any:
    """The rope's inertia and the loads of all effects on one node."""
    total = _inertia(node)
    for effect in effects:
        if type(effect) in _KERNELS["load"]:
            total = _sum(total, _KERNELS["load"][type(effect)](effect, node, stage))
    return total


@overload(_sum_loads, jit_options={**LINKED, "forceinline": True}, strict=False)
def _compose_load(effects: Any, node: Any, stage: Any) -> Any:
    found = {i: _KERNELS["load"].get(effect.instance_class) for i, effect in enumerate(effects)}
    calls = {i: call for i, call in found.items() if call is not None}
    lines = [f"total = add(total, kernel_{i}(effects[{i}], node, stage))" for i in calls]
    lines = ["total = inertia(node)", *lines, "return total"]
    return written_out("effects, node, stage", lines, calls, inertia=_inertia, add=_sum)


@jit_within
def _inertia(node: Any) -> Any:
    m = node.mass
    return Load(-m * node.ax, -m * node.ay, -m * node.az, m, 0.0, 0.0, m, 0.0, m)


@jit_within
def _sum(a: Any, b: Any) -> Any:
    return Load(
        a.x + b.x, a.y + b.y, a.z + b.z, a.xx + b.xx, a.xy + b.xy, a.xz + b.xz, a.yy + b.yy,
        a.yz + b.yz, a.zz + b.zz,
    )  # fmt: skip


@jit_within
def seen(work: Any, low: int) -> Any:
    """What loads see of the nodes from `low` on, but for the tangent: rows."""
    x, y, z = rows(work, POSITION, low)
    vx, vy, vz = rows(work, VELOCITY, low)
    ax, ay, az = rows(work, ACCELERATION, low)
    ux, uy, uz = rows(work, FLOW, low)
    wx, wy, wz = rows(work, FLOW_RATE, low)
    mass, volume, frontal, skin = span(work, MASS, 4, low)
    return (
        x, y, z, vx, vy, vz, ax, ay, az, ux, uy, uz, wx, wy, wz, mass, volume, frontal, skin
    )  # fmt: skip


@jit_within
def load_of(effects: Any, stage: Any, nodes: Any, tangent: Any, i: int) -> Any:
    """Inertia and the loads of all effects on node i of what is `seen`."""
    x, y, z, vx, vy, vz, ax, ay, az, ux, uy, uz, wx, wy, wz, mass, volume, frontal, skin = nodes
    tx, ty, tz = tangent
    node = Node(
        x[i], y[i], z[i], vx[i], vy[i], vz[i], ax[i], ay[i], az[i], tx, ty, tz,
        ux[i], uy[i], uz[i], wx[i], wy[i], wz[i], mass[i], volume[i], frontal[i], skin[i],
    )  # fmt: skip
    return _sum_loads(effects, node, stage)


@jit
def _set_tangents(work: Any, low: int, high: int) -> None:
    """TANGENT of the nodes 1 <= low <= i < high: the mean direction of both elements."""
    tx, ty, tz = rows(work, DIRECTION, low)
    bx, by, bz = rows(work, DIRECTION, low - 1)
    mx, my, mz = rows(work, TANGENT, low)
    for i in range(high - low):
        x, y, z = bx[i] + tx[i], by[i] + ty[i], bz[i] + tz[i]
        inverse = 1.0 / sqrt(x * x + y * y + z * z + 1e-12)
        mx[i] = x * inverse
        my[i] = y * inverse
        mz[i] = z * inverse


def load_remembering(
    effects: Any, work: Any, stage: Any, low: Any, high: Any, tangents: Any
) -> Any:
    """Add the loads of the effects that remember; `tangents`: they are to be found first."""
    calls = [(own, _KERNELS["load_nodes"].get(type(own))) for own in effects]
    if tangents and any(call for _, call in calls):
        _set_tangents(work, low, high)
    for effect, call in calls:
        if call is not None:
            call(effect, work, stage, low, high)


@overload(load_remembering, jit_options=LINKED, strict=False)
def _compose_remembering(
    effects: Any, work: Any, stage: Any, low: Any, high: Any, tangents: Any
) -> Any:
    calls = _kernels("load_nodes", effects, work)
    lines = [f"kernel_{i}(effects[{i}], work, stage, low, high)" for i in calls]
    lines = ["if tangents: set_tangents(work, low, high)", *lines] if calls else []
    head = "effects, work, stage, low, high, tangents"
    return written_out(head, [*lines, "return None"], calls, set_tangents=_set_tangents)


@jit
def add_load(effects: Any, work: Any, stage: Any, low: int, high: int) -> None:
    """Residual += loads and inertia, block = their derivative, for the nodes low <= i < high.

    For nodes whose TANGENT is given; `assembly.load_nodes` finds it from the elements.
    """
    nodes = seen(work, low)
    tx, ty, tz = rows(work, TANGENT, low)
    Rx, Ry, Rz = rows(work, RESIDUAL, low)
    Axx, Axy, Axz, Ayy, Ayz, Azz = span(work, BLOCK, 6, low)
    for i in range(high - low):
        load = load_of(effects, stage, nodes, (tx[i], ty[i], tz[i]), i)
        Rx[i] += load.x
        Ry[i] += load.y
        Rz[i] += load.z
        Axx[i] = load.xx
        Axy[i] = load.xy
        Axz[i] = load.xz
        Ayy[i] = load.yy
        Ayz[i] = load.yz
        Azz[i] = load.zz
    load_remembering(effects, work, stage, low, high, False)

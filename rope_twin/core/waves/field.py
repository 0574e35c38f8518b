"""Wave kinematics along a rope: evaluated at its nodes, or interpolated from a few of them.

Where the water moves alike at neighbouring nodes it is evaluated at four nodes of a stretch and
interpolated by a cubic. In any direction the fourth derivative of a component's velocity is at most
a·ω·k⁴·e^{kz} (except for the surface's slope in Wheeler's z). With thirds s the error of the cubic
is s⁴/24 of the sum of these at the stretch's highest position, s⁴/11 where a stretch has few nodes.
`sea` is any NamedTuple with the fields of `effects/waves.Waves`.
"""

from __future__ import annotations

import math
from typing import Any

from rope_twin.core.jit.decorators import jit, jit_within
from rope_twin.core.jit.rows import row, rows
from rope_twin.core.state import FLOW, FLOW_RATE, POSITION, SURFACE
from rope_twin.core.waves.rows import ASIDE, BASE, ECHO, LEVEL, REACH, THIRD, figures, scratch
from rope_twin.core.waves.sums import refer, slopes, turn, water

FEWEST = 5  # nodes of a stretch: with fewer, each is evaluated individually
NOWHERE = 1e30  # m: no angles are stored yet


@jit
def _reaching(sea: Any, level: float) -> int:
    """Return the number of blocks of components that reach down to a level."""
    reach, count = figures(sea.table)[REACH], 0
    while count < sea.blocks and reach[count] <= level:
        count += 1
    return count


@jit
def _echoing(sea: Any, level: float) -> int:
    """Return the number of those blocks with a significant reflection at the bottom."""
    echo, count = figures(sea.table)[ECHO], 0
    while count < sea.blocks and echo[count] > level:
        count += 1
    return count


@jit
def _level(sea: Any, z: float, eta: float) -> float:
    """Return the stretched z, at most 0."""
    eta *= sea.follows
    return float(max(min((z - eta) / (1.0 + eta / sea.depth), 0.0), -sea.depth))


@jit
def _find(sea: Any, share: Any, kept: Any, place: Any, time: float) -> Any:
    """Return surface, velocity and acceleration at a position; share: build-up factor, rate."""
    x, y, z = place
    part, rate = share
    base = kept[BASE]
    dx, dy = x - base[0], y - base[1]
    away = math.sqrt(dx * dx + dy * dy)
    highest = _level(sea, z, part * (base[2] - sea.steepest * away))
    if away <= figures(sea.table)[ASIDE][_reaching(sea, highest)]:
        full = turn(sea, kept, dx, dy)
    else:
        full = refer(sea, kept, x, y, time)
        base[0], base[1], base[2] = x, y, full
    eta = part * full
    level = _level(sea, z, eta)
    echoing, reaching = _echoing(sea, level), _reaching(sea, level)
    u, v, w, du, dv, dw = water(sea, kept, echoing, reaching, level)
    beyond = sea.extends * min(z, eta)
    if beyond > 0.0:
        su, sv, sw, sdu, sdv, sdw = slopes(sea, kept, echoing)
        u, v, w = u + beyond * su, v + beyond * sv, w + beyond * sw
        du, dv, dw = du + beyond * sdu, dv + beyond * sdv, dw + beyond * sdw
    return (
        eta, part * u, part * v, part * w,
        part * du + rate * u, part * dv + rate * v, part * dw + rate * w,
    )  # fmt: skip


@jit
def _stretch_end(sea: Any, nodes: Any, arc: Any, i: int, last: int, eta: float) -> int:
    """Return the last node of a stretch from node i; arc length of its nodes is in arc [m].

    eta: the surface elevation above node i; from there it falls by the steepest slope at most.
    """
    x, y, z = nodes
    level, third = figures(sea.table)[LEVEL], figures(sea.table)[THIRD]
    end, length, top, row_of = i, 0.0, -sea.depth, sea.levels - 1
    shrink = 1.0 / (1.0 + sea.follows * eta / sea.depth)
    for k in range(i + 1, last):
        dx, dy, dz = x[k] - x[k - 1], y[k] - y[k - 1], z[k] - z[k - 1]
        length += math.sqrt(dx * dx + dy * dy + dz * dz)
        dx, dy = x[k] - x[i], y[k] - y[i]
        lowest = sea.follows * (eta - sea.steepest * math.sqrt(dx * dx + dy * dy))
        top = max(top, min((z[k] - lowest) * shrink, 0.0))  # at least _level(sea, z[k], lowest)
        while row_of > 0 and level[row_of] < top:
            row_of -= 1
        if length > 3.0 * third[row_of] or z[k] < sea.lowest:
            break
        arc[k] = length
        end = k
    return end


@jit
def _thirds(arc: Any, i: int, end: int) -> Any:
    """Return the nodes nearest above a third and two thirds of a stretch."""
    a, b = i, i
    for k in range(i + 1, end):
        if a == i and 3.0 * arc[k] >= arc[end]:
            a = k
        elif a > i and b == i and 3.0 * arc[k] >= 2.0 * arc[end]:
            b = k
    return a, b


@jit
def _put(target: Any, i: int, values: Any) -> None:
    """Set surface elevation and water acceleration of a node; add the velocity."""
    u, v, w, du, dv, dw, surface_at = target
    surface_at[i] = values[0]
    u[i] += values[1]
    v[i] += values[2]
    w[i] += values[3]
    du[i] = values[4]
    dv[i] = values[5]
    dw[i] = values[6]


@jit_within
def _blend(weights: Any, four: Any, k: int) -> float:
    return float(
        weights[0] * four[0][k] + weights[1] * four[1][k]
        + weights[2] * four[2][k] + weights[3] * four[3][k]
    )  # fmt: skip


@jit
def _put_cubic(target: Any, span: Any, thirds: Any, four: Any) -> None:
    """Interpolate the nodes of a stretch after its first by Lagrange's cubic through four.

    The arc lengths of the nodes are passed in the surface's row.
    """
    u, v, w, du, dv, dw, surface_at = target
    i, end = span
    t1, t2, t3 = surface_at[thirds[0]], surface_at[thirds[1]], surface_at[end]
    f0, f1 = -1.0 / (t1 * t2 * t3), 1.0 / (t1 * (t1 - t2) * (t1 - t3))
    f2, f3 = 1.0 / (t2 * (t2 - t1) * (t2 - t3)), 1.0 / (t3 * (t3 - t1) * (t3 - t2))
    for k in range(i + 1, end + 1):
        at = surface_at[k]
        b, c, d = at - t1, at - t2, at - t3
        weights = f0 * b * c * d, f1 * at * c * d, f2 * at * b * d, f3 * at * b * c
        surface_at[k] = _blend(weights, four, 0)
        u[k] += _blend(weights, four, 1)
        v[k] += _blend(weights, four, 2)
        w[k] += _blend(weights, four, 3)
        du[k] = _blend(weights, four, 4)
        dv[k] = _blend(weights, four, 5)
        dw[k] = _blend(weights, four, 6)


@jit
def add_water(sea: Any, share: Any, work: Any, time: float, low: int, high: int) -> None:
    """Add wave velocity to FLOW, and set FLOW_RATE and SURFACE, of the nodes low <= i < high.

    They are 0 where no component reaches. share: build-up factor of the sea and its rate [1/s].
    """
    nodes = rows(work, POSITION, low)
    rates = rows(work, FLOW_RATE, low)
    surface_at = row(work, SURFACE, low)
    for i in range(high - low):
        rates[0][i] = 0.0
        rates[1][i] = 0.0
        rates[2][i] = 0.0
        surface_at[i] = 0.0
    if share[0] == 0.0:
        return
    kept = scratch()
    kept[BASE][0] = NOWHERE
    kept[BASE][1] = kept[BASE][2] = 0.0
    target = (*rows(work, FLOW, low), *rates, surface_at)
    i, last = low - low, high - low  # 0; a literal has its own type and compiles everything twice
    while i < last:
        if nodes[2][i] >= sea.lowest:
            i = _go_along(sea, share, kept, nodes, target, time, (i, last))
        i += 1


@jit
def _go_along(
    sea: Any, share: Any, kept: Any, nodes: Any, target: Any, time: float, span: Any
) -> int:
    """Evaluate node i and as many stretches from it as possible; return the last node done."""
    i, last = span
    x, y, z = nodes
    arc = target[6]
    first = _find(sea, share, kept, (x[i], y[i], z[i]), time)
    _put(target, i, first)
    while True:
        end = _stretch_end(sea, nodes, arc, i, last, first[0])
        if end - i + 1 < FEWEST:
            break
        a, b = _thirds(arc, i, end)
        if not i < a < b < end or not 0.0 < arc[a] < arc[b] < arc[end]:
            break
        second = _find(sea, share, kept, (x[a], y[a], z[a]), time)
        third = _find(sea, share, kept, (x[b], y[b], z[b]), time)
        fourth = _find(sea, share, kept, (x[end], y[end], z[end]), time)
        _put_cubic(target, (i, end), (a, b), (first, second, third, fourth))
        first, i = fourth, end
    for k in range(i + 1, end + 1):
        arc[k] = 0.0
    return int(i)

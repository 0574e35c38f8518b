"""Sums over the components of a sea along a rope: at its nodes, or at a few of them.

Where the water moves alike at neighbouring nodes it is found at four nodes of a stretch, and
a cubic goes through them. In any direction the fourth derivative of a component's velocity is at
most a·ω·k⁴·e^{kz} (the surface's slope in Wheeler's z apart). With thirds s the cubic is wrong by
s⁴/24 of the sum of these at the stretch's highest place, by s⁴/11 where a stretch has few nodes.

`sea` is any NamedTuple with the fields of `effects/waves.Waves`.
"""

from __future__ import annotations

import math
from typing import Any

from rope_twin.core.jit import jit, jit_sum, jit_within
from rope_twin.core.rows import row, rows
from rope_twin.core.state import FLOW, FLOW_RATE, POSITION, SURFACE

LOWEST = 60.0  # e^-60 stands for less
FEWEST = 5  # nodes of a stretch: of fewer, each is found by itself


@jit_within
def cos_sin(angle: float) -> Any:
    """Cosine and sine to 3e-15, in arithmetic that runs on several angles at once.

    By half the angle, taken to within a quarter turn: polynomials through sin x/x and cos x at
    Chebyshev's places of x², 0 to (π/2)². Taylor's of the same length is wrong by 2e-11.
    """
    turns = angle * (0.5 / math.pi)
    x = math.pi * (turns - math.floor(turns + 0.5))
    y = x * x
    s = x * (0.9999999999999999 + y * (-0.16666666666666072 + y * (0.008333333333282756 + y * (
        -0.00019841269824861897 + y * (2.7557316609073673e-06 + y * (
            -2.505188194671259e-08 + y * (1.6048168318165643e-10 + y * (
                -7.374387503862757e-13))))))))  # fmt: skip
    c = 1.0 + y * (-0.4999999999999997 + y * (0.04166666666666388 + y * (
        -0.001388888888877299 + y * (2.4801587277414926e-05 + y * (
            -2.755731639102575e-07 + y * (2.0876561839933163e-09 + y * (
                -1.1462901901757276e-11 + y * 4.608977003001797e-14)))))))  # fmt: skip
    return 1.0 - 2.0 * s * s, 2.0 * s * c


@jit_within
def decay(x: float) -> float:
    """e^x for -60 < x <= 0 to 4e-14, likewise: (e^{x/64})^64, about x/64 = -1/2."""
    y = x * (1.0 / 64.0) + 0.5
    e = 0.6065306597126334 + y * (0.6065306597126321 + y * (0.3032653298563332 + y * (
        0.10108844328558202 + y * (0.02527211082046181 + y * (0.005054422160007714 + y * (
            0.0008424037123452005 + y * (0.00012034343642683682 + y * (
                1.5042751194096253e-05 + y * (1.6711620242364625e-06 + y * (
                    1.6790056737862458e-07 + y * 1.5743583162962852e-08))))))))))  # fmt: skip
    e = e * e
    e = e * e
    e = e * e
    e = e * e
    e = e * e
    return e * e


@jit_sum
def surface(sea: Any, x: float, y: float, time: float) -> float:
    """η of the full sea at a place [m]."""
    eta = 0.0
    for j in range(sea.k.shape[0]):
        angle = sea.kx[j] * x + sea.ky[j] * y - sea.omega[j] * time + sea.phase[j]
        c, _ = cos_sin(angle)
        eta += sea.amplitude[j] * c
    return eta


@jit_sum
def water(sea: Any, count: int, x: float, y: float, z: float, time: float) -> Any:
    """Velocity and acceleration of the water from the `count` longest components at Wheeler's z."""
    u, v, w, du, dv, dw = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    for j in range(count):
        c, s = cos_sin(sea.kx[j] * x + sea.ky[j] * y - sea.omega[j] * time + sea.phase[j])
        far = decay(max(sea.k[j] * z, -LOWEST))
        echo = sea.echo[j] / far  # from the bottom
        level, rise, omega = far + echo, sea.up[j] * (far - echo), sea.omega[j]
        along, cross = level * c, omega * level * s
        u += sea.east[j] * along
        v += sea.north[j] * along
        w += rise * s
        du += sea.east[j] * cross
        dv += sea.north[j] * cross
        dw -= omega * rise * c
    return u, v, w, du, dv, dw


@jit
def _reaching(sea: Any, level: float) -> int:
    """How many components reach down to a level: the first of `reach`, which rises."""
    low, high = 0, sea.k.shape[0]
    while low < high:
        middle = (low + high) // 2
        if sea.reach[middle] > level:
            high = middle
        else:
            low = middle + 1
    return low


@jit
def _level(sea: Any, z: float, eta: float) -> float:
    """Wheeler's z."""
    return float(max(min((z - eta) / (1.0 + eta / sea.depth), 0.0), -sea.depth))


@jit
def _is_reached(sea: Any, z: float) -> bool:
    """Whether any component moves the water there, were all crests at one place."""
    return bool(z - sea.crest >= sea.reach[0] * (1.0 - sea.crest / sea.depth))


@jit
def _find(sea: Any, share: Any, place: Any, time: float) -> Any:
    """Surface, velocity and its rate at a place; share: of the sea that there is, and its rate."""
    x, y, z = place
    part, rate = share
    eta = part * surface(sea, x, y, time)
    level = _level(sea, z, eta)
    u, v, w, du, dv, dw = water(sea, _reaching(sea, level), x, y, level, time)
    return (
        eta, part * u, part * v, part * w,
        part * du + rate * u, part * dv + rate * v, part * dw + rate * w,
    )  # fmt: skip


@jit
def _stretch_end(sea: Any, nodes: Any, i: int, last: int, eta: float) -> Any:
    """The last node of a stretch from node i, and how long the stretch is [m].

    eta: the surface above node i; from there it falls by the steepest slope at most.
    """
    x, y, z = nodes
    end, long, length, top, row_of = i, 0.0, 0.0, -sea.depth, sea.levels.shape[0] - 1
    for k in range(i + 1, last):
        dx, dy, dz = x[k] - x[k - 1], y[k] - y[k - 1], z[k] - z[k - 1]
        length += math.sqrt(dx * dx + dy * dy + dz * dz)
        away = math.sqrt((x[k] - x[i]) ** 2 + (y[k] - y[i]) ** 2)
        top = max(top, _level(sea, z[k], eta - sea.steepest * away))
        while row_of > 0 and sea.levels[row_of] < top:
            row_of -= 1
        if length > 3.0 * sea.thirds[row_of] or not _is_reached(sea, z[k]):
            break
        end, long = k, length
    return end, long


@jit
def _thirds(nodes: Any, i: int, end: int, long: float) -> Any:
    """The nodes nearest above a third and two thirds of a stretch, and how far along they are."""
    x, y, z = nodes
    length, a, b, at_a, at_b = 0.0, i, i, 0.0, 0.0
    for k in range(i + 1, end):
        dx, dy, dz = x[k] - x[k - 1], y[k] - y[k - 1], z[k] - z[k - 1]
        length += math.sqrt(dx * dx + dy * dy + dz * dz)
        if a == i and 3.0 * length >= long:
            a, at_a = k, length
        elif a > i and b == i and 3.0 * length >= 2.0 * long:
            b, at_b = k, length
    return a, b, at_a, at_b


@jit_within
def _weights(at: float, t1: float, t2: float, t3: float) -> Any:
    """Of the values at 0, t1, t2 and t3 in the cubic through them (Lagrange)."""
    b, c, d = at - t1, at - t2, at - t3
    return (
        -b * c * d / (t1 * t2 * t3),
        at * c * d / (t1 * (t1 - t2) * (t1 - t3)),
        at * b * d / (t2 * (t2 - t1) * (t2 - t3)),
        at * b * c / (t3 * (t3 - t1) * (t3 - t2)),
    )


@jit
def _put(target: Any, i: int, values: Any, weight: float) -> None:
    """Velocity, its rate and the surface, the values times a weight, are added."""
    u, v, w, du, dv, dw, surface_at = target
    surface_at[i] += weight * values[0]
    u[i] += weight * values[1]
    v[i] += weight * values[2]
    w[i] += weight * values[3]
    du[i] += weight * values[4]
    dv[i] += weight * values[5]
    dw[i] += weight * values[6]


@jit
def add_water(sea: Any, share: Any, work: Any, time: float, low: int, high: int) -> None:
    """FLOW += velocity; FLOW_RATE and SURFACE = the sea's, of the nodes low <= i < high.

    0 where no component reaches. share: of the sea that there is, and its rate [1/s].
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
    target = (*rows(work, FLOW, low), *rates, surface_at)
    i, last = low - low, high - low  # 0; a plain one is a type of its own: all is compiled twice
    while i < last:
        if _is_reached(sea, nodes[2][i]):
            i = _go_along(sea, share, nodes, target, time, (i, last))
        i += 1


@jit
def _go_along(sea: Any, share: Any, nodes: Any, target: Any, time: float, span: Any) -> int:
    """Node i, and as many stretches from it as there are; the last node that is done."""
    i, last = span
    x, y, z = nodes
    first = _find(sea, share, (x[i], y[i], z[i]), time)
    _put(target, i, first, 1.0)
    while True:
        end, long = _stretch_end(sea, nodes, i, last, first[0])
        if end - i + 1 < FEWEST:
            return int(i)
        a, b, t1, t2 = _thirds(nodes, i, end, long)
        if not 0.0 < t1 < t2 < long:
            return int(i)
        second = _find(sea, share, (x[a], y[a], z[a]), time)
        third = _find(sea, share, (x[b], y[b], z[b]), time)
        fourth = _find(sea, share, (x[end], y[end], z[end]), time)
        at = 0.0
        for k in range(i + 1, end + 1):
            dx, dy, dz = x[k] - x[k - 1], y[k] - y[k - 1], z[k] - z[k - 1]
            at += math.sqrt(dx * dx + dy * dy + dz * dz)
            w0, w1, w2, w3 = _weights(at, t1, t2, long)
            _put(target, k, first, w0)
            _put(target, k, second, w1)
            _put(target, k, third, w2)
            _put(target, k, fourth, w3)
        first, i = fourth, end

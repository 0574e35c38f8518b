"""Wave kinematics along a rope: linear superposition of components, truncation, interpolation.

**Table**: properties of the components, and work arrays for their cosines and sines. Like the rows
of core/jit/rows they are pointers that LLVM knows not to alias. All properties are in one table,
since a kernel passes ten words for each array. The work arrays are on the stack of the calling
kernel: ropes that step on several threads may share their sea. Components are padded to whole
blocks with zero amplitude, so that a sum over blocks has no remainder.

**Sums** over the components at one position, vectorised over components. `evaluate_phases` computes
cosine and sine of each component's phase, and the surface, at a base position. Near it they are
rotated: the angle differs by d = k·(distance along the heading), and with cos d to d⁴ and sin d to
d⁵ the relative error of a component is at most d⁶/720. `rotation_ranges` returns the admissible
distance.

**Truncation**: depth of components, node spacing, range of rotated angles. Each neglects part of
the water velocity; the total error is below `neglected` [m/s]. Here k are wave numbers [1/m] in
ascending order and speed is a·ω of each component at the surface [m/s], (n,), where ω is at least
1/s, so that the bound holds for the acceleration too.

**Interpolation.** Where the water motion varies little along the rope it is evaluated at four nodes
of a stretch and interpolated by a cubic. In any direction the fourth derivative of a component's
velocity is at most a·ω·k⁴·e^{kz} (except for the surface's slope in Wheeler's z). With thirds s the
error of the cubic is s⁴/24 of the sum of these at the stretch's highest position, s⁴/11 where a
stretch has few nodes. `sea` is any NamedTuple with the fields of `effects/waves.Waves`.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from rope_twin.core.jit.decorators import jit, jit_sum, jit_within
from rope_twin.core.jit.rows import row, rows, stack_rows, table_rows
from rope_twin.core.state import FLOW, FLOW_RATE, POSITION, SURFACE, WAVE_MIN, Floats

BLOCK, MAX_COMPONENTS = 16, 2000  # components per block; maximum per sea

# Rows of a sea's table: one column per component, from long to short,
KX, KY = 0, 1  # wave number east and north [1/m]
OMEGA, PHASE = 2, 3  # [rad/s], [rad]
AMPLITUDE = 4  # [m]
K = 5  # [1/m], ascending
EAST, NORTH, UP = 6, 7, 8  # a·ω/(1 - e^{-2kh}), times cos β, times sin β, and as it is [m/s]
BOTTOM_DECAY = 9  # e^{-2kh}: its reflection at the bottom, at the mean level
# one column per block of components,
REACH_LEVEL = 10  # below this z [m] the blocks from here on are left out
REFLECTION_LEVEL = 11  # down to this z [m] its reflection at the bottom is negligible
ROTATION_RANGE = (
    12  # range of rotated angles for this number of reaching blocks [m]: one more column
)
# and one column per level, from the surface down.
LEVEL = 13  # z [m]
STRETCH_THIRD = 14  # of the longest stretch [m] that a cubic can interpolate below it
SEA_ROWS = 15

# Rows of the work arrays.
COS, SIN = 0, 1  # of each component's angle at the present position
COS_BASE, SIN_BASE = 2, 3  # and at the base position from which angles are rotated:
DECAY = 4  # e^{kz} of each component at LAST_Z
BASE = 5  # base position: x, y and surface [m]; row of LEVEL at the end of the last stretch;
DECAY_Z, DECAY_BLOCKS = 4, 5  # z of FADED, and the number of its blocks
SCRATCH_ROWS = 6


# Rows of a sea's table; uninitialised work arrays.
figures = table_rows("sea", SEA_ROWS)
scratch = stack_rows("scratch", (*[MAX_COMPONENTS] * (SCRATCH_ROWS - 1), DECAY_BLOCKS + 1))


MAX_DECAY_EXPONENT = 60.0  # exponents below are clamped to e^-60


@jit_within
def cos_sin(angle: float) -> Any:
    """Return cosine and sine to 3e-15, in arithmetic that vectorises over angles.

    From half the angle, reduced to a quarter turn: polynomials through sin x/x and cos x at
    Chebyshev points of x², 0 to (π/2)². Taylor polynomials of the same degree have an error of
    2e-11.
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
    """Return e^x for -60 < x <= 0 to 4e-14: (e^{x/64})^64, expanded about x/64 = -1/2."""
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
def evaluate_phases(sea: Any, buffer: Any, x: float, y: float, time: float) -> float:
    """Return η of the full sea at a position [m]; store cosines and sines for `rotate_phases`."""
    c, s, c_base, s_base = buffer[COS], buffer[SIN], buffer[COS_BASE], buffer[SIN_BASE]
    rows = figures(sea.table)
    kx, ky, omega, phase, a = rows[KX], rows[KY], rows[OMEGA], rows[PHASE], rows[AMPLITUDE]
    eta = 0.0
    for j in range(BLOCK * sea.blocks):
        cosine, sine = cos_sin(kx[j] * x + ky[j] * y - omega[j] * time + phase[j])
        c[j] = cosine
        s[j] = sine
        c_base[j] = cosine
        s_base[j] = sine
        eta += a[j] * cosine
    return eta


@jit_sum
def rotate_phases(sea: Any, buffer: Any, x: float, y: float) -> float:
    """Return η near the base position [m], with the angles rotated from there."""
    c, s, c_base, s_base = buffer[COS], buffer[SIN], buffer[COS_BASE], buffer[SIN_BASE]
    rows = figures(sea.table)
    kx, ky, a = rows[KX], rows[KY], rows[AMPLITUDE]
    eta = 0.0
    for j in range(BLOCK * sea.blocks):
        d = kx[j] * x + ky[j] * y
        square = d * d
        across = 1.0 - square * (1.0 / 2.0 - square * (1.0 / 24.0))
        along = d * (1.0 - square * (1.0 / 6.0 - square * (1.0 / 120.0)))
        cosine = c_base[j] * across - s_base[j] * along
        c[j] = cosine
        s[j] = s_base[j] * across + c_base[j] * along
        eta += a[j] * cosine
    return eta


@jit
def set_decay(sea: Any, buffer: Any, blocks: int, z: float) -> None:
    """Set e^{kz} of the longest blocks, if not set already: nodes above the surface share one z."""
    base, faded, k = buffer[BASE], buffer[DECAY], figures(sea.table)[K]
    if z == base[DECAY_Z] and blocks <= base[DECAY_BLOCKS]:
        return
    base[DECAY_Z], base[DECAY_BLOCKS] = z, blocks
    for j in range(BLOCK * blocks):
        faded[j] = decay(max(k[j] * z, -MAX_DECAY_EXPONENT))


@jit_sum
def kinematics(sea: Any, buffer: Any, echoing: int, reaching: int, z: float) -> Any:
    """Return velocity and acceleration at a stretched z from the `reaching` longest blocks.

    The `echoing` longest ones have cosh and sinh profiles, which include the reflection at the
    bottom. All factors are read before the sums: register pressure decides how many partial sums
    LLVM makes, on which the rounding depends.
    """
    set_decay(sea, buffer, max(echoing, reaching), z)
    rows, c, s = figures(sea.table), buffer[COS], buffer[SIN]
    omega, east, north, up = rows[OMEGA], rows[EAST], rows[NORTH], rows[UP]
    bottom, faded = rows[BOTTOM_DECAY], buffer[DECAY]
    u, v, w, du, dv, dw = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    for j in range(BLOCK * echoing):
        o, e, n, r, far, cosine, sine = omega[j], east[j], north[j], up[j], faded[j], c[j], s[j]
        echo = bottom[j] / far  # e^{-k(z+2h)}
        along, rise = (far + echo) * cosine, (far - echo) * sine
        cross, fall = o * (far + echo) * sine, o * (far - echo) * cosine
        u += e * along
        v += n * along
        w += r * rise
        du += e * cross
        dv += n * cross
        dw -= r * fall
    for j in range(BLOCK * echoing, BLOCK * reaching):
        o, e, n, r, far, cosine, sine = omega[j], east[j], north[j], up[j], faded[j], c[j], s[j]
        along, rise = far * cosine, far * sine
        cross, fall = o * rise, o * along
        u += e * along
        v += n * along
        w += r * rise
        du += e * cross
        dv += n * cross
        dw -= r * fall
    return u, v, w, du, dv, dw


@jit_sum
def vertical_gradients(sea: Any, buffer: Any, echoing: int) -> Any:
    """Return the change of velocity and acceleration with z at the mean level [1/s], [1/s²]."""
    rows, c, s = figures(sea.table), buffer[COS], buffer[SIN]
    k, omega, east, north, up = rows[K], rows[OMEGA], rows[EAST], rows[NORTH], rows[UP]
    bottom = rows[BOTTOM_DECAY]
    u, v, w, du, dv, dw = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    for j in range(BLOCK * sea.blocks):
        echo = bottom[j] if j < BLOCK * echoing else 0.0
        along, rise = k[j] * (1.0 - echo) * c[j], k[j] * (1.0 + echo) * s[j]
        cross, fall = omega[j] * k[j] * (1.0 - echo) * s[j], omega[j] * k[j] * (1.0 + echo) * c[j]
        u += east[j] * along
        v += north[j] * along
        w += up[j] * rise
        du += east[j] * cross
        dv += north[j] * cross
        dw -= up[j] * fall
    return u, v, w, du, dv, dw


# Fractions of the error budget. A cubic amplifies an error of its four values by up to 1.63.
TRUNCATION_SHARE, ROTATION_SHARE, INTERPOLATION_SHARE = 0.2, 0.1, 0.5
LEVELS, MAX_LEVEL_DEPTH = 40, 2e3  # of the table of stretches, to this depth [m]
BISECTIONS = 60  # bisections for the depth that a component reaches
MAX_ROTATION_RANGE = 1e4  # m: maximum range of rotated angles
ROUND_OFF_EXPONENT = 36.7  # e^-36.7 is round-off of 1


def levels_to(depth: float) -> Floats:
    """Return the levels at which the longest stretches are tabulated, from the surface down [m]."""
    return -np.append(0.0, np.geomspace(0.25, min(depth, MAX_LEVEL_DEPTH), LEVELS))


def lowest_level(k: Floats, depth: float) -> float:
    """Return the z at which the longest component ends: the bottom, or where it has decayed [m]."""
    return max(-MAX_DECAY_EXPONENT / float(k[0]), -depth)


def reach_levels(k: Floats, speed: Floats, depth: float, neglected: float) -> Floats:
    """Return for each component the z below which it and all shorter ones are negligible.

    z is Wheeler's. The bound is the sum of all amplitudes, Σ a·ω·(e^{kz} + e^{-k(z+2h)}), solved by
    bisection.
    """
    error, bottom = TRUNCATION_SHARE * neglected, lowest_level(k, depth)
    reach = np.full(len(k), bottom)
    for j in range(len(k)):
        low, high = bottom, 0.0
        for _ in range(BISECTIONS):
            middle = 0.5 * (low + high)
            decay_sum = np.exp(k[j:] * middle) + np.exp(-k[j:] * (middle + 2.0 * depth))
            if float(speed[j:] @ decay_sum) > error:
                high = middle
            else:
                low = middle
        reach[j] = low if low > bottom else -math.inf
    return reach


def lowest_node_height(reach: float, crest: float, depth: float) -> float:
    """Return the z below which no component reaches a node, for coincident crests or troughs.

    From Wheeler's z that the longest one reaches, `reach` [m]; crest: Σ a [m].
    """
    if crest >= depth:
        return -math.inf
    return reach * (1.0 - crest / depth) - crest


def reflection_levels(k: Floats, depth: float) -> Floats:
    """Return for each component the z down to which its reflection at the bottom is negligible."""
    return 0.5 * ROUND_OFF_EXPONENT / k - depth


def stretch_thirds(
    levels: Floats, k: Floats, speed: Floats, depth: float, neglected: float
) -> Floats:
    """Return a third of the longest stretch [m] that a cubic can interpolate below each level.

    (11·error/Σ a·ω·k⁴·(e^{kz} + e^{-k(z+2h)}))^¼, where ω is at least 1/s.
    """
    error, size = INTERPOLATION_SHARE * neglected, speed * k**4
    return np.asarray(
        (11.0 * error / np.maximum(_decay_sum(levels, k, depth) @ size, WAVE_MIN)) ** 0.25
    )


def rotation_ranges(
    levels: Floats, k: Floats, a: Floats, speed: Floats, depth: float, neglected: float
) -> Floats:
    """Return the horizontal range [m] over which angles may be rotated, below each level.

    The relative error of a component rotated by d = k·r is d⁶/720: in the velocity that of Σ
    a·ω·k⁶·e^{kz}, and in the surface that of Σ a·k⁶, which shifts Wheeler's z and changes the
    velocity by Σ a·ω·k·e^{kz} a metre, in shallow water by h/(h - Σ a) times as much.
    """
    margin = 1.0 - float(a.sum()) / depth
    if margin <= 0.0:
        return np.zeros(len(levels))
    decay = _decay_sum(np.maximum(levels, lowest_level(k, depth)), k, depth)
    error_sum = decay @ (speed * k**6) + decay @ (speed * k) * float(a @ k**6) / margin
    return np.minimum(
        (720.0 * ROTATION_SHARE * neglected / np.maximum(error_sum, WAVE_MIN)) ** (1 / 6),
        MAX_ROTATION_RANGE,
    )


def _decay_sum(levels: Floats, k: Floats, depth: float) -> Floats:
    """Return e^{kz} + e^{-k(z+2h)} of components at levels, (levels, n)."""
    return np.exp(np.outer(levels, k)) + np.exp(-np.outer(levels + 2.0 * depth, k))


MIN_STRETCH_NODES = 5  # nodes of a stretch: with fewer, each is evaluated individually
NO_BASE_YET = 1e30  # m: no angles are stored yet


@jit
def _reaching_blocks(sea: Any, level: float) -> int:
    """Return the number of blocks of components that reach down to a level."""
    reach, count = figures(sea.table)[REACH_LEVEL], 0
    while count < sea.blocks and reach[count] <= level:
        count += 1
    return count


@jit
def _reflected_blocks(sea: Any, level: float) -> int:
    """Return the number of those blocks with a significant reflection at the bottom."""
    echo, count = figures(sea.table)[REFLECTION_LEVEL], 0
    while count < sea.blocks and echo[count] > level:
        count += 1
    return count


@jit
def _stretched_z(sea: Any, z: float, eta: float) -> float:
    """Return the stretched z, at most 0."""
    eta *= sea.follows
    return float(max(min((z - eta) / (1.0 + eta / sea.depth), 0.0), -sea.depth))


@jit
def _evaluate_at(sea: Any, build_up: Any, buffer: Any, position: Any, time: float) -> Any:
    """Return surface, velocity and acceleration at a position; build_up: factor and its rate."""
    x, y, z = position
    factor, rate = build_up
    base = buffer[BASE]
    dx, dy = x - base[0], y - base[1]
    distance = math.sqrt(dx * dx + dy * dy)
    highest = _stretched_z(sea, z, factor * (base[2] - sea.steepest * distance))
    if distance <= figures(sea.table)[ROTATION_RANGE][_reaching_blocks(sea, highest)]:
        full = rotate_phases(sea, buffer, dx, dy)
    else:
        full = evaluate_phases(sea, buffer, x, y, time)
        base[0], base[1], base[2] = x, y, full
    eta = factor * full
    level = _stretched_z(sea, z, eta)
    echoing, reaching = _reflected_blocks(sea, level), _reaching_blocks(sea, level)
    u, v, w, du, dv, dw = kinematics(sea, buffer, echoing, reaching, level)
    height = sea.extends * min(z, eta)
    if height > 0.0:
        su, sv, sw, sdu, sdv, sdw = vertical_gradients(sea, buffer, echoing)
        u, v, w = u + height * su, v + height * sv, w + height * sw
        du, dv, dw = du + height * sdu, dv + height * sdv, dw + height * sdw
    return (
        eta, factor * u, factor * v, factor * w,
        factor * du + rate * u, factor * dv + rate * v, factor * dw + rate * w,
    )  # fmt: skip


@jit
def _stretch_end(sea: Any, buffer: Any, nodes: Any, arc: Any, i: int, last: int, eta: float) -> int:
    """Return the last node of a stretch from node i; arc length of its nodes is in arc [m].

    eta: the surface elevation above node i; from there it falls by the steepest slope at most.
    """
    x, y, z = nodes
    level, third = figures(sea.table)[LEVEL], figures(sea.table)[STRETCH_THIRD]
    end, length, top, row_of = i, 0.0, -sea.depth, int(buffer[BASE][3])
    shrink = 1.0 / (1.0 + sea.follows * eta / sea.depth)
    for k in range(i + 1, last):
        dx, dy, dz = x[k] - x[k - 1], y[k] - y[k - 1], z[k] - z[k - 1]
        length += math.sqrt(dx * dx + dy * dy + dz * dz)
        dx, dy = x[k] - x[i], y[k] - y[i]
        lowest = sea.follows * (eta - sea.steepest * math.sqrt(dx * dx + dy * dy))
        top = max(top, min((z[k] - lowest) * shrink, 0.0))  # at least _level(sea, z[k], lowest)
        while row_of < sea.levels - 1 and level[row_of + 1] >= top:
            row_of += 1
        while row_of > 0 and level[row_of] < top:
            row_of -= 1
        if length > 3.0 * third[row_of] or z[k] < sea.lowest:
            break
        arc[k] = length
        end = k
    buffer[BASE][3] = row_of
    return end


@jit
def _nodes_at_thirds(arc: Any, i: int, end: int) -> Any:
    """Return the nodes nearest above a third and two thirds of a stretch."""
    a, b = i, i
    for k in range(i + 1, end):
        if a == i and 3.0 * arc[k] >= arc[end]:
            a = k
        elif a > i and b == i and 3.0 * arc[k] >= 2.0 * arc[end]:
            b = k
    return a, b


@jit
def _store_node(target: Any, i: int, values: Any) -> None:
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
def _weighted_sum(weights: Any, four: Any, k: int) -> float:
    return float(
        weights[0] * four[0][k] + weights[1] * four[1][k]
        + weights[2] * four[2][k] + weights[3] * four[3][k]
    )  # fmt: skip


@jit
def _interpolate_stretch(target: Any, span: Any, thirds: Any, four: Any) -> None:
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
        surface_at[k] = _weighted_sum(weights, four, 0)
        u[k] += _weighted_sum(weights, four, 1)
        v[k] += _weighted_sum(weights, four, 2)
        w[k] += _weighted_sum(weights, four, 3)
        du[k] = _weighted_sum(weights, four, 4)
        dv[k] = _weighted_sum(weights, four, 5)
        dw[k] = _weighted_sum(weights, four, 6)


@jit
def add_water(sea: Any, build_up: Any, work: Any, time: float, low: int, high: int) -> None:
    """Add wave velocity to FLOW, and set FLOW_RATE and SURFACE, of the nodes low <= i < high.

    They are 0 where no component reaches. build_up: factor of the sea and its rate [1/s].
    """
    nodes = rows(work, POSITION, low)
    rates = rows(work, FLOW_RATE, low)
    surface_at = row(work, SURFACE, low)
    for i in range(high - low):
        rates[0][i] = 0.0
        rates[1][i] = 0.0
        rates[2][i] = 0.0
        surface_at[i] = 0.0
    if build_up[0] == 0.0:
        return
    buffer = scratch()
    buffer[BASE][0] = NO_BASE_YET
    buffer[BASE][1] = buffer[BASE][2] = buffer[BASE][3] = 0.0
    buffer[BASE][DECAY_Z] = NO_BASE_YET
    target = (*rows(work, FLOW, low), *rates, surface_at)
    i, last = low - low, high - low  # a literal 0 has its own type: a second specialisation
    while i < last:
        if nodes[2][i] >= sea.lowest:
            i = _evaluate_stretches(sea, build_up, buffer, nodes, target, time, (i, last))
        i += 1


@jit
def _evaluate_stretches(
    sea: Any, build_up: Any, buffer: Any, nodes: Any, target: Any, time: float, span: Any
) -> int:
    """Evaluate node i and as many stretches from it as possible; return the last node done."""
    i, last = span
    x, y, z = nodes
    arc = target[6]
    first = _evaluate_at(sea, build_up, buffer, (x[i], y[i], z[i]), time)
    _store_node(target, i, first)
    while True:
        end = _stretch_end(sea, buffer, nodes, arc, i, last, first[0])
        if end - i + 1 < MIN_STRETCH_NODES:
            break
        a, b = _nodes_at_thirds(arc, i, end)
        if not i < a < b < end or not 0.0 < arc[a] < arc[b] < arc[end]:
            break
        second = _evaluate_at(sea, build_up, buffer, (x[a], y[a], z[a]), time)
        third = _evaluate_at(sea, build_up, buffer, (x[b], y[b], z[b]), time)
        fourth = _evaluate_at(sea, build_up, buffer, (x[end], y[end], z[end]), time)
        _interpolate_stretch(target, (i, end), (a, b), (first, second, third, fourth))
        first, i = fourth, end
    for k in range(i + 1, end + 1):
        arc[k] = 0.0
    return int(i)

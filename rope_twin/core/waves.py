"""Wave kinematics along a rope: linear superposition of components, expansion, interpolation.

**Table**: properties of the components, and work arrays for their cosines and sines. Like the rows
of core/jit/rows they are pointers that LLVM knows not to alias. All properties are in one table,
since a kernel passes ten words for each array. The work arrays are on the stack of the calling
kernel: ropes that step on several threads may share their sea. Components are padded to whole
blocks with zero amplitude, so that a sum over blocks has no remainder.

**Sums** over the components at one position, vectorised over components. `evaluate_phases` computes
cosine and sine of each component's phase, and the surface, at a base position. Near it they are
rotated: the angle differs by d = k·(distance along the heading), and with cos d to d⁴ and sin d to
d⁵ the relative error of a component is at most d⁶/720; the surface is its Taylor polynomial of the
same order. e^{kz} is expanded likewise about the next tabulated level. core/wave_tables gives the
distances within which that is done.

**Interpolation.** Where the water motion varies little along the rope it is evaluated at four nodes
of a stretch and interpolated by a cubic. In any direction the fourth derivative of a component's
velocity is at most a·ω·k⁴·e^{kz} (except for the surface's slope in Wheeler's z). With thirds s the
error of the cubic is s⁴/24 of the sum of these at the stretch's highest position, s⁴/11 where a
stretch has few nodes. `sea` is any NamedTuple with the fields of `effects/waves.Waves`.
"""

from __future__ import annotations

import math
from typing import Any

from rope_twin.core.elements import dry_height
from rope_twin.core.jit.decorators import jit, jit_sum, jit_within
from rope_twin.core.jit.rows import row, rows, stack_rows, table_rows
from rope_twin.core.state import FLOW, FLOW_RATE, LENGTH, POSITION, SURFACE, VOLUME

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
# Columns per level at which e^{kz} of the components is tabulated,
DECAY_LEVEL = 15  # z [m]
DECAY_END = 16  # down to this z [m] e^{kz} may be expanded about it; up to that of the level above
DECAY_START = 17  # place of its first component in the table of decays: one more column
SEA_ROWS = 18

# Rows of the work arrays.
COS, SIN = 0, 1  # of each component's angle at the base position from which angles are rotated
DECAY = 2  # e^{kz} of each component at DECAY_Z
TAYLOR = 3  # coefficients of the surface about the base position, by order and power of y
BASE = 4  # base position: x, y and surface [m]; row of LEVEL at the end of the last stretch;
DECAY_Z, DECAY_BLOCKS, DECAY_ROW = 4, 5, 6  # z of DECAY, number of its blocks, row of DECAY_LEVEL
TAYLOR_MADE = 7  # 1 once TAYLOR belongs to the base position
TAYLOR_TERMS = 21  # of orders 0 to 5


# Rows of a sea's table; e^{kz} at the tabulated levels, in one row; uninitialised work arrays.
figures = table_rows("sea", SEA_ROWS)
decay_rows = table_rows("sea", 1)
scratch = stack_rows("scratch", (*[MAX_COMPONENTS] * 3, TAYLOR_TERMS, TAYLOR_MADE + 1))


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


@jit_within
def _rotate(cosine: float, sine: float, d: float) -> Any:
    """Return cosine and sine of an angle that is larger by d, to d⁶/720."""
    square = d * d
    across = 1.0 - square * (1.0 / 2.0 - square * (1.0 / 24.0))
    along = d * (1.0 - square * (1.0 / 6.0 - square * (1.0 / 120.0)))
    return cosine * across - sine * along, sine * across + cosine * along


@jit_sum
def evaluate_phases(sea: Any, buffer: Any, x: float, y: float, time: float) -> float:
    """Return η of the full sea at a position [m]; store cosines and sines as the base."""
    c, s = buffer[COS], buffer[SIN]
    rows = figures(sea.table)
    kx, ky, omega, phase, a = rows[KX], rows[KY], rows[OMEGA], rows[PHASE], rows[AMPLITUDE]
    eta = 0.0
    for j in range(BLOCK * sea.blocks):
        cosine, sine = cos_sin(kx[j] * x + ky[j] * y - omega[j] * time + phase[j])
        c[j] = cosine
        s[j] = sine
        eta += a[j] * cosine
    return eta


@jit
def surface_near(sea: Any, buffer: Any, x: float, y: float) -> float:
    """Return η of the full sea at this distance from the base position [m], to (k·distance)⁶/720.

    Its Taylor polynomial in x and y is made for the first position near a base.
    """
    base, m = buffer[BASE], buffer[TAYLOR]
    if base[TAYLOR_MADE] == 0.0:
        base[TAYLOR_MADE] = 1.0
        _expand_to_cubic(sea, buffer)
        _expand_to_quintic(sea, buffer)
    return float(
        m[0] + x * (m[1] + x * (m[3] + x * (m[6] + x * (m[10] + x * m[15]))))
        + y * (m[2] + x * (m[4] + x * (m[7] + x * (m[11] + x * m[16])))
        + y * (m[5] + x * (m[8] + x * (m[12] + x * m[17]))
        + y * (m[9] + x * (m[13] + x * m[18])
        + y * (m[14] + x * m[19] + y * m[20]))))
    )  # fmt: skip


@jit_sum
def _expand_to_cubic(sea: Any, buffer: Any) -> None:
    """Set the coefficients of η about the base position, orders 0 to 3."""
    c, s, m = buffer[COS], buffer[SIN], buffer[TAYLOR]
    rows = figures(sea.table)
    kx, ky, a = rows[KX], rows[KY], rows[AMPLITUDE]
    m0, m1, m2, m3, m4, m5, m6, m7, m8, m9 = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    for j in range(BLOCK * sea.blocks):
        x, y, even, odd = kx[j], ky[j], a[j] * c[j], a[j] * s[j]
        odd_x, odd_y, square_x, square_y = odd * x, odd * y, x * x, y * y
        m0 += even
        m1 -= odd_x
        m2 -= odd_y
        m3 -= even * square_x
        m4 -= even * (x * y)
        m5 -= even * square_y
        m6 += odd_x * square_x
        m7 += odd_y * square_x
        m8 += odd_x * square_y
        m9 += odd_y * square_y
    m[0], m[1], m[2], m[3], m[4], m[5] = m0, m1, m2, m3 / 2.0, m4, m5 / 2.0
    m[6], m[7], m[8], m[9] = m6 / 6.0, m7 / 2.0, m8 / 2.0, m9 / 6.0


@jit_sum
def _expand_to_quintic(sea: Any, buffer: Any) -> None:
    """Set the coefficients of η about the base position, orders 4 and 5."""
    c, s, m = buffer[COS], buffer[SIN], buffer[TAYLOR]
    rows = figures(sea.table)
    kx, ky, a = rows[KX], rows[KY], rows[AMPLITUDE]
    m0, m1, m2, m3, m4 = 0.0, 0.0, 0.0, 0.0, 0.0
    m5, m6, m7, m8, m9, m10 = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    for j in range(BLOCK * sea.blocks):
        x, y, even, odd = kx[j], ky[j], a[j] * c[j], a[j] * s[j]
        square_x, square_y, mixed = x * x, y * y, x * y
        even_x, even_y = even * square_x, even * square_y
        odd_x, odd_y = odd * x, odd * y
        fourth_x, fourth, fourth_y = square_x * square_x, square_x * square_y, square_y * square_y
        m0 += even_x * square_x
        m1 += even_x * mixed
        m2 += even_x * square_y
        m3 += even_y * mixed
        m4 += even_y * square_y
        m5 -= odd_x * fourth_x
        m6 -= odd_y * fourth_x
        m7 -= odd_x * fourth
        m8 -= odd_y * fourth
        m9 -= odd_x * fourth_y
        m10 -= odd_y * fourth_y
    m[10], m[11], m[12], m[13], m[14] = m0 / 24.0, m1 / 6.0, m2 / 4.0, m3 / 6.0, m4 / 24.0
    m[15], m[16], m[17] = m5 / 120.0, m6 / 24.0, m7 / 12.0
    m[18], m[19], m[20] = m8 / 12.0, m9 / 24.0, m10 / 120.0


@jit
def set_decay(sea: Any, buffer: Any, blocks: int, z: float) -> None:
    """Set e^{kz} of the longest blocks, if not set already: nodes above the surface share one z."""
    base = buffer[BASE]
    if z == base[DECAY_Z] and blocks <= base[DECAY_BLOCKS]:
        return
    base[DECAY_Z], base[DECAY_BLOCKS] = z, blocks
    rows, faded = figures(sea.table), buffer[DECAY]
    k, lower_end, level, start = rows[K], rows[DECAY_END], rows[DECAY_LEVEL], rows[DECAY_START]
    last, m = sea.decay_levels - 1, int(base[DECAY_ROW])
    while m < last and z < lower_end[m]:
        m += 1
    while m > 0 and z >= lower_end[m - 1]:
        m -= 1
    base[DECAY_ROW] = m
    if m <= last and z >= lower_end[m] and start[m] + BLOCK * blocks <= start[m + 1]:
        _decay_from(sea, faded, int(start[m]), BLOCK * blocks, z - level[m])
        return
    for j in range(BLOCK * blocks):
        faded[j] = decay(max(k[j] * z, -MAX_DECAY_EXPONENT))


@jit
def _decay_from(sea: Any, faded: Any, start: int, count: int, rise: float) -> None:
    """Set e^{kz} from its values at a tabulated level, this much below [m], to (k·rise)⁶/720."""
    k, stored = figures(sea.table)[K], decay_rows(sea.decays)[0]
    for j in range(count):
        d = k[j] * rise
        faded[j] = stored[start + j] * (1.0 + d * (1.0 + d * (1.0 / 2.0 + d * (
            1.0 / 6.0 + d * (1.0 / 24.0 + d * (1.0 / 120.0))))))  # fmt: skip


@jit_sum
def kinematics(sea: Any, buffer: Any, x: float, y: float, z: float, spans: Any) -> Any:
    """Return velocity and acceleration at a stretched z, this far from the base position [m].

    spans: the number of longest blocks with cosh and sinh profiles, which include the reflection at
    the bottom, and of those that reach z. All factors are read before the sums: register pressure
    decides how many partial sums LLVM makes, on which the rounding depends.
    """
    echoing, reaching = spans
    set_decay(sea, buffer, max(echoing, reaching), z)
    rows, c, s = figures(sea.table), buffer[COS], buffer[SIN]
    kx, ky, omega, bottom = rows[KX], rows[KY], rows[OMEGA], rows[BOTTOM_DECAY]
    east, north, up, faded = rows[EAST], rows[NORTH], rows[UP], buffer[DECAY]
    u, v, w, du, dv, dw = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    for j in range(BLOCK * echoing):
        o, e, n, r, far = omega[j], east[j], north[j], up[j], faded[j]
        cosine, sine = _rotate(c[j], s[j], kx[j] * x + ky[j] * y)
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
        o, e, n, r, far = omega[j], east[j], north[j], up[j], faded[j]
        cosine, sine = _rotate(c[j], s[j], kx[j] * x + ky[j] * y)
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
def vertical_gradients(sea: Any, buffer: Any, x: float, y: float, echoing: int) -> Any:
    """Return the change of velocity and acceleration with z at the mean level [1/s], [1/s²]."""
    rows, c, s = figures(sea.table), buffer[COS], buffer[SIN]
    kx, ky, k, omega = rows[KX], rows[KY], rows[K], rows[OMEGA]
    east, north, up, bottom = rows[EAST], rows[NORTH], rows[UP], rows[BOTTOM_DECAY]
    u, v, w, du, dv, dw = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    for j in range(BLOCK * sea.blocks):
        cosine, sine = _rotate(c[j], s[j], kx[j] * x + ky[j] * y)
        echo = bottom[j] if j < BLOCK * echoing else 0.0
        along, rise = k[j] * (1.0 - echo) * cosine, k[j] * (1.0 + echo) * sine
        cross, fall = omega[j] * k[j] * (1.0 - echo) * sine, omega[j] * k[j] * (1.0 + echo) * cosine
        u += east[j] * along
        v += north[j] * along
        w += up[j] * rise
        du += east[j] * cross
        dv += north[j] * cross
        dw -= up[j] * fall
    return u, v, w, du, dv, dw


MIN_STRETCH_NODES = 5  # nodes of a stretch: with fewer, each is evaluated individually
ROUNDED_UP = 1.0 + 1e-9  # more than the rounding of a length
NO_BASE_YET = 1e30  # m: no angles are stored yet
ALWAYS_WET = 1e30  # m above the surface: no node is so high


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
def _evaluate_at(
    sea: Any, build_up: Any, buffer: Any, position: Any, time: float, dry_above: float
) -> Any:
    """Return surface, velocity and acceleration at a position; build_up: factor and its rate.

    dry_above: height over the surface above which the water's motion is left out, 0 [m].
    """
    x, y, z = position
    factor, rate = build_up
    base = buffer[BASE]
    dx, dy = x - base[0], y - base[1]
    distance = math.sqrt(dx * dx + dy * dy)
    highest = _stretched_z(sea, z, factor * (base[2] - sea.steepest * distance))
    if distance <= figures(sea.table)[ROTATION_RANGE][_reaching_blocks(sea, highest)]:
        full = surface_near(sea, buffer, dx, dy)
    else:
        full = evaluate_phases(sea, buffer, x, y, time)
        base[0], base[1], base[2], base[TAYLOR_MADE] = x, y, full, 0.0
        dx = dy = 0.0
    eta = factor * full
    if z - eta > dry_above:
        return eta, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    level = _stretched_z(sea, z, eta)
    spans = _reflected_blocks(sea, level), _reaching_blocks(sea, level)
    u, v, w, du, dv, dw = kinematics(sea, buffer, dx, dy, level, spans)
    height = sea.extends * min(z, eta)
    if height > 0.0:
        su, sv, sw, sdu, sdv, sdw = vertical_gradients(sea, buffer, dx, dy, spans[0])
        u, v, w = u + height * su, v + height * sv, w + height * sw
        du, dv, dw = du + height * sdu, dv + height * sdv, dw + height * sdw
    return (
        eta, factor * u, factor * v, factor * w,
        factor * du + rate * u, factor * dv + rate * v, factor * dw + rate * w,
    )  # fmt: skip


@jit
def _level_row(sea: Any, row_of: int, z: float) -> int:
    """Return the row of the lowest level at or above z, searched from another row."""
    level = figures(sea.table)[LEVEL]
    while row_of < sea.levels - 1 and level[row_of + 1] >= z:
        row_of += 1
    while row_of > 0 and level[row_of] < z:
        row_of -= 1
    return row_of


@jit
def _stretch_end(sea: Any, buffer: Any, nodes: Any, arc: Any, i: int, last: int, eta: float) -> int:
    """Return the last node of a stretch from node i; arc length of its nodes is in arc [m].

    eta: the surface elevation above node i; from there it falls by the steepest slope at most. A
    stretch ends below the surface, where the kinematics have a kink.
    """
    x, y, z = nodes
    third, row_of = figures(sea.table)[STRETCH_THIRD], int(buffer[BASE][3])
    end, length, top = i, 0.0, -sea.depth
    shrink = 1.0 / (1.0 + sea.follows * eta / sea.depth)
    k = i + MIN_STRETCH_NODES - 1  # most stretches in short ropes would end before this node
    if k >= last or z[i] > sea.follows * eta:
        return i
    row_of = _level_row(sea, row_of, min((z[k] - sea.follows * eta) * shrink, 0.0))
    dx, dy, dz = x[k] - x[i], y[k] - y[i], z[k] - z[i]
    if dx * dx + dy * dy + dz * dz > ROUNDED_UP * (3.0 * third[row_of]) ** 2:
        buffer[BASE][3] = row_of
        return i
    for k in range(i + 1, last):
        dx, dy, dz = x[k] - x[k - 1], y[k] - y[k - 1], z[k] - z[k - 1]
        length += math.sqrt(dx * dx + dy * dy + dz * dz)
        dx, dy = x[k] - x[i], y[k] - y[i]
        lowest = sea.follows * (eta - sea.steepest * math.sqrt(dx * dx + dy * dy))
        top = max(top, min((z[k] - lowest) * shrink, 0.0))  # at least _stretched_z there
        row_of = _level_row(sea, row_of, top)
        if length > 3.0 * third[row_of] or z[k] < sea.lowest or z[k] > lowest:
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
    buffer[BASE][DECAY_Z], buffer[BASE][DECAY_ROW] = NO_BASE_YET, 0.0
    target = (*rows(work, FLOW, low), *rates, surface_at)
    lengths, volumes = row(work, LENGTH, low), row(work, VOLUME, low)
    i, last = low - low, high - low  # a literal 0 has its own type: a second specialisation
    while i < last:
        if nodes[2][i] >= sea.lowest:
            dry_above = ALWAYS_WET
            if i + low > 0:  # the payload at the lower end may reach into the water
                dry_above = sea.dry_above + dry_height(lengths[i], volumes[i])
            i = _evaluate_stretches(
                sea, build_up, buffer, nodes, target, time, (i, last), dry_above
            )
        i += 1


@jit
def _evaluate_stretches(
    sea: Any, build_up: Any, buffer: Any, nodes: Any, target: Any, time: float, span: Any,
    dry_above: float,
) -> int:  # fmt: skip
    """Evaluate node i and as many stretches from it as possible; return the last node done."""
    i, last = span
    x, y, z = nodes
    arc = target[6]
    first = _evaluate_at(sea, build_up, buffer, (x[i], y[i], z[i]), time, dry_above)
    _store_node(target, i, first)
    if z[i] - first[0] > dry_above:
        return int(i)
    while True:
        end = _stretch_end(sea, buffer, nodes, arc, i, last, first[0])
        if end - i + 1 < MIN_STRETCH_NODES:
            break
        a, b = _nodes_at_thirds(arc, i, end)
        if not i < a < b < end or not 0.0 < arc[a] < arc[b] < arc[end]:
            break
        second = _evaluate_at(sea, build_up, buffer, (x[a], y[a], z[a]), time, ALWAYS_WET)
        third = _evaluate_at(sea, build_up, buffer, (x[b], y[b], z[b]), time, ALWAYS_WET)
        fourth = _evaluate_at(sea, build_up, buffer, (x[end], y[end], z[end]), time, ALWAYS_WET)
        _interpolate_stretch(target, (i, end), (a, b), (first, second, third, fourth))
        first, i = fourth, end
    for k in range(i + 1, end + 1):
        arc[k] = 0.0
    return int(i)

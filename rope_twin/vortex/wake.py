"""Vortex shedding kernels of the VIV models inside the time step.

Shedding along a rope follows from the water velocity normal to its mean shape, the running mean of
the rope's tangent, which follows payout and current.

The wake oscillator is van der Pol's in scaled time, solved at a node inside a stage. In the wake's
time τ, dτ = ω·dt, with y the driving motion divided by the diameter:

    d²q/dτ² + ε·(q² - 1)·dq/dτ + q = A·d²y/dτ²

For constant ω that is q'' + ε·ω·(q² - 1)·q' + ω²·q = A·y''. Where ω falls to 0 that form has no
restoring term, and q grows without bound. Here the state is q and p, which is dq/dτ without the
driving term (Liénard 1928):

    q' = ω·p + A·y',    p' = -ε·(q² - 1)·q' - ω·q

Nothing is divided by ω: at ω = 0 the wake is stationary.

A body that moves many times as fast as the water sheds vortices of its own motion, for which the
driving term would only integrate its path: A·y' is reduced by 1/(1 + (A·y'/(40·ω))⁴). In lock-in at
one diameter, A·y'/ω is 4 to 5 and the reduction 2e-4; q then stays below (4·23/ε)^⅓, 12 for ε 0.05,
in any motion.

Shedding frequencies are held over each half wavelength of the response, [LCD] Le Cunff and Durand
(1999): ω = 2π·St·U/d, and waves of this frequency have k² = (√(T² +
4·EI·m_t·ω²) - T)/(2·EI), or m_t·ω²/T. Counted from the hang-off down, a half wave has the largest
frequency on it: in the published case that of its upper end, which would be 0 where waves stop the
flow there, and its half wave the whole rope, on which the lift would then stand still.
"""

from __future__ import annotations

from math import pi, sin, sqrt
from typing import Any

from rope_twin.core.elements import end_rope, stretch_all
from rope_twin.core.jit.decorators import jit, jit_within
from rope_twin.core.jit.functions import anywhere
from rope_twin.core.jit.rows import row, rows
from rope_twin.core.jit.wide import choose
from rope_twin.core.loads.balance import set_flow
from rope_twin.core.state import (
    DIRECTION,
    DIVISOR_MIN,
    ELEMENTS,
    FLOW,
    MASS,
    POSITION,
    RATE_MIN,
    REST,
    TANGENT,
    TANGENT2_MIN,
    TENSION,
    VOLUME,
    Stage,
)


@jit_within
def three_rows(memory: Any, first: int, low: int) -> Any:
    """Return three rows of a memory from node `low` on."""
    return memory[first, low:], memory[first + 1, low:], memory[first + 2, low:]


@jit
def set_node_lengths(work: Any, length: Any, low: int, high: int) -> None:
    """Set the unstretched length lumped at the free nodes low <= i < high [m].

    length: result, from node `low` on.
    """
    first = max(low, 1)
    rest, below = row(work, REST, first), row(work, REST, first - 1)
    if low == 0:
        length[0] = 0.5 * work[REST, 0]
    own = length[first - low :]
    for i in range(high - first):
        own[i] = 0.5 * (rest[i] + below[i])


@jit
def evaluate_statics(rope: Any, upto: int) -> None:
    """Compute directions, tensions and water velocity in static equilibrium at time 0.

    upto: number of nodes that carry loads.
    """
    n, stage = rope.state.counts[ELEMENTS], Stage(0.0, 1.0, 0.0, 0.0)
    stretch_all(rope, stage)
    if upto > n:
        end_rope(rope.work, n)
    set_flow(rope.effects, rope.work, stage, n - n, upto)


@jit
def set_shape(rope: Any, shape: Any, upto: int) -> None:
    """Set `shape` (three rows) to the rope's present tangent at the nodes below `upto`."""
    nodes, (x, y, z), n = rope.state.nodes, shape, rope.state.counts[ELEMENTS]
    for i in range(upto):
        low, high = max(i - 1, 0), min(i + 1, n)
        dx = nodes[POSITION, high] - nodes[POSITION, low]
        dy = nodes[POSITION + 1, high] - nodes[POSITION + 1, low]
        dz = nodes[POSITION + 2, high] - nodes[POSITION + 2, low]
        inverse = 1.0 / sqrt(dx * dx + dy * dy + dz * dz + DIVISOR_MIN)
        x[i], y[i], z[i] = inverse * dx, inverse * dy, inverse * dz


@jit
def follow_shape(work: Any, share: float, mean: Any, shape: Any, n: int) -> None:
    """Set shape = mean + share·(tangent - mean) of the nodes below n; both are three rows."""
    tx, ty, tz = rows(work, TANGENT, 0)
    (mx, my, mz), (x, y, z) = mean, shape
    for i in range(n):
        x[i] = mx[i] + share * (tx[i] - mx[i])
        y[i] = my[i] + share * (ty[i] - my[i])
        z[i] = mz[i] + share * (tz[i] - mz[i])


@jit_within
def _shed(wake: Any, water: Any, tangent: Any) -> Any:
    """Return V × t_s, its magnitude |V_N|, A and ε at a node; t_s: tangent of the mean shape."""
    u, v, w = water
    x, y, z = tangent
    cx, cy, cz = v * z - w * y, w * x - u * z, u * y - v * x
    speed = sqrt(cx * cx + cy * cy + cz * cz)
    along = u * x + v * y + w * z
    upright = along * along < wake.critical * wake.critical * (u * u + v * v + w * w)
    A = choose(upright, wake.A, wake.A_inclined)
    epsilon = choose(upright, wake.epsilon, wake.epsilon_inclined)
    return (cx, cy, cz), speed, A, epsilon


@jit
def set_shedding(wake: Any, work: Any, own: Any, low: int, high: int) -> None:
    """Set ω_s [rad/s], ε, the lift factor [kg/m] and (A/D)·D_a of the nodes low <= i < high.

    own: rows from node `low` on: the shape (three); ω_s, ε and lift factor, which contains the
    node's length; and (A/D)·D_a (three).
    """
    (tx, ty, tz), (omega, epsilon, length), (bx, by, bz) = own
    ux, uy, uz = rows(work, FLOW, low)
    volume = row(work, VOLUME, low)
    for i in range(high - low):
        per_diameter = sqrt(0.25 * pi * length[i] / (volume[i] + DIVISOR_MIN))
        (x, y, z), speed, A, e = _shed(wake, (ux[i], uy[i], uz[i]), (tx[i], ty[i], tz[i]))
        omega[i] = 2.0 * pi * wake.strouhal * speed * per_diameter
        epsilon[i] = e
        length[i] *= wake.strength / per_diameter
        scale = A * per_diameter / (speed + RATE_MIN)
        bx[i], by[i], bz[i] = scale * x, scale * y, scale * z


UNENDED = -1.0  # marks a node above the lower end of its half wave
WAVES = 24  # number of half waves along the rope that compose the smooth noise
GOLDEN = 2.399963  # rad, phase increment between them
FASTEST = 40.0  # A·dy/dτ at which the driving term is halved


@jit_within
def smooth_noise(share: float) -> Any:
    """Return mesh-independent noise of half waves at a fraction of the rope's length."""
    total = 0.0
    for j in range(1, WAVES + 1):
        total += sin(pi * j * share + GOLDEN * j * j)
    return sqrt(2.0 / WAVES) * total


@jit_within
def faded(drive: Any, omega: Any) -> Any:
    """Return the reduced driving term A·y' and its derivative to A·y'."""
    x, root = drive * drive, FASTEST * omega
    limit = root * root
    s = limit * limit / (limit * limit + x * x + DIVISOR_MIN)
    return s * drive, s * (4.0 * s - 3.0)


@jit_within
def wake_of(c: float, q: Any, start: Any, figures: Any) -> Any:
    """Return p of the stage that has this q; see `solve_wake`."""
    hat, wake_hat, _ = start
    omega, epsilon = figures
    return wake_hat - epsilon * (q * q - 1.0) * (q - hat) - c * omega * q


@jit_within
def solve_wake(c: float, count: int, start: Any, figures: Any, drive: Any) -> Any:
    """Solve q = hat + c·q', p = wake_hat + c·p' by Newton's method; return q and slope s.

    start: both explicit parts and an initial guess of q; figures: ω and ε; drive: reduced A·y'; s:
    slope of the cubic. dq/d(drive) is c/s.
    """
    hat, wake_hat, q = start
    omega, epsilon = figures
    k = c * omega
    slope = 0.0 * k
    for _ in range(count):
        own = k * epsilon * (q * q - 1.0)
        miss = (q - hat) * (1.0 + own) - k * (wake_hat - k * q) - c * drive
        slope = 1.0 + own + 2.0 * k * epsilon * q * (q - hat) + k * k
        q -= miss / slope
    return q, slope


@jit_within
def across(water: Any, tangent: Any) -> Any:
    """Return U × t and its magnitude, the water velocity normal to the rope."""
    u, v, w = water
    x, y, z = tangent
    cx, cy, cz = v * z - w * y, w * x - u * z, u * y - v * x
    return cx, cy, cz, sqrt(cx * cx + cy * cy + cz * cz)


@jit_within
def _pace(turns: float, water: Any, direction: Any, per_diameter: float) -> Any:
    """Return 2π·St·U/d [rad/s] for water normal to a direction vector of any length."""
    x, y, z = direction
    inverse = 1.0 / sqrt(x * x + y * y + z * z + TANGENT2_MIN)
    _, _, _, speed = across(water, (x * inverse, y * inverse, z * inverse))
    return turns * speed * per_diameter


@jit
def set_paces(turns: float, work: Any, per_diameter: Any, pace: Any, low: int, high: int) -> None:
    """Set 2π·St·U/d of the nodes low <= i < high [rad/s], U normal to the adjacent elements.

    turns: 2π·St; per_diameter and pace: 1/d and the result, from node `low` on.
    """
    first = max(low, 1)
    if low == 0:
        water = (work[FLOW, 0], work[FLOW + 1, 0], work[FLOW + 2, 0])
        x, y, z = work[DIRECTION, 0], work[DIRECTION + 1, 0], work[DIRECTION + 2, 0]
        pace[0] = _pace(turns, water, (2.0 * x, 2.0 * y, 2.0 * z), per_diameter[0])
    tx, ty, tz = rows(work, DIRECTION, first)
    bx, by, bz = rows(work, DIRECTION, first - 1)
    ux, uy, uz = rows(work, FLOW, first)
    own, per = pace[first - low :], per_diameter[first - low :]
    for i in range(high - first):
        direction = (tx[i] + bx[i], ty[i] + by[i], tz[i] + bz[i])
        own[i] = _pace(turns, (ux[i], uy[i], uz[i]), direction, per[i])


@jit_within
def wave_number(EI: Any, T: Any, m: Any, omega: Any) -> Any:
    """Return k of a wave of this frequency [1/m]; 0 where the rope is slack. m: mass per metre."""
    inertia = m * omega * omega
    square = 2.0 * inertia / (T + sqrt(T * T + 4.0 * EI * inertia) + RATE_MIN)
    return choose(T > 0.0, sqrt(square), 0.0)


@jit
def hold_frequencies(waves: Any, work: Any, length: Any, held: Any, mark: Any, n: int) -> None:
    """Hold the largest ω of each half wave over it, from the hang-off down.

    held: each node's own ω, replaced by that of its half wave; mark: scratch, one number a node.
    """
    T, mass, volume = row(work, TENSION, 0), row(work, MASS, 0), row(work, VOLUME, 0)
    for i in range(n):
        mark[i] = UNENDED
    turned, omega = 0.0 * length[0], 0.0 * length[0]
    for i in range(n - 1, -1, -1):
        omega = max(omega, held[i])
        per_metre = (mass[i] + waves.added * volume[i]) / length[i]
        turned += length[i] * wave_number(waves.EI, T[i], per_metre, omega)
        ends = turned >= pi
        if anywhere(ends):
            mark[i] = choose(ends, omega, UNENDED)
            turned, omega = choose(ends, turned - pi, turned), choose(ends, 0.0, omega)
    for i in range(n):  # the lowest half wave has what is left
        omega = choose(mark[i] > UNENDED, mark[i], omega)
        held[i] = omega

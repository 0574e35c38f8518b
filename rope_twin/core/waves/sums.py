"""Sums over the components of a sea at one position, vectorised over components.

`refer` evaluates cosine and sine of each component's angle, and the surface, at a base position.
Near it they are rotated: the angle differs by d = k·(distance along the heading), and with cos d to
d⁴ and sin d to d⁵ the relative error of a component is at most d⁶/720. The admissible distance is
given by core/waves/reach.
"""

from __future__ import annotations

import math
from typing import Any

from rope_twin.core.jit.decorators import jit_sum, jit_within
from rope_twin.core.waves.rows import (
    AMPLITUDE,
    BLOCK,
    COS,
    COS_BASE,
    EAST,
    KX,
    KY,
    NORTH,
    OMEGA,
    PHASE,
    SIN,
    SIN_BASE,
    UP,
    K,
    figures,
)

LOWEST = 60.0  # exponents below are clamped to e^-60


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
def refer(sea: Any, kept: Any, x: float, y: float, time: float) -> float:
    """Return η of the full sea at a position [m]; store its cosines and sines for `turn`."""
    c, s, c_base, s_base = kept[COS], kept[SIN], kept[COS_BASE], kept[SIN_BASE]
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
def turn(sea: Any, kept: Any, x: float, y: float) -> float:
    """Return η near the base position [m], with the angles rotated from there."""
    c, s, c_base, s_base = kept[COS], kept[SIN], kept[COS_BASE], kept[SIN_BASE]
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


@jit_sum
def water(sea: Any, kept: Any, echoing: int, reaching: int, z: float) -> Any:
    """Return velocity and acceleration at a stretched z from the `reaching` longest blocks.

    The `echoing` longest ones are reflected at the bottom: cosh and sinh profiles then differ
    slightly.
    """
    rows, c, s = figures(sea.table), kept[COS], kept[SIN]
    k, omega, east, north, up = rows[K], rows[OMEGA], rows[EAST], rows[NORTH], rows[UP]
    u, v, w, du, dv, dw = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    for j in range(BLOCK * echoing):
        far = decay(max(k[j] * z, -LOWEST))
        echo = decay(max(-k[j] * (z + 2.0 * sea.depth), -LOWEST))
        along, rise = (far + echo) * c[j], (far - echo) * s[j]
        cross, fall = omega[j] * (far + echo) * s[j], omega[j] * (far - echo) * c[j]
        u += east[j] * along
        v += north[j] * along
        w += up[j] * rise
        du += east[j] * cross
        dv += north[j] * cross
        dw -= up[j] * fall
    for j in range(BLOCK * echoing, BLOCK * reaching):
        far = decay(max(k[j] * z, -LOWEST))
        along, rise = far * c[j], far * s[j]
        cross, fall = omega[j] * rise, omega[j] * along
        u += east[j] * along
        v += north[j] * along
        w += up[j] * rise
        du += east[j] * cross
        dv += north[j] * cross
        dw -= up[j] * fall
    return u, v, w, du, dv, dw


@jit_sum
def slopes(sea: Any, kept: Any, echoing: int) -> Any:
    """Return the change of velocity and acceleration with z at the mean level [1/s], [1/s²]."""
    rows, c, s = figures(sea.table), kept[COS], kept[SIN]
    k, omega, east, north, up = rows[K], rows[OMEGA], rows[EAST], rows[NORTH], rows[UP]
    u, v, w, du, dv, dw = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    for j in range(BLOCK * sea.blocks):
        echo = decay(max(-2.0 * k[j] * sea.depth, -LOWEST)) if j < BLOCK * echoing else 0.0
        along, rise = k[j] * (1.0 - echo) * c[j], k[j] * (1.0 + echo) * s[j]
        cross, fall = omega[j] * k[j] * (1.0 - echo) * s[j], omega[j] * k[j] * (1.0 + echo) * c[j]
        u += east[j] * along
        v += north[j] * along
        w += up[j] * rise
        du += east[j] * cross
        dv += north[j] * cross
        dw -= up[j] * fall
    return u, v, w, du, dv, dw

"""The wake oscillator of [QM] on a cylinder: Q2 under forced motion, Q3 free on springs.

Lengths in diameters, ρ = 1. Q2 is harmonic balance, Q3 Runge and Kutta on the same equations as the
effect's; that the effect steps them so is held by test_wake_oscillator.
"""

from __future__ import annotations

from math import pi, sqrt

import numpy as np

from rope_twin.effects.wake_oscillator import SETS
from rope_twin.studies.picture import Field, Line, Panel, Vector
from validation.case import Case, Finding, Found, between, derived, shown, within_pct
from validation.forced_wake import table_of_readings

Four = tuple[float, float, float, float]

SET, DRAG = SETS["qu_metrikine"], 1.2
UPRIGHT_AT, INCLINED_AT = (5.5, 5.75, 6.0, 6.25, 6.5), (5.8, 6.0)  # V_r
TURN = np.linspace(0.0, 2.0 * pi, 180, endpoint=False)
MASS_RATIO, DAMPING = 2.4, 0.0045
FREE = {  # y/D and f/f_n over V_r
    4.0: (0.075, 0.723), 5.0: (0.724, 0.948), 6.0: (1.058, 1.000), 6.5: (1.080, 1.027),
    7.0: (1.017, 1.058), 8.0: (0.621, 1.167), 10.0: (0.210, 1.530),
}  # fmt: skip


def force(q: Vector, V: float, rate: Vector) -> Vector:
    """Return |U|·(C_L0/2·q·V - C_D·y'), twice the cross-flow force of eqs 26-29."""
    return np.asarray(np.hypot(V, rate) * (0.5 * SET.lift * q * V - DRAG * rate))


def mean_power(reduced: float, y: float, A: float, epsilon: float) -> float:
    """Return the mean power on y·sin τ, by harmonic balance of q (eqs 18-23 with U_N exact).

    q = Im(z·e^{iτ}); |z|² = Q solves ((Ω² - 1)² + (ε·Ω·(Q/4 - 1))²)·Q = (A·y)², Ω = St·V_r. Force
    |U|·(C_L0/2·q·V - C_D·y')/2 with |U|² = V² + y'²: the root that the paper prints without y².
    """
    omega = SET.strouhal * reduced
    e2, d2 = (epsilon * omega) ** 2, (omega**2 - 1.0) ** 2
    roots = np.roots([e2 / 16.0, -e2 / 2.0, d2 + e2, -((A * y) ** 2)])
    Q = max(root.real for root in roots if abs(root.imag) < 1e-9 * max(1.0, abs(root)))
    z = -A * y / (omega**2 - 1.0 + 1j * epsilon * omega * (Q / 4.0 - 1.0))
    q, rate, V = np.imag(z * np.exp(1j * TURN)), y * np.cos(TURN), reduced / (2.0 * pi)
    return float(np.mean(force(q, V, rate) * rate))


def power_map(reduced: Vector, y: Vector, pair: tuple[float, float]) -> Vector:
    """Return the power over V_r (columns) and ŷ (rows)."""
    return np.array([[mean_power(V, amplitude, *pair) for V in reduced] for amplitude in y])


def largest_amplitude(reduced: float, pair: tuple[float, float]) -> float:
    """Return the largest ŷ with positive power; 0: none."""
    from scipy.optimize import brentq

    grid = np.linspace(0.02, 1.4, 139)
    values = [mean_power(reduced, y, *pair) for y in grid]
    gains = np.flatnonzero(np.array(values) > 0.0)
    if not len(gains):
        return 0.0
    k = int(gains[-1])
    return float(brentq(lambda y: mean_power(reduced, y, *pair), grid[k], grid[k + 1]))


def ends(A: float) -> tuple[float, float]:
    """Return V_r at the limits of the region: |1 - (St·V_r)²| = β·V_r, β = C_L0·A/(8π·C_D).

    With g = ε·Ω·(Q/4 - 1) and d = Ω² - 1 the part of q in phase with the velocity is g·Q/(A·y), and
    (A·y)² = (d² + g²)·Q: power comes in where g² + d² < 2·β·V_r·g, which some g > 0 meets as long
    as |d| < β·V_r. ε drops out, and the ends' product is 1/St².
    """
    beta, st = SET.lift * A / (8.0 * pi * DRAG), SET.strouhal
    root = sqrt(beta * beta + 4.0 * st * st)
    return (root - beta) / (2.0 * st * st), (root + beta) / (2.0 * st * st)


def highest(reduced: float, pair: tuple[float, float]) -> float:
    """Return the largest ŷ with positive power between the limits: the larger g of `ends`."""
    A, epsilon = pair
    omega = SET.strouhal * reduced
    half, d = SET.lift * A * reduced / (8.0 * pi * DRAG), omega * omega - 1.0
    g = half + sqrt(half * half - d * d)
    return sqrt(2.0 * half * g * 4.0 * (1.0 + g / (epsilon * omega))) / A


def _edge(pair: tuple[float, float], inside: float, outside: float) -> float:
    """Return V_r at the limit of the region of positive power, by bisection."""
    for _ in range(12):
        middle = 0.5 * (inside + outside)
        if largest_amplitude(middle, pair) > 0.0:
            inside = middle
        else:
            outside = middle
    return inside


def _forced(readings: bool = True) -> Found:
    upright, inclined = SET.upright, SET.inclined
    findings: list[Finding] = []
    for name, pair, speeds, middle in (
        ("A 4, ε 0.05", upright, UPRIGHT_AT, 6.0), ("A 1, ε 0.1", inclined, INCLINED_AT, 5.9),
    ):  # fmt: skip
        lower, upper = ends(pair[0])
        edges = _edge(pair, middle, 4.0), _edge(pair, middle, 8.0)
        findings += [
            derived(within_pct(f"{name}: lower end of the region", edges[0], lower, 0.5)),
            derived(within_pct(f"{name}: upper end of the region", edges[1], upper, 0.5)),
            *(
                derived(
                    within_pct(
                        f"{name}: ŷ_max at V_r {V:g}", largest_amplitude(V, pair),
                        highest(V, pair), 0.1, "D",
                    )
                )
                for V in speeds
            ),
        ]  # fmt: skip
        if pair == upright:
            findings += [
                between(f"{name}: region from", edges[0], (4.75, 5.25), "approximately 5"),
                between(f"{name}: region to", edges[1], (6.65, 7.25), "approximately 7"),
                between(f"{name}: ŷ_max", highest(6.25, pair), (0.85, 1.15), "about 1", "D"),
            ]
        else:
            largest = highest(0.5 * sum(edges), pair)
            findings += [
                between(f"{name}: middle of the region", 0.5 * sum(edges), (5.8, 6.2), "around 6"),
                between(f"{name}: ŷ_max", largest, (0.0, 0.5), "less than 0.5", "D"),
            ]
    free = {V: (V / ratio, y) for V, (y, ratio) in FREE.items() if 5.0 <= V <= 7.0}
    findings.append(
        derived(shown("Q3 at V_r 5: V_r on the frequency it vibrates at", free[5.0][0], "5.27"))
    )
    findings.append(
        shown("power that comes in there, at ŷ 0.724", mean_power(*free[5.0], *upright), "> 0")
    )
    notes = (*WHY_FORCED, table_of_readings()) if readings else ()
    return Found(tuple(findings), _regions(free), notes)


WHY_FORCED = (
    "The paper shows both regions in a figure and prints what is quoted here. The numbers beside "
    "ours are derived from its eqs 15-17 and 24-29 by harmonic balance: the ends lie where "
    "|1 - (St·V_r)²| = β·V_r with β = C_L0·A/(8π·C_D), so that their product is 1/St² = 34.6 "
    "whatever A, ε, C_L0 and C_D are. The paper drops a ŷ² under the root of eqs 22-23, which "
    "moves no end: where the power's sign changes does not depend on a root that lift and drag "
    "have in common.",
    "By another program, the oscillator stepped in time on a grid of 0.05 in V_r and ŷ, for "
    "readings of the equations that might be meant; U is the speed that the moving cylinder feels.",
)


def _regions(free_points: dict[float, tuple[float, float]]) -> tuple[Panel, ...]:
    """Return maps of the power's sign, with published values and the free cylinder of Q3."""
    V, y = np.linspace(4.5, 7.5, 121), np.linspace(0.025, 1.4, 56)
    free = Line(
        [V for V, _ in free_points.values()],
        [y for _, y in free_points.values()],
        "Q3's cylinder",
        "k^",
    )
    known = [
        Line(list(reduced), [highest(V, pair) for V in reduced], "ŷ_max derived", "ko")
        for reduced, pair in ((UPRIGHT_AT, SET.upright), (INCLINED_AT, SET.inclined))
    ]
    panels = []
    for name, pair, lines in (
        ("A 4, ε 0.05", SET.upright, (known[0], free)),
        ("A 1, ε 0.1", SET.inclined, (known[1],)),
    ):
        sign = np.sign(power_map(V, y, pair))
        field = Field(sign, (V[0], V[-1]), (0.0, y[-1]), "", most=3.0)
        published = [
            Line([end, end], [0.0, 1.4], "" if k else "ends derived", "k--")
            for k, end in enumerate(ends(pair[0]))
        ]
        title = f"{name}: red where power comes in"
        panels.append(
            Panel(title, "reduced velocity V/(f·D)", "amplitude ŷ [D]", (*published, *lines), field)
        )
    return tuple(panels)


def free_response(reduced: float, seconds: float = 150.0) -> tuple[float, float]:
    """Return y/D and f/f_n of an elastically mounted cylinder; in water f_n = 1, D = 1, ρ = 1."""
    A, epsilon = SET.upright
    displaced, V = 0.25 * pi, reduced
    M, wet = (MASS_RATIO + 1.0) * displaced, 2.0 * pi
    shed, c, k = 2.0 * pi * SET.strouhal * V, 2.0 * DAMPING * M * wet, M * wet**2

    def slope(s: Four) -> Four:
        y, v, q, rate = s
        force = 0.5 * sqrt(V * V + v * v) * (0.5 * SET.lift * q * V - DRAG * v)
        a = (force - c * v - k * y) / M
        return v, a, rate, -epsilon * shed * (q * q - 1.0) * rate - shed**2 * q + A * a

    h = 1.0 / (60.0 * max(1.0, reduced * SET.strouhal))
    state, places = (0.0, 0.0, 0.1, 0.0), []
    for _ in range(round(seconds / h)):
        k1 = slope(state)
        k2 = slope(_moved(state, k1, 0.5 * h))
        k3 = slope(_moved(state, k2, 0.5 * h))
        k4 = slope(_moved(state, k3, h))
        state = _moved(_moved(state, k1, h / 6.0), _moved(k4, _moved(k2, k3, 1.0), 2.0), h / 6.0)
        places.append(state[0])
    y = np.array(places[3 * len(places) // 4 :])
    x = y - y.mean()
    crossings = np.flatnonzero((x[:-1] < 0.0) & (x[1:] >= 0.0))
    times = crossings + x[crossings] / (x[crossings] - x[crossings + 1])
    return 0.5 * float(np.ptp(y)), float((len(crossings) - 1) / ((times[-1] - times[0]) * h))


def _moved(state: Four, slopes: Four, step: float) -> Four:
    return (
        state[0] + step * slopes[0],
        state[1] + step * slopes[1],
        state[2] + step * slopes[2],
        state[3] + step * slopes[3],
    )


def _free() -> Found:
    responses = {V: free_response(V) for V in FREE}
    findings: list[Finding] = []
    for V, (amplitude, frequency) in responses.items():
        findings += [
            derived(within_pct(f"V_r {V:g}: y/D", amplitude, FREE[V][0], 2.0)),
            derived(within_pct(f"V_r {V:g}: f/f_n", frequency, FREE[V][1], 2.0)),
        ]
    reduced = list(FREE)
    panels = tuple(
        Panel(
            "m* 2.4, ζ 0.0045", "reduced velocity", name,
            (Line(reduced, [responses[V][k] for V in reduced], "ours", "o-"),
             Line(reduced, [FREE[V][k] for V in reduced], "reference", "kx")),
        )
        for k, name in enumerate(("y/D", "f/f_n"))
    )  # fmt: skip
    return Found(tuple(findings), panels)


CASES = (
    Case("Q2", "the wake oscillator under forced motion: where power comes in", "[QM] fig. 2",
         _forced, 45.0, short=lambda: _forced(readings=False)),
    Case("Q3", "one degree of freedom on this oscillator, V_r on the wet natural frequency",
         "our own reference", _free, 5.0),
)  # fmt: skip

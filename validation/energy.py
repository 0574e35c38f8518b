"""P5: energy of undamped motion in vacuum, and the work of a winch that pays out."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from rope_twin.core.energy import measure
from rope_twin.core.integrator import GAMMA, K1, K2
from rope_twin.core.state import Boundary
from rope_twin.scene.schema import Winch
from rope_twin.studies.picture import Line, Panel, Vector
from validation.case import Case, Finding, Found, between
from validation.rigs import Rig
from validation.snap import SPRING
from validation.state_bench import Bench, energy

SWUNG = Rig(length=100.0, elements=20, load=2e3, EA=20e6, tolerance=1e-3)
SWING_S, STEPS_S = 60.0, ((0.01, 1e-5), (0.05, 3e-4))  # step, and what it may lose of the energy
SPRING_STEPS_S = (0.01, 0.02, 0.04)
PAID_OUT = Rig(
    length=200.0, elements=20, step=0.005, tolerance=1e-3,
    winch=Winch(speed_limit_m_per_s=3.0, acceleration_limit_m_per_s2=0.3,
                min_line_out_m=12.0, max_line_out_m=3000.0),
)  # fmt: skip


def damping(z: complex) -> float:
    """Return |R(z)| of TR-BDF2 (Bank et al. 1985) for y' = z/h·y: amplification of a step."""
    c = 0.5 * GAMMA * z
    middle = (1.0 + c) / (1.0 - c)
    return float(abs((K1 * middle - K2) / (1.0 - c)))


def _swing(step: float) -> Vector:
    """Return the relative change of a swing's energy, ten steps apart; released at 30 degrees."""
    rig = replace(SWUNG, step=step)
    bench = Bench(rig.scene())
    hanging = energy(bench, rig)
    depth, angle = -bench.position[2].copy(), math.radians(30.0)
    bench.position[0], bench.position[2] = depth * math.sin(angle), -depth * math.cos(angle)
    start = energy(bench, rig)
    energies = [start]
    for _ in range(round(SWING_S / step / 10)):
        bench.hold(10)
        energies.append(energy(bench, rig))
    return np.asarray((np.array(energies) - start) / (start - hanging))


def _spring(step: float) -> tuple[float, float]:
    """Return the energy loss of a mass on a spring in 20 s, computed and |R(i·ω·h)|^(2N)."""
    bench = Bench(replace(SPRING, step=step, tolerance=1e-4).scene())
    hanging = measure(bench.rope, np.zeros(3), 0.0, 0.0).store.total
    share = np.linspace(1.0, 0.0, 4)
    bench.position[2] -= 0.05 * share
    omega = math.sqrt(SPRING.EA / SPRING.length / (SPRING.load + SPRING.added[2]))
    bench.acceleration[2] = 0.05 * omega**2 * share
    start = measure(bench.rope, np.zeros(3), 0.0, 0.0).store.total - hanging
    steps = round(20.0 / step)
    bench.hold(steps)
    remaining = measure(bench.rope, np.zeros(3), 0.0, 0.0).store.total - hanging
    return 1.0 - remaining / start, 1.0 - damping(1j * omega * step) ** (2 * steps)


def _payout() -> tuple[float, float, int]:
    """Return the loss of rope and payload while paid out, the work at the sheave [J], and splits.

    Hang-off fixed, vacuum: d(energy)/dt = V·(m·w²/2 + T²/(2·EA)) - V·T·(dz/ds) of the rope that
    passes the sheave at w = V·dz/ds, its height being 0 there.
    """
    rig = PAID_OUT
    bench = Bench(rig.scene())
    t = rig.step * np.arange(4001)
    u = np.minimum(t / 5.0, 1.0)
    value, rate = np.zeros((len(t), 4)), np.zeros((len(t), 4))
    rate[:, 3] = 2.0 * u**2 * (3.0 - 2.0 * u)
    value[:, 3] = rig.length + 2.0 * (5.0 * (u**3 - 0.5 * u**4) + np.maximum(t - 5.0, 0.0))
    start = energy(bench, rig)
    pull = np.array([bench.hold(1)[0]])  # the static pull, before the winch starts
    pull = np.concatenate([pull, bench.follow(Boundary(value, rate))])
    V, stretch = rate[:, 3], 1.0 + pull / rig.EA
    work = float(np.trapezoid(V * pull * stretch, t))
    brought = V * (0.5 * rig.mass * (V * stretch) ** 2 + 0.5 * pull**2 / rig.EA)
    lost = start - energy(bench, rig) + float(np.trapezoid(brought, t))
    return lost, work, bench.n - rig.elements


def _energies() -> Found:
    findings: list[Finding] = []
    lines = []
    for step, largest_loss in STEPS_S:
        energy_gain = _swing(step)
        label = f"swing of 30° for {SWING_S:g} s at {1e3 * step:g} ms"
        findings += [
            between(
                f"{label}: energy gained, most", float(energy_gain.max()), (-math.inf, 1e-6), "0"
            ),
            between(f"{label}: energy lost", -float(energy_gain[-1]), (-1e-6, largest_loss), "0"),
        ]
        times = [10.0 * step * k for k in range(len(energy_gain))]
        lines.append(Line(times, 1e6 * energy_gain, f"{1e3 * step:g} ms"))
    for step in SPRING_STEPS_S:
        ours, exact = _spring(step)
        margin = 0.02 * exact + 1e-6
        findings.append(
            Finding(f"mass on a spring for 20 s at {1e3 * step:g} ms: energy lost", ours,
                    f"{exact:.4g}", "2 % and 1e-6", "", exact - margin, exact + margin)
        )  # fmt: skip
    lost, work, born = _payout()
    part = abs(lost / work - 1.0)
    findings += [
        between("payout of 36 m: what the rope loses is off the sheave's work by", part,
                (0.0, 5e-5), f"{work:.6g} J"),
        between("elements born meanwhile", born, (1.0, math.inf), "some"),
    ]  # fmt: skip
    picture = Panel("swing of 30° in vacuum", "time [s]", "energy less its start [1e-6]",
                    tuple(lines))  # fmt: skip
    note = (
        "The spring loses what TR-BDF2 takes of its frequency, |R(i·ω·h)|^(2N) in closed form; the "
        "swing, which the step resolves, next to nothing."
    )
    return Found(tuple(findings), (picture,), (note,))


CASES = (
    Case("P5", "energy of undamped motion in vacuum; work of the winch in payout",
         "closed form; TR-BDF2's own damping", _energies, 5.0),
)  # fmt: skip

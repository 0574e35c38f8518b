"""Top tension under payout and heave against the exact travelling waves with a moving boundary."""

from __future__ import annotations

import numpy as np
import pytest
from payout_rigs import HMPE, STEEL, WINCH
from rigs import Rig, Vector, march, sine

from validation.hard_cases.waves import HangingBar, Motion, ramped_speed
from validation.hard_cases.waves import top_tension as exact_tension

COMMANDS = [(2.0, 1.0), (20.0, -1.0)]  # at, speed: pays out, then hauls
SECONDS = 40.0
MARCH_S = 5e-4


def faded_in(amplitude: float, period: float, duration: float) -> Motion:
    """Heave with the scene's ramp u³·(10 - 15u + 6u²), and its rate."""
    heave = sine(amplitude, period)

    def at(time: float) -> tuple[float, float]:
        z, v = heave(time)
        u = min(time / duration, 1.0)
        share = u**3 * (10.0 - 15.0 * u + 6.0 * u * u)
        return share * z, share * v + 30.0 * u * u * (1.0 - u) ** 2 / duration * z

    return at


def exact(rig: Rig, amplitude: float) -> Vector:
    """F at the step borders after the first [N]."""
    bar = HangingBar(rig.mass, rig.weight, rig.EA, rig.load, rig.load_weight)
    line = ramped_speed(rig.length, WINCH.acceleration_limit_m_per_s2, COMMANDS)
    fine = exact_tension(bar, line, faded_in(amplitude, 8.0, rig.ramp), SECONDS, MARCH_S)
    every = round(rig.step / MARCH_S)
    return fine[every::every]


def published(rig: Rig, amplitude: float) -> tuple[Vector, int]:
    """Top tension [N] after each step, and the number of splits and merges."""
    snapshots = list(march(rig.twin(), sine(amplitude, 8.0), SECONDS, speeds=COMMANDS))
    return np.array([s.tension_top_n for s in snapshots]), snapshots[-1].solver.splits + snapshots[
        -1
    ].solver.merges


def test_the_travelling_wave_solution_before_the_first_echo() -> None:
    """Before the first echo an accelerating winch lowers the pull by I·a, less the rope it adds.

    -Z·a = -6119 N/s for steel (a 0.3 m/s²); here w·V is added as it is.
    """
    bar = HangingBar(STEEL.mass, STEEL.weight, STEEL.EA, STEEL.load, STEEL.load_weight)
    tension = exact_tension(bar, ramped_speed(1000.0, 0.3, [(0.0, 1.0)]), sine(0.0, 8.0), 0.5, 1e-3)
    impedance = (STEEL.EA * STEEL.mass) ** 0.5
    stretch = 1.0 + (bar.W + bar.w * 1000.0) / bar.EA
    line, speed = 0.5 * 0.3 * 0.5**2, 0.3 * 0.5
    expected = -impedance * speed * stretch + bar.w * line
    assert tension[-1] - tension[0] == pytest.approx(expected, rel=1e-3)


@pytest.mark.parametrize(("rig", "most"), [(STEEL, 5e-4), (HMPE, 1.3e-3)])
def test_top_tension_under_payout_equals_travelling_waves(rig: Rig, most: float) -> None:
    """10 m elements, 10 ms, winch acceleration in steps of 0.3 m/s², heave 1.5 m in 8 s."""
    computed, events = published(rig, 1.5)
    reference = exact(rig, 1.5)
    assert events >= 3
    assert np.sqrt(np.mean((computed - reference) ** 2)) / reference.mean() <= most

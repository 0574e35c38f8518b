"""Hard cases of a rope that is cut under load: at the payload, and in the middle.

A cut is a new rope of what is left (the upper part, a bare lower end) that takes over position and
velocity of its nodes. What falls off is not followed.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from rope_twin.core import state as rows
from rope_twin.studies.rigs import NOTHING, WATER, Rig
from rope_twin.studies.stability_check import Case, Check, all_converged, off
from rope_twin.studies.stability_rigs import Arrays

WIRE = Rig(length=1000.0, elements=500, step=1e-3, tolerance=1.0)
WET_WIRE = replace(
    WIRE, elements=100, step=0.01, tolerance=None, density=WATER, volume=2.0, added=(2050.0,) * 3,
    area=(4.0,) * 3, drag=(1.2, 0.02), added_mass=1.0, damping=65e4,
    current=((0.0, (0.5, 0.0)), (-1000.0, (0.1, 0.0))),
)  # fmt: skip
SETTLE_S = 900.0


def cut(whole: Arrays, below: int) -> Arrays:
    """The rope above its first `below` elements, with nothing on it, moving as it did."""
    rig = replace(
        whole.rig, length=float(whole.s[-1] - whole.s[below]), elements=whole.n - below, load=0.0,
        volume=0.0, added=NOTHING, area=NOTHING,
    )  # fmt: skip
    left = Arrays(rig)
    n = left.n + 1
    source, target = whole.rope.state, left.rope.state
    target.nodes[:, :n] = source.nodes[:, below : below + n]
    target.s[:n] = source.s[below : below + n] - source.s[below]
    target.offset[: n - 1] = source.offset[below : below + n - 1]
    target.counts[rows.LOWEST_OFFSET] = 0
    left.find_acceleration()
    return left


def momentum(arrays: Arrays) -> float:
    """Vertical momentum of the bare rope [N·s]."""
    rest = np.diff(arrays.s)
    lump = 0.5 * (np.concatenate([[0.0], rest]) + np.concatenate([rest, [0.0]]))
    return float(arrays.rig.mass * (lump * arrays.velocity[2]).sum())


def recoil(below: int) -> list[Check]:
    """A hanging rope in vacuum is cut; the release runs up it as a wave.

    Before the wave reaches the top at L/c, c = √(EA/m): the cut end flies up at T/√(EA·m), T the
    tension that was cut, the pull on the hang-off stays, and momentum grows as T·t. Afterwards the
    rope is slack: its energy can only fall.
    """
    whole = Arrays(WIRE)
    whole.settle()
    left = cut(whole, below)
    rig, length = left.rig, float(left.s[-1])
    T = WIRE.load_weight + WIRE.weight * float(whole.s[below])
    arrival = length / math.sqrt(rig.EA / rig.mass)
    pull_before = T + rig.weight * length
    start = left.energy()
    steps = int(0.8 * arrival / rig.step)
    pull = left.hold(steps)
    gained = momentum(left)
    speed = math.sqrt(rig.EA / rig.mass)
    released = left.s < 0.8 * speed * rig.step * steps
    released_speed = float(left.velocity[2, released].mean())
    kinetic = 0.5 * T * T / rig.EA * rig.step * steps * speed
    moving = 0.5 * rig.mass * float((np.diff(left.s) * left.velocity[2, 1:] ** 2).sum())
    highest = max(highest_energy(left, 200, 50), left.energy())
    free = T / math.sqrt(rig.EA * rig.mass)
    return [
        off("speed of the released part against T/√(EA·m)", released_speed, free, 1.0),
        off("momentum when the wave is at 0.8 L against T·t", gained, T * rig.step * steps, 0.1),
        off("energy of motion then against T²/(2·EA)·c·t", moving, kinetic, 2.0),
        Check("change of the pull before the wave arrives",
              100.0 * float(np.abs(pull / pull_before - 1.0).max()), 0.1),
        Check("energy gained in 10 s after the cut, over what was stored in stretch",
              100.0 * (highest - start) / stretch_energy(T, rig), 1e-4),
        all_converged(left.unconverged),
    ]  # fmt: skip


def highest_energy(left: Arrays, pieces: int, steps: int) -> float:
    """The largest energy [J] at the ends of so many pieces of the run to come."""
    highest = -np.inf
    for _ in range(pieces):
        left.hold(steps)
        highest = max(highest, left.energy())
    return float(highest)


def stretch_energy(T: float, rig: Rig) -> float:
    """Energy stored in a hanging rope with tension T at its lower end [J]: ∫T²/(2·EA) ds."""
    top = T + rig.weight * rig.length
    return (top**3 - T**3) / (6.0 * rig.EA * rig.weight)


def come_to_rest(below: int) -> list[Check]:
    """The same in water and a current, until the bare rope hangs as one that was never cut."""
    whole = Arrays(WET_WIRE)
    whole.settle()
    left = cut(whole, below)
    pull = float(left.hold(round(SETTLE_S / left.rig.step))[-1])
    fresh = Arrays(left.rig)
    fresh.settle()
    away = float(np.abs(left.position - fresh.position).max())
    return [
        off("in water, pull at the end against rest", pull, float(fresh.hold(1)[-1]), 0.1),
        Check("and its distance from the shape at rest, over the length",
              100.0 * away / left.rig.length, 0.1),
        all_converged(left.unconverged),
    ]  # fmt: skip


def cut_at_payload() -> list[Check]:
    """20 t fall off 1,000 m of wire."""
    return [*recoil(0), *come_to_rest(0)]


def cut_in_middle() -> list[Check]:
    """The lower 500 m and 20 t fall off."""
    return [*recoil(250), *come_to_rest(50)]


REFERENCE = "release wave: T/√(EA·m), momentum T·t, energy that only falls; the rope at rest"
CASES = (
    Case("cut_at_payload", "20 t cut off 1,000 m of wire", REFERENCE, cut_at_payload, 5.0, True),
    Case("cut_in_middle", "1,000 m of wire with 20 t cut at 500 m", REFERENCE, cut_in_middle, 4.0),
)

"""Robustness tests of a rope that is cut under load: at the payload, and in the middle.

Both parts continue as in a twin: the upper one with a bare lower end, the lower one free at its
upper end, with the payload. A sling of one element remains on a payload that is cut off.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from rope_twin.core import state as rows
from rope_twin.core.state import Boundary
from rope_twin.effects.seabed import SeabedParams
from rope_twin.errors import SolverError
from rope_twin.scene.rope_model import build
from rope_twin.twin.contact import seabed_contact
from rope_twin.twin.rope_cut import (
    CutPosition,
    cut_rope,
    without_load,
    without_massless_section,
)
from rope_twin.twin.ropes import CutRope
from validation.case import Finding, limited
from validation.hard_cases.limits import all_converged, hard_case, off
from validation.hard_cases.rigs import RigBench, settled
from validation.rigs import NOTHING, WATER, Rig
from validation.state_bench import Vector

WIRE = Rig(length=1000.0, elements=500, step=1e-3, tolerance=1.0)
WET_WIRE = replace(
    WIRE, elements=100, step=0.01, tolerance=None, density=WATER, volume=2.0, added=(2050.0,) * 3,
    area=(4.0,) * 3, drag=(1.2, 0.02), added_mass=1.0, damping=65e4,
    current=((0.0, (0.5, 0.0)), (-1000.0, (0.1, 0.0))),
)  # fmt: skip
SETTLE_S, SINK_S = 900.0, 200.0
BED = SeabedParams(depth_m=1200.0)
GONE = 0.8  # of its way: where the release wave is looked at


class Parts:
    """Both of them, with the hang-off at rest."""

    def __init__(self, bench: RigBench, below: int) -> None:
        """Cut a whole rope above its first `below` elements."""
        rig, lost, rope = bench.rig, float(bench.s[below]), bench.rope
        value = np.zeros((1, rows.MOTIONS))
        value[0, rows.LINE] = bench.length
        place = CutPosition(lost, math.inf, 0.0)
        cut = cut_rope(
            rope, Boundary(value, np.zeros_like(value)), place, without_load(rope.effects)
        )
        upper_rig = replace(
            rig, length=bench.length - lost, elements=bench.n - below, load=0.0, volume=0.0,
            added=NOTHING, area=NOTHING,
        )  # fmt: skip
        self.upper = RigBench(upper_rig, cut.upper)
        self.lower = RigBench(
            replace(rig, length=lost, elements=below), without_massless_section(cut.lower)
        )
        self._ropes = CutRope(rig.scene(), cut.upper, cut.lower)
        self._steps = 0

    def hold(self, steps: int) -> Vector:
        """Advance; the pull on the hang-off after each step [N]. Raises SolverError."""
        value = np.zeros((steps + 1, rows.MOTIONS))
        value[:, rows.LINE] = self.upper.length
        pull = np.zeros((steps, rows.PULL_COLUMNS))
        border = Boundary(value, np.zeros_like(value))
        time = self._steps * self.upper.rig.step
        done = self._ropes.advance(self.upper.rope, border, time, pull)
        if done < steps:
            problem = "the next state of a part is not finite even at 1/32 of the step"
            raise SolverError(f"step {done + 1}", problem, "a solver defect: report it")
        self._steps += steps
        return pull[:, rows.PULL]

    def push_of_bed(self) -> float:
        """Return the seabed reaction on the lower part [N]."""
        bed = seabed_contact(self._ropes.lowest(self.upper.rope))
        return bed.payload_reaction_n + bed.rope_reaction_n if bed is not None else math.nan

    def energy(self) -> float:
        """Return the energy of both parts [J]."""
        return self.upper.energy() + self.lower.energy()


def momentum(part: RigBench) -> float:
    """Return the vertical momentum of a part with its payload [N·s]."""
    rest_length = np.diff(part.s)
    lump = (
        part.rig.mass
        * 0.5
        * (np.concatenate([[0.0], rest_length]) + np.concatenate([rest_length, [0.0]]))
    )
    lump[0] += part.rig.load
    return float((lump * part.velocity[2]).sum())


def recoil(below: int) -> list[Finding]:
    """Test the upper part of a hanging rope that is cut in vacuum, with its release wave.

    Before the wave reaches the top at L/c, c = √(EA/m): the cut end flies up at T/√(EA·m), T the
    tension that was cut, the pull on the hang-off stays, and momentum grows as T·t. Afterwards the
    rope is slack: its energy can only fall.
    """
    bench = settled(WIRE)
    upper = Parts(bench, below).upper
    rig, length = upper.rig, float(upper.s[-1])
    T = WIRE.load_weight + WIRE.weight * float(bench.s[below])
    arrival = length / math.sqrt(rig.EA / rig.mass)
    pull_before = T + rig.weight * length
    start = upper.energy()
    steps = int(GONE * arrival / rig.step)
    pull = upper.hold(steps)
    gained = momentum(upper)
    speed = math.sqrt(rig.EA / rig.mass)
    released = upper.s < GONE * speed * rig.step * steps
    released_speed = float(upper.velocity[2, released].mean())
    kinetic = 0.5 * T * T / rig.EA * rig.step * steps * speed
    moving = 0.5 * rig.mass * float((np.diff(upper.s) * upper.velocity[2, 1:] ** 2).sum())
    highest = max(highest_energy(upper, 200, 50), upper.energy())
    free = T / math.sqrt(rig.EA * rig.mass)
    return [
        off("speed of the released part against T/√(EA·m)", released_speed, free, 1.0),
        off("momentum when the wave is at 0.8 L against T·t", gained, T * rig.step * steps, 0.1),
        off("energy of motion then against T²/(2·EA)·c·t", moving, kinetic, 2.0),
        limited("change of the pull before the wave arrives",
                100.0 * float(np.abs(pull / pull_before - 1.0).max()), 0.1),
        limited("energy gained in 10 s after the cut, over what was stored in stretch",
                100.0 * (highest - start) / stretch_energy(T, rig), 1e-4),
        all_converged(upper.unconverged),
    ]  # fmt: skip


def fall(below: int) -> list[Finding]:
    """Test the lower part in vacuum: its centre of mass falls with g.

    The wave goes down from the cut; it meets the tension T - m·g·c·t, leaves rope that is slack,
    and that falls: v = -T/√(EA·m) + g·t_a - g·(t - t_a) where it came at t_a. When it has passed
    the payload nothing pulls there any more.
    """
    bench = settled(WIRE)
    before = bench.energy()
    parts = Parts(bench, below)
    rig, lower = WIRE, parts.lower
    length, c = lower.length, math.sqrt(rig.EA / rig.mass)
    T = rig.load_weight + rig.weight * length
    weight = (rig.load + rig.mass * length) * rig.gravity
    stored = stretch_energy(rig.load_weight, rig)
    checks = []
    steps = int(GONE * length / c / rig.step)
    if steps > 0:
        parts.hold(steps)
        t = steps * rig.step
        behind = length - GONE * c * t
        speed = float(lower.velocity[2, lower.s > behind].mean())
        expected = -T / math.sqrt(rig.EA * rig.mass) - (1.0 - GONE) * rig.gravity * t
        checks.append(off("speed of the cut end of the lower part", speed, expected, 2.0))
    highest = parts.energy()
    for _ in range(200):
        parts.hold(10)
        highest = max(highest, parts.energy())
    steps += 2000
    tension = float(lower.rope.work[rows.TENSION, 0])
    return [
        *checks,
        off("momentum of the lower part after 2 s of fall against -W·t", momentum(lower),
            -weight * steps * rig.step, 1e-6),
        limited("tension that is left at the payload", 100.0 * tension / T, 0.1),
        limited(
            "energy of both parts gained at the cut and in 2 s, over what was stored in stretch",
            100.0 * (highest - before) / stored, 0.1,
        ),
        all_converged(lower.unconverged),
    ]  # fmt: skip


def highest_energy(bench: RigBench, pieces: int, steps: int) -> float:
    """Return the largest energy at the ends of the following pieces of the run [J]."""
    highest = -np.inf
    for _ in range(pieces):
        bench.hold(steps)
        highest = max(highest, bench.energy())
    return float(highest)


def stretch_energy(T: float, rig: Rig) -> float:
    """Return the strain energy of a hanging rope with tension T at its lower end [J]: ∫T²/(2·EA)
    ds.
    """
    top = T + rig.weight * rig.length
    return (top**3 - T**3) / (6.0 * rig.EA * rig.weight)


def come_to_rest(below: int) -> list[Finding]:
    """Test the upper part in water and current, until it hangs like a bare rope.

    What falls has its terminal speed by then: W + w·l = ½·ρ·(CdA + Ct·π·d·l)·v².
    """
    parts = Parts(settled(WET_WIRE), below)
    upper, lower = parts.upper, parts.lower
    parts.hold(round(SINK_S / upper.rig.step))
    sinking = float(lower.velocity[2, 0])
    pull = float(upper.hold(round((SETTLE_S - SINK_S) / upper.rig.step))[-1])
    fresh = settled(upper.rig)
    largest_m = float(np.abs(upper.position - fresh.position).max())
    return [
        off("in water, pull at the end against rest", pull, float(fresh.hold(1)[-1]), 0.1),
        limited("and its distance from the shape at rest, over the length",
                100.0 * largest_m / upper.length, 0.1),
        off("terminal speed of what falls", sinking, -terminal_speed(lower.length), 0.01),
        all_converged(upper.unconverged + lower.unconverged),
    ]  # fmt: skip


def terminal_speed(length: float) -> float:
    """Return the terminal velocity of the payload with this length of taut rope behind it [m/s]."""
    rig = WET_WIRE
    area = rig.area[2] + rig.drag[1] * math.pi * rig.diameter * length
    weight = rig.load_weight + rig.weight * length
    return math.sqrt(weight / (0.5 * rig.density * area))


def land(below: int) -> list[Finding]:
    """Test the lower part on a seabed 200 m below, whose reaction is its submerged weight."""
    rig = WET_WIRE
    scene = rig.scene()
    scene = replace(scene, effects=(*scene.effects[:-1], BED, scene.effects[-1]))
    bench = RigBench(rig, build(scene))
    bench.settle()
    parts = Parts(bench, below)
    parts.hold(round(SINK_S / rig.step))
    push = parts.push_of_bed()
    weight = rig.load_weight + rig.weight * parts.lower.length
    return [off("the seabed reaction on what has fallen against its weight", push, weight, 0.5)]


def cut_at_payload() -> list[Finding]:
    """Cut 20 t off 1,000 m of wire, at the payload."""
    return [*recoil(1), *fall(1), *come_to_rest(1)]


def cut_in_middle() -> list[Finding]:
    """Cut off the lower 500 m with 20 t."""
    return [*recoil(250), *fall(250), *come_to_rest(50), *land(50)]


REFERENCE = (
    "release wave: T/√(EA·m), momentum T·t, energy that only falls; what falls: momentum W·t, "
    "terminal speed, weight on the bed; the rope at rest"
)
CASES = (
    hard_case("cut_at_payload", "20 t cut off 1,000 m of wire", REFERENCE, cut_at_payload, 7.0,
              True),
    hard_case("cut_in_middle", "1,000 m of wire with 20 t cut at 500 m", REFERENCE, cut_in_middle,
              8.0),
)  # fmt: skip

"""Hard case: ropes crumpled at random and thrown into still water, whose energy may only fall."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from validation.case import Finding, limited, shown
from validation.hard_cases.limits import all_converged, hard_case
from validation.hard_cases.rigs import RigBench
from validation.rigs import WATER, Rig

THROWS, PARTS = 2000, 16


@dataclass(frozen=True)
class Throw:
    """Outcome of a throw: largest rise of energy between looks over all that there was."""

    rise: float
    unconverged: int


def drawn(random: np.random.Generator) -> Rig:
    """Return a rope and a payload that need not go together.

    Elements of 0.5 to 50 m, axial waves of 1 to 10 km/s (steel 5, HMPE 8), damping of 1 to 100 ms
    times EA, payloads of nothing to 500 t, steps of 5 to 20 ms.
    """

    def spread(low: float, high: float) -> float:
        return math.exp(random.uniform(math.log(low), math.log(high)))

    mass = spread(0.05, 50.0)
    load = random.integers(2) * spread(1.0, 5e5)
    volume = load * random.uniform(0.0, 0.9) / WATER
    EA = mass * spread(1e3, 1e4) ** 2
    elements = int(random.integers(3, 121))
    return Rig(
        length=elements * spread(0.5, 50.0),
        elements=elements,
        mass=mass,
        EA=EA,
        diameter=math.sqrt(4.0 * mass * random.uniform(0.1, 1.1) / (math.pi * WATER)),
        damping=EA * spread(1e-3, 0.1),
        load=load,
        volume=volume,
        added=(WATER * volume * random.uniform(0.0, 3.0),) * 3,
        area=(random.uniform(0.0, 5.0) * volume ** (2.0 / 3.0),) * 3,
        density=WATER,
        drag=(random.uniform(0.5, 2.0), random.uniform(0.005, 0.05)),
        step=float(random.choice([5e-3, 0.01, 0.02])),
    )


def is_resolved(rig: Rig) -> bool:
    """Return whether the elements are 5 m or longer."""
    return rig.length >= 5.0 * rig.elements


def throw(rig: Rig, random: np.random.Generator, size: float, parts: int = 1) -> Throw:
    """Throw a rope whose links have `size` times their length, and look 40 times.

    Five steps lie between two looks, each divided into `parts`.
    """
    # the energy of added mass is no function of the state; nor may the tolerance do work
    rig = replace(rig, added_mass=0.0, tolerance=1e-3, step=rig.step / parts)
    bench = RigBench(rig)
    links = random.normal(size=(3, rig.elements))
    links *= size * rig.length / rig.elements / np.linalg.norm(links, axis=0)
    bench.position[:] = 0.0
    bench.position[:, :-1] = np.cumsum(links[:, ::-1], axis=1)[:, ::-1]
    bench.find_acceleration()  # of rest: that of a stiff damper would be no state of a run
    bench.velocity[:, :-1] = random.normal(scale=2.0, size=(3, rig.elements))
    energies = [bench.energy()]
    for _ in range(40 * parts):
        pull = bench.hold(5)
        assert np.isfinite(pull).all()
        assert pull.min() >= 0.0
        energies.append(bench.energy())
    available = _motion(bench) + (rig.load_weight + abs(rig.weight) * rig.length) * rig.length
    return Throw(float(np.diff(energies).max()) / available, bench.unconverged)


def _motion(bench: RigBench) -> float:
    """Return ½·m·v² of a throw at 2 m/s rms in each direction [J]."""
    rig = bench.rig
    return 0.5 * (rig.mass * rig.length + rig.load + rig.added[2]) * 3.0 * 2.0**2


def thrown_ropes(throws: int = THROWS) -> list[Finding]:
    """Throw ropes drawn by seed; every tenth of those with short elements in small steps too."""
    resolved: list[Throw] = []
    short: list[Throw] = []
    small: list[Throw] = []
    for seed in range(throws):
        random = np.random.default_rng(seed)
        rig, size = drawn(random), random.uniform(0.05, 1.0)
        generator_state = random.bit_generator.state
        outcome = throw(rig, random, size)
        (resolved if is_resolved(rig) else short).append(outcome)
        if not is_resolved(rig) and (outcome.rise > 1e-9 or len(short) % 10 == 0):
            random.bit_generator.state = generator_state
            small.append(throw(rig, random, size, PARTS))

    def rise(group: list[Throw]) -> float:
        return 100.0 * max((max(result.rise, 0.0) for result in group), default=0.0)

    gained = sum(result.rise > 1e-9 for result in short)
    return [
        limited("elements of 5 m and more: rise of energy between looks over all that there was",
                rise(resolved), 1e-7),
        limited("shorter ones at a sixteenth of the step", rise(small), 1e-7),
        shown("shorter ones as they are", rise(short), "no theorem", "%"),
        shown(f"of {throws} throws, those that gained", gained, "", ""),
        all_converged(sum(result.unconverged for result in (*resolved, *short, *small))),
    ]  # fmt: skip


CASES = (
    hard_case("thrown_ropes", "2,000 ropes crumpled at random and thrown into water",
              "energy that only falls", thrown_ropes, 45.0),
)  # fmt: skip

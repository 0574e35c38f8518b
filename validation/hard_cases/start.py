"""Hard cases of the start: far from equilibrium, all slack, and no tension anywhere."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from validation.case import Finding, limited
from validation.hard_cases.limits import all_converged, hard_case, off
from validation.hard_cases.rigs import RigBench
from validation.rigs import WATER, Rig
from validation.state_bench import Vector

HEAVY = Rig(length=200.0, elements=50, density=WATER, volume=2.0)
WET = replace(HEAVY, added=(2050.0,) * 3, area=(4.0,) * 3, drag=(1.2, 0.02), damping=65e4)
LIGHT = Rig(
    length=100.0, elements=20, mass=1e-2, EA=6.9e6, diameter=1e-3, load=5e3, step=5e-3,
    damping=1e4,
)  # fmt: skip


def place(rig: Rig, shape: Vector) -> RigBench:
    """Return the fixture at rest in a given shape, (3, elements + 1) from the lower end up."""
    bench = RigBench(rig)
    bench.position[:] = shape
    bench.velocity[:] = 0.0
    return bench


def below_hang_off(rig: Rig) -> Vector:
    """Return the unstretched distance of the nodes from the hang-off [m], lower end first."""
    return np.linspace(rig.length, 0.0, rig.elements + 1)


def horizontal(rig: Rig) -> Vector:
    """Return a horizontal, unstretched shape."""
    distance = below_hang_off(rig)
    return np.stack([distance, np.zeros_like(distance), np.zeros_like(distance)])


def coiled(rig: Rig) -> Vector:
    """Return a helix of 3 m radius with chords of 0.8 elements and a pitch of 0.2 m per element."""
    turn = np.arange(rig.elements, -1, -1.0)
    chord = 0.8 * rig.length / rig.elements
    angle = 2.0 * math.asin(min(0.5 * math.sqrt(chord**2 - 0.04) / 3.0, 1.0)) * turn
    return np.stack([3.0 * (np.cos(angle) - 1.0), 3.0 * np.sin(angle), -0.2 * turn])


def folded(rig: Rig) -> Vector:
    """Return a slack zigzag of a few centimetres that hangs to half its length."""
    distance = below_hang_off(rig)
    side = np.where(np.arange(len(distance)) % 2 == 0, 0.0, 0.03)
    side[-1] = 0.0
    return np.stack([side, np.zeros_like(distance), -0.5 * distance])


def gathered(rig: Rig) -> Vector:
    """Return all nodes in one point."""
    return np.zeros((3, rig.elements + 1))


def finds_rest(shape: Vector, name: str) -> list[Finding]:
    """Compare the static equilibrium from this shape with the closed form."""
    bench = place(HEAVY, shape)
    bench.settle()
    depth, offset_m = -float(bench.position[2, 0]), float(np.abs(bench.position[:2]).max())
    return [
        off(f"{name}: depth at rest against L + (W + w·L/2)·L/EA", depth, HEAVY.hanging_depth,
            1e-7),
        limited(f"{name}: distance from the plumb line over the length",
                100.0 * offset_m / HEAVY.length, 1e-6),
    ]  # fmt: skip


def energy_falls(shape: Vector, name: str) -> list[Finding]:
    """Release 20 t on 200 m of wire in still water: the energy may not increase."""
    bench = place(WET, shape)
    bench.find_acceleration()
    energies = [bench.energy()]
    for _ in range(400):
        bench.hold(5)
        energies.append(bench.energy())
    rise = float(np.diff(energies).max()) / (WET.load_weight * WET.length)
    return [
        limited(f"{name}: largest rise of energy in water over W·L", 100.0 * rise, 1e-6),
        all_converged(bench.unconverged),
    ]


def pendulum_pull(rig: Rig, seconds: float) -> Vector:
    """Return tension over W of a mass released from the horizontal, at the steps: 3·cos θ.

    θ'' = -(g/L)·sin θ by the fourth-order Runge-Kutta method.
    """
    h, rate = rig.step, -rig.gravity / rig.length
    y, pulls = np.array([0.5 * math.pi, 0.0]), []

    def slope(state: Vector) -> Vector:
        return np.array([state[1], rate * math.sin(state[0])])

    for _ in range(round(seconds / h)):
        k1 = slope(y)
        k2 = slope(y + 0.5 * h * k1)
        k3 = slope(y + 0.5 * h * k2)
        y = y + h / 6.0 * (k1 + 2.0 * k2 + 2.0 * k3 + slope(y + h * k3))
        pulls.append(3.0 * math.cos(y[0]))
    return np.array(pulls)


def start_horizontal() -> list[Finding]:
    """Release 5 t on a light, stiff rope from the horizontal: 3·W at the lowest point."""
    rig = replace(LIGHT, EA=6.9e8)
    bench = place(rig, horizontal(rig))
    bench.find_acceleration()
    pulls = bench.hold(round(10.0 / rig.step)) / rig.load_weight
    expected = pendulum_pull(rig, 10.0)
    lowest = int(np.argmax(expected))
    window = slice(lowest - 150, lowest + 150)
    mean, exact = float(pulls[window].mean()), float(expected[window].mean())
    return [
        off("mean pull of 1.5 s at the lowest point, 2.9 W, against a pendulum", mean, exact, 0.5),
        all_converged(bench.unconverged),
        *energy_falls(horizontal(WET), "straight horizontal"),
        *finds_rest(horizontal(HEAVY), "straight horizontal"),
    ]


def caught(shape: Vector) -> list[Finding]:
    """Drop 5 t from a slack shape: W + √(W² + K·M·v²), v² = 2·g·h, as the rope becomes taut.

    The rope weighs 1 kg, so it takes no part.
    """
    bench = place(LIGHT, shape)
    start = bench.energy()
    bench.find_acceleration()
    drop = LIGHT.length - math.sqrt(float((shape[:, 0] ** 2).sum()))
    seconds = math.sqrt(2.0 * drop / LIGHT.gravity) + 1.0
    pulls, largest_gain = [], -np.inf
    for _ in range(round(seconds / LIGHT.step)):
        pulls.append(float(bench.hold(1)[0]))
        largest_gain = max(largest_gain, bench.energy() - start)
    W, M = LIGHT.load_weight, LIGHT.load
    stiffness = LIGHT.EA / LIGHT.length
    expected = W + math.sqrt(W * W + stiffness * M * 2.0 * LIGHT.gravity * drop)
    return [
        off("peak when caught against W + √(W² + K·M·v²)", max(pulls), expected, 1.0),
        limited("energy gained over W·L", 100.0 * largest_gain / (W * LIGHT.length), 1e-6),
        all_converged(bench.unconverged),
    ]


def start_coiled() -> list[Finding]:
    """Start from a coil under the hang-off."""
    return [
        *caught(coiled(LIGHT)),
        *energy_falls(coiled(WET), "coiled"),
        *finds_rest(coiled(HEAVY), "coiled"),
    ]


def start_slack() -> list[Finding]:
    """Start with every element slack."""
    return [
        *caught(folded(LIGHT)),
        *energy_falls(folded(WET), "all slack"),
        *energy_falls(gathered(WET), "all nodes in one point"),
        *finds_rest(folded(HEAVY), "all slack"),
        *finds_rest(gathered(HEAVY), "all nodes in one point"),
    ]


def neutral_slack() -> list[Finding]:
    """Start a neutrally buoyant rope, slack everywhere: it must not move."""
    diameter = 0.04
    rig = Rig(
        length=200.0, elements=40, diameter=diameter, mass=WATER * 0.25 * math.pi * diameter**2,
        density=WATER, load=0.0, drag=(1.2, 0.02), added_mass=1.0,
    )  # fmt: skip
    shape = folded(rig)
    bench = place(rig, shape)
    pull = float(bench.hold(6000).max())
    drift = float(np.abs(bench.position - shape).max())
    glide = place(replace(rig, drag=(0.0, 0.0), added_mass=0.0), shape)
    glide.velocity[0, :-1] = 0.5
    glide.hold(600)  # 3 m: the top element, 5 m from 2.5 m apart, is slack until 4.3 m
    way = float(np.abs(glide.position - shape - [[3.0], [0.0], [0.0]])[:, :-1].max())
    flow = place(replace(rig, current=((0.0, (0.0, 0.5)),)), shape)
    flow.find_acceleration()
    flow.hold(400)
    # k·(U - v)²= m·v', m with added mass: v = U·x/(1 + x), x = U·k·t/m
    mass = 2.0 * rig.mass
    k = 0.5 * WATER * diameter * rig.drag[0]
    x = 0.5 * k * 4.0 / mass
    expected = 0.5 * 4.0 - mass / k * math.log1p(x)
    carried = flow.position[1, :-5]  # the last ones lean against the hang-off
    return [
        limited("drift in a minute of still water", drift, 1e-9, "m"),
        limited("pull in it", pull, 1e-6, "N"),
        limited("distance from 3 m of free glide", way, 1e-9, "m"),
        off("way in a current of 0.5 m/s against U·t - (m/k)·ln(1 + U·k·t/m)",
            float(carried.max()), expected, 0.1),
        off("and of the node that goes least", float(carried.min()), expected, 0.1),
        all_converged(bench.unconverged + glide.unconverged + flow.unconverged),
    ]  # fmt: skip


FALL = "energy that only falls; closed form at rest"
CASES = (
    hard_case("start_horizontal", "started straight out to the side",
              f"pendulum from the horizontal, 3·W; {FALL}", start_horizontal, 1.0, True),
    hard_case("start_coiled", "started in a coil of 3 m",
              f"free fall into W + √(W² + K·M·v²); {FALL}", start_coiled, 1.0, True),
    hard_case("start_slack", "started with every element slack, and with all nodes in one point",
              f"free fall into W + √(W² + K·M·v²); {FALL}", start_slack, 1.0, True),
    hard_case("neutral_slack", "a neutrally buoyant slack rope without tension anywhere",
              "nothing moves; free glide; drag alone in closed form", neutral_slack, 1.0, True),
)  # fmt: skip

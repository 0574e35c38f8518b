"""Multi-line systems built from rigs, with ends at given points."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from rigs import Rig

from rope_twin.core import state as rows
from rope_twin.core.joined import joints as ties
from rope_twin.core.joined.joints import LOOSE, System, new_system
from rope_twin.core.joined.statics import solve_joined_statics
from rope_twin.core.state import Floats
from rope_twin.core.step import advance_joined
from rope_twin.effects.wake_oscillator import WakeOscillatorParams
from rope_twin.scene.rope_model import build

Vector = NDArray[np.float64]
Point = tuple[float, float, float]
STIFF = Rig(length=20.0, elements=10, mass=1.0, EA=1e8, diameter=0.03, damping=1e4, load=0.0)
LIGHT = replace(STIFF, mass=1e-3, EA=1e10)  # so that closed forms of weightless legs hold
HEAVY = 1e4  # kg


@dataclass(frozen=True, kw_only=True)
class Line:
    """A rope between two points, initially straight, and the joints at its ends."""

    rig: Rig
    low: Point
    high: Point
    lower: int = LOOSE
    upper: int = LOOSE
    held: bool = False  # a loose lower end that is fixed
    more: tuple[Any, ...] = ()  # parameters of further effects

    def rope(self) -> rows.Rope:
        """Build the rope; the payload at its lower end is the rig's."""
        scene = self.rig.scene()
        rope = build(replace(scene, effects=(*scene.effects, *self.more)))
        n = int(rope.state.counts[rows.ELEMENTS])
        share = rope.state.s[: n + 1] / rope.state.s[n]
        low, high = np.array([self.low, self.high])
        rope.state.nodes[:3, : n + 1] = low[:, None] + (high - low)[:, None] * share
        first = 1 if self.held else 0
        return rope._replace(model=rope.model._replace(first_free=first))


class JointBench:
    """A multi-line system that steps; hang-offs are fixed unless a motion is given."""

    def __init__(self, lines: Sequence[Line], tied: Floats | None = None) -> None:
        ropes = tuple(line.rope() for line in lines)
        lower, upper = [line.lower for line in lines], [line.upper for line in lines]
        self.system: System = new_system(ropes, lower, upper, tied)
        self.lines = lines
        self.line_out = np.array([line.rig.length for line in lines])
        self.step = lines[0].rig.step
        self.time = 0.0

    def nodes(self, r: int, first: int = rows.POSITION) -> Vector:
        """View of three rows of rope r's nodes, lower end first."""
        state = self.system.ropes[r].state
        return state.nodes[first : first + 3, : int(state.counts[rows.ELEMENTS]) + 1]

    def tension(self, r: int) -> Vector:
        """Tension of rope r's elements after the last step [N]."""
        rope = self.system.ropes[r]
        return rope.work[rows.TENSION, : int(rope.state.counts[rows.ELEMENTS])]

    @property
    def joints(self) -> Vector:
        """View of the joints' positions, (3, joints)."""
        return self.system.joints.nodes[:3]

    def still(self, steps: int) -> rows.Boundary:
        """Return boundary values of hang-offs at rest."""
        value = np.zeros((len(self.lines), steps + 1, rows.MOTIONS))
        for r, line in enumerate(self.lines):
            value[r, :, :3], value[r, :, rows.LINE] = line.high, self.line_out[r]
        return rows.Boundary(value, np.zeros_like(value))

    def follow(self, boundary: rows.Boundary) -> Vector:
        """Advance with prescribed motion; return the ropes' pulls, (ropes, steps, PULL_COLUMNS)."""
        steps = boundary.value.shape[1] - 1
        pull = np.zeros((len(self.lines), steps, rows.PULL_COLUMNS))
        done = advance_joined(self.system, boundary, pull, self.time, steps)
        assert done == steps, f"step {done + 1} was not finite"
        self.time += steps * self.step
        self.line_out = boundary.value[:, -1, rows.LINE].copy()
        return pull

    def hold(self, steps: int) -> Vector:
        """Advance with hang-offs at rest."""
        return self.follow(self.still(steps))

    @property
    def health(self) -> rows.Ints:
        """The solver's counts."""
        return self.system.ropes[0].state.health

    def pull_of_tie(self, k: int) -> float:
        """Pull of tie k at the end of the last step [N]; negative: a push."""
        return float(self.system.joints.ties[ties.PULL, k])


def legs(a: Rig, b: Rig, left: Point, right: Point, **below: Any) -> list[Line]:
    """Return two ropes from hang-offs to joint 0, and a third 5 m long below it with the load."""
    meet = (0.5 * (left[0] + right[0]), 0.0, -5.0)
    under = (meet[0], meet[1], meet[2] - 5.0)
    sling = replace(STIFF, length=5.0, elements=3, load=HEAVY, **below)
    return [
        Line(rig=a, low=meet, high=left, lower=0),
        Line(rig=b, low=meet, high=right, lower=0),
        Line(rig=sling, low=under, high=meet, upper=0),
    ]


def rest(bench: JointBench) -> None:
    """Bring a bench to static equilibrium."""
    end = solve_joined_statics(bench.system, bench.still(0).value[:, 0])
    assert end.found
    assert end.left_m < 1e-9
    bench.hold(1)


def tie(
    first: int, *, second: int = ties.ANCHORED, anchor: Point = (0.0, 0.0, 0.0),
    force: float = 0.0, length: float = 0.0, stiffness: float = 0.0, damping: float = 0.0,
    pushes: bool = False,
) -> Floats:  # fmt: skip
    """Return one tie, (TIE_ROWS, 1)."""
    column = np.zeros((ties.TIE_ROWS, 1))
    column[: ties.TOWARDS, 0] = (
        first, second, *anchor, force, length, stiffness, damping, -np.inf if pushes else 0.0,
    )  # fmt: skip
    return column


def cut(rig: Rig, cuts: tuple[int, int], top: Point) -> list[Line]:
    """Return a hanging rope of equal elements in three parts, with joints at the nodes `cuts`."""
    h = rig.length / rig.elements
    x, y, z = top
    borders = (0, *cuts, rig.elements)
    points = [(x, y, z - rig.length + k * h) for k in borders]
    lines = []
    for part in (2, 1, 0):
        count = borders[part + 1] - borders[part]
        part_rig = replace(
            rig, length=count * h, elements=count, load=rig.load if part == 0 else 0.0
        )
        lines.append(
            Line(
                rig=part_rig,
                low=points[part],
                high=points[part + 1],
                lower=2 - part if part else LOOSE,
                upper=1 - part if part < 2 else LOOSE,
            )
        )
    return lines


def triangle() -> Vector:
    """Run two hang-offs, one paying out, a load below their joint, a tether and wakes.

    Pulls of the three ropes, position of joint and load, elements of the second rope, step by step.
    """
    more = (WakeOscillatorParams(start_per_s=5.0),)
    leg = Rig(
        length=12.0, elements=4, mass=2.9, EA=2e6, diameter=0.06, damping=2e4, load=0.0,
        added_mass=1.0, density=1025.0, drag=(1.2, 0.02), step=0.05, tolerance=1e-3,
        current=((0.0, (0.8, 0.1)), (-30.0, (0.3, 0.5))),
    )  # fmt: skip
    load = replace(leg, length=9.0, elements=3, load=600.0, volume=0.1, added=(150.0, 200.0, 260.0))
    meet = (0.0, 1.0, -10.0)
    lines = [
        Line(rig=leg, low=meet, high=(-6.0, 0.0, 0.0), lower=0, more=more),
        Line(rig=leg, low=meet, high=(6.0, 0.0, 0.0), lower=0, more=more),
        Line(rig=load, low=(0.0, 1.0, -19.0), high=meet, upper=0, more=more),
    ]
    bench = JointBench(
        lines, tie(0, anchor=(0.0, 40.0, -5.0), force=300.0, stiffness=10.0, damping=50.0)
    )
    motion = bench.still(80)
    t = bench.step * np.arange(81)
    motion.value[0, :, 2] += 1.5 * np.sin(t) ** 2
    motion.rate[0, :, 2] = 1.5 * np.sin(2.0 * t)
    motion.value[1, :, rows.LINE] += 0.15 * t * t
    motion.rate[1, :, rows.LINE] = 0.3 * t
    results = []
    for k in range(80):
        pulls = bench.follow(
            rows.Boundary(*(np.ascontiguousarray(table[:, k : k + 2]) for table in motion))
        )
        points = [*bench.joints[:, 0], *bench.nodes(2)[:, 0]]
        results.append([*pulls[:, 0, rows.PULL], *points, bench.nodes(1).shape[1] - 1])
    return np.array(results)


def bent_ladder(steps: int = 25) -> Vector:
    """Run ropes with bending stiffness and every kind of end, one between two joints.

    Pulls of the four ropes, positions of both joints and of the load, step by step.
    """
    leg = Rig(
        length=6.0, elements=4, mass=4.0, EA=2e6, diameter=0.06, damping=2e4, load=0.0,
        density=1025.0, drag=(1.2, 0.02), added_mass=1.0, EI=2e3, clamp=(0.5, 0.0, -1.0), step=0.02,
        tolerance=1e-3, current=((0.0, (0.8, 0.1)), (-30.0, (0.3, 0.5))),
    )  # fmt: skip
    left, right, foot = (-3.0, 0.0, -5.0), (3.0, 1.0, -5.0), (3.0, 1.0, -9.0)
    hinged = replace(leg, clamp=None)
    load = replace(hinged, length=4.0, elements=3, load=300.0, volume=0.1)
    lines = [
        Line(rig=leg, low=left, high=(-6.0, 0.0, 0.0), lower=0),
        Line(rig=hinged, low=right, high=(6.0, 0.0, 0.0), lower=1),
        Line(rig=replace(hinged, EI=5e3), low=left, high=right, lower=0, upper=1),
        Line(rig=load, low=foot, high=right, upper=1),
    ]
    bench, results = JointBench(lines), []
    motion = bench.still(steps)
    t = bench.step * np.arange(steps + 1)
    motion.value[0, :, 2] += 0.5 * np.sin(3.0 * t) ** 2
    motion.rate[0, :, 2] = 1.5 * np.sin(6.0 * t)
    for k in range(steps):
        pulls = bench.follow(
            rows.Boundary(*(np.ascontiguousarray(table[:, k : k + 2]) for table in motion))
        )
        results.append([*pulls[:, 0, rows.PULL], *bench.joints.T.ravel(), *bench.nodes(3)[:, 0]])
    return np.array(results)

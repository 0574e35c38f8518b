"""Systems whose rope runs over a sheave: an Atwood machine and a loop between two winches."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from joint_rigs import JointBench, Line, Vector, rest
from rigs import Rig

from rope_twin.core import state as rows
from rope_twin.core.joined.joints import Wheel, reeve
from rope_twin.core.joined.stack import FLOW_COLUMN, WHEEL
from rope_twin.scene.schema import Winch

G = 9.80665
FIXED = 1e30  # kg: what nothing moves
DRUM = Winch(
    speed_limit_m_per_s=5.0, acceleration_limit_m_per_s2=1.0, min_line_out_m=5.0,
    max_line_out_m=400.0,
)  # fmt: skip


def let_run(bench: JointBench, inertia: float = 0.0) -> None:
    """Release the wheel, which was held for the static equilibrium."""
    sheaves = bench.system.sheaves
    assert sheaves is not None
    sheaves.figures[WHEEL] = inertia


def flow(bench: JointBench) -> Vector:
    """Return the flow over the first sheave, its rate and acceleration."""
    sheaves = bench.system.sheaves
    assert sheaves is not None
    column = int(sheaves.figures[FLOW_COLUMN, 0])
    nodes = bench.system.joints.nodes
    return nodes[[rows.POSITION, rows.VELOCITY, rows.ACCELERATION], column].copy()


def line(bench: JointBench, r: int) -> float:
    """Return the unstretched length of rope r [m]."""
    state = bench.system.ropes[r].state
    return float(state.s[state.counts[rows.ELEMENTS]])


def atwood(
    left: float = 500.0, right: float = 520.0, *, length: float = 20.0, mass: float = 1.0,
    EA: float = 1e8, step: float = 0.01, friction: float = 0.0, damping: float = 1e4,
) -> JointBench:  # fmt: skip
    """Return two loads [kg] on one rope over a fixed sheave, at rest, the wheel held."""
    rig = Rig(
        length=length, elements=20, mass=mass, EA=EA, diameter=0.03, damping=damping, load=left,
        winch=DRUM, step=step, tolerance=1e-2,
    )  # fmt: skip
    top, low = (0.0, 0.0, 0.0), (0.0, 0.0, -length)
    bench = JointBench(
        [
            Line(rig=rig, low=low, high=top, upper=0),
            Line(rig=replace(rig, load=right), low=low, high=top, upper=0),
        ]
    )
    wheel = Wheel(0, 0, 1, mass=FIXED, inertia=FIXED, friction=friction)
    bench.system = reeve(bench.system, [wheel])
    rest(bench)
    return bench


def loop(*, wheel: float = 3000.0, step: float = 0.01, gap: float = 10.0) -> JointBench:
    """Return `laid_loop` at rest, the wheel free."""
    bench = laid_loop(wheel, step, gap)
    rest(bench)
    let_run(bench)
    return bench


def laid_loop(
    wheel: float = 3000.0, step: float = 0.01, gap: float = 10.0, elements: int = 10
) -> JointBench:
    """Return 400 m of steel wire from winch to sheave to winch with two skips, the wheel held.

    Ropes 0 and 3 hang from the winches, 1 and 2 end at the sheave, which its weight pulls down.
    """
    rig = Rig(
        length=100.0, elements=elements, mass=6.4, EA=65e6, diameter=0.04, damping=0.65e6, load=0.0,
        winch=DRUM, step=step, tolerance=1.0,
    )  # fmt: skip
    loaded = replace(rig, load=50.0)
    x = 0.5 * gap
    left, right, bottom = (-x, 0.0, -100.0), (x, 0.0, -100.0), (0.0, 0.0, -200.0)
    bench = JointBench(
        [
            Line(rig=loaded, low=left, high=(-x, 0.0, 0.0), lower=0),
            Line(rig=rig, low=left, high=bottom, lower=0, upper=1),
            Line(rig=rig, low=right, high=bottom, lower=2, upper=1),
            Line(rig=loaded, low=right, high=(x, 0.0, 0.0), lower=2),
        ]
    )
    held = Wheel(1, 1, 2, mass=wheel, weight=wheel * G, inertia=FIXED)
    bench.system = reeve(bench.system, [held])
    return bench


def circulate(bench: JointBench, speed: float, seconds: float, ramp: float = 4.0) -> Vector:
    """Pay out rope 0 and haul in rope 3 at this speed; return the ropes' pulls, (4, steps)."""
    steps = round(seconds / bench.step)
    motion = bench.still(steps)
    t = bench.step * np.arange(steps + 1)
    u = np.minimum(t / ramp, 1.0)
    travel = ramp * (u**3 - 0.5 * u**4) + np.maximum(t - ramp, 0.0)
    for r, sense in ((0, speed), (3, -speed)):
        motion.value[r, :, rows.LINE] += sense * travel
        motion.rate[r, :, rows.LINE] = sense * u * u * (3.0 - 2.0 * u)
    pulls: Vector = bench.follow(motion)[:, :, rows.PULL]
    return pulls


def noise(pull: Vector) -> float:
    """Return the largest deviation from a quartic over time, over the mean."""
    t = np.linspace(-1.0, 1.0, len(pull))
    smooth = np.polynomial.Polynomial.fit(t, pull, 4)(t)
    return float(np.abs(pull - smooth).max() / pull.mean())

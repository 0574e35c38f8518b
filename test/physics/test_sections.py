"""A rope of two sections whose junction passes the sheave, out and in again."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import pytest
from payout_rigs import HMPE, KELVIN_VOIGT_S, SEA, STEEL, WINCH
from rigs import Bench, Rig, march, sine, still
from section_rigs import hanging, joined

from rope_twin import Snapshot, Twin
from rope_twin.core import state as rows

JUMP = 1e-4  # of the mean tension
JOINT = 213.3  # m from the lower end: no multiple of the element length
SPEED = 0.5  # m/s
PAIRS = pytest.mark.parametrize(("low", "high"), [(HMPE, STEEL), (STEEL, HMPE)])


def short(rig: Rig, line_out: float) -> Rig:
    """The rope of the payout study with less of it out, on elements of 10 m."""
    return replace(
        rig, length=line_out, elements=round(line_out / 10.0), damping=65e6 * KELVIN_VOIGT_S
    )


def is_a_node(snapshot: Snapshot) -> bool:
    """Return whether the joint is a node below the hang-off (arc lengths count from there)."""
    from_below = snapshot.line_out_m - snapshot.arc_length_m[1:]
    return bool(np.abs(from_below - JOINT).min() < 1e-9)


def jump(snapshots: list[Snapshot], at: int) -> float:
    """Largest second difference of the top tension in the 11 samples from an event on [N]."""
    tension = np.array([snapshot.tension_top_n for snapshot in snapshots])
    return float(np.abs(np.diff(tension, 2))[at - 1 : at + 10].max())


@PAIRS
def test_a_section_junction_through_the_sheave(low: Rig, high: Rig) -> None:
    """It becomes a node, stays one, and goes; the tension follows the weight that is out.

    The rope leaves the sheave with V·(1 + strain), and the strain changes there: a wave of Z·V·Δε
    with Z = √(EA·m) of the rope below is no error. Beyond it 0.01 % of the mean at most.
    """
    twin = Twin(joined(short(low, 205.0), high, JOINT))
    assert not is_a_node(twin.snapshot())
    speeds = [(1.0, SPEED), (41.0, -SPEED), (81.0, 0.0)]
    snapshots = list(march(twin, still, 90.0, speeds=speeds))
    out = np.flatnonzero(np.diff([is_a_node(snapshot) for snapshot in snapshots])) + 1
    assert len(out) == 2, "one event makes it a node, one takes it away"
    mean = np.mean([snapshot.tension_top_n for snapshot in snapshots])
    wave = np.sqrt(low.EA * low.mass) * SPEED * mean * abs(1.0 / low.EA - 1.0 / high.EA)
    for at in out:
        assert abs(snapshots[at].line_out_m - JOINT) < 0.05
        assert jump(snapshots, at) <= JUMP * mean + wave
    assert snapshots[-1].solver.unconverged_substeps == 0


@PAIRS
def test_static_tension_and_depth_of_two_sections(low: Rig, high: Rig) -> None:
    """Paid out past the joint and at rest: tension and depth of two ropes, each with its EA."""
    rig = replace(short(low, 205.0), damping=20e6)
    twin = Twin(joined(rig, high, JOINT))
    *_, snapshot = march(twin, still, 200.0, every=500, speeds=[(0.0, 1.0), (40.0, 0.0)])
    assert is_a_node(snapshot)
    top, depth = hanging(low, high, JOINT, snapshot.line_out_m)
    assert snapshot.tension_top_n == pytest.approx(top, rel=1e-9)
    assert -snapshot.payload_position_m[2] == pytest.approx(depth, abs=1e-8)


@dataclass(frozen=True)
class Carried:
    """Loads of the rope before and after an event at the joint."""

    mass: float
    momentum: float


def carried(bench: Bench, V: float) -> Carried:
    """∫m ds and ∫m·v_z ds of the material; at the sheave v = v_n - V·dx/ds."""
    s = bench.rope.state.s[: bench.n + 1]
    rest, v = np.diff(s), bench.velocity[2].copy()
    v[-1] -= V * (bench.position[2, -1] - bench.position[2, -2]) / rest[-1]
    sections = bench.rope.sections
    mass = sections[rows.PER_METRE, (s[:-1] >= JOINT - 1e-9).astype(int)] * rest
    return Carried(float(mass.sum()), float((0.5 * (v[1:] + v[:-1]) * mass).sum()))


@PAIRS
def test_mass_and_momentum_at_the_section_junction(low: Rig, high: Rig) -> None:
    """The step in which the joint becomes a node, with and without that.

    Mass: the centimetres above the joint become of their own kind. Momentum: beyond that what the
    wave at the joint carries, Z·V·Δε over a step.
    """
    bench = Bench(joined(short(low, 210.0), high, JOINT))
    step = bench.rope.model.step
    motion = np.zeros((2, rows.MOTIONS))
    rate = motion.copy()
    line, n = 210.0, bench.n
    while bench.n == n:
        kept = bench.rope.state.copy()
        motion[:, rows.LINE], rate[:, rows.LINE] = (line, line + SPEED * step), SPEED
        bench.follow(rows.Boundary(motion, rate))
        line += SPEED * step
    after = carried(bench, SPEED)
    bench.rope = bench.rope._replace(
        state=kept, sections=np.where(np.isinf(bench.rope.sections), np.inf, bench.rope.sections)
    )
    bench.rope.sections[rows.END, 0] = 1e4  # now the joint is not there
    bench.follow(rows.Boundary(motion, rate))
    assert bench.n == n
    before = carried(bench, SPEED)
    above = line - JOINT
    assert 0.0 < above < 0.05
    assert after.mass - before.mass == pytest.approx((high.mass - low.mass) * above, abs=1e-9)
    change = abs(after.momentum - before.momentum - (low.mass - high.mass) * above * SPEED)
    tension = low.load_weight + low.weight * JOINT
    wave = np.sqrt(low.EA * low.mass) * SPEED * tension * abs(1.0 / low.EA - 1.0 / high.EA)
    assert abs(before.momentum) > 50.0
    assert change < wave * step


def test_hauling_in_to_two_metres_and_paying_out() -> None:
    """Under heave, past the joint: nearly the payload's weight, then what a fresh rope shows."""
    winch = replace(WINCH, min_line_out_m=2.0)
    rig = replace(SEA, length=40.0, elements=8, damping=SEA.EA * KELVIN_VOIGT_S, winch=winch)
    twin = Twin(joined(rig, replace(HMPE, diameter=0.08), 20.0))
    speeds = [(0.0, -1.0), (50.0, 1.0), (80.0, 0.0)]
    snapshots = list(march(twin, sine(0.3, 8.0), 95.0, every=5, speeds=speeds))
    shortest = min(snapshots, key=lambda snapshot: snapshot.line_out_m)
    assert 2.0 - 1e-9 <= shortest.line_out_m < 2.02
    assert len(shortest.element_tension_n) == 2
    assert max(abs(snapshot.tension_top_n / SEA.load_weight - 1.0) for snapshot in snapshots) < 0.2
    last = snapshots[-1]
    assert last.line_out_m > 28.0
    assert last.solver.unconverged_substeps == 0
    assert np.abs(last.line_out_m - last.arc_length_m - 20.0).min() < 1e-9

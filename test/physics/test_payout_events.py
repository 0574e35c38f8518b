"""Splits and merges at the sheave: no jump in tension, momentum or mass."""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import product

import numpy as np
import pytest
from payout_rigs import HMPE, HMPE_SEA, KELVIN_VOIGT_S, SEA, STEEL
from rigs import Bench, Rig, Vector, march, sine, still

from rope_twin import Snapshot
from rope_twin.core import state as rows

JUMP = 1e-4  # of the mean tension


def events_and_jumps(snapshots: list[Snapshot]) -> tuple[int, float]:
    """Number of splits and merges, and the largest second difference near one, over the mean.

    The measure: max |F(k+1) - 2·F(k) + F(k-1)| over the 11 samples from an event on.
    """
    tension = np.array([s.tension_top_n for s in snapshots])
    bend = np.abs(np.diff(tension, 2)) / tension.mean()  # bend[k] is centred on sample k + 1
    count = np.array([s.solver.splits + s.solver.merges for s in snapshots])
    events = np.flatnonzero(np.diff(count)) + 1
    return len(events), max(float(bend[k - 1 : k + 10].max()) for k in events if k > 1)


ALWAYS = [(STEEL, 0.0, 10.0), (STEEL, 1.5, 30.0), (HMPE, 1.5, 2.0), (HMPE, 0.0, 30.0)]
EVENTS = [
    pytest.param(*case, marks=[] if case in ALWAYS else pytest.mark.long)
    for case in product((STEEL, HMPE), (0.0, 1.5), (2.0, 10.0, 30.0))
]


@pytest.mark.parametrize(("rope", "heave", "element"), EVENTS)
def test_no_tension_jump_at_splits_and_merges(rope: Rig, heave: float, element: float) -> None:
    """±1 m/s, elements of 2, 10 and 30 m: at most 0.01 % of the mean."""
    rig = replace(rope, elements=round(rope.length / element), damping=rope.EA * KELVIN_VOIGT_S)
    assert_smooth(rig, heave, 2 if element > 20.0 else 5)


@pytest.mark.parametrize(
    ("rope", "element"),
    [
        (SEA, 10.0),
        pytest.param(HMPE_SEA, 10.0, marks=pytest.mark.long),
        pytest.param(HMPE_SEA, 30.0, marks=pytest.mark.long),
    ],
)
def test_no_tension_jump_at_splits_and_merges_in_a_current(rope: Rig, element: float) -> None:
    """Test across a current of 1 m/s, where a bent pair is longer than its chord.

    Without the length offsets 30 m of HMPE jump by 0.8 %.
    """
    rig = replace(rope, elements=round(rope.length / element), damping=rope.EA * KELVIN_VOIGT_S)
    assert_smooth(rig, 1.0, 2)


def assert_smooth(rig: Rig, heave: float, least_events: int) -> None:
    """Pay out, haul in, and check the jump at each event."""
    half = 38.0 if rig.length > 5.0 * rig.elements else 20.0
    speeds = [(2.0, 1.0), (2.0 + half, -1.0)]
    snapshots = march(rig.twin(), sine(heave, 8.0), 2.0 * half - 1.0, speeds=speeds)
    events, jump = events_and_jumps(list(snapshots))
    assert events >= least_events
    assert jump <= JUMP


def test_depth_after_280_splits() -> None:
    """200 m to 3,000 m at 2 m/s; then the payload hangs where the closed form says.

    Depth L + (W + w·L/2)·L/EA: the offsets of 280 events have left nothing behind.
    """
    rig = replace(STEEL, length=200.0, elements=20, damping=7e6, step=0.02)
    twin = rig.twin()
    *_, snapshot = march(twin, still, 1410.0, every=500, speeds=[(0.0, 2.0)])
    assert snapshot.line_out_m == pytest.approx(3000.0, abs=0.01)
    assert snapshot.solver.splits == 280
    *_, snapshot = march(twin, still, 400.0, every=500)
    L = snapshot.line_out_m
    depth = L + (rig.load_weight + 0.5 * rig.weight * L) * L / rig.EA
    assert -snapshot.payload_position_m[2] == pytest.approx(depth, abs=1e-8)
    assert snapshot.tension_top_n == pytest.approx(rig.load_weight + rig.weight * L, rel=1e-9)


def test_payout_conserves_rope_length() -> None:
    """Rest lengths sum to the line out; only the top element differs from the nominal length."""
    rig = replace(SEA, length=200.0, elements=20)
    counts = set()
    speeds = [(0.0, 1.0), (60.0, -1.5)]
    for snapshot in march(rig.twin(), sine(1.0, 8.0), 120.0, every=7, speeds=speeds):
        rest = np.diff(snapshot.arc_length_m)
        assert rest.sum() == pytest.approx(snapshot.line_out_m, rel=1e-14)
        assert rest[1:] == pytest.approx(10.0, abs=1e-10)
        assert 0.0 < rest[0] <= 15.0 + 1.5 * rig.step * 7
        counts.add(len(rest))
    assert len(counts) > 5


@dataclass(frozen=True)
class Event:
    """One step, with and without its split or merge."""

    before: Vector  # momentum of the rope [N·s], (3,)
    after: Vector


def momentum(bench: Bench, V: float) -> Vector:
    """∫ m·v ds of the material, linear in each element; at the sheave v = v_n - V·dx/ds."""
    rest = np.diff(bench.rope.state.s[: bench.n + 1])
    v = bench.velocity.copy()
    v[:, -1] -= V * (bench.position[:, -1] - bench.position[:, -2]) / rest[-1]
    mass = bench.rope.sections[rows.PER_METRE, 0]
    return np.asarray(mass * (0.5 * (v[:, 1:] + v[:, :-1]) * rest).sum(axis=1))


def motion(rig: Rig, speed: float, sway: float) -> rows.Boundary:
    """Line out up to `speed` within 4 s; heave of 0.5 m and sway, from rest."""
    t = rig.step * np.arange(3001)
    value, rate = np.zeros((len(t), rows.MOTIONS)), np.zeros((len(t), rows.MOTIONS))
    for column, amplitude, omega in ((rows.Z, 0.5, 0.8), (rows.X, sway, 0.9)):
        value[:, column] = amplitude * (1.0 - np.cos(omega * t))
        rate[:, column] = amplitude * omega * np.sin(omega * t)
    u = np.minimum(t / 4.0, 1.0)
    rate[:, rows.LINE] = speed * u**2 * (3.0 - 2.0 * u)
    after = np.maximum(t - 4.0, 0.0)
    value[:, rows.LINE] = rig.length + speed * (4.0 * (u**3 - 0.5 * u**4) + after)
    return rows.Boundary(value, rate)


def first_event(rig: Rig, speed: float, sway: float) -> Event:
    """Run to the first split or merge and repeat that step without it."""
    bench = Bench(rig.scene())
    prescribed = motion(rig, speed, sway)
    for k in range(len(prescribed.value) - 1):
        kept, n = bench.rope.state.copy(), bench.n
        step = rows.Boundary(prescribed.value[k : k + 2], prescribed.rate[k : k + 2])
        bench.follow(step)
        if bench.n != n:
            V = float(prescribed.rate[k + 1, rows.LINE])
            after = momentum(bench, V)
            untouched = bench.rope.model._replace(split_above=np.inf, merge_below=0.0)
            bench.rope = bench.rope._replace(state=kept, model=untouched)
            bench.follow(step)
            assert bench.n == n
            return Event(momentum(bench, V), after)
    raise AssertionError("no event")


@pytest.mark.parametrize("rope", [STEEL, HMPE])
@pytest.mark.parametrize("speed", [1.0, -1.0])
def test_momentum_at_a_split_or_merge(rope: Rig, speed: float) -> None:
    """Vertical, 10 m: within 1e-3 N·s of more than 500."""
    rig = replace(rope, length=200.0, elements=20, damping=rope.EA * KELVIN_VOIGT_S)
    event = first_event(rig, speed, sway=0.0)
    assert abs(event.before[2]) > 500.0
    assert np.abs(event.after - event.before).max() < 1e-3


@pytest.mark.parametrize("speed", [1.0, -1.0])
def test_momentum_at_a_split_or_merge_in_a_current(speed: float) -> None:
    """In a current and with sway: within 1e-4 of it."""
    rig = replace(SEA, length=200.0, elements=20, damping=SEA.EA * KELVIN_VOIGT_S)
    event = first_event(rig, speed, sway=1.0)
    assert np.abs(event.after - event.before).max() < 1e-4 * np.linalg.norm(event.before)


@pytest.mark.parametrize("speed", [1.5, -1.5])
def test_tensions_match_the_current_positions_after_every_step(speed: float) -> None:
    """After every step, also one with an event, T is that of the nodes' own places and speeds.

    An element whose length offset fades is left out: it does so at the step's end.
    """
    rig = replace(SEA, length=200.0, elements=20, damping=SEA.EA * KELVIN_VOIGT_S)
    bench, prescribed = Bench(rig.scene()), motion(rig, speed, sway=1.0)
    events = 0
    for k in range(2000):
        n = bench.n
        bench.follow(rows.Boundary(prescribed.value[k : k + 2], prescribed.rate[k : k + 2]))
        events += bench.n != n
        state, work, below = bench.rope.state, bench.rope.work, bench.n - 1
        apart, closing = np.diff(bench.position), np.diff(bench.velocity)
        length = np.linalg.norm(apart, axis=0)
        rest = np.diff(state.s[: bench.n + 1])
        strain = (length - rest) / rest
        rate = (apart * closing).sum(axis=0) / length / rest
        expected = np.maximum(0.0, rig.EA * strain + rig.damping * rate)
        bare = np.flatnonzero(state.offset[:below] == 0.0)
        assert len(bare) > 10
        assert work[rows.TENSION, bare] == pytest.approx(expected[bare], rel=1e-7)
    assert events >= 2

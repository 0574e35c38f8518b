"""Nets along a rope: closed forms in a uniform current, energy, material coordinates."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from effect_cases import CURTAINS, NODES, acting, loads, some_work
from rigs import CALM, Rig, march, march_to_end, sine
from test_energy_accounts import DT, seen, stored, three

from rope_twin import Twin
from rope_twin.core import state as rows
from rope_twin.core.loads.accounts import account_sum
from rope_twin.core.state import Floats
from rope_twin.effects import Surroundings
from rope_twin.effects.net_curtain import SHARE, NetCurtain, NetCurtainParams, build
from rope_twin.effects.waves import RegularWave, WavesParams
from rope_twin.scene.relations import faults
from rope_twin.scene.schema import Scene, Winch
from rope_twin.studies.driven_twin import with_effect
from rope_twin.twin.monitors import ENERGY
from validation.rigs import faded

G, RHO, U = 9.80665, 1025.0, 0.6
NET = NetCurtainParams(
    from_m=10.0, to_m=60.0, width_m=4.0, twine_m=0.003, bar_m=0.03, solidity=0.2, heading_deg=90.0
)
PATH = 0.5 * RHO * NET.width_m  # ½·ρ·width [kg/m²]
RIG = Rig(
    length=100.0, elements=50, mass=0.3, diameter=0.01, damping=1e5, load=800.0, density=RHO,
    step=0.02, EA=1e8, current=((0.0, (U, 0.0)), (-200.0, (U, 0.0))),
    winch=Winch(
        speed_limit_m_per_s=2.0, acceleration_limit_m_per_s2=2.0, min_line_out_m=70.0,
        max_line_out_m=140.0,
    ),
)  # fmt: skip


def hung(net: NetCurtainParams, rig: Rig = RIG, sea: WavesParams = CALM) -> Scene:
    """A weight below a rope that has no drag itself, so that all that pulls aside is net.

    Also where it is calm there are waves, of no height: one step serves all.
    """
    return with_effect(with_effect(rig.scene(), sea), net)


def curtain(twin: Twin) -> NetCurtain:
    return next(effect for effect in twin.rope.effects if isinstance(effect, NetCurtain))


def net_m(twin: Twin) -> float:
    """Length of rope that carries net, by the nodes' shares."""
    n = int(twin.rope.state.counts[rows.ELEMENTS])
    work = np.diff(twin.rope.state.s[: n + 1])
    lengths = 0.5 * (np.append(work, 0.0) + np.append(0.0, work))
    return float(curtain(twin).memory[SHARE, : n + 1] @ lengths)


@pytest.mark.parametrize(
    ("law", "drag", "lift"), [("aarsnes", 0.2600, 0.0532), ("loeland", 0.2886, 0.0679)]
)
def test_published_net_coefficients_per_metre(law: str, drag: float, lift: float) -> None:
    """Sn 0.2: an upright panel across the flow has the printed C_D; at 45° the printed C_L."""
    water = Surroundings(RHO, G, 0.0, room=NODES)
    for heading, normal, along in ((90.0, 0.0, drag), (45.0, lift, 0.04 + (drag - 0.04) / 2**0.5)):
        net = build(replace(NET, law=law, heading_deg=heading, width_m=1.0), None, water)
        net.memory[SHARE] = 1.0
        work = rows.new_work(NODES, rows.COUPLED_ROWS)
        work[rows.TANGENT + 2], work[rows.LENGTH], work[rows.VELOCITY] = 1.0, 1.0, -2.0
        computed = (loads((net,), work) - loads((), work))[3:6, 3] / (0.5 * RHO * 4.0)
        assert computed[0] == pytest.approx(along, abs=5e-5)
        assert abs(computed[1]) == pytest.approx(normal, abs=5e-5)
        assert computed[2] == pytest.approx(-net.weight / (0.5 * RHO * 4.0))


def test_static_shape_of_a_free_net() -> None:
    """It trails: drag 0.04·½·ρ·width·U² per metre; tan φ = H(s)/V(s)."""
    net = replace(NET, heading_deg=None, twine_kg_per_m3=1380.0)
    twin = Twin(hung(net))
    snapshot = twin.snapshot()
    x = snapshot.node_position_m[::-1]
    s = 2.0 * np.arange(50) + 1.0  # middles of the elements; 0: those of their half nodes
    steps = np.diff(x, axis=0)
    aside, down = 0.04 * PATH * U * U, curtain(twin).weight
    assert down == pytest.approx(G * (1380.0 - RHO) * 4.0 * 2.0 / 0.03 * math.pi * 0.0015**2)
    held = np.clip(s - NET.from_m, 0.0, NET.to_m - NET.from_m)
    slope = aside * held / (RIG.load_weight + RIG.weight * s + down * held)
    assert -steps[:, 0] / steps[:, 2] == pytest.approx(slope, rel=1e-4, abs=1e-7)
    assert np.abs(steps[:, 1]).max() < 1e-6
    assert abs(snapshot.hang_off_force_n[0]) == pytest.approx(50.0 * aside, rel=1e-6)


def shape(law: tuple[float, float, float]) -> Floats:
    """Forces in a rope with a fixed net, by Runge-Kutta from its weight up, (101, 2) [N].

    An independent integration of dF/ds = load(angle of F), every metre.
    """
    along, facing, lift = law
    per_area = 2.0 / 0.03 * math.pi * 0.0015**2
    down = G * (1140.0 - RHO) * 4.0 * per_area

    def load(s: float, F: Floats) -> Floats:
        cosine = float(F[1] / np.hypot(*F))  # of the angle between flow and normal
        sine = math.sqrt(1.0 - cosine * cosine)
        on = PATH * U * U if NET.from_m <= s < NET.to_m else 0.0
        side = on * (along + facing * cosine)
        # the normal leans with the rope: its part across the flow points up
        press = on * 2.0 * lift * sine * cosine
        return np.array([side, RIG.weight - press + (down if on else 0.0)])

    F = np.array([0.0, RIG.load_weight])
    made = [F]
    for k in range(1000):
        s, h = 0.1 * k, 0.1
        a = load(s + 1e-9, F)
        b = load(s + 0.5 * h, F + 0.5 * h * a)
        c = load(s + 0.5 * h, F + 0.5 * h * b)
        d = load(s + h - 1e-9, F + h * c)
        F = F + h / 6.0 * (a + 2.0 * b + 2.0 * c + d)
        made.append(F)
    return np.array(made)[::10]


@pytest.fixture(scope="module")
def held() -> Twin:
    return Twin(hung(NET))


def test_static_shape_of_a_fixed_net(held: Twin) -> None:
    """Tension and inclination over the rope against a Runge-Kutta integration."""
    net = curtain(held)
    law = (net.along / PATH, net.facing / PATH, 0.5 * net.lift / PATH)
    forces = shape(law)
    steps = np.diff(held.snapshot().node_position_m[::-1], axis=0)
    middles = forces[1::2]
    assert -steps[:, 0] / steps[:, 2] == pytest.approx(
        middles[:, 0] / middles[:, 1], rel=2e-3, abs=1e-5
    )
    top = held.snapshot().hang_off_force_n
    assert np.abs(top[[0, 2]]) == pytest.approx(np.abs(forces[-1]), rel=2e-3)
    assert middles[-1, 0] / middles[-1, 1] > 0.3, "the rope must lean"


def test_the_net_stays_on_its_length_of_rope_through_payout() -> None:
    """20 m out and 15 m in, with splits and merges: 50 m of net, 10 m above the weight."""
    twin = Twin(hung(NET))
    assert net_m(twin) == pytest.approx(50.0)
    counts = set()
    for _ in march(twin, sine(0.5, 5.0), 22.0, speeds=[(0.0, 1.8), (11.0, -1.8)]):
        counts.add(int(twin.rope.state.counts[rows.ELEMENTS]))
        assert net_m(twin) == pytest.approx(50.0, rel=1e-12)
    assert len(counts) > 3
    share = curtain(twin).memory[SHARE]
    assert share[:10].tolist() == [0.0] * 5 + [0.5] + [1.0] * 4


def test_a_cut_divides_the_net_curtain(tmp_path: Path) -> None:
    """A cut 25 m up leaves 35 m on the winch's part; a saved run resumes bit-identically."""
    scene = hung(NET)
    twin = Twin(scene)
    assert not twin.submit_cut(500_000_000, 75.0)
    twin.advance(50)
    assert twin.snapshot().cut is not None
    assert net_m(twin) == pytest.approx(35.0)
    twin.save(tmp_path / "state")
    other = Twin.restore(tmp_path / "state", scene)
    for run in (twin, other):
        run.advance(50)
    assert np.array_equal(twin.snapshot().node_position_m, other.snapshot().node_position_m)
    assert net_m(other) == pytest.approx(35.0)


@pytest.mark.parametrize("name", CURTAINS)
def test_curtain_force_times_velocity_is_power_less_stored_energy_rate(name: str) -> None:
    """F·v = power - d(kinetic + potential)/dt, with half-covered nodes in accelerated water."""
    effects, work = acting(name), some_work(3)
    random = np.random.default_rng(3)
    work[rows.FLOW : rows.FLOW + 2] = random.normal(0.0, 0.6, (2, NODES))
    work[rows.FLOW_RATE : rows.FLOW_RATE + 3] = random.normal(0.0, 0.6, (3, NODES))
    force = (loads(effects, work) - loads((), work))[3:6]
    done = float((force * three(work, rows.VELOCITY)).sum())
    position = seen(work, np.zeros((3, NODES)), 0.0)
    later, before = (stored(effects, seen(work, 0.0 * position.flow, dt)) for dt in (DT, -DT))
    rate = (later - before) / (2.0 * DT)
    assert abs(done) > 1e3
    assert done == pytest.approx(account_sum("power", effects, position) - rate, rel=1e-6)


def test_energy_balance_of_a_net_in_waves() -> None:
    """Waves of 2 m, heave, payout: 5e-5 of what passes; found: 1.7e-5, falling with step²."""
    waves = WavesParams(regular=RegularWave(height_m=2.0, period_s=7.0), ramp_s=2.0)
    scene = hung(NET, replace(RIG, ramp=5.0), waves)
    twin = Twin(replace(scene, time=replace(scene.time, newton_tolerance_n=0.01)), ENERGY)
    snapshot = march_to_end(twin, faded(sine(0.8, 6.0), 5.0), 12.0, speeds=[(2.0, 0.8), (8.0, 0.0)])
    assert snapshot.energy is not None
    assert abs(snapshot.energy.water_j) > 0.3 * snapshot.energy.exchanged_j, "the net must matter"
    assert abs(snapshot.energy.residual_j) < 5e-5 * snapshot.energy.exchanged_j


@pytest.mark.parametrize(
    ("changed", "said"),
    [
        ({"from_m": 60.0}, "a net from 60 m up to 60 m"),
        ({"law": "lolland"}, "unknown law 'lolland'; give one of aarsnes, loeland"),
        ({"twine_m": 0.04}, "leaves no mesh between knots"),
        ({"twine_m": 0.008, "solidity": None}, "solidity 0.46 is above 0.35"),
    ],
)
def test_invalid_net_curtains_are_rejected(changed: dict[str, object], said: str) -> None:
    assert said in (replace(NET, **changed).check() or "")  # type: ignore[arg-type]


def test_invalid_net_curtain_extents_are_rejected() -> None:
    """Longer than the least line out; on a rope that is not there."""
    reported = [(where, what) for where, what, _ in faults(hung(replace(NET, to_m=80.0)))]
    assert reported == [
        ("effects.net_curtain.to_m",
         "the net would reach 80 m up 'rope', of which 70 m may be all that is out"),
    ]  # fmt: skip
    reported = [(where, what) for where, what, _ in faults(hung(replace(NET, rope="warp")))]
    assert reported == [("effects.net_curtain.rope", "there is no rope 'warp'")]

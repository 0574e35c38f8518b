"""Multi-line systems at rest and in their modes: bridles, lines to one load, bars and tuggers."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from joint_rigs import HEAVY, LIGHT, STIFF, JointBench, Line, legs, rest, tie
from rigs import frequency

from benchmarks.statics_speed import JOINED_GUESSES, joined_statics_rows
from rope_twin.core import state as rows


@pytest.mark.parametrize(("a", "b", "left", "right"), [
    (20.0, 20.0, -10.0, 10.0), (15.5, 25.0, -8.0, 12.0), (200.0, 260.0, -80.0, 120.0),
])  # fmt: skip
def test_leg_tensions_close_the_force_triangle(
    a: float, b: float, left: float, right: float
) -> None:
    """Weightless legs: W/(2·cos α) if they are equal, the force triangle if not."""
    bench = JointBench(legs(
        replace(LIGHT, length=a), replace(LIGHT, length=b), (left, 0.0, 0.0), (right, 0.0, 0.0),
        mass=1e-3, EA=1e10,
    ))  # fmt: skip
    rest(bench)
    span, W, Ta, Tb = right - left, HEAVY * STIFF.gravity, 0.0, 0.0
    for _ in range(4):  # with the legs' small stretch
        la, lb = a * (1.0 + Ta / LIGHT.EA), b * (1.0 + Tb / LIGHT.EA)
        x = (la * la - lb * lb + span * span) / (2.0 * span)
        z = math.sqrt(la * la - x * x)
        Ta, Tb = W * (span - x) * la / (z * span), W * x * lb / (z * span)
    if a == b:
        assert Ta == pytest.approx(W / (2.0 * z / la), rel=1e-12)
    assert bench.joints[:, 0] == pytest.approx([left + x, 0.0, -z], abs=1e-4)
    assert bench.tension(0) == pytest.approx(np.full(10, Ta), rel=1e-4)
    assert bench.tension(1) == pytest.approx(np.full(10, Tb), rel=1e-4)


def test_a_slack_leg_has_zero_tension() -> None:
    """The shorter leg hangs straight down; the longer one is slack."""
    low = replace(STIFF, length=10.0, elements=5)
    bench = JointBench(legs(low, STIFF, (0.0, 0.0, 0.0), (4.0, 0.0, 0.0), tolerance=1e-3))
    rest(bench)
    own = STIFF.mass * STIFF.gravity * STIFF.length
    assert bench.tension(1).max() < own, "it hangs by its own weight"
    W = (HEAVY + 5.0 * STIFF.mass) * STIFF.gravity
    sideways = bench.tension(1)[0]
    assert bench.tension(0)[0] == pytest.approx(W, abs=0.6 * own + sideways)


def test_joint_position_after_paying_out_one_of_two_lines() -> None:
    """Load on two lines, one paid out by 5 m: the joint is where the lengths meet."""
    winch = replace(STIFF, mass=0.1, EA=1e9, step=0.02, damping=1e6, tolerance=50.0)
    bench = JointBench(legs(
        winch, winch, (-10.0, 0.0, 0.0), (10.0, 0.0, 0.0), mass=0.1, EA=1e9, step=0.02,
        damping=1e6, area=(500.0,) * 3, density=1025.0, volume=1.0, tolerance=50.0,
    ))  # fmt: skip
    rest(bench)
    steps = 800
    t = bench.step * np.arange(steps + 1)
    u = np.minimum(t / 10.0, 1.0)
    motion = bench.still(steps)
    motion.value[1, :, rows.LINE] += 5.0 * u**3 * (10.0 - 15.0 * u + 6.0 * u * u)
    motion.rate[1, :, rows.LINE] = 5.0 * 30.0 * u * u * (1.0 - u) ** 2 / 10.0
    bench.follow(motion)
    assert bench.system.ropes[1].state.health[rows.SPLITS] == 2
    assert bench.system.ropes[0].state.health[rows.SPLITS] == 0
    rest(bench)
    x = (20.0**2 - 25.0**2 + 20.0**2) / 40.0
    position = [x - 10.0, 0.0, -math.sqrt(400.0 - x * x)]
    assert bench.joints[:, 0] == pytest.approx(position, abs=5e-3)


def test_two_payloads_on_one_line() -> None:
    """Static tensions above and below the upper payload; both axial modes of two masses.

    Masses m1 (upper, on a spring k1) and m2 below it on k2, ropes of hardly any mass.
    """
    m1, m2, l1, l2, EA = 4e3, 2e3, 60.0, 40.0, 2e7
    base = replace(LIGHT, EA=EA, damping=0.0, step=0.005, tolerance=1e-2)
    lines = [
        Line(rig=replace(base, length=0.5 * l1, elements=3), low=(0, 0, -30), high=(0, 0, 0),
             lower=0),
        Line(rig=replace(base, length=0.5 * l1, elements=3, load=m1), low=(0, 0, -60),
             high=(0, 0, -30), lower=1, upper=0),
        Line(rig=replace(base, length=l2, elements=4, load=m2), low=(0, 0, -100),
             high=(0, 0, -60), upper=1),
    ]  # fmt: skip
    bench = JointBench(lines)
    rest(bench)
    g = base.gravity
    assert bench.tension(0) == pytest.approx(np.full(3, (m1 + m2) * g), rel=2e-5)
    assert bench.tension(1) == pytest.approx(np.full(3, (m1 + m2) * g), rel=2e-5)
    assert bench.tension(2) == pytest.approx(np.full(4, m2 * g), rel=2e-5)
    K = np.array([[EA / l1 + EA / l2, -EA / l2], [-EA / l2, EA / l2]])
    values, shapes = np.linalg.eigh(K / np.sqrt(np.outer([m1, m2], [m1, m2])))
    for omega, shape in zip(np.sqrt(values), shapes.T, strict=True):
        rest(bench)
        up, down = 0.01 * shape / np.sqrt([m1, m2]) * math.sqrt(m1)
        bench.nodes(0)[2] += np.linspace(0.5 * up, 0.0, 4)
        bench.nodes(1)[2] += np.linspace(up, 0.5 * up, 4)
        bench.nodes(2)[2] += np.linspace(down, up, 5)
        bench.joints[2] += [0.5 * up, up]
        heights = np.array([(bench.hold(1), bench.joints[2, 1])[1] for _ in range(800)])
        assert frequency(heights, bench.step) == pytest.approx(omega / (2 * math.pi), rel=2e-3)


def test_spreader_bar_compression() -> None:
    """Two legs from one hook to a bar with a load at each end: T = W/cos α, bar W·tan α."""
    leg = replace(LIGHT, length=10.0, load=HEAVY)
    half = 4.0
    drop = math.sqrt(100.0 - half**2)
    hook, left, right = (0.0, 0.0, 0.0), (-half, 0.0, -drop), (half, 0.0, -drop)
    sling = replace(STIFF, length=9.0, elements=5)
    bench = JointBench(
        [
            Line(rig=leg, low=left, high=hook, lower=0),
            Line(rig=leg, low=right, high=hook, lower=1),
            Line(rig=sling, low=left, high=right, lower=0, upper=1),  # slack below the bar
        ],
        tie(0, second=1, length=2.0 * half, stiffness=1e9, damping=1e5, pushes=True),
    )
    rest(bench)
    W = (HEAVY + 0.5 * sling.mass * sling.length) * leg.gravity
    aside = bench.tension(2)[2]  # where the sling is level
    assert bench.tension(0) == pytest.approx(np.full(10, W * 10.0 / drop), rel=1e-4)
    assert bench.pull_of_tie(0) == pytest.approx(-W * half / drop - aside, rel=1e-4)
    assert 0.0 < aside < W / 500.0


def test_lateral_offset_by_a_constant_tension_tether() -> None:
    """A tugger of F on a load of W: tan of the line's angle is F·cos β/(W - F·sin β)."""
    F, anchor = 2e4, (30.0, 0.0, -10.0)
    lines = legs(replace(LIGHT, length=20.0), replace(LIGHT, length=50.0), (0.0, 0.0, 0.0),
                 (1.0, 0.0, 0.0), mass=1e-3)  # fmt: skip
    bench = JointBench(lines, tie(0, anchor=anchor, force=F))
    rest(bench)
    x, y, z = bench.joints[:, 0]
    to_anchor = np.array(anchor) - bench.joints[:, 0]
    pull = F * to_anchor / np.linalg.norm(to_anchor)
    W = HEAVY * STIFF.gravity
    assert y == pytest.approx(0.0, abs=1e-9)
    assert x / -z == pytest.approx(pull[0] / (W - pull[2]), rel=1e-3)
    assert bench.tension(0)[0] == pytest.approx(math.hypot(pull[0], W - pull[2]), rel=1e-3)


def test_static_equilibrium_from_random_initial_shapes() -> None:
    """Ropes displaced by metres, slack and stretched, reach the same equilibrium."""
    heavy = replace(STIFF, mass=5.0)
    lines = legs(heavy, replace(heavy, length=26.0), (-8.0, 0.0, 0.0), (8.0, 0.0, 0.0), mass=5.0)
    good = JointBench(lines)
    rest(good)
    random = np.random.default_rng(7)
    tangled = JointBench(lines)
    for r in range(3):
        nodes = tangled.nodes(r)
        inner = slice(0, nodes.shape[1] - (r < 2))
        nodes[:, inner] += random.normal(0.0, 3.0, nodes[:, inner].shape)
    tangled.joints[:] += random.normal(0.0, 3.0, tangled.joints.shape)
    rest(tangled)
    assert np.abs(tangled.joints - good.joints).max() < 1e-6
    for r in range(3):
        assert np.abs(tangled.nodes(r) - good.nodes(r)).max() < 1e-6


def test_static_equilibrium_is_independent_of_the_initial_guess() -> None:
    """The guesses of `python -m benchmarks statics`."""
    rows = list(joined_statics_rows(("two_line_lift",), nodes=60))
    assert [row["guess"] for row in rows] == list(JOINED_GUESSES)
    assert all(row["found"] for row in rows)
    tensions = [row["tension_n"] for row in rows]
    assert max(tensions) - min(tensions) < 1e-6 * max(tensions)

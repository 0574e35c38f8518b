"""The loop over a lower sheave as a twin: static equilibrium, running, saved states."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from small_scene import digest

from rope_twin import Snapshot, Twin, load_scene
from rope_twin.effects.current import CurrentParams
from rope_twin.errors import SolverError
from rope_twin.scene.schema import Scene


@pytest.fixture(scope="module")
def scene() -> Scene:
    return load_scene("two_line_loop")


def run_both(twin: Twin, speed: float, seconds: int) -> list[Snapshot]:
    """Main pays out and haulback hauls in; a snapshot each second."""
    snapshots = []
    assert twin.submit_speed(None, speed) == ""
    assert twin.submit_speed(None, -speed, "haulback_sheave") == ""
    for _ in range(seconds):
        twin.advance(round(1.0 / twin.step_s))
        snapshots.append(twin.snapshot())
    return snapshots


def pulls(snapshot: Snapshot) -> dict[str, float]:
    """Return the tension of each rope at its upper end, or on the sheave [N]."""
    return {rope.name: rope.tension_top_n for rope in snapshot.ropes}


def lengths(snapshot: Snapshot) -> dict[str, float]:
    """Unstretched, of each rope [m]."""
    return {rope.name: rope.line_out_m for rope in snapshot.ropes}


def test_static_tensions_beside_the_sheave(scene: Scene) -> None:
    """In still water: 2·T·cos = what the tether and the block's weight in water pull down."""
    still = CurrentParams(profile=((0.0, (0.0, 0.0)),))
    effects = tuple(still if isinstance(e, CurrentParams) else e for e in scene.effects)
    snapshot = Twin(replace(scene, effects=effects)).snapshot()
    (sheave,) = snapshot.sheaves
    depth = -sheave.position_m[2]
    tether = 50e3 + 500.0 * (1550.0 - depth - 50.0)
    block = 1500.0 * (1.0 - 1025.0 / 7850.0) * 9.80665
    left, right = (
        next(rope.node_position_m[-2:] for rope in snapshot.ropes if rope.name == name)
        for name in ("below_descending", "below_ascending")
    )
    cosines = sum(
        float(np.diff(x[:, 2])[0] / np.linalg.norm(np.diff(x, axis=0))) for x in (left, right)
    )
    pull = pulls(snapshot)
    assert pull["below_descending"] == pytest.approx(pull["below_ascending"], rel=1e-9)
    assert pull["below_descending"] * -cosines == pytest.approx(tether + block, rel=1e-6)
    assert sum(lengths(snapshot).values()) == pytest.approx(3000.0, abs=1e-9)
    assert sheave.passed_m == pytest.approx(0.0, abs=0.05)


def test_tensions_are_smooth_while_rope_runs_over_the_sheave(scene: Scene) -> None:
    """40 s at 1 m/s: the skips pass each other, lengths add up, tensions are smooth."""
    twin = Twin(scene)
    start = lengths(twin.snapshot())
    run_both(twin, 1.0, 15)
    snapshots = run_both(twin, 1.0, 40)
    last, before = snapshots[-1], snapshots[0]
    assert last.sheaves[0].passed_m - before.sheaves[0].passed_m == pytest.approx(-39.0, abs=0.1)
    stretches = ("below_descending", "below_ascending")
    for snapshot in snapshots:
        own = lengths(snapshot)
        assert sum(own[name] for name in stretches) == pytest.approx(1500.0, abs=1e-9)
        assert sum(own.values()) == pytest.approx(sum(start.values()), abs=1e-6)
        for rope, payload in ((1, 0), (3, 1)):
            position = snapshot.ropes[rope].node_position_m
            assert (position[0] == snapshot.payloads[payload].position_m).all()
            assert (position[-1] == snapshot.sheaves[0].position_m).all()
            assert len(snapshot.ropes[rope].element_tension_n) == len(position) - 1
        assert not snapshot.not_converged
    calm = snapshots[:30]  # then the skips pass the border of the current's layers
    t = np.linspace(-1.0, 1.0, len(calm))
    for name in stretches:
        pull = np.array([pulls(snapshot)[name] for snapshot in calm])
        smooth = np.polynomial.Polynomial.fit(t, pull, 4)(t)
        assert np.abs(pull - smooth).max() < 2e-5 * pull.mean()
    assert last.solver.splits >= 6
    assert last.solver.merges >= 6


def test_one_winch_moves_the_sheave_by_half_of_its_payout(scene: Scene) -> None:
    """4 m more line let the sheave down by 2 m, less what the tether's spring leaves to stretch."""
    twin = Twin(scene)
    before = twin.snapshot().sheaves[0].position_m[2]
    assert twin.submit_speed(None, 0.2) == ""
    twin.advance(round(21.0 / twin.step_s))
    assert twin.submit_speed(None, 0.0) == ""
    twin.advance(round(60.0 / twin.step_s))
    snapshot = twin.snapshot()
    more = sum(lengths(snapshot).values()) - 3000.0
    assert snapshot.sheaves[0].position_m[2] - before == pytest.approx(-0.5 * more, rel=0.02)


def test_a_sheave_twin_resumes_bit_identically(scene: Scene, tmp_path: Path) -> None:
    """To the bit, under heave, with rope running over the sheave."""

    def heaved(twin: Twin, seconds: int) -> list[Snapshot]:
        snapshots, omega = [], 2.0 * math.pi / 8.0
        for second in range(seconds):
            for part in range(1, 21):
                due = twin.time_ns + part * 50_000_000
                z, v = math.sin(omega * due * 1e-9), omega * math.cos(omega * due * 1e-9)
                assert not twin.submit_heave(due, z, v), second
            twin.advance(round(1.0 / twin.step_s))
            snapshots.append(twin.snapshot())
        return snapshots

    twin = Twin(scene)
    run_both(twin, 1.0, 6)
    twin.save(tmp_path / "saved")
    branch, restored = twin.branch(), Twin.restore(tmp_path / "saved", scene)
    expected = heaved(twin, 20)
    for other in (branch, restored):
        snapshots = heaved(other, 20)
        assert digest(snapshots) == digest(expected)
        for snapshot, wanted in zip(snapshots, expected, strict=True):
            assert snapshot.sheaves[0].passed_m == wanted.sheaves[0].passed_m
            assert pulls(snapshot) == pulls(wanted)


def test_a_failed_step_restores_the_sheave(scene: Scene) -> None:
    """Its correction is not finite, and the next step must not read it."""
    twin = Twin(scene)
    twin.advance(100)
    other = twin.branch()
    n = int(twin.rope.state.counts[0])
    kept = twin.rope.state.nodes[3, 1:n].copy()
    twin.rope.state.nodes[3, 1:n] = math.inf
    with pytest.raises(SolverError, match="not finite"):
        twin.advance(1)
    twin.rope.state.nodes[3, 1:n] = kept
    for run in (twin, other):
        run.advance(100)
    snapshots = [run.snapshot() for run in (twin, other)]
    assert pulls(snapshots[0]) == pulls(snapshots[1])
    assert digest(snapshots[:1]) == digest(snapshots[1:])

"""A twin whose rope is cut above a rigid body: snapshots, topics, view, saved states, refusals."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from small_scene import digest, not_finite

from rope_twin import Snapshot, Twin, load_scene
from rope_twin.effects.rigid_body import DeckParams, RigidBodyParams
from rope_twin.recording.bag import BagReader
from rope_twin.run.options import RunOptions
from rope_twin.run.unpaced import run_unpaced
from rope_twin.scene.schema import Scene
from rope_twin.twin.cut_input import CutInput
from rope_twin.view.rope_view import RopeView, play
from rope_twin.view.sinks import FileSink

AT_S, BELOW_M, EVERY = 1.002, 12.0, 100


@pytest.fixture(scope="module")
def scene() -> Scene:
    return load_scene("manifold_lift")


def reported(twin: Twin) -> Twin:
    assert not twin.submit_speed(500_000_000, 0.25)
    assert not twin.submit_cut(round(AT_S * 1e9), BELOW_M)
    return twin


def ends(twin: Twin, last: int = 1600) -> list[Snapshot]:
    """Return a snapshot every 100 steps, stepped singly: waves know the time to its last bit."""
    snapshots = []
    while twin.steps < last:
        twin.advance(1)
        if twin.steps % EVERY == 0:
            snapshots.append(twin.snapshot())
    return snapshots


def every_bit(snapshots: list[Snapshot]) -> str:
    """Return every figure of a snapshot of one rope and a body, and of the lower part."""
    tables = [rope.node_position_m.tobytes() for snapshot in snapshots for rope in snapshot.ropes]
    return digest(snapshots) + b"".join(tables).hex()


@pytest.fixture(scope="module")
def run(scene: Scene) -> list[Snapshot]:
    return ends(reported(Twin(scene)))


def test_the_falling_body_is_reported(run: list[Snapshot]) -> None:
    """Position, attitude and slings belong to the lower part; the upper one has no payload."""
    before, after = run[3], run[-1]
    assert before.cut is None
    assert before.body is not None
    assert (before.body.leg_tension_n > 0.0).all()
    assert after.cut is not None
    upper, lower = after.ropes
    assert after.body is not None
    assert len(after.body.leg_tension_n) == 4
    hook = lower.node_position_m[-1]
    legs = np.linalg.norm(hook - after.body.leg_end_m, axis=1)
    np.testing.assert_allclose(after.body.leg_length_m, legs, rtol=1e-12)
    assert after.payload_position_m[2] < before.payload_position_m[2] - 5.0
    assert (after.payloads[0].position_m == after.payload_position_m).all()
    assert upper.node_position_m[-1, 2] > 20.0
    assert after.tension_top_n < 0.01 * before.tension_top_n
    assert after.seabed is not None
    assert after.seabed.payload_height_m < 45.0 + after.payload_position_m[2]
    assert not not_finite(after)


@pytest.mark.parametrize("moment", [300, 401, 900])
def test_a_cut_above_a_body_resumes_bit_identically(
    scene: Scene, run: list[Snapshot], tmp_path: Path, moment: int
) -> None:
    """With the cut planned, in the step after it, and during the fall."""
    twin = reported(Twin(scene))
    ends(twin, moment)
    twin.save(tmp_path / "cut.state")
    rest = [snapshot for snapshot in run if snapshot.step > moment]
    assert every_bit(ends(twin.branch())) == every_bit(rest)
    assert every_bit(ends(Twin.restore(tmp_path / "cut.state", scene))) == every_bit(rest)


@pytest.mark.parametrize("below_m", [1.0, math.inf])
def test_cuts_at_time_zero_at_either_end(scene: Scene, below_m: float) -> None:
    """At static equilibrium; a metre of rope stays above, or stays on the hook."""
    twin = Twin(scene)
    assert not twin.submit_cut(None, below_m)
    still = twin.snapshot()
    twin.advance(40)
    snapshot = twin.snapshot()
    assert twin.cut is not None
    fallen_m = still.payload_position_m[2] - snapshot.payload_position_m[2]
    slack_s = 0.01  # until the slings are, with the hook of 1.5 t on them
    assert 0.5 * 9.81 * (0.1 - slack_s) ** 2 < fallen_m < 0.5 * 9.81 * 0.1**2
    assert snapshot.solver.unconverged_substeps == 0


def test_a_failed_step_restores_body_and_both_ropes(scene: Scene) -> None:
    """The upper part fails: the lower part, stepped before, goes back."""
    twin = reported(Twin(scene))
    twin.advance(500)
    other = twin.branch()
    n = int(twin.rope.state.counts[0])
    kept = twin.rope.state.nodes[3, 1:n].copy()
    twin.rope.state.nodes[3, 1:n] = math.inf
    with pytest.raises(Exception, match=r"(?i)finite|step"):
        twin.advance(1)
    twin.rope.state.nodes[3, 1:n] = kept
    for one in (twin, other):
        one.advance(100)
    assert every_bit([twin.snapshot()]) == every_bit([other.snapshot()])


def test_a_cut_above_a_deck_on_the_ship_is_rejected(scene: Scene) -> None:
    body = scene.listed(RigidBodyParams)
    assert body is not None
    for with_ship in (True, False):
        own = replace(body, deck=DeckParams(height_m=5.0, with_ship=with_ship))
        on_deck = replace(
            scene, effects=tuple(own if effect is body else effect for effect in scene.effects)
        )
        message = CutInput(on_deck).submit(None, 12.0, 0)
        assert ("deck that heaves with the ship" in message) == with_ship


def test_a_bag_and_its_view_show_the_body_after_the_cut(scene: Scene, tmp_path: Path) -> None:
    """Rigging and both ropes on their topics; the view falls with the body.

    The run ends with a picture: one each 0.12 s from 0.04 s on.
    """
    options = RunOptions(
        scene="manifold_lift", end_s=3.04, speed=0.0, record=tmp_path / "bag", cut=f"{BELOW_M}@1.0"
    )
    summary = run_unpaced(options, lambda run: None)
    assert "cut at 1.00 s, 12.0 m below the hang-off" in summary.as_text()
    with BagReader(tmp_path / "bag") as reader:
        counts = {name.strip("/"): content.messages for name, content in reader.topics.items()}
    assert counts["ropes/cut"] == 1
    assert counts["slings/state"] == counts["ropes/nodes"] == pytest.approx(76, abs=2)
    view = RopeView(FileSink(tmp_path / "seen.rrd", footer=True))
    play(tmp_path / "bag", view)
    falls = view._lower_end._focus
    view.close()
    assert falls[2] == pytest.approx(summary_depth(tmp_path / "bag"), abs=1.2)
    assert falls[2] < 1.0, "the rope above ends 28 m higher"


def summary_depth(bag: Path) -> float:
    """Return the hook's depth at the end, by the bag's last nodes of all ropes."""

    class Last:
        z = 0.0

        def show(self, topic: str, message: object, time_ns: int) -> None:
            if topic == "ropes/nodes":
                data = np.asarray(message.data, dtype=np.uint8)  # type: ignore[attr-defined]
                self.z = float(data.view("<f4").reshape(-1, 5)[-1, 2])

    last = Last()
    play(bag, last)
    return last.z

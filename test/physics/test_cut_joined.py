"""Cuts in multi-line systems: against a single rope that is cut, conservation and refusals."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
from test_joint_effects import CUT, REST, WHOLE

from rope_twin import Snapshot, load_scene
from rope_twin.core import state as rows
from rope_twin.core.state import Floats
from rope_twin.errors import InputError
from rope_twin.scene.schema import Scene
from rope_twin.twin.cut_input import PlannedCut, plan_for
from rope_twin.twin.monitors import ENERGY
from rope_twin.twin.multi_line import MultiLineRopes
from rope_twin.twin.twin import Twin


@pytest.fixture(scope="module")
def bridle() -> Scene:
    return load_scene("bridle_lift")


def heaved(twin: Twin, seconds: int) -> None:
    """Feed a heave of 0.3 m for some seconds."""
    for k in range(20 * seconds):
        t = 0.05 * k
        assert not twin.submit_heave(round(t * 1e9), 0.3 * math.sin(t), 0.3 * math.cos(t))


def seen(scene: Path, text: str, rope: str) -> Floats:
    """A rope of 8 m that pays out, cut 2 m below the hang-off at 2 s: top tension, load's place."""
    scene.write_text(text + REST, encoding="utf-8")
    twin, snapshots = Twin(load_scene(str(scene))), []
    heaved(twin, 6)
    assert not twin.submit_speed(None, 0.3)
    assert not twin.submit_cut(2_000_000_000, 2.0, rope)
    for _ in range(13):
        twin.advance(50)
        snapshot = twin.snapshot()
        load = (
            snapshot.payloads[-1].position_m if snapshot.payloads else snapshot.payload_position_m
        )
        snapshots.append([snapshot.tension_top_n, snapshot.line_out_m, *load])
    assert twin.cut is not None
    assert twin.cut.left_m == pytest.approx(2.0)
    assert not twin.snapshot().not_converged
    return np.array(snapshots)


def test_a_cut_rope_with_a_ring_equals_a_cut_single_rope(tmp_path: Path) -> None:
    """Both parts in heave, waves and splash zone.

    A second on places differ by 4e-5 m, the solver's tolerance, which grows as the rope folds.
    """
    ring, whole = (
        seen(tmp_path / "scene.yaml", text, rope) for text, rope in ((CUT, "hoist"), (WHOLE, ""))
    )
    after = slice(8, 13)
    assert whole[after, 4].min() < whole[8, 4] - 2.0, "the load falls"
    assert np.abs(ring[after, 0] - whole[after, 0]).max() < 5e-3, "newtons"
    assert np.abs(ring[after, 2:] - whole[after, 2:]).max() < 1e-3


def figures(twin: Twin) -> tuple[float, Floats]:
    """Mass [kg] and momentum [N·s] of all rope."""
    ropes = twin.inspect().ropes
    assert isinstance(ropes, MultiLineRopes)
    mass, momentum = 0.0, np.zeros(3)
    for rope in ropes.system(twin.rope).ropes:
        n = int(rope.state.counts[rows.ELEMENTS])
        half = 0.5 * rope.sections[rows.PER_METRE, 0] * np.diff(rope.state.s[: n + 1])
        own = np.append(half, 0.0) + np.append(0.0, half)
        mass += own.sum()
        momentum += rope.state.nodes[rows.VELOCITY : rows.VELOCITY + 3, : n + 1] @ own
    return mass, momentum


@pytest.mark.parametrize(("number", "above_m"), [(0, 333.0), (1, 4.4), (4, 1.2)])
def test_a_cut_in_a_system_conserves_mass_and_momentum(
    bridle: Scene, number: int, above_m: float
) -> None:
    """Mass and momentum of all ropes stay, wherever the cut; the new ends coincide."""
    twin = Twin(bridle)
    heaved(twin, 6)
    twin.advance(400)
    mass, momentum = figures(twin)
    lost = twin.split(above_m, number)
    after, gone = figures(twin)
    assert lost == pytest.approx(above_m, abs=0.1)
    assert after == pytest.approx(mass, rel=1e-13)
    np.testing.assert_allclose(gone, momentum, rtol=1e-10, atol=1e-9)
    snapshot = twin.snapshot()
    assert snapshot.ropes[-1].name == f"{bridle.ropes[number].name}/lower"
    assert (
        snapshot.ropes[-1].node_position_m[0] == snapshot.ropes[number].node_position_m[-1]
    ).all()


def pulls(snapshot: Snapshot) -> dict[str, float]:
    """Return the tension at the upper end of each rope [N]."""
    return {rope.name: rope.tension_top_n for rope in snapshot.ropes}


def test_the_other_leg_carries_the_load_after_a_cut(bridle: Scene) -> None:
    """It carries all weight, the energy balance closes, and a saved run resumes identically."""
    twin = Twin(bridle, ENERGY)
    before = pulls(twin.snapshot())
    assert not twin.submit_cut(1_000_000_000, 4.0, "leg_port")
    twin.advance(150)
    branch = Twin.restore(twin.capture(), bridle, ENERGY)
    for run in (twin, branch):
        run.advance(150)
    snapshot, other = twin.snapshot(), branch.snapshot()
    for rope, same in zip(snapshot.ropes, other.ropes, strict=True):
        assert rope.node_position_m.tobytes() == same.node_position_m.tobytes()
        assert rope.element_tension_n.tobytes() == same.element_tension_n.tobytes()
    assert snapshot.cut == other.cut
    assert snapshot.energy is not None
    assert 0.0 <= snapshot.energy.residual_j < 5e-3 * snapshot.energy.exchanged_j
    assert pulls(snapshot)["leg_port/lower"] < 1.0, "its upper end is free"
    plain = Twin.restore(twin.capture(), bridle)
    plain.advance(9_000)
    after, two_legs = pulls(plain.snapshot()), 2.0 * before["leg_port"] * math.cos(math.pi / 6.0)
    assert after["hoist"] == pytest.approx(before["hoist"], rel=0.01)
    assert after["leg_starboard"] == pytest.approx(two_legs, rel=0.02)


def test_invalid_cuts_of_named_ropes_are_rejected(bridle: Scene) -> None:
    """A wrong rope or length gets one sentence, also before a run."""
    twin = Twin(bridle)
    message = twin.submit_cut(None, 3.0, "leg_prot")
    assert "there is no rope 'leg_prot'; did you mean 'leg_port'?" in message
    assert plan_for(bridle, "leg_port:4@3") == PlannedCut(3_000_000_000, 4.0, "leg_port")
    with pytest.raises(InputError, match=r"never longer than 8 m; give up to 7 m, or end"):
        plan_for(bridle, "leg_port:9@3")
    with pytest.raises(InputError, match=r"there is no rope 'leg'"):
        plan_for(bridle, "leg:4@3")

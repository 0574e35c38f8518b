"""A rope cut while a modal VIV model shakes it: the remaining rope has modes of its own."""

from __future__ import annotations

import numpy as np
import pytest
from cut_rigs import fallen

from rope_twin import Twin, load_scene
from rope_twin.core import state as rows
from rope_twin.vortex.drag_amplification import GROWTH, DragGrowth
from rope_twin.vortex.line_model import line_model

SCENES = pytest.mark.parametrize(
    "name", ["vortices_modal", pytest.param("vortices_decomposed", marks=pytest.mark.long)]
)
STEPS_PER_S = 100


def shaken(name: str) -> Twin:
    """Return the twin after half a minute."""
    twin = Twin(load_scene(name))
    twin.advance(30 * STEPS_PER_S)
    return twin


def growth_of(effects: tuple[object, ...]) -> np.ndarray:
    """Return the drag amplification at the nodes."""
    own = next(effect for effect in effects if isinstance(effect, DragGrowth))
    return np.asarray(own.memory[GROWTH])


@SCENES
@pytest.mark.long
def test_modal_viv_after_a_cut_uses_the_remaining_rope(name: str) -> None:
    """Modes 20 s later are those of a bare rope; the fallen part has no VIV."""
    twin = shaken(name)
    before = twin.snapshot().vibration
    assert before is not None
    assert not twin.submit_cut(None, 300.0)
    twin.advance(1)
    after, n = twin.snapshot().vibration, int(twin.rope.state.counts[rows.ELEMENTS])
    assert after is not None
    from_top = 10  # nodes: it goes on as it was
    np.testing.assert_allclose(
        after.cross_flow[:from_top], before.cross_flow[:from_top], rtol=0.2, atol=0.02
    )
    assert growth_of(twin.rope.effects)[: n - 1].min() > 0.0
    lower = fallen(twin)
    assert not growth_of(lower.effects)[: int(lower.state.counts[rows.ELEMENTS]) + 1].any()
    assert twin.viv_drag is not None
    twin.advance(20 * STEPS_PER_S)
    now = twin.snapshot().vibration
    assert now is not None
    assert now.solves >= before.solves + 18
    assert not now.note
    span = line_model(twin.rope)
    assert span.end_mass == 0.0, "nothing hangs on it"
    response = twin.viv_drag.trackers[0]._response
    own = response.span
    assert own.s[-1] - own.s[0] == pytest.approx(300.0, rel=2e-3)
    assert own.tension[0] < 0.02 * own.tension[-1], "down to its free end"
    assert 0.02 < now.cross_flow[:-3].max() < 1.0
    assert now.cross_flow.max() < 3.0, "its end lashes: 2.5 d seconds before and after, as ever"


@SCENES
def test_a_cut_run_with_modal_viv_resumes_bit_identically(name: str) -> None:
    """Saved states and branches, right after the cut and later."""
    twin = shaken(name)
    assert not twin.submit_cut(None, 300.0)
    others = []
    for steps in (1, 230):
        twin.advance(steps)
        others += [Twin.restore(twin.capture(), twin.scene), twin.branch()]
    due = twin.steps + 170
    for one in (twin, *others):
        one.advance(due - one.steps)
    kept = twin.snapshot()
    assert kept.vibration is not None
    for one in others:
        snapshot = one.snapshot()
        assert snapshot.vibration is not None
        assert (snapshot.vibration.cross_flow == kept.vibration.cross_flow).all()
        for rope, own in zip(snapshot.ropes, kept.ropes, strict=True):
            assert (rope.node_position_m == own.node_position_m).all()

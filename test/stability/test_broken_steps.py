"""A failed step is reported, the last good state stays, the run resumes without the cause."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from small_scene import figures, not_finite, small_scene

import rope_twin.twin.ropes as twin_module
from rope_twin import Snapshot, Twin
from rope_twin.core.state import Boundary
from rope_twin.core.step import advance
from rope_twin.effects.drag import Drag
from rope_twin.effects.rope_mass import Weight
from rope_twin.errors import SolverError
from rope_twin.twin.state import load_state

STEP_NS = 10_000_000
BREAKS_AT = 137  # steps that succeed


def started(folder: Path) -> Twin:
    """A twin with heave for 20 s and a winch that runs from the start."""
    twin = Twin(small_scene(folder))
    for k in range(2001):
        t = k * 0.01
        assert not twin.submit_heave(k * STEP_NS, 1.5 * math.sin(t), 1.5 * math.cos(t))
    assert not twin.submit_speed(0, 1.2)
    assert not twin.submit_speed(3_000_000_000, -0.5)
    return twin


def unbroken(folder: Path, steps: int) -> Snapshot:
    """After so many steps of a twin whose core does not break."""
    twin = started(folder)
    twin.advance(steps)
    return twin.snapshot()


class BrokenCore:
    """The core's advance, whose loads are spoilt from step BREAKS_AT on while `broken`."""

    def __init__(self, spoilt: Any) -> None:
        self.broken = True
        self._advance = advance
        self._spoilt = spoilt

    def __call__(self, rope: Any, boundary: Any, pull: Any, time: float, steps: int) -> int:
        first = round(time / rope.model.step)
        good = min(steps, max(BREAKS_AT - first, 0)) if self.broken else steps
        done = self._advance(rope, boundary, pull, time, good)
        if done < good or good == steps:
            return int(done)
        effects = tuple(self._spoilt if type(e) is type(self._spoilt) else e for e in rope.effects)
        rest = Boundary(boundary.value[good:], boundary.rate[good:])
        more = self._advance(
            rope._replace(effects=effects), rest, pull[good:], time + good * rope.model.step,
            steps - good,
        )  # fmt: skip
        return int(good + more)


@pytest.fixture(params=[Weight(math.nan, 0.0), Weight(math.inf, 0.0), Drag(1e300, 1e300)], ids=str)
def core(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> BrokenCore:
    """A core that breaks."""
    broken = BrokenCore(request.param)
    monkeypatch.setattr(twin_module, "advance", broken)
    return broken


def differences(found: Snapshot, expected: Snapshot, relative: float) -> list[str]:
    """Return the figures that differ by more than this fraction of their largest value."""
    a, b = figures(found), figures(expected)
    return [
        name
        for name in b
        if a[name].shape != b[name].shape
        or np.abs(a[name] - b[name]).max(initial=0.0) > relative * np.abs(b[name]).max(initial=0.0)
    ]


def test_a_failed_step_is_reported_in_one_sentence(tmp_path: Path, core: BrokenCore) -> None:
    """The sentence names the step and says that the last good state is kept."""
    twin = started(tmp_path)
    with pytest.raises(SolverError) as caught:
        twin.advance(300)
    assert "\n" not in str(caught.value)
    assert f"step {BREAKS_AT + 1}" in str(caught.value)
    assert twin.steps == BREAKS_AT


def test_the_last_good_state_is_kept(tmp_path: Path, core: BrokenCore) -> None:
    """The snapshot is that of a run which was asked for the good steps only."""
    twin = started(tmp_path)
    with pytest.raises(SolverError):
        twin.advance(300)
    kept = twin.snapshot()
    assert not not_finite(kept)
    core.broken = False
    assert not differences(kept, unbroken(tmp_path, BREAKS_AT), 1e-12)


def test_a_run_resumes_bit_identically_after_failed_steps(tmp_path: Path, core: BrokenCore) -> None:
    """After three failures in a row the run ends in the same bits as an unbroken one."""
    twin = started(tmp_path)
    for _ in range(3):
        with pytest.raises(SolverError):
            twin.advance(300)
        assert twin.steps == BREAKS_AT
    core.broken = False
    twin.advance(900 - BREAKS_AT)
    assert not differences(twin.snapshot(), unbroken(tmp_path, 900), 0.0)


def test_the_state_before_a_failed_step_is_saved_to_a_file(
    tmp_path: Path, core: BrokenCore
) -> None:
    """The sentence names the file; with the failing step's inputs it resumes as the twin would."""
    twin = started(tmp_path)
    twin.failure_folder = tmp_path
    with pytest.raises(SolverError) as caught:
        twin.advance(300)
    path = tmp_path / f"small_failed_step_{BREAKS_AT + 1}.state"
    assert str(caught.value).endswith(f"state and inputs of that step are in {path}.")
    assert "\n" not in str(caught.value)
    kept = load_state(path)
    assert kept.about.step == BREAKS_AT
    assert f"step {BREAKS_AT + 1} at" in kept.about.failure
    again = Twin.restore(path, twin.scene)
    with pytest.raises(SolverError):
        again.advance(1)
    assert again.steps == BREAKS_AT
    core.broken = False
    again.advance(900 - BREAKS_AT)
    assert not differences(again.snapshot(), unbroken(tmp_path, 900), 0.0)


def test_an_unwritable_folder_is_reported_too(tmp_path: Path, core: BrokenCore) -> None:
    """Both problems in one sentence; the twin still holds its last good state."""
    twin = started(tmp_path)
    twin.failure_folder = tmp_path / "none"
    with pytest.raises(
        SolverError, match=r"not finite.*cannot be written \(No such file"
    ) as caught:
        twin.advance(300)
    assert "\n" not in str(caught.value)
    assert twin.steps == BREAKS_AT

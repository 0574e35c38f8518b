"""The row on the gain of lanes: consistent numbers, and a check of equality that can fail."""

from __future__ import annotations

import json

import pytest

import benchmarks.lane_gain as study
from benchmarks.__main__ import main
from benchmarks.lane_gain import FULL, QUICK, gain_rows, gain_table
from rope_twin.core.jit.wide import LANES
from rope_twin.core.lanes.group import why_alone
from rope_twin.core.lanes.joined_group import why_joined_alone
from rope_twin.scene.joined_model import build_joined
from rope_twin.scene.rigging import is_joined
from rope_twin.scene.rope_model import build
from rope_twin.scene.schema import Scene


def test_a_row_is_consistent() -> None:
    """All members are in lanes, none differs, and the gain is that of the two times."""
    (row,) = gain_rows(QUICK)
    assert (row.members, row.in_lanes, row.unequal, row.failed) == (LANES, LANES, 0, 0)
    assert 0.0 <= row.given_up <= 0.05
    assert row.gain_least <= row.gain <= row.gain_most
    assert row.gain == pytest.approx(row.alone_ns_per_node_step / row.lanes_ns_per_node_step)
    heads, cells = gain_table([row])
    assert dict(zip(heads, cells, strict=True))["equal to alone"] == f"{LANES} of {LANES}"


def test_what_differs_is_counted(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """The command fails if a member has other bits than alone."""
    assert main(["lanes", "--quick", "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["rows"][0]["unequal"] == 0
    monkeypatch.setattr(study, "_same", lambda together, alone, number: number > 0)
    assert main(["lanes", "--quick"]) == 1
    assert f"{LANES - 1} of {LANES}" in capsys.readouterr().out


def test_every_scene_of_the_benchmark_steps_in_lanes() -> None:
    """A row must not compare members alone with themselves."""
    assert not [case.scene for case in FULL if _why_alone(case.load())]


def _why_alone(scene: Scene) -> str:
    return (
        why_joined_alone(build_joined(scene).system)
        if is_joined(scene)
        else why_alone(build(scene))
    )

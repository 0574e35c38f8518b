"""Load charts: neighbouring values, mirrored headings, and files rejected in one sentence."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

from rope_twin.errors import InputError
from rope_twin.scene.load_chart import read_load_chart

CHART: dict[str, Any] = {
    "format": 1,
    "plan": "lift",
    "scene": "deep_lift",
    "scene_digest": "0123",
    "percentile": 90.0,
    "tp_s": [7.0, 9.0, 12.0],
    "heading_deg": [180.0, 135.0],
    "symmetric": True,
    "phases": {
        "lowering": {
            "kind": "lowering",
            "depth_m": [1000.0, 2900.0],
            "limiting_hs_m": [[4.0, 3.0], [2.5, 2.0], [None, 1.5]],
            "governing": [["swl_n"] * 2] * 3,
            "hook_load_n": [[3.6e5, 3.6e5], [3.5e5, 3.6e5], [None, 3.4e5]],
        }
    },
}

PHASE: dict[str, Any] = CHART["phases"]["lowering"]


def written(tmp_path: Path, chart: object) -> Path:
    """Return the path of a chart."""
    path = tmp_path / "load_chart.json"
    path.write_text(json.dumps(chart))
    return path


@pytest.mark.parametrize(
    ("period", "heading", "allowed"),
    [
        (7.0, 180.0, 4.0),
        (8.0, 180.0, 2.5),  # the lower of 4.0 and 2.5
        (8.0, 150.0, 2.0),  # the lowest of four
        (9.0, 135.0, 2.0),
        (9.0, -135.0, 2.0),  # from the other side
        (9.0, -180.0, 2.5),
        (12.0, 180.0, 0.0),
        (6.9, 180.0, 0.0),  # beyond the chart
        (9.0, 90.0, 0.0),
    ],
)
def test_the_lowest_neighbour_is_the_limit(
    period: float, heading: float, allowed: float, tmp_path: Path
) -> None:
    """Limits are not interpolated upward; nothing is allowed beyond the axes."""
    chart = read_load_chart(written(tmp_path, CHART))
    assert chart.allowed_height_m("lowering", period, heading) == allowed


def test_an_unknown_phase_is_named_with_the_nearest(tmp_path: Path) -> None:
    """With the nearest known one."""
    chart = read_load_chart(written(tmp_path, CHART))
    with pytest.raises(InputError, match="no such phase; did you mean 'lowering'"):
        chart.allowed_height_m("lowerin", 9.0, 180.0)


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"format": 9}, "a load chart of format 9, this version reads 1"),
        ({"tp_s": []}, "is empty, not finite, or has a value twice"),
        ({"tp_s": [7.0, 7.0, 9.0]}, "has a value twice"),
        ({"tp_s": [7.0, 9.0]}, "a table has not 2 rows of 2"),
        ({"heading_deg": 180.0}, "it is not a load chart"),
        ({"phases": {"lowering": {}}}, "it lacks the key 'depth_m'"),
        ({"phases": [1]}, "it is not a load chart"),
        ({"phases": {"lowering": PHASE | {"limiting_hs_m": [[-1.0, 1.0]] * 3}}},
         "a limiting height is negative or not finite"),
    ],
)  # fmt: skip
def test_invalid_charts_are_rejected(change: dict[str, Any], said: str, tmp_path: Path) -> None:
    """One sentence with the file and the remedy."""
    path = written(tmp_path, CHART | change)
    with pytest.raises(InputError) as caught:
        read_load_chart(path)
    assert said in str(caught.value)
    assert str(caught.value).startswith(str(path))
    assert "\n" not in str(caught.value)


def test_files_that_are_not_charts_are_rejected(tmp_path: Path) -> None:
    """Missing files, and files of something else."""
    with pytest.raises(InputError, match=r"it cannot be read \(No such file or directory\)"):
        read_load_chart(tmp_path / "none.json")
    path = tmp_path / "text.json"
    path.write_text("not JSON")
    with pytest.raises(InputError, match="it is not JSON"):
        read_load_chart(path)
    with pytest.raises(InputError, match="a load chart of format None"):
        read_load_chart(written(tmp_path, [1, 2]))


@pytest.mark.parametrize(
    ("heading", "allowed"),
    [(135.0, 2.0), (-225.0, 2.0), (180.0, 2.5), (-180.0, 2.5), (-135.0, 0.0), (225.0, 0.0)],
)
def test_headings_are_mirrored_only_if_declared(
    heading: float, allowed: float, tmp_path: Path
) -> None:
    """A crane over the side is not the same to port and starboard."""
    chart = read_load_chart(written(tmp_path, CHART | {"symmetric": False}))
    assert chart.allowed_height_m("lowering", 9.0, heading) == allowed

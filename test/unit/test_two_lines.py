"""Two lines side by side: distance and crossings against geometry, and a run of the small loop."""

from __future__ import annotations

import json
import math
from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from rope_twin import Snapshot, load_scene
from rope_twin.cli import main
from rope_twin.errors import InputError
from rope_twin.scene.schema import Scene
from rope_twin.studies.two_lines.watch import LineWatch, lines_of

DEPTH = 1000.0


@pytest.fixture(scope="module")
def scene() -> Scene:
    return load_scene("two_line_loop")


def seen(time_s: float, lean: float, *, aside: float = 0.0, wave: float = 0.0) -> Snapshot:
    """Both lines in two straight parts each; the main one leans over by `lean` at mid-depth.

    Hang-offs at x = -8 and 8; aside: y of the main line at mid-depth; wave: x that both have more
    of there. The sheave is in the middle below them.
    """

    def part(*points: tuple[float, float, float]) -> Any:
        path = [np.linspace(a, b, 24) for a, b in pairwise(points)]
        return SimpleNamespace(node_position_m=np.concatenate(path))

    half, bottom = -0.5 * DEPTH, (0.0, 0.0, -DEPTH)
    main_mid, other_mid = (lean + wave, aside, half), (4.0 + wave, 0.0, half)
    ropes = [
        part((-8.0, 0.0, 0.0), main_mid), part(main_mid, bottom),
        part((8.0, 0.0, 0.0), other_mid), part(other_mid, bottom),
    ]  # fmt: skip
    sheave = SimpleNamespace(position_m=np.array(bottom))
    return cast(Snapshot, SimpleNamespace(ropes=ropes, sheaves=[sheave], time_s=time_s))


def test_each_line_goes_from_its_winch_to_the_sheave(scene: Scene) -> None:
    """By number, main first."""
    assert lines_of(scene) == ([0, 1], [2, 3])


def test_lines_that_cross_are_told_where_and_at_which_angle(scene: Scene) -> None:
    """The upper halves meet where x = -8 + (lean + 8)·s and 8 - 4·s agree: s = 16/(lean + 12)."""
    watch = LineWatch(scene)
    assert watch.look(seen(0.0, -4.0)) == []
    assert watch.nearest[-1].distance_m == pytest.approx(8.0 * 0.04, rel=0.1), "near the sheave"
    lean, half = 20.0, 0.5 * DEPTH
    (event,) = watch.look(seen(1.0, lean, wave=0.0))
    share = 16.0 / (lean + 12.0)
    assert (event.what, event.time_s) == ("cross", 1.0)
    assert event.depth_m == pytest.approx(share * half, abs=1e-6)
    angle = math.atan((lean + 8.0) / half) + math.atan(4.0 / half)
    assert event.angle_deg == pytest.approx(math.degrees(angle), rel=1e-6)
    assert event.gap_m == 0.0
    assert watch.look(seen(2.0, lean + 0.5)) == [], "it has moved by less than 5 %"
    (gone,) = watch.look(seen(3.0, -4.0))
    assert gone.what == "part"
    assert [event.what for event in watch.events] == ["cross", "part"]


def test_lines_that_pass_each_other_at_a_distance_say_so(scene: Scene) -> None:
    """The main line is 6 m aside at mid-depth, so 6·s where they cross."""
    watch = LineWatch(scene)
    (event,) = watch.look(seen(0.0, 20.0, aside=6.0))
    assert event.gap_m == pytest.approx(6.0 * 0.5, rel=1e-6)
    assert watch.nearest[-1].distance_m < 3.0


def test_a_line_that_turns_up_again_is_counted(scene: Scene) -> None:
    """A loop of slack rope."""
    watch, shot = LineWatch(scene), seen(0.0, -4.0)
    shot.ropes[0].node_position_m[10, 2] = -300.0
    watch.look(shot)
    assert watch.turned_up == 1


def test_what_has_no_two_lines_is_refused(scene: Scene) -> None:
    """In one sentence."""
    with pytest.raises(InputError, match="has 0 sheaves; give a scene with one, such as two_line"):
        lines_of(load_scene("two_line_lift"))
    together = replace(scene.hang_offs[0], at_m=scene.ship.hang_off_m)
    with pytest.raises(InputError, match="both are at one place; set `at_m` of one of them aside"):
        LineWatch(replace(scene, hang_offs=(together,)))


def test_a_loop_runs_calm_and_in_a_sea(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Forty seconds each: smooth when calm, tensions swing in the sea, crossings with depths."""
    assert main(["lines", "two_line_loop", "--seconds", "40", "--into", str(tmp_path)]) == 0
    told = capsys.readouterr()
    found = json.loads((tmp_path / "two_lines.json").read_text())
    assert (tmp_path / "two_lines.png").stat().st_size > 10_000
    assert "main" in told.out
    assert "the lines cross at" in told.err
    calm, rough = found["calm"], found["in_sea_state"]
    assert max(noise["jump_pct"] for noise in calm["noise"]) < 0.01
    assert min(noise["events"] for noise in calm["noise"]) > 0
    for line in ("main", "haulback"):
        assert rough["tension_n"][line] != calm["tension_n"][line]
        assert rough["tension_n"][line]["max"] < 1.2 * calm["tension_n"][line]["mean"]
    event = calm["crossings"][0]
    assert 0.0 < event["depth_m"] < 1500.0
    assert event["gap_m"] < 0.1, "the current is in the plane of both hang-offs"
    assert 0.0 < event["angle_deg"] < 10.0


def test_too_short_a_run_is_refused(capsys: pytest.CaptureFixture[str]) -> None:
    """Before anything is computed."""
    assert main(["lines", "two_line_loop", "--seconds", "3"]) == 1
    assert "3 s cannot be run; give 10 to 7200 s" in capsys.readouterr().err

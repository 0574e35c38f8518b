"""Studies as files: what is read, which runs follow, and what is refused in one sentence."""

from __future__ import annotations

from collections import Counter
from pathlib import Path

import numpy as np
import pytest
from study_text import DRAWN, GOOD, written

from rope_twin.errors import RopeTwinError
from rope_twin.files import share_dir
from rope_twin.scene.load import change_scene
from rope_twin.scene.schema import Scene
from rope_twin.studies.ensemble import MemberHeave
from rope_twin.studies.study_design import Study, StudyRun, design_runs, read_study, run_of
from rope_twin.studies.study_run import cut_into_batches


def runs_of(study: Study, scene: Scene) -> list[StudyRun]:
    return [run_of(study, scene, *numbered) for numbered in enumerate(design_runs(study))]


def test_a_grid_is_every_combination(tmp_path: Path) -> None:
    study, scene = read_study(written(tmp_path))
    runs = runs_of(study, scene)
    assert [run.number for run in runs] == list(range(12))
    assert len({run.values for run in runs}) == 12
    changed = change_scene(runs[-1].scene, runs[-1].changes)
    assert runs[-1].values == (22000.0, "steel_wire_76mm", "rough")
    assert changed.payloads[0].mass_kg == 22000.0
    assert changed.ropes[0].made_of[0].rope.diameter_m == 0.0762
    drag = next(own for own in changed.effects if hasattr(own, "tangential"))
    assert (drag.normal, drag.tangential) == (1.9, 0.03)


def test_a_hypercube_meets_each_part_equally_often(tmp_path: Path) -> None:
    text = DRAWN.replace("values: [18000.0, 20000.0, 22000.0]", "from: 18000.0, to: 22000.0")
    study, _ = read_study(written(tmp_path, text))
    runs = design_runs(study)
    masses = np.array([values[0] for values in runs], float)
    parts = np.floor((masses - 18000.0) / 4000.0 * 12).astype(int)
    assert sorted(parts) == list(range(12))
    assert Counter(values[1] for values in runs) == {"steel_wire_40mm": 6, "steel_wire_76mm": 6}
    assert design_runs(study) == runs
    other, _ = read_study(written(tmp_path, text.replace("seed: 3", "seed: 4")))
    assert design_runs(other) != runs


def test_runs_of_one_scene_share_a_batch(tmp_path: Path) -> None:
    study, scene = read_study(written(tmp_path))
    batches = cut_into_batches(study, runs_of(study, scene), 4)
    assert [len(batch.runs) for batch in batches] == [4, 2, 4, 2]
    assert sorted(run.number for batch in batches for run in batch.runs) == list(range(12))
    for batch in batches:
        assert len({run.values[1] for run in batch.runs}) == 1


def test_the_ship_rides_on_the_waves_of_its_run(tmp_path: Path) -> None:
    """Twice the height is twice the heave: not the waves of the scene's file."""
    text = GOOD.replace("scene: shallow_lift", "scene: wave_zone").partition("vary:")[0]
    path = "effects.waves.jonswap.significant_height_m"
    study, scene = read_study(
        written(tmp_path, text + f"vary:\n  - {{path: {path}, values: [1.0, 2.0]}}\n")
    )
    seas = MemberHeave(scene, 29.0)
    low, high = (seas.heave(run.changes, 0.0) for run in runs_of(study, scene))
    assert low is not None
    assert high is not None
    assert (high.stamp_ns == low.stamp_ns).all()
    assert high.position_m == pytest.approx(2.0 * low.position_m, rel=1e-9, abs=1e-12)
    with pytest.raises(RopeTwinError, match=r"vary effects\.waves\.seed instead"):
        seas.heave((), 5.0)


BAD = [
    ("scene: shallow_lift", "scene: shalow_lift", "did you mean 'shallow_lift'?"),
    ("seconds: 2.0", "seconds: -2.0", "line 3, seconds: -2 s is out of range; give 0.01 "),
    ("vary:", "varry:", "unknown key; did you mean 'vary'?"),
    ("values: [18000.0, 20000.0, 22000.0]", "from: 18000.0, to: 22000.0",
     "on a grid 'payloads[0].mass_kg' needs its numbers; add `count`, or `latin_hypercube`."),
    ("values: [18000.0, 20000.0, 22000.0]", "from: 3.0, to: 2.0, count: 3",
     "line 5, vary[0]: `from` and `to` are no range; give both, the lesser as `from`."),
    ("values: [18000.0, 20000.0, 22000.0]", "values: [1.0], names: [a]",
     "2 ways of saying what it can be; give one of from and to, values, names, cases."),
    ("name: cable, ", "name: drag, ", "two variables are called 'drag'; give one of "),
    ("name: smooth", "name: rough", "two cases have one name; rename one."),
    ("stranded_wire, piece", "stranded, piece", "there is no curve 'stranded'; known: "),
]  # fmt: skip


@pytest.mark.parametrize(("old", "new", "said"), BAD)
def test_what_the_file_may_not_say(old: str, new: str, said: str, tmp_path: Path) -> None:
    assert old in GOOD
    with pytest.raises(RopeTwinError) as refused:
        read_study(written(tmp_path, GOOD.replace(old, new, 1)))
    assert said in str(refused.value)
    assert "\n" not in str(refused.value)


IMPOSSIBLE = [
    ("payloads[0].mass_kg", "payloads[0].mas_kg", "vary[0]: ", "did you mean 'mass_kg'?"),
    ("[18000.0,", "[-1.0,", "vary[0]: ", "-1 kg is out of range"),
    ("steel_wire_76mm", "steel_wire_7mm", "vary[1]: ", "7 mm is out of the range"),
    ("ropes[0].rope", "payloads[0].shape", "vary[1]: ", "it takes no name; names serve ropes[0]."),
    ("effects.drag.normal: 1.2", "effects.dragg.normal: 1.2", "vary[2]: ", "did you mean 'drag'?"),
]  # fmt: skip


@pytest.mark.parametrize(("old", "new", "place", "said"), IMPOSSIBLE)
def test_what_cannot_vary(old: str, new: str, place: str, said: str, tmp_path: Path) -> None:
    study, scene = read_study(written(tmp_path, GOOD.replace(old, new, 1)))
    with pytest.raises(RopeTwinError) as refused:
        runs_of(study, scene)
    assert place in str(refused.value)
    assert said in str(refused.value)


@pytest.mark.parametrize(
    ("scene", "said"),
    [("still_water", "lies still; leave it out"), ("wave_zone", "vary effects.waves.seed instead")],
)
def test_no_sea_to_begin_elsewhere_in(scene: str, said: str, tmp_path: Path) -> None:
    text = GOOD.replace("shallow_lift", scene).replace("payloads[0].mass_kg", "sea_offset_s")
    study, own = read_study(written(tmp_path, text))
    with pytest.raises(RopeTwinError) as refused:
        runs_of(study, own)
    assert "vary[0]: sea_offset_s: the s" in str(refused.value)
    assert said in str(refused.value)


@pytest.mark.parametrize("path", sorted((share_dir() / "config" / "studies").glob("*.yaml")))
def test_the_studies_that_come_with_it_are_sound(path: Path) -> None:
    study, scene = read_study(path)
    runs = runs_of(study, scene)
    assert len(runs) >= 16
    assert len(cut_into_batches(study, runs)) >= 2

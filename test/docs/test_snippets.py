"""Snippets of the README and the tutorials run, and print what the pages show."""

from __future__ import annotations

import json
import os
import re
from collections.abc import Callable
from pathlib import Path

import pytest
from snippets import run_page

from rope_twin import Twin, load_scene
from rope_twin.feeds.configuration import read_settings
from rope_twin.planning.plan_reader import read_plan
from rope_twin.scene.rope_warnings import sense_checks
from rope_twin.scene.schema import Scene
from rope_twin.studies.study_design import Study, StudyRun, design_runs, read_study, run_of

ROOT = Path(__file__).resolve().parents[2]
TUTORIALS = ROOT / "docs" / "tutorials"
OVER_ROS = "winch_and_mru"  # test/ros/test_tutorial_feed.py runs that one
LESSONS = [page for page in TUTORIALS.glob("*.md") if page.stem not in ("index", OVER_ROS)]


GUIDES = [ROOT / "docs" / "how-to" / "fleet.md", ROOT / "docs" / "reference" / "api.md"]
LAST = TUTORIALS / "limiting_sea_state.md"  # compiles a splash zone in lanes for itself
PAGES = [page for page in (ROOT / "README.md", *sorted(LESSONS), *GUIDES) if page != LAST]


@pytest.mark.parametrize(
    "page", [*PAGES, pytest.param(LAST, marks=pytest.mark.long)], ids=lambda page: page.stem
)
def test_a_page_runs(page: Path, tmp_path: Path) -> None:
    ran = list(run_page(page, tmp_path))
    assert ran
    assert [one.complaint() for one in ran if one.complaint()] == []


def test_the_scene_of_the_readme_is_the_tutorials_and_balances_by_hand(tmp_path: Path) -> None:
    """Payload (12,000 kg - 1025 kg/m³·2.5 m³)·g and 54.5 N/m of wire in water."""
    scenes = [
        re.findall(r"^about: 12 t.*?(?=^```)", path.read_text("utf-8"), re.MULTILINE | re.DOTALL)[0]
        for path in (ROOT / "README.md", TUTORIALS / "own_lift.md")
    ]
    keys = [re.sub(r" +#.*", "", scene) for scene in scenes]
    assert keys[0] == keys[1]
    (tmp_path / "my_lift.yaml").write_text(scenes[0], "utf-8")
    scene = load_scene(tmp_path / "my_lift.yaml")
    assert sense_checks(scene) == []
    by_hand_n = (12000.0 - 1025.0 * 2.5) * 9.80665 + 54.5 * 800.0
    assert Twin(scene).snapshot().tension_top_n == pytest.approx(by_hand_n, rel=2e-3)


@pytest.mark.parametrize(
    ("guide", "read"),
    [("parameter_studies", lambda path: runs_of(*read_study(path))), ("lift_planning", read_plan),
     ("instruments", lambda path: read_settings(str(path)))],
    ids=["study", "plan", "feeds"],
)  # fmt: skip
def test_the_first_file_of_a_guide_is_valid(
    guide: str, read: Callable[[Path], object], tmp_path: Path
) -> None:
    page = (ROOT / "docs" / "how-to" / f"{guide}.md").read_text("utf-8")
    path = tmp_path / "file.yaml"
    path.write_text(page.partition("```yaml\n")[2].partition("```")[0], "utf-8")
    assert read(path)


@pytest.mark.parametrize("path", sorted(TUTORIALS.glob("*.ipynb")), ids=lambda path: path.stem)
def test_a_notebook_runs(path: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Every cell, and the printed lines are those that the page shows."""
    import nbformat
    from nbclient import NotebookClient

    monkeypatch.setenv("JUPYTER_PLATFORM_DIRS", "1")
    monkeypatch.setenv("MPLCONFIGDIR", str(tmp_path))
    paths = [str(ROOT), *filter(None, [os.environ.get("PYTHONPATH")])]
    monkeypatch.setenv("PYTHONPATH", os.pathsep.join(paths))
    shown = nbformat.read(path, as_version=4)
    notebook = nbformat.from_dict(json.loads(json.dumps(shown)))
    NotebookClient(notebook, timeout=300, kernel_name="python3").execute()
    assert printed(shown)
    assert printed(notebook) == printed(shown)


def runs_of(study: Study, scene: Scene) -> list[StudyRun]:
    """Return the runs of a study, which checks each path and value in its scene."""
    return [run_of(study, scene, *numbered) for numbered in enumerate(design_runs(study))]


def printed(notebook: object) -> list[str]:
    """Return what each cell of a notebook prints; a kernel sends it in parts of any length."""
    outputs = [cell.get("outputs", []) for cell in notebook["cells"]]  # type: ignore[index]
    texts = ("".join(one["text"] for one in own if one["output_type"] == "stream")
             for own in outputs)  # fmt: skip
    return [text for text in texts if text]

"""The twin as programs import it: scenes by name, refusals as errors."""

from __future__ import annotations

import math
import re
from collections.abc import Callable
from pathlib import Path

import pytest
from scene_text import STEPPED, written

from rope_twin import Twin, fed, load_scene
from rope_twin.errors import InputError, SceneError
from rope_twin.twin import twin as internal
from rope_twin.twin.motion.ship_motion import ShipPose
from rope_twin.twin.readings import Measurement
from rope_twin.twin.winch.commands import WinchCommand

NO_POSE = ShipPose(0, (math.nan, 0.0, 0.0), (0.0, 0.0, 0.0))
REFUSED: dict[str, tuple[Callable[[Twin], str], str]] = {
    "submit_heave": (lambda twin: twin.submit_heave(0, math.nan, 0.0), "finite"),
    "submit_pose": (lambda twin: twin.submit_pose(NO_POSE), "must be finite"),
    "submit_speed": (lambda twin: twin.submit_speed(None, 99.0), "99"),
    "submit_command": (lambda twin: twin.submit_command(None, WinchCommand("length", -5.0)), "-5"),
    "submit_current": (lambda twin: twin.submit_current([[0.0, 99.0, 0.0]]), "is no sea current"),
    "submit_measurement": (
        lambda twin: twin.submit_measurement(Measurement.of_winch(0, math.inf)),
        "finite",
    ),
    "submit_figures": (lambda twin: twin.submit_figures(submerged_weight=-1.0), "submerged_weight"),
    "submit_forecast_score": (
        lambda twin: twin.submit_forecast_score(coverage=1.5, judged=5, factor=1.0, age_s=0.1),
        "a coverage of 1.5",
    ),
    "submit_lower_end": (
        lambda twin: twin.submit_lower_end(0, (0.0, 0.0, -9.0), (0.0, 0.0, 0.0)),
        "does not let another simulator move it",
    ),
    "submit_cut": (lambda twin: twin.submit_cut(None, 0.1), "of rope stay there"),
}


@pytest.fixture(scope="module")
def scene_file(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return written(tmp_path_factory.mktemp("scene"), STEPPED)


@pytest.mark.parametrize("name", REFUSED)
def test_a_refused_offer_raises_its_sentence(name: str, scene_file: Path) -> None:
    """It was returned, and easily overlooked; the suite's own twin returns it."""
    submit, words = REFUSED[name]
    with pytest.raises(InputError, match=words) as caught:
        submit(Twin(scene_file))
    inside: internal.Twin = internal.Twin(load_scene(scene_file))
    assert submit(inside) == str(caught.value)  # type: ignore[arg-type]


def test_every_offer_raises() -> None:
    submits = {name for name in dir(internal.Twin) if name.startswith("submit_")}
    assert submits == set(REFUSED)
    assert all(getattr(Twin, name) is not getattr(internal.Twin, name) for name in submits)
    assert all("InputError" in str(getattr(Twin, name).__doc__) for name in submits)


def test_what_runs_by_itself_never_raises_for_an_input() -> None:
    """A sensor that lies is reported by nodes and runs, and ends none of them."""
    assert not issubclass(internal.Twin, Twin)


def test_a_scene_is_given_by_name_by_path_or_as_it_is(scene_file: Path, tmp_path: Path) -> None:
    """All the same twin, to the bit that of the suite; its saved state and branches too."""
    scene = load_scene(scene_file)
    twins = [Twin(scene), Twin(scene_file), Twin(str(scene_file)), internal.Twin(scene)]
    for twin in twins:
        assert twin.submit_speed(None, 0.5) == ""
        twin.advance(50)
    assert len({twin.snapshot().tension_top_n for twin in twins}) == 1
    twins[1].save(tmp_path / "state")
    restored, branch = Twin.restore(tmp_path / "state", scene_file), twins[1].branch()
    for twin in (twins[0], restored, branch):
        twin.advance(50)
    assert len({twin.snapshot().tension_top_n for twin in (twins[0], restored, branch)}) == 1
    for twin in (restored, branch):
        with pytest.raises(InputError):
            twin.submit_speed(None, 99.0)
    assert Twin("still_water").scene.name == "still_water"
    with pytest.raises(SceneError, match="did you mean 'still_water'"):
        Twin("still_watr")


def test_feeding_continues_where_it_ended() -> None:
    """In two parts as in one, bit for bit; and after time without inputs."""
    whole = [snapshot.tension_top_n for snapshot in fed(Twin("shallow_lift"), 4.0)]
    twin = Twin("shallow_lift")
    parts = [snapshot.tension_top_n for until_s in (2.0, 4.0) for snapshot in fed(twin, until_s)]
    assert parts == whole
    late = Twin("shallow_lift")
    late.advance(100)
    assert (
        max(snapshot.tension_top_n for snapshot in fed(late, 6.0)) > late.snapshot().tension_top_n
    )


@pytest.mark.parametrize("until_s", [math.nan, -1.0, 0.5])
def test_feeding_into_the_past_is_refused(until_s: float) -> None:
    twin = Twin("still_water")
    twin.advance(100)
    with pytest.raises(InputError, match=r"fed: .* the twin is at 1 s; give a later"):
        list(fed(twin, until_s))


def test_the_example_of_the_readme_runs(capsys: pytest.CaptureFixture[str]) -> None:
    readme = (Path(__file__).parents[2] / "README.md").read_text(encoding="utf-8")
    (example,) = re.findall(r"```python\n(.*?)```", readme, re.DOTALL)
    exec(example, {})
    assert 150e3 < float(capsys.readouterr().out) < 300e3

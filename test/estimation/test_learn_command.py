"""`rope_twin learn BAG`: table, JSON and refusals; what manoeuvres and a tare would tell."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from learned_lift import SECONDS, recorded, scene, write_bag
from small_scene import SMALL_SCENE

from rope_twin.cli import main
from rope_twin.errors import InputError
from rope_twin.estimation import report
from rope_twin.estimation.figures import (
    BIAS,
    GAIN,
    INDEX,
    NAMES,
    Gaussian,
    check_learnable,
    prior_of,
)
from rope_twin.estimation.recorded_lift import read_lift
from rope_twin.messages.cdr import decode, serialise
from rope_twin.recording.bag import BagReader
from rope_twin.recording.bag_writer import BagWriter
from rope_twin.scene.instruments import Learning
from rope_twin.scene.load import load_scene
from rope_twin.topics import BY_NAME


@pytest.fixture(scope="module")
def bag(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a bag of the small rope with known figures."""
    return write_bag(tmp_path_factory.mktemp("bags") / "lift")


def test_a_pause_of_a_day_is_not_stepped_through(tmp_path: Path) -> None:
    """One minute, a pause of a day, three minutes: the latter are taken, and a warning says so."""
    plain = read_lift(write_bag(tmp_path / "plain"), "", scene())
    paused = read_lift(write_bag(tmp_path / "day", earlier=(86400.0, 60.0)), "", scene())
    for name in ("tension", "line_out", "heave"):
        tables = (getattr(one.lift, name).table for one in (plain, paused))
        assert np.allclose(*tables, rtol=0.0, atol=1e-6)
    assert plain.problems == ()
    assert paused.problems == (
        "heave or line out has 1 pause of more than 10 min; only the longest stretch is taken, "
        "182 s of 86582 s, from 86400 s on",
    )


def test_minutes_without_data_do_not_count(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Eight minutes are stepped; five of them lie in a pause between one minute and three."""
    file = tmp_path / "small.yaml"
    file.write_text(SMALL_SCENE)
    bag = write_bag(tmp_path / "minutes", earlier=(360.0, 60.0))
    assert main(["learn", str(bag), "--scene", str(file)]) == 0
    assert "after 3 min; 100 % of the last minute's" in capsys.readouterr().out


def test_learn_prints_json(bag: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """True weight, mass and drag lie in their intervals; advice has numbers; a picture is there."""
    file = tmp_path / "small.yaml"
    sure = "learning: {friction_pct: 0.0, friction_uncertainty_pct: 0.001, heave_delay_s: 0.0}\n"
    file.write_text(SMALL_SCENE + sure)
    picture = tmp_path / "learned.png"
    words = ["learn", str(bag), "--scene", str(file), "--json", "--out", str(picture)]
    assert main(words) == 0
    printed = json.loads(capsys.readouterr().out)
    theta, _, _ = recorded()
    own = {one["name"]: one for one in printed["figures"]}
    base = report.base_values(scene())
    for k, name in enumerate(NAMES[:3]):
        truth = base[name] * np.exp(theta[k])
        slack = 0.5 * (own[name]["high"] - own[name]["low"])
        assert own[name]["low"] - 0.5 * slack < truth < own[name]["high"] + 0.5 * slack, name
    assert own["submerged_weight"]["unit"] == "N"
    assert own["submerged_weight"]["prior"] == pytest.approx(9.80665 * (8000.0 - 1.5 * 1025.0))
    assert "tare" in own["submerged_weight"]["advice"]
    assert own["submerged_weight"]["correlated"] in (BIAS, GAIN)
    assert [block["end_s"] for block in printed["blocks"]] == [120.0, 180.0]
    assert printed["alarm"] is None
    assert set(printed["derived"]) == {"mass_in_air_kg", "added_mass_kg"}
    assert picture.stat().st_size > 10_000


def test_figures_that_the_run_took_over_are_scored(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """A weight that was right lies in the interval, one that is 30 % off does not."""
    theta, _, _ = recorded()
    right, wrong = float(np.exp(theta[0])), 1.3 * float(np.exp(theta[1]))
    taken = write_bag(tmp_path / "run", submerged_weight=right, oscillating_mass=wrong)
    file = tmp_path / "small.yaml"
    file.write_text(SMALL_SCENE)
    assert main(["learn", str(taken), "--scene", str(file), "--tared", "--json"]) == 0
    own = {one["name"]: one for one in json.loads(capsys.readouterr().out)["figures"]}
    base = report.base_values(scene())
    assert own["submerged_weight"]["applied"] == pytest.approx(base["submerged_weight"] * right)
    assert abs(own["submerged_weight"]["applied_off_sds"]) < 3.0
    assert own["oscillating_mass"]["applied_off_sds"] > 3.0
    assert own["payload_drag"]["applied"] is None
    assert main(["learn", str(taken), "--scene", str(file), "--tared"]) == 0
    assert "outside" in capsys.readouterr().out


def test_tension_in_kn_is_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """The message has both tensions; no figures are printed that nothing was learned of."""
    wrong = write_bag(tmp_path / "kn", unit_n=1000.0)
    file = tmp_path / "small.yaml"
    file.write_text(SMALL_SCENE)
    assert main(["learn", str(wrong), "--scene", str(file), "--tared"]) == 1
    printed = capsys.readouterr()
    assert "nothing is learned from" in printed.err
    assert "unit (N)" in printed.err
    assert not printed.out


def test_values_that_a_twin_would_refuse_are_left_out(bag: Path, tmp_path: Path) -> None:
    """Spikes of the line counter are no line that the model follows."""
    topics = [BY_NAME["ship/heave"], BY_NAME["winch/measured"]]
    with BagReader(bag) as whole, BagWriter(tmp_path / "spikes", topics) as spikes:
        for topic in topics:
            for number, (log_ns, data) in enumerate(whole.messages(f"/{topic.name}")):
                sent = data
                if topic.name == "winch/measured" and number % 1000 == 500:
                    message = decode(topic.name, data)
                    message.position = message.position + 30.0
                    sent = serialise(message)
                spikes.write(topic.name, log_ns, sent)
    (tmp_path / "small.yaml").write_text(SMALL_SCENE)
    small = load_scene(tmp_path / "small.yaml")
    clean, read = (read_lift(one, scene=small) for one in (bag, tmp_path / "spikes"))
    assert clean.problems == ()
    (words,) = read.problems
    assert "values of line out, impossible for the scene's winch, left out" in words
    assert np.ptp(read.lift.line_out.table[:, 1]) == np.ptp(clean.lift.line_out.table[:, 1])
    assert len(read.lift.tension.table) == len(clean.lift.tension.table)


def test_nothing_is_learned_behind_a_fault(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """A load pin that sticks at 130 s ends it: figures are those of the two minutes before."""
    file = tmp_path / "small.yaml"
    file.write_text(SMALL_SCENE)
    stuck = write_bag(tmp_path / "stuck", stuck_s=130.0)
    words = ["learn", str(stuck), "--scene", str(file), "--tared"]
    assert main([*words, "--json"]) == 3
    printed = json.loads(capsys.readouterr().out)
    assert printed["alarm"]["causes"] == "load pin stuck"
    assert printed["alarm"]["begun_s"] == pytest.approx(130.0, abs=0.1)
    assert [block["end_s"] for block in printed["blocks"]] == [120.0]
    assert main(words) == 3
    assert "load pin stuck, since 130 s; nothing behind it" in capsys.readouterr().err
    early = write_bag(tmp_path / "early", stuck_s=50.0)
    assert main(["learn", str(early), "--scene", str(file), "--tared"]) == 1
    assert "before anything is learned, load pin stuck" in capsys.readouterr().err


def test_learn_refuses_a_short_bag(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """One sentence with what is needed."""
    short = write_bag(tmp_path / "short", 40.0)
    file = tmp_path / "small.yaml"
    file.write_text(SMALL_SCENE)
    assert main(["learn", str(short), "--scene", str(file)]) != 0
    error = capsys.readouterr().err
    assert "at least 120 s" in error


def test_a_bag_without_a_scene_or_tension(bag: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """The message names the missing part."""
    assert main(["learn", str(bag)]) != 0
    assert "--scene" in capsys.readouterr().err
    assert main(["learn", "sea_2p5m", "--scene", "deep_lift"]) != 0
    assert "0 samples of tension; record winch/measured" in capsys.readouterr().err
    assert main(["learn", str(bag), "--scene", "deep_lift", "--winch", "other"]) != 0
    assert "winch 'other'" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("name", "why"),
    [
        ("two_line_loop", "over a sheave"),
        ("lift_off", "begins on a deck"),
        ("load_transfer", "rigid body hangs on several ropes"),
    ],
)
def test_scenes_that_cannot_be_learned_yet(name: str, why: str) -> None:
    """One sentence says why."""
    with pytest.raises(InputError, match=why):
        check_learnable(load_scene(name))


def test_conditioning_on_a_measurement() -> None:
    """Two figures whose sum is known: measuring one to s leaves the other with s beside the sum."""
    prior = prior_of(Learning(pin_range_n=500e3), 300e3)
    covariance = np.diag(prior.sd**2)
    k, b = INDEX["submerged_weight"], INDEX[BIAS]
    weight_n = 100e3
    covariance[k, k] = (3000.0 / weight_n) ** 2 + 1e-8
    covariance[k, b] = covariance[b, k] = -(3000.0**2) / weight_n
    posterior = Gaussian(prior.mean, covariance)
    words, after = report.tare_action(prior, posterior)
    assert words == "tare"
    gone = 300.0 / np.hypot(1.0, 300.0 / 3000.0)  # of a prior of 3000 measured to 300
    assert after.sd[k] * weight_n == pytest.approx(np.hypot(gone, 10.0), rel=1e-6)
    advice = report.best_actions(posterior, [(words, after)])
    assert set(advice) == {"submerged_weight", BIAS}
    assert advice["submerged_weight"] == "tare: ±3 % to ±0.3 %"


def test_planned_lines_stay_within_the_winch() -> None:
    """Both ways come back; speeds and accelerations are the winch's; no winch, no manoeuvre."""
    plans = list(report.planned_lines(scene(), 200.0))
    assert len(plans) == 3
    for _, t, line in plans:
        speed = np.diff(line) / np.diff(t)
        assert np.abs(speed).max() <= 1.5 + 1e-9
        assert np.abs(np.diff(speed)).max() <= 0.3 / 20.0 + 1e-9
        assert line[-1] == pytest.approx(200.0, abs=2.0)
        assert (line[t < 60.0] == 200.0).all()
    assert len(list(report.planned_lines(scene(), 51.0))) == 2  # no space to haul
    assert SECONDS > 180.0

"""Forecasts of multi-line scenes: winches together, risk of any rope, recordings."""

from __future__ import annotations

import json
import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from bag_samples import START_NS
from fleet_inputs import heave

from rope_twin.cli import main
from rope_twin.errors import InputError
from rope_twin.forecast.heave_process import SAMPLE_S, MotionError
from rope_twin.forecast.live import LiveForecaster, LiveInputs, Series, forecast_rows, order_rows
from rope_twin.forecast.offline import RecordingForecaster
from rope_twin.forecast.orders import (
    LineState,
    below_main_m,
    check_lift_order,
    read_order,
    read_orders,
    scene_at_line,
    suspended_ropes,
    winch_directions,
)
from rope_twin.forecast.recorded_lift import line_to_contact_m, nominal_states, read_lift
from rope_twin.forecast.risk import Limits, compare, risks, tension_limits
from rope_twin.forecast.tension_forecast import (
    BOTTOM,
    DEPTH,
    MARGIN,
    TENSION,
    ForecastSettings,
    Observations,
    TensionForecast,
    TensionForecaster,
)
from rope_twin.messages import encode_heave, encode_measurement
from rope_twin.recording.bag_writer import BagWriter
from rope_twin.scene.load import Change, change_scene, load_scene
from rope_twin.scene.schema import Scene
from rope_twin.topics import BY_NAME
from rope_twin.twin.ensemble.fleet import Fleet, FleetInputs, FleetRecord
from rope_twin.twin.motion.heave_track import ramp
from rope_twin.twin.readings import Measurement

SETTINGS = ForecastSettings(
    members=19, burn_in_s=30.0, motion_error=MotionError(coloured_m=0.0), spread={},
)  # fmt: skip
ORIGIN = 400  # sample
SLOW = 0.02  # m/s, line speed of the aft winch before the origin
PERIOD_S = 0.05


@pytest.fixture(scope="module")
def scene() -> Scene:
    """A module on two winches."""
    return load_scene("two_line_lift")


def test_winches_go_together(scene: Scene) -> None:
    """Beside the main one alike, at the other end of a loop the other way."""
    assert winch_directions(scene) == {"aft_sheave": 1.0}
    assert winch_directions(load_scene("two_line_14km")) == {"haulback_sheave": -1.0}
    assert winch_directions(load_scene("bridle_lift")) == {}
    assert suspended_ropes(scene) == ["fore", "aft"]
    assert suspended_ropes(load_scene("bridle_lift")) == ["hoist"]


def test_line_out_at_the_beginning(scene: Scene) -> None:
    """Each winch has its own, by its name."""
    assert scene_at_line(scene, 600.0) is scene
    own = scene_at_line(scene, 500.0, {"aft_sheave": 510.0})
    assert [line.length_m for line in own.ropes] == [500.0, 510.0]


def test_all_winches_must_follow_an_order(scene: Scene) -> None:
    """A slower winch than the main one holds it back."""
    slow = change_scene(scene, [Change("hang_offs[0].winch.speed_limit_m_per_s", 0.3)])
    now = LineState(600.0, 0.0)
    check_lift_order(read_order("lower:0.3"), slow, now)
    with pytest.raises(InputError, match=r"too fast for 'aft_sheave'; it reaches 0.3 m/s"):
        check_lift_order(read_order("lower:0.4"), slow, now)


def test_line_to_contact_is_that_of_what_hangs_below() -> None:
    """The slings below the main winch's rope count."""
    bridle = load_scene("bridle_lift")
    assert below_main_m(bridle) == 14.0
    landing = load_scene("two_line_landing")
    assert below_main_m(landing) == 0.0
    left_m = line_to_contact_m(landing, 50.0)
    assert left_m == pytest.approx(45.0 - 0.02 * 6.0 + 16.0 - 50.0)


def lines(count: int) -> dict[str, np.ndarray]:
    """Line out of the aft winch until the origin, which pays out slowly at the end."""
    at = SAMPLE_S * (np.arange(count) - ORIGIN)
    return {"aft_sheave": 600.0 + SLOW * np.clip(at + 20.0, 0.0, 20.0)}


def known_of(scene: Scene) -> Observations:
    """A swell that ten minutes reveal, seen almost without error."""
    z = heave(0.6, 11.0, SAMPLE_S * np.arange(ORIGIN + 1))[0]
    z += 1e-3 * np.random.default_rng(3).standard_normal(ORIGIN + 1)
    return Observations(200.0, z, np.full(ORIGIN + 1, 600.0), lines_m=lines(ORIGIN + 1))


Made = tuple[TensionForecaster, list[TensionForecast], list[FleetInputs]]
ORDERS = ("continue", "hold", "lower:0.4", "haul:0.4", "lower:0.4@aft_sheave")


@pytest.fixture(scope="module")
def made(scene: Scene) -> Made:
    """Five orders on the same heave, and the inputs that the fleet got."""
    known = known_of(scene)
    forecaster = TensionForecaster(scene, SETTINGS)
    states = nominal_states(
        scene, known.heave_m, known.line_out_m, [ORIGIN - 60], SETTINGS, known.lines_m
    )
    given, advance = list[FleetInputs](), forecaster.fleet.advance

    def spy(own: FleetInputs, interval_steps: int) -> FleetRecord:
        given.append(own)
        return advance(own, interval_steps)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(forecaster.fleet, "advance", spy)
        found = forecaster.forecast(known, states[0][0], [read_order(one) for one in ORDERS])
    return forecaster, found, given


def test_orders_move_all_winches(made: Made) -> None:
    """Lowering and hauling bring the slow winch to the speed of the main one; hold stops it."""
    _, _, (past, going, holding, lowering, hauling, _) = made
    assert past.lines["aft_sheave"][0][-1] == pytest.approx(600.4)
    speeds = {
        name: (inputs.line_speed_m_per_s[-1], inputs.lines["aft_sheave"][1][-1])
        for name, inputs in zip(ORDERS[:4], (going, holding, lowering, hauling), strict=True)
    }
    assert speeds["continue"] == pytest.approx((0.0, SLOW), abs=1e-6)
    assert speeds["hold"] == pytest.approx((0.0, 0.0), abs=1e-9)
    assert speeds["lower:0.4"] == pytest.approx((0.4, 0.4))
    assert speeds["haul:0.4"] == pytest.approx((-0.4, -0.4))
    out, speed = lowering.lines["aft_sheave"]
    assert np.diff(speed).max() <= 0.2 * PERIOD_S + 1e-12  # the winch's acceleration
    assert out[-1] - out[0] == pytest.approx(lowering.line_out_m[-1] - 600.0, abs=0.1)


def test_the_load_goes_down_with_both(made: Made) -> None:
    """By the line of both, with the tensions of both ropes beside each other."""
    _, (_, holding, lowering, hauling, _), _ = made
    down = (lowering.values[DEPTH] - holding.values[DEPTH])[-1]
    up = (hauling.values[DEPTH] - holding.values[DEPTH])[-1]
    assert down == pytest.approx(0.4 * (60.0 - 1.0), abs=0.2)
    assert up == pytest.approx(-0.4 * (60.0 - 1.0), abs=0.2)
    assert list(holding.others) == ["aft"]
    both = holding.values[TENSION] + holding.others["aft"].values
    load_n = (25000.0 - 5.0 * 1025.0) * 9.80665
    assert load_n < both.mean() < 1.5 * load_n
    assert (holding.values[BOTTOM] < holding.values[TENSION]).all()
    assert (holding.others["aft"].peak_n >= holding.others["aft"].values).all()


def test_an_order_to_one_winch_leaves_the_others(scene: Scene, made: Made) -> None:
    """The main winch goes on; its rope takes what the other one gives."""
    _, (going, *_, lowering), (_, as_it_is, *_, alone) = made
    assert alone.line_out_m == pytest.approx(as_it_is.line_out_m, abs=0.0)
    assert alone.lines["aft_sheave"][1][-1] == pytest.approx(0.4)
    shed, taken = (compare(lowering, going, 10.0, name) for name in ("aft", "fore"))
    assert shed.lower == 1.0
    assert shed.peak_n[2] < 0.0 < 2e4 < taken.peak_n[0]
    load_n = (25000.0 - 5.0 * 1025.0) * 9.80665
    end_n = lowering.others["aft"].values[-1]
    assert np.median(end_n) < 0.2 * load_n < np.median(lowering.values[TENSION][-1])
    assert compare(lowering, going, 10.0) == taken
    now = LineState(600.0, 0.0)
    for word, right in (("stop@aft_sheve", "did you mean 'aft_sheave'"), ("land@winch", "leave"),
                        ("lower:0.9@aft_sheave", "the winch reaches")):  # fmt: skip
        with pytest.raises(InputError, match=right):
            check_lift_order(read_order(word), scene, now)


def test_the_forecast_is_what_then_happens(scene: Scene, made: Made) -> None:
    """Both ropes follow the run, while swell and winches go on as they did."""
    _, (going, *_), _ = made
    at = PERIOD_S * np.arange(round((200.0 + 60.0) / PERIOD_S) + 1)
    z, v = heave(0.6, 11.0, at)
    share, slope = np.array([ramp(float(t), 10.0) for t in at]).T
    line = 600.0 + SLOW * np.maximum(at - 180.0, 0.0)
    rate = np.where(at < 180.0, 0.0, SLOW)
    zero = np.zeros(len(at))
    inputs = FleetInputs(
        share * z, share * v + slope * z, zero + 600.0, zero, {"aft_sheave": (line, rate)}
    )
    record = Fleet(scene, 4, elements=20, step_s=PERIOD_S).advance(inputs)
    first = round(200.0 / PERIOD_S)
    bands = {"fore": going.band(), "aft": going.others["aft"].band()}
    for name, band in bands.items():
        truth = record.suspended_tension_n[name][first:, 0][9::10]
        error = band[1] - truth
        assert np.mean(error[:20] ** 2) < 0.05 * np.var(truth)
    least = record.min_tension_n[first // 10 :, 0]
    assert np.median(going.values[MARGIN][:10], axis=1) == pytest.approx(least[:10], rel=0.03)


def test_risk_is_that_of_any_rope(scene: Scene, made: Made) -> None:
    """Each rope has a limit of its own."""
    first = made[1][0]
    aft_n = float(np.quantile(first.others["aft"].peak_n.max(axis=0), 0.5))
    never = Limits(1e9, ropes_n={"aft": 1e9})
    assert risks(first, never)[-1].tension == 0.0
    found = risks(first, replace(never, ropes_n={"aft": aft_n}))[-1].tension
    assert 0.2 < found < 0.8
    assert risks(first, replace(never, tension_n=1e3))[-1].tension == 1.0
    assert risks(first, Limits(1e3))[-1].tension == 1.0  # counts for all ropes
    own, others = tension_limits(scene)
    assert own == scene.ropes[0].breaking_load_n
    assert others == {"aft": scene.ropes[1].breaking_load_n}
    assert tension_limits(scene, 2e5) == (2e5, {"aft": 2e5})
    with pytest.raises(InputError, match="tension of aft"):
        Limits(1e5, ropes_n={"aft": 0.0})


def test_lines_that_are_not_known_hold(scene: Scene, made: Made) -> None:
    """And go with the main winch from where they are."""
    forecaster = made[0]
    known = replace(known_of(scene), lines_m={})
    state = Fleet(scene, 1, elements=20, step_s=PERIOD_S).state(0)
    orders = [read_order(one) for one in ("hold", "lower:0.4")]
    holding, lowering = forecaster.forecast(known, state, orders)
    down = (lowering.values[DEPTH] - holding.values[DEPTH])[-1]
    assert down == pytest.approx(0.4 * (60.0 - 1.0), abs=0.2)


def test_a_live_forecast_follows_all_winches(scene: Scene) -> None:
    """One that is heard later begins the nominal ropes again; orders move both."""
    forecaster, heard = LiveForecaster(scene, Limits(2e5), SETTINGS), LiveInputs()
    at = 0.1 * np.arange(1300)
    z = heave(0.5, 10.0, at)[0]
    for t, value in zip(at.tolist(), z.tolist(), strict=True):
        heard.heave_m.add(t, value)
        heard.line_out_m.add(t, 600.0)
        heard.tension_n.add(t, 1.25e5)
    without = forecaster.forecast(heard, lambda: 130.0)
    aft = heard.lines_m["aft_sheave"] = Series()
    for t in at[:700].tolist():
        aft.add(t, 599.0)
    assert "more of heave" in forecaster.missing_inputs(heard)
    for t in at[700:].tolist():
        aft.add(t, 599.0)
    heard.asked = read_orders("lower:0.3 haul:0.8")
    made = forecaster.forecast(heard, lambda: 130.0)
    shared = [
        float(np.median(one.forecast.others["aft"].values - one.forecast.values[TENSION]))
        for one in (without, made)
    ]
    assert shared[1] - shared[0] > 3e4  # the shorter rope carries more
    assert [one.order for one in made.orders] == ["hold", "lower:0.3"]
    assert len(made.refused) == 1
    assert "too fast" in made.refused[0]
    holding, lowering = made.orders
    gone = np.median((lowering.values[DEPTH] - holding.values[DEPTH])[-1])
    assert gone == pytest.approx(0.3 * 59.0, abs=0.3)
    limits = Limits(2e5, ropes_n={"aft": 9e4})
    rows = forecast_rows(made, limits)["forecast/ropes"]
    fore, aft = rows[:120], rows[120:]
    assert {row["rope"] for row in fore} == {0}
    assert [row["top_tension_50_n"] for row in fore] == pytest.approx(made.forecast.band()[1])
    assert [row["top_tension_95_n"] for row in aft] == pytest.approx(
        made.forecast.others["aft"].band()[2]
    )
    assert {(row["rope"], row["tension_limit_n"]) for row in aft} == {(1, 9e4)}
    assert fore[-1]["above"] == 0.0 < aft[-1]["above"]
    assert (np.diff([row["above"] for row in aft]) >= 0.0).all()
    ordered = order_rows(made, limits, None)
    assert [(row["name"], row["rope"]) for row in ordered[:3]] == [
        ("hold", 0), ("hold", 1), ("hold", 0),
    ]  # fmt: skip
    assert len(ordered) == 2 * 2 * 4
    heard.clear()
    assert not heard.lines_m


@pytest.fixture(scope="module")
def bag(scene: Scene, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Heave and both winches of the lift, the aft one first in each message."""
    count = round(300.0 / PERIOD_S)
    at = PERIOD_S * np.arange(count + 1)
    z, v = heave(0.6, 11.0, at)
    share, slope = np.array([ramp(float(t), 10.0) for t in at]).T
    line = 600.0 + SLOW * np.clip(at - 180.0, 0.0, 20.0)
    rate = np.where((at > 180.0) & (at < 200.0), SLOW, 0.0)
    still = np.zeros(count + 1)
    inputs = FleetInputs(
        share * z, share * v + slope * z, still + 600.0, still, {"aft_sheave": (line, rate)}
    )
    record = Fleet(scene, 4, elements=20, step_s=PERIOD_S).advance(inputs)
    path: Path = tmp_path_factory.mktemp("bag") / "pair"
    np.save(path.parent / "fore.npy", record.top_tension_n[:, 0])
    with BagWriter(path, [BY_NAME["ship/heave"], BY_NAME["winch/measured"]]) as writer:
        for k in range(count):
            stamp_ns = START_NS + round(k * PERIOD_S * 1e9)
            writer.write("ship/heave", stamp_ns, encode_heave(stamp_ns, z[k], v[k]))
            tops = {name: own[max(k - 1, 0), 0] for name, own in record.suspended_tension_n.items()}
            reading = Measurement.of_winch(stamp_ns, 600.0, 0.0, float(tops["fore"]))
            aft = ("aft_sheave", float(line[k]), float(rate[k]), float(tops["aft"]))
            both = reading._replace(rows=(aft, *reading.rows))
            writer.write("winch/measured", stamp_ns, encode_measurement(stamp_ns, both)[1])
    return path


def test_a_recorded_lift_of_two_winches(bag: Path, scene: Scene) -> None:
    """Winches are known by their names; the plan of the recording moves both."""
    lift = read_lift(bag, str(scene.path))
    assert (lift.line_out_m == 600.0).all()
    assert lift.lines_m["aft_sheave"][-1] == pytest.approx(600.4)
    fore_n = np.load(bag.parent / "fore.npy")[9::10]
    assert lift.tension_n[1 : 1 + len(fore_n)] == pytest.approx(fore_n[: len(lift.tension_n) - 1])
    forecaster = RecordingForecaster(lift, SETTINGS, planned=True)
    sample = forecaster.sample_of(185.0)
    (going,) = forecaster.at(sample, [read_order("continue")])
    plan = lift.plans_at(sample, SETTINGS, 60.0)["aft_sheave"]
    assert plan.out_m[-1] == pytest.approx(600.4)
    error = going.band()[1, :10] - lift.tension_n[sample + 1 : sample + 11]
    assert np.abs(error).max() < 0.3 * np.std(lift.tension_n)


def test_command(bag: Path, scene: Scene, capsys: pytest.CaptureFixture[str]) -> None:
    """Text and JSON have the bands of both ropes."""
    words = ["ahead", str(bag), "--scene", str(scene.path), "--at", "4min", "--members", "19",
             "--what-if", "lower:0.3"]  # fmt: skip
    assert main(words) == 0
    printed = capsys.readouterr().out
    for part in ("top tension of fore", "top tension of aft", "P(any rope's T > its limit)"):
        assert part in printed
    assert main([*words, "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    aft = found["forecasts"][1]["others"]["aft"]
    assert np.shape(aft["band"]) == (3, 120)
    assert aft["against_first"]["order"] == "lower:0.3"
    assert "lower:0.3 in aft" in printed
    assert found["limits"]["ropes_n"] == {"aft": scene.ropes[1].breaking_load_n}
    assert math.isfinite(found["forecasts"][0]["risks"][0]["tension"])

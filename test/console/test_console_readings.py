"""Values of the pages are those of the topics, with their age."""

from __future__ import annotations

import json
import math
from dataclasses import asdict

import numpy as np
import pytest
from console_rig import EPOCH_NS, forecast_tables
from hypothesis import given
from hypothesis import strategies as st
from sample_snapshot import hanging_body, hanging_rope, lifted

from rope_twin import messages
from rope_twin.console.pages import POINTS, RopeProfile, Trend
from rope_twin.console.readings import (
    AHEAD_S,
    SHORTEST_LIMIT_S,
    SHOWN,
    SLOW_EVERY,
    Readings,
    number,
    of_winch,
    stale_limits_s,
)
from rope_twin.console.requests import scene_facts
from rope_twin.estimation.figures import REPORTED, WINCH_FIGURES
from rope_twin.estimation.report import FigureEstimate
from rope_twin.messages import Level, Status
from rope_twin.messages.cdr import encode_text, new, serialise
from rope_twin.messages.reports import UNITS, encode_estimate, encode_forecast
from rope_twin.scene.load import load_scene
from rope_twin.topics import BY_NAME


def read(*topics: str, snapshot=None) -> Readings:  # type: ignore[no-untyped-def]
    readings, encoder = Readings(), messages.Encoder(EPOCH_NS)
    readings.take("twin/epoch", messages.encode_epoch(EPOCH_NS), 10.0)
    for topic in topics:
        readings.take(topic, encoder.encode(topic, snapshot or hanging_rope()), 10.0)
    readings.update()
    return readings


def test_numbers_are_those_of_the_snapshot() -> None:
    snapshot = hanging_rope()
    values = read("ropes/tension_top", "ropes/length", "payloads/state",
                  "seabed/contact", "hang_off/odometry", "compensator/state").values  # fmt: skip
    assert values["tension_n"] == [pytest.approx(snapshot.tension_top_n, rel=1e-7)]
    assert values["line_out_m"] == [3000.0]
    assert values["line_speed_m_per_s"] == [0.5]
    assert values["payloads"][0]["place_m"] == pytest.approx(list(snapshot.payload_position_m))
    assert values["payloads"][0]["velocity_m_per_s"] == pytest.approx([0.0, 0.0, 0.3])
    assert values["bed"][0]["payload_height_m"] == pytest.approx(-0.03)
    assert values["hang_off_m"][2] == pytest.approx(0.4)
    assert values["compensator"][0]["stroke_m"] == pytest.approx(2.1)


def test_residuals_and_quality_keep_their_names() -> None:
    values = read("residuals", "twin/quality").values
    (row,) = values["residuals"]
    assert (row["quantity"], row["name"]) == ("top_tension_n", "winch")
    assert row["residual"] == pytest.approx(row["measured"] - row["computed"])
    assert row["twin"] is None  # unknown
    (one,) = values["quality"]
    assert (one["name"], one["index"], one["cause"]) == ("top_tension", 0.8, "discretisation")
    assert one["history"] is None


def test_a_body_s_velocity_is_turned_into_the_map_and_its_angles_are_those_of_rep_103() -> None:
    snapshot = hanging_body()
    body = snapshot.body
    assert body is not None
    half = math.radians(30.0) / 2.0
    body.quaternion[:] = (0.0, 0.0, math.sin(half), math.cos(half))  # 30° about z
    snapshot.payload_velocity_m_per_s[:] = (1.0, 2.0, -0.5)
    payload = read("payloads/state", snapshot=snapshot).values["payloads"][0]
    assert payload["velocity_m_per_s"] == pytest.approx([1.0, 2.0, -0.5])
    assert payload["attitude_deg"] == pytest.approx([0.0, 0.0, 30.0], abs=1e-6)


def test_time_is_the_twin_s() -> None:
    assert read("ropes/tension_top").time_s == pytest.approx(2.5)


def test_time_and_trend_go_on_after_a_pause() -> None:
    """A new epoch shifts what comes after it, not the tension from before the pause."""
    readings, trend, pause_ns = read("ropes/tension_top"), Trend(20.0), 7_000_000_000
    assert trend.add(readings) is not None
    readings.take("twin/epoch", messages.encode_epoch(EPOCH_NS + pause_ns), 17.0)
    readings.update()
    assert readings.time_s == pytest.approx(2.5)
    assert trend.add(readings) is None
    encoder, snapshot = messages.Encoder(EPOCH_NS + pause_ns), hanging_rope(time_s=2.55)
    readings.take("ropes/tension_top", encoder.encode("ropes/tension_top", snapshot), 17.5)
    readings.update()
    assert trend.add(readings) is not None
    assert trend.columns()["time_s"] == pytest.approx([2.5, 2.55])


def test_ages_grow_until_the_next_message() -> None:
    readings = read("ropes/tension_top")
    assert readings.ages(10.25)["ropes/tension_top"] == pytest.approx(0.25)
    encoder = messages.Encoder(EPOCH_NS)
    readings.take("ropes/tension_top", encoder.encode("ropes/tension_top", hanging_rope()), 11.0)
    assert readings.ages(11.1)["ropes/tension_top"] == pytest.approx(0.1)


def test_loss_of_the_twin_is_stale_within_a_second() -> None:
    limits = stale_limits_s()
    assert limits["ropes/tension_top"] == SHORTEST_LIMIT_S < 1.0
    assert limits["diagnostics"] == pytest.approx(3.0)
    assert "winch/seat" not in limits  # published on change only
    assert all(limits[name] > 1.0 / BY_NAME[name].rate_hz for name in limits)


def test_only_what_has_changed_is_read_again() -> None:
    readings = read("ropes/tension_top", "ropes/length")
    assert readings.update() == {}
    encoder = messages.Encoder(EPOCH_NS)
    readings.take("ropes/length", encoder.encode("ropes/length", hanging_rope()), 11.0)
    assert set(readings.update()) == {"line_out_m", "line_speed_m_per_s"}


@given(st.sampled_from([one for one in SHOWN if one not in ("ropes/nodes", "twin/session")]),
       st.binary(max_size=200))  # fmt: skip
def test_bytes_that_are_no_message_are_a_fault_in_words(topic: str, data: bytes) -> None:
    readings = Readings()
    readings.take(topic, data, 1.0)
    changed = readings.update()
    fault = changed.get(f"fault {topic}")
    assert fault is None or topic in fault or "point cloud" in fault
    json.dumps(changed, allow_nan=False)


def test_lists_of_other_lengths_are_a_fault_in_words() -> None:
    """And of that topic alone: the others are read, and it is once it is whole again."""
    readings = read()
    strange = new("sensor_msgs/msg/MultiDOFJointState", joint_names=["payload"])
    readings.take("payloads/state", serialise(strange), 11.0)
    encoder = messages.Encoder(EPOCH_NS)
    readings.take("ropes/length", encoder.encode("ropes/length", hanging_rope()), 11.0)
    for _ in range(SLOW_EVERY):
        readings.update()
    assert "payloads/state: ValueError" in readings.values["fault payloads/state"]
    assert readings.values["line_out_m"] == [3000.0]
    readings.take("payloads/state", encoder.encode("payloads/state", hanging_rope()), 12.0)
    for _ in range(SLOW_EVERY):
        readings.update()
    assert readings.values["fault payloads/state"] == ""


@given(st.floats())
def test_a_number_is_json_to_eight_digits(value: float) -> None:
    found = number(value)
    if not math.isfinite(value):
        assert found is None
    else:
        assert found == pytest.approx(value, rel=1e-7, abs=5e-324)


def test_diagnostics_of_several_nodes_are_kept_by_their_name() -> None:
    readings = Readings()
    for name in ("simulation: pacing", "recorder: bag"):
        rows = [Status(name, Level.WARN, "a sentence", {"key": "1"})]
        readings.take("diagnostics", messages.encode_diagnostics(EPOCH_NS, rows), 1.0)
        readings.update()
    assert readings.values["diagnostics recorder: bag"]["level"] == Level.WARN
    assert readings.values["diagnostics simulation: pacing"]["values"] == {"key": "1"}


def test_tension_along_the_rope_and_its_range() -> None:
    profile, encoder = RopeProfile(), messages.Encoder(EPOCH_NS)
    snapshot = hanging_rope(nodes=101)
    (first,) = profile.update(encoder.encode("ropes/nodes", snapshot), 0.0)
    assert len(first["along_m"]) == POINTS
    assert first["tension_n"][0] == pytest.approx(snapshot.node_tension_n[0], abs=1.0)
    assert first["low_n"] == first["high_n"] == first["tension_n"]
    snapshot.node_tension_n[:] *= 1.5
    (second,) = profile.update(encoder.encode("ropes/nodes", snapshot), 1.0)
    assert np.array(second["high_n"]) == pytest.approx(1.5 * np.array(first["high_n"]), rel=1e-5)
    assert second["low_n"] == first["low_n"]
    assert second["min_n"] == pytest.approx(min(first["low_n"]), abs=1.0)
    (third,) = profile.update(encoder.encode("ropes/nodes", snapshot), 61.5)
    assert third["low_n"] == third["tension_n"]  # what is older than 60 s does not count


def test_a_trend_begins_again_with_another_run() -> None:
    trend, encoder = Trend(20.0), messages.Encoder(EPOCH_NS)
    for time_s in (5.0, 5.05, 5.05, 1.0):
        readings = read(snapshot=hanging_rope())
        snapshot = hanging_rope(time_s=time_s)
        readings.take("ropes/tension_top", encoder.encode("ropes/tension_top", snapshot), 1.0)
        readings.update()
        row = trend.add(readings)
        if time_s == 5.05 and row is None:
            assert trend.columns()["time_s"] == [5.0, 5.05]  # a row for each new time
    assert trend.columns()["time_s"] == [1.0]


ORIGIN_NS = EPOCH_NS + 1_500_000_000


def forecast_of(readings: Readings) -> None:
    """Give readings the tables of a forecast that began 1 s before the snapshot's 2.5 s."""
    for topic, rows in forecast_tables(horizon_s=20.0).items():
        readings.take(topic, encode_forecast(topic, ORIGIN_NS, "map", rows), 11.0)


def test_a_forecast_is_shown_from_its_origin() -> None:
    readings = read("ropes/tension_top")
    forecast_of(readings)
    for _ in range(SLOW_EVERY):
        readings.update()
    values = readings.values
    band = values["forecast"]
    assert band["at_s"] == pytest.approx(1.5), "twin time of the origin, not of the arrival"
    assert len(band["lead_s"]) == len(band["low_n"]) == len(band["median_n"])
    assert AHEAD_S <= band["lead_s"][-1] < 60.0, "as far as it is drawn"
    assert (band["lead_s"][3], band["low_n"][3], band["high_n"][3]) == (2.0, 3.192e5, 3.208e5)
    ropes = values["forecast_ropes"]
    assert ropes["at_s"] == pytest.approx(1.5)
    assert list(ropes["bands"]) == ["0", "1"]
    assert ropes["bands"]["0"] == {name: band[name] for name in ropes["bands"]["0"]}
    assert ropes["bands"]["1"]["median_n"][0] == 1e5
    risk = values["risk"]
    assert risk["at_s"] == pytest.approx(1.5)
    assert [row["climatology"] for row in risk["rows"]] == [False, False, True, True]
    assert [row["tension"] for row in risk["rows"]] == pytest.approx([0.02, 0.04, 0.06, 0.12])
    assert risk["rows"][0]["contact"] is None, "no seabed: NaN"
    quiet = values["quiet"]["rows"]
    assert [(row["begin_s"], row["length_s"]) for row in quiet][1] == (2.0, 10.0)
    assert quiet[3]["probability"] == pytest.approx(0.5)
    json.dumps(values, allow_nan=False)


def test_a_forecast_before_the_epoch_is_known_has_no_time() -> None:
    readings = Readings()
    forecast_of(readings)
    assert readings.update()["forecast"]["at_s"] is None


def test_a_table_of_other_columns_is_a_fault_in_words() -> None:
    readings = read()
    data = encode_forecast("forecast/quiet", ORIGIN_NS, "map", [{"begin_s": 0.0}])
    for topic in ("forecast/tension", "forecast/risk", "estimate/figures"):
        readings.take(topic, data, 11.0)
    for _ in range(SLOW_EVERY):
        readings.update()
    assert "lead_s, top_tension_5_n" in readings.values["fault forecast/tension"]
    assert "span_s" in readings.values["fault forecast/risk"]
    assert "prior_sd" in readings.values["fault estimate/figures"]
    assert "forecast" not in readings.values


def test_learned_figures_have_units_and_words() -> None:
    readings = read("ropes/tension_top")
    figure = FigureEstimate("payload_drag", "m²", 12.0, 14.5, 13.0, 16.0, 0.3, 0.06, "learned")
    pin = FigureEstimate(
        "aft_winch/tension_bias", "N", 0.0, 900.0, -50.0, 1850.0, 2e3, 600.0, "weak"
    )
    data = encode_estimate(EPOCH_NS + 120_000_000_000, [asdict(figure), asdict(pin)])
    readings.take("estimate/figures", data, 11.0)
    readings.take("estimate/alarms", encode_text("snag since 312 s"), 11.0)
    for _ in range(SLOW_EVERY):
        readings.update()
    learned = readings.values["learned"]
    assert learned["at_s"] == pytest.approx(120.0)
    drag, bias = learned["rows"]
    assert (drag["name"], drag["unit"], drag["state"]) == ("payload_drag", "m²", "learned")
    assert (drag["low"], drag["value"], drag["high"], drag["prior"]) == (13.0, 14.5, 16.0, 12.0)
    assert (bias["name"], bias["unit"], bias["state"]) == ("aft_winch/tension_bias", "N", "weak")
    assert readings.values["fault_alarm"] == "snag since 312 s"
    readings.take("estimate/alarms", encode_text(""), 12.0)
    assert readings.update()["fault_alarm"] == "", "acknowledged"


def test_every_figure_that_is_learned_has_a_unit() -> None:
    assert set(UNITS) == {*REPORTED, *WINCH_FIGURES}


def test_a_trend_has_a_row_for_each_rope() -> None:
    trend, encoder, readings = Trend(20.0), messages.Encoder(EPOCH_NS), Readings()
    snapshot = lifted()
    for topic in ("ropes/tension_top", "ropes/length", "payloads/state"):
        readings.take(topic, encoder.encode(topic, snapshot), 0.0)
    readings.update()
    facts = {"ropes": [{"winch": "winch", "payload": ""}, {"winch": "", "payload": "port"},
                       {"winch": "", "payload": "starboard"}]}  # fmt: skip
    rows = trend.add(readings, facts)
    assert rows is not None
    assert [row["tension_n"] for row in rows] == [one.tension_top_n for one in snapshot.ropes]
    assert [row["line_out_m"] for row in rows] == [100.0, 8.0, 8.0]
    depths = [-one.position_m[2] for one in snapshot.payloads]
    assert [row["depth_m"] for row in rows[1:]] == pytest.approx(depths)
    assert trend.ropes == 3
    assert trend.columns(1)["tension_n"] == [6e3]


def test_each_winch_has_its_own_words() -> None:
    """Limits in parentheses have the separator of winches too."""
    words = "winch: tension 190 kN (a limit; another; a third); aft: speed 1 m/s"
    assert of_winch(words, "winch") == words.partition("; aft")[0]
    assert of_winch(words, "aft") == "aft: speed 1 m/s"
    assert of_winch(words, "a") == ""


def test_the_sea_of_a_scene_is_that_of_its_spectrum() -> None:
    sea = scene_facts(load_scene("ship_6dof"))["sea"]
    assert sea == {"recorded": None, "significant_height_m": 2.5, "peak_period_s": 9.0}
    assert scene_facts(load_scene("deep_lift"))["sea"]["significant_height_m"] is None

"""Measured tension, line out and depth: what is refused, and what the residuals say."""

from __future__ import annotations

import json
import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from small_scene import SMALL_SCENE

from rope_twin.errors import InputError
from rope_twin.messages import Encoder, Level, encode_measurement, read_cloud, statuses
from rope_twin.messages.cdr import deserialise
from rope_twin.messages.inputs import read_measurement
from rope_twin.messages.reports import residuals_status
from rope_twin.run.summary import RunSummary, summarise
from rope_twin.scene.error_bound import KnownError
from rope_twin.scene.instruments import Measured
from rope_twin.scene.load import load_scene
from rope_twin.scene.schema import Scene
from rope_twin.topics import BY_NAME, MEASURED_TOPICS
from rope_twin.twin.input_queue import InputQueue, LogEntry, apply, calls_of, plain_calls
from rope_twin.twin.quality import residual_of
from rope_twin.twin.readings import Measurement
from rope_twin.twin.residuals import DEPTH, LINE_OUT, SAMPLE_NS, TENSION, MeasuredInputs
from rope_twin.twin.snapshot import Residual, Snapshot, TensionInterval, disagrees
from rope_twin.twin.state import decode_state
from rope_twin.twin.twin import Twin

MEASURED = """\
measured:
  tension: {uncertainty_n: 200.0, uncertainty_pct: 0.1, bias_n: 500.0}
  line_out: {uncertainty_m: 0.05}
"""
SLOT_NS, STEPS = 20_000_000, 2


@pytest.fixture(scope="module")
def scene(tmp_path_factory: pytest.TempPathFactory) -> Scene:
    path = tmp_path_factory.mktemp("scene") / "measured.yaml"
    path.write_text(SMALL_SCENE + MEASURED)
    return load_scene(path)


@pytest.fixture(scope="module")
def at_rest(scene: Scene) -> Twin:
    return Twin(scene)


def by_quantity(snapshot: Snapshot) -> dict[str, Residual]:
    return {one.quantity: one for one in snapshot.residuals}


def heaved(twin: Twin, seconds: float) -> list[Snapshot]:
    """Advance in a swell of 1 m and 6 s while the winch pays out; snapshots at each slot."""
    snapshots, omega = [], 2.0 * math.pi / 6.0
    twin.submit_speed(None, 0.5)
    for _ in range(round(seconds / 0.02)):
        t = (twin.time_ns + SLOT_NS) * 1e-9
        twin.submit_heave(twin.time_ns + SLOT_NS, math.sin(omega * t), omega * math.cos(omega * t))
        twin.advance(STEPS)
        snapshots.append(twin.snapshot())
    return snapshots


def test_a_biased_cell_that_comes_late_shows_its_bias(at_rest: Twin) -> None:
    """Readings of the past are compared with the past: else the swell would be in the residual.

    The twin's own values of a twin without measurements, 0.7 s late and 1.3 kN too large, differ
    from it by that bias less the known offset. A straight line between samples 20 ms apart errs by
    h²/8 of the second derivative of the tension.
    """
    snapshots = heaved(at_rest.branch(), 20.0)
    twin = at_rest.branch()
    twin.submit_speed(None, 0.5)
    omega, delay = 2.0 * math.pi / 6.0, 35
    for k in range(len(snapshots)):
        t = (twin.time_ns + SLOT_NS) * 1e-9
        twin.submit_heave(twin.time_ns + SLOT_NS, math.sin(omega * t), omega * math.cos(omega * t))
        if k >= delay:
            then = snapshots[k - delay]
            reported = Measurement.of_winch(
                then.stamp_ns, then.line_out_m, then.payout_speed_m_per_s,
                then.tension_top_n + 1300.0,
            )  # fmt: skip
            depth = Measurement.of_depth(then.stamp_ns, -float(then.payload_position_m[2]) + 3.0)
            assert twin.submit_measurement(reported) == ""
            assert twin.submit_measurement(depth) == ""
        twin.advance(STEPS)
        last = twin.snapshot()
    assert last.tension_top_n == snapshots[-1].tension_top_n, "measurements change nothing"
    assert np.std([one.tension_top_n for one in snapshots]) > 1000.0
    found = by_quantity(last)
    tension, line, lower = found[TENSION], found[LINE_OUT], found[DEPTH]
    assert tension.mean == pytest.approx(800.0, abs=1e-6)
    assert tension.rms == pytest.approx(800.0, abs=1e-6)
    u = math.hypot(200.0, 1e-3 * tension.measured)
    assert tension.half_width == pytest.approx(1.96 * u, rel=1e-12)
    assert tension.outside == 1.0
    assert line.mean == pytest.approx(0.0, abs=1e-9)
    assert line.outside == 0.0
    assert lower.mean == pytest.approx(3.0, abs=1e-9)
    assert lower.half_width is None
    assert lower.outside is None
    row = residuals_status(last.residuals)
    assert row.level == Level.WARN
    assert "top tension of 'winch'" in row.message
    assert "line out" not in row.message, "only what is outside"


def test_a_measurement_of_long_ago_is_reported_as_such(at_rest: Twin) -> None:
    """A cable that came off is no present disagreement of 50 kN."""
    twin = at_rest.branch()
    tension_n = twin.snapshot().tension_top_n + 5e4
    for _ in range(10):
        twin.advance(2)
        reading = Measurement.of_winch(twin.time_ns, tension_n=tension_n)
        assert twin.submit_measurement(reading) == ""
        twin.snapshot()
    for seconds, words in ((1, "of 'winch': measured"), (14, "of 'winch', 15 s ago: measured")):
        twin.advance(100 * seconds)
        snapshot = twin.snapshot()
        (row,) = (row for row in statuses(snapshot, None) if row.name == "simulation: residuals")
        assert words in row.message
        assert words in summarise(twin, snapshot, None).as_text()


def test_a_reading_between_two_samples_is_interpolated(scene: Scene) -> None:
    """T = 1e5 + 100·t² at 13 ms: a line between samples 20 ms apart errs by h²/8·T'' at most."""
    inputs = MeasuredInputs(scene)
    for k in range(200):
        t = k * SAMPLE_NS * 1e-9
        inputs.record(k * SAMPLE_NS, (1e5 + 100.0 * t * t, 200.0 + 0.5 * t, 190.0))
    snapshot = Twin(scene).snapshot()
    for k in range(1, 190):
        t_ns = k * SAMPLE_NS + 13_000_000
        t = t_ns * 1e-9
        tension = 1e5 + 100.0 * t * t + 500.0
        reported = Measurement.of_winch(t_ns, 200.0 + 0.5 * t, 0.5, tension)
        assert inputs.submit(reported, t_ns) == ""
    found = {one.quantity: one for one in inputs.residuals(snapshot)}
    assert 0.0 < found[TENSION].rms <= 0.02**2 / 8.0 * 200.0
    assert found[LINE_OUT].rms < 1e-9


def test_statistics_are_those_of_the_last_minute(scene: Scene) -> None:
    inputs, snapshot = MeasuredInputs(scene), Twin(scene).snapshot()
    for second in range(200):
        t_ns = second * 1_000_000_000
        inputs.record(t_ns, (1e5, 200.0, 190.0))
        off = 5e3 if second < 100 else 0.0
        assert inputs.submit(Measurement.of_winch(t_ns, tension_n=1e5 + 500.0 + off), t_ns) == ""
        (one,) = inputs.residuals(snapshot)
    assert one.readings == 60
    assert (one.mean, one.rms, one.outside) == (0.0, 0.0, 0.0)


def test_motor_tension_is_compared_only_where_the_scene_says_so(tmp_path: Path) -> None:
    snapshot = None
    for place, expected in (("sheave", None), ("motor", 2e3)):
        path = tmp_path / f"{place}.yaml"
        path.write_text(SMALL_SCENE + f"measured: {{tension: {{at: {place}}}}}\n")
        scene = load_scene(path)
        snapshot = snapshot or Twin(scene).snapshot()
        inputs = MeasuredInputs(scene)
        inputs.record(0, (1e5, 200.0, 190.0))
        assert inputs.submit(Measurement.of_motor(0, 1.02e5), 0) == ""
        found = inputs.residuals(snapshot)
        assert (found[0].mean if found else None) == expected


REFUSED = {
    "nothing": (Measurement.of_winch(10**9), "nothing is measured"),
    "infinite": (Measurement.of_winch(10**9, math.inf), "finite"),
    "longer than the rope": (Measurement.of_winch(10**9, 401.0), "0 to 400 m out"),
    "negative": (Measurement.of_winch(10**9, -34.0), "zero"),
    "too fast": (Measurement.of_winch(10**9, None, 3.0), "1.875 m/s at most"),
    "beyond its strength": (Measurement.of_winch(10**9, tension_n=1e9), "possible for this rope"),
    "another winch": (Measurement.of_winch(10**9, 200.0, winch="aft"), "there is no 'aft'"),
    "above the water": (Measurement.of_depth(10**9, -80.0), "up from the mean water level"),
    "deeper than the rope": (Measurement.of_depth(10**9, 600.0), "up from the mean water level"),
    "another clock": (Measurement.of_winch(10**11, 200.0), "must share one clock"),
    "too old": (Measurement.of_winch(-(10**11), 200.0), "must share one clock"),
}


def test_readings_of_another_clock_are_called_so(scene: Scene) -> None:
    """A stamp of zero, for example, is an error and not an order to correct."""
    inputs = MeasuredInputs(scene)
    assert inputs.submit(Measurement.of_winch(10**11, 200.0), 10**11) == ""
    refusal = inputs.submit(Measurement.of_winch(-(10**18), 200.0), 10**11)
    assert "must share one clock" in refusal


@pytest.mark.parametrize("case", REFUSED)
def test_garbage_gets_one_sentence(case: str, scene: Scene) -> None:
    measurement, words = REFUSED[case]
    inputs = MeasuredInputs(scene)
    refusal = inputs.submit(measurement, 0)
    assert words in refusal
    assert refusal.endswith(".")
    assert refusal.count(". ") == 0
    assert not inputs.active
    assert sum(one.refused for one in inputs.health(0).values()) == 1


@pytest.mark.parametrize(
    ("values", "kept", "words"),
    [
        ((450.0, 0.5, 1e5), (None, 0.5, 1e5), "line out 450 m; this winch has 0 to 400 m out"),
        ((202.0, 0.5, 1e5), (None, 0.5, 1e5), "line out changes by +2.00 m in 0.10 s"),
        ((200.1, 3.0, 1e5), (200.1, None, 1e5), "line speed 3 m/s"),
        ((200.1, 0.5, 1e9), (200.1, 0.5, None), "tension 1e+09 N"),
        ((math.inf, 0.5, 1e9), (None, 0.5, None), "a value of inf"),
    ],
)
def test_a_faulty_value_leaves_the_others_of_its_reading(
    values: tuple[float, float, float],
    kept: tuple[float | None, float | None, float | None],
    words: str,
    scene: Scene,
) -> None:
    """A counter that fails says nothing of the load cell; the bad value is refused and counted."""
    inputs, followed, snapshot = MeasuredInputs(scene), [], Twin(scene).snapshot()
    at_ns = 100_000_000
    inputs.record(0, (1e5, 200.0, 190.0))
    inputs.record(at_ns, (1e5, 200.1, 190.1))
    assert inputs.submit(Measurement.of_winch(0, 200.0, 0.5), 0) == ""
    reading = Measurement.of_winch(at_ns, *values)
    assert words in inputs.submit(reading, at_ns, lambda *one: followed.append(one[2:]))
    line_out, speed, tension = kept
    assert followed == ([] if line_out is None else [(line_out, speed)])
    found = {one.quantity: one for one in inputs.residuals(snapshot)}
    assert (TENSION in found) == (tension is not None)
    assert (found[LINE_OUT].at_s == 0.1) == (line_out is not None)
    health = inputs.health(at_ns)["winch_measured"]
    assert (health.accepted, health.refused, health.recently_refused) == (2, 1, 1)


def test_a_quantity_that_falls_silent_is_named(scene: Scene) -> None:
    """While the load cell goes on: else the last line out would pass for one of now."""
    inputs, second = MeasuredInputs(scene), 1_000_000_000
    for k in range(80):
        t_ns = k * second // 10
        line_out = 200.0 if k < 30 else 900.0 if k < 60 else None
        inputs.submit(Measurement.of_winch(t_ns, line_out, tension_n=1e5), t_ns)
        silent = inputs.health(t_ns)["winch_measured"].warning
        assert silent == (f"no line out for {0.1 * (k - 29):.1f} s" if k > 49 else "")
    later = inputs.health(12 * second)["winch_measured"].warning
    assert later == "no reading for 4.1 s; nothing is compared"


NUMBERS = st.one_of(st.none(), st.floats(allow_nan=False, width=64), st.floats(0.0, 400.0))


@given(st.lists(st.tuples(st.integers(-(10**11), 10**11), NUMBERS, NUMBERS, NUMBERS), max_size=8))
def test_no_input_breaks_it(scene: Scene, rows: list[tuple[int, float, float, float]]) -> None:
    """Whatever comes is taken or refused in a sentence, and every figure stays finite."""
    inputs = MeasuredInputs(scene)
    inputs.record(0, (1e5, 200.0, 190.0))
    inputs.record(10**9, (1e5, 200.0, 190.0))
    for stamp_ns, *values in rows:
        for one in (
            Measurement.of_winch(stamp_ns, *values),
            Measurement("motor", stamp_ns, (("", None, None, values[2]),)),
            Measurement("payload", stamp_ns, (("", values[0], None, None),)),
        ):
            refusal = inputs.submit(one, 10**9)
            assert refusal == "" or refusal.endswith(".")
    for channel in (*inputs._tensions, *inputs._lengths, inputs._depths):
        channel.update(inputs._history, None, None)
        if (found := channel.result()) is not None:
            assert math.isfinite(found.mean)
            assert math.isfinite(found.rms)


def test_a_jump_is_refused_and_a_hole_is_none(scene: Scene) -> None:
    """19 s without data are missing data; what the winch cannot have done is a warning then."""
    inputs = MeasuredInputs(scene)
    assert inputs.submit(Measurement.of_winch(0, 200.0), 0) == ""
    jump = inputs.submit(Measurement.of_winch(50_000_000, 201.0), 50_000_000)
    assert "line out changes by +1.00 m in 0.05 s" in jump
    later = 19_050_000_000
    assert "no reading for 19.1 s" in inputs.health(later)["winch_measured"].warning
    assert inputs.submit(Measurement.of_winch(later, 220.0), later) == ""
    assert inputs.health(later)["winch_measured"].warning == ""
    again = later + 19_000_000_000
    assert inputs.submit(Measurement.of_winch(again, 350.0), again) == ""
    assert "was the sensor reset?" in inputs.health(again)["winch_measured"].warning


def test_a_counter_that_jumps_to_and_fro_is_distrusted_until_it_is_steady(scene: Scene) -> None:
    """5 m to and fro each 2.5 s: one jump is a reset, each further one must last twice as long."""
    inputs, step_ns = MeasuredInputs(scene), 50_000_000

    def read(from_s: float, to_s: float, high: bool) -> list[str]:
        first, end = (round(s * 1e9) // step_ns for s in (from_s, to_s))
        length_m = 205.0 if high else 200.0
        return [
            inputs.submit(Measurement.of_winch(k * step_ns, length_m), k * step_ns)
            for k in range(first, end)
        ]

    def warning(at_s: float) -> str:
        return inputs.health(round(at_s * 1e9))["winch_measured"].warning

    assert not any(read(0.0, 2.5, high=False))
    reset = read(2.5, 5.0, high=True)
    assert [words == "" for words in reset] == [False] * 40 + [True] * 10
    assert "was the sensor reset?" in warning(5.0)
    assert [words == "" for words in read(5.0, 7.5, high=False)] == [False] * 40 + [True] * 10
    jumping = [read(7.5 + 2.5 * n, 10.0 + 2.5 * n, high=n % 2 == 0) for n in range(40)]
    assert all(words for one in jumping for words in one), "none lasts for 4 s"
    assert jumping[-1][-1].endswith(
        "line out steady for 2.5 s after jumping to and fro; "
        "accepted again after 4 s without a jump."
    )
    assert "line out distrusted, as it jumps to and fro" in warning(107.5)
    assert inputs.health(107_500_000_000)["winch_measured"].unconfirmed > 0
    steady = read(107.5, 130.0, high=True)
    taken = steady.index("") * step_ns * 1e-9
    assert taken == pytest.approx(4.0)
    assert not any(steady[steady.index("") :])
    assert "distrusted" not in warning(130.0)


@pytest.mark.parametrize(("ahead_s", "doubted"), [(1.5, True), (0.3, False), (-5.0, False)])
def test_a_clock_that_is_ahead_is_noticed(scene: Scene, ahead_s: float, doubted: bool) -> None:
    """No reading arrives before it was made; one that comes late may have had a long way."""
    inputs, lead_ns, second = MeasuredInputs(scene), round(ahead_s * 1e9), 1_000_000_000
    for k in range(10):
        at_ns = k * second // 10
        reading = Measurement.of_depth(at_ns + lead_ns, 100.0 + 0.01 * k)
        assert inputs.submit(reading, at_ns, received_ns=at_ns) == ""
    words = inputs.health(second)["payload_depth"].warning
    assert ("1.50 s ahead of their arrival" in words) == doubted
    inputs.lead_s = 2.0  # of a replay
    assert "ahead" not in inputs.health(second)["payload_depth"].warning


@pytest.mark.parametrize(
    ("scale", "words"),
    [
        (1e-3, "it reads 0.15 kN where the twin has 150 kN: another unit, sign or load"),
        (-1.0, "it reads -150 kN where the twin has 150 kN: another unit, sign or load"),
        (1.0 / 4.448, "it reads 33.72 kN where the twin has 150 kN: another unit, sign or load"),
        (4.448, "it reads 667.2 kN where the twin has 150 kN: another unit, sign or load"),
        (0.3, ""),
        (3.9, ""),
    ],
)
def test_a_cell_in_another_unit_is_noticed(scene: Scene, scale: float, words: str) -> None:
    """Where the scene gives no uncertainty too."""
    plain = replace(scene, measured=Measured())
    inputs, snapshot = MeasuredInputs(plain), Twin(plain).snapshot()
    for k in range(200):
        time_ns, swing = k * 100_000_000, (1e4, -1e4)[k % 2]
        inputs.record(time_ns, (1.5e5 + swing, 200.0, 200.0))
        tension_n = scale * (1.5e5 + swing)
        assert inputs.submit(Measurement.of_winch(time_ns, tension_n=tension_n), time_ns) == ""
        inputs.residuals(snapshot)
        if k == 80:
            assert inputs.health(time_ns)["winch_measured"].warning == ""
    assert inputs.health(time_ns)["winch_measured"].warning == words


@pytest.mark.parametrize(("scale", "doubted"), [(0.5, True), (1.5, True), (0.9, False)])
def test_a_cell_beyond_load_and_pin_is_doubted_without_an_uncertainty(
    scene: Scene, scale: float, doubted: bool
) -> None:
    """The scene's weight is within 18 %, its load pin within 3 % and 4 kN: 28 kN of 150 kN."""
    twin = Twin(replace(scene, measured=Measured()))
    inputs, blank = MeasuredInputs(replace(scene, measured=Measured())), twin.snapshot()
    for k in range(200):
        time_ns, swing = k * 100_000_000, (1e4, -1e4)[k % 2]
        inputs.record(time_ns, (1.5e5 + swing, 200.0, 200.0))
        reading = Measurement.of_winch(time_ns, tension_n=scale * (1.5e5 + swing))
        assert inputs.submit(reading, time_ns) == ""
        (residual,) = inputs.residuals(blank)
        assert disagrees(residual) == (doubted and k >= 90)  # for 10 s
    assert residual.explained == pytest.approx(
        3.0 * math.hypot(0.06 * 1.5e5, 0.01 * 1.5e5, 0.008 * 1.5e5, 0.006 * 1.5 * 1.6e5)
    )
    snapshot = replace(blank, stamp_ns=time_ns, residuals=(residual,))
    (row,) = (row for row in statuses(snapshot, None) if row.name == "simulation: residuals")
    assert row.level == (Level.WARN if doubted else Level.OK)
    assert "interval unknown (give `measured` in the scene)" in row.message
    assert ("of load and load pin explain ±27.94 kN" in row.message) == doubted
    assert residual_of("top_tension", snapshot).value == (0.5 if doubted else None)


@pytest.mark.parametrize(("factor", "noticed"), [(1.0, False), (1.0 / 0.3048, True)])
def test_heave_in_feet_shows_in_the_measured_tension(
    scene: Scene, factor: float, noticed: bool
) -> None:
    """Heave itself is plausible, as of a higher sea; the residuals of a load cell are not."""
    true, twin = Twin(scene), Twin(scene)
    for own in (true, twin):
        own.prescribe_motion()
    omega, bias_n = 2.0 * math.pi / 7.0, scene.measured.tension.bias_n
    for k in range(400):
        for n in (4 * k, 4 * k + 1, 4 * k + 2, 4 * k + 3):
            t = (n + 1) * 0.05
            z, v = 0.6 * math.sin(omega * t), 0.6 * omega * math.cos(omega * t)
            for own, size in ((true, 1.0), (twin, factor)):
                assert own.submit_heave(round(t * 1e9), size * z, size * v) == ""
        for own in (true, twin):
            own.advance(20)
        tension_n = true.snapshot().tension_top_n + bias_n
        twin.submit_measurement(Measurement.of_winch(twin.time_ns, tension_n=tension_n))
        snapshot = twin.snapshot()
    assert snapshot.inputs["heave"].warning == snapshot.inputs["heave"].fault == ""
    assert disagrees(by_quantity(snapshot)[TENSION]) == noticed
    quality = residual_of("top_tension", snapshot)
    assert quality.value is not None
    assert (quality.value <= 0.5) == noticed


def test_a_frozen_cell_is_noticed(scene: Scene) -> None:
    """Equal readings while the twin's tension swings by 10 %; none while the twin is as quiet."""
    for swing, frozen in ((1e4, True), (10.0, False)):
        inputs, snapshot = MeasuredInputs(scene), Twin(scene).snapshot()
        for k in range(100):
            t_ns = k * 100_000_000
            inputs.record(t_ns, (1e5 + swing * math.sin(0.3 * k), 200.0, 190.0))
            inputs.submit(Measurement.of_winch(t_ns, tension_n=1.0e5), t_ns)
        inputs.residuals(snapshot)
        assert ("frozen" in inputs.health(10**10)["winch_measured"].warning) == frozen


@pytest.mark.parametrize(
    ("speed", "share", "doubted"),
    [(0.5, 1.0, False), (0.5, 0.0, True), (0.5, -1.0, True), (0.0, 0.0, False), (0.5, 0.95, False)],
    ids=["sound", "frozen", "sign", "at rest", "5 % of scale"],
)
def test_line_out_and_line_speed_are_compared(
    speed: float, share: float, doubted: bool, scene: Scene
) -> None:
    """The speed of a counter that stands or counts the other way is not used to follow."""
    inputs, given = MeasuredInputs(scene), []
    for k in range(200):
        reported = Measurement.of_winch(k * 50_000_000, 200.0 + share * speed * 0.05 * k, speed)
        assert inputs.submit(reported, k * 50_000_000, lambda *one: given.append(one)) == ""
    assert (given[-1][3] is None) == doubted
    assert ("another unit or sign" in inputs.health(10**10)["winch_measured"].warning) == doubted


def test_the_interval_has_the_twins_own_error_where_it_is_known(scene: Scene) -> None:
    """By the study: 2 % of the standard deviation of a sine of 1 kN; else by the error interval."""
    snapshot = replace(Twin(scene).snapshot(), study_error=KnownError(2.0, 1.0, "by a study"))
    interval = TensionInterval(1e5 - 98.0, 1e5 + 98.0, 98.0, 10.0)
    for now, twin in (
        (snapshot, 0.02 * 1e3 / math.sqrt(2.0)),
        (replace(snapshot, error_interval=interval), 50.0),
        (replace(snapshot, study_error=KnownError()), None),
    ):
        inputs = MeasuredInputs(scene)
        for k in range(1000):
            t_ns = k * 50_000_000
            computed = 1e5 + 1e3 * math.sin(2.0 * math.pi * k / 100.0)
            inputs.record(t_ns, (computed, 200.0, 190.0))
            inputs.submit(Measurement.of_winch(t_ns, tension_n=computed), t_ns)
            (one,) = inputs.residuals(now)
        assert one.instrument == pytest.approx(math.hypot(200.0, 1e-3 * one.measured))
        assert one.twin == (None if twin is None else pytest.approx(twin, rel=1e-3))
        both = math.hypot(one.instrument or 0.0, one.twin or 0.0)
        assert one.half_width == pytest.approx(1.96 * both)


def test_a_run_repeats_from_its_log_and_from_a_saved_state(at_rest: Twin) -> None:
    """Statistics included, to the bit; NaN is None in the log, since a state holds no NaN."""
    log: list[LogEntry] = []
    twin, repeated = at_rest.branch(), at_rest.branch()
    queue = InputQueue(twin, twin, log.append)
    for k in range(60):
        reported = Measurement.of_winch(
            twin.time_ns, 200.0 + 0.01 * (k % 3), None, 7.5e4 + 10.0 * k
        )
        queue.submit_measurement(reported)
        queue.advance(STEPS)
        last = twin.snapshot()
    calls = {entry.time_ns: calls_of(plain_calls(entry.calls)) for entry in log}
    for _ in range(60):
        apply(repeated, calls.get(repeated.time_ns, ()))
        repeated.advance(STEPS)
        again = repeated.snapshot()
    assert again.residuals == last.residuals
    assert len(last.residuals) == 2
    state = decode_state(twin.capture().encode(), "memory")
    resumed = Twin.restore(state, twin.scene)
    for one in (twin, resumed):
        one.submit_measurement(Measurement.of_winch(one.time_ns, 200.0, None, 7.6e4))
        one.advance(STEPS)
    assert resumed.snapshot().residuals == twin.snapshot().residuals != last.residuals


def test_messages_carry_what_was_measured_and_the_residuals(at_rest: Twin) -> None:
    rows = (("port", 12.5, None, 3e4), ("starboard", None, -0.5, None))
    for one in (
        Measurement("winch", 1_500_000_000, rows),
        Measurement("motor", 1_500_000_000, (("winch", None, None, 4e4),)),
        Measurement.of_depth(1_500_000_000, 120.0),
    ):
        topic, data = encode_measurement(1_500_000_000, one)
        assert topic in MEASURED_TOPICS
        assert read_measurement(topic, data) == one
    twin = at_rest.branch()
    for _ in range(30):
        twin.submit_measurement(Measurement.of_winch(twin.time_ns, 200.5, None, 8e4))
        twin.advance(STEPS)
        snapshot = twin.snapshot()
    data = Encoder(0).encode("residuals", snapshot)
    tension, line = read_cloud(deserialise(BY_NAME["residuals"].type_name, data))
    assert tension["name"] == b"top_tension_n winch"
    assert (
        tension["residual"]
        == tension["measured"] - tension["computed"]
        == snapshot.residuals[0].residual
    )
    assert line["mean"] == pytest.approx(0.5)
    assert line["upper"] == pytest.approx(1.96 * 0.05)
    assert math.isnan(tension["twin"])
    assert any(row.name == "simulation: residuals" for row in statuses(snapshot, None))
    summary = summarise(twin, snapshot, None)
    (reported, _) = json.loads(summary.as_json())["residuals"]
    assert (reported["residual"], reported["twin"]) == (snapshot.residuals[0].residual, None)
    assert "top tension of 'winch': measured 79.50 kN" in summary.as_text()
    assert RunSummary.from_values(summary.row().values) == summary


@pytest.mark.parametrize("topic", MEASURED_TOPICS)
def test_bytes_that_are_no_message_get_a_sentence(topic: str) -> None:
    with pytest.raises(InputError):
        read_measurement(topic, b"\x00\x01garbage")

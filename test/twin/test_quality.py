"""Quality index: each component, fall and rise, its bounds, and a twin whose heave drops out."""

from __future__ import annotations

import dataclasses
import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from sample_snapshot import RESIDUAL, hanging_rope
from small_scene import small_scene

from rope_twin.messages import Level, statuses
from rope_twin.scene.error_bound import KnownError
from rope_twin.twin.quality import (
    DEPTH,
    DISAGREEMENT_VALUE,
    ELEMENTS,
    EVALUATED_NS,
    FATIGUE,
    FORECAST,
    RISE_S,
    TENSION,
    TOLERANCES_PCT,
    WARNING_VALUE,
    QualityIndex,
    calibration_of,
    discretisation_of,
    input_of,
    inputs_of,
    residual_of,
    validity_of,
)
from rope_twin.twin.residual_tests import ResidualTests
from rope_twin.twin.snapshot import (
    CAUSES,
    UNPROVEN,
    ForecastScore,
    InputHealth,
    Quality,
    RopeStrength,
    Snapshot,
    SolverHealth,
    TensionInterval,
)
from rope_twin.twin.twin import Twin
from rope_twin.twin.validity import falling

SOUND = replace(hanging_rope(), error_interval=None, study_error=KnownError(0.5, 0.1, "by a study"))
MEASURED = replace(RESIDUAL, at_s=2.4, mean=0.0, rms=RESIDUAL.half_width / 1.96, outside=0.05)
UNMEASURED = replace(SOUND, residuals=())


def at(snapshot: Snapshot, time_s: float) -> Snapshot:
    """Return these readings at another time, as fresh as before."""
    moved = tuple(
        replace(one, at_s=one.at_s + time_s - snapshot.time_s) for one in snapshot.residuals
    )
    return replace(snapshot, stamp_ns=round(time_s * 1e9), residuals=moved)


def of(snapshot: Snapshot, element: str = TENSION) -> Quality:
    """The index of an element in a snapshot."""
    return next(one for one in snapshot.quality if one.element == element)


def heard(**health: object) -> Snapshot:
    """Sound but for the heave."""
    return replace(UNMEASURED, inputs={"heave": InputHealth(accepted=1200, **health)})  # type: ignore[arg-type]


def test_a_sound_twin_with_a_measurement_is_at_one() -> None:
    snapshot = QualityIndex().judge(replace(SOUND, residuals=(MEASURED,)))
    assert of(snapshot).index == 1.0
    assert of(snapshot).components == (1.0, 1.0, 1.0, 1.0, 1.0, None)
    assert of(snapshot, DEPTH).index == UNPROVEN, "its depth is not measured"


def test_without_a_measurement_or_a_known_error_it_is_capped_and_says_why() -> None:
    one = of(QualityIndex().judge(UNMEASURED))
    assert (one.index, one.cause) == (UNPROVEN, "residual")
    assert "no measured top tension" in one.reason
    unknown = replace(SOUND, residuals=(MEASURED,), study_error=KnownError(words="unknown: why"))
    one = of(QualityIndex().judge(unknown))
    assert (one.index, one.cause) == (UNPROVEN, "discretisation")
    assert "unknown: why" in one.reason


def test_a_measurement_that_is_refused_is_the_reason() -> None:
    """All readings in another unit: that there are none would be wrong."""
    sentence = "winch/measured: tension 1e+30 N; -2e+05 to 2e+06 N are possible for this rope"
    health = InputHealth(accepted=9, impossible=9, recently_refused=9, refusal=f"{sentence}.")
    snapshot = replace(UNMEASURED, inputs={**UNMEASURED.inputs, "winch_measured": health})
    judged = QualityIndex().judge(snapshot)
    assert (of(judged).index, of(judged).reason) == (UNPROVEN, sentence)
    assert of(judged, DEPTH).reason == "no measured payload depth to compare with"


def test_fatigue_has_an_index_only_where_it_is_counted() -> None:
    names = [one.element for one in QualityIndex().judge(SOUND).quality]
    assert names == [one for one in ELEMENTS if one != FORECAST]
    names = [one.element for one in QualityIndex().judge(replace(SOUND, fatigue=None)).quality]
    assert FATIGUE not in names


@pytest.mark.parametrize(
    ("health", "value"),
    [
        ({"age_s": 0.1}, 1.0),
        ({"stale": True, "note": "no heave for 2 s"}, 0.0),
        ({"fault": "the rates contradict the positions"}, 0.0),
        ({"warning": "noisy"}, WARNING_VALUE),
        ({"recently_refused": 1200, "interval_s": 0.05, "refusal": "late"}, 0.0),  # half of them
        (
            {"recently_refused": 400, "interval_s": 0.05, "refusal": "late"},
            0.5 * WARNING_VALUE,
        ),  # 25 %
    ],
)
def test_the_input_follows_its_health(health: dict[str, object], value: float) -> None:
    snapshot = heard(**health)
    assert inputs_of(snapshot).value == pytest.approx(value)
    rows = {row.name: row.level for row in statuses(QualityIndex().judge(snapshot), None)}
    assert (rows["simulation: quality"] > Level.OK) == (rows["simulation: input heave"] > Level.OK)


def test_the_more_are_refused_the_lower() -> None:
    values = [
        input_of("heave", InputHealth(accepted=1000, recently_refused=n)).value
        for n in (0, 1, 10, 100, 1000, 5000)
    ]
    assert values == sorted(values, reverse=True)  # type: ignore[type-var]
    assert values[0] == 1.0
    assert values[-1] == 0.0


def test_a_refused_cut_leaves_the_twin_as_good_as_it_was() -> None:
    cut = InputHealth(recently_refused=1, impossible=1, refusal="no rope there")
    assert inputs_of(replace(UNMEASURED, inputs={"cut": cut})).value == 1.0


@pytest.mark.parametrize("element", TOLERANCES_PCT)
def test_discretisation_falls_from_its_tolerance_to_three_times_that(element: str) -> None:
    by_study, by_interval = TOLERANCES_PCT[element]
    for share, value in ((0.5, 1.0), (1.0, 1.0), (2.0, 0.5), (3.0, 0.0), (9.0, 0.0)):
        snapshot = replace(SOUND, study_error=KnownError(share * by_study, 1.0, "by a study"))
        assert discretisation_of(element, snapshot).value == pytest.approx(value)
        bound_n = 0.01 * share * by_interval * 2e5
        rope = RopeStrength("main", 3e5, 1e6, static_n=2e5)
        snapshot = replace(
            snapshot, strength=(rope,), error_interval=TensionInterval(0.0, 1e6, bound_n, 0.0)
        )
        assert discretisation_of(element, snapshot).value == pytest.approx(value)


def test_a_rope_beyond_its_breaking_load_is_not_valid() -> None:
    parted = replace(SOUND, strength=(RopeStrength("main", 1.1e6, 1e6),))
    assert validity_of(parted).value == 0.0
    assert "parted" in validity_of(parted).reason
    assert validity_of(replace(SOUND, motion_ramp=0.4)).value == 0.5
    assert validity_of(replace(SOUND, fluid_factors=(1.0, 0.5, 1.0))).value == 0.5
    assert validity_of(SOUND).value == 1.0


def test_the_residual_falls_with_its_size_and_with_its_bias() -> None:
    sigma = MEASURED.half_width / 1.96
    sizes = [
        residual_of(TENSION, replace(SOUND, residuals=(replace(MEASURED, rms=k * sigma),))).value
        for k in (0.5, 1.5, 2.0, 3.0, 5.0, 9.0)
    ]
    assert sizes == sorted(sizes, reverse=True)  # type: ignore[type-var]
    assert (sizes[1], sizes[-2]) == (1.0, 0.0)
    biased = replace(MEASURED, rms=1.4 * sigma, mean=-5.0 * sigma)
    assert residual_of(TENSION, replace(SOUND, residuals=(biased,))).value == pytest.approx(0.0)


def test_old_few_or_unknown_readings_prove_nothing() -> None:
    for one in (
        replace(MEASURED, at_s=-9.0),
        replace(MEASURED, readings=9),
        replace(MEASURED, half_width=None, outside=None),
    ):
        assert residual_of(TENSION, replace(SOUND, residuals=(one,))).value is None


def test_a_frozen_load_cell_proves_nothing_and_is_named() -> None:
    for health, value in (
        (InputHealth(accepted=9, fault="gone"), None),
        (InputHealth(accepted=9, warning="frozen: top_tension_n"), WARNING_VALUE),
    ):
        snapshot = replace(SOUND, residuals=(MEASURED,), inputs={"winch_measured": health})
        found = residual_of(TENSION, snapshot)
        assert found.value == value
        assert (health.fault or health.warning) in found.reason
        assert inputs_of(snapshot).value == 1.0, "a sensor that only judges does not drive the twin"


def test_it_falls_at_once_and_rises_in_a_minute() -> None:
    index, bad = QualityIndex(), replace(heard(stale=True), residuals=(MEASURED,))
    good = replace(SOUND, residuals=(MEASURED,))
    assert of(index.judge(at(good, 1.0))).index == 1.0
    assert of(index.judge(at(bad, 1.2))).index == 0.0
    times = np.arange(1.2 + 0.2, 1.2 + RISE_S + 0.5, 0.2)
    risen = [of(index.judge(at(good, time_s))).index for time_s in times]
    assert risen == pytest.approx(np.minimum((times - 1.2) / RISE_S, 1.0), abs=1e-9)
    lowest = of(index.judge(at(good, 90.0)))
    assert (lowest.lowest, lowest.lowest_at_s) == (0.0, pytest.approx(1.2))


def test_while_it_rises_it_says_from_what() -> None:
    index = QualityIndex()
    index.judge(at(heard(fault="no clock"), 1.0))
    rising = of(index.judge(at(UNMEASURED, 10.0)))
    assert 0.0 < rising.index < UNPROVEN
    assert (rising.cause, rising.reason) == ("input", "heave: no clock")
    assert rising.components[0] == 1.0


def test_between_evaluations_nothing_changes() -> None:
    index = QualityIndex()
    first = index.judge(at(UNMEASURED, 1.0)).quality
    soon = replace(heard(stale=True), stamp_ns=1_000_000_000 + EVALUATED_NS - 1)
    assert index.judge(soon).quality == first


def test_an_unconverged_step_between_evaluations_counts() -> None:
    """The count since the start is compared, not only the newest snapshot's mark."""
    index = QualityIndex()
    index.judge(at(UNMEASURED, 1.0))
    worse = replace(UNMEASURED, solver=SolverHealth(unconverged_substeps=1))
    index.judge(at(worse, 1.1))
    assert of(index.judge(at(worse, 1.3))).index == 0.0
    assert of(index.judge(at(worse, 1.5))).components[1] == 1.0


def test_a_failed_step_holds_it_down_for_a_minute() -> None:
    index = QualityIndex()
    index.judge(at(UNMEASURED, 1.0))
    index.fail(1_050_000_000)
    failed = of(index.judge(at(UNMEASURED, 1.06)))
    assert (failed.index, failed.cause) == (0.0, "numerics")
    assert of(index.judge(at(UNMEASURED, 60.0))).index == 0.0
    assert of(index.judge(at(UNMEASURED, 62.0))).index > 0.0


def test_history_is_the_share_of_time_in_agreement() -> None:
    """Half an hour well, then a quarter of an hour off: 2/3 of the time, below the 80 % of 0."""
    index, good = QualityIndex(), replace(SOUND, residuals=(MEASURED,))
    off = replace(SOUND, residuals=(replace(MEASURED, outside=0.3),))
    for time_s in range(1, 1801):
        snapshot = index.judge(at(good, float(time_s)))
    assert of(snapshot).components[-1] == 1.0
    for time_s in range(1801, 2701):
        snapshot = index.judge(at(off, float(time_s)))
    assert of(snapshot).components[-1] == 0.0
    assert of(snapshot, DEPTH).components[-1] is None
    for time_s in range(3600, 86400 + 3600, 60):  # a day later the bad quarter is forgotten
        snapshot = index.judge(at(good, float(time_s)))
    assert of(snapshot).components[-1] == 1.0


def test_faults_of_the_last_hour_are_remembered() -> None:
    """One is healed after its minute; the second of an hour leaves 0.9, and the tenth 0.5."""
    index, good = QualityIndex(), replace(SOUND, residuals=(MEASURED,))
    bad = replace(heard(stale=True, note="no heave"), residuals=(MEASURED,))
    for number, value in enumerate((None, 0.9, 0.8, 0.7, 0.6, 0.5, 0.5, 0.5, 0.5)):
        at_s = 100.0 * (number + 1)
        index.judge(at(bad, at_s))
        index.judge(at(bad, at_s + 8.0))  # the same fault
        now = of(index.judge(at(good, at_s + 99.0)))
        assert now.components[-1] == (None if value is None else pytest.approx(value))
        assert now.index == pytest.approx(value or 1.0)
    assert now.reason.startswith("9 faults in the last hour, the last one at 900 s: heave")
    for time_s in np.arange(1000.0, 4800.0, 10.0):
        snapshot = index.judge(at(good, float(time_s)))
    assert of(snapshot).index == 1.0


@pytest.mark.parametrize(
    ("tests", "value", "words"),
    [
        (ResidualTests(1.0, 0.0, 0.9, 300.0, None, 0.0), 1.0, ""),
        (ResidualTests(3.0, 6.0, 1.7, 300.0, None, 0.0), 0.75, "5 min 1.7 times"),
        (ResidualTests(9.0, 13.0, 3.0, 300.0, None, 0.0), DISAGREEMENT_VALUE, "more than chance"),
        (ResidualTests(0.1, -6.0, 0.1, 300.0, None, 0.0), UNPROVEN, "proves little"),
        (
            ResidualTests(1.0, 0.0, 0.9, 300.0, -0.8, 900.0),
            DISAGREEMENT_VALUE,
            "drifted by -0.8 times",
        ),
    ],
)
def test_the_residual_follows_its_tests_over_minutes(
    tests: ResidualTests, value: float, words: str
) -> None:
    snapshot = replace(SOUND, residuals=(replace(MEASURED, tests=tests),))
    one = of(QualityIndex().judge(snapshot))
    assert one.components[4] == one.index == pytest.approx(value)
    assert words in one.reason


def scored(time_s: float, **figures: float) -> Snapshot:
    """Sound, with a forecast that came half a second ago."""
    given = {"at_s": time_s - 0.5, "age_s": 0.5, "coverage": 0.9, "judged": 40, "factor": 1.0}
    return at(replace(UNMEASURED, forecast_score=ForecastScore(**(given | figures))), time_s)  # type: ignore[arg-type]


def test_a_forecast_has_an_index_only_while_it_runs() -> None:
    index = QualityIndex()
    assert FORECAST not in [one.element for one in index.judge(at(UNMEASURED, 1.0)).quality]
    snapshot = index.judge(scored(2.0))
    assert (of(snapshot, FORECAST).index, of(snapshot).index) == (1.0, UNPROVEN)
    silent = of(index.judge(scored(20.0, at_s=2.0)), FORECAST)
    assert silent.index == 0.0
    assert silent.reason.startswith("the last forecast came 18 s ago")
    assert FORECAST not in [one.element for one in index.judge(at(UNMEASURED, 90.0)).quality]
    assert of(index.judge(scored(91.0)), FORECAST).index == 1.0, "another one begins afresh"


def test_a_forecast_is_as_good_as_its_last_bands_held() -> None:
    """Within two deviations of a share of n draws about 90 %; none judged: unproven."""
    for coverage, judged, value in (
        (0.9, 100, 1.0), (0.85, 100, 1.0), (0.67, 100, 0.5), (0.5, 100, 0.0), (0.3, 100, 0.0),
        (0.7, 5, 1.0), (1.0, 100, 1.0),
    ):  # fmt: skip
        score = ForecastScore(0.0, 0.5, coverage, judged, 1.0)
        assert calibration_of(score).value == pytest.approx(value)
    assert calibration_of(ForecastScore(0.0, 0.5, 0.9, 100, 2.25)).value == pytest.approx(0.5)
    unknown = of(QualityIndex().judge(scored(2.0, coverage=math.nan, judged=0)), FORECAST)
    assert (unknown.index, unknown.cause) == (UNPROVEN, "residual")
    late = of(QualityIndex().judge(scored(2.0, age_s=10.0)), FORECAST)
    assert (late.index, late.cause) == (pytest.approx(0.5), "input")


@given(value=st.floats(-1e9, 1e9), step=st.floats(0.0, 1e9))
def test_a_component_never_rises_with_its_error(value: float, step: float) -> None:
    assert 0.0 <= falling(value + step, 1.5, 5.0) <= falling(value, 1.5, 5.0) <= 1.0


snapshots = st.builds(
    lambda stale, warned, refused, error, ramp, failed, mean, measured: replace(
        UNMEASURED,
        inputs={
            "heave": InputHealth(
                accepted=100, stale=stale, warning=warned, recently_refused=refused, interval_s=0.05
            )
        },
        study_error=KnownError(error, error, "by a study"),
        motion_ramp=ramp,
        solver=SolverHealth(unconverged_substeps=failed),
        residuals=(replace(MEASURED, mean=mean, rms=abs(mean)),) if measured else (),
    ),
    st.booleans(), st.sampled_from(["", "noisy"]), st.integers(0, 3000),
    st.one_of(st.just(math.nan), st.floats(0.0, 100.0)), st.sampled_from([0.3, 1.0]),
    st.integers(0, 3), st.floats(-1e4, 1e4), st.booleans(),
)  # fmt: skip


@settings(max_examples=100, deadline=None)
@given(course=st.lists(st.tuples(snapshots, st.floats(0.2, 30.0)), min_size=1, max_size=8))
def test_it_stays_within_its_bounds(course: list[tuple[Snapshot, float]]) -> None:
    """Within 0 to 1, at most the smallest component, and capped where nothing was measured."""
    index, now_s, before = QualityIndex(), 0.0, {}
    for snapshot, wait_s in course:
        now_s += wait_s
        for one in index.judge(at(snapshot, now_s)).quality:
            known = [part for part in one.components if part is not None]
            assert 0.0 <= one.index <= min(known)
            assert one.cause in CAUSES
            if one.components[4] is None:
                assert one.index <= UNPROVEN
            if one.element in before:
                assert one.index <= before[one.element] + wait_s / RISE_S + 1e-9
            before[one.element] = one.index
            assert one.lowest <= one.index or now_s == one.lowest_at_s


def test_nothing_builds_up_while_the_ship_lies_still(tmp_path: Path) -> None:
    twin = Twin(small_scene(tmp_path))
    assert twin.snapshot().motion_ramp == 1.0
    assert of(twin.snapshot()).index == UNPROVEN
    twin.submit_heave(0, 0.1, 0.0)
    assert twin.snapshot().motion_ramp == 0.0
    twin.advance(100)
    assert twin.snapshot().motion_ramp == 0.5  # of a ramp of 2 s, u³·(10 - 15u + 6u²)


def test_a_twin_whose_heave_drops_out_and_returns(tmp_path: Path) -> None:
    """Through the public interface, in a saved state too."""
    twin = Twin(small_scene(tmp_path))

    def run(until_s: float, sends: bool) -> Snapshot:
        while twin.time_ns < round(until_s * 1e9):
            if sends:
                t = twin.time_ns * 1e-9 + 0.1
                wave = 0.5 * math.sin(0.6 * t), 0.3 * math.cos(0.6 * t)
                twin.submit_heave(round(t * 1e9), *wave)
            twin.advance(10)
            snapshot = twin.snapshot()
        return snapshot

    before = run(20.0, sends=True)
    assert of(before).index > 0.5
    gone = run(22.0, sends=False)
    assert (of(gone).index, of(gone).cause) == (0.0, "input")
    row = next(row for row in statuses(gone, None) if row.name == "simulation: quality")
    assert row.level == Level.ERROR
    assert "heave" in row.message
    twin.save(tmp_path / "gone.state")
    back = run(40.0, sends=True)
    assert 0.0 < of(back).index < 0.4
    again = Twin.restore(tmp_path / "gone.state", twin.scene)
    assert dataclasses.asdict(of(again.snapshot())) == dataclasses.asdict(of(gone))
    twin = again
    assert twin.take_remark("ship/heave: malformed") == ""
    kept_out = twin.inputs.health()["border"]
    assert kept_out.warning == "ship/heave: malformed"
    snapshot = replace(UNMEASURED, inputs={"border": kept_out})
    assert inputs_of(snapshot).value == WARNING_VALUE
    names = [row.name for row in statuses(snapshot, None)]
    assert "simulation: input border" not in names, "rows of the border tell it"

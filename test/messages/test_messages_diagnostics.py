"""Diagnostics: texts and levels that operators read."""

from __future__ import annotations

from dataclasses import asdict, replace

import numpy as np
import pytest
from sample_snapshot import QUALITY, hanging_rope

from rope_twin import messages
from rope_twin.messages import Encoder, Level, Status, decode, read_cloud, statuses
from rope_twin.messages.reports import lowest_words
from rope_twin.scene.error_bound import KnownError
from rope_twin.twin.pacing import PacingHealth
from rope_twin.twin.snapshot import (
    CAUSES,
    BedContact,
    EnergyBalance,
    InputHealth,
    RopeStrength,
    Snapshot,
    SolverHealth,
)

GOOD = PacingHealth(running=True, steps=100, real_time_factor=420.0)


def row(part: str, snapshot: Snapshot, pacing: PacingHealth | None = GOOD) -> Status:
    (found,) = [r for r in statuses(snapshot, pacing) if r.name == f"simulation: {part}"]
    return found


def test_all_is_well_when_all_is_well() -> None:
    rows = statuses(hanging_rope(), GOOD)
    assert {r.level for r in rows} == {Level.OK}
    assert len({r.name for r in rows}) == len(rows) == 14


def test_a_doubtful_step_is_an_error_and_a_past_one_a_warning() -> None:
    past = replace(hanging_rope(), solver=SolverHealth(steps=10, unconverged_substeps=1))
    assert row("solver", past).level is Level.WARN
    assert "1 substep " in row("solver", past).message
    now = row("solver", replace(past, not_converged=True))
    assert now.level is Level.ERROR
    assert "not converged" in now.message


def test_the_winch_says_why_it_is_held_back() -> None:
    held = replace(hanging_rope(), winch_at_limit="2,000 m of line are out, which is all there is")
    assert row("winch", held).level is Level.WARN
    assert row("winch", held).message == held.winch_at_limit
    hauling = replace(hanging_rope(), payout_speed_m_per_s=-0.5)
    assert row("winch", hauling).message.startswith("hauling in")


def test_the_tension_never_goes_without_its_error() -> None:
    """By the study, or the reason why there is none; that is no fault of the run's."""
    reported = row("accuracy", hanging_rope())
    assert "0.5 % at most, in a run on paper" in reported.message
    assert reported.values["peak error bound [%]"] == "0.1"
    nothing = KnownError(words="unknown: no study")
    reported = row("accuracy", replace(hanging_rope(), study_error=nothing))
    assert reported.level is Level.OK
    assert reported.message.endswith("unknown: no study")
    assert reported.values["RMS error bound [% of the standard deviation]"] == "unknown"


def test_start_up_is_reported_until_the_motion_is_all_there() -> None:
    ramp = row("start-up", replace(hanging_rope(), motion_ramp=0.25))
    assert ramp.level is Level.WARN
    assert "25%" in ramp.message
    nearly = row("start-up", replace(hanging_rope(), motion_ramp=0.9999))
    assert "99%" in nearly.message, "all of it would be no reason for a warning"


@pytest.mark.parametrize(
    ("health", "level", "words"),
    [
        (GOOD._replace(error="the rope cannot be stepped on"), Level.ERROR, "cannot be stepped"),
        (GOOD._replace(behind_s=1.5), Level.ERROR, "1.50 s behind"),
        (
            GOOD._replace(late_steps=2, worst_lateness_s=0.004, late_ago_s=3.0),
            Level.WARN,
            "2 missed deadlines",
        ),
        (
            GOOD._replace(late_steps=2, worst_lateness_s=0.004, late_ago_s=61.0),
            Level.OK,
            "in the last 60 s; 2 missed deadlines since the start",
        ),
        (GOOD._replace(running=False), Level.OK, "paused"),
    ],
)
def test_pacing(health: PacingHealth, level: Level, words: str) -> None:
    reported = row("pacing", hanging_rope(), health)
    assert reported.level is level
    assert words in reported.message


def test_an_unpaced_run_has_no_pacing_row() -> None:
    assert not [r for r in statuses(hanging_rope(), None) if "pacing" in r.name]


def test_the_error_interval_is_reported_where_there_is_one() -> None:
    without = replace(hanging_rope(), error_interval=None)
    assert not [r for r in statuses(without, GOOD) if "interval" in r.name]
    reported = row("error interval", hanging_rope())
    assert reported.level is Level.OK
    assert "within 40 N of the converged" in reported.message
    assert reported.values["extra CPU time [%]"] == "25"


def test_the_energy_balance_is_reported_where_there_is_one() -> None:
    """Each term in joules, the residual in per cent; energy from nothing is a warning."""
    assert not [r for r in statuses(hanging_rope(), GOOD) if "energy" in r.name]
    balance = EnergyBalance(
        since_s=1.0, kinetic_j=2e4, elastic_j=3e5, potential_j=-4e6, change_j=-9e4, hang_off_j=-8e4,
        passing_j=1e3, water_j=-9e3, damped_j=1.5e3, residual_j=500.0, exchanged_j=1e6,
    )  # fmt: skip
    reported = row("energy", replace(hanging_rope(), energy=balance))
    assert reported.level is Level.OK
    assert "0.05 % of the energy exchanged" in reported.message
    assert reported.values["work of the water [J]"] == "-9000"
    assert reported.values["residual [% of exchanged]"] == "0.05"
    assert len(reported.values) == 12
    gained = row("energy", replace(hanging_rope(), energy=replace(balance, residual_j=-2e3)))
    assert gained.level is Level.WARN
    assert "gain of 0.2 % of the energy exchanged" in gained.message


def test_a_residual_beside_nothing_is_round_off() -> None:
    """A rope at rest exchanges nothing: its residual is beside 1e-4 of what is there."""
    rest = EnergyBalance(
        since_s=0.0, kinetic_j=0.0, elastic_j=1e5, potential_j=-3e6, change_j=1e-9, hang_off_j=0.0,
        passing_j=0.0, water_j=0.0, damped_j=0.0, residual_j=-1e-9, exchanged_j=1e-9,
    )  # fmt: skip
    assert rest.residual_pct == pytest.approx(-1e-9 / 310.0 * 100.0)
    assert row("energy", replace(hanging_rope(), energy=rest)).level is Level.OK
    assert replace(rest, elastic_j=0.0, potential_j=0.0, exchanged_j=0.0).residual_pct == 0.0


@pytest.mark.parametrize(
    ("health", "level", "words"),
    [
        (InputHealth(), Level.OK, "no sample received yet"),
        (InputHealth(accepted=7, age_s=0.1), Level.OK, "7 samples accepted"),
        (
            InputHealth(
                accepted=7,
                late=1,
                impossible=2,
                recently_refused=3,
                note="heave of 90 m is impossible",
            ),
            Level.WARN,
            "3 samples rejected in the last 60 s; last: heave of 90 m is impossible",
        ),
        (
            InputHealth(accepted=7, late=1, impossible=2, note="heave of 90 m is impossible"),
            Level.OK,
            "7 samples accepted; 3 rejected since the start, none in the last 60 s",
        ),
        (
            InputHealth(accepted=7, stuck=2, recently_refused=2, fault="the sender is stuck"),
            Level.ERROR,
            "the sender is stuck",
        ),
        (
            InputHealth(accepted=7, warning="a sample every 0.5 s is too slow"),
            Level.WARN,
            "a sample every 0.5 s is too slow",
        ),
        (
            InputHealth(
                accepted=7,
                late=1,
                recently_refused=1,
                refusal="it came late.",
                note="it came late.",
                warning="heave: a jump; check the sensor.",
            ),
            Level.WARN,
            "heave: a jump; check the sensor; 1 sample rejected in the last 60 s; last: "
            "it came late.",
        ),
        (
            InputHealth(
                accepted=7,
                late=1,
                recently_refused=1,
                refusal="it came late.",
                note="samples are back",
            ),
            Level.WARN,
            "1 sample rejected in the last 60 s; last: it came late; now: samples are back",
        ),
        (
            InputHealth(
                accepted=7,
                late=1,
                recently_refused=1,
                refusal="it came late.",
                note="it came late.",
            ),
            Level.WARN,
            "last: it came late.",
        ),
        (InputHealth(accepted=7, age_s=4.2, stale=True), Level.ERROR, "no heave for 4.200 s"),
        (InputHealth(stale=True, note="fading out"), Level.ERROR, "stale: fading out"),
        (
            InputHealth(
                stale=True,
                impossible=2,
                recently_refused=2,
                refusal="50 m/s; too fast.",
                note="kept",
            ),
            Level.ERROR,
            "stale: kept; 2 samples rejected in the last 60 s; last: 50 m/s; too fast",
        ),
    ],
)
def test_inputs(health: InputHealth, level: Level, words: str) -> None:
    reported = row("input heave", replace(hanging_rope(), inputs={"heave": health}))
    assert reported.level is level
    assert words in reported.message
    assert reported.values["refused"] == str(health.refused)


@pytest.mark.parametrize(
    ("highest_kn", "level", "words"),
    [
        (499.0, Level.OK, "499.0 kN, utilisation 0.50 (MBL 1000 kN)"),
        (501.0, Level.WARN, "utilisation 0.50"),
        (1420.0, Level.ERROR, "MBL exceeded (utilisation 1.42): rope failure expected"),
    ],
)
def test_a_rope_beyond_its_breaking_load_is_reported(
    highest_kn: float, level: Level, words: str
) -> None:
    strength = (RopeStrength("hoist", highest_kn * 1e3, 1e6),)
    reported = row("strength", replace(hanging_rope(), strength=strength))
    assert (reported.level, words in reported.message) == (level, True)
    slack = (*strength, RopeStrength("aft", 0.0, 1e6))
    both = row("strength", replace(hanging_rope(), strength=slack))
    assert "of 'hoist' " in both.message
    assert both.values["aft: utilisation [% of MBL]"] == "0.0"


def test_diagnostics_come_back_as_they_went_in() -> None:
    rows = [Status("a", Level.OK, "gut · ok", {"x": "1"}), Status("b", Level.ERROR, "", {})]
    decoded = messages.decode("diagnostics", messages.encode_diagnostics(5_000_000_001, rows))
    assert (decoded.header.stamp.sec, decoded.header.stamp.nanosec) == (5, 1)
    back = [
        Status(s.name, Level(s.level), s.message, {v.key: v.value for v in s.values})
        for s in decoded.status
    ]
    assert back == rows
    assert {s.hardware_id for s in decoded.status} == {"rope_twin"}


def test_the_compensator_warns_at_its_stops() -> None:
    """Within its stroke it is OK, retracted or extended a warning."""
    snapshot = hanging_rope()
    unit = snapshot.compensator
    assert unit is not None
    for stroke, level, words in (
        (2.1, Level.OK, "stroke 2.10 of 4.00 m"),
        (-0.01, Level.WARN, "retracted to its end stop"),
        (4.02, Level.WARN, "extended to its end stop"),
    ):
        there = replace(snapshot, compensator=replace(unit, stroke_m=stroke))
        row = next(r for r in statuses(there, GOOD) if "compensator" in r.name)
        assert row.level == level
        assert words in row.message
    assert not [
        r for r in statuses(replace(snapshot, compensator=None), GOOD) if "compens" in r.name
    ]


def test_the_seabed_is_reported() -> None:
    """Landed and lying; and hanging above it."""
    row = next(r for r in statuses(hanging_rope(), GOOD) if "seabed" in r.name)
    assert all(words in row.message for words in ("landed", "95.0 kN", "12.0 m of rope"))
    above = replace(hanging_rope(), seabed=BedContact(3.21, 0.0, 0.0, 0.0))
    row = next(r for r in statuses(above, GOOD) if "seabed" in r.name)
    assert "3.21 m above the seabed" in row.message
    assert not [r for r in statuses(replace(above, seabed=None), GOOD) if "seabed" in r.name]


@pytest.mark.parametrize(
    ("index", "level", "words"),
    [
        (0.95, Level.OK, "0.9"), (0.7, Level.OK, "0.7"), (0.69, Level.WARN, "0.6"),
        (0.5, Level.WARN, "0.5"), (0.49, Level.ERROR, "0.4"), (0.0, Level.ERROR, "0.0"),
    ],
)  # fmt: skip
def test_the_quality_row_has_the_lowest_index_and_its_reason(
    index: float, level: Level, words: str
) -> None:
    other = replace(QUALITY, element="slack", index=1.0)
    parts = (index, 1.0, 1.0, 1.0, 1.0, None)
    worst = replace(QUALITY, index=index, cause="input", reason="heave: late", components=parts)
    found = row("quality", replace(hanging_rope(), quality=(other, worst)))
    assert found.level is level
    said = f"lowest index {words} (top tension)"
    assert found.message == f"{said}, limited by input: heave: late"
    sound = replace(worst, components=(1.0, 1.0, 1.0, 1.0, 1.0, None))
    rising = row("quality", replace(hanging_rope(), quality=(other, sound)))
    assert rising.message == f"{said}, rising after input: heave: late"
    assert found.values["slack: index"] == "1.000"
    assert found.values["top tension: history"] == "unknown"


@pytest.mark.parametrize(("index", "reason"), [(0.7, "now"), (0.9, "then")])
def test_a_lowest_index_that_lasts_has_its_present_reason(index: float, reason: str) -> None:
    """A run of 0.7 throughout is explained by what limits it now."""
    lasting = replace(QUALITY, index=index, reason="now", lowest=0.7, lowest_reason="then")
    assert lowest_words([asdict(lasting)]).endswith(f"): {reason}")


def test_the_quality_table_has_every_component_and_nan_where_unknown() -> None:
    snapshot = hanging_rope()
    rows = read_cloud(decode("twin/quality", Encoder(0).encode("twin/quality", snapshot)))
    assert rows.dtype.names == ("name", "index", "cause", *CAUSES)
    (one,) = rows
    assert one["name"].decode() == "top_tension"
    assert (one["index"], one["cause"]) == (0.8, CAUSES.index("discretisation"))
    assert (one["discretisation"], one["residual"]) == (0.8, 1.0)
    assert np.isnan(one["history"])

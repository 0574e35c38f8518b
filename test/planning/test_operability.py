"""Operability of synthetic weather with closed forms: square waves, months, Markov chains."""

from __future__ import annotations

import json
import math
from dataclasses import replace
from datetime import datetime
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from weather_samples import HOUR, write_hindcast, write_limits

from rope_twin.cli import main
from rope_twin.errors import InputError
from rope_twin.planning.operability import Operation, operability
from rope_twin.planning.weather_files import (
    Hindcast,
    LimitTable,
    read_alpha,
    read_hindcast,
    read_limits,
)

CALM_M, STORM_M, LIMIT_M = 1.0, 3.0, 2.0
ANY = LimitTable("limits", {"lift": (np.array([1.0, 40.0]), np.zeros(1), np.full((2, 1), LIMIT_M))})


def hindcast(hs_m: np.ndarray, step_s: float = HOUR, towards: float | None = None) -> Hindcast:
    """A series with 8 s waves, all in January."""
    count = len(hs_m)
    direction = None if towards is None else np.full(count, towards)
    month = np.ones(count, np.int64)
    return Hindcast("weather", step_s, hs_m, np.full(count, 8.0), direction, month)


def test_a_square_wave_has_its_windows_and_waits() -> None:
    """30 h calm, 19 h storm; T_R 12 h: 18 of 49 hours may start, the others wait 1 to 31 h.

    Half of 49 hours is the 25th smallest wait, the 7th above 0; nine tenths the 45th, the 27th.
    """
    hs = np.tile(np.r_[np.full(30, CALM_M), np.full(19, STORM_M)], 400)
    found = operability(hindcast(hs), ANY, Operation(8.0 * HOUR, 4.0 * HOUR))
    whole = found.whole
    assert whole.within_limit == whole.within_forecast == pytest.approx(30.0 / 49.0)
    assert whole.possible_starts == pytest.approx(18.0 / 49.0, abs=2e-3)
    assert whole.wait.percentiles_s == (7.0 * HOUR, 27.0 * HOUR)
    assert whole.duration.percentiles_s == (19.0 * HOUR, 39.0 * HOUR)
    assert whole.wait.mean_s / HOUR == pytest.approx(31.0 * 32.0 / 2.0 / 49.0, abs=0.05)
    assert found.calm.percentiles_s == (30.0 * HOUR, 30.0 * HOUR)
    assert found.storm.percentiles_s == (19.0 * HOUR, 19.0 * HOUR)
    assert found.operation.reference_s == 12.0 * HOUR


@pytest.mark.parametrize(
    ("hours", "step_h", "starts"), [(12.0, 3.0, 6), (11.0, 3.0, 6), (9.0, 3.0, 7), (10.0, 1.0, 20)]
)
def test_windows_last_for_whole_steps_at_least(hours: float, step_h: float, starts: int) -> None:
    """11 h at steps of 3 h take four steps; a calm of n samples has n - steps starts."""
    calm = 10 if step_h == 3.0 else 30
    hs = np.tile(np.r_[np.full(calm, CALM_M), np.full(10, STORM_M)], 50)
    found = operability(hindcast(hs, step_h * HOUR), ANY, Operation(hours * HOUR, 0.0))
    assert found.whole.possible_starts == pytest.approx(starts / (calm + 10))


def test_a_markov_chain_has_geometric_spells() -> None:
    """Persistence p: mean spells 1/(1 - p), share (1 - q)/(2 - p - q), starts times p^steps."""
    p, q, count, steps = 0.97, 0.9, 400_000, 8
    draw = np.random.default_rng(5).random(count)
    calm, state = np.empty(count, bool), True
    for k in range(count):
        state = draw[k] < p if state else draw[k] >= q
        calm[k] = state
    found = operability(
        hindcast(np.where(calm, CALM_M, STORM_M)), ANY, Operation(steps * HOUR, 0.0)
    )
    share = (1.0 - q) / (2.0 - p - q)
    assert found.whole.within_limit == pytest.approx(share, abs=0.01)
    assert found.whole.possible_starts == pytest.approx(share * p**steps, abs=0.012)
    assert found.calm.mean_s / HOUR == pytest.approx(1.0 / (1.0 - p), rel=0.03)
    assert found.storm.mean_s / HOUR == pytest.approx(1.0 / (1.0 - q), rel=0.03)
    for spells, own in ((found.calm, p), (found.storm, q)):
        expected = [math.ceil(math.log(1.0 - one) / math.log(own)) for one in (0.5, 0.9)]
        assert np.array(spells.percentiles_s) / HOUR == pytest.approx(expected, abs=1.0)


def test_months_are_those_of_readiness(tmp_path: Path) -> None:
    """Summer from April to September is calm, winter is not; two years of three-hourly rows."""
    steps = 8 * 730
    stamps = np.datetime64("2001-01-01T00", "h") + 3 * np.arange(steps).astype("timedelta64[h]")
    month = stamps.astype("datetime64[M]").astype(int) % 12 + 1
    summer = (month >= 4) & (month <= 9)
    path = write_hindcast(tmp_path / "h.csv", np.where(summer, CALM_M, STORM_M), step_h=3.0)
    found = operability(read_hindcast(path), read_limits(write_limits(tmp_path / "l.csv", 2.0)),
                        Operation(24.0 * HOUR, 0.0))  # fmt: skip
    by_name = {own.name: own for own in found.months}
    assert list(by_name) == ["Jan", "Feb", "Mar", "Apr", "May", "Jun", "Jul", "Aug", "Sep", "Oct",
                             "Nov", "Dec"]  # fmt: skip
    assert [by_name[name].within_limit for name in ("Mar", "Apr", "Sep", "Oct")] == [0, 1, 1, 0]
    assert by_name["Sep"].possible_starts == pytest.approx((240 - 8) / 240)
    # ready at noon of an average day in March: half the month, then April
    assert by_name["Mar"].wait.percentiles_s[0] == pytest.approx(15.5 * 86400.0, abs=3 * HOUR)
    assert by_name["Jan"].samples == 2 * 31 * 8
    # half of the waits from October on are cut off by the end of the hindcast
    assert by_name["Dec"].wait.percentiles_s[1] == math.inf
    assert found.years == pytest.approx(730.0 / 365.25)


ALPHA = """# source: example of the test, not a standard
hs_m,planned_h,alpha
1,12,0.7
1,24,0.6
2,12,0.8
2,24,0.7
4,12,0.9
4,24,0.84
"""


def test_alpha_lowers_the_limit_of_the_forecast(tmp_path: Path) -> None:
    """0.8 at 2 m and 12 h: 1.5 m passes, 1.7 and 1.9 m do not, though they are within the limit."""
    (tmp_path / "alpha.csv").write_text(ALPHA)
    alpha = read_alpha(tmp_path / "alpha.csv")
    assert alpha.source == "example of the test, not a standard"
    hs = np.tile([1.5, 1.7, 1.9, 2.1], 30)
    found = operability(hindcast(hs), ANY, Operation(12.0 * HOUR, 12.0 * HOUR), alpha)
    assert found.whole.within_limit == 0.75
    assert found.whole.within_forecast == 0.25
    assert found.alpha == (0.8, 0.8)
    # bilinear in height and period; held above the largest height and below the shortest period
    at = alpha.at(np.array([1.0, 1.5, 3.0, 9.0]), 18.0 * HOUR, 99.0 * HOUR)
    assert at == pytest.approx([0.65, 0.7, 0.81, 0.87])
    assert alpha.at(np.array([2.0]), 1.0 * HOUR, 0.0) == pytest.approx([0.8])
    with pytest.raises(InputError, match=r"it begins at Hs 1 m, and .* at most 0\.5 m; give"):
        alpha.at(np.array([0.5, 0.2]), 12.0 * HOUR, 0.0)
    with pytest.raises(InputError, match=r"it ends at 24 h; give alpha factors up to 30 h"):
        alpha.at(np.array([2.0]), 30.0 * HOUR, 0.0)
    (tmp_path / "alpha.csv").write_text(ALPHA.replace("planned_h", "reference_h"))
    by_reference = read_alpha(tmp_path / "alpha.csv")
    assert by_reference.at(np.array([2.0]), 0.0, 24.0 * HOUR) == pytest.approx([0.7])


HEADINGS = LimitTable(
    "limits",
    {"lift": (np.array([4.0, 16.0]), np.array([0.0, 90.0, 180.0, 270.0]),
              np.tile([1.0, 2.0, 3.0, 4.0], (2, 1)))},
)  # fmt: skip


@pytest.mark.parametrize(
    ("bow", "comes_from", "limit"),
    [(0, 0, 3.0), (0, 180, 1.0), (0, 90, 2.0), (0, 270, 4.0), (90, 90, 3.0), (45, 0, 3.5),
     (-90, 90, 1.0), (0, 315, 3.5), (0, 225, 2.5)],
)  # fmt: skip
def test_directions_are_turned_into_headings(bow: float, comes_from: float, limit: float) -> None:
    """Bow north: waves from the north are head seas, waves from the east travel to port (90°)."""
    hs = np.array([limit - 0.01, limit + 0.01] * 20)
    weather = hindcast(hs, HOUR, (comes_from + 180.0) % 360.0)
    found = operability(weather, HEADINGS, Operation(HOUR, 0.0, bow_deg=bow))
    assert found.whole.within_limit == 0.5
    kept = operability(weather, HEADINGS, Operation(HOUR, 0.0, relative_deg=180.0))
    assert kept.whole.within_limit == (1.0 if limit < 2.9 else 0.5 if limit < 3.1 else 0.0)


def test_limits_are_those_of_all_phases_and_bilinear(tmp_path: Path) -> None:
    path = tmp_path / "limits.csv"
    path.write_text(
        "phase,tp_s,heading_deg,limit_hs_m\n"
        + "".join(f"splash,{t},{h},{1 + t / 10 + h / 100}\n" for t in (6, 8, 12) for h in (0, 180))
        + "".join(f"landing,{t},{h},2.5\n" for t in (6, 12) for h in (0, 180))
    )
    limits = read_limits(path)
    assert limits.phases == ("splash", "landing")
    tp, heading = np.array([7.0, 10.0, 10.0, 5.0]), np.array([45.0, 90.0, -90.0, 0.0])
    expected = [2.15, 2.9, 2.9, math.nan]
    assert limits.at("splash", tp, heading) == pytest.approx(expected, nan_ok=True)
    weather = hindcast(np.array([1.7, 1.9, 2.4, 2.6] * 5))
    both = operability(weather, limits, Operation(HOUR, 0.0, relative_deg=0.0))
    assert dict(both.phases) == {"splash": 0.25, "landing": 0.75}
    assert both.whole.within_limit == 0.25
    alone = operability(weather, limits.only(["landing"]), Operation(HOUR, 0.0, relative_deg=0.0))
    assert alone.whole.within_limit == 0.75
    with pytest.raises(InputError, match="there is no phase 'spash'; did you mean 'splash'"):
        limits.only(["spash"])
    as_json = tmp_path / "limits.json"
    rows = [{"phase": "landing", "tp_s": t, "limit_hs_m": 2.5} for t in (6, 12)]
    as_json.write_text(json.dumps({"limits": rows}))
    assert read_limits(as_json).at("landing", tp[:1], heading[:1]) == pytest.approx([2.5])


SECTORS = [135.0, 165.0, 180.0]


@pytest.mark.parametrize(
    ("headings", "symmetric", "covered"),
    [
        (SECTORS, False, [(135.0, 180.0)]),
        (SECTORS, True, [(135.0, 225.0)]),
        ([0.0, 90.0, 180.0], False, [(0.0, 360.0)]),
        ([0.0, 180.0], False, [(0.0, 360.0)]),
        ([90.0, 180.0], True, [(90.0, 270.0)]),
        ([45.0, 135.0], True, [(45.0, 135.0), (225.0, 315.0), (135.0, 225.0), (315.0, 405.0)]),
        ([0.0, 90.0, 180.0, 270.0], False, [(0.0, 360.0)]),
        ([180.0], False, [(179.5, 180.5)]),
        ([150.0], True, [(150.0, 210.0)]),
    ],
)
def test_sectors_that_are_not_covered_are_not_workable(
    headings: list[float], symmetric: bool, covered: list[tuple[float, float]], tmp_path: Path
) -> None:
    """Between neighbours up to 90° apart, mirrored if declared; else above the limit, and said."""
    path = tmp_path / "chart.json"
    rows = [{"tp_s": t, "heading_deg": h, "limit_hs_m": 2.0} for t in (6, 12) for h in headings]
    path.write_text(json.dumps({"limits": rows, "symmetric": symmetric}))
    limits = read_limits(path)
    at = np.arange(0.25, 360.0, 1.0)
    inside = np.array([any(a <= own + turn <= b for a, b in covered for turn in (0.0, 360.0))
                       for own in at])  # fmt: skip
    assert limits.covers("operation", at).tolist() == inside.tolist()
    found = limits.at("operation", np.full(len(at), 8.0), at)
    assert found == pytest.approx(np.where(inside, 2.0, np.nan), nan_ok=True)
    hs, month = np.full(len(at), CALM_M), np.ones(len(at), np.int64)
    weather = Hindcast("w", HOUR, hs, np.full(len(at), 8.0), -at, month)
    result = operability(weather, limits, Operation(HOUR, 0.0, bow_deg=0.0))
    assert result.whole.within_limit == pytest.approx(inside.mean())
    assert result.heading_not_covered == pytest.approx(1.0 - inside.mean())
    assert result.not_covered == 0.0


def test_tables_say_that_they_are_symmetric(tmp_path: Path) -> None:
    """A comment of CSV; a mirrored limit is that of the other side."""
    path = tmp_path / "limits.csv"
    rows = "".join(f"{t},{h},{h / 100}\n" for t in (6, 12) for h in (120, 180))
    path.write_text("# symmetric\ntp_s,heading_deg,limit_hs_m\n" + rows)
    at = np.array([120.0, 150.0, 210.0, 240.0, 250.0])
    found = read_limits(path).at("operation", np.full(5, 8.0), at)
    assert found == pytest.approx([1.2, 1.5, 1.5, 1.2, math.nan], nan_ok=True)


@given(
    heights=st.lists(st.sampled_from([0.5, 1.5, 2.5, math.nan]), min_size=12, max_size=60),
    hours=st.integers(1, 6),
    limit=st.sampled_from([1.0, 2.0, 3.0]),
)
@settings(deadline=None)
def test_starts_and_waits_are_those_of_a_plain_search(
    heights: list[float], hours: int, limit: float
) -> None:
    """For each hour: the first hour from it on whose window is below the limit throughout."""
    table = LimitTable("l", {"a": (np.array([1.0, 40.0]), np.zeros(1), np.full((2, 1), limit))})
    found = operability(hindcast(np.array(heights)), table, Operation(hours * HOUR, 0.0))
    starts = [
        k
        for k in range(len(heights) - hours)
        if all(h <= limit for h in heights[k : k + hours + 1])
    ]
    waits = [next((s - k for s in starts if s >= k), math.inf) * HOUR for k in range(len(heights))]
    assert found.whole.possible_starts == pytest.approx(len(starts) / len(heights))
    ordered = sorted(waits)
    for share, own in zip((0.5, 0.9), found.whole.wait.percentiles_s, strict=True):
        assert own == ordered[math.ceil(share * len(waits) - 1e-9) - 1]
    assert found.missing == pytest.approx(np.isnan(heights).mean())
    longer = operability(hindcast(np.array(heights)), table, Operation((hours + 1) * HOUR, 0.0))
    assert longer.whole.possible_starts <= found.whole.possible_starts
    assert longer.whole.wait.percentiles_s >= found.whole.wait.percentiles_s


def test_the_command_prints_a_table_json_and_a_picture(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    hs = np.tile(np.r_[np.full(30, CALM_M), np.full(19, STORM_M)], 100)
    weather = write_hindcast(tmp_path / "h.csv", hs, start=datetime(2001, 6, 1))
    limits = write_limits(tmp_path / "l.csv", LIMIT_M)
    picture = tmp_path / "months.png"
    words = [
        "operability",
        str(limits),
        str(weather),
        "--planned-period",
        "8h",
        "--contingency",
        "4h",
    ]
    (tmp_path / "alpha.csv").write_text(ALPHA)
    assert main([*words, "--alpha", str(tmp_path / "alpha.csv")]) == 0
    shown = capsys.readouterr().out
    assert "T_R               12 h: planned 8 h and contingency 4 h" in shown
    assert "alpha             0.8 to 0.8, example of the test, not a standard" in shown
    assert "calm spells       mean 30 h, P50 30 h, P90 30 h" in shown
    assert main([*words, "--picture", str(picture), "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert found["reference_s"] == 12.0 * HOUR
    assert found["periods"][0]["wait"]["p50_s"] == 7.0 * HOUR
    assert found["alpha_source"] is None
    assert picture.read_bytes().startswith(b"\x89PNG")


def test_a_sea_that_no_height_is_allowed_in_needs_no_alpha(tmp_path: Path) -> None:
    """A plan's chart has 0 there, below the first height of every table of α."""
    (tmp_path / "alpha.csv").write_text(ALPHA)
    alpha = read_alpha(tmp_path / "alpha.csv")
    path = tmp_path / "l.csv"
    path.write_text("tp_s,limit_hs_m\n6,2\n8,0\n10,2\n")
    weather = hindcast(np.full(40, CALM_M))
    for period, share in ((8.0, 0.0), (6.0, 1.0)):
        swell = replace(weather, tp_s=np.full(40, period))
        found = operability(swell, read_limits(path), Operation(4.0 * HOUR, 0.0), alpha)
        assert found.whole.within_forecast == share
    low = replace(weather, hs_m=np.full(40, 0.2), tp_s=np.full(40, 7.8))
    with pytest.raises(InputError, match=r"begins at Hs 1 m, .* within are at most 0\.2 m"):
        operability(low, read_limits(path), Operation(4.0 * HOUR, 0.0), alpha)


def test_low_limits_between_others_have_no_forecast_limit(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Between a limit of 0 and one of 2 m, a limit of 0.2 m ended the command for all weather."""
    (tmp_path / "alpha.csv").write_text(ALPHA)
    (tmp_path / "l.csv").write_text("tp_s,limit_hs_m\n6,2\n8,0\n10,2\n")
    rows = [f"2001-01-{1 + k // 24:02d}T{k % 24:02d}:00,{hs},{tp}\n"
            for k, (hs, tp) in enumerate([(0.2, 7.8)] * 10 + [(1.0, 6.0)] * 30)]  # fmt: skip
    (tmp_path / "h.csv").write_text("time,hs_m,tp_s\n" + "".join(rows))
    words = ["operability", *(str(tmp_path / name) for name in ("l.csv", "h.csv"))]
    words += ["--planned-period", "4h", "--contingency", "0h", "--alpha"]
    assert main([*words, str(tmp_path / "alpha.csv")]) == 0
    shown = capsys.readouterr().out
    assert "25 % of the rows is within a limit below the alpha factors, and counts" in shown
    assert "alpha             0.8 to 0.8" in shown
    assert main([*words, str(tmp_path / "alpha.csv"), "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert found["without_alpha_share"] == 0.25
    whole = found["periods"][0]
    assert (whole["within_limit"], whole["within_forecast"]) == (1.0, 0.75)


def test_short_periods_are_not_rounded_to_hours(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Half-hourly records of a buoy."""
    rows = [f"2001-01-01T{k // 2:02d}:{30 * (k % 2):02d},1.0,8.0,90\n" for k in range(40)]
    (tmp_path / "h.csv").write_text("".join([HEAD, *rows]))
    words = [str(write_limits(tmp_path / "l.csv", LIMIT_M)), str(tmp_path / "h.csv")]
    times = ["--planned-period", "90min", "--contingency", "45min"]
    assert main(["operability", *words, *times]) == 0
    shown = capsys.readouterr().out
    assert "T_R               2.25 h: planned 1.5 h and contingency 0.75 h" in shown
    assert "years, every 0.5 h" in shown
    assert shown.splitlines()[-1].split()[-2] == "2.25"


def test_time_without_a_row_counts_as_above_the_limit(tmp_path: Path) -> None:
    """In every share: of twelve hours nine have a row, of which six are calm."""
    heights = np.array([CALM_M] * 6 + [math.nan] * 3 + [STORM_M] * 3)
    limits = read_limits(write_limits(tmp_path / "l.csv", LIMIT_M))
    found = operability(hindcast(heights), limits, Operation(HOUR, 0.0))
    assert (found.missing, found.whole.samples) == (0.25, 9)
    assert found.whole.within_limit == found.whole.within_forecast == 0.5
    assert list(found.phases.values()) == [0.5]
    assert found.whole.possible_starts == pytest.approx(5 / 12)


HEAD = "time,hs_m,tp_s,direction_from_deg\n"
ROWS = [f"2001-01-01T{hour:02d}:00,1.0,8.0,90\n" for hour in range(20)]
WRONG_WEATHER = {
    "no height": (HEAD.replace("hs_m", "height") + ROWS[0], "there is no hs_m; needed are time"),
    "no time": (HEAD.replace("time", "t") + ROWS[0], "there is no time"),
    "unclear direction": (HEAD.replace("direction_from_deg", "dir") + ROWS[0],
                          "the column dir does not say which direction it is"),
    "two directions": (HEAD.strip() + ",direction_to_deg\n" + ROWS[0].strip() + ",9\n",
                       "both direction_from_deg and direction_to_deg"),
    "not a time": (HEAD + "yesterday,1,8,90\n", "line 2: 'yesterday' is not a time"),
    "back in time": (HEAD + ROWS[1] + ROWS[0], "line 3: its time is not after the one above"),
    "same time": (HEAD + ROWS[1] + ROWS[1], "its time is not after the one above"),
    "uneven": (HEAD + "".join(ROWS) + "2001-01-02T00:20,1,8,90\n", "is not at a step of 60 min"),
    "long steps": (HEAD + "2001-01-01,1,8,90\n2001-01-02,1,8,90\n", "steps of 24 h; give at most"),
    "not finite": (HEAD + ROWS[0].replace("1.0", "nan"), "hs_m is 'nan'; give 0 to 30"),
    "negative": (HEAD + ROWS[0].replace("1.0", "-1.0"), "hs_m is '-1.0'"),
    "a period in words": (HEAD + ROWS[0].replace("8.0", "long"), "tp_s is 'long'"),
    "direction of 999": (HEAD + ROWS[0].replace(",90", ",999"), "direction_from_deg is '999'"),
    "few cells": (HEAD + "2001-01-01,1\n", "2 values; the header has 4"),
    "one row": (HEAD + ROWS[0], "it has fewer than two rows"),
    "empty": ("# nothing\n", "it is empty"),
    "shorter than T_R": (HEAD + "".join(ROWS[:5]), "it is shorter than T_R = 16 h"),
}  # fmt: skip
WRONG_LIMITS = {
    "no limit": ("tp_s,limit\n8,2\n9,2\n", "there is no limit_hs_m"),
    "one period": ("tp_s,limit_hs_m\n8,2\n", "phase 'operation': limits at one Tp, 8 s, hold"),
    "double": ("tp_s,limit_hs_m\n8,2\n8,3\n", "Tp 8 s is double"),
    "a hole": ("tp_s,heading_deg,limit_hs_m\n8,0,2\n8,180,2\n9,0,2\n", "Tp 9 s at heading 180° is"),
    "both sides of one": ("# symmetric\ntp_s,heading_deg,limit_hs_m\n"
                          "8,90,2\n8,-90,2\n9,90,2\n9,-90,2\n",
                          "it is symmetric and has headings of both sides; give those of one"),
    "not finite": ("tp_s,limit_hs_m\n8,inf\n9,2\n", "limit_hs_m is 'inf'; give 0 to 30"),
    "no rows": ("tp_s,limit_hs_m\n", "it has no limits"),
}  # fmt: skip
WRONG_ALPHA = {
    "no source": ("hs_m,planned_h,alpha\n1,12,0.8\n", "it names no source; add a line `# source:"),
    "no period": ("# source: x\nhs_m,hours,alpha\n1,12,0.8\n", "not one column of periods"),
    "above 1": ("# source: x\nhs_m,planned_h,alpha\n1,12,1.2\n", "alpha is '1.2'; give 0 to 1"),
    "a hole": ("# source: x\nhs_m,planned_h,alpha\n1,12,0.8\n2,24,0.8\n", "2 rows of 2 heights"),
    "double": ("# source: x\nhs_m,planned_h,alpha\n1,12,0.8\n1,12,0.8\n", "period are double"),
    "too short": ("# source: x\nhs_m,planned_h,alpha\n1,6,0.8\n", "it ends at 6 h; give alpha"),
    "too high": ("# source: x\nhs_m,planned_h,alpha\n3,24,0.8\n", "it begins at Hs 3 m"),
}  # fmt: skip


@pytest.mark.parametrize(
    ("name", "text", "words"),
    [(name, *own) for name, kind in (("h.csv", WRONG_WEATHER), ("l.csv", WRONG_LIMITS),
                                     ("a.csv", WRONG_ALPHA)) for own in kind.values()]
    + [("l.json", "{", "it is not JSON"), ("l.json", '{"limits": 3}', "there is no list `limits`")],
)  # fmt: skip
def test_a_wrong_file_is_refused_in_one_sentence(
    tmp_path: Path, name: str, text: str, words: str, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "h.csv").write_text(HEAD + "".join(ROWS))
    write_limits(tmp_path / "l.csv", 2.0)
    (tmp_path / "a.csv").write_text(ALPHA)
    (tmp_path / name).write_text(text)
    limits = tmp_path / ("l.json" if name == "l.json" else "l.csv")
    options = ["--planned-period", "8h", "--alpha", str(tmp_path / "a.csv")]
    code = main(["operability", str(limits), str(tmp_path / "h.csv"), *options])
    said = capsys.readouterr().err
    assert code == 1
    assert words in said
    assert str(tmp_path / name) in said
    assert said.count("\n") == 1


@pytest.mark.parametrize(
    ("weather", "period", "words"),
    [
        (
            "none.csv",
            "8h",
            "none.csv: it cannot be read (No such file or directory); give the path",
        ),
        ("h.csv", "8", "planned period: it is 8 s; give it with its unit, like 6h."),
    ],
)
def test_an_absent_file_and_a_period_without_unit_are_refused(
    weather: str, period: str, words: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "h.csv").write_text(HEAD + "".join(ROWS))
    limits = write_limits(tmp_path / "l.csv", 2.0)
    command = ["operability", str(limits), str(tmp_path / weather), "--planned-period", period]
    assert main(command) == 1
    assert words in capsys.readouterr().err


@pytest.mark.parametrize(
    ("operation", "weather", "words"),
    [
        (Operation(HOUR, 0.0), hindcast(np.ones(9)), "the limits depend on the heading"),
        (Operation(HOUR, 0.0, bow_deg=0.0), hindcast(np.ones(9)), "it has no direction of the"),
    ],
)
def test_a_heading_is_never_guessed(operation: Operation, weather: Hindcast, words: str) -> None:
    with pytest.raises(InputError, match=words):
        operability(weather, HEADINGS, operation)


@pytest.mark.parametrize("angle", [900.0, -361.0, math.inf])
def test_a_heading_of_more_than_a_turn_is_refused(angle: float) -> None:
    for heading in ({"bow_deg": angle}, {"relative_deg": angle}):
        with pytest.raises(InputError, match=f"it is {angle:g}°; give degrees within ±360"):
            Operation(HOUR, 0.0, **heading)
    assert Operation(HOUR, 0.0, bow_deg=-360.0).bow_deg == -360.0


@pytest.mark.parametrize(
    "wrong",
    [(0.0, 0.0), (math.nan, 0.0), (HOUR, -1.0), (HOUR, math.inf), (HOUR, 0.0, 1.0, 2.0),
     (HOUR, 0.0, math.nan)],
)  # fmt: skip
def test_an_operation_of_no_time_is_refused(wrong: tuple[float, ...]) -> None:
    with pytest.raises(InputError):
        Operation(*wrong)

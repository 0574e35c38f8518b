"""Files of operability: limiting sea states, hindcasts, alpha factors.

CSV with a header; lines that begin with # are comments. The names of columns say what is meant, so
that no convention is assumed:

* limits: `phase` (may be left out), `tp_s`, `heading_deg` (may be left out: any heading; 0 for
  following seas, 180 for head seas, 90 for waves that travel to port), `limit_hs_m`, and a comment
  `# symmetric` if limits of one side hold for the other; or JSON, an object whose `limits` is a
  list of objects with these keys, and whose `symmetric` is true or left out;
* hindcast: `time` (ISO 8601, UTC), `hs_m`, `tp_s`, and `direction_from_deg` (that the waves come
  from) or `direction_to_deg` (that they travel to), clockwise from north;
* alpha factors: `hs_m`, `planned_h` (T_POP) or `reference_h` (T_R), `alpha`, and a comment
  `# source: ...` with the standard or forecast service that they are from.

Spectra of ERA5, WAVEWATCH III, NDBC, Spotter and others are read with wavespectra, if it is there.
"""

from __future__ import annotations

import csv
import importlib.util
import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rope_twin.errors import InputError, did_you_mean, unreadable
from rope_twin.sea.tables import Vector

LARGEST_HS_M, LARGEST_TP_S = 30.0, 40.0
ONE_PHASE = "operation"  # name of the phase of a table without phases
SECONDS_PER_HOUR = 3600.0
LONGEST_STEP_S = 6.0 * SECONDS_PER_HOUR  # between samples: weather windows are hours
LARGEST_FILE_BYTES = 200_000_000
SAME_DEG = 1e-6
WIDEST_DEG = 90.0  # between neighbouring headings with limits in between
ALONE_DEG = 0.5  # to either side that a single heading holds for
ANY_HEADING = -1.0  # key of a table without headings


@dataclass(frozen=True)
class LimitTable:
    """Limiting Hs [m] of each phase over Tp and heading: (tp, headings) arrays on own axes.

    One heading holds for any. Of more, a table from 0 to 180 holds for both sides and all
    headings; another covers the sectors between neighbours that are not further apart than
    WIDEST_DEG, and what lies outside has no limit.
    """

    source: str
    tables: Mapping[str, tuple[Vector, Vector, Vector]]  # tp_s, heading_deg, limit_hs_m

    @property
    def phases(self) -> tuple[str, ...]:
        """Return the names of the phases."""
        return tuple(self.tables)

    @property
    def has_headings(self) -> bool:
        """Return whether a limit depends on the heading."""
        return any(len(headings) > 1 for _, headings, _ in self.tables.values())

    def only(self, phases: Sequence[str]) -> LimitTable:
        """Return the table of these phases alone. Raises InputError: there is none of a name."""
        for name in phases:
            if name not in self.tables:
                remedy = did_you_mean(name, self.tables)
                raise InputError(self.source, f"there is no phase '{name}'", remedy)
        return LimitTable(self.source, {name: self.tables[name] for name in phases})

    def at(self, phase: str, tp_s: Vector, heading_deg: Vector) -> Vector:
        """Return limits (n,) at peak periods and headings (n,), bilinear; nan where the table does
        not cover one of them.
        """
        periods, headings, limits = self.tables[phase]
        over_tp = [np.interp(tp_s, periods, limits[:, k]) for k in range(len(headings))]
        limit = over_tp[0]
        if len(headings) > 1:
            i, share = _between(headings, heading_deg)
            stacked, rows = np.stack(over_tp), np.arange(len(tp_s))
            low, high = stacked[i, rows], stacked[(i + 1) % len(headings), rows]
            limit = (1.0 - share) * low + share * high
        inside = (tp_s >= periods[0]) & (tp_s <= periods[-1])
        return np.where(inside & self.covers(phase, heading_deg), limit, np.nan)

    def covers(self, phase: str, heading_deg: Vector) -> NDArray[np.bool_]:
        """Return whether the table has limits at headings, (n,)."""
        headings = self.tables[phase][1]
        if len(headings) == 1 or _is_one_side(headings):
            return np.ones(len(heading_deg), bool)
        i, share = _between(headings, heading_deg)
        gaps = np.diff(np.append(headings, headings[0] + 360.0))
        at_one = np.minimum(share, 1.0 - share) * gaps[i] <= SAME_DEG
        return np.asarray((gaps[i] <= WIDEST_DEG + SAME_DEG) | at_one)


def _between(headings: Vector, at_deg: Vector) -> tuple[NDArray[np.int64], Vector]:
    """Return the heading below each angle and the share of the way to the next one."""
    turn = at_deg % 360.0
    if _is_one_side(headings):
        turn = np.where(turn > 180.0, 360.0 - turn, turn)
        i = np.clip(np.searchsorted(headings, turn, side="right") - 1, 0, len(headings) - 2)
        return i, np.clip((turn - headings[i]) / (headings[i + 1] - headings[i]), 0.0, 1.0)
    around = np.append(headings, headings[0] + 360.0)
    turn = np.where(turn < headings[0], turn + 360.0, turn)
    i = np.clip(np.searchsorted(around, turn, side="right") - 1, 0, len(headings) - 1)
    return i, (turn - around[i]) / (around[i + 1] - around[i])


def _is_one_side(headings: Vector) -> bool:
    """Return whether headings go from 0 to 180, so that they hold for both sides."""
    return bool(headings[0] <= SAME_DEG and abs(headings[-1] - 180.0) <= SAME_DEG)


@dataclass(frozen=True)
class Hindcast:
    """Sea states at equal steps of time; nan where a row is missing."""

    source: str
    step_s: float
    hs_m: Vector
    tp_s: Vector
    towards_deg: Vector | None  # direction of propagation, clockwise from north
    month: NDArray[np.int64]  # 1 to 12 of each sample


@dataclass(frozen=True)
class AlphaTable:
    """Alpha factors over limit and period, of a stated source."""

    where: str
    source: str
    by_reference: bool  # whether its periods are T_R; else T_POP
    hs_m: Vector
    period_s: Vector
    alpha: Vector  # (hs, periods)

    def at(self, limit_hs_m: Vector, planned_s: float, reference_s: float) -> Vector:
        """Return α at limits (n,), bilinear; nan below the lowest Hs of the table.

        The factor of the largest Hs and of the shortest period holds beyond them, as α rises with
        Hs and falls with the period.

        Raises:
            InputError: all limits are below the table, or the period above it.
        """
        period = reference_s if self.by_reference else planned_s
        if period > self.period_s[-1]:
            problem = f"it ends at {self.period_s[-1] / SECONDS_PER_HOUR:g} h"
            remedy = f"give alpha factors up to {period / SECONDS_PER_HOUR:g} h"
            raise InputError(self.where, problem, remedy)
        if len(limit_hs_m) and limit_hs_m.max() < self.hs_m[0]:
            problem = f"it begins at Hs {self.hs_m[0]:g} m, and the limits that the weather is "
            problem += f"within are at most {float(limit_hs_m.max()):.3g} m"
            raise InputError(self.where, problem, "give alpha factors for that height")
        alpha_of_period = [np.interp(period, self.period_s, row) for row in self.alpha]
        return np.asarray(np.interp(limit_hs_m, self.hs_m, alpha_of_period, left=np.nan))


def read_limits(path: Path) -> LimitTable:
    """Read limiting sea states from CSV or JSON.

    Raises:
        InputError: the file is invalid; one sentence.
    """
    where = str(path)
    if path.suffix.lower() == ".json":
        rows, mirrored = _json_rows(path)
    else:
        rows, mirrored = _csv_rows(path), "symmetric" in _comments(path)
    limits: dict[str, dict[tuple[float, float], float]] = {}
    for place, row in rows:
        _need(place, row, ("tp_s", "limit_hs_m"))
        name = str(row.get("phase") or ONE_PHASE).strip()
        heading = ANY_HEADING
        if "heading_deg" in row:
            heading = _ranged(place, row, "heading_deg", -360.0, 360.0) % 360.0
        key = (_ranged(place, row, "tp_s", 1.0, LARGEST_TP_S), heading)
        table = limits.setdefault(name, {})
        if key in table:
            problem = f"{_pair_words(*key)} is double in phase '{name}'"
            raise InputError(place, problem, "give each once")
        table[key] = _ranged(place, row, "limit_hs_m", 0.0, LARGEST_HS_M)
    if not limits:
        raise InputError(where, "it has no limits", "give rows of tp_s and limit_hs_m")
    tables = {name: _grid(where, name, table, mirrored) for name, table in limits.items()}
    return LimitTable(where, tables)


def _pair_words(period: float, heading: float) -> str:
    return f"Tp {period:g} s" + ("" if heading == ANY_HEADING else f" at heading {heading:g}°")


def _grid(
    where: str, name: str, table: Mapping[tuple[float, float], float], mirrored: bool
) -> tuple[Vector, Vector, Vector]:
    """Return axes and values of a full grid; mirrored: those of one side hold for the other.

    Raises:
        InputError: a pair is missing, or a heading and its mirror image are both given.
    """
    place = f"{where}, phase '{name}'"
    periods = sorted({period for period, _ in table})
    headings = sorted({heading for _, heading in table})
    if len(periods) < 2:
        problem = f"limits at one Tp, {periods[0]:g} s, hold for no other"
        remedy = "give two or more that enclose those of the hindcast, in a plan by sea.tp_s"
        raise InputError(place, problem, remedy)
    for period in periods:
        for heading in headings:
            if (period, heading) not in table:
                problem = f"{_pair_words(period, heading)} is missing"
                raise InputError(place, problem, "give a full grid")
    values = np.array([[table[period, heading] for heading in headings] for period in periods])
    axis = np.array(headings)
    if headings == [ANY_HEADING]:
        return np.array(periods), np.zeros(1), values
    if mirrored and not _is_one_side(axis):
        other = [k for k, heading_deg in enumerate(headings) if heading_deg % 180.0 > 0.0]
        image = (360.0 - axis[other]) % 360.0
        if set(image.tolist()) & set(headings):
            problem = "it is symmetric and has headings of both sides"
            raise InputError(place, problem, "give those of one side")
        axis, values = np.append(axis, image), np.hstack([values, values[:, other]])
        order = np.argsort(axis)
        axis, values = axis[order], values[:, order]
    if len(axis) == 1:  # holds for itself alone
        axis = axis[0] + np.array([-ALONE_DEG, ALONE_DEG])
        values = np.hstack([values, values])
    return np.array(periods), axis, values


def read_hindcast(path: Path) -> Hindcast:
    """Read a hindcast from CSV; rows may be missing, and their times are then not known.

    Raises:
        InputError: the file is invalid; one sentence.
    """
    where, times, numbers = str(path), list[datetime](), list[tuple[float, float, float]]()
    column, turn = "", 0.0
    for place, row in _csv_rows(path):
        if not column:
            column, turn = _direction_column(place, row)
        times.append(_time(place, row["time"]))
        hs, tp = (
            _ranged(place, row, "hs_m", 0.0, LARGEST_HS_M),
            _ranged(place, row, "tp_s", 0.0, 60.0),
        )
        towards = _ranged(place, row, column, -360.0, 360.0) + turn if column != "none" else 0.0
        if len(times) > 1 and times[-1] <= times[-2]:
            raise InputError(place, "its time is not after the one above", "order the rows")
        numbers.append((hs, tp, towards))
    if len(times) < 2:
        raise InputError(where, "it has fewer than two rows", "give a time series")
    columns = np.array(numbers).T
    return _series(where, times, columns[0], columns[1], columns[2] if column != "none" else None)


def _series(
    where: str, times: Sequence[datetime], hs_m: Vector, tp_s: Vector, towards_deg: Vector | None
) -> Hindcast:
    """Return rows (n,) at ascending times on equal steps. Raises InputError: they are not equal."""
    seconds = np.array([(time - times[0]).total_seconds() for time in times])
    steps, counts = np.unique(np.diff(seconds), return_counts=True)
    step = float(steps[np.argmax(counts)])  # the smallest of the most frequent ones
    index = np.rint(seconds / step).astype(np.int64)
    is_off = np.abs(seconds - index * step) > 0.01 * step
    if is_off.any():
        first_off = f"{times[int(np.argmax(is_off))]:%Y-%m-%d %H:%M}"
        problem = f"{first_off} is not at a step of {step / 60.0:g} min"
        raise InputError(where, problem, "give equal steps; rows may be missing")
    if step > LONGEST_STEP_S:
        problem = f"steps of {step / SECONDS_PER_HOUR:g} h"
        raise InputError(where, problem, f"give at most {LONGEST_STEP_S / SECONDS_PER_HOUR:g} h")

    def filled(values: Vector) -> Vector:
        series = np.full(index[-1] + 1, np.nan)
        series[index] = values
        return series

    start = np.datetime64(times[0].replace(tzinfo=None), "s")
    stamps = start + np.rint(np.arange(index[-1] + 1) * step).astype("timedelta64[s]")
    month = stamps.astype("datetime64[M]").astype(np.int64) % 12 + 1
    towards = None if towards_deg is None else filled(towards_deg)
    return Hindcast(where, step, filled(hs_m), filled(tp_s), towards, month)


def read_spectra(path: Path, reader: str) -> Hindcast:
    """Read wave spectra with a reader of wavespectra (era5, ww3, ndbc, spotter, ...).

    Hs and Tp are its `hs` and `tp`, the direction its mean direction at the peak (`dpm`), which the
    waves come from. Spectra without a finite value are missing rows.

    Raises:
        InputError: wavespectra is not installed or has no such reader, or the file is not one of
            that format, or of several places; one sentence.
    """
    where = str(path)
    if importlib.util.find_spec("wavespectra") is None:
        problem = "reading spectra needs wavespectra, and it is not there"
        raise InputError(where, problem, "install it with `pip install wavespectra`")
    import wavespectra  # optional, and slow to import

    known = [name.removeprefix("read_") for name in dir(wavespectra) if name.startswith("read_")]
    if reader not in known:
        problem = f"wavespectra has no reader '{reader}'"
        raise InputError("--reader", problem, did_you_mean(reader, known))
    try:
        spectra = getattr(wavespectra, f"read_{reader}")(where)
        parameters = [getattr(spectra.spec, name)().squeeze() for name in ("hs", "tp", "dpm")]
        stamps = parameters[0].time.values.astype("datetime64[s]")
        rows = [np.asarray(parameter.values, np.float64) for parameter in parameters]
    except Exception as error:  # a reader fails in any way on a file of another format
        reason = " ".join(str(error).split())[:120] or type(error).__name__
        remedy = f"give a file of the format {reader}"
        raise InputError(where, f"it cannot be read ({reason})", remedy) from None
    if any(row.shape != stamps.shape or row.ndim != 1 for row in rows):
        problem = f"its spectra are an array of {' x '.join(map(str, rows[0].shape))}"
        raise InputError(where, problem, "give a time series at one place")
    is_finite = np.isfinite(rows).all(axis=0)
    if is_finite.sum() < 2:
        raise InputError(where, "it has fewer than two spectra", "give a time series")
    order = np.argsort(stamps[is_finite])
    stamps, (hs, tp, come_from) = stamps[is_finite][order], (row[is_finite][order] for row in rows)
    if (np.diff(stamps) <= np.timedelta64(0, "s")).any():
        raise InputError(where, "a time is double", "give each once")
    times = [stamp.astype(datetime).replace(tzinfo=UTC) for stamp in stamps]
    return _series(where, times, hs, tp, (come_from + 180.0) % 360.0)


def _direction_column(place: str, row: Mapping[str, Any]) -> tuple[str, float]:
    """Return the column of the direction, "none" without, and what turns it into that towards."""
    _need(place, row, ("time", "hs_m", "tp_s"))
    columns = [name for name in ("direction_from_deg", "direction_to_deg") if name in row]
    if len(columns) == 2:
        raise InputError(place, "both direction_from_deg and direction_to_deg", "keep one of them")
    if not columns:
        if other := [name for name in row if "dir" in name]:
            problem = f"the column {other[0]} does not say which direction it is"
            raise InputError(place, problem, "name it direction_from_deg or direction_to_deg")
        return "none", 0.0
    return columns[0], 180.0 if columns[0] == "direction_from_deg" else 0.0


def _time(place: str, text: str) -> datetime:
    try:
        time = datetime.fromisoformat(text.strip())
    except ValueError:
        remedy = "give ISO 8601, like 2015-01-31T06:00"
        raise InputError(place, f"'{text}' is not a time", remedy) from None
    return time.replace(tzinfo=UTC) if time.tzinfo is None else time.astimezone(UTC)


def read_alpha(path: Path) -> AlphaTable:
    """Read alpha factors and their source.

    Raises:
        InputError: the file is invalid or names no source; one sentence.
    """
    where, alpha_of = str(path), dict[tuple[float, float], float]()
    comments = _comments(path)
    source = next(
        (comment[7:].strip() for comment in comments if comment.lower().startswith("source:")), ""
    )
    if not source:
        remedy = "add a line `# source: ...` with the standard or forecast service"
        raise InputError(where, "it names no source", remedy)
    column = ""
    for place, row in _csv_rows(path):
        columns = [name for name in ("planned_h", "reference_h") if name in row]
        if len(columns) != 1:
            problem = "there is not one column of periods"
            raise InputError(place, problem, "name it planned_h (T_POP) or reference_h (T_R)")
        column = columns[0]
        _need(place, row, ("hs_m", "alpha"))
        key = (
            _ranged(place, row, "hs_m", 0.0, LARGEST_HS_M),
            _ranged(place, row, column, 0.0, 1e4),
        )
        if key in alpha_of:
            raise InputError(place, "its height and period are double", "give each once")
        alpha_of[key] = _ranged(place, row, "alpha", 0.0, 1.0)
    heights, periods = (sorted({key[k] for key in alpha_of}) for k in (0, 1))
    if not alpha_of or len(alpha_of) != len(heights) * len(periods):
        problem = f"{len(alpha_of)} rows of {len(heights)} heights and {len(periods)} periods"
        raise InputError(where, problem, "give a full grid")
    alpha = np.array([[alpha_of[height, period] for period in periods] for height in heights])
    hours = np.array(periods)
    return AlphaTable(where, source, column == "reference_h", np.array(heights),
                      SECONDS_PER_HOUR * hours, alpha)  # fmt: skip


def _text(path: Path) -> list[str]:
    try:
        if path.stat().st_size > LARGEST_FILE_BYTES:
            raise InputError(str(path), "it is larger than 200 MB", "give a smaller table")
        return path.read_text(encoding="utf-8-sig").splitlines()
    except (OSError, UnicodeDecodeError) as error:
        raise unreadable(path, error) from None


def _comments(path: Path) -> list[str]:
    """Return the comments of a file, without their #."""
    return [line.strip("# \n") for line in _text(path) if line.lstrip().startswith("#")]


def _csv_rows(path: Path) -> list[tuple[str, dict[str, str]]]:
    """Return place and cells by name of each row. Raises InputError."""
    lines = [(k, line) for k, line in enumerate(_text(path), 1)
            if line.strip() and not line.lstrip().startswith("#")]  # fmt: skip
    if not lines:
        raise InputError(str(path), "it is empty", "give a header and rows")
    head = [name.strip() for name in next(csv.reader([lines[0][1]]))]
    rows = list[tuple[str, dict[str, str]]]()
    read = csv.reader(line for _, line in lines[1:])
    for (number, _), cells in zip(lines[1:], read, strict=True):
        where = f"{path}, line {number}"
        if len(cells) != len(head):
            raise InputError(where, f"{len(cells)} values", f"the header has {len(head)}")
        rows.append((where, dict(zip(head, cells, strict=True))))
    return rows


def _json_rows(path: Path) -> tuple[list[tuple[str, dict[str, Any]]], bool]:
    """Return place and values of each limit, and whether it is symmetric. Raises InputError."""
    remedy = "give an object whose `limits` is a list of objects"
    try:
        content = json.loads("\n".join(_text(path)))
    except ValueError as error:
        raise InputError(str(path), f"it is not JSON ({error})", remedy) from None
    listed = content.get("limits") if isinstance(content, dict) else None
    if not isinstance(listed, list) or not all(isinstance(entry, dict) for entry in listed):
        raise InputError(str(path), "there is no list `limits`", remedy)
    rows = [(f"{path}, limits[{number}]", entry) for number, entry in enumerate(listed)]
    return rows, content.get("symmetric") is True


def _need(place: str, row: Mapping[str, Any], names: Sequence[str]) -> None:
    for name in names:
        if name not in row:
            raise InputError(place, f"there is no {name}", f"needed are {', '.join(names)}")


def _ranged(place: str, row: Mapping[str, Any], name: str, low: float, high: float) -> float:
    """Return a finite number within a range. Raises InputError."""
    cell = row[name]
    try:
        value = math.nan if isinstance(cell, bool) or cell is None else float(cell)
    except (TypeError, ValueError):
        value = math.nan
    if not (math.isfinite(value) and low <= value <= high):
        raise InputError(place, f"{name} is {cell!r}", f"give {low:g} to {high:g}")
    return value

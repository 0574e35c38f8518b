"""Measured series of a lift (tension, heave, line out), conditioned for the estimator.

Load pin: samples far from the median of their nine neighbours are dropped, if these are near in
time, then means over 0.25 s are taken, missing where too few samples are left. Line out: a cubic
fitted over 15 samples (Savitzky and Golay 1964) gives its value and rate. Heave: the cubic through
positions and velocities. Nothing is invented in a hole of heave or line out: means within it, and
until the rope has forgotten it, are missing.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicHermiteSpline, CubicSpline
from scipy.signal import savgol_coeffs
from scipy.sparse import csr_array

from rope_twin.core.state import Floats

Bools = NDArray[np.bool_]
MEAN_S = 0.25  # interval of the means that are compared
NEIGHBOURS = 9  # samples of the median
SPIKE_SDS = 5.0  # of the pin's noise, from that median
NEAR_S = 1.25  # that they span at most: at 6.4 Hz and more
STOP_SHARE = 0.03  # of the values at the extreme: the sensor may be at the end of its range ...
STOP_RATIO = 4.0  # ... with so many times those next to it; the counts of a sine have 2.4 times ...
STOP_GAP = 0.2  # ... so near, in standard deviations: coarser counts say nothing of it
MIN_GOOD = 0.6  # share of a mean's samples that must be good
SMOOTHED_SAMPLES, SMOOTHED_ORDER = 15, 5
# of an axial period of 1.3 s a cubic would leave 97 %, a quintic leaves 99.9 %
_SMOOTHING = savgol_coeffs(SMOOTHED_SAMPLES, SMOOTHED_ORDER)
SMOOTHING_LEAVES = float(_SMOOTHING @ _SMOOTHING)  # of the variance of independent errors
SAME_COUNT_M = 1e-6  # counts that differ by less are equal
EDGE_S = 0.25  # of standing counts beside a change, which say less than the change
LINE_HZ = 20.0  # grid of the line out
STRAIGHT_SAMPLES = 41  # of a steady line, on that grid
MAX_STRAIGHT, STRAIGHT_RMS = 0.75, 0.4  # resolutions; rounding explains 1/2 and 1/√12
HEAVE_HOLE_S, LINE_HOLE_S = 1.0, 2.0  # longer gaps are holes
LATE_S = 5.0  # of the tension, behind heave and line out
FORGETTING_S = 30.0  # after a hole of heave or line out


class Series:
    """Samples of one or two quantities by time, which may come late and out of order."""

    def __init__(self, columns: int) -> None:
        """Begin without samples of so many quantities."""
        self._rows: list[tuple[float, ...]] = []
        self._table: Floats = np.empty((0, columns + 1))

    def add(self, time_s: float, *values: float) -> None:
        """Add a sample; one that is not finite is missing data and is left out."""
        if np.isfinite((time_s, *values)).all():
            self._rows.append((time_s, *values))

    def extend(self, time_s: Floats, *values: Floats) -> None:
        """Add samples, (k,) each; those that are not finite are left out."""
        table = np.column_stack([time_s, *values])
        self._merge(table[np.isfinite(table).all(axis=1)])

    def less(self, *offsets: float) -> Series:
        """Return the series without these offsets of time and values."""
        shifted = Series(len(offsets) - 1)
        shifted.extend(*(self.table - offsets).T)
        return shifted

    def drop_before(self, time_s: float) -> None:
        """Forget samples before a time."""
        self._table = self.table[self.table[:, 0] >= time_s]

    def keep(self, which: Bools) -> None:
        """Forget all samples but these, (samples,) in the order of time."""
        self._table = self.table[which]

    @property
    def table(self) -> Floats:
        """Return times and values, (samples, 1 + columns), sorted, each time once."""
        if self._rows:
            rows, self._rows = np.array(self._rows), []
            self._merge(rows)
        return self._table

    @property
    def newest_s(self) -> float:
        """Return the time of the newest sample; -inf: there is none."""
        table = self.table
        return float(table[-1, 0]) if len(table) else -np.inf

    def _merge(self, rows: Floats) -> None:
        rows_by_time = np.vstack([self._table, rows])
        _, first = np.unique(rows_by_time[:, 0], return_index=True)
        self._table = rows_by_time[first]


def without_spikes(time_s: Floats, values: Floats, limit: float) -> Floats:
    """Return values (k,) with NaN where one lies further than `limit` from its neighbours' median.

    The median is of NEIGHBOURS values around it, itself among them. Where these span more than
    NEAR_S the waves set them apart: nothing is a spike there, and the estimator's gate decides.
    """
    half = NEIGHBOURS // 2
    if len(values) < NEIGHBOURS:
        return values.copy()
    padded = np.pad(values, half, mode="edge")
    median = np.median(np.lib.stride_tricks.sliding_window_view(padded, NEIGHBOURS), axis=1)
    times = np.pad(time_s, half, mode="reflect", reflect_type="odd")
    is_near = times[2 * half :] - times[: -2 * half] <= NEAR_S
    return np.where(is_near & (np.abs(values - median) > limit), np.nan, values)


def _intervals(time_s: Floats, begin_s: float) -> NDArray[np.int64]:
    """Return the number k of the interval (k, k + 1]·MEAN_S from begin that times lie in."""
    return np.ceil((time_s - begin_s) / MEAN_S - 1e-6).astype(np.int64) - 1


def at_stops(values: Floats) -> Bools:
    """Return which values (k,) are at an end of the sensor's range, (k,).

    A sensor that saturates repeats its extreme to the last digit, far more often than the value
    next to it.
    """
    levels, counts = np.unique(values[np.isfinite(values)], return_counts=True)
    stopped = np.zeros(len(values), dtype=np.bool_)
    for end, next_to in ((0, 1), (-1, -2)) if len(levels) > 2 else ():
        is_near = abs(levels[end] - levels[next_to]) < STOP_GAP * np.nanstd(values)
        is_often = counts[end] > max(STOP_SHARE * counts.sum(), STOP_RATIO * counts[next_to])
        if is_near and is_often:
            stopped |= values == levels[end]
    return stopped


def interval_means(
    time_s: Floats, values: Floats, begin_s: float, count: int
) -> tuple[Floats, Floats]:
    """Return the means over intervals (k, k + 1]·MEAN_S from begin, (count,), NaN: missing.

    Second result: number of samples in each mean, (count,). Data are missing where fewer than
    MIN_GOOD of the samples that the median interval has are finite.
    """
    bins = _intervals(time_s, begin_s)
    inside = (bins >= 0) & (bins < count)
    good = inside & np.isfinite(values)
    number = np.bincount(bins[good], minlength=count).astype(float)
    total = np.bincount(bins[good], weights=values[good], minlength=count)
    spacing = float(np.median(np.diff(time_s))) if len(time_s) > 1 else MEAN_S
    enough = max(1.0, MIN_GOOD * MEAN_S / spacing - 1e-6)
    return np.where(number >= enough, total / np.maximum(number, 1.0), np.nan), number


def _resolution(counts: Floats) -> float:
    """Return the smallest change of counts; 0: they do not change."""
    steps = np.abs(np.diff(counts))
    steps = steps[steps > SAME_COUNT_M]
    return float(steps.min()) if len(steps) else 0.0


def without_stairs(time_s: Floats, counts: Floats) -> tuple[Floats, Floats]:
    """Return times and positions of a line from a counter of coarse resolution, (k,) each.

    Where a count that repeats changes, the line passes the middle between both counts; the counts
    less than EDGE_S from the change are left out. So a slow line has no stairs, whose smoothing
    would let it run back a little: enough to reverse the friction of a sheave. Counts that never
    repeat, and a line that stands, are kept.
    """
    changes = np.flatnonzero(np.diff(counts))  # between k and k + 1
    if not len(changes):
        return time_s, counts
    first = np.concatenate([[0], changes + 1])
    last = np.concatenate([changes, [len(counts) - 1]])
    length = last - first + 1
    begins, ends = time_s[first].copy(), time_s[last].copy()
    begins[0], ends[-1] = -np.inf, np.inf  # no change is known there
    from_change = np.minimum(time_s - np.repeat(begins, length), np.repeat(ends, length) - time_s)
    edges = (np.repeat(length, length) == 1) | (from_change >= EDGE_S)
    passed = changes[(length[:-1] > 1) | (length[1:] > 1)]
    middles = (0.5 * (values[passed] + values[passed + 1]) for values in (time_s, counts))
    times, positions = (
        np.concatenate(pair) for pair in zip((time_s[edges], counts[edges]), middles, strict=True)
    )
    order = np.argsort(times)
    return times[order], positions[order]


def straightened(positions: Floats, resolution_m: float) -> tuple[Floats, Bools]:
    """Return positions on an even grid, (k,), with the line itself where its speed is constant.

    Second result: where that is, (k,).

    The rounding of a counter is no noise while a line runs steadily: it is a slow saw tooth, which
    no short mean removes and which shakes the rope at its own period. Stretches are set to a
    straight line of least squares where rounding explains what lies beside it: MAX_STRAIGHT
    resolutions over STRAIGHT_SAMPLES, STRAIGHT_RMS of the whole stretch.
    """
    half = STRAIGHT_SAMPLES // 2
    straight = np.zeros(len(positions), bool)
    if len(positions) <= STRAIGHT_SAMPLES:
        return positions, straight
    windows = np.lib.stride_tricks.sliding_window_view(positions, STRAIGHT_SAMPLES)
    offset = np.arange(STRAIGHT_SAMPLES) - float(half)
    middle, slope = windows.mean(axis=1), windows @ offset / (offset @ offset)
    deviation = np.abs(windows - middle[:, None] - slope[:, None] * offset).max(axis=1)
    steady = np.concatenate([[False], deviation <= MAX_STRAIGHT * resolution_m, [False]])
    borders = np.flatnonzero(np.diff(steady.astype(int))) + half
    straight_m = positions.copy()
    for begin, end in borders.reshape(-1, 2):
        if end - begin > STRAIGHT_SAMPLES:
            abscissa = np.arange(end - begin) - 0.5 * (end - begin - 1)
            stretch = positions[begin:end]
            line = stretch.mean() + abscissa * (abscissa @ stretch) / (abscissa @ abscissa)
            if np.sqrt(np.mean((stretch - line) ** 2)) <= STRAIGHT_RMS * resolution_m:
                straight_m[begin:end] = line
                straight[begin:end] = True
    return straight_m, straight


@dataclass(frozen=True)
class UnsteadyStretch:
    """Stretch of a moving line whose speed is not constant, by a counter of coarse resolution."""

    begin_s: float
    end_s: float
    counts: bytes  # of the counter, in resolutions; unlike all others where the stretch is cut
    resolution_m: float
    standing: tuple[tuple[float, float], ...]  # begin and end of counts that repeat [s]

    def sd_at(self, times_s: Floats) -> Floats:
        """Return the standard deviation of the smoothed rounding error [m], (k,)."""
        at_rest = np.zeros(len(times_s), bool)
        for begin, end in self.standing:
            at_rest |= (times_s >= begin) & (times_s <= end)
        remaining = np.where(at_rest, 1.0, SMOOTHING_LEAVES)
        return np.asarray(self.resolution_m * np.sqrt(remaining / 12.0))


@dataclass(frozen=True)
class LineTrack:
    """Smoothed line out over time."""

    line_out_m: CubicSpline  # over time [s]

    def at(self, times_s: Floats) -> tuple[Floats, Floats]:
        """Return the line out [m] and its rate [m/s] at times, (k,); beyond its ends it stands.

        The rate is the derivative of the line out: else steps shorter than a sample would shake the
        rope.
        """
        inside = np.clip(times_s, self.line_out_m.x[0], self.line_out_m.x[-1])
        rate = np.where(inside == times_s, self.line_out_m(inside, 1), 0.0)
        return self.line_out_m(inside), rate


class MeasuredLift:
    """Measured tension, heave and line out of one rope, and of others that share its load."""

    def __init__(self, pin_noise_n: float) -> None:
        """Begin without data; pin_noise_n: standard deviation of one sample of the load pin [N]."""
        self.pin_noise_n = pin_noise_n
        self.tension = Series(1)  # at the sheave [N]
        self.heave = Series(2)  # of the hang-off [m], its rate [m/s]
        self.line_out = Series(1)  # of the rope that is predicted [m]
        self.sensor = Series(1)  # heave as the motion sensor measures it, if heave is a twin's [m]
        self.counter = Series(1)  # as the line counter measures it, if line_out is a twin's [m]
        self.others: dict[str, MeasuredLift] = {}  # of further winches, without heave

    @property
    def ropes(self) -> tuple[MeasuredLift, ...]:
        """Return this one and those of further winches."""
        return (self, *self.others.values())

    @property
    def begin_s(self) -> float:
        """Return the first time at which all are known, of load pins those there are; inf: none."""
        tables = [self.heave.table, *(rope.line_out.table for rope in self.ropes)]
        pins = [rope.tension.table for rope in self.ropes if len(rope.tension.table)]
        if not pins or not all(len(table) for table in tables):
            return np.inf
        return max(float(table[0, 0]) for table in (*pins, *tables))

    def known_until_s(self, ahead_s: float) -> float:
        """Return the time until which all are known; ahead_s: of heave that a delay asks for.

        A tension that is LATE_S late is missing and is not waited for, if there was any before.
        """
        line_s = min(rope.line_out.newest_s for rope in self.ropes)
        moved_s = min(line_s, self.heave.newest_s - ahead_s)
        newest_s = [rope.tension.newest_s for rope in self.ropes if len(rope.tension.table)]
        return min(max(min(newest_s), moved_s - LATE_S), moved_s) if newest_s else -np.inf

    def drop_before(self, time_s: float) -> None:
        """Forget all samples before a time."""
        for rope in self.ropes:
            for series in (rope.tension, rope.heave, rope.line_out, rope.sensor, rope.counter):
                series.drop_before(time_s)

    def means_of_pins(self, begin_s: float, end_s: float) -> tuple[Floats, Floats]:
        """Return the means of the tension over MEAN_S from begin to end, (pins·k,), NaN: missing.

        Those of one load pin after the other. Second result: median number of samples in a mean,
        (pins,).
        """
        pairs = [rope._own_means(begin_s, end_s) for rope in self.ropes]
        means = np.array([mean for mean, _ in pairs])
        ends = begin_s + MEAN_S * np.arange(1, means.shape[1] + 1)
        for hole_begin, hole_end in self._holes(begin_s - FORGETTING_S, end_s):
            means[:, (ends > hole_begin) & (ends - MEAN_S < hole_end + FORGETTING_S)] = np.nan
        return means.ravel(), np.array([samples for _, samples in pairs])

    def _own_means(self, begin_s: float, end_s: float) -> tuple[Floats, float]:
        """Return `means_of_pins` of this load pin, holes of heave and line out not regarded."""
        count = round((end_s - begin_s) / MEAN_S)
        if not len(self.tension.table):
            return np.full(count, np.nan), 1.0
        time_s, clean = self._clean_tension(begin_s, end_s)
        means, number = interval_means(time_s, clean, begin_s, count)
        stopped = np.where(at_stops(clean), 1.0, 0.0)
        means[np.nan_to_num(interval_means(time_s, stopped, begin_s, count)[0]) > 0.0] = np.nan
        present = number[number > 0]
        return means, float(np.median(present)) if len(present) else 1.0

    def sampled_means(self, steps: Floats, begin_s: float, step_s: float, from_s: float) -> Floats:
        """Return the means of a model's tension at the instants of the measured one, (k, ...).

        A load cell samples an interval at instants of its own, whose middle may be some tenths of a
        second from the interval's. Where there is no sample the mean is that of the steps.

        Args:
            steps: at the ends of steps from begin_s on, (a whole number of means, ...).
            begin_s: begin of the first step [s].
            step_s: time step, a whole fraction of MEAN_S.
            from_s: begin of the first mean, a whole number of them after begin_s.
        """
        per_mean = round(MEAN_S / step_s)
        skipped = round((from_s - begin_s) / MEAN_S)
        count = len(steps) // per_mean - skipped
        time_s, clean = self._clean_tension(from_s, from_s + MEAN_S * count)
        interval = _intervals(time_s, from_s)
        good = np.isfinite(clean) & (interval >= 0) & (interval < count)
        index = np.clip((time_s[good] - begin_s) / step_s - 1.0, 0.0, len(steps) - 1.0)
        before = np.minimum(index.astype(np.int64), max(len(steps) - 2, 0))
        share = index - before
        row, number = interval[good], np.bincount(interval[good], minlength=count)
        empty = np.flatnonzero(number == 0)
        even = (empty[:, None] + skipped) * per_mean + np.arange(per_mean)
        weights = csr_array(
            (
                np.concatenate([
                    (1.0 - share) / number[row], share / number[row],
                    np.full(even.size, 1.0 / per_mean),
                ]),
                (
                    np.concatenate([row, row, np.repeat(empty, per_mean)]),
                    np.concatenate([before, before + 1, even.ravel()]),
                ),
            ),
            shape=(count, len(steps)),
        )  # fmt: skip
        return np.asarray(weights @ steps)

    def _clean_tension(self, begin_s: float, end_s: float) -> tuple[Floats, Floats]:
        """Return times and tension about an interval, NaN: a spike."""
        table = self.tension.table
        table = table[(table[:, 0] > begin_s - 1.0) & (table[:, 0] <= end_s + 1.0)]
        limit = SPIKE_SDS * self.pin_noise_n + _resolution(table[:, 1])
        return table[:, 0], without_spikes(table[:, 0], table[:, 1], limit)

    def rounding_n(self, begin_s: float, end_s: float) -> float:
        """Return the standard deviation of what the load cell rounds off between two times [N].

        A count between two levels is a step of that size, which the waves may take minutes to
        leave: the samples of a mean have one error.
        """
        times, values = self.tension.table.T
        return _resolution(values[(times > begin_s) & (times <= end_s)]) / float(np.sqrt(12.0))

    def stopped_share(self, begin_s: float, end_s: float) -> float:
        """Return the share of the tension from begin to end at the ends of the pin's range."""
        times, values = self.tension.table.T
        values = values[(times > begin_s) & (times <= end_s)]
        return float(at_stops(values).mean()) if len(values) else 0.0

    def _holes(self, begin_s: float, end_s: float) -> list[tuple[float, float]]:
        """Return begin and end of the holes in heave and line out that overlap an interval."""
        holes = []
        lines = ((rope.line_out, LINE_HOLE_S) for rope in self.ropes)
        for series, longest in ((self.heave, HEAVE_HOLE_S), *lines):
            times = series.table[:, 0]
            wide = np.flatnonzero(np.diff(times) > longest)
            holes += [(float(times[k]), float(times[k + 1])) for k in wide]
        return [(a, b) for a, b in holes if b > begin_s and a < end_s]

    def heave_motion(
        self, times_s: Floats, delay_s: float | Floats = 0.0, heave_gain: float = 0.0
    ) -> tuple[Floats, Floats]:
        """Return the heave [m] and its rate at times, (k,), of a sensor with delay and gain.

        The true heave is exp(-heave_gain)·measured(t + delay_s). Beyond its ends a series keeps
        its last value. Times (k, 1) with delays (n,) yield (k, n).
        """
        table = self.heave.table
        sampled_s = times_s + delay_s
        window = slice(
            *np.searchsorted(table[:, 0], (sampled_s.min() - 2.0, sampled_s.max() + 2.0))
        )
        rows = table[window] if window.stop - window.start > 1 else table
        heave = CubicHermiteSpline(rows[:, 0], rows[:, 1], rows[:, 2])
        inside = np.clip(sampled_s, rows[0, 0], rows[-1, 0])
        share = np.exp(-heave_gain)
        return share * heave(inside), np.where(inside == sampled_s, share * heave(inside, 1), 0.0)

    def heave_grid(self, begin_s: float, end_s: float, interval_s: float) -> Floats:
        """Return the measured heave on an even grid [m], as far as it is known, (samples,)."""
        table = self.heave.table
        begin, end = max(begin_s, table[0, 0]), min(end_s, table[-1, 0])
        times = np.arange(begin, end, interval_s)
        return np.interp(times, table[:, 0], table[:, 1])

    def line_resolution_m(self) -> float:
        """Return the smallest change of the line counter [m]; 0: the line has not moved."""
        return _resolution(self.line_out.table[:, 1])

    def line_error_psd(self, begin_s: float, end_s: float) -> float:
        """Return the spectrum of a line counter's rounding [m²/Hz], one-sided and flat.

        A resolution Δ makes a white error of Δ²/12 while the line moves (Widrow 1956), and none
        while it stands. The resolution is the smallest change of the counts.
        """
        times, counts = self.line_out.table.T
        window = slice(*np.searchsorted(times, (begin_s, end_s)))
        resolution_m = _resolution(counts[window])
        if resolution_m == 0.0:
            return 0.0
        moved = np.abs(np.diff(counts[window])) > SAME_COUNT_M
        spacing_s = float(np.median(np.diff(times[window])))
        return float(moved.mean() * resolution_m**2 / 6.0 * spacing_s)

    def line_motion(self, times_s: Floats) -> tuple[Floats, Floats]:
        """Return the line out [m] and its rate [m/s] at times, (k,), smoothed over 15 samples."""
        return self.line_track(float(times_s[0]), float(times_s[-1])).at(times_s)

    def line_track(self, begin_s: float, end_s: float, straight: bool = False) -> LineTrack:
        """Return the line out between two times [s], smoothed over 15 samples.

        straight: where the line runs steadily it is a straight line first.
        """
        grid, raw, table = self._line_samples(begin_s, end_s)
        if straight and (resolution_m := _resolution(table[:, 1])) > 0.0:
            raw, _ = straightened(raw, resolution_m)
        half = SMOOTHED_SAMPLES // 2
        padded = np.pad(raw, half, mode="reflect", reflect_type="odd")
        return LineTrack(CubicSpline(grid, np.convolve(padded, _SMOOTHING, "valid")))

    def passages(self, begin_s: float, end_s: float) -> list[UnsteadyStretch]:
        """Return the stretches between two times [s] in which a line moves, but not steadily."""
        grid, raw, table = self._line_samples(begin_s, end_s)
        resolution_m = _resolution(table[:, 1])
        if resolution_m == 0.0:
            return []
        _, steady = straightened(raw, resolution_m)
        borders = np.flatnonzero(np.diff(np.concatenate([[True], steady, [True]]).astype(int)))
        passages = []
        for begin, end in borders.reshape(-1, 2):
            samples = slice(
                *np.searchsorted(table[:, 0], (grid[begin] - 1e-6, grid[end - 1] + 1e-6))
            )
            times, counts = table[samples].T
            if len(counts) < 2 or np.ptp(counts) < SAME_COUNT_M:
                continue
            cut = begin == 0 or end == len(grid)
            key = np.round(counts / resolution_m).astype(np.int64)
            name = np.array([grid[begin], grid[end - 1]]) if cut else key
            changes = np.flatnonzero(np.diff(key))
            edges = np.concatenate([[times[0]], times[changes + 1], [times[-1]]])
            wide = np.flatnonzero(np.diff(edges) > SMOOTHED_SAMPLES / LINE_HZ)
            standing = tuple((float(edges[k]), float(edges[k + 1])) for k in wide)
            span_s = float(grid[begin]), float(grid[end - 1])
            passages.append(UnsteadyStretch(*span_s, name.tobytes(), resolution_m, standing))
        return passages

    def _line_samples(self, begin_s: float, end_s: float) -> tuple[Floats, Floats, Floats]:
        """Return an even grid [s], the line out there without stairs, and the samples near."""
        table = self.line_out.table
        margin = SMOOTHED_SAMPLES / LINE_HZ
        begin = max(begin_s - margin, table[0, 0])
        end = min(end_s + margin, table[-1, 0])
        count = max(SMOOTHED_SAMPLES, round((end - begin) * LINE_HZ)) + 1
        grid = begin + np.arange(count) / LINE_HZ
        window = slice(*np.searchsorted(table[:, 0], (begin - LINE_HOLE_S, end + LINE_HOLE_S)))
        rows = table[window] if window.stop > window.start else table  # all of it lies in a hole
        return grid, np.interp(grid, *without_stairs(*rows.T)), rows

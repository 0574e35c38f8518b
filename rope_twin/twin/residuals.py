"""Residuals: what a sensor measured less what the twin computed for the same instant.

From the first reading on the twin's values are stored for HISTORY_NS, one row every SAMPLE_NS, and
interpolated linearly at the stamp of each reading; a reading with a future stamp waits for its
time. A residual should lie in ±1.96·√(u² + t²) in 95 % of the cases, with the standard uncertainty
u of the instrument (the scene's `measured`) and t of the twin. For the tension t is the half width
of the error interval over 1.96, or the RMS error bound of the scene's convergence study; where it
is unknown, the interval is that of the instrument alone and the twin's part is reported as unknown.
A tension whose instrument has no stated uncertainty has no interval; its mean residual is compared
with what the uncertainties of load and load pin in the scene's `learning` explain.
Nothing here acts on the twin, and without readings nothing is done.
"""

from __future__ import annotations

import math
from bisect import bisect_left
from collections import deque
from collections.abc import Callable
from operator import add

from rope_twin.errors import did_you_mean, phrase
from rope_twin.scene.instruments import MOTOR as AT_MOTOR
from rope_twin.scene.instruments import Learning, MeasuredLength, MeasuredTension
from rope_twin.scene.rigging import places
from rope_twin.scene.schema import Scene
from rope_twin.twin.health import SENDER_LEAD_S
from rope_twin.twin.readings import (
    HISTORY_NS,
    MOTOR,
    MOTOR_TENSION,
    PAYLOAD,
    PAYLOAD_DEPTH,
    WINCH_MEASURED,
    WINCH_SENSORS,
    DepthReadings,
    Measurement,
    Readings,
    Row,
    WinchReadings,
)
from rope_twin.twin.residual_tests import ResidualMonitor
from rope_twin.twin.snapshot import InputHealth, Residual, Snapshot

SAMPLE_NS = 20_000_000  # minimum interval of the stored values of the twin
WINDOW_S = 60  # of the statistics
COVERAGE = 1.96  # half width of a 95 % interval over its standard deviation
MIN_COMPARED = 10  # readings for a standard deviation of the computed tension
FROZEN_NS, FROZEN_READINGS = 5_000_000_000, 5  # duration and number of equal readings
FROZEN_FRACTION, FROZEN_M = 0.02, 0.5  # change of the twin's tension or length meanwhile
# ratio of tensions that no error of cell or twin explains; a pound-force is 4.448 N
MISFIT, MISFIT_S = 4.0, 10
MAX_WAITING = 5000  # readings of one sensor that may wait for their time
Values = tuple[float, ...]
Follow = Callable[[str, int, float, float | None], None]
TENSION, LINE_OUT, DEPTH = "top_tension_n", "line_out_m", "payload_depth_m"


class History:
    """Values of the twin over HISTORY_NS: of each rope tension and line out, then depth."""

    def __init__(self) -> None:
        self._times: list[int] = []
        self._rows: list[Values] = []

    @property
    def newest_ns(self) -> int:
        """Time of the newest row; -1: there is none."""
        return self._times[-1] if self._times else -1

    def add(self, time_ns: int, row: Values) -> None:
        """Append the values at a time, and drop those that are too old."""
        if self._rows and (time_ns <= self._times[-1] or len(row) != len(self._rows[-1])):
            self._times.clear()  # another number of ropes after a cut, or an earlier state
            self._rows.clear()
        self._times.append(time_ns)
        self._rows.append(row)
        if len(self._times) > 64 and self._times[32] < time_ns - HISTORY_NS:
            del self._times[:32], self._rows[:32]

    def at(self, time_ns: int, column: int) -> float | None:
        """Return a value at a time, interpolated, or None if it is not stored."""
        if not self._times or not self._times[0] <= time_ns <= self._times[-1]:
            return None
        k = bisect_left(self._times, time_ns)
        after = self._rows[k][column]
        if self._times[k] == time_ns:
            return after
        before, begin_ns = self._rows[k - 1][column], self._times[k - 1]
        return before + (after - before) * (time_ns - begin_ns) / (self._times[k] - begin_ns)


class Comparison:
    """Residuals of one quantity, and their statistics over WINDOW_S in bins of a second."""

    def __init__(
        self, name: str, quantity: str, column: int, sensor: MeasuredTension | MeasuredLength,
        group: str, prior: Learning | None = None,
    ) -> None:  # fmt: skip
        """Compare readings of a group of sensors with a column of the history (-1: the last).

        prior: of a load pin, for readings of unknown uncertainty.
        """
        self.name, self.quantity, self.column, self.group = name, quantity, column, group
        self._sensor, self._prior = sensor, prior
        self._waiting: deque[tuple[int, float]] = deque()
        # newest one compared: stamp, measured, computed, instrument's and twin's uncertainty
        self._newest: tuple[int, float, float, float | None, float | None] | None = None
        # second, readings, Σr, Σr², outside, with an interval, Σc, Σc²: r residual, c computed
        self._bins: deque[tuple[float, ...]] = deque()
        self._level = 0.0  # reference of c
        judged = sensor.uncertainty(1.0) is not None
        self._monitor = ResidualMonitor() if judged else None
        self._equal = (0.0, 0, 0, 0.0, 0.0)  # value, since [ns], readings, range of the computed

    @property
    def bias(self) -> float:
        """Known offset of the instrument."""
        return self._sensor.bias

    def submit(self, stamp_ns: int, value: float) -> None:
        """Record an accepted reading; the oldest that waits is dropped if there are too many."""
        self._waiting.append((stamp_ns, value - self._sensor.bias))
        if len(self._waiting) > MAX_WAITING:
            self._waiting.popleft()

    def invalidate(self) -> None:
        """Drop the readings that wait for their time."""
        self._waiting.clear()

    def update(self, history: History, twin: float | None, rms_share: float | None) -> None:
        """Compare the readings whose time has come.

        twin: its standard uncertainty; rms_share: that over the standard deviation of the computed
        values instead; None: unknown.
        """
        while self._waiting and self._waiting[0][0] <= history.newest_ns:
            stamp_ns, measured = self._waiting.popleft()
            computed = history.at(stamp_ns, self.column)
            if computed is None:
                continue
            uncertainty = twin
            if twin is None and rms_share is not None and (spread := self._spread()) is not None:
                uncertainty = rms_share * spread
            self._count(stamp_ns, measured, computed, uncertainty)

    def _count(self, stamp_ns: int, measured: float, computed: float, twin: float | None) -> None:
        """Add a residual to the statistics."""
        if self._newest is None:
            self._level = computed
        u, r, c = self._sensor.uncertainty(measured), measured - computed, computed - self._level
        self._newest = stamp_ns, measured, computed, u, twin
        half_width = _half_width(u, twin)
        second = stamp_ns // 1_000_000_000
        known = int(half_width is not None)
        outside = int(half_width is not None and abs(r) > half_width)
        if self._monitor is not None and half_width and u:
            self._monitor.take(stamp_ns, r, half_width / COVERAGE, u)
        sums: tuple[float, ...] = 0, 0.0, 0.0, 0, 0, 0.0, 0.0
        if self._bins and self._bins[-1][0] == second:
            sums = self._bins.pop()[1:]
        added = 1, r, r * r, outside, known, c, c * c
        self._bins.append((second, *map(add, sums, added)))
        while self._bins[0][0] <= second - WINDOW_S:
            self._bins.popleft()
        value, since_ns, count, low, high = self._equal
        if measured != value or count == 0:
            self._equal = measured, stamp_ns, 1, computed, computed
        else:
            self._equal = value, since_ns, count + 1, min(low, computed), max(high, computed)

    @property
    def doubt(self) -> str:
        """Return the warning on recent readings, or ""."""
        return self.frozen or self.misfit

    @property
    def frozen(self) -> str:
        """Return the warning on a reading that stays equal while the twin's value moves, or ""."""
        value, since_ns, count, low, high = self._equal
        if self._newest is None or count < FROZEN_READINGS:
            return ""
        min_change = FROZEN_FRACTION * abs(high) if self.quantity == TENSION else FROZEN_M
        equal_ns = self._newest[0] - since_ns
        if equal_ns < FROZEN_NS or high - low <= min_change:
            return ""
        problem = f"frozen: {self.quantity} {value:.6g} for {equal_ns * 1e-9:.0f} s"
        return f"{problem}, while the twin's moved by {high - low:.3g}"

    @property
    def misfit(self) -> str:
        """Return the warning on a tension of another size than the twin's for MISFIT_S, or ""."""
        if self.quantity != TENSION or not self._bins:
            return ""
        newest = self._bins[-1][0]
        if newest - self._bins[0][0] < MISFIT_S:
            return ""
        recent = [row for row in self._bins if row[0] > newest - MISFIT_S]
        n = sum(row[1] for row in recent)
        computed = self._level + sum(row[6] for row in recent) / n
        measured = computed + sum(row[2] for row in recent) / n
        if computed <= 0.0 or 1.0 / MISFIT <= measured / computed <= MISFIT:
            return ""
        problem = f"it reads {measured / 1e3:.4g} kN where the twin has {computed / 1e3:.4g} kN"
        return f"{problem}: another unit, sign or load"

    def _spread(self) -> float | None:
        """Return the standard deviation of the computed values; None: too few."""
        n = sum(row[1] for row in self._bins)
        if n < MIN_COMPARED:
            return None
        mean = sum(row[6] for row in self._bins) / n
        return math.sqrt(max(sum(row[7] for row in self._bins) / n - mean * mean, 0.0))

    def result(self) -> Residual | None:
        """Return the newest residual and the statistics, or None if nothing was compared yet."""
        if self._newest is None:
            return None
        stamp_ns, measured, computed, u, twin = self._newest
        n, sum_r, sum_rr, out, known, sum_c = (
            sum(row[k] for row in self._bins) for k in range(1, 7)
        )
        explained = None
        if self._prior is not None and u is None:
            mean_n = self._level + sum_c / n
            explained = self._prior.explained_tension_n(mean_n, self._level)
        return Residual(
            name=self.name,
            quantity=self.quantity,
            at_s=stamp_ns * 1e-9,
            measured=measured,
            computed=computed,
            half_width=_half_width(u, twin),
            instrument=u,
            twin=twin,
            readings=int(n),
            mean=sum_r / n,
            rms=math.sqrt(sum_rr / n),
            outside=out / known if known else None,
            span_s=float(self._bins[-1][0] - self._bins[0][0] + 1),
            sensors=self.group,
            tests=None if self._monitor is None else self._monitor.result,
            explained=explained,
        )


def _half_width(u: float | None, twin: float | None) -> float | None:
    """Return half the interval of a residual; None: the instrument's uncertainty is unknown."""
    return None if u is None else COVERAGE * math.hypot(u, twin or 0.0)


class MeasuredInputs:
    """All measured inputs of a twin; `submit` takes them, `record` and `look` compare them."""

    def __init__(self, scene: Scene) -> None:
        """Make the checks and comparisons of a scene."""
        sensors, hang_offs = scene.measured, places(scene)
        lines = [(r, line) for r, line in enumerate(scene.ropes) if line.from_ in hang_offs]
        self.names = tuple(line.from_ for _, line in lines)
        self.active = False  # whether a reading was accepted
        self.lead_s = SENDER_LEAD_S  # allowed to senders
        self._heard = False  # whether a reading came
        self._motor_tells = sensors.tension.at == AT_MOTOR
        self._winches = tuple(WinchReadings(scene, line, "") for _, line in lines)
        self._motors = tuple(WinchReadings(scene, line, MOTOR) for _, line in lines)
        self._depth = DepthReadings(scene)
        group = MOTOR_TENSION if self._motor_tells else WINCH_MEASURED
        self._tensions = tuple(
            Comparison(line.from_, TENSION, 2 * r, sensors.tension, group, scene.learning)
            for r, line in lines
        )
        counter = sensors.line_out
        self._lengths = tuple(
            Comparison(line.from_, LINE_OUT, 2 * r + 1, counter, WINCH_MEASURED)
            for r, line in lines
        )
        lower = scene.payloads[0].name if len(scene.payloads) == 1 else "payload"
        self._depths = Comparison(lower, DEPTH, -1, sensors.payload_depth, PAYLOAD_DEPTH)
        self._history = History()

    def submit(
        self, measurement: Measurement, now_ns: int, follow: Follow | None = None,
        received_ns: int | None = None,
    ) -> str:  # fmt: skip
        """Take a measurement, value by value; return "" or the first reason for a rejection.

        follow: is given name of the winch, stamp, line out less its offset, and line speed (None:
        not measured, or in contradiction to the line out). received_ns: arrival; None: unknown.
        """
        source, stamp_ns, rows = measurement
        self._heard = True
        refusals = []
        for row in rows:
            (name, line_out, speed, _), refusal = self._submit(
                source, stamp_ns, row, now_ns, received_ns
            )
            refusals.append(refusal)
            if source != WINCH_SENSORS or line_out is None or follow is None:
                continue
            name = name or self.names[0]
            if self._winches[self.names.index(name)].speed_doubt:
                speed = None
            follow(name, stamp_ns, line_out - self._lengths[0].bias, speed)
        return next(filter(None, refusals), "")

    def _submit(
        self, source: str, stamp_ns: int, row: Row, now_ns: int, received_ns: int | None
    ) -> tuple[Row, str]:
        """Check a row; return it with None for each rejected value, and the first rejection."""
        name, nothing = row[0], (row[0], None, None, None)
        if source == PAYLOAD:
            accepted, refusal = self._depth.take(stamp_ns, row, now_ns, received_ns)
            if (depth_m := accepted[1]) is not None:
                self.active = True
                self._depths.submit(stamp_ns, depth_m)
            return accepted, refusal
        group = self._motors if source == MOTOR else self._winches
        if not name and len(self.names) > 1:
            remedy = f"name one of {', '.join(self.names)}"
            sentence = phrase("winch", "no name is given", remedy)
            return nothing, group[0].counter.refuse("impossible", sentence)
        if name and name not in self.names:
            sentence = phrase("winch", f"there is no '{name}'", did_you_mean(name, self.names))
            return nothing, group[0].counter.refuse("impossible", sentence)
        index = self.names.index(name) if name else 0
        accepted, refusal = group[index].take(stamp_ns, row, now_ns, received_ns)
        _, position, _, tension = accepted
        self.active = self.active or accepted != nothing
        if tension is not None and (source == MOTOR) == self._motor_tells:
            self._tensions[index].submit(stamp_ns, tension)
        if position is not None:
            self._lengths[index].submit(stamp_ns, position)
        return accepted, refusal

    def invalidate(self) -> None:
        """Drop readings that were known in advance, after a pause or a restart."""
        for readings in self._groups:
            readings.invalidate()
        for comparison in (*self._tensions, *self._lengths, self._depths):
            comparison.invalidate()

    def steps_to_sample(self, steps: int, step_ns: int) -> int:
        """Return after how many steps the next row of the history is due."""
        interval = max(1, SAMPLE_NS // step_ns)
        return interval - steps % interval

    def is_due(self, steps: int, step_ns: int) -> bool:
        """Return whether a row of the history is due after this many steps."""
        return steps % max(1, SAMPLE_NS // step_ns) == 0

    def record(self, time_ns: int, row: Values) -> None:
        """Store the twin's values at a time: of each rope top tension and line out, then depth."""
        self._history.add(time_ns, row)

    def residuals(self, snapshot: Snapshot) -> tuple[Residual, ...]:
        """Compare the readings since the last snapshot, and return all residuals."""
        for r, comparison in enumerate(self._tensions):
            interval = snapshot.error_interval if r == 0 else None
            number = comparison.column // 2
            if r > 0 and number < len(snapshot.ropes):
                interval = snapshot.ropes[number].error_interval
            twin = None if interval is None else interval.bound_n / COVERAGE
            rms_pct = snapshot.study_error.rms_pct if r == 0 else math.nan
            comparison.update(self._history, twin, None if math.isnan(rms_pct) else 0.01 * rms_pct)
        for comparison in self._lengths:  # prescribed to the rope: it has no error of its own
            comparison.update(self._history, 0.0, None)
        self._depths.update(self._history, None, None)
        comparisons = (*self._tensions, *self._lengths, self._depths)
        return tuple(filter(None, (comparison.result() for comparison in comparisons)))

    def newest_ns(self) -> dict[str, int]:
        """Return the stamp of the newest accepted reading of each sensor group [ns]."""
        newest = {readings.counter.name: readings.counter.newest_ns for readings in self._groups}
        return {name: stamp_ns for name, stamp_ns in newest.items() if stamp_ns is not None}

    def health(self, now_ns: int) -> dict[str, InputHealth]:
        """Return the health of each sensor group that has sent anything."""
        if not self._heard:
            return {}
        for index, readings in enumerate(self._winches):
            tensions = () if self._motor_tells else (self._tensions[index],)
            compared = (comparison.doubt for comparison in (*tensions, self._lengths[index]))
            readings.warning = "; ".join(filter(None, (readings.speed_doubt, *compared)))
        if self._motor_tells:
            for motor, comparison in zip(self._motors, self._tensions, strict=True):
                motor.warning = comparison.doubt
        self._depth.warning = self._depths.doubt
        groups = [one for one in self._groups if one.counter.accepted or one.counter.refused]
        return {one.counter.name: one.health(now_ns, self.lead_s) for one in groups}

    @property
    def _groups(self) -> tuple[Readings, ...]:
        return (*self._winches, *self._motors, self._depth)

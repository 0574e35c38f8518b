"""Residuals: what a sensor measured less what the twin computed for the same instant.

From the first reading on the twin's own values are kept for HISTORY_NS, one row every SAMPLE_NS,
and interpolated linearly at the stamp of each reading; a reading of the near future waits for its
time. A residual should lie in ±1.96·√(u² + t²) in 95 % of the cases, with the standard uncertainty
u of the instrument (the scene's `measured`) and t of the twin. For the tension t is the half width
of the error interval over 1.96, or the RMS error bound of the scene's convergence study; where it
is unknown, the interval is that of the instrument alone and the twin's part is reported as unknown.
Nothing here acts on the twin, and without readings nothing is done.
"""

from __future__ import annotations

import math
from bisect import bisect_left
from collections import deque
from collections.abc import Callable

from rope_twin.errors import did_you_mean, phrase
from rope_twin.scene.instruments import MOTOR as AT_MOTOR
from rope_twin.scene.instruments import MeasuredLength, MeasuredTension
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

SAMPLE_NS = 20_000_000  # at least this far apart are the kept values of the twin
WINDOW_S = 60  # of the statistics
COVERAGE = 1.96  # half width of a 95 % interval over its standard deviation
LEAST_COMPARED = 10  # readings for a standard deviation of the computed tension
FROZEN_NS, FROZEN_READINGS = 5_000_000_000, 5  # equal readings for so long, while the twin moves
FROZEN_SHARE, FROZEN_M = 0.02, 0.5  # by more than this share of a tension, or this length
MISFIT, MISFIT_S = 5.0, 10  # ratio of tensions that no error of cell or twin explains
WAITING_MOST = 5000  # readings of one sensor that may wait for their time
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
        """Return a value at a time, interpolated, or None if it was not kept."""
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
        group: str,
    ) -> None:  # fmt: skip
        """Compare readings of a group of sensors with a column of the history (-1: the last)."""
        self.name, self.quantity, self.column, self.group = name, quantity, column, group
        self._sensor = sensor
        self._waiting: deque[tuple[int, float]] = deque()
        # newest one compared: stamp, measured, computed, instrument's and twin's uncertainty
        self._newest: tuple[int, float, float, float | None, float | None] | None = None
        # second, readings, Σr, Σr², outside, with an interval, Σc, Σc²: r residual, c computed
        self._bins: deque[tuple[int, int, float, float, int, int, float, float]] = deque()
        self._level = 0.0  # from which c counts
        judged = sensor.uncertainty(1.0) is not None
        self._monitor = ResidualMonitor() if judged else None
        self._equal = (0.0, 0, 0, 0.0, 0.0)  # value, since [ns], readings, range of the computed

    @property
    def bias(self) -> float:
        """Known offset of the instrument."""
        return self._sensor.bias

    def offer(self, stamp_ns: int, value: float) -> None:
        """Take an accepted reading; the oldest that waits is dropped if there are too many."""
        self._waiting.append((stamp_ns, value - self._sensor.bias))
        if len(self._waiting) > WAITING_MOST:
            self._waiting.popleft()

    def invalidate(self) -> None:
        """Drop the readings that wait for their time."""
        self._waiting.clear()

    def look(self, history: History, twin: float | None, rms_share: float | None) -> None:
        """Compare the readings whose time has come.

        twin: its standard uncertainty; rms_share: that over the standard deviation of the computed
        values instead; None: unknown.
        """
        while self._waiting and self._waiting[0][0] <= history.newest_ns:
            stamp_ns, measured = self._waiting.popleft()
            computed = history.at(stamp_ns, self.column)
            if computed is None:
                continue
            own = twin
            if own is None and rms_share is not None and (spread := self._spread()) is not None:
                own = rms_share * spread
            self._count(stamp_ns, measured, computed, own)

    def _count(self, stamp_ns: int, measured: float, computed: float, twin: float | None) -> None:
        """Add a residual to the statistics."""
        if self._newest is None:
            self._level = computed
        u, r, c = self._sensor.uncertainty(measured), measured - computed, computed - self._level
        self._newest = stamp_ns, measured, computed, u, twin
        half = _half_width(u, twin)
        second = stamp_ns // 1_000_000_000
        known, outside = int(half is not None), int(half is not None and abs(r) > half)
        if self._monitor is not None and half and u:
            self._monitor.take(stamp_ns, r, half / COVERAGE, u)
        if self._bins and self._bins[-1][0] == second:
            _, n, sum_r, sum_rr, out, with_half, sum_c, sum_cc = self._bins.pop()
        else:
            n, sum_r, sum_rr, out, with_half, sum_c, sum_cc = 0, 0.0, 0.0, 0, 0, 0.0, 0.0
        sums = (
            sum_r + r,
            sum_rr + r * r,
            out + outside,
            with_half + known,
            sum_c + c,
            sum_cc + c * c,
        )
        self._bins.append((second, n + 1, *sums))
        while self._bins[0][0] <= second - WINDOW_S:
            self._bins.popleft()
        value, since_ns, count, low, high = self._equal
        if measured != value or count == 0:
            self._equal = measured, stamp_ns, 1, computed, computed
        else:
            self._equal = value, since_ns, count + 1, min(low, computed), max(high, computed)

    @property
    def doubt(self) -> str:
        """Return the warning on the readings of late, or ""."""
        return self.frozen or self.misfit

    @property
    def frozen(self) -> str:
        """Return the warning on a reading that stays equal while the twin's value moves, or ""."""
        value, since_ns, count, low, high = self._equal
        if self._newest is None or count < FROZEN_READINGS:
            return ""
        least = FROZEN_SHARE * abs(high) if self.quantity == TENSION else FROZEN_M
        equal_ns = self._newest[0] - since_ns
        if equal_ns < FROZEN_NS or high - low <= least:
            return ""
        what = f"frozen: {self.quantity} {value:.6g} for {equal_ns * 1e-9:.0f} s"
        return f"{what}, while the twin's moved by {high - low:.3g}"

    @property
    def misfit(self) -> str:
        """Return the warning on a tension of another size than the twin's for MISFIT_S, or ""."""
        if self.quantity != TENSION or not self._bins:
            return ""
        newest = self._bins[-1][0]
        if newest - self._bins[0][0] < MISFIT_S:
            return ""
        late = [one for one in self._bins if one[0] > newest - MISFIT_S]
        n = sum(one[1] for one in late)
        computed = self._level + sum(one[6] for one in late) / n
        measured = computed + sum(one[2] for one in late) / n
        if computed <= 0.0 or 1.0 / MISFIT <= measured / computed <= MISFIT:
            return ""
        what = f"it reads {measured / 1e3:.4g} kN where the twin has {computed / 1e3:.4g} kN"
        return f"{what}: another unit, sign or load"

    def _spread(self) -> float | None:
        """Return the standard deviation of the computed values; None: too few."""
        n = sum(one[1] for one in self._bins)
        if n < LEAST_COMPARED:
            return None
        mean = sum(one[6] for one in self._bins) / n
        return math.sqrt(max(sum(one[7] for one in self._bins) / n - mean * mean, 0.0))

    def result(self) -> Residual | None:
        """Return the newest residual and the statistics, or None if nothing was compared yet."""
        if self._newest is None:
            return None
        stamp_ns, measured, computed, u, twin = self._newest
        n, sum_r, sum_rr, out, known = (sum(one[k] for one in self._bins) for k in range(1, 6))
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
        )


def _half_width(u: float | None, twin: float | None) -> float | None:
    """Return half the interval of a residual; None: the instrument's uncertainty is unknown."""
    return None if u is None else COVERAGE * math.hypot(u, twin or 0.0)


class MeasuredInputs:
    """All measured inputs of a twin; `offer` takes them, `record` and `look` compare them."""

    def __init__(self, scene: Scene) -> None:
        """Make the checks and comparisons of a scene."""
        sensors, hung = scene.measured, places(scene)
        lines = [(r, line) for r, line in enumerate(scene.ropes) if line.from_ in hung]
        self.names = tuple(line.from_ for _, line in lines)
        self.active = False  # whether a reading was accepted
        self.lead_s = SENDER_LEAD_S  # allowed to senders
        self._heard = False  # whether a reading came
        self._motor_tells = sensors.tension.at == AT_MOTOR
        self._winches = tuple(WinchReadings(scene, line, "") for _, line in lines)
        self._motors = tuple(WinchReadings(scene, line, MOTOR) for _, line in lines)
        self._depth = DepthReadings(scene)
        tells = MOTOR_TENSION if self._motor_tells else WINCH_MEASURED
        self._tensions = tuple(
            Comparison(line.from_, TENSION, 2 * r, sensors.tension, tells) for r, line in lines
        )
        self._lengths = tuple(
            Comparison(line.from_, LINE_OUT, 2 * r + 1, sensors.line_out, WINCH_MEASURED)
            for r, line in lines
        )
        lower = scene.payloads[0].name if len(scene.payloads) == 1 else "payload"
        self._depths = Comparison(lower, DEPTH, -1, sensors.payload_depth, PAYLOAD_DEPTH)
        self._history = History()

    def offer(
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
            (name, line_out, speed, _), refusal = self._offer(
                source, stamp_ns, row, now_ns, received_ns
            )
            refusals.append(refusal)
            if source != WINCH_SENSORS or line_out is None or follow is None:
                continue
            name = name or self.names[0]
            if self._winches[self.names.index(name)].speed_doubt:
                speed = None
            follow(name, stamp_ns, line_out - self._lengths[0].bias, speed)
        return next((words for words in refusals if words), "")

    def _offer(
        self, source: str, stamp_ns: int, row: Row, now_ns: int, received_ns: int | None
    ) -> tuple[Row, str]:
        """Take a row; return what of it is accepted and why the rest is not."""
        name, nothing = row[0], (row[0], None, None, None)
        if source == PAYLOAD:
            taken, refusal = self._depth.take(stamp_ns, row, now_ns, received_ns)
            if (depth_m := taken[1]) is not None:
                self.active = True
                self._depths.offer(stamp_ns, depth_m)
            return taken, refusal
        group = self._motors if source == MOTOR else self._winches
        if not name and len(self.names) > 1:
            right = f"name one of {', '.join(self.names)}"
            sentence = phrase("winch", "no name is given", right)
            return nothing, group[0].counter.refuse("impossible", sentence)
        if name and name not in self.names:
            sentence = phrase("winch", f"there is no '{name}'", did_you_mean(name, self.names))
            return nothing, group[0].counter.refuse("impossible", sentence)
        at = self.names.index(name) if name else 0
        taken, refusal = group[at].take(stamp_ns, row, now_ns, received_ns)
        _, place, _, tension = taken
        self.active = self.active or taken != nothing
        if tension is not None and (source == MOTOR) == self._motor_tells:
            self._tensions[at].offer(stamp_ns, tension)
        if place is not None:
            self._lengths[at].offer(stamp_ns, place)
        return taken, refusal

    def invalidate(self) -> None:
        """Drop readings that were known in advance, after a pause or a restart."""
        for group in self._groups:
            group.invalidate()
        for one in (*self._tensions, *self._lengths, self._depths):
            one.invalidate()

    def steps_to_sample(self, steps: int, step_ns: int) -> int:
        """Return after how many steps the next row of the history is due."""
        every = max(1, SAMPLE_NS // step_ns)
        return every - steps % every

    def is_due(self, steps: int, step_ns: int) -> bool:
        """Return whether a row of the history is due after this many steps."""
        return steps % max(1, SAMPLE_NS // step_ns) == 0

    def record(self, time_ns: int, row: Values) -> None:
        """Keep the twin's values at a time: of each rope top tension and line out, then depth."""
        self._history.add(time_ns, row)

    def residuals(self, shot: Snapshot) -> tuple[Residual, ...]:
        """Compare what has come since the last snapshot, and return all residuals."""
        for r, one in enumerate(self._tensions):
            interval = shot.error_interval if r == 0 else None
            number = one.column // 2
            if r > 0 and number < len(shot.ropes):
                interval = shot.ropes[number].error_interval
            twin = None if interval is None else interval.bound_n / COVERAGE
            rms_pct = shot.study_error.rms_pct if r == 0 else math.nan
            one.look(self._history, twin, None if math.isnan(rms_pct) else 0.01 * rms_pct)
        for one in self._lengths:
            one.look(self._history, 0.0, None)  # prescribed to the rope: it has no error of its own
        self._depths.look(self._history, None, None)
        found = (one.result() for one in (*self._tensions, *self._lengths, self._depths))
        return tuple(one for one in found if one is not None)

    def newest_ns(self) -> dict[str, int]:
        """Return the stamp of the newest accepted reading of each sensor group [ns]."""
        counters = (one.counter for one in self._groups)
        return {one.name: one.newest_ns for one in counters if one.newest_ns is not None}

    def health(self, now_ns: int) -> dict[str, InputHealth]:
        """Return the health of each sensor group that has sent anything."""
        if not self._heard:
            return {}
        for at, one in enumerate(self._winches):
            tells = () if self._motor_tells else (self._tensions[at],)
            doubts = [one.speed_doubt, *(part.doubt for part in (*tells, self._lengths[at]))]
            one.warning = "; ".join(words for words in doubts if words)
        if self._motor_tells:
            for motor, part in zip(self._motors, self._tensions, strict=True):
                motor.warning = part.doubt
        self._depth.warning = self._depths.doubt
        return {
            one.counter.name: one.health(now_ns, self.lead_s)
            for one in self._groups
            if one.counter.accepted or one.counter.refused
        }

    @property
    def _groups(self) -> tuple[Readings, ...]:
        return (*self._winches, *self._motors, self._depth)

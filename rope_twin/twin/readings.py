"""Checks of measured line out, line speed, tension and payload depth.

A reading whose stamp is out of order or of another clock is rejected. Each of its values is checked
separately, since a failing counter does not affect the load cell: a value is rejected if it is not
finite, out of the range of the scene's winch and rope, or a jump beyond the winch's speed limit;
the other values of the reading are accepted. After a gap longer than GAP_NS a change of any size is
possible: any value within the range is accepted, and one that the speed limit does not explain is
reported as a warning.

A counter that jumps to and fro would be accepted again after each gap. For a while after such a
warning, positions (line out or depth) that contradict the accepted ones for longer than GAP_NS make
the counter distrusted: its positions are rejected as unconfirmed until they have followed each
other within the speed limit for a time. This time is GAP_NS after the first warning and doubles
with each further one. It ends after DISTRUST_NS, or twice that time if this is longer, without a
warning.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections import deque
from typing import NamedTuple, Self

from rope_twin.errors import phrase
from rope_twin.scene.rigging import places, winch_of
from rope_twin.scene.schema import RopeLine, Scene, Winch
from rope_twin.twin.health import (
    AHEAD_NS,
    CLOCK_SAMPLES_MIN,
    CLOCK_WARN_S,
    SENDER_LEAD_S,
    UNJUDGED,
    InputCounter,
    too_far_ahead,
    too_late,
)
from rope_twin.twin.snapshot import InputHealth

WINCH_SENSORS, MOTOR, PAYLOAD = "winch", "motor", "payload"  # sources of a measurement
# groups of sensors, as `Snapshot.inputs` names them
WINCH_MEASURED, MOTOR_TENSION, PAYLOAD_DEPTH = "winch_measured", "motor_tension", "payload_depth"
Row = tuple[str, float | None, float | None, float | None]
Refusal = tuple[str, str, str]  # kind, problem and remedy
GAP_NS = 2_000_000_000  # after a longer gap a jump is not detected
DISTRUST_NS = 60_000_000_000
STALE_NS = 2_000_000_000
STALE_INTERVALS = 3.0  # intervals of a slow sensor after which it is stale
HISTORY_NS = 10_000_000_000  # readings later than this cannot be compared
SPEED_MARGIN = 1.25  # measured speed allowed over the winch's speed limit
JUMP_M = 0.2  # allowed sudden change of the line out: slip and resolution of a counter
MAX_SPEED_M_PER_S = 10.0  # line speed of a winch that can render or slip, and speed of a payload
DEPTH_JUMP_M, DEPTH_JUMP_SIGMAS = 5.0, 6.0  # scatter of acoustic positioning
MAX_HEIGHT_M = 50.0
SPEED_WINDOW_NS = 5_000_000_000  # over which line out and line speed are compared
SPEED_SCALE_TOL, SPEED_LAG_S = 0.1, 0.3  # allowed scale error and delay of the line speed
_OTHERS = "line speed", "tension"
TENSION_RANGE = -0.2, 2.0  # of the MBL: an offset may make an unloaded cell negative


class Measurement(NamedTuple):
    """Values measured at one instant; None: not measured.

    A row has the name of the winch ("": the only one), line out [m], line speed [m/s, + pays out]
    and tension [N]; of a payload its name ("": the only one) and depth [m, + down].
    """

    source: str  # WINCH_SENSORS (tension at the sheave), MOTOR or PAYLOAD
    stamp_ns: int
    rows: tuple[Row, ...]

    @classmethod
    def of_winch(
        cls,
        stamp_ns: int,
        line_out_m: float | None = None,
        speed_m_per_s: float | None = None,
        tension_n: float | None = None,
        winch: str = "",
    ) -> Self:
        """Return a reading of the sensors of one winch, with the tension at the sheave."""
        return cls(WINCH_SENSORS, stamp_ns, ((winch, line_out_m, speed_m_per_s, tension_n),))

    @classmethod
    def of_motor(cls, stamp_ns: int, tension_n: float, winch: str = "") -> Self:
        """Return a tension derived from the torque of a winch's motor."""
        return cls(MOTOR, stamp_ns, ((winch, None, None, tension_n),))

    @classmethod
    def of_depth(cls, stamp_ns: int, depth_m: float) -> Self:
        """Return a measured depth of the payload below the mean water level."""
        return cls(PAYLOAD, stamp_ns, (("", depth_m, None, None),))


class Readings(ABC):
    """Checks and counts of the readings of one group of sensors."""

    def __init__(self, name: str, topic: str) -> None:
        self.counter, self._topic = InputCounter(name), topic
        self._newest_ns: int | None = None
        self._interval_ns = 0
        # newest stamp and interval of position, speed and tension
        self._came: list[tuple[int, int] | None] = [None] * 3
        self._place: tuple[int, float] | None = None  # newest stamp and value of line out or depth
        self._heard: tuple[int, float] | None = None  # newest one, accepted or not
        self._steady_ns = 0  # since when readings have followed each other within the speed limit
        self._confirm_ns = 0  # time for which they must do so after a contradiction
        self._doubted_ns = 0  # stamp of the newest accepted position that no speed explains
        self._distrust = ""  # why readings are refused until they are confirmed
        self.warning = ""  # on the sensor itself, such as a frozen value
        self.speed_doubt = ""  # why the measured speed does not fit the measured position
        self._leads: deque[int] = deque(maxlen=CLOCK_SAMPLES_MIN)  # stamp minus arrival [ns]
        # of the last SPEED_WINDOW_NS: stamp, position [m], integral of speed [m], speed [m/s]
        self._ways: deque[tuple[int, float, float, float]] = deque()

    def invalidate(self) -> None:
        """Accept readings again that were known in advance, after a pause or a restart."""
        self._newest_ns = self._place = self._heard = None
        self._came = [None] * 3
        self._distrust = ""
        self._ways.clear()

    def take(
        self, stamp_ns: int, row: Row, now_ns: int, received_ns: int | None = None
    ) -> tuple[Row, str]:
        """Check a row; return it with None for each rejected value, and the first rejection or "".

        Of several rejected values in a row the first one is counted.

        received_ns: its arrival, to detect a clock that is ahead; None: unknown.
        """
        if received_ns is not None:
            self._leads.append(stamp_ns - received_ns)
        name, position, speed, tension = row
        fault = self._stamp_fault(stamp_ns, now_ns)
        if (position, speed, tension) == (None, None, None):
            remedy = "give at least one value that is not NaN"
            fault = "non_finite", "nothing is measured", remedy
        if fault:
            return (name, None, None, None), self._refuse(fault)
        each = (position, None, None), (None, speed, None), (None, None, tension)
        faults = [self._number_fault((name, *values)) for values in each]
        position, speed, tension = (
            None if fault else value for value, fault in zip(row[1:], faults, strict=True)
        )
        if position is not None and (fault := self._jump_fault(stamp_ns, position, now_ns)):
            position, faults = None, [fault, *faults]
        refusal = next((self._refuse(fault) for fault in faults if fault), "")
        accepted: Row = name, position, speed, tension
        if accepted[1:] != (None, None, None):
            self._accept(stamp_ns, accepted)
        return accepted, refusal

    def _accept(self, stamp_ns: int, row: Row) -> None:
        if self._newest_ns is not None:
            self._interval_ns = stamp_ns - self._newest_ns
        self._newest_ns = stamp_ns
        for k, (last, value) in enumerate(zip(self._came, row[1:], strict=True)):
            if value is not None:
                self._came[k] = stamp_ns, 0 if last is None else stamp_ns - last[0]
        if row[1] is not None:
            self._compare_speed(stamp_ns, row)
            self._place = stamp_ns, row[1]
        self.counter.accept(stamp_ns)

    def _refuse(self, fault: Refusal) -> str:
        kind, problem, remedy = fault
        return self.counter.refuse(kind, phrase(self._topic, problem, remedy))

    def _compare_speed(self, stamp_ns: int, row: Row) -> None:
        """Compare the change of the measured position with the integral of the measured speed."""
        _, position, speed, _ = row
        if position is None or speed is None:
            self.speed_doubt = ""
            return
        window = self._ways
        travel = 0.0
        if window:
            interval_s = (stamp_ns - window[-1][0]) * 1e-9
            travel = window[-1][2] + 0.5 * (window[-1][3] + speed) * interval_s
            if interval_s > GAP_NS * 1e-9:
                window.clear()
        window.append((stamp_ns, position, travel, speed))
        while stamp_ns - window[0][0] > SPEED_WINDOW_NS:
            window.popleft()
        since_ns, first_position, first_travel, _ = window[0]
        change, travel = position - first_position, travel - first_travel
        speeds = [entry[3] for entry in window]
        allowed = self._slip_m + SPEED_SCALE_TOL * abs(travel)
        allowed += SPEED_LAG_S * (max(speeds) - min(speeds))
        self.speed_doubt = ""
        if abs(change - travel) > allowed:
            self.speed_doubt = (
                f"in {(stamp_ns - since_ns) * 1e-9:.1f} s the {self._quantity} changed by "
                f"{change:+.2f} m, by the line speed {travel:+.2f} m: "
                "frozen, or another unit or sign?"
            )

    def _clock_doubt(self, lead_s: float) -> str:
        """Return the warning on a sensor's clock that is ahead, or "".

        Readings may arrive late (acoustic transmission takes seconds), but not before their stamps.
        """
        if len(self._leads) < CLOCK_SAMPLES_MIN:
            return ""
        ahead_s = min(self._leads) * 1e-9
        if ahead_s <= lead_s + CLOCK_WARN_S:
            return ""
        problem = f"stamps lie {ahead_s:.2f} s ahead of their arrival, {lead_s:g} s are allowed"
        return f"{problem}: the sensor's clock is ahead"

    def health(self, now_ns: int, lead_s: float = SENDER_LEAD_S) -> InputHealth:
        """Return counts, age and warnings; missing readings are no fault of the twin.

        lead_s: allowed to a sender, as a replay publishes a reading before its time.
        """
        doubts = self.warning, self._distrust, self._clock_doubt(lead_s)
        warnings = [text for text in doubts if text]
        if self._newest_ns is not None and self.stale(now_ns):
            gap_s = (now_ns - self._newest_ns) * 1e-9
            warnings.append(f"no reading for {gap_s:.1f} s; nothing is compared")
        else:
            warnings += [
                f"no {name} for {(now_ns - newest[0]) * 1e-9:.1f} s"
                for name, newest in zip((self._quantity, *_OTHERS), self._came, strict=True)
                if newest is not None and _is_stale(*newest, now_ns)
            ]
        judged = UNJUDGED._replace(warning="; ".join(warnings)) if warnings else UNJUDGED
        return self.counter.health(now_ns, False, judged)

    def stale(self, now_ns: int) -> bool:
        """Return whether readings have been missing for longer than is usual for the sensor."""
        newest_ns = self._newest_ns
        return newest_ns is not None and _is_stale(newest_ns, self._interval_ns, now_ns)

    def _number_fault(self, row: Row) -> Refusal | None:
        """Return why the numbers are rejected, or None."""
        values = (value for value in row[1:] if value is not None)
        invalid = next((value for value in values if not math.isfinite(value)), None)
        if invalid is not None:
            remedy = "give a finite number, or None (NaN in a message) for none"
            return "non_finite", f"a value of {invalid}", remedy
        return self._range_fault(row)

    @abstractmethod
    def _range_fault(self, row: Row) -> Refusal | None:
        """Return why a finite value is out of range, or None."""

    def _stamp_fault(self, stamp_ns: int, now_ns: int) -> Refusal | None:
        newest_ns, at = self._newest_ns, f"stamp {stamp_ns * 1e-9:.3f} s"
        if stamp_ns == newest_ns:
            return "repeated", f"{at} came twice", "each reading needs a stamp of its own"
        if stamp_ns < now_ns - HISTORY_NS:  # another clock, whatever the order
            return ("late", *too_late(stamp_ns, now_ns))
        if newest_ns is not None and stamp_ns < newest_ns:
            problem = f"{at} follows {newest_ns * 1e-9:.3f} s"
            return "late", problem, "readings must come in the order of their stamps"
        if stamp_ns > now_ns + AHEAD_NS:
            return ("impossible", *too_far_ahead(stamp_ns, now_ns))
        return None

    def _jump_fault(self, stamp_ns: int, position: float, now_ns: int) -> Refusal | None:
        """Return why a position after the last one is impossible, or None; warn after a gap."""
        last, self._heard = self._heard, (stamp_ns, position)
        if last is None or self._change(last, self._heard)[1]:
            self._steady_ns = stamp_ns
        if self._place is None:
            return None
        gap_ns = stamp_ns - self._place[0]
        quiet_ns = stamp_ns - self._doubted_ns
        if not self._distrust and quiet_ns > max(DISTRUST_NS, 2 * self._confirm_ns):
            self._confirm_ns = 0
        change, reason = self._change(self._place, self._heard)
        is_contradicted = gap_ns > GAP_NS and last is not None and last[0] > self._place[0]
        is_distrusted = self._confirm_ns > 0 and is_contradicted
        if not reason and not is_distrusted:
            return None
        problem = f"{self._quantity} changes by {change:+.2f} m in {gap_ns * 1e-9:.2f} s"
        if gap_ns <= GAP_NS:
            return "impossible", problem, reason
        steady_ns = stamp_ns - self._steady_ns
        if steady_ns < self._confirm_ns:
            self._distrust = f"{self._quantity} distrusted, as it jumps to and fro"
            steady = f"steady for {steady_ns * 1e-9:.1f} s after jumping to and fro"
            problem = f"{self._quantity} {steady}"
            remedy = f"accepted again after {self._confirm_ns * 1e-9:g} s without a jump"
            return "unconfirmed", problem, remedy
        self._confirm_ns = max(GAP_NS, 2 * self._confirm_ns)
        self._doubted_ns, self._distrust = stamp_ns, ""
        remedy = "; ".join(filter(None, (reason, "accepted after a gap: was the sensor reset?")))
        self.counter.warn(phrase(self._topic, problem, remedy), now_ns)
        return None

    def _change(self, before: tuple[int, float], after: tuple[int, float]) -> tuple[float, str]:
        """Return the change of position between readings [m], and why it is impossible or ""."""
        change, allowed = after[1] - before[1], self.reach_m((after[0] - before[0]) * 1e-9)
        return change, "" if abs(change) <= allowed else f"at most {allowed:.2f} m are possible"

    _quantity = ""
    _slip_m = math.inf  # allowed difference of position and integral of the speed

    @abstractmethod
    def reach_m(self, seconds: float) -> float:
        """Return the largest possible change of the position in a time [m]."""


def _is_stale(newest_ns: int, interval_ns: int, now_ns: int) -> bool:
    allowed_ns = max(STALE_NS, round(STALE_INTERVALS * min(interval_ns, AHEAD_NS)))
    return now_ns - newest_ns > allowed_ns


def fastest_m_per_s(winch: Winch | None) -> float:
    """Return the maximum line speed of a plausible reading [m/s]; 0 without a winch."""
    if winch is None:
        return 0.0
    if winch.drive or winch.passive_compensation:
        return MAX_SPEED_M_PER_S
    heave = winch.heave_compensation
    limit = winch.speed_limit_m_per_s + (heave.speed_limit_m_per_s if heave else 0.0)
    return SPEED_MARGIN * limit


class WinchReadings(Readings):
    """Readings of the sensors of one winch, or of its motor."""

    _quantity = "line out"

    def __init__(self, scene: Scene, line: RopeLine, source: str) -> None:
        """Make the checks for the winch at the upper end of a rope."""
        suffix = "" if line.from_ == scene.ropes[0].from_ else f" {line.from_}"
        is_motor = source == MOTOR
        name = MOTOR_TENSION if is_motor else WINCH_MEASURED
        super().__init__(name + suffix, "winch/motor_tension" if is_motor else "winch/measured")
        winch, counter = winch_of(scene, line), scene.measured.line_out
        self._max_m = line.length_m if winch is None else winch.max_line_out_m
        self._jump_m = self._slip_m = JUMP_M + counter.resolution_m
        self._bias_m = counter.bias_m
        self._speed = fastest_m_per_s(winch)
        self._loads = tuple(fraction * line.breaking_load_n for fraction in TENSION_RANGE)

    def _range_fault(self, row: Row) -> Refusal | None:
        _, line_out, speed, tension = row
        low_n, high_n = self._loads
        slack = self._jump_m
        if line_out is not None and not -slack <= line_out - self._bias_m <= self._max_m + slack:
            remedy = f"this winch has 0 to {self._max_m:g} m out; set unit, sign and zero of it"
            return "impossible", f"line out {line_out:g} m", remedy
        if speed is not None and abs(speed) > self._speed + JUMP_M:
            remedy = f"this line moves at {self._speed:g} m/s at most"
            return "impossible", f"line speed {speed:g} m/s", remedy
        if tension is not None and not low_n <= tension <= high_n:
            remedy = f"{low_n:.4g} to {high_n:.4g} N are possible for this rope"
            return "impossible", f"tension {tension:g} N", remedy
        return None

    def reach_m(self, seconds: float) -> float:
        return self._speed * seconds + self._jump_m


class DepthReadings(Readings):
    """Readings of the payload's depth."""

    _quantity = "depth"

    def __init__(self, scene: Scene) -> None:
        super().__init__("payload_depth", "payload/measured_depth")
        line, winch = scene.ropes[0], winch_of(scene, scene.ropes[0])
        max_length_m = line.length_m if winch is None else winch.max_line_out_m
        max_length_m += sum(other.length_m for other in scene.ropes[1:])
        lowest_z = min(position[2] for position in places(scene).values())
        self._sensor = scene.measured.payload_depth
        self._deepest_m = 1.2 * max_length_m - lowest_z + scene.ship.max_heave_m
        self._deepest_m += abs(self._sensor.bias_m)

    def _range_fault(self, row: Row) -> Refusal | None:
        depth = row[1]
        if depth is not None and not -MAX_HEIGHT_M <= depth <= self._deepest_m:
            remedy = f"give point.z up from the mean water level, {MAX_HEIGHT_M:g} m at most and "
            remedy += f"{-self._deepest_m:.4g} m at least for this rope"
            return "impossible", f"z of {-depth:g} m", remedy
        return None

    def reach_m(self, seconds: float) -> float:
        scatter = self._sensor.uncertainty(self._place[1] if self._place else 0.0) or 0.0
        return MAX_SPEED_M_PER_S * seconds + max(DEPTH_JUMP_M, DEPTH_JUMP_SIGMAS * scatter)

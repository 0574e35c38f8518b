"""Motion of the ship from the samples of a sensor: rates where it gives none, poses, and holes.

Rates are derived by the parabola through three samples at the middle one, so such a sample comes
one interval later. Nothing is derived across a hole: the samples on its sides are no neighbours.

With `fit_samples` above three each motion is that of the cubic that fits so many samples best, at
the middle one (Savitzky and Golay 1964). Of a wave with x = ω·T/2 over the span T of the samples it
keeps 1 - x⁴/280 of the position and 1 - x⁴/504 of the rate, and of white noise in n samples
1.5/√n.

Of two samples that arrive closer together than a fifth of the usual interval the first was held up
on its way, and its stamp by arrival is wrong: the second replaces it. So nothing is derived from a
sample that comes late before its successor is there.
"""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass

import numpy as np
from numpy.polynomial.polynomial import polyfit

from rope_twin.feeds.configuration import CRANE_TIP, NO_FIT, FeedSettings
from rope_twin.feeds.instrument import MotionSample
from rope_twin.twin.motion.ship_motion import (
    ShipPose,
    attitude,
    body_rates,
    sea_velocity,
    turned,
    with_rates,
)

Numbers = tuple[float, ...]
INTERVALS = 20  # whose median is the usual interval
SHORT_INTERVAL = 0.2  # of the usual one
LONG_INTERVAL = 1.5  # of it: one sample was lost or held up, as the next one shows
MIN_INTERVAL_NS = 2_000_000
NO_HEADING = "tss1", "tss3", "phtrh", "smc"  # formats without one, or without one in all sentences


@dataclass(frozen=True)
class HeaveOutput:
    """Heave of the crane tip."""

    stamp_ns: int
    heave_m: float
    heave_rate_m_per_s: float


MotionOutput = HeaveOutput | ShipPose


class MotionTrack:
    """Turns samples into what `ship/heave` or `ship/odometry` takes."""

    def __init__(self, settings: FeedSettings) -> None:
        self._of_crane_tip = settings.heave_of == CRANE_TIP
        self._rest_deg = settings.rest_heading_deg or 0.0
        self._hole_ns = round(settings.silent_after_s * 1e9)
        self._count = settings.fit_samples
        self._last: list[tuple[int, Numbers, float]] = []  # stamp, values, given rate of heave
        self._yaw_deg: float | None = None
        self._headed_ns: int | None = None  # stamp of the newest heading, or of the first sample
        self.heading_doubt = ""  # why the yaw is not the measured one
        self._is_headed = settings.format not in NO_HEADING
        self._intervals_ns: deque[int] = deque(maxlen=INTERVALS)
        self.replaced = 0  # samples that were held up on their way

    def take(self, sample: MotionSample) -> list[MotionOutput]:
        """Return the motions that this sample completes, in order."""
        if math.isnan(sample.heave_m):
            return []
        is_complete = self._of_crane_tip and not math.isnan(sample.heave_rate_m_per_s)
        if is_complete and self._count == NO_FIT:
            return [HeaveOutput(sample.stamp_ns, sample.heave_m, sample.heave_rate_m_per_s)]
        values: Numbers = (sample.heave_m,)
        if not self._of_crane_tip:
            if math.isnan(sample.roll_rad) or math.isnan(sample.pitch_rad):
                return []
            values = (*values, sample.roll_rad, sample.pitch_rad, self._yaw(sample))
        return self._derived((sample.stamp_ns, values, sample.heave_rate_m_per_s))

    def _derived(self, sample: tuple[int, Numbers, float]) -> list[MotionOutput]:
        """Return the motions whose rates can be derived with a further sample."""
        outputs: list[MotionOutput] = []
        usual_ns, late = self._usual_ns(), False
        if self._last:
            interval_ns = sample[0] - self._last[-1][0]
            late = 0 < interval_ns < max(MIN_INTERVAL_NS, SHORT_INTERVAL * usual_ns)
            if late:
                del self._last[-1]
                self.replaced += 1
            elif len(self._last) == self._count:
                outputs.append(self._middle())
            if not 0 < interval_ns <= self._hole_ns:
                self._last.clear()
            self._intervals_ns.append(interval_ns)
        self._last.append(sample)
        if len(self._last) == self._count:
            newest_ns = sample[0] - self._last[-2][0]
            if late or not usual_ns or newest_ns < LONG_INTERVAL * usual_ns:
                outputs.append(self._middle())
        return outputs

    def _usual_ns(self) -> float:
        """Return the usual interval of samples; 0: not known yet."""
        if len(self._intervals_ns) < INTERVALS // 4:
            return 0.0
        return float(sorted(self._intervals_ns)[len(self._intervals_ns) // 2])

    def _yaw(self, sample: MotionSample) -> float:
        """Return the yaw from the rest heading, counterclockwise and continuous [rad].

        The last one is kept, or that of the rest, where no heading is measured.
        """
        if math.isnan(sample.heading_deg):
            self._headed_ns = self._headed_ns or sample.stamp_ns
            missing_ns, known = sample.stamp_ns - self._headed_ns, self._yaw_deg is not None
            if missing_ns > self._hole_ns and (known or self._is_headed):
                kept = "the last one" if known else f"rest_heading_deg, {self._rest_deg:g}°,"
                self.heading_doubt = f"no heading for {missing_ns * 1e-9:.0f} s, {kept} is kept"
            return math.radians(self._yaw_deg or 0.0)
        self._headed_ns, self.heading_doubt = sample.stamp_ns, ""
        yaw = self._rest_deg - sample.heading_deg
        near = 0.0 if self._yaw_deg is None else self._yaw_deg
        self._yaw_deg = yaw - 360.0 * round((yaw - near) / 360.0)
        return math.radians(self._yaw_deg)

    def _middle(self) -> MotionOutput:
        """Return the motion at the middle sample, and drop the first."""
        stamp_ns, middle, measured_rate = self._last[self._count // 2]
        times_s = np.array([stamp - stamp_ns for stamp, _, _ in self._last]) * 1e-9
        samples = np.array([values for _, values, _ in self._last])
        del self._last[0]
        span_s = times_s[-1] - times_s[0]
        fit = polyfit(times_s / span_s, samples, 2 if self._count == NO_FIT else 3)
        rates = (fit[1] / span_s).tolist()
        if self._count > NO_FIT:
            middle = tuple(fit[0].tolist())
        if not math.isnan(measured_rate):
            rates[0] = measured_rate
        if self._of_crane_tip:
            return HeaveOutput(stamp_ns, middle[0], rates[0])
        return pose_of(stamp_ns, middle, rates, self._rest_deg)


def pose_of(stamp_ns: int, values: Numbers, rates: list[float], heading_deg: float) -> ShipPose:
    """Return the pose of heave [m], roll, pitch and yaw [rad] and their rates.

    The rotation is by yaw, then pitch, then roll about the ship's own axes, x to the bow; a pose is
    in the axes of `map`, to which the bow at rest has this true heading.
    """
    heave, roll, pitch, yaw = values
    bow = math.radians(90.0 - heading_deg)  # from east, counterclockwise
    x, y, z, w = attitude(roll, pitch, yaw)
    bow_rotation = (0.0, 0.0, math.sin(0.5 * bow), math.cos(0.5 * bow))
    orientation = (*turned(bow_rotation, (x, y, z)), w)
    pose = ShipPose(stamp_ns, (0.0, 0.0, heave), (0.0, 0.0, 0.0), orientation)
    spin = body_rates(roll, pitch, rates[1:])
    return with_rates(pose, (0.0, 0.0, rates[0]), turned(bow_rotation, spin))


def motion_of_pose(pose: ShipPose, heading_deg: float) -> MotionSample:
    """Return heave, roll, pitch and heading of a pose in the axes of `map`: `pose_of` reversed."""
    bow = math.radians(90.0 - heading_deg)
    east, north, up, w = pose.orientation
    back = (0.0, 0.0, -math.sin(0.5 * bow), math.cos(0.5 * bow))
    x, y, z = turned(back, (east, north, up))
    roll = math.atan2(2.0 * (w * x + y * z), 1.0 - 2.0 * (x * x + y * y))
    pitch = math.asin(max(-1.0, min(1.0, 2.0 * (w * y - z * x))))
    yaw = math.atan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z))
    heading = (heading_deg - math.degrees(yaw)) % 360.0
    rate = sea_velocity(pose)[2]
    return MotionSample(pose.stamp_ns, pose.position_m[2], rate, roll, pitch, heading)

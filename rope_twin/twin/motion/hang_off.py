"""Motion of the hang-offs from measured heave, or from ship poses and lever arms.

The first of the two that arrives moves the hang-off from then on; the other is rejected. A pose
moves it in three directions: heave by the track itself, east and north by two more tracks of the
same kind, with the same treatment of gaps, late samples and restarts. Where ropes leave the ship at
further points, each of those has an arm and three tracks of its own; heave moves all of them
equally.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace

from rope_twin.errors import phrase
from rope_twin.quantity import or_none
from rope_twin.scene.environment import reference_point_m
from rope_twin.scene.rigging import places
from rope_twin.scene.schema import Scene
from rope_twin.twin.health import (
    MIN_AGREEING_SAMPLES,
    STUCK_NS,
    UNJUDGED,
    InputAssessment,
    SenderClock,
    StuckDetector,
)
from rope_twin.twin.motion.heave_track import HEAVE_LIMIT_M, VELOCITY_LIMIT_M_PER_S, HeaveTrack
from rope_twin.twin.motion.plausibility import (
    NOISE_M,
    NOISE_RAD,
    PERSISTENT_NS,
    Continuity,
    MotionLimits,
    Numbers,
    RateCheck,
    SampleTiming,
    is_moved,
    needed_interval_s,
    shortest_period_s,
)
from rope_twin.twin.motion.ship_motion import (
    MAX_RATE_RAD_PER_S,
    UPRIGHT,
    ZERO_VECTOR,
    ShipPose,
    Vector3,
    hang_off_motion,
    is_finite,
    pose_fault,
    sea_velocity,
    turn_between,
    with_rates,
)
from rope_twin.twin.snapshot import InputHealth

MAX_DISTANCE_M = 1e5  # east or north of the initial position: a day's tow
UNLIMITED_M_PER_S = 1e6  # for tracks that take samples validated by another track
ASSESSMENT_NS = 200_000_000
REQUIRED_NS = 3_000_000_000  # time by which the first sample must have come


# by number of a rope other than the first: displacement [m] and velocity [m/s] of its hang-off
Moves = Mapping[int, tuple[Vector3, Vector3]]


def lever_arm(scene: Scene, position_m: Vector3 | None = None) -> Vector3:
    """Return the vector from the ship's reference point to a point on it, or the hang-off [m].

    Both are in the ship's mean position and attitude.

    Raises:
        InputError: the scene's RAO file is invalid.
    """
    x, y, z = position_m or scene.ship.hang_off_m
    a, b, c = reference_point_m(scene)
    return x - a, y - b, z - c


def arm_from_bow(scene: Scene) -> Vector3:
    """Return `lever_arm` of the hang-off in the axes of a ship with RAOs: forward, to port, up [m].

    Raises:
        InputError: the scene's RAO file is invalid.
    """
    on_waves = scene.sea_state.on_waves
    x, y, z = lever_arm(scene)
    heading = math.radians(0.0 if on_waves is None else on_waves.heading_deg)
    c, s = math.cos(heading), math.sin(heading)
    return c * x + s * y, c * y - s * x, z


class FurtherHangOff:
    """Hang-off of a rope other than the first, on a ship that is moved by poses."""

    def __init__(self, rope: int, arm_m: Vector3) -> None:
        self.rope, self._arm = rope, arm_m
        self._tracks = tuple(_unchecked_track() for _ in range(3))

    @property
    def tracks(self) -> tuple[HeaveTrack, ...]:
        """Tracks of its displacement east, north and up."""
        return self._tracks

    def submit(self, pose: ShipPose) -> None:
        """Record a pose that the first hang-off has accepted."""
        position, velocity = hang_off_motion(pose, self._arm)
        for track, value, speed in zip(self._tracks, position, velocity, strict=True):
            track.submit(pose.stamp_ns, value, speed)

    def at(self, time_ns: int, ramp: tuple[float, float]) -> tuple[Vector3, Vector3]:
        """Return displacement [m] and velocity [m/s] at a time, scaled by a ramp and its rate."""
        factor, rate = ramp
        (x, u), (y, v), (z, w) = (track.at(time_ns) for track in self._tracks)
        velocity = factor * u + rate * x, factor * v + rate * y, factor * w + rate * z
        return (factor * x, factor * y, factor * z), velocity


def _unchecked_track() -> HeaveTrack:
    """Return a track for samples that are validated elsewhere."""
    return HeaveTrack(2.0 * MAX_DISTANCE_M, UNLIMITED_M_PER_S)


class HangOffTrack(HeaveTrack):
    """Heave track that also takes poses, and validates the motion of the ship."""

    def __init__(self, scene: Scene) -> None:
        limits = MotionLimits.of(scene.ship)
        super().__init__(limits.heave_m, limits.speed_m_per_s)
        self._arm = lever_arm(scene)
        positions = places(scene)
        self._further = tuple(
            FurtherHangOff(number, lever_arm(scene, positions[line.from_]))
            for number, line in enumerate(scene.ropes)
            if number and line.from_ in positions
        )
        self._aside = (_unchecked_track(), _unchecked_track())
        self.posed = False  # whether poses move the hang-off
        self.clock = SenderClock()
        self._moved = is_moved(scene)  # the scene's sea moves it: samples must come and vary
        self._on_way = bool(scene.sea_state.path)  # prescribed motion, which may pause
        self._prescribed = False  # computed by the caller: checked for order and range only
        self._stuck, self._is_stuck = StuckDetector(), False
        self._continuity = Continuity(limits)
        speed, acceleration = limits.speed_m_per_s, limits.acceleration_m_per_s2
        self._rates = RateCheck(NOISE_M, speed, acceleration)
        self._turns = RateCheck(NOISE_RAD, MAX_RATE_RAD_PER_S, MAX_RATE_RAD_PER_S)
        self._judged_ns, self._judged = -ASSESSMENT_NS, UNJUDGED
        self._turned: Vector3 = ZERO_VECTOR  # sum of the rotation vectors between poses
        self._orientation = UPRIGHT  # of the newest pose
        self._timing = SampleTiming(needed_interval_s(shortest_period_s(scene)))

    @property
    def _followers(self) -> tuple[HeaveTrack, ...]:
        """Tracks that take the samples which this one has validated."""
        others = (track for further in self._further for track in further.tracks)
        return (*self._aside, *others)

    def prescribe(self) -> None:
        """Accept motion as computed: heave is not checked for plausibility, poses may rest."""
        self._prescribed = True
        self._limit_m, self._speed_limit = HEAVE_LIMIT_M, VELOCITY_LIMIT_M_PER_S

    def invalidate(self) -> None:
        """Invalidate samples that were known in advance, as the sender was interrupted."""
        super().invalidate()
        self.clock.expect_repeats()
        for track in self._followers:
            track.invalidate()

    def drop(self) -> None:
        """Drop all samples and the last position: the next ones are joined as after a gap."""
        super().drop()
        self._continuity.forget()
        for check in (self._rates, self._turns):
            check.forget()

    def submit(
        self,
        stamp_ns: int,
        position_m: float,
        velocity_m_per_s: float,
        received_ns: int | None = None,
    ) -> str:
        """Submit a heave sample; return "" or the reason for its rejection.

        received_ns: its arrival by the receiver's clock in twin time; None: unknown.
        """
        if self.posed:
            remedy = "let only one of ship/heave and ship/odometry be published"
            problem = "the ship's pose moves the hang-off already"
            return self.counter.refuse("impossible", phrase("heave", problem, remedy))
        if self._prescribed:
            return super().submit(stamp_ns, position_m, velocity_m_per_s)
        if refusal := self._clock_fault(stamp_ns, received_ns, "heave"):
            return refusal
        stamp_ns += self._shift_ns(received_ns)
        sample = (position_m, velocity_m_per_s)
        if self._in_doubt and self._is_repeated(stamp_ns, sample):
            return ""
        is_possible = abs(position_m) <= self._limit_m and math.isfinite(velocity_m_per_s)
        fault = "" if is_possible else self._number_fault(position_m, velocity_m_per_s)
        fault = fault or self._fault(stamp_ns, sample, sample[1:], (position_m,), "heave")
        if fault:
            return fault
        rates = self._rates.rates(stamp_ns, (position_m,), (velocity_m_per_s,))
        if rates is None:
            return self._number_fault(position_m, velocity_m_per_s) or self._refuse_sudden_rate(
                "heave"
            )
        return self._accept_sample(stamp_ns, (position_m,), rates, "heave")

    def submit_pose(self, pose: ShipPose, received_ns: int | None = None) -> str:
        """Submit a ship pose; return "" or the reason for its rejection."""
        if refusal := self._clock_fault(pose.stamp_ns, received_ns, "ship pose"):
            return refusal
        pose = replace(pose, stamp_ns=pose.stamp_ns + self._shift_ns(received_ns))
        fault = self._pose_fault(pose)
        if fault:
            kind = "impossible" if is_finite(pose) else "non_finite"
            return self.counter.refuse(kind, fault)
        position, velocity = hang_off_motion(pose, self._arm)
        if self._in_doubt and self._is_repeated(pose.stamp_ns, (position[2], velocity[2])):
            self._follow(pose, position, velocity)
            return ""
        sent_rates = (*pose.velocity_m_per_s, *pose.rate_rad_per_s)
        numbers = (*pose.position_m, *pose.orientation, *sent_rates)
        fault = self._pose_range(position) or self._fault(
            pose.stamp_ns, numbers, sent_rates, position, "ship pose"
        )
        if fault:
            return fault
        checked = self._with_checked_rates(pose)
        if checked is None:
            fault = pose_fault(pose) or self._too_fast(velocity)
            return (
                self.counter.refuse("impossible", fault)
                if fault
                else self._refuse_sudden_rate("ship pose")
            )
        if checked is not pose:
            velocity = hang_off_motion(checked, self._arm)[1]
        fault = self._accept_sample(checked.stamp_ns, position, velocity, "ship pose")
        if not fault:
            self._follow(checked, position, velocity)
        return fault

    def _fault(
        self, stamp_ns: int, numbers: Numbers, rates: Numbers, position: Numbers, input_name: str
    ) -> str:
        """Return why a sample with finite numbers is rejected but for its rates, counted; or ""."""
        if fault := self._stamp_fault(stamp_ns):
            return fault
        stuck = self._stuck.is_stuck(stamp_ns, numbers)
        never_moved = not (self._moved or self._stuck.varied)
        is_at_rest = not any(rates) and (self._on_way or never_moved)
        self._is_stuck = stuck and not (is_at_rest or self._prescribed)
        if self._is_stuck:
            problem = f"all its numbers have been the same for {STUCK_NS * 1e-9:g} s or more"
            remedy = "the sender is stuck; restart it"
            return self.counter.refuse("stuck", phrase(input_name, problem, remedy))
        was_confirmed = self._continuity.confirmed
        kind, reason = self._continuity.fault(stamp_ns, position, self._rates.noise)
        if self._continuity.confirmed and not was_confirmed:  # no rate leads to the new position
            self._rates.forget()
            self._turns.forget()
        return self.counter.refuse(kind, phrase(input_name, *reason)) if reason else ""

    def _accept_sample(
        self, stamp_ns: int, position: Numbers, rates: Numbers, input_name: str
    ) -> str:
        """Accept a sample with checked rates; return "" or why its acceleration is rejected."""
        if self._rates.switched or self._turns.switched:
            self._continuity.forget_rates()
        noise = self._rates.derived_noise
        if reason := self._continuity.acceleration_fault(stamp_ns, rates, noise):
            return self.counter.refuse("impossible", phrase(input_name, *reason))
        if self._continuity.confirmed:
            self._drop_samples()
        self._continuity.accept(stamp_ns, position, rates)
        self._timing.take(stamp_ns, self._asked_ns or 0, self.missing_ns)
        self._append(stamp_ns, position[-1], rates[-1])
        return ""

    def _follow(self, pose: ShipPose, position: Vector3, velocity: Vector3) -> None:
        """Pass an accepted pose to the lateral tracks and the further hang-offs."""
        if not self.posed:
            self._begin_poses()
        for track, value, speed in zip(self._aside, position, velocity, strict=False):
            track.submit(pose.stamp_ns, value, speed)
        for further in self._further:
            further.submit(pose)

    def _clock_fault(self, stamp_ns: int, received_ns: int | None, input_name: str) -> str:
        """Check the sender's clock; return why the sample is not yet confirmed, counted; or ""."""
        if received_ns is None:
            return ""
        if not (step_s := self.clock.take(stamp_ns, received_ns)):
            return ""
        problem = f"its stamp has stepped by {step_s:+.2f} s against its arrival"
        remedy = f"it is taken once {MIN_AGREEING_SAMPLES} samples agree on it"
        return self.counter.refuse("unconfirmed", phrase(input_name, problem, remedy))

    def _shift_ns(self, received_ns: int | None) -> int:
        """Return the correction of the newest sample's stamp [ns]; blend over a gap from it."""
        if received_ns is None:
            return 0
        shift_ns, is_broken = self.clock.shift_ns()
        if is_broken:
            self.drop()
            self._drop_samples()
        if mended := self.clock.mended:
            self.counter.warn(mended, received_ns)
            self.clock.mended = ""
        return shift_ns

    def _drop_samples(self) -> None:
        """Join the next samples as after a gap, in all directions and at all hang-offs."""
        super().drop()
        for track in self._followers:
            track.drop()

    def _with_checked_rates(self, pose: ShipPose) -> ShipPose | None:
        """Return the pose with rates that agree with its positions; None: they are impossible."""
        turn = turn_between(self._orientation, pose.orientation)
        self._orientation = pose.orientation
        self._turned = _sum(self._turned, turn)
        sent = sea_velocity(pose)
        velocity = self._rates.rates(pose.stamp_ns, pose.position_m, sent)
        turn_rate = self._turns.rates(pose.stamp_ns, self._turned, pose.rate_rad_per_s)
        if velocity is None or turn_rate is None:
            return None
        if velocity is sent and turn_rate is pose.rate_rad_per_s:
            return pose
        return with_rates(pose, _vector(velocity), _vector(turn_rate))

    def _pose_range(self, position: Vector3) -> str:
        """Return why the position of the hang-off is out of range, counted; or ""."""
        if abs(position[2]) > self._limit_m:
            problem = f"the hang-off {position[2]:g} m above its rest"
            remedy = f"a ship stays within ±{self._limit_m:g} m (ship.max_heave_m)"
        elif max(abs(position[0]), abs(position[1])) > MAX_DISTANCE_M:
            problem = f"the hang-off {position[0]:g} m east and {position[1]:g} m north of its rest"
            remedy = f"right is within {MAX_DISTANCE_M:g} m"
        else:
            return ""
        return self.counter.refuse("impossible", phrase("ship pose", problem, remedy))

    def _too_fast(self, velocity: Vector3) -> str:
        if max(abs(component) for component in velocity) <= self._speed_limit:
            return ""
        problem = f"the hang-off moving at {max(abs(component) for component in velocity):g} m/s"
        remedy = f"a ship stays within ±{self._speed_limit:g} m/s"
        return phrase("ship pose", problem, remedy)

    def _refuse_sudden_rate(self, input_name: str) -> str:
        """Reject a sample whose rates changed too suddenly, when no others can be derived."""
        problem = "its rate changes faster than a ship can, and too few positions are known"
        remedy = "position and rate must be of one motion"
        return self.counter.refuse("impossible", phrase(input_name, problem, remedy))

    def _begin_poses(self) -> None:
        """Start motion by poses; up to now the hang-off had no lateral motion."""
        self.posed = True
        for track in self._followers:
            track.rest_until(self._asked_ns)

    def health(self, now_ns: int) -> InputHealth:
        """Return the health of the input and of its sender.

        The sender is assessed every ASSESSMENT_NS of twin time.
        """
        if now_ns - self._judged_ns >= ASSESSMENT_NS or now_ns < self._judged_ns:
            self._judged_ns, self._judged = now_ns, self._assess(now_ns)
        return self.counter.health(now_ns, self.stale(now_ns), self._judged)

    def _assess(self, now_ns: int) -> InputAssessment:
        clock, clock_is_wrong = self.clock.fault()
        faults: list[str] = []
        warnings: list[str] = []
        accepted, refused = self.counter.accepted, self.counter.refused
        if self._is_stuck:
            faults.append("the sender is stuck: its numbers do not change")
        if accepted == 0 and refused:
            faults.append(f"every one of {refused} samples was refused")
        elif accepted == 0 and self._moved and now_ns >= REQUIRED_NS:
            faults.append(
                f"nothing has come for {now_ns * 1e-9:.0f} s, and the scene's sea moves the ship"
            )
        for check, names in ((self._rates, "position and velocity"),
                             (self._turns, "orientation and rate of turn")):  # fmt: skip
            if check.disagrees:
                message = f"{names} disagree: the rate is derived from positions"
                is_persistent = check.disagrees_for_s() >= PERSISTENT_NS * 1e-9
                (faults if is_persistent else warnings).append(message)
        if self._rates.scatters:
            warnings.append(
                f"its positions scatter by {self._rates.scatter:.2f} m, as of noise or of several "
                "senders"
            )
        elif self._rates.is_jittery:
            warnings.append(
                f"its positions scatter by at least {self._rates.jitter:.2f} m/s over an interval, "
                "which the rope feels: repeated samples, coarse digits or noise; send each sample "
                "once, with more digits, fewer a second, or fitted (fit_samples of a feed)"
            )
        if clock:
            (faults if clock_is_wrong else warnings).append(clock)
        if slow := self._timing.fault(self.clock.lateness_s):
            warnings.append(slow)
        if self._rejoining(now_ns):
            warnings.append(f"the motion is led over to the samples in {self._rejoin_s:.3g} s")
        measured = or_none(self.clock.offset_s), or_none(self._timing.interval_s)
        return InputAssessment("; ".join(faults), "; ".join(warnings), *measured)

    def lateral_at(self, time_ns: int) -> tuple[tuple[float, float], tuple[float, float]]:
        """Return displacement [m] and velocity [m/s], east and north, at a time; after `at`."""
        east, north = self._aside
        return east.at(time_ns), north.at(time_ns)

    def further_at(self, time_ns: int, ramp: tuple[float, float]) -> Moves:
        """Return the motion by poses of the other ropes' hang-offs at a time; empty without poses.

        ramp: build-up factor of the motion, and its rate [1/s].
        """
        if not self.posed:
            return {}
        return {further.rope: further.at(time_ns, ramp) for further in self._further}

    def _pose_fault(self, pose: ShipPose) -> str:
        """Return why a pose is rejected except for its rates; or ""."""
        if not self.posed and self.counter.newest_ns is not None:
            problem = "heave moves the hang-off already"
            remedy = "let only one of ship/heave and ship/odometry be published"
            return phrase("ship pose", problem, remedy)
        if not is_finite(pose):
            return pose_fault(pose)
        return pose_fault(replace(pose, rate_rad_per_s=ZERO_VECTOR))


def _sum(a: Vector3, b: Vector3) -> Vector3:
    return a[0] + b[0], a[1] + b[1], a[2] + b[2]


def _vector(numbers: Numbers) -> Vector3:
    x, y, z = numbers
    return x, y, z

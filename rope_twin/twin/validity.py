"""Range in which a scene's model holds, and validity of its convergence study, during a run.

Each finding outside the range has a value for the validity of the quality index (twin/quality.py)
and states what the model does not contain. The scene's own warnings apply to the whole run, unless
the scene accepts them; all else is checked at snapshots. Nothing here has an effect on the twin.

A convergence study states the discretisation error of one run: the scene from its static
equilibrium, with its own sea, winch schedule and current, for the duration of the study. A twin
with the same inputs passes through the same phases of the lift (splash zone, landing) at the same
time, so its error is known as long as no other input has come and the duration has not passed. From
the first difference on the state itself is different: the error stays unknown for the rest of the
run, and for every run that resumes from it. No allowance is made beyond the duration.

All of this is a function of twin time and accepted inputs, so a real-time run, an offline run and a
replay publish the same error; it is part of a saved state.
"""

from __future__ import annotations

import functools
import math
import operator
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any, NamedTuple, Protocol

import numpy as np

from rope_twin.effects.current import profile_of
from rope_twin.effects.line_contact import LineContactParams
from rope_twin.effects.payload import SplashZoneParams
from rope_twin.effects.rigid_body import RigidBodyParams
from rope_twin.effects.seabed import SeabedParams
from rope_twin.effects.waves import WavesParams
from rope_twin.scene.convergence import scene_digest
from rope_twin.scene.error_bound import KnownError
from rope_twin.scene.instruments import PRIOR_SIGMAS
from rope_twin.scene.rigging import is_joined
from rope_twin.scene.rope_warnings import validity_warnings
from rope_twin.scene.schema import Scene
from rope_twin.scene.shapes import payload_figures
from rope_twin.scene.water_warnings import is_air
from rope_twin.twin.contact import payload_motions
from rope_twin.twin.motion.ship_motion import ZERO_VECTOR, ShipPose
from rope_twin.twin.snapshot import Snapshot

LINE_FOLLOWING = "line_following"  # input of a winch that follows its measured line
DOUBTED, OUTSIDE = 0.6, 0.5  # values for an error of unknown size, and for an expected error
PENETRATION_M = 0.5, 2.0  # of a payload in an elastic bed: from 1 to 0
LINE_TOL_M = 0.5  # of the measured line out beyond the winch's range
SPEED_TOL = 1.1  # of the measured line speed over the winch's limit
# minimum speed of a current extended below its last row, and of that extent over the depth
EXTENDED_M_PER_S, EXTENDED_FRACTION = 0.25, 0.1
MOTION_TOL = 1e-6  # m, m/s, rad/s: a sample that differs by less matches the scene's sea
MISSING_NS = 500_000_000  # the sea counts as missing after this time without a sample
TIME_TOL_NS = 1_000
CUT_REASON = "the rope was cut"
OTHER_SCHEDULE = "it resumes from a run with another schedule or sea"


class Finding(NamedTuple):
    """Reason for leaving the model's range, and how far results may be relied on there, 0 to 1."""

    value: float
    reason: str


def falling(value: float, good: float, bad: float) -> float:
    """Return 1 up to `good`, 0 from `bad` on, and linear between them."""
    return min(1.0, max(0.0, (bad - value) / (bad - good)))


class ModelRange:
    """Range of one scene's model; it has no state."""

    def __init__(self, scene: Scene) -> None:
        """Read the scene.

        Raises:
            SceneError: the payload's properties are incomplete.
        """
        self._standing = _standing(scene)
        self._winch = scene.winch
        self._surfacing = _half_heights(scene)
        waves, bed = scene.listed(WavesParams), scene.listed(SeabedParams)
        self._water_m = waves.depth_m if waves is not None and bed is None else None
        self._touching = scene.listed(LineContactParams) is not None
        self._prior = scene.learning

    def outside(
        self, snapshot: Snapshot, effects: tuple[Any, ...], factors: Mapping[str, float]
    ) -> Iterator[Finding]:
        """Yield the findings outside the range.

        effects: kernel data in use of the first rope; factors: learned ones on the scene's figures.
        """
        yield from self._standing
        yield from self._at_the_surface(snapshot)
        yield from self._below_the_bed(snapshot)
        yield from self._beyond_the_winch(snapshot)
        yield from _below_the_profile(snapshot, effects)
        if snapshot.lines is not None and snapshot.lines.crossings and not self._touching:
            at_m = snapshot.lines.crossings[0].depth_m
            text = f"the lines cross at {at_m:.0f} m; contact between them is not modelled"
            yield Finding(DOUBTED, text)
        for name, factor in factors.items():
            sigma = 0.01 * getattr(self._prior, f"{name}_pct", math.inf)
            if abs(math.log(factor)) > PRIOR_SIGMAS * sigma:
                text = f"the learned {name.replace('_', ' ')} is {factor:.3g} times the scene's"
                yield Finding(DOUBTED, f"{text}: another lift than the one prepared")

    def _at_the_surface(self, snapshot: Snapshot) -> Iterator[Finding]:
        positions = {payload.name: payload.position_m for payload in snapshot.payloads}
        for name, half_m in self._surfacing.items():
            z = float(positions.get(name, snapshot.payload_position_m)[2])
            if z > -half_m:
                text = f"payload '{name}' is at the surface, z = {z:.1f} m, without `splash_zone`"
                yield Finding(OUTSIDE, text)

    def _below_the_bed(self, snapshot: Snapshot) -> Iterator[Finding]:
        depths = [-float(position[2]) for position, _ in payload_motions(snapshot, 1)]
        depth_m = max(depths)
        if self._water_m is not None and depth_m > self._water_m:
            yield Finding(
                0.0, f"the payload is at {depth_m:.1f} m in water {self._water_m:g} m deep"
            )
        if snapshot.seabed is None:
            return
        penetration_m = -snapshot.seabed.payload_height_m
        if penetration_m > PENETRATION_M[0]:
            text = f"the payload is {penetration_m:.1f} m in the seabed, whose model is elastic"
            yield Finding(falling(penetration_m, *PENETRATION_M), text)
        heights = (height_m for height_m, _ in snapshot.seabed.payloads)
        bed_m = max(map(operator.add, depths, heights))
        for residual in snapshot.residuals:
            beyond_m = residual.measured - bed_m - (residual.half_width or 0.0)
            if residual.quantity == "payload_depth_m" and beyond_m > PENETRATION_M[0]:
                text = f"the measured depth, {residual.measured:.1f} m, is below the scene's seabed"
                yield Finding(OUTSIDE, f"{text} at {bed_m:.1f} m")

    def _beyond_the_winch(self, snapshot: Snapshot) -> Iterator[Finding]:
        """Check the line of a winch that follows measurements; commands are limited elsewhere."""
        winch = self._winch
        if winch is None or snapshot.cut is not None or LINE_FOLLOWING not in snapshot.inputs:
            return
        low_m, high_m = winch.min_line_out_m - LINE_TOL_M, winch.max_line_out_m + LINE_TOL_M
        if not low_m <= snapshot.line_out_m <= high_m:
            text = f"line out of {snapshot.line_out_m:.1f} m, the scene's winch has "
            text += f"{winch.min_line_out_m:g} to {winch.max_line_out_m:g} m"
            yield Finding(DOUBTED, text)
        speed = abs(snapshot.payout_speed_m_per_s)
        if speed > SPEED_TOL * winch.speed_limit_m_per_s:
            text = f"line speed of {speed:.2f} m/s, the scene's winch has at most "
            yield Finding(DOUBTED, f"{text}{winch.speed_limit_m_per_s:g} m/s")


def _below_the_profile(snapshot: Snapshot, effects: tuple[Any, ...]) -> Iterator[Finding]:
    """Check whether a measured current ends far above the payload with a speed above zero."""
    current, profile = snapshot.inputs.get("current"), profile_of(effects)
    if current is None or not current.accepted or profile is None:
        return
    last_m, end_m = float(profile.z[0]), float(snapshot.payload_position_m[2])
    speed = float(np.hypot(*(row[0] for row in profile.U[:2])))
    if speed > EXTENDED_M_PER_S and last_m - end_m > -EXTENDED_FRACTION * end_m > 0.0:
        text = f"the current ends at z = {last_m:g} m with {speed:.2f} m/s, which is used down to "
        yield Finding(DOUBTED, f"{text}the payload at z = {end_m:.0f} m")


@functools.lru_cache(maxsize=8)
def _standing(scene: Scene) -> tuple[Finding, ...]:
    """Return a finding for each warning of the scene on what its model does not contain."""
    warnings = (warning.removesuffix(".") for warning in validity_warnings(scene))
    return tuple(Finding(DOUBTED, f"the scene warns: {warning}") for warning in warnings)


def _half_heights(scene: Scene) -> dict[str, float]:
    """Return half the height of each payload whose passage through the surface is not modelled [m].

    It is that of a cube of the same volume. Empty: it is modelled, or there is no water.
    """
    modelled = any(isinstance(e, SplashZoneParams | RigidBodyParams) for e in scene.effects)
    if modelled or is_air(scene):
        return {}
    unmodelled = list(scene.payloads[:1])
    if is_joined(scene):
        unmodelled = [payload for payload in scene.payloads if payload.splash_zone is None]
    density = scene.environment.water_density_kg_per_m3
    volumes_m3 = {one.name: payload_figures(one, density).volume_m3 for one in unmodelled}
    return {name: 0.5 * volume_m3 ** (1.0 / 3.0) for name, volume_m3 in volumes_m3.items()}


@dataclass(frozen=True)
class HeaveSample:
    """Sample of the hang-off's motion in simulation time."""

    stamp_ns: int  # since the twin's start
    position_m: float  # up, above the rest position
    velocity_m_per_s: float
    elevation_m: float | None  # water surface at the ship, where the record has it
    pose: ShipPose | None = None  # of the ship, where that is what moves the hang-off
    lateral: tuple[float, float, float, float] | None = None  # then: x, y [m], their rates [m/s]


class SceneMotion(Protocol):
    """Motion by the scene's own sea, in twin time."""

    def between(self, from_ns: int, to_ns: int) -> list[HeaveSample]:
        """Return the samples with from_ns <= stamp_ns < to_ns, in order; each stamp once."""


class StudyValidity:
    """Validity of the scene's convergence study for one run; `claim` gives the error that holds."""

    def __init__(self, scene: Scene) -> None:
        self._moves = scene.sea_state.moves
        self.digest = scene_digest(scene)  # a run may resume in a scene with another schedule
        self._why = self._stated = ""  # latched: first reason, and first reason set by `invalidate`
        self._agreed_ns: int | None = None  # stamp of the newest sample that matches the sea
        self._strange: tuple[int, str] | None = None  # time and message of the first difference

    def invalidate(self, why: str) -> None:
        """Mark the error as unknown from now on; the first reason is kept."""
        self._stated = self._stated or why
        self._why = self._why or why

    def resume(self, digest: str) -> None:
        """Continue from a saved state in a scene with this digest."""
        if digest != self.digest:
            self.invalidate(OTHER_SCHEDULE)
            self.digest = digest

    def compare_heave(
        self,
        scene_motion: SceneMotion | None,
        stamp_ns: int,
        position_m: float,
        velocity_m_per_s: float,
    ) -> None:
        """Compare an accepted heave sample with the scene's own sea.

        scene_motion: None if the sea is unknown here; nothing is then compared, unless the scene
        has no motion.
        """
        if scene_motion is None and self._moves:
            return
        expected, sample = self._expected(scene_motion, stamp_ns), (position_m, velocity_m_per_s)
        if isinstance(expected, ShipPose):
            self._record_match(stamp_ns, not self._moves and _matches((0.0, 0.0), sample))
        else:
            self._record_match(stamp_ns, expected is not None and _matches(expected, sample))

    def compare_pose(self, scene_motion: SceneMotion | None, pose: ShipPose) -> None:
        """Compare an accepted pose with the scene's sea; scene_motion: as in `compare_heave`."""
        if scene_motion is None and self._moves:
            return
        expected = self._expected(scene_motion, pose.stamp_ns)
        matches = isinstance(expected, ShipPose) and _matches(
            pose_numbers(expected), pose_numbers(pose)
        )
        self._record_match(pose.stamp_ns, matches)

    def _expected(
        self, scene_motion: SceneMotion | None, stamp_ns: int
    ) -> ShipPose | tuple[float, float] | None:
        """Return the sea's own pose, or heave and its rate, at this stamp; None: no sample."""
        if scene_motion is None:
            return ShipPose(stamp_ns, ZERO_VECTOR, ZERO_VECTOR)
        for sample in scene_motion.between(stamp_ns, stamp_ns + 1):
            return sample.pose or (sample.position_m, sample.velocity_m_per_s)
        return None

    def _record_match(self, stamp_ns: int, matches: bool) -> None:
        """Record whether a sample matches; the motion differs after the last matching sample."""
        if matches:
            self._agreed_ns = stamp_ns
        elif self._strange is None:
            since_ns = 0 if self._agreed_ns is None else max(self._agreed_ns, 0)
            reason = f"the ship's motion is not the scene's own sea from {since_ns * 1e-9:.2f} s on"
            self._strange = (since_ns, reason)

    def observe(self, snapshot: Snapshot, compared: bool) -> None:
        """Check the inputs at a snapshot; compared: motion was compared, or is the sea itself."""
        now_ns = snapshot.stamp_ns
        if self._why or now_ns == 0:
            return
        for winch in snapshot.winches:
            if winch.off_schedule_s is not None:
                since = f"{winch.off_schedule_s:.2f} s on"
                self._latch(f"winch commands differ from the scene's schedule from {since}")
        if self._strange is not None and now_ns > self._strange[0]:
            self._latch(self._strange[1])
        if self._moves:
            self._check_sea(snapshot, compared)

    def _check_sea(self, snapshot: Snapshot, compared: bool) -> None:
        """Check that samples of the scene's sea arrive and were compared."""
        heave, is_late = snapshot.inputs.get("heave"), snapshot.stamp_ns > MISSING_NS
        if not compared:
            self._latch("the ship's motion was not compared with the scene's own sea")
        elif heave is not None and (heave.stale or (heave.accepted == 0 and is_late)):
            self._latch(f"samples of the scene's sea are missing at {snapshot.time_s:.2f} s")

    def _latch(self, reason: str) -> None:
        self._why = self._why or reason

    def claim(self, known: KnownError, time_ns: int) -> KnownError:
        """Return the error known from the study, or why it is unknown for this run at this time."""
        is_unknown = math.isnan(known.rms_pct) and math.isnan(known.peak_pct)
        if reason := self._stated if is_unknown else self._why:
            return KnownError(words=f"unknown: {reason}")
        if is_unknown:
            return known
        if time_ns > known.seconds * 1e9 + TIME_TOL_NS:
            return KnownError(words=f"unknown: {beyond(known.seconds)}")
        return known


def beyond(seconds: float) -> str:
    """Return the message for a run longer than its convergence study."""
    return f"the study's run ended at {seconds:g} s"


def pose_numbers(pose: ShipPose) -> tuple[float, ...]:
    """Return position, velocity, orientation and rate of turn of a pose, 13 numbers."""
    return (
        *pose.position_m, *pose.velocity_m_per_s, *pose.orientation, *pose.rate_rad_per_s,
    )  # fmt: skip


def _matches(first: tuple[float, ...], second: tuple[float, ...]) -> bool:
    return all(abs(a - b) <= MOTION_TOL for a, b in zip(first, second, strict=True))

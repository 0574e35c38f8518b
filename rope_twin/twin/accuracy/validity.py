"""Validity of a convergence study for a run: one rule for every display.

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

import math
from collections.abc import Sequence
from typing import Protocol

from rope_twin.scene.card import KnownError, scene_digest
from rope_twin.scene.schema import Scene
from rope_twin.twin.motion.ship_pose import STILL, ShipPose
from rope_twin.twin.snapshot import Snapshot

MOTION_TOL = 1e-6  # m, m/s, rad/s: a sample that differs by less matches the scene's sea
UNHEARD_NS = 500_000_000  # the sea counts as missing after this time without a sample
TIME_TOL_NS = 1_000
CUT_REASON = "the rope was cut"
OTHER_SCHEDULE = "it resumes from a run with another schedule or sea"


class MotionSample(Protocol):
    """One sample of the hang-off's heave, with the ship's pose if that moves the hang-off."""

    @property
    def position_m(self) -> float:
        """Heave [m]."""

    @property
    def velocity_m_per_s(self) -> float:
        """Heave rate [m/s]."""

    @property
    def pose(self) -> ShipPose | None:
        """The ship's pose; None: heave alone."""


class SceneMotion(Protocol):
    """Motion by the scene's own sea, in twin time."""

    def between(self, from_ns: int, to_ns: int) -> Sequence[MotionSample]:
        """Return the samples with from_ns <= stamp_ns < to_ns, in order."""


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

    def hear_heave(
        self, own: SceneMotion | None, stamp_ns: int, position_m: float, velocity_m_per_s: float
    ) -> None:
        """Compare an accepted heave sample with the scene's own sea.

        own: None if the sea is unknown here; nothing is then compared, unless the scene has no
        motion.
        """
        if own is None and self._moves:
            return
        expected, heard = self._expected(own, stamp_ns), (position_m, velocity_m_per_s)
        if isinstance(expected, ShipPose):
            self._judge(stamp_ns, not self._moves and _near((0.0, 0.0), heard))
        else:
            self._judge(stamp_ns, expected is not None and _near(expected, heard))

    def hear_pose(self, own: SceneMotion | None, pose: ShipPose) -> None:
        """Compare an accepted pose with the scene's own sea; own: as in `hear_heave`."""
        if own is None and self._moves:
            return
        expected = self._expected(own, pose.stamp_ns)
        self._judge(
            pose.stamp_ns,
            isinstance(expected, ShipPose) and _near(_numbers(expected), _numbers(pose)),
        )

    def _expected(
        self, own: SceneMotion | None, stamp_ns: int
    ) -> ShipPose | tuple[float, float] | None:
        """Return the sea's own pose, or heave and its rate, at this stamp; None: no sample."""
        if own is None:
            return ShipPose(stamp_ns, STILL, STILL)
        for sample in own.between(stamp_ns, stamp_ns + 1):
            return sample.pose or (sample.position_m, sample.velocity_m_per_s)
        return None

    def _judge(self, stamp_ns: int, own: bool) -> None:
        """Record whether a sample matches; the motion differs from the last matching sample on."""
        if own:
            self._agreed_ns = stamp_ns
        elif self._strange is None:
            since_ns = 0 if self._agreed_ns is None else max(self._agreed_ns, 0)
            why = f"the ship's motion is not the scene's own sea from {since_ns * 1e-9:.2f} s on"
            self._strange = (since_ns, why)

    def look(self, taken: Snapshot, compared: bool) -> None:
        """Check the inputs at a snapshot; compared: motion was compared, or is the sea itself."""
        now_ns = taken.stamp_ns
        if self._why or now_ns == 0:
            return
        for winch in taken.winches:
            if winch.off_schedule_s is not None:
                self._latch(
                    "winch commands differ from the scene's schedule from "
                    f"{winch.off_schedule_s:.2f} s on"
                )
        if self._strange is not None and now_ns > self._strange[0]:
            self._latch(self._strange[1])
        if self._moves:
            self._look_at_sea(taken, compared)

    def _look_at_sea(self, taken: Snapshot, compared: bool) -> None:
        """Check that samples of the scene's sea arrive and were compared."""
        heave = taken.inputs.get("heave")
        if not compared:
            self._latch("the ship's motion was not compared with the scene's own sea")
        elif heave is not None and (
            heave.stale or (heave.accepted == 0 and taken.stamp_ns > UNHEARD_NS)
        ):
            self._latch(f"samples of the scene's sea are missing at {taken.time_s:.2f} s")

    def _latch(self, why: str) -> None:
        self._why = self._why or why

    def claim(self, known: KnownError, time_ns: int) -> KnownError:
        """Return the error known from the study, or why it is unknown for this run at this time."""
        nothing = math.isnan(known.rms_pct) and math.isnan(known.peak_pct)
        if why := self._stated if nothing else self._why:
            return KnownError(words=f"unknown: {why}")
        if nothing:
            return known
        if time_ns > known.seconds * 1e9 + TIME_TOL_NS:
            return KnownError(words=f"unknown: {beyond(known.seconds)}")
        return known


def beyond(seconds: float) -> str:
    """Return the message for a run longer than its convergence study."""
    return f"the study's run ended at {seconds:g} s"


def _numbers(pose: ShipPose) -> tuple[float, ...]:
    return (
        *pose.position_m, *pose.velocity_m_per_s, *pose.orientation, *pose.rate_rad_per_s,
    )  # fmt: skip


def _near(one: tuple[float, ...], other: tuple[float, ...]) -> bool:
    return all(abs(a - b) <= MOTION_TOL for a, b in zip(one, other, strict=True))

"""Whether a run is the one that the scene's accuracy card describes: one rule for every display.

A card states the discretisation error of one run: the scene from its static equilibrium, with its
own sea, winch schedule and current, for the card's seconds. A twin with the same inputs goes
through the same phases of the lift (splash zone, landing) at the same time, so the error is known
exactly as long as nothing has come from elsewhere and the card's seconds have not passed. From the
first difference on the state itself is another one: the error stays unknown for the rest of the
run, and for every run that resumes from it. No allowance is made beyond the card's seconds.

Everything here is a function of twin time and accepted inputs, so a paced run, an unpaced run and
a replay publish the same error; it is part of a saved state.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Protocol

from rope_twin.scene.card import KnownError
from rope_twin.scene.digest import scene_digest
from rope_twin.scene.schema import Scene
from rope_twin.twin.motion.ship_pose import STILL, ShipPose
from rope_twin.twin.snapshot import Snapshot

MOTION_TOL = 1e-6  # m, m/s, rad/s: a sample that differs by less is the scene's own
UNHEARD_NS = 500_000_000  # without a sample for so long the sea counts as missing
TIME_TOL_NS = 1_000
CUT_WORDS = "the rope was cut"
OTHER_SCHEDULE = "it resumes from a run with another schedule or sea"


class MotionSample(Protocol):
    """One sample of the hang-off's heave, with the ship's pose where that moves the hang-off."""

    @property
    def position_m(self) -> float:
        """Heave [m]."""

    @property
    def velocity_m_per_s(self) -> float:
        """Its rate [m/s]."""

    @property
    def pose(self) -> ShipPose | None:
        """The ship's pose; None: heave alone."""


class OwnMotion(Protocol):
    """The scene's own sea, in twin time."""

    def between(self, from_ns: int, to_ns: int) -> Sequence[MotionSample]:
        """Samples with from_ns <= stamp_ns < to_ns, in order."""


class CardValidity:
    """Watches one run; `claim` turns the card's error into the one that holds for the run."""

    def __init__(self, scene: Scene) -> None:
        self._moves = scene.sea_state.moves
        self.digest = scene_digest(scene)  # a run may resume in a scene with another schedule
        self._why = self._stated = ""  # latched: the first reason, and the first that was stated
        self._agreed_ns: int | None = None  # stamp of the newest sample that is the scene's own
        self._strange: tuple[int, str] | None = None  # from when motion differs, in words

    def doubt(self, why: str) -> None:
        """The error is unknown from now on, whatever the card says; the first reason stands."""
        self._stated = self._stated or why
        self._why = self._why or why

    def resume(self, digest: str) -> None:
        """Go on in a scene with this digest, from a state that was saved."""
        if digest != self.digest:
            self.doubt(OTHER_SCHEDULE)
            self.digest = digest

    def hear_heave(
        self, own: OwnMotion | None, stamp_ns: int, position_m: float, velocity_m_per_s: float
    ) -> None:
        """Compare an accepted sample of heave with the scene's own sea.

        None: there is none, or it is not known here and nothing is compared.
        """
        if own is None and self._moves:
            return
        expected, heard = self._expected(own, stamp_ns), (position_m, velocity_m_per_s)
        if isinstance(expected, ShipPose):
            self._judge(stamp_ns, not self._moves and _near((0.0, 0.0), heard))
        else:
            self._judge(stamp_ns, expected is not None and _near(expected, heard))

    def hear_pose(self, own: OwnMotion | None, pose: ShipPose) -> None:
        """Compare an accepted pose with the scene's own sea; None as for heave."""
        if own is None and self._moves:
            return
        expected = self._expected(own, pose.stamp_ns)
        self._judge(
            pose.stamp_ns,
            isinstance(expected, ShipPose) and _near(_numbers(expected), _numbers(pose)),
        )

    def _expected(
        self, own: OwnMotion | None, stamp_ns: int
    ) -> ShipPose | tuple[float, float] | None:
        """The scene's own pose, or heave and its rate, at this stamp; None: it has no sample."""
        if own is None:
            return ShipPose(stamp_ns, STILL, STILL)
        for sample in own.between(stamp_ns, stamp_ns + 1):
            return sample.pose or (sample.position_m, sample.velocity_m_per_s)
        return None

    def _judge(self, stamp_ns: int, own: bool) -> None:
        """Between two samples both count: motion differs from the last one that agreed on."""
        if own:
            self._agreed_ns = stamp_ns
        elif self._strange is None:
            since_ns = 0 if self._agreed_ns is None else max(self._agreed_ns, 0)
            why = f"the ship's motion is not the scene's own sea from {since_ns * 1e-9:.2f} s on"
            self._strange = (since_ns, why)

    def look(self, taken: Snapshot, compared: bool) -> None:
        """Judge the inputs at a snapshot; compared: samples of motion are judged (or fed so)."""
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
        """Whether the scene's sea is heard, and known to be the scene's."""
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
        """The card's error, or why it is unknown for this run at this time."""
        nothing = math.isnan(known.rms_pct) and math.isnan(known.peak_pct)
        if why := self._stated if nothing else self._why:
            return KnownError(words=f"unknown: {why}")
        if nothing:
            return known
        if time_ns > known.seconds * 1e9 + TIME_TOL_NS:
            return KnownError(words=f"unknown: {beyond(known.seconds)}")
        return known


def beyond(seconds: float) -> str:
    """Why nothing is known of a run that lasts longer than the card's, in words."""
    return f"the card's run ended at {seconds:g} s"


def _numbers(pose: ShipPose) -> tuple[float, ...]:
    return (
        *pose.position_m, *pose.velocity_m_per_s, *pose.orientation, *pose.rate_rad_per_s,
    )  # fmt: skip


def _near(one: tuple[float, ...], other: tuple[float, ...]) -> bool:
    return all(abs(a - b) <= MOTION_TOL for a, b in zip(one, other, strict=True))

"""Inputs of a twin, accepted from any thread: motion, winch commands, current profiles, cuts."""

from __future__ import annotations

import threading

import numpy as np
from numpy.typing import ArrayLike

from rope_twin.errors import did_you_mean, phrase
from rope_twin.scene.card import known_error
from rope_twin.scene.schema import WINCH, Scene
from rope_twin.scene.validation.rigging import is_joined, winches_by_name
from rope_twin.twin.accuracy.validity import SceneMotion, StudyValidity
from rope_twin.twin.current_input import CurrentInput
from rope_twin.twin.cutting.cut_input import CutInput
from rope_twin.twin.motion.hang_off import HangOffTrack
from rope_twin.twin.motion.ship_pose import ShipPose
from rope_twin.twin.ropes import Ropes
from rope_twin.twin.snapshot import CutShot, InputHealth
from rope_twin.twin.winch.commands import SPEED, WinchCommand
from rope_twin.twin.winch.winch import winch_of_rope


class TwinInputs:
    """Inputs of a twin behind one lock; each `offer_*` method validates its input."""

    def __init__(self, scene: Scene, ropes: Ropes) -> None:
        self._lock = threading.Lock()
        self._heave = HangOffTrack(scene)
        self._winch = winch_of_rope(scene, scene.ropes[0])
        self._current = CurrentInput(ropes.first.effects)
        self._cut = CutInput(scene)
        self._ropes = ropes
        self._winch_names = tuple(winches_by_name(scene))
        alone = () if is_joined(scene) else (scene.ropes[0].name,)
        self._first_winch_names = ("", WINCH, *alone)
        self._time_ns = 0
        self._card_error = known_error(scene)  # by the scene's convergence study alone
        self._validity = StudyValidity(scene)
        self._own_motion: SceneMotion | None = None  # reference for the accepted motion
        self._judges_motion, self._motion_judged = True, False

    def expect_motion(self, own: SceneMotion | None) -> None:
        """Compare each accepted motion sample with the scene's own sea from now on.

        The error known from the scene's convergence study is reported only for motion that was
        compared in this way. None: the caller itself supplies the scene's own sea, and nothing is
        compared.
        """
        self._own_motion, self._judges_motion = own, own is not None
        self._motion_judged = True

    @property
    def time_ns(self) -> int:
        """Time since the start [ns]."""
        return self._time_ns

    def offer_heave(
        self,
        stamp_ns: int,
        position_m: float,
        velocity_m_per_s: float,
        received_ns: int | None = None,
    ) -> str:
        """Submit a heave sample of the hang-off, + up; return "" or the reason for its rejection.

        received_ns: arrival by the twin's clock, in twin time, to judge the sender's clock; None:
        unknown.
        """
        with self._lock:
            heard = position_m, velocity_m_per_s
            refusal = self._heave.offer(stamp_ns, *heard, received_ns)
            if not refusal and self._judges_motion:
                self._validity.hear_heave(self._own_motion, stamp_ns, *heard)
            return refusal

    def offer_pose(self, pose: ShipPose, received_ns: int | None = None) -> str:
        """Submit a ship pose, which moves the hang-off in x, y, z; return "" or the rejection.

        received_ns: as in `offer_heave`.
        """
        with self._lock:
            refusal = self._heave.offer_pose(pose, received_ns)
            if not refusal and self._judges_motion:
                self._validity.hear_pose(self._own_motion, pose)
            return refusal

    def prescribe_motion(self) -> None:
        """Accept heave as computed values of any form (step, pluck, stop) from now on.

        Sensor checks are then skipped: samples are checked only for order, range and finiteness.
        """
        with self._lock:
            self._heave.prescribe()

    def judge_clocks(self, lead_s: float, correct: bool) -> None:
        """Set the lead allowed to senders of motion [s], and whether their stamps are corrected."""
        with self._lock:
            self._heave.clock.lead_s, self._heave.clock.correct = lead_s, correct

    def offer_speed(self, stamp_ns: int | None, speed_m_per_s: float, winch: str = WINCH) -> str:
        """Command a winch speed, + pays out (stamp None: at once); return "" or the rejection."""
        return self.offer_command(stamp_ns, WinchCommand(SPEED, speed_m_per_s), winch)

    def offer_command(self, stamp_ns: int | None, command: WinchCommand, winch: str = WINCH) -> str:
        """Command or switch a winch (stamp None: at once); return "" or the rejection.

        A command for an unknown winch counts as rejected by the first one.
        """
        winch = self.winch_called(winch)
        with self._lock:
            if winch == WINCH:
                return self._winch.take(stamp_ns, command, self.time_ns)
            if winch not in self._winch_names:
                known = self._winch_names
                right = did_you_mean(winch, known) if known else "this scene has none"
                if len(self._first_winch_names) > 2 and known:
                    right = f"name it '{WINCH}', or leave the name empty"
                sentence = phrase("winch command", f"there is no winch '{winch}'", right)
                return self._winch.refuse(command, sentence)
            return self._ropes.offer(winch, stamp_ns, command, self.time_ns)

    def winch_called(self, name: str) -> str:
        """Return the name of the commanded winch; a single-line scene accepts its rope's too."""
        return WINCH if name in self._first_winch_names else name

    def offer_current(self, profile: ArrayLike) -> str:
        """Submit a current profile; return "" or the reason for its rejection.

        profile: rows of z [m], east, north [m/s] from the surface down, (rows, 3).
        """
        with self._lock:
            return self._current.offer(np.asarray(profile, dtype=float), self.time_ns)

    def offer_cut(self, stamp_ns: int | None, below_m: float, rope: str = "") -> str:
        """Submit a cut of a rope (stamp None: at once); return "" or the reason for its rejection.

        below_m: unstretched distance below its upper end [m]; infinite: as close to the lower end
        as possible. rope: its name in a multi-line scene; "" is the first one.
        """
        with self._lock:
            return self._cut.offer(stamp_ns, below_m, self.time_ns, rope)

    @property
    def cut(self) -> CutShot | None:
        """Position and time of the cut; None if no rope was cut."""
        return self._cut.done

    def newest_ns(self) -> dict[str, int]:
        """Return the stamp of the newest accepted sample of heave, cut and each winch [ns]."""
        counters = (self._heave.counter, self._cut.counter)
        own = {one.name: one.newest_ns for one in counters if one.newest_ns is not None}
        return own | self._winch.newest_ns() | self._ropes.newest_ns()

    def invalidate_inputs(self) -> None:
        """Invalidate inputs that were known in advance, after a pause or a restart."""
        with self._lock:
            self._heave.invalidate()
            self._winch.invalidate()
            self._ropes.invalidate()

    def _input_health(self) -> dict[str, InputHealth]:
        """Return the health of each input; call it under the lock."""
        now = self.time_ns
        return {
            "heave": self._heave.health(now),
            **self._winch.health(now),
            "current": self._current.counter.health(now, False),
            **self._cut.health(now),
        }

"""What a twin is told, from any thread: heave or pose, orders to winches, a current, a cut."""

from __future__ import annotations

import threading

import numpy as np
from numpy.typing import ArrayLike

from rope_twin.errors import did_you_mean, phrase
from rope_twin.scene.card import known_error
from rope_twin.scene.rigging import WINCH
from rope_twin.scene.rules.rigging import is_joined, winches_by_name
from rope_twin.scene.schema import Scene
from rope_twin.twin.accuracy.card_validity import CardValidity, OwnMotion
from rope_twin.twin.cutting.cutting import CutInput
from rope_twin.twin.hoisting.orders import SPEED, Order
from rope_twin.twin.hoisting.winch import winch_of_rope
from rope_twin.twin.motion.hang_off import HangOffTrack
from rope_twin.twin.motion.ship_pose import ShipPose
from rope_twin.twin.ropes import Ropes
from rope_twin.twin.snapshot import CutShot, InputHealth
from rope_twin.twin.water import CurrentInput


class ToldTwin:
    """The inputs of a twin, behind one lock; each `offer` judges what it is given."""

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
        self._card_error = known_error(scene)  # by the card alone, on the present elements and step
        self._validity = CardValidity(scene)
        self._own_motion: OwnMotion | None = None  # what the accepted motion is compared with
        self._judges_motion, self._motion_judged = True, False

    def expect_motion(self, own: OwnMotion | None) -> None:
        """Compare each accepted sample of motion with the scene's own sea from now on.

        The error of the scene's accuracy card is claimed only for motion that was compared so.
        None: the caller itself feeds the scene's own sea, and nothing is compared.
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
        """Take a heave sample of the hang-off, + up; returns "" or why it was refused.

        received_ns: when it arrived, by the twin's own clock in twin time, for the judgement of
        its sender's clock; None: not known.
        """
        with self._lock:
            heard = position_m, velocity_m_per_s
            refusal = self._heave.offer(stamp_ns, *heard, received_ns)
            if not refusal and self._judges_motion:
                self._validity.hear_heave(self._own_motion, stamp_ns, *heard)
            return refusal

    def offer_pose(self, pose: ShipPose, received_ns: int | None = None) -> str:
        """Take the ship's pose, which moves the hang-off in three directions; as offer_heave."""
        with self._lock:
            refusal = self._heave.offer_pose(pose, received_ns)
            if not refusal and self._judges_motion:
                self._validity.hear_pose(self._own_motion, pose)
            return refusal

    def prescribe_motion(self) -> None:
        """Take heave as computed from now on, exact and of any form: a step, a pluck, a stop.

        No sensor is judged then: of a sample only order, range and finiteness are.
        """
        with self._lock:
            self._heave.prescribe()

    def judge_clocks(self, lead_s: float, correct: bool) -> None:
        """Set by how much senders of motion may publish ahead, and whether stamps are corrected."""
        with self._lock:
            self._heave.clock.lead_s, self._heave.clock.correct = lead_s, correct

    def offer_speed(self, stamp_ns: int | None, speed_m_per_s: float, winch: str = WINCH) -> str:
        """Command the winch at a hang-off, + pays out (stamp None: at once); "" or the refusal."""
        return self.offer_order(stamp_ns, Order(SPEED, speed_m_per_s), winch)

    def offer_order(self, stamp_ns: int | None, order: Order, winch: str = WINCH) -> str:
        """Command or switch the winch at a hang-off (stamp None: at once); "" or the refusal.

        An order for a winch that is not there counts as refused at the first one.
        """
        winch = self.winch_called(winch)
        with self._lock:
            if winch == WINCH:
                return self._winch.take(stamp_ns, order, self.time_ns)
            if winch not in self._winch_names:
                known = self._winch_names
                right = did_you_mean(winch, known) if known else "this scene has none"
                if len(self._first_winch_names) > 2 and known:
                    right = f"name it '{WINCH}', or leave the name empty"
                sentence = phrase("winch command", f"there is no winch '{winch}'", right)
                return self._winch.refuse(order, sentence)
            return self._ropes.offer(winch, stamp_ns, order, self.time_ns)

    def winch_called(self, name: str) -> str:
        """The winch that a command means; a scene of one rope also calls it by the rope's name."""
        return WINCH if name in self._first_winch_names else name

    def offer_current(self, profile: ArrayLike) -> str:
        """A current profile, rows of z, east, north from the surface down; "" or the refusal."""
        with self._lock:
            return self._current.offer(np.asarray(profile, dtype=float), self.time_ns)

    def offer_cut(self, stamp_ns: int | None, below_m: float, rope: str = "") -> str:
        """Cut a rope so far below its upper end (stamp None: at once); "" or the refusal.

        below_m: unstretched [m]; infinite: as near to the lower end as can be. rope: its name,
        where several meet; without one it is the first.
        """
        with self._lock:
            return self._cut.offer(stamp_ns, below_m, self.time_ns, rope)

    @property
    def cut(self) -> CutShot | None:
        """Where and when the rope was cut, if it was."""
        return self._cut.done

    def newest_ns(self) -> dict[str, int]:
        """Stamp of the newest accepted sample of heave, cut and each winch's inputs, if any."""
        counters = (self._heave.counter, self._cut.counter)
        own = {one.name: one.newest_ns for one in counters if one.newest_ns is not None}
        return own | self._winch.newest_ns() | self._ropes.newest_ns()

    def doubt_inputs(self) -> None:
        """After a pause or a restart: inputs known for times to come may no longer hold."""
        with self._lock:
            self._heave.doubt()
            self._winch.doubt()
            self._ropes.doubt()

    def _input_health(self) -> dict[str, InputHealth]:
        """What became of each input's samples; under the lock."""
        now = self.time_ns
        return {
            "heave": self._heave.health(now),
            **self._winch.health(now),
            "current": self._current.counter.health(now, False),
            **self._cut.health(now),
        }

"""Energy balance of a run, for runs that ask for it.

Energy is evaluated at every step boundary. Power in and out is integrated from its values there by
the trapezoidal rule with Gregory's end correction (a twelfth of the last and first increments). The
remainder was dissipated numerically. In a snap load that begins and ends within a step the work of
the hang-off is known only from the force at the step boundaries: with 20 ms the residual may be 0.3
% of the exchanged energy too low, with 50 ms and a stiff damper some per cent.
"""

from __future__ import annotations

from collections import deque
from dataclasses import replace
from pathlib import Path
from typing import Any, Self

import numpy as np

from rope_twin.core import state as rows
from rope_twin.core.energy import Power, accounts_of
from rope_twin.core.joined.energy import SystemBorder, lost
from rope_twin.core.loads.hooks import hooks_of
from rope_twin.core.state import Floats, Rope
from rope_twin.errors import SceneError, phrase
from rope_twin.scene.schema import Scene
from rope_twin.twin.accuracy.level import AccuracyLevel
from rope_twin.twin.recovery import Checkpoint
from rope_twin.twin.results import EnergyBalance
from rope_twin.twin.saving.saved_state import SavedState
from rope_twin.twin.snapshot import Snapshot
from rope_twin.twin.twin import Twin


class EnergyAccount:
    """Energy sums over the steps, from the state at which it was opened."""

    def __init__(self, time_s: float, border: SystemBorder) -> None:
        self._since_s = time_s
        self._first = self._now = border
        self._work = np.zeros(len(Power._fields))  # by the trapezoidal rule
        # increments of power over the first two and the last two steps, times step/12
        self._first_rises: list[Floats] = []
        self._last_rises: deque[Floats] = deque(maxlen=2)
        self._damped = self._exchanged = 0.0

    def take(self, step_s: float, border: SystemBorder) -> None:
        """Add a step of this length [s] that ended at this state."""
        before, after = np.array(self._now.power), np.array(border.power)
        work = 0.5 * step_s * (before + after)
        loss = lost(self._now, border, step_s)
        changes = np.array(border.store) - np.array(self._now.store)
        moved = np.abs(changes).sum() + np.abs(work).sum() + abs(loss)
        self._last_rises.append(step_s / 12.0 * (after - before))
        if len(self._first_rises) < 2:
            self._first_rises.append(self._last_rises[-1])
        self._work = self._work + work
        self._damped += loss
        self._exchanged += 0.5 * float(moved)
        self._now = border

    def restart_at(self, border: SystemBorder) -> None:
        """Start the next step from this state, as the rope's elements have changed."""
        self._now = border

    def balance(self) -> EnergyBalance:
        """Return the sums up to the present, with Gregory's corrections at both ends."""
        now, work = self._now.store, self._work
        if len(self._first_rises) == 2:
            work = work - _steady(*self._last_rises) + _steady(*self._first_rises)
        hang_off, passing, water = work.tolist()
        change = now.total - self._first.store.total
        return EnergyBalance(
            since_s=self._since_s,
            kinetic_j=now.kinetic,
            elastic_j=now.elastic,
            potential_j=now.potential,
            change_j=change,
            hang_off_j=hang_off,
            passing_j=passing,
            water_j=water,
            damped_j=self._damped,
            residual_j=hang_off + passing + water - self._damped - change,
            exchanged_j=self._exchanged,
        )


class EnergyTwin(Twin):
    """A twin with an energy balance: a bit-identical run, but stepped one by one and slower.

    A saved state does not hold the balance; a restored twin opens a new one.

    Raises:
        SceneError: as for a twin, or an effect does not report its energy.
    """

    def __init__(self, scene: Scene) -> None:
        super().__init__(scene)
        _check_effects(scene, self._rope)
        self._account = self._new_account()

    @classmethod
    def restore(cls, saved: str | Path | SavedState, scene: Scene) -> Self:
        """Return a twin that resumes from a saved state, with a new energy balance."""
        twin = super().restore(saved, scene)
        twin._account = twin._new_account()
        return twin

    def snapshot(self) -> Snapshot:
        """Return a frozen copy of the present with the energy balance."""
        return replace(super().snapshot(), energy=self._account.balance())

    def set_level(self, level: AccuracyLevel) -> None:
        """Continue on another accuracy level with a new balance: its elements hold other energy."""
        super().set_level(level)
        self._account = self._new_account()

    def return_to(self, then: Checkpoint) -> bool:
        """Return to an earlier state with a new balance, as no step links the two states."""
        went = super().return_to(then)
        self._account = self._new_account()
        return went

    def _changing(self) -> dict[str, Any]:
        changing = super()._changing()
        changing.pop("_account", None)
        return changing

    def _advance_some(self, steps: int) -> int:
        for _ in range(steps):
            super()._advance_some(1)
            self._account.take(self.step_s, self._measured())
        return steps

    def _new_account(self) -> EnergyAccount:
        return EnergyAccount(self.time_ns * 1e-9, self._measured())

    def _split(self, lost_m: float, rope: int = 0) -> float:
        """Cut a rope; a cut is no step, so its change of energy does not enter the residual."""
        lost_m = super()._split(lost_m, rope)
        self._account.restart_at(self._measured())
        return lost_m

    def _measured(self) -> SystemBorder:
        """Return energy and power of the present state."""
        rope = self._rope._replace(effects=self._current.effects)
        V = float(self._boundary.rate[0, rows.LINE])
        return self._ropes.measure(rope, self._pull, V, self.time_ns * 1e-9)


def _steady(one: Floats, other: Floats) -> Floats:
    """Return the smaller of two increments of equal sign, else 0 (no correction at a kink)."""
    same = np.sign(one) == np.sign(other)
    return np.where(same, np.sign(one) * np.minimum(np.abs(one), np.abs(other)), 0.0)


def _check_effects(scene: Scene, rope: Rope) -> None:
    """Reject a balance in which an effect's work would appear as numerical dissipation.

    Raises:
        SceneError: an effect does not report the energy that it stores or adds.
    """
    for effect in rope.effects:
        kind = type(effect)
        if {"load", "load_end", "load_nodes", "couple"}.intersection(
            hooks_of(kind)
        ) and not accounts_of(kind):
            what = f"effect {kind.__name__} does not say what energy it stores or brings"
            right = "run it without the energy balance"
            raise SceneError(phrase(f"{scene.path}", what, right))

"""Energy balance of a run, for runs that ask for it.

Energy is evaluated at every step boundary. Power in and out is integrated from its values there by
the trapezoidal rule with Gregory's end correction (a twelfth of the last and first increments). The
remainder was dissipated numerically. In a snap load that begins and ends within a step the work of
the hang-off is known only from the force at the step boundaries: with 20 ms the residual may be 0.3
% of the exchanged energy too low, with 50 ms and a stiff damper some per cent.
"""

from __future__ import annotations

from collections import deque

import numpy as np

from rope_twin.core.energy import Power, SystemBorder, accounts_of, lost
from rope_twin.core.loads.hooks import hooks_of
from rope_twin.core.state import Floats, Rope
from rope_twin.errors import SceneError, phrase
from rope_twin.scene.schema import Scene
from rope_twin.twin.monitors.monitor import Chunk, Monitor, TwinView
from rope_twin.twin.results import EnergyBalance
from rope_twin.twin.snapshot import Snapshot, amended


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


class EnergyMonitor(Monitor):
    """Monitor of the energy balance; it observes every step, so that the run is slower.

    A saved state does not hold the balance: a restored twin opens a new one.
    """

    _account: EnergyAccount

    def start(self, now: TwinView, present: Chunk) -> None:
        """Open the balance.

        Raises:
            SceneError: an effect does not report its energy.
        """
        _check_effects(now.scene, now.rope)
        self.restart(now, present)

    def steps_to_observation(self, now: TwinView) -> int:
        """Return 1."""
        return 1

    def observe(self, now: TwinView, chunk: Chunk) -> None:
        """Add the step just done."""
        if chunk.done:
            self._account.take(now.step_s, _measured(now))

    def amend(self, now: TwinView, shot: Snapshot) -> Snapshot:
        """Return the snapshot with the energy balance."""
        return amended(shot, energy=self._account.balance())

    def restart(self, now: TwinView, present: Chunk) -> None:
        """Open a new balance, as no step leads to the present."""
        self._account = EnergyAccount(now.time_ns * 1e-9, _measured(now))

    def cut(self, now: TwinView) -> None:
        """Continue with the parts: a cut is no step, so its change of energy does not count."""
        self._account.restart_at(_measured(now))


def _measured(now: TwinView) -> SystemBorder:
    """Return energy and power of the present state."""
    return now.ropes.measure(now.rope, now.pull, now.line[1], now.time_ns * 1e-9)


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

"""Monitors of a twin: their interface, what they observe, energy balance and tension.

A monitor exists only if a run asks for it. It observes each series of steps just done, adds its
results to snapshots, and changes nothing in the twin: the run is bit-identical with it.

Energy is evaluated at every step boundary. Power in and out is integrated from its values there by
the trapezoidal rule with Gregory's end correction (a twelfth of the last and first increments). The
remainder was dissipated numerically. In a snap load that begins and ends within a step the work of
the hang-off is known only from the force at the step boundaries: with 20 ms the residual may be 0.3
% of the exchanged energy too low, with 50 ms and a stiff damper some per cent.
"""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from rope_twin.core import state as rows
from rope_twin.core.energy import Power, SystemStepEnergy, dissipated
from rope_twin.core.joined.joints import System
from rope_twin.core.loads.accounts import accounts_of
from rope_twin.core.loads.hooks import hooks_of
from rope_twin.core.state import STEPS_PER_CALL, Boundary, Floats, Rope
from rope_twin.errors import SceneError
from rope_twin.scene.schema import Scene
from rope_twin.twin.inputs import TwinInputs
from rope_twin.twin.multi_line import MultiLineRopes
from rope_twin.twin.regrid import element_tension, is_slack
from rope_twin.twin.ropes import Ropes
from rope_twin.twin.snapshot import CutSnapshot, EnergyBalance, Snapshot, amended
from rope_twin.twin.snapshot_builder import Extremes
from rope_twin.twin.state import Clock, SavedState
from rope_twin.twin.winch.commands import WinchCommand
from rope_twin.vortex.coupled import VivDragAmplification
from rope_twin.vortex.results import MonitorSettings


class TwinView(NamedTuple):
    """Read-only view of a twin after the newest step; its arrays are those in use."""

    scene: Scene
    clock: Clock
    step_s: float
    rope: Rope  # the first one, with the effects in use
    ropes: Ropes  # all of them, with the winches of the others
    boundary: Boundary  # hang-off and paid-out length of the first one; row 0 is the present
    pull: Floats  # force of the first one on its hang-off [N], (rows.PULL_COLUMNS,)
    inputs: TwinInputs
    viv_drag: VivDragAmplification | None  # loosely coupled VIV model of the scene

    @property
    def time_ns(self) -> int:
        """Twin time [ns]."""
        return self.clock.time_ns

    @property
    def tension(self) -> Floats:
        """Tension of the first rope's elements from the lower end up [N], (elements,)."""
        return element_tension(self.rope)

    @property
    def line(self) -> tuple[float, float]:
        """Paid-out length of the first rope [m] and its rate [m/s]."""
        value, rate = self.boundary
        return float(value[0, rows.LINE]), float(rate[0, rows.LINE])

    @property
    def cut(self) -> CutSnapshot | None:
        """Position and time of the cut; None if no rope was cut."""
        return self.inputs.cut.done

    @property
    def joined(self) -> MultiLineRopes | None:
        """The multi-line system; None for a single rope."""
        return self.ropes if isinstance(self.ropes, MultiLineRopes) else None


class Chunk(NamedTuple):
    """Ropes of a twin and their boundary conditions over the steps of one call of `advance`."""

    ropes: Rope | System  # at present, with the effects in use
    boundary: Boundary  # of every rope at the boundaries of the steps, (ropes, steps + 1, MOTIONS)
    pulls: Floats  # force on every upper end after each step [N], (ropes, steps, PULL_COLUMNS)
    done: int  # steps done: row `done` of the boundary is the present; 0: so is the row of pulls
    time_ns: int  # the present
    step_s: float
    steps: int  # done since the start of the twin
    currents: int  # current profiles accepted since then

    @property
    def present_motion(self) -> tuple[Floats, Floats]:
        """Return value and rate of the prescribed motion at present, (ropes, MOTIONS) each."""
        return self.boundary.value[:, self.done].copy(), self.boundary.rate[:, self.done].copy()

    @property
    def pull(self) -> Floats:
        """Return the force on the upper ends at present [N], (ropes, PULL_COLUMNS)."""
        present: Floats = self.pulls[:, max(self.done - 1, 0)]
        return present


class Monitor:
    """Monitor of a twin; by default it observes nothing.

    It is made before the twin is built, so that it can reject the scene. All methods but `command`
    and `invalidate` are called in the stepping thread.
    """

    notice = ""  # message for the user before the run

    def start(self, view: TwinView, present: Chunk) -> None:
        """Start with a twin in static equilibrium."""
        self.restart(view, present)

    def restart(self, view: TwinView, present: Chunk) -> None:
        """Start from the present: elements have changed, or the ropes are in an earlier state."""

    def steps_to_observation(self, view: TwinView) -> int:
        """Return after how many further steps it must observe."""
        return STEPS_PER_CALL

    def observe(self, view: TwinView, chunk: Chunk) -> None:
        """Observe the steps just done, not more than `steps_to_observation` returned."""

    def amend(self, view: TwinView, snapshot: Snapshot) -> Snapshot:
        """Return the snapshot with its results."""
        return snapshot

    def cut(self, view: TwinView) -> None:
        """Continue with a rope that was cut just now."""

    def command(self, now_ns: int, rope: int, stamp_ns: int | None, command: WinchCommand) -> None:
        """Observe a command that the winch of a rope has accepted; under the lock of the inputs."""

    def invalidate(self) -> None:
        """Invalidate inputs that were known in advance; under the lock of the inputs."""

    def state(self) -> dict[str, Any]:
        """Return the state from which `restore` continues, by name; empty for none."""
        return {}

    def restore(self, view: TwinView, present: Chunk, saved: SavedState) -> None:
        """Continue in a twin that was restored, as far as the state has this monitor.

        Raises:
            StateError: the state is of another monitor.
        """
        self.restart(view, present)


def chunk_of(view: TwinView, pulls: Floats, boundary: Boundary) -> Chunk:
    """Return the ropes at present and the last steps.

    pulls: force of the first rope after each of these steps, empty for none; boundary: of the first
    rope, row 0 is before these steps.
    """
    joined, done = view.joined, len(pulls)
    ropes: Rope | System
    if joined is None:
        ropes, boundaries = view.rope, Boundary(*(table[None] for table in boundary))
        rope_pulls = pulls[None] if done else view.pull[None, None]
    else:
        ropes = joined.system(view.rope)
        boundaries = joined.moved if done else joined.boundaries(boundary, 0)
        rope_pulls = joined.pulls if done else joined.pull[:, None]
    counts = view.clock.steps, view.inputs.current.changes
    return Chunk(ropes, boundaries, rope_pulls, done, view.time_ns, view.step_s, *counts)


@dataclass(frozen=True)
class Monitors:
    """Monitors that a run asks for."""

    energy: bool = False
    error_interval: bool = False
    vortex: MonitorSettings | None = None  # vibration and fatigue
    slack_steps: int = 0  # between checks for slack; 0: tensions are not monitored
    further: tuple[Monitor, ...] = ()  # of the caller, for one twin


NO_MONITORS = Monitors()
ENERGY, ERROR_INTERVAL = Monitors(energy=True), Monitors(error_interval=True)


def new_monitors(scene: Scene, requested: Monitors) -> tuple[Monitor, ...]:
    """Return the monitors of a new twin, not started; they are imported only if asked for.

    Raises:
        InputError: a monitor is not possible for the scene.
    """
    monitors: list[Monitor] = []
    if requested.error_interval:
        from rope_twin.twin.error_interval import ErrorInterval

        monitors.append(ErrorInterval(scene))
    if requested.energy:
        monitors.append(EnergyMonitor())
    if requested.slack_steps:
        monitors.append(TensionMonitor(requested.slack_steps))
    if requested.vortex:
        from rope_twin.twin.vortex_monitor import VortexMonitor

        monitors.append(VortexMonitor(scene, requested.vortex))
    return *monitors, *requested.further


class EnergyAccount:
    """Energy sums over the steps, from the state at which it was opened."""

    def __init__(self, time_s: float, start: SystemStepEnergy) -> None:
        self._since_s = time_s
        self._first = self._now = start
        self._work = np.zeros(len(Power._fields))  # by the trapezoidal rule
        # increments of power over the first two and the last two steps, times step/12
        self._first_rises: list[Floats] = []
        self._last_rises: deque[Floats] = deque(maxlen=2)
        self._damped = self._exchanged = 0.0

    def take(self, step_s: float, end: SystemStepEnergy) -> None:
        """Add a step of this length [s] that ended at this state."""
        before, after = np.array(self._now.power), np.array(end.power)
        work = 0.5 * step_s * (before + after)
        loss = dissipated(self._now, end, step_s)
        changes = np.array(end.store) - np.array(self._now.store)
        exchanged = np.abs(changes).sum() + np.abs(work).sum() + abs(loss)
        self._last_rises.append(step_s / 12.0 * (after - before))
        if len(self._first_rises) < 2:
            self._first_rises.append(self._last_rises[-1])
        self._work = self._work + work
        self._damped += loss
        self._exchanged += 0.5 * float(exchanged)
        self._now = end

    def restart_at(self, state: SystemStepEnergy) -> None:
        """Start the next step from this state, as the rope's elements have changed."""
        self._now = state

    def balance(self) -> EnergyBalance:
        """Return the sums up to the present, with Gregory's corrections at both ends."""
        stored, work = self._now.store, self._work
        if len(self._first_rises) == 2:
            work = (
                work
                - _smaller_increment(*self._last_rises)
                + _smaller_increment(*self._first_rises)
            )
        hang_off, passing, water = work.tolist()
        change = stored.total - self._first.store.total
        return EnergyBalance(
            since_s=self._since_s,
            kinetic_j=stored.kinetic,
            elastic_j=stored.elastic,
            potential_j=stored.potential,
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

    def start(self, view: TwinView, present: Chunk) -> None:
        """Open the balance.

        Raises:
            SceneError: an effect does not report its energy.
        """
        _check_effects(view.scene, view.rope)
        self.restart(view, present)

    def steps_to_observation(self, view: TwinView) -> int:
        """Return 1."""
        return 1

    def observe(self, view: TwinView, chunk: Chunk) -> None:
        """Add the step just done."""
        if chunk.done:
            self._account.take(view.step_s, _energy_state(view))

    def amend(self, view: TwinView, snapshot: Snapshot) -> Snapshot:
        """Return the snapshot with the energy balance."""
        return amended(snapshot, energy=self._account.balance())

    def restart(self, view: TwinView, present: Chunk) -> None:
        """Open a new balance from the present state."""
        self._account = EnergyAccount(view.time_ns * 1e-9, _energy_state(view))

    def cut(self, view: TwinView) -> None:
        """Continue with the parts; the change of energy by the cut itself is not counted."""
        self._account.restart_at(_energy_state(view))


def _energy_state(view: TwinView) -> SystemStepEnergy:
    """Return energy and power of the present state."""
    return view.ropes.measure(view.rope, view.pull, view.line[1], view.time_ns * 1e-9)


def _smaller_increment(first: Floats, second: Floats) -> Floats:
    """Return the smaller of two increments of equal sign; 0 for opposite signs, as at a kink."""
    same = np.sign(first) == np.sign(second)
    return np.where(same, np.sign(first) * np.minimum(np.abs(first), np.abs(second)), 0.0)


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
            problem = f"effect {kind.__name__} does not say what energy it stores or brings"
            raise SceneError(f"{scene.path}", problem, "run it without the energy balance")


class TensionMonitor(Monitor):
    """Monitor of the tension at the upper ends, in every step, and of slack, at intervals.

    A saved state does not hold its results: in a restored twin they start again.
    """

    _upper: list[Extremes]
    _static: list[float]

    def __init__(self, slack_steps: int) -> None:
        """Check for slack after every `slack_steps` steps."""
        self._slack_steps = slack_steps
        self._checks = self._slack_checks = 0

    def start(self, view: TwinView, present: Chunk) -> None:
        """Start in static equilibrium."""
        self._static = present.pull[:, rows.PULL].tolist()
        self._upper = [Extremes() for _ in self._static]

    def steps_to_observation(self, view: TwinView) -> int:
        """Return the number of steps until the next check for slack."""
        return self._slack_steps - view.clock.steps % self._slack_steps

    def observe(self, view: TwinView, chunk: Chunk) -> None:
        """Record the tensions of the steps just done, and check for slack if that is due."""
        for upper, pulls in zip(self._upper, chunk.pulls, strict=True):
            upper.take(pulls[: chunk.done, rows.PULL].tolist())
        if chunk.done and chunk.steps % self._slack_steps == 0:
            ropes = (chunk.ropes,) if isinstance(chunk.ropes, Rope) else chunk.ropes.ropes
            self._checks += 1
            self._slack_checks += is_slack(ropes)

    def cut(self, view: TwinView) -> None:
        """Continue with the parts; the lower one of a multi-line system is a further rope."""
        if view.joined is not None:
            self._upper.append(Extremes())
            self._static.append(0.0)

    @property
    def upper_n(self) -> list[Extremes]:
        """Tension at the upper end of each rope in all steps [N]; before the first, the static."""
        extremes = []
        for upper, static in zip(self._upper, self._static, strict=True):
            if upper.empty:
                upper = Extremes()
                upper.take([static])
            extremes.append(upper)
        return extremes

    @property
    def slack_share(self) -> float:
        """Fraction of the checks that found an element without tension, of any rope."""
        return self._slack_checks / self._checks if self._checks else 0.0

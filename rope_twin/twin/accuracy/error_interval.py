"""Discretisation-error interval of the top tension, from a coarse solution parallel to the twin.

The coarse solution (`coarse_solution`) has half the elements and twice the step, with bit-identical
hang-off, paid-out length and current. Where elements and step are of second order, its tension
differs from the rope's by three times the rope's error (Richardson 1911); where they are of first
order (slack, landing, a winch with tension feedback, waves that decay within an element), by the
error itself. The bound is therefore the whole difference, with a margin. The difference passes
through zero while the error does not, and after an impact it may vanish while both still ring: so
the largest difference of the last seconds counts.

Where the coarse solution cannot follow the rope, the interval is unknown, with the reason.
"""

from __future__ import annotations

import time
from collections import deque
from dataclasses import replace

import numpy as np

from rope_twin.core import state as rows
from rope_twin.core.bed import Grid, Plane, clearance
from rope_twin.core.joined.joints import LOOSE, System
from rope_twin.core.state import Floats, Rope
from rope_twin.effects.wake_oscillator import WakeOscillatorParams
from rope_twin.scene.schema import Scene
from rope_twin.twin.accuracy.coarse_solution import RATIO, CoarseSolution
from rope_twin.twin.monitors.monitor import Chunk, Monitor, TwinView
from rope_twin.twin.results import TensionInterval
from rope_twin.twin.snapshot import Snapshot, amended
from rope_twin.twin.winch.commands import WinchCommand
from rope_twin.twin.winch.winch import Winch

MARGIN = 1.25  # bound over the largest difference: safety factor of the grid convergence index
WINDOW_S = 10.0  # largest difference so long: more than a wave period or first axial period
SETTLING_S = 20.0  # settling time of a coarse solution that was started during a run
_PLACE = slice(rows.POSITION, rows.POSITION + 3)


class WindowMaximum:
    """Maximum of a series over a sliding window."""

    def __init__(self, window_s: float) -> None:
        self._window_s = window_s
        self._kept: deque[tuple[float, float]] = deque()  # (time, value), values falling

    def take(self, time_s: float, value: float) -> None:
        """Add a value."""
        while self._kept and self._kept[-1][1] <= value:
            self._kept.pop()
        self._kept.append((time_s, value))

    def at(self, time_s: float) -> float:
        """Return the maximum over the window that ends at this time; 0 if it is empty."""
        while self._kept and self._kept[0][0] <= time_s - self._window_s:
            self._kept.popleft()
        return self._kept[0][1] if self._kept else 0.0


class ErrorInterval(Monitor):
    """Monitor of the error interval of the top tension of every rope that hangs from the ship.

    A saved state does not hold the coarse solution; a restored twin makes a new one.
    """

    def __init__(self, scene: Scene) -> None:
        """Make a monitor that has not started."""
        self._scene = scene
        self.coarse: CoarseSolution | None = None  # None: the interval is unknown from here on
        self._largest: dict[int, WindowMaximum] = {}  # by rope, of the difference [N]
        self._reason, self._known_from_ns = "", 0  # why it is unknown before this time
        self.took_s = 0.0  # CPU time since the start

    @property
    def ropes(self) -> tuple[int, ...]:
        """Return the numbers of the ropes that have an interval."""
        return tuple(self._largest)

    def start(self, now: TwinView, present: Chunk) -> None:
        """Start a coarse solution in static equilibrium."""
        self._begin(now, present, at_rest=True)

    def restart(self, now: TwinView, present: Chunk) -> None:
        """Start a coarse solution from the present state, unless a rope was cut."""
        if now.cut is None:
            self._begin(now, present, at_rest=False)
        else:
            self.cut(now)

    def cut(self, now: TwinView) -> None:
        """End the coarse solution."""
        assert now.cut is not None
        at = f"{now.cut.at_s:.2f} s"
        self._end(f"unknown since the cut at {at}: the coarse solution has no cut")

    def command(self, now_ns: int, rope: int, stamp_ns: int | None, command: WinchCommand) -> None:
        """Command the winch of the coarse solution, if it has one of its own."""
        if self.coarse is not None:
            self.coarse.command(rope, stamp_ns, command, now_ns)

    def invalidate(self) -> None:
        """Invalidate commands known in advance in the winches of the coarse solution."""
        if self.coarse is not None:
            self.coarse.invalidate()

    def amend(self, now: TwinView, shot: Snapshot) -> Snapshot:
        """Return the snapshot with the interval of each rope, or why it is unknown."""
        if reason := self.why_unknown(now.time_ns):
            return amended(shot, no_error_interval=reason)
        rest_s = now.clock.computing_s - self.took_s
        cost_pct = 100.0 * self.took_s / rest_s if rest_s > 0.0 else 0.0
        ropes = list(shot.ropes)
        for r in self.ropes if ropes else ():
            found = self.interval(r, ropes[r].tension_top_n, shot.time_s, cost_pct)
            ropes[r] = replace(ropes[r], error_interval=found)
        first = self.interval(0, shot.tension_top_n, shot.time_s, cost_pct)
        return amended(shot, error_interval=first, ropes=tuple(ropes))

    def _begin(self, seen: TwinView, now: Chunk, at_rest: bool) -> None:
        if self._scene.listed(WakeOscillatorParams) is not None:
            self._end("unknown with `wake_oscillator`: the phase of its vortices drifts")
            return
        self.coarse = CoarseSolution(self._scene, now, at_rest, seen.viv_drag)
        self._largest = {r: WindowMaximum(WINDOW_S) for r in ropes_from_ship(now.ropes)}
        self._reason, self._known_from_ns = "", 0
        if not self.coarse.at_rest:
            self._settle(now.time_ns, "its coarse solution has to settle")

    def _end(self, reason: str) -> None:
        """End the coarse solution; the interval is unknown from now on."""
        self.coarse, self._largest, self._reason = None, {}, reason

    def observe(self, now: TwinView, chunk: Chunk) -> None:
        """Advance the coarse solution by the steps just done, and compare the top tensions.

        A coarse solution whose next state would not be finite starts again from the twin's state.
        """
        if self.coarse is not None and chunk.done:
            began = time.perf_counter()
            if stands_on_bed(chunk.ropes):
                self._settle(chunk.time_ns, "the payload stood on the seabed")
            followed = self.coarse.follow(chunk)
            if followed is None:
                self._begin(now, chunk, at_rest=False)
            else:
                self.coarse.sample_vortices(chunk)
                self._compare(chunk, *followed)
            self.took_s += time.perf_counter() - began
        if self.coarse is not None and (responding := responding_winches(now)):
            with now.inputs.lock:
                self.coarse.share_winches(responding)

    def why_unknown(self, time_ns: int) -> str:
        """Return why there is no interval at this time; "" if there is one."""
        known = self.coarse is not None and time_ns >= self._known_from_ns
        return "" if known else self._reason

    def interval(self, r: int, tension_n: float, time_s: float, cost_pct: float) -> TensionInterval:
        """Return the interval of rope r around its top tension.

        cost_pct: CPU time of the interval relative to all other work.
        """
        bound = MARGIN * self._largest[r].at(time_s)
        low = max(tension_n - bound, 0.0)
        return TensionInterval(low, tension_n + bound, bound, cost_pct)

    def _settle(self, time_ns: int, why: str) -> None:
        """Make the interval unknown for the settling time from now on."""
        self._known_from_ns = time_ns + round(SETTLING_S * 1e9)
        self._reason = f"unknown until {self._known_from_ns * 1e-9:.1f} s: {why}"

    def _compare(self, chunk: Chunk, first: int, coarse_n: Floats) -> None:
        """Take the differences after every coarse step; first: step of the chunk that ends it."""
        ends = range(first, chunk.done + 1, RATIO)
        for r, largest in self._largest.items():
            own_n = chunk.pulls[r, first - 1 : chunk.done : RATIO, rows.PULL]
            for end, difference in zip(ends, np.abs(coarse_n[r] - own_n).tolist(), strict=True):
                time_s = chunk.time_ns * 1e-9 - (chunk.done - end) * chunk.step_s
                largest.take(time_s, difference)


def ropes_from_ship(ropes: Rope | System) -> tuple[int, ...]:
    """Return the numbers of the ropes whose upper end is on the ship."""
    if isinstance(ropes, Rope):
        return (0,)
    return tuple(r for r, upper in enumerate(ropes.joints.upper) if upper == LOOSE)


def stands_on_bed(ropes: Rope | System) -> bool:
    """Return whether the free lower end of a rope, or one that carries a load, is on the seabed.

    The rope above it then lies in loops that neither solution resolves, so that their difference
    does not contain the error.
    """
    ends = [ropes] if isinstance(ropes, Rope) else list(ropes.ropes)
    joined = [LOOSE] if isinstance(ropes, Rope) else ropes.joints.lower.tolist()
    bed = next((one for one in ends[0].effects if isinstance(one, Plane | Grid)), None)
    return bed is not None and any(
        bool(clearance(bed, rope.state.nodes[_PLACE, :1])[0] <= 0.0)
        for rope, lower in zip(ends, joined, strict=True)
        if lower != LOOSE or rope.model.first_free == 0
    )


def responding_winches(now: TwinView) -> dict[int, Winch]:
    """Return the winches that need tension feedback for the next step, by rope number."""
    winch = now.inputs.winch
    first = {0: winch} if winch.needs_feedback(now.time_ns) else {}
    joined = now.joined
    return first if joined is None else first | joined.needing_feedback(now.time_ns)

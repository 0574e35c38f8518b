"""Interface of the monitors of a twin, and what they observe.

A monitor exists only if a run asks for it. It observes each series of steps just done, adds its
results to snapshots, and changes nothing in the twin: the run is bit-identical with it.
"""

from __future__ import annotations

from typing import Any, NamedTuple

from rope_twin.core import state as rows
from rope_twin.core.joined.joints import System
from rope_twin.core.state import Boundary, Floats, Rope
from rope_twin.scene.schema import Scene
from rope_twin.twin.inputs import TwinInputs
from rope_twin.twin.motion.boundary_conditions import STEPS_PER_CALL
from rope_twin.twin.multi_line.system import MultiLineRopes
from rope_twin.twin.ropes import Ropes
from rope_twin.twin.saving.saved_state import SavedState
from rope_twin.twin.snapshot import CutShot, Snapshot
from rope_twin.twin.state import Clock
from rope_twin.twin.winch.commands import WinchCommand
from rope_twin.vortex.coupled import VivDragAmplification


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
        tension: Floats = self.rope.work[rows.TENSION, : self.rope.state.counts[rows.ELEMENTS]]
        return tension

    @property
    def line(self) -> tuple[float, float]:
        """Paid-out length of the first rope [m] and its rate [m/s]."""
        value, rate = self.boundary
        return float(value[0, rows.LINE]), float(rate[0, rows.LINE])

    @property
    def cut(self) -> CutShot | None:
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
    done: int  # steps done: row `done` of the boundary is the present. 0: pulls has the present
    time_ns: int  # the present
    step_s: float
    steps: int  # done since the start of the twin
    currents: int  # current profiles accepted since then

    @property
    def border(self) -> tuple[Floats, Floats]:
        """Return value and rate of the prescribed motion at present, (ropes, MOTIONS) each."""
        return self.boundary.value[:, self.done].copy(), self.boundary.rate[:, self.done].copy()

    @property
    def pull(self) -> Floats:
        """Return the force on the upper ends at present [N], (ropes, PULL_COLUMNS)."""
        now: Floats = self.pulls[:, max(self.done - 1, 0)]
        return now


class Monitor:
    """Monitor of a twin; by default it observes nothing.

    It is made before the twin is built, so that it can reject the scene. All methods but `command`
    and `invalidate` are called in the stepping thread.
    """

    told = ""  # message for the user before the run

    def start(self, now: TwinView, present: Chunk) -> None:
        """Start with a twin in static equilibrium."""
        self.restart(now, present)

    def restart(self, now: TwinView, present: Chunk) -> None:
        """Start from the present: elements have changed, or the ropes are in an earlier state."""

    def steps_to_observation(self, now: TwinView) -> int:
        """Return after how many further steps it must observe."""
        return STEPS_PER_CALL

    def observe(self, now: TwinView, chunk: Chunk) -> None:
        """Observe the steps just done, not more than `steps_to_observation` returned."""

    def amend(self, now: TwinView, shot: Snapshot) -> Snapshot:
        """Return the snapshot with its results."""
        return shot

    def cut(self, now: TwinView) -> None:
        """Continue with a rope that was cut just now."""

    def command(self, now_ns: int, rope: int, stamp_ns: int | None, command: WinchCommand) -> None:
        """Take a command that the winch of a rope has accepted; under the lock of the inputs."""

    def invalidate(self) -> None:
        """Invalidate inputs that were known in advance; under the lock of the inputs."""

    def state(self) -> dict[str, Any]:
        """Return the state from which `restore` continues, by name; empty for none."""
        return {}

    def restore(self, now: TwinView, present: Chunk, saved: SavedState) -> None:
        """Continue in a twin that was restored, as far as the state has this monitor.

        Raises:
            StateError: the state is of another monitor.
        """
        self.restart(now, present)


def chunk_of(now: TwinView, pulls: Floats, boundary: Boundary) -> Chunk:
    """Return the ropes at present and the last steps.

    pulls: force of the first rope after each of them, empty for none; boundary: of the first rope,
    row 0 is before them.
    """
    joined, done = now.joined, len(pulls)
    ropes: Rope | System
    if joined is None:
        ropes, borders = now.rope, Boundary(*(table[None] for table in boundary))
        each = pulls[None] if done else now.pull[None, None]
    else:
        ropes = joined.system(now.rope)
        borders = joined.moved if done else joined.borders(boundary, 0)
        each = joined.pulls if done else joined.pull[:, None]
    counts = now.clock.steps, now.inputs.current.changes
    return Chunk(ropes, borders, each, done, now.time_ns, now.step_s, *counts)

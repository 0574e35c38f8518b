"""Checks of the measured values that a live forecast hears, by the twin's own rules.

A forecast of a heave that stands still, or of a line out in another unit, would be a calm and
certain one. So what the twin refuses is refused here too. Both hear the same topics, each for
itself: a forecast waits for nobody.
"""

from __future__ import annotations

import time
from collections import Counter
from collections.abc import Callable

from rope_twin.errors import phrase
from rope_twin.scene.rigging import places
from rope_twin.scene.schema import Scene
from rope_twin.twin.health import AHEAD_NS, too_far_ahead, too_late
from rope_twin.twin.motion.hang_off import HangOffTrack
from rope_twin.twin.readings import Row, WinchReadings

ANOTHER_RUN_NS = 2_000_000_000  # by so much a clock goes back for another run
BEHIND_NS = 500_000_000  # the present, by which a sample of heave may be late
SILENT_S = 2.0  # of the simulation, after which its time says nothing of a stamp


class Admission:
    """Judges heave and readings of winches; times are stamps in ROS time [ns]."""

    def __init__(self, scene: Scene, steady_s: Callable[[], float] = time.monotonic) -> None:
        """Make the checks of a scene; steady_s: a clock that is never set."""
        self._scene, self._steady_s = scene, steady_s
        hung = places(scene)
        self._lines = [line for line in scene.ropes if line.from_ in hung]
        self._simulated_ns, self._heard_s = 0, -float("inf")
        self._newest_ns: dict[str, int] = {}  # accepted, of heave and of each winch
        self.refused: Counter[str] = Counter()  # by topic
        self.last_refusal = ""
        self._begin()

    def _begin(self) -> None:
        self._newest_ns.clear()
        self._heave, self._asked_ns = HangOffTrack(self._scene), 0
        self._winches = {line.from_: WinchReadings(self._scene, line, "") for line in self._lines}

    def note_simulated(self, stamp_ns: int) -> None:
        """Take the stamp of a value of the simulation, to judge other clocks by."""
        self._simulated_ns, self._heard_s = stamp_ns, self._steady_s()

    def heave(self, stamp_ns: int, position_m: float, velocity_m_per_s: float) -> bool:
        """Return whether a sample of ship/heave is accepted."""
        refusal = self._clock_fault("heave", stamp_ns)
        if not refusal:
            self._follow("heave", stamp_ns)
            known_ns = min(stamp_ns, self._simulated_ns) if self._simulates else stamp_ns
            self._asked_ns = max(self._asked_ns, known_ns - BEHIND_NS)
            self._heave.at(self._asked_ns)
            refusal = self._heave.offer(stamp_ns, position_m, velocity_m_per_s)
        return self._counted("ship/heave", "heave", stamp_ns, refusal)

    def reading(self, stamp_ns: int, winch: str, row: Row) -> Row:
        """Return what is accepted of a row of winch/measured, None for the rest.

        winch: the place in the scene that it is of.
        """
        nothing: Row = (row[0], None, None, None)
        if row[1:] == nothing[1:]:
            return nothing
        taken, refusal = nothing, self._clock_fault("winch", stamp_ns)
        if not refusal:
            self._follow(winch, stamp_ns)
            taken, refusal = self._winches[winch].take(stamp_ns, row, stamp_ns)
        self._counted("winch/measured", winch, stamp_ns, "" if taken != nothing else refusal)
        if refusal and taken != nothing:
            self._refuse("winch/measured", refusal)
        return taken

    def _counted(self, topic: str, stream: str, stamp_ns: int, refusal: str) -> bool:
        if refusal:
            self._refuse(topic, refusal)
            return False
        self._newest_ns[stream] = stamp_ns
        return True

    def _refuse(self, topic: str, refusal: str) -> None:
        self.refused[topic] += 1
        self.last_refusal = refusal

    def _follow(self, stream: str, stamp_ns: int) -> None:
        """Begin again where the clock of a sender went back, as when a bag is played again."""
        if stamp_ns < self._newest_ns.get(stream, stamp_ns) - ANOTHER_RUN_NS:
            self._begin()

    @property
    def _simulates(self) -> bool:
        """Whether the simulation was heard of late."""
        return self._steady_s() - self._heard_s <= SILENT_S

    def _clock_fault(self, what: str, stamp_ns: int) -> str:
        """Return why a stamp is of another clock than the simulation's, or ""."""
        if not self._simulates:
            return ""
        if stamp_ns > self._simulated_ns + AHEAD_NS:
            return phrase(what, *too_far_ahead(stamp_ns, self._simulated_ns))
        if stamp_ns < self._simulated_ns - AHEAD_NS:
            return phrase(what, *too_late(stamp_ns, self._simulated_ns))
        return ""

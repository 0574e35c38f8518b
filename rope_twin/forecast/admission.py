"""Checks of the measured inputs of a live forecast, by the rules of the twin.

A frozen heave signal, or a line out in another unit, would give a falsely calm forecast with a
narrow band. Inputs that the twin rejects are therefore rejected here too. Both subscribe to the
same topics independently, so a forecast does not wait for the twin.

A load pin would draw the next seconds to whatever it reads. Where the members, with the spread of
their figures, cannot explain its readings, it is left out: it has failed, or the scene is another
lift.
"""

from __future__ import annotations

import time
from collections import Counter
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from rope_twin.errors import phrase
from rope_twin.scene.rigging import places
from rope_twin.scene.schema import Scene
from rope_twin.twin.health import AHEAD_NS, too_far_ahead, too_late
from rope_twin.twin.motion.hang_off import HangOffTrack
from rope_twin.twin.readings import Row, WinchReadings

ANOTHER_RUN_NS = 2_000_000_000  # a clock that goes back by this much means another run
BEHIND_NS = 500_000_000  # the present, by which a sample of heave may be late
SILENT_S = 2.0  # of the simulation, after which its time is not used to check stamps
MAX_MISFIT = 4.0  # RMS of the load pin about the members, in standard deviations
STUCK_READINGS, STUCK_SDS = 20, 2.0  # equal ones, while the members move by so many deviations
Floats = NDArray[np.float64]


class Admission:
    """Accepts or rejects heave and winch readings; times are stamps in ROS time [ns]."""

    def __init__(self, scene: Scene, steady_s: Callable[[], float] = time.monotonic) -> None:
        """Prepare the checks of a scene; steady_s: a steady clock."""
        self._scene, self._steady_s = scene, steady_s
        hang_offs = places(scene)
        self._lines = [line for line in scene.ropes if line.from_ in hang_offs]
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
        """Store the stamp of a value of the simulation, to check other clocks against."""
        self._simulated_ns, self._heard_s = stamp_ns, self._steady_s()

    def heave(self, stamp_ns: int, position_m: float, velocity_m_per_s: float) -> bool:
        """Return whether a sample of ship/heave is accepted."""
        refusal = self._clock_fault("heave", stamp_ns)
        if not refusal:
            self._follow("heave", stamp_ns)
            known_ns = min(stamp_ns, self._simulated_ns) if self._simulates else stamp_ns
            self._asked_ns = max(self._asked_ns, known_ns - BEHIND_NS)
            self._heave.at(self._asked_ns)
            refusal = self._heave.submit(stamp_ns, position_m, velocity_m_per_s)
        return self._counted("ship/heave", "heave", stamp_ns, refusal)

    def reading(self, stamp_ns: int, winch: str, row: Row) -> Row:
        """Return the accepted values of a row of winch/measured, None for the others.

        winch: name of its hang-off in the scene.
        """
        nothing: Row = (row[0], None, None, None)
        if row[1:] == nothing[1:]:
            return nothing
        accepted, refusal = nothing, self._clock_fault("winch", stamp_ns)
        if not refusal:
            self._follow(winch, stamp_ns)
            accepted, refusal = self._winches[winch].take(stamp_ns, row, stamp_ns)
        self._counted("winch/measured", winch, stamp_ns, "" if accepted != nothing else refusal)
        if refusal and accepted != nothing:
            self._refuse("winch/measured", refusal)
        return accepted

    def reach_m(self, winch: str, seconds: float) -> float:
        """Return by how much the line out of a winch may change in a time [m]."""
        return self._winches[winch].reach_m(seconds)

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
        """Reset if the clock of a sender went back, as when a bag is replayed."""
        if stamp_ns < self._newest_ns.get(stream, stamp_ns) - ANOTHER_RUN_NS:
            self._begin()

    @property
    def _simulates(self) -> bool:
        """Whether a value of the simulation was received recently."""
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


def pin_fault(predicted: Floats, readings: Floats, deviation_n: float) -> str:
    """Return why a load pin is not to be used, or "".

    predicted: what each member would have read [N], (readings, members); readings: [N],
    (readings,); deviation_n: standard deviation of a reading.
    """
    expected = predicted.mean(axis=1)
    misfit = float(
        np.sqrt(
            np.mean(((readings - expected) / np.hypot(predicted.std(axis=1), deviation_n)) ** 2)
        )
    )
    if misfit > MAX_MISFIT:
        return (
            f"the load pin is left out: it reads {readings.mean() * 1e-3:.4g} kN where the members "
            f"have {expected.mean() * 1e-3:.4g} kN, {misfit:.2g} standard deviations off"
        )
    newest, moved = readings[-STUCK_READINGS:], np.ptp(expected[-STUCK_READINGS:])
    is_equal = len(newest) == STUCK_READINGS and np.ptp(newest) <= 1e-9 * abs(newest[0])
    if is_equal and moved > STUCK_SDS * deviation_n:
        return (
            f"the load pin is left out: it stands at {newest[0] * 1e-3:.4g} kN while the members "
            f"move by {moved * 1e-3:.2g} kN"
        )
    return ""

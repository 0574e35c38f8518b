"""Vortex-induced vibration beside a running twin: its rope in its modes, found again as it changes.

The twin steps the rope at the pace of ship and winch; vortices shake it ten or a hundred times
faster and finer. Here its tension, line out and the water across it, relative to its own motion,
are taken every so often, the natural modes found again, and the vibration carried over
(rope_twin.viv.modal_response). What it costs is counted. The twin's own motion is not changed.
"""

from __future__ import annotations

import time
from dataclasses import dataclass

from rope_twin.core.state import Floats
from rope_twin.errors import InputError, phrase
from rope_twin.scene.rules.rigging import refuse_joined
from rope_twin.twin.twin import Twin
from rope_twin.twin.vibration.rope_span import span_of_rope
from rope_twin.viv.modal_response import ModalResponse
from rope_twin.viv.shedding import Shedding
from rope_twin.viv.span import Span


@dataclass(frozen=True)
class VibrationShot:
    """One instant. Rows run from the hang-off (row 0) down."""

    time_s: float
    from_hang_off_m: Floats  # along the rope, (places,)
    amplitude: Floats  # in diameters
    frequency_hz: Floats  # of the mode that moves a place most; 0 where none does
    slack: bool  # part of the rope is slack: the modes are those from before


class Vibration:
    """Follows a twin; call `follow` after each piece of its way, from the thread that advances it.

    At the lower end swings the payload, with its added mass along x.

    Raises:
        SceneError: ropes meet in the scene.
        InputError: the rope is slack at the start, or `every_s` is not positive.
    """

    def __init__(self, twin: Twin, shedding: Shedding, every_s: float = 1.0) -> None:
        refuse_joined(twin.scene)
        if not every_s > 0.0:
            raise InputError(phrase("vibration", f"modes every {every_s:g} s", "give more than 0"))
        self.every_s = every_s
        self.solves, self.computing_s = 0, 0.0
        self._twin, self._slack = twin, False
        self._began_s = self._solved_s = twin.time_ns * 1e-9
        self._response = ModalResponse(span_of_twin(twin), shedding)

    @property
    def response(self) -> ModalResponse:
        """The rope in its modes, from the lower end up."""
        return self._response

    def follow(self) -> VibrationShot:
        """Go on to the twin's time."""
        began = time.perf_counter()
        now = self._twin.time_ns * 1e-9
        if now >= self._solved_s + self.every_s - 1e-9:
            span = span_of_twin(self._twin)
            self._slack = not (span.tension > 0.0).all()
            if not self._slack:
                self._response.follow(span)
                self.solves += 1
            self._solved_s = now
        ahead = now - self._began_s - self._response.time_s
        if ahead > 0.0:
            self._response.advance(ahead)
        self.computing_s += time.perf_counter() - began
        span = self._response.span
        return VibrationShot(
            now,
            (span.s[-1] - span.s)[::-1].copy(),
            self._response.amplitude[::-1].copy(),
            self._response.dominant_hz[::-1].copy(),
            self._slack,
        )


def span_of_twin(twin: Twin) -> Span:
    """The rope as it is now, with the water across it relative to its own motion."""
    return span_of_rope(twin.rope)

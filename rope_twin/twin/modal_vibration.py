"""Modal VIV response that follows a running twin.

The twin steps the rope at the time scale of ship and winch; vortices shake it ten or a hundred
times faster and on shorter waves. At intervals the rope's tension, payout and the flow relative to
its own motion are sampled, the natural modes solved, and the vibration transferred to them
(rope_twin.vortex.modal_response). Its CPU time is counted. The twin's own motion is unchanged.
"""

from __future__ import annotations

import time
from dataclasses import dataclass

from rope_twin.core.state import Floats
from rope_twin.errors import InputError, phrase
from rope_twin.scene.validation.rigging import refuse_joined
from rope_twin.twin.twin import Twin
from rope_twin.vortex.line_model import Span, line_model
from rope_twin.vortex.modal_response import ModalResponse
from rope_twin.vortex.shedding import Shedding


@dataclass(frozen=True)
class ModalVibrationResult:
    """VIV response at one instant; rows run from the hang-off (row 0) down."""

    time_s: float
    from_hang_off_m: Floats  # along the rope, (nodes,)
    amplitude: Floats  # in diameters
    frequency_hz: Floats  # of the mode with the largest amplitude there; 0 where none
    slack: bool  # part of the rope is slack: the previous modes are kept


class ModalVibration:
    """Modal VIV response of a twin; call `follow` after each `advance`, in the stepping thread.

    The payload moves at the lower end with its added mass along x.

    Raises:
        SceneError: the scene is multi-line.
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
        self._response = ModalResponse(line_model_of_twin(twin), shedding)

    @property
    def response(self) -> ModalResponse:
        """Response in modes, from the lower end up."""
        return self._response

    def follow(self) -> ModalVibrationResult:
        """Advance the response to the twin's time and return it."""
        began = time.perf_counter()
        now = self._twin.time_ns * 1e-9
        if now >= self._solved_s + self.every_s - 1e-9:
            span = line_model_of_twin(self._twin)
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
        return ModalVibrationResult(
            now,
            (span.s[-1] - span.s)[::-1].copy(),
            self._response.amplitude[::-1].copy(),
            self._response.dominant_hz[::-1].copy(),
            self._slack,
        )


def line_model_of_twin(twin: Twin) -> Span:
    """Return the line model of the present rope, with the flow relative to its own motion."""
    return line_model(twin.rope)

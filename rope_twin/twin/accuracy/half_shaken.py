"""A companion whose vortices are computed beside its step, as the twin's: by a model of its own.

What modes make of the rope hangs on its tension and on the water across it, so the model has a
share in the error; the companion's finds its modes itself, on its own rope.
"""

from __future__ import annotations

from dataclasses import replace

from rope_twin.core.state import Boundary, Floats, Rope
from rope_twin.core.step import advance
from rope_twin.scene.schema import Scene
from rope_twin.twin.accuracy.companion import HalfRope
from rope_twin.twin.accuracy.error_bound import EVERY
from rope_twin.twin.accuracy.regrid import HangOff
from rope_twin.twin.vibration.shaking import KeptShaking, Shaking


class HalfShaken(HalfRope):
    """Half the elements and twice the step, shaken by its own model."""

    def __init__(
        self,
        rope: Rope,
        at: HangOff,
        border: tuple[Floats, Floats],
        resting: bool,
        scene: Scene,
        kept: KeptShaking,
    ) -> None:
        """As of any companion; kept: what the twin's model goes on from now."""
        super().__init__(rope, at, border, resting)
        step_s = EVERY * rope.model.step
        slower = replace(scene, time=replace(scene.time, step_s=step_s))
        self._shaking, self._done = Shaking(slower, self._rope), 0
        if not self.rests:
            self._shaking.take_back(kept._replace(looked=0))

    def _advance(self, start_s: float, steps: int) -> int:
        """Step on from look to look."""
        step, done = self._rope.model.step, 0
        while done < steps:
            some = min(steps - done, self._shaking.steps_to_look(self._done))
            borders = Boundary(*(table[done : done + some + 1] for table in self._ahead))
            went = advance(self._rope, borders, self._pulls[done:], start_s + done * step, some)
            done += went
            self._done += went
            if went < some:
                break
            if self._shaking.steps_to_look(self._done) == 0:
                now = Boundary(*(table[done:] for table in self._ahead))
                self._shaking.look(self._rope, now, self._done, 0)
        return done

"""Simulation of one scene (`Twin`), which can be saved, restored and branched.

Inputs carry a time stamp and are accepted from any thread; `advance`, `snapshot` and the methods
that save a state belong to one thread.
"""

from __future__ import annotations

import copy
import threading
from pathlib import Path
from typing import Any, Self

from rope_twin.core import state as rows
from rope_twin.errors import SolverError, StateError
from rope_twin.scene.schema import Scene
from rope_twin.twin.cutting.cut_input import rope_number
from rope_twin.twin.saving import saved_state
from rope_twin.twin.saving.saved_state import SavedState, StateDescription
from rope_twin.twin.stepper import TwinStepper

# Attributes given by the scene or the caller; all others change and belong to a saved state.
_GIVEN = (
    "scene", "step_s", "step_ns", "failure_folder", "_card_error", "_lock", "_pulls",
    "_rope", "_ropes", "_base", "_ahead", "_viv_drag", "told", "_winch_names", "_first_winch_names",
    "_own_motion", "_judges_motion", "_motion_judged", "_load_rules",
)  # fmt: skip


class Twin(TwinStepper):
    """Real-time simulation of one scene; its state can be saved, restored and branched.

    Raises:
        SceneError: the scene cannot be built, or its rope has no static equilibrium to start from.
    """

    def __init__(self, scene: Scene) -> None:
        self.failure_folder: Path | None = None  # for the state from which a step failed
        super().__init__(scene)

    def advance(self, steps: int) -> None:
        """Advance by this number of time steps.

        Raises:
            SolverError: the next state would not be finite. The last good state is kept; with the
                inputs of the failing step it is written to `failure_folder`, if that is set.
        """
        try:
            super().advance(steps)
        except SolverError as error:
            raise SolverError(str(error).removesuffix(".") + self._keep_failure(error)) from error

    def _keep_failure(self, error: SolverError) -> str:
        """Write the state from which the step failed; return the end of the error message."""
        if self.failure_folder is None:
            return "."
        path = self.failure_folder / f"{self.scene.name}_failed_step_{self._steps + 1}.state"
        try:
            self.capture(str(error)).write(path)
        except StateError as trouble:
            return f"; {trouble}"
        return f"; state and inputs of that step are in {path}."

    def save(self, path: str | Path) -> None:
        """Write a state from which `restore` resumes bit-identically; for the stepping thread.

        Raises:
            StateError: the file cannot be written; an existing file of this name is kept.
        """
        self.capture().write(Path(path))

    @classmethod
    def restore(cls, saved: str | Path | SavedState, scene: Scene) -> Self:
        """Return a twin that resumes from a saved state of this scene.

        saved: the state, or the path of its file.

        Raises:
            StateError: the file is invalid, or the scene differs; the message names the difference.
            SceneError: as for a new twin.
        """
        state = saved if isinstance(saved, SavedState) else saved_state.load_state(saved)
        saved_state.check_scene(state, scene)
        twin = cls(scene)
        if (level := state.level) != twin.level:
            twin.set_level(level)
        if (lost_m := state.about.cut_lost_m) > 0.0:  # anywhere: arrays are restored below
            rope = rope_number(scene, state.about.cut_rope)
            twin._split(0.5 * twin._length_m(rope), rope)
            twin._record_cut(lost_m, state.about.cut_left_m, rope)
        digest = twin._validity.digest
        values = state.restore_into(twin._changing())
        twin._rope = twin._rope._replace(
            **{name: values.pop(f"rope/{name}") for name in saved_state.changing_parts(twin._rope)},
            effects=values["_current"].effects,
            model=values.pop("rope/model", twin._rope.model),
        )
        twin._tension[:] = values.pop("rope/tension")
        twin._ahead.boundary = values.pop("_boundary")
        twin._ahead.steps = values.pop("_prescribed")
        twin._ropes.take_back(values, twin._rope)
        if twin._viv_drag is not None:
            twin._viv_drag.take_back(values.pop("viv_drag"))
        vars(twin).update(values)
        twin._validity.resume(digest)
        return twin

    def branch(self) -> Twin:
        """Return an independent, bit-identical copy; call it from the stepping thread."""
        with self._lock:
            twin = copy.copy(self)
            shared: dict[int, Any] = {id(self.scene): self.scene, id(self._lock): threading.Lock()}
            shared[id(self._own_motion)] = self._own_motion
            vars(twin).update(copy.deepcopy(vars(self), shared))
        return twin

    def capture(self, failure: str = "") -> SavedState:
        """Return in memory the state that `save` writes; call it from the stepping thread.

        failure: the error message, if a step from this state failed.
        """
        state, (value, rate) = self._rope.state, self._boundary
        payload = self._ropes.lowest(self._rope).state.nodes[rows.POSITION : rows.POSITION + 3, 0]
        cut = self._cut.done
        about = StateDescription(
            **saved_state.stamp(self.scene, failure),
            time_s=self.time_ns * 1e-9,
            step=self._steps,
            step_s=self.step_s,
            halvings=self._level.halvings,
            elements=int(state.counts[rows.ELEMENTS]),
            line_out_m=float(value[0, rows.LINE]),
            payout_speed_m_per_s=float(rate[0, rows.LINE]),
            tension_top_n=float(self._pull[rows.PULL]),
            payload_position_m=tuple(payload.tolist()),
            cut_lost_m=cut.lost_m if cut else 0.0,
            cut_left_m=cut.left_m if cut else 0.0,
            cut_rope=cut.rope if cut else "",
        )
        with self._lock:
            return saved_state.take(self._changing(), about, self.scene)

    def _changing(self) -> dict[str, Any]:
        """Return every attribute that a restart needs; effects in use are those of `_current`."""
        kept = {name: value for name, value in vars(self).items() if name not in _GIVEN}
        parts = saved_state.changing_parts(self._rope)
        rope = {f"rope/{name}": getattr(self._rope, name) for name in parts}
        ahead = {"_boundary": self._ahead.boundary, "_prescribed": self._ahead.steps}
        if self._viv_drag is not None:
            kept["viv_drag"] = self._viv_drag.kept()
        return kept | rope | ahead | {"rope/tension": self._tension} | self._ropes.changing()

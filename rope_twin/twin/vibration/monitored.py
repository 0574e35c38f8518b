"""Twin with vibration and fatigue monitors.

The monitors exist only if a run asks for them, and the run is bit-identical with them. They sample
the rope at equal times, often enough to resolve the fastest vortices.
"""

from __future__ import annotations

import time
from dataclasses import replace
from pathlib import Path
from typing import Any, ClassVar, Self

import numpy as np

from rope_twin.core import state as rows
from rope_twin.core.state import Floats
from rope_twin.effects.bending import BendingParams
from rope_twin.errors import InputError, StateError, phrase
from rope_twin.scene.schema import Scene
from rope_twin.scene.validation.rigging import refuse_joined
from rope_twin.scene.validation.vortices import model_beside, shedding_model, strouhal_number
from rope_twin.twin.accuracy.level import AccuracyLevel
from rope_twin.twin.fatigue.curves import wire_curve_warning
from rope_twin.twin.fatigue.damage import DamageSettings, RopeDamage, bending_stiffness, curvature
from rope_twin.twin.results import MaterialFatigue, RopeVibration
from rope_twin.twin.saving.saved_state import MONITOR_PREFIX, SavedState, load_state
from rope_twin.twin.saving.state_file import deserialise
from rope_twin.twin.snapshot import Snapshot, amended
from rope_twin.twin.twin import Twin
from rope_twin.twin.vibration.coupled_model import (
    CoupledModel,
    force_decomposition_model,
    modal_model,
)
from rope_twin.twin.vibration.measured import MeasuredVibration
from rope_twin.twin.vibration.sampling import needs_new_interval, sampling_steps, shedding_hz
from rope_twin.twin.vibration.settings import DECOMPOSED, MODES, MOTION, MonitorSettings
from rope_twin.viv.decomposed import decomposed
from rope_twin.viv.shedding import Shedding

SECOND_NS = 1_000_000_000  # interval of the fatigue results


class MonitoredTwin(Twin):
    """A twin with the monitors of `asked`; a saved state includes their counts and averages.

    Raises:
        SceneError: as for a twin, or the scene is multi-line.
        InputError: a requested monitor is not possible for the scene.
    """

    asked: ClassVar[MonitorSettings]

    def __init__(self, scene: Scene) -> None:
        refuse_joined(scene, "what watches vibration or fatigue")
        model = shedding_model(scene)
        if self.asked.vibration == MOTION and not model:
            what = "the scene lists no model of vortices, so nothing shakes its rope"
            right = f"list one of them, or ask for one beside the twin: {MODES}, {DECOMPOSED}"
            raise InputError(phrase(f"vibration {MOTION}", what, right))
        if self.asked.vibration and model_beside(scene) is not None:
            what = f"the scene's own {model} tells how the rope shakes without being asked"
            right = "leave it out"
            raise InputError(phrase(f"vibration {self.asked.vibration}", what, right))
        if self.asked.vibration in (MODES, DECOMPOSED) and model:
            what = f"the scene's own {model} shakes its rope already"
            raise InputError(phrase(f"vibration {self.asked.vibration}", what, f"ask for {MOTION}"))
        # before the twin is built, as it may be rejected
        damage = self._new_damage(scene) if self.asked.fatigue else None
        super().__init__(scene)
        self._strouhal, self._damage = strouhal_number(scene), damage
        self._hz = 0.0  # vortex frequency of the sampling interval
        self._profiles = 0  # number of current profiles accepted by then
        self._every = self._steps_between()
        self._tracker = self._coupled_model()  # a monitor of the twin's motion starts with the flow
        self.told = self._tracker.told if isinstance(self._tracker, CoupledModel) else self.told
        if self.asked.fatigue:
            others = wire_curve_warning(scene.ropes[0], self.asked.fatigue, _stiffness(scene))
            self.told = "\n".join(words for words in (self.told, others) if words)
        self._counting_from_ns, self._second = self.time_ns, -1
        self._fatigue: MaterialFatigue | None = None
        self._watch_s = self._watched_s = 0.0  # CPU time of the monitors, and twin time covered

    @classmethod
    def restore(cls, saved: str | Path | SavedState, scene: Scene) -> Self:
        """Return a twin that resumes from a saved state.

        Raises:
            StateError: as for a twin, or its fatigue was counted by another curve.
        """
        state = saved if isinstance(saved, SavedState) else load_state(saved)
        twin = super().restore(state, scene)
        twin._take_back(state)
        return twin

    def snapshot(self) -> Snapshot:
        """Return a frozen copy of the present with the results of the monitors."""
        taken = super().snapshot()
        if self._viv_drag is None:
            amended(taken, vibration=self._vibration())
        return amended(taken, fatigue=self._fatigue)

    def set_level(self, level: AccuracyLevel) -> None:
        """Continue on another accuracy level, as a twin does."""
        super().set_level(level)
        self._every = self._steps_between()

    def _changing(self) -> dict[str, Any]:
        own = ("told", "_strouhal", "_damage", "_tracker", "_hz", "_profiles", "_every",
               "_counting_from_ns", "_second", "_fatigue", "_watch_s", "_watched_s")  # fmt: skip
        changing = {name: value for name, value in super()._changing().items() if name not in own}
        if self._damage is not None:
            changing[f"{MONITOR_PREFIX}wear"] = self._damage
            changing[f"{MONITOR_PREFIX}counting_from_ns"] = self._counting_from_ns
        if self._tracker is not None and self._viv_drag is None:
            changing[f"{MONITOR_PREFIX}model"] = self.asked.vibration
            changing[f"{MONITOR_PREFIX}tracker"] = self._tracker.kept()
            changing[f"{MONITOR_PREFIX}looks"] = [self._hz, self._profiles]
        return changing

    def _take_back(self, state: SavedState) -> None:
        """Restore the monitors that both the state and this run have."""
        kept = {
            name.removeprefix(MONITOR_PREFIX): plain
            for name, plain in state.memory["monitors"].items()
            if name.startswith(MONITOR_PREFIX)
        }
        self._counting_from_ns = kept.get("counting_from_ns", self.time_ns)
        if self._damage is not None and "wear" in kept:
            begun = kept["wear"]["fields"]["name"]
            if begun != self._damage.name:
                what = f"its fatigue was counted by the curve {begun}, not {self._damage.name}"
                raise StateError(phrase(f"saved state {state.source}", what, f"ask for {begun}"))
            self._damage = deserialise(
                kept["wear"], self._damage, state.arrays, f"{MONITOR_PREFIX}wear"
            )
        self._tracker = self._coupled_model()
        if self.asked.vibration and kept.get("model") == self.asked.vibration:
            self._hz, self._profiles = kept["looks"]
            self._every = self._steps_between()
            tracker = self._tracker or self._measured_vibration()
            tracker.take_back(
                deserialise(
                    kept["tracker"], tracker.kept(), state.arrays, f"{MONITOR_PREFIX}tracker"
                )
            )
            self._tracker = tracker

    def _split(self, lost_m: float, rope: int = 0) -> float:
        """Cut a rope; the vibration monitor restarts on the part left."""
        self._tracker, self._hz = None, 0.0
        return super()._split(lost_m, rope)

    def _advance_some(self, steps: int) -> int:
        viv_drag = self._viv_drag
        own = self._every - self._steps % self._every
        due = own if viv_drag is None else viv_drag.steps_to_sampling(self._steps)
        done = super()._advance_some(min(steps, due))
        if done == due:
            began = time.perf_counter()
            self._look()
            spent = time.perf_counter() - began
            self._watch_s += spent
            self._watched_s += self._every * self.step_s
            self._computing_s += spent
        return done

    def _look(self) -> None:
        """Sample the rope; once a second also update the interval and the fatigue results."""
        second = self.time_ns // SECOND_NS
        new, self._second = second != self._second, second
        if new:
            self._update_interval()
        rope = self.rope
        if self._tracker is not None and self._viv_drag is None:
            self._tracker.take(rope, self._every * self.step_s, self._hz)
        if self._damage is not None:
            if self._cut.done:
                self._damage.cut_off(self._cut.done.lost_m)
            self._damage.take(rope, float(self._pull[rows.PULL]), self._bent())
            if new:
                counted_s = (self.time_ns - self._counting_from_ns) * 1e-9
                line_out = float(self._boundary.value[0, rows.LINE])
                self._fatigue = self._damage.shot(line_out, counted_s)

    def _update_interval(self) -> None:
        """Adapt the sampling interval to the vortex frequency; only a new current extends it."""
        if self._viv_drag is not None or not (self.asked.vibration or shedding_model(self.scene)):
            return
        hz = shedding_hz(self.rope, self._boundary, self._strouhal)
        profiles = self._current.counter.health(self.time_ns, False).accepted
        if needs_new_interval(hz, self._hz, profiles != self._profiles):
            self._hz, self._profiles = hz, profiles
            self._every = self._steps_between()
            if self.asked.vibration == MOTION:
                self._tracker = self._measured_vibration() if hz > 0.0 else None

    def _steps_between(self) -> int:
        """Return the number of steps between samples."""
        return sampling_steps(self._hz, self.step_s)

    def _measured_vibration(self) -> MeasuredVibration:
        return MeasuredVibration(self.rope, self._every * self.step_s, self._hz)

    def _coupled_model(self) -> MeasuredVibration | CoupledModel | None:
        """Return the loosely coupled model of the scene or of the run in its initial state."""
        if self._viv_drag is not None:
            return self._viv_drag.tracker
        density = self.scene.environment.water_density_kg_per_m3
        if self.asked.vibration == MODES:
            return modal_model(self.rope, Shedding(strouhal=self._strouhal, density=density))
        if self.asked.vibration == DECOMPOSED:
            return force_decomposition_model(self.rope, replace(decomposed(), density=density))
        return None

    def _new_damage(self, scene: Scene) -> RopeDamage:
        line, winch = scene.ropes[0], scene.winch
        EI = _stiffness(scene)
        most = winch.most_line_out_m if winch else line.length_m
        shaken = model_beside(scene) is not None or self.asked.vibration in (MODES, DECOMPOSED)
        sheave = winch.sheave if winch else None
        bent_pa = sheave.bending_stress_pa(line.made_of[0].rope.diameter_m) if sheave else 0.0
        return RopeDamage(
            line, most, DamageSettings(self.asked.fatigue, EI > 0.0 or shaken, bent_pa), EI
        )

    def _bent(self) -> Floats | None:
        """Curvature of rope and vibration per metre [1/m], (2, metres); None: not counted."""
        if self._damage is None or not self._damage.bends:
            return None
        lost_m = self._cut.done.lost_m if self._cut.done else 0.0
        middles = self._damage.middles - lost_m
        bent = np.zeros((2, len(middles)))
        if bending_stiffness(self._rope.effects) > 0.0:
            s, own = curvature(self._rope)
            bent += [np.interp(middles, s, part) for part in own]
        shaken = self._tracker.bent(self._rope, middles) if self._tracker is not None else None
        return bent if shaken is None else bent + shaken

    def _vibration(self) -> RopeVibration | None:
        viv_drag = self._tracker.shot(self._rope) if self._tracker is not None else None
        if viv_drag is None:
            return None
        watched_s = max(self._watched_s, self.step_s)
        return replace(viv_drag, cost_pct=100.0 * self._watch_s / watched_s)


def _stiffness(scene: Scene) -> float:
    """Return the bending stiffness EI of the scene's rope [N·m²]; 0: none."""
    return sum(own.stiffness_n_m2 for own in scene.effects if isinstance(own, BendingParams))

"""Twin with vibration and fatigue monitors; a run is bit-identical with them."""

from __future__ import annotations

from pathlib import Path
from typing import Any, ClassVar, Self

from rope_twin.core import state as rows
from rope_twin.effects.bending import BendingParams
from rope_twin.errors import StateError, phrase
from rope_twin.scene.model.grid import ends_m
from rope_twin.scene.schema import Scene
from rope_twin.scene.validation.rigging import refuse_joined
from rope_twin.scene.validation.vortices import model_beside, shedding_model, strouhal_number
from rope_twin.twin.accuracy.level import AccuracyLevel
from rope_twin.twin.pacing import steps_in_slot
from rope_twin.twin.saving.saved_state import MONITOR_PREFIX, SavedState, load_state
from rope_twin.twin.saving.state_file import deserialise
from rope_twin.twin.snapshot import Snapshot, amended
from rope_twin.twin.twin import Twin
from rope_twin.vortex.damage import DamageSettings, RopeDamage
from rope_twin.vortex.fatigue import wire_curve_warning
from rope_twin.vortex.monitor import RopeMonitor, Sample, Vortices, check_monitors
from rope_twin.vortex.settings import FREQUENCY_DOMAIN, MonitorSettings


class MonitoredTwin(Twin):
    """A twin with the monitors of `asked`; a saved state includes their counts and averages.

    Raises:
        SceneError: as for a twin, or the scene is multi-line.
        InputError: a requested monitor is not possible for the scene.
    """

    asked: ClassVar[MonitorSettings]

    def __init__(self, scene: Scene) -> None:
        refuse_joined(scene, "vibration or fatigue monitoring")
        model, coupled = shedding_model(scene), model_beside(scene) is not None
        check_monitors(self.asked, model, coupled)
        EI = sum(own.stiffness_n_m2 for own in scene.effects if isinstance(own, BendingParams))
        # before the twin is built, as it may be rejected
        damage = _new_damage(scene, self.asked, EI) if self.asked.fatigue else None
        super().__init__(scene)
        density = scene.environment.water_density_kg_per_m3
        self._monitor = RopeMonitor(
            self.asked, Vortices(model, strouhal_number(scene), density), self.rope,
            (self.step_s, steps_in_slot(self.step_s)), damage, self._viv_drag,
        )  # fmt: skip
        self._monitor.counting_from_ns = self.time_ns
        self.told = self._monitor.told or self.told
        if self.asked.fatigue:
            others = wire_curve_warning(scene.ropes[0], self.asked.fatigue, EI)
            self.told = "\n".join(words for words in (self.told, others) if words)

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
            amended(taken, vibration=self._monitor.vibration(self._rope))
        return amended(taken, fatigue=self._monitor.fatigue)

    def set_level(self, level: AccuracyLevel) -> None:
        """Continue on another accuracy level, as a twin does."""
        super().set_level(level)
        self._monitor.set_step(self.step_s, steps_in_slot(self.step_s))

    def _changing(self) -> dict[str, Any]:
        kept = self._monitor.kept()
        return {
            **super()._changing(),
            **{f"{MONITOR_PREFIX}{name}": one for name, one in kept.items()},
        }

    def _take_back(self, state: SavedState) -> None:
        """Restore the monitors that both the state and this run have."""
        kept = {
            name.removeprefix(MONITOR_PREFIX): plain
            for name, plain in state.memory["monitors"].items()
            if name.startswith(MONITOR_PREFIX)
        }

        def read(name: str, template: Any) -> Any:
            return deserialise(kept[name], template, state.arrays, f"{MONITOR_PREFIX}{name}")

        begun = kept["wear"]["fields"]["name"] if "wear" in kept else self.asked.fatigue
        if self.asked.fatigue and begun != self.asked.fatigue:
            what = f"its fatigue was counted by the curve {begun}, not {self.asked.fatigue}"
            raise StateError(phrase(f"saved state {state.source}", what, f"ask for {begun}"))
        self._monitor.take_back(kept, self.rope, self.time_ns, read)

    def _split(self, lost_m: float, rope: int = 0) -> float:
        """Cut a rope; the vibration monitor restarts on the part left."""
        self._monitor.cut()
        return super()._split(lost_m, rope)

    def _advance_some(self, steps: int) -> int:
        due = self._monitor.steps_to_sampling(self._steps)
        done = super()._advance_some(min(steps, due))
        if done == due:
            self._computing_s += self._monitor.observe(self._sample())
        return done

    def _sample(self) -> Sample:
        return Sample(
            rope=self.rope,
            boundary=self._boundary,
            time_ns=self.time_ns,
            top_tension_n=float(self._pull[rows.PULL]),
            line_out_m=float(self._boundary.value[0, rows.LINE]),
            lost_m=self._cut.done.lost_m if self._cut.done else 0.0,
            profiles=self._current.counter.health(self.time_ns, False).accepted,
        )


def _new_damage(scene: Scene, asked: MonitorSettings, EI: float) -> RopeDamage:
    line, winch = scene.ropes[0], scene.winch
    most = winch.most_line_out_m if winch else line.length_m
    vibrates = model_beside(scene) is not None or asked.vibration == FREQUENCY_DOMAIN
    sheave = winch.sheave if winch else None
    bent_pa = sheave.bending_stress_pa(line.made_of[0].rope.diameter_m) if sheave else 0.0
    settings = DamageSettings(asked.fatigue, EI > 0.0 or vibrates, bent_pa)
    return RopeDamage(line, ends_m(line), most, settings, EI)

"""Monitor of vibration and fatigue: it passes samples of a twin to a `RopeMonitor`."""

from __future__ import annotations

from typing import Any

from rope_twin.core import state as rows
from rope_twin.effects.bending import BendingParams
from rope_twin.errors import StateError, phrase
from rope_twin.scene.model.grid import ends_m
from rope_twin.scene.schema import Scene
from rope_twin.scene.validation.rigging import refuse_joined
from rope_twin.scene.validation.vortices import coupled_settings, model_beside, shedding_model
from rope_twin.twin.monitors.monitor import Chunk, Monitor, TwinView
from rope_twin.twin.pacing import steps_in_slot
from rope_twin.twin.saving.saved_state import SavedState
from rope_twin.twin.snapshot import Snapshot, amended
from rope_twin.vortex.damage import DamageSettings, RopeDamage
from rope_twin.vortex.fatigue import wire_curve_warning
from rope_twin.vortex.monitor import RopeMonitor, Sample, check_monitors
from rope_twin.vortex.settings import FREQUENCY_DOMAIN, MonitorSettings

PREFIX = "vortex/"  # of the names in a saved state


class VortexMonitor(Monitor):
    """Monitor of vibration and fatigue of a single rope.

    A saved state includes its counts and averages.

    Raises:
        SceneError: the scene is multi-line.
        InputError: a requested monitor is not possible for the scene.
    """

    rope: RopeMonitor
    _due_at = 0  # step of the next sampling

    def __init__(self, scene: Scene, asked: MonitorSettings) -> None:
        refuse_joined(scene, "vibration or fatigue monitoring")
        check_monitors(asked, shedding_model(scene), model_beside(scene) is not None)
        self._asked = asked
        self._EI = sum(
            own.stiffness_n_m2 for own in scene.effects if isinstance(own, BendingParams)
        )
        self._damage = _new_damage(scene, asked, self._EI) if asked.fatigue else None

    def start(self, now: TwinView, present: Chunk) -> None:
        """Start without vibration or damage."""
        scene = now.scene
        interval, vortices = (now.step_s, steps_in_slot(now.step_s)), coupled_settings(scene)
        self.rope = RopeMonitor(
            self._asked, vortices, now.rope, interval, self._damage, now.viv_drag
        )
        self.rope.counting_from_ns = now.time_ns
        texts = [self.rope.told if now.viv_drag is None else ""]
        if self._asked.fatigue:
            texts.append(wire_curve_warning(scene.ropes[0], self._asked.fatigue, self._EI))
        self.told = "\n".join(text for text in texts if text)

    def restart(self, now: TwinView, present: Chunk) -> None:
        """Adapt the sampling to the step; counts and averages continue."""
        self.rope.set_step(now.step_s, steps_in_slot(now.step_s))

    def steps_to_observation(self, now: TwinView) -> int:
        """Return the number of steps until the next sampling."""
        due = self.rope.steps_to_sampling(now.clock.steps)
        self._due_at = now.clock.steps + due
        return due

    def observe(self, now: TwinView, chunk: Chunk) -> None:
        """Sample the rope if that is due."""
        if chunk.steps == self._due_at:
            self.rope.observe(
                Sample(
                    rope=now.rope,
                    boundary=now.boundary,
                    time_ns=now.time_ns,
                    top_tension_n=float(now.pull[rows.PULL]),
                    line_out_m=now.line[0],
                    lost_m=now.cut.lost_m if now.cut else 0.0,
                    profiles=now.inputs.current.counter.accepted,
                )
            )

    def amend(self, now: TwinView, shot: Snapshot) -> Snapshot:
        """Return the snapshot with vibration and fatigue."""
        if now.viv_drag is None:
            amended(shot, vibration=self.rope.vibration(now.rope))
        return amended(shot, fatigue=self.rope.fatigue)

    def cut(self, now: TwinView) -> None:
        """Restart the vibration monitor on the part that is left."""
        self.rope.cut()

    def state(self) -> dict[str, Any]:
        """Return counts and averages."""
        return {f"{PREFIX}{name}": one for name, one in self.rope.kept().items()}

    def restore(self, now: TwinView, present: Chunk, saved: SavedState) -> None:
        """Continue with counts and averages.

        Raises:
            StateError: fatigue was counted by another curve.
        """
        kept = saved.of_monitor(PREFIX)
        curve = self._asked.fatigue
        begun = kept["wear"]["fields"]["name"] if "wear" in kept else curve
        if curve and begun != curve:
            what = f"its fatigue was counted by the curve {begun}, not {curve}"
            raise StateError(phrase(f"saved state {saved.source}", what, f"ask for {begun}"))
        self.rope.set_step(now.step_s, steps_in_slot(now.step_s))

        def read(name: str, like: Any) -> Any:
            return saved.read_monitor(f"{PREFIX}{name}", like)

        self.rope.take_back(kept, now.rope, now.time_ns, read)


def _new_damage(scene: Scene, asked: MonitorSettings, EI: float) -> RopeDamage:
    line, winch = scene.ropes[0], scene.winch
    most = winch.most_line_out_m if winch else line.length_m
    vibrates = model_beside(scene) is not None or asked.vibration == FREQUENCY_DOMAIN
    sheave = winch.sheave if winch else None
    bent_pa = sheave.bending_stress_pa(line.made_of[0].rope.diameter_m) if sheave else 0.0
    settings = DamageSettings(asked.fatigue, EI > 0.0 or vibrates, bent_pa)
    return RopeDamage(line, ends_m(line), most, settings, EI)

"""Monitor of vibration and fatigue: it passes samples of a twin to the `RopeMonitor` of each line.

Each rope of a multi-line system is monitored separately; ropes in series through bare connections
are one line (rope_twin.vortex.line_model).

Two ropes that run as one over a sheave share a fatigue count: its material is that of the first of
them in the scene, from its far end, followed by that of the other.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from rope_twin.core import state as rows
from rope_twin.core.state import Rope
from rope_twin.effects.bending import BendingParams
from rope_twin.errors import StateError, phrase
from rope_twin.scene.grid import ends_m
from rope_twin.scene.joined_model import over_sheaves
from rope_twin.scene.rigging import is_joined, runs_over_sheave, winch_of
from rope_twin.scene.rope_data import endurance, own_curve
from rope_twin.scene.schema import RopeLine, Scene
from rope_twin.scene.vortex import coupled_settings, model_beside, shedding_model
from rope_twin.scene.winch import BendingSheave
from rope_twin.twin.monitors import Chunk, Monitor, TwinView
from rope_twin.twin.pacing import steps_in_slot
from rope_twin.twin.snapshot import Snapshot, amended
from rope_twin.twin.state import SavedState
from rope_twin.vortex.fatigue import OWN, reach_m, wire_curve_warning
from rope_twin.vortex.line_model import lines_of, one_rope
from rope_twin.vortex.monitor import RopeMonitor, RopeSample, Sample, check_monitors, wear_name
from rope_twin.vortex.results import (
    FREQUENCY_DOMAIN,
    SEGMENT_M,
    DamageSettings,
    MonitorSettings,
    RopeDamage,
    RopeVibration,
)

PREFIX = "vortex/"  # of the names in a saved state


def uncounted_fatigue(saved: SavedState, asked: MonitorSettings) -> str:
    """Return that a run leaves out the fatigue that a saved state has, in a sentence, or ""."""
    wear = saved.of_monitor(PREFIX).get(wear_name(0))
    if asked.fatigue or wear is None:
        return ""
    curve = wear["fields"]["name"]
    problem = f"its fatigue by the curve {curve} is not counted on, and not saved again"
    return phrase(f"saved state {saved.source}", problem, f"ask for fatigue {curve} to continue it")


Numbers = tuple[int, ...]  # of the ropes of a line, from its lower end up


class VortexMonitor(Monitor):
    """Monitor of vibration and fatigue of each rope.

    A saved state includes its counts and averages.

    Raises:
        InputError: a requested monitor is not possible for the scene.
    """

    lines: dict[Numbers, RopeMonitor]  # by the ropes of the line

    def __init__(self, scene: Scene, settings: MonitorSettings) -> None:
        check_monitors(settings, shedding_model(scene), model_beside(scene) is not None)
        self._asked = settings
        self._damages: dict[int, RopeDamage] = {}  # by rope
        vibrates = model_beside(scene) is not None or settings.vibration == FREQUENCY_DOMAIN
        for number, line in enumerate(scene.ropes if settings.fatigue else ()):
            bends = vibrates or bending_stiffness_of(scene, line) > 0.0
            if (damage := damage_of(scene, number, settings.fatigue, bends)) is not None:
                self._damages[number] = damage
        self._due: dict[Numbers, int] = {}  # step of the next sampling

    def start(self, view: TwinView, present: Chunk) -> None:
        """Start without vibration or damage."""
        scene = view.scene
        self.lines = {}
        for numbers in self._numbers(view):
            line = self._new_monitor(view, numbers, self._asked)
            line.counting_from_ns = view.time_ns
            self.lines[numbers] = line
        warnings = [line.notice if view.viv_drag is None else "" for line in self.lines.values()]
        if self._asked.fatigue:
            curve = self._asked.fatigue
            warnings += [
                wire_curve_warning(line, curve, bending_stiffness_of(scene, line))
                for line in scene.ropes
            ]
        self.notice = "\n".join(text for text in warnings if text)

    def restart(self, view: TwinView, present: Chunk) -> None:
        """Adapt the sampling to the step; counts and averages continue."""
        for line in self.lines.values():
            line.set_step(view.step_s, steps_in_slot(view.step_s))

    def steps_to_observation(self, view: TwinView) -> int:
        """Return the number of steps until the next sampling."""
        done = view.clock.steps
        self._due = {
            numbers: done + line.steps_to_sampling(done) for numbers, line in self.lines.items()
        }
        return min(self._due.values()) - done

    def observe(self, view: TwinView, chunk: Chunk) -> None:
        """Sample the lines for which that is due."""
        for numbers, line in self.lines.items():
            if chunk.steps == self._due.get(numbers):
                line.observe(_sample(view, numbers))

    def amend(self, view: TwinView, snapshot: Snapshot) -> Snapshot:
        """Return the snapshot with vibration and fatigue."""
        if view.joined is not None:
            return self._amend_ropes(view, snapshot)
        (line,) = self.lines.values()
        if view.viv_drag is None:
            amended(snapshot, vibration=_with_cost(line.vibration(view.rope), line.cost_pct))
        return amended(snapshot, fatigue=line.fatigue[0] if line.fatigue else None)

    def _amend_ropes(self, view: TwinView, snapshot: Snapshot) -> Snapshot:
        """Return the snapshot of a multi-line system with the results of each rope."""
        cost_pct = sum(line.cost_pct for line in self.lines.values())
        snapshots = list(snapshot.ropes)
        for numbers, line in self.lines.items():
            ropes = [view.ropes.all_with(view.rope)[r] for r in numbers]
            response = _with_cost(line.vibration(one_rope(ropes)), cost_pct)
            parts = [None] * len(ropes) if response is None else _parts(response, ropes)
            damages = line.fatigue or (None,) * len(ropes)
            for r, vibration, fatigue in zip(numbers, parts, damages, strict=True):
                if vibration is not None and runs_over_sheave(view.scene, view.scene.ropes[r]):
                    vibration = _at_nodes(vibration, slice(None, None, -1))
                if view.viv_drag is not None:  # the snapshot has it already
                    vibration = snapshots[r].vibration
                snapshots[r] = replace(snapshots[r], vibration=vibration, fatigue=fatigue)
        snapshot = amended(snapshot, ropes=tuple(snapshots), fatigue=snapshots[0].fatigue)
        return (
            snapshot
            if view.viv_drag is not None
            else amended(snapshot, vibration=snapshots[0].vibration)
        )

    def cut(self, view: TwinView) -> None:
        """Restart the vibration monitor on the remaining part; the lower part is not monitored."""
        cut = _cut_rope(view)
        before, self.lines = self.lines, {}
        for numbers in self._numbers(view):
            line = before.get(numbers)
            if line is None:  # a part of a line of several ropes, with other modes than the whole
                (whole_line,) = (
                    old for old_numbers, old in before.items() if numbers[0] in old_numbers
                )
                line = self._new_monitor(view, numbers, replace(self._asked, vibration=""))
                line.counting_from_ns = whole_line.counting_from_ns
            elif cut in numbers:
                line.cut()
            self.lines[numbers] = line

    def state(self) -> dict[str, Any]:
        """Return counts and averages."""
        return {
            f"{self._prefix(numbers)}{name}": value
            for numbers, line in self.lines.items()
            for name, value in line.kept().items()
        }

    def restore(self, view: TwinView, present: Chunk, saved: SavedState) -> None:
        """Continue with counts and averages.

        Raises:
            StateError: fatigue was counted by another curve.
        """
        if view.cut is not None:
            self.cut(view)
        for numbers, line in self.lines.items():
            prefix = self._prefix(numbers)
            kept = saved.of_monitor(prefix)
            curve = self._asked.fatigue
            counted_curve = kept[wear_name(0)]["fields"]["name"] if wear_name(0) in kept else curve
            if curve and counted_curve != curve:
                problem = f"its fatigue was counted by the curve {counted_curve}, not {curve}"
                raise StateError(f"saved state {saved.source}", problem, f"ask for {counted_curve}")
            line.set_step(view.step_s, steps_in_slot(view.step_s))

            def read(name: str, like: Any, prefix: str = prefix) -> Any:
                return saved.read_monitor(f"{prefix}{name}", like)

            line.take_back(
                kept,
                one_rope([view.ropes.all_with(view.rope)[r] for r in numbers]),
                view.time_ns,
                read,
            )

    def _prefix(self, numbers: Numbers) -> str:
        """Return the prefix of a line's names in a saved state."""
        return PREFIX if numbers == (0,) else f"{PREFIX}{numbers[-1]}/"

    def _numbers(self, view: TwinView) -> list[Numbers]:
        """Return the ropes of each line; the lower part of a cut rope is not monitored."""
        joined = view.joined
        if joined is None or not is_joined(view.scene):
            return [(0,)]
        if view.viv_drag is not None:  # a model of each rope
            return [(r,) for r in range(len(view.scene.ropes))]
        return lines_of(joined.system(view.rope), len(view.scene.ropes))

    def _new_monitor(
        self, view: TwinView, numbers: Numbers, settings: MonitorSettings
    ) -> RopeMonitor:
        vortices = coupled_settings(view.scene)
        interval = view.step_s, steps_in_slot(view.step_s)
        damages = tuple(self._damages[r] for r in numbers if r in self._damages)
        rope = one_rope([view.ropes.all_with(view.rope)[r] for r in numbers])
        return RopeMonitor(settings, vortices, rope, interval, damages, view.viv_drag, numbers[-1])


def _cut_rope(view: TwinView) -> int:
    """Return the number of the rope that was cut."""
    names = [line.name for line in view.scene.ropes]
    return names.index(view.cut.rope) if view.cut is not None and view.cut.rope else 0


def _sample(view: TwinView, numbers: Numbers) -> Sample:
    """Return the present state of a line."""
    ropes, joined = view.ropes.all_with(view.rope), view.joined
    lost_m, cut = (view.cut.lost_m, _cut_rope(view)) if view.cut is not None else (0.0, 0)
    beyond = dict(over_sheaves(view.scene)) if joined is not None else {}

    def sample(r: int) -> RopeSample:
        pull = view.pull if joined is None else joined.pull[r]
        length_m = view.line[0] if r == 0 or joined is None else joined.length_m(r)
        return RopeSample(
            ropes[r],
            float(pull[rows.PULL]),
            length_m,
            lost_m if r == cut else 0.0,
            sample(beyond[r]) if r in beyond else None,
        )

    samples = [sample(r) for r in numbers]
    line = one_rope([rope_sample.rope for rope_sample in samples])
    profiles = view.inputs.current.counter.accepted
    return Sample(line, tuple(samples), view.boundary, view.time_ns, profiles)


def _with_cost(response: RopeVibration | None, cost_pct: float) -> RopeVibration | None:
    return None if response is None else replace(response, cost_pct=cost_pct)


def _parts(response: RopeVibration, ropes: Sequence[Rope]) -> list[RopeVibration]:
    """Return the vibration of each rope of a line, from its lower end up."""
    parts, at = [], 0
    for rope in reversed(ropes):  # rows run from the upper end down
        n = int(rope.state.counts[rows.ELEMENTS])
        parts.append(_at_nodes(response, slice(at, at + n + 1)))
        at += n
    return parts[::-1]


def _at_nodes(response: RopeVibration, nodes: slice) -> RopeVibration:
    """Return the vibration at these nodes."""
    values: dict[str, Any] = {
        name: value[nodes]
        for name, value in vars(response).items()
        if isinstance(value, np.ndarray)
    }
    return replace(response, **values)


def bending_stiffness_of(scene: Scene, line: RopeLine) -> float:
    """Return the bending stiffness of a rope [N·m²]; 0: none."""
    listed = [params for params in scene.effects if isinstance(params, BendingParams)]
    return sum((line.bending or params).stiffness_n_m2 for params in listed)


def damage_of(
    scene: Scene, number: int, curve: str, bends: bool = False, piece_m: float = SEGMENT_M
) -> RopeDamage | None:
    """Return the damage count of a rope; None: the rope before it on a sheave has its count.

    curve: name of a fatigue curve, or OWN; bends: whether curvature will be given; piece_m: length
    of a segment of the count.

    Raises:
        InputError: the curve does not fit the rope.
    """
    line, pairs = scene.ropes[number], over_sheaves(scene)
    EI = bending_stiffness_of(scene, line)
    if number in (out for _, out in pairs):
        return None
    settings = DamageSettings(curve, bends, piece_m=piece_m)
    max_m = line.length_m
    for wheel, (into, out) in zip(scene.sheaves, pairs, strict=True):
        if number == into:
            other = scene.ropes[out]
            max_m += other.length_m
            line = replace(line, fatigue=line.fatigue or other.fatigue)
            settings = replace(settings, bends=False)
            if (groove := wheel.groove) is not None:
                settings = replace(
                    settings, path=groove.places(-0.5 * groove.arc_m), wires=_wires(line, groove)
                )
    if (winch := winch_of(scene, line)) is not None:
        max_m, path = winch.max_line_out_m, winch.bend_path()
        wires = _wires(line, winch.sheave) if winch.sheave else ()
        for sheave in winch.inboard_sheaves:
            wires += _wires(line, sheave, sheave.inboard_m)
        settings = replace(settings, path=path, reach_m=reach_m(path), wires=wires)
    own_s_n_curve = own_curve(line) if curve == OWN else None
    settings = replace(settings, own=own_s_n_curve, endurance=endurance(line))
    return RopeDamage(line, ends_m(line), max_m, settings, EI)


def _wires(
    line: RopeLine, sheave: BendingSheave, inboard_m: float = 0.0
) -> tuple[tuple[float, float], ...]:
    """Return position [m] and bending stress [Pa] of the outer wires over a sheave, if given."""
    stress_pa = sheave.bending_stress_pa(line.made_of[-1].rope.diameter_m)  # the upper section runs
    return ((inboard_m, stress_pa),) if stress_pa > 0.0 else ()

"""Monitor of vibration and fatigue: it passes samples of a twin to the `RopeMonitor` of each line.

The ropes of a multi-line system are monitored each by itself; ropes that continue each other
through bare connections are one line (rope_twin.vortex.line_model).

Two ropes that run as one over a sheave share a fatigue count: its material is that of the first of
them in the scene, from its far end, and then that of the other.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from rope_twin.core import state as rows
from rope_twin.core.state import Rope
from rope_twin.effects.bending import BendingParams
from rope_twin.errors import StateError
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
Numbers = tuple[int, ...]  # of the ropes of a line, from its lower end up


class VortexMonitor(Monitor):
    """Monitor of vibration and fatigue of each rope.

    A saved state includes its counts and averages.

    Raises:
        InputError: a requested monitor is not possible for the scene.
    """

    lines: dict[Numbers, RopeMonitor]  # by the ropes of the line

    def __init__(self, scene: Scene, asked: MonitorSettings) -> None:
        check_monitors(asked, shedding_model(scene), model_beside(scene) is not None)
        self._asked = asked
        self._damages: dict[int, RopeDamage] = {}  # by rope
        vibrates = model_beside(scene) is not None or asked.vibration == FREQUENCY_DOMAIN
        for number, line in enumerate(scene.ropes if asked.fatigue else ()):
            bends = vibrates or bending_stiffness_of(scene, line) > 0.0
            if (damage := damage_of(scene, number, asked.fatigue, bends)) is not None:
                self._damages[number] = damage
        self._due: dict[Numbers, int] = {}  # step of the next sampling

    def start(self, now: TwinView, present: Chunk) -> None:
        """Start without vibration or damage."""
        scene = now.scene
        self.lines = {}
        for numbers in self._numbers(now):
            line = self._new_monitor(now, numbers, self._asked)
            line.counting_from_ns = now.time_ns
            self.lines[numbers] = line
        texts = [one.notice if now.viv_drag is None else "" for one in self.lines.values()]
        if self._asked.fatigue:
            curve = self._asked.fatigue
            texts += [
                wire_curve_warning(line, curve, bending_stiffness_of(scene, line))
                for line in scene.ropes
            ]
        self.notice = "\n".join(text for text in texts if text)

    def restart(self, now: TwinView, present: Chunk) -> None:
        """Adapt the sampling to the step; counts and averages continue."""
        for line in self.lines.values():
            line.set_step(now.step_s, steps_in_slot(now.step_s))

    def steps_to_observation(self, now: TwinView) -> int:
        """Return the number of steps until the next sampling."""
        done = now.clock.steps
        self._due = {
            numbers: done + line.steps_to_sampling(done) for numbers, line in self.lines.items()
        }
        return min(self._due.values()) - done

    def observe(self, now: TwinView, chunk: Chunk) -> None:
        """Sample the lines for which that is due."""
        for numbers, line in self.lines.items():
            if chunk.steps == self._due.get(numbers):
                line.observe(_sample(now, numbers))

    def amend(self, now: TwinView, shot: Snapshot) -> Snapshot:
        """Return the snapshot with vibration and fatigue."""
        if now.joined is not None:
            return self._amend_ropes(now, shot)
        (line,) = self.lines.values()
        if now.viv_drag is None:
            amended(shot, vibration=_with_cost(line.vibration(now.rope), line.cost_pct))
        return amended(shot, fatigue=line.fatigue[0] if line.fatigue else None)

    def _amend_ropes(self, now: TwinView, shot: Snapshot) -> Snapshot:
        """Return the snapshot of a multi-line system with the results of each rope."""
        cost_pct = sum(line.cost_pct for line in self.lines.values())
        made = list(shot.ropes)
        for numbers, line in self.lines.items():
            ropes = [now.ropes.all_with(now.rope)[r] for r in numbers]
            found = _with_cost(line.vibration(one_rope(ropes)), cost_pct)
            parts = [None] * len(ropes) if found is None else _parts(found, ropes)
            wear = line.fatigue or (None,) * len(ropes)
            for r, vibration, fatigue in zip(numbers, parts, wear, strict=True):
                if vibration is not None and runs_over_sheave(now.scene, now.scene.ropes[r]):
                    vibration = _between(vibration, slice(None, None, -1))
                if now.viv_drag is not None:  # known already
                    vibration = made[r].vibration
                made[r] = replace(made[r], vibration=vibration, fatigue=fatigue)
        shot = amended(shot, ropes=tuple(made), fatigue=made[0].fatigue)
        return shot if now.viv_drag is not None else amended(shot, vibration=made[0].vibration)

    def cut(self, now: TwinView) -> None:
        """Restart the vibration monitor on the part that is left; what was cut off is dropped."""
        cut = _cut_rope(now)
        before, self.lines = self.lines, {}
        for numbers in self._numbers(now):
            line = before.get(numbers)
            if line is None:  # a part of a line of several ropes, which does not vibrate as it did
                (whole,) = (one for own, one in before.items() if numbers[0] in own)
                line = self._new_monitor(now, numbers, replace(self._asked, vibration=""))
                line.counting_from_ns = whole.counting_from_ns
            elif cut in numbers:
                line.cut()
            self.lines[numbers] = line

    def state(self) -> dict[str, Any]:
        """Return counts and averages."""
        return {
            f"{self._prefix(numbers)}{name}": one
            for numbers, line in self.lines.items()
            for name, one in line.kept().items()
        }

    def restore(self, now: TwinView, present: Chunk, saved: SavedState) -> None:
        """Continue with counts and averages.

        Raises:
            StateError: fatigue was counted by another curve.
        """
        if now.cut is not None:
            self.cut(now)
        for numbers, line in self.lines.items():
            prefix = self._prefix(numbers)
            kept = saved.of_monitor(prefix)
            curve = self._asked.fatigue
            begun = kept[wear_name(0)]["fields"]["name"] if wear_name(0) in kept else curve
            if curve and begun != curve:
                what = f"its fatigue was counted by the curve {begun}, not {curve}"
                raise StateError(f"saved state {saved.source}", what, f"ask for {begun}")
            line.set_step(now.step_s, steps_in_slot(now.step_s))

            def read(name: str, like: Any, prefix: str = prefix) -> Any:
                return saved.read_monitor(f"{prefix}{name}", like)

            line.take_back(
                kept,
                one_rope([now.ropes.all_with(now.rope)[r] for r in numbers]),
                now.time_ns,
                read,
            )

    def _prefix(self, numbers: Numbers) -> str:
        """Return the beginning of the names of a line in a saved state."""
        return PREFIX if numbers == (0,) else f"{PREFIX}{numbers[-1]}/"

    def _numbers(self, now: TwinView) -> list[Numbers]:
        """Return the ropes of each line; the lower part of a cut rope is none of them."""
        joined = now.joined
        if joined is None or not is_joined(now.scene):
            return [(0,)]
        if now.viv_drag is not None:  # a model of each rope
            return [(r,) for r in range(len(now.scene.ropes))]
        return lines_of(joined.system(now.rope), len(now.scene.ropes))

    def _new_monitor(self, now: TwinView, numbers: Numbers, asked: MonitorSettings) -> RopeMonitor:
        vortices = coupled_settings(now.scene)
        interval = now.step_s, steps_in_slot(now.step_s)
        damages = tuple(self._damages[r] for r in numbers if r in self._damages)
        rope = one_rope([now.ropes.all_with(now.rope)[r] for r in numbers])
        return RopeMonitor(asked, vortices, rope, interval, damages, now.viv_drag, numbers[-1])


def _cut_rope(now: TwinView) -> int:
    """Return the number of the rope that was cut."""
    names = [line.name for line in now.scene.ropes]
    return names.index(now.cut.rope) if now.cut is not None and now.cut.rope else 0


def _sample(now: TwinView, numbers: Numbers) -> Sample:
    """Return the present state of a line."""
    ropes, joined = now.ropes.all_with(now.rope), now.joined
    lost_m, cut = (now.cut.lost_m, _cut_rope(now)) if now.cut is not None else (0.0, 0)
    beyond = dict(over_sheaves(now.scene)) if joined is not None else {}

    def sample(r: int) -> RopeSample:
        pull = now.pull if joined is None else joined.pull[r]
        length_m = now.line[0] if r == 0 or joined is None else joined.length_m(r)
        return RopeSample(
            ropes[r],
            float(pull[rows.PULL]),
            length_m,
            lost_m if r == cut else 0.0,
            sample(beyond[r]) if r in beyond else None,
        )

    samples = [sample(r) for r in numbers]
    line = one_rope([one.rope for one in samples])
    profiles = now.inputs.current.counter.accepted
    return Sample(line, tuple(samples), now.boundary, now.time_ns, profiles)


def _with_cost(found: RopeVibration | None, cost_pct: float) -> RopeVibration | None:
    return None if found is None else replace(found, cost_pct=cost_pct)


def _parts(found: RopeVibration, ropes: Sequence[Rope]) -> list[RopeVibration]:
    """Return the vibration of each rope of a line, from its lower end up."""
    parts, at = [], 0
    for rope in reversed(ropes):  # rows run from the upper end down
        n = int(rope.state.counts[rows.ELEMENTS])
        parts.append(_between(found, slice(at, at + n + 1)))
        at += n
    return parts[::-1]


def _between(found: RopeVibration, some: slice) -> RopeVibration:
    """Return the vibration at some of the nodes."""
    own: dict[str, Any] = {
        name: value[some] for name, value in vars(found).items() if isinstance(value, np.ndarray)
    }
    return replace(found, **own)


def bending_stiffness_of(scene: Scene, line: RopeLine) -> float:
    """Return the bending stiffness of a rope [N·m²]; 0: none."""
    listed = [own for own in scene.effects if isinstance(own, BendingParams)]
    return sum((line.bending or own).stiffness_n_m2 for own in listed)


def damage_of(
    scene: Scene, number: int, curve: str, bends: bool = False, piece_m: float = SEGMENT_M
) -> RopeDamage | None:
    """Return the count of a rope of the scene; None: that of the rope before it on a sheave.

    curve: name of a fatigue curve, or OWN; bends: whether curvature will be given; piece_m: length
    of a piece of the count.

    Raises:
        InputError: the curve does not fit the rope.
    """
    line, pairs = scene.ropes[number], over_sheaves(scene)
    EI = bending_stiffness_of(scene, line)
    if number in (out for _, out in pairs):
        return None
    settings = DamageSettings(curve, bends, piece_m=piece_m)
    most = line.length_m
    for wheel, (into, out) in zip(scene.sheaves, pairs, strict=True):
        if number == into:
            other = scene.ropes[out]
            most += other.length_m
            line = replace(line, fatigue=line.fatigue or other.fatigue)
            settings = replace(settings, bends=False)
            if (groove := wheel.groove) is not None:
                settings = replace(
                    settings, path=groove.places(-0.5 * groove.arc_m), wires=_wires(line, groove)
                )
    if (winch := winch_of(scene, line)) is not None:
        most, path = winch.most_line_out_m, winch.bend_path()
        wires = _wires(line, winch.sheave) if winch.sheave else ()
        for sheave in winch.inboard_sheaves:
            wires += _wires(line, sheave, sheave.inboard_m)
        settings = replace(settings, path=path, reach_m=reach_m(path), wires=wires)
    own = own_curve(line) if curve == OWN else None
    settings = replace(settings, own=own, endurance=endurance(line))
    return RopeDamage(line, ends_m(line), most, settings, EI)


def _wires(
    line: RopeLine, sheave: BendingSheave, inboard_m: float = 0.0
) -> tuple[tuple[float, float], ...]:
    """Return place and bending stress of the outer wires over a sheave; none if none are given."""
    stress_pa = sheave.bending_stress_pa(line.made_of[0].rope.diameter_m)
    return ((inboard_m, stress_pa),) if stress_pa > 0.0 else ()

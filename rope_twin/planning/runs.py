"""Runs of one leg in one sea: seeds stepped together in SIMD lanes, and the extremes of each."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np

from rope_twin.core.lanes.step import DEPTH, LEAST, LOWEST, SINKING
from rope_twin.effects.waves import WavesParams, components_of
from rope_twin.planning.phases import Leg
from rope_twin.planning.seas import SeaState, Ship, tip_on_waves, tip_record
from rope_twin.planning.twin_runs import (
    Extremes,
    Row,
    reference_m,
    sea_changes,
    twin_rows,
    watch_twin,
)
from rope_twin.scene.load import change_scene
from rope_twin.scene.schema import Scene
from rope_twin.sea.tables import Vector
from rope_twin.twin.ensemble.ensemble import BATCH_STEPS, Ensemble, Variation
from rope_twin.twin.ensemble.member import LINE_OUT, TOP, WATCHED
from rope_twin.twin.motion.boundary_conditions import WinchMotion
from rope_twin.twin.motion.heave_track import HeaveSeries

AT_LEAST, AT_DEPTH, AT_SINKING, AT_LOWEST = (1 + k for k in (LEAST, DEPTH, SINKING, LOWEST))

# what a run is for: extremes of its cell, the error of one of those, or the choice of a setting
STATISTICS, ERROR, SETTING = "statistics", "error", "setting"


def sea_seed(first: int, phase: int, leg: int, number: int) -> int:
    """Return the random number of a sea, from those of the plan, phase, leg and seed.

    All seas of a phase have the same seeds, so that a higher sea is the same sea, but higher.
    """
    state = np.random.SeedSequence([first, phase, leg, number]).generate_state(1)
    return int(state[0] >> 1)


def variation(leg: Leg, ship: Ship, sea: SeaState, seed: int) -> Variation:
    """Return the changes and inputs of a seed.

    Raises:
        InputError: the crane tip would move further or faster than inputs may.
        SceneError: the waves do not take these numbers.
    """
    waves = leg.scene.listed(WavesParams)
    if waves is None:
        heave = tip_record(ship.tip, sea, seed, leg.seconds, ship.bow, ship.tip.headings)
        return Variation((), heave, leg.commands)
    changes = sea_changes(leg, ship, sea, seed)
    scene = change_scene(leg.scene, changes)
    heave = _on_waves(scene, ship, leg.seconds)
    return Variation(changes, heave, leg.commands)


def _on_waves(scene: Scene, ship: Ship, seconds: float) -> HeaveSeries:
    """Return the motion of a ship on the scene's waves."""
    waves = scene.listed(WavesParams)
    assert waves is not None
    components = components_of(waves, scene.environment.gravity_m_per_s2)
    reference = reference_m(scene, ship)[:2]
    return tip_on_waves(ship.tip, components, reference, seconds, ship.bow, ship.tip.headings)


class SteppedExtremes:
    """Extremes of one run inside the window, taken from its steps a batch at a time."""

    def __init__(self, leg: Leg) -> None:
        self._leg = leg
        self.found = Extremes(offset_m=leg.offset_m)
        self._depth = self._sinking = -math.inf  # at the end of the last batch
        self._line: tuple[float, float] | None = None

    @property
    def landed(self) -> bool:
        """Whether the payload has touched the seabed."""
        return not math.isnan(self.found.landing_speed_m_per_s)

    def take(self, steps: Vector, time_s: Vector, nominal_m: Vector | None) -> None:
        """Take steps (n, WATCHED) that end at these times.

        nominal_m: line out without heave compensation, (n,), or None if there is none.
        """
        if nominal_m is not None:
            self._take_line(steps[:, LINE_OUT], time_s, nominal_m)
        is_counted, extremes = time_s > self._leg.first_s, self.found
        afloat = is_counted.copy()
        if self._leg.bed_m is not None:
            afloat &= self._before_touchdown(steps)
        if is_counted.any():
            selected = steps[is_counted]
            k = int(np.argmax(selected[:, TOP]))
            at_s, depth_m = float(time_s[is_counted][k]), float(selected[k, AT_DEPTH])
            extremes.take_top(float(selected[k, TOP]), at_s, depth_m)
            extremes.payload_max_n = max(
                extremes.payload_max_n, float(selected[:, AT_LOWEST].max())
            )
        if afloat.any():
            selected = steps[afloat]
            extremes.take_least(
                len(selected),
                int((selected[:, AT_LEAST] <= 0.0).sum()),
                top_n=float(selected[:, TOP].min()),
                payload_n=float(selected[:, AT_LOWEST].min()),
                anywhere_n=float(selected[:, AT_LEAST].min()),
            )

    def _before_touchdown(self, steps: Vector) -> Any:
        """Return which steps end before the payload first touches, and note how fast it lands."""
        bed = self._leg.bed_m
        depth = np.concatenate([[self._depth], steps[:, AT_DEPTH]])
        sinking = np.concatenate([[self._sinking], steps[:, AT_SINKING]])
        touches = np.flatnonzero((depth[:-1] < bed) & (depth[1:] >= bed))
        before = np.full(len(steps), not self.landed)
        if touches.size:
            if not self.landed:
                before[touches[0] :] = False
            fastest = float(np.maximum(sinking[touches], sinking[touches + 1]).max())
            known = self.found.landing_speed_m_per_s
            self.found.landing_speed_m_per_s = max(known, fastest) if self.landed else fastest
        self._depth, self._sinking = float(depth[-1]), float(sinking[-1])
        return before

    def _take_line(self, line_m: Vector, time_s: Vector, nominal_m: Vector) -> None:
        """Note how far and how fast the heave compensation moves the line."""
        extra, extremes = line_m - nominal_m, self.found
        extremes.stroke_m = max(extremes.stroke_m, float(np.abs(extra).max(initial=0.0)))
        if self._line is not None:
            extra = np.concatenate([[self._line[1]], extra])
            time_s = np.concatenate([[self._line[0]], time_s])
        if len(extra) > 1:
            speeds = np.abs(np.diff(extra) / np.diff(time_s))
            extremes.stroke_speed_m_per_s = max(extremes.stroke_speed_m_per_s, float(speeds.max()))
        self._line = float(time_s[-1]), float(extra[-1])


def run_seeds(leg: Leg, ship: Ship, sea: SeaState, seeds: Sequence[int]) -> list[Row]:
    """Return the extremes of each seed; a run that failed has a sentence in `failure`.

    leg: at its setting. seeds: random numbers of the seas.

    Raises:
        RopeTwinError: the sea moves the crane tip beyond what inputs may, or no run can start.
    """
    if leg.by_twin:
        return twin_rows(leg, ship, sea, seeds)
    ensemble = _started(leg, ship, sea, seeds)
    members = [SteppedExtremes(leg) for _ in seeds]
    for time_s, nominal, parts in _batches(leg, ensemble):
        for extremes, steps in zip(members, parts, strict=True):
            count = len(steps)
            if count:
                extremes.take(steps, time_s[:count], None if nominal is None else nominal[:count])
    rows = []
    for seed, extremes, member in zip(seeds, members, ensemble.figures(), strict=True):
        not_landed = (
            "" if leg.bed_m is None or extremes.landed or member.failure else "it did not land"
        )
        failure = member.failure or not_landed
        rows.append({"sea_seed": seed, **extremes.found.row(), "failure": failure})
    return rows


def run_row(
    number: int, phase: str, leg: Leg, sea: SeaState, seed: int, result: Row, purpose: str
) -> Row:
    """Return the stored row of a run: its place in the plan, its results and its setting.

    found: of `run_seeds`.
    """
    return {
        "run": number,
        "purpose": purpose,
        "phase": phase,
        "leg": leg.number,
        "tp_s": sea.period_s,
        "heading_deg": sea.heading_deg,
        "hs_m": sea.height_m,
        "seed": seed,
        **result,
        "seconds": leg.seconds,
        "elements": leg.setting.elements,
        "step_s": leg.setting.step_s,
        "setting_error": leg.setting_error,
    }


def watch_seed(leg: Leg, ship: Ship, sea: SeaState, seed: int) -> tuple[Vector, Vector]:
    """Return the time [s], (n,), and all steps of a run, (n, WATCHED).

    Raises:
        RopeTwinError: see `run_seeds`.
    """
    if leg.by_twin:
        rows = []
        for snapshot in watch_twin(leg, ship, sea, seed):
            row = np.full(WATCHED, math.nan)
            row[TOP], row[AT_LOWEST] = snapshot.tension_top_n, snapshot.tension_payload_n
            row[AT_DEPTH] = -float(snapshot.payload_position_m[2])
            rows.append((snapshot.time_s, row))
        return np.array([instant for instant, _ in rows]), np.stack([row for _, row in rows])
    ensemble = _started(leg, ship, sea, [seed])
    times, steps = [], []
    for time_s, _, (member_steps,) in _batches(leg, ensemble):
        times.append(time_s[: len(member_steps)])
        steps.append(member_steps)
    return np.concatenate(times), np.concatenate(steps)


def _started(leg: Leg, ship: Ship, sea: SeaState, seeds: Sequence[int]) -> Ensemble:
    members = [variation(leg, ship, sea, seed) for seed in seeds]
    return Ensemble(leg.scene, members, threads=1, watched=True)


def _batches(leg: Leg, ensemble: Ensemble) -> Iterator[tuple[Vector, Vector | None, list[Vector]]]:
    """Yield times [s], line out without compensation [m] and the members' steps, by batches.

    The second is None without compensation.
    """
    step = leg.scene.time.step_s
    left, done = round(leg.seconds / step), 0
    winch = leg.scene.winch
    compensated = winch is not None and winch.heave_compensation is not None
    nominal = nominal_line(leg) if compensated else None
    while left:
        count = min(left, BATCH_STEPS)
        ensemble.advance(count * step)
        time_s = np.arange(done + 1.0, done + count + 1.0) * step
        parts = [ensemble.watched(k) for k in range(len(ensemble))]
        yield time_s, None if nominal is None else nominal[done : done + count], parts
        left, done = left - count, done + count


def nominal_line(leg: Leg) -> Vector:
    """Return the line out at the end of each step without heave compensation [m], (steps,)."""
    scene, step = leg.scene, leg.scene.time.step_s
    winch = scene.winch and dataclasses.replace(scene.winch, heave_compensation=None)
    motion = WinchMotion(winch, scene.ropes[0].length_m, leg.commands, step)
    return motion.through(0, round(leg.seconds / step))[1:, 0]

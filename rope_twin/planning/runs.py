"""Runs of one leg in one sea, and the extremes of each.

Seeds are stepped together in SIMD lanes, but for a lift off a moving deck and multi-line systems,
which a twin steps by itself: the ship's pose in six degrees of freedom moves every hang-off
rigidly. The deck of a lift-off heaves by the same wave components (`SeaRecord`), so that crane tip
and deck keep their phases; it stays level. Loads are sampled every SAMPLE_S, those of the upper
ends at every step.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from rope_twin.core.lanes.step import (
    EAST,
    LOWEST_TENSION,
    MIN_TENSION,
    NORTH,
    PAYLOAD_DEPTH,
    PAYLOAD_DESCENT,
)
from rope_twin.effects.rigid_body import DeckHeave, RigidBodyParams
from rope_twin.effects.waves import WavesParams, components_of
from rope_twin.errors import SolverError
from rope_twin.planning.lift_monitor import LiftMonitor, LiftSample, RopeLoads
from rope_twin.planning.phases import Leg
from rope_twin.planning.seas import (
    DeckTransfer,
    SeaRecord,
    SeaState,
    Ship,
    sea_record,
    tip_on_waves,
    tip_record,
)
from rope_twin.recording.motion_source import FIRST_NS, SAMPLE_PERIOD_NS, ShipOfComponents
from rope_twin.scene.load import Change, change_scene
from rope_twin.scene.rigging import winches_by_name
from rope_twin.scene.schema import WINCH, Scene
from rope_twin.scene.schema import SeaState as SceneSea
from rope_twin.sea.spectrum import Waves, wave_at
from rope_twin.sea.tables import Vector
from rope_twin.studies.driven_twin import check_taken
from rope_twin.twin.ensemble.ensemble import BATCH_STEPS, Ensemble, Variation
from rope_twin.twin.ensemble.member import LINE_OUT, TOP, WATCHED
from rope_twin.twin.monitors import Monitors
from rope_twin.twin.motion.boundary_conditions import WinchMotion
from rope_twin.twin.twin import Twin
from rope_twin.twin.winch.commands import schedule_samples

Row = dict[str, Any]
SAMPLE_S = 0.01
BATCH_S = 1.0  # of a twin, whose inputs are submitted at once
AHEAD_NS = 1_000_000_000  # inputs are given to the twin this long before they are needed
SMALLEST_M, SHORTEST_S = 1e-6, 0.5  # harmonics of a deck below: they move it by nothing


@dataclass
class Extremes:
    """Extremes of one run inside its window, by the names that they have in its row."""

    top_max_n: float = -math.inf
    top_min_n: float = math.inf
    payload_min_n: float = math.inf
    payload_max_n: float = -math.inf
    min_n: float = math.inf  # anywhere in the rope
    depth_at_max_m: float = math.nan  # of the payload, at the largest hook load
    at_s: float = math.nan  # of that
    slack_share: float = 0.0
    landing_speed_m_per_s: float = math.nan
    stroke_m: float = 0.0
    stroke_speed_m_per_s: float = 0.0
    re_hit_m_per_s: float = math.nan
    offset_m: float = 0.0
    _samples: int = 0
    _slack: int = 0

    def take_top(self, top_n: float, at_s: float, depth_m: float) -> None:
        """Take a hook load at a time, with the depth of the payload."""
        if top_n > self.top_max_n:
            self.top_max_n, self.at_s, self.depth_at_max_m = top_n, at_s, depth_m

    def take_minima(
        self, samples: int, slack: int, *, top_n: float, payload_n: float, anywhere_n: float
    ) -> None:
        """Take the minimum tensions of several samples; slack: samples with a slack element."""
        self.top_min_n = min(self.top_min_n, top_n)
        self.payload_min_n = min(self.payload_min_n, payload_n)
        self.min_n = min(self.min_n, anywhere_n)
        self._samples, self._slack = self._samples + samples, self._slack + slack
        self.slack_share = self._slack / self._samples

    def row(self) -> Row:
        """Return the extremes as a row of results."""
        return {name: value for name, value in vars(self).items() if not name.startswith("_")}


class TwinExtremes:
    """Extremes of one run of a twin, with those of multi-line systems and of the deck."""

    def __init__(self, leg: Leg) -> None:
        self._first_s, self._ropes = leg.first_s, leg.ropes
        self._decked = leg.deck_m is not None
        self._found = Extremes(re_hit_m_per_s=0.0 if self._decked else math.nan)
        self.aloft = False  # whether it has left the deck
        self.on_deck = self._decked
        self._clearance: tuple[float, float] | None = None  # time [s], above the deck [m]
        self._loads = [RopeLoads(math.nan, math.nan) for _ in self._ropes]  # NaN: no sample yet

    def take(self, sample: LiftSample) -> None:
        """Take a sample."""
        if sample.time_s <= self._first_s:
            return
        extremes = self._found
        extremes.take_top(sample.top_max_n, sample.time_s, sample.depth_m)
        extremes.payload_max_n = max(extremes.payload_max_n, sample.payload_n)
        for r, before in enumerate(self._loads):
            now = sample.ropes[r]  # first: of two numbers, max and min return the first beside NaN
            self._loads[r] = RopeLoads(
                max(now.max_n, before.max_n), min(now.lowest_n, before.lowest_n)
            )
        if self._decked:
            self._take_deck(sample)
        if not self._decked or (self.aloft and not self.on_deck):
            extremes.take_minima(
                1, int(sample.min_n <= 0.0), top_n=sample.top_min_n,
                payload_n=sample.payload_n, anywhere_n=sample.min_n,
            )  # fmt: skip
            extremes.offset_m = max(extremes.offset_m, sample.offset_m)

    def _take_deck(self, sample: LiftSample) -> None:
        """Note whether the object stands on the deck, and how fast that meets it again."""
        assert sample.deck is not None, "checked when the plan was read"
        reaction_n, clearance_m = sample.deck
        clearance, before = (sample.time_s, clearance_m), self._clearance
        on_deck = reaction_n > 0.0
        if on_deck and self.aloft and not self.on_deck and before is not None:
            speed = (before[1] - clearance[1]) / (clearance[0] - before[0])
            self._found.re_hit_m_per_s = max(self._found.re_hit_m_per_s, speed)
        self.aloft = self.aloft or not on_deck
        self.on_deck, self._clearance = on_deck, clearance

    def row(self) -> Row:
        """Return the run's results."""
        row = self._found.row()
        for rope, loads in zip(self._ropes, self._loads, strict=True):
            row[f"rope_load[{rope.name}]"] = loads.max_n
            row[f"rope_loss[{rope.name}]"] = 1.0 - loads.lowest_n / rope.lower_n
        return row


def twin_rows(leg: Leg, ship: Ship, sea: SeaState, seeds: Sequence[int]) -> list[Row]:
    """Return the extremes of each seed; a run that failed has a sentence in `failure`.

    Raises:
        RopeTwinError: no run can start.
    """
    rows = []
    for seed in seeds:
        extremes, failure = TwinExtremes(leg), ""
        try:
            for sample in watch_twin(leg, ship, sea, seed):
                extremes.take(sample)
        except SolverError as error:
            failure = str(error)
        if not failure and leg.deck_m is not None and extremes.on_deck:
            failure = "the object did not leave the deck"
        rows.append({"sea_seed": seed, **extremes.row(), "failure": failure})
    return rows


def watch_twin(leg: Leg, ship: Ship, sea: SeaState, seed: int) -> Iterator[LiftSample]:
    """Yield samples of a run, one every SAMPLE_S or every step.

    Raises:
        RopeTwinError: it cannot start.
        SolverError: an input was rejected, or the next state would not be finite.
    """
    scene, motion = moved_by_sea(leg, ship, sea, seed)
    step_s = scene.time.step_s
    every, batch, steps = (round(seconds / step_s) for seconds in (SAMPLE_S, BATCH_S, leg.seconds))
    monitor = LiftMonitor(scene, leg.from_ship, max(1, every), steps)
    twin = Twin(scene, Monitors(further=(monitor,)))
    twin.prescribe_motion()
    stamp, commanded = FIRST_NS, 0
    waiting = list(leg.commands)
    while twin.steps < steps:
        count = min(max(1, batch), steps - twin.steps)
        until = twin.time_ns + count * twin.step_ns + AHEAD_NS
        while stamp < until:
            check_taken(twin.submit_pose(motion.pose(stamp)))
            stamp += SAMPLE_PERIOD_NS
        for name, winch in winches_by_name(scene).items():
            if name != WINCH or not leg.commands:
                for command in schedule_samples(winch, commanded, until):
                    check_taken(twin.submit_command(command.stamp_ns, command.command, name))
        commanded = until
        while waiting and waiting[0].stamp_ns < until:
            command = waiting.pop(0)
            check_taken(twin.submit_command(command.stamp_ns, command.command))
        try:
            twin.advance(count)
        finally:
            yield from monitor.take()


def moved_by_sea(leg: Leg, ship: Ship, sea: SeaState, seed: int) -> tuple[Scene, ShipOfComponents]:
    """Return the scene in a sea, and the ship that answers it.

    Raises:
        SceneError: the waves do not take these numbers.
    """
    scene, tip, bow = leg.scene, ship.tip, ship.bow
    reference = reference_m(scene, ship)
    at_rest = replace(scene.ship, reference_m=reference)
    scene = replace(scene, ship=at_rest, sea_state=SceneSea())
    waves = scene.listed(WavesParams)
    if waves is None:
        record = sea_record(sea, seed, leg.seconds)
        answer = record.from_start(tip.freedoms(record.frequency_hz, record.heading))
        if leg.deck is not None:
            scene = on_deck(scene, leg.deck, record)
        return scene, ShipOfComponents(answer, record.omega, bow)
    scene = change_scene(scene, sea_changes(leg, ship, sea, seed))
    components = _components(scene)
    heading = components.heading - bow
    answer = wave_at(components, *reference[:2]) * tip.freedoms(
        components.omega / (2.0 * math.pi), heading
    )
    return scene, ShipOfComponents(answer, components.omega, bow)


def reference_m(scene: Scene, ship: Ship) -> tuple[float, float, float]:
    """Return the ship's reference point, an arm away from the hang-off [m]."""
    x, y, z = scene.ship.hang_off_m
    ahead, port, up = getattr(ship.tip, "arm_m", (0.0, 0.0, 0.0))
    c, s = math.cos(ship.bow), math.sin(ship.bow)
    return x - (c * ahead - s * port), y - (s * ahead + c * port), z - up


def sea_changes(leg: Leg, ship: Ship, sea: SeaState, seed: int) -> tuple[Change, ...]:
    """Return the changes of a scene's waves for a seed of a sea state."""
    waves = leg.scene.listed(WavesParams)
    assert waves is not None
    heading = waves.heading_deg  # a hull that answers head seas has no bow to turn from
    if ship.tip.headings:
        heading = (math.degrees(ship.bow) + sea.heading_deg + 180.0) % 360.0 - 180.0
    numbers: dict[str, float | None] = {
        "jonswap.significant_height_m": sea.height_m,
        "jonswap.peak_period_s": sea.period_s,
        "jonswap.gamma": sea.gamma,
        "spreading": sea.spreading,
        "seed": seed,
        "heading_deg": heading,
    }
    return tuple(
        Change(f"effects.waves.{key}", value) for key, value in numbers.items() if value is not None
    )


def on_deck(scene: Scene, deck: DeckTransfer, record: SeaRecord) -> Scene:
    """Return the scene whose deck heaves in a record of the sea, with the ship's build-up."""
    body = scene.listed(RigidBodyParams)
    assert body is not None, "checked when the plan was read"
    assert body.deck is not None, "checked when the plan was read"
    heaves = tuple(
        DeckHeave(
            amplitude_m=amplitude,
            period_s=2.0 * math.pi / omega,
            phase_deg=math.degrees(phase),
            ramp_s=scene.ship.motion_ramp_s,
        )
        for amplitude, omega, phase in record.harmonics(deck).tolist()
        if amplitude > SMALLEST_M and 2.0 * math.pi / omega > SHORTEST_S
    )
    deck_body = replace(body, deck=replace(body.deck, heave=None, with_ship=False, heaves=heaves))
    effects = tuple(deck_body if effect is body else effect for effect in scene.effects)
    return replace(scene, effects=effects)


AT_MIN_TENSION, AT_DEPTH, AT_SINKING, AT_LOWEST, AT_EAST, AT_NORTH = (
    1 + k for k in (MIN_TENSION, PAYLOAD_DEPTH, PAYLOAD_DESCENT, LOWEST_TENSION, EAST, NORTH)
)

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
        heave = tip_record(ship, sea, seed, leg.seconds)
        return Variation((), heave, leg.commands)
    changes = sea_changes(leg, ship, sea, seed)
    scene = change_scene(leg.scene, changes)
    reference = reference_m(scene, ship)[:2]
    heave = tip_on_waves(ship, _components(scene), reference, leg.seconds)
    return Variation(changes, heave, leg.commands)


def _components(scene: Scene) -> Waves:
    """Return the components of the scene's waves."""
    waves = scene.listed(WavesParams)
    assert waves is not None
    return components_of(waves, scene.environment.gravity_m_per_s2)


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

    @property
    def fault(self) -> str:
        """Return why the run is no landing; empty: it is one, or none is asked for."""
        if self._leg.bed_m is None:
            return ""
        if not self.landed:
            return "it did not land"
        early = math.isinf(self.found.payload_min_n)  # none afloat in the window
        return "it touched the seabed before it was lowered; raise above_m" if early else ""

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
            if self._leg.in_air:
                offset_m = np.hypot(selected[:, AT_EAST], selected[:, AT_NORTH])
                extremes.offset_m = max(extremes.offset_m, float(offset_m.max()))
        if afloat.any():
            selected = steps[afloat]
            extremes.take_minima(
                len(selected),
                int((selected[:, AT_MIN_TENSION] <= 0.0).sum()),
                top_n=float(selected[:, TOP].min()),
                payload_n=float(selected[:, AT_LOWEST].min()),
                anywhere_n=float(selected[:, AT_MIN_TENSION].min()),
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
        failure = member.failure or extremes.fault
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
        for sample in watch_twin(leg, ship, sea, seed):
            row = np.full(WATCHED, math.nan)
            row[TOP], row[AT_LOWEST], row[AT_DEPTH] = (
                sample.top_max_n, sample.payload_n, sample.depth_m,
            )  # fmt: skip
            rows.append((sample.time_s, row))
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
    nominal = None
    if compensated:
        uncompensated = winch and replace(winch, heave_compensation=None)
        motion = WinchMotion(uncompensated, leg.scene.ropes[0].length_m, leg.commands, step)
        nominal = motion.through(0, left)[1:, 0]
    while left:
        count = min(left, BATCH_STEPS)
        ensemble.advance(count * step)
        time_s = np.arange(done + 1.0, done + count + 1.0) * step
        parts = [ensemble.watched(k) for k in range(len(ensemble))]
        yield time_s, None if nominal is None else nominal[done : done + count], parts
        left, done = left - count, done + count

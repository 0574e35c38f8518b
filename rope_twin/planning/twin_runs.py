"""Runs that a twin steps by itself: a lift off a moving deck, and multi-line systems.

The ship's pose in six degrees of freedom moves every hang-off rigidly. The deck of a lift-off
heaves by the same wave components (`SeaRecord`), so that crane tip and deck keep their phases; it
stays level. Loads are taken every LOOK_S, those of the first rope's upper end at every step.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from rope_twin.effects.rigid_body import DeckHeave, RigidBodyParams
from rope_twin.effects.waves import WavesParams, components_of
from rope_twin.errors import SolverError
from rope_twin.planning.phases import Leg
from rope_twin.planning.seas import DeckTransfer, SeaRecord, SeaState, Ship, sea_record
from rope_twin.recording.motion_source import FIRST_NS, SAMPLE_PERIOD_NS, ShipOfComponents
from rope_twin.scene.load import Change, change_scene
from rope_twin.scene.rigging import winches_by_name
from rope_twin.scene.schema import WINCH, Scene
from rope_twin.scene.schema import SeaState as SceneSea
from rope_twin.sea.spectrum import wave_at
from rope_twin.studies.driven_twin import check_taken
from rope_twin.twin.snapshot import Snapshot
from rope_twin.twin.twin import Twin
from rope_twin.twin.winch.commands import schedule_samples

Row = dict[str, Any]
LOOK_S = 0.01
AHEAD_NS = 1_000_000_000  # inputs are given to the twin this long before they are needed
SMALLEST_M, SHORTEST_S = 1e-6, 0.5  # harmonics of a deck below: they move it by nothing


def offset_m(snapshot: Snapshot, from_ship: Collection[str] = ()) -> float:
    """Return the horizontal distance of the payload from the crane tip [m].

    from_ship: names of the ropes that leave the ship in multi-line systems; their middle counts.
    """
    tips = [rope.node_position_m[0] for rope in snapshot.ropes if rope.name in from_ship]
    middle = np.mean(tips, axis=0) if tips else snapshot.hang_off_position_m
    return float(np.hypot(*(snapshot.payload_position_m - middle)[:2]))


@dataclass
class Extremes:
    """Extremes of one run inside its window, by the names that they have in its row."""

    top_max_n: float = -math.inf
    top_min_n: float = math.inf
    payload_min_n: float = math.inf
    payload_max_n: float = -math.inf
    least_n: float = math.inf  # anywhere in the rope
    depth_at_max_m: float = math.nan  # of the payload, at the largest hook load
    at_s: float = math.nan  # of that
    slack_share: float = 0.0
    landing_speed_m_per_s: float = math.nan
    stroke_m: float = 0.0
    stroke_speed_m_per_s: float = 0.0
    re_hit_m_per_s: float = math.nan
    offset_m: float = 0.0
    _looks: int = 0
    _slack: int = 0

    def take_top(self, top_n: float, at_s: float, depth_m: float) -> None:
        """Take a hook load at a time, with the depth of the payload."""
        if top_n > self.top_max_n:
            self.top_max_n, self.at_s, self.depth_at_max_m = top_n, at_s, depth_m

    def take_least(
        self, looks: int, slack: int, *, top_n: float, payload_n: float, anywhere_n: float
    ) -> None:
        """Take the least tensions of several samples; slack: samples with a slack element."""
        self.top_min_n = min(self.top_min_n, top_n)
        self.payload_min_n = min(self.payload_min_n, payload_n)
        self.least_n = min(self.least_n, anywhere_n)
        self._looks, self._slack = self._looks + looks, self._slack + slack
        self.slack_share = self._slack / self._looks

    def row(self) -> Row:
        """Return the extremes as a row of results."""
        return {name: value for name, value in vars(self).items() if not name.startswith("_")}


class TwinExtremes:
    """Extremes of one run of a twin, with those of multi-line systems and of the deck."""

    def __init__(self, leg: Leg) -> None:
        self._first_s, self._ropes = leg.first_s, leg.ropes
        self._from_ship = {rope.name for rope in leg.ropes if rope.from_ship}
        self._decked = leg.deck_m is not None
        self._found = Extremes(re_hit_m_per_s=0.0 if self._decked else math.nan)
        self.aloft = False  # whether it has left the deck
        self.on_deck = self._decked
        self._clearance: tuple[float, float] | None = None  # time [s], above the deck [m]
        self._by_rope: dict[str, list[float]] = {}  # largest at its top, least at its lower end

    def take(self, snapshot: Snapshot) -> None:
        """Take a snapshot."""
        if snapshot.time_s <= self._first_s:
            return
        least_n = min(
            [float(snapshot.element_tension_n.min())]
            + [float(rope.element_tension_n.min()) for rope in snapshot.ropes]
        )
        tops = [rope.tension_top_n for rope in snapshot.ropes if rope.name in self._from_ship]
        top = max([snapshot.tension_top_max_n, *tops])
        depth_m = -float(snapshot.payload_position_m[2])
        extremes = self._found
        extremes.take_top(top, snapshot.time_s, depth_m)
        extremes.payload_max_n = max(extremes.payload_max_n, snapshot.tension_payload_n)
        for rope in snapshot.ropes:
            rope_extremes = self._by_rope.setdefault(rope.name, [-math.inf, math.inf])
            rope_extremes[0] = max(
                rope_extremes[0], float(rope.element_tension_n.max()), rope.tension_top_n
            )
            rope_extremes[1] = min(rope_extremes[1], float(rope.element_tension_n[-1]))
        if self._decked:
            self._take_deck(snapshot)
        if not self._decked or (self.aloft and not self.on_deck):
            extremes.take_least(
                1, int(least_n <= 0.0), top_n=snapshot.tension_top_min_n,
                payload_n=snapshot.tension_payload_n, anywhere_n=least_n,
            )  # fmt: skip
            extremes.offset_m = max(extremes.offset_m, offset_m(snapshot, self._from_ship))

    def _take_deck(self, snapshot: Snapshot) -> None:
        """Note whether the object stands on the deck, and how fast that meets it again."""
        body = snapshot.body
        assert body is not None, "checked when the plan was read"
        assert body.deck_push_n is not None, "checked when the plan was read"
        assert body.deck_clearance_m is not None, "checked when the plan was read"
        clearance, before = (snapshot.time_s, body.deck_clearance_m), self._clearance
        on_deck = body.deck_push_n > 0.0
        if on_deck and self.aloft and not self.on_deck and before is not None:
            speed = (before[1] - clearance[1]) / (clearance[0] - before[0])
            self._found.re_hit_m_per_s = max(self._found.re_hit_m_per_s, speed)
        self.aloft = self.aloft or not on_deck
        self.on_deck, self._clearance = on_deck, clearance

    def row(self) -> Row:
        """Return the run's results."""
        row = self._found.row()
        for rope in self._ropes:
            high, low = self._by_rope.get(rope.name, (math.nan, math.nan))
            row[f"rope_load[{rope.name}]"] = high
            row[f"rope_loss[{rope.name}]"] = 1.0 - low / rope.lower_n
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
            for snapshot in watch_twin(leg, ship, sea, seed):
                extremes.take(snapshot)
        except SolverError as error:
            failure = str(error)
        if not failure and leg.deck_m is not None and extremes.on_deck:
            failure = "the object did not leave the deck"
        rows.append({"sea_seed": seed, **extremes.row(), "failure": failure})
    return rows


def watch_twin(leg: Leg, ship: Ship, sea: SeaState, seed: int) -> Iterator[Snapshot]:
    """Yield snapshots of a run, one every LOOK_S or every step.

    Raises:
        RopeTwinError: it cannot start.
        SolverError: an input was rejected, or the next state would not be finite.
    """
    scene, motion = moved_by_sea(leg, ship, sea, seed)
    twin = Twin(scene)
    twin.prescribe_motion()
    step = twin.step_ns
    every, steps = max(1, round(LOOK_S / twin.step_s)), round(leg.seconds / twin.step_s)
    stamp, commanded = FIRST_NS, 0
    waiting = list(leg.commands)
    while twin.steps < steps:
        until = twin.time_ns + every * step + AHEAD_NS
        while stamp < until:
            check_taken(twin.offer_pose(motion.pose(stamp)))
            stamp += SAMPLE_PERIOD_NS
        for name, winch in winches_by_name(scene).items():
            if name != WINCH or not leg.commands:
                for sample in schedule_samples(winch, commanded, until):
                    check_taken(twin.offer_command(sample.stamp_ns, sample.command, name))
        commanded = until
        while waiting and waiting[0].stamp_ns < until:
            sample = waiting.pop(0)
            check_taken(twin.offer_command(sample.stamp_ns, sample.command))
        twin.advance(min(every, steps - twin.steps))
        yield twin.snapshot()


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
    waves = scene.listed(WavesParams)
    assert waves is not None
    components = components_of(waves, scene.environment.gravity_m_per_s2)
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

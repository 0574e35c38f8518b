"""Limits of scene and crew, and the alerts that follow them.

A crew sets limits during a run; it can only be stricter than the scene, so that no alert of the
scene's limits is lost. The limits in force are a row of the diagnostics; the commands are in every
bag (`alerts/command`).
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from typing import NamedTuple

from rope_twin.alerts.alert_list import Priority
from rope_twin.effects.seabed import SeabedParams
from rope_twin.errors import InputError, did_you_mean
from rope_twin.messages.diagnostics import breach_words
from rope_twin.messages.reports import Status, crew_limits_row
from rope_twin.scene.lift import LiftFigures, lift_figures
from rope_twin.scene.rigging import is_joined, winch_of
from rope_twin.scene.schema import Scene
from rope_twin.scene.winch import Drum
from rope_twin.twin.contact import LandingWatch, payload_motions
from rope_twin.twin.run_record import LINES, LoadRules, minimum_tensions_n, watches_bends
from rope_twin.twin.snapshot import LimitBreach, Snapshot

NEAR_LIMIT = 0.95  # of a limit: a warning
WITHOUT_LIMIT = 0.5  # of the MBL, where a scene gives no limit: codes allow less (UNOLS: 1/FS)
EVENT_S = 10.0  # an event, such as a landing too fast, is a present situation for so long
CAUTION, WARNING, ALARM = Priority.CAUTION, Priority.WARNING, Priority.ALARM
SCENE = "scene"  # in place of a number: the scene's limit alone applies again


class CrewLimit(NamedTuple):
    """Limit that a crew can set."""

    unit: str
    at_least: bool = False  # stricter is more
    needs: str = ""  # that a scene must have; "": any scene can have it


_BED, _PAYLOAD, _LINES = "a seabed", "a payload", "two lines around one sheave"
_BENDS = "a rope with bending stiffness or a minimum bend radius"
CREW_LIMITS = {
    "tension_n": CrewLimit("N"),
    "utilisation": CrewLimit(""),
    "min_tension_n": CrewLimit("N", at_least=True),
    "bend_radius_m": CrewLimit("m", at_least=True, needs=_BENDS),
    "payload_depth_m": CrewLimit("m", needs=_PAYLOAD),
    "payload_speed_m_per_s": CrewLimit("m/s", needs=_PAYLOAD),
    "landing_speed_m_per_s": CrewLimit("m/s", needs=_BED),
    "bed_clearance_m": CrewLimit("m", at_least=True, needs=_BED),
    "line_clearance_m": CrewLimit("m", at_least=True, needs=_LINES),
}
Levels = tuple[tuple[float, Priority], ...]
_BROKEN = ("landing_speed_m_per_s", "min_tension_n", "bend_radius", "strain")
_NEARING: Levels = ((NEAR_LIMIT, WARNING), (1.0, ALARM))


class Measure(NamedTuple):
    """Measure of a situation at one place."""

    where: str
    value: float  # a level is reached from its threshold up
    levels: Levels
    text: str


def present(where: str, priority: Priority, text: str) -> Measure:
    """Return the measure of a situation that is either there or not."""
    return Measure(where, 1.0, ((1.0, priority),), text)


def scene_limits(scene: Scene) -> dict[str, float | None]:
    """Return the scene's own limits by the names of CREW_LIMITS, or None if it gives none."""
    limits, rules = scene.limits, LoadRules(scene)
    radii = [rules.radius_m(name) for name in rules.ropes] if limits.bend_radius else []
    values = {name: getattr(limits, name) for name in CREW_LIMITS if name != "bend_radius_m"}
    return values | {"tension_n": max(rules.allowed_n), "bend_radius_m": max(radii, default=None)}


def impossible_limits(scene: Scene) -> dict[str, str]:
    """Return the names of CREW_LIMITS that a scene cannot have, with what it lacks."""
    has = {
        "": True,
        _BED: scene.listed(SeabedParams) is not None,
        _PAYLOAD: bool(scene.payloads),
        _LINES: len(scene.sheaves) == 1,
        _BENDS: watches_bends(scene),
    }
    return {name: limit.needs for name, limit in CREW_LIMITS.items() if not has[limit.needs]}


class CrewLimits:
    """Limits set by a crew, by the names of those of a scene."""

    def __init__(
        self, of_scene: Mapping[str, float | None], impossible: Mapping[str, str] | None = None
    ) -> None:
        """Set no limit.

        of_scene: the scene's own, None where it has none; impossible: those that the scene cannot
        have, and what it lacks.
        """
        self._of_scene, self._impossible = of_scene, impossible or {}
        self._set: dict[str, float] = {}
        self._loosened: set[str] = set()

    def set(self, name: str, words: str) -> str:
        """Set or end a limit and return the answer in words.

        words: a number in SI units, or SCENE.

        Raises:
            InputError: no such limit, no positive number, or not stricter than the scene's.
        """
        where = f"limit {name}"
        if name not in CREW_LIMITS:
            raise InputError(where, "no such limit", did_you_mean(name, CREW_LIMITS))
        unit, at_least, _ = CREW_LIMITS[name]
        if name in self._impossible:
            problem = f"the scene has not {self._impossible[name]}"
            raise InputError(where, problem, "set another limit")
        if words == SCENE:
            self._put(name, None)
            return f"{where}: that of the scene"
        try:
            value = float(words)
        except ValueError:
            value = math.nan
        if not (value > 0.0 and math.isfinite(value)):
            remedy = f"give a positive number{unit and f' in {unit}'}, or {SCENE}"
            raise InputError(where, f"'{words}'", remedy)
        scene = self._of_scene.get(name)
        if scene is not None and (value <= scene if at_least else value >= scene):
            problem = f"{_of(value, unit)} is not stricter than the scene's {_of(scene, unit)}"
            raise InputError(where, problem, f"give {'more' if at_least else 'less'}, or {SCENE}")
        self._put(name, value)
        return f"{where}: {_of(value, unit)}"

    def _put(self, name: str, value: float | None) -> None:
        """Set a limit, or end it; remember it if that allows more."""
        before = self._set.get(name)
        self._set.pop(name, None)
        if value is not None:
            self._set[name] = value
        if before is not None:
            at_least = CREW_LIMITS[name].at_least
            if value is None or (value < before if at_least else value > before):
                self._loosened.add(name)

    def take_loosened(self) -> tuple[str, ...]:
        """Return the names of the limits that allow more than at the last call."""
        loosened = tuple(self._loosened)
        self._loosened.clear()
        return loosened

    def memory(self) -> dict[str, float]:
        """Return the limits that are set, by name."""
        return dict(self._set)

    def get(self, name: str) -> float | None:
        """Return the crew's limit of a name; None: none is set."""
        return self._set.get(name)

    def stricter(self, name: str) -> float | None:
        """Return the stricter of a limit of the scene and the crew's; None: there is neither."""
        both = self._of_scene.get(name), self._set.get(name)
        limits = [limit for limit in both if limit is not None]
        return (max if CREW_LIMITS[name].at_least else min)(limits, default=None)

    def row(self) -> Status:
        """Return the row of the diagnostics; values: the limits in SI units, by name."""
        limits = (
            f"{name} {_of(value, CREW_LIMITS[name].unit)}" for name, value in self._set.items()
        )
        words = ", ".join(limits) or "none beside those of the scene"
        return crew_limits_row(self._set, words)


class DrumRope(NamedTuple):
    """Rope on the drum of a winch."""

    winch: str
    drum: Drum
    diameter_m: float
    whole_m: float  # length of the rope, of which the line out has left

    def turns(self, line_out_m: float) -> float:
        """Return the turns left on the drum."""
        return self.drum.turns(self.whole_m - line_out_m, self.diameter_m)

    def to_layer_m(self, line_out_m: float) -> float:
        """Return the length of line to the nearest change of layer [m]; infinite: there is none."""
        drum, d, stored_m = self.drum, self.diameter_m, self.whole_m - line_out_m
        layer = drum.layer_of(stored_m, d)
        ends = (drum.length_m(k, d) for k in (layer - 1, layer))
        distances = [abs(stored_m - end) for end in ends if 0.0 < end < self.whole_m]
        return min(distances, default=math.inf)


class SceneFigures:
    """Limits and static loads of a scene, constant during a run, and the limits of its crew."""

    def __init__(self, scene: Scene) -> None:
        rules = LoadRules(scene)
        self.limits = scene.limits
        self.payloads = tuple(payload.name for payload in scene.payloads)
        self.allowed_n = dict(zip(rules.ropes, rules.allowed_n, strict=True))
        self.limited = scene.limits.tension_n is not None or scene.limits.utilisation < 1.0
        self.crew = CrewLimits(scene_limits(scene), impossible_limits(scene))
        self.stores: dict[int, DrumRope] = {}  # rope on each drum by the number of its rope
        for number, line in enumerate(scene.ropes):
            winch = winch_of(scene, line)
            if winch is not None and winch.drum is not None:
                diameter_m = line.made_of[-1].rope.diameter_m  # the upper end is on the drum
                store = DrumRope(line.from_, winch.drum, diameter_m, winch.max_line_out_m)
                self.stores[number] = store
        self._lift: LiftFigures | None = None
        if not is_joined(scene) and scene.payloads and not scene.ropes[0].fixed_at_m:
            self._lift = lift_figures(scene)

    def weight_n(self, line_out_m: float) -> float:
        """Return the static load on the rope's lower end [N]; NaN: not a hanging payload."""
        return math.nan if self._lift is None else self._lift.suspended.weight_n(line_out_m)


class LimitWatch:
    """Measures what the limits of scene and crew apply to, snapshot by snapshot."""

    def __init__(self, figures: SceneFigures) -> None:
        self._figures, self.crew = figures, figures.crew
        self._broken: dict[tuple[str, str], LimitBreach] = {}  # of the crew's limits
        self._landings = LandingWatch()

    def tension(self, snapshot: Snapshot) -> Iterator[Measure]:
        """Find the tension at the top of each rope, against the least of its limits."""
        figures, crew = self._figures, self.crew
        tops = {line.name: line.tension_top_n for line in snapshot.ropes[1:]}
        max_n, max_utilisation = crew.get("tension_n"), crew.get("utilisation")
        for number, rope in enumerate(snapshot.strength):
            used_up = (max_utilisation or math.inf) * rope.breaking_load_n
            own = figures.allowed_n.get(rope.name, rope.breaking_load_n)
            if rope.utilisation_now is not None:  # sections, each with its own MBL
                own, used_up = figures.limits.tension_n or math.inf, math.inf
            allowed = min(own, max_n or math.inf, used_up)
            now = snapshot.tension_top_max_n if number == 0 else tops.get(rope.name, 0.0)
            is_limited = figures.limited or max_n is not None or max_utilisation is not None
            near = NEAR_LIMIT if is_limited else WITHOUT_LIMIT
            share = now / allowed
            text = f"tension of '{rope.name}' {now / 1e3:.1f} kN, limit {allowed / 1e3:.1f} kN"
            limit = min(figures.limits.utilisation, max_utilisation or math.inf)
            if rope.utilisation_now is not None and rope.utilisation_now / limit > share:
                share = rope.utilisation_now / limit
                text = f"utilisation of '{rope.name}' {rope.utilisation_now:.2f}, limit {limit:.2f}"
            yield Measure(rope.name, share, ((near, WARNING), (1.0, ALARM)), text)

    def payload(self, snapshot: Snapshot) -> Iterator[Measure]:
        """Find speed and depth of the payloads."""
        fastest = self.crew.stricter("payload_speed_m_per_s")
        deepest = self.crew.stricter("payload_depth_m")
        if fastest is None and deepest is None:
            return
        names = self._figures.payloads or ("payload",)
        for name, (position, velocity) in zip(
            names, payload_motions(snapshot, len(names)), strict=False
        ):
            if fastest is not None:
                speed = math.sqrt(float(velocity @ velocity))
                text = f"speed of '{name}' {speed:.2f} m/s, limit {fastest:g} m/s"
                yield Measure(f"{name} speed", speed / fastest, _NEARING, text)
            if deepest:
                depth = -float(position[2])
                text = f"depth of '{name}' {depth:.1f} m, limit {deepest:g} m"
                yield Measure(f"{name} depth", depth / deepest, _NEARING, text)

    def clearance(self, snapshot: Snapshot) -> Iterator[Measure]:
        """Find the height of the payload above the bed, and the distance of two lines."""
        height = self.crew.stricter("bed_clearance_m")
        min_m = self.crew.stricter("line_clearance_m")
        if height is not None and snapshot.seabed is not None:
            now = snapshot.seabed.payload_height_m
            text = f"payload {now:.1f} m above the bed, limit {height:g} m"
            yield Measure("bed", _nearness(now, height), _NEARING, text)
        if min_m is not None and snapshot.lines is not None:
            now = snapshot.lines.nearest.distance_m
            depth = f"{snapshot.lines.nearest.depth_m:.0f} m"
            text = f"lines {now:.2f} m apart at {depth}, limit {min_m:g} m"
            yield Measure(LINES, _nearness(now, min_m), _NEARING, text)

    def broken(self, snapshot: Snapshot) -> Iterator[Measure]:
        """Find limits broken in an instant or along the rope: the scene's, then the crew's."""
        self._observe(snapshot)
        for breach in (*snapshot.breaches, *self._broken.values()):
            if breach.limit in _BROKEN and snapshot.time_s - breach.last_s <= EVENT_S:
                yield present(f"{breach.where} {breach.limit}", ALARM, breach_words(breach))

    def _observe(self, snapshot: Snapshot) -> None:
        """Record which of the crew's limits of this kind are broken now."""
        min_n, radius_m = self.crew.get("min_tension_n"), self.crew.get("bend_radius_m")
        landing = self.crew.get("landing_speed_m_per_s")
        in_force = {"min_tension_n": min_n, "bend_radius": radius_m,
                    "landing_speed_m_per_s": landing}  # fmt: skip
        for limit, where in list(self._broken):
            if in_force[limit] != self._broken[limit, where].allowed:
                del self._broken[limit, where]
        if min_n is not None:
            names = [rope.name for rope in snapshot.ropes or snapshot.strength]
            for name, low_n in zip(names, minimum_tensions_n(snapshot), strict=False):
                if low_n < min_n:
                    self._break(snapshot.time_s, "min_tension_n", name, (low_n, min_n))
        if radius_m is not None:
            for bend in snapshot.bends:
                if bend.now.radius_m < radius_m:
                    values = bend.now.radius_m, radius_m
                    self._break(snapshot.time_s, "bend_radius", bend.now.name, values)
        if landing is not None and snapshot.seabed is not None:
            payloads = self._figures.payloads or ("payload",)
            for number, speed in self._landings.take(snapshot):
                if speed > landing:
                    values = speed, landing
                    self._break(snapshot.time_s, "landing_speed_m_per_s", payloads[number], values)

    def _break(self, time_s: float, limit: str, where: str, values: tuple[float, float]) -> None:
        """Record that a limit is broken now; found: the value and the limit."""
        value, allowed = values
        previous = self._broken.get((limit, where))
        first_s, worst, worst_s = time_s, value, time_s
        if previous is not None and time_s - previous.last_s <= EVENT_S:
            first_s = previous.first_s
            if (previous.worst - value) * (value - allowed) >= 0.0:  # it was as bad or worse before
                worst, worst_s = previous.worst, previous.worst_s
        breach = LimitBreach(limit, where, allowed, first_s, time_s, worst, worst_s)
        self._broken[limit, where] = breach


def _nearness(value: float, least: float) -> float:
    """Return a limit over a value that must not be below it; infinite at zero and below."""
    return least / value if value > 0.0 else math.inf


def _of(value: float, unit: str) -> str:
    return f"{value:g} {unit}".rstrip()

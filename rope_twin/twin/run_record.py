"""Record of a run: extremes of tension, utilisation, the scene's limits, and bends.

Snapshots are completed with the results.

The tension at the upper end of each rope is checked after every step; the tension along a rope, the
payload's motion and bends are checked at snapshots (50 Hz in every run). The strain is that of the
maximum tension divided by the rope's stiffness, so it covers every step too and excludes damping.
The utilisation of a rope of several sections is the highest of them, each with its own MBL; the
uppermost one counts in every step.

Dynamic amplification is the maximum since the start of the ratio of the tension at a rope's upper
end to its static tension at the same paid-out length (DNV-RP-N103: total over static load). The
static tension is that of the static equilibrium at the start, plus the weight in water of the rope
paid out since. For a single rope with its payload below it, it follows the payload through the
surface, and the reaction of deck or bed to the payload at the start is added.

The bends of a rope are judged by the smallest radius and where it occurs. At a node between
elements of unit directions t and unstretched mean length l the curvature is |t' - t|/l =
2·sin(turn/2)/l, as of the discrete rod (Bergou et al. 2008, section 4.2, for small turns); for
equal elements along a circle it is exactly 1/R. Where the hang-off holds the rope's direction, the
turn to it counts over half the top element, as in `effects/bending.py`.

The mesh limits the result: a rope folded back on itself has a curvature of 2/l, so no radius below
l/2 is ever reported, and an arc shorter than an element is not resolved. A slack rope without
bending stiffness bends as sharply as its elements allow: its radius is then that of the mesh. A
rope with bending stiffness that would carry compression gets shorter instead of bending aside
(`effects/bending.py`): the unstretched length of such elements is reported beside the radius.
"""

from __future__ import annotations

import copy
import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import astuple
from typing import Any, NamedTuple

import numpy as np

from rope_twin.core import state as rows
from rope_twin.core.state import Floats, Rope
from rope_twin.effects.bending import Bending, BendingParams
from rope_twin.effects.hull_contact import HullContactParams
from rope_twin.scene.grid import is_compensated
from rope_twin.scene.lift import LiftFigures, alone, lift_figures
from rope_twin.scene.rigging import is_joined, winch_of
from rope_twin.scene.schema import RopeLine, Scene
from rope_twin.twin.contact import (
    LandingWatch,
    hull_contacts,
    payload_motions,
    seabed_contact,
    seabed_of,
    touchdown_of,
)
from rope_twin.twin.quality import QualityIndex
from rope_twin.twin.ropes import Ropes
from rope_twin.twin.snapshot import (
    Bend,
    Landings,
    LimitBreach,
    RopeBend,
    RopeStrength,
    Snapshot,
    Vector,
    amended,
)
from rope_twin.twin.snapshot_builder import (
    Extremes,
    RopeShape,
    RunStatistics,
    body_of,
    with_body,
    with_compensator,
)
from rope_twin.twin.state import Clock
from rope_twin.twin.validity import ModelRange
from rope_twin.vortex.line_model import bending_stiffness

LINE_OUT_TOL_M = 0.02  # the static tension is computed again when the line out has changed by more
MAX_TENSION_N = 1e12
SHORTENING_TOL = 1e-3  # of an element's length: less is round-off, or a damper's
SUPPORT_TOL = 0.05  # of the tension at the lower end: less is the lowest element's own weight
ROPE_LIMITS = ("tension_n", "utilisation", "strain", "min_tension_n", "bend_radius")
PAYLOAD_LIMITS = ("payload_speed_m_per_s", "payload_depth_m", "landing_speed_m_per_s",
                  "bed_clearance_m")  # fmt: skip
LINES = "the two lines"  # around a sheave: to which the limit line_clearance_m belongs
LOWER_LIMITS = ("min_tension_n", "bend_radius", "bed_clearance_m", "line_clearance_m")
_STORED = ("radius_m", "line_out_m", "at_s", "minimum_m", "element_m")  # fields of a Bend


class LoadRules:
    """Load limits and static tensions of a scene, constant during a run."""

    def __init__(self, scene: Scene) -> None:
        self.limits = limits = scene.limits
        self.ropes = tuple(line.name for line in scene.ropes)
        self.payloads = tuple(payload.name for payload in scene.payloads)
        self.lengths_m = tuple(line.length_m for line in scene.ropes)
        self.watches_payload = any(getattr(limits, name) is not None for name in PAYLOAD_LIMITS)
        self.allowed_n = tuple(self._allowed_n(scene, r) for r in range(len(scene.ropes)))
        self._lines = scene.ropes
        self._static = tuple(_weight_of_line(scene, r) for r in range(len(scene.ropes)))

    def _allowed_n(self, scene: Scene, r: int) -> float:
        """Return the tension of a rope at which the first of its limits is exceeded [N]."""
        ropes = [section.rope for section in scene.ropes[r].made_of]
        limits_n = [self.limits.utilisation * scene.ropes[r].breaking_load_n]
        if self.limits.tension_n is not None:
            limits_n.append(self.limits.tension_n)
        return min(*limits_n, *(_tension_at(rope.strain_at, self.limits.strain) for rope in ropes))

    def upper_mbl_n(self, r: int, line_out_m: float) -> float:
        """Return the MBL of a rope's uppermost section that is paid out [N]."""
        line = self._lines[r]
        out = zip(line.made_of, line.lengths_m(line_out_m), strict=True)
        return [section.rope.breaking_load_n for section, length_m in out if length_m > 0.0][-1]

    def strain_at(self, r: int, tension_n: float) -> float:
        """Return the strain of the softest section of a rope under a tension [N]."""
        return max(section.rope.strain_at(tension_n) for section in self._lines[r].made_of)

    def radius_m(self, name: str) -> float:
        """Return the minimum bend radius of a rope [m], the largest of its sections."""
        line = self._lines[self.ropes.index(name)]
        return max(section.rope.minimum_bend_radius_m or 0.0 for section in line.made_of)

    def supported_n(self, end_n: float) -> float:
        """Return the reaction of deck or bed to a single rope's payload [N].

        end_n: tension at the rope's lower end [N]. The reaction is part of the static tension:
        after lift-off the rope carries the whole weight of the load.
        """
        figures, _ = self._static[0]
        if figures is None or len(self.ropes) > 1:
            return 0.0
        reaction_n = figures.suspended.weight_n(self.lengths_m[0]) - end_n
        return reaction_n if reaction_n > SUPPORT_TOL * abs(end_n) else 0.0

    def static_n(self, r: int, start_n: float, line_out_m: float) -> float:
        """Return the static tension of a rope at a payout [N]; start_n: at the start [N]."""
        figures, slope = self._static[r]
        if figures is None:
            return start_n + slope * (line_out_m - self.lengths_m[r])
        return (
            start_n + figures.top_tension_n(line_out_m) - figures.top_tension_n(self.lengths_m[r])
        )


class LoadRecord:
    """Maximum loads and exceeded limits of a run; `look` takes the next snapshot."""

    def __init__(self, rules: LoadRules, start_n: Sequence[float]) -> None:
        """Start from `start_n`, the static tension at the upper end of each rope [N]."""
        ropes = len(rules.ropes)
        self._start_n = list(start_n)
        self._max_n = [0.0] * ropes
        self._top_max_n = [0.0] * ropes
        self._most_used = [(0.0, 1.0)] * ropes  # tension [N] and MBL [N] of the most used section
        self._static_n = list(start_n)
        self._static_at_m = list(rules.lengths_m)
        self._amplification = [0.0] * ropes
        self._watch = LandingWatch()
        # numbers, since the fields of an object must be in a saved state from the start
        self._landings: list[float] = []
        self._broken = False
        # for each limit: first and last time [s], worst value and its time [s]; -inf: not exceeded
        count = ropes * len(ROPE_LIMITS) + len(rules.payloads) * len(PAYLOAD_LIMITS)
        self._found = [[-math.inf] * 4 for _ in range(count + 1)]  # the last: of the two lines

    @property
    def landings(self) -> Landings | None:
        """Landings of the payloads since the start; None: none has landed."""
        if not self._landings:
            return None
        count, *rest = self._landings
        return Landings(int(count), *rest)

    def observe(
        self, snapshot: Snapshot, rules: LoadRules, bends: tuple[RopeBend, ...]
    ) -> tuple[tuple[RopeStrength, ...], tuple[LimitBreach, ...]]:
        """Return the strength results of each rope and the limits exceeded since the start."""
        count = len(rules.ropes)
        strength = [
            self._load(snapshot, r, rope_strength, rules) if r < count else rope_strength
            for r, rope_strength in enumerate(snapshot.strength)
        ]
        limits = rules.limits
        if limits.min_tension_n is not None:
            for r, low_n in enumerate(minimum_tensions_n(snapshot)[:count]):
                if low_n < limits.min_tension_n:
                    self._record_breach(self._row(r, 3), -low_n, snapshot.time_s)
        if limits.bend_radius:
            for bend in bends:
                if bend.now.too_tight and bend.now.name in rules.ropes:
                    row = self._row(rules.ropes.index(bend.now.name), 4)
                    self._record_breach(row, -bend.now.radius_m, snapshot.time_s)
        if rules.watches_payload and rules.payloads:
            self._check_payloads(snapshot, rules)
        if snapshot.seabed is not None and rules.payloads:
            self._check_landings(snapshot, rules)
        min_clearance_m = limits.line_clearance_m
        if min_clearance_m is not None and snapshot.lines is not None:
            distance_m = snapshot.lines.nearest.distance_m
            if distance_m < min_clearance_m:
                self._record_breach(len(self._found) - 1, -distance_m, snapshot.time_s)
        return tuple(strength), tuple(self._breaches(rules)) if self._broken else ()

    def _load(
        self, snapshot: Snapshot, r: int, strength: RopeStrength, rules: LoadRules
    ) -> RopeStrength:
        """Return a rope's maximum tension, utilisation and dynamic amplification."""
        if snapshot.ropes and r > 0:
            now_n, line_out_m = snapshot.ropes[r].tension_top_n, snapshot.ropes[r].line_out_m
        else:
            # the first snapshot's maximum includes the static equilibrium, which no step computed
            is_first = self._top_max_n[r] == 0.0
            now_n = strength.top_max_n if is_first else snapshot.tension_top_max_n
            line_out_m = snapshot.line_out_m
        has_grown = strength.max_n > self._max_n[r]
        current_n = max(now_n, strength.max_n) if has_grown else now_n
        top_has_grown = strength.top_max_n > self._top_max_n[r]
        peak_n = max(now_n, strength.top_max_n) if top_has_grown else now_n
        self._top_max_n[r] = max(self._top_max_n[r], strength.top_max_n)
        max_n = self._max_n[r] = max(self._max_n[r], current_n)
        used = (current_n, rules.upper_mbl_n(r, line_out_m))
        if strength.section_n is not None:
            used = max(used, (strength.section_n, strength.breaking_load_n), key=_share)
        self._most_used[r] = max(self._most_used[r], used, key=_share)
        if current_n > rules.allowed_n[r]:
            self._check_tension(r, current_n, _share(used), (snapshot.time_s, rules))
        if snapshot.cut is None:
            if abs(line_out_m - self._static_at_m[r]) > LINE_OUT_TOL_M:
                self._static_at_m[r] = line_out_m
                self._static_n[r] = rules.static_n(r, self._start_n[r], line_out_m)
            static_n = self._static_n[r]
            if static_n > 0.0 and peak_n > self._amplification[r] * static_n:
                self._amplification[r] = peak_n / static_n
        carried_n, mbl_n = self._most_used[r]
        amplification = self._amplification[r] or None
        of_section = strength.section_n is not None
        return RopeStrength(
            strength.name, max_n, mbl_n, self._static_n[r], amplification,
            section_n=carried_n if of_section else None,
            utilisation_now=_share(used) if of_section else None,
            top_max_n=self._top_max_n[r],
        )  # fmt: skip

    def _check_tension(
        self, r: int, tension_n: float, utilisation: float, at: tuple[float, LoadRules]
    ) -> None:
        """Record which limits of a rope this tension exceeds; at: the time [s] and the rules."""
        time_s, rules = at
        limits = rules.limits
        values = (
            (tension_n, limits.tension_n),
            (utilisation, limits.utilisation),
            (rules.strain_at(r, tension_n), limits.strain),
        )
        for number, (value, limit) in enumerate(values):
            if limit is not None and value > limit:
                self._record_breach(self._row(r, number), value, time_s)

    def _check_payloads(self, snapshot: Snapshot, rules: LoadRules) -> None:
        limits, first = rules.limits, len(rules.ropes) * len(ROPE_LIMITS)
        for number, (position, velocity) in enumerate(
            payload_motions(snapshot, len(rules.payloads))
        ):
            row = first + number * len(PAYLOAD_LIMITS)
            x, y, z = velocity.tolist()
            depth_m = -float(position[2])
            if limits.payload_speed_m_per_s is not None:
                speed = math.sqrt(x * x + y * y + z * z)
                if speed > limits.payload_speed_m_per_s:
                    self._record_breach(row, speed, snapshot.time_s)
            if limits.payload_depth_m is not None and depth_m > limits.payload_depth_m:
                self._record_breach(row + 1, depth_m, snapshot.time_s)
        if snapshot.seabed is None or limits.bed_clearance_m is None:
            return
        for number, (height_m, _) in enumerate(snapshot.seabed.payloads):
            if height_m < limits.bed_clearance_m:
                row = first + number * len(PAYLOAD_LIMITS) + 3
                self._record_breach(row, -height_m, snapshot.time_s)

    def _check_landings(self, snapshot: Snapshot, rules: LoadRules) -> None:
        """Record the payloads that land now, and which of them are too fast."""
        limit = rules.limits.landing_speed_m_per_s
        for number, speed in self._watch.take(snapshot):
            known = self.landings
            first = Landings(1, snapshot.time_s, speed, snapshot.time_s, speed)
            now = first if known is None else known.then(snapshot.time_s, speed)
            self._landings = list(astuple(now))
            if limit is not None and speed > limit:
                row = len(rules.ropes) * len(ROPE_LIMITS) + number * len(PAYLOAD_LIMITS)
                self._record_breach(row + 2, speed, snapshot.time_s)

    def _row(self, r: int, number: int) -> int:
        return r * len(ROPE_LIMITS) + number

    def _record_breach(self, row: int, value: float, time_s: float) -> None:
        """Record that a limit is exceeded now; a lower limit takes the negative value."""
        breach = self._found[row]
        if breach[0] == -math.inf:
            breach[0] = time_s
        if value > breach[2]:
            breach[2:] = [value, time_s]
        breach[1], self._broken = time_s, True

    def _breaches(self, rules: LoadRules) -> Iterator[LimitBreach]:
        names = [(key, name) for name in rules.ropes for key in ROPE_LIMITS]
        names += [(key, name) for name in rules.payloads for key in PAYLOAD_LIMITS]
        names.append(("line_clearance_m", LINES))
        for (key, name), (first_s, last_s, worst, worst_s) in zip(names, self._found, strict=True):
            if first_s == -math.inf:
                continue
            bent = key == "bend_radius"
            limit = rules.radius_m(name) if bent else getattr(rules.limits, key)
            value = -worst if key in LOWER_LIMITS else worst
            yield LimitBreach(key, name, float(limit), first_s, last_s, value, worst_s)


def _share(carried: tuple[float, float]) -> float:
    tension_n, breaking_load_n = carried
    return tension_n / breaking_load_n


def _weight_of_line(scene: Scene, r: int) -> tuple[LiftFigures | None, float]:
    """Return the dependence of a rope's static tension on its paid-out length.

    For a single rope with its payload below it, the properties of the lift; for others the weight
    in water of the rope paid out [N/m], 0 without a winch.
    """
    line = scene.ropes[r]
    if winch_of(scene, line) is None:
        return None, 0.0
    figures = lift_figures(alone(scene, r) if is_joined(scene) else scene)
    slope = figures.bars[-1].weight_n_per_m
    hangs = not is_joined(scene) and not line.fixed_at_m and not figures.rises
    return (figures if hangs else None), slope


def _tension_at(strain_at: Callable[[float], float], strain: float) -> float:
    """Return the tension at which a rope has this strain [N]; infinite if it never has."""
    low, high = 0.0, MAX_TENSION_N
    if strain_at(high) < strain:
        return math.inf
    while high - low > 1e-9 * high:
        middle = 0.5 * (low + high)
        low, high = (middle, high) if strain_at(middle) < strain else (low, middle)
    return high


def minimum_tensions_n(snapshot: Snapshot) -> list[float]:
    """Return the minimum tension of each rope [N]; a single rope's top counts in every step."""
    if not snapshot.ropes:
        return [min(snapshot.tension_top_min_n, float(snapshot.element_tension_n.min()))]
    return [float(rope.element_tension_n.min()) for rope in snapshot.ropes]


def curvatures(position: Vector, arc: Vector, held: Vector | None = None) -> Vector:
    """Curvature at the nodes [1/m], (n,).

    position: nodes (n, 3) [m]; arc: their unstretched arc length [m], (n,); held: unit vector of
    the direction in which the rope is clamped at the first node, or None for a free end.
    """
    chord, rest_lengths = np.diff(position, axis=0), np.diff(arc)
    length = np.sqrt((chord * chord).sum(axis=1))[:, None]
    direction = np.divide(chord, length, out=np.zeros_like(chord), where=length > 0.0)
    curvature = np.zeros(len(position))
    turn, both = np.diff(direction, axis=0), rest_lengths[1:] + rest_lengths[:-1]
    curvature[1:-1] = 2.0 * np.sqrt((turn * turn).sum(axis=1)) / both
    if held is not None:
        curvature[0] = 2.0 * float(np.linalg.norm(direction[0] - held)) / rest_lengths[0]
    return curvature


def minimum_radii(shape: RopeShape) -> Vector:
    """Minimum bend radius at the nodes [m], (n,); 0: none is given; the larger at section ends."""
    radii = np.array([section.rope.minimum_bend_radius_m or 0.0 for section in shape.line.made_of])
    if len(radii) == 1:
        return np.full(len(shape.arc_m), radii[0])
    ends = shape.core.sections[rows.END, : len(radii)]
    s, last = shape.arc_m[-1] - shape.arc_m, len(radii) - 1
    below, above = (
        radii[np.minimum(np.searchsorted(ends, s, side=side), last)] for side in ("left", "right")
    )
    return np.asarray(np.maximum(below, above))


class BendMonitor:
    """Monitor of the smallest bend radius of each rope with bending stiffness or a minimum radius.

    It samples at each snapshot and keeps the smallest radius of all snapshots.
    """

    def __init__(self, scene: Scene) -> None:
        """Reserve a row for each rope of the scene, and for the lower part of a cut rope."""
        self._tightest = np.zeros((len(scene.ropes) + 1, len(_STORED)))
        self._tightest[:, 0] = math.inf

    def observe(self, ropes: tuple[RopeShape, ...], time_s: float) -> tuple[RopeBend, ...]:
        """Return the bend of each monitored rope now; time_s: twin time [s]."""
        return tuple(
            self._bend_of(number, shape, time_s)
            for number, shape in enumerate(ropes)
            if limits_bends(shape.line) or bending_stiffness(shape.core.effects) > 0.0
        )

    def _bend_of(self, number: int, shape: RopeShape, time_s: float) -> RopeBend:
        present, position = smallest_radius(shape, time_s)
        tightest = Bend(shape.name, *self._tightest[number].tolist())
        if present.tightness > tightest.tightness:
            tightest = present
            self._tightest[number] = [getattr(present, name) for name in _STORED]
        return RopeBend(present, position, tightest, compressed_length_m(shape))


def smallest_radius(shape: RopeShape, time_s: float) -> tuple[Bend, tuple[float, float, float]]:
    """Return the bend closest to its minimum radius, or furthest below it, and its position [m].

    For a rope without a minimum bend radius it is the smallest radius; if only some sections have a
    minimum radius, only these count.
    """
    curvature = curvatures(shape.position_m, shape.arc_m, _clamped_direction(shape))
    radii = minimum_radii(shape)
    node = int(np.argmax(curvature * radii if radii.any() else curvature))
    rest_lengths = np.diff(shape.arc_m)[max(node - 1, 0) : node + 1]
    x, y, z = (float(part) for part in shape.position_m[node])
    bend = Bend(
        name=shape.name,
        radius_m=1.0 / float(curvature[node]) if curvature[node] > 0.0 else math.inf,
        line_out_m=float(shape.arc_m[node]),
        at_s=time_s,
        minimum_m=float(radii[node]),
        element_m=float(rest_lengths.mean()),
    )
    return bend, (x, y, z)


def compressed_length_m(shape: RopeShape) -> float:
    """Return the unstretched length of a stiff rope's compressed elements [m]."""
    if bending_stiffness(shape.core.effects) == 0.0:
        return 0.0
    rest_lengths = np.diff(shape.arc_m)
    length = np.linalg.norm(np.diff(shape.position_m, axis=0), axis=1)
    return float(rest_lengths[length < (1.0 - SHORTENING_TOL) * rest_lengths].sum())


def watches_bends(scene: Scene) -> bool:
    """Return whether any rope of the scene is monitored for bends."""
    stiff = scene.listed(BendingParams) or any(line.bending for line in scene.ropes)
    return bool(stiff) or any(limits_bends(line) for line in scene.ropes)


def limits_bends(line: RopeLine) -> bool:
    """Return whether a section of the rope has a minimum bend radius."""
    return any(section.rope.minimum_bend_radius_m is not None for section in line.made_of)


def _clamped_direction(shape: RopeShape) -> Vector | None:
    """Return the direction in which the rope's upper end is clamped, downward; None if free."""
    for effect in shape.core.effects:
        if isinstance(effect, Bending) and effect.clamp > 0.0 and not shape.loose:
            return -np.array([effect.x, effect.y, effect.z])
    return None


class RecordState(NamedTuple):
    """State of a record, by the names of its attributes."""

    run: Extremes
    recent: Extremes
    unconverged: int
    loads: LoadRecord
    bends: BendMonitor | None
    quality: QualityIndex


class RunRecord:
    """Record of a run since its start, and of the time since the newest snapshot."""

    def __init__(self, scene: Scene, ropes: Ropes, pulls: Floats, end_n: float) -> None:
        """Start from static equilibrium.

        pulls: force on the upper end of each rope [N], (ropes, PULL_COLUMNS); end_n: tension at the
        lower end of the first one [N].
        """
        self.run, self.recent = Extremes(), Extremes()
        self.recent.take([float(pulls[0, rows.PULL])])
        self.unconverged = 0  # substeps at the newest snapshot
        self._rules = LoadRules(scene)
        start_n = pulls[:, rows.PULL].tolist()
        start_n[0] += self._rules.supported_n(end_n)
        self.loads = LoadRecord(self._rules, start_n)
        self._has_bed = seabed_of(ropes.first) is not None
        self._has_compensator = is_compensated(scene)
        self._has_hull = scene.listed(HullContactParams) is not None
        self._has_body = body_of(ropes.lowest(ropes.first)) is not None
        self.bends = BendMonitor(scene) if watches_bends(scene) else None
        self._range = ModelRange(scene)
        self.quality = QualityIndex()

    def state(self) -> RecordState:
        """Return its state; the parts are its own."""
        return RecordState(**{name: getattr(self, name) for name in RecordState._fields})

    def restore(self, state: RecordState) -> None:
        """Continue with this state."""
        vars(self).update(state._asdict())

    def take(self, tensions_n: list[float]) -> None:
        """Add the top tensions after each of the steps just done [N]."""
        self.run.take(tensions_n)
        self.recent.take(tensions_n)

    def extremes(self) -> tuple[Extremes, Extremes]:
        """Return copies of the extremes since the start and since the newest snapshot."""
        return copy.copy(self.run), copy.copy(self.recent)

    def restore_finite(self, earlier: tuple[Extremes, Extremes]) -> None:
        """Restore earlier extremes if a failed step has left values that are not finite."""
        if not self.run.empty and not math.isfinite(self.run.mean):
            self.run, self.recent = (copy.copy(extremes) for extremes in earlier)

    def statistics(self, clock: Clock) -> RunStatistics:
        """Return the statistics since the start."""
        simulated = clock.time_ns * 1e-9
        factor = simulated / clock.computing_s if clock.computing_s > 0.0 else 0.0
        run = self.run if clock.steps else self.recent
        return RunStatistics(clock.steps, clock.computing_s, factor, run.high, run.mean, run.low)

    def begin_interval(self, unconverged: int) -> None:
        """Start the extremes until the next snapshot; unconverged: substeps since the start."""
        self.unconverged, self.recent = unconverged, Extremes()

    def add_contact(self, snapshot: Snapshot, rope: Rope, ropes: Ropes) -> Snapshot:
        """Add body, compensator, and contact with hull and seabed, if the scene has them."""
        if self._has_body:
            snapshot = with_body(snapshot, ropes.lowest(rope))
        if self._has_compensator:
            snapshot = with_compensator(snapshot, ropes.lowest(rope))
        if self._has_hull:
            snapshot = amended(snapshot, contacts=hull_contacts(rope))
        contact = seabed_contact(rope) if self._has_bed else None
        return snapshot if contact is None else amended(snapshot, seabed=contact)

    def add_loads(self, snapshot: Snapshot, rope: Rope, ropes: Ropes) -> Snapshot:
        """Add touchdown and bends (if the scene has them), loads and limits."""
        added: dict[str, Any] = {}
        bed = seabed_of(rope) if self._has_bed else None
        if bed is not None or self.bends is not None:
            shapes = ropes.shapes(rope, snapshot)
            if bed is not None:
                touchdowns = (touchdown_of(shape, bed) for shape in shapes)
                added["touchdowns"] = tuple(filter(None, touchdowns))
            if self.bends is not None:
                added["bends"] = self.bends.observe(shapes, snapshot.time_s)
        results = self.loads.observe(snapshot, self._rules, added.get("bends", ()))
        added["strength"], added["breaches"] = results
        added["landings"] = self.loads.landings
        return amended(snapshot, **added)

    def judge(
        self, snapshot: Snapshot, effects: tuple[Any, ...], factors: Mapping[str, float]
    ) -> Snapshot:
        """Add the quality indices; arguments as of `ModelRange.outside`."""
        return self.quality.judge(snapshot, self._range.outside(snapshot, effects, factors))

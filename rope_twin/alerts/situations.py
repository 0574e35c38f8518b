"""Situations that call for an alert, found in snapshots and rows of the diagnostics.

Each kind of situation has a number from 10000 up (those below are given by standards), and one or
more levels: a measure from which it has a priority. Chatter is kept out at its source (EEMUA 191,
ISA-18.2): a level counts after its delay, and ends once the measure has been below it by a deadband
for the holding time. All times are those of the twin, so that a faster run judges alike.

What a situation is measured against are the limits of the scene and of the crew; numbers that no
scene gives are named here and are this project's.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

from rope_twin.alerts.alert_list import SECOND, Priority, Situation
from rope_twin.alerts.limits import (
    ALARM,
    CAUTION,
    WARNING,
    CrewLimits,
    Levels,
    LimitWatch,
    Measure,
    SceneFigures,
    present,
)
from rope_twin.messages.reports import RECORDER_ROW, Level, Status
from rope_twin.scene.schema import Scene
from rope_twin.twin.quality import BUILD_UP
from rope_twin.twin.snapshot import BORDER, Snapshot, disagrees
from rope_twin.twin.winch.commands import EMERGENCY_STOP

SLACK_MARGIN = 0.1  # of the static submerged weight, as DNV-RP-N103 4.4 is quoted
SLACK_WINDOW_NS = 60 * SECOND
AT_LIMIT_SHARE = 0.1  # of LIMIT_WINDOW_NS
LIMIT_WINDOW_NS = 60 * SECOND
POOR_INDEX, DOUBTFUL_INDEX = 0.7, 0.5  # of a quality index
RESIDUAL_HEAVE, HEAVING_M_PER_S = 0.3, 0.05  # of the heave rate (RMS), and the least that counts
HEAVE_EVERY_NS, HEAVE_SAMPLES = SECOND // 2, 120  # a minute
MIN_TURNS = 3.0  # on a drum, as codes of cranes ask
LAYER_NEAR_M = 5.0  # of line until a rope leaves the drum from another layer
WAVES_S = 30.0  # two of the longest waves: what each crest exceeds is one situation
RISK_SPAN_S = 30.0  # within which a crew can still stop, haul or lower through
POSSIBLE, LIKELY = 0.1, 0.5  # probabilities that call for a caution and a warning
SUPERVISED = (  # rows of the diagnostics
    "simulation: saving", "simulation: clocks", "simulation: sources", "simulation: messages",
    "simulation: senders", RECORDER_ROW,
)  # fmt: skip
RISK_AGE_NS = 5 * SECOND  # of the last forecast heard: an older one is of the past


class LiftState(NamedTuple):
    """Knowledge about the lift at one time."""

    snapshot: Snapshot
    rows: Mapping[str, Status]  # newest rows of the diagnostics by name, at times older
    scene: SceneFigures
    limits: LimitWatch
    min_payload_n: float  # tension at the payload over the last minute; NaN: does not count
    at_limit: float  # share of the last minute that the winch was at one of its limits
    residual_heave: float  # of the last minute that is not compensated; NaN: does not count
    risk: Mapping[str, float]  # of RISK_SPAN_S ahead, as forecast/risk has it; empty: unknown


@dataclass(frozen=True)
class Kind:
    """A kind of situation."""

    identifier: int
    name: str
    find: Callable[[LiftState], Iterator[Measure]]
    delay_s: float = 0.0  # until a level counts
    hold_s: float = 5.0  # until it ends
    deadband: float = 0.02  # of the threshold
    category: str = "B"  # A: acknowledged only where its cause can be judged


def _slack(at: LiftState) -> Iterator[Measure]:
    """Find the minimum tension at the payload in a minute, against its static weight."""
    weight, least = at.scene.weight_n(at.snapshot.line_out_m), at.min_payload_n
    if not (weight > 0.0 and math.isfinite(least)):
        return
    fraction = least / weight
    words = (
        f"minimum tension at the payload in 60 s {least / 1e3:.2f} kN, {fraction:.0%} of its weight"
    )
    levels = (1.0 - SLACK_MARGIN, WARNING), (1.0, ALARM)
    yield Measure("payload", 1.0 - fraction, levels, words)


def _winch(at: LiftState) -> Iterator[Measure]:
    """Find a winch that is often at a limit: speed, acceleration, torque, stroke of its AHC.

    In waves it is there for a second or two of each; the share of a minute tells it from an end of
    a movement.
    """
    if at.at_limit > 0.0:
        words = at.snapshot.winch_at_limit or "at a limit of late"
        text = f"winch: {words}; at a limit for {at.at_limit:.0%} of a minute"
        yield Measure("winch", at.at_limit, ((AT_LIMIT_SHARE, WARNING),), text)


def _residual(at: LiftState) -> Iterator[Measure]:
    """Find a heave compensation that leaves much of the heave."""
    if math.isfinite(at.residual_heave):
        text = f"{at.residual_heave:.0%} of the heave rate of a minute is left at the line"
        yield Measure("winch", at.residual_heave, ((RESIDUAL_HEAVE, CAUTION),), text)


def _drum(at: LiftState) -> Iterator[Measure]:
    """Find a drum that is nearly empty, and one whose rope changes its layer soon."""
    lengths = [at.snapshot.line_out_m, *(rope.line_out_m for rope in at.snapshot.ropes[1:])]
    for number, line_out_m in enumerate(lengths):
        store = at.scene.stores.get(number)
        if store is None:
            continue
        turns_left, change_m = store.turns(line_out_m), store.to_layer_m(line_out_m)
        text = f"'{store.winch}': {turns_left:.1f} turns left on the drum"
        yield Measure(store.winch, MIN_TURNS / max(turns_left, 1e-9), ((1.0, ALARM),), text)
        text = f"'{store.winch}': change of layer within {change_m:.1f} m of line"
        near = LAYER_NEAR_M / max(change_m, 1e-9)
        yield Measure(f"{store.winch} layer", near, ((1.0, CAUTION),), text)


def _stroke(at: LiftState) -> Iterator[Measure]:
    """Find a heave compensator at one of its stops."""
    compensator = at.snapshot.compensator
    if compensator is not None and compensator.at_stop:
        text = f"piston at its {compensator.at_stop} stop, {compensator.stop_n / 1e3:.1f} kN"
        yield present("compensator", WARNING, text)


def _apart(at: LiftState) -> Iterator[Measure]:
    """Find measured values that lie apart from the computed ones."""
    for residual in at.snapshot.residuals:
        if disagrees(residual):
            label = residual.quantity.rpartition("_")[0].replace("_", " ")
            text = f"{label} of '{residual.name}': measured {residual.measured:.6g}, "
            text += f"computed {residual.computed:.6g}; "
            if residual.outside is not None:
                text += f"{residual.outside:.0%} of a minute apart"
            else:
                text += f"apart by {residual.mean:+.6g} in the mean of a minute"
            yield present(f"{residual.name} {residual.quantity}", WARNING, text)


def _touchdown(at: LiftState) -> Iterator[Measure]:
    """Find a payload that the bed carries."""
    bed = at.snapshot.seabed
    if bed is not None and bed.payload_landed:
        text = f"payload on the seabed, which carries {bed.payload_reaction_n / 1e3:.1f} kN"
        yield present("payload", CAUTION, text)


def _inputs(at: LiftState) -> Iterator[Measure]:
    """Find inputs that fail or are doubtful."""
    for name, health in at.snapshot.inputs.items():
        if name == BORDER:
            continue
        label = name.replace("_", " ")
        if health.fault or health.stale:
            words = health.fault or health.note or "no sample is fresh"
            yield present(name, WARNING, _about(label, words))
        elif health.warning:
            yield present(name, CAUTION, _about(label, health.warning))


def _about(label: str, words: str) -> str:
    """Return words that begin with the input's label once, and end as those of other alerts."""
    subject, colon, detail = words.removesuffix(".").partition(": ")
    if colon and subject.replace("/", " ") == label:
        return f"{label}: {detail}"
    return f"{label}: {subject}{colon}{detail}"


def _quality(at: LiftState) -> Iterator[Measure]:
    """Find results that may no longer be relied on: one alert, since most share their cause.

    The start-up, from which an index rises for some seconds more, is known to everybody.
    """
    settled = (
        element for element in at.snapshot.quality if not element.reason.startswith(BUILD_UP)
    )
    worst = min(settled, key=lambda element: element.index, default=None)
    if worst is None or at.snapshot.motion_ramp < 1.0:
        return
    levels = (1.0 - POOR_INDEX + 1e-6, CAUTION), (1.0 - DOUBTFUL_INDEX + 1e-6, WARNING)
    poor = [element.element for element in at.snapshot.quality if element.index < POOR_INDEX - 1e-6]
    labels = ", ".join(poor or [worst.element]).replace("_", " ")
    text = f"quality of {labels} {worst.index:.1f}, {worst.cause}: {worst.reason}"
    yield Measure("twin", 1.0 - worst.index, levels, text)


def _stopped(at: LiftState) -> Iterator[Measure]:
    """Find winches in emergency stop."""
    for winch in at.snapshot.winches:
        if winch.mode == EMERGENCY_STOP:
            yield present(winch.name, WARNING, f"'{winch.name}' is in emergency stop")


def _cut(at: LiftState) -> Iterator[Measure]:
    """Find a rope that was cut."""
    cut = at.snapshot.cut
    if cut is not None:
        text = f"rope cut at {cut.at_s:.1f} s, {cut.left_m:.1f} m left below the hang-off"
        yield present(cut.rope or "rope", ALARM, text)


def _numerics(at: LiftState) -> Iterator[Measure]:
    """Find steps that did not converge, or that failed a short time ago."""
    row = at.rows.get("simulation: solver")
    failed = row is not None and row.level >= Level.ERROR
    if at.snapshot.not_converged or failed:
        words = row.message if row is not None and failed else "a step did not converge"
        yield present("solver", WARNING, words)


def _forecast(at: LiftState) -> Iterator[Measure]:
    """Find what the forecast node expects within RISK_SPAN_S."""
    risk, levels = at.risk, ((POSSIBLE, CAUTION), (LIKELY, WARNING))
    if not risk:
        return
    limits = {
        "tension": f"tension above {risk['tension_limit_n'] / 1e3:.1f} kN",
        "slack": "a slack rope",
        "contact": f"landing faster than {risk['contact_limit_m_per_s']:g} m/s",
    }
    for name, words in limits.items():
        if math.isfinite(risk[name]):
            text = f"{words} within {RISK_SPAN_S:g} s: probability {risk[name]:.0%}"
            yield Measure(name, risk[name], levels, text)


def _supervision(at: LiftState) -> Iterator[Measure]:
    """Find trouble of the suite beside the lift."""
    for name in SUPERVISED:
        row = at.rows.get(name)
        if row is not None and row.level > Level.OK:
            yield present(name.removeprefix("simulation: "), CAUTION, row.message)


def _by_level(name: str) -> Callable[[LiftState], Iterator[Measure]]:
    """Return what finds a row of the diagnostics: a warning at ERROR, a caution at WARN."""

    def find(at: LiftState) -> Iterator[Measure]:
        row = at.rows.get(f"simulation: {name}")
        if row is not None and row.level > Level.OK:
            yield present(name, WARNING if row.level >= Level.ERROR else CAUTION, row.message)

    return find


KINDS = (
    Kind(
        10001, "top tension", lambda at: at.limits.tension(at.snapshot), hold_s=WAVES_S,
        category="A",
    ),
    Kind(10002, "slack", _slack, category="A", deadband=0.05),
    Kind(10003, "winch at its limit", _winch, hold_s=10.0),
    Kind(10004, "end of stroke", _stroke, hold_s=60.0, category="A"),
    Kind(10005, "measured and computed apart", _apart, delay_s=30.0, hold_s=10.0, category="A"),
    Kind(10006, "touchdown", _touchdown, hold_s=10.0),
    Kind(10007, "input", _inputs, delay_s=1.0),
    Kind(10008, "quality", _quality, delay_s=10.0, hold_s=10.0, deadband=0.0),
    Kind(10009, "numerics", _numerics, hold_s=60.0),
    Kind(
        10010, "payload limit", lambda at: at.limits.payload(at.snapshot), hold_s=WAVES_S,
        category="A",
    ),
    Kind(10011, "limit broken", lambda at: at.limits.broken(at.snapshot), hold_s=0.0, category="A"),
    Kind(10012, "emergency stop", _stopped, hold_s=0.0),
    Kind(10013, "rope cut", _cut, category="A"),
    Kind(10014, "twin late", _by_level("pacing"), delay_s=5.0, hold_s=10.0),
    Kind(10015, "supervision", _supervision, delay_s=5.0, hold_s=10.0),
    # while the twin learns; ends when the fault alarm is acknowledged by its service
    Kind(10016, "fault alarm", _by_level("faults"), hold_s=0.0, category="A"),
    Kind(10017, "forecast", _forecast, delay_s=3.0, hold_s=10.0, deadband=0.3),
    Kind(
        10018, "clearance", lambda at: at.limits.clearance(at.snapshot), hold_s=WAVES_S,
        category="A",
    ),
    Kind(10019, "line on the drum", _drum, hold_s=10.0, deadband=0.2),
    Kind(10020, "residual heave", _residual, hold_s=10.0, deadband=0.1),
)  # fmt: skip


# Kinds that hold after a limit was exceeded, by the names of the limits.
HELD_LIMITS = {
    "tension_n": 10001, "utilisation": 10001, "payload_depth_m": 10010,
    "payload_speed_m_per_s": 10010, "bed_clearance_m": 10018, "line_clearance_m": 10018,
}  # fmt: skip


class _Gate:
    """Delay and hold of one level of one situation."""

    def __init__(self, on: bool = False, since_ns: int | None = None) -> None:
        """Begin as if it would change since `since_ns`."""
        self.on, self._since_ns = on, since_ns

    @property
    def memory(self) -> tuple[bool, int | None]:
        """The arguments that it can be made of again."""
        return self.on, self._since_ns

    def take(self, reached: bool, left: bool, now_ns: int, kind: Kind) -> bool:
        """Return whether the level counts now."""
        changing = left if self.on else reached
        if not changing:
            self._since_ns = None
            return self.on
        if self._since_ns is None:
            self._since_ns = now_ns
        wait_s = kind.hold_s if self.on else kind.delay_s
        if now_ns - self._since_ns >= round(wait_s * SECOND):
            self.on, self._since_ns = not self.on, None
        return self.on


class SituationMonitor:
    """Finds the situations of a run; `look` takes one snapshot after the other."""

    def __init__(self, scene: Scene) -> None:
        self._scene = SceneFigures(scene)
        self._limits = LimitWatch(self._scene)
        self._rows: Mapping[str, Status] = {}
        self._gates: dict[tuple[int, str], dict[float, _Gate]] = {}
        self._texts: dict[tuple[int, str], tuple[Levels, str]] = {}
        self._payload: deque[tuple[int, float]] = deque()  # rising tensions: least first
        self._limited: deque[tuple[int, int]] = deque()  # time at a limit of the winch [ns]
        self._heaving: deque[tuple[float, float]] = deque(maxlen=HEAVE_SAMPLES)  # rates, squared
        self._heaved_ns = 0
        self._heave_left = math.nan
        self._seen_ns: int | None = None
        self._risk: Mapping[str, float] = {}
        self._risk_ns = 0

    def take_risks(self, rows: Sequence[Mapping[str, float]]) -> None:
        """Take the risks of the newest forecast, as forecast/risk has them."""
        self._risk = next((row for row in rows if row["span_s"] == RISK_SPAN_S), {})
        self._risk_ns = self._seen_ns or 0

    @property
    def crew(self) -> CrewLimits:
        """Return the limits that the crew sets."""
        return self._limits.crew

    def memory(self) -> list[Any]:
        """Return the delays and holds as JSON types; windows of a minute begin again."""
        return [
            [*key, [[threshold, *gate.memory] for threshold, gate in gates.items()],
             [[threshold, int(priority)] for threshold, priority in self._texts[key][0]],
             self._texts[key][1]]
            for key, gates in self._gates.items()
        ]  # fmt: skip

    def restore(self, memory: Sequence[Any]) -> None:
        """Continue with the delays and holds of which `memory` was saved."""
        for number, where, gates, levels, text in memory:
            key = number, where
            self._gates[key] = {threshold: _Gate(*saved) for threshold, *saved in gates}
            self._texts[key] = tuple((one, Priority(priority)) for one, priority in levels), text

    def take_rows(self, rows: list[Status]) -> None:
        """Take the newest rows of the diagnostics."""
        self._rows = {row.name: row for row in rows}

    def observe(self, snapshot: Snapshot) -> list[Situation]:
        """Return the situations at the time of a snapshot."""
        least, at_limit = self._min_payload_n(snapshot), self._share_at_limit(snapshot)
        residual_heave = self._residual_heave(snapshot)
        risk = self._risk if snapshot.stamp_ns - self._risk_ns <= RISK_AGE_NS else {}
        moment = LiftState(
            snapshot, self._rows, self._scene, self._limits, least, at_limit, residual_heave, risk
        )
        situations: list[Situation] = []
        for name in self.crew.take_loosened():  # what exceeds the new limit begins at once
            ended = [key for key in self._gates if key[0] == HELD_LIMITS.get(name)]
            for key in ended:
                del self._gates[key]
        for kind in KINDS:
            measures = {measure.where: measure for measure in kind.find(moment)}
            active = {where for number, where in self._gates if number == kind.identifier}
            for where in (*measures, *sorted(active - measures.keys())):
                measure = self._judge(kind, where, measures.get(where), snapshot.stamp_ns)
                situations += [measure] if measure is not None else []
        return situations

    def _judge(
        self, kind: Kind, where: str, measure: Measure | None, now_ns: int
    ) -> Situation | None:
        """Return the situation at one place, or None if there is none."""
        key = kind.identifier, where
        if measure is not None:
            self._texts[key] = measure.levels, measure.text
        levels, text = self._texts[key]
        value = -math.inf if measure is None else measure.value
        gates, highest = self._gates.setdefault(key, {}), None
        for threshold, priority in levels:
            gate = gates.setdefault(threshold, _Gate())
            has_ended = value < threshold * (1.0 - kind.deadband)
            if gate.take(value >= threshold, has_ended, now_ns, kind):
                highest = priority
        for threshold in gates.keys() - {gate_threshold for gate_threshold, _ in levels}:
            del gates[threshold]
        if highest is None:
            return None
        return Situation(kind.identifier, kind.name, kind.category, where, highest, text)

    def _share_at_limit(self, snapshot: Snapshot) -> float:
        """Return the share of LIMIT_WINDOW_NS that the winch was at one of its limits."""
        past_ns = 0 if self._seen_ns is None else snapshot.stamp_ns - self._seen_ns
        self._seen_ns = snapshot.stamp_ns
        stopped = any(
            winch.mode == EMERGENCY_STOP for winch in snapshot.winches
        )  # an alert of its own
        if snapshot.winch_at_limit and past_ns > 0 and not stopped:
            self._limited.append((snapshot.stamp_ns, past_ns))
        while self._limited and self._limited[0][0] <= snapshot.stamp_ns - LIMIT_WINDOW_NS:
            self._limited.popleft()
        return sum(duration_ns for _, duration_ns in self._limited) / LIMIT_WINDOW_NS

    def _residual_heave(self, snapshot: Snapshot) -> float:
        """Return the RMS rate of heave that is left over that of the heave, of a whole minute.

        NaN while the compensation of the first winch is off or was on for less.
        """
        figures = dict(snapshot.winches[0].figures) if snapshot.winches else {}
        if not figures.get("compensation_on") or snapshot.motion_ramp < 1.0:
            self._heaving.clear()
            self._heave_left = math.nan
        elif not self._heaving or snapshot.stamp_ns - self._heaved_ns >= HEAVE_EVERY_NS:
            heave = float(snapshot.hang_off_velocity_m_per_s[2])
            residual = heave - figures["compensation_m_per_s"]
            self._heaving.append((heave * heave, residual * residual))
            self._heaved_ns = snapshot.stamp_ns
            if len(self._heaving) == HEAVE_SAMPLES:
                moved, residual_ms = (
                    math.fsum(squares) / HEAVE_SAMPLES
                    for squares in zip(*self._heaving, strict=True)
                )
                moving = moved > HEAVING_M_PER_S**2
                self._heave_left = math.sqrt(residual_ms / moved) if moving else math.nan
        return self._heave_left

    def _min_payload_n(self, snapshot: Snapshot) -> float:
        """Return the minimum tension at the payload over SLACK_WINDOW_NS [N].

        NaN while the bed or a deck carries it or the rope is cut: then it may well be slack.
        """
        carried = snapshot.seabed is not None and snapshot.seabed.payload_landed
        deck = snapshot.body is not None and bool(snapshot.body.deck_reaction_n)
        if carried or deck or snapshot.cut is not None or snapshot.motion_ramp < 1.0:
            self._payload.clear()
            return math.nan
        rising, tension = self._payload, snapshot.tension_payload_n
        while rising and rising[-1][1] >= tension:
            rising.pop()
        rising.append((snapshot.stamp_ns, tension))
        while rising[0][0] < snapshot.stamp_ns - SLACK_WINDOW_NS:
            rising.popleft()
        return rising[0][1]

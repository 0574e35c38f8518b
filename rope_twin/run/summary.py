"""Run summary: results and performance of a run, as text, JSON and a progress line."""

from __future__ import annotations

import json
import math
import types
import typing
from dataclasses import asdict, dataclass, field, fields
from typing import Any

from rope_twin.effects import EFFECTS
from rope_twin.errors import counted
from rope_twin.messages.diagnostics import (
    bends_in_words,
    breach_words,
    compressed_words,
    cut_words,
    landing_words,
    strength_words,
    touchdown_words,
)
from rope_twin.messages.reports import (
    Level,
    Status,
    alarm_words,
    learned_words,
    lowest_words,
    residual_words,
)
from rope_twin.quantity import kilonewtons, or_none
from rope_twin.scene.error_bound import format_bound
from rope_twin.twin.pacing import PacingHealth
from rope_twin.twin.snapshot import (
    Bend,
    CutSnapshot,
    Landings,
    LimitBreach,
    Residual,
    RopeStrength,
    Snapshot,
    Touchdown,
    most_damaged,
)
from rope_twin.twin.twin import Twin
from rope_twin.vortex.fatigue import BendResult
from rope_twin.vortex.results import MaterialFatigue

RUN_ROW = "simulation: run"


@dataclass(frozen=True)
class CpuUsage:
    """CPU time over real time since the first real-time cycle [% of one core]."""

    steps_pct: float  # solver thread
    publishing_pct: float  # thread that encodes messages and hands them to the middleware
    process_pct: float  # whole process, with all nodes, recorder and viewer that run in it
    asked_pct: float | None = None  # budget set by --budget
    calibrated_pct: float | None = None  # measured for that budget before the run

    def words(self) -> str:
        """Return a line of text."""
        budget = "" if self.asked_pct is None else f" (budget: {self.asked_pct:g} %)"
        return (
            f"CPU usage of one core: {self.steps_pct:.3g} % solver, {self.publishing_pct:.2g} % "
            f"publishing, {self.process_pct:.3g} % whole process{budget}"
        )


@dataclass(frozen=True, kw_only=True)
class RunSummary:
    """Results of a run up to now; field names are the keys of `--json`."""

    scene: str
    effects: tuple[str, ...]
    elements: int
    step_s: float
    steps: int
    time_s: float  # simulation time
    late_steps: int
    worst_lateness_s: float
    real_time_factor: float  # of the solver only: simulation time over computing time
    paced_real_time_factor: float | None  # within the real-time cycle; None: not real-time
    tension_top_now_n: float
    tension_top_max_n: float
    tension_top_mean_n: float
    tension_top_min_n: float
    tension_top_error_pct: float | None  # RMS bound, % of its standard deviation; None: unknown
    tension_top_peak_error_pct: float | None  # bound on the error of the maximum; None: unknown
    tension_top_error_reason: str  # source of the error, or why it is unknown
    line_out_m: float
    payload_depth_m: float
    heave_accepted: int
    heave_refused: int
    heave_late: int  # those of the rejected samples that came after they were needed
    heave_refusal: str  # reason of the last rejection
    commands_accepted: int
    commands_refused: int
    lower_end: str = "payload"  # the item that payload_depth_m refers to
    # multi-line systems (or after a cut): name, elements, length_m, tension_top_n; name, depth_m
    ropes: list[dict[str, Any]] = field(default_factory=list)
    payloads: list[dict[str, Any]] = field(default_factory=list)
    # fields of RopeStrength and the utilisation, per rope
    strength: list[dict[str, Any]] = field(default_factory=list)
    # fields of LimitBreach, per violated limit of the scene; any makes the exit code 4
    limits_broken: list[dict[str, Any]] = field(default_factory=list)
    touchdowns: list[dict[str, Any]] = field(default_factory=list)  # of Touchdown, at the end
    landings: dict[str, Any] | None = None  # of Landings, or None if the payload has not landed
    # fields of Bend, the smallest radius of each monitored rope; radius_m None: straight
    bends: list[dict[str, Any]] = field(default_factory=list)
    # unstretched length [m] of stiff ropes that would be compressed at the end, by rope
    compressed: dict[str, float] = field(default_factory=dict)
    speed: float = 1.0  # 0: as fast as possible
    chosen: str = ""  # why --within or --budget selected these elements and this time step
    core_share: dict[str, float | None] | None = None  # fields of CpuUsage; None: not real-time
    level_changes: int = 0  # changes of the accuracy level
    recoveries: int = 0  # failed steps that the simulation recovered from
    recovery: str = ""  # why the last of them failed, and what was done
    error: str = ""  # why the run ended early
    mixed: str = ""  # inputs that came from several senders in turn
    bag: str | None = None
    not_recorded: int = 0  # messages that were published but are not in the bag
    not_kept: str = ""  # why the bag or the last state is incomplete on disk
    # --processes: restarts, a sentence each; and processes that were not restarted
    restarts: list[str] = field(default_factory=list)
    not_running: str = ""
    view: str | None = None
    state: str | None = None  # file with the saved state
    energy: dict[str, float] | None = None  # EnergyBalance.figures; None: not enabled
    cut: dict[str, Any] | None = None  # fields of CutSnapshot, or None if the rope is intact
    cut_refused: str = ""  # why a requested cut was not made
    error_interval: dict[str, float] | None = None  # fields of TensionInterval; None: see next
    no_error_interval: str = ""  # why there is none, if it is enabled
    # fields of Residual and `residual`, of each measured quantity; None: unknown
    residuals: list[dict[str, Any]] = field(default_factory=list)
    quality: list[dict[str, Any]] = field(default_factory=list)  # fields of Quality, per element
    # fields of FigureEstimate of each figure that was learned; empty: none yet, or not enabled
    learned: list[dict[str, Any]] = field(default_factory=list)
    # causes, begun_s, found_s, ratio, named_after_s of each alarm of the fault tests
    alarms: list[dict[str, Any]] = field(default_factory=list)
    vibration: dict[str, float | str] | None = None  # at its maximum; None: not enabled
    fatigue: dict[str, float | str] | None = None  # at the maximum damage; None: not enabled

    def as_json(self) -> str:
        """Return the summary as one line of JSON."""
        return json.dumps(asdict(self), ensure_ascii=False, allow_nan=False)

    def row(self) -> Status:
        """Return the diagnostics row of the summary: each field as JSON text in its key values."""
        values = {key: json.dumps(value) for key, value in asdict(self).items()}
        return Status(RUN_ROW, Level.OK, "run statistics", values)

    @classmethod
    def from_values(cls, values: dict[str, str]) -> RunSummary | None:
        """Return the summary with the values of such a row; None if they are not one.

        The values come from the network: each must have the type of its field, and the summary
        must be printable.
        """
        hints = typing.get_type_hints(cls)
        try:
            decoded = {name: json.loads(values[name]) for name in hints}
            decoded["effects"] = tuple(decoded["effects"])
            if not all(_is_a(decoded[name], hint) for name, hint in hints.items()):
                return None
            summary = cls(**decoded)
            for render in (summary.as_text, summary.as_progress, summary.as_json):
                render()
        except Exception:  # whatever printing something else raises
            return None
        return summary

    def as_text(self) -> str:
        """Return a few lines of text."""
        elements = sum(rope["elements"] for rope in self.ropes) or self.elements
        rope_label = f" of {self.ropes[0]['name']}" if self.ropes else ""
        lines = [
            f"scene {self.scene}: {self.steps} steps of {self.step_s:g} s, "
            f"{counted(elements, 'element')}; effects: {', '.join(self.effects)}",
            f"top tension{rope_label}: min. {_kn(self.tension_top_min_n)}, "
            f"max. {_kn(self.tension_top_max_n)}, mean {_kn(self.tension_top_mean_n)}",
            *self._strength_words(),
            *(f"limit violated: {breach_words(LimitBreach(**one))}" for one in self.limits_broken),
            *self._shape_words(),
            self._error_words(),
            *self._end_words(),
            *self._pace_words(),
        ]
        if self.heave_refused:
            samples = self.heave_accepted + self.heave_refused
            words = f"{self.heave_refused} of {samples} heave samples rejected; last: "
            lines.append(words + self.heave_refusal.rstrip("."))
        if self.recoveries:
            failed = counted(self.recoveries, "failed step")
            lines.append(f"recovered from {failed}; last: {self.recovery}")
        if self.cut is not None:
            lines.append(cut_words(CutSnapshot(**self.cut)))
        lines += [self.cut_refused] if self.cut_refused else []
        lines += self._monitor_words()
        residuals = (_of_fields(Residual, residual) for residual in self.residuals)
        lines += [residual_words(residual, self.time_s) for residual in residuals]
        lines += [lowest_words(self.quality)] if self.quality else []
        lines += [learned_words(figure) for figure in self.learned]
        lines += [alarm_words(alarm) for alarm in self.alarms]
        lines += watch_words(self.vibration, self.fatigue)
        lines += self.restarts
        missing = ""
        if self.not_recorded:
            missing = f"; {counted(self.not_recorded, 'message')} missing"
            missing += "" if self.not_kept else " (CPU overload)"
        lines += [f"bag {self.bag}{missing}"] if self.bag else []
        lines += [f"view {self.view}"] if self.view else []
        lines += [f"state {self.state}"] if self.state else []
        return "\n".join(lines)

    def _strength_words(self) -> list[str]:
        """Return the highest utilisation of a rope, and all beyond the MBL."""
        ropes = [_of_fields(RopeStrength, rope) for rope in self.strength]
        ropes.sort(key=lambda rope: -rope.utilisation)
        reported = [rope for n, rope in enumerate(ropes) if n == 0 or rope.utilisation >= 1.0]
        return [strength_words(rope, len(ropes) > 1) for rope in reported]

    def _shape_words(self) -> list[str]:
        """Return the landings, the touchdown points at the end, and the smallest bend radii."""
        touchdowns = [Touchdown(**touchdown) for touchdown in self.touchdowns]
        bends = [Bend(**bend | {"radius_m": bend["radius_m"] or math.inf}) for bend in self.bends]
        lines = [touchdown_words(touchdown, len(self.ropes) > 1) for touchdown in touchdowns]
        if self.landings is not None:
            lines.insert(0, landing_words(Landings(**self.landings)))
        lines += bends_in_words(bends) if bends else []
        several = len(self.bends) > 1
        return lines + [
            f"at the end, {compressed_words(length_m, rope if several else '')}"
            for rope, length_m in self.compressed.items()
        ]

    def _pace_words(self) -> list[str]:
        """Return real-time factor, missed deadlines and CPU usage."""
        real_time = f"real-time factor: {_times(self.real_time_factor)} (solver only)"
        if self.paced_real_time_factor is not None:
            real_time += f", {_times(self.paced_real_time_factor)} (in real-time cycle)"
        deadlines = counted(self.late_steps, "missed deadline")
        if self.late_steps:
            deadlines += f" (worst {self.worst_lateness_s * 1e3:.1f} ms late)"
        lines = [real_time, deadlines]
        if self.core_share is not None:
            lines.append(CpuUsage(**self.core_share).words())  # type: ignore[arg-type]
        if self.level_changes:
            lines.append(counted(self.level_changes, "change") + " of the accuracy level")
        return lines

    def _monitor_words(self) -> list[str]:
        """Return energy balance and error interval, where enabled."""
        lines = []
        if self.energy is not None:
            residual_j, residual_pct = self.energy["residual_j"], self.energy["residual_pct"]
            lines.append(
                f"energy: {self.energy['exchanged_j']:.4g} J exchanged, residual "
                f"{residual_j:.3g} J ({residual_pct:.2g} %; positive: numerical dissipation)"
            )
        if self.error_interval is not None:
            lines.append(
                f"error interval (95 %): top tension now {_kn(self.error_interval['low_n'])} to "
                f"{_kn(self.error_interval['high_n'])} (±{self.error_interval['bound_n']:.3g} N); "
                f"{self.error_interval['cost_pct']:.0f} % extra CPU time"
            )
        if self.no_error_interval:
            lines.append(f"error interval: {self.no_error_interval}")
        return lines

    def _end_words(self) -> list[str]:
        """Return the final state: line out and depth, or each rope and payload of several."""
        if not self.ropes:
            depth = f"{self.lower_end} at {self.payload_depth_m:.1f} m depth"
            return [f"line out {self.line_out_m:.1f} m, {depth}"]
        lines = [
            f"rope {rope['name']}: {rope['length_m']:.1f} m, "
            f"{counted(rope['elements'], 'element')}, "
            f"upper-end tension {_kn(float(rope['tension_top_n']))}"
            for rope in self.ropes
        ]
        loads = [f"{one['name']} at {one['depth_m']:.1f} m depth" for one in self.payloads]
        return [*lines, ", ".join(loads)] if loads else lines

    def _error_words(self) -> str:
        reason = self.tension_top_error_reason
        if self.tension_top_error_pct is None:
            return f"top-tension error {reason}"
        bounds_pct = self.tension_top_error_pct, self.tension_top_peak_error_pct
        rms, peak = ("unknown" if pct is None else f"{format_bound(pct)} %" for pct in bounds_pct)
        return f"top-tension error: {rms} RMS, {peak} peak, {reason}"

    def as_progress(self) -> str:
        """Return a progress line; the most important values are within 80 columns."""
        error_pct = self.tension_top_error_pct
        error = "unknown" if error_pct is None else f"≤ {format_bound(error_pct)} %"
        return (
            f"{self.time_s:8.1f} s  line out {self.line_out_m:7.1f} m  "
            f"top tension {_kn(self.tension_top_now_n)}, max. {_kn(self.tension_top_max_n)}  "
            f"{self.late_steps} late  error {error}  "
            f"{_times(self.real_time_factor)} × real time"
        )


def _of_fields(kind: Any, values: dict[str, Any]) -> Any:
    """Return a dataclass with the values of its fields, which may be among others."""
    return kind(**{field.name: values[field.name] for field in fields(kind)})


def _is_a(value: Any, hint: Any) -> bool:
    """Return whether a value has a type, as far as JSON has it: outermost, and items of lists."""
    kinds = typing.get_args(hint)
    origin = typing.get_origin(hint)
    if origin in (types.UnionType, typing.Union):
        return any(_is_a(value, kind) for kind in kinds)
    if hint is Any:
        return True
    if origin in (tuple, list):
        return isinstance(value, origin) and all(_is_a(item, kinds[0]) for item in value)
    if hint in (int, float):
        number = int | float if hint is float else int
        return isinstance(value, number) and not isinstance(value, bool)
    return isinstance(value, origin or hint)


def _times(factor: float) -> str:
    return f"{factor:.0f}" if factor >= 9.95 or factor == 0.0 else f"{factor:.2g}"


def _kn(newtons: float) -> str:
    return kilonewtons(newtons, 1)


def summarise(twin: Twin, snapshot: Snapshot, pacing: PacingHealth | None) -> RunSummary:
    """Return the summary at a snapshot; `pacing` is None for a run that is not real-time."""
    statistics = twin.statistics()
    heave = snapshot.inputs.get("heave")
    command = snapshot.inputs.get("winch_command")
    cut = snapshot.inputs.get("cut")
    now_n, stepped = snapshot.tension_top_n, statistics.steps > 0
    return RunSummary(
        scene=twin.scene.name,
        effects=tuple(
            effect.name
            for params in twin.scene.effects
            for effect in EFFECTS
            if isinstance(params, effect.params)
        ),
        elements=len(snapshot.element_tension_n),
        step_s=twin.step_s,
        steps=snapshot.step,
        time_s=snapshot.time_s,
        late_steps=pacing.late_steps if pacing else 0,
        worst_lateness_s=pacing.worst_lateness_s if pacing else 0.0,
        real_time_factor=statistics.real_time_factor,
        paced_real_time_factor=statistics.real_time_factor if pacing else None,
        tension_top_now_n=now_n,
        tension_top_max_n=statistics.tension_top_max_n if stepped else now_n,
        tension_top_mean_n=statistics.tension_top_mean_n if stepped else now_n,
        tension_top_min_n=statistics.tension_top_min_n if stepped else now_n,
        tension_top_error_pct=or_none(snapshot.study_error.rms_pct),
        tension_top_peak_error_pct=or_none(snapshot.study_error.peak_pct),
        tension_top_error_reason=snapshot.study_error.words,
        line_out_m=snapshot.line_out_m,
        payload_depth_m=-float(snapshot.payload_position_m[2]),
        lower_end="payload" if twin.scene.payloads else "lower end",
        ropes=[
            {
                "name": rope.name,
                "elements": len(rope.element_tension_n),
                "length_m": rope.line_out_m,
                "tension_top_n": rope.tension_top_n,
            }
            for rope in snapshot.ropes
        ],
        payloads=[{"name": p.name, "depth_m": -float(p.position_m[2])} for p in snapshot.payloads],
        strength=[asdict(rope) | {"utilisation": rope.utilisation} for rope in snapshot.strength],
        limits_broken=[asdict(breach) for breach in snapshot.breaches],
        touchdowns=[asdict(touchdown) for touchdown in snapshot.touchdowns],
        landings=None if snapshot.landings is None else asdict(snapshot.landings),
        bends=[  # JSON has no infinity
            asdict(bend) | {"radius_m": None if math.isinf(bend.radius_m) else bend.radius_m}
            for bend in (rope.tightest for rope in snapshot.bends)
        ],
        compressed={
            bend.now.name: bend.compressed_m for bend in snapshot.bends if bend.compressed_m > 0.0
        },
        heave_accepted=heave.accepted if heave else 0,
        heave_refused=heave.refused if heave else 0,
        heave_late=heave.late if heave else 0,
        heave_refusal=heave.refusal if heave else "",
        commands_accepted=command.accepted if command else 0,
        commands_refused=command.refused if command else 0,
        speed=pacing.speed if pacing else 0.0,
        recoveries=snapshot.solver.recoveries,
        recovery=snapshot.solver.recovery,
        error=pacing.error if pacing else "",
        cut=asdict(snapshot.cut) if snapshot.cut else None,
        cut_refused=cut.note if cut and cut.refused else "",
        energy=snapshot.energy.figures() if snapshot.energy else None,
        error_interval=asdict(snapshot.error_interval) if snapshot.error_interval else None,
        no_error_interval=snapshot.no_error_interval,
        residuals=[asdict(one) | {"residual": one.residual} for one in snapshot.residuals],
        quality=[asdict(one) | {"components": list(one.components)} for one in snapshot.quality],
        vibration=vibration_figures(snapshot),
        fatigue=fatigue_figures(snapshot),
    )


Figures = dict[str, float | str]
_OF_ROPE = "cross_flow_diameters_of_"  # and the name of a rope other than the first


def vibration_figures(snapshot: Snapshot) -> Figures | None:
    """Return the VIV response at its maximum; None: not enabled, or not known yet."""
    vibration = snapshot.vibration
    if vibration is None:
        return None
    node = vibration.worst
    figures: Figures = {
        "model": vibration.model,
        "cross_flow_diameters": float(vibration.cross_flow[node]),
        "frequency_hz": float(vibration.cross_flow_hz[node]),
        "from_hang_off_m": float(snapshot.arc_length_m[node]),
        "drag_amplification": float(vibration.drag_amplification.max()),
        "cost_pct": vibration.cost_pct,
        "solves": vibration.solves,
    }
    if vibration.in_line is not None:
        figures["in_line_diameters"] = float(vibration.in_line.max())
    for rope in snapshot.ropes[1:]:
        if rope.vibration is not None:
            figures[f"{_OF_ROPE}{rope.name}"] = float(rope.vibration.cross_flow.max())
    return figures


def fatigue_figures(snapshot: Snapshot) -> Figures | None:
    """Return the maximum fatigue damage and its location; None: not enabled."""
    damaged = most_damaged(snapshot)
    if damaged is None:
        return None
    name, rope_fatigue = damaged
    metre = rope_fatigue.worst
    figures: Figures = {"rope": name} if name else {}
    if rope_fatigue.bent is not None:
        figures |= _bend_count(rope_fatigue, rope_fatigue.bent)
    return figures | {
        "curve": rope_fatigue.curve,
        "counted_s": rope_fatigue.counted_s,
        "used": float(rope_fatigue.used[metre]),
        "from_lower_end_m": float(rope_fatigue.from_lower_end_m[metre]),
        "from_hang_off_m": float(rope_fatigue.from_hang_off_m[metre]),
    }


def _bend_count(rope_fatigue: MaterialFatigue, bending: BendResult) -> Figures:
    """Return the bends of the most bent metre; what is unknown is left out."""
    metre = rope_fatigue.most_bent
    figures: Figures = {
        "bends": float(bending.bends[metre]),
        "bends_from_lower_end_m": float(rope_fatigue.from_lower_end_m[metre]),
    }
    optional = {"bend_damage": bending.damage[metre], "discard_fraction": bending.discard[metre]}
    figures |= {name: float(value) for name, value in optional.items() if not math.isnan(value)}
    return figures | ({"bend_source": bending.source} if bending.source else {})


def watch_words(vibration: Figures | None, fatigue: Figures | None) -> list[str]:
    """Return lines of text on vibration and fatigue, where not None."""
    lines = []
    if vibration is not None:
        lines.append(
            f"VIV ({vibration['model']}): maximum cross-flow A/D "
            f"{vibration['cross_flow_diameters']:.3g} at {vibration['frequency_hz']:.3g} Hz, "
            f"{vibration['from_hang_off_m']:.4g} m below the hang-off; drag amplification up to "
            f"{vibration['drag_amplification']:.3g}; monitoring took "
            f"{vibration['cost_pct']:.2g} % of real time"
        )
        others = {k.removeprefix(_OF_ROPE): v for k, v in vibration.items() if _OF_ROPE in k}
        if others:
            largest = ", ".join(f"{name} {value:.3g}" for name, value in others.items())
            lines.append(f"VIV of the other ropes: maximum cross-flow A/D {largest}")
    if fatigue is not None:
        end = f"the lower end of '{fatigue['rope']}'" if "rope" in fatigue else "the lower end"
        lines.append(
            f"fatigue ({fatigue['curve']}): maximum damage {fatigue['used']:.3g} (failure at 1), "
            f"{fatigue['from_lower_end_m']:.4g} m from {end}, in {fatigue['counted_s']:g} s"
        )
        if "bends" in fatigue:
            lines.append(_bend_words(fatigue, end))
    return lines


def _bend_words(fatigue: Figures, end: str) -> str:
    """Return a line of text on the most bent metre."""
    words = f"most bent metre: {fatigue['bends']:g} bends over sheaves and drum"
    if "discard_fraction" in fatigue:
        words += f", {fatigue['discard_fraction']:.3g} of the discard value"
    if "bend_damage" in fatigue:
        words += f", bending damage {fatigue['bend_damage']:.3g} (failure at 1)"
    words += f", {fatigue['bends_from_lower_end_m']:.4g} m from {end}"
    return words + (f" (data: {fatigue['bend_source']})" if "bend_source" in fatigue else "")

"""Diagnostics of a run: one row (diagnostic_msgs/DiagnosticStatus) per part of the twin."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from functools import partial
from typing import Any

from rope_twin.core.loads.hooks import FACTORS
from rope_twin.errors import counted
from rope_twin.messages.reports import Level, Status, quality_status, residuals_status
from rope_twin.quantity import kilonewtons
from rope_twin.scene.error_bound import KnownError, format_bound
from rope_twin.twin.pacing import PacingHealth
from rope_twin.twin.snapshot import (
    BORDER,
    Bend,
    CompensatorSnapshot,
    CutSnapshot,
    EnergyBalance,
    InputHealth,
    Landings,
    LimitBreach,
    RopeBend,
    RopeStrength,
    Snapshot,
    Touchdown,
    most_damaged,
)
from rope_twin.vortex.results import MaterialFatigue

WARN_UTILISATION = 0.5  # codes for lifting wire allow less than this share of the MBL
MOTION_ROW, SAMPLE_AGE = "simulation: input heave", "age of the last sample [s]"
VIOLATED_FOR_S = 60.0  # after its last violation a limit is an ERROR for this long, then a WARN


def strength_status(ropes: Sequence[RopeStrength]) -> Status:
    """Return the row on the rope with the highest utilisation, with key values of every rope."""
    values = {}
    for rope in ropes:
        values[f"{rope.name}: utilisation [% of MBL]"] = f"{100.0 * rope.utilisation:.1f}"
        if rope.dynamic_amplification is not None:
            values[f"{rope.name}: dynamic amplification"] = f"{rope.dynamic_amplification:.3f}"
    worst = max(ropes, key=lambda rope: rope.utilisation)
    level = Level.OK if worst.utilisation < WARN_UTILISATION else Level.WARN
    if worst.utilisation >= 1.0:
        level = Level.ERROR
    return Status("simulation: strength", level, strength_words(worst, len(ropes) > 1), values)


def strength_words(rope: RopeStrength, named: bool) -> str:
    """Return the utilisation of a rope in words; `named`: say of which rope."""
    of_rope = f" of '{rope.name}'" if named else ""
    tension = f"maximum tension{of_rope} {kilonewtons(rope.max_n, 1)}"
    mbl = f"MBL {kilonewtons(rope.breaking_load_n)}"
    if rope.section_n is not None and rope.section_n < rope.max_n:
        mbl = f"{kilonewtons(rope.section_n, 1)} in its section of {mbl}"
    words = f"{tension}, utilisation {rope.utilisation:.2f} ({mbl})"
    if rope.utilisation >= 1.0:
        words = f"MBL{of_rope} exceeded (utilisation {rope.utilisation:.2f}): rope failure expected"
        words += f"; {tension}, {mbl}"
    if rope.dynamic_amplification is not None:
        words += f"; DAF {rope.dynamic_amplification:.2f}"
    return words


def limits_status(snapshot: Snapshot) -> Status:
    """Return the row on violated limits: ERROR for a while, WARN for the rest of the run."""
    name, violated = "simulation: limits", snapshot.breaches
    if not violated:
        return Status(name, Level.OK, "within all limits of the scene", {})
    values = {}
    for breach in violated:
        label = f"{breach.where}: {breach.limit}"
        values[f"{label}, worst (limit {breach.allowed:g})"] = f"{breach.worst:.6g}"
        times = f"{breach.first_s:.2f}, {breach.worst_s:.2f}, {breach.last_s:.2f}"
        values[f"{label}, first, worst and last violation [s]"] = times
    newest = max(breach.last_s for breach in violated)
    level = Level.ERROR if snapshot.time_s - newest < VIOLATED_FOR_S else Level.WARN
    return Status(name, level, "; ".join(breach_words(breach) for breach in violated), values)


_LIMITS_IN_WORDS = {  # name of the limited quantity, scale, unit and number format
    "tension_n": ("tension of", 1e-3, " kN", ".1f"),
    "utilisation": ("utilisation of", 1.0, "", ".3g"),
    "strain": ("strain of", 100.0, " %", ".3g"),
    "min_tension_n": ("minimum tension of", 1e-3, " kN", ".1f"),
    "bend_radius": ("bend radius of", 1.0, " m", ".4g"),
    "payload_speed_m_per_s": ("speed of", 1.0, " m/s", ".3g"),
    "payload_depth_m": ("depth of", 1.0, " m", ".1f"),
    "landing_speed_m_per_s": ("landing speed of", 1.0, " m/s", ".3g"),
    "bed_clearance_m": ("height above the bed of", 1.0, " m", ".1f"),
    "line_clearance_m": ("distance between", 1.0, " m", ".3g"),
}


class BreachWords:
    """Reports each violated limit once, when it is first violated."""

    def __init__(self) -> None:
        self._said: set[tuple[str, str]] = set()

    def of(self, snapshot: Snapshot) -> list[str]:
        """Return a sentence for each limit that was not yet violated at an earlier call."""
        if len(snapshot.breaches) == len(self._said):
            return []
        fresh = [
            breach for breach in snapshot.breaches if (breach.limit, breach.where) not in self._said
        ]
        self._said |= {(one.limit, one.where) for one in fresh}
        return [f"limit violated: {breach_words(one)}" for one in fresh]


def breach_words(breach: LimitBreach) -> str:
    """Return a violated limit in words."""
    quantity, scale, unit, form = _LIMITS_IN_WORDS[breach.limit]
    worst, allowed = (f"{scale * value:{form}}{unit}" for value in (breach.worst, breach.allowed))
    if worst == allowed:  # just over the limit: the value in digits that show it
        worst = f"{scale * breach.worst:.6g}{unit}"
    side = "below" if breach.worst < breach.allowed else "above"
    times = f"first at {breach.first_s:.2f} s"
    if breach.worst_s > breach.first_s:
        times += f", worst at {breach.worst_s:.2f} s"
    return f"{quantity} '{breach.where}' {worst}, {side} the limit of {allowed} ({times})"


def touchdown_status(ropes: Sequence[Touchdown]) -> Status:
    """Return the row on the touchdown points; its level is always OK."""
    values: dict[str, str] = {}
    for point in ropes:
        x, y, z = point.position_m
        values |= {
            f"{point.name}: x, y, z [m]": f"{x:.2f}, {y:.2f}, {z:.2f}",
            f"{point.name}: line out to TDP [m]": f"{point.line_out_m:.2f}",
            f"{point.name}: layback [m]": f"{point.layback_m:.2f}",
            f"{point.name}: tension at TDP [N]": f"{point.tension_n:.6g}",
            f"{point.name}: angle to the seabed [degrees]": f"{point.angle_deg:.2f}",
        }
    message = "; ".join(touchdown_words(point, len(ropes) > 1) for point in ropes)
    return Status("simulation: touchdown", Level.OK, message, values)


def touchdown_words(point: Touchdown, named: bool) -> str:
    """Return the touchdown point of a rope in words; `named`: say of which rope."""
    of_rope = f" of '{point.name}'" if named else ""
    return (
        f"touchdown point{of_rope} at {point.line_out_m:.1f} m line out, layback "
        f"{point.layback_m:.1f} m, tension {point.tension_n / 1e3:.1f} kN"
    )


def landing_words(landings: Landings) -> str:
    """Return in words when and how fast the payload landed."""
    first = f"at {landings.first_s:.1f} s with {landings.first_m_per_s:.2f} m/s"
    if landings.count == 1:
        return f"landed {first}"
    fastest = f"fastest at {landings.fastest_s:.1f} s with {landings.fastest_m_per_s:.2f} m/s"
    return f"landed {landings.count} times, first {first}, {fastest}"


def bend_status(ropes: Sequence[RopeBend]) -> Status:
    """Return the row on the rope closest to its minimum bend radius, and on all below theirs.

    It warns too of a rope with bending stiffness that would be in compression.
    """
    values: dict[str, str] = {}
    for rope in ropes:
        values |= {
            f"{rope.now.name}: smallest bend radius now [m]": _radius(rope.now.radius_m),
            f"{rope.now.name}: below its upper end [m]": f"{rope.now.line_out_m:.2f}",
            f"{rope.now.name}: smallest since the start [m]": _radius(rope.tightest.radius_m),
        }
        if rope.now.minimum_m:
            values[f"{rope.now.name}: minimum bend radius [m]"] = f"{rope.now.minimum_m:g}"
    in_compression = [rope for rope in ropes if rope.compressed_m > 0.0]
    warns = bool(in_compression) or any(rope.tightest.too_tight for rope in ropes)
    words = bends_in_words([rope.tightest for rope in ropes])
    words += [
        compressed_words(rope.compressed_m, rope.now.name if len(ropes) > 1 else "")
        for rope in in_compression
    ]
    return Status("simulation: bend", Level.WARN if warns else Level.OK, "; ".join(words), values)


def compressed_words(length_m: float, rope: str = "") -> str:
    """Return the text on the length in compression, where a stiff rope would buckle."""
    of_rope = f" of '{rope}'" if rope else ""
    return (
        f"{length_m:.3g} m{of_rope} would be in compression, which no rope carries here: "
        "elements get shorter instead, and neither shape nor bend radius is valid there"
    )


def bends_in_words(bends: Sequence[Bend]) -> list[str]:
    """Return in words the bend closest to its minimum radius, and all below theirs."""
    limited = [bend for bend in bends if bend.minimum_m] or bends
    ordered = sorted(limited, key=lambda bend: -bend.tightness)
    worst = [bend for n, bend in enumerate(ordered) if n == 0 or bend.too_tight]
    return [_bend_words(bend, len(bends) > 1) for bend in worst]


def _bend_words(bend: Bend, named: bool) -> str:
    of_rope = f" of '{bend.name}'" if named else ""
    if math.isinf(bend.radius_m):
        return f"no bending{of_rope}: straight"
    words = (
        f"smallest bend radius{of_rope} {_radius(bend.radius_m)} m, {bend.line_out_m:.1f} m below "
        f"the upper end at {bend.at_s:.1f} s"
    )
    if bend.radius_m < bend.element_m:
        words += f" (not resolved by elements of {bend.element_m:.3g} m)"
    if bend.too_tight:
        return f"{words}: below the MBR of {bend.minimum_m:g} m"
    return f"{words}; MBR {bend.minimum_m:g} m" if bend.minimum_m else words


def _radius(radius_m: float) -> str:
    return f"{radius_m:.3g}" if radius_m < 1000.0 else f"{radius_m:.0f}"


FORCES = ("the water's forces", "the vortices' forces", "the fairings' drag")  # as FACTORS
GAIN_PCT = 0.1  # of the energy exchanged: tolerance of the integration of work
BEHIND_S = 0.5  # a twin further behind than this does not publish the present state
RECOVERY_ERROR_S = 60.0  # simulation time after which a failed step turns from ERROR to WARN
LATE_FOR_S = 60.0  # how long a missed deadline is reported as a warning


def statuses(snapshot: Snapshot, pacing: PacingHealth | None) -> list[Status]:
    """Return one row each for solver, accuracy, winch, build-up, pacing, strength, limits, quality.

    Rows for compensator, seabed, touchdown, bend radius and a cut follow where they apply; rows for
    energy balance, error interval, vibration and fatigue where the run monitors them; then one row
    for each input. `pacing` is None for a run that is not real-time.
    """
    sources: tuple[tuple[Any, Callable[[Any], Status]], ...] = (
        (snapshot, _solver),
        (snapshot.study_error, _accuracy),
        (snapshot, _winch),
        (snapshot.motion_ramp, _start_up),
        (snapshot.fluid_factors, _fluid_ramp),
        (pacing, _pacing),
        (snapshot.strength, strength_status),
        (snapshot, limits_status),
        (snapshot.compensator, _compensator),
        (snapshot.seabed and snapshot, _seabed),
        (snapshot.touchdowns, touchdown_status),
        (snapshot.residuals, partial(residuals_status, now_s=snapshot.time_s)),
        (snapshot.quality, quality_status),
        (snapshot.bends, bend_status),
        (snapshot.cut and snapshot, _cut),
        (snapshot.energy, _energy),
        (snapshot.error_interval and snapshot, _error_interval),
        (snapshot.no_error_interval, partial(Status, "simulation: error interval", Level.WARN)),
        (snapshot.vibration and snapshot, _vibration),
        (most_damaged(snapshot), _fatigue),
    )
    rows = [row(item) for item, row in sources if item is not None and item not in ((), "")]
    rows += [_input(name, health) for name, health in snapshot.inputs.items() if name != BORDER]
    return rows


def _solver(snapshot: Snapshot) -> Status:
    health = snapshot.solver
    values = {
        "steps": str(health.steps),
        "solves per step": f"{health.solves / health.steps:.2f}" if health.steps else "0",
        "max. solves in a stage": str(health.solves_max_per_stage),
        "extra substeps": str(health.substeps),
        "max. substeps in a step": str(health.substeps_max_per_step),
        "rejected substeps": str(health.rejected_substeps),
        "unconverged substeps": str(health.unconverged_substeps),
        "computing time [s]": f"{health.computing_s:.3f}",
    }
    if health.recoveries:
        values["failed steps recovered from"] = str(health.recoveries)
        values["last failed step [s ago]"] = f"{health.recovered_ago_s:.2f}"
    failed = counted(health.recoveries, "failed step")
    level, message = Level.OK, "all steps converged"
    if health.recovered_ago_s < RECOVERY_ERROR_S:
        level, message = Level.ERROR, f"recovered from {failed}; last: {health.recovery}"
    elif snapshot.not_converged:
        level = Level.ERROR
        message = "last step not converged: tension and positions unreliable"
    elif health.unconverged_substeps:
        substeps = counted(health.unconverged_substeps, "substep")
        level = Level.WARN
        message = f"last step converged; {substeps} not converged since the start"
    elif health.recoveries:
        level = Level.WARN
        message = f"last step converged; recovered from {failed}, last: {health.recovery}"
    return Status("simulation: solver", level, message, values)


def _accuracy(error: KnownError) -> Status:
    """Return the error from the convergence study; an unknown error is not a fault of the run."""
    values = {
        "RMS error bound [% of the standard deviation]": format_bound(error.rms_pct),
        "peak error bound [%]": format_bound(error.peak_pct),
        "source": error.words,
    }
    if math.isnan(error.rms_pct):
        return Status("simulation: accuracy", Level.OK, f"top-tension error {error.words}", values)
    words = f"RMS error of the top tension {format_bound(error.rms_pct)} % {error.words}"
    return Status("simulation: accuracy", Level.OK, words, values)


def _winch(snapshot: Snapshot) -> Status:
    values = {
        "line out [m]": f"{snapshot.line_out_m:.2f}",
        "speed [m/s, + pays out]": f"{snapshot.payout_speed_m_per_s:.3f}",
        "tension [kN]": f"{snapshot.tension_top_n / 1000.0:.1f}",
    }
    if snapshot.winch_at_limit:
        return Status("simulation: winch", Level.WARN, snapshot.winch_at_limit, values)
    speed = snapshot.payout_speed_m_per_s
    doing = "stopped" if speed == 0.0 else "paying out" if speed > 0.0 else "hauling in"
    return Status("simulation: winch", Level.OK, f"{doing}; within limits", values)


def _start_up(fraction: float) -> Status:
    name, values = "simulation: start-up", {"share of ship motion": f"{fraction:.3f}"}
    if fraction >= 1.0:
        return Status(name, Level.OK, "full ship motion applied", values)
    message = f"build-up period: {min(fraction, 0.99):.0%} of the ship motion applied"
    return Status(name, Level.WARN, f"{message}, tension not yet representative", values)


def _fluid_ramp(factors: tuple[float, ...]) -> Status:
    """Return the row on the factors that currently scale the forces of the water."""
    values = {
        f"factor on {name}": f"{factor:.3f}" for name, factor in zip(FACTORS, factors, strict=True)
    }
    scaled = [f"{factor:.0%} of {name}" for name, factor in zip(FORCES, factors, strict=True)
              if factor != 1.0]  # fmt: skip
    if scaled:
        message = f"{', '.join(scaled)} applied; tension and motion not representative"
        return Status("simulation: fluid ramp", Level.WARN, message, values)
    return Status("simulation: fluid ramp", Level.OK, "full forces of the water applied", values)


def _energy(balance: EnergyBalance) -> Status:
    values = {
        "counted since [s]": f"{balance.since_s:.2f}",
        "kinetic [J]": f"{balance.kinetic_j:.6g}",
        "elastic [J]": f"{balance.elastic_j:.6g}",
        "potential [J]": f"{balance.potential_j:.6g}",
        "change of the three [J]": f"{balance.change_j:.6g}",
        "work of ship and winch [J]": f"{balance.hang_off_j:.6g}",
        "brought by rope paid out [J]": f"{balance.passing_j:.6g}",
        "work of the water [J]": f"{balance.water_j:.6g}",
        "dissipated by the axial damper [J]": f"{balance.damped_j:.6g}",
        "residual, dissipated numerically [J]": f"{balance.residual_j:.6g}",
        "exchanged [J]": f"{balance.exchanged_j:.6g}",
        "residual [% of exchanged]": f"{balance.residual_pct:.3g}",
    }
    residual = f"{abs(balance.residual_pct):.2g} % of the energy exchanged"
    if balance.residual_pct < -GAIN_PCT:
        words = f"energy balance violated: gain of {residual}; reduce the time step"
        return Status("simulation: energy", Level.WARN, words, values)
    return Status("simulation: energy", Level.OK, f"residual {residual}", values)


def _compensator(unit: CompensatorSnapshot) -> Status:
    values = {
        "stroke [m]": f"{unit.stroke_m:.3f}",
        "stroke limit [m]": f"{unit.stroke_limit_m:.3f}",
        "stroke rate [m/s]": f"{unit.stroke_rate_m_per_s:.3f}",
        "tension [N]": f"{unit.tension_n:.6g}",
        "gas pressure [Pa]": f"{unit.gas_pressure_pa:.6g}",
        "force of the stop [N]": f"{unit.stop_n:.6g}",
    }
    message = f"stroke {unit.stroke_m:.2f} of {unit.stroke_limit_m:.2f} m"
    if not unit.at_stop:
        return Status("simulation: compensator", Level.OK, message, values)
    message = f"{unit.at_stop} to its end stop: it does not compensate"
    return Status("simulation: compensator", Level.WARN, message, values)


def _seabed(snapshot: Snapshot) -> Status:
    bed, landings = snapshot.seabed, snapshot.landings
    assert bed is not None
    values = {
        "payload above the seabed [m]": f"{bed.payload_height_m:.3f}",
        "seabed reaction on the payload [N]": f"{bed.payload_reaction_n:.6g}",
        "rope on the seabed [m]": f"{bed.rope_on_bed_m:.6g}",
        "seabed reaction on the rope [N]": f"{bed.rope_reaction_n:.6g}",
    }
    if landings is not None:
        values["landings"] = str(landings.count)
        values["speed of the first landing [m/s]"] = f"{landings.first_m_per_s:.3f}"
        values["speed of the fastest landing [m/s]"] = f"{landings.fastest_m_per_s:.3f}"
    message = f"payload {bed.payload_height_m:.2f} m above the seabed"
    if bed.payload_landed:
        message = f"payload landed; seabed reaction {bed.payload_reaction_n / 1e3:.1f} kN"
    if bed.rope_on_bed_m > 0.0:
        message += f"; {bed.rope_on_bed_m:.1f} m of rope on the seabed"
    return Status("simulation: seabed", Level.OK, message, values)


def _cut(snapshot: Snapshot) -> Status:
    cut, depth_m = snapshot.cut, -float(snapshot.payload_position_m[2])
    assert cut is not None
    values = {
        "cut at [s]": f"{cut.at_s:.2f}",
        "rope above the cut [m]": f"{cut.left_m:.2f}",
        "rope below the cut [m]": f"{cut.lost_m:.2f}",
        "depth of the lower end [m]": f"{depth_m:.2f}",
    }
    message = f"{cut_words(cut)}; lower end at {depth_m:.1f} m depth"
    return Status("simulation: rope", Level.WARN, message, values)


def cut_words(cut: CutSnapshot) -> str:
    """Return in words when and where the rope was cut."""
    cut_at = f"cut at {cut.at_s:.2f} s, {cut.left_m:.1f} m below"
    if cut.rope:
        return f"rope '{cut.rope}' {cut_at} its upper end; {cut.lost_m:.1f} m below the cut"
    return f"rope {cut_at} the hang-off; {cut.lost_m:.1f} m released"


def _error_interval(snapshot: Snapshot) -> Status:
    interval, tension_n = snapshot.error_interval, snapshot.tension_top_n
    assert interval is not None
    values = {
        "low [N]": f"{interval.low_n:.6g}",
        "high [N]": f"{interval.high_n:.6g}",
        "error bound [N]": f"{interval.bound_n:.3g}",
        "extra CPU time [%]": f"{interval.cost_pct:.0f}",
    }
    if tension_n > 0.0:
        values["error bound [% of the tension]"] = f"{100.0 * interval.bound_n / tension_n:.3g}"
    for rope in snapshot.ropes[1:]:
        if rope.error_interval is not None:
            values[f"error bound of '{rope.name}' [N]"] = f"{rope.error_interval.bound_n:.3g}"
    message = f"top tension within {interval.bound_n:.3g} N of the converged solution"
    message += " (95 % interval)"
    return Status("simulation: error interval", Level.OK, message, values)


def _vibration(snapshot: Snapshot) -> Status:
    viv = snapshot.vibration
    assert viv is not None
    node = viv.worst
    values = {
        "model": viv.model,
        "maximum cross-flow A/D": f"{viv.cross_flow[node]:.3g}",
        "its frequency [Hz]": f"{viv.cross_flow_hz[node]:.3g}",
        "below the hang-off [m]": f"{snapshot.arc_length_m[node]:.1f}",
        "maximum drag amplification": f"{viv.drag_amplification.max():.3g}",
        "monitoring time [% of real time]": f"{viv.cost_pct:.2g}",
    }
    if viv.every_s > 0.0:
        values["modes recomputed every [s]"] = f"{viv.every_s:g}"
        values["mode solutions"] = str(viv.solves)
    message = (
        f"maximum cross-flow A/D {viv.cross_flow[node]:.2f} at "
        f"{viv.cross_flow_hz[node]:.2f} Hz, {snapshot.arc_length_m[node]:.0f} m "
        "below the hang-off"
    )
    notes = [viv.note]
    for rope in snapshot.ropes[1:]:
        if (response := rope.vibration) is not None:
            worst = response.worst
            peak, hz = response.cross_flow[worst], response.cross_flow_hz[worst]
            values[f"maximum cross-flow A/D of '{rope.name}'"] = f"{peak:.3g} at {hz:.3g} Hz"
            notes.append(f"'{rope.name}': {response.note}" if response.note else "")
    name, level = "simulation: vibration", Level.WARN if any(notes) else Level.OK
    return Status(name, level, "; ".join(filter(None, (message, *notes))), values)


def _most_bent(fatigue: MaterialFatigue) -> tuple[str, bool, dict[str, str]]:
    """Return message on the most bent metre, whether it has reached its limit, and key values."""
    if (bent := fatigue.bent) is None:
        return "", False, {}
    metre = fatigue.most_bent
    columns = bent.bends, bent.damage, bent.discard
    bends, damage, discard = (float(column[metre]) for column in columns)
    from_end = f"{fatigue.from_lower_end_m[metre]:.1f}"
    values = {"most bent metre, from the lower end [m]": from_end, "its bends": f"{bends:g}"}
    if not math.isnan(damage):
        values["its bending damage (failure at 1)"] = f"{damage:.3e}"
    if not math.isnan(discard):
        values["its bends over the discard value"] = f"{discard:.3g}"
    if bent.source:
        values["source of its bending data"] = bent.source
    message = f"; most bent metre: {bends:g} bends, {from_end} m from the lower end"
    return message, damage >= 1.0 or discard >= 1.0, values


def _fatigue(damaged: tuple[str, MaterialFatigue]) -> Status:
    """Return the row of the rope with the largest damage; its name is "" in a scene of one."""
    name, fatigue = damaged
    metre = fatigue.worst
    upper = f"the upper end of '{name}'" if name else "the hang-off"
    damage, below_m = float(fatigue.used[metre]), float(fatigue.from_hang_off_m[metre])
    values = {
        "curve": fatigue.curve,
        "with bending": "yes" if fatigue.bending else "no",
        "counted [s]": f"{fatigue.counted_s:.1f}",
        "maximum damage (failure at 1)": f"{damage:.3e}",
        "distance from the lower end [m]": f"{fatigue.from_lower_end_m[metre]:.1f}",
        f"distance below {upper} [m], negative: aboard": f"{below_m:.1f}",
    }
    location = f"{below_m:.0f} m below {upper}" if below_m >= 0.0 else "aboard"
    message = (
        f"maximum accumulated damage {damage:.2e} (failure at 1), "
        f"{fatigue.from_lower_end_m[metre]:.0f} m from the lower end, currently {location}"
    )
    bend_text, is_worn, bend_values = _most_bent(fatigue)
    level = Level.WARN if damage >= 1.0 or is_worn else Level.OK
    return Status("simulation: fatigue", level, message + bend_text, values | bend_values)


def _pacing(pacing: PacingHealth) -> Status:
    values = {
        "late steps": str(pacing.late_steps),
        "worst lateness [ms]": f"{pacing.worst_lateness_s * 1000.0:.2f}",
        "behind now [ms]": f"{pacing.behind_s * 1000.0:.2f}",
        "real-time factor": f"{pacing.real_time_factor:.1f}",
        "lost snapshots": str(pacing.lost_snapshots),
        "thread priority": "real-time" if pacing.priority else "ordinary",
    }
    lateness = (
        f"{counted(pacing.late_steps, 'missed deadline')} since the start, worst "
        f"{pacing.worst_lateness_s * 1000.0:.1f} ms late"
    )
    if pacing.error:
        level, message = Level.ERROR, f"stopped: {pacing.error}"
    elif pacing.behind_s > BEHIND_S:
        level, message = Level.ERROR, f"{pacing.behind_s:.2f} s behind real time; {lateness}"
    elif pacing.late_ago_s is not None and pacing.late_ago_s < LATE_FOR_S:
        level, message = Level.WARN, lateness
    elif not pacing.running:
        level, message = Level.OK, "paused"
    elif pacing.late_steps:
        level, message = Level.OK, f"all deadlines met in the last {LATE_FOR_S:.0f} s; {lateness}"
    else:
        level, message = Level.OK, "all deadlines met"
    return Status("simulation: pacing", level, message, values)


def _rejected(health: InputHealth) -> str:
    return f"{counted(health.recently_refused, 'sample')} rejected in the last 60 s; last"


def _input_values(health: InputHealth, age: str) -> dict[str, str]:
    values = {
        "accepted": str(health.accepted),
        SAMPLE_AGE: age,
        "refused": str(health.refused),
        "refused in the last 60 s": str(health.recently_refused),
        "late": str(health.late),
        "repeated": str(health.repeated),
        "not finite": str(health.non_finite),
        "impossible": str(health.impossible),
        "stuck": str(health.stuck),
        "unconfirmed after a gap": str(health.unconfirmed),
        "last note": health.note,
    }
    if health.executed_late:
        values["executed late"] = str(health.executed_late)
    if health.clock_offset_s is not None:
        values["arrival less stamp [s]"] = f"{health.clock_offset_s:.3f}"
    if health.interval_s is not None:
        values["interval between samples [s]"] = f"{health.interval_s:.4f}"
    return values


def _input(name: str, health: InputHealth) -> Status:
    words = name.replace("_", " ")
    age = "never" if math.isinf(health.age_s) else f"{health.age_s:.3f}"
    values = _input_values(health, age)
    title = f"simulation: input {words}"
    faults = [health.fault] if health.fault else []
    if health.stale:
        gap = f"no {words} for {age} s; continuing with the last input"
        faults.append(f"stale: {health.note or gap}")
        if health.refusal and health.refusal != health.note and health.recently_refused:
            faults.append(f"{_rejected(health)}: {health.refusal.removesuffix('.')}")
    if faults:
        faults += [health.warning.removesuffix(".")] if health.warning else []
        return Status(title, Level.ERROR, "; ".join(faults), values)
    warnings = [health.warning.removesuffix(".")] if health.warning else []
    if name == "current" and health.note and health.note != health.refusal:
        warnings.append(health.note.removesuffix("."))  # accepted, but implausibly fast
    if health.recently_refused:
        last_reason = health.refusal or health.note or "no reason given"
        if health.refusal and health.note != health.refusal:  # how a gap is handled now
            last_reason = f"{health.refusal.removesuffix('.')}; now: {health.note}"
        warnings.append(f"{_rejected(health)}: {last_reason}")
    if warnings:
        return Status(title, Level.WARN, "; ".join(warnings), values)
    if not health.accepted:
        return Status(title, Level.OK, "no sample received yet", values)
    message = f"up to date; {counted(health.accepted, 'sample')} accepted"
    if health.refused:
        message += f"; {health.refused} rejected since the start, none in the last 60 s"
    return Status(title, Level.OK, message, values)

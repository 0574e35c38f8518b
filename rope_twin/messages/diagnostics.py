"""Diagnostics of a run: one row (diagnostic_msgs/DiagnosticStatus) per part of the twin."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from functools import partial
from typing import Any

from rope_twin.core.loads.hooks import FACTORS
from rope_twin.messages.status import Level, Status, counted, quality_status, residuals_status
from rope_twin.scene.error_bound import KnownError, format_bound
from rope_twin.twin.pacing import PacingHealth
from rope_twin.twin.snapshot import (
    BORDER,
    Bend,
    CompensatorShot,
    CutShot,
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
VIOLATED_FOR_S = 60.0  # after its last violation a limit is an ERROR for so long, then a WARN


def strength_status(ropes: Sequence[RopeStrength]) -> Status:
    """Return the row on the rope with the highest utilisation, with key values of every rope."""
    values = {}
    for one in ropes:
        values[f"{one.name}: utilisation [% of MBL]"] = f"{100.0 * one.utilisation:.1f}"
        if one.dynamic_amplification is not None:
            values[f"{one.name}: dynamic amplification"] = f"{one.dynamic_amplification:.3f}"
    worst = max(ropes, key=lambda one: one.utilisation)
    level = Level.OK if worst.utilisation < WARN_UTILISATION else Level.WARN
    if worst.utilisation >= 1.0:
        level = Level.ERROR
    return Status("simulation: strength", level, strength_words(worst, len(ropes) > 1), values)


def strength_words(one: RopeStrength, named: bool) -> str:
    """Return the utilisation of a rope in words; `named`: say of which rope."""
    which = f" of '{one.name}'" if named else ""
    tension = f"maximum tension{which} {one.highest_n / 1e3:.1f} kN"
    words = f"{tension}, utilisation {one.utilisation:.2f} (MBL {one.breaking_load_n / 1e3:.0f} kN)"
    if one.utilisation >= 1.0:
        words = (
            f"MBL{which} exceeded (utilisation {one.utilisation:.2f}): rope failure expected; "
            f"{tension}, MBL {one.breaking_load_n / 1e3:.0f} kN"
        )
    if one.dynamic_amplification is not None:
        words += f"; DAF {one.dynamic_amplification:.2f}"
    return words


def limits_status(snapshot: Snapshot) -> Status:
    """Return the row on violated limits: ERROR for a while, WARN for the rest of the run."""
    name, violated = "simulation: limits", snapshot.breaches
    if not violated:
        return Status(name, Level.OK, "within all limits of the scene", {})
    values = {}
    for one in violated:
        what = f"{one.where}: {one.limit}"
        values[f"{what}, worst (limit {one.allowed:g})"] = f"{one.worst:.6g}"
        values[f"{what}, first, worst and last violation [s]"] = (
            f"{one.first_s:.2f}, {one.worst_s:.2f}, {one.last_s:.2f}"
        )
    newest = max(one.last_s for one in violated)
    level = Level.ERROR if snapshot.time_s - newest < VIOLATED_FOR_S else Level.WARN
    return Status(name, level, "; ".join(breach_words(one) for one in violated), values)


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
        fresh = [one for one in snapshot.breaches if (one.limit, one.where) not in self._said]
        self._said |= {(one.limit, one.where) for one in fresh}
        return [f"limit violated: {breach_words(one)}" for one in fresh]


def breach_words(one: LimitBreach) -> str:
    """Return a violated limit in words."""
    what, scale, unit, form = _LIMITS_IN_WORDS[one.limit]
    worst, allowed = (f"{scale * value:{form}}{unit}" for value in (one.worst, one.allowed))
    if worst == allowed:  # just over the limit: the value in digits that show it
        worst = f"{scale * one.worst:.6g}{unit}"
    side = "below" if one.worst < one.allowed else "above"
    when = f"first at {one.first_s:.2f} s"
    if one.worst_s > one.first_s:
        when += f", worst at {one.worst_s:.2f} s"
    return f"{what} '{one.where}' {worst}, {side} the limit of {allowed} ({when})"


def touchdown_status(ropes: Sequence[Touchdown]) -> Status:
    """Return the row on the touchdown points; its level is always OK."""
    values: dict[str, str] = {}
    for one in ropes:
        x, y, z = one.position_m
        values |= {
            f"{one.name}: x, y, z [m]": f"{x:.2f}, {y:.2f}, {z:.2f}",
            f"{one.name}: line out to TDP [m]": f"{one.line_out_m:.2f}",
            f"{one.name}: layback [m]": f"{one.layback_m:.2f}",
            f"{one.name}: tension at TDP [N]": f"{one.tension_n:.6g}",
            f"{one.name}: angle to the seabed [degrees]": f"{one.angle_deg:.2f}",
        }
    message = "; ".join(touchdown_words(one, len(ropes) > 1) for one in ropes)
    return Status("simulation: touchdown", Level.OK, message, values)


def touchdown_words(one: Touchdown, named: bool) -> str:
    """Return the touchdown point of a rope in words; `named`: say of which rope."""
    which = f" of '{one.name}'" if named else ""
    return (
        f"touchdown point{which} at {one.line_out_m:.1f} m line out, layback "
        f"{one.layback_m:.1f} m, tension {one.tension_n / 1e3:.1f} kN"
    )


def landing_words(one: Landings) -> str:
    """Return in words when and how fast the payload landed."""
    first = f"at {one.first_s:.1f} s with {one.first_m_per_s:.2f} m/s"
    if one.count == 1:
        return f"landed {first}"
    fastest = f"fastest at {one.fastest_s:.1f} s with {one.fastest_m_per_s:.2f} m/s"
    return f"landed {one.count} times, first {first}, {fastest}"


def bend_status(ropes: Sequence[RopeBend]) -> Status:
    """Return the row on the rope closest to its minimum bend radius, and on all below theirs.

    It warns too of a rope whose bending stiffness would meet compression now.
    """
    values: dict[str, str] = {}
    for one in ropes:
        values |= {
            f"{one.now.name}: smallest bend radius now [m]": _radius(one.now.radius_m),
            f"{one.now.name}: below its upper end [m]": f"{one.now.line_out_m:.2f}",
            f"{one.now.name}: smallest since the start [m]": _radius(one.tightest.radius_m),
        }
        if one.now.minimum_m:
            values[f"{one.now.name}: minimum bend radius [m]"] = f"{one.now.minimum_m:g}"
    pressed = [one for one in ropes if one.compressed_m > 0.0]
    doubt = bool(pressed) or any(one.tightest.too_tight for one in ropes)
    words = bends_in_words([one.tightest for one in ropes])
    words += [
        compressed_words(one.compressed_m, one.now.name if len(ropes) > 1 else "")
        for one in pressed
    ]
    return Status("simulation: bend", Level.WARN if doubt else Level.OK, "; ".join(words), values)


def compressed_words(length_m: float, rope: str = "") -> str:
    """Return in words the length that gets shorter where a stiff rope would bend aside."""
    which = f" of '{rope}'" if rope else ""
    return (
        f"{length_m:.3g} m{which} would be in compression, which no rope carries here: "
        "elements get shorter instead, and neither shape nor bend radius is valid there"
    )


def bends_in_words(bends: Sequence[Bend]) -> list[str]:
    """Return in words the bend closest to its minimum radius, and all below theirs."""
    limited = [one for one in bends if one.minimum_m] or bends
    ordered = sorted(limited, key=lambda one: -one.tightness)
    reported = [one for n, one in enumerate(ordered) if n == 0 or one.too_tight]
    return [_bend_words(one, len(bends) > 1) for one in reported]


def _bend_words(one: Bend, named: bool) -> str:
    which = f" of '{one.name}'" if named else ""
    if math.isinf(one.radius_m):
        return f"no bending{which}: straight"
    words = (
        f"smallest bend radius{which} {_radius(one.radius_m)} m, {one.line_out_m:.1f} m below the "
        f"upper end at {one.at_s:.1f} s"
    )
    if one.radius_m < one.element_m:
        words += f" (not resolved by elements of {one.element_m:.3g} m)"
    if one.too_tight:
        return f"{words}: below the MBR of {one.minimum_m:g} m"
    return f"{words}; MBR {one.minimum_m:g} m" if one.minimum_m else words


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
    parts: tuple[tuple[Any, Callable[[Any], Status]], ...] = (
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
        (snapshot.residuals, residuals_status),
        (snapshot.quality, quality_status),
        (snapshot.bends, bend_status),
        (snapshot.cut and snapshot, _cut),
        (snapshot.energy, _energy),
        (snapshot.error_interval and snapshot, _error_interval),
        (snapshot.no_error_interval, partial(Status, "simulation: error interval", Level.WARN)),
        (snapshot.vibration and snapshot, _vibration),
        (most_damaged(snapshot), _fatigue),
    )
    rows = [row(part) for part, row in parts if part is not None and part not in ((), "")]
    rows += [_input(name, one) for name, one in snapshot.inputs.items() if name != BORDER]
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
    elif snapshot.doubtful:
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


def _start_up(share: float) -> Status:
    level, message = Level.OK, "full ship motion applied"
    if share < 1.0:
        level = Level.WARN
        message = f"build-up period: {share:.0%} of the ship motion applied, tension not yet "
        message += "representative"
    values = {"share of ship motion": f"{share:.3f}"}
    return Status("simulation: start-up", level, message, values)


def _fluid_ramp(factors: tuple[float, ...]) -> Status:
    """Say by which factors the forces of the water are scaled now."""
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
    share = f"{abs(balance.residual_pct):.2g} % of the energy exchanged"
    if balance.residual_pct < -GAIN_PCT:
        words = f"energy balance violated: gain of {share}; reduce the time step"
        return Status("simulation: energy", Level.WARN, words, values)
    return Status("simulation: energy", Level.OK, f"residual {share}", values)


def _compensator(unit: CompensatorShot) -> Status:
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
        "seabed reaction on the payload [N]": f"{bed.payload_push_n:.6g}",
        "rope on the seabed [m]": f"{bed.rope_on_bed_m:.6g}",
        "seabed reaction on the rope [N]": f"{bed.rope_push_n:.6g}",
    }
    if landings is not None:
        values["landings"] = str(landings.count)
        values["speed of the first landing [m/s]"] = f"{landings.first_m_per_s:.3f}"
        values["speed of the fastest landing [m/s]"] = f"{landings.fastest_m_per_s:.3f}"
    message = f"payload {bed.payload_height_m:.2f} m above the seabed"
    if bed.payload_landed:
        message = f"payload landed; seabed reaction {bed.payload_push_n / 1e3:.1f} kN"
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


def cut_words(cut: CutShot) -> str:
    """Return in words when and where the rope was cut."""
    at = f"cut at {cut.at_s:.2f} s, {cut.left_m:.1f} m below"
    if cut.rope:
        return f"rope '{cut.rope}' {at} its upper end; {cut.lost_m:.1f} m below the cut"
    return f"rope {at} the hang-off; {cut.lost_m:.1f} m released"


def _error_interval(snapshot: Snapshot) -> Status:
    found, tension_n = snapshot.error_interval, snapshot.tension_top_n
    assert found is not None
    values = {
        "low [N]": f"{found.low_n:.6g}",
        "high [N]": f"{found.high_n:.6g}",
        "error bound [N]": f"{found.bound_n:.3g}",
        "extra CPU time [%]": f"{found.cost_pct:.0f}",
    }
    if tension_n > 0.0:
        values["error bound [% of the tension]"] = f"{100.0 * found.bound_n / tension_n:.3g}"
    for one in snapshot.ropes[1:]:
        if one.error_interval is not None:
            values[f"error bound of '{one.name}' [N]"] = f"{one.error_interval.bound_n:.3g}"
    message = f"top tension within {found.bound_n:.3g} N of the converged solution (95 % interval)"
    return Status("simulation: error interval", Level.OK, message, values)


def _vibration(snapshot: Snapshot) -> Status:
    shaking = snapshot.vibration
    assert shaking is not None
    at = shaking.worst
    values = {
        "model": shaking.model,
        "maximum cross-flow A/D": f"{shaking.cross_flow[at]:.3g}",
        "its frequency [Hz]": f"{shaking.cross_flow_hz[at]:.3g}",
        "below the hang-off [m]": f"{snapshot.arc_length_m[at]:.1f}",
        "maximum drag amplification": f"{shaking.drag_amplification.max():.3g}",
        "monitoring time [% of real time]": f"{shaking.cost_pct:.2g}",
    }
    if shaking.every_s > 0.0:
        values["modes recomputed every [s]"] = f"{shaking.every_s:g}"
        values["mode solutions"] = str(shaking.solves)
    message = (
        f"maximum cross-flow A/D {shaking.cross_flow[at]:.2f} at "
        f"{shaking.cross_flow_hz[at]:.2f} Hz, {snapshot.arc_length_m[at]:.0f} m below the hang-off"
    )
    notes = [shaking.note]
    for rope in snapshot.ropes[1:]:
        own = rope.vibration
        if own is not None:
            most, hz = own.cross_flow[own.worst], own.cross_flow_hz[own.worst]
            values[f"maximum cross-flow A/D of '{rope.name}'"] = f"{most:.3g} at {hz:.3g} Hz"
            notes.append(f"'{rope.name}': {own.note}" if own.note else "")
    name, level = "simulation: vibration", Level.WARN if any(notes) else Level.OK
    return Status(name, level, "; ".join(filter(None, (message, *notes))), values)


def _most_bent(wear: MaterialFatigue) -> tuple[str, bool, dict[str, str]]:
    """Return what the most bent metre has had: message, whether it is worn, values."""
    if wear.bent is None:
        return "", False, {}
    at = wear.most_bent
    bends, damage, discard = (
        float(part[at]) for part in (wear.bent.bends, wear.bent.damage, wear.bent.discard)
    )
    place = f"{wear.from_lower_end_m[at]:.1f}"
    values = {"most bent metre, from the lower end [m]": place, "its bends": f"{bends:g}"}
    if not math.isnan(damage):
        values["its bending damage (failure at 1)"] = f"{damage:.3e}"
    if not math.isnan(discard):
        values["its bends over the discard value"] = f"{discard:.3g}"
    if wear.bent.source:
        values["source of its bending data"] = wear.bent.source
    message = f"; most bent metre: {bends:g} bends, {place} m from the lower end"
    return message, damage >= 1.0 or discard >= 1.0, values


def _fatigue(damaged: tuple[str, MaterialFatigue]) -> Status:
    """Return the row of the rope with the largest damage; its name is "" in a scene of one."""
    name, wear = damaged
    at = wear.worst
    upper = f"the upper end of '{name}'" if name else "the hang-off"
    damage, place = float(wear.used[at]), float(wear.from_hang_off_m[at])
    values = {
        "curve": wear.curve,
        "with bending": "yes" if wear.bending else "no",
        "counted [s]": f"{wear.counted_s:.1f}",
        "maximum damage (failure at 1)": f"{damage:.3e}",
        "distance from the lower end [m]": f"{wear.from_lower_end_m[at]:.1f}",
        f"distance below {upper} [m], negative: aboard": f"{place:.1f}",
    }
    where = f"{place:.0f} m below {upper}" if place >= 0.0 else "aboard"
    message = (
        f"maximum accumulated damage {damage:.2e} (failure at 1), "
        f"{wear.from_lower_end_m[at]:.0f} m from the lower end, currently {where}"
    )
    bent, worn, more = _most_bent(wear)
    level = Level.WARN if damage >= 1.0 or worn else Level.OK
    return Status("simulation: fatigue", level, message + bent, values | more)


def _pacing(pacing: PacingHealth) -> Status:
    values = {
        "late steps": str(pacing.late_steps),
        "worst lateness [ms]": f"{pacing.worst_lateness_s * 1000.0:.2f}",
        "behind now [ms]": f"{pacing.behind_s * 1000.0:.2f}",
        "real-time factor": f"{pacing.real_time_factor:.1f}",
        "lost snapshots": str(pacing.lost_snapshots),
        "thread priority": "real-time" if pacing.priority else "ordinary",
    }
    late = (
        f"{counted(pacing.late_steps, 'missed deadline')} since the start, worst "
        f"{pacing.worst_lateness_s * 1000.0:.1f} ms late"
    )
    if pacing.error:
        level, message = Level.ERROR, f"stopped: {pacing.error}"
    elif pacing.behind_s > BEHIND_S:
        level, message = Level.ERROR, f"{pacing.behind_s:.2f} s behind real time; {late}"
    elif pacing.late_ago_s is not None and pacing.late_ago_s < LATE_FOR_S:
        level, message = Level.WARN, late
    elif not pacing.running:
        level, message = Level.OK, "paused"
    elif pacing.late_steps:
        level, message = Level.OK, f"all deadlines met in the last {LATE_FOR_S:.0f} s; {late}"
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
        last = health.refusal or health.note or "no reason given"
        if health.refusal and health.note != health.refusal:  # how a gap is handled now
            last = f"{health.refusal.removesuffix('.')}; now: {health.note}"
        warnings.append(f"{_rejected(health)}: {last}")
    if warnings:
        return Status(title, Level.WARN, "; ".join(warnings), values)
    if not health.accepted:
        return Status(title, Level.OK, "no sample received yet", values)
    message = f"up to date; {counted(health.accepted, 'sample')} accepted"
    if health.refused:
        message += f"; {health.refused} rejected since the start, none in the last 60 s"
    return Status(title, Level.OK, message, values)

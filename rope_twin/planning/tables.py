"""Tables of a plan beside that of its limits: further characteristic values, sling loads."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from operator import itemgetter
from typing import TYPE_CHECKING, Any, NamedTuple

from rope_twin.planning.judgement import Extreme, quantity_of
from rope_twin.planning.plan_reader import spreading_of
from rope_twin.planning.seas import SeaState
from rope_twin.planning.simplified import (
    lift_of,
    lift_off_n,
    lift_off_speed,
    relative_offset_m,
    relative_speed,
)
from rope_twin.planning.slings import sling_shares

if TYPE_CHECKING:
    from rope_twin.planning.cells import CellLimit, PhaseWork
    from rope_twin.planning.run import PlanResult

IN_LIMITS = ("hook_load", "uplift")  # that the table of limits has
CELL = ("phase", "Tp s", "heading °", "Hs m")
SLING = ("phase", "sling", "share %", "with skew, tilt, CoG %", "load at hook kN", "sling load kN",
         "allowed kN", "utilisation %")  # fmt: skip


SNAP = (*CELL, "uplift %", "slack %", "snap force kN", "static + snap kN", "of hook limit %",
        "hook load kN")  # fmt: skip
LIFT_OFF = (*CELL, "winch m/s", "tip to deck m/s", "lateral m", "least by API m/s", "DAF",
            "simplified DAF", "re-hit m/s", "re-hit in % of seeds")  # fmt: skip


USES = (*CELL, "criterion", "value", "limit", "utilisation %")


class Table(NamedTuple):
    """A table of the report."""

    title: str
    rows: list[list[str]]  # the first is its head
    about: str  # in words, below it


def lowest(cells: Sequence[CellLimit]) -> CellLimit:
    """Return the cell with the lowest limit; one without a limit only if there is no other."""
    return min(cells, key=lambda cell: (bool(cell.capped), cell.height_m or 0.0, cell.crossing_m))


def further_tables(result: PlanResult) -> Iterator[Table]:
    """Yield the tables that the plan has."""
    yield _uses(result)
    yield _values(result)
    snaps = _snaps(result)
    if len(snaps.rows) > 1:
        yield snaps
    lifted = [work for work in result.works if work.legs[0].deck_m is not None]
    if lifted:
        yield _lift_offs(result, lifted)
    if result.plan.slings is not None:
        yield _slings(result)


def _uses(result: PlanResult) -> Table:
    """Return the utilisation of every criterion at the lowest limit of each phase."""
    rows = [list(USES)]
    for work in result.works:
        cell = lowest(result.of_phase(work.title))
        judged = cell.shown
        if judged is None:
            continue
        for limit in work.limits:
            value, quantity = judged.values.get(limit.quantity), quantity_of(limit.quantity)
            if value is None or limit.key not in judged.uses:
                continue
            share = quantity.unit == ""
            scale, unit = (100.0, "%") if share else (quantity.scale, quantity.unit)
            half, limit_value = 0.5 * scale * (value.high - value.low), scale * limit.most
            rows.append([
                *cell.row_head, f"{judged.height_m:g}", limit.words,
                f"{scale * value.value:.3g} ± {half:.2g} {unit}", f"{limit_value:.4g} {unit}",
                f"{100.0 * judged.uses[limit.key].value:.0f}",
            ])  # fmt: skip
    about = (
        "Utilisation of each criterion at the lowest limit of each phase: characteristic value, ± "
        "half of its interval, over what is allowed. SWL: of the crane. MBL over its safety "
        "factor: of the wire, loaded by the hook load. Slack: uplift over the submerged weight."
    )
    return Table("Utilisation", rows, about)


def _values(result: PlanResult) -> Table:
    """Return the characteristic values that the table of limits does not have."""
    judged = [(cell, cell.shown) for cell in result.cells]
    known = [
        (cell, judgement)
        for cell, judgement in judged
        if judgement is not None and judgement.values
    ]
    names = [
        name
        for name in dict.fromkeys(name for _, judgement in known for name in judgement.values)
        if name not in IN_LIMITS
        and any(
            name in judgement.values and judgement.values[name].value != 0.0
            for _, judgement in known
        )
    ]
    head = [
        *CELL,
        *(f"{quantity_of(name).words} {quantity_of(name).unit}".strip() for name in names),
    ]
    rows = [head]
    for cell, judgement in known:
        values = [
            f"{judgement.values[name].scaled(quantity_of(name).scale).value:.3g}"
            if name in judgement.values
            else ""
            for name in names
        ]
        rows.append([*cell.row_head, f"{judgement.height_m:g}", *values])
    about = (
        f"P{result.plan.method.percentile:g} of the largest value in the exposure, at the limiting "
        "Hs, or at the lowest of the grid where no height meets the criteria."
    )
    return Table("Further characteristic values", rows, about)


def snap_of(work: PhaseWork, cell: CellLimit) -> tuple[float, float]:
    """Return the snap force of the leg with the largest sum of it and its static hook load, and
    that sum [N]; NaN in air.
    """
    pairs = [
        (load.snap_n, leg.static_hook_n + load.snap_n)
        for leg, load in zip(work.legs, cell.simplified, strict=True)
    ]
    return max(pairs, key=itemgetter(1))


def _snaps(result: PlanResult) -> Table:
    """Return the snap loads of a slack rope by the formula, beside the loads of the runs."""
    rows = [list(SNAP)]
    for work in result.works:
        hook = min(
            (limit.most for limit in work.limits if limit.quantity == "hook_load"), default=math.inf
        )
        for cell in result.of_phase(work.title):
            judgement = cell.shown
            if judgement is None or not cell.simplified or "uplift" not in judgement.values:
                continue
            snap, total_n = snap_of(work, cell)
            if math.isnan(snap):
                continue
            rows.append([
                *cell.row_head, f"{judgement.height_m:g}",
                f"{100.0 * judgement.values['uplift'].value:.0f}",
                f"{100.0 * judgement.slack_share:.2g}",
                f"{1e-3 * snap:.0f}", f"{1e-3 * total_n:.0f}",
                f"{100.0 * total_n / hook:.0f}" if hook < math.inf else "–",
                f"{1e-3 * judgement.values['hook_load'].value:.0f}",
            ])  # fmt: skip
    about = (
        "Snap force v_snap·√(K·(M + A33)) of DNV-RP-N103 (4.7.2 in H103) and with the static hook "
        "load, over the least limit of the hook load, should the rope go slack; of several legs "
        "that with the largest sum. The last column is that of the runs, which have the snap where "
        "uplift or slack lead to one."
    )
    return Table("Snap check", rows, about)


def _share_hit(re_hit: Extreme, confidence: float) -> str:
    """Return the share of seeds with a re-hit [%]; none: and its upper confidence limit.

    All n seeds are without one with probability (1 - q)^n (Clopper and Pearson 1934).
    """
    if re_hit.zeros < 1.0:
        return f"{100.0 * (1.0 - re_hit.zeros):.0f}"
    return f"0 (at most {100.0 * (1.0 - (1.0 - confidence) ** (1.0 / re_hit.seeds)):.0f})"


def _lift_offs(result: PlanResult, works: list[PhaseWork]) -> Table:
    """Return speeds, offset and loads of each lift-off, by the runs and by the formula."""
    rows = [list(LIFT_OFF)]
    for work in works:
        leg, static = work.legs[0], work.static_hook_n
        for cell in result.of_phase(work.title):
            judgement = cell.shown
            if judgement is None or "re_hit" not in judgement.values:
                continue
            spreading = spreading_of(result.plan, result.scene)
            gamma = result.plan.sea.gamma
            sea = SeaState(judgement.height_m, cell.period_s, cell.heading_deg, gamma, spreading)
            inputs = leg, work.ship.tip, sea, result.plan.method.percentile
            re_hit = judgement.values["re_hit"]
            closing, lateral = relative_speed(*inputs), relative_offset_m(*inputs)
            by_rule = lift_off_n(leg, lift_of(leg), closing - leg.speed_m_per_s) / static
            rows.append([
                *cell.row_head, f"{judgement.height_m:g}", f"{-leg.speed_m_per_s:g}",
                f"{closing:.2f}", f"{lateral:.2f}", f"{lift_off_speed(judgement.height_m):.2f}",
                f"{judgement.values['hook_load'].value / static:.2f}", f"{by_rule:.2f}",
                f"{re_hit.value:.2f}", _share_hit(re_hit, result.plan.method.confidence),
            ])  # fmt: skip
    about = (
        "DAF of the simplified formula: 1 + V_R·√(K/(g·W)) with V_R the speed of the winch and the "
        "characteristic speed between crane tip and deck (API Spec 2C, 7th ed., 5.4.5). Lateral: "
        "characteristic horizontal motion of the crane tip against the point of the deck below the "
        "object, in its largest direction; in the runs the deck stays in place. On a rigid rope "
        "a winch faster than the deck leaves it behind; an object that swings on its rope, or "
        "leaves the deck edge by edge, may still meet it. API's least hoisting speed is that of "
        "5.4.5.2 for a supply vessel. Re-hit: closing speed of object and deck after the first "
        "lift-off, and the share of seeds that have one; where none has, the share that so many "
        "seeds without one do not exclude."
    )
    return Table("Lift-off", rows, about)


def sling_loads(result: PlanResult) -> Iterator[dict[str, Any]]:
    """Yield load and utilisation of each sling in each phase, at its largest judged load."""
    slings = result.plan.slings
    assert slings is not None
    for work in result.works:
        judged = [cell.shown for cell in result.of_phase(work.title)]
        values = [judgement.values for judgement in judged if judgement is not None]
        loads = [value["lower_end_load"].value for value in values if "lower_end_load" in value]
        if not loads:
            continue
        load = max(loads)
        shares = sling_shares(slings, work.weight_n)
        for k in range(slings.count):
            load_n = float(shares.largest[k]) * load
            yield {
                "phase": work.title,
                "sling": k + 1,
                "share": float(shares.nominal[k]),
                "largest_share": float(shares.largest[k]),
                "lower_end_n": load,
                "load_n": load_n,
                "allowed_n": slings.strength_n,
                "utilisation": load_n / slings.strength_n,
            }


def _slings(result: PlanResult) -> Table:
    slings = result.plan.slings
    assert slings is not None
    rows = [list(SLING)]
    for load in sling_loads(result):
        rows.append([
            load["phase"], str(load["sling"]), f"{100.0 * load['share']:.1f}",
            f"{100.0 * load['largest_share']:.1f}", f"{1e-3 * load['lower_end_n']:.0f}",
            f"{1e-3 * load['load_n']:.1f}", f"{1e-3 * load['allowed_n']:.1f}",
            f"{100.0 * load['utilisation']:.0f}",
        ])  # fmt: skip
    factors, shares = slings.factors, sling_shares(slings, result.works[0].weight_n)
    if slings.skew_load_factor is not None:
        skew = f"skew load factor {slings.skew_load_factor:g} (5.6.12)"
    elif slings.length_tolerance_m is not None:
        skew = f"all errors of length of ±{slings.length_tolerance_m:g} m (5.6.13)"
    else:
        skew = "statically determinate, SKL 1"
    remarks = [f"Elastic slings below the hook (GL Noble Denton 0027/ND): {skew}"]
    remarks.append(
        f"object at rest tilted by {shares.tilt_deg:.1f}°, within its tolerances by up to "
        f"{shares.max_tilt_deg:.1f}°"
    )
    if slings.mbl_n is not None:
        remarks.append(
            f"MBL {1e-3 * slings.mbl_n:g} kN over γ_sf {factors.nominal:.2f} "
            f"(γ_f {factors.load:g}, "
            f"γ_c {factors.consequence:g}, γ_r {factors.reduction:g}, γ_w {factors.wear:g}, "
            f"γ_m {factors.material:g}, γ_tw {factors.twist:g})"
        )
    if slings.wll_n is not None:
        remarks.append(f"WLL {1e-3 * slings.wll_n:g} kN")
    return Table("Slings", rows, "; ".join(remarks) + ".")

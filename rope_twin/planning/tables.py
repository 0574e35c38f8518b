"""Tables of a plan beside that of its limits: further characteristic values, sling loads."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING, Any, NamedTuple

from rope_twin.planning.judgement import QUANTITIES
from rope_twin.planning.slings import sling_shares

if TYPE_CHECKING:
    from rope_twin.planning.cells import CellLimit, PhaseWork
    from rope_twin.planning.run import PlanResult

IN_LIMITS = ("hook_load", "uplift")  # that the table of limits has
CELL = ("phase", "Tp s", "heading °", "Hs m")
SLING = ("phase", "sling", "share %", "with skew, tilt, CoG %", "load at hook kN", "sling load kN",
         "allowed kN", "utilisation %")  # fmt: skip


class Table(NamedTuple):
    """A table of the report."""

    title: str
    rows: list[list[str]]  # the first is its head
    about: str  # in words, below it


def further_tables(result: PlanResult) -> Iterator[Table]:
    """Yield the tables that the plan has."""
    yield _values(result)
    if result.plan.slings is not None:
        yield _slings(result)


def _values(result: PlanResult) -> Table:
    """Return the characteristic values that the table of limits does not have."""
    judged = [(cell, cell.judged or cell.beyond) for cell in result.cells]
    known = [(cell, one) for cell, one in judged if one is not None and one.values]
    names = [
        name
        for name in QUANTITIES
        if name not in IN_LIMITS
        and any(name in one.values and one.values[name].value != 0.0 for _, one in known)
    ]
    head = [*CELL, *(f"{QUANTITIES[name].words} {QUANTITIES[name].unit}".strip() for name in names)]
    rows = [head]
    for cell, one in known:
        values = [
            f"{one.values[name].scaled(QUANTITIES[name].scale).value:.3g}"
            if name in one.values
            else ""
            for name in names
        ]
        rows.append([*_cell_words(cell), f"{one.height_m:g}", *values])
    about = (
        f"P{result.plan.method.percentile:g} of the largest value in the exposure, at the limiting "
        "Hs, or at the lowest of the grid where no height meets the criteria."
    )
    return Table("Further characteristic values", rows, about)


def _cell_words(cell: CellLimit) -> list[str]:
    return [cell.phase, f"{cell.period_s:g}", f"{cell.heading_deg:g}"]


def sling_loads(result: PlanResult) -> Iterator[dict[str, Any]]:
    """Yield load and utilisation of each sling in each phase, at its largest judged load."""
    slings = result.plan.slings
    assert slings is not None
    for work in result.works:
        load = _lower_end_n(result, work)
        if load is None:
            continue
        shares = sling_shares(slings, work.weight_n)
        for k in range(slings.count):
            own = float(shares.largest[k]) * load
            yield {
                "phase": work.title,
                "sling": k + 1,
                "share": float(shares.nominal[k]),
                "largest_share": float(shares.largest[k]),
                "lower_end_n": load,
                "load_n": own,
                "allowed_n": slings.strength_n,
                "utilisation": own / slings.strength_n,
            }


def _lower_end_n(result: PlanResult, work: PhaseWork) -> float | None:
    """Return the largest characteristic load at the lower end in a phase's limiting seas [N]."""
    judged = [cell.judged or cell.beyond for cell in result.of_phase(work.title)]
    values = [one.values for one in judged if one is not None]
    return max(
        (one["lower_end_load"].value for one in values if "lower_end_load" in one), default=None
    )


def _slings(result: PlanResult) -> Table:
    slings = result.plan.slings
    assert slings is not None
    rows = [list(SLING)]
    for one in sling_loads(result):
        rows.append([
            one["phase"], str(one["sling"]), f"{100.0 * one['share']:.1f}",
            f"{100.0 * one['largest_share']:.1f}", f"{1e-3 * one['lower_end_n']:.0f}",
            f"{1e-3 * one['load_n']:.1f}", f"{1e-3 * one['allowed_n']:.1f}",
            f"{100.0 * one['utilisation']:.0f}",
        ])  # fmt: skip
    own, shares = slings.factors, sling_shares(slings, result.works[0].weight_n)
    if slings.skew_load_factor is not None:
        skew = f"skew load factor {slings.skew_load_factor:g} (5.6.12)"
    elif slings.length_tolerance_m is not None:
        skew = f"all errors of length of ±{slings.length_tolerance_m:g} m (5.6.13)"
    else:
        skew = "statically determinate, SKL 1"
    words = [f"Elastic slings below the hook (GL Noble Denton 0027/ND): {skew}"]
    words.append(
        f"object at rest tilted by {shares.tilt_deg:.1f}°, within its tolerances by up to "
        f"{shares.most_tilt_deg:.1f}°"
    )
    if slings.mbl_n is not None:
        words.append(
            f"MBL {1e-3 * slings.mbl_n:g} kN over γ_sf {own.nominal:.2f} (γ_f {own.load:g}, γ_c "
            f"{own.consequence:g}, γ_r {own.reduction:g}, γ_w {own.wear:g}, γ_m {own.material:g}, "
            f"γ_tw {own.twist:g})"
        )
    if slings.wll_n is not None:
        words.append(f"WLL {1e-3 * slings.wll_n:g} kN")
    return Table("Slings", rows, "; ".join(words) + ".")

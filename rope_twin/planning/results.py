"""Results of a plan: tables, remarks on them, one object for programs, and the load chart.

Remarks say what limits the validity of the results, in numbers.
"""

from __future__ import annotations

import json
import math
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rope_twin import __version__
from rope_twin.effects.current import CurrentParams
from rope_twin.effects.waves import WavesParams
from rope_twin.errors import counted
from rope_twin.files import write_whole
from rope_twin.planning.judgement import CriteriaAssessment
from rope_twin.planning.seas import ResponsesTip, SeaState
from rope_twin.planning.tables import sling_loads
from rope_twin.quantity import json_value
from rope_twin.scene.convergence import solver_version
from rope_twin.scene.load_chart import FORMAT
from rope_twin.sea.spectrum import DEEP, STANDARD_GRAVITY, irregular_waves, spread, usual_height_m

if TYPE_CHECKING:
    from rope_twin.planning.cells import CellLimit
    from rope_twin.planning.phases import Leg
    from rope_twin.planning.plan_file import Plan
    from rope_twin.planning.run import PlanResult
    from rope_twin.planning.simplified import Simplified

HEAD = ("phase", "Tp s", "heading °", "Hs m", "interval m", "governed by", "use %",
        "hook load kN", "DAF",
        "least load kN", "uplift %", "slack %", "seeds", "error %", "simplified Hs m",
        "simplified hook kN")  # fmt: skip
NONE = "–"
NOT_COVERED = (
    "Motion of the crane's boom and slewing, off-lead and side-lead; the tip moves with the hull.",
    "Second-order motions, manoeuvring and positioning of the vessel; forward speed.",
    "Vortex-induced vibration of the wire, its fatigue and wear.",
    "Trapped air and flooding.",
    SWINGING := "The swinging of the object in air.",
    "Shielding of waves by the vessel, and its radiated and reflected waves.",
    "Weather forecasts: limits are operational limits, before any alpha factor.",
)
COMPONENTS, LOST_SHARE = 200, 0.01  # of a spectrum; of the motion's variance, beyond the RAOs
DEEP_WATER_LENGTHS = 0.5  # of the wave: below, its kinematics are 4 % of those at the surface


def height_words(cell: CellLimit) -> str:
    """Return the limiting height in words."""
    return _bounded(cell.height_m, cell.capped)


def _bounded(height_m: float | None, capped: str) -> str:
    if height_m is None:
        return "none"
    return f"{'≥ ' if capped else ''}{height_m:g}"


def limit_words(result: PlanResult, cell: CellLimit) -> str:
    """Return the governing criterion in words."""
    labels = {limit.key: limit.words for limit in result.work_of(cell).limits}
    label = labels.get(cell.governing, cell.governing)
    return f"{cell.capped} ({label})" if cell.capped else label


def daf(result: PlanResult, cell: CellLimit) -> float:
    """Return the dynamic amplification: characteristic over static hook load; NaN: unknown."""
    judged = cell.shown
    if judged is None or "hook_load" not in judged.values:
        return math.nan
    return judged.values["hook_load"].value / result.work_of(cell).static_hook_n


def table_rows(result: PlanResult) -> list[list[str]]:
    """Return the limits as rows of text below a head."""
    return [list(HEAD), *(_cells_of(result, cell) for cell in result.cells)]


def _cells_of(result: PlanResult, cell: CellLimit) -> list[str]:
    judged = cell.shown
    begin = [*cell.row_head, height_words(cell), _interval(cell), limit_words(result, cell)]
    simple = hook = NONE
    if cell.simplified:
        simple = _bounded(cell.simplified_height_m, cell.simplified_capped)
        hook = f"{1e-3 * _simple(cell.simplified)[0]:.0f}"
    if judged is None or "hook_load" not in judged.values:
        return [*begin, *[NONE] * 8, simple, hook]
    weight = result.work_of(cell).weight_n
    load, uplift = judged.values["hook_load"], judged.values["uplift"]
    spread = 0.5e-3 * (load.high - load.low)
    return [
        *begin,
        f"{100.0 * judged.use:.0f}",
        f"{1e-3 * load.value:.0f} ± {spread:.1f}",
        f"{daf(result, cell):.2f}",
        f"{1e-3 * weight * (1.0 - uplift.value):.0f}",
        f"{100.0 * uplift.value:.0f}",
        f"{100.0 * judged.slack_share:.2g}",
        str(judged.seeds),
        NONE if math.isnan(cell.error) else f"{100.0 * cell.error:.2g}",
        simple,
        hook,
    ]


def _interval(cell: CellLimit) -> str:
    """Return the interval of the height at which the use is 1; none where all of it is capped."""
    if cell.capped and cell.low_m == cell.high_m:
        return NONE
    return f"{cell.low_m:.2f} to {cell.high_m:.2f}"


def summary_lines(result: PlanResult) -> Iterator[str]:
    """Yield lines on method, settings and runs, which complete the table."""
    method = result.plan.method
    yield (
        f"characteristic values: P{method.percentile:g} of the largest in the exposure, Gumbel by "
        f"maximum likelihood, intervals of {100.0 * method.confidence:g} %"
    )
    for work in result.works:
        for leg in work.legs:
            setting = f"{leg.setting}, {setting_words(result, leg)}"
            exposure = f"exposure {leg.window_s:.0f} s"
            yield f"{work.title}, {depth_words(leg)} m: {setting}; {exposure}"
    titles = [work.title for work in result.works if work.legs[0].by_twin]
    if titles:
        yield f"{', '.join(titles)}: runs are stepped one at a time, not in lanes"
    finer = sum(cell.refinements > 0 for cell in result.cells)
    if finer:
        yield (
            f"in {finer} of {len(result.cells)} cells mesh or step were made finer, to bring the "
            f"error of the governing run to {100.0 * method.error_within:g} %"
        )
    study = result.study
    known = (
        ""
        if math.isnan(study.peak_pct)
        else (f"maximum of the top tension within {study.peak_pct:.2g} %, ")
    )
    yield f"study of scene '{result.scene.name}': {known}{study.words}"
    total = f"{result.runs:,} runs of {round(result.simulated_s / 3600.0, 2):,g} h in all"
    if result.made:
        factor = result.made_s / result.elapsed_s
        progress = "done" if result.made >= result.runs else f"{result.made} runs made"
        total += f", {progress} in {result.elapsed_s:.0f} s ({factor:,.0f} times real time)"
    yield total


def depth_words(leg: Leg) -> str:
    """Return the depths of a leg's payload at its start and its end [m], or one for both."""
    ends = (f"{leg.from_m:.0f}", f"{leg.to_m:.0f}")
    return " to ".join(ends[:1] if leg.to_m == leg.from_m else ends)


def setting_words(result: PlanResult, leg: Leg) -> str:
    """Return where mesh and step of a leg are from: given, or the error that they have."""
    if not math.isnan(leg.setting_error):
        return f"error {100.0 * leg.setting_error:.2g} %"
    given = result.plan.method.elements is not None or leg.by_twin
    return "given" if given else "error not measured"


def plan_notes(plan: Plan) -> Iterator[str]:
    """Yield remarks on the plan itself, known before its runs."""
    if len(plan.sea.tp_s) == 1:
        yield (
            f"The limits hold at Tp {plan.sea.tp_s[0]:g} s alone: `rope_twin operability` and the "
            "console interpolate between periods; give them two or more in sea.tp_s."
        )


def notes(result: PlanResult) -> Iterator[str]:
    """Yield remarks on the results, the most important first."""
    yield from plan_notes(result.plan)
    yield from _static(result)
    yield from _failures(result)
    yield from _intervals(result)
    yield from _errors(result)
    yield from _shallow(result)
    yield from _seas(result)
    yield from _beyond_table(result)
    winch = result.scene.winch
    if winch is not None and winch.heave_compensation is not None:
        yield "The simplified method has no heave compensation: it shows what the runs gain by it."
    if any(work.legs[0].deck is not None for work in result.works):
        yield (
            "The deck of the lift-off moves up and down as its vessel does below the object, by "
            "heave, roll and pitch; it stays level and in its place. The table of the lift-off has "
            "what the crane tip does against it sideways."
        )
    if result.scene.listed(CurrentParams) is None:
        yield "The scene has no current: the payload hangs plumb."


def _static(result: PlanResult) -> Iterator[str]:
    for work in result.works:
        if work.static_use > 1.0:
            limit_n = work.static_hook_n / work.static_use
            yield (
                f"{work.title}: the static hook load of {1e-3 * work.static_hook_n:.3g} kN alone "
                f"is above its limit of {1e-3 * limit_n:.3g} kN, so that no sea meets it; check "
                "swl_n [N] and safety_factor."
            )


def _failures(result: PlanResult) -> Iterator[str]:
    for cell in result.cells:
        judged = [item for item in (cell.judged, cell.beyond) if item is not None]
        failed = [item.failure for item in judged if item.failures]
        faults = [item.fault for item in judged if item.fault]
        where = f"{cell.phase}, {cell.sea}"
        if failed:
            runs = counted(sum(item.failures for item in judged), "run")
            yield (
                f"{where}: {runs} did not reach the end, so that the sea counts as too high: "
                f"{failed[0]}"
            )
        if faults:
            yield f"{where}: {faults[0]}"


def _intervals(result: PlanResult) -> Iterator[str]:
    method = result.plan.method
    wide_cells = [
        (max(use.half_width for use in cell.judged.uses.values()), cell)
        for cell in result.cells
        if cell.judged is not None and cell.judged.uses and not cell.judged.narrow(method.within)
    ]
    if wide_cells:
        half_width, cell = max(wide_cells, key=lambda pair: pair[0])
        yield (
            f"In {counted(len(wide_cells), 'cell')} {method.seeds.most} seeds leave an interval "
            f"wider than ±{100.0 * method.within:g} % (up to ±{100.0 * half_width:.0f} %, "
            f"{cell.phase}, Tp {cell.period_s:g} s); raise method.seeds.most."
        )


def _errors(result: PlanResult) -> Iterator[str]:
    max_error = result.plan.method.error_within
    known = [cell for cell in result.cells if not math.isnan(cell.error)]
    large = [cell for cell in known if cell.error > max_error]
    unknown = sum(cell.judged is not None for cell in result.cells) - len(known)
    if large:
        largest = max(large, key=lambda cell: cell.error)
        yield (
            f"In {counted(len(large), 'cell')} the discretisation error of the governing run is "
            f"above {100.0 * max_error:g} % (up to {100.0 * largest.error:.2g} %, "
            f"{largest.phase}, Tp {largest.period_s:g} s): after slack, runs of two "
            "meshes drift apart."
        )
    if unknown:
        yield f"In {counted(unknown, 'cell')} the discretisation error could not be measured."


def _shallow(result: PlanResult) -> Iterator[str]:
    if result.scene.listed(WavesParams) is not None:
        return
    longest = STANDARD_GRAVITY * max(result.plan.sea.tp_s) ** 2 / (2.0 * math.pi)
    for work in result.works:
        depth = min(leg.from_m for leg in work.legs)
        if 0.0 < depth < DEEP_WATER_LENGTHS * longest:  # above the water there are none
            yield (
                f"{work.title}: the payload is at {depth:.0f} m, less than half of the longest "
                f"waves' {longest:.0f} m, and the scene has no waves: their force on payload and "
                "rope is missing."
            )


def _beyond_table(result: PlanResult) -> Iterator[str]:
    """Yield a remark on motion that the RAOs do not reach."""
    tip, sea = result.works[0].ship.tip, result.plan.sea
    if not isinstance(tip, ResponsesTip):
        return
    share_lost: dict[float, float] = {}
    for period in sea.tp_s:
        spectrum = SeaState(sea.hs_m.from_, period, 0.0, sea.gamma).spectrum()
        waves = irregular_waves(spectrum, COMPONENTS, 1, DEEP, STANDARD_GRAVITY)
        for heading in sea.headings_deg:
            spread_waves = spread(waves, math.radians(heading), None, 1)
            share_lost[period] = max(
                share_lost.get(period, 0.0),
                tip.responses.share_left_out(spread_waves, 0.0, tip.arm_m),
            )
    cut_periods = [period for period, share in share_lost.items() if share > LOST_SHARE]
    if cut_periods:
        yield (
            f"At Tp {', '.join(f'{tp:g}' for tp in cut_periods)} s up to "
            f"{100.0 * max(share_lost.values()):.2g} % of the variance of the tip's motion lies "
            "above the highest frequency of the RAOs and is left out."
        )


def _seas(result: PlanResult) -> Iterator[str]:
    steep = [
        cell for cell in result.cells
        if cell.height_m is not None and cell.height_m > 1.005 * usual_height_m(cell.period_s)
    ]  # fmt: skip
    if steep:
        periods = sorted({cell.period_s for cell in steep})
        period_list = ", ".join(f"{period:g}" for period in periods)
        yield (
            f"At Tp {period_list} s limits lie above the steepest usual seas of DNV-RP-C205: such "
            "seas are rare, and their limits seldom decide."
        )


def result_object(result: PlanResult) -> dict[str, Any]:
    """Return everything as one object of plain values; unknown numbers are None."""
    content = {
        "plan": result.plan.name,
        "plan_digest": result.plan.digest,
        "scene": result.scene.name,
        "scene_digest": result.scene.digest,
        "solver": solver_version(result.scene),
        "version": __version__,
        "percentile": result.plan.method.percentile,
        "confidence": result.plan.method.confidence,
        "runs": result.runs,
        "simulated_s": result.simulated_s,
        "elapsed_s": result.elapsed_s,
        "study_error_peak_pct": result.study.peak_pct,
        "study_error_words": result.study.words,
        "phases": [
            {
                "name": work.title,
                "limits": {limit.key: limit.most for limit in work.limits},
                "static_hook_n": work.static_hook_n,
                "payload_submerged_n": work.weight_n,
                "legs": [
                    {
                        "from_m": leg.from_m, "to_m": leg.to_m, "exposure_s": leg.window_s,
                        "elements": leg.setting.elements, "step_s": leg.setting.step_s,
                        "error": leg.setting_error,
                    }
                    for leg in work.legs
                ],
            }
            for work in result.works
        ],
        "slings": list(sling_loads(result)) if result.plan.slings is not None else [],
        "cells": [_cell_object(result, cell) for cell in result.cells],
    }  # fmt: skip
    return dict(json_value(content))


def _cell_object(result: PlanResult, cell: CellLimit) -> dict[str, Any]:
    return {
        "phase": cell.phase,
        "tp_s": cell.period_s,
        "heading_deg": cell.heading_deg,
        "limiting_hs_m": cell.height_m,
        "crossing_hs_m": cell.crossing_m,
        "crossing_low_m": cell.low_m,
        "crossing_high_m": cell.high_m,
        "capped": cell.capped,
        "governing": cell.governing,
        "daf": daf(result, cell),
        "at_limit": _judgement_object(cell.judged),
        "beyond": _judgement_object(cell.beyond),
        "discretisation_error": cell.error,
        "elements": cell.setting.elements,
        "step_s": cell.setting.step_s,
        "refinements": cell.refinements,
        "simplified_hs_m": cell.simplified_height_m,
        "simplified_capped": cell.simplified_capped,
        "simplified": [vars(load) for load in cell.simplified],
        "difference": difference(cell),
        "judged_heights": cell.heights,
        "runs": cell.runs,
    }


def difference(cell: CellLimit) -> dict[str, float]:
    """Return the excess of the runs' characteristic values over the simplified method's.

    Hook load over the simplified one less 1, and uplift less the simplified uplift; empty if no
    height meets the criteria.
    """
    if cell.judged is None or not cell.simplified:
        return {}
    hook, uplift = _simple(cell.simplified)
    values = cell.judged.values
    return {
        "hook_load": values["hook_load"].value / hook - 1.0,
        "uplift": values["uplift"].value - uplift,
    }


def _simple(loads: Sequence[Simplified]) -> tuple[float, float]:
    return max(load.hook_n for load in loads), max(load.uplift_share for load in loads)


def _judgement_object(judged: CriteriaAssessment | None) -> dict[str, Any] | None:
    if judged is None:
        return None
    return {
        "hs_m": judged.height_m,
        "seeds": judged.seeds,
        "governing_seed": judged.governing_seed,
        "values": {name: vars(value) for name, value in judged.values.items()},
        "uses": {name: vars(use) for name, use in judged.uses.items()},
        "slack_share": judged.slack_share,
        "failures": judged.failures,
        "failure": judged.failure,
        "fault": judged.fault,
    }


def load_chart(result: PlanResult) -> dict[str, Any]:
    """Return the limits as a load chart, which `rope_twin.scene.load_chart` reads.

    `limiting_hs_m` has a row for each peak period and a column for each heading; None: no height
    of the grid is allowed. `limits` has the same as a list, with 0 for None.
    """
    sea = result.plan.sea
    charts = {}
    for work in result.works:
        cells = result.by_sea(work.title)
        rows = [[cells[tp, heading] for heading in sea.headings_deg] for tp in sea.tp_s]
        charts[work.title] = {
            "kind": result.plan.phases[work.number].kind,
            "depth_m": [work.legs[0].from_m, work.legs[-1].to_m],
            "limits": {limit.key: limit.most for limit in work.limits},
            "limiting_hs_m": [[cell.height_m for cell in row] for row in rows],
            "governing": [[cell.governing for cell in row] for row in rows],
            "hook_load_n": [
                [cell.judged and cell.judged.values["hook_load"].value for cell in row]
                for row in rows
            ],
        }
    return {
        "format": FORMAT,
        "plan": result.plan.name,
        "plan_digest": result.plan.digest,
        "scene": result.scene.name,
        "scene_digest": result.scene.digest,
        "version": __version__,
        "percentile": result.plan.method.percentile,
        "tp_s": list(sea.tp_s),
        "heading_deg": list(sea.headings_deg),
        "symmetric": sea.symmetric,
        "phases": charts,
        "limits": [
            {
                "phase": cell.phase,
                "tp_s": cell.period_s,
                "heading_deg": cell.heading_deg,
                "limit_hs_m": cell.height_m or 0.0,
            }
            for cell in result.cells
        ],
    }


def write_results(result: PlanResult, folder: Path) -> None:
    """Write `plan.json` and `load_chart.json`. Raises OSError: they cannot be written."""
    for name, content in (("plan.json", result_object(result)),
                          ("load_chart.json", load_chart(result))):  # fmt: skip
        text = json.dumps(content, ensure_ascii=False, indent=1, allow_nan=False)
        write_whole(folder / name, text.encode())

"""Results of a plan: tables, one object for programs, and the load chart."""

from __future__ import annotations

import json
import math
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from rope_twin import __version__
from rope_twin.planning.judgement import Judgement
from rope_twin.planning.tables import sling_loads
from rope_twin.scene.convergence import solver_version
from rope_twin.scene.load_chart import FORMAT
from rope_twin.whole_file import write_whole

if TYPE_CHECKING:
    from rope_twin.planning.cells import CellLimit
    from rope_twin.planning.run import PlanResult
    from rope_twin.planning.simplified import Simplified

HEAD = ("phase", "Tp s", "heading °", "Hs m", "interval m", "governed by", "use %",
        "hook load kN", "DAF",
        "least load kN", "uplift %", "slack %", "seeds", "error %", "simplified Hs m",
        "simplified hook kN")  # fmt: skip
NONE = "–"


def height_words(cell: CellLimit) -> str:
    """Return the limiting height in words."""
    if cell.height_m is None:
        return "none"
    return f"{'≥ ' if cell.capped else ''}{cell.height_m:g}"


def limit_words(result: PlanResult, cell: CellLimit) -> str:
    """Return the governing criterion in words."""
    words = {limit.key: limit.words for limit in result.work_of(cell).limits}
    named = words.get(cell.governing, cell.governing)
    return f"{cell.capped} ({named})" if cell.capped else named


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
    simple = f"{cell.simplified_height_m:g}" if cell.simplified_height_m is not None else "none"
    simple = simple if cell.simplified else NONE
    hook = f"{1e-3 * _simple(cell.simplified)[0]:.0f}" if cell.simplified else NONE
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
    """Yield what the table does not say."""
    method = result.plan.method
    yield (
        f"characteristic values: P{method.percentile:g} of the largest in the exposure, Gumbel by "
        f"maximum likelihood, intervals of {100.0 * method.confidence:g} %"
    )
    for work in result.works:
        for leg in work.legs:
            error = leg.setting_error
            error_words = "given" if math.isnan(error) else f"error {100.0 * error:.2g} %"
            where = (
                f"{leg.from_m:.0f} to {leg.to_m:.0f} m"
                if leg.to_m > leg.from_m
                else (f"{leg.from_m:.0f} m")
            )
            how = f"{leg.setting}, {error_words}"
            yield f"{work.title}, {where}: {how}; exposure {leg.window_s:.0f} s"
    alone = [work.title for work in result.works if work.legs[0].by_twin]
    if alone:
        yield f"{', '.join(alone)}: runs are stepped one at a time, not in lanes"
    finer = sum(cell.refinements > 0 for cell in result.cells)
    if finer:
        yield (
            f"in {finer} of {len(result.cells)} cells mesh or step were made finer, to bring the "
            f"error of the governing run to {100.0 * method.error_within:g} %"
        )
    yield f"study of scene '{result.scene.name}': {_study_words(result)}"
    whole = f"{result.runs:,} runs of {result.simulated_s / 3600.0:,.0f} h in all"
    if result.made:
        factor = result.made_s / result.elapsed_s
        here = "done" if result.made >= result.runs else f"{result.made} runs made"
        whole += f", {here} in {result.elapsed_s:.0f} s ({factor:,.0f} times real time)"
    yield whole


def _study_words(result: PlanResult) -> str:
    study = result.study
    if math.isnan(study.peak_pct):
        return study.words
    return f"maximum of the top tension within {study.peak_pct:.2g} %, {study.words}"


def result_object(result: PlanResult) -> dict[str, Any]:
    """Return everything as one object of plain values; unknown numbers are None."""
    found = {
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
                "limits": {one.key: one.most for one in work.limits},
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
    return dict(_plain(found))


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
        "simplified": [vars(one) for one in cell.simplified],
        "difference": difference(cell),
        "judged_heights": cell.heights,
        "runs": cell.runs,
    }


def difference(cell: CellLimit) -> dict[str, float]:
    """Return what the runs' characteristic values are above the simplified method's.

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


def _simple(found: Sequence[Simplified]) -> tuple[float, float]:
    return max(one.hook_n for one in found), max(one.uplift_share for one in found)


def _judgement_object(judged: Judgement | None) -> dict[str, Any] | None:
    if judged is None:
        return None
    return {
        "hs_m": judged.height_m,
        "seeds": judged.seeds,
        "governing_seed": judged.governing_seed,
        "values": {name: vars(one) for name, one in judged.values.items()},
        "uses": {name: vars(one) for name, one in judged.uses.items()},
        "slack_share": judged.slack_share,
        "failures": judged.failures,
        "fault": judged.fault,
    }


def _plain(value: Any) -> Any:
    """Return a value with None for numbers that are not finite."""
    if isinstance(value, Mapping):
        return {key: _plain(own) for key, own in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(own) for own in value]
    if isinstance(value, float | np.floating):
        return float(value) if math.isfinite(value) else None
    return value


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
            "limits": {one.key: one.most for one in work.limits},
            "limiting_hs_m": [[one.height_m for one in row] for row in rows],
            "governing": [[one.governing for one in row] for row in rows],
            "hook_load_n": [[_hook_n(one) for one in row] for row in rows],
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


def _hook_n(cell: CellLimit) -> float | None:
    return None if cell.judged is None else cell.judged.values["hook_load"].value


def write_results(result: PlanResult, folder: Path) -> None:
    """Write `plan.json` and `load_chart.json`.

    Raises:
        OSError: they cannot be written.
    """
    for name, content in (("plan.json", result_object(result)),
                          ("load_chart.json", load_chart(result))):  # fmt: skip
        words = json.dumps(content, ensure_ascii=False, indent=1, allow_nan=False)
        write_whole(folder / name, words.encode())

"""Report of a plan: one HTML file with inputs, limits, governing runs, errors and versions."""

from __future__ import annotations

import importlib.util
import io
import math
import re
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from rope_twin import __version__
from rope_twin.errors import InputError, phrase
from rope_twin.planning.cell_view import governing_series, series_figure
from rope_twin.planning.notes import NOT_COVERED, notes
from rope_twin.planning.phases import hung_at
from rope_twin.planning.results import (
    NONE,
    daf,
    difference,
    height_words,
    limit_words,
    limits_figure,
    summary_lines,
    table_rows,
)
from rope_twin.planning.run import cell_of
from rope_twin.planning.simplified import lift_of, resonance_period_s
from rope_twin.scene.card import solver_version
from rope_twin.scene.lift import lift_figures
from rope_twin.whole_file import write_whole

if TYPE_CHECKING:
    from rope_twin.planning.cells import CellLimit, PhaseWork, RowStore
    from rope_twin.planning.run import PlanResult

TEMPLATE = "report.html.j2"
WORDS_COLUMNS = (0, 5)  # of the table of limits
DEPTHS, SHALLOW = 12, 0.05  # along the curve of resonance; its beginning over the deepest

SOURCES = {
    "swl_n": "plan; capacity of the crane at its radius",
    "safety_factor": "plan; MBL of the wire by the scene",
    "uplift_share": "DNV-RP-N103: hydrodynamic force at most 0.9 of the static submerged weight",
    "least_tension_n": "plan",
    "landing_speed_m_per_s": "plan; what object and soil bear",
    "stroke_m": "plan; stroke of the compensator",
    "compensation_speed_m_per_s": "plan; speed of the compensator",
}


def check_report() -> None:
    """Check, before any computation, that a report can be made.

    Raises:
        InputError: Jinja2 is not installed.
    """
    if importlib.util.find_spec("jinja2") is None:
        right = "install it with `pip install 'rope_twin[planning]'`"
        raise InputError(phrase("jinja2", "a report needs it and it is not there", right))


def write_report(result: PlanResult, store: RowStore, path: Path) -> None:
    """Write the report.

    Args:
        result: of the plan.
        store: rows of its runs.
        path: of the HTML file.

    Raises:
        InputError: Jinja2 is not installed.
        OSError: it cannot be written.
    """
    check_report()
    import jinja2

    text = Path(__file__).with_name(TEMPLATE).read_text(encoding="utf-8")
    template = jinja2.Environment(autoescape=True, undefined=jinja2.StrictUndefined).from_string(
        text
    )
    pictures = {
        "tip": _svg(_tip_figure(result), "tip", jinja2),
        "limits": _svg(limits_figure(result), "limits", jinja2),
        "resonance": _svg(_resonance_figure(result), "resonance", jinja2),
    }
    page = template.render(
        plan=result.plan,
        scene=result.scene,
        summary=[_summary(result, work) for work in result.works],
        inputs=list(_inputs(result)),
        tip_source=result.works[0].ship.tip.source,
        legs=list(_legs(result)),
        criteria=list(_criteria(result)),
        assumptions=list(_assumptions(result)),
        table=table_rows(result),
        words_columns=WORDS_COLUMNS,
        simplified=list(_simplified_rows(result)),
        pictures=pictures,
        runs=[
            (words, _svg(figure, f"run{number}", jinja2))
            for number, (words, figure) in enumerate(_governing_runs(result, store))
        ],
        lines=list(summary_lines(result)),
        remarks=list(notes(result)),
        not_covered=NOT_COVERED,
        versions=_versions(result),
    )
    write_whole(path, page.encode())


def _svg(figure: Any, salt: str, jinja2: Any) -> Any:
    """Return a figure as SVG inside HTML; salt: makes the names of its parts its own."""
    import matplotlib

    sink = io.StringIO()
    with matplotlib.rc_context({"svg.hashsalt": salt, "svg.fonttype": "none"}):
        figure.savefig(sink, format="svg", metadata={"Date": None, "Creator": None})
    text = sink.getvalue()
    text = text[text.index("<svg") :]
    text = re.sub(r'\bid="', f'id="{salt}_', text)
    text = re.sub(r'(xlink:href="#|url\(#)', rf"\g<1>{salt}_", text)
    return jinja2.utils.markupsafe.Markup(text)


def _lowest(cells: Sequence[CellLimit]) -> CellLimit:
    """Return the cell with the lowest limit; one without a limit only if there is no other."""
    return min(cells, key=lambda cell: (bool(cell.capped), cell.height_m or 0.0, cell.crossing_m))


def _summary(result: PlanResult, work: PhaseWork) -> dict[str, Any]:
    cells = result.of_phase(work.title)
    low = _lowest(cells)
    judged = [cell for cell in cells if cell.judged is not None]
    hooks = [cell.judged.values["hook_load"].value for cell in judged if cell.judged is not None]
    return {
        "phase": work.title,
        "none": low.height_m is None,
        "height": f"{height_words(low)} m" if low.height_m is not None else "none",
        "at": f"Tp {low.period_s:g} s, heading {low.heading_deg:g}°",
        "governing": limit_words(result, low),
        "hook": f"{1e-3 * max(hooks):.0f} kN" if hooks else NONE,
        "daf": f"{max(daf(result, cell) for cell in judged):.2f}" if judged else NONE,
    }


def _inputs(result: PlanResult) -> Iterator[tuple[str, str, str]]:
    """Yield name, value and source of each input."""
    scene, plan = result.scene, result.plan
    figures = lift_figures(scene)
    payload, water = figures.payload, scene.environment
    assert payload is not None, "checked when the plan was read"
    own = next(one for one in scene.payloads)
    shaped = f"shape {type(own.shape).__name__.lower()}" if own.shape is not None else "scene"
    yield "object", f"{own.name}, {1e-3 * payload.mass_kg:g} t in air", "scene"
    yield (
        "submerged weight",
        f"{1e-3 * figures.payload_weight_n:.1f} kN ({payload.volume_m3:g} m³)",
        "mass and displaced volume",
    )
    added = "scene" if own.added_mass_kg is not None else f"{shaped}, DNV-RP-N103"
    drag = "scene" if own.drag_area_m2 is not None else f"{shaped}, DNV-RP-N103"
    yield "added mass A33", f"{1e-3 * payload.added_mass_kg[2]:.1f} t", added
    yield "vertical drag C_D·A", f"{payload.drag_area_m2[2]:.1f} m²", drag
    for section in scene.ropes[0].made_of:
        rope = section.rope
        stiffness = figures.bars[0].stiffness_n
        yield (
            "rope",
            f"{1e3 * rope.diameter_m:g} mm, {rope.mass_kg_per_m:g} kg/m, EA {1e-6 * stiffness:.1f} "
            f"MN, MBL {1e-3 * rope.breaking_load_n:g} kN",
            rope.source or rope.about or "scene",
        )
    yield (
        "structural damping",
        f"{100.0 * figures.damping_fraction:.2g} % of the first axial mode",
        ("scene"),
    )
    yield "water", f"{water.water_density_kg_per_m3:g} kg/m³", "scene"
    yield "vessel", result.works[0].ship.tip.source, "plan" if plan.vessel else "scene"
    sea = plan.sea
    gamma = "by DNV-RP-C205, 3.5.5.5" if sea.gamma is None else "plan"
    yield "spectrum", f"JONSWAP, gamma {gamma if sea.gamma is None else f'{sea.gamma:g}'}", gamma
    yield (
        "sea states",
        f"Hs {sea.hs_m.from_:g} to {sea.hs_m.to:g} m by {sea.hs_m.step:g} m; Tp "
        f"{', '.join(f'{one:g}' for one in sea.tp_s)} s; headings "
        f"{', '.join(f'{one:g}' for one in sea.headings_deg)}° (180°: head seas)",
        "plan",
    )
    yield "load models", ", ".join(_effects(result)), "scene"


def _effects(result: PlanResult) -> list[str]:
    from rope_twin.scene.lift import listed_effects

    return list(listed_effects(result.scene))


def _legs(result: PlanResult) -> Iterator[dict[str, Any]]:
    for work in result.works:
        pairs = zip(work.legs, work.settings, work.setting_errors, strict=True)
        for number, (leg, setting, error) in enumerate(pairs):
            depth = f"{leg.from_m:.0f}"
            yield {
                "first": number == 0,
                "phase": work.title if number == 0 else "",
                "depth": depth if leg.to_m == leg.from_m else f"{depth} to {leg.to_m:.0f}",
                "line": f"{leg.line_out_m:.0f}",
                "speed": f"{leg.speed_m_per_s:g}",
                "exposure": f"{leg.window_s:.0f}",
                "static": f"{1e-3 * leg.static_hook_n:.0f}",
                "resonance": f"{resonance_period_s(lift_of(leg)):.1f}",
                "setting": f"{setting.elements}, {1e3 * setting.step_s:g} ms",
                "error": "given" if math.isnan(error) else f"{100.0 * error:.2g} %",
            }


def _criteria(result: PlanResult) -> Iterator[tuple[str, str, str]]:
    seen = set()
    for work in result.works:
        for limit in work.limits:
            if limit.key in seen:
                continue
            seen.add(limit.key)
            most = (
                f"{1e-3 * limit.most:.0f} kN"
                if limit.key.endswith(("_n", "factor"))
                else (f"{limit.most:g}")
            )
            name = f"{limit.key} ({limit.words})"
            yield name, most, SOURCES[limit.key]


def _assumptions(result: PlanResult) -> Iterator[str]:
    method, scene = result.plan.method, result.scene
    yield "The crane tip is rigid with the ship and turns by small angles (DNV-RP-N103, 4.3.3)."
    yield (
        "Each record is a stationary sea of one JONSWAP system; random phases and Rayleigh "
        "amplitudes (DNV-RP-C205, 3.3.2)."
        if not _on_waves(result)
        else "Rope and payload feel the Airy waves that the ship answers, with the same phases."
    )
    yield (
        "Maxima of seeds follow the Gumbel distribution (Gumbel 1958), fitted by maximum "
        f"likelihood; intervals of {100.0 * method.confidence:g} % by a pivotal bootstrap (Lawless "
        "2003)."
    )
    yield f"The first {scene.ship.motion_ramp_s + method.settle_s:g} s of a run are not counted."
    if any(leg.speed_m_per_s > 0.0 for work in result.works for leg in work.legs):
        yield "Winch speeds are constant, within the winch's acceleration."
    if any(len(work.legs) > 1 for work in result.works):
        yield "Legs of a lowering have independent seas of the same state."
    yield "Added mass and drag of the object do not depend on its motion unless the scene says so."


def _on_waves(result: PlanResult) -> bool:
    return "waves" in _effects(result)


def _simplified_rows(result: PlanResult) -> Iterator[dict[str, Any]]:
    before = ""
    for cell in result.cells:
        if cell.judged is None:
            continue
        tip = max(cell.simplified, key=lambda one: one.tip_m)
        hook = max(one.hook_n for one in cell.simplified)
        uplift = max(one.uplift_share for one in cell.simplified)
        values, apart = cell.judged.values, difference(cell)
        yield {
            "first": cell.phase != before,
            "phase": cell.phase,
            "cells": [
                f"{cell.period_s:g}", f"{cell.heading_deg:g}", f"{cell.height_m:g}",
                f"{tip.tip_m:.2f}", f"{tip.tip_period_s:.1f}",
                f"{1e-3 * values['hook_load'].value:.0f}", f"{1e-3 * hook:.0f}",
                f"{100.0 * apart['hook_load']:+.0f}", f"{100.0 * values['uplift'].value:.0f}",
                f"{100.0 * uplift:.0f}", f"{1e-3 * max(s.snap_n for s in cell.simplified):.0f}",
            ],
        }  # fmt: skip
        before = cell.phase


def _tip_figure(result: PlanResult) -> Any:
    from matplotlib.figure import Figure

    figure = Figure(figsize=(7.0, 3.0), layout="constrained")
    axes = figure.subplots()
    period = np.linspace(4.0, 22.0, 181)
    for heading in result.plan.sea.headings_deg:
        angle = np.full_like(period, math.radians(heading))
        height = np.abs(result.works[0].ship.tip.at(1.0 / period, angle)[2])
        axes.plot(period, height, label=f"{heading:g}°")
    axes.set_xlabel("wave period [s]")
    axes.set_ylabel("tip height [m/m]")
    axes.grid(True, linewidth=0.3)
    axes.legend(fontsize="small", title="heading")
    return figure


def _resonance_figure(result: PlanResult) -> Any:
    from matplotlib.figure import Figure

    figure = Figure(figsize=(7.0, 3.2), layout="constrained")
    axes = figure.subplots()
    legs = [leg for work in result.works for leg in work.legs]
    deepest = max(leg.to_m for leg in legs)
    winch, tip_m = result.scene.winch, result.scene.ship.hang_off_m[2]
    least = winch.least_line_out_m - tip_m if winch is not None else 0.0
    shallow = max(SHALLOW * deepest, least, 1.0)
    template, periods = legs[0], []
    depths = np.linspace(shallow, deepest, DEPTHS)
    for depth in depths.tolist():
        hung, found, _ = hung_at(result.scene, None, depth + tip_m)
        leg = type(template)(**{**vars(template), "scene": hung, "from_m": found, "to_m": found})
        periods.append(resonance_period_s(lift_of(leg)))
    axes.plot(periods, depths, color="#20506e")
    for period in result.plan.sea.tp_s:
        axes.axvline(period, color="#a02c00", linewidth=0.6)
    axes.invert_yaxis()
    axes.set_xlabel("period [s] (lines: Tp of the plan)")
    axes.set_ylabel("depth [m]")
    axes.grid(True, linewidth=0.3)
    return figure


def _governing_runs(result: PlanResult, store: RowStore) -> Iterator[tuple[str, Any]]:
    """Yield caption and picture of the governing run of each phase's lowest limit."""
    for work in result.works:
        low = _lowest(result.of_phase(work.title))
        shown = low.judged or low.beyond
        if shown is None or shown.governing_seed < 0:
            continue
        plan = result.plan
        cell = (
            work.number, plan.sea.tp_s.index(low.period_s),
            plan.sea.headings_deg.index(low.heading_deg),
        )  # fmt: skip
        search = cell_of(plan, result.scene, result.works, cell, store)
        time_s, series = governing_series(search, low)
        words = (
            f"{work.title}: seed {shown.governing_seed} at Hs {shown.height_m:g} m, Tp "
            f"{low.period_s:g} s, heading {low.heading_deg:g}°; above the whole exposure, below "
            "two minutes around the largest hook load."
        )
        yield words, series_figure(low, time_s, series)


def _versions(result: PlanResult) -> list[tuple[str, str]]:
    plan, scene = result.plan, result.scene
    return [
        ("rope_twin", __version__),
        ("solver", solver_version(scene)),
        ("numpy", np.__version__),
        ("plan, SHA-256", plan.digest),
        ("scene, SHA-256", scene.digest),
        ("seed", str(plan.method.seed)),
        ("command", f"rope_twin plan {plan.name} --report"),
    ]

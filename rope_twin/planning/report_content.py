"""Content of the report of a plan: title, tables, figures and texts, in the order of reading.

Whatever writes it, HTML or PDF, adds the layout alone.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace
from decimal import Decimal
from operator import itemgetter
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from rope_twin import __version__
from rope_twin.effects.current import CurrentParams
from rope_twin.files import share_dir, write_whole
from rope_twin.planning.judgement import plain_name, quantity_of
from rope_twin.planning.pictures import (
    AROUND_S,
    arrangement_figure,
    contour_figure,
    governing_series,
    is_short,
    limits_figure,
    resonance_figure,
    series_figure,
    tip_figure,
)
from rope_twin.planning.plan_file import Criteria
from rope_twin.planning.report import Report, check_report, html_report, pdf_report
from rope_twin.planning.results import (
    NONE,
    NOT_COVERED,
    SWINGING,
    daf,
    depth_words,
    difference,
    height_words,
    limit_words,
    notes,
    setting_words,
    summary_lines,
    table_rows,
)
from rope_twin.planning.simplified import lift_of, resonance_period_s
from rope_twin.planning.tables import further_tables, lowest, snap_of
from rope_twin.scene.convergence import solver_version
from rope_twin.scene.lift import lift_figures, listed_effects
from rope_twin.scene.rigging import is_joined

if TYPE_CHECKING:
    from rope_twin.planning.cells import CellLimit, PhaseWork
    from rope_twin.planning.run import PlanResult
    from rope_twin.scene.schema import Scene

HTML, PDF = "report.html", "report.pdf"
SOURCES = {
    "swl_n": "plan; capacity of the crane at its radius",
    "safety_factor": "plan; MBL of the wire by the scene",
    "slings": "MBL over the nominal safety factor of GL Noble Denton 0027/ND 7.3, or WLL",
    "uplift_share": "DNV-RP-N103: hydrodynamic force at most 0.9 of the static submerged weight",
    "min_tension_n": "plan; submerged weight less the minimum tension anywhere in the rope",
    "re_hit_m_per_s": "plan; what object and deck bear",
    "offset_m": "plan; watch circle or target",
    "landing_speed_m_per_s": "plan; what object and soil bear",
    "stroke_m": "plan; stroke of the compensator",
    "compensation_speed_m_per_s": "plan; speed of the compensator",
}
WORDS = ("phase", "governed by", "criterion")  # columns of the tables of cells that are text
LIMIT_COLUMNS = (
    "phase", "Tp s", "heading °", "Hs m", "interval m", "governed by", "simplified Hs m",
)  # fmt: skip
CELL_COLUMNS = ("phase", "Tp s", "heading °", "Hs m")
SIMPLIFIED_HEAD = (
    *CELL_COLUMNS, "tip amplitude m", "tip period s", "hook load kN", "simplified kN",
    "difference %", "uplift %", "simplified %", "snap force kN",
)  # fmt: skip


def write_report(result: PlanResult, folder: Path) -> list[Path]:
    """Write the report as HTML and PDF into a folder that is there, and return both paths.

    Raises:
        InputError: Jinja2 or typst is not installed.
        OSError: a file cannot be written.
    """
    check_report()
    report = report_of(result)
    files = {folder / HTML: html_report(report), folder / PDF: pdf_report(report)}
    for path, data in files.items():
        write_whole(path, data)
    return list(files)


def report_of(result: PlanResult) -> Report:
    """Return the content of a plan's report; governing runs are run once more."""
    # phases as in a text: `at depth`
    works = (replace(work, title=work.title.replace("_", " ")) for work in result.works)
    cells = (replace(cell, phase=cell.phase.replace("_", " ")) for cell in result.cells)
    result = replace(result, works=tuple(works), cells=tuple(cells))
    plan, scene = result.plan, result.scene
    report = Report(
        plan.about or plan.name,
        f"Lift analysis: limiting sea states by phase, peak period and heading. {scene.about}",
        (
            ("plan", f"`{plan.name}`"), ("scene", f"`{scene.name}`"),
            ("analysis", f"rope_twin {__version__}, solver {solver_version(scene)}"),
            ("digest of the plan", f"`{plan.digest[:16]}`"),
            ("prepared by, date", ""), ("checked by, date", ""), ("approved by, date", ""),
        ),
    )  # fmt: skip
    _add_summary(report, result)
    _add_basis(report, result)
    _add_limits(report, result)
    _add_simplified(report, result)
    _add_runs(report, result)
    _add_accuracy(report, result)
    report.appendix("Results of every cell")
    _add_cells(report, result)
    report.heading("Versions and digests")
    names = ("", "")
    report.table("What made these results.", names, list(_versions(result)), (0, 1), (1,))
    return report


def _add_summary(report: Report, result: PlanResult) -> None:
    report.heading("Summary")
    low, method = lowest(result.cells), result.plan.method
    criterion = limit_words(result, low)
    if low.height_m is None:
        report.text(
            f"At {low.sea} no sea state of the grid meets the criteria in phase '{low.phase}' "
            f"({criterion}). The other limits stand below."
        )
    else:
        report.text(
            f"The lowest limit is Hs {height_words(low)} m, in phase '{low.phase}' at {low.sea}; "
            f"{criterion} governs."
        )
    head = ("phase", "lowest limiting Hs", "at", "governed by", "largest hook load", "largest DAF")
    rows = [_summary_row(result, work) for work in result.works]
    report.table("Lowest limit of each phase, and the largest loads at its limits.", head, rows,
                 (0, 2, 3), (2, 3))  # fmt: skip
    report.text(
        f"Loads are P{method.percentile:g} of the largest value in the exposure, at the limiting "
        "sea states. Limits are operational limits: a weather forecast must stay below them times "
        "the alpha factor of the operation's period."
    )
    remarks = list(notes(result))
    if remarks:
        report.text("What to know before these numbers are used:")
        report.points(remarks)


def _summary_row(result: PlanResult, work: PhaseWork) -> tuple[str, ...]:
    cells = result.of_phase(work.title)
    low = lowest(cells)
    judged = [cell for cell in cells if cell.judged is not None]
    hooks = [cell.judged.values["hook_load"].value for cell in judged if cell.judged is not None]
    return (
        work.title,
        f"{height_words(low)} m" if low.height_m is not None else "none",
        low.sea,
        limit_words(result, low),
        f"{1e-3 * max(hooks):.0f} kN" if hooks else NONE,
        f"{max(daf(result, cell) for cell in judged):.2f}" if judged else NONE,
    )


def _add_basis(report: Report, result: PlanResult) -> None:
    plan, scene = result.plan, result.scene
    report.heading("Basis")
    report.heading("Inputs", 2)
    report.table("Inputs and where they are from.", ("input", "value", "source"),
                 list(_inputs(result)), (0, 1, 2), (1, 2))  # fmt: skip
    for name, source in (("plan", plan.source), ("scene", scene.source)):
        if source:
            report.text(f"Source of the {name}: {source}")
    report.figure(
        arrangement_figure(result),
        "Depth of the payload from start to end of each phase, static hook load over depth, and "
        "the current; blue: surface, brown: seabed.",
    )
    report.figure(
        tip_figure(result),
        "Left: height of the crane tip per metre of wave amplitude, by heading. Right: wave "
        f"spectra of the plan over Hs². {result.works[0].ship.tip.source}.",
    )
    report.heading("Phases", 2)
    head = ("phase", "depth m", "line out m", "speed m/s", "exposure s", "static kN",
            "resonance s", "elements, step", "error")  # fmt: skip
    report.table(
        "Phases and their legs: static hook load, period of the first axial mode, and the "
        "discretisation error of mesh and step.", head, list(_legs(result)), (0,), (0,), True,
    )  # fmt: skip
    report.heading("Criteria", 2)
    report.table(
        "Criteria: each characteristic value is at most its limit.",
        ("criterion", "limit", "source"),
        list(_criteria(result)),
        (0, 2),
        (0, 2),
    )
    report.heading("Assumptions", 2)
    report.points(list(_assumptions(result)))
    if plan.uncertainties:
        report.heading("Uncertain data", 2)
        report.table(
            "Data that the plan calls uncertain. The limits are those of the data above; "
            "`rope_twin sensitivity` shows which of it they depend on.",
            ("number", "distribution", "source"),
            [(datum.title, datum.words, datum.source) for datum in plan.uncertainties],
            (0, 1, 2), (1, 2),
        )  # fmt: skip


def _inputs(result: PlanResult) -> Iterator[tuple[str, str, str]]:
    """Yield name, value and source of each input."""
    scene, plan = result.scene, result.plan
    yield from _lines(scene) if is_joined(scene) else _object(scene)
    yield "water", f"{scene.environment.water_density_kg_per_m3:g} kg/m³", "scene"
    yield "vessel", result.works[0].ship.tip.source, "plan" if plan.vessel else "scene"
    if plan.vessel is not None:
        x, y, z = plan.vessel.crane_tip_m
        yield "crane tip", f"{x:g} m ahead, {y:g} m to port, {z:g} m up, in the RAOs' axes", "plan"
    yield from _current(result)
    sea = plan.sea
    by_rule = sea.gamma is None
    gamma = "from Tp/√Hs" if by_rule else f"{sea.gamma:g}"
    yield "spectrum", f"JONSWAP, gamma {gamma}", "DNV-RP-C205, 3.5.5.5" if by_rule else "plan"
    yield (
        "sea states",
        f"Hs {sea.hs_m.from_:g} to {sea.hs_m.to:g} m by {sea.hs_m.step:g} m; Tp "
        f"{', '.join(f'{value:g}' for value in sea.tp_s)} s; headings "
        f"{', '.join(f'{value:g}' for value in sea.headings_deg)}° (180°: head seas)",
        "plan",
    )
    yield "load models", ", ".join(listed_effects(scene)), "scene"


def _current(result: PlanResult) -> Iterator[tuple[str, str, str]]:
    """Yield the current at its highest and its lowest point, with its direction from the bow."""
    current = result.scene.listed(CurrentParams)
    if current is None:
        return
    bow, levels = math.degrees(result.plan.bow_of(result.scene)), []
    for z, east, north, _ in current.table[[0, -1] if len(current.table) > 1 else [0]].tolist():
        setting = (math.degrees(math.atan2(north, east)) - bow) % 360.0
        levels.append(f"{math.hypot(east, north):.3g} m/s towards {setting:.0f}° at {abs(z):g} m")
    source = "plan" if result.plan.current else "scene"
    yield "current, from the bow", ", ".join(levels), source


def _lines(scene: Scene) -> Iterator[tuple[str, str, str]]:
    """Yield the payloads and ropes of a multi-line scene."""
    for payload in scene.payloads:
        yield payload.name, f"payload, {1e-3 * payload.mass_kg:g} t in air", "scene"
    for line in scene.ropes:
        properties = f"{line.length_m:g} m, MBL {1e-3 * line.breaking_load_n:g} kN"
        yield line.name, f"from {line.from_} to {line.to or 'a fixed point'}, {properties}", "scene"


def _object(scene: Scene) -> Iterator[tuple[str, str, str]]:
    """Yield the object and the rope of a scene of one rope."""
    figures = lift_figures(scene)
    payload = figures.payload
    assert payload is not None, "checked when the plan was read"
    entry = next(item for item in scene.payloads)
    shaped = f"shape {type(entry.shape).__name__.lower()}" if entry.shape is not None else "scene"
    yield "object", f"{entry.name}, {1e-3 * payload.mass_kg:g} t in air", "scene"
    yield (
        "submerged weight",
        f"{1e-3 * figures.payload_weight_n:.1f} kN ({payload.volume_m3:g} m³)",
        "mass and displaced volume",
    )
    added = "scene" if entry.added_mass_kg is not None else f"{shaped}, DNV-RP-N103"
    drag = "scene" if entry.drag_area_m2 is not None else f"{shaped}, DNV-RP-N103"
    yield "added mass A33", f"{1e-3 * payload.added_mass_kg[2]:.1f} t", added
    yield "vertical drag C_D·A", f"{payload.drag_area_m2[2]:.1f} m²", drag
    for section, bar in zip(scene.ropes[0].made_of, figures.bars, strict=True):
        rope = section.rope
        yield (
            "rope",
            f"{1e3 * rope.diameter_m:g} mm, {rope.mass_kg_per_m:.4g} kg/m, EA "
            f"{1e-6 * bar.stiffness_n:.1f} MN, MBL {1e-3 * rope.breaking_load_n:.4g} kN",
            rope.source or rope.about or "scene",
        )
    yield (
        "structural damping",
        f"{100.0 * figures.damping_fraction:.2g} % of the first axial mode",
        "scene",
    )


def _legs(result: PlanResult) -> Iterator[tuple[str, ...]]:
    for work in result.works:
        for leg in work.legs:
            setting = leg.setting
            yield (
                work.title,
                depth_words(leg),
                f"{leg.line_out_m:.0f}",
                f"{leg.speed_m_per_s:g}",
                f"{leg.window_s:.0f}",
                f"{1e-3 * leg.static_hook_n:.0f}",
                NONE if leg.ropes else f"{resonance_period_s(lift_of(leg)):.1f}",
                f"{setting.elements}, {1e3 * setting.step_s:g} ms",
                setting_words(result, leg).removeprefix("error "),
            )


def _criteria(result: PlanResult) -> Iterator[tuple[str, str, str]]:
    limits = {limit.key: limit for work in result.works for limit in work.limits}
    for limit in limits.values():
        unit = quantity_of(limit.quantity).unit
        text = f"{1e-3 * limit.most:.0f} kN" if unit == "kN" else f"{limit.most:g} {unit}".strip()
        source = SOURCES.get(plain_name(limit.key), "plan")
        if plain_name(limit.key) == "uplift_share" and limit.most != Criteria.uplift_share:
            source = "plan"
        yield f"{limit.words} (`{limit.key}`)", text, source


def _assumptions(result: PlanResult) -> Iterator[str]:
    method, scene = result.plan.method, result.scene
    yield "The crane tip is rigid with the ship and turns by small angles (DNV-RP-N103, 4.3.3)."
    yield (
        "Each record is a stationary sea of one JONSWAP system; random phases and Rayleigh "
        "amplitudes (DNV-RP-C205, 3.3.2)."
        if "waves" not in listed_effects(scene)
        else "Rope and payload feel the Airy waves that the ship answers, with the same phases."
    )
    yield (
        "Maxima of seeds follow the Gumbel distribution (Gumbel 1958), fitted by maximum "
        f"likelihood; intervals of {100.0 * method.confidence:g} % by a pivotal bootstrap (Lawless "
        "2003). Where some are zero, as of a re-hit that does not happen, the others are fitted, "
        "and the percentile is taken of both together."
    )
    yield f"The first {scene.ship.motion_ramp_s + method.settle_s:g} s of a run are not counted."
    if any(leg.speed_m_per_s != 0.0 for work in result.works for leg in work.legs):
        yield "Winch speeds are constant, within the winch's acceleration."
    if any(len(work.legs) > 1 for work in result.works):
        yield "Legs of a lowering have independent seas of the same state."
    yield "Added mass and drag of the object do not depend on its motion unless the scene says so."


def _add_limits(report: Report, result: PlanResult) -> None:
    report.heading("Limiting sea states")
    report.text(
        "Each cell has the largest Hs of the grid that meets all criteria, found by bisection, and "
        "the criterion that the next height breaks. ≥: no higher sea was judged, as the grid ends "
        "or waves break there."
    )
    headings = result.plan.sea.headings_deg
    rows = []
    for work in result.works:
        cells = result.by_sea(work.title)
        for tp in result.plan.sea.tp_s:
            limits = [cells[tp, heading] for heading in headings]
            rows.append(
                (work.title, f"{tp:g}", *(_matrix_words(result, column) for column in limits))
            )
    head = ("phase", "Tp s", *(f"heading {heading:g}°" for heading in headings))
    report.table(
        "Limiting Hs in metres and the governing criterion, by phase, peak period and heading.",
        head,
        rows,
        (0, *range(2, len(head))),
        range(2, len(head)),
        True,
    )
    report.figure(
        limits_figure(result),
        f"Limiting Hs over Tp. Bands: intervals of {100.0 * result.plan.method.confidence:g} % "
        "where the use of the governing limit is 1. Thin lines: simplified method. "
        "Triangles, open ones of the simplified method: no higher sea was judged.",
    )
    report.figure(
        contour_figure(result),
        "Contours of limiting Hs over peak period and heading, linear between the cells (dots).",
    )
    for table in further_tables(result):
        report.heading(table.title, 2)
        text = [k for k, name in enumerate(table.rows[0]) if name in WORDS]
        report.table(table.about, table.rows[0], table.rows[1:], text, text, True)


def _matrix_words(result: PlanResult, cell: CellLimit) -> str:
    if cell.height_m is None:
        return f"none ({limit_words(result, cell)})"
    if cell.capped:
        return height_words(cell)
    return f"{height_words(cell)}, {limit_words(result, cell)}"


def _add_simplified(report: Report, result: PlanResult) -> None:
    report.heading("Resonance and the simplified method")
    curve = resonance_figure(result)
    if curve is None:
        report.text("No object hangs under water on a single rope: there is no curve of resonance.")
    report.figure(
        curve,
        "Period of the first axial mode of rope and payload over depth, "
        "2π·√((M + A33 + m·L/3)·L/EA), and the peak periods of the plan.",
    )
    if is_joined(result.scene):
        report.text("The ropes meet: the simplified method has no formulas for them.")
        return
    report.text(
        "The simplified method (DNV-RP-N103) linearises drag and takes the response as fully "
        "developed; in the splash zone it adds characteristic slamming, drag, inertia and buoyancy "
        "as if they acted at once. The runs integrate quadratic drag, slack and the paid-out line "
        "in time. Its numbers stand beside those of the runs in appendix A."
    )
    differences = [
        (100.0 * difference(cell)["hook_load"], cell)
        for cell in result.cells if cell.judged is not None and cell.simplified
    ]  # fmt: skip
    if differences:
        ends = min(differences, key=itemgetter(0)), max(differences, key=itemgetter(0))
        words = [f"{share:+.1f} % ({cell.phase}, {cell.sea})" for share, cell in ends]
        by = " to ".join(dict.fromkeys(words))
        report.text(f"The hook load of the runs differs from the simplified one by {by}.")


def _add_runs(report: Report, result: PlanResult) -> None:
    """Add the governing run of each phase's lowest limit."""
    report.heading("Governing runs")
    report.text("The run with the largest use of the governing limit, at the lowest limit of each "
                "phase.")  # fmt: skip
    for work in result.works:
        low = lowest(result.of_phase(work.title))
        judgement = low.shown
        if judgement is None or judgement.governing_seed < 0:
            continue
        time_s, series = governing_series(result.search_of(low), low)
        parts = "the whole exposure"
        if not is_short(time_s):
            around = f"{AROUND_S:g} s before and after the largest hook load"
            parts = f"above the whole exposure, below {around}"
        report.figure(
            series_figure(low, time_s, series),
            f"{work.title}: seed {judgement.governing_seed} at Hs {judgement.height_m:g} m, "
            f"{low.sea}; {parts}.",
        )


def _add_accuracy(report: Report, result: PlanResult) -> None:
    report.heading("Statistics and accuracy")
    report.points([line[0].upper() + line[1:] for line in summary_lines(result)])
    errors = [cell.error for cell in result.cells if not math.isnan(cell.error)]
    if errors:
        report.text(
            "The discretisation error of the governing run, from twice the elements and half the "
            f"step, is {100.0 * float(np.median(errors)):.2g} % in the middle cell and at most "
            f"{100.0 * max(errors):.2g} %."
        )
    report.heading("What is not covered")
    legs = [leg for work in result.works for leg in work.legs]
    swings = any(leg.in_air or leg.deck_m is not None for leg in legs)
    report.points([line for line in NOT_COVERED if line != SWINGING or not swings])


def _add_cells(report: Report, result: PlanResult) -> None:
    head, *rows = table_rows(result)
    others = [name for name in head if name not in LIMIT_COLUMNS and "simplified" not in name]
    for title, names, wide, caption in (
        ("Limits", LIMIT_COLUMNS, (0, 5), "Limits. Interval: of the Hs at which the largest use "
         "of a limit is 1."),
        ("Loads at the limits", (*CELL_COLUMNS, *others), (0,), "Loads at the limits (at the "
         "lowest height where there is none). ±: half of the interval of the hook load. DAF: hook "
         "load over the largest static one of the phase. Uplift: loss of tension at the payload "
         "over its submerged weight; least load: what is left. Slack: share of the time with an "
         "element without tension. Error: discretisation error of the governing run."),
    ):  # fmt: skip
        report.heading(title, 2)
        columns = [head.index(name) for name in names]
        text = [k for k, name in enumerate(names) if name in WORDS]
        cells = [[row[k] for k in columns] for row in rows]
        report.table(caption, names, cells, text, wide, True)
    rows = list(_simplified_rows(result))
    if rows:
        report.heading("Simplified method", 2)
        report.table("Loads of the runs and of the simplified method at the limits. The snap force "
                     "is that of the simplified method, should the rope go slack.",
                     SIMPLIFIED_HEAD, rows, (0,), (0,), True)  # fmt: skip


def _simplified_rows(result: PlanResult) -> Iterator[list[str]]:
    for cell in result.cells:
        if cell.judged is None or not cell.simplified:
            continue
        tip = max(cell.simplified, key=lambda load: load.tip_m)
        hook = max(load.hook_n for load in cell.simplified)
        uplift = max(load.uplift_share for load in cell.simplified)
        values, differences = cell.judged.values, difference(cell)
        snap, _ = snap_of(result.work_of(cell), cell)
        yield [
            *cell.row_head, f"{cell.height_m:g}",
            f"{tip.tip_m:.2f}", f"{tip.tip_period_s:.1f}",
            f"{1e-3 * values['hook_load'].value:.0f}", f"{1e-3 * hook:.0f}",
            f"{round(100.0 * differences['hook_load']):+d}",
            f"{100.0 * values['uplift'].value:.0f}", f"{100.0 * uplift:.0f}",
            NONE if math.isnan(snap) else f"{1e-3 * snap:.0f}",
        ]  # fmt: skip


def _versions(result: PlanResult) -> Iterator[tuple[str, str]]:
    plan, scene = result.plan, result.scene
    yield "rope_twin", f"`{__version__}`"
    yield "solver", f"`{solver_version(scene)}`"
    yield "numpy", f"`{np.__version__}`"
    yield "plan, SHA-256", f"`{plan.digest}`"
    yield "scene, SHA-256", f"`{scene.digest}`"
    yield "first random number", f"`{plan.method.seed}`"
    is_selected = plan.method.elements is None
    error_pct = Decimal(repr(plan.method.error_within)).scaleb(2).normalize()
    option = f" --within {error_pct:f}%" if is_selected else ""
    shipped = plan.path.parent == share_dir() / "config" / "plans"
    file = plan.name if shipped else plan.path.name
    yield "command", f"`rope_twin plan {file}{option} --report`"

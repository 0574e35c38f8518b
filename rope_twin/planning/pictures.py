"""Pictures of a plan (matplotlib): its inputs, limits and governing runs."""

from __future__ import annotations

import math
import textwrap
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from rope_twin.effects.current import CurrentParams
from rope_twin.errors import InputError
from rope_twin.files import write_whole
from rope_twin.planning.phases import suspended_at
from rope_twin.planning.runs import AT_DEPTH, AT_LOWEST, sea_seed, watch_seed
from rope_twin.planning.simplified import lift_of, resonance_period_s
from rope_twin.scene.lift import lift_figures
from rope_twin.scene.rigging import is_joined
from rope_twin.sea.tables import Vector
from rope_twin.studies.picture import new_figure, write_picture
from rope_twin.twin.ensemble.member import TOP

if TYPE_CHECKING:
    from rope_twin.planning.cells import Cell, CellLimit
    from rope_twin.planning.phases import Leg
    from rope_twin.planning.run import PlanResult

COLUMNS = ("time_s", "hook_load_n", "payload_tension_n", "payload_depth_m")
TIME_DIGITS = 10  # of a file: the finest steps stay apart after days
AROUND_S = 60.0  # on either side of the largest load, in the lower panels
DEPTHS, SHALLOW = 12, 0.05  # along the curve of resonance; its beginning over the deepest
STEPS = 40  # along the static hook load
STYLES = ("-", "--", ":", "-.")
WIDE = 7.0  # inches, over a page
NAME_WIDTH = 10  # letters of a line under a phase
MAX_MARKED = 9  # peak periods that all have a mark


def _axes(height: float, across: int = 1, **more: Any) -> tuple[Any, Any]:
    """Return a figure over the page and its axes; those of several in a list."""
    figure = new_figure(WIDE, height)
    axes_array = figure.subplots(1, across, **more)
    for axes in [axes_array] if across == 1 else axes_array:
        axes.grid(True, linewidth=0.3)
    return figure, axes_array


def _sunk(result: PlanResult) -> list[Leg]:
    """Return the legs in which an object hangs under water on one rope."""
    legs = [leg for work in result.works for leg in work.legs]
    return [] if is_joined(result.scene) else [leg for leg in legs if leg.to_m > 0.0]


def _depths(result: PlanResult) -> tuple[float, float]:
    """Return the depths between which curves over depth are drawn [m]."""
    deepest = max(leg.to_m for leg in _sunk(result))
    winch = result.scene.winch
    min_depth_m = 0.0 if winch is None else winch.min_line_out_m - result.scene.ship.hang_off_m[2]
    return max(SHALLOW * deepest, min_depth_m, 1.0), deepest


def arrangement_figure(result: PlanResult) -> Any:
    """Return depths of the phases, static hook load and current over one axis of depth; None
    where no object hangs under water on one rope.
    """
    if not _sunk(result):
        return None
    current = result.scene.listed(CurrentParams)
    figure, panels = _axes(2.6, 2 if current is None else 3, sharey=True)
    shallow, deepest = _depths(result)
    water = panels[0]
    for number, work in enumerate(result.works):
        ends = [work.legs[0].from_m, work.legs[-1].to_m]
        water.plot([number, number], ends, "o-", color=f"C{number}", linewidth=3, markersize=5)
        bed = work.legs[0].bed_m
        if bed is not None:
            water.axhline(bed, color="#6b4f2a", linewidth=1.5)
    names = [textwrap.fill(work.title, NAME_WIDTH) for work in result.works]
    water.set_xticks(range(len(names)), names, fontsize=7)
    water.set_xlim(-0.6, len(result.works) - 0.4)
    water.axhline(0.0, color="#20506e", linewidth=1.5)
    water.set_ylabel("depth [m]")
    water.set_title("payload in each phase", fontsize=9)
    figures, tip_m = lift_figures(result.scene), result.scene.ship.hang_off_m[2]
    start = min(leg.from_m for leg in _sunk(result))
    depths = np.linspace(min(shallow, start), deepest, STEPS)
    panels[1].plot([1e-3 * figures.top_tension_n(tip_m + d) for d in depths.tolist()], depths)
    panels[1].set_xlabel("kN")
    panels[1].set_title("static hook load", fontsize=9)
    if current is not None:
        z, *parts = current.table.T
        panels[2].plot(np.hypot(parts[0], parts[1]), -z, "o-", markersize=3)
        panels[2].set_xlabel("m/s")
        panels[2].set_title("current", fontsize=9)
    top = min(min(leg.from_m for work in result.works for leg in work.legs), 0.0)
    panels[0].set_ylim(1.04 * deepest, top - 0.04 * deepest)
    return figure


def tip_figure(result: PlanResult) -> Any:
    """Return the height of the crane tip per metre of wave amplitude, and spectra of the plan."""
    figure, (tip, sea) = _axes(2.7, 2)
    period = np.linspace(4.0, 22.0, 181)
    for heading in result.plan.sea.headings_deg:
        angle = np.full_like(period, math.radians(heading))
        height = np.abs(result.works[0].ship.tip.at(1.0 / period, angle)[2])
        tip.plot(period, height, label=f"{heading:g}°")
    tip.set_xlabel("wave period [s]")
    tip.set_ylabel("tip height [m/m]")
    tip.legend(fontsize="small", title="heading")
    plan = result.plan
    for number, tp in enumerate(plan.sea.tp_s):
        heights = plan.heights_m(number, 0)
        height = heights[len(heights) // 2]
        spectrum = plan.sea_state(height, number, 0).spectrum()
        density = spectrum.density_at(1.0 / period) / height**2
        sea.plot(period, density, label=f"{tp:g} s, {height:g} m", linewidth=0.9)
    sea.set_xlabel("wave period [s]")
    sea.set_ylabel("S/Hs² [s]")
    sea.legend(fontsize="small", title="Tp, Hs")
    return figure


def resonance_figure(result: PlanResult) -> Any:
    """Return the period of the first axial mode over depth, with the peak periods; None where no
    object hangs under water on one rope.
    """
    legs = _sunk(result)
    if not legs:
        return None
    figure, axes = _axes(2.5)
    (shallow, deepest), tip_m = _depths(result), result.scene.ship.hang_off_m[2]
    template, periods = legs[0], []
    depths = np.linspace(shallow, deepest, DEPTHS)
    for depth in depths.tolist():
        scene, depth_m = suspended_at(result.scene, None, depth + tip_m)[:2]
        leg = type(template)(
            **{**vars(template), "scene": scene, "from_m": depth_m, "to_m": depth_m}
        )
        periods.append(resonance_period_s(lift_of(leg)))
    axes.plot(periods, depths, color="#20506e")
    for period in result.plan.sea.tp_s:
        axes.axvline(period, color="#a02c00", linewidth=0.6)
    axes.invert_yaxis()
    axes.set_xlabel("period [s] (lines: Tp of the plan)")
    axes.set_ylabel("depth [m]")
    return figure


def limits_figure(result: PlanResult) -> Any:
    """Return the picture of limiting Hs over Tp: a panel for each phase, a line for each heading.

    Bands are the intervals; thin lines are the simplified method. Triangles, open ones of the
    simplified method: no higher sea was judged.
    """
    figure, panels = _panels(len(result.works), 2.7)
    top = result.plan.sea.hs_m.to * 1.08
    for axes, work in zip(panels, result.works, strict=True):
        cells = result.of_phase(work.title)
        for number, heading in enumerate(result.plan.sea.headings_deg):
            cells_of_heading = [cell for cell in cells if cell.heading_deg == heading]
            _draw_limit(axes, cells_of_heading, number, f"{heading:g}°")
        axes.set_title(work.title, fontsize=10)
        axes.set_xlabel("Tp [s]")
        axes.set_ylabel("limiting Hs [m]")
        axes.set_ylim(0.0, top)
        axes.grid(True, linewidth=0.3)
        axes.legend(fontsize="small", title="heading")
    return figure


def _panels(count: int, panel_height: float) -> tuple[Any, list[Any]]:
    """Return a page-wide figure and the axes of its panels, `panel_height` inches high."""
    across = min(count, 3)
    down = math.ceil(count / across)
    figure = new_figure(WIDE, panel_height * down)
    panels: list[Any] = figure.subplots(down, across, squeeze=False).ravel().tolist()
    for axes in panels[count:]:
        axes.set_axis_off()
    return figure, panels[:count]


def _draw_limit(axes: Any, cells: Sequence[CellLimit], number: int, label: str) -> None:
    periods = [cell.period_s for cell in cells]
    colour, style = f"C{number}", STYLES[number % len(STYLES)]
    heights = [cell.height_m or 0.0 for cell in cells]
    axes.plot(periods, heights, f"o{style}", color=colour, markersize=4, label=label)
    capped = [(cell.period_s, cell.height_m or 0.0) for cell in cells if cell.capped]
    if capped:
        axes.plot(*zip(*capped, strict=True), "^", color=colour, markersize=8)
    low, high = [cell.low_m for cell in cells], [cell.high_m for cell in cells]
    axes.fill_between(periods, low, high, color=colour, alpha=0.2, linewidth=0.0)
    simple = [cell.simplified_height_m or 0.0 for cell in cells]
    axes.plot(periods, simple, color=colour, linewidth=0.7)
    ends = [
        (cell.period_s, cell.simplified_height_m or 0.0) for cell in cells if cell.simplified_capped
    ]
    if ends:
        axes.plot(
            *zip(*ends, strict=True),
            "^",
            color=colour,
            markersize=12,
            markeredgewidth=0.7,
            fillstyle="none",
        )


def contour_figure(result: PlanResult) -> Any:
    """Return contours of limiting Hs over Tp and heading, a panel for each phase; None: the plan
    has one Tp or one heading.
    """
    sea = result.plan.sea
    headings = sorted(sea.headings_deg)
    if len(sea.tp_s) < 2 or len(headings) < 2:
        return None
    figure, panels = _panels(len(result.works), 2.8)
    top = math.ceil(2.0 * max(cell.height_m or 0.0 for cell in result.cells)) / 2.0
    levels = np.linspace(0.0, max(top, 0.5), 13)
    for axes, work in zip(panels, result.works, strict=True):
        cells = result.by_sea(work.title)
        table = np.array([[cells[tp, h].height_m or 0.0 for tp in sea.tp_s] for h in headings])
        contours = axes.contourf(sea.tp_s, headings, table, levels, cmap="RdYlGn")
        lines = axes.contour(
            sea.tp_s, headings, table, levels[::2], colors="#1c2630", linewidths=0.5
        )
        axes.clabel(lines, fontsize=6, fmt="%g")
        tp, heading = np.meshgrid(sea.tp_s, headings)
        axes.plot(tp.ravel(), heading.ravel(), ".", color="#1c2630", markersize=3)
        axes.set_yticks(headings)
        if len(sea.tp_s) <= MAX_MARKED:
            axes.set_xticks(sea.tp_s, [f"{period_s:g}" for period_s in sea.tp_s], fontsize=8)
        axes.set_title(work.title, fontsize=10)
        axes.set_xlabel("Tp [s]")
        axes.set_ylabel("heading [°]")
    figure.colorbar(contours, ax=panels, label="limiting Hs [m]", shrink=0.9)
    return figure


def governing_series(search: Cell, limit: CellLimit) -> tuple[Vector, Vector]:
    """Return time [s] in the window, (n,), and hook load [N], payload tension [N] and depth [m] of
    the governing run, (n, 3).
    """
    judgement = limit.shown
    assert judgement is not None
    leg = search.work.legs[judgement.governing_leg]
    seed = sea_seed(
        search.plan.method.seed, search.work.number, leg.number, judgement.governing_seed
    )
    time_s, steps = watch_seed(leg, search.work.ship, search.sea(judgement.height_m), seed)
    is_counted = time_s > leg.first_s
    return time_s[is_counted], steps[is_counted][:, [TOP, AT_LOWEST, AT_DEPTH]]


def is_short(time_s: Vector) -> bool:
    """Return whether a run is not longer than what is shown around its largest load."""
    return bool(time_s[-1] - time_s[0] <= 2.0 * AROUND_S)


def series_figure(limit: CellLimit, time_s: Vector, series: Vector) -> Any:
    """Return the picture of a run: hook load as a whole unless it is short, then all around its
    maximum.
    """
    short = is_short(time_s)
    figure = new_figure(WIDE, 3.5 if short else 4.5)
    panels = figure.subplots(3 if short else 4, 1).tolist()
    load, payload, depth = panels[-3:]
    hook, tension, below = 1e-3 * series[:, 0], 1e-3 * series[:, 1], series[:, 2]
    if not short:
        panels[0].plot(time_s, hook, linewidth=0.6)
        panels[0].set_ylabel("hook load [kN]")
    peak_s = time_s[int(np.argmax(hook))]
    is_near = short | (np.abs(time_s - peak_s) <= AROUND_S)
    for axes, values, label in (
        (load, hook, "hook load [kN]"),
        (payload, tension, "tension at\npayload [kN]"),
        (depth, below, "depth [m]"),
    ):
        axes.plot(time_s[is_near], values[is_near], linewidth=0.9)
        axes.set_ylabel(label)
    payload.axhline(0.0, color="#a02c00", linewidth=0.8)
    depth.invert_yaxis()
    depth.set_xlabel("time [s]")
    for axes in panels:
        axes.grid(True, linewidth=0.3)
        axes.yaxis.label.set_size(8)
    figure.align_ylabels()
    assert limit.shown is not None
    figure.suptitle(f"{limit.phase}: {limit.sea}, Hs {limit.shown.height_m:g} m", fontsize=10)
    return figure


def series_csv(time_s: Vector, series: Vector) -> str:
    """Return time [s], (n,), and the series of `governing_series`, (n, 3), as CSV with COLUMNS."""
    pairs = zip(time_s.tolist(), series.tolist(), strict=True)
    rows = (",".join([f"{t:.{TIME_DIGITS}g}", *(f"{v:.6g}" for v in row)]) for t, row in pairs)
    return "\n".join([",".join(COLUMNS), *rows]) + "\n"


def show_cell(search: Cell, limit: CellLimit, out: Path) -> dict[str, Any]:
    """Run the governing run of a cell's limiting height again; write its series and its picture.

    Returns its numbers as they were judged, and the paths of the files.

    search: of the cell, at the limit's settings, with its rows.

    Raises:
        InputError: no height of the cell meets the criteria.
    """
    judgement = limit.shown
    if judgement is None or judgement.governing_seed < 0:
        problem = limit.governing or "no height could be run"
        raise InputError(f"cell of '{limit.phase}'", problem, "choose another cell")
    height, seed = search.heights_m.index(judgement.height_m), judgement.governing_seed
    row = search.store.get(search.run_number(height, judgement.governing_leg, seed))
    assert row is not None, "the search has judged it"
    time_s, series = governing_series(search, limit)
    stem = f"cell_{limit.phase}_{limit.period_s:g}s_{limit.heading_deg:g}deg".replace("/", "_")
    table = out / f"{stem}.csv"
    write_whole(table, series_csv(time_s, series).encode())
    picture = out / f"{stem}.png"
    write_picture(series_figure(limit, time_s, series), picture, 110)
    return {
        "phase": limit.phase,
        "tp_s": limit.period_s,
        "heading_deg": limit.heading_deg,
        "hs_m": judgement.height_m,
        "seed": seed,
        "hook_load_max_n": row["top_max_n"],
        "payload_tension_min_n": row["payload_min_n"],
        "series": str(table),
        "picture": str(picture),
    }

"""One cell looked at: its governing run once more, as time series and picture."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from rope_twin.errors import InputError, phrase
from rope_twin.planning.cells import Cell, CellLimit
from rope_twin.planning.runs import AT_DEPTH, AT_LOWEST, sea_seed, watch_seed
from rope_twin.sea.tables import Vector
from rope_twin.studies.picture import write_picture
from rope_twin.twin.ensemble.member import TOP
from rope_twin.whole_file import write_whole

COLUMNS = ("time_s", "hook_load_n", "payload_tension_n", "payload_depth_m")
AROUND_S = 60.0  # on either side of the largest load, in the lower panels


def show_cell(search: Cell, out: Path) -> dict[str, Any]:
    """Run the governing run of a cell's limiting height again; write its series and its picture.

    Returns its numbers, and the paths of the files. Rows that are not there are run first.

    Raises:
        InputError: no height of the cell meets the criteria.
    """
    limit = search.find()
    shown = limit.judged or limit.beyond
    if shown is None or shown.governing_seed < 0:
        what = limit.governing or "no height could be run"
        raise InputError(phrase(f"cell of '{limit.phase}'", what, "choose another cell"))
    time_s, series = governing_series(search, limit)
    stem = f"cell_{limit.phase}_{limit.period_s:g}s_{limit.heading_deg:g}deg".replace("/", "_")
    table = out / f"{stem}.csv"
    columns = np.column_stack([time_s, series])
    lines = [",".join(COLUMNS), *(",".join(f"{v:.6g}" for v in row) for row in columns)]
    write_whole(table, ("\n".join(lines) + "\n").encode())
    picture = out / f"{stem}.png"
    write_picture(series_figure(limit, time_s, series), picture, 110)
    return {
        "phase": limit.phase,
        "tp_s": limit.period_s,
        "heading_deg": limit.heading_deg,
        "hs_m": shown.height_m,
        "seed": shown.governing_seed,
        "hook_load_max_n": float(series[:, 0].max()),
        "payload_tension_min_n": float(series[:, 1].min()),
        "series": str(table),
        "picture": str(picture),
    }


def governing_series(search: Cell, limit: CellLimit) -> tuple[Vector, Vector]:
    """Return time [s] in the window, (n,), and hook load [N], payload tension [N] and depth [m] of
    the governing run, (n, 3).
    """
    shown = limit.judged or limit.beyond
    assert shown is not None
    leg = search.work.legs[shown.governing_leg]
    seed = sea_seed(search.plan.method.seed, search.work.number, leg.number, shown.governing_seed)
    time_s, steps = watch_seed(leg, search.work.ship, search.sea(shown.height_m), seed)
    counted = time_s > leg.first_s
    return time_s[counted], steps[counted][:, [TOP, AT_LOWEST, AT_DEPTH]]


def series_figure(limit: CellLimit, time_s: Vector, series: Vector) -> Any:
    """Return the picture of a run: hook load as a whole, then all around its maximum."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(8.0, 6.5), layout="constrained")
    whole, load, payload, depth = figure.subplots(4, 1)
    hook, tension, below = 1e-3 * series[:, 0], 1e-3 * series[:, 1], series[:, 2]
    whole.plot(time_s, hook, linewidth=0.6)
    whole.set_ylabel("hook load [kN]")
    at = time_s[int(np.argmax(hook))]
    near = np.abs(time_s - at) <= AROUND_S
    for axes, values, words in (
        (load, hook, "hook load [kN]"),
        (payload, tension, "at the payload [kN]"),
        (depth, below, "depth [m]"),
    ):
        axes.plot(time_s[near], values[near], linewidth=0.9)
        axes.set_ylabel(words)
    depth.invert_yaxis()
    depth.set_xlabel("time [s]")
    for axes in (whole, load, payload, depth):
        axes.grid(True, linewidth=0.3)
    figure.suptitle(
        f"{limit.phase}: Tp {limit.period_s:g} s, heading {limit.heading_deg:g}°, "
        f"Hs {(limit.judged or limit.beyond).height_m:g} m"  # type: ignore[union-attr]
    )
    return figure

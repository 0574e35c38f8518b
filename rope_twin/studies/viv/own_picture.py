"""Pictures and tables of a run with the scene's own VIV model, in one folder."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np

from rope_twin.core.state import Floats
from rope_twin.studies.picture import Field, Line, Panel, draw_panels
from rope_twin.studies.viv.own import OwnRun
from rope_twin.studies.viv.picture import ABOVE, write_table
from rope_twin.studies.viv.study import where_it_moves

PERIODS = 12  # of the motion that the space-time picture shows, the last ones
SETTLED = 0.1  # of the rms, by which it may be another in the second half of the time that counts
COLUMNS = 60  # places in the table of the motion
BELOW = "along the rope, + up from the hang-off [m]"


def write_own(run: OwnRun, folder: Path) -> list[Path]:
    """Write `own_along.png`, `own_motion.png` and two Parquet tables; return their paths.

    Raises:
        InputError: matplotlib or pyarrow is not there, or the folder cannot be written.
    """
    pictures = {"own_along.png": _along(run), "own_motion.png": _in_time(run)}
    for name, panels in pictures.items():
        draw_panels(f"{run.scene}: {run.model}", panels, folder / name)
    own_tables = {"own_along.parquet": _along_table(run), "own_motion.parquet": _motion_table(run)}
    for name, columns in own_tables.items():
        write_table(folder / name, columns)
    return [folder / name for name in (*pictures, *own_tables)]


def own_figures(run: OwnRun) -> dict[str, Any]:
    """Return the results as numbers by name."""
    across, with_flow = run.rms
    at = int(across.argmax())
    known = run.fatigue is not None
    return {
        "model": run.model,
        "steady_s": float(len(run.time_s) * run.every_s),
        "vortices_hz": run.vortices_hz,
        "rms_max_diameters": float(across[at]),
        "rms_max_at_m": float(run.from_hang_off_m[at]),
        "frequency_there_hz": float(run.frequency_hz[0, at]),
        "in_line_rms_max_diameters": float(with_flow.max()) if run.in_line else None,
        "rms_second_over_first_half": run.growth if math.isfinite(run.growth) else None,
        "drag_amplification_max": float(run.drag_amplification.max()),
        "drag_amplification_mean": float(run.drag_amplification.mean()),
        "drag_amplification_vandiver_max": float(run.vandiver.max()),
        "tension_top_min_n": float(run.tension_top_n.min()),
        "tension_top_max_n": float(run.tension_top_n.max()),
        "stress_rms_max_pa": float(run.stress_rms_pa.max()) if known else None,
        "damage_per_year_max": float(run.damage_per_year.max()) if known else None,
    }


def own_words(run: OwnRun) -> str:
    """Return the results as text."""
    told = own_figures(run)
    in_line = "none in its model"
    if run.in_line:
        in_line = f"{told['in_line_rms_max_diameters']:.3g}"
    cause = "relative velocity makes of it" if run.in_line else "growth of the drag makes of it"
    words = (
        f"{run.model}, the last {told['steady_s']:.4g} s: largest rms A/d "
        f"{told['rms_max_diameters']:.3g} at {told['rms_max_at_m']:.4g} m below the hang-off, "
        f"{told['frequency_there_hz']:.3g} Hz; in line {in_line}\n"
        f"{_unsettled(run.growth)}"
        "(published VIV codes differ among each other by a factor of 1.7)\n"
        f"mean drag {told['drag_amplification_max']:.3g} times that without vibration at most, "
        f"{told['drag_amplification_mean']:.3g} in the mean: what the model's {cause} "
        "(Vandiver 1983 of such a motion: "
        f"{told['drag_amplification_vandiver_max']:.3g})"
    )
    if run.fatigue is None:
        return (
            f"{words}\nno stress: neither a rope all of steel nor a pipe, with its bending listed"
        )
    return (
        f"{words}\nbending stress at most {1e-6 * told['stress_rms_max_pa']:.3g} MPa rms, damage "
        f"of tension and bending {told['damage_per_year_max']:.3g} per year; of a stranded rope as "
        "if it were solid: an upper bound"
    )


def _unsettled(growth: float) -> str:
    """Return a line if the motion differs between both halves of its time; else nothing."""
    if abs(growth - 1.0) <= SETTLED:
        return ""
    return (
        "not settled: its rms along the rope in the second half of that time is "
        f"{growth:.2g} times that in the first; give a longer --duration\n"
    )


def _along(run: OwnRun) -> list[Panel]:
    depth = -run.from_hang_off_m

    def panel(title: str, x: str, *lines: tuple[Floats, str]) -> Panel:
        return Panel(title, x, BELOW, tuple(Line(values, depth, label) for values, label in lines))

    sides = ("across the flow", "in line") if run.in_line else ("across the flow",)
    moving_hz = [where_it_moves(*own) for own in zip(run.frequency_hz, run.rms, strict=True)]
    worn = run.damage_per_year > 0.0
    damage = np.log10(run.damage_per_year, out=np.full(len(worn), np.nan), where=worn)
    return [
        panel("rms of the motion", "rms/d", *zip(run.rms, sides, strict=False)),
        panel("mean frequency", "[Hz]", *zip(moving_hz, sides, strict=False)),
        panel("drag amplification", "", (run.drag_amplification, "of the run"),
              (run.vandiver, "Vandiver 1983 of this motion")),
        panel("bending stress, rms", "[MPa]", (1e-6 * run.stress_rms_pa, "")),
        panel("damage of tension and bending", "log10 of damage per year", (damage, "")),
    ]  # fmt: skip


def _in_time(run: OwnRun) -> list[Panel]:
    depth = (-float(run.from_hang_off_m[-1]), 0.0)
    mean_hz = max(float(run.frequency_hz[0].max()), 1e-9)
    samples = 1.0 / mean_hz / run.every_s  # a period
    shown = slice(-min(max(8, round(PERIODS * samples)), len(run.time_s)), None)
    times = (float(run.time_s[shown][0]), float(run.time_s[shown][-1]))
    frequency, power = run.spectra()
    some = frequency < ABOVE * mean_hz
    level = np.log10(np.maximum(power[some], 1e-6 * power.max()))
    with_flow = Panel("in line with it", "time [s]", BELOW,
                      field=Field(run.motion[1, shown].T[::-1], times, depth, "x/d"))  # fmt: skip
    return [
        Panel("across the flow, last periods", "time [s]", BELOW,
              field=Field(run.motion[0, shown].T[::-1], times, depth, "y/d")),
        *([with_flow] if run.in_line else []),
        Panel("spectra across the flow", "[Hz]", BELOW,
              field=Field(level.T[::-1], (0.0, float(frequency[some][-1])), depth,
                          "log10 of power [d²/Hz]")),
        Panel("top tension", "time [s]", "[kN]",
              (Line(run.time_s[shown], 1e-3 * run.tension_top_n[shown]),)),
    ]  # fmt: skip


def _along_table(run: OwnRun) -> dict[str, Any]:
    return {
        "from_hang_off_m": run.from_hang_off_m,
        "rms_diameters": run.rms[0],
        "frequency_hz": run.frequency_hz[0],
        "in_line_rms_diameters": run.rms[1],
        "in_line_frequency_hz": run.frequency_hz[1],
        "drag_amplification": run.drag_amplification,
        "drag_amplification_vandiver": run.vandiver,
        "stress_rms_pa": run.stress_rms_pa,
        "damage_per_year": run.damage_per_year,
    }


def _motion_table(run: OwnRun) -> dict[str, Any]:
    columns: dict[str, Any] = {"time_s": run.time_s, "tension_top_n": run.tension_top_n}
    places = np.unique(np.linspace(0, len(run.from_hang_off_m) - 1, COLUMNS).round()).astype(int)
    for place in places:
        at = f"{run.from_hang_off_m[place]:.2f}_m"
        columns[f"y_over_d_at_{at}"] = run.motion[0, :, place]
        if run.in_line:
            columns[f"x_over_d_at_{at}"] = run.motion[1, :, place]
    return columns

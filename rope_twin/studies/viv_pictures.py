"""Pictures and tables of VIV assessments, in one folder, and of modes (matplotlib, pyarrow)."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np

from rope_twin.core.state import Floats
from rope_twin.errors import InputError
from rope_twin.studies.modes import TURNING, UNHELD, Mode, Modes, SystemMode, SystemModes
from rope_twin.studies.picture import (
    Field,
    Line,
    Panel,
    check_picture,
    draw_panels,
    new_figure,
    write_picture,
)
from rope_twin.studies.viv_frequency_domain import (
    Fatigue,
    FrequencyDomainRun,
    chosen_places,
    most_moved,
    where_it_moves,
)
from rope_twin.studies.viv_time_domain import WINDOW_S, TimeDomainRun

SHAPES = 8  # modes drawn, those that move most
PERIODS = 12  # of the motion that the space-time picture shows
ABOVE = 3.0  # times the mean frequency: so far spectra are drawn
SETTLED = 0.1  # relative difference of the rms between both halves of a settled run
COLUMNS = 60  # places in the table of the motion
BELOW = "along the rope, + up from the hang-off [m]"
SCATTER = "published VIV codes differ by a factor of 1.7"
_ROPES = ("#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00", "#56b4e9", "#555555")
_COLOURS = {"axial": "#d55e00", "in-plane": "#0072b2", "out-of-plane": "#009e73",
            TURNING: "#cc79a7"}  # fmt: skip


def check_folder(folder: Path) -> None:
    """Make the folder, and check that pictures and tables can be written.

    Raises:
        InputError: it cannot be made, or matplotlib or pyarrow is not there.
    """
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        problem = str(error.strerror)
        raise InputError(str(folder), problem, "give a place that can be written") from error
    check_picture(folder / "motion.png")
    try:
        import pyarrow.parquet  # noqa: F401
    except ImportError as error:
        remedy = "install it: pip install 'rope_twin[plot]'"
        raise InputError("tables", "pyarrow is not there", remedy) from error


def write_all(name: str, run: FrequencyDomainRun, fatigue: Fatigue, folder: Path) -> list[Path]:
    """Write all pictures and tables; return their paths."""
    pictures = [
        _figure(folder / "current.png", f"{name}: what the current can drive", _current, run),
        _figure(folder / "modes.png", f"{name}: modes that move most", _shapes, run),
        _figure(
            folder / "along.png", f"{name}: response along the rope ({SCATTER})",
            lambda figure, data: _along(figure, data, fatigue), run,
        ),
        _figure(folder / "motion.png", f"{name}: motion of the last periods", _motion, run),
        _figure(folder / "spectra.png", f"{name}: spectra along the rope", _spectra, run),
    ]  # fmt: skip
    return [*pictures, *_tables(run, fatigue, folder)]


def _figure(path: Path, title: str, draw: Any, run: FrequencyDomainRun) -> Path:
    figure = new_figure(11.0, 5.5)
    draw(figure, run)
    figure.suptitle(title)
    write_picture(figure, path, 100)
    return path


def _panels(figure: Any, count: int) -> Any:
    """Return panels side by side over the same length of rope, hang-off on top."""
    axes = np.atleast_1d(figure.subplots(1, count, sharey=True))
    axes[0].set_ylabel("rope below the hang-off [m]")
    axes[0].invert_yaxis()
    for panel in axes:
        panel.grid(True, linewidth=0.3)
    return axes


def _current(figure: Any, run: FrequencyDomainRun) -> None:
    speed, strouhal, zones = _panels(figure, 3)
    span, water = run.response.span, run.response.shedding
    speed.plot(span.speed, run.from_top_m)
    speed.set_xlabel("current across the rope [m/s]")
    strouhal.plot(water.strouhal * span.speed / span.diameter, run.from_top_m)
    strouhal.set_xlabel(f"Strouhal frequency, {water.strouhal:g}·U/d [Hz]")
    for frequency, zone in zip(run.response.frequency, run.response.zones.T, strict=True):
        if zone.any():
            zones.plot(np.where(zone, frequency, np.nan), run.from_top_m, linewidth=2.5)
    zones.set_xlabel("mode that each place drives [Hz]")


def _shapes(figure: Any, run: FrequencyDomainRun) -> None:
    largest = most_moved(run, SHAPES)
    axes = _panels(figure, max(len(largest), 1))
    for panel, mode in zip(axes, largest, strict=False):
        panel.plot(run.response.modes.shape[:, mode], run.from_top_m, linewidth=0.9)
        frequency, rms = run.response.frequency[mode], run.modal_rms[mode]
        panel.set_title(f"{mode + 1}: {frequency:.3g} Hz\nrms {rms:.2g} d", fontsize=8)
        panel.set_xticks([])


def _along(figure: Any, run: FrequencyDomainRun, fatigue: Fatigue) -> None:
    axes = _panels(figure, 5)
    rows = (
        (run.rms(), run.from_top_m, "rms A/d"),
        (where_it_moves(run.frequency_hz(), run.rms()), run.from_top_m, "mean frequency [Hz]"),
        (run.drag_amplification(), run.from_top_m, "drag amplification"),
        (1e-6 * fatigue.stress_rms_pa, fatigue.from_top_m, "bending stress, rms [MPa]"),
        (fatigue.damage_per_year, fatigue.from_top_m, "damage per year"),
    )
    for panel, (values, depth_m, label) in zip(axes, rows, strict=True):
        panel.plot(values, depth_m, linewidth=0.9)
        panel.set_xlabel(label)
    if np.nanmax(fatigue.damage_per_year, initial=0.0) > 0.0:
        axes[-1].set_xscale("log")


def _motion(figure: Any, run: FrequencyDomainRun) -> None:
    nodes = chosen_places(run, 600)
    frequency = run.frequency_hz().max(initial=0.0)
    step = float(run.time_s[1] - run.time_s[0])
    motion = run.motion(nodes)
    if frequency > 0.0:
        motion = motion[-max(8, int(PERIODS / frequency / step)) :]
    last, largest = run.time_s[-1], float(np.abs(motion).max(initial=1e-9))
    colours = {"cmap": "RdBu_r", "vmin": -largest, "vmax": largest}
    ends = last - step * len(motion), last
    _map(figure, motion, ends, run.from_top_m[nodes.astype(int)], "time [s]", "y/d", **colours)


def _spectra(figure: Any, run: FrequencyDomainRun) -> None:
    nodes = chosen_places(run)
    frequency, power = run.spectra(nodes)
    if (mean_hz := float(run.frequency_hz().max(initial=0.0))) > 0.0:
        is_shown = frequency < ABOVE * mean_hz
        frequency, power = frequency[is_shown], power[is_shown]
    level = np.log10(np.maximum(power, 1e-6 * float(power.max(initial=1e-30))))
    ends, top = (float(frequency[0]), float(frequency[-1])), run.from_top_m[nodes.astype(int)]
    _map(figure, level, ends, top, "frequency [Hz]", "log10 of power [d²/Hz]")


def _map(
    figure: Any, values: Any, ends: tuple[float, float], top: Floats, x: str, label: str,
    **colours: Any,
) -> None:  # fmt: skip
    """Draw values (along x, places) in colours; ends: of the axis x; top: of the places [m]."""
    axes = figure.subplots()
    extent = (*ends, float(top[0]), float(top[-1]))
    image = axes.imshow(values.T[::-1], aspect="auto", extent=extent, **colours)
    figure.colorbar(image, ax=axes, label=label)
    axes.set_xlabel(x)
    axes.set_ylabel("rope below the hang-off [m]")


def _tables(run: FrequencyDomainRun, fatigue: Fatigue, folder: Path) -> list[Path]:
    """Return the results along the rope, of the modes, and the motion over time at some places."""
    span, water = run.response.span, run.response.shedding
    profile = {
        "from_hang_off_m": run.from_top_m,
        "speed_across_m_per_s": span.speed,
        "strouhal_hz": water.strouhal * span.speed / span.diameter,
        "driven_hz": _driven_hz(run),
        "rms_diameters": run.rms(),
        "frequency_hz": run.frequency_hz(),
        "drag_amplification": run.drag_amplification(),
        "strain_rms": _to_all(run, fatigue, fatigue.strain_rms),
        "stress_rms_pa": _to_all(run, fatigue, fatigue.stress_rms_pa),
        "damage_per_year": _to_all(run, fatigue, fatigue.damage_per_year),
    }
    modes = {
        "mode": np.arange(1, len(run.response.frequency) + 1),
        "frequency_hz": run.response.frequency,
        "modal_mass_kg": run.response.modes.mass,
        "driven_m": run.response.zones.T @ span.node_length,
        "rms_diameters": run.modal_rms,
    }
    nodes = chosen_places(run, 60)
    motion = {"time_s": run.time_s[run.first :]}
    for number, column in zip(nodes.astype(int), run.motion(nodes).T, strict=True):
        motion[f"y_over_d_at_{run.from_top_m[number]:.2f}_m"] = column
    return [
        write_table(folder / f"{name}.parquet", columns)
        for name, columns in (("along", profile), ("modes", modes), ("motion", motion))
    ]


def _to_all(run: FrequencyDomainRun, fatigue: Fatigue, values: Any) -> Any:
    return np.interp(run.from_top_m, fatigue.from_top_m[::-1], values[::-1])


def write_table(path: Path, columns: dict[str, Any]) -> Path:
    """Write one Parquet file. Raises InputError: it cannot be written."""
    import pyarrow
    import pyarrow.parquet

    try:
        pyarrow.parquet.write_table(pyarrow.table(columns), path)
    except OSError as error:
        raise InputError(str(path), str(error), "give a place that can be written") from error
    return path


def _driven_hz(run: FrequencyDomainRun) -> Any:
    """Return the frequency of the mode with most power-in at a place; 0: none."""
    zones = run.response.zones
    if not zones.size:
        return np.zeros(len(zones))
    driven_hz = run.response.frequency[zones.argmax(axis=1)]
    return np.where(zones.any(axis=1), driven_hz, 0.0)


def write_time_domain(run: TimeDomainRun, folder: Path) -> list[Path]:
    """Write `time_along.png`, `time_motion.png` and two Parquet tables; return their paths.

    Raises:
        InputError: matplotlib or pyarrow is not there, or the folder cannot be written.
    """
    pictures = {"time_along.png": _panels_along(run), "time_motion.png": _panels_in_time(run)}
    for name, panels in pictures.items():
        draw_panels(f"{run.scene}, {run.line}: {run.model}", panels, folder / name)
    tables = {"time_along.parquet": _along_table(run), "time_motion.parquet": _motion_table(run)}
    for name, columns in tables.items():
        write_table(folder / name, columns)
    return [folder / name for name in (*pictures, *tables)]


def time_domain_figures(run: TimeDomainRun) -> dict[str, Any]:
    """Return the results as numbers by name."""
    across, with_flow = run.rms
    largest = int(across.argmax())
    known, spectrum = run.fatigue is not None, run.spectrum
    return {
        "model": run.model,
        "steady_s": float(len(run.time_s) * run.every_s),
        "vortices_hz": run.vortices_hz,
        "rms_max_diameters": float(across[largest]),
        "rms_max_at_m": float(run.from_hang_off_m[largest]),
        "rms_mean_diameters": float(across.mean()),
        "frequency_there_hz": float(run.frequency_hz[0, largest]),
        "spectrum_centre_hz": spectrum.centre_hz,
        "spectrum_bandwidth_hz": spectrum.bandwidth_hz,
        "modulation": run.modulation,
        "in_line_rms_max_diameters": float(with_flow.max()) if run.in_line else None,
        **growth_figure(run.growth),
        "drag_amplification_max": float(run.drag_amplification.max()),
        "drag_amplification_mean": float(run.drag_amplification.mean()),
        "drag_amplification_vandiver_max": float(run.vandiver.max()),
        "tension_top_mean_n": float(run.tension_top_n.mean()),
        "tension_top_min_n": float(run.tension_top_n.min()),
        "tension_top_max_n": float(run.tension_top_n.max()),
        "strain_rms_max": float(run.strain_rms.max()),
        "stress_rms_max_pa": float(run.stress_rms_pa.max()) if known else None,
        "damage_per_year_max": float(run.damage_per_year.max()) if known else None,
    }


def time_domain_words(run: TimeDomainRun) -> str:
    """Return the results as text."""
    figures = time_domain_figures(run)
    in_line = "not in the model"
    if run.in_line:
        in_line = f"{figures['in_line_rms_max_diameters']:.3g}"
    cause = "relative velocity" if run.in_line else "drag amplification"
    text = (
        f"{run.model}, last {figures['steady_s']:.4g} s: maximum rms A/D "
        f"{figures['rms_max_diameters']:.3g} at {figures['rms_max_at_m']:.4g} m below the "
        f"hang-off, {figures['frequency_there_hz']:.3g} Hz; in line {in_line}\n"
        f"mean rms A/D {figures['rms_mean_diameters']:.3g}; spectrum about "
        f"{figures['spectrum_centre_hz']:.3g} Hz, bandwidth "
        f"{figures['spectrum_bandwidth_hz']:.2g} Hz; modulation {figures['modulation']:.0%}\n"
        f"{unsettled_words(run.growth)}"
        f"(published VIV codes differ from each other by a factor of 1.7)\n"
        f"top tension {1e-3 * figures['tension_top_min_n']:.4g} to "
        f"{1e-3 * figures['tension_top_max_n']:.4g} kN, "
        f"mean {1e-3 * figures['tension_top_mean_n']:.4g}\n"
        f"drag amplification at most {figures['drag_amplification_max']:.3g}, mean "
        f"{figures['drag_amplification_mean']:.3g}, by the model's {cause} "
        f"(Vandiver 1983 for this motion: {figures['drag_amplification_vandiver_max']:.3g})\n"
        f"{strain_words(figures['strain_rms_max'])}"
    )
    if run.fatigue is None:
        return (
            f"{text}\nno bending stress: that needs steel rope or a pipe, with `bending` in the "
            "scene"
        )
    return (
        f"{text}\nbending stress at most {1e-6 * figures['stress_rms_max_pa']:.3g} MPa rms, Miner "
        f"damage of tension and bending {figures['damage_per_year_max']:.3g} per year; a stranded "
        "rope counts as solid: an upper bound"
    )


def strain_words(strain_rms_max: float) -> str:
    """Return the bending strain in words."""
    strain = 1e6 * strain_rms_max
    return f"bending strain at most {strain:.3g} µm/m rms, of a section that stays plane"


def growth_figure(growth: float) -> dict[str, float | None]:
    """Return the ratio of the rms of both halves under its key of `--json`."""
    return {"rms_second_over_first_half": growth if math.isfinite(growth) else None}


def unsettled_words(growth: float | None) -> str:
    """Return a line if the motion differs between both halves of its time; None: no motion."""
    if growth is None or abs(growth - 1.0) <= SETTLED:
        return ""
    return (
        "not settled: the rms of the second half of the time that counts is "
        f"{growth:.2g} times that of the first; give a longer --duration\n"
    )


def _panels_along(run: TimeDomainRun) -> list[Panel]:
    depth = -run.from_hang_off_m

    def panel(title: str, x: str, *lines: tuple[Floats, str]) -> Panel:
        return Panel(title, x, BELOW, tuple(Line(values, depth, label) for values, label in lines))

    sides = ("across the flow", "in line") if run.in_line else ("across the flow",)
    moving_hz = [where_it_moves(*pair) for pair in zip(run.frequency_hz, run.rms, strict=True)]
    damaged = run.damage_per_year > 0.0
    damage = np.log10(run.damage_per_year, out=np.full(len(damaged), np.nan), where=damaged)
    return [
        panel("rms of the motion", "rms/d", *zip(run.rms, sides, strict=False)),
        panel("mean frequency", "[Hz]", *zip(moving_hz, sides, strict=False)),
        panel("drag amplification", "", (run.drag_amplification, "of the run"),
              (run.vandiver, "Vandiver 1983 of this motion")),
        panel("bending stress, rms", "[MPa]", (1e-6 * run.stress_rms_pa, "")),
        panel("damage of tension and bending", "log10 of damage per year", (damage, "")),
    ]  # fmt: skip


def _panels_in_time(run: TimeDomainRun) -> list[Panel]:
    depth = (-float(run.from_hang_off_m[-1]), 0.0)
    mean_hz = max(float(run.frequency_hz[0].max()), 1e-9)
    samples = 1.0 / mean_hz / run.every_s  # a period
    shown = slice(-min(max(8, round(PERIODS * samples)), len(run.time_s)), None)
    times = (float(run.time_s[shown][0]), float(run.time_s[shown][-1]))
    frequency, power = run.spectra()
    is_shown = frequency < ABOVE * mean_hz
    level = np.log10(np.maximum(power[is_shown], 1e-6 * power.max()))
    with_flow = Panel("in line with it", "time [s]", BELOW,
                      field=Field(run.motion[1, shown].T[::-1], times, depth, "x/d"))  # fmt: skip
    return [
        Panel("across the flow, last periods", "time [s]", BELOW,
              field=Field(run.motion[0, shown].T[::-1], times, depth, "y/d")),
        *([with_flow] if run.in_line else []),
        Panel("spectra across the flow", "[Hz]", BELOW,
              field=Field(level.T[::-1], (0.0, float(frequency[is_shown][-1])), depth,
                          "log10 of power [d²/Hz]")),
        Panel(f"rms over {WINDOW_S:g} s, all places", "time [s]", "rms/d", (Line(*run.size),)),
        Panel("top tension", "time [s]", "[kN]",
              (Line(run.time_s[shown], 1e-3 * run.tension_top_n[shown]),)),
    ]  # fmt: skip


def _along_table(run: TimeDomainRun) -> dict[str, Any]:
    return {
        "from_hang_off_m": run.from_hang_off_m,
        "rms_diameters": run.rms[0],
        "frequency_hz": run.frequency_hz[0],
        "in_line_rms_diameters": run.rms[1],
        "in_line_frequency_hz": run.frequency_hz[1],
        "drag_amplification": run.drag_amplification,
        "drag_amplification_vandiver": run.vandiver,
        "strain_rms": run.strain_rms,
        "stress_rms_pa": run.stress_rms_pa,
        "damage_per_year": run.damage_per_year,
    }


def _motion_table(run: TimeDomainRun) -> dict[str, Any]:
    columns: dict[str, Any] = {"time_s": run.time_s, "tension_top_n": run.tension_top_n}
    nodes = np.unique(np.linspace(0, len(run.from_hang_off_m) - 1, COLUMNS).round()).astype(int)
    for node in nodes:
        label = f"{run.from_hang_off_m[node]:.2f}_m"
        columns[f"y_over_d_at_{label}"] = run.motion[0, :, node]
        if run.in_line:
            columns[f"x_over_d_at_{label}"] = run.motion[1, :, node]
    return columns


def _mode_panels(count: int, panel_width: float) -> tuple[Any, Any]:
    """Return a figure and its panels side by side, so many inches wide each."""
    figure = new_figure(panel_width * count + 1.0, 5.0)
    return figure, np.atleast_1d(figure.subplots(1, count, sharey=True))


def draw_modes(scene: str, result: Modes | SystemModes, path: Path) -> None:
    """Draw a panel per mode: amplitude along the rope, signed by its main direction.

    Of a multi-line system the ropes at rest in side view, and displaced by the mode.

    Raises:
        InputError: matplotlib is not there, or the picture cannot be written.
    """
    check_picture(path)
    figure = _system_figure(result) if isinstance(result, SystemModes) else _rope_figure(result)
    remark = " (grey), motion drawn large" if isinstance(result, SystemModes) else ""
    figure.suptitle(f"{scene}: natural modes about rest{remark}")
    write_picture(figure, path, 110)


def _rope_figure(result: Modes) -> Any:
    modes = [*result.lowest, *result.axial]
    figure, panels = _mode_panels(len(modes), 1.2)
    span = np.linalg.norm(np.diff(result.place, axis=0), axis=1)
    arc_length = np.concatenate([[0.0], np.cumsum(span)])
    for axes, mode in zip(panels, modes, strict=True):
        _draw(axes, mode, arc_length)
    panels[0].set_ylabel("along the rope from the hang-off [m]")
    panels[0].invert_yaxis()
    return figure


def _draw(axes: Any, mode: Mode, arc_length: Any) -> None:
    axis = mode.shape[np.abs(mode.shape).max(axis=1).argmax()]
    sign = np.sign(mode.shape @ axis)
    motion = sign * np.linalg.norm(mode.shape, axis=1)
    axes.plot(motion, arc_length, color=_COLOURS[mode.kind], linewidth=1.2)
    axes.axvline(0.0, color="0.7", linewidth=0.6)
    axes.set_title(f"{mode.kind}\n{mode.period_s:.3g} s", fontsize=8)
    axes.set_xlim(-1.1, 1.1)
    axes.set_xticks([])


def _system_figure(result: SystemModes) -> Any:
    modes = [*result.lowest, *result.stretching]
    figure, panels = _mode_panels(len(modes), 1.5)
    positions = [line.place[:, ::-1].T for line in result.still.lines]
    corners = np.concatenate(positions)
    size = float(np.ptp(corners, axis=0).max())
    for axes, mode in zip(panels, modes, strict=True):
        _draw_system(axes, mode, positions, size)
    panels[0].set_ylabel("z [m]")
    names = [line.name for line in result.still.lines]
    panels[-1].legend(names, fontsize=6, loc="lower right")
    return figure


def _draw_system(axes: Any, mode: SystemMode, positions: list[Floats], size: float) -> None:
    """Draw a system along x or y, whichever shows more of the motion."""
    motion = np.concatenate(mode.shapes)
    side = int((motion[:, :2] ** 2).sum(axis=0).argmax())
    for k, (position, shape) in enumerate(zip(positions, mode.shapes, strict=True)):
        displaced = position + 0.08 * size * shape
        axes.plot(displaced[:, side], displaced[:, 2], color=_ROPES[k % len(_ROPES)], linewidth=1.2)
    for position in positions:
        axes.plot(position[:, side], position[:, 2], color="0.75", linewidth=0.6, zorder=0)
    at_rest = np.concatenate(positions)[:, side]
    middle, reach = 0.5 * (at_rest.min() + at_rest.max()), 0.5 * np.ptp(at_rest) + 0.1 * size
    axes.set_xlim(middle - reach, middle + reach)
    period = f"{mode.period_s:.3g} s" if mode.kind != UNHELD else "no period"
    axes.set_title(f"{mode.kind}\n{period}", fontsize=8)
    axes.set_xlabel("xy"[side] + " [m]", fontsize=7)
    axes.tick_params(labelsize=6)

"""Pictures and tables of a VIV assessment, in one folder (matplotlib, pyarrow)."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from rope_twin.errors import InputError, phrase
from rope_twin.studies.picture import check_picture, write_picture
from rope_twin.studies.viv.study import (
    Fatigue,
    VivRun,
    chosen_places,
    most_moved,
    where_it_moves,
)

SHAPES = 8  # modes drawn, those that move most
PERIODS = 12  # of the motion that the space-time picture shows
ABOVE = 3.0  # times the mean frequency: so far spectra are drawn
SCATTER = "published VIV codes differ by a factor of 1.7"


def check_folder(folder: Path) -> None:
    """Make it, and see that pictures and tables can be made at all.

    Raises:
        InputError: it cannot be made, or matplotlib or pyarrow is not there.
    """
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        what = str(error.strerror)
        raise InputError(phrase(str(folder), what, "give a place that can be written")) from error
    check_picture(folder / "motion.png")
    try:
        import pyarrow.parquet  # noqa: F401
    except ImportError as error:
        right = "install it: pip install 'rope_twin[plot]'"
        raise InputError(phrase("tables", "pyarrow is not there", right)) from error


def write_all(name: str, run: VivRun, fatigue: Fatigue, folder: Path) -> list[Path]:
    """Write all pictures and tables; return their paths."""
    drawn = [
        _figure(folder / "current.png", f"{name}: what the current can drive", _current, run),
        _figure(folder / "modes.png", f"{name}: modes that move most", _shapes, run),
        _figure(
            folder / "along.png", f"{name}: response along the rope ({SCATTER})",
            lambda figure, own: _along(figure, own, fatigue), run,
        ),
        _figure(folder / "motion.png", f"{name}: motion of the last periods", _motion, run),
        _figure(folder / "spectra.png", f"{name}: spectra along the rope", _spectra, run),
    ]  # fmt: skip
    return [*drawn, *_tables(run, fatigue, folder)]


def _figure(path: Path, title: str, draw: Any, run: VivRun) -> Path:
    from matplotlib.figure import Figure

    figure = Figure(figsize=(11.0, 5.5), layout="constrained")
    draw(figure, run)
    figure.suptitle(title)
    write_picture(figure, path, 100)
    return path


def _panels(figure: Any, count: int) -> Any:
    """Return panels side by side over the same length of rope, hang-off on top."""
    axes = np.atleast_1d(figure.subplots(1, count, sharey=True))
    axes[0].set_ylabel("rope below the hang-off [m]")
    axes[0].invert_yaxis()
    for own in axes:
        own.grid(True, linewidth=0.3)
    return axes


def _current(figure: Any, run: VivRun) -> None:
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


def _shapes(figure: Any, run: VivRun) -> None:
    most = most_moved(run, SHAPES)
    axes = _panels(figure, max(len(most), 1))
    for own, mode in zip(axes, most, strict=False):
        own.plot(run.response.modes.shape[:, mode], run.from_top_m, linewidth=0.9)
        frequency, rms = run.response.frequency[mode], run.modal_rms[mode]
        own.set_title(f"{mode + 1}: {frequency:.3g} Hz\nrms {rms:.2g} d", fontsize=8)
        own.set_xticks([])


def _along(figure: Any, run: VivRun, fatigue: Fatigue) -> None:
    axes = _panels(figure, 5)
    rows = (
        (run.rms(), run.from_top_m, "rms A/d"),
        (where_it_moves(run.frequency_hz(), run.rms()), run.from_top_m, "mean frequency [Hz]"),
        (run.drag_amplification(), run.from_top_m, "drag amplification"),
        (1e-6 * fatigue.stress_rms_pa, fatigue.from_top_m, "bending stress, rms [MPa]"),
        (fatigue.damage_per_year, fatigue.from_top_m, "damage per year"),
    )
    for own, (values, at, label) in zip(axes, rows, strict=True):
        own.plot(values, at, linewidth=0.9)
        own.set_xlabel(label)
    if np.nanmax(fatigue.damage_per_year, initial=0.0) > 0.0:
        axes[-1].set_xscale("log")


def _motion(figure: Any, run: VivRun) -> None:
    places = chosen_places(run, 600)
    frequency = run.frequency_hz().max(initial=0.0)
    step = float(run.time_s[1] - run.time_s[0])
    shown = run.motion(places)
    if frequency > 0.0:
        shown = shown[-max(8, int(PERIODS / frequency / step)) :]
    axes = figure.subplots()
    last, top = run.time_s[-1], run.from_top_m[places.astype(int)]
    largest = float(np.abs(shown).max(initial=1e-9))
    image = axes.imshow(
        shown.T[::-1], aspect="auto", cmap="RdBu_r", vmin=-largest, vmax=largest,
        extent=(last - step * len(shown), last, float(top[0]), float(top[-1])),
    )  # fmt: skip
    figure.colorbar(image, ax=axes, label="y/d")
    axes.set_xlabel("time [s]")
    axes.set_ylabel("rope below the hang-off [m]")


def _spectra(figure: Any, run: VivRun) -> None:
    places = chosen_places(run)
    frequency, power = run.spectra(places)
    if (mean_hz := float(run.frequency_hz().max(initial=0.0))) > 0.0:
        some = frequency < ABOVE * mean_hz
        frequency, power = frequency[some], power[some]
    axes = figure.subplots()
    top = run.from_top_m[places.astype(int)]
    floor = 1e-6 * float(power.max(initial=1e-30))
    image = axes.imshow(
        np.log10(np.maximum(power.T[::-1], floor)), aspect="auto",
        extent=(float(frequency[0]), float(frequency[-1]), float(top[0]), float(top[-1])),
    )  # fmt: skip
    figure.colorbar(image, ax=axes, label="log10 of power [d²/Hz]")
    axes.set_xlabel("frequency [Hz]")
    axes.set_ylabel("rope below the hang-off [m]")


def _tables(run: VivRun, fatigue: Fatigue, folder: Path) -> list[Path]:
    """Return the results along the rope, of the modes, and the motion over time at some places."""
    span, water = run.response.span, run.response.shedding
    along = {
        "from_hang_off_m": run.from_top_m,
        "speed_across_m_per_s": span.speed,
        "strouhal_hz": water.strouhal * span.speed / span.diameter,
        "driven_hz": _driven_hz(run),
        "rms_diameters": run.rms(),
        "frequency_hz": run.frequency_hz(),
        "drag_amplification": run.drag_amplification(),
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
    places = chosen_places(run, 60)
    motion = {"time_s": run.time_s[run.first :]}
    for number, column in zip(places.astype(int), run.motion(places).T, strict=True):
        motion[f"y_over_d_at_{run.from_top_m[number]:.2f}_m"] = column
    return [
        write_table(folder / f"{name}.parquet", columns)
        for name, columns in (("along", along), ("modes", modes), ("motion", motion))
    ]


def _to_all(run: VivRun, fatigue: Fatigue, values: Any) -> Any:
    return np.interp(run.from_top_m, fatigue.from_top_m[::-1], values[::-1])


def write_table(path: Path, columns: dict[str, Any]) -> Path:
    """Write one Parquet file.

    Raises:
        InputError: it cannot be written.
    """
    import pyarrow
    import pyarrow.parquet

    try:
        pyarrow.parquet.write_table(pyarrow.table(columns), path)
    except OSError as error:
        right = "give a place that can be written"
        raise InputError(phrase(str(path), str(error), right)) from error
    return path


def _driven_hz(run: VivRun) -> Any:
    """Return the frequency of the mode with most power-in at a place; 0: none."""
    zones = run.response.zones
    if not zones.size:
        return np.zeros(len(zones))
    most = run.response.frequency[zones.argmax(axis=1)]
    return np.where(zones.any(axis=1), most, 0.0)

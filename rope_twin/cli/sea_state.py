"""`rope_twin sea-state`: create a bag of heave from a wave spectrum, or describe one."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rope_twin.cli import Command, ExitCode, print_json
from rope_twin.errors import InputError
from rope_twin.quantity import read_quantity
from rope_twin.recording.bag import BagReader, find_bag
from rope_twin.recording.heave import (
    HeaveRecord,
    HeaveReplay,
    PoseRecord,
    read_heave,
    read_poses,
    write_sea_bag,
)
from rope_twin.run.options import add_command, add_duration, add_json, add_out, measure
from rope_twin.scene.schema import RecordedPoses
from rope_twin.sea.ship_motion import BoxHull
from rope_twin.sea.spectrum import (
    WaveSpectrum,
    band_spectrum,
    breaking_fault,
    jonswap,
    read_spectrum,
    steepness_warning,
)
from rope_twin.twin.motion.ship_motion import synthesise

_UNITS = (
    ("_m_per_s", " m/s", ".2f"),
    ("_deg", "°", ".2f"),
    ("_hz", " Hz", "g"),
    ("_s", " s", ".1f"),
    ("_m", " m", ".2f"),
)
_SYMBOLS = {"hs": "Hs", "tp": "Tp", "std": "standard deviation"}
ELEVATION_HZ = 4.0
EXAMPLES = (
    "sea-state make --jonswap 2.5m 9s --seed 1 --out my_sea",
    "sea-state make --jonswap 4 11 2 --seed 7 --duration 20min --rate 10Hz --out sea_4m",
    "sea-state info sea_2p5m",
)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the command with its two actions."""
    actions = parser.add_subparsers(dest="action", required=True, metavar="ACTION")
    _add_make(actions)
    info = add_command(
        actions,
        "info",
        "describe a bag: heights, periods, rates and origin",
        ("sea-state info sea_2p5m", "sea-state info lift --motion poses"),
    )
    info.add_argument("bag", metavar="BAG", help="a name in bags/ or a path")
    info.add_argument(
        "--topic", metavar="NAME", help="the Odometry topic (default: ship/heave, or the only one)"
    )
    info.add_argument("--motion", choices=("heave", "poses"), default="heave",
                      help="what to describe (default: heave)")  # fmt: skip
    add_json(info)


def run(args: argparse.Namespace) -> int:
    """Make a bag or describe one; return the exit code. Raises RopeTwinError."""
    return _make(args) if args.action == "make" else _info(args)


def _add_make(actions: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    hull = BoxHull()
    make = add_command(
        actions, "make", "create a bag of ship/heave and sea/elevation from a wave spectrum",
        EXAMPLES[:2],
        "Random phases from the seed, heave by the closed-form response of a box-shaped hull "
        "(Jensen, Mansour, Olsen 2004). Equal arguments give equal bytes.",
    )  # fmt: skip
    sea = make.add_mutually_exclusive_group(required=True)
    sea.add_argument("--spectrum", metavar="CSV", help="a name in config/sea_states/ or a file")
    sea.add_argument(
        "--jonswap", nargs="+", metavar=("HS", "TP"),
        help="significant wave height, peak period and, if wanted, peak enhancement factor gamma "
        "(1: Pierson-Moskowitz)",
    )  # fmt: skip
    make.add_argument(
        "--column", metavar="HOUR", help="hour of the measured spectrum, such as 1996-10-16T00Z"
    )
    make.add_argument(
        "--seed", metavar="N", type=int, required=True, help="random seed for wave phases"
    )
    add_out(make, "DIR", "bag directory to create", required=True)
    add_duration(make, "length, after which it repeats", 1200.0)
    rate = measure("Hz")
    make.add_argument(
        "--rate", type=rate, default=20.0, metavar="FREQ",
        help="sampling rate of the heave (default: 20Hz)",
    )  # fmt: skip
    make.add_argument(
        "--elevation-rate", type=rate, metavar="FREQ",
        help="sampling rate of the wave elevation, that of the heave over a whole number "
        f"(default: the lowest of them from {ELEVATION_HZ:g}Hz)",
    )  # fmt: skip
    make.add_argument(
        "--hull", nargs=4, metavar=("LENGTH", "BREADTH", "DRAUGHT", "CB"),
        default=(hull.length_m, hull.breadth_m, hull.draught_m, hull.block_coefficient),
        help="dimensions and block coefficient of the hull (default: 120m 23m 7m 0.7)",
    )  # fmt: skip
    add_json(make)


def _make(args: argparse.Namespace) -> int:
    spectrum = _choose_spectrum(args)
    _check_steepness(args, spectrum)
    *sizes, block = _numbers("--hull", args.hull, ("m", "m", "m", ""))
    length, breadth, draught = sizes
    hull = BoxHull(length_m=length, breadth_m=breadth, draught_m=draught, block_coefficient=block)
    if args.elevation_rate is None:
        args.elevation_rate = args.rate / max(1.0, args.rate // ELEVATION_HZ)
    if args.elevation_rate <= 2.0 * spectrum.frequency_hz[-1]:
        remedy = f"right is above {2.0 * spectrum.frequency_hz[-1]:g} Hz, twice the spectrum's end"
        raise InputError("elevation rate", f"it is {args.elevation_rate:g} Hz", remedy)
    sea = synthesise(spectrum, hull, args.seed, args.duration, args.rate)
    notes = {
        "spectrum": spectrum.source,
        "spectrum_hs_m": f"{spectrum.significant_height_m:.3f}",
        "response": hull.describe(),
        "seed": str(args.seed),
        "loops": f"periodic, {args.duration:g} s",
    }
    write_sea_bag(args.out, sea, args.elevation_rate, notes)
    _report(args.out, _heave_figures(read_heave(args.out)), args.json)
    return ExitCode.OK


def _choose_spectrum(args: argparse.Namespace) -> WaveSpectrum:
    if args.jonswap is not None:
        if args.column is not None or len(args.jonswap) not in (2, 3):
            problem = f"{len(args.jonswap)} numbers" + (" and a column" if args.column else "")
            raise InputError("--jonswap", problem, "right are Hs, Tp and perhaps gamma alone")
        return jonswap(*_numbers("--jonswap", args.jonswap, ("m", "s", "")))
    if args.column is None:
        raise InputError("--column", "it is missing", "name an hour of the spectrum")
    return read_spectrum(args.spectrum, args.column)


def _numbers(option: str, values: Sequence[str | float], units: Sequence[str]) -> list[float]:
    """Return the SI values of several quantities; an empty unit is that of a plain number.

    Raises:
        InputError: one of them is not such a quantity.
    """
    numbers = []
    for word, unit in zip(values, units, strict=False):
        try:
            numbers.append(read_quantity(str(word), unit) if unit else float(word))
        except ValueError as error:
            problem = str(error).partition("; ")[0] if unit else f"'{word}' is not a number"
            remedy = f"give {unit}" if unit else "give a number without unit"
            raise InputError(option, problem, remedy) from error
    return numbers


def _check_steepness(args: argparse.Namespace, spectrum: WaveSpectrum) -> None:
    """Warn about a sea steeper than observed ones. Raises InputError if waves would break."""
    option_values = args.jonswap[:2] if args.jonswap is not None else [args.spectrum]
    option = "--spectrum" if args.jonswap is None else "--jonswap"
    where = " ".join([option, *option_values])
    fault = breaking_fault(spectrum)
    if fault is not None:
        raise InputError(where, *fault)
    if warning := steepness_warning(where, spectrum):
        print(f"warning: {warning}", file=sys.stderr)


def _info(args: argparse.Namespace) -> int:
    path = find_bag(args.bag)
    if args.motion == "poses":
        record = read_poses(path, RecordedPoses(bag=args.bag, topic=args.topic or ""))
        _report(path, _pose_figures(record), args.json)
        return ExitCode.OK
    figures = _heave_figures(read_heave(path, args.topic))
    with BagReader(path) as bag:
        figures |= {"origin": dict(bag.custom_data)}
    _report(path, figures, args.json)
    return ExitCode.OK


def _report(path: Path, figures: dict[str, Any], as_json: bool) -> None:
    """Print the figures of a bag, a line for each."""
    if as_json:
        print_json({"bag": path, **figures})
        return
    content = "poses of the vessel" if figures["motion"] == "poses" else "heave"
    print(f"{path}: {figures['duration_s']:g} s of {content} at {figures['rate_hz']:g} Hz")
    origin = figures.pop("origin", {})
    rows = {key: _words(value) for key, value in figures.items() if isinstance(value, dict)}
    notes = {"note": figures["note"]} if figures["note"] else {}
    for key, text in (rows | notes | origin).items():
        print(f"  {key:<14} {text}")


def _words(figures: dict[str, float]) -> str:
    """Return figures in words; the unit of each is at the end of its name."""
    parts = []
    for name, value in figures.items():
        end, unit, form = next(row for row in _UNITS if name.endswith(row[0]))
        word = name.removesuffix(end)
        parts.append(f"{_SYMBOLS.get(word, word)} {value:{form}}{unit}")
    return ", ".join(parts)


def _heave_figures(record: HeaveRecord) -> dict[str, Any]:
    replay = HeaveReplay(record)
    figures: dict[str, Any] = {
        "motion": "heave",
        "duration_s": replay.duration_s,
        "rate_hz": 1e9 / record.period_ns,
        "heave": _sea_figures(record.time_ns, record.position_m),
        "heave_rate": {"max_m_per_s": float(np.max(np.abs(record.velocity_m_per_s)))},
        "note": replay.note,
    }
    if len(record.elevation_m) > 1:
        figures["wave"] = _sea_figures(record.elevation_time_ns, record.elevation_m)
    return figures


def _pose_figures(record: PoseRecord) -> dict[str, Any]:
    from scipy.spatial.transform import Rotation  # slow to load

    yaw, pitch, roll = np.unwrap(Rotation.from_quat(record.orientation).as_euler("ZYX"), axis=0).T
    turns = (("roll", roll), ("pitch", pitch), ("yaw", yaw))
    places = zip(("east", "north", "up"), record.position_m.T, strict=True)
    return {
        "motion": "poses",
        "duration_s": float(record.time_ns[-1] + record.period_ns) * 1e-9,
        "rate_hz": 1e9 / record.period_ns,
        **{name: _spread(values, "m") for name, values in places},
        **{name: _spread(np.degrees(values), "deg") for name, values in turns},
        "note": record.note,
    }


def _spread(values: NDArray[np.float64], unit: str) -> dict[str, float]:
    figures = {
        "mean": values.mean(), "std": values.std(), "min": values.min(), "max": values.max()
    }  # fmt: skip
    return {f"{name}_{unit}": float(value) for name, value in figures.items()}


def _sea_figures(time_ns: NDArray[np.int64], values: NDArray[np.float64]) -> dict[str, float]:
    """Return Hs = 4·σ, Tp (peak of bands of 0.01 Hz), the largest value and the rate."""
    period_ns = int(np.median(np.diff(time_ns)))
    even_ns = np.arange(time_ns[0], time_ns[-1] + 1, period_ns)
    even = np.interp(even_ns, time_ns, values)
    figures = {"hs_m": 4.0 * float(np.std(values))}
    if np.ptp(even) > 0.0:
        spectrum = band_spectrum(even - even.mean(), 1e9 / period_ns)
        figures["tp_s"] = float(spectrum.peak_period_s)
    return {**figures, "max_m": float(np.max(np.abs(values))), "rate_hz": 1e9 / period_ns}


COMMANDS = {"sea-state": Command(add_arguments, run, EXAMPLES)}

"""`rope_twin sea-state`: make a bag of heave from a wave spectrum, or tell what is in one."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from rope_twin.errors import InputError, phrase
from rope_twin.recording.bag_reader import BagReader, find_bag
from rope_twin.recording.heave_record import HeaveRecord, read_heave
from rope_twin.recording.heave_replay import HeaveReplay
from rope_twin.recording.pose_record import PoseRecord, read_poses
from rope_twin.recording.sea_bag import write_sea_bag
from rope_twin.scene.sea_state import RecordedPoses
from rope_twin.sea.heave_response import BoxHull
from rope_twin.sea.spectrum import (
    WaveSpectrum,
    band_spectrum,
    find_spectra,
    jonswap,
    read_spectrum,
)
from rope_twin.sea.steepness import breaking_fault, steepness_warning
from rope_twin.twin.motion.irregular_sea import synthesise


def add_parser(subparsers: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Add the subcommand with its two verbs."""
    parser = subparsers.add_parser("sea-state", help="make a recorded sea state, or look into one")
    verbs = parser.add_subparsers(dest="verb", required=True, metavar="make | info")
    _add_make(verbs)
    info = verbs.add_parser("info", help="heights, periods, rates and origin of a bag's heave")
    info.add_argument("bag", metavar="BAG", help="name in bags/, or path of a bag")
    info.add_argument(
        "--topic", metavar="NAME", help="the Odometry topic (default: ship/heave, or the only one)"
    )
    info.add_argument("--poses", action="store_true", help="tell of the ship's poses, not of heave")
    parser.set_defaults(run=run)


def run(args: argparse.Namespace) -> int:
    """Make a bag or tell of one; returns the exit code, raises RopeTwinError."""
    return _make(args) if args.verb == "make" else _tell_of(args)


def _add_make(verbs: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    hull = BoxHull()
    make = verbs.add_parser(
        "make",
        help="a bag of ship/heave and sea/elevation from a spectrum",
        description="Random phases from the seed, heave by the closed-form response of a box-like "
        "hull (Jensen, Mansour, Olsen 2004). Equal arguments give equal bytes.",
    )
    sea = make.add_mutually_exclusive_group(required=True)
    sea.add_argument("--spectrum", metavar="CSV", help="name in config/sea_states/, or a file")
    sea.add_argument(
        "--jonswap", type=float, nargs="+", metavar="X",
        help="Hs [m], Tp [s] and, if wanted, gamma (1: Pierson-Moskowitz)",
    )  # fmt: skip
    make.add_argument(
        "--column", metavar="HOUR", help="hour of the measured spectrum, such as 1996-10-16T00Z"
    )
    make.add_argument(
        "--seed", metavar="N", type=int, required=True, help="names the random phases"
    )
    make.add_argument(
        "--out", metavar="DIR", type=Path, required=True, help="directory of the new bag"
    )
    for option, default, unit, what in (
        ("--duration", 1200.0, "S", "length, also of the loop [s]"),
        ("--rate", 20.0, "HZ", "of the heave [Hz]"),
        ("--elevation-rate", 4.0, "HZ", "of the wave elevation [Hz]"),
    ):
        words = f"{what} (default: %(default)g)"
        make.add_argument(option, type=float, default=default, metavar=unit, help=words)
    make.add_argument(
        "--hull", type=float, nargs=4, metavar=("L", "B", "T", "CB"),
        default=(hull.length_m, hull.breadth_m, hull.draught_m, hull.block_coefficient),
        help="length, breadth, draught [m] and block coefficient (default: 120 23 7 0.7)",
    )  # fmt: skip


def _make(args: argparse.Namespace) -> int:
    spectrum = _choose_spectrum(args)
    _check_steepness(args, spectrum)
    length, breadth, draught, block = args.hull
    hull = BoxHull(length_m=length, breadth_m=breadth, draught_m=draught, block_coefficient=block)
    if args.elevation_rate <= 2.0 * spectrum.frequency_hz[-1]:
        right = f"right is above {2.0 * spectrum.frequency_hz[-1]:g} Hz, twice the spectrum's end"
        what = f"it is {args.elevation_rate:g} Hz"
        raise InputError(phrase("elevation rate", what, right))
    sea = synthesise(spectrum, hull, args.seed, args.duration, args.rate)
    notes = {
        "spectrum": spectrum.source,
        "spectrum_hs_m": f"{spectrum.significant_height_m:.3f}",
        "response": hull.describe(),
        "seed": str(args.seed),
        "loops": f"periodic, {args.duration:g} s",
    }
    write_sea_bag(args.out, sea, args.elevation_rate, notes)
    _tell(args.out, read_heave(args.out))
    return 0


def _choose_spectrum(args: argparse.Namespace) -> WaveSpectrum:
    if args.jonswap is not None:
        if args.column is not None or len(args.jonswap) not in (2, 3):
            what = f"{len(args.jonswap)} numbers" + (" and a column" if args.column else "")
            raise InputError(phrase("--jonswap", what, "right are Hs, Tp and perhaps gamma alone"))
        return jonswap(*args.jonswap)
    if args.column is None:
        raise InputError(phrase("--column", "it is missing", "name an hour of the spectrum"))
    return read_spectrum(find_spectra(args.spectrum), args.column)


def _check_steepness(args: argparse.Namespace, spectrum: WaveSpectrum) -> None:
    """Warn of a sea that is steeper than seas are. Raises InputError for one that cannot be."""
    given = args.jonswap[:2] if args.jonswap is not None else [args.spectrum]
    option = "--spectrum" if args.jonswap is None else "--jonswap"
    where = " ".join([option, *(f"{one:g}" if isinstance(one, float) else one for one in given)])
    fault = breaking_fault(spectrum)
    if fault is not None:
        raise InputError(phrase(where, *fault))
    if warning := steepness_warning(where, spectrum):
        print(f"warning: {warning}", file=sys.stderr)


def _tell_of(args: argparse.Namespace) -> int:
    path = find_bag(args.bag)
    if args.poses:
        _tell_poses(path, read_poses(path, RecordedPoses(bag=args.bag, topic=args.topic or "")))
        return 0
    record = read_heave(path, args.topic)
    _tell(path, record)
    with BagReader(path) as bag:
        for key, value in bag.custom_data.items():
            print(f"  {key:<14} {value}")
    return 0


def _tell(path: Path, record: HeaveRecord) -> None:
    replay = HeaveReplay(record)
    rate_hz = 1e9 / record.period_ns
    print(f"{path}: {replay.duration_s:g} s of heave at {rate_hz:g} Hz")
    print(f"  {'heave':<14} {_describe(record.time_ns, record.position_m)}")
    print(f"  {'heave rate':<14} largest {np.max(np.abs(record.velocity_m_per_s)):.2f} m/s")
    if len(record.elevation_m) > 1:
        print(f"  {'wave':<14} {_describe(record.elevation_time_ns, record.elevation_m)}")
    if replay.note:
        print(f"  {'note':<14} {replay.note}")


def _tell_poses(path: Path, record: PoseRecord) -> None:
    from scipy.spatial.transform import Rotation  # slow to load

    duration_s = float(record.time_ns[-1] + record.period_ns) * 1e-9
    print(f"{path}: {duration_s:g} s of the ship's poses at {1e9 / record.period_ns:g} Hz")
    yaw, pitch, roll = np.unwrap(Rotation.from_quat(record.orientation).as_euler("ZYX"), axis=0).T
    turns = (("roll", roll), ("pitch", pitch), ("yaw", yaw))
    for name, values in zip(("east", "north", "up"), record.position_m.T, strict=True):
        print(f"  {name:<14} {_spread(values)} m")
    for name, values in turns:
        print(f"  {name:<14} {_spread(np.degrees(values))}°")
    if record.note:
        print(f"  {'note':<14} {record.note}")


def _spread(values: NDArray[np.float64]) -> str:
    """Mean, standard deviation, lowest and highest."""
    ends = f"{values.min():.2f} to {values.max():.2f}"
    return f"mean {values.mean():.2f}, standard deviation {values.std():.2f}, {ends}"


def _describe(time_ns: NDArray[np.int64], values: NDArray[np.float64]) -> str:
    """Hs = 4·σ, Tp (peak of bands of 0.01 Hz) and the largest value."""
    period_ns = int(np.median(np.diff(time_ns)))
    even_ns = np.arange(time_ns[0], time_ns[-1] + 1, period_ns)
    even = np.interp(even_ns, time_ns, values)
    text = f"Hs {4.0 * np.std(values):.2f} m"
    if np.ptp(even) > 0.0:
        text += f", Tp {band_spectrum(even - even.mean(), 1e9 / period_ns).peak_period_s:.1f} s"
    return f"{text}, largest {np.max(np.abs(values)):.2f} m ({1e9 / period_ns:g} Hz)"

"""Time series of a bag as a table: CSV, Parquet or netCDF, for pandas and xarray.

A row for each stamp of the exported topics, a column for each number, with its unit in the name;
what a topic does not have at a stamp is empty (NaN). Times count from the start of the simulation.
A truncated bag is read up to its break.
"""

from __future__ import annotations

import csv
import io
import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from rope_twin.errors import BagError, InputError, did_you_mean, require
from rope_twin.files import write_whole
from rope_twin.messages import decode
from rope_twin.messages.templates import NANOSECONDS, nanoseconds
from rope_twin.quantity import unit_of
from rope_twin.recording.bag import find_bag
from rope_twin.recording.mcap_scan import mcap_files, topic_messages
from rope_twin.sea.tables import Vector

EPOCH = "twin/epoch"
ENDINGS = (".csv", ".parquet", ".nc")
Cells = Iterator[tuple[str, float]]


def _joints(position: str, velocity: str, effort: str) -> Callable[[Any], Cells]:
    """Return the cells of a JointState, whose parts have these names; "": not exported."""

    def cells(message: Any) -> Cells:
        for part, values in ((position, message.position), (velocity, message.velocity),
                             (effort, message.effort)):  # fmt: skip
            if part:
                pairs = zip(message.name, values, strict=False)
                yield from ((f"{name}/{part}", float(value)) for name, value in pairs)

    return cells


def _vector(value: Any, unit: str) -> Cells:
    yield from ((f"{axis}_{unit}", float(getattr(value, axis))) for axis in "xyz")


def _odometry(message: Any) -> Cells:
    yield from _vector(message.pose.pose.position, "m")
    speed = _vector(message.twist.twist.linear, "m_per_s")
    yield from ((f"v{name}", value) for name, value in speed)


def _heave(message: Any) -> Cells:
    yield "z_m", float(message.pose.pose.position.z)
    yield "vz_m_per_s", float(message.twist.twist.linear.z)


def _bodies(message: Any) -> Cells:
    for number, name in enumerate(message.joint_names):
        translation = message.transforms[number].translation
        yield from ((f"{name}/{part}", value) for part, value in _vector(translation, "m"))
        if number < len(message.twist):
            speed = _vector(message.twist[number].linear, "m_per_s")
            yield from ((f"{name}/v{part}", value) for part, value in speed)


def _wrench(message: Any) -> Cells:
    yield from ((f"f{name}", value) for name, value in _vector(message.wrench.force, "n"))


def _height(message: Any) -> Cells:
    yield "z_m", float(message.point.z)


SERIES: Mapping[str, Callable[[Any], Cells]] = {
    "ropes/tension_top": _joints("", "", "tension_n"),
    "ropes/tension_bottom": _joints("", "", "tension_n"),
    "ropes/length": _joints("line_out_m", "payout_m_per_s", ""),
    "payloads/state": _bodies,
    "hang_off/odometry": _odometry,
    "hang_off/wrench": _wrench,
    "lower_end/odometry": _odometry,
    "lower_end/wrench": _wrench,
    "ship/heave": _heave,
    "ship/odometry": _odometry,
    "sea/elevation": _height,
    "winch/measured": _joints("line_out_m", "payout_m_per_s", "tension_n"),
    "winch/motor_tension": _joints("", "", "tension_n"),
    "payload/measured_depth": _height,
}


@dataclass(frozen=True)
class SeriesTable:
    """Columns by name, `topic/name/quantity`, over a common time."""

    time_s: Vector  # (rows,) ascending
    columns: Mapping[str, Vector]  # (rows,) each; nan where there is no value
    problems: tuple[str, ...]  # damage of the bag, one sentence each


def read_series(bag: str | Path, topics: Sequence[str] = ()) -> SeriesTable:
    """Return the time series of a bag.

    topics: of SERIES; default: all that the bag has.

    Raises:
        BagError: no such bag, or it has none of these topics.
        InputError: a topic has no time series.
    """
    for name in topics:
        if name not in SERIES:
            raise InputError(f"topic '{name}'", "it has no time series", did_you_mean(name, SERIES))
    path, problems = find_bag(bag), list[str]()
    names = frozenset(topics or SERIES)
    series: dict[str, dict[int, float]] = {}
    replaced: dict[str, set[int]] = {}  # stamps of several messages, by topic
    epoch_ns: int | None = None
    files = mcap_files(path)
    if not files:
        raise BagError(f"bag {path}", "it holds no .mcap file", "give a bag with MCAP storage")
    for name, stored in topic_messages(files, names | {EPOCH}, problems):
        try:
            message = decode(name, stored.data)
        except InputError as error:
            problems.append(str(error))
            continue
        if name == EPOCH:
            if epoch_ns is None:
                epoch_ns = nanoseconds(message)
            continue
        stamp = nanoseconds(message.header.stamp)
        for name_part, value in SERIES[name](message):
            column_values = series.setdefault(f"{name}/{name_part}", {})
            previous = column_values.get(stamp, math.nan)
            if not math.isnan(previous) and math.isnan(value):
                continue
            if not math.isnan(previous) and previous != value:
                replaced.setdefault(name, set()).add(stamp)
            column_values[stamp] = value
    problems += [f"{name}: {len(own)} stamps came again with other values, the last are exported"
                 for name, own in replaced.items()]  # fmt: skip
    if not series:
        remedy = f"it must have one of {', '.join(sorted(names))}"
        raise BagError(f"bag {path}", "no topic with a time series", remedy)
    stamps = np.array(sorted(set().union(*series.values())), np.int64)
    columns = dict[str, Vector]()
    for column, known in series.items():
        columns[column] = values = np.full(len(stamps), math.nan)
        values[np.searchsorted(stamps, np.array(list(known), np.int64))] = list(known.values())
    begun_ns = int(stamps[0]) if epoch_ns is None else epoch_ns
    return SeriesTable((stamps - begun_ns) / NANOSECONDS, columns, tuple(dict.fromkeys(problems)))


def check_ending(path: Path) -> None:
    """Check, before a bag is read, that a table can be written at this path.

    Raises:
        InputError: its ending is none of ENDINGS, or the library of that format is missing.
    """
    ending = path.suffix.lower()
    if ending not in ENDINGS:
        remedy = f"end it in {', '.join(ENDINGS)}"
        raise InputError("--out", f"'{path}' is no table that is written", remedy)
    needed = {".csv": ((), ""), ".parquet": (("pyarrow",), "plot"),
              ".nc": (("h5netcdf", "h5py"), "planning")}[ending]  # fmt: skip
    for name in needed[0]:
        require(name, f"{ending} needs it and it is not there", needed[1])


def write_series(table: SeriesTable, path: Path) -> None:
    """Write a table in the format of its ending: all of it or, on an error, nothing.

    Raises:
        InputError: it cannot be written there.
    """
    check_ending(path)
    form = {".csv": _csv, ".parquet": _parquet, ".nc": _netcdf}[path.suffix.lower()]
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        write_whole(path, form(table))
    except OSError as error:
        remedy = "give a place that can be written"
        raise InputError(str(path), f"it cannot be written ({error})", remedy) from None


def _csv(table: SeriesTable) -> bytes:
    stream = io.StringIO()
    writer = csv.writer(stream, lineterminator="\n")
    writer.writerow(["time_s", *table.columns])
    for row in np.stack([table.time_s, *table.columns.values()], axis=1).tolist():
        writer.writerow(["" if math.isnan(value) else repr(value) for value in row])
    return stream.getvalue().encode()


def _parquet(table: SeriesTable) -> bytes:
    import pyarrow
    import pyarrow.parquet as parquet

    stream = io.BytesIO()
    parquet.write_table(pyarrow.table({"time_s": table.time_s, **table.columns}), stream)
    return stream.getvalue()


def _netcdf(table: SeriesTable) -> bytes:
    """Return a netCDF 4 file; slashes of names are dots there."""
    import h5netcdf

    stream = io.BytesIO()
    with h5netcdf.File(stream, "w") as file:
        file.dimensions = {"time_s": len(table.time_s)}
        for name, values in {"time_s": table.time_s, **table.columns}.items():
            variable = file.create_variable(name.replace("/", "."), ("time_s",), "f8", data=values)
            variable.attrs["units"] = unit_of(name)
    return stream.getvalue()

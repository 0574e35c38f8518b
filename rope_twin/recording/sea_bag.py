"""Writes a synthesised sea as a bag: ship/heave and sea/elevation, byte for byte repeatable."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np

from rope_twin.errors import InputError, phrase
from rope_twin.messages import encode_elevation, encode_heave
from rope_twin.recording.bag_writer import BagWriter
from rope_twin.sea.spectrum import Vector
from rope_twin.topics import BY_NAME
from rope_twin.twin.motion.irregular_sea import SeaRecord

START_NS = 946_684_800 * 10**9  # 2000-01-01, a date that nobody takes for the measurement's
RESOLUTION = 2.0**-13  # 0.12 mm and 0.12 mm/s: finer than any motion sensor, and it compresses


def write_sea_bag(
    directory: Path,
    sea: SeaRecord,
    elevation_rate_hz: float,
    notes: Mapping[str, str] | None = None,
) -> None:
    """Write heave at the record's rate and elevation at a lower one; stamps are log times.

    Values are rounded to RESOLUTION, as a sensor would.

    Raises:
        InputError: the elevation's rate does not divide the heave's.
        BagError: the bag cannot be written.
    """
    ratio = sea.rate_hz / elevation_rate_hz if elevation_rate_hz > 0.0 else 0.0
    if ratio < 1.0 or abs(ratio - round(ratio)) > 1e-9:
        what = f"it is {elevation_rate_hz:g} Hz"
        right = f"right is {sea.rate_hz:g} Hz divided by a whole number"
        raise InputError(phrase("elevation rate", what, right))
    every = round(ratio)
    heave, velocity = _round(sea.heave_m), _round(sea.heave_velocity_m_per_s)
    elevation = _round(sea.elevation_m)
    metadata = {
        "source": sea.source,
        "resolution": f"values rounded to {RESOLUTION:g} m and m/s",
        **(notes or {}),
    }
    topics = (BY_NAME["ship/heave"], BY_NAME["sea/elevation"])
    with BagWriter(directory, topics, metadata) as bag:
        for k in range(len(heave)):
            stamp_ns = START_NS + round(k * 1e9 / sea.rate_hz)
            bag.write(
                "ship/heave",
                stamp_ns,
                encode_heave(stamp_ns, float(heave[k]), float(velocity[k])),
            )
            if k % every == 0:
                data = encode_elevation(stamp_ns, float(elevation[k]))
                bag.write("sea/elevation", stamp_ns, data)


def _round(values: Vector) -> Vector:
    return np.round(values / RESOLUTION) * RESOLUTION + 0.0  # no negative zeros

"""One vessel written as CSV, OrcaFlex YAML, WAMIT .4 and Capytaine netCDF, in any convention."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import yaml
from box_motion import box_responses

from rope_twin.sea.rao_files import COLUMNS
from rope_twin.sea.raos import FREEDOMS, MIRRORED, Answers, Point, Responses, moved_by
from rope_twin.sea.ship_motion import BoxHull
from rope_twin.sea.tables import Vector

HEADINGS_DEG = np.array([0.0, 45.0, 90.0, 135.0, 180.0])
FREQUENCIES_HZ = np.linspace(0.02, 0.4, 20)
MIDSHIPS = (0.0, 0.0, 0.0)
ORCAFLEX_KEY = ", ".join(
    ["RAOPeriodOrFrequency", *(f"RAO{f.title()}{p}" for f in FREEDOMS for p in ("Amp", "Phase"))]
)
G = 9.80665


def box() -> Responses:
    """Return the closed-form RAOs of a box-like hull, amidships at the water level."""
    return box_responses(BoxHull(), HEADINGS_DEG, FREQUENCIES_HZ)


def box_at(frequency_hz: Vector) -> Responses:
    """Return the RAOs of `box` at other frequencies."""
    return box_responses(BoxHull(), HEADINGS_DEG, frequency_hz)


def box_small() -> Responses:
    """Return the RAOs of `box` at three headings and four periods."""
    return box_responses(BoxHull(), HEADINGS_DEG[::2], np.array([0.03, 0.06, 0.1, 0.2]))


def box_wide() -> Responses:
    """Return the RAOs of `box` at all headings and four periods."""
    return box_at(np.array([0.03, 0.06, 0.1, 0.2]))


def at_point(vessel: Responses, point: Point) -> Answers:
    """Return the RAOs of another point; phases stay those of the wave amidships."""
    return moved_by(vessel.answer, point)


def csv_text(vessel: Responses) -> str:
    """Return a CSV with every digit."""
    lines = [",".join(COLUMNS)]
    size, phase = np.abs(vessel.answer), np.degrees(np.angle(vessel.answer))
    size[3:] = np.degrees(size[3:])
    for i, heading in enumerate(vessel.heading_deg.tolist()):
        for j, frequency in enumerate(vessel.frequency_hz.tolist()):
            cells = [heading, frequency, *size[:, i, j].tolist(), *phase[:, i, j].tolist()]
            lines.append(",".join(repr(cell) for cell in cells))
    return "\n".join(lines) + "\n"


@dataclass(frozen=True)
class Said:
    """Conventions of an OrcaFlex vessel type."""

    turns: str = "degrees"  # or radians
    unit: str = "amplitude"  # or max wave slope, wave steepness
    waves: str = "period (s)"  # or frequency (rad/s), frequency (Hz)
    phase: str = "lags"  # or leads
    phase_unit: str = "degrees"  # or radians
    relative: str = "crest"  # or trough, zero up-crossing, zero down-crossing
    flipped: tuple[bool, ...] = (False,) * 6  # positive aft, starboard, down, ...
    symmetry: str = "xz plane"
    system: str = "SI"  # or US, in feet


DIRECTIONS = (
    ("SurgePositive", "forward", "aft"), ("SwayPositive", "port", "starboard"),
    ("HeavePositive", "up", "down"), ("RollPositiveStarboard", "down", "up"),
    ("PitchPositiveBow", "down", "up"), ("YawPositiveBow", "port", "starboard"),
)  # fmt: skip
LEADS_OF_EVENT = {"crest": 0.0, "trough": 180.0, "zero up-crossing": -90.0,
                  "zero down-crossing": 90.0}  # phase of the wave at the event [deg]  # fmt: skip


def orcaflex_model(
    vessel: Responses, said: Said | None = None, origin: Point = MIDSHIPS
) -> dict[str, Any]:
    """Return the content of an OrcaFlex YAML file with this vessel type."""
    said = said or Said()
    foot = 0.3048 if said.system == "US" else 1.0
    answer = at_point(vessel, origin)
    omega = 2.0 * np.pi * vessel.frequency_hz
    per = {"amplitude": 1.0 / foot, "max wave slope": omega**2 / G,
           "wave steepness": omega**2 / G / np.pi}[said.unit]  # fmt: skip
    answer[3:] = answer[3:] / per
    answer = answer * np.where(said.flipped, -1.0, 1.0)[:, None, None]
    size, lead = np.abs(answer), np.degrees(np.angle(answer)) + LEADS_OF_EVENT[said.relative]
    if said.unit == "amplitude" and said.turns == "degrees":
        size[3:] = np.degrees(size[3:])
    phase = lead if said.phase == "leads" else -lead
    phase = np.radians(phase) if said.phase_unit == "radians" else phase
    waves = {"period (s)": 1.0 / vessel.frequency_hz, "frequency (rad/s)": omega,
             "frequency (Hz)": vessel.frequency_hz}[said.waves]  # fmt: skip
    tables = []
    for i, heading in enumerate(vessel.heading_deg.tolist()):
        rows = np.empty((len(waves), 13))
        rows[:, 0], rows[:, 1::2], rows[:, 2::2] = waves, size[:, i].T, phase[:, i].T
        tables.append({"RAODirection": heading, ORCAFLEX_KEY: rows.tolist()})
    kind = {
        "Name": "Hull", "Length": 120, "RAOResponseUnits": said.turns, "RAOWaveUnit": said.unit,
        "WavesReferredToBy": said.waves, "RAOPhaseConvention": said.phase,
        "RAOPhaseUnitsConvention": said.phase_unit, "RAOPhaseRelativeToConvention": said.relative,
        "Symmetry": said.symmetry,
        **{key: names[on] for (key, *names), on in zip(DIRECTIONS, said.flipped, strict=True)},
        "Draughts": [{"Name": "Operating", "DisplacementRAOs": {
            "RAOOrigin": [value / foot for value in origin], "PhaseOrigin": [0.0, 0.0, 0.0],
            "RAOs": tables}}],
    }  # fmt: skip
    return {"General": {"UnitsSystem": said.system}, "VesselTypes": [kind]}


def orcaflex_text(model: dict[str, Any]) -> str:
    """Return it as YAML with the head that OrcaFlex writes."""
    dumped = yaml.dump(model, sort_keys=False, width=10_000, default_flow_style=None)
    return f"%YAML 1.1\n# Type: Model\n---\n{dumped}..."


def wamit_text(vessel: Responses, length_m: float = 1.0, origin: Point = MIDSHIPS) -> str:
    """Return a .4 file with every digit, rotations made dimensionless with a length."""
    answer = at_point(vessel, origin)
    answer[3:] = answer[3:] * length_m
    lines = ["    PER      BETA   I   Mod  Pha  Re  Im"]
    for j, frequency in enumerate(vessel.frequency_hz.tolist()):
        for i, heading in enumerate(vessel.heading_deg.tolist()):
            for k in range(6):
                value = complex(answer[k, i, j])
                polar = f"{abs(value):.7e} {np.degrees(np.angle(value)):.7e}"
                cells = f"{1.0 / frequency!r} {heading!r} {k + 1} {polar}"
                lines.append(f"{cells} {value.real!r} {value.imag!r}")
    return "\n".join(lines) + "\n"


def write_capytaine(
    path: Path, vessel: Responses, origin: Point = MIDSHIPS, **left_out: Any
) -> None:
    """Write the RAOs as xarray stores a data set of Capytaine 3.0 with `RAO`.

    left_out: names of variables with None to leave them out, or with other values.
    """
    import h5netcdf
    import h5py

    answer = np.conj(at_point(vessel, origin))
    names = [name.title() for name in FREEDOMS]
    given: dict[str, tuple[tuple[str, ...], Any]] = {
        "omega": (("omega",), 2.0 * np.pi * vessel.frequency_hz),
        "wave_direction": (("wave_direction",), np.radians(vessel.heading_deg)),
        "radiating_dof": (("radiating_dof",), names),
        "complex": (("complex",), ["re", "im"]),
        "rotation_center": (("space_coordinate",), np.array(origin)),
        "forward_speed": ((), np.float64(0.0)),
        "RAO": (("complex", "omega", "wave_direction", "radiating_dof"),
                np.stack([answer.real, answer.imag]).transpose(0, 3, 2, 1)),
    }  # fmt: skip
    given |= {name: value for name, value in left_out.items() if value is not None}
    kept = {name: own for name, own in given.items() if left_out.get(name, own) is not None}
    attributes = kept.pop("attrs", {})
    with h5netcdf.File(path, "w") as file:
        for key, value in attributes.items():
            file.attrs[key] = value
        for dimensions, values in kept.values():
            for dimension, size in zip(dimensions, np.shape(values), strict=True):
                if dimension not in file.dimensions:
                    file.dimensions[dimension] = size
        for name, (dimensions, values) in kept.items():
            words = isinstance(values, list)
            data = np.array(values, dtype=object) if words else np.asarray(values, np.float64)
            kind = h5py.string_dtype() if words else data.dtype
            file.create_variable(name, dimensions, dtype=kind, data=data)


def full_circle(vessel: Responses) -> tuple[Vector, Answers]:
    """Return headings from 0 to 315 and RAOs of a mirrored table."""
    inner = vessel.heading_deg[1:-1]
    headings = np.concatenate([vessel.heading_deg, 360.0 - inner[::-1]])
    other = MIRRORED[:, None, None] * vessel.answer[:, 1:-1][:, ::-1]
    return headings, np.concatenate([vessel.answer, other], axis=1)

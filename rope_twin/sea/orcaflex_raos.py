"""Displacement RAOs of a vessel type in an OrcaFlex YAML file.

The file may be a whole model or a vessel type alone. Its conventions (OrcaFlex help, "Vessel types:
Conventions" and "RAOs") all are keys of the file and are required: units, what the waves are
referred to by, lead or lag and relative to what, the positive direction of each freedom, symmetry,
the point of the motion (`RAOOrigin`) and of the phases (`PhaseOrigin`, `~`: the same point).
`RAODirection` is the direction of propagation, from the bow to port.

Rotations per maximum wave slope or wave steepness are converted with the wavelength of deep water,
as OrcaFlex does: the slope of a wave of amplitude a is k·a, its steepness k·a/π, k = ω²/g.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import yaml

from rope_twin.errors import InputError, did_you_mean
from rope_twin.sea.raos import (
    FREEDOMS,
    GRAVITY_M_PER_S2,
    NO_SYMMETRY,
    XZ_AND_YZ_PLANES,
    XZ_PLANE,
    Answers,
    FileRaos,
    Point,
    RaoConventions,
)
from rope_twin.sea.tables import Vector

FOOT_M = 0.3048
_DIRECTIONS = {
    "SurgePositive": ("forward", "aft"), "SwayPositive": ("port", "starboard"),
    "HeavePositive": ("up", "down"), "RollPositiveStarboard": ("down", "up"),
    "PitchPositiveBow": ("down", "up"), "YawPositiveBow": ("port", "starboard"),
}  # fmt: skip
_SYMMETRIES = {"none": NO_SYMMETRY, "xz plane": XZ_PLANE, "xz and yz planes": XZ_AND_YZ_PLANES}
# what the wave is at the time that a phase counts from, as a phasor of a·cos(ωt)
_RELATIVE = {"crest": 1.0, "trough": -1.0, "zero up crossing": -1j, "zero down crossing": 1j}
_COLUMNS = (
    "RAOPeriodOrFrequency",
    *(f"RAO{name.title()}{part}" for name in FREEDOMS for part in ("Amp", "Phase")),
)
Keys = Mapping[str, Any]


def load_model(path: Path) -> Keys:
    """Return the content of an OrcaFlex YAML file.

    Raises:
        InputError: it cannot be read, is not YAML, or its top is no mapping.
    """
    loader = getattr(yaml, "CSafeLoader", yaml.SafeLoader)
    remedy = "give a model or vessel type that OrcaFlex saved as a text data file"
    try:
        with path.open("rb") as stream:
            content = yaml.load(stream, Loader=loader)
    except OSError as error:
        raise InputError(str(path), f"it cannot be read ({error})", remedy) from None
    except (yaml.YAMLError, ValueError, RecursionError) as error:
        message = " ".join(str(error).split())[:120]
        raise InputError(str(path), f"it is not YAML ({message})", remedy) from None
    if not isinstance(content, Mapping):
        raise InputError(str(path), "its top is not a mapping", remedy)
    return content


def length_unit_m(model: Keys, where: str) -> float:
    """Return the model's unit of length [m].

    Raises:
        InputError: the file does not state it, or it is an unknown one.
    """
    section = model.get("General", model)
    general: Keys = section if isinstance(section, Mapping) else {}
    system = general.get("UnitsSystem")
    known = {"SI": "m", "US": "ft", "User": general.get("LengthUnits")}
    unit = known.get(str(system))
    if unit not in ("m", "ft"):
        remedy = "add `General: {UnitsSystem: SI}`, or User with LengthUnits m or ft"
        raise InputError(where, f"the unit of length is not stated (UnitsSystem {system})", remedy)
    return 1.0 if unit == "m" else FOOT_M


def read_orcaflex(path: Path, conventions: RaoConventions) -> FileRaos:
    """Read one vessel type at one draught.

    Raises:
        InputError: the file is invalid or lacks a convention.
    """
    model = load_model(path)
    where = str(path)
    needed = tuple(name for name in ("vessel", "draught") if getattr(conventions, name))
    conventions.require(where, needed, "the file states it itself")
    kind, kinds = model, model.get("VesselTypes")
    if kinds is not None or "Draughts" not in model:
        kind = _chosen(kinds, conventions.vessel, where, "VesselTypes", "vessel")
    name = str(kind.get("Name", path.stem))
    where = f"{where}, {name}"
    draught = _chosen(kind.get("Draughts"), conventions.draught, where, "Draughts", "draught")
    table = draught.get("DisplacementRAOs")
    if not isinstance(table, Mapping) or not isinstance(table.get("RAOs"), Sequence):
        problem = "there are no DisplacementRAOs with a list RAOs"
        raise InputError(where, problem, "give a vessel type with displacement RAOs")
    unit_m = length_unit_m(model, where)
    headings, waves, numbers = _numbers(table["RAOs"], where)
    frequency = _frequencies(_word(kind, "WavesReferredToBy", where), waves, where)
    answer = _responses(kind, numbers, frequency, unit_m, where)
    origin = _point(table, "RAOOrigin", where)
    phases = _point(table, "PhaseOrigin", where, origin)
    known = frequency < np.inf
    return FileRaos(
        where, f"{path}, OrcaFlex vessel type {name}", headings, frequency[known],
        answer[:, :, known], _choice(kind, "Symmetry", _SYMMETRIES, where),
        _scaled(origin, unit_m), _scaled(phases, unit_m),
    )  # fmt: skip


def _chosen(listed: Any, name: str, where: str, key: str, option: str) -> Keys:
    """Return the one of this name, or the only one. Raises InputError."""
    if not isinstance(listed, Sequence) or not all(isinstance(entry, Mapping) for entry in listed):
        problem = f"there is no list {key}"
        raise InputError(where, problem, "give a vessel type as OrcaFlex saves it")
    names = [str(entry.get("Name", "")) for entry in listed]
    if name and name not in names:
        raise InputError(where, f"no {option} '{name}'", did_you_mean(name, names))
    if not name and len(listed) != 1:
        problem = f"{len(listed)} of {key}: {', '.join(names)}"
        raise InputError(where, problem, f"name one with `{option}`")
    chosen: Keys = listed[names.index(name) if name else 0]
    return chosen


def _word(kind: Keys, key: str, where: str) -> str:
    """Return the text of a convention, in small letters, without hyphens. Raises InputError."""
    if kind.get(key) is None:
        remedy = "add it, as OrcaFlex writes it"
        raise InputError(where, f"the convention {key} is not stated", remedy)
    return " ".join(str(kind[key]).replace("-", " ").lower().split())


def _choice(kind: Keys, key: str, known: Mapping[str, Any], where: str) -> Any:
    """Return the meaning of a convention. Raises InputError."""
    word = _word(kind, key, where)
    if word not in known:
        raise InputError(where, f"{key} is '{kind[key]}'", f"what is read is {', '.join(known)}")
    return known[word]


def _numbers(tables: Any, where: str) -> tuple[Vector, Vector, Vector]:
    """Return headings (h,), periods or frequencies (f,) and numbers (h, f, 12)."""
    headings, blocks, waves = list[float](), list[Vector](), np.zeros(0)
    for table in tables:
        if not isinstance(table, Mapping) or "RAODirection" not in table:
            problem = "an entry of RAOs has no RAODirection"
            raise InputError(where, problem, "give the direction of every table")
        heading = _number(table["RAODirection"], f"{where}, RAODirection")
        where_heading = f"{where}, RAODirection {heading:g}"
        key = next((one for one in table if str(one).startswith(_COLUMNS[0])), None)
        if key is None or tuple(part.strip() for part in str(key).split(",")) != _COLUMNS:
            problem = "its columns are not period or frequency and six amplitudes and phases"
            raise InputError(where_heading, problem, f"the key must be '{', '.join(_COLUMNS)}'")
        rows = table[key]
        if not isinstance(rows, Sequence) or not rows or isinstance(rows, str):
            raise InputError(where_heading, "it has no rows", "give rows of 13 numbers")
        for row in rows:
            if not isinstance(row, Sequence) or len(row) != len(_COLUMNS):
                count = len(row) if isinstance(row, Sequence) else 1
                raise InputError(where_heading, f"a row of {count} values", "a row has 13 numbers")
        block = np.array([[_number(cell, where_heading) for cell in row] for row in rows])
        order = np.argsort(block[:, 0], kind="stable")
        block = block[order]
        if headings and not np.array_equal(waves, block[:, 0]):
            problem = f"other periods or frequencies than at {headings[0]:g}"
            raise InputError(where_heading, problem, "give the same for every direction")
        waves = block[:, 0]
        if (block[:, 1::2] < 0.0).any():
            remedy = "give 0 or more, and a phase"
            raise InputError(where_heading, "an amplitude is negative", remedy)
        if not np.isfinite(block[:, 1:]).all():
            raise InputError(where_heading, "a number is not finite", "give finite numbers")
        headings.append(heading)
        blocks.append(block[:, 1:])
    if not headings:
        raise InputError(where, "RAOs is empty", "give a table for every direction")
    if not np.isfinite(headings).all():
        raise InputError(where, "a RAODirection is not finite", "give degrees")
    return np.array(headings), waves, np.stack(blocks)


def _number(value: Any, where: str) -> float:
    """Return a number that YAML may have read as text, like 1e3 or Infinity. Raises InputError."""
    if isinstance(value, (int, float, str)) and not isinstance(value, bool):
        try:
            return float(value)
        except ValueError:
            pass
    raise InputError(where, f"'{value}' is not a number", "give a number")


def _frequencies(referred: str, waves: Vector, where: str) -> Vector:
    """Return frequencies [Hz] in the order of the rows; a period of 0 is infinite."""
    if (waves < 0.0).any() or np.isnan(waves).any():
        raise InputError(where, "a period or frequency is below 0", "give 0 or more")
    with np.errstate(divide="ignore"):
        match referred:
            case "period (s)":
                return np.asarray(1.0 / waves)
            case "frequency (rad/s)":
                return waves / (2.0 * np.pi)
            case "frequency (hz)":
                return waves
    remedy = "what is read is period (s), frequency (rad/s) and frequency (Hz)"
    raise InputError(where, f"WavesReferredToBy is '{referred}'", remedy)


def _responses(
    kind: Keys, numbers: Vector, frequency: Vector, unit_m: float, where: str
) -> Answers:
    """Return complex RAOs per metre of amplitude, (6, h, f)."""
    amplitude, phase = (np.moveaxis(numbers[:, :, first::2], 2, 0) for first in (0, 1))
    angle = {"degrees": np.pi / 180.0, "radians": 1.0}
    turns = _choice(kind, "RAOResponseUnits", angle, where)
    phase = phase * _choice(kind, "RAOPhaseUnitsConvention", angle, where)
    sign = _choice(kind, "RAOPhaseConvention", {"leads": 1.0, "lags": -1.0}, where)
    relative = _choice(kind, "RAOPhaseRelativeToConvention", _RELATIVE, where)
    unit = _choice(
        kind, "RAOWaveUnit", {"amplitude": "a", "max wave slope": "ka", "wave steepness": "h/l"},
        where,
    )  # fmt: skip
    k = (2.0 * np.pi * np.where(np.isinf(frequency), 0.0, frequency)) ** 2 / GRAVITY_M_PER_S2
    scale = {"a": turns / unit_m, "ka": k, "h/l": k / np.pi}[unit]
    infinite = np.isinf(frequency)
    if infinite.any() and amplitude[:, :, infinite].any():
        raise InputError(where, "RAOs at the period 0 are not 0", "give 0, or leave that row out")
    answer: Answers = amplitude * np.exp(1j * sign * phase) / relative
    answer[3:] = answer[3:] * scale
    for number, (key, (positive, negative)) in enumerate(_DIRECTIONS.items()):
        answer[number] *= _choice(kind, key, {positive: 1.0, negative: -1.0}, where)
    return answer


def _point(table: Keys, key: str, where: str, usual: Point | None = None) -> Point:
    """Return a point, written as one list or as three keys; `~`: as of `usual`."""
    entries = table.get(key, [table.get(f"{key}{axis}", "") for axis in "XYZ"])
    if not isinstance(entries, Sequence) or isinstance(entries, str) or len(entries) != 3:
        raise InputError(where, f"{key} is not three numbers", "give x, y, z")
    if "" in entries:
        raise InputError(where, f"{key} is not stated", f"add {key}, as OrcaFlex writes it")
    x, y, z = (
        usual[axis] if value is None and usual is not None else _number(value, f"{where}, {key}")
        for axis, value in enumerate(entries)
    )
    if not np.isfinite((x, y, z)).all():
        raise InputError(where, f"{key} is not finite", "give x, y, z")
    return x, y, z


def _scaled(point: Point, unit_m: float) -> Point:
    x, y, z = (unit_m * value for value in point)
    return x, y, z

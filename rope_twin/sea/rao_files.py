"""RAO files by their ending: CSV of this package, WAMIT `.4`, OrcaFlex YAML, Capytaine netCDF.

Conventions come from the file or from `RaoConventions`; nothing is assumed. A CSV has a row per
heading_deg and frequency_hz with amplitudes and phases in the conventions of `raos`; headings reach
from 0 to 180, or to 360 for a vessel without symmetry. The other formats:

* WAMIT `.4` (WAMIT User Manual 7.4, 4.9): PER, BETA, mode, modulus, phase, real and imaginary part;
  the time factor is exp(iωt), so that phases lead, relative to the wave at the global origin; BETA
  is the direction of propagation; rotations are made dimensionless with the length ULEN.
* OrcaFlex: `orcaflex_raos`.
* Capytaine: a data set of one rigid body. Either the variable `RAO` is there
  (`capytaine.post_pro.rao`), or it is solved from the coefficients: (-ω²·(M + A) - iω·B + C)·X = F
  (Capytaine's documentation, "Post-processing"). Complex numbers are in the dimension `complex`
  (re, im), as Capytaine exports them. The time factor is exp(-iωt), so that RAOs here are the
  complex conjugates; `wave_direction` is the direction of propagation [rad]; phases are relative to
  the wave at x = y = 0 of the mesh, motions those of `rotation_center`. The mesh must have x to the
  bow and z up, as the vessel's axes.
"""

from __future__ import annotations

import importlib.util
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rope_twin.errors import InputError, unreadable
from rope_twin.sea.orcaflex_raos import read_orcaflex
from rope_twin.sea.raos import (
    FREEDOMS,
    NO_CONVENTIONS,
    SHIFTS,
    TURNS,
    Answers,
    FileRaos,
    RaoConventions,
    Responses,
    assemble,
)
from rope_twin.sea.tables import Vector, find_table, read_grid

RESPONSES_FOLDER = "responses"
AMPLITUDES = (*(f"{name}_m_per_m" for name in SHIFTS), *(f"{name}_deg_per_m" for name in TURNS))
PHASES = tuple(f"{name}_phase_deg" for name in (*SHIFTS, *TURNS))
HEADING, FREQUENCY = "heading_deg", "frequency_hz"
COLUMNS = (HEADING, FREQUENCY, *AMPLITUDES, *PHASES)
ENDINGS = (".csv", ".4", ".yml", ".yaml", ".nc")
LARGEST_FILE_BYTES = 100_000_000
_MODES = 6
_WAMIT = "PER BETA mode modulus phase real imaginary"
_ROUNDED = 2e-4  # of the modulus: difference between both forms of a number with few digits
_HDF5 = b"\x89HDF\r\n\x1a\n"  # first bytes of a netCDF 4 file
_FREQUENCIES = ("omega", "freq", "period")
_CONSTANT = ("inertia_matrix", "hydrostatic_stiffness")
_PER_FREQUENCY = ("added_mass", "radiation_damping")
_ADD_RAO = "add `dataset['RAO'] = capytaine.post_pro.rao(dataset)`"


def read_responses(name_or_path: str, conventions: RaoConventions = NO_CONVENTIONS) -> Responses:
    """Read RAOs from a table in config/responses/ or from a file in one of ENDINGS.

    conventions: what the file does not state; see `RaoConventions`.

    Raises:
        InputError: the file is invalid, or a convention is missing or given twice; one sentence.
    """
    path = find_table(name_or_path, RESPONSES_FOLDER).resolve()
    about = path.stat()
    if about.st_size > LARGEST_FILE_BYTES:
        problem = f"it is larger than {LARGEST_FILE_BYTES // 1_000_000} MB"
        raise InputError(str(path), problem, "give a table of RAOs")
    return _read(path, conventions, about.st_mtime_ns, about.st_size)


@lru_cache(maxsize=8)
def _read(path: Path, conventions: RaoConventions, _time_ns: int, _size: int) -> Responses:
    """Read a file once while it does not change: scenes ask several times for theirs."""
    match path.suffix.lower():
        case ".4":
            return assemble(read_wamit(path, conventions))
        case ".yml" | ".yaml":
            return assemble(read_orcaflex(path, conventions))
        case ".nc":
            return assemble(read_capytaine(path, conventions))
    return read_csv(path, conventions)


def read_csv(path: Path, conventions: RaoConventions) -> Responses:
    """Read a table of COLUMNS. Raises InputError: the table is invalid."""
    where, names = str(path), (*AMPLITUDES, *PHASES)
    needed = () if conventions.origin_m is None else ("origin_m",)
    conventions.require(where, needed, "a CSV has fixed conventions but for its `origin_m`")
    headings, frequencies, columns = read_grid(path, (HEADING, FREQUENCY), names)
    if headings[0] != 0.0 or headings[-1] not in (180.0, 360.0):
        problem = f"headings from {headings[0]:g}° to {headings[-1]:g}°"
        raise InputError(where, problem, "they must reach from 0° to 180°, or to 360°")
    if frequencies[0] <= 0.0:
        raise InputError(where, f"frequencies from {frequencies[0]:g} Hz", "give them above 0")
    for name in AMPLITUDES:
        if (columns[name] < 0.0).any():
            raise InputError(where, f"{name} is negative", "give 0 or more, and a phase")
    amplitude = np.stack([columns[name] for name in AMPLITUDES])
    amplitude[3:] = np.radians(amplitude[3:])
    phases = np.radians(np.stack([columns[name] for name in PHASES]))
    answer: Answers = np.asarray(amplitude * np.exp(1j * phases), np.complex128)
    mirrored = headings[-1] == 180.0
    if not mirrored and not np.allclose(answer[:, 0], answer[:, -1], rtol=1e-6, atol=1e-9):
        problem = "RAOs at 0° and at 360° differ"
        raise InputError(where, problem, "give the same, they are one heading")
    return Responses(headings, frequencies, answer, where, mirrored, conventions.origin_m)


def read_wamit(path: Path, conventions: RaoConventions) -> FileRaos:
    """Read the RAOs of one body from a WAMIT `.4` file; one line of titles may come first.

    Raises:
        InputError: the file is invalid, or one of the four conventions that it lacks is missing.
    """
    where = str(path)
    needed = ("scale_length_m", "origin_m", "phase_origin_m", "symmetry")
    conventions.require(where, needed, "a WAMIT file has one vessel at one draught")
    length_m, origin, phases, symmetry = (getattr(conventions, name) for name in needed)
    rows, lines = _wamit_rows(path)
    period, heading = (_grouped(rows[:, column]) for column in (0, 1))
    i, j = _index(heading, rows[:, 1]), _index(period, rows[:, 0])
    mode = rows[:, 2].astype(np.int64) - 1
    counts = np.zeros((_MODES, len(heading), len(period)), np.int64)
    np.add.at(counts, (mode, i, j), 1)
    if (counts != 1).any():
        k, h, t = (int(one[0]) for one in np.nonzero(counts != 1))
        fault = "is missing" if counts[k, h, t] == 0 else "is double"
        problem = f"mode {k + 1} at PER {period[t]:g} and BETA {heading[h]:g} {fault}"
        raise InputError(where, problem, "give six modes for each period and heading once")
    value = rows[:, 5] + 1j * rows[:, 6]
    polar = rows[:, 3] * np.exp(1j * np.radians(rows[:, 4]))
    inconsistent = np.abs(value - polar) > _ROUNDED * np.abs(value) + 1e-6
    if inconsistent.any():
        problem = "modulus and phase are not those of real and imaginary part"
        remedy = "give them as WAMIT writes them, the phase in degrees"
        raise InputError(f"{where}, line {lines[int(np.argmax(inconsistent))]}", problem, remedy)
    answer = np.zeros(counts.shape, np.complex128)
    answer[mode, i, j] = value
    answer[3:] /= length_m
    source = f"{where}, WAMIT"
    return FileRaos(where, source, heading, 1.0 / period, answer, symmetry, origin, phases)


def _wamit_rows(path: Path) -> tuple[Vector, list[int]]:
    """Return the numbers, (rows, 7), and the line of each. Raises InputError."""
    try:
        text = path.read_text(encoding="utf-8").splitlines()
    except (OSError, UnicodeDecodeError) as error:
        raise unreadable(path, error) from None
    rows, lines = list[list[float]](), list[int]()
    for number, line in enumerate(text, 1):
        where, remedy = f"{path}, line {number}", f"a row is {_WAMIT}"
        cells = line.replace("D", "E").split()
        if not cells:
            continue
        try:
            values = [float(cell) for cell in cells]
        except ValueError:
            if number == 1:
                continue  # titles
            problem = f"'{line.strip()[:40]}' are not numbers"
            raise InputError(where, problem, remedy) from None
        if len(values) != 7:
            raise InputError(where, f"{len(values)} numbers", remedy)
        period, _, mode, modulus = values[:4]
        for fault, problem, right in (
            (not np.isfinite(values).all(), "a number is not finite", remedy),
            (period <= 0.0, f"PER is {period:g}",
             "give periods in seconds above 0 (WAMIT: IPEROUT = 1)"),
            (mode not in range(1, _MODES + 1), f"mode {mode:g}",
             "give the six rigid modes of one body, 1 to 6"),
            (modulus < 0.0, f"modulus {modulus:g}", "give 0 or more"),
        ):  # fmt: skip
            if fault:
                raise InputError(where, problem, right)
        rows.append(values)
        lines.append(number)
    if not rows:
        raise InputError(str(path), "it has no rows", f"a row is {_WAMIT}")
    return np.array(rows), lines


def _grouped(values: Vector) -> Vector:
    """Return the different values in order; those equal to seven digits are one."""
    ordered = np.unique(values)
    new = np.append(True, np.diff(ordered) > 1e-7 * np.abs(ordered[1:]))
    return np.asarray(ordered[new])


def _index(axis: Vector, values: Vector) -> NDArray[np.int64]:
    """Return the number of each value on its axis."""
    return np.asarray(np.abs(values[:, None] - axis[None, :]).argmin(axis=1), np.int64)


class _DataSet:
    """Variables of the file by their dimensions."""

    def __init__(self, file: Any, where: str) -> None:
        self._file, self.where = file, where

    def has(self, name: str) -> bool:
        """Return whether there is such a variable."""
        return name in self._file.variables

    def values(self, name: str, *dimensions: str) -> Vector:
        """Return a variable with these dimensions in this order, those of length 1 left out.

        Raises:
            InputError: it is missing, or has other dimensions.
        """
        if not self.has(name):
            problem = f"there is no variable {name}"
            raise InputError(self.where, problem, "give a data set as Capytaine exports it")
        variable = self._file.variables[name]
        axes, numbers = list(variable.dimensions), np.asarray(variable[...], np.float64)
        for axis in reversed(range(len(axes))):
            if axes[axis] not in dimensions and numbers.shape[axis] == 1:
                numbers = numbers.squeeze(axis)
                del axes[axis]
        if sorted(axes) != sorted(dimensions):
            problem = f"{name} has the dimensions {', '.join(variable.dimensions) or 'none'}"
            raise InputError(self.where, problem, f"needed are {', '.join(dimensions)}")
        return np.transpose(numbers, [axes.index(dimension) for dimension in dimensions])

    def complex(self, name: str, *dimensions: str) -> Answers:
        """Return a complex variable. Raises InputError as `values`."""
        parts = self.values(name, "complex", *dimensions)
        names = self.names("complex")
        if names != ["re", "im"]:
            problem = f"the dimension complex is {', '.join(names)}"
            raise InputError(self.where, problem, "it must be re, im")
        return np.asarray(parts[0] + 1j * parts[1], np.complex128)

    def names(self, name: str) -> list[str]:
        """Return the texts of a coordinate."""
        raw = self._file.variables[name][...] if self.has(name) else ()
        return [
            entry.decode() if isinstance(entry, bytes) else str(entry) for entry in np.ravel(raw)
        ]

    def dimensions(self, name: str) -> tuple[str, ...]:
        """Return the dimensions of a variable."""
        return tuple(self._file.variables[name].dimensions)


def read_capytaine(path: Path, conventions: RaoConventions) -> FileRaos:
    """Read the RAOs of a file.

    Raises:
        InputError: h5netcdf is not installed, the file is invalid, or a convention is missing.
    """
    where = str(path)
    if importlib.util.find_spec("h5netcdf") is None or importlib.util.find_spec("h5py") is None:
        problem = "reading netCDF needs h5netcdf and h5py, and they are not there"
        raise InputError(where, problem, "install them with `pip install 'rope_twin[planning]'`")
    with path.open("rb") as stream:
        if stream.read(len(_HDF5)) != _HDF5:
            remedy = "export it with `capytaine.export_dataset` or xarray's engine h5netcdf"
            raise InputError(where, "it is not a netCDF 4 file", remedy)
    import h5netcdf  # optional

    try:
        with h5netcdf.File(path, "r") as file:
            return _written(_DataSet(file, where), conventions)
    except (OSError, RuntimeError, ValueError, KeyError, TypeError) as error:
        message = " ".join(str(error).split())[:120]
        remedy = "give a data set as Capytaine exports it"
        raise InputError(where, f"it cannot be read ({message})", remedy) from None


def _written(data: _DataSet, conventions: RaoConventions) -> FileRaos:
    """Return the RAOs of an open file. Raises InputError."""
    where = data.where
    states = data.has("rotation_center")
    needed = ("symmetry",) if states else ("symmetry", "origin_m")
    conventions.require(where, needed, "the data set states it itself")
    convention = str(data._file.attrs.get("incoming_waves_convention", "Nemoh"))
    if convention.lower() != "nemoh":
        problem = f"incoming_waves_convention is '{convention}'"
        raise InputError(where, problem, "give a data set with Capytaine's own, exp(-iωt)")
    if data.has("forward_speed") and data.values("forward_speed").any():
        problem = "its RAOs are those of a vessel with forward speed"
        raise InputError(where, problem, "give RAOs at zero speed")
    direction = data.values("wave_direction", "wave_direction")
    names = ("RAO", "excitation_force", "Froude_Krylov_force")
    variable = next((name for name in names if data.has(name)), None)
    if variable is None:
        raise InputError(where, "there is neither RAO nor excitation_force", _ADD_RAO)
    axis = next((name for name in _FREQUENCIES if name in data.dimensions(variable)), None)
    if axis is None:
        problem = f"{variable} has no dimension omega, freq or period"
        raise InputError(where, problem, "give a data set over wave frequencies")
    values = data.values(axis, axis)
    if not (np.isfinite(values).all() and (values > 0.0).all()):
        problem = f"{axis} is not finite and above 0 everywhere"
        raise InputError(where, problem, "leave the limits of 0 and infinity out")
    frequency = {"omega": values / (2.0 * np.pi), "freq": values, "period": 1.0 / values}[axis]
    answer = np.conj(_raos(data, axis, frequency))
    origin = conventions.origin_m
    if origin is None:
        x, y, z = data.values("rotation_center", "space_coordinate").tolist()
        origin = (x, y, z)
    if not np.isfinite(origin).all():
        raise InputError(where, "rotation_center is not finite", "give one in the data set")
    return FileRaos(where, f"{where}, Capytaine", np.degrees(direction), frequency, answer,
                   conventions.symmetry, origin, (0.0, 0.0, 0.0))  # fmt: skip


def _raos(data: _DataSet, axis: str, frequency: Vector) -> Answers:
    """Return RAOs in Capytaine's convention, (6, h, f). Raises InputError."""
    if data.has("RAO"):
        dofs = (dimension for dimension in data.dimensions("RAO") if dimension.endswith("_dof"))
        dof = next(dofs, "radiating_dof")
        return data.complex("RAO", dof, "wave_direction", axis)[_order(data, dof)]
    missing = [name for name in (*_CONSTANT, *_PER_FREQUENCY) if not data.has(name)]
    if missing:
        problem = f"there is no RAO, and no {', '.join(missing)} to solve it from"
        raise InputError(data.where, problem, _ADD_RAO)
    pair = ("influenced_dof", "radiating_dof")
    rows, columns = (_order(data, dof) for dof in pair)
    A, B = (data.values(name, axis, *pair)[:, rows][:, :, columns] for name in _PER_FREQUENCY)
    M, C = (data.values(name, *pair)[rows][:, columns] for name in _CONSTANT)
    if data.has("excitation_force"):
        F = data.complex("excitation_force", axis, pair[0], "wave_direction")
    else:
        F = data.complex("Froude_Krylov_force", axis, pair[0], "wave_direction")
        F = F + data.complex("diffraction_force", axis, pair[0], "wave_direction")
    omega = (2.0 * np.pi * frequency)[:, None, None]
    impedance = -(omega**2) * (M + A) - 1j * omega * B + C
    try:
        solved = np.linalg.solve(impedance, F[:, rows])
    except np.linalg.LinAlgError:
        problem = "its equations of motion are singular"
        raise InputError(data.where, problem, "give the inertia of a body that floats") from None
    return np.asarray(np.moveaxis(solved, 0, 2))


def _order(data: _DataSet, dof: str) -> list[int]:
    """Return the places of surge to yaw in a dimension. Raises InputError."""
    names = [name.lower() for name in data.names(dof)]
    if sorted(names) != sorted(FREEDOMS):
        problem = f"its degrees of freedom are {', '.join(data.names(dof)) or 'not named'}"
        remedy = "give one rigid body with Surge, Sway, Heave, Roll, Pitch, Yaw"
        raise InputError(data.where, problem, remedy)
    return [names.index(name) for name in FREEDOMS]

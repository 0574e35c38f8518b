"""Displacement RAOs in a netCDF file of Capytaine, a data set of one rigid body.

Either the variable `RAO` is there (`capytaine.post_pro.rao`), or it is solved from the coefficients
of the data set: (-ω²·(M + A) - iω·B + C)·X = F (Capytaine's documentation, "Post-processing").
Complex numbers are in the dimension `complex` (re, im), as Capytaine exports them.

The time factor is exp(-iωt), so that RAOs here are the complex conjugates; `wave_direction` is the
direction of propagation [rad]; phases are relative to the wave at x = y = 0 of the mesh, motions
those of `rotation_center`. The mesh must have x to the bow and z up, as the vessel's axes.
"""

from __future__ import annotations

import importlib.util
from pathlib import Path
from typing import Any

import numpy as np

from rope_twin.errors import InputError
from rope_twin.sea.raos import FREEDOMS, Answers, RaoConventions, Written
from rope_twin.sea.tables import Vector

_HDF5 = b"\x89HDF\r\n\x1a\n"
_FREQUENCIES = ("omega", "freq", "period")
_COEFFICIENTS = ("inertia_matrix", "hydrostatic_stiffness", "added_mass", "radiation_damping")


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
            what = f"there is no variable {name}"
            raise InputError(self.where, what, "give a data set as Capytaine exports it")
        variable = self._file.variables[name]
        own, numbers = list(variable.dimensions), np.asarray(variable[...], np.float64)
        for axis in reversed(range(len(own))):
            if own[axis] not in dimensions and numbers.shape[axis] == 1:
                numbers = numbers.squeeze(axis)
                del own[axis]
        if sorted(own) != sorted(dimensions):
            what = f"{name} has the dimensions {', '.join(variable.dimensions) or 'none'}"
            raise InputError(self.where, what, f"needed are {', '.join(dimensions)}")
        return np.transpose(numbers, [own.index(one) for one in dimensions])

    def complex(self, name: str, *dimensions: str) -> Answers:
        """Return a complex variable. Raises InputError as `values`."""
        parts = self.values(name, "complex", *dimensions)
        names = self.names("complex")
        if names != ["re", "im"]:
            what = f"the dimension complex is {', '.join(names)}"
            raise InputError(self.where, what, "it must be re, im")
        return np.asarray(parts[0] + 1j * parts[1], np.complex128)

    def names(self, name: str) -> list[str]:
        """Return the texts of a coordinate."""
        raw = self._file.variables[name][...] if self.has(name) else ()
        return [one.decode() if isinstance(one, bytes) else str(one) for one in np.ravel(raw)]

    def dimensions(self, name: str) -> tuple[str, ...]:
        """Return the dimensions of a variable."""
        return tuple(self._file.variables[name].dimensions)


def read_capytaine(path: Path, conventions: RaoConventions) -> Written:
    """Read the RAOs of a file.

    Raises:
        InputError: h5netcdf is not installed, the file is invalid, or a convention is missing.
    """
    where = str(path)
    if importlib.util.find_spec("h5netcdf") is None or importlib.util.find_spec("h5py") is None:
        what = "reading netCDF needs h5netcdf and h5py, and they are not there"
        raise InputError(where, what, "install them with `pip install 'rope_twin[planning]'`")
    with path.open("rb") as stream:
        if stream.read(len(_HDF5)) != _HDF5:
            right = "export it with `capytaine.export_dataset` or xarray's engine h5netcdf"
            raise InputError(where, "it is not a netCDF 4 file", right)
    import h5netcdf  # optional

    try:
        with h5netcdf.File(path, "r") as file:
            return _written(_DataSet(file, where), conventions)
    except (OSError, RuntimeError, ValueError, KeyError, TypeError) as error:
        words = " ".join(str(error).split())[:120]
        right = "give a data set as Capytaine exports it"
        raise InputError(where, f"it cannot be read ({words})", right) from None


def _written(data: _DataSet, conventions: RaoConventions) -> Written:
    """Return the RAOs of an open file. Raises InputError."""
    where = data.where
    states = data.has("rotation_center")
    needed = ("symmetry",) if states else ("symmetry", "origin_m")
    conventions.require(where, needed, "the data set states it itself")
    convention = str(data._file.attrs.get("incoming_waves_convention", "Nemoh"))
    if convention.lower() != "nemoh":
        what = f"incoming_waves_convention is '{convention}'"
        raise InputError(where, what, "give a data set with Capytaine's own, exp(-iωt)")
    if data.has("forward_speed") and data.values("forward_speed").any():
        what = "its RAOs are those of a vessel with forward speed"
        raise InputError(where, what, "give RAOs at zero speed")
    direction = data.values("wave_direction", "wave_direction")
    variable = "RAO" if data.has("RAO") else "excitation_force"
    if not data.has(variable):
        variable = "Froude_Krylov_force"
    if not data.has(variable):
        what = "there is neither RAO nor excitation_force"
        raise InputError(where, what, "add `dataset['RAO'] = capytaine.post_pro.rao(dataset)`")
    axis = next((one for one in _FREQUENCIES if one in data.dimensions(variable)), None)
    if axis is None:
        what = f"{variable} has no dimension omega, freq or period"
        raise InputError(where, what, "give a data set over wave frequencies")
    given = data.values(axis, axis)
    if not (np.isfinite(given).all() and (given > 0.0).all()):
        what = f"{axis} is not finite and above 0 everywhere"
        raise InputError(where, what, "leave the limits of 0 and infinity out")
    frequency = {"omega": given / (2.0 * np.pi), "freq": given, "period": 1.0 / given}[axis]
    answer = np.conj(_raos(data, axis, frequency))
    origin = conventions.origin_m
    if origin is None:
        x, y, z = (float(one) for one in data.values("rotation_center", "space_coordinate"))
        origin = (x, y, z)
    if not np.isfinite(origin).all():
        raise InputError(where, "rotation_center is not finite", "give one in the data set")
    return Written(where, f"{where}, Capytaine", np.degrees(direction), frequency, answer,
                   conventions.symmetry, origin, (0.0, 0.0, 0.0))  # fmt: skip


def _raos(data: _DataSet, axis: str, frequency: Vector) -> Answers:
    """Return RAOs in Capytaine's convention, (6, h, f). Raises InputError."""
    if data.has("RAO"):
        dof = next((one for one in data.dimensions("RAO") if one.endswith("_dof")), "radiating_dof")
        own = data.complex("RAO", dof, "wave_direction", axis)
        return own[_order(data, dof)]
    missing = [name for name in _COEFFICIENTS if not data.has(name)]
    if missing:
        what = f"there is no RAO, and no {', '.join(missing)} to solve it from"
        raise InputError(data.where, what, "add `dataset['RAO'] = capytaine.post_pro.rao(dataset)`")
    pair = ("influenced_dof", "radiating_dof")
    rows, columns = (_order(data, dof) for dof in pair)
    A, B = (
        data.values(name, axis, *pair)[:, rows][:, :, columns]
        for name in ("added_mass", "radiation_damping")
    )
    M, C = (
        data.values(name, *pair)[rows][:, columns]
        for name in ("inertia_matrix", "hydrostatic_stiffness")
    )
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
        what = "its equations of motion are singular"
        raise InputError(data.where, what, "give the inertia of a body that floats") from None
    return np.asarray(np.moveaxis(solved, 0, 2))


def _order(data: _DataSet, dof: str) -> list[int]:
    """Return the places of surge to yaw in a dimension. Raises InputError."""
    names = [name.lower() for name in data.names(dof)]
    if sorted(names) != sorted(FREEDOMS):
        what = f"its degrees of freedom are {', '.join(data.names(dof)) or 'not named'}"
        right = "give one rigid body with Surge, Sway, Heave, Roll, Pitch, Yaw"
        raise InputError(data.where, what, right)
    return [names.index(name) for name in FREEDOMS]

"""Table of forces on a cylinder in forced cross-flow motion: C_Lv and C_a.

C_Lv is the lift in phase with velocity (positive: it excites the motion), C_a the added mass, over
amplitude A/D and frequency f·D/U (first measured by Gopalkrishnan 1993). The package's table is in
config/viv, with its source in its header; a scene can name another one (`own_forces`).

The forces on nodes follow from the table and running means of the motion; the model and its
derivation are described in rope_twin.vortex.decomposed_response ([GE], [SJTU] ch. 5). The table is
bilinear between its rows, constant beyond its ends.
"""

from __future__ import annotations

from functools import lru_cache
from math import cos, pi, sqrt
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from rope_twin.core.jit.decorators import jit, jit_entry
from rope_twin.core.state import Floats
from rope_twin.errors import InputError
from rope_twin.files import share_dir
from rope_twin.sea.tables import find_table, read_grid

FORCES_FOLDER = "viv"
RANGES = {  # of a table's columns: far beyond what was measured, against other units or signs
    "frequency": (0.01, 2.0), "amplitude": (0.0, 3.0), "C_Lv": (-20.0, 5.0), "C_a": (-5.0, 10.0),
}  # fmt: skip


class ForceTable(NamedTuple):
    """Force coefficients, bilinear between rows; constant beyond the ends."""

    frequency: Floats  # f·D/U, ascending, (n,)
    amplitude: Floats  # A/D, ascending, (m,)
    lift: Floats  # C_Lv, (n, m)
    added_mass: Floats  # C_a, (n, m)

    def lift_along(self, amplitude: float, frequency: Floats) -> Floats:
        """Return C_Lv of one amplitude for all frequencies."""
        return np.interp(frequency, self.frequency, self._row(self.lift, amplitude))

    def added_mass_row(self, amplitude: float) -> Floats:
        """Return C_a of one amplitude at the table's frequencies."""
        return self._row(self.added_mass, amplitude)

    def _row(self, values: Floats, amplitude: float) -> Floats:
        at = min(max(amplitude, self.amplitude[0]), self.amplitude[-1])
        j = int(np.searchsorted(self.amplitude, at, side="right")) - 1
        j = min(j, len(self.amplitude) - 2)
        v = (at - self.amplitude[j]) / (self.amplitude[j + 1] - self.amplitude[j])
        return np.asarray((1.0 - v) * values[:, j] + v * values[:, j + 1])


@lru_cache
def fitted_forces() -> ForceTable:
    """Return the table of the package: a fit, as its header states."""
    return read_force_table(share_dir() / "config" / "viv" / "fitted_forces.csv")


def read_force_table(path: Path) -> ForceTable:
    """Read a table with the columns frequency, amplitude, C_Lv and C_a.

    Raises:
        InputError: it cannot be read, or its rows are not a full grid.
    """
    frequency, amplitude, forces = read_grid(path, ("frequency", "amplitude"), ("C_Lv", "C_a"))
    return ForceTable(frequency, amplitude, forces["C_Lv"], forces["C_a"])


def own_forces(name_or_path: str) -> ForceTable:
    """Return the table of a name in config/viv or of a path, checked.

    Raises:
        InputError: there is no such file, it is no full grid of finite numbers, a number is out of
            range, or C_Lv excites at no amplitude or at any, however large.
    """
    path = find_table(name_or_path, FORCES_FOLDER).resolve()
    stat = path.stat()
    return _checked(path, stat.st_mtime_ns, stat.st_size)


@lru_cache(maxsize=8)
def _checked(path: Path, changed_ns: int, size: int) -> ForceTable:
    """Return the checked table of a file; it is read again once the file has changed."""
    table = read_force_table(path)
    for (name, (low, high)), values in zip(RANGES.items(), table, strict=True):
        beyond = np.argwhere((values < low) | (values > high))
        if len(beyond):
            first = tuple(beyond[0])
            where = name if values.ndim == 1 else f"{name} at {_place(table, *first)}"
            problem = f"{where} is {values[first]:g}"
            raise InputError(str(path), problem, f"give {low:g} to {high:g}")
    if not (table.lift > 0.0).any():
        remedy = "give lift in phase with velocity, positive where it excites the motion"
        raise InputError(str(path), "C_Lv is nowhere positive, so nothing is excited", remedy)
    unlimited = np.flatnonzero(table.lift[:, -1] > 0.0)
    if len(unlimited):
        i, j = int(unlimited[0]), len(table.amplitude) - 1
        problem = (
            f"C_Lv is still {table.lift[i, j]:g} at {_place(table, i, j)}, the largest amplitude"
        )
        remedy = "add amplitudes up to one where it is 0 or less, which limits the motion"
        raise InputError(str(path), problem, remedy)
    return table


def _place(table: ForceTable, i: int, j: int) -> str:
    return f"frequency {table.frequency[i]:g}, amplitude {table.amplitude[j]:g}"


def power_in_band(table: ForceTable, amplitude: float) -> tuple[float, float] | None:
    """Return between which frequencies f·D/U the C_Lv of an amplitude is positive.

    About its largest value, by straight lines, up to the table's ends; None: nowhere positive.
    """
    row, f = table.lift_along(amplitude, table.frequency), table.frequency
    at = int(row.argmax())
    if row[at] <= 0.0:
        return None
    i = j = at
    while i > 0 and row[i] > 0.0:
        i -= 1
    while j < len(f) - 1 and row[j] > 0.0:
        j += 1
    low, high = f[i], f[j]
    if row[i] <= 0.0:
        low = f[i] - row[i] * (f[i + 1] - f[i]) / (row[i + 1] - row[i])
    if row[j] <= 0.0:
        high = f[j] - row[j] * (f[j] - f[j - 1]) / (row[j] - row[j - 1])
    return float(low), float(high)


def centre_of(table: ForceTable, amplitude: float, band: tuple[float, float]) -> float:
    """Return the frequency of the table with the largest C_Lv within a band.

    The mean of several equal ones; where no frequency lies in the band, its middle.
    """
    f = table.frequency[(table.frequency >= band[0]) & (table.frequency <= band[1])]
    if not len(f):
        return 0.5 * (band[0] + band[1])
    row = table.lift_along(amplitude, f)
    return float(f[row == row.max()].mean())


MIN_AMPLITUDE = 0.02  # [D]: minimum amplitude for which damping is evaluated


class Nodes(NamedTuple):
    """Constants of the free nodes between two modal analyses, (n,)."""

    push: Floats  # ½·ρ·D·U² times length [N]
    water: Floats  # displaced water [kg]
    dry: Floats  # mass without added mass [kg]
    diameter: Floats  # [m]
    speed: Floats  # of the water across the rope [m/s]
    omega: Floats  # initial frequency, before it has moved [rad/s]


class NodeExcitation(NamedTuple):
    """Modes excited by each node: of node n the entries first[n] to first[n + 1]."""

    first: NDArray[Any]  # (n + 1,)
    mode: NDArray[Any]  # (entries,)
    part: Floats  # fraction of the node, with the sign of the mode there
    omega: Floats  # of the modes [rad/s], (k,)
    angle: Floats  # their phases at the origin of `since` [rad]


@jit_entry
def node_forces(
    table: Any, nodes: Any, drives: Any, amplitude: Any, omega: Any, since: float, h: float,
    structural: float, mass: Any, damping: Any, middle: Any, end: Any, turn: Any,
) -> None:  # fmt: skip
    """Write mass [kg], damping [N·s/m] and the forces in the middle and at the end of a step [N].

    amplitude: [D]; omega: measured frequency of the motion; since: start of the step; turn:
    scratch, (2, k).
    """
    for k in range(drives.omega.shape[0]):
        turn[0, k] = cos(drives.omega[k] * (since + 0.5 * h) + drives.angle[k])
        turn[1, k] = cos(drives.omega[k] * (since + h) + drives.angle[k])
    i = j = 0
    for n in range(amplitude.shape[0]):
        reduced = omega[n] / (2.0 * pi) * nodes.diameter[n] / nodes.speed[n]
        i, j = _below(table.frequency, reduced, i), _below(table.amplitude, amplitude[n], j)
        u, v = _share(table.frequency, reduced, i), _share(table.amplitude, amplitude[n], j)
        lift = _between(table.lift, i, j, u, v)
        added = _between(table.added_mass, i, j, u, v)
        mass[n] = max(nodes.dry[n] + added * nodes.water[n], 0.1 * nodes.dry[n])
        size = max(amplitude[n], MIN_AMPLITUDE) * nodes.diameter[n]
        against = nodes.push[n] * max(-lift, 0.0) / (size * omega[n])
        damping[n] = against + 2.0 * structural * omega[n] * mass[n]
        middle[n] = end[n] = 0.0
        for entry in range(drives.first[n], drives.first[n + 1]):
            push = drives.part[entry] * nodes.push[n] * max(lift, 0.0)
            middle[n] += push * turn[0, drives.mode[entry]]
            end[n] += push * turn[1, drives.mode[entry]]


@jit_entry
def update_means(
    nodes: Any, motion: Any, share: float, squares: Any, amplitude: Any, omega: Any
) -> None:
    """Update the running means of ẏ² and ÿ² by a fraction; ω = rms(ÿ)/rms(ẏ), A = √2·rms(ẏ)/ω."""
    for n in range(amplitude.shape[0]):
        speed, acceleration = motion.speed[n], motion.acceleration[n]
        squares[0, n] += share * (speed * speed - squares[0, n])
        squares[1, n] += share * (acceleration * acceleration - squares[1, n])
        rms = sqrt(2.0 * squares[0, n])
        known = rms > MIN_AMPLITUDE * nodes.diameter[n] * nodes.omega[n]
        omega[n] = sqrt(squares[1, n] / squares[0, n]) if known else nodes.omega[n]
        amplitude[n] = rms / omega[n] / nodes.diameter[n]


@jit_entry
def solve_added_mass(
    knots: Any, values: Any, ratio: Any, weight: Any, given: Any, dry: Any, wet: Any,
    rounds: int, same: float, added: Any, frequency: Any,
) -> None:  # fmt: skip
    """Solve for natural frequencies f = f_1·√(M_1/(M + C_a·m)) with the added mass at f.

    Of each mode: given f_1 [Hz], dry M and wet M_1 [kg]; weight: displaced water of the nodes times
    φ² [kg], (modes, nodes), m its sum; C_a its mean with that weight, read along the nodes at
    f·D/U, `ratio` of D to U [s]; fixed-point iteration with the mean of two successive iterates
    until they agree.
    """
    for k in range(added.shape[0]):
        moved = 0.0
        for n in range(ratio.shape[0]):
            moved += weight[k, n]
        for _ in range(rounds):
            whole, i = 0.0, 0
            for n in range(ratio.shape[0]):
                reduced = frequency[k] * ratio[n]
                i = _below(knots, reduced, i)
                u = _share(knots, reduced, i)
                whole += weight[k, n] * ((1.0 - u) * values[i] + u * values[i + 1])
            mean = 0.5 * (added[k] + whole / moved)
            done = abs(mean - added[k]) < same
            added[k] = mean
            frequency[k] = given[k] * sqrt(wet[k] / (dry[k] + mean * moved))
            if done:
                break


@jit
def _below(knots: Any, at: float, guess: int) -> int:
    """Return the index of the knot below, of all but the last, searched from a guess."""
    i, last = guess, knots.shape[0] - 2
    while i < last and at >= knots[i + 1]:
        i += 1
    while i > 0 and at < knots[i]:
        i -= 1
    return i


@jit
def _share(knots: Any, at: float, i: int) -> float:
    """Return the fraction of the way from knot i to the next, from 0 to 1."""
    share = (at - knots[i]) / (knots[i + 1] - knots[i])
    return float(min(max(share, 0.0), 1.0))


@jit
def _between(table: Any, i: int, j: int, u: float, v: float) -> float:
    low = (1.0 - v) * table[i, j] + v * table[i, j + 1]
    high = (1.0 - v) * table[i + 1, j] + v * table[i + 1, j + 1]
    return float((1.0 - u) * low + u * high)

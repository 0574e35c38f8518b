"""VIV models beside the time step, which amplify the drag in it.

**modal_vibration**: Modal VIV model: cross-flow vibration in natural modes, and drag amplification.

[LCD] Le Cunff and Durand (1999), eqs 1-9: the natural modes of the rope in its present shape are
locked in where U/(f·d) lies in a band; there the lift C_c·C_l(A/d) excites them (two parabolas,
Venugopal 1996), elsewhere the water damps them. A place excites the mode nearest to its shedding
frequency (`lock_in: nearest`, the rule that the paper prints) or, of those locked in there, the one
with the largest response (`strongest`). The response is decoupled from the step, on a mesh of its
own (rope_twin.vortex.modal_response, rope_twin.vortex.coupled), with the modal analysis repeated as
tension and paid-out length change: elements and step of the scene need not resolve it.

The feedback on the rope is in the step: the drag coefficient at each node is multiplied by 1 +
a·(2·rms/d)^b (Vandiver 1983: a = 1.043, b = 0.65), averaged over the rope that the node represents.

**decomposed_force**: Force-decomposition VIV model with amplitude-dependent added mass, and drag
amplification.

[GE] Ge, Added mass effect on VIV for flexible risers (2018); [SJTU] thesis on ultra-slender
flexible structures, ch. 5. The component of the lift in phase with the velocity, C_Lv(A/D, f·D/U),
excites the rope where it is positive and damps it elsewhere; the component in antiphase with the
acceleration is an added mass C_a(A/D, f·D/U); both from a table (config/viv, its source is in its
header; or one of the user's own, `table`). A pre-analysis determines which mode each place excites
and its natural frequency; amplitude and frequency are measured from the running motion. All this is
decoupled from the step, on a mesh of its own (rope_twin.vortex.decomposed_response,
rope_twin.vortex.coupled), and the pre-analysis is repeated as tension and paid-out length change:
elements and step of the scene need not resolve it.

The feedback on the rope is in the step: the drag coefficient at each node is multiplied by 1 +
a·(2·rms/d)^b (Vandiver 1983: a = 1.043, b = 0.65), averaged over the rope that the node represents.
"""

from __future__ import annotations

from dataclasses import dataclass
from hashlib import sha256
from typing import NamedTuple

from rope_twin.errors import InputError
from rope_twin.quantity import SparingRepr, quantity, text
from rope_twin.sea.tables import find_table
from rope_twin.vortex.drag_amplification import DragGrowthParams, build_growth
from rope_twin.vortex.force_table import (
    FORCES_FOLDER,
    ForceTable,
    centre_of,
    own_forces,
    power_in_band,
)
from rope_twin.vortex.shedding import LOCK_IN


@dataclass(frozen=True, kw_only=True)
class ModalVibrationParams(DragGrowthParams):
    """Published coefficients; lift by Venugopal (1996), drag amplification by Vandiver (1983)."""

    damping_fraction: float = quantity(
        "structural damping ratio of every mode; 1.5 % of the paper is read as a loss factor", "",
        0.0, 0.5, default=0.0075,
    )  # fmt: skip
    strouhal: float = quantity("Strouhal number St", "", 0.05, 0.5, default=0.17)
    band: tuple[float, float] = quantity(
        "lock-in range of the reduced velocity U/(f·d)", "", 1.0, 30.0, default=(5.0, 7.0)
    )
    lift: tuple[float, float] = quantity(
        "C_l at zero amplitude, and its maximum", "", 0.0, 3.0, default=(0.3, 0.7)
    )
    lift_at: tuple[float, float] = quantity(
        "A/d at the maximum of C_l, and at C_l = 0", "", 0.01, 10.0, default=(0.5, 1.0)
    )
    lift_factor: float = quantity(
        "factor C_c of the lift, for its phase and the extent of the excited zone", "", 0.01, 1.0,
        default=1.0,
    )  # fmt: skip
    lock_in: str = text("mode that a place excites: nearest or strongest", "nearest")
    viscosity_m2_per_s: float = quantity(
        "kinematic viscosity ν of water", "m²/s", 1e-7, 1e-4, default=1.3e-6
    )

    def check(self) -> str | None:
        """Return a fault of band or lift_at (ascending) or of lock_in, or None."""
        if self.lock_in not in LOCK_IN:
            return f"unknown lock_in '{self.lock_in}'; give one of {', '.join(LOCK_IN)}"
        if not self.band[0] < self.band[1]:
            return f"band from {self.band[0]:g} to {self.band[1]:g}; give the lower one first"
        if not self.lift_at[0] < self.lift_at[1]:
            return f"lift_at {self.lift_at[0]:g} and {self.lift_at[1]:g}; give the lower one first"
        return None

    @property
    def strouhal_number(self) -> float:
        """Return the Strouhal number of the vortex shedding."""
        return self.strouhal


BAND = (0.125, 0.2)  # of the package's table


class CustomForces(NamedTuple):
    """A force table of the user's own, and the numbers by which the pre-analysis reads it."""

    forces: ForceTable
    band: tuple[float, float]
    centre: float
    amplitude: float


@dataclass(frozen=True, kw_only=True, repr=False)
class CustomForceTable:
    """A force table of the user's own.

    Its `repr`, of which digests are made, has the content of the file in place of its path: a study
    stays valid where the table is moved, not where it is changed.
    """

    path: str = text("table of frequency, amplitude, C_Lv, C_a: name in config/viv, or path")
    band: tuple[float, float] | None = quantity(
        "range of f·D/U of power-in; default: where C_Lv is positive at power_amplitude", "", 0.02,
        1.0, default=None,
    )  # fmt: skip
    centre: float | None = quantity(
        "f·D/U with which lock_in `nearest` compares modes; default: of the largest C_Lv", "",
        0.02, 1.0, default=None,
    )  # fmt: skip
    power_amplitude: float = quantity(
        "A/D at which the powers of the modes are compared", "", 0.01, 2.0, default=0.5
    )

    def __repr__(self) -> str:
        try:
            content = sha256(find_table(self.path, FORCES_FOLDER).read_bytes()).hexdigest()[:16]
        except (InputError, OSError):
            content = "unreadable"
        figures = f"band={self.band}, centre={self.centre}, power_amplitude={self.power_amplitude}"
        return f"CustomForceTable(content={content}, {figures})"

    def figures(self) -> CustomForces:
        """Return the table, its band, centre and amplitude.

        Raises:
            InputError: there is no such table, or it breaks a rule.
        """
        forces, amplitude = own_forces(self.path), self.power_amplitude
        band = self.band or power_in_band(forces, amplitude) or (0.0, 0.0)
        centre = centre_of(forces, amplitude, band) if self.centre is None else self.centre
        return CustomForces(forces, band, centre, amplitude)

    def check(self) -> str | None:
        """Return a fault of the table, or of a number that does not fit it, or None."""
        try:
            forces, (low, high), centre, amplitude = self.figures()
        except InputError as error:
            return str(error)
        f, a = forces.frequency, forces.amplitude
        if not a[0] <= amplitude <= a[-1]:
            return (
                f"power_amplitude {amplitude:g} is outside the table's {a[0]:g} to {a[-1]:g}; give "
                "one of its amplitudes"
            )
        if power_in_band(forces, amplitude) is None:
            return (
                f"C_Lv of the table is nowhere positive at power_amplitude {amplitude:g}; give an "
                "amplitude that is excited"
            )
        if not f[0] <= low < high <= f[-1]:
            return (
                f"band from {low:g} to {high:g}; give two ascending frequencies of the table's "
                f"{f[0]:g} to {f[-1]:g}"
            )
        if not low <= centre <= high:
            return f"centre {centre:g} is outside the band of {low:g} to {high:g}; give one in it"
        return None


@dataclass(frozen=True, kw_only=True, repr=False)
class DecomposedForceParams(SparingRepr, DragGrowthParams):
    """Published coefficients; structural damping, which [GE] does not give, as in [LCD]."""

    _later = frozenset(("table",))

    band: tuple[float, float] = quantity(
        "range of f·D/U of power-in (lock-in)", "", 0.02, 1.0, default=BAND
    )
    table: CustomForceTable | None = text("force table of the user's own", None)
    lock_in: str = text("mode that a place excites: strongest or nearest", "strongest")
    added_mass: float | None = quantity(
        "constant C_a; default: variable, from the table", "", 0.0, 10.0, default=None
    )

    @property
    def strouhal_number(self) -> float | None:
        """Return f·D/U of the largest power-in of the user's own table; None without one."""
        return None if self.table is None else self.table.figures().centre

    @property
    def tables(self) -> tuple[tuple[str, str], ...]:
        """Return name or path of each table that is read, and its folder in config."""
        return () if self.table is None else ((self.table.path, FORCES_FOLDER),)

    def check(self) -> str | None:
        """Return a fault of the band (ascending, one) or of lock_in, or None."""
        if self.table is not None and self.band != BAND:
            return "`band` is given beside `table`; give it in `table`, to which it belongs"
        if self.lock_in not in LOCK_IN:
            return f"unknown lock_in '{self.lock_in}'; give one of {', '.join(LOCK_IN)}"
        if not self.band[0] < self.band[1]:
            return f"band from {self.band[0]:g} to {self.band[1]:g}; give the lower one first"
        return None


build = build_growth

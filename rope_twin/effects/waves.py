"""Waves: Airy wave kinematics at rope and payload, stretched to the surface.

A component with surface a·cos θ, θ = k·(x·cos β + y·sin β) - ω·t + φ, moves the water at z by

    u = a·ω·C·cos θ along its heading, w = a·ω·S·sin θ upward,
    C = cosh(k·(z + h))/sinh(k·h), S = sinh(k·(z + h))/sinh(k·h), both e^{k·z} in deep water

(DNV-RP-C205, 3.2.2), with accelerations a·ω²·C·sin θ and -a·ω²·S·cos θ. With [LCD] eqs 21 and 22, u
= π·H·f·e^{k·z}·cos 2πft and k = 4π²f²/g, for one deep-water wave. By `stretching`, z is Wheeler's
(1970) h·(z - η)/(h + η), which takes the surface to the mean level; or the node's own (`none`), or
with the kinematics above the mean level continued along their tangent there up to the surface
(`linear`, DNV-RP-C205, 3.3.3). It is at most 0, with `linear` at most η: above the surface the
water of the surface is used.

Several systems, such as a wind sea and swells from other directions, add up (`also`). Not included:
what is of second order in the steepness, so the mean drift of the water too.

The water's acceleration acts on the rope by ρ·A·(a + Ca·a_n) per metre, and by Ca along the rope
too where `added_mass` has it, on the payload by (ρ·V + added mass)·a on each axis (Froude-Krylov;
Morison et al. 1950).

Approximations: components are sorted from long to short, and a node uses only as many that the sum
of the others, Σ a·ω·e^{k·z}, is negligible there; nodes between others may be interpolated by a
cubic (core/waves); angles and decay are those of a nearby position and level, changed by a series
(core/waves). Their total error is below `neglected_m_per_s`.
"""

from __future__ import annotations

import math
from collections import Counter
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from rope_twin.core.jit.decorators import jit_within
from rope_twin.core.jit.rows import rows
from rope_twin.core.lanes.effects import by_lane
from rope_twin.core.loads.accounts import account
from rope_twin.core.loads.hooks import Load, differs_by_rope, kernel, scales_with_ramp
from rope_twin.core.state import FLOW_RATE, RESIDUAL, Floats
from rope_twin.core.wave_tables import (
    decay_table,
    levels_to,
    lowest_node_height,
    reach_levels,
    reflection_levels,
    rotation_ranges,
    stretch_thirds,
)
from rope_twin.core.waves import (
    ALWAYS_WET,
    BLOCK,
    BOTTOM_DECAY,
    DECAY_END,
    DECAY_LEVEL,
    DECAY_START,
    LEVEL,
    MAX_COMPONENTS,
    REACH_LEVEL,
    REFLECTION_LEVEL,
    ROTATION_RANGE,
    SEA_ROWS,
    STRETCH_THIRD,
    add_water,
)
from rope_twin.errors import InputError
from rope_twin.quantity import SparingRepr, quantity, text
from rope_twin.sea.spectrum import (
    DEEP,
    SHARES,
    SPECTRA_FOLDER,
    WaveSpectrum,
    irregular_waves,
    jonswap,
    read_spectrum,
    regular_wave,
    spread,
    together,
)
from rope_twin.sea.spectrum import Waves as Components


@dataclass(frozen=True, kw_only=True, repr=False)
class RegularWave(SparingRepr):
    """A regular wave; with phase 0 its crest passes the origin at t = 0."""

    _later = frozenset(("phase_deg",))

    height_m: float = quantity("wave height, trough to crest", "m", 0.0, 40.0)
    period_s: float = quantity("wave period", "s", 1.0, 40.0)
    phase_deg: float = quantity(
        "phase at the origin at t = 0: 0 crest, 180 trough", "°", -360.0, 360.0, default=0.0
    )


@dataclass(frozen=True, kw_only=True)
class Jonswap:
    """A JONSWAP spectrum by height and period; gamma 1 is Pierson-Moskowitz."""

    significant_height_m: float = quantity("significant wave height Hs", "m", 0.01, 30.0)
    peak_period_s: float = quantity("peak period Tp", "s", 1.0, 40.0)
    gamma: float | None = quantity(
        "peak enhancement γ; default: from Tp/√Hs", "", 1.0, 10.0, default=None
    )


@dataclass(frozen=True, kw_only=True)
class Measured:
    """A measured wave spectrum."""

    file: str = text("table of spectra: name in config/sea_states, or path")
    column: str = text("spectrum in the table: column heading, or its hour")

    def spectrum(self) -> WaveSpectrum:
        """Return the spectrum.

        Raises:
            InputError: there is no such file or column.
        """
        return read_spectrum(self.file, self.column)

    def check(self) -> str | None:
        """Return a fault if it cannot be read, or None."""
        try:
            self.spectrum()
        except InputError as error:
            return str(error)
        return None


STRETCHING = {"wheeler": (1.0, 0.0), "none": (0.0, 0.0), "linear": (0.0, 1.0)}


@dataclass(frozen=True, kw_only=True)
class WaveSystem:
    """Waves of one origin; exactly one of `regular`, `jonswap` and `measured`."""

    regular: RegularWave | None = text("a regular wave", None)
    jonswap: Jonswap | None = text("a JONSWAP spectrum", None)
    measured: Measured | None = text("a measured spectrum", None)
    components: int = quantity(
        "number of wave components of a spectrum", "", 2, MAX_COMPONENTS, 200
    )
    seed: int | None = quantity(
        "random seed of the phases; default: further numbers of the seed of `waves`",
        "", 0, 2**31, default=None,
    )  # fmt: skip
    heading_deg: float = quantity(
        "direction of propagation: 0 to the east, 90 to the north", "°", -360.0, 360.0, 0.0
    )
    spreading: float | None = quantity(
        "directional spreading exponent s, cos²ˢ form; omit for long-crested seas", "", 1.0, 100.0,
        default=None,
    )  # fmt: skip

    def check(self) -> str | None:
        """Return a fault unless exactly one sea state is given, or None."""
        given = [sea for sea in (self.regular, self.jonswap, self.measured) if sea is not None]
        if len(given) != 1:
            return f"{len(given)} sea states given; give one of regular, jonswap and measured"
        return None

    def waves(self, depth_m: float, gravity: float, seed: int, skipped: int) -> Components:
        """Return the wave components.

        seed: the system's own or that of `waves`; skipped: its numbers that others have used.

        Raises:
            InputError: there is no such spectrum.
        """
        heading = math.radians(self.heading_deg)
        if self.regular is not None:
            wave = self.regular
            return regular_wave(
                wave.height_m, wave.period_s, heading, depth_m, gravity,
                math.radians(wave.phase_deg),
            )  # fmt: skip
        if self.jonswap is not None:
            sea = self.jonswap
            spectrum = jonswap(sea.significant_height_m, sea.peak_period_s, sea.gamma)
        else:
            assert self.measured is not None, "checked when the scene was read"
            spectrum = self.measured.spectrum()
        found = irregular_waves(spectrum, self.components, seed, depth_m, gravity, skipped)
        return spread(found, heading, self.spreading, seed, skipped)


@dataclass(frozen=True, kw_only=True, repr=False)
class WavesParams(SparingRepr, WaveSystem):
    """Sea state: one system of waves, and others that come with it."""

    _later = frozenset(("also", "stretching"))

    seed: int = quantity("random seed of the phases", "", 0, 2**31, 1)
    also: tuple[WaveSystem, ...] = text("further systems, such as swells", ())
    stretching: str = text("kinematics up to the surface: wheeler, linear or none", "wheeler")
    depth_m: float | None = quantity(
        "water depth; default: deep water", "m", 1.0, 12e3, default=None
    )
    ramp_s: float = quantity("build-up time of the sea", "s", 0.0, 600.0, 8.0)
    neglected_m_per_s: float = quantity(
        "bound of the approximation error of the water velocity", "m/s", 0.0, 0.1, 3e-4
    )

    @property
    def systems(self) -> dict[str, WaveSystem]:
        """Return all systems by the name of their place in a scene."""
        return {"waves": self} | {f"waves.also[{k}]": own for k, own in enumerate(self.also)}

    @property
    def tables(self) -> tuple[tuple[str, str], ...]:
        """Return name or path of each table of spectra that is read, and its folder in config."""
        measured = [own.measured for own in self.systems.values() if own.measured is not None]
        return tuple((own.file, SPECTRA_FOLDER) for own in measured)

    def check(self) -> str | None:
        """Return a fault of the sea state (one), the stretching or the number of components."""
        if self.stretching not in STRETCHING:
            known = ", ".join(STRETCHING)
            return f"unknown stretching '{self.stretching}'; give one of {known}"
        count = sum(
            1 if own.regular is not None else own.components for own in self.systems.values()
        )
        if count > MAX_COMPONENTS:
            return f"{count} components in all; give at most {MAX_COMPONENTS}"
        return WaveSystem.check(self)


class Waves(NamedTuple):
    """Kernel data: components from long to short, in blocks."""

    table: Floats  # data of components, blocks and levels (core/waves), (SEA_ROWS, any)
    decays: Floats  # e^{kz} of components at levels, (1, any)
    blocks: int
    levels: int
    decay_levels: int
    steepest: float  # Σ a·k, maximum slope of the surface
    lowest: float  # z of nodes [m] below which waves are negligible
    depth: float  # [m]
    ramp: float  # [s]
    follows: float  # share of η that z is taken from: 1 with Wheeler's stretching, else 0
    dry_above: float  # 0, with `wetting`: the water need not move at dry nodes; or ALWAYS_WET [m]
    extends: float  # share of the tangent that is followed above the mean level: 1 or 0
    density: float  # of the water [kg/m³]
    Ca: float  # added mass coefficient of the rope
    apart: float  # the same less that along the rope
    Mx: float  # ρ·V + added mass of the payload [kg]
    My: float
    Mz: float


scales_with_ramp(Waves, "density", "Mx", "My", "Mz")
differs_by_rope(Waves)


def components_of(params: WavesParams, gravity: float) -> Components:
    """Return the wave components of a scene's sea state.

    Systems with one seed use its random numbers one after the other: with the same phases, waves
    of the same period would add up by amplitude instead of variance.

    Raises:
        InputError: there is no such spectrum.
    """
    depth, used, systems = params.depth_m or DEEP, Counter[int](), []
    for own in params.systems.values():
        seed = params.seed if own.seed is None else own.seed
        systems.append(own.waves(depth, gravity, seed, used[seed]))
        used[seed] += 0 if own.regular is not None else SHARES * own.components
    return systems[0] if len(systems) == 1 else together(systems)


def build(params: WavesParams, payload: Any, environment: Any) -> Waves:
    """Return the kernel data for the sea, the payload's inertia, and the rope's added mass."""
    density = environment.water_density_kg_per_m3
    sea = components_of(params, environment.gravity_m_per_s2)
    k, a, depth = sea.wave_number, sea.amplitude_m, sea.depth_m
    speed = a * sea.omega / (1.0 - np.exp(-2.0 * k * depth))
    felt = speed * np.maximum(sea.omega, 1.0)  # bounds velocity and acceleration
    levels, neglected = levels_to(depth), params.neglected_m_per_s
    reach_of_each = reach_levels(k, felt, depth, neglected)
    reach = reach_of_each[::BLOCK]
    blocks = len(reach)
    decay_levels, ends, starts, decays = decay_table(k, felt, reach_of_each, depth, neglected)
    table = np.zeros((SEA_ROWS, max(blocks * BLOCK, len(levels), blocks + 1, len(starts))))
    table[: BOTTOM_DECAY + 1, : len(k)] = (
        k * np.cos(sea.heading), k * np.sin(sea.heading), sea.omega, sea.phase, a, k,
        speed * np.cos(sea.heading), speed * np.sin(sea.heading), speed, np.exp(-2.0 * k * depth),
    )  # fmt: skip
    table[REACH_LEVEL, :blocks] = reach
    table[REFLECTION_LEVEL, :blocks] = reflection_levels(k[::BLOCK], depth)
    table[ROTATION_RANGE, : blocks + 1] = rotation_ranges(
        np.append(reach, 0.0), k, a, felt, depth, neglected
    )
    table[LEVEL, : len(levels)] = levels
    table[STRETCH_THIRD, : len(levels)] = stretch_thirds(levels, k, felt, depth, neglected)
    table[DECAY_LEVEL, : len(decay_levels)] = decay_levels
    table[DECAY_END, : len(ends)] = ends
    table[DECAY_START, : len(starts)] = starts
    inertia = [0.0] * 3
    if payload is not None:
        inertia = [density * payload.volume_m3 + added for added in payload.added_mass_kg]
    return Waves(
        table=table,
        decays=decays[np.newaxis],
        blocks=blocks,
        levels=len(levels),
        decay_levels=len(decay_levels),
        steepest=float(a @ k),
        lowest=lowest_node_height(float(reach[0]), float(a.sum()), depth),
        depth=depth,
        ramp=params.ramp_s,
        dry_above=0.0 if environment.wets else ALWAYS_WET,
        follows=STRETCHING[params.stretching][0],
        extends=STRETCHING[params.stretching][1],
        density=density,
        Ca=environment.added_mass,
        apart=environment.added_mass - environment.added_mass_along,
        Mx=inertia[0],
        My=inertia[1],
        Mz=inertia[2],
    )


@jit_within
def _ramp(waves: Any, time: float) -> Any:
    """Return the build-up factor of the sea, u³·(10 - 15u + 6u²), and its rate [1/s]."""
    if time >= waves.ramp:
        return 1.0, 0.0
    u = max(time / waves.ramp, 0.0)
    return u**3 * (10.0 - 15.0 * u + 6.0 * u * u), 30.0 * u * u * (1.0 - u) ** 2 / waves.ramp


@kernel("flow", Waves)
def flow(waves: Any, work: Any, stage: Any, low: int, high: int) -> None:
    """Add the wave velocity to flow; set its acceleration and the surface elevation."""
    add_water(waves, _ramp(waves, stage.time), work, stage.time, low, high)


@kernel("load", Waves, wide=True)
def load(waves: Any, node: Any, stage: Any) -> Any:
    """Return F = ρ·volume·(a + Ca·a - (Ca - Ct)·(a·τ)·τ) with the water's acceleration a."""
    x, y, z = node.tx, node.ty, node.tz
    along = node.wx * x + node.wy * y + node.wz * z
    m = waves.density * node.volume
    own, across = m * (1.0 + waves.Ca), m * waves.apart * along
    return Load(
        own * node.wx - across * x, own * node.wy - across * y, own * node.wz - across * z,
        0.0, 0.0, 0.0, 0.0, 0.0, 0.0,
    )  # fmt: skip


@kernel("load_end", Waves, wide=True)
def load_end(waves: Any, work: Any, stage: Any) -> None:
    """Add (ρ·V + added mass)·a on each axis to R_0."""
    ax, ay, az = rows(work, FLOW_RATE, 0)
    Rx, Ry, Rz = rows(work, RESIDUAL, 0)
    Rx[0] += waves.Mx * ax[0]
    Ry[0] += waves.My * ay[0]
    Rz[0] += waves.Mz * az[0]


by_lane(Waves, "flow")


@account("power", Waves)
def power(waves: Any, place: Any) -> Any:
    """Return the power of the inertia force [W]."""
    a, t = place.flow_rate, place.tangent
    along = (a * t).sum(axis=0) * t
    force = waves.density * place.volume * (a + waves.Ca * a - waves.apart * along)
    return (force * place.velocity).sum(axis=0)


@account("power_end", Waves)
def power_end(waves: Any, place: Any) -> Any:
    """Return the power of the inertia force on the payload [W]."""
    mass = np.array([[waves.Mx], [waves.My], [waves.Mz]])
    return (mass * place.flow_rate * place.velocity).sum(axis=0)

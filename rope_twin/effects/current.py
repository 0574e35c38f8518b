"""Current: a profile over depth, piecewise linear in speed components, or two layers.

Above the first and below the last point the end values hold. U is horizontal unless a row has a
third component, positive upward (up- and downwelling, the water over a slope, the tow of a line
that is not hauled: VzCrnt1 and VzCrnt2 of Laird, Fraser and Marsh, 2016). A time factor may scale
all depths alike.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from rope_twin.core.jit.decorators import jit_within
from rope_twin.core.jit.rows import rows
from rope_twin.core.jit.wide import bits, choose
from rope_twin.core.loads.hooks import kernel, wide_kernel
from rope_twin.core.state import FLOW, POSITION, Floats
from rope_twin.quantity import quantity, text

TOGETHER = 32  # nodes
STEP = 1e-3  # m, height of the transition between two layers

Velocity = tuple[float, ...]  # east, north and, if it has one, up [m/s]
Point = tuple[float, Velocity]


@dataclass(frozen=True, kw_only=True)
class Layers:
    """Two layers: one velocity from the surface to the split, another down to the bottom, none
    below.

    After Laird, Fraser and Marsh (2016).
    """

    upper: Velocity = quantity("velocity east, north (, up)", "m/s", -10.0, 10.0)
    lower: Velocity = quantity("velocity east, north (, up)", "m/s", -10.0, 10.0)
    split_z_m: float = quantity("elevation z of the interface", "m", -12e3, 0.0)
    bottom_z_m: float = quantity("elevation z of the lower layer's bottom", "m", -12e3, 0.0)

    def check(self) -> str | None:
        """Return a fault if the split is not above the bottom, or None."""
        if not self.bottom_z_m < self.split_z_m - STEP:
            return (
                f"the split at {self.split_z_m:g} m is not above the bottom at "
                f"{self.bottom_z_m:g} m; order them downward"
            )
        return None

    def points(self) -> tuple[Point, ...]:
        """Return the profile, whose steps are a millimetre high."""
        split, bottom, half = self.split_z_m, self.bottom_z_m, 0.5 * STEP
        return (
            (split + half, self.upper), (split - half, self.lower),
            (bottom + half, self.lower), (bottom - half, (0.0, 0.0)),
        )  # fmt: skip


@dataclass(frozen=True, kw_only=True)
class CurrentParams:
    """A profile (rows of elevation z from the surface down and velocity east, north and, where it
    has a vertical component, up), or two layers.
    """

    profile: tuple[Point, ...] = quantity(
        "rows of elevation z [m] and velocity [east, north] or [east, north, up] [m/s]",
        "",
        default=(),
    )
    layers: Layers | None = text("two layers instead of a profile", None)
    over_time: tuple[tuple[float, float], ...] = quantity(
        "rows of time [s] and factor on the velocity, linear between them", "", -1e7, 1e7,
        default=(),
    )  # fmt: skip

    @property
    def points(self) -> tuple[Point, ...]:
        """Return the profile, including that of two layers."""
        return self.layers.points() if self.layers is not None else self.profile

    @property
    def rises(self) -> bool:
        """Return whether a row has a vertical component, be it 0."""
        return any(len(velocity) > 2 for _, velocity in self.points)

    @property
    def table(self) -> Floats:
        """Return the profile as rows of z, east, north, up, from the surface down; (rows, 4)."""
        rows = [(z, *velocity, 0.0)[:4] for z, velocity in self.points]
        return np.array(rows, dtype=float)

    def check(self) -> str | None:
        """Return the fault of the profile and its remedy, or None."""
        if self.layers is not None and self.profile:
            return "both profile and layers; keep one of them"
        if any(b[0] <= a[0] for a, b in itertools.pairwise(self.over_time)):
            return "times of over_time are not ascending; order the rows"
        heights = [z for z, _ in self.points]
        if len(heights) < 1:
            return "the profile is empty; give at least one row [z, [east, north]]"
        for above, below in itertools.pairwise(heights):
            if not below < above:
                return f"z = {below:g} m follows z = {above:g} m; order rows from the surface down"
        if max(heights) > 0.0 or min(heights) < -12e3:
            return "a row is outside the water; give z from 0 down to -12000 m"
        for z, velocity in self.points:
            if not 2 <= len(velocity) <= 3:
                problem = f"the velocity at z = {z:g} m has {len(velocity)} components"
                return f"{problem}; give [east, north] or [east, north, up]"
        speeds = [abs(u) for _, velocity in self.points for u in velocity]
        if max(speeds) > 10.0:
            return f"{max(speeds):g} m/s is not a plausible current; give at most 10 m/s"
        return None


class Current(NamedTuple):
    """Kernel data: rows from the bottom up."""

    z: Floats  # elevations [m], (rows,)
    rise: Floats  # vertical distance from each row to the next [m]; 0 for the last
    U: Floats  # velocity east, north [m/s], (2, rows)
    slope: Floats  # its derivative over z between the rows [1/s], (2, rows)


class RisingCurrent(NamedTuple):
    """Kernel data of a current with a vertical component; rows from the bottom up."""

    z: Floats  # elevations [m], (rows,)
    rise: Floats  # vertical distance from each row to the next [m]; 0 for the last
    U: Floats  # velocity east, north, up [m/s], (3, rows)
    slope: Floats  # its derivative over z between the rows [1/s], (3, rows)


class CurrentInTime(NamedTuple):
    """Kernel data of a current with a time factor."""

    current: Current
    time: Floats  # [s], ascending, (rows,)
    share: Floats  # factor on the current at these times


class RisingCurrentInTime(NamedTuple):
    """Kernel data of a current with a vertical component and a time factor."""

    current: RisingCurrent
    time: Floats  # [s], ascending, (rows,)
    share: Floats  # factor on the current at these times


STEADY = Current, RisingCurrent
OVER_TIME = CurrentInTime, RisingCurrentInTime


def build(params: CurrentParams, payload: Any, environment: Any) -> Any:
    """Return the kernel data of the scene's current, of one of the four types above."""
    current = from_rows(params.table if params.rises else params.table[:, :3])
    if not params.over_time:
        return current
    time, share = (np.ascontiguousarray(row) for row in np.array(params.over_time, float).T)
    if isinstance(current, RisingCurrent):
        return RisingCurrentInTime(current, time, share)
    return CurrentInTime(current, time, share)


def profile_of(effects: Iterable[Any]) -> Current | RisingCurrent | None:
    """Return the profile of the current among the kernel data of effects, if there is one."""
    for effect in effects:
        if isinstance(effect, OVER_TIME):
            return effect.current
        if isinstance(effect, STEADY):
            return effect
    return None


def with_profile(effect: Any, new: Any) -> Any:
    """Return the kernel data of an effect, with the new profile if it is a current."""
    if isinstance(effect, OVER_TIME):
        return effect._replace(current=new)
    return new if isinstance(effect, STEADY) else effect


def from_rows(rows: Floats) -> Current | RisingCurrent:
    """Return a current from rows of z, east, north (, up), ordered from the surface down; (rows, 3
    or 4).
    """
    upward = rows[::-1]
    z = np.ascontiguousarray(upward[:, 0])
    U = np.ascontiguousarray(upward[:, 1:].T)
    rise, slope = np.zeros_like(z), np.zeros_like(U)
    rise[:-1] = np.diff(z)
    slope[:, :-1] = np.diff(U, axis=1) / rise[:-1]
    return (RisingCurrent if len(U) == 3 else Current)(z, rise, U, slope)


@jit_within
def _add_layer(
    current: Any, share: Any, layer: int, z: Any, base: Any, flow: Any, count: int
) -> None:
    """Add base + slope·(height above the layer's lower face, at most its thickness) to flow."""
    east, north = flow
    base_east, base_north = base
    low, rise = current.z[layer], current.rise[layer]
    slope_east, slope_north = share * current.slope[0, layer], share * current.slope[1, layer]
    for i in range(count):
        inside = min(max(z[i] - low, 0.0), rise)
        east[i] += base_east + slope_east * inside
        north[i] += base_north + slope_north * inside


@jit_within
def _above(z: Any, level: float, count: int) -> int:
    """Return how many nodes are not below a level (this vectorises; a minimum does not)."""
    nodes = 0
    for i in range(count):
        nodes += z[i] >= level
    return nodes


@jit_within
def _flow(current: Any, share: Any, work: Any, low: int, high: int) -> None:
    """Add share·U(z) to flow, a sum over the layers between rows, for a few nodes at a time.

    Only the layers that these nodes reach are summed; each sum runs over contiguous memory.
    """
    last = current.z.shape[0] - 1
    first = 0
    for start in range(low, high, TOGETHER):
        count = min(start + TOGETHER, high) - start
        _, _, z = rows(work, POSITION, start)
        east, north, _ = rows(work, FLOW, start)
        while first < last and _above(z, current.z[first + 1], count) == count:
            first += 1
        while first > 0 and _above(z, current.z[first], count) < count:
            first -= 1
        base = share * current.U[0, first], share * current.U[1, first]
        _add_layer(current, share, first, z, base, (east, north), count)
        layer = first + 1
        while layer < last and _above(z, current.z[layer], count) > 0:
            _add_layer(current, share, layer, z, (0.0, 0.0), (east, north), count)
            layer += 1


@jit_within
def _flow_up(current: Any, share: Any, work: Any, low: int, high: int) -> None:
    """Add share·U_z(z) to the vertical flow of the nodes low <= i < high."""
    _, _, z = rows(work, POSITION, low)
    _, _, up = rows(work, FLOW, low)
    last = current.z.shape[0] - 1
    layer = 0
    for i in range(high - low):
        while layer < last and z[i] >= current.z[layer + 1]:
            layer += 1
        while layer > 0 and z[i] < current.z[layer]:
            layer -= 1
        inside = min(max(z[i] - current.z[layer], 0.0), current.rise[layer])
        up[i] += share * (current.U[2, layer] + current.slope[2, layer] * inside)


@jit_within
def _flow_wide(current: Any, share: Any, work: Any, low: int, high: int) -> None:
    """Add share·U(z) to flow for a SIMD batch, over the layers that each rope's nodes reach."""
    last = current.z.shape[0] - 1
    for start in range(low, high, TOGETHER):
        count = min(start + TOGETHER, high) - start
        _, _, z = rows(work, POSITION, start)
        east, north, _ = rows(work, FLOW, start)
        bottom, top = z[0], z[0]
        for i in range(1, count):
            bottom, top = min(bottom, z[i]), max(top, z[i])
        base_east, base_north = current.U[0, 0], current.U[1, 0]
        for layer in range(1, last + 1):
            reached = current.z[layer] <= bottom
            base_east = choose(reached, current.U[0, layer], base_east)
            base_north = choose(reached, current.U[1, layer], base_north)
        base_east, base_north = share * base_east, share * base_north
        for i in range(count):
            east[i] += base_east
            north[i] += base_north
        for layer in range(last):
            reached_lanes = (
                current.z[layer + 1] > bottom
            )  # lanes whose ropes do not begin above the layer
            if bits(reached_lanes) != 0 and bits(current.z[layer] < top) != 0:
                low_face, rise = current.z[layer], choose(reached_lanes, current.rise[layer], 0.0)
                slope_east = share * current.slope[0, layer]
                slope_north = share * current.slope[1, layer]
                for i in range(count):
                    inside = min(max(z[i] - low_face, 0.0), rise)
                    east[i] += slope_east * inside
                    north[i] += slope_north * inside


@jit_within
def _flow_up_wide(current: Any, share: Any, work: Any, low: int, high: int) -> None:
    """Add share·U_z(z) to the vertical flow for a SIMD batch."""
    _, _, z = rows(work, POSITION, low)
    _, _, up = rows(work, FLOW, low)
    for i in range(high - low):
        inside = min(max(z[i] - current.z[0], 0.0), current.rise[0])
        velocity = current.U[2, 0] + current.slope[2, 0] * inside
        for layer in range(1, current.z.shape[0]):
            inside = min(max(z[i] - current.z[layer], 0.0), current.rise[layer])
            layer_velocity = current.U[2, layer] + current.slope[2, layer] * inside
            velocity = choose(current.z[layer] <= z[i], layer_velocity, velocity)
        up[i] += share * velocity


@jit_within
def _share_wide(current: Any, stage: Any) -> Any:
    """Return the time factor of each lane."""
    last = current.time.shape[0] - 1
    share = current.share[0]
    if last > 0:
        low, high, next_share = current.time[0], current.time[1], current.share[1]
        for i in range(1, last):
            beyond = current.time[i] <= stage.time
            low, high = (
                choose(beyond, current.time[i], low),
                choose(beyond, current.time[i + 1], high),
            )
            share = choose(beyond, current.share[i], share)
            next_share = choose(beyond, current.share[i + 1], next_share)
        fraction = (stage.time - low) / (high - low)
        share += min(max(fraction, 0.0), 1.0) * (next_share - share)
    return share


@jit_within
def _share(current: Any, stage: Any) -> Any:
    """Return the time factor, which is constant before the first and after the last row."""
    last = current.time.shape[0] - 1
    i = 0
    while i < last - 1 and current.time[i + 1] <= stage.time:
        i += 1
    share = current.share[i]
    if last > 0:
        fraction = (stage.time - current.time[i]) / (current.time[i + 1] - current.time[i])
        share += min(max(fraction, 0.0), 1.0) * (current.share[i + 1] - current.share[i])
    return share


@jit_within
def _flow_rising(current: Any, share: Any, work: Any, low: int, high: int) -> None:
    _flow(current, share, work, low, high)
    _flow_up(current, share, work, low, high)


@jit_within
def _flow_rising_wide(current: Any, share: Any, work: Any, low: int, high: int) -> None:
    _flow_wide(current, share, work, low, high)
    _flow_up_wide(current, share, work, low, high)


def _register(register: Any, steady: type, over_time: type, add: Any, share_of: Any) -> None:
    """Register the kernels of a profile; add(current, share, ...): adds share·U(z) to flow."""

    @register("flow", steady)
    def flow(current: Any, work: Any, stage: Any, low: int, high: int) -> None:
        add(current, 1.0, work, low, high)

    @register("flow", over_time)
    def flow_in_time(current: Any, work: Any, stage: Any, low: int, high: int) -> None:
        add(current.current, share_of(current, stage), work, low, high)


_register(kernel, Current, CurrentInTime, _flow, _share)
_register(kernel, RisingCurrent, RisingCurrentInTime, _flow_rising, _share)
_register(wide_kernel, Current, CurrentInTime, _flow_wide, _share_wide)
_register(wide_kernel, RisingCurrent, RisingCurrentInTime, _flow_rising_wide, _share_wide)

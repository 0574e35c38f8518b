"""Build-up of the forces of water and wind: factors of time on all, on vortices and on fairings.

[UWCFSI] Laird, Fraser and Marsh (2016): fluid forces grow over tRamp, or follow a load curve; so do
the forces of vortices (strumming) and of a payload's fairing. The factor is u³·(10 - 15·u + 6·u²),
u = t/`ramp_s`, whose first and second derivatives vanish at both ends (the paper gives no form), or
a table of time and factor, linear between its rows and constant beyond them. Vortices and fairings
have the product of their own factor and that of all.

It applies to drag, the inertia forces of the water's acceleration, lift and oscillating drag of
vortices, nets, fairings, slamming and the wind: a run that begins at a factor 0 begins as if the
water were at rest and without resistance. Added mass, buoyancy and weight are not scaled, as they
are not forces of the flow; nor is the water itself, so that vortices shed at their full frequency.
While a factor is not 1 the results are not those of the sea: diagnostics say so.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from rope_twin.core.jit.decorators import jit_exact_within, jit_within
from rope_twin.core.jit.functions import by_width
from rope_twin.core.jit.wide import choose
from rope_twin.core.loads.hooks import FAIRINGS, VORTICES, kernel
from rope_twin.core.state import Floats
from rope_twin.quantity import quantity, text


@dataclass(frozen=True, kw_only=True)
class LoadCurve:
    """One of a ramp and a table."""

    ramp_s: float | None = quantity("time to the full force", "s", 0.0, 1e5, default=None)
    over_time: tuple[tuple[float, float], ...] = quantity(
        "rows of time [s] and factor on the force, linear between them", "", -1e7, 1e7, default=()
    )

    def check(self) -> str | None:
        """Return a fault if there is not one of both, of order or of range, or None."""
        if (self.ramp_s is None) == (not self.over_time):
            given = "both ramp_s and over_time" if self.over_time else "no ramp_s, no over_time"
            return f"{given}; give one of them"
        if any(b[0] <= a[0] for a, b in itertools.pairwise(self.over_time)):
            return "times of over_time are not ascending; order the rows"
        for time, factor in self.over_time:
            if not 0.0 <= factor <= 10.0:
                return f"a factor of {factor:g} at {time:g} s; give 0 to 10"
        return None

    @property
    def last(self) -> tuple[float, float]:
        """Return the time [s] from which the factor is constant, and that factor."""
        return (self.ramp_s, 1.0) if self.ramp_s is not None else self.over_time[-1]


@dataclass(frozen=True, kw_only=True)
class FluidRampParams:
    """Factors of time on the forces of the water; those left out are 1."""

    water: LoadCurve | None = text("all forces of water and wind", None)
    vortices: LoadCurve | None = text("forces of vortices, besides", None)
    fairings: LoadCurve | None = text("drag of fairings, besides", None)

    def check(self) -> str | None:
        """Return a fault if there is no factor at all, or None."""
        if self.curves:
            return None
        return "no factor is given; give water, vortices or fairings, or remove the effect"

    @property
    def curves(self) -> dict[str, LoadCurve]:
        """Return the factors that are given, by their keys."""
        own = {"water": self.water, "vortices": self.vortices, "fairings": self.fairings}
        return {name: curve for name, curve in own.items() if curve is not None}


class Curve(NamedTuple):
    """A factor of time."""

    ramp: float  # [s]; 0: by the table
    time: Floats  # [s], ascending
    factor: Floats


class FluidRamp(NamedTuple):
    """Kernel data of the three factors."""

    water: Curve
    vortices: Curve
    fairings: Curve


def _curve(params: LoadCurve | None) -> Curve:
    table = () if params is None else params.over_time
    time, factor = np.array(table or ((0.0, 1.0),), dtype=float).T
    ramp = 0.0 if params is None or params.ramp_s is None else params.ramp_s
    return Curve(float(ramp), np.ascontiguousarray(time), np.ascontiguousarray(factor))


def build(params: FluidRampParams, payload: Any, environment: Any) -> FluidRamp:
    """Return the kernel data of the factors."""
    return FluidRamp(_curve(params.water), _curve(params.vortices), _curve(params.fairings))


@jit_exact_within
def _on_ramp(curve: Any, time: float) -> Any:
    u = min(max(time / curve.ramp, 0.0), 1.0)
    return u * u * u * (10.0 - 15.0 * u + 6.0 * u * u)


@jit_within
def _factor_of_one(table: Any, curve: Any, time: float) -> Any:
    if curve.ramp > 0.0:
        return _on_ramp(curve, time)
    last = curve.time.shape[0] - 1
    if last == 0 or time <= curve.time[0]:
        return curve.factor[0]
    i = 0
    while i < last - 1 and curve.time[i + 1] <= time:
        i += 1
    fraction = min((time - curve.time[i]) / (curve.time[i + 1] - curve.time[i]), 1.0)
    return curve.factor[i] + fraction * (curve.factor[i + 1] - curve.factor[i])


@jit_within
def _factor_of_lanes(table: Any, curve: Any, time: float) -> Any:
    last = curve.time.shape[0] - 1
    at = curve.factor[0]
    for i in range(last):
        fraction = min((time - curve.time[i]) / (curve.time[i + 1] - curve.time[i]), 1.0)
        value = curve.factor[i] + fraction * (curve.factor[i + 1] - curve.factor[i])
        at = choose(curve.time[i] <= time, value, at)
    return choose(curve.ramp > 0.0, _on_ramp(curve, time), at)


_chosen = by_width(_factor_of_one, _factor_of_lanes)


@jit_within
def _factor(curve: Any, time: float) -> Any:
    """Return a factor at a time."""
    return _chosen(curve.time, curve, time)


@kernel("share", FluidRamp, wide=True)
def share(ramp: Any, time: float, factor: int) -> Any:
    """Return the factor on a group of forces: that of all, times their own."""
    common = _factor(ramp.water, time)
    if factor == VORTICES:
        return common * _factor(ramp.vortices, time)
    if factor == FAIRINGS:
        return common * _factor(ramp.fairings, time)
    return common

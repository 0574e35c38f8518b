"""Slings of the object: their keys, and the load of each from that at the lower end of the rope.

The object is rigid and hangs from a point (the hook) on elastic slings without weight. In the axes
of the object, with the origin in its centre of gravity, the hook at h is where the energy
Σ ½·k_i·e_i² - F·|h| is least: k_i = EA/L_i, e_i = |h - p_i| - L_i > 0. There the slings' resultant
passes through the centre of gravity, with its size F, so that attitude and distribution follow
together; one to three slings are statically determinate, four and more by their stiffness.

What a rule adds has its section of GL Noble Denton 0027/ND Rev 11 (2016), whose text is public and
was taken up by DNV-ST-N001: skew load (5.6.12, 5.6.13) and the nominal safety factor (7.3 to 7.10).
Shares are those at the static load, where errors of length count most.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from functools import lru_cache
from itertools import product

import numpy as np
from scipy.optimize import minimize

from rope_twin.quantity import quantity, text
from rope_twin.scene.schema import Triple
from rope_twin.sea.tables import Vector

MAX_SLINGS = 6  # 2^6 combinations of length errors at four centres of gravity
DETERMINATE = 3
SLING_MODULUS_PA = 8.0e10  # on 0.785·d², 0027/ND 5.6.13
CLOSED_N, STRETCHED = 1.0, 0.02  # load at which slings must meet, and strain that they then have
MIN_FACTOR = 2.3  # of 7.3.1


@dataclass(frozen=True, kw_only=True)
class SlingFactors:
    """Partial factors of the nominal safety factor, 0027/ND 7.3 to 7.10."""

    load: float = quantity("γ_f, lifting (7.4)", "", 1.0, 3.0, default=1.3)
    consequence: float = quantity("γ_c, consequence (7.5)", "", 1.0, 2.0, default=1.3)
    reduction: float = quantity(
        "γ_r, greater of termination and bending (7.6 to 7.8)", "", 1.0, 4.0, default=1.0
    )
    wear: float = quantity("γ_w, wear and application (7.9)", "", 1.0, 2.0, default=1.0)
    material: float = quantity(
        "γ_m: 1.5 certified steel wire, 1.35 as new, 1.65 polyester, 2.0 HMPE (7.10)", "", 1.0, 4.0,
        default=1.5,
    )  # fmt: skip
    twist: float = quantity("γ_tw, twist of grommets and cable-laid slings", "", 1.0, 2.0,
                            default=1.0)  # fmt: skip

    @property
    def nominal(self) -> float:
        """Return γ_sf, the greater of γ_f·γ_c·γ_r·γ_w·γ_m·γ_tw and 2.3·γ_r·γ_w·γ_tw (7.3.1)."""
        common = self.reduction * self.wear * self.twist
        return common * max(self.load * self.consequence * self.material, MIN_FACTOR)


@dataclass(frozen=True, kw_only=True)
class Slings:
    """Slings from the hook to the object; loads are those of the runs."""

    attachments_m: tuple[Triple, ...] = quantity(
        "attachment points from the centre of gravity: x, y, z", "m", -100.0, 100.0
    )
    lengths_m: tuple[float, ...] = quantity(
        "unstretched lengths: one of each, or one for all", "m", 0.1, 500.0
    )
    axial_stiffness_n: float | None = quantity("EA of each", "N", 1e4, 1e11, default=None)
    diameter_m: float | None = quantity(
        "instead of EA: diameter of steel wire, EA = 80 GPa·0.785·d² (0027/ND 5.6.13)", "m", 1e-3,
        1.0, default=None,
    )  # fmt: skip
    skew_load_factor: float | None = quantity(
        "SKL of four slings or more: 1.25 for matched pairs (0027/ND 5.6.12)", "", 1.0, 3.0,
        default=None,
    )  # fmt: skip
    length_tolerance_m: float | None = quantity(
        "instead of SKL: ± error of each length; all combinations are computed (0027/ND 5.6.13)",
        "m", 0.0, 10.0, default=None,
    )  # fmt: skip
    centre_of_gravity_within_m: tuple[float, float] = quantity(
        "half sides of the envelope of the centre of gravity: x, y", "m", 0.0, 50.0,
        default=(0.0, 0.0),
    )  # fmt: skip
    tilt_factor: float = quantity(
        "factor for tilt and yaw beyond the computed attitude (0027/ND 5.4, 5.5)", "", 1.0, 3.0,
        default=1.0,
    )  # fmt: skip
    mbl_n: float | None = quantity("MBL of each", "N", 1e2, 1e9, default=None)
    wll_n: float | None = quantity("WLL of each, which has its own factor", "N", 1e2, 1e9,
                                   default=None)  # fmt: skip
    factors: SlingFactors = text("partial factors on the MBL", SlingFactors())

    @property
    def count(self) -> int:
        """Return the number of slings."""
        return len(self.attachments_m)

    @property
    def EA_n(self) -> float:
        """Return the axial stiffness [N]."""
        if self.axial_stiffness_n is not None:
            return self.axial_stiffness_n
        assert self.diameter_m is not None, "checked when the plan was read"
        return SLING_MODULUS_PA * 0.785 * self.diameter_m**2

    @property
    def strength_n(self) -> float:
        """Return the allowable load of a sling: the lesser of MBL/γ_sf and WLL [N]."""
        by_mbl = math.inf if self.mbl_n is None else self.mbl_n / self.factors.nominal
        return min(by_mbl, math.inf if self.wll_n is None else self.wll_n)

    @property
    def lengths(self) -> Vector:
        """Return the length of each [m], (slings,)."""
        lengths = np.array(self.lengths_m, dtype=float)
        return lengths if len(lengths) == self.count else np.full(self.count, lengths[0])

    def check(self) -> str | None:
        """Return a fault of the keys, or None."""
        return next(self._faults(), None)

    def _faults(self) -> Iterator[str]:
        count, more = self.count, self.count > DETERMINATE
        if not 1 <= count <= MAX_SLINGS:
            yield f"{count} attachments; give 1 to {MAX_SLINGS}"
            return
        if len(self.lengths_m) not in (1, count):
            yield f"{len(self.lengths_m)} lengths for {count} slings; give one of each, or one"
            return
        if (self.axial_stiffness_n is None) == (self.diameter_m is None):
            number = "no" if self.diameter_m is None else "a second"
            yield f"{number} stiffness is given; give one of axial_stiffness_n and diameter_m"
            return
        skew = (self.skew_load_factor, self.length_tolerance_m)
        known = sum(value is not None for value in skew)
        if more and known != 1:
            problem = "both skew_load_factor and length_tolerance_m" if known else "no skew load"
            yield (
                f"{count} slings are statically indeterminate and {problem} given; give one of "
                "skew_load_factor (1.25 for matched pairs) and length_tolerance_m"
            )
        if not more and self.skew_load_factor is not None:
            problem = f"{count} slings are statically determinate"
            yield f"{problem}; leave skew_load_factor out (their SKL is 1)"
        if self.mbl_n is None and self.wll_n is None:
            yield "no strength is given; give mbl_n or wll_n"
        points = np.array(self.attachments_m)
        hook, tension = hang(points, self.lengths, self.EA_n, CLOSED_N)
        if hook[2] <= 0.0 or hook[2] <= points[:, 2].min():
            yield "the object capsizes; attach slings above its centre of gravity"
        elif tension.max() > STRETCHED * self.EA_n:
            yield "the slings do not meet at a hook; give greater lengths_m"


@dataclass(frozen=True)
class SlingShares:
    """Loads of the slings over the load at the hook."""

    nominal: Vector  # of the lengths and the centre of gravity as given, (slings,)
    largest: Vector  # with skew load, shift of the centre of gravity and tilt factor, (slings,)
    tilt_deg: float  # of the object at rest, by lengths and centre of gravity as given
    max_tilt_deg: float  # within the envelope of the centre of gravity and the length errors


@lru_cache(maxsize=64)
def sling_shares(slings: Slings, load_n: float) -> SlingShares:
    """Return the loads of the slings over the hook load, at this static load [N]."""
    points, lengths, EA = np.array(slings.attachments_m), slings.lengths, slings.EA_n
    hook, tension = hang(points, lengths, EA, load_n)
    nominal, tilts = tension / load_n, [_tilt_deg(hook)]
    x, y = slings.centre_of_gravity_within_m
    shifts = {(a * x, b * y, 0.0) for a, b in product((-1.0, 1.0), repeat=2)} | {(0.0, 0.0, 0.0)}
    tolerance = slings.length_tolerance_m or 0.0
    signs = product((-1.0, 1.0), repeat=slings.count) if tolerance > 0.0 else [(0.0,)]
    errors = [tolerance * np.array(sign) for sign in signs]
    largest = nominal
    for shift, error in product(sorted(shifts), errors):
        shifted = points - np.array(shift)
        hook_position, tension = hang(shifted, lengths + error, EA, load_n, hook - np.array(shift))
        largest = np.maximum(largest, tension / load_n)
        tilts.append(_tilt_deg(hook_position))
    factor = slings.tilt_factor * (slings.skew_load_factor or 1.0)
    return SlingShares(nominal, factor * largest, tilts[0], max(tilts))


def _tilt_deg(hook: Vector) -> float:
    return math.degrees(math.acos(min(hook[2] / float(np.linalg.norm(hook)), 1.0)))


def hang(
    points_m: Vector, lengths_m: Vector, EA_n: float, load_n: float, near_m: Vector | None = None
) -> tuple[Vector, Vector]:
    """Return the hook in the axes of the object [m], (3,), and the tensions [N], (slings,).

    points_m: attachments from the centre of gravity, (slings, 3). lengths_m: unstretched,
    (slings,). load_n: at the hook, plumb above the centre of gravity. near_m: where to look first.
    """
    k = EA_n / lengths_m
    scale = load_n * float(lengths_m.mean())  # of the energy

    def state(h: Vector) -> tuple[Vector, Vector, Vector, float]:
        arms = h - points_m
        length = np.sqrt((arms * arms).sum(axis=1))
        stretch = np.maximum(length - lengths_m, 0.0)
        return arms / length[:, None], length, stretch, math.sqrt(float(h @ h))

    def energy(h: Vector) -> float:
        _, _, stretch, distance = state(h)
        return (0.5 * float(k @ stretch**2) - load_n * distance) / scale

    def slope(h: Vector) -> Vector:
        direction, _, stretch, distance = state(h)
        return np.asarray(((k * stretch) @ direction - load_n * h / distance) / scale)

    def curvature(h: Vector) -> Vector:
        direction, length, stretch, distance = state(h)
        tension = k * stretch
        outer = direction[:, :, None] * direction[:, None, :]
        stiff = np.where(stretch > 0.0, k - tension / length, 0.0)
        up = h / distance
        geometric = (np.eye(3) - np.outer(up, up)) * load_n / distance
        total = np.tensordot(stiff, outer, 1) + np.eye(3) * (tension / length).sum() - geometric
        return np.asarray(total / scale)

    start = near_m
    if start is None:
        middle = points_m.mean(axis=0)
        reach = np.sqrt(((points_m - middle) ** 2).sum(axis=1))
        rise = np.sqrt(np.maximum(lengths_m**2 - reach**2, (0.1 * lengths_m) ** 2)).mean()
        start = middle + np.array([0.0, 0.0, rise])
    hook: Vector = minimize(
        energy, start, jac=slope, hess=curvature, method="trust-exact",
        options={"gtol": 1e-12, "initial_trust_radius": 0.1, "maxiter": 500},
    ).x  # fmt: skip
    for _ in range(3):  # of Newton's: the energy is flat where its slope is not yet 0
        hook = hook - np.linalg.solve(curvature(hook), slope(hook))
    return hook, k * state(hook)[2]

"""Uncertain numbers of a plan: which key, how it is distributed, and who says so.

A key is a path of the plan (`criteria.swl_n`, `vessel.crane_tip_m[1]`) or, after `scene.`, of its
scene (`scene.payloads[0].mass_kg`). Normal distributions end at ±3 standard deviations, since no
data sheet means an infinite mass.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from scipy.special import ndtr, ndtri

from rope_twin.quantity import quantity, text
from rope_twin.scene.load import Change, change_part, change_scene
from rope_twin.sea.tables import Vector

if TYPE_CHECKING:
    from rope_twin.planning.plan_file import Plan
    from rope_twin.scene.schema import Scene

SCENE = "scene."
# endings of keys, the longer ones first: unit of tables, and its size in the unit of the key
UNITS = {
    "_m_per_s": ("m/s", 1.0), "_kg_per_m3": ("kg/m³", 1.0), "_kg_per_m": ("kg/m", 1.0),
    "_m3": ("m³", 1.0), "_m2": ("m²", 1.0), "_kg": ("kg", 1.0), "_deg": ("°", 1.0),
    "_n": ("kN", 1e-3), "_m": ("m", 1.0), "_s": ("s", 1.0),
}  # fmt: skip
ENDS = 3.0  # standard deviations of a normal distribution


@dataclass(frozen=True, kw_only=True)
class Uniform:
    """Uniform distribution between two numbers."""

    from_: float = quantity("lowest number")
    to: float = quantity("highest number")

    def check(self) -> str | None:
        """Return a fault of the range, or None."""
        if self.from_ < self.to:
            return None
        return f"from {self.from_:g} is not below to {self.to:g}; give the lesser one as `from`"

    def quantile(self, share: Vector) -> Vector:
        """Return the numbers that these shares do not exceed, same shape."""
        return self.from_ + (self.to - self.from_) * share


@dataclass(frozen=True, kw_only=True)
class Normal:
    """Normal distribution, cut off at ±3 standard deviations."""

    mean: float = quantity("mean")
    std: float = quantity("standard deviation", "", 1e-12)

    def quantile(self, share: Vector) -> Vector:
        """Return the numbers that these shares do not exceed, same shape."""
        low = ndtr(-ENDS)
        deviate = ndtri(low + (1.0 - 2.0 * low) * np.asarray(share))
        return np.asarray(self.mean + self.std * deviate)


@dataclass(frozen=True, kw_only=True)
class Triangular:
    """Density that rises from the lowest number to the mode and falls to the highest."""

    from_: float = quantity("lowest number")
    mode: float = quantity("most likely number")
    to: float = quantity("highest number")

    def check(self) -> str | None:
        """Return a fault of the order, or None."""
        if self.from_ <= self.mode <= self.to and self.from_ < self.to:
            return None
        ends = f"from {self.from_:g} to {self.to:g}"
        return f"the mode {self.mode:g} is not {ends}; give them in ascending order"

    def quantile(self, share: Vector) -> Vector:
        """Return the numbers that these shares do not exceed, same shape."""
        width, rise = self.to - self.from_, self.mode - self.from_
        share = np.asarray(share)
        return np.where(
            share <= rise / width,
            self.from_ + np.sqrt(share * width * rise),
            self.to - np.sqrt((1.0 - share) * width * (self.to - self.mode)),
        )


KINDS = ("uniform", "normal", "triangular")


@dataclass(frozen=True, kw_only=True)
class Uncertainty:
    """An uncertain number of the plan or its scene."""

    key: str = text("path such as criteria.swl_n, or of the scene: scene.payloads[0].mass_kg")
    name: str = text("what it is called in tables; default: the key", "")
    uniform: Uniform | None = text("every number of a range", None)
    normal: Normal | None = text("normal distribution", None)
    triangular: Triangular | None = text("lowest, most likely and highest number", None)
    factor: bool = text("the numbers multiply what plan or scene say", False)
    source: str = text("who says so: data sheet, weighing, estimate")

    @property
    def title(self) -> str:
        """Return its name, or its key."""
        return self.name or self.key

    @property
    def distribution(self) -> Uniform | Normal | Triangular:
        """Return the distribution that is given."""
        distribution = self.uniform or self.normal or self.triangular
        assert distribution is not None, "checked when it was read"
        return distribution

    def check(self) -> str | None:
        """Return a fault unless exactly one distribution is given, or None."""
        kinds = [kind for kind in KINDS if getattr(self, kind) is not None]
        if len(kinds) == 1:
            return None
        problem = " and ".join(kinds) if kinds else "no distribution"
        return f"{problem} given; give exactly one of {', '.join(KINDS)}"

    @property
    def words(self) -> str:
        """Return the distribution in words."""
        distribution, times = self.distribution, "times " if self.factor else ""
        end = "" if self.factor else re.sub(r"\[\d+\]$", "", self.key)
        unit, scale = next(
            (unit_scale for name, unit_scale in UNITS.items() if end.endswith(name)), ("", 1.0)
        )
        unit = f" {unit}" if unit else ""
        if isinstance(distribution, Normal):
            mean, std = scale * distribution.mean, scale * distribution.std
            return f"{times}normal, mean {mean:g}{unit}, standard deviation {std:g}{unit}"
        low, high = scale * distribution.from_, scale * distribution.to
        if isinstance(distribution, Triangular):
            mode = scale * distribution.mode
            return f"{times}triangular, {low:g} to {high:g}{unit}, most likely {mode:g}{unit}"
        return f"{times}uniform, {low:g} to {high:g}{unit}"

    def change(self, value: float) -> Change:
        """Return the change that makes it this number, its path without `scene.`."""
        return Change(self.key.removeprefix(SCENE), value, self.factor)


def with_values(
    plan: Plan, scene: Scene, uncertain: Sequence[Uncertainty], values: Sequence[float]
) -> tuple[Plan, Scene]:
    """Return plan and scene with these numbers, of which the plan then calls none uncertain.

    Raises:
        SceneError: a key is no path of plan or scene, or a number is out of range; one sentence.
    """
    pairs = [(uncertainty.key.startswith(SCENE), uncertainty.change(float(value)))
             for uncertainty, value in zip(uncertain, values, strict=True)]  # fmt: skip
    changed_plan = change_part(plan, [change for inside, change in pairs if not inside], plan.path)
    changed = change_scene(scene, [change for inside, change in pairs if inside])
    certain = replace(changed_plan, uncertainties=())
    return certain, certain.in_current(changed)

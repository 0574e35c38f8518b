"""Total suspended weight on the ropes from the ship in a multi-line scene, in water.

The distribution among several ropes depends on the positions of loads and hang-offs: by hand only
the sum is known.
"""

from __future__ import annotations

from dataclasses import dataclass

from rope_twin.scene.arrays.composite import weight_n_per_m
from rope_twin.scene.arrays.joined import point_figures
from rope_twin.scene.rules.rigging import places
from rope_twin.scene.schema import Rope, RopeLine, Scene


@dataclass(frozen=True)
class HungTogether:
    """Weights in still water."""

    lines: tuple[RopeLine, ...]  # ropes that leave the ship
    ropes: tuple[Rope, ...]  # their topmost sections
    weight_n: float  # of payloads, joints, bars and all paid-out rope at the start
    per_m_n: float  # of the first rope's topmost section: increase with payout [N/m]

    def weight_at(self, line_out_m: float) -> float:
        """Return the weight at a paid-out length of the first rope [N]."""
        return self.weight_n + self.per_m_n * (line_out_m - self.lines[0].length_m)

    @property
    def breaking_load_n(self) -> float:
        """Return the sum of the MBL of the ropes from the ship [N]."""
        return sum(rope.breaking_load_n for rope in self.ropes)


def hung_together(scene: Scene) -> HungTogether | None:
    """Return the weights of a multi-line scene; None with a fixed end or a tether."""
    if scene.sheaves or any(line.fixed_at_m for line in scene.ropes):
        return None
    water = scene.environment
    density, g = water.water_density_kg_per_m3, water.gravity_m_per_s2
    loads = point_figures(scene).values()
    weight = sum((one.mass_kg - density * one.volume_m3) * g for one in loads)
    for line in scene.ropes:
        lengths = zip(line.made_of, line.lengths_m(line.length_m), strict=True)
        weight += sum(weight_n_per_m(one.rope, water) * length for one, length in lengths)
    from_ship = tuple(line for line in scene.ropes if line.from_ in places(scene))
    tops = tuple(line.made_of[-1].rope for line in from_ship)
    return HungTogether(from_ship, tops, weight, weight_n_per_m(tops[0], water))

"""What the ropes from the ship carry together at rest, where ropes meet: all that hangs in water.

How several share it depends on where loads and hang-offs are: by hand only the sum is known.
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

    lines: tuple[RopeLine, ...]  # that leave the ship
    ropes: tuple[Rope, ...]  # their topmost sections
    weight_n: float  # of payloads, joints, bars and all rope that is out at the start
    per_m_n: float  # of the first rope's topmost section: what paying out adds [N/m]

    def weight_at(self, line_out_m: float) -> float:
        """The same with so much of the first rope out [N]."""
        return self.weight_n + self.per_m_n * (line_out_m - self.lines[0].length_m)

    @property
    def breaking_load_n(self) -> float:
        """Of the ropes from the ship, together [N]."""
        return sum(rope.breaking_load_n for rope in self.ropes)


def hung_together(scene: Scene) -> HungTogether | None:
    """Of a scene where ropes meet; None if something else pulls too: a fixed end, a tether."""
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

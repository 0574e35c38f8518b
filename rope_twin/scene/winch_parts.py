"""What a winch may have besides a speed: each a key of `winch`, there if the scene gives it."""

from __future__ import annotations

from dataclasses import dataclass
from math import pi

from rope_twin.quantity import quantity

WIRE_PA = 1.96e11  # modulus of a rope's steel wires
LAYER_RISE = 0.9  # a layer lies so many rope diameters above the one below, in its grooves


@dataclass(frozen=True, kw_only=True)
class Drum:
    """Layers of rope on a drum: layer k has the radius r_k = r_0 + (k - 1/2)·0.9·d."""

    core_radius_m: float = quantity("radius of the bare drum, r_0", "m", 0.05, 10.0)
    turns_per_layer: float = quantity("turns side by side in one layer", "", 1.0, 1e3)

    def radius_m(self, layer: int, diameter_m: float) -> float:
        """From the axis to the middle of the rope in layer 1, 2, ... [m]."""
        return self.core_radius_m + (layer - 0.5) * LAYER_RISE * diameter_m

    def length_m(self, layers: int, diameter_m: float) -> float:
        """Rope in so many full layers: 2π·N·(k·r_0 + 0.45·d·k²) [m]."""
        rise = 0.5 * LAYER_RISE * diameter_m * layers * layers
        return 2.0 * pi * self.turns_per_layer * (layers * self.core_radius_m + rise)

    def layer_of(self, stored_m: float, diameter_m: float) -> int:
        """The layer from which rope leaves when so much is on the drum; 1 at least."""
        layer = 1
        while self.length_m(layer, diameter_m) < stored_m:
            layer += 1
        return layer


@dataclass(frozen=True, kw_only=True)
class Drive:
    """The motor: what it cannot hold is rendered. Needs a drum."""

    inertia_kg_m2: float = quantity(
        "drum with its rope, gear and motor, at the drum's axis", "kg·m²", 1e-6, 1e9
    )
    torque_limit_n_m: float = quantity("largest torque either way, at the axis", "N·m", 1.0, 1e9)


@dataclass(frozen=True, kw_only=True)
class Brake:
    """Friction on the drum; released at the start. Needs a drive, whose inertia it brakes."""

    holding_torque_n_m: float = quantity("it slips above this, at the axis", "N·m", 1.0, 1e9)
    delay_s: float = quantity("from the command to its effect, either way", "s", 0.0, 10.0)


@dataclass(frozen=True, kw_only=True)
class EmergencyStop:
    """Stops the drum faster than the ordinary limits allow, and sets the brake if there is one."""

    deceleration_m_per_s2: float = quantity("of the line", "m/s²", 0.01, 50.0)


@dataclass(frozen=True, kw_only=True)
class HeaveCompensation:
    """Pays out as the hang-off rises: efficiency·e^(-iω·delay)/(1 + iω·lag) of its velocity.

    On at the start; on top of what else the winch does, within limits of its own.
    """

    efficiency: float = quantity("share of the velocity that it answers", "", 0.0, 1.2)
    lag_s: float = quantity("first-order lag of measurement and drive", "s", 0.0, 10.0)
    delay_s: float = quantity("dead time ahead of the lag", "s", 0.0, 5.0, default=0.0)
    stroke_m: float = quantity("most that it pays out or hauls in", "m", 0.01, 100.0)
    speed_limit_m_per_s: float = quantity("largest speed either way", "m/s", 0.01, 10.0)
    acceleration_limit_m_per_s2: float = quantity("largest acceleration", "m/s²", 0.01, 50.0)


@dataclass(frozen=True, kw_only=True)
class TopSheave:
    """What the rope runs over at the hang-off: for the fatigue of the metres that pass it.

    It has no part in the motion.
    """

    diameter_m: float = quantity("where the rope lies, in its groove", "m", 0.01, 20.0)
    outer_wire_m: float = quantity("diameter of the rope's outer wires", "m", 1e-4, 0.05)

    def bending_stress_pa(self, rope_diameter_m: float) -> float:
        """Of an outer wire on it, E·δ/(D + d) (Reuleaux 1861; E as in Feyrer 2015, Wire Ropes)."""
        return WIRE_PA * self.outer_wire_m / (self.diameter_m + rope_diameter_m)


@dataclass(frozen=True, kw_only=True)
class ConstantTension:
    """Keeps a named top tension: speed = gain·(e + ∫e/T dt), e = tension less the named one."""

    gain_m_per_s_per_kn: float = quantity("speed for each kN too much", "m/s/kN", 1e-5, 10.0)
    integral_time_s: float | None = quantity(
        "T; absent: no integral, and what a steady speed needs stays as an error", "s", 0.1, 1e4,
        default=None,
    )  # fmt: skip

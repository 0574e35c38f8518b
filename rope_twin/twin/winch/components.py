"""Components of a winch between its motion profile and its drum.

Some add to the motion (heave compensation), some limit it (drive, brake), some only report it (drum
layers). A winch has the components that its scene lists.
"""

from __future__ import annotations

from typing import Protocol

from rope_twin.scene.winch import Winch as WinchScene
from rope_twin.twin.winch.compensation import Compensation
from rope_twin.twin.winch.drive import Brake, Drive, WinchDrum
from rope_twin.twin.winch.payout import Payout, WinchStep

States = dict[str, float]


class Component(Protocol):
    """Interface of a winch component."""

    def figures(self, line: Payout) -> States:
        """Return the states for operators, the unit in the name."""

    def words(self) -> str:
        """Return the active limit; "" if none."""

    def switch(self, switch: str, time_ns: int) -> None:
        """Take a switch command, which may be for another component."""

    def set_total_length(self, whole_m: float) -> None:
        """Set the total length of rope, paid out or on the drum [m]."""


class AddingComponent(Component, Protocol):
    """Interface of a component that adds to the motion."""

    def add(self, wanted: Payout, moment: WinchStep) -> Payout:
        """Return the line at the end of the step with the addition."""


class LimitingComponent(Component, Protocol):
    """Interface of a component that limits the motion."""

    @property
    def controls_line(self) -> bool:
        """Whether it alone controls the line and the motor is off."""

    def hold(self, before: Payout, wanted: Payout, moment: WinchStep) -> Payout:
        """Return the line at the end of the step, as far as it allows."""


class Layers:
    """Drum layer, radius and speed."""

    def __init__(self, machine: WinchDrum) -> None:
        self._machine = machine

    def figures(self, line: Payout) -> States:
        """Return layer, radius and speed, + pays out."""
        layer, radius = self._machine.layer(line.length_m)
        return {
            "layer": float(layer),
            "drum_radius_m": radius,
            "drum_speed_rad_per_s": line.speed_m_per_s / radius,
        }

    def words(self) -> str:
        """Return "", as there are no limits."""
        return ""

    def switch(self, switch: str, time_ns: int) -> None:
        """Do nothing, as there is no switch."""

    def set_total_length(self, whole_m: float) -> None:
        """Set the total length; the length not paid out is on the drum."""
        self._machine.whole_m = whole_m


def adding_components(scene: WinchScene) -> tuple[AddingComponent, ...]:
    """Return the components that add to the motion, in their order."""
    own = scene.heave_compensation
    return (Compensation(own),) if own is not None else ()


def drum_components(
    scene: WinchScene, diameter_m: float
) -> tuple[tuple[Component, ...], tuple[LimitingComponent, ...]]:
    """Return the components that report the motion, and those that limit it, in their order."""
    if scene.drum is None:
        return (), ()
    machine = WinchDrum(scene.drum, diameter_m, scene.most_line_out_m)
    reporting: tuple[Component, ...] = (Layers(machine),)
    if scene.drive is None:
        return reporting, ()
    drive = Drive(scene.drive, machine)
    if scene.brake is None:
        return reporting, (drive,)
    return reporting, (drive, Brake(scene.brake, drive))

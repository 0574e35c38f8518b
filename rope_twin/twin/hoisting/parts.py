"""Components of a winch between its motion profile and its drum.

Some add to the motion (heave compensation), some limit it (drive, brake), some only report it (drum
layers). A winch has the components that its scene lists.
"""

from __future__ import annotations

from typing import Protocol

from rope_twin.scene.winch import Winch as WinchScene
from rope_twin.twin.hoisting.compensation import Compensation
from rope_twin.twin.hoisting.drive import Brake, Drive, Machine
from rope_twin.twin.hoisting.line import LineOut, Moment

Figures = dict[str, float]


class Part(Protocol):
    """Interface of a winch component."""

    def figures(self, line: LineOut) -> Figures:
        """Return the states for operators, the unit in the name."""

    def words(self) -> str:
        """Return the active limit; "" if none."""

    def obey(self, switch: str, time_ns: int) -> None:
        """Take a switch command, which may be for another component."""

    def know_rope(self, whole_m: float) -> None:
        """Set the total length of rope, paid out or on the drum [m]."""


class Adding(Part, Protocol):
    """Interface of a component that adds to the motion."""

    def add(self, wanted: LineOut, moment: Moment) -> LineOut:
        """Return the line at the end of the step with the addition."""


class Holding(Part, Protocol):
    """Interface of a component that limits the motion."""

    @property
    def has_line(self) -> bool:
        """Whether it alone controls the line and the motor is off."""

    def hold(self, before: LineOut, wanted: LineOut, moment: Moment) -> LineOut:
        """Return the line at the end of the step, as far as it allows."""


class Layers:
    """Drum layer, radius and speed."""

    def __init__(self, machine: Machine) -> None:
        self._machine = machine

    def figures(self, line: LineOut) -> Figures:
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

    def obey(self, switch: str, time_ns: int) -> None:
        """Do nothing, as there is no switch."""

    def know_rope(self, whole_m: float) -> None:
        """Set the total length; the length not paid out is on the drum."""
        self._machine.whole_m = whole_m


def adding_parts(scene: WinchScene) -> tuple[Adding, ...]:
    """Return the components that add to the motion, in their order."""
    own = scene.heave_compensation
    return (Compensation(own),) if own is not None else ()


def drum_parts(
    scene: WinchScene, diameter_m: float
) -> tuple[tuple[Part, ...], tuple[Holding, ...]]:
    """Return the components that report the motion, and those that limit it, in their order."""
    if scene.drum is None:
        return (), ()
    machine = Machine(scene.drum, diameter_m, scene.most_line_out_m)
    looking: tuple[Part, ...] = (Layers(machine),)
    if scene.drive is None:
        return looking, ()
    drive = Drive(scene.drive, machine)
    if scene.brake is None:
        return looking, (drive,)
    return looking, (drive, Brake(scene.brake, drive))

"""The parts that a winch may have between what its pace wishes and what its drum does.

Some add to the motion (heave compensation), some hold it back (drive, brake), some only look at it
(the drum's layers). A winch has those that its scene lists; the others do not exist.
"""

from __future__ import annotations

from typing import Protocol

from rope_twin.scene.winch import Winch as WinchScene
from rope_twin.twin.hoisting.compensation import Compensation
from rope_twin.twin.hoisting.drive import Brake, Drive, Machine
from rope_twin.twin.hoisting.line import LineOut, Moment

Figures = dict[str, float]


class Part(Protocol):
    """What every part can tell."""

    def figures(self, line: LineOut) -> Figures:
        """What operators read, the unit in the name."""

    def words(self) -> str:
        """Which limit of it holds the winch back; "" if none."""

    def obey(self, switch: str, time_ns: int) -> None:
        """A switch was set, maybe another part's."""

    def know_rope(self, whole_m: float) -> None:
        """All the rope that there is now, out or on the drum."""


class Adding(Part, Protocol):
    """A part that adds to the motion."""

    def add(self, wanted: LineOut, moment: Moment) -> LineOut:
        """The line at the end of the step, with what it adds."""


class Holding(Part, Protocol):
    """A part that the motion has to get past."""

    @property
    def has_line(self) -> bool:
        """Whether it has the line to itself and the motor is off."""

    def hold(self, before: LineOut, wanted: LineOut, moment: Moment) -> LineOut:
        """The line at the end of the step, as far as it allows."""


class Layers:
    """Which layer of the drum the rope leaves from, on what radius, and how fast the drum turns."""

    def __init__(self, machine: Machine) -> None:
        self._machine = machine

    def figures(self, line: LineOut) -> Figures:
        """Layer, radius and speed; + pays out."""
        layer, radius = self._machine.layer(line.length_m)
        return {
            "layer": float(layer),
            "drum_radius_m": radius,
            "drum_speed_rad_per_s": line.speed_m_per_s / radius,
        }

    def words(self) -> str:
        """It has no limits."""
        return ""

    def obey(self, switch: str, time_ns: int) -> None:
        """It has no switch."""

    def know_rope(self, whole_m: float) -> None:
        """What is not out is on the drum."""
        self._machine.whole_m = whole_m


def adding_parts(scene: WinchScene) -> tuple[Adding, ...]:
    """In the order of the chain."""
    own = scene.heave_compensation
    return (Compensation(own),) if own is not None else ()


def drum_parts(
    scene: WinchScene, diameter_m: float
) -> tuple[tuple[Part, ...], tuple[Holding, ...]]:
    """What looks at the motion, and what holds it back, in the order of the chain."""
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

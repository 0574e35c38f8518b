"""Selection of the monitors of a run."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from rope_twin.vortex.results import MonitorSettings

if TYPE_CHECKING:
    from rope_twin.scene.schema import Scene
    from rope_twin.twin.monitors.monitor import Monitor


@dataclass(frozen=True)
class Monitors:
    """Monitors that a run asks for."""

    energy: bool = False
    error_interval: bool = False
    vortex: MonitorSettings | None = None  # vibration and fatigue
    slack_steps: int = 0  # between checks for slack; 0: tensions are not monitored


NO_MONITORS = Monitors()
ENERGY, ERROR_INTERVAL = Monitors(energy=True), Monitors(error_interval=True)


def new_monitors(scene: Scene, asked: Monitors) -> tuple[Monitor, ...]:
    """Return the monitors of a new twin, not started; they are imported only if asked for.

    Raises:
        InputError: a monitor is not possible for the scene.
    """
    monitors: list[Monitor] = []
    if asked.error_interval:
        from rope_twin.twin.accuracy.error_interval import ErrorInterval

        monitors.append(ErrorInterval(scene))
    if asked.energy:
        from rope_twin.twin.monitors.energy import EnergyMonitor

        monitors.append(EnergyMonitor())
    if asked.slack_steps:
        from rope_twin.twin.monitors.tension import TensionMonitor

        monitors.append(TensionMonitor(asked.slack_steps))
    if asked.vortex:
        from rope_twin.twin.monitors.vortex import VortexMonitor

        monitors.append(VortexMonitor(scene, asked.vortex))
    return tuple(monitors)

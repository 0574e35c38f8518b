"""Selection of the twin class by the analyses that a run asks for."""

from __future__ import annotations

from rope_twin.twin.accuracy.error_interval import ErrorIntervalTwin
from rope_twin.twin.energy_account import EnergyTwin
from rope_twin.twin.monitored import MonitoredTwin
from rope_twin.twin.twin import Twin
from rope_twin.vortex.settings import MonitorSettings


class EnergyIntervalTwin(EnergyTwin, ErrorIntervalTwin):
    """A twin with an energy balance and a discretisation-error interval."""


def twin_class(
    energy: bool, error_interval: bool, watch: MonitorSettings | None = None
) -> type[Twin]:
    """Return the twin class with these analyses; watch: the VIV and fatigue monitors, if any."""
    kind: type[Twin] = ErrorIntervalTwin if error_interval else Twin
    if energy:
        kind = EnergyIntervalTwin if error_interval else EnergyTwin
    if not watch:
        return kind
    parts = (MonitoredTwin,) if kind is Twin else (MonitoredTwin, kind)
    return type(f"Watched{kind.__name__}", parts, {"asked": watch})

"""rope_twin: a real-time digital twin of the lifting rope.

from rope_twin import Twin
twin = Twin("deep_lift")
twin.submit_speed(None, 0.5)
twin.advance(100)
print(twin.snapshot().tension_top_n)
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from rope_twin.planning.run import plan
    from rope_twin.scene.load import load_scene
    from rope_twin.studies.driven_twin import fed
    from rope_twin.twin.ensemble.fleet import (
        Fleet,
        FleetInputs,
        FleetRecord,
        FleetState,
        LiveState,
        live_state,
    )
    from rope_twin.twin.public import Twin
    from rope_twin.twin.snapshot import Snapshot

__version__ = "0.1.0"
__all__ = [
    "Fleet",
    "FleetInputs",
    "FleetRecord",
    "FleetState",
    "LiveState",
    "Snapshot",
    "Twin",
    "fed",
    "live_state",
    "load_scene",
    "plan",
]

_FLEET = "rope_twin.twin.ensemble.fleet"
_HOMES = {
    "Fleet": _FLEET,
    "FleetInputs": _FLEET,
    "FleetRecord": _FLEET,
    "FleetState": _FLEET,
    "LiveState": _FLEET,
    "fed": "rope_twin.studies.driven_twin",
    "live_state": _FLEET,
    "load_scene": "rope_twin.scene.load",
    "plan": "rope_twin.planning.run",
    "Snapshot": "rope_twin.twin.snapshot",
    "Twin": "rope_twin.twin.public",
}


def __getattr__(name: str) -> Any:
    """Import public names on first use, as the compiler behind Twin takes a second to load."""
    if name not in _HOMES:
        raise AttributeError(f"module 'rope_twin' has no attribute '{name}'")
    from importlib import import_module

    return getattr(import_module(_HOMES[name]), name)

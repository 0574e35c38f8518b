"""Hard cases of the vortex models: a current that jumps or ends, slack in lock-in, hauling in."""

from __future__ import annotations

import math
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np

from rope_twin.effects.strouhal_forcing import StrouhalForcingParams
from rope_twin.effects.travelling_waves import TravellingWavesParams
from rope_twin.effects.wake_oscillator import WakeOscillatorParams
from rope_twin.scene.schema import Winch
from rope_twin.studies.rigs import WATER, Rig, march, still
from rope_twin.studies.stability.check import Case, Check, all_converged
from rope_twin.twin.ledger import AccountedTwin
from rope_twin.twin.snapshot import Snapshot
from rope_twin.twin.twin import Twin

RIG = Rig(
    length=200.0, elements=100, mass=6.4, EA=65e6, diameter=0.04, density=WATER, load=100.0,
    volume=0.02, added=(20.0, 20.0, 20.0), area=(0.5, 0.5, 0.5), drag=(1.2, 0.01), added_mass=1.0,
    damping=5e4, step=0.01,
    winch=Winch(speed_limit_m_per_s=2.0, acceleration_limit_m_per_s2=0.5, least_line_out_m=50.0,
                most_line_out_m=250.0),
)  # fmt: skip
SPEED = 1.5  # of the current that comes at once [m/s]
SELF_LIMIT = 2.0  # diameters; the models limit themselves at about one
GAIN_PCT = 0.01  # of the energy lost: what rounding may bring between two looks
BEGIN_S, PERIOD_S, END_S = 20.0, 2.5, 40.0  # of a heave that lets the rope go slack


def _heave(time: float) -> tuple[float, float]:
    """From 0 to 4 m and back in 2.5 s, from rest to rest."""
    if not BEGIN_S < time < END_S:
        return 0.0, 0.0
    omega = 2.0 * math.pi / PERIOD_S
    angle = omega * (time - BEGIN_S)
    return 2.0 * (1.0 - math.cos(angle)), 2.0 * omega * math.sin(angle)


def _through_it_all(model: Any) -> list[Check]:
    """Current at once, lock-in, slack and snap in it, 20 m hauled through it, lock-in again."""
    scene = RIG.scene()
    twin = Twin(replace(scene, effects=(*scene.effects, model)))
    list(march(twin, _heave, 5.0, 10))
    twin.offer_current(np.array([[0.0, SPEED, 0.0]]))
    locked = list(march(twin, _heave, 15.0, 2))
    rough = list(march(twin, _heave, 20.0, 5))
    hauled = list(march(twin, _heave, 30.0, 5, speeds=[(42.0, -1.0), (62.0, 0.0)]))
    after = list(march(twin, still, 20.0, 2))
    shots = (*locked, *rough, *hauled, *after)
    least = min(float(shot.element_tension_n.min()) for shot in shots)
    return [
        Check("largest amplitude in lock-in, diameters", _across(locked[250:]), SELF_LIMIT, ""),
        Check("the same after slack and hauling", _across(after[500:]), SELF_LIMIT, ""),
        Check("largest push of an element", max(0.0, -least), 0.0, "N"),
        Check("least tension: the rope must go slack", least, 0.0, "N"),
        all_converged(after[-1].solver.unconverged_substeps),
    ]


def _until_it_stops(model: Any) -> list[Check]:
    """Lock-in, the current taken away at once, still water, and the current again."""
    scene = RIG.scene()
    twin = AccountedTwin(replace(scene, effects=(*scene.effects, model)))
    list(march(twin, still, 2.0, 10))
    twin.offer_current(np.array([[0.0, SPEED, 0.0]]))
    locked = list(march(twin, still, 15.0, 2))
    twin.offer_current(np.array([[0.0, 0.0, 0.0]]))
    stopped = list(march(twin, still, 30.0, 2))
    twin.offer_current(np.array([[0.0, SPEED, 0.0]]))
    again = list(march(twin, still, 20.0, 2))
    energy = np.array([shot.energy.change_j for shot in stopped[1:] if shot.energy is not None])
    rise = float(np.diff(energy).max() / (energy.max() - energy.min()))
    return [
        Check("largest amplitude in lock-in, diameters", _across(locked[500:]), SELF_LIMIT, ""),
        Check("the same when it flows again", _across(again[500:]), SELF_LIMIT, ""),
        Check("energy gained in still water over what is lost", 100.0 * max(rise, 0.0), GAIN_PCT),
        all_converged(again[-1].solver.unconverged_substeps),
    ]


def _across(shots: list[Snapshot]) -> float:
    """Largest distance across the current from a node's mean place [diameters]."""
    y = np.array([shot.node_position_m[:, 1] for shot in shots])
    return float(np.abs(y - y.mean(axis=0)).max()) / RIG.diameter


MODELS = (
    ("strouhal", "Strouhal forcing", StrouhalForcingParams(limit_diameters=1.0)),
    ("wake", "wake oscillator", WakeOscillatorParams()),
    ("waves", "travelling waves", TravellingWavesParams()),
)
CASES = tuple(
    Case(f"vortices_{name}", f"current to {SPEED} m/s at once, slack, hauling: {about}",
         "amplitude limited by itself, before and after; never a push",
         partial(_through_it_all, model), 20.0)
    for name, about, model in MODELS
) + tuple(
    Case(f"vortices_{name}_stop", f"current of {SPEED} m/s taken away at once, and back: {about}",
         "amplitude limited by itself; energy in still water that only falls",
         partial(_until_it_stops, model), 20.0)
    for name, about, model in MODELS
)  # fmt: skip

"""Robustness tests of VIV models outside the time step: sudden current, slack in lock-in, hauling.

The rope has twenty elements of five metres, far too coarse for its vortices; the models use a finer
grid of their own. They act on the rope by drag amplification.
"""

from __future__ import annotations

import math
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np

from rope_twin.effects.decomposed_force import DecomposedForceParams
from rope_twin.effects.modal_vibration import ModalVibrationParams
from rope_twin.scene.schema import Winch
from rope_twin.studies.driven_twin import march, still
from rope_twin.twin.monitors.settings import ENERGY
from rope_twin.twin.snapshot import Snapshot
from rope_twin.twin.twin import Twin
from rope_twin.vortex.drag_amplification import GROWTH, DragGrowth
from rope_twin.vortex.results import RopeVibration
from validation.hard_cases.check import Case, Check, all_converged, off
from validation.hard_cases.vortices import treat_roughly
from validation.rigs import WATER, Rig

RIG = Rig(
    length=100.0, elements=20, mass=10.0, EA=120e6, diameter=0.08, density=WATER, load=1000.0,
    volume=0.1, added=(100.0, 100.0, 100.0), area=(1.0, 1.0, 1.0), drag=(1.2, 0.01),
    added_mass=1.0, damping=1e5, step=0.02,
    winch=Winch(speed_limit_m_per_s=2.0, acceleration_limit_m_per_s2=0.5, least_line_out_m=25.0,
                most_line_out_m=125.0),
)  # fmt: skip
SPEED = 1.5  # of the current that comes at once [m/s]
SELF_LIMIT = 2.0  # diameters; the models limit themselves at about one
SHAKES = 0.1  # diameters: less is no vibration
SAME_PCT, HZ_PCT = 20.0, 5.0  # of a fresh rope's amplitude, on the mean of rope and time; its Hz
LEAN_PCT = 10.0  # of the growth of its drag, and of how far downstream it hangs
LEFT_J_PCT = 0.5  # residual of the energy balance over what was exchanged
LOOK_S, FRESH_S = 40.0, 200.0  # the last of both counts; its own sway takes minutes to end
AMPLITUDE_M = 2.5  # of the heave


def _through_it_all(model: Any) -> list[Check]:
    """Apply a sudden current, lock-in, slack and snap, haul 20 m, and lock-in again."""
    scene = RIG.scene()
    twin = Twin(replace(scene, effects=(*scene.effects, model)), ENERGY)
    locked, rough = treat_roughly(twin, AMPLITUDE_M, SPEED, 5)
    after = list(march(twin, still, FRESH_S - LOOK_S, 5))
    before, (last, growth) = after[-1], _looked(twin)
    shots = [*locked, *rough, *after, *last]
    least = min(float(shot.element_tension_n.min()) for shot in shots)
    residual = before.energy.residual_pct if before.energy is not None else math.nan
    return [
        Check("largest amplitude in all of it, diameters", _largest(shots), SELF_LIMIT, ""),
        Check("0.1 diameters over the amplitude in lock-in", SHAKES / _largest(locked), 1.0, ""),
        *_like_a_fresh_rope(model, last, growth),
        Check("largest push of an element", max(0.0, -least), 0.0, "N"),
        Check("least tension: the rope must go slack", least, 0.0, "N"),
        Check("residual of the energy balance", abs(residual), LEFT_J_PCT),
        all_converged(last[-1].solver.unconverged_substeps),
    ]


def _like_a_fresh_rope(model: Any, last: list[Snapshot], growth: float) -> list[Check]:
    """Test that slack and hauling have no lasting effect: VIV and offset as for a new rope."""
    end = last[-1]
    elements, current = len(end.element_tension_n), ((0.0, (SPEED, 0.0)),)
    rig = replace(RIG, length=end.line_out_m, elements=elements, current=current)
    scene = rig.scene()
    twin = Twin(replace(scene, effects=(*scene.effects, model)))
    list(march(twin, still, FRESH_S - LOOK_S, 50))
    fresh, fresh_growth = _looked(twin)
    (size, hertz), (fresh_size, fresh_hertz) = _shaking(last), _shaking(fresh)
    lean, fresh_lean = (_lean(shots) for shots in (last, fresh))
    return [
        off("mean amplitude against a fresh rope of that length", size, fresh_size, SAME_PCT),
        off("mean frequency against that rope's", hertz, fresh_hertz, HZ_PCT),
        off("mean growth of the drag against that rope's", growth, fresh_growth, LEAN_PCT),
        off("lean against that rope's", lean, fresh_lean, LEAN_PCT),
    ]


def _looked(twin: Twin) -> tuple[list[Snapshot], float]:
    """Run LOOK_S more; return its mean drag amplification over rope and time."""
    shots, grown = [], []
    for shot in march(twin, still, LOOK_S, 5):
        own = next(effect for effect in twin.rope.effects if isinstance(effect, DragGrowth))
        grown.append(own.memory[GROWTH, : len(shot.element_tension_n)].mean())
        shots.append(shot)
    return shots, float(np.mean(grown))


def _of(shot: Snapshot) -> RopeVibration:
    assert shot.vibration is not None
    return shot.vibration


def _shaking(shots: list[Snapshot]) -> tuple[float, float]:
    """Return mean amplitude [diameters] and mean frequency, both over rope and time."""
    size = np.mean([_of(shot).cross_flow for shot in shots])
    return float(size), float(np.mean([_of(shot).cross_flow_hz for shot in shots]))


def _lean(shots: list[Snapshot]) -> float:
    """Return the mean downstream offset of the lower end [m]."""
    return float(np.mean([shot.node_position_m[-1, 0] for shot in shots]))


def _largest(shots: list[Snapshot]) -> float:
    """Return the largest amplitude anywhere at any time [diameters]."""
    return max(float(_of(shot).cross_flow.max()) for shot in shots)


CASES = tuple(
    Case(f"vortices_{name}", f"current to {SPEED} m/s at once, slack, hauling: {about}",
         "amplitude limited by itself; afterwards a fresh rope's amplitude, frequency, drag, lean",
         partial(_through_it_all, model), 50.0)
    for name, about, model in (
        ("modal", "modal vibration", ModalVibrationParams()),
        ("decomposed", "decomposed force", DecomposedForceParams()),
    )
)  # fmt: skip

"""Robustness tests of the VIV models: current that jumps or ends, slack in lock-in, hauling in.

Each model goes through a sudden current, lock-in, slack and snap, and hauling; afterwards its
vibration is that of a fresh rope. Two models act within the step, on a rope fine enough for its
vortices. The loosely coupled ones have a grid of their own and act on the rope by drag
amplification: their rope has twenty elements of five metres, far too coarse for its vortices.
"""

from __future__ import annotations

import math
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np

from rope_twin.effects.coupled_vibration import DecomposedForceParams, ModalVibrationParams
from rope_twin.effects.strouhal_forcing import StrouhalForcingParams
from rope_twin.effects.travelling_waves import TravellingWavesParams
from rope_twin.effects.wake_oscillator import WakeOscillatorParams
from rope_twin.scene.schema import Winch
from rope_twin.studies.driven_twin import Motion, march, still
from rope_twin.twin.monitors import ENERGY
from rope_twin.twin.snapshot import Snapshot
from rope_twin.twin.twin import Twin
from rope_twin.vortex.drag_amplification import GROWTH, DragGrowth
from rope_twin.vortex.results import RopeVibration
from validation.case import Finding, limited
from validation.hard_cases.limits import all_converged, hard_case, off
from validation.rigs import WATER, Rig

FINE = Rig(
    length=200.0, elements=100, mass=6.4, EA=65e6, diameter=0.04, density=WATER, load=100.0,
    volume=0.02, added=(20.0, 20.0, 20.0), area=(0.5, 0.5, 0.5), drag=(1.2, 0.01), added_mass=1.0,
    damping=5e4, step=0.01,
    winch=Winch(speed_limit_m_per_s=2.0, acceleration_limit_m_per_s2=0.5, min_line_out_m=50.0,
                max_line_out_m=250.0),
)  # fmt: skip
COARSE = Rig(
    length=100.0, elements=20, mass=10.0, EA=120e6, diameter=0.08, density=WATER, load=1000.0,
    volume=0.1, added=(100.0, 100.0, 100.0), area=(1.0, 1.0, 1.0), drag=(1.2, 0.01),
    added_mass=1.0, damping=1e5, step=0.02,
    winch=Winch(speed_limit_m_per_s=2.0, acceleration_limit_m_per_s2=0.5, min_line_out_m=25.0,
                max_line_out_m=125.0),
)  # fmt: skip
SPEED = 1.5  # of the current that comes at once [m/s]
SELF_LIMIT = 2.0  # diameters; the models limit themselves at about one
SHAKES, SHAKES_COUPLED = 0.02, 0.1  # diameters, rms and amplitude: less is no vibration
SAME_PCT, SAME_HZ_PCT = 20.0, 5.0  # of a fresh rope's amplitude, which still settles; its Hz
LEAN_PCT = 10.0  # of the growth of its drag, and of how far downstream it hangs
AFTER_S, FRESH_S, LOOK_S = 60.0, 100.0, 20.0  # the last of both counts
COUPLED_S, COUPLED_LOOK_S = 200.0, 40.0  # its own sway takes minutes to end
SWAY_HZ = 1.0  # slower is the rope's swing in the current, which takes minutes to end
GAIN_PCT = 0.01  # of the energy lost: what rounding may bring between two looks
LEFT_PCT = 0.5  # residual of the energy balance over what was exchanged
BEGIN_S, PERIOD_S, END_S = 20.0, 2.5, 40.0  # of a heave that lets the rope go slack
AMPLITUDE_M, COUPLED_AMPLITUDE_M = 2.0, 2.5


def slackening_heave(amplitude_m: float) -> Motion:
    """Return a heave from 0 to twice the amplitude and back in 2.5 s, for 20 s."""
    omega = 2.0 * math.pi / PERIOD_S

    def at(time: float) -> tuple[float, float]:
        if not BEGIN_S < time < END_S:
            return 0.0, 0.0
        angle = omega * (time - BEGIN_S)
        return amplitude_m * (1.0 - math.cos(angle)), amplitude_m * omega * math.sin(angle)

    return at


def treat_roughly(
    twin: Twin, amplitude_m: float, speed: float, every: int
) -> tuple[list[Snapshot], list[Snapshot]]:
    """Apply a sudden current, 15 s of lock-in, then slack and snap in it, and haul 20 m through it.

    Return the samples of the lock-in, every so many steps, and of all the rest.
    """
    heave = slackening_heave(amplitude_m)
    list(march(twin, heave, 5.0, 10))
    twin.submit_current(np.array([[0.0, speed, 0.0]]))
    locked = list(march(twin, heave, 15.0, every))
    rough = list(march(twin, heave, 20.0, 5))
    return locked, rough + list(march(twin, heave, 30.0, 5, speeds=[(42.0, -1.0), (62.0, 0.0)]))


def _twin(rig: Rig, model: Any, *monitors: Any) -> Twin:
    scene = rig.scene()
    return Twin(replace(scene, effects=(*scene.effects, model)), *monitors)


def _slack(snapshots: list[Snapshot]) -> list[Finding]:
    """Require that the rope goes slack, and that no element is compressed."""
    smallest_n = min(float(snapshot.element_tension_n.min()) for snapshot in snapshots)
    return [
        limited("largest push of an element", max(0.0, -smallest_n), 0.0, "N"),
        limited("minimum tension: the rope must go slack", smallest_n, 0.0, "N"),
    ]


def _through_it_all(model: Any) -> list[Finding]:
    """Apply a sudden current, lock-in, slack and snap, haul 20 m, and lock-in again."""
    twin = _twin(FINE, model)
    locked, rough = treat_roughly(twin, AMPLITUDE_M, SPEED, 2)
    after = list(march(twin, still, AFTER_S, 2))
    return [
        limited("largest amplitude in lock-in, diameters", _across(locked[250:]), SELF_LIMIT, ""),
        limited("the same after slack and hauling", _across(after[500:]), SELF_LIMIT, ""),
        *_like_a_fresh_rope(model, after),
        *_slack([*locked, *rough, *after]),
        all_converged(after[-1].solver.unconverged_substeps),
    ]


def _until_it_stops(model: Any) -> list[Finding]:
    """Apply lock-in, remove the current, still water, and the current again."""
    twin = _twin(FINE, model, ENERGY)
    list(march(twin, still, 2.0, 10))
    twin.submit_current(np.array([[0.0, SPEED, 0.0]]))
    locked = list(march(twin, still, 15.0, 2))
    twin.submit_current(np.array([[0.0, 0.0, 0.0]]))
    stopped = list(march(twin, still, 30.0, 2))
    twin.submit_current(np.array([[0.0, SPEED, 0.0]]))
    restarted = list(march(twin, still, 20.0, 2))
    energy = np.array(
        [snapshot.energy.change_j for snapshot in stopped[1:] if snapshot.energy is not None]
    )
    rise = float(np.diff(energy).max() / (energy.max() - energy.min()))
    return [
        limited("largest amplitude in lock-in, diameters", _across(locked[500:]), SELF_LIMIT, ""),
        limited("the same when it flows again", _across(restarted[500:]), SELF_LIMIT, ""),
        limited("0.02 diameters over its rms then: it shakes",
                SHAKES / _shaking(restarted[500:])[0], 1.0, ""),
        limited("energy gained in still water over what is lost", 100.0 * max(rise, 0.0), GAIN_PCT),
        all_converged(restarted[-1].solver.unconverged_substeps),
    ]  # fmt: skip


def _like_a_fresh_rope(model: Any, after: list[Snapshot]) -> list[Finding]:
    """Test that slack and hauling have no lasting effect: VIV is that of a new rope."""
    last = after[-1]
    rig = replace(FINE, length=last.line_out_m, elements=len(last.element_tension_n))
    fresh = _twin(rig, model)
    fresh.submit_current(np.array([[0.0, SPEED, 0.0]]))
    snapshots = list(march(fresh, still, FRESH_S, 2))
    look = round(0.5 * LOOK_S / FINE.step)
    (rms, hertz), (fresh_rms, fresh_hertz) = map(_shaking, (after[-look:], snapshots[-look:]))
    rms_pct, hertz_pct = 100.0 * abs(rms / fresh_rms - 1.0), 100.0 * abs(hertz / fresh_hertz - 1.0)
    return [
        limited("0.02 diameters over the rms then: it shakes", SHAKES / rms, 1.0, ""),
        limited("rms amplitude against a fresh rope of that length", rms_pct, SAME_PCT),
        limited("mean frequency against that rope's", hertz_pct, SAME_HZ_PCT),
    ]


def _shaking(snapshots: list[Snapshot]) -> tuple[float, float]:
    """Return cross-flow RMS over rope and time [diameters], and RMS frequency."""
    window = np.hanning(len(snapshots))[:, None]
    power = (np.abs(np.fft.rfft(_sideways(snapshots) * window, axis=0)) ** 2).sum(axis=1)
    frequency = np.fft.rfftfreq(len(snapshots), 2.0 * FINE.step)
    fast = frequency > SWAY_HZ
    power, frequency = power[fast], frequency[fast]
    nodes = len(snapshots[0].node_position_m)
    rms = (
        math.sqrt(2.0 * power.sum() / (len(snapshots) * nodes * (window**2).sum())) / FINE.diameter
    )
    return rms, math.sqrt((power * frequency**2).sum() / power.sum())


def _sideways(snapshots: list[Snapshot]) -> Any:
    """Return the cross-flow offset from each node's mean position [m], (snapshots, nodes)."""
    y = np.array([snapshot.node_position_m[:, 1] for snapshot in snapshots])
    return y - y.mean(axis=0)


def _across(snapshots: list[Snapshot]) -> float:
    """Return the largest cross-flow offset from a node's mean position [diameters]."""
    return float(np.abs(_sideways(snapshots)).max()) / FINE.diameter


def _coupled_through_it_all(model: Any) -> list[Finding]:
    """Apply a sudden current, lock-in, slack and snap, haul 20 m, and lock-in again."""
    twin = _twin(COARSE, model, ENERGY)
    locked, rough = treat_roughly(twin, COUPLED_AMPLITUDE_M, SPEED, 5)
    after = list(march(twin, still, COUPLED_S - COUPLED_LOOK_S, 5))
    before, (last, growth) = after[-1], _looked(twin)
    snapshots = [*locked, *rough, *after, *last]
    residual = before.energy.residual_pct if before.energy is not None else math.nan
    return [
        limited("largest amplitude in all of it, diameters", _largest(snapshots), SELF_LIMIT, ""),
        limited("0.1 diameters over the amplitude in lock-in",
                SHAKES_COUPLED / _largest(locked), 1.0, ""),
        *_coupled_like_a_fresh_rope(model, last, growth),
        *_slack(snapshots),
        limited("residual of the energy balance", abs(residual), LEFT_PCT),
        all_converged(last[-1].solver.unconverged_substeps),
    ]  # fmt: skip


def _coupled_like_a_fresh_rope(model: Any, last: list[Snapshot], growth: float) -> list[Finding]:
    """Test that slack and hauling have no lasting effect: VIV and offset as for a new rope."""
    end = last[-1]
    elements, current = len(end.element_tension_n), ((0.0, (SPEED, 0.0)),)
    rig = replace(COARSE, length=end.line_out_m, elements=elements, current=current)
    twin = _twin(rig, model)
    list(march(twin, still, COUPLED_S - COUPLED_LOOK_S, 50))
    fresh, fresh_growth = _looked(twin)
    (size, hertz), (fresh_size, fresh_hertz) = _mean_response(last), _mean_response(fresh)
    lean, fresh_lean = (_lean(snapshots) for snapshots in (last, fresh))
    return [
        off("mean amplitude against a fresh rope of that length", size, fresh_size, SAME_PCT),
        off("mean frequency against that rope's", hertz, fresh_hertz, SAME_HZ_PCT),
        off("mean growth of the drag against that rope's", growth, fresh_growth, LEAN_PCT),
        off("lean against that rope's", lean, fresh_lean, LEAN_PCT),
    ]


def _looked(twin: Twin) -> tuple[list[Snapshot], float]:
    """Run COUPLED_LOOK_S more; return its mean drag amplification over rope and time."""
    snapshots, grown = [], []
    for snapshot in march(twin, still, COUPLED_LOOK_S, 5):
        growth = next(effect for effect in twin.rope.effects if isinstance(effect, DragGrowth))
        grown.append(growth.memory[GROWTH, : len(snapshot.element_tension_n)].mean())
        snapshots.append(snapshot)
    return snapshots, float(np.mean(grown))


def _of(snapshot: Snapshot) -> RopeVibration:
    assert snapshot.vibration is not None
    return snapshot.vibration


def _mean_response(snapshots: list[Snapshot]) -> tuple[float, float]:
    """Return mean amplitude [diameters] and mean frequency, both over rope and time."""
    size = np.mean([_of(snapshot).cross_flow for snapshot in snapshots])
    return float(size), float(np.mean([_of(snapshot).cross_flow_hz for snapshot in snapshots]))


def _lean(snapshots: list[Snapshot]) -> float:
    """Return the mean downstream offset of the lower end [m]."""
    return float(np.mean([snapshot.node_position_m[-1, 0] for snapshot in snapshots]))


def _largest(snapshots: list[Snapshot]) -> float:
    """Return the largest amplitude anywhere at any time [diameters]."""
    return max(float(_of(snapshot).cross_flow.max()) for snapshot in snapshots)


# A lift that starts as a standing wave keeps its pattern for good in a uniform current, and that of
# a rope that has been treated roughly is another: waves that travel have none to compare.
TRAVELLING = TravellingWavesParams(initial_phase="travelling")
WITHIN_STEP = (
    ("strouhal", "Strouhal forcing", StrouhalForcingParams(limit_diameters=1.0)),
    ("wake", "wake oscillator", WakeOscillatorParams()),
    ("waves", "travelling waves", TRAVELLING),
)
COUPLED = (
    ("modal", "modal vibration", ModalVibrationParams()),
    ("decomposed", "decomposed force", DecomposedForceParams()),
)
SUDDEN, TAKEN = f"current to {SPEED} m/s at once, slack, hauling", f"current of {SPEED} m/s taken"
LIMITED = "amplitude limited by itself"
CASES = (
    *(
        hard_case(f"vortices_{name}", f"{SUDDEN}: {about}",
                  f"{LIMITED}; afterwards a fresh rope's amplitude and frequency",
                  partial(_through_it_all, model), 20.0)
        for name, about, model in WITHIN_STEP
    ),
    *(
        hard_case(f"vortices_{name}_stop", f"{TAKEN} away at once, and back: {about}",
                  f"{LIMITED}; energy in still water that only falls",
                  partial(_until_it_stops, model), 20.0)
        for name, about, model in WITHIN_STEP
    ),
    *(
        hard_case(f"vortices_{name}", f"{SUDDEN}: {about}",
                  f"{LIMITED}; afterwards a fresh rope's amplitude, frequency, drag, lean",
                  partial(_coupled_through_it_all, model), 50.0)
        for name, about, model in COUPLED
    ),
)  # fmt: skip

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
from rope_twin.studies.driven_twin import Motion, march, still
from rope_twin.twin.monitors.settings import ENERGY
from rope_twin.twin.snapshot import Snapshot
from rope_twin.twin.twin import Twin
from validation.hard_cases.check import Case, Check, all_converged
from validation.rigs import WATER, Rig

RIG = Rig(
    length=200.0, elements=100, mass=6.4, EA=65e6, diameter=0.04, density=WATER, load=100.0,
    volume=0.02, added=(20.0, 20.0, 20.0), area=(0.5, 0.5, 0.5), drag=(1.2, 0.01), added_mass=1.0,
    damping=5e4, step=0.01,
    winch=Winch(speed_limit_m_per_s=2.0, acceleration_limit_m_per_s2=0.5, least_line_out_m=50.0,
                most_line_out_m=250.0),
)  # fmt: skip
SPEED = 1.5  # of the current that comes at once [m/s]
SELF_LIMIT = 2.0  # diameters; the models limit themselves at about one
SHAKES = 0.02  # diameters, rms: less is no vibration
SAME_PCT, SAME_HZ_PCT = 20.0, 5.0  # of a fresh rope's rms amplitude, which still settles; its Hz
AFTER_S, FRESH_S, LOOK_S = 60.0, 100.0, 20.0  # the last of both counts
SWAY_HZ = 1.0  # slower is the rope's swing in the current, which takes minutes to end
GAIN_PCT = 0.01  # of the energy lost: what rounding may bring between two looks
BEGIN_S, PERIOD_S, END_S = 20.0, 2.5, 40.0  # of a heave that lets the rope go slack
AMPLITUDE_M = 2.0


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
    twin.offer_current(np.array([[0.0, speed, 0.0]]))
    locked = list(march(twin, heave, 15.0, every))
    rough = list(march(twin, heave, 20.0, 5))
    return locked, rough + list(march(twin, heave, 30.0, 5, speeds=[(42.0, -1.0), (62.0, 0.0)]))


def _through_it_all(model: Any) -> list[Check]:
    """Apply a sudden current, lock-in, slack and snap, haul 20 m, and lock-in again."""
    scene = RIG.scene()
    twin = Twin(replace(scene, effects=(*scene.effects, model)))
    locked, rough = treat_roughly(twin, AMPLITUDE_M, SPEED, 2)
    after = list(march(twin, still, AFTER_S, 2))
    shots = (*locked, *rough, *after)
    least = min(float(shot.element_tension_n.min()) for shot in shots)
    return [
        Check("largest amplitude in lock-in, diameters", _across(locked[250:]), SELF_LIMIT, ""),
        Check("the same after slack and hauling", _across(after[500:]), SELF_LIMIT, ""),
        *_like_a_fresh_rope(model, after),
        Check("largest push of an element", max(0.0, -least), 0.0, "N"),
        Check("least tension: the rope must go slack", least, 0.0, "N"),
        all_converged(after[-1].solver.unconverged_substeps),
    ]


def _until_it_stops(model: Any) -> list[Check]:
    """Apply lock-in, remove the current, still water, and the current again."""
    scene = RIG.scene()
    twin = Twin(replace(scene, effects=(*scene.effects, model)), ENERGY)
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
        Check(
            "0.02 diameters over its rms then: it shakes",
            SHAKES / _shaking(again[500:])[0],
            1.0,
            "",
        ),
        Check("energy gained in still water over what is lost", 100.0 * max(rise, 0.0), GAIN_PCT),
        all_converged(again[-1].solver.unconverged_substeps),
    ]


def _like_a_fresh_rope(model: Any, after: list[Snapshot]) -> list[Check]:
    """Test that slack and hauling have no lasting effect: VIV is that of a new rope."""
    last = after[-1]
    scene = replace(RIG, length=last.line_out_m, elements=len(last.element_tension_n)).scene()
    fresh = Twin(replace(scene, effects=(*scene.effects, model)))
    fresh.offer_current(np.array([[0.0, SPEED, 0.0]]))
    shots = list(march(fresh, still, FRESH_S, 2))
    look = round(0.5 * LOOK_S / RIG.step)
    (rms, hertz), (fresh_rms, fresh_hertz) = map(_shaking, (after[-look:], shots[-look:]))
    rms_pct, hertz_pct = 100.0 * abs(rms / fresh_rms - 1.0), 100.0 * abs(hertz / fresh_hertz - 1.0)
    return [
        Check("0.02 diameters over the rms then: it shakes", SHAKES / rms, 1.0, ""),
        Check("rms amplitude against a fresh rope of that length", rms_pct, SAME_PCT),
        Check("mean frequency against that rope's", hertz_pct, SAME_HZ_PCT),
    ]


def _shaking(shots: list[Snapshot]) -> tuple[float, float]:
    """Return cross-flow RMS over rope and time [diameters], and RMS frequency."""
    window = np.hanning(len(shots))[:, None]
    power = (np.abs(np.fft.rfft(_sideways(shots) * window, axis=0)) ** 2).sum(axis=1)
    frequency = np.fft.rfftfreq(len(shots), 2.0 * RIG.step)
    fast = frequency > SWAY_HZ
    power, frequency = power[fast], frequency[fast]
    nodes = len(shots[0].node_position_m)
    rms = math.sqrt(2.0 * power.sum() / (len(shots) * nodes * (window**2).sum())) / RIG.diameter
    return rms, math.sqrt((power * frequency**2).sum() / power.sum())


def _sideways(shots: list[Snapshot]) -> Any:
    """Return the cross-flow offset from each node's mean position [m], (shots, nodes)."""
    y = np.array([shot.node_position_m[:, 1] for shot in shots])
    return y - y.mean(axis=0)


def _across(shots: list[Snapshot]) -> float:
    """Return the largest cross-flow offset from a node's mean position [diameters]."""
    return float(np.abs(_sideways(shots)).max()) / RIG.diameter


MODELS = (
    ("strouhal", "Strouhal forcing", StrouhalForcingParams(limit_diameters=1.0)),
    ("wake", "wake oscillator", WakeOscillatorParams()),
    ("waves", "travelling waves", TravellingWavesParams()),
)
CASES = tuple(
    Case(f"vortices_{name}", f"current to {SPEED} m/s at once, slack, hauling: {about}",
         "amplitude limited by itself; afterwards a fresh rope's amplitude and frequency",
         partial(_through_it_all, model), 20.0)
    for name, about, model in MODELS
) + tuple(
    Case(f"vortices_{name}_stop", f"current of {SPEED} m/s taken away at once, and back: {about}",
         "amplitude limited by itself; energy in still water that only falls",
         partial(_until_it_stops, model), 20.0)
    for name, about, model in MODELS
)  # fmt: skip

"""VIV model of a scene, the mesh and time step that it requires, and warnings.

The highest shedding frequency along the rope is decisive: a wave of that frequency on the hanging
rope must be resolved in space and time.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from math import floor, hypot, inf, log10, pi, sqrt
from typing import Any

import numpy as np

from rope_twin.effects import EFFECTS
from rope_twin.effects.bending import BendingParams
from rope_twin.effects.current import CurrentParams
from rope_twin.effects.drag import DragParams
from rope_twin.effects.rope_mass import AddedMassParams
from rope_twin.effects.strouhal_forcing import StrouhalForcingParams
from rope_twin.effects.waves import WavesParams
from rope_twin.errors import phrase
from rope_twin.scene.grid import Bar, tension_at_length
from rope_twin.scene.lift import LiftFigures
from rope_twin.scene.schema import Scene
from rope_twin.vortex.results import CoupledSettings

# Linear elements shorten a wave by (π/n)²/6: 0.4 % at 20. At 200 steps TR-BDF2 has a period error
# of 0.01 % and negligible damping; the wake, with a damping of 5 %, needs no more than that.
ELEMENTS_PER_WAVE, STEPS_PER_PERIOD = 20.0, 200.0
PLACES = 64  # sampling points along the rope


STROUHAL = 0.17  # default, where the model has none


@dataclass(frozen=True)
class LockInResolution:
    """Highest expected lock-in frequency, and the resolution that it requires."""

    frequency_hz: float
    element_m: float  # maximum
    step_s: float  # maximum


def expected_pace(scene: Scene, figures: LiftFigures) -> LockInResolution | None:
    """Return the pace for a straight hanging rope; None without a model or without flow."""
    if not shedding_model(scene):
        return None
    z, tension, bars = _hanging(scene, figures)
    speed = _current(scene, z)
    Ca = sum(effect.normal for effect in scene.effects if isinstance(effect, AddedMassParams))
    EI = sum(effect.stiffness_n_m2 for effect in scene.effects if isinstance(effect, BendingParams))
    strouhal = strouhal_number(scene)
    fastest, shortest = 0.0, inf
    for u, T, bar in zip(speed, tension, bars, strict=True):
        d = bar.rope.hydrodynamic_diameter_m
        frequency = strouhal * u / d
        if frequency <= 0.0 or T <= 0.0:
            continue
        moved = Ca * scene.environment.water_density_kg_per_m3 * 0.25 * pi * d * d
        inertia = (bar.rope.mass_kg_per_m + moved) * (2.0 * pi * frequency) ** 2
        # dispersion of a beam under tension, EI·k⁴ + T·k² = m·ω²
        square = 2.0 * inertia / (T + sqrt(T * T + 4.0 * EI * inertia))
        fastest = max(fastest, frequency)
        shortest = min(shortest, 2.0 * pi / sqrt(square))
    if fastest == 0.0:
        return None
    return LockInResolution(
        fastest, shortest / ELEMENTS_PER_WAVE, 1.0 / (STEPS_PER_PERIOD * fastest)
    )


def _hanging(scene: Scene, figures: LiftFigures) -> tuple[list[float], list[float], list[Bar]]:
    """Return elevation [m], tension [N] and section of sampling points from the lower end up."""
    line, top = scene.ropes[0], scene.ship.hang_off_m
    end_tension = tension_at_length(figures.bars, figures.chord_m) if line.fixed_at_m else 0.0
    low = line.fixed_at_m[2] if line.fixed_at_m else top[2] - line.length_m
    weight = sum(bar.weight_n_per_m * bar.length_m for bar in figures.bars)
    rise = (top[2] - low) / line.length_m  # of a straight rope
    z, tension, bars = [], [], []
    for s in (np.arange(PLACES) + 0.5) / PLACES * line.length_m:
        below, length_m = 0.0, 0.0
        for bar in figures.bars:
            inside = min(max(float(s) - length_m, 0.0), bar.length_m)
            below += bar.weight_n_per_m * inside
            length_m += bar.length_m
            if inside < bar.length_m or bar is figures.bars[-1]:
                break
        z.append(low + rise * float(s))
        bars.append(bar)
        tension.append(
            (end_tension - 0.5 * weight if end_tension else figures.payload_weight_n) + below
        )
    return z, tension, bars


def _current(scene: Scene, z: list[float]) -> list[float]:
    """Return the speed of the current at these elevations [m/s]."""
    current = scene.listed(CurrentParams)
    if current is None:
        return [0.0] * len(z)
    heights = [row[0] for row in reversed(current.points)]
    parts = [np.interp(z, heights, [row[1][k] for row in reversed(current.points)]) for k in (0, 1)]
    return [hypot(east, north) for east, north in zip(*parts, strict=True)]


def vortex_words(scene: Scene, figures: LiftFigures) -> str:
    """Return the resolution required and given for the VIV model, before a run; "" without one."""
    pace = expected_pace(scene, figures)
    if pace is None:
        return ""
    cost = _cost(scene, figures, pace)
    if model_beside(scene) is not None:
        return (
            f"{shedding_model(scene)}: lock-in at {pace.frequency_hz:.3g} Hz is computed "
            "decoupled from the step, on its own mesh; this scene's need not resolve it."
        )
    text = (
        f"{shedding_model(scene)}: {_wanted(pace)}; this scene gives "
        f"{figures.longest_element_m:.3g} m and {1e3 * scene.time.step_s:.3g} ms"
    )
    if cost <= 1.0:
        return f"{text}."
    return f"{text}, too coarse; fine ones are {cost:.2g} times slower than this scene without it."


def _wanted(pace: LockInResolution) -> str:
    return (
        f"lock-in at {pace.frequency_hz:.3g} Hz requires elements below "
        f"{_rounded(pace.element_m):g} m and steps below {_rounded(1e3 * pace.step_s):g} ms"
    )


def _cost(scene: Scene, figures: LiftFigures, pace: LockInResolution) -> float:
    """Return the factor of elements and steps over the scene's, without the model's own cost."""
    elements = max(figures.longest_element_m / pace.element_m, 1.0)
    return elements * max(scene.time.step_s / pace.step_s, 1.0)


def check_vortex_resolution(scene: Scene, figures: LiftFigures) -> Iterator[str]:
    """Check elements and step for the highest lock-in frequency."""
    pace = None if model_beside(scene) is not None else expected_pace(scene, figures)
    if pace is None:
        return
    element, step = figures.longest_element_m, scene.time.step_s
    cost = _cost(scene, figures, pace)
    if cost <= 1.0:
        return
    path = "ropes[0].elements" if element > pace.element_m else "time.step_s"
    problem = (
        f"elements of {element:.3g} m and steps of {1e3 * step:.3g} ms are coarse for vortices: "
        f"{_wanted(pace)}"
    )
    yield phrase(path, problem, f"give these: {cost:.2g} times slower than this scene without it")


def check_vortex_inputs(scene: Scene, figures: LiftFigures) -> Iterator[str]:
    """Check for a VIV model without flow or without force."""
    listed = {type(effect) for effect in scene.effects}
    model, sea = shedding_model(scene), scene.sea_state
    if not model:
        return
    moved = bool(sea.path) or sea.poses is not None
    if CurrentParams not in listed and WavesParams not in listed and not moved:
        problem = "nothing flows past the rope, so no vortices are shed"
        yield phrase(f"effects {model}", problem, "add `current`")
    for params, problem in (
        (scene.listed(StrouhalForcingParams),
         "its forces are fractions of `drag`, which is not listed: they are zero"),
        (model_beside(scene),
         "the drag that it amplifies is not listed, so it has no effect on the rope"),
    ):  # fmt: skip
        if params is not None and params.drag is None and DragParams not in listed:
            remedy = "add `drag`, or give the effect a drag of its own"
            yield phrase(f"effects {model}", problem, remedy)


def _rounded(value: float) -> float:
    """Round down to two digits."""
    place = 10.0 ** (floor(log10(value)) - 1)
    return floor(value / place) * place


def shedding_model(scene: Scene) -> str:
    """Return the name of the scene's VIV model, or ""."""
    for effect in EFFECTS:
        if effect.sheds and any(type(params) is effect.params for params in scene.effects):
            return effect.name
    return ""


def model_beside(scene: Scene) -> Any:
    """Return the parameters of the scene's decoupled VIV model, or None."""
    kinds = tuple(effect.params for effect in EFFECTS if effect.beside)
    return next((params for params in scene.effects if isinstance(params, kinds)), None)


def coupled_settings(scene: Scene) -> CoupledSettings:
    """Return the scene's VIV model with its water; params of a decoupled one, else None."""
    return CoupledSettings(
        name=shedding_model(scene),
        params=model_beside(scene),
        strouhal=strouhal_number(scene),
        density=scene.environment.water_density_kg_per_m3,
        step_s=scene.time.step_s,
    )


def strouhal_number(scene: Scene) -> float:
    """Return the Strouhal number of the scene's VIV model, or the default."""
    numbers = (getattr(effect, "strouhal_number", None) for effect in scene.effects)
    return next((number for number in numbers if number is not None), STROUHAL)

"""From a scene to arrays: the model, a state in static equilibrium's neighbourhood, the effects."""

from __future__ import annotations

from dataclasses import dataclass
from math import atan, pi, sqrt
from typing import Any

import numpy as np

from rope_twin.core import state as rows
from rope_twin.core.state import ELEMENTS, POSITION, Floats, Model, State, new_state, new_work
from rope_twin.core.state import Rope as CoreRope
from rope_twin.core.terms import hooks_of
from rope_twin.core.trial import TRIALS
from rope_twin.effects import EFFECTS
from rope_twin.effects.payload import Payload as PayloadEffect
from rope_twin.effects.weight import Weight
from rope_twin.errors import SceneError, phrase
from rope_twin.scene.schema import Payload, RopeLine, Scene
from rope_twin.scene.shapes import PayloadFigures, payload_figures

SPLIT_ABOVE, MERGE_BELOW = 1.5, 0.4  # times the element length; leaves a hysteresis of 0.1
ABSORB_S = 1.0
SPARE_NODES = 4  # the hang-off, a top element not yet merged, and one to spare
TOLERANCE_SHARE, TOLERANCE_LEAST_N, TOLERANCE_MOST_N = 0.003, 1.0, 500.0


@dataclass(frozen=True)
class Built:
    """The arrays of a scene."""

    rope: CoreRope
    static_top_tension_n: float  # of a rope that hangs straight


def build(scene: Scene) -> Built:
    """Arrays for the scene's rope with a straight, stretched first guess of its shape.

    Raises:
        SceneError: an effect without a kernel, or figures that a payload does not give.
    """
    line = scene.ropes[0]
    payload = find_payload(scene, line)
    density = scene.environment.water_density_kg_per_m3
    figures = payload_figures(payload, density) if payload else None
    effects = build_effects(scene, figures)
    sections = _sections(line, figures)
    load = _loads(effects, sections)
    top = load.end + load.per_metre * line.length_m
    length = line.length_m / line.elements
    model = Model(
        element_length=length,
        split_above=SPLIT_ABOVE * length,
        merge_below=MERGE_BELOW * length,
        absorb=ABSORB_S,
        first_free=1 if line.fixed_at_m is not None else 0,
        step=scene.time.step_s,
        tolerance=scene.time.newton_tolerance_n or _tolerance(top),
    )
    most = scene.winch.most_line_out_m if scene.winch else line.length_m
    elements = max(int(np.ceil(most / length)), line.elements)
    state = new_state(elements + SPARE_NODES + TRIALS)
    state.counts[ELEMENTS] = line.elements
    state.s[: line.elements + 1] = np.linspace(0.0, line.length_m, line.elements + 1)
    _place(state, scene, line, load)
    return Built(CoreRope(model, state, new_work(state.s.shape[0]), sections, effects), top)


def find_payload(scene: Scene, line: RopeLine) -> Payload | None:
    """The payload at the line's lower end, or None if that end is fixed."""
    return next((payload for payload in scene.payloads if payload.name == line.to), None)


def build_effects(scene: Scene, figures: PayloadFigures | None) -> tuple[Any, ...]:
    """The kernels' data of the effects that the scene lists, in the order of EFFECTS."""
    built = []
    for effect in EFFECTS:
        for params in scene.effects:
            if type(params) is effect.params:
                built.append(effect.build(params, figures, scene.environment))
                if not hooks_of(type(built[-1])):
                    raise SceneError(
                        phrase(f"effect '{effect.name}'", "it has no kernel", "mend its file")
                    )
    return tuple(built)


def damping_newton_seconds(line: RopeLine, figures: PayloadFigures | None) -> float:
    """c of T = EA·strain + c·strain rate [N·s], independent of the elements.

    From a fraction ζ of critical on the first axial mode: c = 2·ζ·EA/ω, since the mode's damping
    is c/EA of its stiffness.
    """
    if line.damping.newton_seconds is not None:
        return line.damping.newton_seconds
    fraction = line.damping.fraction_of_first_axial_mode or 0.0
    mass = figures.mass_kg + float(figures.added_mass_kg[2]) if figures else np.inf
    return 2.0 * fraction * line.rope.axial_stiffness_n / first_axial_frequency(line, mass)


def first_axial_frequency(line: RopeLine, mass_kg: float) -> float:
    """ω [rad/s] of the first axial mode of rope and end mass: x·tan x = m·L/M, ω = x·c/L.

    A fixed end (infinite mass) gives x = π. Closed form of the longitudinal bar with an end mass.
    """
    rope, length = line.rope, line.length_m
    speed = sqrt(rope.axial_stiffness_n / rope.mass_kg_per_m)
    if np.isinf(mass_kg):
        return pi * speed / length
    if mass_kg <= 0.0:
        return 0.5 * pi * speed / length
    ratio = rope.mass_kg_per_m * length / mass_kg
    low, high = 0.0, 0.5 * pi
    for _ in range(200):
        x = 0.5 * (low + high)
        low, high = (x, high) if x < atan(ratio / x) else (low, x)
    return 0.5 * (low + high) * speed / length


@dataclass(frozen=True)
class _Loads:
    per_metre: float  # weight in water of the rope [N/m]
    end: float  # weight in water of the payload [N]


def _sections(line: RopeLine, figures: PayloadFigures | None) -> Floats:
    """The rope's figures per metre, (rows.SECTION_ROWS, sections)."""
    rope, diameter = line.rope, line.rope.hydrodynamic_diameter_m
    column = np.zeros(rows.SECTION_ROWS)
    column[rows.END] = np.inf
    column[rows.EA] = rope.axial_stiffness_n
    column[rows.C] = damping_newton_seconds(line, figures)
    column[rows.PER_METRE :] = (
        rope.mass_kg_per_m, 0.25 * pi * diameter**2, diameter, pi * diameter,
    )  # fmt: skip
    return column[:, None].copy()


def _loads(effects: tuple[Any, ...], sections: Floats) -> _Loads:
    """Vertical loads that the scene's effects bring, for the first guess."""
    mass, volume = sections[rows.PER_METRE : rows.PER_METRE + 2, 0]
    per_metre = sum(
        effect.g * (mass - effect.density * volume)
        for effect in effects
        if isinstance(effect, Weight)
    )
    end = sum(effect.W for effect in effects if isinstance(effect, PayloadEffect))
    return _Loads(float(per_metre), float(end))


def _tolerance(top_tension: float) -> float:
    """Largest tension mismatch of an accepted stage [N]."""
    share = TOLERANCE_SHARE * abs(top_tension)
    return min(max(share, TOLERANCE_LEAST_N), TOLERANCE_MOST_N)


def _place(state: State, scene: Scene, line: RopeLine, load: _Loads) -> None:
    """First guess: hanging straight and stretched, or straight to the fixed end."""
    n = line.elements
    top = np.array(scene.ship.hang_off_m)
    s = state.s[: n + 1]
    if line.fixed_at_m is not None:
        low = np.array(line.fixed_at_m)
        state.nodes[POSITION : POSITION + 3, : n + 1] = low[:, None] + (top - low)[:, None] * (
            s / s[-1]
        )
        return
    tension = np.maximum(load.end + load.per_metre * s, 0.0)
    stretched = np.diff(s) * (
        1.0 + 0.5 * (tension[:-1] + tension[1:]) / line.rope.axial_stiffness_n
    )
    depth: Floats = np.concatenate([[0.0], np.cumsum(stretched)])
    state.nodes[POSITION, : n + 1] = top[0]
    state.nodes[POSITION + 1, : n + 1] = top[1]
    state.nodes[POSITION + 2, : n + 1] = top[2] - depth[-1] + depth

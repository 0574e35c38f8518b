"""What an effect costs a step where it is listed, and that it costs nothing where it is not.

Three ropes step in turns: the scene with the effect, the scene without it, and that one again. The
last two differ by what the timing is worth. Whether the code of the scene without contains the
effect is read from its assembly.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from rope_twin.core.state import Boundary
from rope_twin.effects import EFFECTS
from rope_twin.effects.bending import BendingParams
from rope_twin.effects.decomposed_force import DecomposedForceParams
from rope_twin.effects.fairing import FairingParams
from rope_twin.effects.modal_vibration import ModalVibrationParams
from rope_twin.effects.net import NetParams
from rope_twin.effects.payload import PayloadParams
from rope_twin.effects.rigid_body import RigidBodyParams, Sling
from rope_twin.effects.seabed import SeabedParams
from rope_twin.effects.splash_zone import SplashZoneParams
from rope_twin.effects.strouhal_forcing import StrouhalForcingParams
from rope_twin.effects.travelling_waves import TravellingWavesParams
from rope_twin.effects.wake_oscillator import WakeOscillatorParams
from rope_twin.effects.waves import Jonswap, WavesParams
from rope_twin.scene.load import load_scene
from rope_twin.scene.schema import Scene
from rope_twin.studies.bench.effect_code import modules_of, step_assembly, traces
from rope_twin.studies.state_bench import Bench, time_in_turns
from rope_twin.studies.variants import variant, with_effect

BASE, STEP_S, DEPTH_M = "smooth_2km", 0.01, 2050.0
ADDED: dict[str, Any] = {
    "waves": WavesParams(
        jonswap=Jonswap(significant_height_m=2.5, peak_period_s=8.5), components=200,
        spreading=6.0, depth_m=DEPTH_M,
    ),
    "bending": BendingParams(stiffness_n_m2=2e4),
    "strouhal_forcing": StrouhalForcingParams(limit_diameters=1.0),
    "wake_oscillator": WakeOscillatorParams(),
    "travelling_waves": TravellingWavesParams(),
    "modal_vibration": ModalVibrationParams(),  # in the step: the drag that it makes grow
    "decomposed_force": DecomposedForceParams(),
    "seabed": SeabedParams(depth_m=DEPTH_M),
    "rigid_body": RigidBodyParams(
        size_m=(4.0, 3.0, 2.5),
        slings=tuple(
            Sling(to_m=(x, y, 1.25), length_m=8.0, stiffness_n_per_m=5e6)
            for x, y in ((1.8, 1.3), (1.8, -1.3), (-1.8, 1.3), (-1.8, -1.3))
        ),
    ),
    "splash_zone": SplashZoneParams(height_m=3.0),
    "net": NetParams(width_m=12.0, height_m=8.0, twine_m=0.003, bar_m=0.03, panels=2),
    "fairing": FairingParams(face_m2=4.0),
}  # fmt: skip
TOGETHER = ("waves", "seabed")  # beside the base's own: the sea that a lift usually has
AMPLITUDE_M, PERIOD_S = 1.5, 8.0
HELD_STRAIN = 5e-3  # of the rope without a payload: it stays taut while the hang-off heaves
SETTLE_S, PIECES, NODE_STEPS = 1.0, 15, 100_000  # node-steps of a piece
Listener = Callable[[int, int, str], None]


@dataclass(frozen=True)
class EffectSpeed:
    """One effect in the base scene, medians of the pieces."""

    effect: str
    nodes: int
    us_per_step_base: float  # without it
    us_per_step_off: float  # without it, a second rope
    us_per_step_on: float
    symbols_off: int | None  # of its functions in the code without; None: not of one effect
    real_time_factor_on: float


def effect_speeds(elements: int, names: Sequence[str], listen: Listener) -> Iterator[EffectSpeed]:
    """A row per effect of `names`; with waves among them, one of all that a lift usually has.

    Raises:
        SolverError: a rope finds no rest, or a step is not finite.
    """
    base = variant(load_scene(BASE), elements, STEP_S)
    codes: dict[tuple[type, ...], str] = {}
    for number, name in enumerate(names):
        listen(number, len(names) + 1, name)
        yield _measured(base, name, codes)
    if TOGETHER[0] in names:
        listen(len(names), len(names) + 1, " and ".join(TOGETHER))
        yield _together(base)
    listen(len(names) + 1, len(names) + 1, "done")


def all_names() -> tuple[str, ...]:
    """All effects."""
    return tuple(effect.name for effect in EFFECTS)


def speed_table(rows: Sequence[EffectSpeed]) -> list[tuple[str, ...]]:
    """The rows as words, below a head."""
    head = (
        "effect", "µs a step without", "again", "with", "costs", "in the code without",
        "× real time",
    )  # fmt: skip
    table: list[tuple[str, ...]] = [head]
    for row in rows:
        code = {None: "-", 0: "no"}.get(row.symbols_off, f"{row.symbols_off} symbols")
        table.append(
            (
                row.effect,
                f"{row.us_per_step_base:.1f}",
                f"{row.us_per_step_off:.1f}",
                f"{row.us_per_step_on:.1f}",
                f"{row.us_per_step_on - row.us_per_step_base:+.1f}",
                code,
                f"{row.real_time_factor_on:.0f}",
            )
        )
    return table


def _measured(base: Scene, name: str, codes: dict[tuple[type, ...], str]) -> EffectSpeed:
    params = next(effect.params for effect in EFFECTS if effect.name == name)
    listed = next((own for own in base.effects if type(own) is params), None)
    if listed is None:
        listed, without, whole = ADDED[name], base, with_effect(base, ADDED[name])
    else:
        without, whole = _without(base, listed), base
    kinds = tuple(type(own) for own in without.effects)
    if kinds not in codes:
        codes[kinds] = step_assembly(without)
    symbols = sum(traces(codes[kinds], module) for module in modules_of(whole, without))
    off, again, on = _took(without, without, whole)
    elements = base.ropes[0].elements
    return EffectSpeed(name, elements, off, again, on, symbols, 1e6 * STEP_S / on)


def _without(base: Scene, listed: Any) -> Scene:
    """The base less an effect; without the payload the rope is held where that hung."""
    kept = tuple(own for own in base.effects if own is not listed)
    if not isinstance(listed, PayloadParams):
        return replace(base, effects=kept)
    line, (x, y, z) = base.ropes[0], base.ship.hang_off_m
    held = replace(line, to="", fixed_at_m=(x, y, z - (1.0 + HELD_STRAIN) * line.length_m))
    return replace(base, effects=kept, payloads=(), ropes=(held,))


def _together(base: Scene) -> EffectSpeed:
    whole = base
    for name in TOGETHER:
        whole = with_effect(whole, ADDED[name])
    off, again, on = _took(base, base, whole)
    words = "with " + " and ".join(TOGETHER)
    elements = base.ropes[0].elements
    return EffectSpeed(words, elements, off, again, on, None, 1e6 * STEP_S / on)


def _took(*scenes: Scene) -> list[float]:
    """Microseconds of a step of each scene under heave, taken in turns."""
    benches = [Bench(scene) for scene in scenes]
    steps = max(1, NODE_STEPS // scenes[0].ropes[0].elements)
    for bench in benches:
        bench.follow(_heave(bench, round(SETTLE_S / STEP_S)))
    took = time_in_turns(benches, PIECES, lambda bench: _heave(bench, steps))
    return [1e6 * float(np.median(own)) / steps for own in took]


def _heave(bench: Bench, steps: int) -> Boundary:
    """The hang-off from here on: z = A·(1 - cos ω·t)."""
    omega = 2.0 * math.pi / PERIOD_S
    t = bench.time + STEP_S * np.arange(steps + 1)
    value = np.tile([*bench.hang_off, bench.length], (steps + 1, 1))
    rate = np.zeros_like(value)
    value[:, 2] += AMPLITUDE_M * (1.0 - np.cos(omega * t))
    rate[:, 2] = AMPLITUDE_M * omega * np.sin(omega * t)
    return Boundary(value, rate)

"""Cost of an effect per step where it is listed, and proof that it costs nothing elsewhere.

Three ropes are stepped in turns: the scene without the effect, the same again, and the scene with
it. The difference of the first two is the uncertainty of the timing (benchmarks/paired). Whether
the code of the scene without it contains the effect is read from its assembly.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from benchmarks.paired import Plan, Ratio, ratio_of, time_rounds
from rope_twin.core.jit.decorators import assembly
from rope_twin.core.loads.hooks import hooks_of, kernel_of
from rope_twin.core.state import MOTIONS, PULL_COLUMNS, Boundary
from rope_twin.core.step import advance_steps
from rope_twin.effects import EFFECTS
from rope_twin.effects.bed_friction import BedFrictionParams
from rope_twin.effects.bending import BendingParams
from rope_twin.effects.compensator import CompensatorParams
from rope_twin.effects.coupled_vibration import DecomposedForceParams, ModalVibrationParams
from rope_twin.effects.depth_profiles import DepthProfilesParams
from rope_twin.effects.fluid_ramp import FluidRampParams, LoadCurve
from rope_twin.effects.hull_contact import HullBox, HullContactParams
from rope_twin.effects.net_curtain import NetCurtainParams
from rope_twin.effects.payload import PayloadParams, SplashZoneParams
from rope_twin.effects.payload_faces import FairingParams, NetParams
from rope_twin.effects.payload_oscillation import PayloadOscillationParams
from rope_twin.effects.payload_shedding import PayloadSheddingParams
from rope_twin.effects.rigid_body import RigidBodyParams, Sling
from rope_twin.effects.rope_in_air import WettingParams, WindParams
from rope_twin.effects.seabed import SeabedParams
from rope_twin.effects.strouhal_forcing import StrouhalForcingParams
from rope_twin.effects.travelling_waves import TravellingWavesParams
from rope_twin.effects.wake_oscillator import WakeOscillatorParams
from rope_twin.effects.waves import Jonswap, WavesParams
from rope_twin.errors import InputError, did_you_mean
from rope_twin.scene.load import load_scene
from rope_twin.scene.rope_model import build
from rope_twin.scene.schema import Scene
from rope_twin.studies.driven_twin import variant, with_effect
from validation.case import Listener
from validation.state_bench import Bench

BASE, STEP_S, DEPTH_M = "smooth_2km", 0.01, 2050.0
ADDED: dict[str, Any] = {
    "waves": WavesParams(
        jonswap=Jonswap(significant_height_m=2.5, peak_period_s=8.5), components=200,
        spreading=6.0, depth_m=DEPTH_M,
    ),
    "wetting": WettingParams(),
    "depth_profiles": DepthProfilesParams(
        density_kg_per_m3=tuple((-50.0 * k, 1025.0 + 0.22 * k) for k in range(42)),
        drag_factor=((0.0, 1.3), (-60.0, 1.0)),
    ),
    "wind": WindParams(velocity_m_per_s=(12.0, 0.0)),
    "bending": BendingParams(stiffness_n_m2=2e4),
    "strouhal_forcing": StrouhalForcingParams(limit_diameters=1.0),
    "wake_oscillator": WakeOscillatorParams(),
    "travelling_waves": TravellingWavesParams(),
    "modal_vibration": ModalVibrationParams(),  # in the step: the drag that it makes grow
    "decomposed_force": DecomposedForceParams(),
    "seabed": SeabedParams(depth_m=DEPTH_M),
    "bed_friction": BedFrictionParams(),
    "hull_contact": HullContactParams(
        boxes=(HullBox(centre_m=(0.0, 0.0, -12.0), size_m=(3.0, 3.0, 9.0), opening=True),)
    ),
    "payload_oscillation": PayloadOscillationParams(
        size_m=(4.0, 3.0, 2.5), drag=((1.0, 2.0), (20.0, 1.0)), added_mass=((0.5, 0.8), (3.0, 1.2)),
    ),
    "rigid_body": RigidBodyParams(
        size_m=(4.0, 3.0, 2.5),
        slings=tuple(
            Sling(to_m=(x, y, 1.25), length_m=8.0, stiffness_n_per_m=5e6)
            for x, y in ((1.8, 1.3), (1.8, -1.3), (-1.8, 1.3), (-1.8, -1.3))
        ),
    ),
    "splash_zone": SplashZoneParams(height_m=3.0),
    "net": NetParams(width_m=12.0, height_m=8.0, twine_m=0.003, bar_m=0.03, panels=2),
    "net_curtain": NetCurtainParams(
        from_m=50.0, to_m=250.0, width_m=6.0, twine_m=0.003, bar_m=0.03, heading_deg=90.0
    ),
    "fairing": FairingParams(face_m2=4.0),
    "payload_shedding": PayloadSheddingParams(
        strouhal=0.2, lift_coefficient=0.4, diameter_m=3.0, area_m2=9.0
    ),
    "fluid_ramp": FluidRampParams(water=LoadCurve(ramp_s=5.0)),
    "compensator": CompensatorParams(  # the lowest element of the rope, not a unit above the load
        stroke_m=4.0, piston_area_m2=0.02, gas_pressure_pa=8e6, gas_volume_m3=1.0, exponent=1.3,
        damping_newton_seconds_per_m=2e3, throttling_kg_per_m=4e3, friction_n=500.0,
    ),
}  # fmt: skip
BETWEEN = ("line_contact", "payload_contact")  # what acts between ropes; the base has one
NEEDS = {"wind": "wetting", "bed_friction": "seabed"}  # what acts only beside another
TOGETHER = ("waves", "seabed")  # beside the base's own: the sea that a lift usually has
TOGETHER_NAME = "with waves and seabed"
AMPLITUDE_M, PERIOD_S = 1.5, 8.0
HELD_STRAIN = 5e-3  # of the rope without a payload: it stays taut while the hang-off heaves
# Settled is what is asked for: while a sea rises, less of it is there.
SETTLE_S, SETS, ROUNDS, NODE_STEPS = 10.0, 6, 8, 60_000  # node-steps of a piece


@dataclass(frozen=True)
class EffectSpeed:
    """One effect in the base scene, medians of the pieces, by the processor's own time."""

    effect: str
    nodes: int
    us_per_step_base: float  # without it
    us_per_step_off: float  # without it, a second rope
    us_per_step_on: float
    off_over_base: Ratio  # piece by piece; what differs from 1 is what the timing is worth
    on_over_base: Ratio
    symbols_off: int | None  # of its functions in the code without; None: not of one effect
    real_time_factor_on: float


def effect_speeds(elements: int, names: Sequence[str], listen: Listener) -> Iterator[EffectSpeed]:
    """Return a row per effect of `names`; with waves, also one of all effects of a typical lift.

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
    """Return the names of all effects that act on a single rope."""
    return tuple(effect.name for effect in EFFECTS if effect.name not in BETWEEN)


def choose_names(names: Sequence[str]) -> tuple[str, ...]:
    """Return these effects, or all if none is named.

    Raises:
        InputError: there is no such effect.
    """
    for name in names:
        if name not in all_names():
            right = did_you_mean(name, all_names())
            raise InputError("python -m benchmarks effects", f"there is no effect `{name}`", right)
    return tuple(name for name in all_names() if name in names) or all_names()


def _measured(base: Scene, name: str, codes: dict[tuple[type, ...], str]) -> EffectSpeed:
    params = next(effect.params for effect in EFFECTS if effect.name == name)
    listed = next((present for present in base.effects if type(present) is params), None)
    if listed is None:
        if name in NEEDS:
            base = with_effect(base, ADDED[NEEDS[name]])
        listed, base_scene, extended = ADDED[name], base, with_effect(base, ADDED[name])
    else:
        base_scene, extended = _without(base, listed), base
    kinds = tuple(type(present) for present in base_scene.effects)
    if kinds not in codes:
        codes[kinds] = step_assembly(base_scene)
    symbols = sum(traces(codes[kinds], place) for place in places_of(extended, base_scene))
    return _row(name, base_scene, extended, symbols)


def _without(base: Scene, listed: Any) -> Scene:
    """Return the base scene less an effect; without the payload the lower end is fixed there."""
    effects = tuple(effect for effect in base.effects if effect is not listed)
    if not isinstance(listed, PayloadParams):
        return replace(base, effects=effects)
    line, (x, y, z) = base.ropes[0], base.ship.hang_off_m
    fixed_line = replace(line, to="", fixed_at_m=(x, y, z - (1.0 + HELD_STRAIN) * line.length_m))
    return replace(base, effects=effects, payloads=(), ropes=(fixed_line,))


def _together(base: Scene) -> EffectSpeed:
    extended = base
    for name in TOGETHER:
        extended = with_effect(extended, ADDED[name])
    return _row(TOGETHER_NAME, base, extended, None)


def _row(name: str, base_scene: Scene, extended: Scene, symbols: int | None) -> EffectSpeed:
    """Time a scene, the same again and one with more effects, in turns."""
    elements = extended.ropes[0].elements
    plan = Plan(SETS, ROUNDS, round(SETTLE_S / STEP_S), max(1, NODE_STEPS // elements))
    took = time_rounds(
        lambda: [Bench(scene) for scene in (base_scene, base_scene, extended)], _heave, plan
    )
    base, repeat_us, extended_us = (1e6 * float(np.median(times)) for times in took)
    repeat_ratio, more = ratio_of(took[1], took[0]), ratio_of(took[2], took[0])
    return EffectSpeed(
        name,
        elements,
        base,
        repeat_us,
        extended_us,
        repeat_ratio,
        more,
        symbols,
        1e6 * STEP_S / extended_us,
    )


def _heave(bench: Bench, steps: int) -> Boundary:
    """Return the hang-off motion from here on: z = A·(1 - cos ω·t)."""
    omega = 2.0 * math.pi / PERIOD_S
    t = bench.time + STEP_S * np.arange(steps + 1)
    value = np.tile([*bench.hang_off, bench.length], (steps + 1, 1))
    rate = np.zeros_like(value)
    value[:, 2] += AMPLITUDE_M * (1.0 - np.cos(omega * t))
    rate[:, 2] = AMPLITUDE_M * omega * np.sin(omega * t)
    return Boundary(value, rate)


def step_assembly(scene: Scene) -> str:
    """Return the assembly of the step for the scene's effects; it takes about 10 s."""
    border = np.zeros((2, MOTIONS))
    arguments = (build(scene), Boundary(border, border), np.zeros((1, PULL_COLUMNS)), 0.0, 0, 1)
    return assembly(advance_steps, arguments)


def places_of(scene: Scene, base_scene: Scene) -> tuple[str, ...]:
    """Return module and function of the kernels that one scene has and another has not."""
    base_kinds = {type(effect) for effect in build(base_scene).effects}
    kinds = [
        type(candidate) for candidate in build(scene).effects if type(candidate) not in base_kinds
    ]
    kernels = [kernel_of(hook, kind) for kind in kinds for hook in hooks_of(kind)]
    functions = [kernel.py_func for kernel in kernels]
    return tuple(sorted({f"{f.__module__}.{f.__qualname__.split('.')[0]}" for f in functions}))


def traces(code: str, place: str) -> int:
    """Count the symbols of a module or a function in assembly, as numba mangles them."""
    return code.count("".join(f"{len(part)}{part}" for part in place.split(".")))

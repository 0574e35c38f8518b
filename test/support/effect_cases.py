"""Results of every effect on small arrays and on a small rope, compiled and in plain Python.

A new effect gets its row in PARAMS the day it is listed; until then the tests say so.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
from body_rigs import aground
from compensator_rigs import PASSIVE, compensated
from compensator_rigs import RIG as STROKING
from joint_rigs import bent_ladder, triangle
from numpy.typing import NDArray
from rigs import Rig, march, sine
from table_rigs import HMPE, tabled

from rope_twin import Twin
from rope_twin.core import state as rows
from rope_twin.core.axial_law import law_of
from rope_twin.core.elements import stretch
from rope_twin.core.jit.decorators import jit_entry
from rope_twin.core.joined.line_contact import add_interactions
from rope_twin.core.loads.balance import add_couplings, add_end, add_flow, add_load
from rope_twin.core.loads.hooks import hooks_of
from rope_twin.effects import EFFECTS
from rope_twin.effects.bed_friction import BedFrictionParams
from rope_twin.effects.bending import BendingParams
from rope_twin.effects.compensator import ActiveCylinder, CompensatorParams
from rope_twin.effects.coupled_vibration import DecomposedForceParams, ModalVibrationParams
from rope_twin.effects.current import CurrentParams, Layers
from rope_twin.effects.depth_profiles import DepthProfilesParams
from rope_twin.effects.drag import DragParams, KeuleganCarpenter, RoughnessTable
from rope_twin.effects.fluid_ramp import FluidRampParams, LoadCurve
from rope_twin.effects.hull_contact import (
    BEFORE,
    FRICTION,
    KNOWN,
    REACHED,
    HullBox,
    HullContactParams,
)
from rope_twin.effects.line_contact import LineContactParams
from rope_twin.effects.net_curtain import NetCurtainParams
from rope_twin.effects.payload import PayloadParams, SplashZoneParams
from rope_twin.effects.payload_contact import ContactSphere, PayloadContactParams
from rope_twin.effects.payload_faces import FairingParams, NetParams
from rope_twin.effects.payload_oscillation import PayloadOscillationParams
from rope_twin.effects.payload_shedding import PayloadSheddingParams
from rope_twin.effects.rigid_body import RigidBodyParams, Sling
from rope_twin.effects.rope_in_air import WettingParams, WindParams
from rope_twin.effects.rope_mass import AddedMassParams, WeightParams
from rope_twin.effects.seabed import SeabedParams
from rope_twin.effects.strouhal_forcing import StrouhalForcingParams
from rope_twin.effects.travelling_waves import TravellingWavesParams
from rope_twin.effects.wake_oscillator import WakeOscillatorParams
from rope_twin.effects.waves import Jonswap, WavesParams
from rope_twin.scene.rope_model import build_effects
from rope_twin.scene.schema import Scene, Winch
from rope_twin.scene.shapes import payload_figures
from rope_twin.twin import ropes

Vector = NDArray[np.float64]
NODES = 13
SHEDDING = [effect.name for effect in EFFECTS if effect.sheds]
OSCILLATING = ("payload_oscillation", "drag over Keulegan-Carpenter numbers")
CURTAINS = ("net_curtain", "net_curtain that trails")
RESULTS = (  # flow, R; blocks; couplings; tension of the lowest element, which has no stiffness
    slice(rows.FLOW, rows.FLOW + 6), slice(rows.BLOCK, rows.BLOCK + 6),
    slice(rows.LINK, rows.LINK + 2), slice(rows.TENSION, rows.TENSION + 1),
)  # fmt: skip

PARAMS: dict[str, Any] = {
    "current": CurrentParams(
        profile=((0.0, (0.8, 0.1)), (-30.0, (0.3, 0.5)), (-70.0, (-0.2, 0.4)))
    ),
    "waves": WavesParams(
        jonswap=Jonswap(significant_height_m=2.5, peak_period_s=7.0),
        components=12,
        seed=3,
        heading_deg=30.0,
        spreading=4.0,
        depth_m=95.0,
        ramp_s=4.0,
    ),
    "wetting": WettingParams(),
    "depth_profiles": DepthProfilesParams(
        density_kg_per_m3=((-5.0, 1005.0), (-30.0, 1028.0), (-80.0, 1060.0)),
        drag_factor=((0.0, 1.6), (-40.0, 0.8)),
    ),
    "wind": WindParams(velocity_m_per_s=(14.0, -5.0)),
    "weight": WeightParams(),
    "drag": DragParams(normal=1.3, tangential=0.03),
    "added_mass": AddedMassParams(normal=1.4),
    "bending": BendingParams(stiffness_n_m2=5e3, clamped_along=(0.3, 0.1, -1.0)),
    "strouhal_forcing": StrouhalForcingParams(drag=1.2, in_line=0.2),
    "wake_oscillator": WakeOscillatorParams(set="facchinetti", start_per_s=5.0, shape_over_s=2.0),
    "travelling_waves": TravellingWavesParams(strouhal=0.2, periods=0.5, ramp_s=0.5),
    "modal_vibration": ModalVibrationParams(modes_every_s=0.5, drag=1.2),
    "decomposed_force": DecomposedForceParams(added_mass=1.0, modes_every_s=0.5, drag=0.7),
    "seabed": SeabedParams(
        depth_m=50.0, slope=(0.1, -0.05), stiffness_n_per_m3=1e4, damping_s_per_m=0.2, friction=0.0
    ),
    "bed_friction": BedFrictionParams(axial=0.4, lateral=0.8, slip_m=0.05),
    "hull_contact": HullContactParams(
        boxes=(
            HullBox(centre_m=(0.4, 0.3, -20.0), size_m=(1.8, 1.6, 25.0), opening=True),
            HullBox(centre_m=(-12.0, 3.0, -60.0), size_m=(20.0, 16.0, 50.0)),
        ),
        heading_deg=25.0,
        payload_radius_m=0.3,
        stiffness_n_per_m2=2e3,
        payload_stiffness_n_per_m=2e4,
        friction=0.3,
    ),
    "line_contact": LineContactParams(
        distance_m=0.5, stiffness_n_per_m=2e3, damping_s_per_m=0.2, friction=0.3
    ),
    "payload_contact": PayloadContactParams(
        bodies=(ContactSphere(name="skip", radius_m=9.0), ContactSphere(name="hook", radius_m=7.0)),
        stiffness_n_per_m=2e3,
        damping_s_per_m=0.2,
        friction=0.3,
    ),
    "payload": PayloadParams(),
    "payload_oscillation": PayloadOscillationParams(
        size_m=(1.0, 1.0, 1.5),
        drag=((1.0, 2.0), (10.0, 1.2), (40.0, 0.9)),
        added_mass=((0.5, 0.6), (3.0, 1.5)),
        window_s=8.0,
    ),
    "rigid_body": RigidBodyParams(
        size_m=(2.0, 1.5, 1.0),
        centre_of_gravity_m=(0.2, 0.1, -0.1),
        centre_of_drag_m=(-0.1, 0.0, 0.1),
        heading_deg=30.0,
        hook_mass_kg=40.0,
        slings=tuple(
            Sling(
                to_m=(x, y, 0.5),
                length_m=3.0,
                stiffness_n_per_m=4e5,
                damping_newton_seconds_per_m=2e3,
            )
            for x, y in ((0.9, 0.7), (0.9, -0.7), (-0.9, 0.0))
        ),
    ),
    "splash_zone": SplashZoneParams(height_m=200.0, bottom_area_m2=6.0, slamming=5.0),
    "net": NetParams(width_m=2.0, height_m=1.5, solidity=0.2, facing_deg=40.0, panels=2),
    "net_curtain": NetCurtainParams(
        from_m=2.0, to_m=9.0, width_m=3.0, twine_m=0.003, bar_m=0.03, heading_deg=25.0, panels=2
    ),
    "fairing": FairingParams(face_m2=1.2, drag=0.9, axis=(0.3, -0.2, 1.0)),
    "payload_shedding": PayloadSheddingParams(
        strouhal=0.18, lift_coefficient=0.4, diameter_m=1.2, area_m2=1.5
    ),
    "fluid_ramp": FluidRampParams(
        water=LoadCurve(ramp_s=8.0),
        vortices=LoadCurve(over_time=((0.0, 0.2), (4.0, 1.0), (9.0, 0.6))),
        fairings=LoadCurve(ramp_s=4.0),
    ),
    "compensator": CompensatorParams(
        stroke_m=1.5,
        piston_area_m2=0.001,
        gas_pressure_pa=5e6,
        gas_volume_m3=0.004,
        exponent=1.3,
        damping_newton_seconds_per_m=300.0,
        throttling_kg_per_m=200.0,
        friction_n=100.0,
        rod_area_m2=2e-4,
    ),
}
VARIANTS: dict[str, Any] = {  # other kernels of the same effects, each with its effect's name
    "added mass along the rope": AddedMassParams(normal=1.4, tangential=0.3),
    "current in layers that comes and goes": CurrentParams(
        layers=Layers(upper=(0.8, 0.2), lower=(-0.3, 0.1), split_z_m=-40.0, bottom_z_m=-70.0),
        over_time=((0.0, 0.0), (10.0, 1.0)),
    ),
    "current that wells up": CurrentParams(
        profile=((0.0, (0.8, 0.1, 0.0)), (-30.0, (0.3, 0.5, 0.2)), (-70.0, (-0.2, 0.4, -0.1)))
    ),
    "current that wells up and goes": CurrentParams(
        profile=((0.0, (0.8, 0.1, 0.0)), (-60.0, (0.3, 0.5, 0.2))),
        over_time=((0.0, 1.0), (10.0, 0.0)),
    ),
    "drag over Reynolds numbers": DragParams(
        normal=1.2, tangential=0.02, over_reynolds=((1e3, 1.4), (1e5, 1.0), (1e6, 0.5))
    ),
    "drag over Keulegan-Carpenter numbers": DragParams(
        normal=1.0,
        tangential=0.02,
        over_keulegan_carpenter=KeuleganCarpenter(
            tables=(
                RoughnessTable(roughness=1e-4, rows=((2.0, 0.8), (12.0, 1.4), (60.0, 0.7))),
                RoughnessTable(roughness=2e-2, rows=((2.0, 1.2), (15.0, 1.9), (80.0, 1.1))),
            ),
            roughness=3e-3,
            window_s=8.0,
        ),
    ),
    "drag by the current alone": DragParams(normal=1.2, tangential=0.02, relative=False),
    "net_curtain that trails": NetCurtainParams(
        to_m=6.0, width_m=3.0, twine_m=0.002, bar_m=0.03, law="aarsnes"
    ),
    "fairing that is towed": FairingParams(face_m2=1.2, tow_speed_m_per_s=-0.8, ramp_s=9.0),
}
SMALL = Rig(
    length=40.0, elements=8, mass=2.9, EA=2e6, diameter=0.06, damping=2e4, load=600.0, volume=0.1,
    added=(150.0, 200.0, 260.0), area=(0.8, 1.1, 1.5), density=1025.0, step=0.05, tolerance=1e-3,
    hang_off=(1.0, -2.0, 0.0),
    winch=Winch(
        speed_limit_m_per_s=3.0, acceleration_limit_m_per_s2=5.0, min_line_out_m=10.0,
        max_line_out_m=80.0,
    ),
)  # fmt: skip


BESIDE = {  # what must be listed for an effect to be built, or to know its payload
    "bed_friction": ("seabed",),
    "depth_profiles": ("payload",),
    "payload_oscillation": ("payload",),
}


def params_of(name: str) -> Any:
    """Return the parameters of an effect, or of a variant of one."""
    if name in VARIANTS:
        return VARIANTS[name]
    assert name in PARAMS, (
        f"effect '{name}' is in EFFECTS but has no row in PARAMS of test/support/effect_cases.py;"
        " add one with parameters that make it act, so that it is tested"
    )
    return PARAMS[name]


def data_of(*names: str) -> tuple[Any, ...]:
    """Return the kernel data of these effects on the small rope."""
    needed = [item for name in names for item in BESIDE.get(name, ()) if item not in names]
    listed = [params_of(name) for name in (*needed, *names)]
    order = [effect.params for effect in EFFECTS]
    listed.sort(key=lambda params: order.index(type(params)))
    scene = replace(SMALL.scene(), effects=tuple(listed))
    built = build_effects(scene, payload_figures(scene.payloads[0], SMALL.density))
    unwanted = {type(params_of(name)) for name in needed}
    return tuple(
        item for item, params in zip(built, listed, strict=True) if type(params) not in unwanted
    )


def acting(name: str) -> tuple[Any, ...]:
    """Return the kernel data of an effect, last, after the effects it needs; vortices shed."""
    effects = (*besides(name), *data_of(name))
    if name in (*SHEDDING, *OSCILLATING, *CURTAINS, "bed_friction", "payload_shedding"):
        memory = effects[-1].memory
        memory[:] = np.random.default_rng(5).uniform(0.3, 1.2, memory.shape)
    if name in CURTAINS:
        effects[-1].memory[3, -1] = NODES  # whose shares are known
    if name == "payload_contact":
        effects = (*effects[:-1], effects[-1]._replace(joints=np.array([0, 1])))
    if name == "hull_contact":  # a rope of these nodes, with friction
        memory = effects[-1].memory
        shape = memory[BEFORE:REACHED].shape
        memory[BEFORE:REACHED] = np.random.default_rng(5).uniform(-0.1, 0.1, shape)
        memory[KNOWN, -1], memory[FRICTION, -1] = NODES - 1, 1.0
    return effects


def besides(name: str) -> tuple[Any, ...]:
    """Return the effects that this one needs to act: current, water or dry part of the rope."""
    if name == "wetting":
        return data_of("weight", "drag")
    if name == "depth_profiles":
        return data_of("weight", "drag", "added_mass")
    if name == "fluid_ramp":
        return data_of("current", "waves", "drag", "payload", "net", "fairing")
    if name == "wind":
        return data_of("wetting")
    by_current = (*SHEDDING, "payload_shedding", "drag by the current alone")
    return data_of("current") if name in by_current else ()


class UntabledRope(NamedTuple):
    """A rope without a stiffness table, as `law_of` takes it."""

    effects: Any
    law: None


@jit_entry
def apply(effects: Any, work: Any, stage: Any, low: int, high: int) -> None:
    """Apply all hooks of these effects to the nodes low <= i < high and at the ends."""
    add_flow(effects, work, stage, low, high)
    add_load(effects, work, stage, low, high)
    if low == 0:
        add_end(effects, work, stage)
        add_couplings(effects, work, stage, high - 1)
        law = law_of(UntabledRope(effects, None))
        stretch(law, work, work[rows.GROWTH], stage.p, stage.q, low, low + 1)


def some_stage() -> rows.Stage:
    """Return the weights of a TR-BDF2 stage at 3 s."""
    c = 0.5 * (2.0 - math.sqrt(2.0)) * SMALL.step
    return rows.Stage(3.0, c * c, c, 0.7)


def some_work(seed: int = 1) -> Vector:
    """Return scratch of unloaded nodes in motion down to 90 m, with random tangents."""
    random = np.random.default_rng(seed)
    work = rows.new_work(NODES, rows.COUPLED_ROWS)
    work[rows.POSITION : rows.POSITION + 2] = random.normal(0.0, 5.0, (2, NODES))
    work[rows.POSITION + 2] = np.linspace(-90.0, 0.0, NODES)
    work[rows.VELOCITY : rows.VELOCITY + 3] = random.normal(0.0, 1.5, (3, NODES))
    work[rows.ACCELERATION : rows.ACCELERATION + 3] = random.normal(0.0, 2.0, (3, NODES))
    tangent = random.normal(0.0, 1.0, (3, NODES))
    work[rows.TANGENT : rows.TANGENT + 3] = tangent / np.linalg.norm(tangent, axis=0)
    length, diameter = random.uniform(1.0, 6.0, NODES), SMALL.diameter
    work[rows.REST] = 0.7 * length
    work[rows.MASS] = SMALL.mass * length
    half = 0.5 * work[rows.REST, :-1]
    work[rows.LENGTH] = np.append(half, 0.0) + np.append(0.0, half)
    work[rows.VOLUME] = 0.25 * math.pi * diameter**2 * length
    work[rows.FRONTAL], work[rows.SKIN] = diameter * length, math.pi * diameter * length
    return work


class RopesBetween(NamedTuple):
    """Stack of ropes, reduced to what the hook between ropes reads."""

    work: Vector
    nodes: Vector
    counts: Any


class Connections(NamedTuple):
    """Connections, reduced to what that hook reads; each is at a node of the rope."""

    work: Vector
    nodes: Vector
    matrix: Vector


class TwoRopes(NamedTuple):
    """A system of two ropes."""

    stack: RopesBetween
    joints: Connections


def blocks_of(matrix: Vector) -> Vector:
    """Return the diagonal blocks of connections, (6, connections)."""
    diagonal = matrix.reshape(NODES, 3, NODES, 3).diagonal(axis1=0, axis2=2)
    return np.array([diagonal[i, j] for i, j in ((0, 0), (1, 0), (2, 0), (1, 1), (2, 1), (2, 2))])


@jit_entry
def apply_among(effects: Any, system: Any, stage: Any) -> None:
    """Apply the hook of these effects between ropes."""
    add_interactions(effects, system, stage)


def loads(effects: tuple[Any, ...], work: Vector, low: int = 0, high: int = NODES) -> Vector:
    """Return flow, residual, blocks and couplings that the hooks leave on a copy, (15, NODES).

    Where an effect acts between ropes there is the same rope once more, 0.3 m aside.
    """
    work = work.copy()
    apply(effects, work, some_stage(), low, high)
    if any("interact" in hooks_of(type(effect)) for effect in effects):
        both = np.stack([work, work])
        both[1, rows.POSITION] += 0.3
        counts = np.array([[NODES - 1, 0], [NODES - 1, 0]])
        ends = Connections(both[0], both[0].copy(), np.zeros((3 * NODES, 3 * NODES)))
        apply_among(effects, TwoRopes(RopesBetween(both, both.copy(), counts), ends), some_stage())
        work = both[0]
        work[rows.BLOCK : rows.BLOCK + 6] += blocks_of(ends.matrix)
    return np.concatenate([work[part] for part in RESULTS])


def alone(name: str) -> Vector:
    """Return the results of one effect over all nodes and over one spare slot, (2, 15, NODES)."""
    effects, work = acting(name), some_work()
    return np.stack([loads(effects, work), loads(effects, work, NODES - 1, NODES)])


def together() -> Vector:
    """Run all effects on a small rope that is paid out, hauled in and goes slack; a row a step.

    All but a rigid body, which is there in place of `payload`, and a compensator. Columns: top
    tension, its extremes in element tension, payload position, number of elements.
    """
    left_out = ("rigid_body", "compensator")
    effects = tuple(params_of(effect.name) for effect in EFFECTS if effect.name not in left_out)
    return steps(replace(SMALL.scene(), effects=effects), 8.0)


def swung() -> Vector:
    """Heave a rigid body until its slings are slack; columns of `together`.

    The payload position is that of the body's middle.
    """
    names = ("current", "weight", "drag", "added_mass", "rigid_body")
    effects = tuple(params_of(name) for name in names)
    return steps(replace(SMALL.scene(), effects=effects), 1.5)


def touching() -> Vector:
    """Run the first steps of a rigid body that falls tilted into shallow water, half wet."""
    return aground(np.eye(3), 1.0, 20).reshape(20, -1)


def stroking() -> Vector:
    """Run a compensator at its stops, sticking, slack, and driven actively."""
    cylinder = ActiveCylinder(
        efficiency=0.9, lag_s=0.1, gain_newton_seconds_per_m=1e5, force_limit_n=5e4,
        speed_limit_m_per_s=1.0,
    )  # fmt: skip
    unit = replace(
        PASSIVE, friction_n=2e4, throttling_kg_per_m=1e4, rod_area_m2=0.001, active=cylinder
    )
    return steps(compensated(unit, replace(STROKING, step=0.05, winch=SMALL.winch)), 8.0)


def by_table() -> Vector:
    """Run an undamped rope with a stiffness table; round-off doubles within a step of its slack."""
    return steps(tabled(replace(SMALL, tolerance=1e-3), HMPE), 0.8)


def steps(scene: Scene, seconds: float) -> Vector:
    """Step under heave and payout; return the columns of `together`."""
    twin = Twin(scene)
    rows = []
    for snapshot in march(twin, sine(2.0, 4.0), seconds, speeds=[(0.0, 3.0), (3.0, -3.0)]):
        tension, x = snapshot.element_tension_n, snapshot.payload_position_m
        rows.append([snapshot.tension_top_n, tension.min(), tension.max(), *x, len(tension)])
    return np.array(rows)


@contextmanager
def resting(stored: dict[str, Vector], name: str) -> Iterator[None]:
    """Start twins from the equilibrium in `stored`, or store there the one that is found.

    Plain Python takes half a minute to find where a rope with a rigid body rests, and a second to
    see that it does.
    """
    search = ropes.solve_scene_statics

    def begin(scene: Scene, rope: rows.Rope) -> rows.Floats:
        rope.state.nodes[:] = stored.get(name, rope.state.nodes)
        pull = search(scene, rope)
        stored[name] = rope.state.nodes.copy()
        return pull

    ropes.solve_scene_statics = begin
    try:
        yield
    finally:
        ropes.solve_scene_statics = search


def with_bodies(stored: dict[str, Vector]) -> dict[str, Vector]:
    """Return the results of rigid bodies, which start from their stored equilibrium."""
    results = {}
    for name, case in (("swung", swung), ("aground", touching)):
        with resting(stored, name):
            results[name] = case()
    return results


def of_always() -> dict[str, Vector]:
    """Return the results that every test run compares, by name."""
    cases = {name: alone(name) for name in [*(effect.name for effect in EFFECTS), *VARIANTS]}
    return {**cases, "stroking": stroking()}


def of_minutes(stored: dict[str, Vector]) -> dict[str, Vector]:
    """Return the results that only long tests compare."""
    return {
        **with_bodies(stored),
        "together": together(),
        "by_table": by_table(),
        "triangle": triangle(),
        "bent ladder": bent_ladder(),
    }

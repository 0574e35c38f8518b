"""Registry of the effects (load models) that a scene can list, whose files give their sources.

EFFECTS is the only list of all effects. Its order is the order in which they are compiled and
summed: the same set shares one binary, and sums are bit-identical.
"""

from __future__ import annotations

import re
import sys
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, NamedTuple

from rope_twin.effects import (
    bed_friction,
    bending,
    compensator,
    coupled_vibration,
    current,
    depth_profiles,
    drag,
    fluid_ramp,
    hull_contact,
    line_contact,
    net_curtain,
    payload,
    payload_contact,
    payload_faces,
    payload_oscillation,
    payload_shedding,
    rigid_body,
    rope_in_air,
    rope_mass,
    seabed,
    strouhal_forcing,
    travelling_waves,
    wake_oscillator,
    waves,
)
from rope_twin.vortex.drag_amplification import build_growth


class Surroundings(NamedTuple):
    """Properties of water and rope that an effect may use when it is built."""

    water_density_kg_per_m3: float
    gravity_m_per_s2: float
    added_mass: float  # added mass coefficient of the rope, 0 where the scene lists none
    room: int = 0  # node capacity of the rope's arrays
    drag_normal: float = 0.0  # normal drag coefficient of the rope, 0 where the scene lists none
    bending_n_m2: float = 0.0  # bending stiffness of the rope, 0 where the scene lists none
    bed: Any = None  # kernel data of the seabed, where the scene lists one
    friction: float = 0.0  # its friction coefficient
    sticks: bool = False  # whether `bed_friction` takes the place of the seabed's friction
    two_way: bool = False  # whether a payload of the scene differs between ascent and descent
    added_mass_along: float = 0.0  # added mass coefficient along the rope
    carries: bool = True  # whether the scene lists `payload`
    wets: bool = False  # whether the scene lists `wetting`
    diameter: float = 0.0  # largest diameter of the scene's ropes [m]


@dataclass(frozen=True)
class Effect:
    """An effect: its name in a scene, its parameters, and the builder of its kernel data."""

    name: str
    params: type
    build: Callable[[Any, Any, Any], Any]  # params, payload properties, surroundings
    sheds: bool = False  # a VIV model; a scene may list one at most
    beside: bool = False  # a VIV model decoupled from the step, with its own mesh
    version: int = 1  # incremented with every change of its results beyond round-off

    @property
    def about(self) -> str:
        """Return what its file says of model and source; of several effects, under its name."""
        text = sys.modules[self.params.__module__].__doc__ or ""
        parts = re.split(r"\*\*(\w+)\*\*: ", text)
        return dict(zip(parts[1::2], parts[2::2], strict=True)).get(self.name, text)


EFFECTS: tuple[Effect, ...] = (
    Effect("current", current.CurrentParams, current.build),
    Effect("waves", waves.WavesParams, waves.build),
    Effect("wetting", rope_in_air.WettingParams, rope_in_air.build_wetting),
    Effect("depth_profiles", depth_profiles.DepthProfilesParams, depth_profiles.build),
    Effect("wind", rope_in_air.WindParams, rope_in_air.build_wind),
    Effect("weight", rope_mass.WeightParams, rope_mass.build_weight),
    Effect("drag", drag.DragParams, drag.build),
    Effect("added_mass", rope_mass.AddedMassParams, rope_mass.build_added_mass),
    Effect("bending", bending.BendingParams, bending.build),
    Effect(
        "strouhal_forcing",
        strouhal_forcing.StrouhalForcingParams,
        strouhal_forcing.build,
        sheds=True,
    ),
    Effect(
        "wake_oscillator", wake_oscillator.WakeOscillatorParams, wake_oscillator.build, sheds=True
    ),
    Effect(
        "travelling_waves",
        travelling_waves.TravellingWavesParams,
        travelling_waves.build,
        sheds=True,
        version=2,
    ),
    Effect(
        "modal_vibration",
        coupled_vibration.ModalVibrationParams,
        build_growth,
        sheds=True,
        beside=True,
        version=2,
    ),
    Effect(
        "decomposed_force",
        coupled_vibration.DecomposedForceParams,
        build_growth,
        sheds=True,
        beside=True,
        version=2,
    ),
    Effect("seabed", seabed.SeabedParams, seabed.build),
    Effect("bed_friction", bed_friction.BedFrictionParams, bed_friction.build, version=2),
    Effect("hull_contact", hull_contact.HullContactParams, hull_contact.build),
    Effect("line_contact", line_contact.LineContactParams, line_contact.build),
    Effect("payload_contact", payload_contact.PayloadContactParams, payload_contact.build),
    Effect("payload", payload.PayloadParams, payload.build),
    Effect(
        "payload_oscillation",
        payload_oscillation.PayloadOscillationParams,
        payload_oscillation.build,
    ),
    Effect("rigid_body", rigid_body.RigidBodyParams, rigid_body.build),
    Effect("splash_zone", payload.SplashZoneParams, payload.build_splash_zone),
    Effect("net", payload_faces.NetParams, payload_faces.build_net),
    Effect("net_curtain", net_curtain.NetCurtainParams, net_curtain.build),
    Effect("fairing", payload_faces.FairingParams, payload_faces.build_fairing),
    Effect("payload_shedding", payload_shedding.PayloadSheddingParams, payload_shedding.build),
    Effect("fluid_ramp", fluid_ramp.FluidRampParams, fluid_ramp.build),
    Effect("compensator", compensator.CompensatorParams, compensator.build),
)

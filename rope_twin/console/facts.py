"""Constant facts of a scene that the pages need beside the topics: limits, winch, payload, bed."""

from __future__ import annotations

import dataclasses
from contextlib import suppress
from typing import Any

from rope_twin.effects.seabed import SeabedParams
from rope_twin.effects.waves import WavesParams
from rope_twin.errors import RopeTwinError, SceneError
from rope_twin.recording.input_log import decode_json
from rope_twin.recording.session import Session
from rope_twin.scene.rigging import winch_of, winches_by_name
from rope_twin.scene.schema import Scene, Winch
from rope_twin.scene.shapes import payload_figures
from rope_twin.scene.winch import LAYER_RISE, SWITCHES
from rope_twin.topics import SESSION_TOPIC
from rope_twin.twin.limits import LoadRules

_WINCH_FIGURES = (
    "speed_limit_m_per_s", "acceleration_limit_m_per_s2", "least_line_out_m", "most_line_out_m",
    "follows", "when_commander_lost",
)  # fmt: skip


def scene_facts(scene: Scene) -> dict[str, Any]:
    """Return the facts of a scene as JSON types, SI with the unit in the name; None: unknown."""
    rules = LoadRules(scene)
    limits = {
        field.name: getattr(scene.limits, field.name) for field in dataclasses.fields(scene.limits)
    }
    bed = next((one for one in scene.effects if isinstance(one, SeabedParams)), None)
    return {
        "scene": scene.name,
        "about": scene.about,
        "ropes": [
            {
                "name": line.name,
                "breaking_load_n": line.breaking_load_n,
                "allowed_n": rules.allowed_n[number],
                "length_m": line.length_m,
                "minimum_bend_radius_m": rules.radius_m(line.name) or None,
                "winch": line.from_ if winch_of(scene, line) else "",
                "payload": line.to,
            }
            for number, line in enumerate(scene.ropes)
        ],
        "limits": limits,
        "payloads": [_payload(scene, number) for number in range(len(scene.payloads))],
        "winches": {name: _winch(scene, winch) for name, winch in winches_by_name(scene).items()},
        "hang_off_m": list(scene.ship.hang_off_m),
        "bed_m": None if bed is None or bed.depth_m is None else -bed.depth_m,
        "sea": _sea(scene),
    }


def session_facts(data: bytes) -> dict[str, Any]:
    """Return the facts of the scene in a twin/session message; if it cannot be read, the reason.

    The scene is built from the text in the message, whatever machine recorded it.
    """
    try:
        return scene_facts(Session.read(decode_json(SESSION_TOPIC, data)).scene())
    except RopeTwinError as error:
        return {"reason": str(error)}


def _payload(scene: Scene, number: int) -> dict[str, Any]:
    payload, water = scene.payloads[number], scene.environment
    submerged_n = None
    with suppress(SceneError):  # its volume is not known
        known = payload_figures(payload, water.water_density_kg_per_m3)
        mass_kg = known.mass_kg - water.water_density_kg_per_m3 * known.volume_m3
        submerged_n = mass_kg * water.gravity_m_per_s2
    return {"name": payload.name, "mass_kg": payload.mass_kg, "submerged_n": submerged_n}


def _winch(scene: Scene, winch: Winch) -> dict[str, Any]:
    figures = {name: getattr(winch, name) for name in _WINCH_FIGURES}
    figures["switches"] = [
        kind for kind, needed in SWITCHES.items() if getattr(winch, needed) is not None
    ]
    ahc = winch.heave_compensation
    if ahc is not None:
        figures["compensation_stroke_m"] = ahc.stroke_m
        figures["compensation_speed_m_per_s"] = ahc.speed_limit_m_per_s
    if winch.drum is not None:
        own = next(line for line in scene.ropes if winch_of(scene, line) is winch)
        diameter_m = own.made_of[0].rope.diameter_m
        figures["drum_radius_m"] = winch.drum.core_radius_m
        figures["layer_rise_m"] = LAYER_RISE * diameter_m
    figures["modes"] = ["speed", "length", "depth"]
    if winch.constant_tension is not None:
        figures["modes"].append("tension")
    return figures


def _sea(scene: Scene) -> dict[str, Any]:
    waves = next((one for one in scene.effects if isinstance(one, WavesParams)), None)
    height_m = getattr(waves, "significant_height_m", None)
    return {
        "recorded": scene.sea_state.bag or None,
        "significant_height_m": height_m,
        "peak_period_s": getattr(waves, "peak_period_s", None),
    }

"""Scenes with their profiles, the rope library, and the load models."""

from __future__ import annotations

import html
from typing import Any

from markdown import code, prose, table, words
from profiles import stored_profiles

from rope_twin.effects import EFFECTS
from rope_twin.effects.seabed import SeabedParams
from rope_twin.scene.load import load_scene, rope_presets, scene_names
from rope_twin.scene.schema import Scene

WIDTH, HEIGHT, MARGIN = 150, 200, 14  # of a thumbnail [px]


def scene_gallery() -> str:
    """Return a section for each scene: profile in static equilibrium, what it is, what to see."""
    profiles = stored_profiles()
    return "\n\n".join(_scene(load_scene(name), profiles.get(name)) for name in scene_names())


def _scene(scene: Scene, profile: dict[str, Any] | None) -> str:
    drawn = "" if profile is None else f"```{{raw}} html\n{thumbnail(scene, profile)}\n```\n\n"
    effects = ", ".join(
        code(effect.name) for effect in EFFECTS if scene.listed(effect.params) is not None
    )
    out = ", ".join(
        f"{line.name} ({line.length_m:g} m, {line.elements} elements)" for line in scene.ropes
    )
    top = "" if profile is None else f"; {profile['tension_top_kn']:g} kN at the top in equilibrium"
    return (
        f"## {words(scene.name)}\n\n{drawn}**{words(scene.about)}.** {prose(scene.look_at)}\n\n"
        f"Lines: {words(out)}{top}. Time step {scene.time.step_s * 1e3:g} ms. "
        f"Load models: {effects}.\n"
    )


def thumbnail(scene: Scene, profile: dict[str, Any]) -> str:
    """Return a picture of x over z, not to scale: surface, seabed, lines, struts, payloads.

    Of x and y the direction is drawn in which the scene is wider.
    """
    points = [point for line in profile["lines"] for point in line]
    points += profile["payloads"] + [end for strut in profile["struts"] for end in strut]
    spread = [max(p[k] for p in points) - min(p[k] for p in points) for k in (0, 1)]
    across = 0 if spread[0] >= spread[1] else 1
    bed = scene.listed(SeabedParams)
    bed_m = None if bed is None or bed.depth_m is None else -bed.depth_m
    lowest, highest = min(p[2] for p in points), max(0.0, *(p[2] for p in points))
    lowest = lowest if bed_m is None else min(lowest, bed_m)
    deep = max(highest - lowest, 1.0)
    middle = (max(p[across] for p in points) + min(p[across] for p in points)) / 2.0
    wide = max(spread[across], deep / 8.0)

    def place(point: list[float]) -> tuple[float, float]:
        right = WIDTH / 2 + (point[across] - middle) / wide * (WIDTH - 4 * MARGIN)
        return right, MARGIN + (highest - point[2]) / deep * (HEIGHT - 2 * MARGIN)

    surface = place([0.0, 0.0, 0.0])[1]
    shapes = [
        f'<rect x="0" y="{surface:.1f}" width="{WIDTH}" height="{HEIGHT - surface:.1f}" '
        'fill="#2a7ab0" fill-opacity="0.15"/>'
    ]
    if bed_m is not None:
        ground = place([0.0, 0.0, bed_m])[1]
        shapes.append(
            f'<rect x="0" y="{ground:.1f}" width="{WIDTH}" height="{HEIGHT - ground:.1f}" '
            'fill="#8a6d3b" fill-opacity="0.5"/>'
        )
    shapes += [_polyline([place(p) for p in line], "#c03a2b", 1.6) for line in profile["lines"]]
    shapes += [_polyline([place(p) for p in ends], "#555", 3.0) for ends in profile["struts"]]
    for payload in profile["payloads"]:
        x, y = place(payload)
        shapes.append(f'<rect x="{x - 4:.1f}" y="{y - 4:.1f}" width="8" height="8" fill="#333"/>')
    label = html.escape(f"{scene.name}: profile in static equilibrium")
    scale = f"{deep:.0f} m deep" if deep >= 10.0 else f"{deep:.1f} m deep"
    shapes.append(
        f'<text x="{WIDTH - 4}" y="{HEIGHT - 4}" font-size="9" text-anchor="end" '
        f'fill="currentColor">{scale}</text>'
    )
    return (
        f'<svg role="img" aria-label="{label}" width="{WIDTH}" height="{HEIGHT}" '
        f'viewBox="0 0 {WIDTH} {HEIGHT}" style="float: right; margin: 0 0 1em 1em">'
        f"<title>{label}</title>{''.join(shapes)}</svg>"
    )


def _polyline(points: list[tuple[float, float]], colour: str, width: float) -> str:
    path = " ".join(f"{x:.1f},{y:.1f}" for x, y in points)
    return f'<polyline points="{path}" fill="none" stroke="{colour}" stroke-width="{width}"/>'


def rope_library() -> str:
    """Return the rope presets with their figures."""
    rows = (
        (
            code(name),
            prose(rope.about),
            f"{1e3 * rope.diameter_m:g}",
            f"{rope.mass_kg_per_m:.3g}",
            f"{1e3 * rope.hydrodynamic_diameter_m:.3g}",
            "table" if rope.axial_stiffness_n is None else f"{rope.axial_stiffness_n / 1e6:.4g}",
            f"{rope.breaking_load_n / 1e3:.4g}",
            prose(rope.source),
        )
        for name, rope in rope_presets().items()
    )
    head = ("preset", "rope", "d [mm]", "mass in air [kg/m]", "hydrodynamic d [mm]", "EA [MN]",
            "MBL [kN]", "source")  # fmt: skip
    return table(head, rows)


def load_models() -> str:
    """Return a section for each effect: what its file says of model and source."""
    sections = []
    for effect in EFFECTS:
        paragraphs = (prose(" ".join(one.split())) for one in effect.about.strip().split("\n\n"))
        sections.append("\n\n".join((f"## {code(effect.name)}", *paragraphs)))
    return "\n\n".join(sections)

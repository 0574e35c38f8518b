"""Rules between the values of a scene: references, order, limits; its VIV model.

Each rule yields its faults as (path in the file, fault, remedy); the reader has already checked
every single value.
"""

from __future__ import annotations

import dataclasses
from collections import Counter
from collections.abc import Iterator

from rope_twin.effects import EFFECTS
from rope_twin.effects.compensator import CompensatorParams
from rope_twin.effects.depth_profiles import DepthProfilesParams
from rope_twin.effects.drag import DragParams
from rope_twin.effects.fluid_ramp import FluidRampParams
from rope_twin.effects.hull_contact import HullContactParams
from rope_twin.effects.line_contact import LineContactParams
from rope_twin.effects.payload import PayloadParams, SplashZoneParams
from rope_twin.effects.payload_contact import PayloadContactParams
from rope_twin.effects.payload_faces import FairingParams, NetParams
from rope_twin.effects.payload_oscillation import PayloadOscillationParams
from rope_twin.effects.payload_shedding import PayloadSheddingParams
from rope_twin.effects.rigid_body import RigidBodyParams
from rope_twin.effects.seabed import SeabedParams
from rope_twin.errors import RopeTwinError, did_you_mean
from rope_twin.scene.environment import ENVIRONMENT_RULES
from rope_twin.scene.grid import ends_m, grading_faults
from rope_twin.scene.lift import listed_effects
from rope_twin.scene.rigging import (
    RIGGING_RULES,
    body_holds,
    body_payload,
    curtain_hangs,
    is_joined,
    sheaves_hold,
    winch_of,
)
from rope_twin.scene.schema import Fault, Rule, Scene, TwoWayShape
from rope_twin.scene.shapes import payload_figures
from rope_twin.scene.vortex import model_beside, shedding_model
from rope_twin.scene.winch_rules import WINCH_RULES

# Exceptions of a rule that depends on a violated one:
_CONSEQUENCES = (
    ArithmeticError, AssertionError, AttributeError, LookupError, RopeTwinError, TypeError,
    ValueError,
)  # fmt: skip


def faults(scene: Scene) -> Iterator[Fault]:
    """Yield every fault between the values of a scene, in the order of RULES."""
    for rule in RULES:
        yield from rule(scene)


def independent_faults(scene: Scene) -> list[Fault]:
    """Return every fault once; a rule made inapplicable by another fault is skipped."""
    faults: dict[Fault, None] = {}
    for rule in RULES:
        try:
            for fault in rule(scene):
                faults[fault] = None
        except _CONSEQUENCES:
            if not faults:
                raise
    return list(faults)


def _names(scene: Scene) -> Iterator[Fault]:
    for key in ("ropes", "payloads"):
        names = [part.name for part in getattr(scene, key)]
        counts = Counter(names)
        for number, name in enumerate(names):
            if not name:
                yield f"{key}[{number}].name", "the name is empty", "give it a name"
            if counts[name] > 1:
                problem = f"{counts[name]} {key} are named '{name}'"
                yield f"{key}[{number}].name", problem, "give each its own name"


def _payload_figures(scene: Scene) -> Iterator[Fault]:
    for number, payload in enumerate(scene.payloads):
        figures = ("displaced_volume_m3", "added_mass_kg", "drag_area_m2")
        missing = [name for name in figures if getattr(payload, name) is None]
        if payload.shape is None and missing:
            problem = f"without a shape {', '.join(missing)} cannot be known"
            yield f"payloads[{number}]", problem, "add a shape, or these keys"


def _one_of_rope_and_sections(scene: Scene) -> Iterator[Fault]:
    for number, line in enumerate(scene.ropes):
        path = f"ropes[{number}]"
        if line.rope is not None and line.sections:
            remedy = "keep `rope` (all of one kind) or `sections` (several, from the lower end up)"
            yield path, "both `rope` and `sections` are given", remedy
        elif line.rope is None and not line.sections:
            remedy = "add `rope` (a preset's name or figures), or `sections`"
            yield path, "its material is not given", remedy


def _section_lengths(scene: Scene) -> Iterator[Fault]:
    for number, line in enumerate(scene.ropes):
        path = f"ropes[{number}].sections"
        for k, section in enumerate(line.sections[:-1]):
            if section.length_m is None:
                problem = "only the topmost section may have no length"
                yield f"{path}[{k}]", problem, "add length_m"
                return
        lengths = [section.length_m for section in line.sections]
        winch = winch_of(scene, line)
        needed = winch.max_line_out_m if winch else line.length_m
        if lengths and lengths[-1] is not None:
            total = sum(length or 0.0 for length in lengths)
            if total < needed:
                problem = f"the sections are {total:g} m long in total, for {needed:g} m of rope"
                remedy = "lengthen one, or remove length_m of the topmost one: it is then unlimited"
                yield path, problem, remedy
        sections = sum(end < line.length_m for end in ends_m(line)) + 1
        if sections > line.elements:
            problem = f"{line.elements} elements for {sections} sections that are out"
            yield f"ropes[{number}].elements", problem, f"give at least {sections}"


def _own_drag(scene: Scene) -> Iterator[Fault]:
    drag = scene.listed(DragParams)
    for number, line in enumerate(scene.ropes):
        for section in line.made_of if drag is not None else ():
            for name in ("normal", "tangential"):
                coefficient = getattr(section.rope, f"drag_{name}", None)
                if coefficient is not None and getattr(drag, name) == 0.0:
                    problem = (
                        f"drag.{name} is 0 but {section.rope.about or 'a rope'} has its own "
                        f"{coefficient:g}"
                    )
                    remedy = "give the scene's coefficient a value, or remove the rope's own"
                    yield f"ropes[{number}]", problem, remedy


def _grading(scene: Scene) -> Iterator[Fault]:
    for number, line in enumerate(scene.ropes):
        if line.grading is not None:
            winch = winch_of(scene, line)
            shortest_m = winch.min_line_out_m if winch else None
            path = f"ropes[{number}].grading"
            yield from ((path, *fault) for fault in grading_faults(line, line.grading))
            lowest = line.grading.lowest_m or (line.grading.nodes_m or (0.0,))[0]
            if shortest_m is not None and lowest >= shortest_m:
                problem = (
                    f"the lowest element is {lowest:g} m, the winch hauls in to {shortest_m:g} m"
                )
                yield path, problem, "shorten it, or raise min_line_out_m"


def _damping(scene: Scene) -> Iterator[Fault]:
    for number, line in enumerate(scene.ropes):
        dampings = [value for value in dataclasses.astuple(line.damping) if value is not None]
        if len(dampings) != 1:
            count = ("no damping is", "", "two dampings are", "three dampings are")[len(dampings)]
            remedy = "give exactly one of newton_seconds and fraction_of_first_axial_mode"
            yield f"ropes[{number}].damping", f"{count} given", remedy


_NEEDED = (  # effect, another that it cannot be without, why, and how to list that
    ("bed_friction", "seabed", "acts on the seabed, which is not listed", "{depth_m: ...}"),
    ("wetting", "weight", "corrects the buoyancy of `weight`, which is not listed", "{}"),
    ("wind", "wetting", "acts on the rope out of the water, and without `wetting` none is", "{}"),
)


def _effects(scene: Scene) -> Iterator[Fault]:
    listed = [*listed_effects(scene)]
    if "payload" in listed and not (scene.payloads or scene.joints):
        yield "effects", "`payload` is listed but no payload is", "add `payloads`, or remove it"
    shedding = [effect.name for effect in EFFECTS if effect.sheds and effect.name in listed]
    if len(shedding) > 1:
        problem = f"{' and '.join(shedding)} are models of the same vortex shedding"
        yield "effects", problem, "keep one of them"
    for name, needed, problem, right in _NEEDED:
        if name in listed and needed not in listed:
            yield "effects", f"`{name}` {problem}", f"add `- {needed}: {right}`"
    if ramp := scene.listed(FluidRampParams):
        yield from _ramped(scene, ramp, listed)
    drag = scene.listed(DragParams)
    if drag is not None and drag.over_keulegan_carpenter:
        conflicts = [name for name in ("wetting", "depth_profiles") if name in listed] + shedding
        if conflicts:
            problem = (
                f"over_keulegan_carpenter of `drag` and `{conflicts[0]}` both change the "
                "rope's drag"
            )
            yield "effects", problem, "keep one of them"
    if "splash_zone" in listed and not {"payload", "rigid_body"}.intersection(listed):
        problem = "`splash_zone` corrects the loads of `payload`, which is not listed"
        yield "effects", problem, "add `- payload: {}`"


def _depth_profiles(scene: Scene) -> Iterator[Fault]:
    """Profiles over depth correct the loads of effects that know the local water."""
    params = scene.listed(DepthProfilesParams)
    if params is None:
        return
    listed = listed_effects(scene)
    where, drag, rho = "effects", scene.listed(DragParams), params.density_kg_per_m3
    density = scene.environment.water_density_kg_per_m3
    if model := shedding_model(scene):
        problem = f"`depth_profiles` and `{model}`, whose water is the same all over"
        yield where, problem, "keep one of them"
    if params.drag_factor and drag is None:
        problem = "`depth_profiles` scales the coefficients of `drag`, which is not listed"
        yield where, problem, "add `- drag: {...}`, or remove drag_factor"
    elif params.drag_factor and drag is not None and drag.over_reynolds:
        problem = "`depth_profiles` and `drag` both have a factor on the drag coefficient"
        yield where, problem, "remove drag_factor or over_reynolds"
    if not rho:
        return
    if "weight" not in listed:
        problem = "`depth_profiles` corrects the buoyancy of `weight`, which is not listed"
        yield where, problem, "add `- weight: {}`, or remove density_kg_per_m3"
    for name in ("rigid_body", "net", "net_curtain", "fairing"):
        if name in listed:
            problem = f"the water of `{name}` has one density, and `depth_profiles` another"
            yield where, problem, f"remove density_kg_per_m3 or `{name}`"
    if density <= 0.0:
        problem = "a density over depth is relative to the scene's water, and there is none"
        yield where, problem, "give environment.water_density_kg_per_m3 above 0"
    elif "splash_zone" in listed and abs(rho[0][1] - density) > SAME_WATER_KG_PER_M3:
        problem = (
            f"{rho[0][1]:g} kg/m³ at the top of `depth_profiles`, {density:g} in `splash_zone`"
        )
        yield where, problem, f"give environment.water_density_kg_per_m3: {rho[0][1]:g}"


def _ramped(scene: Scene, ramp: FluidRampParams, listed: list[str]) -> Iterator[Fault]:
    """Check that a fluid ramp finds all that it scales, and nothing that it cannot scale."""
    effects = [effect.name for effect in EFFECTS if effect.beside and effect.name in listed]
    for name in (*effects, *({"rigid_body", "payload_oscillation"} & set(listed))):
        problem = f"`fluid_ramp` does not scale the forces of `{name}`"
        yield "effects", problem, "remove one of them, or use `over_time` of `current`"
    if ramp.vortices and not shedding_model(scene) and "payload_shedding" not in listed:
        problem = "`fluid_ramp` scales the forces of vortices, and no VIV model is listed"
        yield "effects", problem, "remove `vortices`, or list a VIV model or `payload_shedding`"
    if ramp.fairings and not (
        "fairing" in listed or any(payload.fairing for payload in scene.payloads)
    ):
        problem = "`fluid_ramp` scales the drag of fairings, and no fairing is listed"
        yield "effects", problem, "remove `fairings`, or add `- fairing: {face_m2: ...}`"


def _compensator(scene: Scene) -> Iterator[Fault]:
    """A heave compensator is the lowest section of a single rope, short of what is hauled in."""
    if scene.listed(CompensatorParams) is None:
        return
    line = scene.ropes[0]
    if is_joined(scene):
        problem = "`compensator` is at the lower end of a single rope, and this scene has more"
        yield "effects", problem, "remove it, or the other ropes and connections"
        return
    if len(line.made_of) < 2:
        remedy = "give `sections`: first its length_m retracted with its mass, then the rope"
        yield "ropes[0].rope", "`compensator` is the rope's lowest section, and it has one", remedy
        return
    if line.fixed_at_m is not None:
        problem = "`compensator` carries a payload, and this end is fixed"
        yield "ropes[0].fixed_at_m", problem, "give the rope a payload, or remove it"
    unit_m = line.made_of[0].length_m or 0.0
    min_m = scene.winch.min_line_out_m if scene.winch else 2.0 * unit_m
    if min_m < 2.0 * unit_m:
        problem = f"{min_m:g} m hauls the compensator of {unit_m:g} m in"
        remedy = f"give at least twice its length, {2.0 * unit_m:g} m"
        yield "winch.min_line_out_m", problem, remedy
    listed = listed_effects(scene)
    for effect in EFFECTS:
        if effect.name in listed and (effect.sheds or effect.name == "bending"):
            whole = f"`{effect.name}` acts on the whole rope"
            problem = f"{whole}, and its lowest section is a compensator"
            yield "effects", problem, f"remove `{effect.name}` or `compensator`"


def _rope_contact(scene: Scene) -> Iterator[Fault]:
    """Boxes that move with the hang-off are for a rope that begins there; ropes touch others."""
    if scene.listed(HullContactParams) is not None and is_joined(scene):
        problem = "`hull_contact` moves with the hang-off of a single rope, and this scene has more"
        yield "effects", problem, "remove it, or the other ropes and connections"
    if scene.listed(LineContactParams) is not None and len(scene.ropes) < 2:
        problem = "`line_contact` acts between ropes, and this scene has one"
        yield "effects", problem, "remove it, or add ropes"


def _payload_contact(scene: Scene) -> Iterator[Fault]:
    """Check that bodies that touch are payloads or joints of a system, and points."""
    contact = scene.listed(PayloadContactParams)
    if contact is None:
        return
    if not is_joined(scene):
        problem = "`payload_contact` acts between payloads and joints, and this scene has one"
        yield "effects", problem, "remove it, or add payloads on ropes of their own"
        return
    names = [*(payload.name for payload in scene.payloads), *(joint.name for joint in scene.joints)]
    for number, body in enumerate(contact.bodies):
        path = f"effects.payload_contact.bodies[{number}].name"
        if body.name not in names:
            remedy = did_you_mean(body.name, names)
            yield path, f"there is no payload or joint '{body.name}'", remedy
        elif body.name == body_payload(scene):
            problem = f"'{body.name}' is a rigid body, and its contact is not modelled"
            yield path, problem, "remove it, or use `payload` instead of `rigid_body`"


def _payload_oscillation(scene: Scene) -> Iterator[Fault]:
    """Factors on the figures of a point payload, which have no other factor."""
    if scene.listed(PayloadOscillationParams) is None:
        return
    profiles = scene.listed(DepthProfilesParams)
    if scene.listed(PayloadParams) is None:
        problem = "`payload_oscillation` corrects the loads of `payload`, which is not listed"
        yield "effects", problem, "add `- payload: {}`"
    for name, params in (("splash_zone", SplashZoneParams), ("rigid_body", RigidBodyParams)):
        if scene.listed(params) is not None:
            problem = f"`payload_oscillation` and `{name}` both change the figures of `payload`"
            yield "effects", problem, "keep one of them"
    if profiles is not None and profiles.density_kg_per_m3:
        problem = "`payload_oscillation` knows one density of water, `depth_profiles` another"
        yield "effects", problem, "remove density_kg_per_m3, or one of them"
    for number, payload in enumerate(scene.payloads):
        if payload_figures(payload, 1.0).differs_rising:
            problem = "its figures differ in ascent, and `payload_oscillation` has others by KC"
            yield f"payloads[{number}]", problem, "remove `rising`, or `payload_oscillation`"


def _drag_that_grows(scene: Scene) -> Iterator[Fault]:
    """A decoupled VIV model amplifies one drag coefficient."""
    vortex, model = model_beside(scene), shedding_model(scene)
    drag = scene.listed(DragParams)
    if vortex is None or vortex.drag is not None or drag is None:
        return
    if drag.over_reynolds or not drag.relative:
        problem = f"`{model}` amplifies one drag coefficient, and `drag` has no constant one"
        remedy = f"give `{model}` a `drag` of its own, or remove over_reynolds and relative"
        yield "effects", problem, remedy


SAME_WATER_KG_PER_M3 = 0.01
AT_PAYLOADS = {"splash_zone": SplashZoneParams, "net": NetParams, "fairing": FairingParams}


def _own_at_payload(scene: Scene) -> Iterator[Fault]:
    """A payload's own splash-zone size, net or fairing replaces the effect's."""
    for number, payload in enumerate(scene.payloads):
        for name, params in AT_PAYLOADS.items():
            path = f"payloads[{number}].{name}"
            if getattr(payload, name) is None:
                continue
            if scene.listed(params) is None:
                yield path, f"the effect `{name}` is not listed", "list it, or remove this"
            elif not is_joined(scene):
                remedy = f"give the values to the effect `{name}`"
                yield path, "this is the only payload", remedy


def _fairings_of_one_kind(scene: Scene) -> Iterator[Fault]:
    """Either all fairings have a tow speed or none has."""
    listed = scene.listed(FairingParams)
    for number, payload in enumerate(scene.payloads):
        fairing = payload.fairing
        if listed is None or fairing is None:
            continue
        speeds = fairing.tow_speed_m_per_s, listed.tow_speed_m_per_s
        if speeds.count(None) == 1:
            problem = "of this fairing and the effect's one has a tow speed and one has not"
            remedy = "give both a tow_speed_m_per_s, or neither"
            yield f"payloads[{number}].fairing", problem, remedy


def _at_the_end(scene: Scene) -> Iterator[Fault]:
    """An effect at the lower end needs a payload there."""
    names = [payload.name for payload in scene.payloads]
    for name, effect in listed_effects(scene).items():
        if name not in ("net", "fairing", "payload_shedding"):
            continue
        if not names:
            problem = f"`{name}` is at the payload, and there is none"
            yield "effects", problem, "give the rope a payload, or remove it"
        elif effect.payload and effect.payload not in names:
            remedy = did_you_mean(effect.payload, names)
            yield f"effects.{name}.payload", f"there is no payload '{effect.payload}'", remedy


def _shedding_payload(scene: Scene) -> Iterator[Fault]:
    """A point needs the area of the payload that sheds, a rigid body has its own."""
    shedding = scene.listed(PayloadSheddingParams)
    if shedding is None:
        return
    path, body = "effects.payload_shedding.area_m2", body_payload(scene)
    if body is None and shedding.area_m2 is None:
        yield path, "it is missing", "give the projected area of the payload across the flow"
    elif body is not None and shedding.area_m2 is not None:
        problem = "the projected area of a rigid body follows from its size"
        yield path, problem, "remove it, or use `payload` instead of `rigid_body`"
    elif body is not None and shedding.payload not in ("", body):
        problem = f"beside a rigid body only that sheds vortices, '{body}'"
        yield "effects.payload_shedding.payload", problem, "remove it"


def _two_ways(scene: Scene) -> Iterator[Fault]:
    """A payload with different properties in ascent and descent."""
    if scene.listed(SplashZoneParams) is None:
        return
    for number, payload in enumerate(scene.payloads):
        if payload.rising is None and not isinstance(payload.shape, TwoWayShape):
            continue
        problem = f"'{payload.name}' has different properties in ascent and descent"
        remedy = "remove `splash_zone`, which supports one set, or `rising` (and give a box)"
        yield f"payloads[{number}]", problem, remedy


def _limits(scene: Scene) -> Iterator[Fault]:
    """Limits refer to a seabed, two lines and a bend radius that the scene has."""
    for name, problem in (("landing_speed_m_per_s", "the scene has no seabed to land on"),
                       ("bed_clearance_m", "the scene has no seabed")):  # fmt: skip
        if getattr(scene.limits, name) is not None and scene.listed(SeabedParams) is None:
            yield f"limits.{name}", problem, "add the effect `seabed`, or remove this limit"
    if scene.limits.line_clearance_m is not None and len(scene.sheaves) != 1:
        problem = "the scene has no two lines around one sheave"
        yield "limits.line_clearance_m", problem, "add the sheave, or remove this limit"
    made_of = [section.rope for line in scene.ropes for section in line.made_of]
    if scene.limits.bend_radius and not any(rope.minimum_bend_radius_m for rope in made_of):
        remedy = "give a rope its minimum_bend_radius_m, or remove this limit"
        yield "limits.bend_radius", "no rope of the scene has a minimum bend radius", remedy


RULES: tuple[Rule, ...] = (
    _names,
    *RIGGING_RULES,
    sheaves_hold,
    _payload_figures,
    _one_of_rope_and_sections,
    _section_lengths,
    _own_drag,
    _grading,
    _damping,
    *WINCH_RULES,
    _effects,
    _depth_profiles,
    _compensator,
    _rope_contact,
    _payload_contact,
    _payload_oscillation,
    _drag_that_grows,
    body_holds,
    curtain_hangs,
    _two_ways,
    _at_the_end,
    _own_at_payload,
    _fairings_of_one_kind,
    _shedding_payload,
    *ENVIRONMENT_RULES,
    _limits,
)

"""Reader of plan files, with the checks of a plan against its scene."""

from __future__ import annotations

import hashlib
import math
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from rope_twin.effects.payload import SplashZoneParams
from rope_twin.effects.rigid_body import RigidBodyParams
from rope_twin.effects.seabed import SeabedParams
from rope_twin.effects.waves import WavesParams
from rope_twin.errors import InputError, RopeTwinError, SceneErrors
from rope_twin.files import shipped_file
from rope_twin.planning.plan_file import BY_TWIN, Criteria, LiftedFrom, LiftOff, Phase, Plan, Vessel
from rope_twin.planning.seas import DeckTransfer, HullTip, ResponsesTip, TipTransfer
from rope_twin.planning.uncertainties import with_values
from rope_twin.scene.environment import vessel_raos
from rope_twin.scene.grid import find_payload
from rope_twin.scene.lift import lift_figures
from rope_twin.scene.load import Change, change_part, load_scene
from rope_twin.scene.reader import Item, Place, read_document, read_object
from rope_twin.scene.relations import faults as scene_faults
from rope_twin.scene.rigging import is_joined
from rope_twin.scene.schema import Scene
from rope_twin.sea.rao_files import read_responses
from rope_twin.sea.raos import Responses
from rope_twin.sea.tables import is_path
from rope_twin.twin.motion.boundary_conditions import is_known_in_advance
from rope_twin.twin.motion.hang_off import arm_from_bow

HEAD_SEAS = 180.0
SCENE_CURRENT = "scene.effects.current"
CERTAIN = ("method", "uncertainties", "sea.hs_m")  # how a plan is worked out, no data of the lift
MAX_AIR_KG_PER_M3 = 10.0  # density of what counts as air


def read_plan(name_or_path: str | Path) -> tuple[Plan, Scene]:
    """Return a plan of config/plans by its name, or of a YAML file, and its scene.

    Raises:
        SceneError: one sentence with the line on what is wrong in the file.
        InputError: there is no such plan.
    """
    path = shipped_file(str(name_or_path), "plans", "plan")
    tree, data = read_document(path)
    digest = hashlib.sha256(data).hexdigest()
    place = Place(path)
    if isinstance(tree.value, dict) and "ropes" in tree.value:
        remedy = "name it by the key `scene` of a plan, as `rope_twin plan --example` prints one"
        raise place.refuse("this is the file of a scene, not a plan", remedy)
    plan: Plan = read_object(Plan, tree, place, name=path.stem, path=path, digest=digest)
    scene_path = path.parent / plan.scene
    try:
        scene = load_scene(scene_path if scene_path.suffix in (".yaml", ".yml") else plan.scene)
    except RopeTwinError as error:
        raise _at(tree, place, "scene").refuse(*_halves(error)) from error
    scene = plan.in_current(scene)
    errors = SceneErrors()
    for keys, problem, remedy in faults(plan, scene):
        errors.add(_at(tree, place, *keys).refuse(problem, remedy))
    errors.raise_any()
    return plan, scene


def with_error(plan: Plan, share: float) -> Plan:
    """Return the plan with this discretisation error to aim at; its digest includes another one.

    Raises:
        InputError: the plan gives mesh and step, or the share is out of range.
    """
    if plan.method.elements is not None:
        problem = f"'{plan.name}' gives elements and step_s"
        raise InputError("--within", problem, "leave them out of its `method`")
    if share == plan.method.error_within:
        return plan
    change = Change("method.error_within", share)
    changed = change_part(plan, [change], Path("--within"))
    return replace(changed, digest=hashlib.sha256(f"{plan.digest} {change}".encode()).hexdigest())


def _halves(error: RopeTwinError) -> tuple[str, str]:
    """Return fault and remedy of an error's sentence."""
    problem, _, remedy = str(error).rstrip(".").rpartition("; ")
    return (problem, remedy) if problem else (remedy, "correct it")


def _at(tree: Item, place: Place, *keys: str | int) -> Place:
    """Return the place of a key, or of the nearest one above it that the file has."""
    item = tree
    for key in keys:
        value = item.value
        if isinstance(key, str) and isinstance(value, dict) and key in value:
            item = value[key]
            place = place.key(key, item.line)
        elif isinstance(key, int) and isinstance(value, list) and key < len(value):
            item = value[key]
            place = place.index(key, item.line)
        else:
            break
    return place


Fault = tuple[tuple[str | int, ...], str, str]  # keys of its place, fault, remedy


def faults(plan: Plan, scene: Scene) -> Iterator[Fault]:
    """Yield every fault between a plan and its scene."""
    fault = _scene_fault(plan, scene)
    if fault is not None:
        yield ("scene",), *fault
        return
    yield from _vessel_faults(plan, scene)
    if plan.current is not None and _is_in_air(scene):
        yield ("current",), f"'{scene.name}' is in air", "leave it out, or give a scene in water"
    elif plan.current is not None:
        for where, problem, remedy in scene_faults(scene):
            yield ("current",), f"with it, {where} of '{scene.name}': {problem}", remedy
    waves = scene.listed(WavesParams)
    if waves is not None and (waves.jonswap is None or waves.also):
        problem = f"the waves of '{scene.name}' are not one JONSWAP system, whose Hs and Tp vary"
        yield ("scene",), problem, "give its effect `waves` a `jonswap`, and nothing in `also`"
    for number, phase in enumerate(plan.phases):
        for keys, problem, right in _phase_faults(plan, phase, scene):
            yield ("phases", number, phase.kind, *keys), problem, right
    yield from _criteria_faults(plan, scene)
    yield from _uncertainty_faults(plan, scene)
    min_hs_m = plan.sea.hs_m.from_
    for k, period in enumerate(plan.sea.tp_s):
        if not plan.heights_m(k, 0):
            problem = f"waves of Tp {period:g} s break at Hs {min_hs_m:g} m, the lowest of the grid"
            yield ("sea", "tp_s"), problem, "leave the period out, or begin `hs_m` lower"


def _scene_fault(plan: Plan, scene: Scene) -> tuple[str, str] | None:
    """Return why a scene cannot be planned with, and the remedy; None if it can."""
    kinds = {phase.kind for phase in plan.phases}
    if is_joined(scene):
        if kinds == {"from_scene"}:
            return None
        remedy = "give phases `from_scene` alone, or a scene of one rope and its payload"
        return f"the ropes of '{scene.name}' meet, and depths are those of one rope", remedy
    if find_payload(scene, scene.ropes[0]) is None:
        return f"'{scene.name}' has no payload", "give a scene with one at the rope's lower end"
    weight = lift_figures(scene).payload_weight_n
    if weight <= 0.0:
        problem = f"the payload of '{scene.name}' floats with {-1e-3 * weight:.3g} kN"
        return problem, "give one that sinks: uplift and slack count from its submerged weight"
    if not kinds <= set(BY_TWIN) and not is_known_in_advance(scene.winch, ()):
        problem = (
            f"the line out of '{scene.name}' depends on the tension (drive or passive cylinder)"
        )
        return (
            problem,
            "leave drive and passive_compensation out of the winch, or plan `from_scene`",
        )
    return None


def _vessel_faults(plan: Plan, scene: Scene) -> Iterator[Fault]:
    riding = scene.sea_state.on_waves
    if plan.vessel is None and riding is None:
        problem = f"no vessel is given, and '{scene.name}' has none on its waves"
        yield ("vessel",), problem, "add `vessel` with responses and crane_tip_m"
        return
    try:
        tip = tip_of(plan, scene)
    except RopeTwinError as error:
        yield ("vessel", "responses"), *_halves(error)
        return
    if not tip.headings and plan.sea.headings_deg != (HEAD_SEAS,):
        problem = "the scene's box-like hull answers head seas alone"
        yield ("sea", "headings_deg"), problem, "give [180.0], or a `vessel` with responses"


def _phase_faults(plan: Plan, phase: Phase, scene: Scene) -> Iterator[Fault]:
    winch, speed = scene.winch, phase.speed_m_per_s
    if speed > 0.0 and winch is None:
        yield (), f"'{scene.name}' has no winch to lower with", "add a `winch` to the scene"
        return
    if winch is not None and speed > winch.speed_limit_m_per_s:
        problem = f"{speed:g} m/s is above the winch's {winch.speed_limit_m_per_s:g} m/s"
        yield ("speed_m_per_s",), problem, "give less, or raise the scene's speed_limit_m_per_s"
    if phase.lift_off is not None:
        yield from _lift_off_faults(plan, phase.lift_off, scene)
    if (
        phase.in_air is not None
        and not _is_in_air(scene)
        and scene.listed(SplashZoneParams) is None
    ):
        problem = f"the object of '{scene.name}' is in water everywhere"
        yield (
            (),
            problem,
            "give a scene in air (water_density_kg_per_m3: 1.225), or with `splash_zone`",
        )
    bed = scene.listed(SeabedParams)
    tip_m = scene.ship.hang_off_m[2]
    if phase.kind == "landing" and bed is None:
        yield (), f"'{scene.name}' has no seabed", "add the effect `seabed` to the scene"
    if phase.splash_zone is not None:
        kinds = {"splash_zone": SplashZoneParams, "waves": WavesParams}
        missing = [name for name, kind in kinds.items() if scene.listed(kind) is None]
        if missing:
            problem = f"'{scene.name}' lacks the effect {' and '.join(missing)}"
            yield (), problem, "add it to the scene"
            return
    if phase.splash_zone is not None or phase.in_air is not None:
        above = getattr(phase, phase.kind).above_m
        if above >= tip_m:
            problem = f"{above:g} m is not below the crane tip, {tip_m:g} m above the water"
            yield ("above_m",), problem, "give less, or raise the scene's hang_off_m"
            return
    for key, depth in _depths(phase):
        if bed is not None and bed.depth_m is not None and depth >= bed.depth_m:
            problem = f"{depth:g} m is not above the seabed in {bed.depth_m:g} m"
            yield (key,), problem, "give less, or a phase `landing`"
        if winch is None:
            continue
        if not winch.min_line_out_m <= tip_m + depth <= winch.max_line_out_m:
            low_m, high_m = winch.min_line_out_m - tip_m, winch.max_line_out_m - tip_m
            side = "above" if depth < 0.0 else "below"
            problem = f"{abs(depth):g} m {side} the water is beyond the line of the winch"
            yield (
                (key,),
                problem,
                f"it reaches from {low_m:g} to {high_m:g} m below the water",
            )


def _is_in_air(scene: Scene) -> bool:
    return scene.environment.water_density_kg_per_m3 < MAX_AIR_KG_PER_M3


def _lift_off_faults(plan: Plan, lift_off: LiftOff, scene: Scene) -> Iterator[Fault]:
    body = scene.listed(RigidBodyParams)
    if body is None or body.deck is None:
        problem = f"the object of '{scene.name}' stands on no deck"
        yield (), problem, "give a scene with `rigid_body` and its `deck`, such as lift_off"
        return
    if not _is_in_air(scene) or scene.listed(WavesParams) is not None:
        problem = f"'{scene.name}' is in water, and the lift-off in air"
        yield (), problem, "give a scene in air (water_density_kg_per_m3: 1.225), without waves"
    if scene.winch is not None:
        left = scene.ropes[0].length_m - lift_off.hoist_m
        if left < scene.winch.min_line_out_m:
            problem = f"{lift_off.hoist_m:g} m leave {left:g} m of line, the winch keeps "
            problem += f"{scene.winch.min_line_out_m:g} m"
            yield ("hoist_m",), problem, "give less, or lower the scene's min_line_out_m"
    if lift_off.deck is not None and plan.vessel is None:
        yield ("deck",), "the deck moves but no vessel is given", "add `vessel`"
        return
    try:
        deck_of(plan, lift_off.deck)
    except RopeTwinError as error:
        yield ("deck", "responses"), *_halves(error)


def _depths(phase: Phase) -> Sequence[tuple[str, float]]:
    """Return keys and depths of a phase's ends [m]."""
    if phase.lowering is not None:
        return ("from_m", phase.lowering.from_m), ("to_m", phase.lowering.to_m)
    if phase.at_depth is not None:
        return (("depth_m", phase.at_depth.depth_m),)
    if phase.in_air is not None:
        return (("above_m", -phase.in_air.above_m),)
    if phase.splash_zone is not None:
        return ("above_m", -phase.splash_zone.above_m), ("below_m", phase.splash_zone.below_m)
    return ()


def _criteria_faults(plan: Plan, scene: Scene) -> Iterator[Fault]:
    criteria = plan.criteria
    compensated = scene.winch is not None and scene.winch.heave_compensation is not None
    for key in ("stroke_m", "compensation_speed_m_per_s"):
        if getattr(criteria, key) is not None and not compensated:
            problem = f"the winch of '{scene.name}' has no heave compensation"
            yield (
                ("criteria", key),
                problem,
                "leave it out, or add `heave_compensation` to the winch",
            )
    kinds = [phase.kind for phase in plan.phases]
    if criteria.landing_speed_m_per_s is not None and "landing" not in kinds:
        yield ("criteria", "landing_speed_m_per_s"), "no phase lands", "add a phase `landing`"
    if criteria.re_hit_m_per_s is not None and "lift_off" not in kinds:
        yield ("criteria", "re_hit_m_per_s"), "no phase lifts off a deck", "add a phase `lift_off`"
    if criteria == Criteria(uplift_share=None):
        yield ("criteria",), "no limit is given", "give one, such as swl_n or uplift_share"


def _uncertainty_faults(plan: Plan, scene: Scene) -> Iterator[Fault]:
    """Yield every uncertain number that cannot be changed, or not to the ends of its range."""
    files = (f"{plan.path}, ", f"{scene.path}, ", f"{plan.path}: ", f"{scene.path}: ")
    for number, uncertainty in enumerate(plan.uncertainties):
        where = ("uncertainties", number, "key")
        if uncertainty.key.startswith(CERTAIN):
            problem = f"'{uncertainty.key}' is no property of the lift"
            yield where, problem, "give a key of vessel, sea, current, phases, criteria or scene"
            continue
        if plan.current is not None and uncertainty.key.startswith(SCENE_CURRENT):
            problem = f"'{uncertainty.key}' is replaced by the plan's `current`"
            yield where, problem, "give current.speed_m_per_s or another key of it"
            continue
        for value in uncertainty.distribution.quantile(np.array([0.0, 1.0])).tolist():
            try:
                with_values(plan, scene, [uncertainty], [value])
            except RopeTwinError as error:
                sentence = str(error)
                for file in files:
                    sentence = sentence.removeprefix(file)
                problem, _, remedy = sentence.rstrip(".").partition("; ")
                yield where, problem, remedy
                break


def tip_of(plan: Plan, scene: Scene) -> TipTransfer:
    """Return the transfer function of the crane tip.

    Raises:
        InputError: the table of RAOs is wrong.
    """
    if plan.vessel is not None:
        table = _raos(plan, plan.vessel)
        origin = table.origin_m or (0.0, 0.0, 0.0)
        x, y, z = (a - b for a, b in zip(plan.vessel.crane_tip_m, origin, strict=True))
        return ResponsesTip(table, (x, y, z))
    riding = scene.sea_state.on_waves
    assert riding is not None, "checked when the plan was read"
    raos = vessel_raos(scene)
    if raos is None:
        return HullTip(riding.hull)
    return ResponsesTip(raos, arm_from_bow(scene))


def deck_of(plan: Plan, lifted_from: LiftedFrom | None) -> DeckTransfer | None:
    """Return the transfer function of a deck, or None if it is fixed.

    Raises:
        InputError: the table of RAOs is wrong.
    """
    if lifted_from is None:
        return None
    vessel = plan.vessel
    assert vessel is not None, "checked when the plan was read"
    table = _raos(plan, lifted_from if lifted_from.responses else vessel)
    origin = table.origin_m or (0.0, 0.0, 0.0)
    x, y, z = (a - b for a, b in zip(lifted_from.point_m, origin, strict=True))
    return DeckTransfer(table, (x, y, z), math.radians(lifted_from.turn_deg), lifted_from.apart_m)


def _raos(plan: Plan, vessel: Vessel | LiftedFrom) -> Responses:
    path = plan.path.parent / vessel.responses
    source = str(path) if is_path(vessel.responses) and path.is_file() else vessel.responses
    return read_responses(source, vessel.conventions).scaled(
        vessel.motion_factor, vessel.heave_factor
    )


def spreading_of(plan: Plan, scene: Scene) -> float | None:
    """Return the spreading exponent in force."""
    if plan.sea.spreading is not None:
        return plan.sea.spreading
    waves = scene.listed(WavesParams)
    return None if waves is None else waves.spreading

"""Reader of plan files, with the checks of a plan against its scene."""

from __future__ import annotations

import hashlib
import math
from collections.abc import Iterator, Sequence
from pathlib import Path

from rope_twin.effects.payload import SplashZoneParams
from rope_twin.effects.seabed import SeabedParams
from rope_twin.effects.waves import WavesParams
from rope_twin.errors import InputError, RopeTwinError, SceneErrors, did_you_mean, phrase
from rope_twin.planning.plan_file import Criteria, Phase, Plan
from rope_twin.planning.seas import HullTip, ResponsesTip, TipTransfer
from rope_twin.scene.environment import vessel_raos
from rope_twin.scene.lift import lift_figures
from rope_twin.scene.load import load_scene
from rope_twin.scene.reader import Item, Place, read_document, read_object
from rope_twin.scene.rigging import is_joined
from rope_twin.scene.rope_model import find_payload
from rope_twin.scene.schema import Scene
from rope_twin.sea.rao_files import read_responses
from rope_twin.sea.tables import is_path
from rope_twin.share import share_dir
from rope_twin.twin.motion.boundary_conditions import is_known_in_advance
from rope_twin.twin.motion.hang_off import lever_arm

HEAD_SEAS = 180.0


def read_plan(name_or_path: str | Path) -> tuple[Plan, Scene]:
    """Return a plan and its scene.

    Args:
        name_or_path: a name in config/plans, or the path of a YAML file.

    Raises:
        SceneError: one sentence with the line on what is wrong in the file.
        InputError: there is no such plan.
    """
    path = plan_path(name_or_path)
    tree, data = read_document(path)
    digest = hashlib.sha256(data).hexdigest()
    place = Place(path)
    plan: Plan = read_object(Plan, tree, place, name=path.stem, path=path, digest=digest)
    beside = path.parent / plan.scene
    try:
        scene = load_scene(beside if beside.suffix in (".yaml", ".yml") else plan.scene)
    except RopeTwinError as error:
        raise _at(tree, place, "scene").refuse(str(error).rstrip("."), "correct it") from error
    errors = SceneErrors()
    for keys, what, right in faults(plan, scene):
        errors.add(_at(tree, place, *keys).refuse(what, right))
    errors.raise_any()
    return plan, scene


def plan_path(name_or_path: str | Path) -> Path:
    """Return the file of a plan.

    Raises:
        InputError: there is none.
    """
    path, words = Path(name_or_path), str(name_or_path)
    folder = share_dir() / "config" / "plans"
    known = {file.stem: file for file in sorted(folder.glob("*.yaml"))}
    if words in known:
        return known[words]
    if len(path.parts) > 1 or path.suffix in (".yaml", ".yml") or path.is_file():
        return path
    right = f"{did_you_mean(words, known)} (or give the path of a YAML file)"
    raise InputError(phrase(f"plan '{words}'", "there is no such plan", right))


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
    fault = _scene_fault(scene)
    if fault is not None:
        yield ("scene",), *fault
        return
    yield from _vessel_faults(plan, scene)
    yield from _wave_faults(plan, scene)
    for number, phase in enumerate(plan.phases):
        for keys, what, right in _phase_faults(phase, scene):
            yield ("phases", number, phase.kind, *keys), what, right
    yield from _criteria_faults(plan, scene)
    least = plan.sea.hs_m.from_
    for k, period in enumerate(plan.sea.tp_s):
        if not plan.heights_m(k, 0):
            what = f"waves of Tp {period:g} s break at Hs {least:g} m, the lowest of the grid"
            yield ("sea", "tp_s"), what, "leave the period out, or begin `hs_m` lower"


def _scene_fault(scene: Scene) -> tuple[str, str] | None:
    """Return why a scene cannot be planned with, and the remedy; None if it can."""
    if is_joined(scene):
        return f"the ropes of '{scene.name}' meet", "give a scene of one rope and its payload"
    if find_payload(scene, scene.ropes[0]) is None:
        return f"'{scene.name}' has no payload", "give a scene with one at the rope's lower end"
    weight = lift_figures(scene).payload_weight_n
    if weight <= 0.0:
        what = f"the payload of '{scene.name}' floats with {-1e-3 * weight:.3g} kN"
        return what, "give one that sinks: uplift and slack count from its submerged weight"
    if not is_known_in_advance(scene.winch, ()):
        what = f"the line out of '{scene.name}' depends on the tension (drive or passive cylinder)"
        return what, "leave drive and passive_compensation out of the winch"
    return None


def _vessel_faults(plan: Plan, scene: Scene) -> Iterator[Fault]:
    riding = scene.sea_state.on_waves
    if plan.vessel is None and riding is None:
        what = f"no vessel is given, and '{scene.name}' has none on its waves"
        yield ("vessel",), what, "add `vessel` with responses and crane_tip_m"
        return
    try:
        tip = tip_of(plan, scene)
    except RopeTwinError as error:
        yield ("vessel", "responses"), str(error).rstrip("."), "correct it"
        return
    if not tip.headings and plan.sea.headings_deg != (HEAD_SEAS,):
        what = "the scene's box-like hull answers head seas alone"
        yield ("sea", "headings_deg"), what, "give [180.0], or a `vessel` with responses"


def _wave_faults(plan: Plan, scene: Scene) -> Iterator[Fault]:
    waves = scene.listed(WavesParams)
    if waves is None:
        return
    if waves.jonswap is None or waves.also:
        what = f"the waves of '{scene.name}' are not one JONSWAP system, whose Hs and Tp vary"
        yield ("scene",), what, "give its effect `waves` a `jonswap`, and nothing in `also`"


def _phase_faults(phase: Phase, scene: Scene) -> Iterator[Fault]:
    winch, speed = scene.winch, phase.speed_m_per_s
    if speed > 0.0 and winch is None:
        yield (), f"'{scene.name}' has no winch to lower with", "add a `winch` to the scene"
        return
    if winch is not None and speed > winch.speed_limit_m_per_s:
        what = f"{speed:g} m/s is above the winch's {winch.speed_limit_m_per_s:g} m/s"
        yield ("speed_m_per_s",), what, "give less, or raise the scene's speed_limit_m_per_s"
    bed = scene.listed(SeabedParams)
    tip_m = scene.ship.hang_off_m[2]
    if phase.kind == "landing" and bed is None:
        yield (), f"'{scene.name}' has no seabed", "add the effect `seabed` to the scene"
    if phase.splash_zone is not None:
        kinds = {"splash_zone": SplashZoneParams, "waves": WavesParams}
        lacking = [name for name, kind in kinds.items() if scene.listed(kind) is None]
        if lacking:
            what = f"'{scene.name}' lacks the effect {' and '.join(lacking)}"
            yield (), what, "add it to the scene"
            return
        above = phase.splash_zone.above_m
        if above >= tip_m:
            what = f"{above:g} m is not below the crane tip, {tip_m:g} m above the water"
            yield ("above_m",), what, "give less, or raise the scene's hang_off_m"
            return
    for key, depth in _depths(phase):
        if bed is not None and bed.depth_m is not None and depth >= bed.depth_m:
            what = f"{depth:g} m is not above the seabed in {bed.depth_m:g} m"
            yield (key,), what, "give less, or a phase `landing`"
        if winch is None:
            continue
        if not winch.least_line_out_m <= tip_m + depth <= winch.most_line_out_m:
            least, most = winch.least_line_out_m - tip_m, winch.most_line_out_m - tip_m
            side = "above" if depth < 0.0 else "below"
            what = f"{abs(depth):g} m {side} the water is beyond the line of the winch"
            yield (key,), what, f"it reaches from {least:g} to {most:g} m below the water"


def _depths(phase: Phase) -> Sequence[tuple[str, float]]:
    """Return keys and depths of a phase's ends [m]."""
    if phase.lowering is not None:
        return ("from_m", phase.lowering.from_m), ("to_m", phase.lowering.to_m)
    if phase.at_depth is not None:
        return (("depth_m", phase.at_depth.depth_m),)
    if phase.splash_zone is not None:
        return ("above_m", -phase.splash_zone.above_m), ("below_m", phase.splash_zone.below_m)
    return ()


def _criteria_faults(plan: Plan, scene: Scene) -> Iterator[Fault]:
    own = plan.criteria
    compensated = scene.winch is not None and scene.winch.heave_compensation is not None
    for key in ("stroke_m", "compensation_speed_m_per_s"):
        if getattr(own, key) is not None and not compensated:
            what = f"the winch of '{scene.name}' has no heave compensation"
            yield ("criteria", key), what, "leave it out, or add `heave_compensation` to the winch"
    kinds = [phase.kind for phase in plan.phases]
    if own.landing_speed_m_per_s is not None and "landing" not in kinds:
        yield ("criteria", "landing_speed_m_per_s"), "no phase lands", "add a phase `landing`"
    if own == Criteria(uplift_share=None):
        yield ("criteria",), "no limit is given", "give one, such as swl_n or uplift_share"


def tip_of(plan: Plan, scene: Scene) -> TipTransfer:
    """Return the transfer function of the crane tip.

    Raises:
        InputError: the table of RAOs is wrong.
    """
    if plan.vessel is not None:
        name = plan.vessel.responses
        beside = plan.path.parent / name
        found = str(beside) if is_path(name) and beside.is_file() else name
        table = read_responses(found, plan.vessel.conventions)
        origin = table.origin_m or (0.0, 0.0, 0.0)
        x, y, z = (a - b for a, b in zip(plan.vessel.crane_tip_m, origin, strict=True))
        return ResponsesTip(table, (x, y, z))
    riding = scene.sea_state.on_waves
    assert riding is not None, "checked when the plan was read"
    own = vessel_raos(scene)
    if own is None:
        return HullTip(riding.hull)
    x, y, z = lever_arm(scene)
    bow = math.radians(riding.heading_deg)
    c, s = math.cos(bow), math.sin(bow)
    return ResponsesTip(own, (c * x + s * y, c * y - s * x, z))


def bow_of(plan: Plan, scene: Scene) -> float:
    """Return the heading of the bow, from east to north [rad]."""
    if plan.vessel is not None:
        return math.radians(plan.vessel.bow_deg)
    riding = scene.sea_state.on_waves
    return math.radians(riding.heading_deg) if riding is not None else 0.0


def spreading_of(plan: Plan, scene: Scene) -> float | None:
    """Return the spreading exponent in force."""
    if plan.sea.spreading is not None:
        return plan.sea.spreading
    waves = scene.listed(WavesParams)
    return None if waves is None else waves.spreading

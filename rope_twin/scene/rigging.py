"""Rules of lines, connections, sheaves and rigid bodies of a scene."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from typing import Any

from rope_twin.effects.bending import BendingParams
from rope_twin.effects.compensator import CompensatorParams
from rope_twin.effects.net_curtain import NetCurtainParams
from rope_twin.effects.payload import PayloadParams, SplashZoneParams
from rope_twin.effects.payload_faces import FairingParams, NetParams
from rope_twin.effects.rigid_body import RigidBodyParams
from rope_twin.errors import SceneError, did_you_mean
from rope_twin.quantity import text
from rope_twin.scene.schema import WINCH, Fault, RopeLine, Rule, Scene, Triple, Winch


@dataclass(frozen=True, kw_only=True, repr=False)
class NetPart(RopeLine):
    """A border of a net's panels, or the part of a rope beside or below the net.

    What is plausible for a rope of the scene need not be for it.
    """

    _later = frozenset(("end_motion", "panels"))

    panels: NetCurtainParams | None = text("panels beside it; default: of the effect", None)


def is_joined(scene: Scene) -> bool:
    """Return whether the scene is a multi-line system."""
    return len(scene.ropes) > 1 or bool(
        scene.joints or scene.struts or scene.hang_offs or scene.sheaves
    )


def refuse_joined(scene: Scene) -> None:
    """Reject a multi-line scene where a scene of one rope is meant.

    Raises:
        SceneError: the scene is a multi-line system.
    """
    if is_joined(scene):
        remedy = "give a scene of one rope, or step this one with `rope_twin run`"
        raise SceneError(f"{scene.path}: ropes", "ropes meet here", remedy)


def places(scene: Scene) -> dict[str, Triple]:
    """Return the mean positions of the hang-offs [m], by name."""
    return {
        WINCH: scene.ship.hang_off_m,
        **{hang_off.name: hang_off.at_m for hang_off in scene.hang_offs},
    }


def winch_of(scene: Scene, line: RopeLine) -> Winch | None:
    """Return the winch that a rope comes from, or None."""
    if line.from_ == WINCH:
        return scene.winch
    return next(
        (hang_off.winch for hang_off in scene.hang_offs if hang_off.name == line.from_), None
    )


def winches(scene: Scene) -> Iterator[tuple[str, Winch]]:
    """Yield every winch with its path in the file."""
    if scene.winch:
        yield "winch", scene.winch
    for number, hang_off in enumerate(scene.hang_offs):
        if hang_off.winch:
            yield f"hang_offs[{number}].winch", hang_off.winch


def winches_by_name(scene: Scene) -> dict[str, Winch]:
    """Return every winch by the name of its hang-off."""
    named = {WINCH: scene.winch, **{hang_off.name: hang_off.winch for hang_off in scene.hang_offs}}
    return {name: winch for name, winch in named.items() if winch}


def with_winches(scene: Scene, change: Callable[[str, Winch], Winch]) -> Scene:
    """Return the scene with each winch as `change` makes it from its hang-off's name and itself."""
    hang_offs = tuple(
        replace(one, winch=one.winch and change(one.name, one.winch)) for one in scene.hang_offs
    )
    return replace(scene, winch=scene.winch and change(WINCH, scene.winch), hang_offs=hang_offs)


def meeting_points(scene: Scene) -> list[str]:
    """Return the names of payloads, joints and sheaves."""
    points: tuple[Any, ...] = (*scene.payloads, *scene.joints, *scene.sheaves)
    return [point.name for point in points]


def _own_names(scene: Scene) -> Iterator[Fault]:
    """There is a rope; payloads, joints and hang-offs have unique names."""
    if not scene.ropes:
        yield "ropes", "no rope is given", "give at least one"
    keys = ("payloads", "joints", "hang_offs", "struts", "sheaves")
    groups = {key: [part.name for part in getattr(scene, key)] for key in keys}
    counts = Counter([WINCH, *(name for names in groups.values() for name in names)])
    for key, names in groups.items():
        for number, name in enumerate(names):
            if not name and key != "payloads":
                yield f"{key}[{number}].name", "the name is empty", "give it a name"
            if counts[name] > 1:
                problem = f"'{name}' is the name of another payload, joint or hang-off too"
                remedy = "give each a name of its own"
                yield f"{key}[{number}].name", problem, remedy


def _upper_ends(scene: Scene) -> Iterator[Fault]:
    known = [*places(scene), *meeting_points(scene)]
    from_winch = Counter(line.from_ for line in scene.ropes)
    for number, line in enumerate(scene.ropes):
        path = f"ropes[{number}].from"
        if line.from_ not in known:
            yield path, f"nothing is named '{line.from_}'", did_you_mean(line.from_, known)
        elif line.from_ == line.to:
            yield path, f"the rope begins and ends at '{line.to}'", "let it end elsewhere"
        elif number == 0 and line.from_ != WINCH:
            remedy = "list the rope from the winch first (`from: winch`, or no `from`)"
            if line.from_ in {payload.name for payload in scene.payloads}:
                remedy += "; a float's mooring goes from its anchor, ship.hang_off_m, up `to` it"
            yield path, f"the first rope comes from '{line.from_}'", remedy
        elif winch_of(scene, line) and from_winch[line.from_] > 1:
            problem = f"{from_winch[line.from_]} ropes come from the winch of '{line.from_}'"
            yield path, problem, "give each a winch of its own: add to `hang_offs`"
    for number, hang_off in enumerate(scene.hang_offs):
        if not from_winch[hang_off.name]:
            remedy = f"give `from: {hang_off.name}` to a rope, or remove the hang-off"
            yield f"hang_offs[{number}]", f"no rope comes from '{hang_off.name}'", remedy


def _lower_ends(scene: Scene) -> Iterator[Fault]:
    names = meeting_points(scene)
    for number, line in enumerate(scene.ropes):
        path = f"ropes[{number}]"
        if line.to and line.fixed_at_m:
            remedy = "keep `to` (a payload) or `fixed_at_m` (a fixed point)"
            yield path, "both `to` and `fixed_at_m` are given", remedy
        elif not line.to and not line.fixed_at_m:
            remedy = "add `to` (a payload's name) or `fixed_at_m` (a fixed point)"
            yield path, "its lower end is neither fixed nor loaded", remedy
        elif line.end_motion is not None and not line.fixed_at_m:
            remedy = "give `fixed_at_m`, its place at rest, instead of `to`, or no end_motion"
            yield f"{path}.end_motion", "a payload moves by itself", remedy
        elif line.end_motion is not None and is_joined(scene):
            problem = "the lower end of a single rope can be moved, and this scene has more"
            yield f"{path}.end_motion", problem, "leave it out, or the other ropes and connections"
        elif line.to and line.to not in names:
            if line.to in places(scene):
                remedy = "let it end at a payload or a joint: ropes leave the ship by `from`"
            else:
                remedy = did_you_mean(line.to, names) if names else "add it under `payloads`"
            yield f"{path}.to", f"there is no payload '{line.to}'", remedy


def _lower_ends_held(scene: Scene) -> Iterator[Fault]:
    """Every payload and joint is at the lower end of a rope, and no joint is a free end."""
    lower_ends = Counter(line.to for line in scene.ropes)
    ends = lower_ends + Counter(line.from_ for line in scene.ropes)
    ends += Counter(name for strut in scene.struts for name in strut.between)
    for number, payload in enumerate(scene.payloads):
        if not lower_ends[payload.name]:
            remedy = f"give `to: {payload.name}` to a rope, or remove the payload"
            yield f"payloads[{number}]", f"no rope holds '{payload.name}'", remedy
    for number, joint in enumerate(scene.joints):
        path = f"joints[{number}]"
        if not lower_ends[joint.name]:
            remedy = f"give `to: {joint.name}` to the rope that holds it"
            yield path, f"no rope holds '{joint.name}' from above", remedy
        elif ends[joint.name] == 1 and joint.mass_kg == 0.0:
            remedy = "connect another rope there, or hang a payload on it"
            yield path, f"only one rope ends at '{joint.name}', and it weighs nothing", remedy


def _hanging(scene: Scene) -> Iterator[Fault]:
    """Every rope is connected to the ship: a search from the hang-offs down and along the bars."""
    reached = set(places(scene))
    links = [(line.from_, line.to) for line in scene.ropes if line.to]
    links += [strut.between for strut in scene.struts]
    while found := {n for link in links if reached.intersection(link) for n in link} - reached:
        reached |= found
    for number, line in enumerate(scene.ropes):
        if line.from_ not in reached:
            problem = f"'{line.name}' is part of a loop or chain without a hang-off"
            yield f"ropes[{number}]", problem, "let one of its ropes come from the winch"


def _struts(scene: Scene) -> Iterator[Fault]:
    names = meeting_points(scene)
    for number, strut in enumerate(scene.struts):
        path, (first, second) = f"struts[{number}].between", strut.between
        if first == second:
            yield path, f"both ends are at '{first}'", "name two payloads or joints"
        for k, name in enumerate(strut.between):
            if name not in names:
                remedy = did_you_mean(name, names) if names else "add it under `joints`"
                yield f"{path}[{k}]", f"there is no payload or joint '{name}'", remedy


def _what_joints_need(scene: Scene) -> Iterator[Fault]:
    if not is_joined(scene):
        return
    if not (scene.payloads or scene.joints or scene.sheaves):
        problem = "several are held at both ends, and no payload or joint is between them"
        yield "ropes", problem, "add one, or give each rope in a scene of its own"
        return
    kinds = [type(params) for params in scene.effects]
    if not {PayloadParams, RigidBodyParams}.intersection(kinds):
        remedy = "add `- payload: {}`"
        yield (
            "effects",
            "`payload` is not listed: no payload, joint, strut or sheave has weight",
            remedy,
        )


def _own_bending(scene: Scene) -> Iterator[Fault]:
    """A rope's own stiffness replaces the effect's; a connection is a hinge."""
    listed = scene.listed(BendingParams) is not None
    for number, line in enumerate(scene.ropes):
        path = f"ropes[{number}].bending"
        if line.bending is None:
            continue
        if not listed:
            yield path, "the effect `bending` is not listed", "list it, or remove this"
        elif not is_joined(scene):
            yield path, "this is the only rope", "give the values to the effect `bending`"
        elif line.bending.clamped_along is not None and line.from_ not in places(scene):
            problem = f"'{line.name}' begins at '{line.from_}', which is a hinge"
            yield f"{path}.clamped_along", problem, "remove it: only a hang-off fixes a direction"


RIGGING_RULES: tuple[Rule, ...] = (
    _own_names,
    _upper_ends,
    _lower_ends,
    _struts,
    _lower_ends_held,
    _hanging,
    _what_joints_need,
    _own_bending,
)


def sheaves_hold(scene: Scene) -> Iterator[Fault]:
    """Check that each sheave has two ropes of the same material, neither straight from the ship."""
    for number, sheave in enumerate(scene.sheaves):
        path = f"sheaves[{number}]"
        ends = [k for k, line in enumerate(scene.ropes) if line.to == sheave.name]
        if any(line.from_ == sheave.name for line in scene.ropes):
            remedy = f"let both stretches end there (`to: {sheave.name}`)"
            yield path, f"a rope begins at '{sheave.name}'", remedy
        elif len(ends) != 2:
            problem = f"{len(ends)} ropes end at '{sheave.name}'"
            remedy = f"rope runs over it from one stretch into another: give `to: {sheave.name}` "
            yield path, problem, remedy + "to two ropes"
        else:
            yield from _stretches(scene, ends)
        if sheave.tether is None and sheave.mass_kg == 0.0:
            remedy = "give it a `tether` or a mass"
            yield path, f"nothing holds '{sheave.name}' down", remedy
        if any(sheave.name in strut.between for strut in scene.struts):
            yield path, f"a bar ends at '{sheave.name}'", "let it end at a payload or a joint"


def _stretches(scene: Scene, ends: list[int]) -> Iterator[Fault]:
    """Check the two ropes that run as one over a sheave."""
    upper, lower = (scene.ropes[number] for number in ends)
    for number in ends:
        path, line = f"ropes[{number}]", scene.ropes[number]
        if line.from_ in places(scene):
            problem = f"'{line.name}' goes from '{line.from_}' straight to a sheave"
            remedy = "put a payload or a joint between: a winch and a sheave need a stretch each"
            yield path, problem, remedy
        if len(line.made_of) > 1:
            remedy = "give it one `rope`; put a joint where the material changes"
            yield path, f"'{line.name}' runs over a sheave and has sections", remedy
        if line.grading is not None:
            remedy = "remove `grading`: elements are added and removed at its end"
            yield path, f"'{line.name}' runs over a sheave and is graded", remedy
    pairs = zip(upper.made_of, lower.made_of, strict=False)
    if upper.damping != lower.damping or any(a.rope != b.rope for a, b in pairs):
        problem = f"'{upper.name}' and '{lower.name}' are one rope and differ in material"
        yield f"ropes[{ends[1]}]", problem, "give both the same `rope` and `damping`"
    if upper.fatigue is not None and lower.fatigue not in (None, upper.fatigue):
        problem = f"'{upper.name}' and '{lower.name}' are one rope with different fatigue data"
        yield f"ropes[{ends[1]}].fatigue", problem, f"give them once, at '{upper.name}'"


# Effects that treat a payload as a point at the rope's end.
OF_A_POINT = {
    PayloadParams: "payload", NetParams: "net", FairingParams: "fairing",
}  # fmt: skip


def refuse_body(scene: Scene, problem: str) -> None:
    """Reject scenes with a rigid body where unsupported; what: the reason.

    Raises:
        SceneError: the scene's payload is a rigid body.
    """
    if scene.listed(RigidBodyParams) is not None:
        remedy = "use `payload`, a point, instead"
        raise SceneError(f"{scene.path}: effects.rigid_body", problem, remedy)


def body_payload(scene: Scene) -> str | None:
    """Return the name of the payload that is a rigid body; None if none is."""
    body = scene.listed(RigidBodyParams)
    if body is None or not scene.payloads:
        return None
    return body.payload or scene.payloads[0].name


def payload_rope(scene: Scene) -> int:
    """Return the number of the rope whose lower end stands for the payload, in multi-line systems.

    It is the first that ends at the rigid body, else at the first payload; without any it is the
    first rope.
    """
    name = body_payload(scene) or next((payload.name for payload in scene.payloads), "")
    ends = [line.to for line in scene.ropes]
    return ends.index(name) if name in ends else 0


def body_holds(scene: Scene) -> Iterator[Fault]:
    """Check that a rigid body has a payload, and that no effect treats it as a point."""
    body = scene.listed(RigidBodyParams)
    if body is None:
        return
    names = [payload.name for payload in scene.payloads]
    if not names or not any(line.to for line in scene.ropes):
        problem = "`rigid_body` is listed but no payload is"
        yield "effects", problem, "add it under `payloads` and to the rope's `to`, or remove it"
        return
    if body.payload and body.payload not in names:
        remedy = did_you_mean(body.payload, names)
        yield "effects.rigid_body.payload", f"there is no payload '{body.payload}'", remedy
        return
    if not body.payload and len(names) > 1:
        problem = f"it does not say which of {len(names)} payloads is the body"
        yield "effects.rigid_body.payload", problem, f"name it, for instance {names[0]}"
    number = names.index(body_payload(scene) or names[0])
    yield from _only_body(scene, body, scene.payloads[number].name)
    if scene.payloads[number].mass_kg == 0.0:
        remedy = "give the body a mass"
        yield f"payloads[{number}].mass_kg", "a rigid body without mass cannot move", remedy


def _only_body(scene: Scene, body: RigidBodyParams, name: str) -> Iterator[Fault]:
    """Check the effects beside a rigid body of this name, and the rope that it hangs on."""
    further = [payload.name for payload in scene.payloads if payload.name != name]
    points = further + [joint.name for joint in scene.joints if joint.mass_kg > 0.0]
    for params in scene.effects:
        at_point = OF_A_POINT.get(type(params), "")
        if at_point and not (points and isinstance(params, PayloadParams)):
            problem = f"`rigid_body` and `{at_point}`, which treats the payload as a point"
            yield "effects", problem, f"remove `{at_point}`, or use `payload` for the body"
        if not isinstance(params, SplashZoneParams):
            continue
        if params.height_m != body.size_m[2]:
            problem = f"{params.height_m:g} m is not the height of the body, {body.size_m[2]:g} m"
            yield "effects.splash_zone.height_m", problem, "give the third value of size_m"
        if further:
            problem = f"`splash_zone` beside `rigid_body` is for the body alone, not '{further[0]}'"
            yield "effects", problem, "remove it, or give the scene one payload"
    if points and scene.listed(PayloadParams) is None:
        problem = f"`payload` is not listed: '{points[0]}' has no weight"
        yield "effects", problem, "add `- payload: {}`"
    holding = next((line for line in scene.ropes if line.to == name), None)
    if body.deck is None or not body.deck.with_ship or holding is None:
        return
    if holding.from_ not in places(scene):
        problem = f"it heaves with the ship, and '{holding.name}' does not come from there"
        yield "effects.rigid_body.deck.with_ship", problem, "let the deck rest, or heave by itself"


def panels_beside(line: RopeLine, usual: NetCurtainParams) -> NetCurtainParams:
    """Return the panels beside a rope: those of its own net, or the effect's."""
    panels = line.panels if isinstance(line, NetPart) else None
    return panels or usual


def curtain_hangs(scene: Scene) -> Iterator[Fault]:
    """Check that each rope with a net along it is long enough, at the least line out too."""
    curtain = scene.listed(NetCurtainParams)
    if curtain is None:
        return
    names = [line.name for line in scene.ropes]
    if curtain.rope and curtain.rope not in names:
        remedy = did_you_mean(curtain.rope, names)
        yield "effects.net_curtain.rope", f"there is no rope '{curtain.rope}'", remedy
        return
    yield from _curtain_between(curtain.between, names)
    between = {name for pair in curtain.between for name in pair}
    for line in scene.ropes:
        if line.name not in (between or {curtain.rope or line.name}):
            continue
        if runs_over_sheave(scene, line):
            problem = f"'{line.name}' runs over a sheave, which no net passes"
            yield "effects.net_curtain.rope", problem, "name another rope"
        winch = winch_of(scene, line)
        min_m = winch.min_line_out_m if winch is not None else line.length_m
        to_m = panels_beside(line, curtain).to_m
        if to_m > min_m:
            problem = f"the net would reach {to_m:g} m up '{line.name}', of which {min_m:g} m"
            remedy = "give a smaller one, or raise the winch's min_line_out_m"
            yield "effects.net_curtain.to_m", f"{problem} may be all that is out", remedy
    unit_m = scene.ropes[0].made_of[0].length_m or 0.0
    if scene.listed(CompensatorParams) is not None and curtain.from_m < unit_m:
        problem = f"the lowest {unit_m:g} m of the rope are the compensator"
        yield "effects.net_curtain.from_m", problem, f"give at least {unit_m:g} m"


def _curtain_between(pairs: tuple[tuple[str, str], ...], names: list[str]) -> Iterator[Fault]:
    """Check the pairs of ropes that have a net between them."""
    path = "effects.net_curtain.between"
    ends = [name for pair in pairs for name in pair]
    for name in dict.fromkeys(ends):
        if name not in names:
            yield path, f"there is no rope '{name}'", did_you_mean(name, names)
        elif ends.count(name) > 2:
            problem = f"'{name}' is in {ends.count(name)} pairs, and a rope has two sides"
            yield path, problem, "give each rope in two pairs at most"
    if len({frozenset(pair) for pair in pairs}) < len(pairs):
        yield path, "a pair of ropes is listed twice", "list each pair once"
    if any(first == second for first, second in pairs):
        yield path, "a rope is paired with itself", "give two different ropes"


def runs_over_sheave(scene: Scene, line: RopeLine) -> bool:
    """Return whether the rope ends at a sheave."""
    return any(line.to == sheave.name for sheave in scene.sheaves)

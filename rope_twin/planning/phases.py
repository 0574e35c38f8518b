"""Legs of a phase: scene, winch commands and time window of the runs that stand for it.

A leg begins in static equilibrium with the payload at its depth. The motion of the ship builds up
and settles before the window in which extremes are counted; the winch starts with the window.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import NamedTuple

from rope_twin.core import state as rows
from rope_twin.core.loads.balance import lone_middle
from rope_twin.effects.rigid_body import RigidBodyParams
from rope_twin.errors import InputError, RopeTwinError
from rope_twin.planning.plan_file import LiftOff, Phase, Plan
from rope_twin.planning.plan_reader import deck_of
from rope_twin.planning.seas import DeckTransfer
from rope_twin.scene.error_bound import Setting
from rope_twin.scene.lift import lift_figures
from rope_twin.scene.load import Change, change_scene
from rope_twin.scene.rigging import places
from rope_twin.scene.rope_model import build
from rope_twin.scene.schema import Scene
from rope_twin.studies.driven_twin import variant
from rope_twin.twin.contact import seabed_contact
from rope_twin.twin.snapshot import SPEED
from rope_twin.twin.statics import solve_scene_statics
from rope_twin.twin.twin import Twin
from rope_twin.twin.winch.commands import CommandSample, WinchCommand

TRIALS, NEAR_M = 8, 1e-3  # of the length at which the payload hangs at a depth
LANDED_M = 2.0  # line paid out after touchdown
STATIC_ELEMENTS = 20


class RopeAtRest(NamedTuple):
    """A rope of a multi-line scene, at the start of its leg."""

    name: str
    from_ship: bool
    breaking_load_n: float
    upper_n: float  # static tension at its ends
    lower_n: float


@dataclass(frozen=True)
class Leg:
    """Runs of one mesh, begin and schedule; a phase has one or more."""

    number: int
    scene: Scene  # rope as long as at the start
    commands: tuple[CommandSample, ...]
    first_s: float  # beginning of the window
    seconds: float  # end of the window and of the run
    from_m: float  # depth of the payload at the start and at the end
    to_m: float
    speed_m_per_s: float  # of the winch
    static_hook_n: float  # largest static hook load of the leg
    payload_n: float  # static submerged weight of the payload with its hook
    bed_m: float | None = None  # depth of the payload's middle as it touches down, of a landing
    deck_m: float | None = None  # mean height of the deck, of a lift-off
    deck: DeckTransfer | None = None  # that moves it, or None if it is fixed
    by_twin: bool = False  # stepped by a twin of its own
    ropes: tuple[RopeAtRest, ...] = ()  # of a multi-line scene
    offset_m: float = 0.0  # largest lateral offset of the payload from the crane tip at rest
    in_air: bool = False  # above the water throughout; its lateral offset is that of the runs
    setting_error: float = math.nan  # measured when mesh and step were chosen; NaN: it was not

    @property
    def from_ship(self) -> frozenset[str]:
        """Return the names of the ropes that leave the ship, of a multi-line scene."""
        return frozenset(rope.name for rope in self.ropes if rope.from_ship)

    @property
    def setting(self) -> Setting:
        """Return mesh and step."""
        return Setting(self.scene.ropes[0].elements, self.scene.time.step_s)

    @property
    def line_out_m(self) -> float:
        """Return the line out at the end of the leg [m]."""
        return self.scene.ropes[0].length_m + self.to_m - self.from_m

    @property
    def window_s(self) -> float:
        """Return the exposure of the leg [s]."""
        return self.seconds - self.first_s

    def at_setting(self, setting: Setting, error: float = math.nan) -> Leg:
        """Return the leg with this mesh and step; times become whole steps.

        error: that was measured for the setting, over the hook load.

        Raises:
            SceneError: the scene does not take them.
        """
        step = setting.step_s
        seconds = math.ceil(self.seconds / step - 1e-6) * step
        if self.ropes:
            scene = variant(self.scene, setting.elements, step)
        else:
            changes = [Change("ropes[0].elements", setting.elements), Change("time.step_s", step)]
            scene = change_scene(self.scene, changes)
        return replace(self, scene=scene, seconds=seconds, setting_error=error)


def legs_of(plan: Plan, scene: Scene, phase: Phase) -> list[Leg]:
    """Return the legs of a phase, with the scene's own mesh and step.

    Raises:
        InputError: the winch cannot do it, or the payload cannot hang there; one sentence.
    """
    try:
        return list(_legs(plan, scene, phase))
    except RopeTwinError as error:
        where = f"{plan.path}: phase '{phase.title}'"
        raise InputError(f"{where}: {error}") from error


def _legs(plan: Plan, scene: Scene, phase: Phase) -> Sequence[Leg]:
    settled_s = scene.ship.motion_ramp_s + plan.method.settle_s
    if phase.lowering is not None:
        borders = phase.lowering.borders_m()
        speed = phase.lowering.speed_m_per_s
        pairs = pairwise(borders)
        return [_leg(k, scene, settled_s, pair, speed) for k, pair in enumerate(pairs)]
    if phase.at_depth is not None:
        depth, exposure = phase.at_depth.depth_m, phase.at_depth.exposure_s
        return [_leg(0, scene, settled_s, (depth, depth), 0.0, exposure)]
    if phase.splash_zone is not None:
        zone = phase.splash_zone
        return [_leg(0, scene, settled_s, (-zone.above_m, zone.below_m), zone.speed_m_per_s)]
    if phase.in_air is not None:
        above, exposure = phase.in_air.above_m, phase.in_air.exposure_s
        leg = _leg(0, _without_deck(scene), settled_s, (-above, -above), 0.0, exposure)
        load_n = lift_figures(scene).suspended.weight_n(leg.line_out_m)
        return [replace(leg, in_air=True, payload_n=load_n)]
    if phase.from_scene is not None:
        return [_from_scene(scene, settled_s, phase.from_scene.exposure_s)]
    if phase.lift_off is not None:
        return [_lift_off(plan, scene, settled_s, phase.lift_off)]
    assert phase.landing is not None
    return [_landing(scene, settled_s, phase.landing.above_m, phase.landing.speed_m_per_s)]


def _without_deck(scene: Scene) -> Scene:
    """Return the scene of an object that has been slewed clear of the deck it stood on."""
    body = scene.listed(RigidBodyParams)
    if body is None:
        return scene
    effects = (replace(body, deck=None) if effect is body else effect for effect in scene.effects)
    return replace(scene, effects=tuple(effects))


def _leg(
    number: int,
    scene: Scene,
    settled_s: float,
    depths_m: tuple[float, float],
    speed_m_per_s: float,
    exposure_s: float = 0.0,
    bed_m: float | None = None,
) -> Leg:
    start, end = depths_m
    begin = suspended_at(scene, start)
    start_scene, offset = begin.scene, begin.offset_m
    if end > start and bed_m is None:
        offset = max(offset, suspended_at(scene, end).offset_m)
    seconds = exposure_s or (end - start) / speed_m_per_s
    if speed_m_per_s > 0.0 and scene.winch is not None:
        seconds += speed_m_per_s / scene.winch.acceleration_limit_m_per_s2  # its start and its end
        _check_line(scene, start_scene.ropes[0].length_m + (end - start))
    commands = [CommandSample(0, WinchCommand(SPEED, 0.0))] if scene.winch is not None else []
    if speed_m_per_s > 0.0:
        commands.append(CommandSample(round(settled_s * 1e9), WinchCommand(SPEED, speed_m_per_s)))
    figures = lift_figures(scene)
    lengths = (start_scene.ropes[0].length_m, start_scene.ropes[0].length_m + end - start)
    return Leg(
        number=number,
        scene=start_scene,
        commands=tuple(commands),
        first_s=settled_s,
        seconds=settled_s + seconds,
        from_m=start,
        to_m=end,
        speed_m_per_s=speed_m_per_s,
        static_hook_n=max(figures.top_tension_n(length) for length in lengths),
        payload_n=figures.suspended.wet_n,
        bed_m=bed_m,
        offset_m=offset,
    )


def _lift_off(plan: Plan, scene: Scene, settled_s: float, lift_off: LiftOff) -> Leg:
    """Return the leg of a lift off the scene's deck; the rope is as long as in the scene."""
    winch, body = scene.winch, scene.listed(RigidBodyParams)
    assert winch is not None, "checked when the plan was read"
    assert body is not None, "checked when the plan was read"
    assert body.deck is not None, "checked when the plan was read"
    speed, height = lift_off.speed_m_per_s, body.deck.height_m
    seconds = lift_off.hoist_m / speed + speed / winch.acceleration_limit_m_per_s2
    commands = (
        CommandSample(0, WinchCommand(SPEED, 0.0)),
        CommandSample(round(settled_s * 1e9), WinchCommand(SPEED, -speed)),
    )
    fixed = replace(body, deck=replace(body.deck, heave=None, with_ship=False, heaves=()))
    effects = tuple(fixed if effect is body else effect for effect in scene.effects)
    figures, middle = lift_figures(scene), height + 0.5 * body.size_m[2]
    return Leg(
        number=0,
        scene=replace(scene, effects=effects),
        commands=commands,
        first_s=settled_s,
        seconds=settled_s + seconds,
        from_m=-middle,
        to_m=-middle - lift_off.hoist_m,
        speed_m_per_s=-speed,
        static_hook_n=figures.top_tension_n(scene.ropes[0].length_m),
        payload_n=figures.suspended.wet_n,
        by_twin=True,
        deck_m=height,
        deck=deck_of(plan, lift_off.deck),
    )


def _from_scene(scene: Scene, settled_s: float, exposure_s: float) -> Leg:
    """Return the leg of a scene as it is."""
    snapshot, ship_places = Twin(scene).snapshot(), places(scene)
    by_name = {rope.name: rope for rope in snapshot.ropes}
    ropes = tuple(
        RopeAtRest(
            name=line.name,
            from_ship=number == 0 or line.from_ in ship_places,
            breaking_load_n=line.breaking_load_n,
            upper_n=by_name[line.name].tension_top_n,
            lower_n=float(by_name[line.name].element_tension_n[-1]),
        )
        for number, line in enumerate(scene.ropes)
        if line.name in by_name
    )
    depth = -float(snapshot.payload_position_m[2])
    return Leg(
        number=0,
        scene=scene,
        commands=(),
        first_s=settled_s,
        seconds=settled_s + exposure_s,
        from_m=depth,
        to_m=depth,
        speed_m_per_s=0.0,
        static_hook_n=max(
            [snapshot.tension_top_n, *(rope.upper_n for rope in ropes if rope.from_ship)]
        ),
        payload_n=snapshot.tension_payload_n,
        by_twin=True,
        ropes=ropes,
    )


def _landing(scene: Scene, settled_s: float, above_m: float, speed_m_per_s: float) -> Leg:
    """Return the leg of a landing from this height above the seabed."""
    length_m = scene.ropes[0].length_m
    for _ in range(TRIALS):
        found = suspended_at(scene, None, length_m)
        depth, height = found.depth_m, found.height_m
        if height is None or abs(height - above_m) <= NEAR_M:
            break
        length_m += height - above_m
    assert height is not None, "checked when the plan was read"
    ends, bed = (depth, depth + height + LANDED_M), found.middle_depth_m + height
    return _leg(0, scene, settled_s, ends, speed_m_per_s, bed_m=bed)


class SuspendedConfiguration(NamedTuple):
    """A payload in static equilibrium."""

    scene: Scene  # with the rope so long
    depth_m: float  # of the rope's lower end
    height_m: float | None  # above the seabed, of its lowest corner; None: there is no seabed
    offset_m: float  # horizontal distance from the crane tip
    middle_depth_m: float  # of its middle: below the hook if it is a rigid body


def suspended_at(
    scene: Scene, depth_m: float | None, line_out_m: float | None = None
) -> SuspendedConfiguration:
    """Return the scene with its payload hanging at a depth.

    depth_m: of the payload's node below the water; None: `line_out_m` counts; line_out_m:
    unstretched length to begin with.

    Raises:
        SceneError: there is no equilibrium, or the length is out of range.
    """
    length = line_out_m or (depth_m or 0.0) + scene.ship.hang_off_m[2]
    for _ in range(TRIALS):
        count = max(min(STATIC_ELEMENTS, int(length / 2.0)), 3)
        changes = [Change("ropes[0].length_m", length), Change("ropes[0].elements", count)]
        suspended = change_scene(scene, changes)
        rope = build(suspended)
        solve_scene_statics(suspended, rope)
        suspended_depth_m = -float(rope.state.nodes[rows.POSITION + 2, 0])
        if depth_m is None or abs(suspended_depth_m - depth_m) <= NEAR_M:
            break
        length += depth_m - suspended_depth_m
    contact = seabed_contact(rope)
    position = rope.state.nodes[rows.POSITION : rows.POSITION + 3, :1]
    x, y, _ = scene.ship.hang_off_m
    offset = math.hypot(float(position[0, 0]) - x, float(position[1, 0]) - y)
    middle, _ = lone_middle(rope.effects, -suspended_depth_m, 0.0)
    return SuspendedConfiguration(
        suspended,
        suspended_depth_m,
        None if contact is None else contact.payload_height_m,
        offset,
        -middle,
    )


def _check_line(scene: Scene, longest_m: float) -> None:
    """Check that the winch has this much line. Raises InputError: it has not."""
    assert scene.winch is not None
    max_line_m = scene.winch.max_line_out_m
    if longest_m > max_line_m:
        problem = f"it takes {longest_m:.1f} m of line, the winch has {max_line_m:g} m"
        raise InputError("winch", problem, "raise max_line_out_m of the scene")

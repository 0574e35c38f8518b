"""Flexible nets: a grid of ropes between the ropes of a scene, made of the meshes.

The net hangs over a stretch of two or more ropes, side by side. It is divided in columns and rows
of panels. Each border between panels is a rope with the axial stiffness of all twines that it
stands for: those of half a panel on either side, so half as many along the edges. Ropes meet in
connections, on the ropes that hold the net too, which are divided there; so tension passes through
the net in both directions, and every border has nodes of its own. A border carries tension alone,
and shear turns meshes without resistance.

Forces, weight and inertia of the panels are those of `net_curtain` between the level borders, which
carry all of them to the ropes; the borders themselves have next to no mass and no drag.

Several nets share ropes side by side or above each other: a rope is divided at the levels of all of
them, and nets that have a level at the same height meet there. A rope that comes from a winch does
so above its highest net; its line out counts from there, and the winch's limits with it.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import pairwise
from typing import NamedTuple

from rope_twin.core.loads.panel import mesh_fault, meshed_solidity
from rope_twin.effects import EFFECTS
from rope_twin.effects.drag import DragParams
from rope_twin.effects.net_curtain import NetCurtainParams
from rope_twin.errors import did_you_mean
from rope_twin.scene.grid import FEWEST_ELEMENTS
from rope_twin.scene.rigging import NetPart, runs_over_sheave, winch_of, with_winches
from rope_twin.scene.schema import (
    Fault,
    FlexibleNet,
    Joint,
    Rope,
    RopeLine,
    Scene,
    Winch,
)
from rope_twin.scene.winch import FOLLOWS_MEASURED
from rope_twin.scene.winch_rules import line_out_faults

THIN_M, LIGHT_KG_PER_M = 1e-3, 1e-3  # of a border: the panels have the twine's own
ELEMENTS = 3  # of a border


SAME_M = 1e-6  # levels at this distance on a rope are one
APART_M = 0.5  # least distance of others: the shortest part of a rope between nets
LEFT_M = 1.0  # of a rope above its highest net, with the winch's least line out


def net_faults(scene: Scene) -> Iterator[Fault]:
    """Check that the ropes of each net can hold it."""
    names = [net.name for net in scene.nets]
    for number, name in enumerate(names):
        if names.index(name) < number:
            yield f"nets[{number}].name", f"'{name}' is the name of another net", "rename one"
    if scene.nets and scene.listed(NetCurtainParams) is not None:
        yield "effects.net_curtain", "`nets` brings its own panels", "remove one of them"
    for number, net in enumerate(scene.nets):
        path = f"nets[{number}]"
        fault = mesh_fault(net.law, meshed_solidity(net.twine_m, net.bar_m), net.twine_m, net.bar_m)
        if fault is not None:
            problem, _, remedy = fault.partition("; ")
            yield path, problem, remedy
        if net.from_m >= net.to_m:
            yield path, f"from {net.from_m:g} m up to {net.to_m:g} m", "give from_m below to_m"
        if len(set(net.between)) < max(len(net.between), 2):
            yield f"{path}.between", "it names no two different ropes", "name each once, at least 2"
        for name in net.between:
            for key, problem, remedy in _rope_faults(scene, net, name):
                yield f"{path}.{key}", problem, remedy
        for key, problem, remedy in _meeting_faults(net, scene.nets[:number]):
            yield f"{path}.{key}", problem, remedy
    if scene.nets:
        yield from line_out_faults(scene)


_Reason = tuple[str, str, str]  # key of the net, problem, remedy


def _rope_faults(scene: Scene, net: FlexibleNet, name: str) -> Iterator[_Reason]:
    names = [line.name for line in scene.ropes]
    if name not in names:
        yield "between", f"there is no rope '{name}'", did_you_mean(name, names)
        return
    line = scene.ropes[names.index(name)]
    if net.to_m >= line.length_m:
        remedy = "let some rope be left above the net"
        yield "to_m", f"the net reaches {net.to_m:g} m up '{name}' of {line.length_m:g} m", remedy
    if line.rope is None or line.grading is not None:
        problem = f"'{name}' has sections or a grading"
        yield "between", problem, "give it one `rope`, without grading"
    winch = winch_of(scene, line)
    if winch is not None and winch.follows == FOLLOWS_MEASURED:
        problem = f"the winch of '{name}' follows a measured line out, which no net divides"
        yield "between", problem, "let it follow commands, or name another rope"
    elif winch is not None and winch.min_line_out_m < net.to_m + LEFT_M:
        problem = (
            f"the net reaches {net.to_m:g} m up '{name}', of which its winch may leave no more "
            f"than {winch.min_line_out_m:g} m out"
        )
        yield "to_m", problem, f"raise min_line_out_m to {net.to_m + LEFT_M:g} m at least"
    if runs_over_sheave(scene, line):
        yield "between", f"'{name}' runs over a sheave, which no net passes", "name another rope"
    if line.fixed_at_m is not None and net.from_m == 0.0:
        yield "from_m", f"the lower end of '{name}' is fixed", "begin the net above it"


def _meeting_faults(net: FlexibleNet, before: Sequence[FlexibleNet]) -> Iterator[_Reason]:
    """Check a net against those before it: on shared ropes they meet or keep apart."""
    for other in before:
        shared = [name for name in net.between if name in other.between]
        sides = {frozenset(pair) for pair in pairwise(net.between)}
        overlap = net.from_m < other.to_m - SAME_M and other.from_m < net.to_m - SAME_M
        if overlap and sides & {frozenset(pair) for pair in pairwise(other.between)}:
            problem = f"it and '{other.name}' hang between the same ropes at the same height"
            yield "between", problem, "give them different heights, or one net"
            continue
        for level in _heights(net) if shared else ():
            nearest = min((abs(level - height), height) for height in _heights(other))
            if SAME_M < nearest[0] < APART_M:
                problem = (
                    f"on '{shared[0]}' a level at {level:g} m is close to one of '{other.name}' at "
                )
                remedy = f"let them meet there, or keep {APART_M:g} m apart"
                yield "from_m", f"{problem}{nearest[1]:g} m", remedy
                break


class _Level(NamedTuple):
    """A place at which a rope is divided."""

    height_m: float  # above its lower end
    joint: str


class _Grid(NamedTuple):
    """A scene whose nets are being made, and what was made so far."""

    scene: Scene
    tops: dict[str, RopeLine]  # what is left of the ropes above their nets
    levels: dict[str, list[_Level]]  # by rope, from the lowest up
    ropes: list[RopeLine]
    joints: list[Joint]
    pairs: list[tuple[str, str]]  # level borders above each other, with panels between


def with_nets(scene: Scene) -> Scene:
    """Return the scene with ropes, connections and panels in place of its nets."""
    grid, all_panels = _Grid(scene, {}, {}, [], [], []), list[NetCurtainParams]()
    for net in scene.nets:
        all_panels.append(_panels(net))
        usual = all_panels[-1] == all_panels[0]
        _hang(grid, net, None if usual else all_panels[-1])
    ropes = (*(grid.tops.get(line.name, line) for line in scene.ropes), *grid.ropes)
    panels = replace(all_panels[0], between=tuple(grid.pairs))
    order = [effect.params for effect in EFFECTS]
    effects = sorted((*scene.effects, panels), key=lambda params: order.index(type(params)))
    joints = (*scene.joints, *grid.joints)
    return replace(_shortened(scene), ropes=ropes, joints=joints, effects=tuple(effects), nets=())


def _panels(net: FlexibleNet) -> NetCurtainParams:
    """Return the panels of a net, between borders that are not known yet."""
    return NetCurtainParams(
        to_m=net.width_m / net.columns, width_m=(net.to_m - net.from_m) / net.rows,
        twine_m=net.twine_m, bar_m=net.bar_m, twine_kg_per_m3=net.twine_kg_per_m3, law=net.law,
    )  # fmt: skip


def _shortened(scene: Scene) -> Scene:
    """Return the scene with the limits of its winches for the rope above the highest net."""

    def above(name: str, winch: Winch) -> Winch:
        lines = {line.name for line in scene.ropes if line.from_ == name}
        reach_m = max((net.to_m for net in scene.nets if lines & {*net.between}), default=0.0)
        if not reach_m:
            return winch
        schedule = [
            row if row.line_out_m is None else replace(row, line_out_m=row.line_out_m - reach_m)
            for row in winch.schedule
        ]
        return replace(
            winch,
            min_line_out_m=winch.min_line_out_m - reach_m,
            max_line_out_m=winch.max_line_out_m - reach_m,
            schedule=tuple(schedule),
        )

    return with_winches(scene, above)


def _heights(net: FlexibleNet) -> list[float]:
    """Return the heights of a net's levels above the lower ends of its ropes, from its edge up."""
    height = (net.to_m - net.from_m) / net.rows
    return [*(net.from_m + row * height for row in range(net.rows)), net.to_m]


def _hang(grid: _Grid, net: FlexibleNet, panels: NetCurtainParams | None) -> None:
    """Add a net to a scene; panels: None if those of the first net."""
    scene, lines = grid.scene, {line.name: line for line in grid.scene.ropes}
    posts = []  # of each upright border: connections from the net's lower edge up
    for number, name in enumerate(net.between):
        for column in range(1, net.columns if number > 0 else 1):
            posts.append(_inner(grid, net, f"{net.name}_{number}_{column}"))
        if name not in grid.tops:
            nets = [candidate for candidate in scene.nets if name in candidate.between]
            grid.tops[name], grid.levels[name] = _divided(grid, lines[name], nets)
        joints = (_joint_at(grid.levels[name], level) for level in _heights(net))
        posts.append([joint for joint in joints if joint])
    for level, (left, right) in enumerate(pairwise(posts)):
        names = [f"{net.name}_level_{row}_{level}" for row in range(net.rows + 1)]
        pairs = list(pairwise(names))
        panels_of_net = None if panels is None else replace(panels, between=tuple(pairs))
        grid.pairs.extend(pairs)
        for row, name in enumerate(names):
            share = 1.0 if 0 < row < net.rows else 0.5
            twines = share * (net.to_m - net.from_m) / net.rows / net.bar_m
            border = _border(scene, net, name, net.width_m / net.columns, twines)
            border = replace(border, from_=left[row], to=right[row])
            grid.ropes.append(replace(border, panels=panels_of_net))


def _joint_at(levels: Sequence[_Level], height_m: float) -> str:
    """Return the connection of a rope at this height; empty if it has none."""
    return next((level.joint for level in levels if abs(level.height_m - height_m) < SAME_M), "")


def _divided(
    grid: _Grid, line: RopeLine, nets: Sequence[FlexibleNet]
) -> tuple[RopeLine, list[_Level]]:
    """Divide a rope that holds nets; return its part above, and its levels from the lowest up."""
    levels: list[_Level] = []
    for net in nets:
        for row, level in enumerate(_heights(net)):
            if not _joint_at(levels, level):
                at_end = line.to if level == 0.0 else ""
                levels.append(_Level(level, at_end or f"{net.name}_{line.name}_{row}"))
    levels.sort()
    grid.joints.extend(Joint(name=joint) for _, joint in levels if joint != line.to)

    def part(name: str, length_m: float, from_: str, to: str) -> NetPart:
        return NetPart(
            name=name, rope=line.rope, length_m=length_m, elements=elements(length_m), from_=from_,
            to=to, damping=line.damping, bending=line.bending, fatigue=line.fatigue,
        )  # fmt: skip

    def elements(length_m: float) -> int:
        return max(FEWEST_ELEMENTS, round(line.elements * length_m / line.length_m))

    for row, (low, high) in enumerate(pairwise(levels)):
        length_m = high.height_m - low.height_m
        grid.ropes.append(part(f"{line.name}_{row}", length_m, high.joint, low.joint))
    lowest, highest = levels[0], levels[-1]
    if lowest.height_m > 0.0:
        below = part(f"{line.name}_below", lowest.height_m, lowest.joint, line.to)
        grid.ropes.append(replace(below, fixed_at_m=line.fixed_at_m))
    left_m = line.length_m - highest.height_m
    above = replace(
        line, length_m=left_m, elements=elements(left_m), to=highest.joint, fixed_at_m=None
    )
    return above, levels


def _inner(grid: _Grid, net: FlexibleNet, name: str) -> list[str]:
    """Add an upright border between two ropes; return its connections."""
    places = [f"{name}_{level}" for level in range(net.rows + 1)]
    grid.joints.extend(Joint(name=place) for place in places)
    height, twines = (net.to_m - net.from_m) / net.rows, net.width_m / net.columns / net.bar_m
    for row, (low, high) in enumerate(pairwise(places)):
        border = _border(grid.scene, net, f"{name}_row_{row}", height, twines)
        grid.ropes.append(replace(border, from_=high, to=low))
    return places


def _border(scene: Scene, net: FlexibleNet, name: str, length_m: float, twines: float) -> NetPart:
    """Return a rope with the stiffness of so many twines."""
    drag = scene.listed(DragParams)
    rope = Rope(
        diameter_m=THIN_M,
        mass_kg_per_m=LIGHT_KG_PER_M,
        hydrodynamic_diameter_m=THIN_M,
        axial_stiffness_n=twines * net.twine_stiffness_n,
        breaking_load_n=twines * net.twine_breaking_load_n,
        drag_normal=0.0 if drag is not None and drag.normal > 0.0 else None,
        drag_tangential=0.0 if drag is not None and drag.tangential > 0.0 else None,
        about=f"{twines:.3g} twines of '{net.name}'",
    )
    return NetPart(name=name, rope=rope, length_m=length_m, elements=ELEMENTS, damping=net.damping)

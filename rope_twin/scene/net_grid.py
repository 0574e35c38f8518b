"""Flexible nets: a grid of ropes between the ropes of a scene, made of the meshes.

The net hangs over a stretch of two or more ropes, side by side. It is divided in columns and rows
of panels. Each border between panels is a rope with the axial stiffness of all twines that it
stands for: those of half a panel on either side, so half as many along the edges. Ropes meet in
connections, on the ropes that hold the net too, which are divided there; so tension passes through
the net in both directions, and every border has nodes of its own. A border carries tension alone,
and shear turns meshes without resistance.

Forces, weight and inertia of the panels are those of `net_curtain` between the level borders, which
carry all of them to the ropes; the borders themselves have next to no mass and no drag.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from itertools import pairwise
from typing import NamedTuple

from rope_twin.core.loads.panel import mesh_fault, meshed_solidity
from rope_twin.effects import EFFECTS
from rope_twin.effects.drag import DragParams
from rope_twin.effects.net_curtain import NetCurtainParams
from rope_twin.errors import did_you_mean
from rope_twin.scene.rigging import winch_of
from rope_twin.scene.schema import Fault, FlexibleNet, Joint, Rope, RopeLine, Scene

THIN_M, LIGHT_KG_PER_M = 1e-3, 1e-3  # of a border: the panels have the twine's own
ELEMENTS = 3  # of a border


class NetPart(RopeLine):
    """A border of panels, or the part of a rope beside or below the net.

    What is plausible for a rope of the scene need not be for it.
    """


def net_faults(scene: Scene) -> Iterator[Fault]:
    """Check that the ropes of each net can hold it."""
    if len(scene.nets) > 1:
        yield "nets[1]", "a second net", "keep one; it may hang between any number of ropes"
    if scene.nets and scene.listed(NetCurtainParams) is not None:
        yield "effects.net_curtain", "`nets` brings its own panels", "remove one of them"
    for number, net in enumerate(scene.nets):
        path = f"nets[{number}]"
        fault = mesh_fault(net.law, meshed_solidity(net.twine_m, net.bar_m), net.twine_m, net.bar_m)
        if fault is not None:
            what, _, right = fault.partition("; ")
            yield path, what, right
        if net.from_m >= net.to_m:
            yield path, f"from {net.from_m:g} m up to {net.to_m:g} m", "give from_m below to_m"
        if len(set(net.between)) < max(len(net.between), 2):
            yield f"{path}.between", "it names no two different ropes", "name each once, at least 2"
        for name in net.between:
            for key, what, right in _rope_faults(scene, net, name):
                yield f"{path}.{key}", what, right


def _rope_faults(scene: Scene, net: FlexibleNet, name: str) -> Iterator[tuple[str, str, str]]:
    names = [line.name for line in scene.ropes]
    if name not in names:
        yield "between", f"there is no rope '{name}'", did_you_mean(name, names)
        return
    line = scene.ropes[names.index(name)]
    if net.to_m >= line.length_m:
        right = "let some rope be left above the net"
        yield "to_m", f"the net reaches {net.to_m:g} m up '{name}' of {line.length_m:g} m", right
    if line.rope is None or line.grading is not None:
        yield (
            "between",
            f"'{name}' has sections or a grading",
            "give it one `rope`, without grading",
        )
    if winch_of(scene, line) is not None:
        yield "between", f"'{name}' comes from a winch", "let it come from a hang-off without one"
    if any(line.to == sheave.name for sheave in scene.sheaves):
        yield "between", f"'{name}' runs over a sheave, which no net passes", "name another rope"
    if line.fixed_at_m is not None and net.from_m == 0.0:
        yield "from_m", f"the lower end of '{name}' is fixed", "begin the net above it"


class _Made(NamedTuple):
    """Ropes and connections of a net, and the pairs of borders with panels between."""

    ropes: list[RopeLine]
    joints: list[Joint]
    pairs: list[tuple[str, str]]  # level borders above each other


def with_nets(scene: Scene) -> Scene:
    """Return the scene with ropes, connections and panels in place of its nets."""
    for net in scene.nets:
        tops, made = _grid(scene, net)
        panels = NetCurtainParams(
            to_m=net.width_m / net.columns, width_m=(net.to_m - net.from_m) / net.rows,
            twine_m=net.twine_m, bar_m=net.bar_m, twine_kg_per_m3=net.twine_kg_per_m3,
            law=net.law, between=tuple(made.pairs),
        )  # fmt: skip
        order = [effect.params for effect in EFFECTS]
        effects = sorted((*scene.effects, panels), key=lambda own: order.index(type(own)))
        ropes = (*(tops.get(line.name, line) for line in scene.ropes), *made.ropes)
        joints = (*scene.joints, *made.joints)
        scene = replace(scene, ropes=ropes, joints=joints, effects=tuple(effects))
    return replace(scene, nets=())


def _grid(scene: Scene, net: FlexibleNet) -> tuple[dict[str, RopeLine], _Made]:
    """Return what is left of the ropes above the net, by name, and all else."""
    made, tops = _Made([], [], []), {}
    lines = {line.name: line for line in scene.ropes}
    posts = []  # of each upright border: connections from the net's lower edge up
    for number, name in enumerate(net.between):
        if number > 0:
            for column in range(1, net.columns):
                posts.append(_inner(scene, net, f"{net.name}_{number}_{column}", made))
        tops[name], places = _divided(lines[name], net, made)
        posts.append(places)
    for at, (left, right) in enumerate(pairwise(posts)):
        names = [f"{net.name}_level_{row}_{at}" for row in range(net.rows + 1)]
        made.pairs.extend(pairwise(names))
        for row, name in enumerate(names):
            share = 1.0 if 0 < row < net.rows else 0.5
            twines = share * (net.to_m - net.from_m) / net.rows / net.bar_m
            border = _border(scene, net, name, net.width_m / net.columns, twines)
            made.ropes.append(replace(border, from_=left[row], to=right[row]))
    return tops, made


def _divided(line: RopeLine, net: FlexibleNet, made: _Made) -> tuple[RopeLine, list[str]]:
    """Divide a rope that holds the net; return its part above, and the connections beside it."""
    height = (net.to_m - net.from_m) / net.rows
    places = [f"{net.name}_{line.name}_{level}" for level in range(net.rows + 1)]
    if net.from_m == 0.0:
        places[0] = line.to
    made.joints.extend(Joint(name=name) for name in places if name != line.to)

    def part(name: str, length_m: float, from_: str, to: str) -> NetPart:
        return NetPart(
            name=name, rope=line.rope, length_m=length_m, elements=elements(length_m), from_=from_,
            to=to, damping=line.damping, bending=line.bending, fatigue=line.fatigue,
        )  # fmt: skip

    def elements(length_m: float) -> int:
        return max(2, round(line.elements * length_m / line.length_m))

    for row, (low, high) in enumerate(pairwise(places)):
        made.ropes.append(part(f"{line.name}_{row}", height, high, low))
    if net.from_m > 0.0:
        below = part(f"{line.name}_below", net.from_m, places[0], line.to)
        made.ropes.append(replace(below, fixed_at_m=line.fixed_at_m))
    left_m = line.length_m - net.to_m
    above = replace(
        line, length_m=left_m, elements=elements(left_m), to=places[-1], fixed_at_m=None
    )
    return above, places


def _inner(scene: Scene, net: FlexibleNet, name: str, made: _Made) -> list[str]:
    """Add an upright border between two ropes; return its connections."""
    places = [f"{name}_{level}" for level in range(net.rows + 1)]
    made.joints.extend(Joint(name=place) for place in places)
    height, twines = (net.to_m - net.from_m) / net.rows, net.width_m / net.columns / net.bar_m
    for row, (low, high) in enumerate(pairwise(places)):
        border = _border(scene, net, f"{name}_row_{row}", height, twines)
        made.ropes.append(replace(border, from_=high, to=low))
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

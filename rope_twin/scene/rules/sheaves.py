"""Rules of a scene's sheaves: two stretches of one rope end at each, and it is held."""

from __future__ import annotations

from collections.abc import Iterator

from rope_twin.scene.rigging import Sheave
from rope_twin.scene.rules.fault import Fault
from rope_twin.scene.rules.rigging import places
from rope_twin.scene.schema import RopeLine, Scene


def lines_at(scene: Scene, sheave: Sheave) -> list[int]:
    """Return the indices of the ropes that end at a sheave."""
    return [number for number, line in enumerate(scene.ropes) if line.to == sheave.name]


def sheaves_hold(scene: Scene) -> Iterator[Fault]:
    """Check that each sheave has two ropes of the same material, neither straight from the ship."""
    for number, sheave in enumerate(scene.sheaves):
        path = f"sheaves[{number}]"
        ends = lines_at(scene, sheave)
        if any(line.from_ == sheave.name for line in scene.ropes):
            right = f"let both stretches end there (`to: {sheave.name}`)"
            yield path, f"a rope begins at '{sheave.name}'", right
        elif len(ends) != 2:
            what = f"{len(ends)} ropes end at '{sheave.name}'"
            right = f"rope runs over it from one stretch into another: give `to: {sheave.name}` "
            yield path, what, right + "to two ropes"
        else:
            yield from _stretches(scene, ends)
        if sheave.tether is None and sheave.mass_kg == 0.0:
            right = "give it a `tether` or a mass"
            yield path, f"nothing holds '{sheave.name}' down", right
        if any(sheave.name in strut.between for strut in scene.struts):
            yield path, f"a bar ends at '{sheave.name}'", "let it end at a payload or a joint"


def _stretches(scene: Scene, ends: list[int]) -> Iterator[Fault]:
    """Check the two ropes that run as one over a sheave."""
    one, other = (scene.ropes[number] for number in ends)
    for number in ends:
        path, line = f"ropes[{number}]", scene.ropes[number]
        if line.from_ in places(scene):
            what = f"'{line.name}' goes from '{line.from_}' straight to a sheave"
            right = "put a payload or a joint between: a winch and a sheave need a stretch each"
            yield path, what, right
        if len(line.made_of) > 1:
            right = "give it one `rope`; put a joint where the material changes"
            yield path, f"'{line.name}' runs over a sheave and has sections", right
        if line.grading is not None:
            right = "remove `grading`: elements are added and removed at its end"
            yield path, f"'{line.name}' runs over a sheave and is graded", right
    if _makes_differ(one, other):
        what = f"'{one.name}' and '{other.name}' are one rope and differ in material"
        yield f"ropes[{ends[1]}]", what, "give both the same `rope` and `damping`"


def _makes_differ(one: RopeLine, other: RopeLine) -> bool:
    pairs = zip(one.made_of, other.made_of, strict=False)
    return one.damping != other.damping or any(a.rope != b.rope for a, b in pairs)

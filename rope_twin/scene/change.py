"""Changes of numbers of a scene by their paths in its file, under the same rules.

`payloads[0].mass_kg`, `effects.drag.normal` (effects by name), `payloads[0].shape.box.height_m`,
`effects.current.profile[*][1][*]` ([*]: every entry of the list).
"""

from __future__ import annotations

import dataclasses
import hashlib
import re
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from rope_twin.effects import EFFECTS
from rope_twin.errors import did_you_mean
from rope_twin.scene.document import Item, Place
from rope_twin.scene.model.grid import elements_with
from rope_twin.scene.reader import read_object
from rope_twin.scene.schema import Scene
from rope_twin.scene.shapes import SHAPES
from rope_twin.scene.validation.relations import faults
from rope_twin.scene.winch import FOLLOWS_MEASURED

_STEP = re.compile(r"\.?([A-Za-z_]\w*)|\[(\d+|\*)\]")
_KINDS = {
    **{effect.params: effect.name for effect in EFFECTS},
    **{shape: name for name, shape in SHAPES.items()},
}


@dataclass(frozen=True)
class Change:
    """Replacement of a number of the scene, or a factor on it."""

    path: str
    value: float
    multiply: bool = False  # value is a factor on the scene's number

    def __str__(self) -> str:
        """Return the change as written on a command line."""
        return f"{self.path}{'*' if self.multiply else ''}={self.value:g}"


def change_scene(scene: Scene, changes: Sequence[Change]) -> Scene:
    """Return the scene with all changes applied in order; its digest includes them.

    Raises:
        SceneError: an invalid path, a number out of range, or numbers that violate a rule of
            scenes; one sentence.
    """
    if not changes:
        return scene
    for change in changes:
        place = Place(scene.path)
        scene = _changed(scene, _steps(change, place), change, place)
    for where, what, right in faults(scene):
        raise Place(scene.path, where).refuse(what, right)
    told = "\n".join([scene.digest, *(repr(change) for change in changes)])
    return dataclasses.replace(scene, digest=hashlib.sha256(told.encode()).hexdigest())


def at_setting(scene: Scene, elements: int | None = None, step_s: float | None = None) -> Scene:
    """Return the scene with these elements and this step; None keeps the scene's own.

    elements: of the first rope; those of other ropes change in proportion.

    Raises:
        SceneError: they are out of range.
    """
    own = [line.elements for line in scene.ropes]
    counts = [None] if elements is None else elements_with(own, elements)
    given: dict[str, float | None] = {f"ropes[{r}].elements": n for r, n in enumerate(counts)}
    given["time.step_s"] = step_s
    return change_scene(
        scene, [Change(path, value) for path, value in given.items() if value is not None]
    )


def following_measured(scene: Scene) -> Scene:
    """Return the scene with winches that follow their measured line out.

    Raises:
        SceneError: there is no winch, or one cannot follow.
    """
    winch = scene.winch and dataclasses.replace(scene.winch, follows=FOLLOWS_MEASURED)
    hang_offs = tuple(
        dataclasses.replace(
            one, winch=one.winch and dataclasses.replace(one.winch, follows=FOLLOWS_MEASURED)
        )
        for one in scene.hang_offs
    )
    if winch is None and not any(one.winch for one in hang_offs):
        place = Place(scene.path, "winch")
        raise place.refuse("there is no winch that could follow a measured line out", "add one")
    scene = dataclasses.replace(scene, winch=winch, hang_offs=hang_offs)
    for where, what, right in faults(scene):
        raise Place(scene.path, where).refuse(what, right)
    return scene


def _steps(change: Change, place: Place) -> list[str | int | None]:
    """Return the steps of a path: names, indices, None for every entry of a list."""
    steps: list[str | int | None] = []
    at = 0
    while found := _STEP.match(change.path, at):
        name, index = found.groups()
        steps.append(name or (None if index == "*" else int(index)))
        at = found.end()
    if at < len(change.path) or not steps or change.path.startswith("."):
        right = "write it like payloads[0].mass_kg or effects.drag.normal"
        raise place.refuse(f"'{change.path}' is not a path", right)
    return steps


def _changed(value: Any, steps: list[Any], change: Change, place: Place) -> Any:
    """Return a part of the scene (a dataclass, or a tuple of them) with the change applied."""
    if not steps:
        names = ", ".join(_names(value))
        raise place.refuse("it is not a number but has parts", f"continue with one of {names}")
    step, *rest = steps
    if isinstance(value, tuple):
        return _in_parts(value, step, rest, change, place)
    name = _key(value, step, place)
    part, at = getattr(value, name), place.key(name, 0)
    if dataclasses.is_dataclass(part) and type(part) in _KINDS:
        rest, at = _enter_kind([part], rest, at)[1:]
    if _has_parts(part):
        return dataclasses.replace(value, **{name: _changed(part, rest, change, at)})
    number = _number(part, rest, change, at)
    others = {key: getattr(value, key) for key in _names(value) if key != name}
    return read_object(type(value), _item({name: number}), place, **others)


def _in_parts(
    parts: tuple[Any, ...], step: Any, rest: list[Any], change: Change, place: Place
) -> tuple[Any, ...]:
    """Apply the change to one entry of a tuple of dataclasses, or to every one."""
    if parts and type(parts[0]) in _KINDS:
        at, rest, where = _enter_kind(list(parts), [step, *rest], place)
        chosen = [at]
    else:
        chosen, where = _indices(parts, step, place), None
    made = list(parts)
    for at in chosen:
        made[at] = _changed(parts[at], rest, change, where or place.index(at, 0))
    return tuple(made)


def _enter_kind(parts: list[Any], steps: list[Any], place: Place) -> tuple[int, list[Any], Place]:
    """Return index, remaining steps and place of the entry named by its kind (effect, shape)."""
    kinds = [_KINDS[type(part)] for part in parts]
    step = steps[0] if steps else ""
    if step not in kinds:
        what = f"the scene has no '{step}' here" if isinstance(step, str) and step else "no name"
        right = did_you_mean(step, kinds) if step else f"continue with one of {', '.join(kinds)}"
        raise place.refuse(what, right)
    return kinds.index(step), steps[1:], place.key(step, 0)


def _key(value: Any, step: Any, place: Place) -> str:
    """Return the field that a step names."""
    names = _names(value)
    if not isinstance(step, str):
        raise place.refuse("it is not a list", f"name one of {', '.join(names)}")
    if step not in names:
        raise place.key(step, 0).refuse("unknown key", did_you_mean(step, names))
    if getattr(value, step) is None and "quantity" not in _field(value, step).metadata:
        raise place.key(step, 0).refuse(f"the scene has no {step}", "add it to the scene first")
    return step


def _indices(values: tuple[Any, ...], step: Any, place: Place) -> list[int]:
    """Return the indices of a list that a step selects."""
    if step is None:
        return list(range(len(values)))
    if isinstance(step, str) or step >= len(values):
        held = f"[0] to [{len(values) - 1}], or [*] for all" if values else "nothing: it is empty"
        what = f"'{step}' is not a list index" if isinstance(step, str) else f"no entry [{step}]"
        raise place.refuse(what, f"the list has {held}")
    return [step]


def _number(value: Any, steps: list[Any], change: Change, place: Place) -> Any:
    """Return the new value of a field without parts: a number, or a list with some changed."""
    if isinstance(value, tuple):
        if not steps:
            raise place.refuse("it is a list", "name one entry like [0], or [*] for all")
        made = list(value)
        for at in _indices(value, steps[0], place):
            made[at] = _number(value[at], steps[1:], change, place.index(at, 0))
        return made
    if steps:
        raise place.refuse("it has no parts", "end the path here")
    if isinstance(value, bool | str):
        raise place.refuse("it is not a number", "only numbers can be changed")
    if change.multiply and value is None:
        raise place.refuse("the scene does not give it", "set it with = instead of *=")
    number = change.value * value if change.multiply else change.value
    return int(number) if isinstance(value, int) and float(number).is_integer() else number


def _has_parts(value: Any) -> bool:
    """Return whether a value is a dataclass or a tuple of dataclasses."""
    if isinstance(value, tuple):
        return bool(value) and dataclasses.is_dataclass(value[0])
    return dataclasses.is_dataclass(value)


def _names(value: Any) -> list[str]:
    """Return the keys of a part of the scene in its file."""
    if isinstance(value, tuple):
        kinds = [_KINDS[type(part)] for part in value if type(part) in _KINDS]
        return kinds or [f"[{number}]" for number in range(len(value))]
    return [field.name for field in dataclasses.fields(value)]


def _field(value: Any, name: str) -> dataclasses.Field[Any]:
    return next(field for field in dataclasses.fields(value) if field.name == name)


def _item(value: Any) -> Item:
    """Return a value in the form of the reader's input, without a line number."""
    if isinstance(value, dict):
        return Item({key: _item(child) for key, child in value.items()}, 0)
    if isinstance(value, list | tuple):
        return Item([_item(child) for child in value], 0)
    return Item(value, 0)

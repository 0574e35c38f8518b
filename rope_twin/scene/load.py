"""Reading of a scene and of the rope presets from their files, and changes of its numbers.

A number is changed by its path in the file, under the same rules: `payloads[0].mass_kg`,
`effects.drag.normal` (effects by name), `payloads[0].shape.box.height_m`,
`effects.current.profile[*][1][*]` ([*]: every entry of the list).
"""

from __future__ import annotations

import dataclasses
import hashlib
import re
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any, TypeVar

from rope_twin.effects import EFFECTS
from rope_twin.errors import SceneError, SceneErrors, did_you_mean
from rope_twin.files import share_dir, shipped_file
from rope_twin.quantity import quantity, text
from rope_twin.scene.environment import beside, is_bag_path
from rope_twin.scene.grid import elements_with
from rope_twin.scene.net_grid import net_faults, with_nets
from rope_twin.scene.reader import Item, Place, kind, read_choice, read_document, read_object
from rope_twin.scene.relations import faults, independent_faults
from rope_twin.scene.rigging import winches_by_name, with_winches
from rope_twin.scene.schema import Rope, Scene
from rope_twin.scene.shapes import SHAPES
from rope_twin.scene.winch import FOLLOWS_MEASURED
from rope_twin.sea.tables import is_path

_STEP = re.compile(r"\.?([A-Za-z_]\w*)|\[(\d+|\*)\]")
SIZES_MM = 8.0, 200.0  # nominal diameters for which a construction's figures are taken
_KINDS = {
    **{effect.params: effect.name for effect in EFFECTS},
    **{shape: name for name, shape in SHAPES.items()},
}


@dataclass(frozen=True, kw_only=True)
class Construction:
    """Properties of a rope construction per power of its nominal diameter d."""

    about: str = text("description")
    source: str = text("source of the regressions")
    mass_per_d2: float = quantity("mass in air over d²", "kg/m³", 1.0, 1e5)
    hydrodynamic_over_nominal: float = quantity("hydrodynamic diameter over d", "", 0.1, 3.0)
    breaking_load_per_d2: float = quantity("MBL over d²", "N/m²", 1e6, 1e10)
    breaking_load_per_d3: float = quantity(
        "MBL over d³, added to that over d²", "N/m³", -1e10, 1e10, default=0.0
    )
    drag_normal: float | None = quantity(
        "normal drag coefficient on d, instead of the scene's", "", 0.0, 10.0, default=None
    )
    drag_tangential: float | None = quantity(
        "tangential drag coefficient on π·d, instead of the scene's", "", 0.0, 1.0, default=None
    )
    stiffness_per_d2: float | None = quantity("EA over d²", "N/m²", 1e6, 1e12, default=None)
    stiffness_over_breaking_load: float | None = quantity(
        "EA over MBL", "", 1.0, 200.0, default=None
    )

    def check(self) -> str | None:
        """Return a fault unless exactly one stiffness is given, or None."""
        if (self.stiffness_per_d2 is None) == (self.stiffness_over_breaking_load is None):
            return (
                "stiffness must be given exactly once; "
                "give stiffness_per_d2 or stiffness_over_breaking_load"
            )
        return None

    def rope(self, diameter_m: float) -> Rope:
        """Return the rope of this construction with a nominal diameter [m]."""
        d = diameter_m
        breaking_load = self.breaking_load_per_d2 * d**2 + self.breaking_load_per_d3 * d**3
        if self.stiffness_per_d2 is not None:
            stiffness = self.stiffness_per_d2 * d**2
        else:
            stiffness = (self.stiffness_over_breaking_load or 0.0) * breaking_load
        return Rope(
            diameter_m=d,
            mass_kg_per_m=self.mass_per_d2 * d**2,
            hydrodynamic_diameter_m=self.hydrodynamic_over_nominal * d,
            axial_stiffness_n=stiffness,
            breaking_load_n=breaking_load,
            drag_normal=self.drag_normal,
            drag_tangential=self.drag_tangential,
            about=f"{1e3 * d:g} mm {self.about}",
            source=self.source,
        )


@dataclass(frozen=True, kw_only=True)
class SizedRope:
    """A rope given by its construction and diameter."""

    construction: str = text("name under `constructions`")
    diameter_m: float = quantity("nominal diameter", "m", 1e-3, 0.5)


@dataclass(frozen=True, kw_only=True)
class RopeLibrary:
    """Content of config/ropes.yaml."""

    constructions: dict[str, Construction] = text("properties per power of the diameter")
    by_diameter: dict[str, SizedRope] = text("presets evaluated from a construction")
    by_figures: dict[str, Rope] = text("presets with explicit properties")


def rope_presets(path: Path | None = None) -> dict[str, Rope]:
    """Return every preset by name, of config/ropes.yaml or another file of this format.

    Raises:
        SceneError: if the file is invalid, with the location.
    """
    book, tree, path = _rope_book(path)
    presets = dict(book.by_figures)
    for name, sized in book.by_diameter.items():
        where = f"by_diameter.{name}"
        place = Place(path, where, tree.find(where).line)
        if name in presets:
            raise place.refuse("a rope of `by_figures` has this name", "rename one of them")
        if sized.construction not in book.constructions:
            remedy = did_you_mean(sized.construction, book.constructions)
            raise place.refuse(f"there is no construction '{sized.construction}'", remedy)
        presets[name] = book.constructions[sized.construction].rope(sized.diameter_m)
    return presets


def _rope_book(path: Path | None = None) -> tuple[RopeLibrary, Item, Path]:
    path = path or share_dir() / "config" / "ropes.yaml"
    return _rope_book_of(path, path.stat().st_mtime_ns if path.is_file() else 0)


@cache  # each rope of each scene asks for it
def _rope_book_of(path: Path, _written_ns: int) -> tuple[RopeLibrary, Item, Path]:
    tree, _ = read_document(path)
    book: RopeLibrary = read_object(RopeLibrary, tree, Place(path))
    return book, tree, path


def rope_sizes() -> str:
    """Return the pattern of names that give a construction and a nominal diameter [mm]."""
    return rf"({'|'.join(sorted(_rope_book()[0].constructions))})_(\d{{1,3}}(?:\.\d{{1,3}})?)mm"


def rope_preset(name: str) -> Rope:
    """Return one preset, or a rope of a construction by its diameter, such as steel_wire_52mm.

    Raises:
        SceneError: if there is none of this name.
    """
    preset = _rope_named(name)
    if isinstance(preset, Rope):
        return preset
    raise SceneError(f"rope '{name}'", *preset)


def _rope_named(name: str) -> Rope | tuple[str, str]:
    """Return the rope of a name, or fault and remedy."""
    presets, constructions = rope_presets(), _rope_book()[0].constructions
    if name in presets:
        return presets[name]
    if size := re.fullmatch(rope_sizes(), name):
        low, high = SIZES_MM
        if low <= float(size[2]) <= high:
            return constructions[size[1]].rope(float(size[2]) / 1e3)
        problem = f"{size[2]} mm is out of the range of figures by diameter, {low:g} to {high:g} mm"
        return problem, "give the rope by its properties"
    sized = f"{', '.join(sorted(constructions))} by diameter, such as steel_wire_52mm"
    remedy = f"give another one by its properties, one of {sized}, or one of: "
    problem = f"no preset of config/ropes.yaml is named '{name}'"
    return problem, remedy + ", ".join(sorted(presets))


def load_scene(name_or_path: str | Path) -> Scene:
    """Load a scene by the name of a file in config/scenes, or by the path of any YAML file.

    Raises:
        SceneError: one sentence with file, line and path, fault and remedy; its `every` has all
            errors of the file: those of single values, or if there are none, those between values.
    """
    _scene_folder()  # raises at once if the package's files are missing
    path = shipped_file(name_or_path, "scenes", "scene", SceneError)
    errors = SceneErrors()
    tree, data = read_document(path, errors)
    if isinstance(tree.value, dict) and "scene" in tree.value:  # the key that names their scene
        command = "plan" if "phases" in tree.value else "study"
        remedy = f"run `rope_twin {command}` with it, or give the scene that it names"
        raise Place(path).refuse(f"this is the file of a {command}, not a scene", remedy)
    with errors:
        scene: Scene = read_object(
            Scene,
            tree,
            Place(path),
            {
                "RopeLine.rope": _read_rope,
                "RopeSection.rope": _read_rope,
                "Payload.shape": _read_shape,
                "Scene.effects": _read_effects,
            },
            name=path.stem,
            path=path,
            digest=hashlib.sha256(data).hexdigest(),
        )
    errors.raise_any()
    for find_faults in (net_faults, independent_faults):
        for where, problem, remedy in find_faults(scene):
            errors.add(Place(path, where, tree.find(where).line).refuse(problem, remedy))
        errors.raise_any()
        scene = with_nets(scene) if scene.nets else scene
    return _with_files_found(scene)


def scene_names() -> list[str]:
    """Return the names of the scenes in the package.

    Raises:
        SceneError: if the package's files are not installed.
    """
    return sorted(path.stem for path in _scene_folder().glob("*.yaml"))


def argument_for(scene: Scene) -> str:
    """Return the command-line argument for a scene: its name in config/scenes, else its path."""
    if scene.name in scene_names() and scene.path == _scene_folder() / f"{scene.name}.yaml":
        return scene.name
    return str(scene.path)


def _scene_folder() -> Path:
    try:
        return share_dir() / "config" / "scenes"
    except FileNotFoundError as error:
        raise SceneError(str(error)) from error


def _read_rope(item: Item, place: Place) -> Rope:
    """Read a preset by its name, or the properties themselves."""
    if isinstance(item.value, dict):
        rope: Rope = read_object(Rope, item, place)
        return rope
    if not isinstance(item.value, str):
        remedy = "give a preset's name or the rope's properties as a mapping"
        raise place.refuse(f"{kind(item)} is not a rope", remedy)
    preset = _rope_named(item.value)
    if isinstance(preset, Rope):
        return preset
    raise place.refuse(*preset)


def _read_shape(item: Item, place: Place) -> Any:
    """Read one of SHAPES, given as `box: {...}`."""
    name, child, below = read_choice(item, place, SHAPES)
    return read_object(SHAPES[name], child, below)


def _read_effects(item: Item, place: Place) -> tuple[Any, ...]:
    """Read the parameters of each listed effect, in the order of EFFECTS."""
    if not isinstance(item.value, list):
        raise place.refuse(f"{kind(item)} instead of a list", "give a list like `- weight: {}`")
    classes = {effect.name: effect.params for effect in EFFECTS}
    effects: dict[str, Any] = {}
    errors, listed = SceneErrors(), set()
    for number, entry in enumerate(item.value):
        with errors:
            name, child, below = read_choice(entry, place.index(number, entry.line), classes)
            _find_tables(child, place.file)
            if name in listed:
                raise below.refuse("this effect is listed a second time", "keep one of them")
            listed.add(name)
            effects[name] = read_object(classes[name], child, below)
    errors.raise_any()
    return tuple(effects[effect.name] for effect in EFFECTS if effect.name in effects)


def _find_tables(effect: Item, scene_file: Path) -> None:
    """Resolve the paths of an effect's tables (spectra, forces) relative to the scene's file."""
    keys = _mapping(effect)
    also = keys["also"].value if "also" in keys else None
    systems = [keys, *map(_mapping, also if isinstance(also, list) else ())]
    named = [(system, "measured", "file") for system in systems] + [(keys, "table", "path")]
    for component, part, key in named:
        section = _mapping(component[part]) if part in component else {}
        item = section.get(key)
        if item is not None and isinstance(item.value, str) and is_path(item.value):
            file = str((scene_file.parent / item.value).resolve())
            section[key] = dataclasses.replace(item, value=file)


def _mapping(item: Item) -> dict[str, Item]:
    """Return the keys of an item, none if it is no mapping."""
    return item.value if isinstance(item.value, dict) else {}


def _with_files_found(scene: Scene) -> Scene:
    """Resolve the paths of bag and tables relative to the scene's file."""
    sea = scene.sea_state
    if is_bag_path(sea.bag):
        sea = dataclasses.replace(sea, bag=str((scene.path.parent / sea.bag).resolve()))
    if sea.poses is not None and is_bag_path(sea.poses.bag):
        bag = str((scene.path.parent / sea.poses.bag).resolve())
        sea = dataclasses.replace(sea, poses=dataclasses.replace(sea.poses, bag=bag))
    if sea.path:
        sea = dataclasses.replace(sea, path=beside(scene, sea.path))
    if sea.on_waves is not None and sea.on_waves.responses:
        table = beside(scene, sea.on_waves.responses)
        sea = dataclasses.replace(sea, on_waves=dataclasses.replace(sea.on_waves, responses=table))
    return dataclasses.replace(scene, sea_state=sea)


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
    scene = _checked(change_part(scene, changes, scene.path))
    content = "\n".join([scene.digest, *(repr(change) for change in changes)])
    return dataclasses.replace(scene, digest=hashlib.sha256(content.encode()).hexdigest())


def _checked(scene: Scene) -> Scene:
    """Return the scene, or raise its first fault between values."""
    for where, problem, remedy in faults(scene):
        raise Place(scene.path, where).refuse(problem, remedy)
    return scene


Part = TypeVar("Part")


def change_part(part: Part, changes: Sequence[Change], file: Path) -> Part:
    """Return a part that was read from a file, such as a plan, with all changes applied in order.

    Raises:
        SceneError: an invalid path, or a number out of range; one sentence.
    """
    for change in changes:
        place = Place(file)
        part = _changed(part, _steps(change, place), change, place)
    return part


def at_setting(scene: Scene, elements: int | None = None, step_s: float | None = None) -> Scene:
    """Return the scene with these elements and this step; None keeps the scene's own.

    elements: of the first rope; those of other ropes change in proportion.

    Raises:
        SceneError: they are out of range.
    """
    scene_counts = [line.elements for line in scene.ropes]
    counts = [None] if elements is None else elements_with(scene_counts, elements)
    values: dict[str, float | None] = {f"ropes[{r}].elements": n for r, n in enumerate(counts)}
    values["time.step_s"] = step_s
    return change_scene(
        scene, [Change(path, value) for path, value in values.items() if value is not None]
    )


def following_measured(scene: Scene) -> Scene:
    """Return the scene with winches that follow their measured line out.

    Raises:
        SceneError: there is no winch, or one cannot follow.
    """
    if not winches_by_name(scene):
        place = Place(scene.path, "winch")
        raise place.refuse("there is no winch that could follow a measured line out", "add one")
    return _checked(
        with_winches(scene, lambda _, winch: dataclasses.replace(winch, follows=FOLLOWS_MEASURED))
    )


def _steps(change: Change, place: Place) -> list[str | int | None]:
    """Return the steps of a path: names, indices, None for every entry of a list."""
    steps: list[str | int | None] = []
    position = 0
    while match := _STEP.match(change.path, position):
        name, index = match.groups()
        steps.append(name or (None if index == "*" else int(index)))
        position = match.end()
    if position < len(change.path) or not steps or change.path.startswith("."):
        remedy = "write it like payloads[0].mass_kg or effects.drag.normal"
        raise place.refuse(f"'{change.path}' is not a path", remedy)
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
    kept = {key: getattr(value, key) for key in _names(value) if key != name}
    return read_object(type(value), _item({name: number}), place, **kept)


def _in_parts(
    parts: tuple[Any, ...], step: Any, rest: list[Any], change: Change, place: Place
) -> tuple[Any, ...]:
    """Apply the change to one entry of a tuple of dataclasses, or to every one."""
    if parts and type(parts[0]) in _KINDS:
        index, rest, where = _enter_kind(list(parts), [step, *rest], place)
        chosen = [index]
    else:
        chosen, where = _indices(parts, step, place), None
    changed = list(parts)
    for index in chosen:
        changed[index] = _changed(parts[index], rest, change, where or place.index(index, 0))
    return tuple(changed)


def _enter_kind(parts: list[Any], steps: list[Any], place: Place) -> tuple[int, list[Any], Place]:
    """Return index, remaining steps and place of the entry named by its kind (effect, shape)."""
    kinds = [_KINDS[type(part)] for part in parts]
    step = steps[0] if steps else ""
    if step not in kinds:
        problem = f"the scene has no '{step}' here" if isinstance(step, str) and step else "no name"
        remedy = did_you_mean(step, kinds) if step else f"continue with one of {', '.join(kinds)}"
        raise place.refuse(problem, remedy)
    return kinds.index(step), steps[1:], place.key(step, 0)


def _key(value: Any, step: Any, place: Place) -> str:
    """Return the field that a step names."""
    names = _names(value)
    if not isinstance(step, str):
        raise place.refuse("it is not a list", f"name one of {', '.join(names)}")
    if step not in names:
        raise place.key(step, 0).refuse("unknown key", did_you_mean(step, names))
    field = next(candidate for candidate in dataclasses.fields(value) if candidate.name == step)
    if getattr(value, step) is None and "quantity" not in field.metadata:
        raise place.key(step, 0).refuse(f"the scene has no {step}", "add it to the scene first")
    return step


def _indices(values: tuple[Any, ...], step: Any, place: Place) -> list[int]:
    """Return the indices of a list that a step selects."""
    if step is None:
        return list(range(len(values)))
    if isinstance(step, str) or step >= len(values):
        extent = f"[0] to [{len(values) - 1}], or [*] for all" if values else "nothing: it is empty"
        problem = f"'{step}' is not a list index" if isinstance(step, str) else f"no entry [{step}]"
        raise place.refuse(problem, f"the list has {extent}")
    return [step]


def _number(value: Any, steps: list[Any], change: Change, place: Place) -> Any:
    """Return the new value of a field without parts: a number, or a list with some changed."""
    if isinstance(value, tuple):
        if not steps:
            raise place.refuse("it is a list", "name one entry like [0], or [*] for all")
        numbers = list(value)
        for index in _indices(value, steps[0], place):
            numbers[index] = _number(value[index], steps[1:], change, place.index(index, 0))
        return numbers
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


def _item(value: Any) -> Item:
    """Return a value in the form of the reader's input, without a line number."""
    if isinstance(value, dict):
        return Item({key: _item(child) for key, child in value.items()}, 0)
    if isinstance(value, list | tuple):
        return Item([_item(child) for child in value], 0)
    return Item(value, 0)

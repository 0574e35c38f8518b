"""Reading of a scene and of the rope presets from their files."""

from __future__ import annotations

import dataclasses
import hashlib
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from rope_twin.effects import EFFECTS
from rope_twin.errors import SceneError, SceneErrors, did_you_mean, phrase
from rope_twin.quantity import quantity, text
from rope_twin.scene.document import Item, Place, kind, read_document
from rope_twin.scene.reader import read_choice, read_object
from rope_twin.scene.schema import Rope, Scene
from rope_twin.scene.shapes import SHAPES
from rope_twin.scene.validation.environment import beside, is_bag_path
from rope_twin.scene.validation.relations import independent_faults
from rope_twin.sea.tables import is_path
from rope_twin.share import share_dir


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
class Sized:
    """A rope given by its construction and diameter."""

    construction: str = text("name under `constructions`")
    diameter_m: float = quantity("nominal diameter", "m", 1e-3, 0.5)


@dataclass(frozen=True, kw_only=True)
class RopeBook:
    """Content of config/ropes.yaml."""

    constructions: dict[str, Construction] = text("properties per power of the diameter")
    by_diameter: dict[str, Sized] = text("presets evaluated from a construction")
    by_figures: dict[str, Rope] = text("presets with explicit properties")


def rope_presets(path: Path | None = None) -> dict[str, Rope]:
    """Return every preset by name, of config/ropes.yaml or another file of this format.

    Raises:
        SceneError: if the file is invalid, with the location.
    """
    path = path or share_dir() / "config" / "ropes.yaml"
    tree, _ = read_document(path)
    book: RopeBook = read_object(RopeBook, tree, Place(path))
    presets = dict(book.by_figures)
    for name, sized in book.by_diameter.items():
        where = f"by_diameter.{name}"
        place = Place(path, where, tree.find(where).line)
        if name in presets:
            raise place.refuse("a rope of `by_figures` has this name", "rename one of them")
        if sized.construction not in book.constructions:
            right = did_you_mean(sized.construction, book.constructions)
            raise place.refuse(f"there is no construction '{sized.construction}'", right)
        presets[name] = book.constructions[sized.construction].rope(sized.diameter_m)
    return presets


def rope_preset(name: str) -> Rope:
    """Return one preset.

    Raises:
        SceneError: if there is none of this name.
    """
    presets = rope_presets()
    if name not in presets:
        what = "there is no such preset in config/ropes.yaml"
        raise SceneError(phrase(f"rope '{name}'", what, did_you_mean(name, presets)))
    return presets[name]


def load_scene(name_or_path: str | Path) -> Scene:
    """Load a scene by the name of a file in config/scenes, or by the path of any YAML file.

    Raises:
        SceneError: one sentence with file, line and path, fault and remedy; its `every` has all
            errors of the file: those of single values, or if there are none, those between values.
    """
    _scene_folder()  # raises at once if the package's files are missing
    path, errors = _scene_path(name_or_path), SceneErrors()
    tree, data = read_document(path, errors)
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
    for where, what, right in independent_faults(scene):
        errors.add(Place(path, where, tree.find(where).line).refuse(what, right))
    errors.raise_any()
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


def _scene_path(name_or_path: str | Path) -> Path:
    """Return the file of a path, or of a name in config/scenes."""
    if isinstance(name_or_path, Path):
        return name_or_path
    path = Path(name_or_path)
    if len(path.parts) > 1 or path.suffix in (".yaml", ".yml"):
        return path
    names = scene_names()
    if name_or_path in names:
        return _scene_folder() / f"{name_or_path}.yaml"
    if name_or_path and path.exists():
        return path
    right = f"{did_you_mean(name_or_path, names)} (or give the path of a YAML file)"
    raise SceneError(phrase(f"scene '{name_or_path}'", "there is no such scene", right))


def _read_rope(item: Item, place: Place) -> Rope:
    """Read a preset by its name, or the properties themselves."""
    if isinstance(item.value, dict):
        rope: Rope = read_object(Rope, item, place)
        return rope
    presets = rope_presets()
    if not isinstance(item.value, str):
        right = "give a preset's name or the rope's properties as a mapping"
        raise place.refuse(f"{kind(item)} is not a rope", right)
    if item.value not in presets:
        right = did_you_mean(item.value, presets)
        raise place.refuse(f"no preset of config/ropes.yaml is named '{item.value}'", right)
    return presets[item.value]


def _read_shape(item: Item, place: Place) -> Any:
    """Read one of SHAPES, given as `box: {...}`."""
    name, child, at = read_choice(item, place, SHAPES)
    return read_object(SHAPES[name], child, at)


def _read_effects(item: Item, place: Place) -> tuple[Any, ...]:
    """Read the parameters of each listed effect, in the order of EFFECTS."""
    if not isinstance(item.value, list):
        raise place.refuse(f"{kind(item)} instead of a list", "give a list like `- weight: {}`")
    classes = {effect.name: effect.params for effect in EFFECTS}
    found: dict[str, Any] = {}
    errors, listed = SceneErrors(), set()
    for number, entry in enumerate(item.value):
        with errors:
            name, child, at = read_choice(entry, place.index(number, entry.line), classes)
            _find_tables(child, place.file)
            if name in listed:
                raise at.refuse("this effect is listed a second time", "keep one of them")
            listed.add(name)
            found[name] = read_object(classes[name], child, at)
    errors.raise_any()
    return tuple(found[effect.name] for effect in EFFECTS if effect.name in found)


def _find_tables(effect: Item, scene_file: Path) -> None:
    """Resolve the paths of an effect's tables (spectra, forces) relative to the scene's file."""
    keys = _mapping(effect)
    also = keys["also"].value if "also" in keys else None
    systems = [keys, *(_mapping(one) for one in (also if isinstance(also, list) else ()))]
    named = [(one, "measured", "file") for one in systems] + [(keys, "table", "path")]
    for one, part, key in named:
        told = _mapping(one[part]) if part in one else {}
        item = told.get(key)
        if item is not None and isinstance(item.value, str) and is_path(item.value):
            found = str((scene_file.parent / item.value).resolve())
            told[key] = dataclasses.replace(item, value=found)


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

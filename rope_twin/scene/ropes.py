"""Rope presets: data of config/ropes.yaml, evaluated for their diameters."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from rope_twin.errors import SceneError, did_you_mean, phrase
from rope_twin.quantity import quantity, text
from rope_twin.scene.document import Place, read_document
from rope_twin.scene.reader import read_object
from rope_twin.scene.schema import Rope
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

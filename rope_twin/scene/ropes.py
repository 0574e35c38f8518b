"""Rope presets: figures of config/ropes.yaml, evaluated for their diameters."""

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
    """Figures of a kind of rope per power of its nominal diameter d."""

    about: str = text("what it is")
    source: str = text("where the regressions come from")
    mass_per_d2: float = quantity("mass in air over d²", "kg/m³", 1.0, 1e5)
    hydrodynamic_over_nominal: float = quantity("diameter of the volume over d", "", 0.1, 3.0)
    breaking_load_per_d2: float = quantity("breaking load over d²", "N/m²", 1e6, 1e10)
    breaking_load_per_d3: float = quantity(
        "breaking load over d³, added to that over d²", "N/m³", -1e10, 1e10, default=0.0
    )
    drag_normal: float | None = quantity(
        "drag coefficient across it on d, in place of the scene's", "", 0.0, 10.0, default=None
    )
    drag_tangential: float | None = quantity(
        "drag coefficient along it on π·d, in place of the scene's", "", 0.0, 1.0, default=None
    )
    stiffness_per_d2: float | None = quantity("EA over d²", "N/m²", 1e6, 1e12, default=None)
    stiffness_over_breaking_load: float | None = quantity(
        "EA over breaking load", "", 1.0, 200.0, default=None
    )

    def check(self) -> str | None:
        """Exactly one of the two stiffnesses."""
        if (self.stiffness_per_d2 is None) == (self.stiffness_over_breaking_load is None):
            return (
                "its stiffness is not given once; "
                "give stiffness_per_d2 or stiffness_over_breaking_load"
            )
        return None

    def rope(self, diameter_m: float) -> Rope:
        """The rope of this construction with a nominal diameter [m]."""
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

    construction: str = text("a name under `constructions`")
    diameter_m: float = quantity("nominal diameter", "m", 1e-3, 0.5)


@dataclass(frozen=True, kw_only=True)
class RopeBook:
    """The whole of config/ropes.yaml."""

    constructions: dict[str, Construction] = text("figures per power of the diameter")
    by_diameter: dict[str, Sized] = text("presets evaluated from a construction")
    by_figures: dict[str, Rope] = text("presets with figures of their own")


def rope_presets(path: Path | None = None) -> dict[str, Rope]:
    """Every preset by its name, of config/ropes.yaml or another file like it.

    Raises:
        SceneError: if the file is wrong, with the place in it.
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
    """One preset.

    Raises:
        SceneError: if there is none of this name.
    """
    presets = rope_presets()
    if name not in presets:
        what = "there is no such preset in config/ropes.yaml"
        raise SceneError(phrase(f"rope '{name}'", what, did_you_mean(name, presets)))
    return presets[name]

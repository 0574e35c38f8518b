"""VIV model of a scene: which one it lists, and its rejection where none is supported."""

from __future__ import annotations

from typing import Any

from rope_twin.effects import EFFECTS
from rope_twin.scene.schema import Scene
from rope_twin.vortex.results import CoupledSettings

STROUHAL = 0.17  # default, where the model has none


def shedding_model(scene: Scene) -> str:
    """Return the name of the scene's VIV model, or ""."""
    for effect in EFFECTS:
        if effect.sheds and any(type(params) is effect.params for params in scene.effects):
            return effect.name
    return ""


def model_beside(scene: Scene) -> Any:
    """Return the parameters of the scene's decoupled VIV model, or None."""
    kinds = tuple(effect.params for effect in EFFECTS if effect.beside)
    return next((own for own in scene.effects if isinstance(own, kinds)), None)


def coupled_settings(scene: Scene) -> CoupledSettings:
    """Return the scene's VIV model with its water; params of a decoupled one, else None."""
    return CoupledSettings(
        name=shedding_model(scene),
        params=model_beside(scene),
        strouhal=strouhal_number(scene),
        density=scene.environment.water_density_kg_per_m3,
        step_s=scene.time.step_s,
    )


def strouhal_number(scene: Scene) -> float:
    """Return the Strouhal number of the scene's VIV model, or the default."""
    numbers = (getattr(own, "strouhal_number", None) for own in scene.effects)
    return next((number for number in numbers if number is not None), STROUHAL)

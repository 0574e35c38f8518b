"""Sample convergence study: errors fall as the square of element length and step."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from rope_twin.scene import convergence
from rope_twin.scene.load import load_scene
from rope_twin.scene.schema import Scene

ELEMENTS, STEPS_S = (10, 20, 40), (0.005, 0.01, 0.02)
UNCERTAINTY_PCT = 0.01


def error_pct(elements: int, step_s: float) -> float:
    """Return the error of a setting's rms, without the reference's uncertainty."""
    return 40.0 / elements**2 + 1000.0 * step_s**2


def sample_row(elements: int, step_s: float) -> dict[str, Any]:
    """Return a level that costs 100 ns per node and step."""
    error = error_pct(elements, step_s)
    figures = {
        name: {"error": scale * error, "at_most": scale * error + UNCERTAINTY_PCT}
        for name, scale in ((convergence.RMS, 1.0), (convergence.PEAK, 0.5))
    }
    return {
        "elements": elements,
        "step_s": step_s,
        "newton_tolerance_n": None,
        "real_time_factor": step_s / (elements * 100e-9),
        "solves_per_step": 2.0,
        "memory_mb": 0.1,
        "figures": figures,
    }


def sample_study(scene: Scene) -> dict[str, Any]:
    """Return a study of the scene, as its file has it."""
    return {
        "format": convergence.FORMAT,
        "scene": scene.name,
        "seconds": 30.0,
        "scene_digest": convergence.scene_digest(scene),
        "solver": convergence.solver_version(scene),
        "machine": "a drawing board",
        "rows": [sample_row(elements, step_s) for elements in ELEMENTS for step_s in STEPS_S],
    }


def studied_scene(folder: Path, elements: int = 20, name: str = "small") -> Scene:
    """Return still_water with this number of elements and name, with the sample study."""
    text = load_scene("still_water").path.read_text(encoding="utf-8")
    path = folder / f"{name}.yaml"
    path.write_text(text.replace("elements: 50", f"elements: {elements}"), encoding="utf-8")
    scene = load_scene(path)
    write_study(scene, sample_study(scene))
    return scene


def write_study(scene: Scene, content: dict[str, Any]) -> None:
    """Write a study to the scene's study file."""
    path = convergence.study_path(scene)
    path.parent.mkdir(exist_ok=True)
    path.write_text(json.dumps(content), encoding="utf-8")

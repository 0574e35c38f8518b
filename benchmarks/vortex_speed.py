"""Speed of VIV models, compared with the same rope without them.

Their errors are not measured here, but by `python -m validation Q1 Q3 L1 L2`.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import asdict, dataclass, replace
from typing import Any

import numpy as np

from rope_twin.effects.bending import BendingParams
from rope_twin.effects.strouhal_forcing import StrouhalForcingParams
from rope_twin.effects.travelling_waves import TravellingWavesParams
from rope_twin.effects.wake_oscillator import WakeOscillatorParams
from rope_twin.scene.load import load_scene
from rope_twin.scene.schema import Scene
from rope_twin.studies.driven_twin import variant
from validation.state_bench import Bench, time_in_turns

STEP_S = 1e-3
MODELS: dict[str, Any] = {
    "none": None,
    "strouhal_forcing": StrouhalForcingParams(limit_diameters=1.0),
    "wake_oscillator": WakeOscillatorParams(),
    "travelling_waves": TravellingWavesParams(),
}
Case = tuple[str, int, tuple[str, ...]]  # scene, elements, models
FULL: tuple[Case, ...] = (
    ("smooth_2km", 1000, tuple(MODELS)), ("curved_pipe", 200, ("none", "wake_oscillator")),
)  # fmt: skip
QUICK: tuple[Case, ...] = (("smooth_2km", 50, ("none", "wake_oscillator")),)
SETTLE_S, PIECES, NODE_STEPS = 1.0, 20, 200_000  # node-steps of a piece
Listener = Callable[[int, int, str], None]


@dataclass(frozen=True)
class VortexRow:
    """One scene with one model, at STEP_S."""

    scene: str
    nodes: int
    bending: bool
    model: str
    ns_per_node_step: float  # median of the pieces
    best_ns: float
    real_time_factor: float
    best_factor: float


def vortex_rows(cases: Sequence[Case], listen: Listener) -> Iterator[dict[str, Any]]:
    """Return a row per scene and model, as a dictionary.

    Raises:
        SolverError: a rope finds no rest, or a step is not finite.
    """
    runs = [(name, elements, model) for name, elements, models in cases for model in models]
    for number, (name, elements, model) in enumerate(runs):
        listen(number, len(runs), f"{name}, {elements} elements, {model}")
        yield asdict(_measured(name, elements, model))
    listen(len(runs), len(runs), "done")


def vortex_table(rows: Sequence[dict[str, Any]]) -> list[tuple[str, ...]]:
    """Return the rows as text, below a head."""
    head = ("scene", "nodes", "bending", "model", "ns/node/step (best)", "× real time (best)")
    table: list[tuple[str, ...]] = [head]
    for row in rows:
        cost = f"{row['ns_per_node_step']:.0f} ({row['best_ns']:.0f})"
        pace = f"{row['real_time_factor']:.1f} ({row['best_factor']:.1f})"
        bending = "yes" if row["bending"] else "no"
        table.append((row["scene"], f"{row['nodes']}", bending, row["model"], cost, pace))
    return table


def _measured(name: str, elements: int, model: str) -> VortexRow:
    scene = _with(variant(load_scene(name), elements, STEP_S), MODELS[model])
    bench, steps = Bench(scene), max(1, NODE_STEPS // elements)
    bench.hold(round(SETTLE_S / STEP_S))
    (took,) = time_in_turns([bench], PIECES, lambda own: own.still(steps))
    usual, best = float(np.median(took)) / steps, min(took) / steps
    bending = any(isinstance(own, BendingParams) for own in scene.effects)
    return VortexRow(
        name, elements, bending, model, 1e9 * usual / elements, 1e9 * best / elements,
        STEP_S / usual, STEP_S / best,
    )  # fmt: skip


def _with(scene: Scene, model: Any) -> Scene:
    """Return the scene with this VIV model (None: without any)."""
    kinds = tuple(type(own) for own in MODELS.values() if own is not None)
    others = tuple(own for own in scene.effects if not isinstance(own, kinds))
    return replace(scene, effects=others if model is None else (*others, model))

"""Cost of VIV models: of a step with each, and real-time factors of rope and model.

Models within the step are compared with the same rope without them at steps of 1 ms.
The modal and the force-decomposition model are outside the step: they respond once per update, on a
grid of their own, and solve for their modes in parts. Twins of scenes run with and without their
model, with the scene's own elements and step; and these two respond alone, in static equilibrium in
a constant current, as in a study without a twin. [LCD]: Le Cunff and Durand (1999).

Their errors are not measured here, but by `python -m validation Q1 Q3 L1 L2`.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import asdict, dataclass, replace
from typing import Any

import numpy as np

from rope_twin.effects import EFFECTS
from rope_twin.effects.bending import BendingParams
from rope_twin.effects.strouhal_forcing import StrouhalForcingParams
from rope_twin.effects.travelling_waves import TravellingWavesParams
from rope_twin.effects.wake_oscillator import WakeOscillatorParams
from rope_twin.scene.load import load_scene
from rope_twin.scene.schema import Scene
from rope_twin.studies.driven_twin import variant
from rope_twin.twin.twin import Twin
from rope_twin.vortex.decomposed_response import DecomposedResponse
from rope_twin.vortex.modal_response import ModalResponse
from rope_twin.vortex.power_in import decomposed, fine_enough
from rope_twin.vortex.shedding import Shedding
from validation.case import Listener, announced
from validation.published_ropes import LCD_CABLE, LCD_RISER, PublishedRope, lcd_current
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
    for run in announced(runs, listen, lambda case: f"{case[0]}, {case[1]} elements, {case[2]}"):
        yield asdict(_measured(*run))


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
    (took,) = time_in_turns([bench], PIECES, lambda timed_bench: timed_bench.still(steps))
    usual, fastest = float(np.median(took)) / steps, min(took) / steps
    bending = any(isinstance(params, BendingParams) for params in scene.effects)
    return VortexRow(
        name, elements, bending, model, 1e9 * usual / elements, 1e9 * fastest / elements,
        STEP_S / usual, STEP_S / fastest,
    )  # fmt: skip


def _with(scene: Scene, model: Any) -> Scene:
    """Return the scene with this VIV model (None: without any)."""
    kinds = tuple(type(params) for params in MODELS.values() if params is not None)
    further = tuple(params for params in scene.effects if not isinstance(params, kinds))
    return replace(scene, effects=further if model is None else (*further, model))


ALONE: dict[str, PublishedRope] = {"[LCD] cable": LCD_CABLE, "[LCD] riser": LCD_RISER}
SCENES = ("cable_waves", "vortices_modal", "vortices_decomposed")
NODES = 301  # of a rope alone, before a model makes elements of its own
PACE_SETTLE_S, PIECE_S = 3.0, 1.0  # a piece holds one search for the modes
Advance = Callable[[float], None]


@dataclass(frozen=True)
class PacePlan:
    """Models, and number of timed seconds of each."""

    scenes: tuple[str, ...]
    alone: tuple[str, ...]
    pieces: int


PACE_FULL = PacePlan(SCENES, tuple(ALONE), 15)
PACE_QUICK = PacePlan((), ("[LCD] riser",), 3)


@dataclass(frozen=True)
class PaceRow:
    """One rope with one model."""

    rope: str
    runs: str  # "twin", or "alone": a constant current, no twin
    model: str  # "none": the twin without it
    step_s: float | None  # the twin's; None: alone
    places: int  # that the model answers at
    modes: int  # that it looks for; 0: it steps with the rope
    real_time_factor: float  # median of the pieces
    best_factor: float


def pace_rows(plan: PacePlan, listen: Listener) -> Iterator[dict[str, Any]]:
    """Return a row for each rope and model, as a dictionary.

    Raises:
        SolverError: a step is not finite.
    """
    for name in announced((*plan.scenes, *plan.alone), listen, str):
        rows = _alone if name in plan.alone else _of_scene
        yield from (asdict(row) for row in rows(name, plan.pieces))


def pace_table(rows: Sequence[dict[str, Any]]) -> list[tuple[str, ...]]:
    """Return the rows as text, below a head."""
    head = ("rope", "runs", "model", "step ms", "places", "modes", "× real time (best)")
    table: list[tuple[str, ...]] = [head]
    for row in rows:
        step = "" if row["step_s"] is None else f"{1e3 * row['step_s']:g}"
        pace = f"{row['real_time_factor']:.0f} ({row['best_factor']:.0f})"
        modes = str(row["modes"]) if row["modes"] else ""
        table.append(
            (row["rope"], row["runs"], row["model"], step, f"{row['places']}", modes, pace)
        )
    return table


def _of_scene(name: str, pieces: int) -> list[PaceRow]:
    """Return a scene's twin with and without its model."""
    scene = load_scene(name)
    sheds = {effect.params: effect.name for effect in EFFECTS if effect.sheds}
    model = next(sheds[type(params)] for params in scene.effects if type(params) in sheds)
    without_model = replace(
        scene, effects=tuple(params for params in scene.effects if type(params) not in sheds)
    )
    rows = []
    for timed_scene, label in ((without_model, "none"), (scene, model)):
        twin = Twin(timed_scene)
        places, modes = scene.ropes[0].elements + 1, 0
        if twin.viv_drag is not None:
            places, modes = twin.viv_drag.trackers[0].size
        usual, fastest = _paces(_advance_of(twin), pieces)
        rows.append(PaceRow(name, "twin", label, twin.step_s, places, modes, usual, fastest))
    return rows


def _advance_of(twin: Twin) -> Advance:
    return lambda seconds: twin.advance(round(seconds / twin.step_s))


def _alone(name: str, pieces: int) -> list[PaceRow]:
    """Return both models on a published rope."""
    rope = ALONE[name]
    wet = rope.span(lcd_current(NODES))
    dry = replace(rope, added_mass=0.0).span(lcd_current(NODES))
    model = decomposed()
    both: dict[str, ModalResponse | DecomposedResponse] = {
        "modal_vibration": ModalResponse(wet, Shedding()),
        "decomposed_force": DecomposedResponse(fine_enough(dry, model), model),
    }
    rows = []
    for label, response in both.items():
        usual, fastest = _paces(response.advance, pieces)
        places, modes = len(response.span.s), len(response.frequency)
        rows.append(PaceRow(name, "alone", label, None, places, modes, usual, fastest))
    return rows


def _paces(advance: Advance, pieces: int) -> tuple[float, float]:
    """Return simulation time per wall-clock time: median and best of the pieces."""
    advance(PACE_SETTLE_S)
    took = []
    for _ in range(pieces):
        began = time.perf_counter()
        advance(PIECE_S)
        took.append(time.perf_counter() - began)
    return PIECE_S / float(np.median(took)), PIECE_S / min(took)

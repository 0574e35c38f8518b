"""How long a scene's rope takes to come to rest, from good and from bad guesses."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import asdict, dataclass, replace
from typing import Any

import numpy as np

from rope_twin.core.state import POSITION, Floats
from rope_twin.core.statics import Equilibrium, settle
from rope_twin.scene.build import build
from rope_twin.scene.load import load_scene
from rope_twin.scene.schema import Scene

NODES = 1000
SCENES = ("deep_lift", "hmpe_lift", "storm", "smooth_2km", "slack_5km")
REPETITIONS = 5
COIL_M = 5.0  # radius


@dataclass(frozen=True)
class StaticsRow:
    """One scene and guess."""

    scene: str
    nodes: int
    guess: str
    ms: float  # best of REPETITIONS, compiled before
    rounds: int
    residual_n: float  # largest force left on a node
    tension_n: float  # largest tension
    found: bool


def statics_rows(scenes: Sequence[str] = SCENES, nodes: int = NODES) -> Iterator[dict[str, Any]]:
    """A row per scene and guess, as a dictionary; the lower end of a rope held there stays.

    Raises:
        SceneError: a scene cannot be loaded or built.
    """
    for name in scenes:
        scene = load_scene(name)
        line = replace(scene.ropes[0], elements=nodes)
        fine = replace(scene, ropes=(line, *scene.ropes[1:]))
        _timed(fine, "as built")  # compiles
        for guess in GUESSES:
            ms, end = min((_timed(fine, guess) for _ in range(REPETITIONS)), key=lambda row: row[0])
            row = StaticsRow(
                name, nodes, guess, ms, end.rounds, end.residual_n, end.tension_n, end.found
            )
            yield asdict(row)


def statics_table(rows: Sequence[dict[str, Any]]) -> list[tuple[str, ...]]:
    """The rows as words, below a head."""
    head = ("scene", "guess", "nodes", "ms", "rounds", "force left N", "tension kN")
    table: list[tuple[str, ...]] = [head]
    for row in rows:
        left = f"{row['residual_n']:.1e}" + ("" if row["found"] else ", no rest")
        cells = (f"{row['nodes']}", f"{row['ms']:.1f}", f"{row['rounds']}", left)
        table.append((row["scene"], row["guess"], *cells, f"{1e-3 * row['tension_n']:.1f}"))
    return table


def _timed(scene: Scene, guess: str) -> tuple[float, Equilibrium]:
    """Milliseconds of one search and how it ended."""
    rope, line = build(scene).rope, scene.ropes[0]
    place = rope.state.nodes[POSITION : POSITION + 3, : line.elements + 1]
    first = 1 if line.fixed_at_m is not None else 0
    start = GUESSES[guess](place - place[:, -1:], line.length_m)
    place[:, first:-1] = (start + place[:, -1:])[:, first:-1]
    began = time.perf_counter()
    end = settle(rope, line.length_m)
    return 1e3 * (time.perf_counter() - began), end


def _as_built(place: Floats, length: float) -> Floats:
    return place


def _slack(place: Floats, length: float) -> Floats:
    return 0.5 * place


def _horizontal(place: Floats, length: float) -> Floats:
    s = np.linspace(length, 0.0, place.shape[1])
    return np.stack([s, 0.0 * s, 0.0 * s])


def _coiled(place: Floats, length: float) -> Floats:
    s = np.linspace(length, 0.0, place.shape[1])
    angle = s / COIL_M
    return np.stack([COIL_M * np.cos(angle) - COIL_M, COIL_M * np.sin(angle), -0.01 * s])


def _upside_down(place: Floats, length: float) -> Floats:
    return np.stack([place[0], place[1], -place[2]])


# Nodes relative to the hang-off and the rope's length, to nodes relative to the hang-off.
GUESSES: dict[str, Callable[[Floats, float], Floats]] = {
    "as built": _as_built,
    "slack": _slack,
    "horizontal": _horizontal,
    "coiled": _coiled,
    "upside down": _upside_down,
}

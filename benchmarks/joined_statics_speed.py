"""Time of the static solver for multi-line systems, from good and bad initial guesses."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import asdict, replace
from typing import Any

import numpy as np

from benchmarks.statics_speed import COIL_M, NODES, REPETITIONS, StaticsRow
from rope_twin.core.joined.joints import LOOSE
from rope_twin.core.joined.statics import solve_joined_statics
from rope_twin.core.state import ELEMENTS, LINE, MOTIONS, POSITION, Floats
from rope_twin.core.statics.shape import Equilibrium
from rope_twin.scene.load import load_scene
from rope_twin.scene.model.joined import build_joined
from rope_twin.scene.schema import Scene

SCENES = ("bridle_lift", "two_line_lift")
_PLACE = slice(POSITION, POSITION + 3)


def joined_statics_rows(
    scenes: Sequence[str] = SCENES, nodes: int = NODES
) -> Iterator[dict[str, Any]]:
    """Return a row per scene and guess, as for single lines; nodes: of all ropes together.

    Raises:
        SceneError: a scene cannot be loaded or built.
    """
    for name in scenes:
        scene = _finer(load_scene(name), nodes)
        _timed(scene, "as built")  # compiles
        for guess in GUESSES:
            ms, end = min(
                (_timed(scene, guess) for _ in range(REPETITIONS)), key=lambda row: row[0]
            )
            yield asdict(
                StaticsRow(
                    name, nodes, guess, ms, end.rounds, end.residual_n, end.tension_n, end.found
                )
            )


def _finer(scene: Scene, nodes: int) -> Scene:
    """Return the scene with this total number of elements, distributed in proportion."""
    times = nodes / sum(line.elements for line in scene.ropes)
    ropes = (replace(line, elements=max(2, round(times * line.elements))) for line in scene.ropes)
    return replace(scene, ropes=tuple(ropes))


def _timed(scene: Scene, guess: str) -> tuple[float, Equilibrium]:
    """Return milliseconds and result of one solution; ends held by the ship are fixed."""
    built, shape = build_joined(scene), GUESSES[guess]
    joints = built.system.joints
    for r, rope in enumerate(built.system.ropes):
        n = int(rope.state.counts[ELEMENTS])
        place = rope.state.nodes[_PLACE]
        low = 1 if rope.model.first_free and joints.lower[r] == LOOSE else 0
        high = n if joints.upper[r] == LOOSE else n + 1
        place[:, low:high] = shape(place[:, : n + 1])[:, low:high]
    joints.nodes[_PLACE] = shape(joints.nodes[_PLACE])
    held = np.zeros((len(scene.ropes), MOTIONS))
    held[:, :3] = np.nan_to_num(built.hang_off_m)
    held[:, LINE] = [line.length_m for line in scene.ropes]
    began = time.perf_counter()
    end = solve_joined_statics(built.system, held)
    return 1e3 * (time.perf_counter() - began), end


def _coiled(place: Floats) -> Floats:
    angle = place[2] / COIL_M
    x = place[0] + COIL_M * np.cos(angle) - COIL_M
    return np.stack([x, place[1] + COIL_M * np.sin(angle), 0.01 * place[2]])


# Places as built, to those to start from.
GUESSES: dict[str, Callable[[Floats], Floats]] = {
    "as built": lambda place: place,
    "slack": lambda place: np.stack([place[0], place[1], 0.5 * place[2]]),
    "horizontal": lambda place: np.stack([place[0] - place[2], place[1], 0.0 * place[2]]),
    "coiled": _coiled,
    "upside down": lambda place: np.stack([place[0], place[1], -place[2]]),
}

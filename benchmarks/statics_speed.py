"""Time of the static solver for ropes and multi-line systems, from good and bad guesses."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import asdict, dataclass, replace
from typing import Any

import numpy as np

from rope_twin.core.joined.joints import LOOSE
from rope_twin.core.joined.statics import solve_joined_statics
from rope_twin.core.state import ELEMENTS, LINE, MOTIONS, POSITION, Floats
from rope_twin.core.statics import solve_statics
from rope_twin.core.still_rope import Equilibrium
from rope_twin.effects.seabed import SeabedParams
from rope_twin.scene.joined_model import build_joined
from rope_twin.scene.load import load_scene
from rope_twin.scene.rope_model import build
from rope_twin.scene.schema import Scene
from validation.rigs import Rig, with_nothing_below

NODES = 1000
SCENES = ("deep_lift", "hmpe_lift", "storm", "smooth_2km", "slack_5km")
JOINED_SCENES = ("bridle_lift", "two_line_lift")
ON_A_BED = ("moored", "moored slack", "landed", "landed slack")
REPETITIONS = 5
COIL_M = 5.0  # radius
_PLACE = slice(POSITION, POSITION + 3)


@dataclass(frozen=True)
class StaticsRow:
    """One scene and initial guess."""

    scene: str
    nodes: int
    guess: str
    ms: float  # best of REPETITIONS, compiled before
    rounds: int
    residual_n: float  # largest force left on a node
    tension_n: float  # largest tension
    found: bool


def statics_rows(
    scenes: Sequence[str] = SCENES + ON_A_BED, nodes: int = NODES
) -> Iterator[dict[str, Any]]:
    """Return a row per scene and guess, as a dictionary; a fixed lower end remains fixed.

    Besides scenes that are loaded there are ropes ON_A_BED.

    Raises:
        SceneError: a scene cannot be loaded or built.
    """
    for name in scenes:
        scene = _on_a_bed(name) if name in ON_A_BED else load_scene(name)
        line = replace(scene.ropes[0], elements=nodes)
        fine = replace(scene, ropes=(line, *scene.ropes[1:]))
        yield from _rows(name, nodes, fine, GUESSES, _timed)


def joined_statics_rows(
    scenes: Sequence[str] = JOINED_SCENES, nodes: int = NODES
) -> Iterator[dict[str, Any]]:
    """Return a row per multi-line scene and guess; nodes: of all ropes together.

    Raises:
        SceneError: a scene cannot be loaded or built.
    """
    for name in scenes:
        fine = _finer(load_scene(name), nodes)
        yield from _rows(name, nodes, fine, JOINED_GUESSES, _timed_system)


def _rows(
    name: str, nodes: int, scene: Scene, guesses: Iterable[str],
    timed: Callable[[Scene, str], tuple[float, Equilibrium]],
) -> Iterator[dict[str, Any]]:  # fmt: skip
    """Return a row per guess; timed: milliseconds and result of one solution from it."""
    timed(scene, "as built")  # compiles
    for guess in guesses:
        ms, end = min((timed(scene, guess) for _ in range(REPETITIONS)), key=lambda row: row[0])
        row = StaticsRow(
            name, nodes, guess, ms, end.rounds, end.residual_n, end.tension_n, end.found
        )
        yield asdict(row)


def statics_table(rows: Sequence[dict[str, Any]]) -> list[tuple[str, ...]]:
    """Return the rows as text, below a head."""
    head = ("scene", "guess", "nodes", "ms", "rounds", "force left N", "tension kN")
    table: list[tuple[str, ...]] = [head]
    for row in rows:
        residual = f"{row['residual_n']:.1e}" + ("" if row["found"] else ", no rest")
        cells = (f"{row['nodes']}", f"{row['ms']:.1f}", f"{row['rounds']}", residual)
        table.append((row["scene"], row["guess"], *cells, f"{1e-3 * row['tension_n']:.1f}"))
    return table


def _on_a_bed(name: str) -> Scene:
    """Return a rope moored 230 m away in 100 m of water, or one with its payload landed at 400 m.

    Both are slack: the moored rope lies on the seabed for most of its length and without tension
    for a third of it; 50 m of rope lie slack next to the payload.
    """
    if name.startswith("landed"):
        scene = load_scene("landing")
        return replace(
            scene,
            ropes=(replace(scene.ropes[0], length_m=450.0 if "slack" in name else 402.0),),
        )
    rig = Rig(
        length=345.0 if "slack" in name else 300.0, mass=20.0, EA=2e8, diameter=0.05,
        density=1025.0, fixed_at=(230.0, 0.0, -100.0),
    )  # fmt: skip
    effects = rig.scene().effects
    bed = SeabedParams(depth_m=100.0)
    scene = replace(rig.scene(), effects=(*effects[:4], bed, *effects[4:]))
    return with_nothing_below(scene)  # the step of `landing`


def _timed(scene: Scene, guess: str) -> tuple[float, Equilibrium]:
    """Return milliseconds and result of one solution."""
    rope, line = build(scene), scene.ropes[0]
    place = rope.state.nodes[_PLACE, : line.elements + 1]
    first = 1 if line.fixed_at_m is not None else 0
    start = GUESSES[guess](place - place[:, -1:], line.length_m)
    place[:, first:-1] = (start + place[:, -1:])[:, first:-1]
    began = time.perf_counter()
    end = solve_statics(rope, line.length_m)
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


def _on_the_bottom(place: Floats, length: float) -> Floats:
    s = np.linspace(length, 0.0, place.shape[1])
    return np.stack([0.0 * s, s, np.full_like(s, place[2].min())])


# Nodes relative to the hang-off and the rope's length, to nodes relative to the hang-off.
GUESSES: dict[str, Callable[[Floats, float], Floats]] = {
    "as built": _as_built,
    "slack": _slack,
    "horizontal": _horizontal,
    "coiled": _coiled,
    "upside down": _upside_down,
    "on the bottom": _on_the_bottom,
}


def _finer(scene: Scene, nodes: int) -> Scene:
    """Return the scene with this total number of elements, distributed in proportion."""
    times = nodes / sum(line.elements for line in scene.ropes)
    ropes = (replace(line, elements=max(2, round(times * line.elements))) for line in scene.ropes)
    return replace(scene, ropes=tuple(ropes))


def _timed_system(scene: Scene, guess: str) -> tuple[float, Equilibrium]:
    """Return milliseconds and result of one solution; ends held by the ship are fixed."""
    built, shape = build_joined(scene), JOINED_GUESSES[guess]
    joints = built.system.joints
    for r, rope in enumerate(built.system.ropes):
        n = int(rope.state.counts[ELEMENTS])
        place = rope.state.nodes[_PLACE]
        low = 1 if rope.model.first_free and joints.lower[r] == LOOSE else 0
        high = n if joints.upper[r] == LOOSE else n + 1
        place[:, low:high] = shape(place[:, : n + 1])[:, low:high]
    joints.nodes[_PLACE] = shape(joints.nodes[_PLACE])
    boundary = np.zeros((len(scene.ropes), MOTIONS))
    boundary[:, :3] = np.nan_to_num(built.hang_off_m)
    boundary[:, LINE] = [line.length_m for line in scene.ropes]
    began = time.perf_counter()
    end = solve_joined_statics(built.system, boundary)
    return 1e3 * (time.perf_counter() - began), end


def _coiled_around(place: Floats) -> Floats:
    angle = place[2] / COIL_M
    x = place[0] + COIL_M * np.cos(angle) - COIL_M
    return np.stack([x, place[1] + COIL_M * np.sin(angle), 0.01 * place[2]])


# Places as built, to those to start from.
JOINED_GUESSES: dict[str, Callable[[Floats], Floats]] = {
    "as built": lambda place: place,
    "slack": lambda place: np.stack([place[0], place[1], 0.5 * place[2]]),
    "horizontal": lambda place: np.stack([place[0] - place[2], place[1], 0.0 * place[2]]),
    "coiled": _coiled_around,
    "upside down": lambda place: np.stack([place[0], place[1], -place[2]]),
}

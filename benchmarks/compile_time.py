"""JIT compile time of each set of effects: cold start, and warm start from the cache.

A set is what a step is compiled for: the types of everything in a line or multi-line system. Each
is started in a fresh process with an empty cache of its own, and again with that cache. A start
builds the twin from a scene that is already read: arrays, compilation of step and statics, static
equilibrium. Python and numba are loaded before, which takes about a second.

The criterion is CPU time: compilation is single-threaded, so that CPU time is the time of a start
on a free core, and is less disturbed by other programs than wall-clock time.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tempfile
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from rope_twin.core.jit.decorators import kind_of
from rope_twin.errors import RopeTwinError
from rope_twin.scene.joined_model import build_joined
from rope_twin.scene.lift import listed_effects
from rope_twin.scene.load import load_scene, scene_names
from rope_twin.scene.rigging import is_joined
from rope_twin.scene.rope_model import build
from rope_twin.scene.schema import Scene
from validation.case import Listener, announced

COLD_LIMIT_S, WARM_LIMIT_S = 20.0, 1.0
QUICK = ("still_water",)
# What a fresh process does; it tells what it took of the processor and on the clock [s].
_START = """
import json, sys, time
from rope_twin.scene.load import load_scene
from rope_twin.twin.twin import Twin
scene = load_scene(sys.argv[1])
cpu, clock = time.process_time(), time.perf_counter()
Twin(scene)
json.dump([time.process_time() - cpu, time.perf_counter() - clock], sys.stdout)
"""


@dataclass(frozen=True)
class CompileRow:
    """One set of effects."""

    scene: str  # the one that was started
    also: tuple[str, ...]  # scenes of the same set
    effects: tuple[str, ...]
    ropes: int
    cold_s: float  # processor time of the first start
    cold_clock_s: float
    warm_s: float  # of the second
    warm_clock_s: float
    limit_s: float = COLD_LIMIT_S
    warm_limit_s: float = WARM_LIMIT_S

    @property
    def ok(self) -> bool:
        """Return whether both are within their limits."""
        return self.cold_s <= self.limit_s and self.warm_s <= self.warm_limit_s


def compile_rows(scenes: Sequence[str], listen: Listener) -> Iterator[CompileRow]:
    """Return a row for each set among the scenes, as they are measured.

    Raises:
        RopeTwinError: a scene cannot be loaded or started.
    """
    for name, *also in announced(distinct_sets(scenes), listen, lambda names: names[0]):
        scene = load_scene(name)
        with tempfile.TemporaryDirectory() as folder:
            cold, warm = _start(scene, folder), _start(scene, folder)
        effects = tuple(listed_effects(scene))
        yield CompileRow(name, tuple(also), effects, len(scene.ropes), *cold, *warm)


def distinct_sets(scenes: Sequence[str] = ()) -> list[list[str]]:
    """Group the scenes (by default all that come with the package) by set."""
    sets: dict[str, list[str]] = {}
    for name in scenes or scene_names():
        sets.setdefault(step_types(load_scene(name)), []).append(name)
    return list(sets.values())


def compile_table(rows: Sequence[CompileRow]) -> list[tuple[str, ...]]:
    """Return the rows as text, below a head."""
    head = ("scene", "ropes", "effects", "cold s", "clock s", "warm s", "clock s", "")
    table: list[tuple[str, ...]] = [head]
    for row in rows:
        times = (row.cold_s, row.cold_clock_s, row.warm_s, row.warm_clock_s)
        cells = (f"{times[0]:.1f}", f"{times[1]:.1f}", f"{times[2]:.2f}", f"{times[3]:.2f}")
        over_limit = "" if row.ok else f"over {row.limit_s:g} or {row.warm_limit_s:g} s"
        table.append((row.scene, f"{row.ropes}", f"{len(row.effects)}", *cells, over_limit))
    return table


def step_types(scene: Scene) -> str:
    """Return the types that a scene's step is compiled for."""
    if not is_joined(scene):
        return kind_of([build(scene)])
    system = build_joined(scene).system
    return kind_of(["ropes that meet", *system.ropes[0], system.joints, system.sheaves])


def _start(scene: Scene, cache: str) -> tuple[float, float]:
    """Return CPU time and wall-clock time of a start in a fresh process [s]."""
    finished = subprocess.run(
        [sys.executable, "-c", _START, str(scene.path)],
        env={**os.environ, "ROPE_TWIN_CACHE": cache},
        capture_output=True,
        text=True,
        check=False,
    )
    if finished.returncode:
        reason = finished.stderr.strip().rpartition("\n")[2]
        right = f"`rope_twin scene check {scene.path}` may say why"
        raise RopeTwinError(f"scene {scene.name}", f"it did not start: {reason}", right)
    cpu_s, clock_s = json.loads(finished.stdout)
    return float(cpu_s), float(clock_s)

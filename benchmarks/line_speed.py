"""Cost of multi-line systems: of a rope in three parts, and with two of them side by side.

The parts together have the elements of the rope. In a row they form a tree and move as the whole
rope does, which is compared; side by side between two rings they form a loop. A system of 14 km
around one sheave runs by itself, calm and in a sea, with both winches at work. Twins get their
inputs and step in turns; `Twin.advance` alone is timed, by the processor's own time.
"""

from __future__ import annotations

import copy
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
import yaml

from benchmarks.paired import Ratio, ratio_of
from rope_twin.scene.load import load_scene
from rope_twin.scene.schema import Scene
from rope_twin.studies.driven_twin import feed
from rope_twin.twin.twin import Twin
from validation.case import Listener

SCENE = "smooth_2km"
RINGS = ("upper_ring", "lower_ring")
SYSTEMS = ("one rope", "three in a row", "two of three side by side")
LONG, HEAVE = "two_line_14km", {"amplitude_m": 0.3, "period_s": 7.5}


@dataclass(frozen=True)
class Plan:
    """Settings of the benchmark."""

    elements: tuple[int, ...]  # multiples of 4
    rounds: int
    node_steps: int  # of a piece
    settle_s: float
    long_s: tuple[float, float] | None  # LONG: when measuring begins and ends


FULL = Plan(elements=(100, 1000), rounds=60, node_steps=240_000, settle_s=16.0, long_s=(20.0, 60.0))
QUICK = Plan(elements=(40,), rounds=6, node_steps=4_000, settle_s=1.0, long_s=None)


@dataclass(frozen=True)
class LineRow:
    """One system."""

    system: str
    elements: int
    step_s: float
    ns_per_element_step: float  # median
    real_time_factor: float  # likewise
    ratio: Ratio | None  # of its time to that of the one rope in the same round
    difference_pct: float | None  # rms of the top tension, of the rope's standard deviation


def system_of(kind: str, elements: int, folder: Path) -> Scene:
    """Return SCENE with its rope as one of SYSTEMS.

    Raises:
        SceneError: the scene is invalid.
    """
    text = yaml.safe_load(load_scene(SCENE).path.read_text(encoding="utf-8"))
    (rope,), load = text["ropes"], text["payloads"][0]["name"]
    del rope["to"]

    def part(name: str, share: int, upper: str, lower: str) -> dict[str, Any]:
        ends: dict[str, Any] = {"from": upper, "to": lower}
        length: dict[str, Any] = {
            "length_m": rope["length_m"] * share / 4,
            "elements": elements * share // 4,
        }
        return {**copy.deepcopy(rope), "name": name, **length, **ends}

    if kind == SYSTEMS[0]:
        text["ropes"] = [part("rope", 4, "winch", load)]
    elif kind == SYSTEMS[1]:
        text["ropes"] = [
            part("upper", 1, "winch", RINGS[0]),
            part("middle", 2, *RINGS),
            part("lower", 1, RINGS[1], load),
        ]
        text["joints"] = [{"name": ring} for ring in RINGS]
    else:
        text["ropes"] = [
            part("upper", 2, "winch", RINGS[0]),
            part("port", 1, *RINGS),
            part("starboard", 1, *RINGS),
        ]
        text["joints"] = [{"name": RINGS[0], "mass_kg": 100.0}]
        text["payloads"][0]["name"] = RINGS[1]
    path = folder / f"{SYSTEMS.index(kind)}_{elements}.yaml"
    path.write_text(yaml.safe_dump(text, sort_keys=False), encoding="utf-8")
    return load_scene(str(path))


def line_rows(plan: Plan, report: Listener) -> Iterator[LineRow]:
    """Measure the systems; yield the rows.

    Raises:
        RopeTwinError: a scene has no static equilibrium, or a step of it is not finite.
    """
    total = len(plan.elements) + (plan.long_s is not None)
    for done, elements in enumerate(plan.elements):
        report(done, total, f"{elements} elements")
        with TemporaryDirectory() as folder:
            scenes = [system_of(kind, elements, Path(folder)) for kind in SYSTEMS]
            yield from _rows(scenes, elements, plan)
    if plan.long_s is not None:
        report(total - 1, total, LONG)
        yield from _long_rows(*plan.long_s)
    report(total, total, "done")


class _Timed:
    """A twin that is fed as in a run, in pieces; only its own `advance` counts."""

    def __init__(self, scene: Scene, seconds: float, steps: int) -> None:
        self.twin, self._steps, self._took_s = Twin(scene), steps, 0.0
        self._advance = self.twin.advance
        self.twin.advance = self._timed  # type: ignore[method-assign]
        self._running = feed(self.twin, seconds, steps)

    def _timed(self, steps: int) -> None:
        began = time.process_time()
        self._advance(steps)
        self._took_s = time.process_time() - began

    def piece_s(self) -> float:
        """Run a piece; return what a step of it took [s]."""
        next(self._running)
        return self._took_s / self._steps


def _rows(scenes: Sequence[Scene], elements: int, plan: Plan) -> Iterator[LineRow]:
    steps = max(1, plan.node_steps // elements)
    seconds = plan.settle_s + (plan.rounds + 1) * steps * scenes[0].time.step_s
    running = [_Timed(scene, seconds, steps) for scene in scenes]
    twins = [timed.twin for timed in running]
    while twins[0].time_ns < plan.settle_s * 1e9:
        for timed in running:
            timed.piece_s()
    took: list[list[float]] = [[] for _ in twins]
    tension: list[list[float]] = [[] for _ in twins]
    for turn in range(plan.rounds):
        order = range(len(twins)) if turn % 2 == 0 else reversed(range(len(twins)))
        for i in order:
            took[i].append(running[i].piece_s())
            tension[i].append(twins[i].top_tension_n)
    reference_n = np.array(tension[0])
    for kind, twin, times, pull in zip(SYSTEMS, twins, took, tension, strict=True):
        rms_off = float(np.sqrt(np.mean((np.array(pull) - reference_n) ** 2)) / np.std(reference_n))
        ratio = ratio_of(times, took[0])
        yield _row(
            kind, elements, twin, times, ratio, 100.0 * rms_off if kind == SYSTEMS[1] else None
        )


def _long_rows(from_s: float, to_s: float) -> Iterator[LineRow]:
    """Measure LONG between two times, calm and in heave, while both of its winches run."""
    text = yaml.safe_load(load_scene(LONG).path.read_text(encoding="utf-8"))
    with TemporaryDirectory() as folder:
        for label, sea in ((LONG, None), (f"{LONG} in heave", {"heave": HEAVE})):
            path = Path(folder) / "scene.yaml"
            path.write_text(yaml.safe_dump(text | ({"sea_state": sea} if sea else {})), "utf-8")
            scene = load_scene(str(path))
            timed, took = _Timed(scene, to_s, round(1.0 / scene.time.step_s)), []
            while timed.twin.time_ns < to_s * 1e9:
                step_s = timed.piece_s()
                if timed.twin.time_ns > from_s * 1e9:
                    took.append(step_s)
            elements = sum(line.elements for line in scene.ropes)
            yield _row(label, elements, timed.twin, took, None, None)


def _row(
    system: str, elements: int, twin: Twin, step_took_s: Sequence[float], ratio: Ratio | None,
    difference_pct: float | None,
) -> LineRow:  # fmt: skip
    took_s = float(np.median(step_took_s))
    factor = twin.step_s / took_s
    return LineRow(
        system, elements, twin.step_s, 1e9 * took_s / elements, factor, ratio, difference_pct
    )


def line_table(rows: Sequence[LineRow]) -> list[tuple[str, ...]]:
    """Return the table of the results, with its head."""
    table: list[tuple[str, ...]] = [
        ("system", "elements", "step", "ns per element and step", "× real time", "ratio (99 %)",
         "difference of the top tension")
    ]  # fmt: skip
    for row in rows:
        difference = (
            "another system" if row.difference_pct is None else f"{row.difference_pct:.2g} %"
        )
        cost = f"{row.ns_per_element_step:.1f}", f"{row.real_time_factor:.0f}"
        ratio = "-" if row.ratio is None else str(row.ratio)
        step = f"{1e3 * row.step_s:g} ms"
        table.append((row.system, str(row.elements), step, *cost, ratio, difference))
    return table

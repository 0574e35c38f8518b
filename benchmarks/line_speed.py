"""Cost of multi-line systems: of a rope in three parts, and with two of them side by side.

The parts together have the elements of the rope. In a row they form a tree and move as the whole
rope does, which is compared; side by side between two rings they form a loop. Twins are fed with
their scene's sea and step in turns, as in a run; times are the processor's own.
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


@dataclass(frozen=True)
class Plan:
    """Settings of the benchmark."""

    elements: tuple[int, ...]  # multiples of 4
    rounds: int
    node_steps: int  # of a piece
    settle_s: float


FULL = Plan(elements=(100, 1000), rounds=60, node_steps=240_000, settle_s=16.0)
QUICK = Plan(elements=(40,), rounds=6, node_steps=4_000, settle_s=1.0)


@dataclass(frozen=True)
class LineRow:
    """One system."""

    system: str
    elements: int
    step_s: float
    ns_per_element_step: float  # median
    ratio: Ratio  # of its time to that of the one rope in the same round
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
    for done, elements in enumerate(plan.elements):
        report(done, len(plan.elements), f"{elements} elements")
        with TemporaryDirectory() as folder:
            scenes = [system_of(kind, elements, Path(folder)) for kind in SYSTEMS]
            yield from _rows(scenes, elements, plan)
    report(len(plan.elements), len(plan.elements), "done")


def _rows(scenes: Sequence[Scene], elements: int, plan: Plan) -> Iterator[LineRow]:
    twins = [Twin(scene) for scene in scenes]
    steps = max(1, plan.node_steps // elements)
    seconds = plan.settle_s + (plan.rounds + 1) * steps * twins[0].step_s
    running = [feed(twin, seconds, steps) for twin in twins]
    while twins[0].time_ns < plan.settle_s * 1e9:
        for one in running:
            next(one)
    took: list[list[float]] = [[] for _ in twins]
    tension: list[list[float]] = [[] for _ in twins]
    for turn in range(plan.rounds):
        order = range(len(twins)) if turn % 2 == 0 else reversed(range(len(twins)))
        for i in order:
            began = time.process_time()
            next(running[i])
            took[i].append(time.process_time() - began)
            tension[i].append(twins[i].top_pull_n)
    whole = np.array(tension[0])
    for kind, twin, own, pull in zip(SYSTEMS, twins, took, tension, strict=True):
        away = float(np.sqrt(np.mean((np.array(pull) - whole) ** 2)) / np.std(whole))
        yield LineRow(
            kind,
            elements,
            twin.step_s,
            1e9 * float(np.median(own)) / (steps * elements),
            ratio_of(own, took[0]),
            100.0 * away if kind == SYSTEMS[1] else None,
        )


def line_table(rows: Sequence[LineRow]) -> list[tuple[str, ...]]:
    """Return the table of the results, with its head."""
    table: list[tuple[str, ...]] = [
        ("system", "elements", "step", "ns per element and step", "ratio (99 %)",
         "difference of the top tension")
    ]  # fmt: skip
    for row in rows:
        difference = (
            "another system" if row.difference_pct is None else f"{row.difference_pct:.2g} %"
        )
        cost = f"{row.ns_per_element_step:.1f}", str(row.ratio)
        step = f"{1e3 * row.step_s:g} ms"
        table.append((row.system, str(row.elements), step, *cost, difference))
    return table

"""Gain of SIMD lanes, effect by effect: members of one scene in lanes, and the same ones alone.

Two ensembles with equal members take turns on one thread, one of them without lanes; the time is
the processor's own. A row shows the steps that lanes gave up (they leave them to the single-rope
solver), and how many members end with other bits than alone.
"""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass
from functools import reduce
from statistics import median
from typing import Any

import numpy as np

from rope_twin.core.jit.wide import LANES
from rope_twin.effects.line_contact import LineContactParams
from rope_twin.scene.load import load_scene
from rope_twin.scene.schema import Scene
from rope_twin.studies.driven_twin import with_effect
from rope_twin.studies.ensemble import make_plan, variations
from rope_twin.studies.study_design import SEA_OFFSET_S, Variable
from rope_twin.twin.ensemble.ensemble import Ensemble
from validation.case import Listener, announced

SEED = 1


@dataclass(frozen=True)
class Case:
    """A scene, and the effect that it shows."""

    scene: str
    shows: str
    more: tuple[Any, ...] = ()  # parameters of effects that the scene does not list
    members: int = 4 * LANES
    warm_s: float = 10.0  # until the ship's motion has faded in; not measured
    seconds: float = 4.0  # of twin time in each turn
    turns: int = 5

    def __str__(self) -> str:
        """Return scene and effect in words."""
        return f"{self.scene} ({self.shows})"

    def load(self) -> Scene:
        """Return the scene with all effects."""
        return reduce(with_effect, self.more, load_scene(self.scene))


FULL = (
    Case("smooth_2km", "current, weight, drag, added_mass, payload"),
    Case("rov_tether", "fixed lower end"),
    Case("hybrid_lift", "stiffness table"),
    Case("polyester_lift", "dynamic stiffness"),
    Case("landing", "seabed"),
    Case("wave_zone", "waves"),
    Case("splash_zone", "waves, wetting, wind, splash_zone"),
    Case("riser_300m", "bending"),
    Case("viv_in_heave", "wake_oscillator"),
    Case("strouhal_lift", "strouhal_forcing"),
    Case("cable_waves", "travelling_waves"),
    Case("chain_on_bottom", "seabed, bed_friction"),
    Case("moonpool_lift", "hull_contact"),
    Case("active_over_passive_lift", "compensator"),
    Case("tow_with_net", "net"),
    Case("lift_off", "rigid_body, a deck"),
    Case("manifold_lift", "rigid_body, waves, splash_zone, seabed"),
    Case("two_line_lift", "multi-line: a tree"),
    Case("bridle_lift", "multi-line: a loop with a bar"),
    Case("load_transfer", "multi-line: rigid_body"),
    Case("net_screen", "multi-line: net_curtain between them"),
    Case("two_line_loop", "multi-line: over a sheave"),
    Case("two_line_loop", "multi-line: line_contact", (LineContactParams(),)),
    Case("cage_and_clump", "multi-line: payload_contact"),
)
QUICK = (Case("smooth_2km", "quick", (), LANES, 1.0, 1.0, 1),)


@dataclass(frozen=True)
class GainRow:
    """One scene; nanoseconds of processor time are medians over the turns."""

    scene: str
    shows: str
    lanes: int
    members: int
    in_lanes: int
    given_up: float  # share of the steps that lanes left to the single-rope solver
    lanes_ns_per_node_step: float
    alone_ns_per_node_step: float
    gain: float  # median of the turns' ratios
    gain_least: float
    gain_most: float
    failed: int
    unequal: int  # members with another state, in any bit, than without lanes


def gain_rows(
    cases: tuple[Case, ...] = FULL, listen: Listener = lambda done, total, what: None
) -> list[GainRow]:
    """Return a row for each case; `listen` hears of each before it runs, and at the end.

    Raises:
        RopeTwinError: a scene is not there, or cannot be run.
    """
    return [_measure(case.load(), case) for case in announced(cases, listen, str)]


def _measure(scene: Scene, case: Case) -> GainRow:
    axes = [Variable(path="effects.drag.normal", from_=0.95, to=1.05, multiply=True)]
    if scene.sea_state.on_waves is not None:  # such a ship's motion begins with the scene's waves
        axes.append(
            Variable(
                path="effects.waves.jonswap.significant_height_m", from_=0.9, to=1.0, multiply=True
            )
        )
    elif scene.sea_state.moves:
        axes.append(Variable(path=SEA_OFFSET_S, from_=0.0, to=60.0))
    plan = make_plan(axes, case.members, SEED)
    members = variations(scene, plan, case.warm_s + case.turns * case.seconds)
    together = Ensemble(scene, members, threads=1)
    alone = Ensemble(scene, members, threads=1, max_lanes=1)
    together.make_ready()
    together.advance(case.warm_s)
    alone.advance(case.warm_s)
    before = together.lanes()
    turns = [
        (_spent(together, case.seconds), _spent(alone, case.seconds)) for _ in range(case.turns)
    ]
    after = together.lanes()
    steps, given_up = after.steps - before.steps, after.given_up - before.given_up
    elements = sum(line.elements for line in scene.ropes)
    node_steps = case.members * elements * case.seconds / scene.time.step_s
    ratios = [alone_s / together_s for together_s, alone_s in turns]
    return GainRow(
        scene=scene.name,
        shows=case.shows,
        lanes=LANES,
        members=case.members,
        in_lanes=after.members,
        given_up=given_up / max(steps + given_up, 1),
        lanes_ns_per_node_step=1e9 * median(first for first, _ in turns) / node_steps,
        alone_ns_per_node_step=1e9 * median(second for _, second in turns) / node_steps,
        gain=median(ratios),
        gain_least=min(ratios),
        gain_most=max(ratios),
        failed=sum(bool(figures.failure) for figures in together.figures()),
        unequal=sum(not _same(together, alone, k) for k in range(case.members)),
    )


def _spent(ensemble: Ensemble, seconds: float) -> float:
    """Return the processor time of an ensemble's turn [s]."""
    began = time.process_time()
    ensemble.advance(seconds)
    return time.process_time() - began


def _same(together: Ensemble, alone: Ensemble, number: int) -> bool:
    """Return whether motion, tensions and counters of a member are equal to the last bit."""
    max_lanes, expected = together.snapshot(number), alone.snapshot(number)
    names = ("node_position_m", "node_velocity_m_per_s", "node_tension_n", "hang_off_force_n")
    equal = all(np.array_equal(getattr(max_lanes, name), getattr(expected, name)) for name in names)
    # of a multi-line scene
    for rope, expected_rope in zip(max_lanes.ropes, expected.ropes, strict=True):
        equal &= np.array_equal(rope.node_position_m, expected_rope.node_position_m)
        equal &= np.array_equal(rope.element_tension_n, expected_rope.element_tension_n)
    return equal and together.figures()[number] == alone.figures()[number]


def gain_table(rows: Sequence[GainRow]) -> list[list[str]]:
    """Return the rows as cells, the first row being the heads."""
    heads = ["scene", "effects", "members", "in lanes", "steps given up", "ns/node/step", "alone",
             "gain", "range", "equal to alone"]  # fmt: skip
    cells = [
        [
            row.scene,
            row.shows,
            f"{row.members}",
            f"{row.in_lanes}",
            f"{100.0 * row.given_up:.2f} %",
            f"{row.lanes_ns_per_node_step:.0f}",
            f"{row.alone_ns_per_node_step:.0f}",
            f"{row.gain:.2f}",
            f"{row.gain_least:.2f} to {row.gain_most:.2f}",
            f"{row.members - row.unequal} of {row.members}",
        ]
        for row in rows
    ]
    return [heads, *cells]

"""Loads of a lift in a run of a twin, sampled from the solver's arrays.

A snapshot has everything that a console shows, and takes fifteen times as long as a step. What the
criteria of a plan compare are a few loads and positions.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator
from typing import NamedTuple

import numpy as np

from rope_twin.core import state as rows
from rope_twin.core.body.step import pose_of
from rope_twin.core.loads.balance import lower_end_tension
from rope_twin.core.state import Floats, Rope
from rope_twin.scene.rigging import runs_over_sheave
from rope_twin.scene.schema import Scene
from rope_twin.twin.monitors import Chunk, Monitor, TwinView
from rope_twin.twin.regrid import element_tension
from rope_twin.twin.snapshot_builder import body_of, deck_contact


class RopeLoads(NamedTuple):
    """Loads of one rope of a multi-line system."""

    max_n: float  # anywhere now, and at its upper end at every step since the sample before
    lowest_n: float  # tension of its lowest element


class LiftSample(NamedTuple):
    """Loads and positions of a lift at one time."""

    time_s: float
    top_max_n: float  # largest hook load at any step since the sample before
    top_min_n: float  # smallest tension at the first rope's upper end, likewise
    payload_n: float  # at the lower end of the first rope
    min_n: float  # smallest tension of an element of any rope
    ropes: tuple[RopeLoads, ...]  # of every rope
    hang_off_m: Floats  # of the first rope, (3,)
    payload_m: Floats  # (3,)
    offset_m: float  # horizontal distance of the payload from the middle of the hang-offs
    deck: tuple[float, float] | None  # its reaction on a body [N], and that body's clearance [m]

    @property
    def depth_m(self) -> float:
        """Depth of the payload [m]."""
        return -float(self.payload_m[2])


class LiftMonitor(Monitor):
    """Monitor that samples a lift every so many steps, and after the last one."""

    def __init__(self, scene: Scene, from_ship: Collection[str], every: int, last: int) -> None:
        """Sample after every `every` steps up to step `last`.

        from_ship: names of the ropes that leave the ship in a multi-line scene; none for one rope.
        """
        self._every, self._last = every, last
        names = [rope.name for rope in scene.ropes]
        self._hoists = [r for r, name in enumerate(names) if name in from_ship] or [0]
        self._at_sheave = [runs_over_sheave(scene, rope) for rope in scene.ropes]
        self._tops: list[Floats] = []  # since the newest sample, (ropes, steps) each
        self._samples: list[LiftSample] = []

    def take(self) -> Iterator[LiftSample]:
        """Yield the samples since the last call."""
        samples, self._samples = self._samples, []
        yield from samples

    def steps_to_observation(self, view: TwinView) -> int:
        """Return the number of steps until the next sample."""
        return self._every - view.clock.steps % self._every

    def observe(self, view: TwinView, chunk: Chunk) -> None:
        """Record the tensions of the steps just done, and sample if that is due."""
        if not chunk.done:
            return
        self._tops.append(chunk.pulls[:, : chunk.done, rows.PULL].copy())
        if chunk.steps % self._every == 0 or chunk.steps == self._last:
            self._samples.append(self._sample(view, chunk))
            self._tops.clear()

    def _sample(self, view: TwinView, chunk: Chunk) -> LiftSample:
        ropes = (chunk.ropes,) if isinstance(chunk.ropes, Rope) else chunk.ropes.ropes
        tops, time_s = np.concatenate(self._tops, axis=1), chunk.time_ns * 1e-9
        loads, min_n = [], np.inf
        for rope, top, at_sheave in zip(ropes, tops, self._at_sheave, strict=True):
            tension = element_tension(rope)
            min_n = min(min_n, float(tension.min()))
            lowest = tension[-1] if at_sheave else tension[0]
            loads.append(RopeLoads(max(float(tension.max()), float(top.max())), float(lowest)))
        hang_off = chunk.boundary.value[0, chunk.done, : rows.LINE].copy()
        payload, deck = ropes[0].state.nodes[rows.POSITION : rows.POSITION + 3, 0].copy(), None
        body = body_of(view.ropes.lowest(view.rope))
        if body is not None:
            pose = pose_of(body)
            payload, deck = pose.place(body.middle), deck_contact(body, pose)
        middle = np.mean([self._upper_end(ropes[r], r) for r in self._hoists], axis=0)
        return LiftSample(
            time_s=time_s,
            top_max_n=float(tops[self._hoists].max()),
            top_min_n=float(tops[0].min()),
            payload_n=lower_end_tension(view.rope, view.rope.effects, time_s),
            min_n=min_n,
            ropes=tuple(loads),
            hang_off_m=hang_off,
            payload_m=payload,
            offset_m=float(np.hypot(*(payload - middle)[:2])),
            deck=deck,
        )

    def _upper_end(self, rope: Rope, r: int) -> Floats:
        """Return the position of the upper end of rope r [m], (3,)."""
        node = 0 if self._at_sheave[r] else int(rope.state.counts[rows.ELEMENTS])
        return rope.state.nodes[rows.POSITION : rows.POSITION + 3, node]

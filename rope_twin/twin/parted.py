"""Rope in two parts after a cut; the falling part is stepped together with the first rope.

The first rope is the part that still hangs; the two do not interact. The payload at the rope's
lower end is now at that of the lower part; both are in the same water.
"""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise
from typing import Any

import numpy as np

from rope_twin.core import state as rows
from rope_twin.core.energy import Power, Store, SystemBorder, measure
from rope_twin.core.loads.balance import lower_end_tension
from rope_twin.core.state import Boundary, Floats, Rope, State
from rope_twin.core.step import advance
from rope_twin.scene.schema import Scene
from rope_twin.twin.contact import seabed_contact
from rope_twin.twin.other_ropes import OtherRopes
from rope_twin.twin.regrid import element_tension, has_state, state_arrays
from rope_twin.twin.rope_cut import (
    SUBSTEPS,
    boundary_at,
    is_at_end,
    refresh_tension,
    rope_s,
    step_free,
    without_massless_section,
)
from rope_twin.twin.snapshot import BedContact, PayloadShot, Snapshot, SolverHealth, first_rope
from rope_twin.twin.snapshot_builder import RopeShape, rope_shot, shape_from_top
from rope_twin.twin.state import changing_parts

_WHOLE = (0.0, 1.0)


class CutRope(OtherRopes):
    """Both parts of a cut rope."""

    def __init__(self, scene: Scene, first: Rope, lower: Rope) -> None:
        """Take both parts; lower: as `sever` returns it, with the effects of the whole rope."""
        super().__init__(scene, first)
        self._lower = lower
        self._kept, self._kept_lower = first.state.copy(), lower.state.copy()
        self._fresh = True  # no step since the cut
        self._unconverged = 0  # unconverged substeps of the lower part at the last snapshot

    def advance(self, first: Rope, boundary: Boundary, time: float, pulls: Floats) -> int:
        """Advance both parts step by step; neither continues without the other."""
        self.first = first
        self._share_water(first)
        for row in range(len(pulls)):
            now = time + row * first.model.step
            own = Boundary(*(table[row : row + 2] for table in boundary))
            if not self._step_both(first, own, now, pulls[row]):
                return row
        return len(pulls)

    def _step_both(self, first: Rope, border: Boundary, time: float, pull: Floats) -> bool:
        """Advance both by a step, the first in doubling substeps; False: both are unchanged."""
        both = ((self._kept, first.state), (self._kept_lower, self._lower.state))
        for kept, state in both:
            _copy(state, kept)
        carried = state_arrays(first.effects + self._lower.effects)
        carried_then = [one.copy() for one in carried]
        h, lower = first.model.step, self._lower
        parts = SUBSTEPS if self._fresh else _WHOLE
        value, rate = boundary_at(border, parts, h)
        pulls = np.zeros((1, rows.PULL_COLUMNS))
        for k, (begin, end) in enumerate(pairwise(parts)):
            now, piece = time + begin * h, (end - begin) * h
            some = Boundary(value[k : k + 2], rate[k : k + 2])
            upper = first._replace(model=first.model._replace(step=piece))
            falling = lower._replace(model=lower.model._replace(step=piece))
            if not step_free(falling, now) or advance(upper, some, pulls, now, 1) < 1:
                for kept, state in both:
                    _copy(kept, state)
                for one, then in zip(carried, carried_then, strict=True):
                    one[...] = then
                refresh_tension(first, float(border.rate[0, rows.LINE]))
                refresh_tension(lower, 0.0)
                return False
        for _, state in both:  # substeps of the first step count as one step
            state.health[rows.STEPS] -= len(parts) - 2
        self._fresh, pull[:] = False, pulls[0]
        return True

    def complete(self, shot: Snapshot, now_ns: int, effects: tuple[Any, ...]) -> Snapshot:
        """Complete the first rope's snapshot with both parts and the payload of the lower one."""
        lower = without_massless_section(self._lower)
        name = f"{self._scene.ropes[0].name}/lower"
        ends_n = lower_end_tension(lower, effects, now_ns * 1e-9), 0.0
        part = rope_shot(name, lower, ends_n, (float(rope_s(lower)[-1]), 0.0))
        unconverged = int(lower.state.health[rows.SUBSTEPS_UNCONVERGED])
        doubtful = shot.doubtful or unconverged > self._unconverged
        self._unconverged = unconverged
        x, v = (lower.state.nodes[k : k + 3, 0].copy() for k in (rows.POSITION, rows.VELOCITY))
        if shot.body is not None:  # the values are those of the lower part already
            x, v = shot.payload_position_m, shot.payload_velocity_m_per_s
        return replace(
            shot,
            tension_payload_n=float(part.node_tension_n[-1]),
            payload_position_m=x,
            payload_velocity_m_per_s=v,
            ropes=(first_rope(shot, self._scene.ropes[0].name), part),
            payloads=tuple(PayloadShot(one.name, x, v) for one in self._scene.payloads),
            seabed=self._contact(lower),
            solver=_both(shot.solver, lower.state.health),
            doubtful=doubtful,
        )

    def shapes(self, first: Rope, shot: Snapshot) -> tuple[RopeShape, ...]:
        """Return the shapes of both parts."""
        line, (upper, lower) = self._scene.ropes[0], shot.ropes
        fallen = without_massless_section(self._lower)
        return shape_from_top(line, first, upper), shape_from_top(line, fallen, lower, loose=True)

    def changing(self) -> dict[str, Any]:
        """Return the state of the lower part that a restart needs, by name."""
        parts = {name: getattr(self._lower, name) for name in changing_parts(self._lower)}
        kept: dict[str, Any] = {f"lower/{name}": part for name, part in parts.items()}
        kept["lower/model"], kept["rope/model"] = self._lower.model, self.first.model
        kept["lower/effects"], kept["lower/fresh"] = self._lower.effects, self._fresh
        kept["lower/tension"] = element_tension(self._lower)
        return kept

    def take_back(self, values: dict[str, Any], first: Rope) -> None:
        """Remove from `values` what `changing` gave and restore it; first: the first rope now."""
        names = (*changing_parts(self._lower), "model", "effects")
        parts = {name: values.pop(f"lower/{name}") for name in names}
        self.first, self._lower = first, self._lower._replace(**parts)
        element_tension(self._lower)[:] = values.pop("lower/tension")
        self._fresh = values.pop("lower/fresh")

    def lowest(self, first: Rope) -> Rope:
        """Return the lower part, which has the payload."""
        return self._lower

    def measure(self, first: Rope, pull: Floats, speed: float, time: float) -> SystemBorder:
        """Return energy and power of both parts; pull [N], speed [m/s]: of the upper one."""
        self._share_water(first)
        with np.errstate(divide="ignore"):  # the node beyond the free end has zero diameter
            low = measure(self._lower, np.zeros(3), time, 0.0)
        high = measure(first, pull[rows.PULL_X : rows.PULL_Z + 1], time, speed)
        return SystemBorder(
            Store(*(a + b for a, b in zip(low.store, high.store, strict=True))),
            Power(*(a + b for a, b in zip(low.power, high.power, strict=True))),
            (low.elements, high.elements),
            0.0,
        )

    def _share_water(self, first: Rope) -> None:
        """Take over the first rope's effects, except those with own load or internal variables."""
        shared = tuple(
            own if is_at_end(own) or has_state(own) else live
            for own, live in zip(self._lower.effects, first.effects, strict=True)
        )
        if any(own is not now for own, now in zip(self._lower.effects, shared, strict=True)):
            self._lower = self._lower._replace(effects=shared)

    def _contact(self, lower: Rope) -> BedContact | None:
        """Return the seabed contact of both parts; the payload is that of the lower one."""
        high, low, all_of_it = (seabed_contact(rope) for rope in (self.first, lower, self._lower))
        if high is None or low is None or all_of_it is None:
            return None
        return replace(
            low,
            rope_on_bed_m=low.rope_on_bed_m + high.rope_on_bed_m,
            rope_push_n=all_of_it.rope_push_n + high.rope_push_n,  # including the free end
        )


def _copy(source: State, target: State) -> None:
    for mine, other in zip(target, source, strict=True):
        mine[...] = other


def _both(upper: SolverHealth, lower: Any) -> SolverHealth:
    """Return the counts of both parts; steps are the same."""
    return upper._replace(
        solves=upper.solves + int(lower[rows.SOLVES]),
        solves_max_per_stage=max(upper.solves_max_per_stage, int(lower[rows.SOLVES_MAX])),
        substeps=upper.substeps + int(lower[rows.SUBSTEPS]),
        substeps_max_per_step=max(upper.substeps_max_per_step, int(lower[rows.SUBSTEPS_MAX])),
        rejected_substeps=upper.rejected_substeps + int(lower[rows.REJECTED]),
        unconverged_substeps=upper.unconverged_substeps + int(lower[rows.SUBSTEPS_UNCONVERGED]),
    )

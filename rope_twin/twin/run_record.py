"""Record of a run: extremes of the top tension, loads against the limits, and bends.

It takes the tensions of every step, and completes each snapshot by what is observed there.
"""

from __future__ import annotations

import copy
import math
from collections.abc import Mapping
from typing import Any, NamedTuple

from rope_twin.core import state as rows
from rope_twin.core.state import Floats, Rope
from rope_twin.effects.hull_contact import HullContactParams
from rope_twin.scene.grid import is_compensated
from rope_twin.scene.schema import Scene
from rope_twin.twin.contact import hull_contacts, seabed_contact, seabed_of, touchdown_of
from rope_twin.twin.limits import BendMonitor, LoadRecord, LoadRules, watches_bends
from rope_twin.twin.quality import QualityIndex
from rope_twin.twin.ropes import Ropes
from rope_twin.twin.snapshot import Snapshot, amended
from rope_twin.twin.snapshot_builder import (
    Extremes,
    RunStatistics,
    body_of,
    with_body,
    with_compensator,
)
from rope_twin.twin.state import Clock
from rope_twin.twin.validity import ModelRange


class RecordState(NamedTuple):
    """State of a record."""

    run: Extremes
    recent: Extremes
    unconverged: int
    loads: LoadRecord
    bends: BendMonitor | None
    quality: QualityIndex


class RunRecord:
    """Record of a run since its start, and of the time since the newest snapshot."""

    def __init__(self, scene: Scene, ropes: Ropes, pulls: Floats, end_n: float) -> None:
        """Start from static equilibrium.

        pulls: force on the upper end of each rope [N], (ropes, PULL_COLUMNS); end_n: tension at the
        lower end of the first one [N].
        """
        self.run, self.recent = Extremes(), Extremes()
        self.recent.take([float(pulls[0, rows.PULL])])
        self._unconverged = 0  # substeps at the newest snapshot
        self._rules = LoadRules(scene)
        start_n = pulls[:, rows.PULL].tolist()
        start_n[0] += self._rules.supported_n(end_n)
        self._loads = LoadRecord(self._rules, start_n)
        self._has_bed = seabed_of(ropes.first) is not None
        self._has_compensator = is_compensated(scene)
        self._has_hull = scene.listed(HullContactParams) is not None
        self._has_body = body_of(ropes.lowest(ropes.first)) is not None
        self._bends = BendMonitor(scene) if watches_bends(scene) else None
        self._range = ModelRange(scene)
        self.quality = QualityIndex()

    def state(self) -> RecordState:
        """Return its state; the parts are its own."""
        own = self.run, self.recent, self._unconverged, self._loads, self._bends
        return RecordState(*own, self.quality)

    def restore(self, state: RecordState) -> None:
        """Continue with this state."""
        self.run, self.recent, self._unconverged, self._loads, self._bends = state[:5]
        self.quality = state.quality

    def take(self, tensions_n: list[float]) -> None:
        """Add the top tensions after each of the steps just done [N]."""
        self.run.take(tensions_n)
        self.recent.take(tensions_n)

    def extremes(self) -> tuple[Extremes, Extremes]:
        """Return copies of the extremes since the start and since the newest snapshot."""
        return copy.copy(self.run), copy.copy(self.recent)

    def restore_finite(self, then: tuple[Extremes, Extremes]) -> None:
        """Restore earlier extremes if a failed step has left values that are not finite."""
        if not self.run.empty and not math.isfinite(self.run.mean):
            self.run, self.recent = (copy.copy(one) for one in then)

    def statistics(self, clock: Clock) -> RunStatistics:
        """Return the statistics since the start."""
        simulated = clock.time_ns * 1e-9
        factor = simulated / clock.computing_s if clock.computing_s > 0.0 else 0.0
        run = self.run if clock.steps else self.recent
        return RunStatistics(clock.steps, clock.computing_s, factor, run.high, run.mean, run.low)

    def begin_interval(self, unconverged: int) -> None:
        """Start the extremes until the next snapshot; unconverged: substeps since the start."""
        self._unconverged, self.recent = unconverged, Extremes()

    def is_doubtful(self, unconverged: int) -> bool:
        """Return whether substeps have not converged since the newest snapshot."""
        return unconverged > self._unconverged

    def add_contact(self, shot: Snapshot, rope: Rope, ropes: Ropes) -> Snapshot:
        """Add body, compensator, and contact with hull and seabed, if the scene has them."""
        if self._has_body:
            shot = with_body(shot, ropes.lowest(rope))
        if self._has_compensator:
            shot = with_compensator(shot, ropes.lowest(rope))
        if self._has_hull:
            shot = amended(shot, contacts=hull_contacts(rope))
        contact = seabed_contact(rope) if self._has_bed else None
        return shot if contact is None else amended(shot, seabed=contact)

    def add_loads(self, shot: Snapshot, rope: Rope, ropes: Ropes) -> Snapshot:
        """Add touchdown and bends (if the scene has them), loads and limits."""
        added: dict[str, Any] = {}
        bed = seabed_of(rope) if self._has_bed else None
        if bed is not None or self._bends is not None:
            shapes = ropes.shapes(rope, shot)
            if bed is not None:
                found = (touchdown_of(hung, bed) for hung in shapes)
                added["touchdowns"] = tuple(one for one in found if one is not None)
            if self._bends is not None:
                added["bends"] = self._bends.look(shapes, shot.time_s)
        looked = self._loads.look(shot, self._rules, added.get("bends", ()))
        added["strength"], added["breaches"] = looked
        return amended(shot, **added)

    def judge(
        self, shot: Snapshot, effects: tuple[Any, ...], factors: Mapping[str, float]
    ) -> Snapshot:
        """Add the quality indices; arguments as of `ModelRange.outside`."""
        return self.quality.judge(shot, self._range.outside(shot, effects, factors))

"""Loosely coupled VIV model of a scene, and its drag amplification.

`modal_vibration` and `decomposed_force` describe the rope by its modes on a line model of their own
(`coupled_model.py`). At each sampling they advance by the time since the previous one, and the drag
coefficient at the rope's nodes is amplified by the rms of the vibration around them
(core/vortices/drag_growth.py). The rope's inclination and tension then change the modes that the
model finds in its next search.
"""

from __future__ import annotations

import copy
import time
from dataclasses import replace
from functools import singledispatch
from math import sqrt
from typing import Any, NamedTuple, Self

import numpy as np

from rope_twin.core.modes.nodes import along, mean_around
from rope_twin.core.state import ELEMENTS, Boundary, Floats, Rope
from rope_twin.core.vortices.drag_growth import DragGrowth, set_growth
from rope_twin.effects.decomposed_force import DecomposedForceParams
from rope_twin.effects.modal_vibration import ModalVibrationParams
from rope_twin.scene.schema import Scene
from rope_twin.scene.validation.vortices import model_beside, shedding_model, strouhal_number
from rope_twin.twin.results import RopeVibration
from rope_twin.twin.vibration.coupled_model import (
    CoupledModel,
    CoupledModelState,
    force_decomposition_model,
    modal_model,
)
from rope_twin.twin.vibration.sampling import needs_new_interval, sampling_steps, shedding_hz
from rope_twin.viv.decomposed import decomposed
from rope_twin.viv.drag import amplified_drag
from rope_twin.viv.shedding import Lift, Shedding


class VivDragState(NamedTuple):
    """State from which the model resumes."""

    tracker: CoupledModelState
    hz: float
    currents: int
    looked: int
    second: int


class VivDragAmplification:
    """Loosely coupled VIV model of a scene, from a start without vibration.

    Raises:
        InputError: the rope is slack somewhere.
    """

    def __init__(self, scene: Scene, rope: Rope) -> None:
        self.hz, self._currents = 0.0, 0  # vortex frequency of the interval, current profiles
        self._looked, self._second = 0, -1  # step of the last sampling, second of its time
        self._strouhal, self._step_s = strouhal_number(scene), scene.time.step_s
        self._every, self._rarer = sampling_steps(0.0, self._step_s), 1
        params = model_beside(scene)
        self._growth: tuple[float, float] = params.drag_growth
        density = scene.environment.water_density_kg_per_m3
        self.tracker: CoupledModel = _tracker(params, rope, density, shedding_model(scene))
        self._amplification_less_1(rope)  # compile now, not at the first sampling
        self._took_s = self._looked_s = 0.0  # CPU time of the model, and twin time covered

    @property
    def every(self) -> int:
        """Number of steps between two samplings."""
        return self._every

    def steps_to_sampling(self, steps: int) -> int:
        """Return the number of steps left until the next sampling, after `steps` steps."""
        return self._looked + self._every - steps

    def look(self, rope: Rope, boundary: Boundary, steps: int, currents: int) -> None:
        """Advance by the time since the last sampling, and set the drag amplification.

        boundary: row 0 is the present; steps: done by the twin; currents: number of profiles
        accepted.
        """
        began = time.perf_counter()
        since_s = (steps - self._looked) * self._step_s
        self._looked = steps
        self._update_interval(rope, boundary, currents)
        self.tracker.take(rope, since_s, self.hz)
        grown = self._amplification_less_1(rope)
        for own in rope.effects:
            if isinstance(own, DragGrowth):
                set_growth(own, rope.state, grown)
        self._looked_s += since_s
        self._took_s += time.perf_counter() - began

    def coarse_copy(self, rarer: int) -> Self:
        """Return an independent copy that samples `rarer` times less often.

        Its first sampling is at the same time as this one's.
        """
        other = copy.deepcopy(self)
        other.tracker.restrict_searches()
        other._rarer = rarer
        if other.hz > 0.0:
            other._every = rarer * sampling_steps(other.hz, other._step_s)
        return other

    def cut(self, whole: Rope, upper: Rope) -> None:
        """Adapt to a cut: the part left has modes of its own."""
        n, left = (int(rope.state.counts[ELEMENTS]) for rope in (whole, upper))
        self.tracker.cut(min(left / n, 1.0))

    def shot(self, rope: Rope) -> RopeVibration:
        """Return the VIV response at the nodes of the rope."""
        cost_pct = 100.0 * self._took_s / max(self._looked_s, self._step_s)
        amplified = self.drag_amplification(rope)[::-1].copy()
        return replace(self.tracker.shot(rope), drag_amplification=amplified, cost_pct=cost_pct)

    def drag_amplification(self, rope: Rope) -> Floats:
        """Return the drag amplification at the nodes, from the lower end up."""
        return 1.0 + self._amplification_less_1(rope)

    def _amplification_less_1(self, rope: Rope) -> Floats:
        """Return the drag amplification less 1 at the nodes.

        A node takes the mean up to its neighbours, over at least half a wave length to either side.
        The drag of a rope in standing waves is then the same whether the nodes resolve the waves or
        not.
        """
        s, amplitude, half_wave = self.tracker.at_model_nodes()
        grown = amplified_drag(amplitude / sqrt(2.0), self._growth) - 1.0
        at = along(rope)
        return mean_around(at, s, grown, np.interp(at, s, half_wave))

    def kept(self) -> VivDragState:
        """Return the state from which `take_back` resumes."""
        return VivDragState(
            self.tracker.kept(), self.hz, self._currents, self._looked, self._second
        )

    def take_back(self, kept: VivDragState) -> None:
        """Resume from this state."""
        self.tracker.take_back(kept.tracker)
        self.hz, self._currents = kept.hz, kept.currents
        self._looked, self._second = kept.looked, kept.second
        self._every = self._rarer * sampling_steps(self.hz, self._step_s)

    def _update_interval(self, rope: Rope, boundary: Boundary, currents: int) -> None:
        """Adapt the sampling interval to the vortex frequency, once a second."""
        second = int(self._looked * self._step_s + 1e-9)
        if second == self._second:
            return
        self._second = second
        hz = shedding_hz(rope, boundary, self._strouhal)
        if needs_new_interval(hz, self.hz, currents != self._currents):
            self.hz, self._currents = hz, currents
            self._every = self._rarer * sampling_steps(hz, self._step_s)


@singledispatch
def _tracker(params: Any, rope: Rope, density: float, name: str) -> CoupledModel:
    """Return the model of a scene for a rope in static equilibrium."""
    raise TypeError(f"{name} is not computed beside the step")


@_tracker.register
def _modes(params: ModalVibrationParams, rope: Rope, density: float, name: str) -> CoupledModel:
    return modal_model(rope, shedding_of(params, density), name, params.modes_every_s)


@_tracker.register
def _decomposed(
    params: DecomposedForceParams, rope: Rope, density: float, name: str
) -> CoupledModel:
    fixed = params.added_mass
    model = replace(
        decomposed(fixed is None, params.damping_fraction),
        fixed_added_mass=1.0 if fixed is None else fixed,
        band=params.band,
        density=density,
    )
    return force_decomposition_model(rope, model, name, params.modes_every_s)


def shedding_of(params: ModalVibrationParams, density: float) -> Shedding:
    """Return the hydrodynamic properties of the modal model of a scene."""
    return Shedding(
        strouhal=params.strouhal,
        band=params.band,
        density=density,
        viscosity=params.viscosity_m2_per_s,
        structural=params.damping_fraction,
        lift=Lift(*params.lift, *params.lift_at),
    )

"""Learner: the estimator as a task of the worker, with its newest result for the twin's threads."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from typing import Any

import numpy as np

from rope_twin.errors import InputError, SolverError
from rope_twin.estimation import report
from rope_twin.estimation.estimator import BURN_IN_S, LEAST_USED, SPECTRUM_S, Estimator
from rope_twin.estimation.figures import ROPE_FIGURES, check_learnable, factors_of, scene_prior
from rope_twin.estimation.lift_model import LiftModel
from rope_twin.estimation.measured_lift import MeasuredLift
from rope_twin.estimation.worker import Begin, Heave, Input, Motion, Reading
from rope_twin.scene.schema import Scene

KEPT_S = SPECTRUM_S + 2.0 * BURN_IN_S  # of measured series


@dataclass(frozen=True)
class Estimate:
    """Figures after a block; frozen, for any thread."""

    time_s: float  # twin time of the end of the data
    minutes: int
    tared: bool
    figures: tuple[report.FigureEstimate, ...]
    factors: dict[str, float]  # on the scene's figures, without the current
    held: tuple[str, ...]  # figures at the limit of the prior
    left_out: tuple[str, ...]  # why how much of the block was left out, in words

    def rows(self) -> list[dict[str, Any]]:
        """Return the rows of estimate/figures."""
        return [dataclasses.asdict(one) for one in self.figures]

    def words(self) -> str:
        """Return the figures that are learned, in one sentence."""
        known = [one for one in self.figures if one.state == report.LEARNED]
        listed = ", ".join(f"{one.name} {one.value:.4g} {one.unit}" for one in known)
        head = f"after {self.minutes} min"
        if self.left_out:
            head += f" ({'; '.join(self.left_out)})"
        found = f"{head}: {listed or 'no figure is known better than before'}"
        return "; ".join(filter(None, (found, report.held_words(self.held))))


class Learner:
    """Learns from what the worker passes on; `newest` may be read from any thread."""

    def __init__(self, scene: Scene) -> None:
        """Build the estimator's fleet.

        Raises:
            InputError: the scene cannot be learned yet.
            SceneError: it has no static equilibrium.
        """
        check_learnable(scene)
        self._scene = scene
        self._prior = scene_prior(scene)
        self._lift = MeasuredLift(self._prior.pin_noise_n)
        self._model = LiftModel(scene, self._lift)
        self._base = report.base_values(scene)
        self._bias_n = scene.measured.tension.bias
        self._estimator: Estimator | None = None
        self._tared = False
        self._frozen = ""
        self._stands = ""
        self.newest: Estimate | None = None

    @property
    def estimator(self) -> Estimator | None:
        """Estimator, for tasks of the same worker; None: it has not begun."""
        return self._estimator

    @property
    def trouble(self) -> str:
        """Return why nothing is learned at present, or ""."""
        return self._stands or self._frozen

    @property
    def state(self) -> str:
        """Return what the learner does, in words."""
        if self.trouble:
            return self.trouble
        if self._estimator is None:
            return "waiting for the twin"
        if self.newest is None:
            end_s = self._estimator.block_end_s
            return f"collecting; the first minute is learned from at {end_s:.0f} s"
        return self.newest.words()

    def freeze(self, why: str) -> None:
        """Learn no more until `freeze("")`, for a reason in words; call it in the worker."""
        self._frozen = f"frozen: {why}" if why else ""

    def tare(self) -> None:
        """Take the load pin's zero as set with an empty hook; call it in the worker.

        Tension with the zero of before is forgotten.
        """
        self._tared = True
        self._prior = self._prior.tared()
        self._lift.tension.drop_before(np.nextafter(self._lift.tension.newest_s, np.inf))
        if self._estimator is not None:
            self._estimator.tare()

    def take(self, inputs: Input) -> None:
        """Take motion, a reading, or a live state to begin from."""
        if isinstance(inputs, Motion):
            self._lift.heave.add(inputs.time_s, inputs.heave_m, inputs.heave_rate_m_per_s)
            self._lift.line_out.add(inputs.time_s, inputs.line_out_m)
        elif isinstance(inputs, Reading):
            self._lift.tension.add(inputs.time_s, inputs.tension_n - self._bias_n)
            self._lift.counter.add(inputs.time_s, inputs.line_out_m)
        elif isinstance(inputs, Heave):
            self._lift.sensor.add(*inputs)
        elif isinstance(inputs, Begin):
            self._begin(inputs)

    def _begin(self, begin: Begin) -> None:
        """Begin from a live state; figures that were learned before are the prior."""
        belief = None if self._estimator is None else self._estimator.belief
        results = [] if self._estimator is None else self._estimator.results
        state = self._model.begin_live(begin.live)
        self._lift.drop_before(begin.live.time_ns * 1e-9 - 1.0)
        made = Estimator(self._model, self._prior, state, begin.live.time_ns * 1e-9)
        if belief is not None:
            made.belief, made.theta, made.results = belief, belief.mean.copy(), results
        self._estimator, self._stands = made, ""

    def work(self) -> bool:
        """Step the estimator on; return whether it did something."""
        estimator = self._estimator
        if estimator is None:
            return False
        if self.trouble:  # it begins again from a live state, not from the series
            self._lift.drop_before(self._lift.heave.newest_s - KEPT_S)
            return False
        before = len(estimator.results)
        try:
            did = estimator.step()
        except SolverError as error:
            self._stands = f"the rope with the learned figures cannot be stepped ({error})"
            return False
        if len(estimator.results) > before:
            self._publish(estimator)
            self._lift.drop_before(estimator.state_s - KEPT_S)
        return did

    def _publish(self, estimator: Estimator) -> None:
        last = estimator.results[-1]
        advice: dict[str, str] = {}
        if not self._tared:
            action = report.tare_action(estimator.prior, last.posterior)
            advice = report.best_actions(last.posterior, [action])
        factors = factors_of(last.posterior.mean)
        known = [name for name in ROPE_FIGURES if self._base[name] and name != "current"]
        self.newest = Estimate(
            time_s=last.end_s,
            minutes=sum(one.used >= LEAST_USED for one in estimator.results),
            tared=self._tared,
            figures=report.estimates(
                self._base, estimator.prior, last.posterior, advice, last.held
            ),
            factors={name: float(factors[name]) for name in known},
            held=last.held,
            left_out=tuple(report.left_out_words(last)),
        )

    def factors_to_apply(self) -> dict[str, float]:
        """Return the factors on the scene's figures to take over.

        Raises:
            InputError: nothing was learned yet, or a figure is at the limit of its prior.
        """
        newest = self.newest
        if newest is None:
            right = "wait for two minutes of tension, heave and line out"
            raise InputError("learned figures", "nothing was learned yet", right)
        if newest.held:
            what = f"{', '.join(newest.held)} is at the limit of its prior"
            raise InputError("learned figures", what, "check scene, units and signs")
        return newest.factors

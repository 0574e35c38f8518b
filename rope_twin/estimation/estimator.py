"""Estimator of a lift's figures: Gauss-Newton over blocks of a minute, the past as a prior.

A block is compared in means over 0.25 s, and in one mean over all that is left out for slack. Its
rope begins a minute earlier from the state that the figures of then had; its residual covariance
has the error of the heave through the top impedance. Of ropes that carry a load together the means
of all load pins are compared, one pin after the other; a pin that is not measured is missing data.
After each block the covariance grows a little, so that figures may drift, and the state from which
the next block begins is that of the new figures.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from rope_twin.core.state import Floats, Ints
from rope_twin.errors import InputError, SolverError
from rope_twin.estimation.counter_error import CounterErrors, ErrorMemory
from rope_twin.estimation.figures import (
    HEAVE_DELAY,
    HEAVE_ERRORS,
    INDEX,
    Gaussian,
    Prior,
    check_learnable,
    factors_of,
    scene_prior,
    suspended_ropes,
    suspending_winches,
)
from rope_twin.estimation.least_squares import (
    Step,
    Whitening,
    gate,
    gauss_newton_step,
    misfit,
)
from rope_twin.estimation.lift_model import ExpectedMotion, LiftModel, Prediction
from rope_twin.estimation.measured_lift import MEAN_S, Bools, MeasuredLift
from rope_twin.estimation.noise import (
    BANDS,
    FREQUENCY_HZ,
    SHARE_BANDS,
    Complexes,
    ExpectedHeave,
    ResidualNoise,
    heave_spectra,
    heave_spectrum,
    pin_autocovariances,
    share_autocovariances,
    top_impedance,
)
from rope_twin.estimation.slack import SlackMean, slack_mean
from rope_twin.scene.load import Change, change_scene
from rope_twin.scene.schema import Scene
from rope_twin.twin.ensemble.fleet import FleetState


@dataclass(frozen=True)
class Innovation:
    """Residual of the last block before it is assimilated, with what explains it to first order."""

    time_s: Floats  # (k,) middles of the intervals of the means
    residual_n: Floats  # (pins·k,) measured less predicted; NaN: missing
    columns: Mapping[str, Floats]  # (pins·k,) J of each figure and sensor parameter


@dataclass(frozen=True)
class _Linearisation:
    """Prediction of a block to first order about θ and n errors of the line counter.

    Its k rows are those of all load pins.
    """

    names: tuple[str, ...]  # of θ
    theta: Floats  # (figures + n,)
    residual: Floats  # (k,) measured less predicted [N]; NaN: missing, or a rope is slack
    jacobian: Floats  # (k, figures + n)
    covariance: Floats  # R, (k, k) [N²]
    autocovariances: Floats  # of its octaves, (BANDS, pins, pins, k/pins) [N²]
    with_slack: Floats  # residual, (k,) [N]; NaN: missing
    slack: SlackMean | None  # over the samples that only `with_slack` has

    def compared(self, slack: SlackMean | None, prior: Gaussian) -> tuple[Floats, Floats, Floats]:
        """Return residual, Jacobian and covariance, with a mean over slack as one more row.

        That is independent of the others: its weights are small near them.
        """
        if slack is None:
            return self.residual, self.jacobian, self.covariance
        row, variance = slack.row(self.jacobian, prior, self.names)
        covariance = np.pad(self.covariance, (0, 1))
        covariance[-1, -1] = variance
        residual = np.append(self.residual, slack.of(self.with_slack))
        return residual, np.vstack([self.jacobian, row]), covariance


@dataclass(frozen=True)
class _SearchResult:
    """Result of the Gauss-Newton search from one start."""

    linear: _Linearisation  # the last linearisation
    used: Floats  # (k,) 1: the mean passed the gate
    step: Step | None  # the last one; None: nothing passed the gate
    nis: float  # normalised innovation squared of what is left, over its number; NaN: nothing used
    residual: Floats  # (k,) after the step [N]

    @property
    def explains(self) -> bool:
        """Return whether what is left is as small as the noise lets one expect."""
        return self.nis < POOR_NIS


BLOCK_S, BURN_IN_S = 60.0, 60.0
MAX_ITERATIONS, MAX_HALVINGS = 20, 3
MAX_STEP_SDS = 1.5  # a figure moves at most so many prior standard deviations in one step
ENOUGH = 0.05  # gain of a step in -ln of the posterior density that is no worth another one
DRIFT = 0.02  # growth of each standard deviation over √(1 min), in prior standard deviations
POOR_NIS = 3.0  # of figures that do not explain a block; of truths that were found it is 0.8 to 1.9
PERIOD_STARTS_SDS = -1.5, -1.0, -0.5, 0.5, 1.0, 1.5  # of ln(stiffness/mass), in standard deviations
MIN_USED = 0.2  # share of a block's means to learn from it; at 1 Hz a quarter is there
SPECTRUM_S = 240.0  # of heave for the linearised drag
SPECTRUM_INTERVAL_S = 0.05
BEFORE_S = 30.0  # of heave before the burn-in, from which it is estimated too
SPEEDS = 30  # of the line in a block, for the same
SPARE_HEAVE_S = 0.25  # beyond the delay, so that its lane has heave at the end of a block
SAME_LENGTH_M = 0.01  # a measured line out that is the scene's
SEGMENT_STEPS = 300  # of the members at a time, whole means
RINGING_S = 40.0  # before a block, in which an error of the line still rings in it
MAX_KNOTS = 200  # a line that is hardly ever steady has errors that are noise
MIN_ERROR = 0.3  # of the white noise that errors of the line must be, or they are left out


@dataclass(frozen=True)
class BlockResult:
    """State of knowledge after a block."""

    end_s: float
    posterior: Gaussian
    used: float  # share of the block's means that were used, of the load pins that are measured
    nis: float  # normalised innovation squared of the residual that is left, over its number; NaN:
    # no mean was used
    at_limit: tuple[str, ...]  # figures at the limit of what the prior allows
    near: float  # share of the means left out with the payload near the surface or the seabed
    stopped: float  # share of the tension left out at an end of a load pin's range
    used_of_pins: tuple[float, ...] = ()  # share of the means of each load pin that was used


class Estimator:
    """Learns the figures of one lift, block by block."""

    def __init__(self, model: LiftModel, prior: Prior, state: FleetState, begin_s: float) -> None:
        """Begin with a prior; state: of the rope at a time [s], a minute before the first block."""
        self.prior = prior
        self.belief = prior.gaussian  # before the next block
        self.theta = prior.mean.copy()
        self.results: list[BlockResult] = []
        self.noise: ResidualNoise | None = None
        self.innovation: Innovation | None = None  # of the last block, before it was assimilated
        self.model = model
        self.state, self.state_s = state, begin_s
        self._running: Prediction | None = None
        self._memory = ErrorMemory(len(prior.names))
        for winch, size in prior.ranges.items():
            model.lift.others[winch].pin_noise_n = model.lift.pin_noise_n * size
        self._errors: CounterErrors | None = None  # of the line counter in the present block
        self._places: Ints = np.empty(0, np.int64)  # of its knots in the memory

    @property
    def block_begin_s(self) -> float:
        """Time at which the next block begins [s]."""
        return self.state_s + BURN_IN_S

    @property
    def block_end_s(self) -> float:
        """Time at which the next block ends [s]."""
        return self.block_begin_s + BLOCK_S

    @property
    def heave_ahead_s(self) -> float:
        """How far the heave must be known beyond the end of a block [s]."""
        delay = self.theta[INDEX[HEAVE_DELAY]] + 4.0 * self.prior.sd[INDEX[HEAVE_DELAY]]
        return max(float(delay), 0.0) + SPARE_HEAVE_S

    def tare(self) -> None:
        """Take the load pins' zeros as set now: a bias is 0 within the uncertainty of a tare."""
        self.prior = self.prior.tared()
        self.belief = self.prior.with_tare(self.belief)
        self._memory = ErrorMemory(len(self.prior.names))
        self.theta = self.belief.mean.copy()
        self._running = None

    def step(self) -> bool:
        """Do a small part of the work on the next block, if its data are there; return whether.

        Raises:
            SolverError: the rope with the present figures cannot be stepped.
        """
        known_s = self.model.lift.known_until_s(self.heave_ahead_s)
        if known_s < self.block_end_s - 1e-6:
            return False
        if self._running is None:
            motion = self._expected_motion()
            self._running = self.model.begin(self.theta, self.state, self.state_s, motion)
        end_s = min(self._running.end_s + SEGMENT_STEPS * self.model.step_s, self.block_end_s)
        self.model.extend(self._running, end_s)
        if self._running.end_s >= self.block_end_s - 1e-6:
            self._assimilate(self._running)
            self._running = None
        return True

    def run(self, until_s: float = np.inf) -> list[BlockResult]:
        """Learn from all data that are there, up to blocks that end by a time; return new results.

        Raises:
            SolverError: the rope with the present figures cannot be stepped.
        """
        before = len(self.results)
        while self.block_end_s <= until_s + 1e-6 and self.step():
            pass
        return self.results[before:]

    def _measured_psd(self, end_s: float) -> Floats:
        """Return the spectrum of the measured heave before a time [s]."""
        heave = self.model.lift.heave_grid(end_s - SPECTRUM_S, end_s, SPECTRUM_INTERVAL_S)
        return heave_spectrum(heave, SPECTRUM_INTERVAL_S)

    def _expected_motion(self) -> ExpectedMotion:
        """Return heave and line without their errors over burn-in and block."""
        end_s = self.block_end_s + self.heave_ahead_s
        begin_s = self.state_s - BEFORE_S
        times, heave = self.model.lift.heave.table[:, :2].T
        first, behind = np.searchsorted(times, (begin_s - 1.0, end_s + 1.0))
        window = slice(max(first - 1, 0), behind + 1)  # with the ends of a hole that is longer
        psd, error_m = self._measured_psd(end_s), self.prior.learning.heave_error_m
        expected = ExpectedHeave(times[window], heave[window], begin_s, end_s, psd, error_m)
        line, *further_lines = (
            rope.line_track(self.state_s, self.block_end_s, straight=True)
            for rope in self.model.lift.ropes
        )
        lines = dict(zip(self.model.winches, further_lines, strict=True))
        return ExpectedMotion(expected, line, lines)

    def autocovariances(self, count: int, end_s: float, *, estimated: bool = True) -> Floats:
        """Return those of the top motion's error as tensions by octaves [N²].

        They are those of the present figures, (bands, pins, pins, count). estimated: of ropes that
        are driven by the expected heave; False: by the measured one.
        """
        measured = self._measured_psd(end_s)
        impedance = self._impedance(self.theta, end_s, measured)
        return self._autocovariances(impedance, self.theta, end_s, measured, count, estimated)

    def _autocovariances(
        self, impedance: Complexes, theta: Floats, end_s: float, measured: Floats, count: int,
        estimated: bool,
    ) -> Floats:  # fmt: skip
        levels = theta[[INDEX[name] for name in HEAVE_ERRORS]]
        spectra = heave_spectra(measured, self.prior.learning.heave_error_m, levels)
        error = spectra.left if estimated else spectra.error
        if not estimated or self._errors is None:
            lines = (one.line_error_psd(end_s - BLOCK_S, end_s) for one in self.model.lift.ropes)
            error = error + max(lines)
        of_heave = pin_autocovariances(impedance, error, count, MEAN_S)
        bars, EA = self.model.bars, float(factors_of(theta)["axial_stiffness"])
        stiff = np.array([EA / float((one.length_m / one.EA_n).sum()) for one in bars])
        return np.concatenate([of_heave, share_autocovariances(stiff, measured, count, MEAN_S)])

    def _impedance(self, theta: Floats, end_s: float, measured: Floats) -> Complexes:
        """Return the top impedance of each rope with figures θ in the block that ends then.

        They are (pins, frequencies). measured: spectrum of the heave [m²/Hz].
        """
        times = end_s - BLOCK_S + np.arange(SPEEDS) * BLOCK_S / SPEEDS
        factors = {name: float(value) for name, value in factors_of(theta).items()}
        impedances = []
        for rope, bars in zip(self.model.lift.ropes, self.model.bars, strict=True):
            line, speed = rope.line_motion(times)
            bar = bars.at_length(float(line[SPEEDS // 2])).with_factors(factors)
            impedances.append(top_impedance(bar, FREQUENCY_HZ, measured, speed))
        return np.array(impedances)

    def _take_counts(self, count: int) -> None:
        """Take the errors of the line counter over the present block, if they matter.

        Those of several counters are noise: each moves the load between the ropes.
        """
        assert self.noise is not None
        begin_s, alone = self.block_begin_s - RINGING_S, not self.model.winches
        passages = self.model.lift.passages(begin_s, self.block_end_s) if alone else []
        errors = CounterErrors.of(passages)
        self._errors, self._places = None, np.empty(0, np.int64)
        if 0 < len(errors.keys) <= MAX_KNOTS:
            psd = self._measured_psd(self.block_end_s)
            impedance = self._impedance(self.theta, self.block_end_s, psd)
            columns = errors.columns(impedance[0], self.block_begin_s, count)
            size = np.linalg.norm(columns, axis=0)
            if (size * errors.sd_m).max() > MIN_ERROR * self.noise.white_n[0]:
                self._errors = errors
        if self._errors is None:
            self._memory = ErrorMemory(len(self.prior.names))
        else:
            self._places = self._memory.take(errors)

    def _assimilate(self, prediction: Prediction) -> None:
        """Learn from the block whose end a prediction with the present figures has reached."""
        begin_s, end_s = self.block_begin_s, self.block_end_s
        lift, pins, figures = self.model.lift, len(self.model.pins), len(self.prior.names)
        measured, samples = lift.means_of_pins(begin_s, end_s)
        known = np.isfinite(measured)
        measured = self.model.in_open_water(prediction, begin_s, measured)
        left_out = self.share(known & np.isnan(measured))
        if self.noise is None:
            sizes = np.array([1.0, *self.prior.ranges.values()])
            pin_n = self.prior.pin_noise_n * sizes / np.sqrt(samples)
            rounding_n = np.array([one.rounding_n(begin_s, end_s) for one in lift.ropes])
            bands = BANDS + (SHARE_BANDS if pins > 1 else 0)
            self.noise = ResidualNoise(np.hypot(pin_n, rounding_n), bands)
        count = len(measured) // pins
        self._take_counts(count)
        joint = self._memory.with_errors(self.belief)
        first = self._linearise(prediction, measured, joint.mean[figures:])
        middles_s: Floats = np.asarray(begin_s + MEAN_S * (np.arange(count) + 0.5), float)
        columns = dict(zip(self.prior.names, first.jacobian.T, strict=False))
        self.innovation = Innovation(middles_s, first.residual, columns)
        posterior, used, nis = joint, np.isfinite(first.residual), np.nan
        at_limit = self.prior.at_limit(self.theta)
        if self.share(used) >= MIN_USED or first.slack is not None:
            posterior, used, nis, at_limit = self._learn(first, joint, measured, prediction.motion)
        self._memory.learn(posterior)
        of_figures = slice(figures)
        posterior = Gaussian(
            posterior.mean[of_figures], posterior.covariance[of_figures, of_figures]
        )
        stopped = max(one.stopped_share(begin_s, end_s) for one in lift.ropes)
        of_pins = tuple(used.reshape(pins, -1).mean(axis=1).tolist())
        self.results.append(
            BlockResult(
                end_s, posterior, self.share(used), nis, at_limit, left_out, stopped, of_pins
            )
        )
        growth = np.diag((DRIFT * self.prior.sd) ** 2) * BLOCK_S / 60.0
        self.belief = Gaussian(self.theta.copy(), posterior.covariance + growth)
        motion = prediction.motion
        self.state = self.model.state_at(self.theta, self.state, self.state_s, begin_s, motion)
        self.state_s = begin_s

    def share(self, rows: Floats | Bools) -> float:
        """Return the share of the means of the load pins that were ever measured, (pins·k,)."""
        measured = [len(rope.tension.table) > 0 for rope in self.model.lift.ropes]
        return float(rows.reshape(len(measured), -1)[measured].mean()) if any(measured) else 0.0

    def _linearise(
        self, prediction: Prediction, measured: Floats, errors_m: Floats
    ) -> _Linearisation:
        """Return what a prediction of the present block leaves of the measured means.

        errors_m: of the line counter, (n,).
        """
        assert self.noise is not None
        begin_s, end_s, theta = self.block_begin_s, self.block_end_s, prediction.theta
        pins, psd = len(self.model.pins), self._measured_psd(end_s)
        count = len(measured) // pins
        taut = self.model.without_slack(prediction, begin_s, measured)
        predicted, J = self.model.linearised(prediction, begin_s)
        impedance = self._impedance(theta, end_s, psd)
        colours = self._autocovariances(impedance, theta, end_s, psd, count, estimated=True)
        R = self.noise.covariance(colours)
        A = np.zeros((len(measured), len(errors_m)))
        if self._errors is not None:
            of_knots = self._errors.columns(impedance[0], begin_s, count)
            np.add.at(A.T, self._places, of_knots.T)
            predicted = predicted + A @ errors_m
        slackened = np.isfinite(measured) & np.isnan(taut)
        left_out = np.asarray(slackened.reshape(pins, count).all(axis=0))
        of_sum = R.reshape(pins, count, pins, count).sum(axis=(0, 2))
        slack = slack_mean(left_out, of_sum, self.model.hanging_kg(theta), psd, pins)
        return _Linearisation(
            self.prior.names, np.append(theta, errors_m), taut - predicted, np.hstack([J, A]), R,
            colours, measured - predicted, slack,
        )  # fmt: skip

    def _learn(
        self,
        first: _Linearisation,
        joint: Gaussian,
        measured: Floats,
        motion: ExpectedMotion | None,
    ) -> tuple[Gaussian, Floats, float, tuple[str, ...]]:
        """Move θ to its posterior mean; return the posterior, the used samples, NIS and limits.

        joint: θ and the errors of the line counter before the block. The limits are the names of
        figures that the best fit has at a limit of the prior.

        Until a block has been explained, the search also begins from other natural periods where
        the present figures lead to none that explain it, and the better result counts. Of a block
        that no figures explain the share 1/NIS is believed, as of noise that large (Birge 1932).
        """
        assert self.noise is not None
        fit = self._fit(first, joint, measured, motion)
        is_enough = self.share(np.isfinite(first.residual)) >= MIN_USED
        was_explained = any(result.nis < POOR_NIS for result in self.results)
        if is_enough and not fit.explains and not was_explained:
            start = self._best_period(first, joint, measured, motion)
            if start is not first:
                retry = self._fit(start, joint, measured, motion)
                fit = (fit, retry)[self._best([fit.linear, retry.linear], joint)]
        if np.isfinite(fit.nis):
            self.noise.learn(fit.residual, fit.used, fit.linear.autocovariances)
        if fit.step is None:
            self.theta = self.belief.mean.copy()
            return joint, fit.used, fit.nis, self.prior.at_limit(self.theta)
        share = 1.0 / fit.nis if fit.nis >= POOR_NIS else 1.0
        posterior = fit.step.posterior_of(share, joint)
        figures = slice(len(self.prior.names))
        self.theta = posterior.mean[figures].copy()
        return posterior, fit.used, fit.nis, self.prior.at_limit(fit.step.theta[figures])

    def _fit(
        self,
        linear: _Linearisation,
        joint: Gaussian,
        measured: Floats,
        motion: ExpectedMotion | None,
    ) -> _SearchResult:
        """Search the posterior mean of θ and the errors of the line counter from one start.

        Steps are taken from new linearisations until one promises no more than ENOUGH. One that
        makes the posterior density smaller is halved. Where the gate leaves less than MIN_USED,
        nothing is learned but from the mean over slack.
        """
        figures = len(self.prior.names)
        free = np.full(len(joint.mean) - figures, np.inf)  # errors of the line have no limits
        count = len(measured)
        for iteration in range(MAX_ITERATIONS):
            residual, jacobian, covariance = linear.compared(linear.slack, joint)
            offset = np.zeros(len(residual))
            if iteration == 0 and np.isfinite(linear.residual).any():
                offset[:count] = np.nanmedian(linear.residual)
            used = gate(residual - offset, covariance, jacobian, joint)
            share = used[:count].copy()
            if self.share(share) < MIN_USED:
                used[:count] = False
            if not used.any():
                return _SearchResult(linear, share, None, np.nan, residual[:count])
            whiten = Whitening(covariance, used)
            reach, theta = MAX_STEP_SDS * self.prior.sd, linear.theta[:figures]
            step = gauss_newton_step(
                linear.theta, joint, residual, jacobian, whiten, robust=iteration > 0,
                least=np.append(self.prior.within(theta - reach), -free),
                most=np.append(self.prior.within(theta + reach), free),
            )  # fmt: skip
            if iteration > 0 and step.gain < ENOUGH:
                break
            better = self._better(linear, step.theta - linear.theta, joint, used, measured, motion)
            if better is None:
                break
            linear = better
        remaining = residual - jacobian @ (step.theta - linear.theta)
        number = int(used[:count].sum())
        whitened = whiten(remaining)[:number]
        nis = float(whitened @ whitened) / number if number else np.nan
        return _SearchResult(linear, share, step, nis, remaining[:count])

    def _best_period(
        self,
        first: _Linearisation,
        joint: Gaussian,
        measured: Floats,
        motion: ExpectedMotion | None,
    ) -> _Linearisation:
        """Return the linearisation of the best of several ratios of stiffness to mass.

        A short rope rings with its natural period. Once the period of the figures is a tenth off,
        the two drift apart by a whole cycle in a block, and the misfit has minima in between.
        """
        figures, starts = len(self.prior.names), [first]
        stiff, mass = INDEX["axial_stiffness"], INDEX["oscillating_mass"]
        P = joint.covariance
        with_ratio = P[:, stiff] - P[:, mass]
        ratio_sd = np.sqrt(with_ratio[stiff] - with_ratio[mass])
        for ratio_sds in PERIOD_STARTS_SDS:
            theta = first.theta + ratio_sds * with_ratio / ratio_sd
            theta[:figures] = self.prior.within(theta[:figures])
            try:
                prediction = self.model.predict(
                    theta[:figures], self.state, self.state_s, self.block_end_s, motion
                )
            except SolverError:  # figures so far off cannot be stepped
                continue
            starts.append(self._linearise(prediction, measured, theta[figures:]))
        return starts[self._best(starts, joint)]

    def _best(self, candidates: Sequence[_Linearisation], joint: Gaussian) -> int:
        """Return which has the highest posterior density, by the means that all of them have.

        The first one where these are less than MIN_USED.
        """
        common = np.asarray(np.isfinite([one.residual for one in candidates]).all(axis=0), float)
        if self.share(common) < MIN_USED:
            return 0
        whiten = Whitening(candidates[0].covariance, common)
        return int(
            np.argmin([misfit(one.theta, joint, whiten(one.residual)) for one in candidates])
        )

    def _better(
        self, linear: _Linearisation, change: Floats, joint: Gaussian, used: Floats,
        measured: Floats, motion: ExpectedMotion | None,
    ) -> _Linearisation | None:  # fmt: skip
        """Return the linearisation after a change, or as small a part of it as is an improvement.

        None: even an eighth of it is none.
        """
        count, figures = len(measured), len(self.prior.names)
        before, _, covariance = linear.compared(linear.slack, joint)
        for halved in range(1 + MAX_HALVINGS):
            theta = linear.theta + 0.5**halved * change
            prediction = self.model.predict(
                theta[:figures], self.state, self.state_s, self.block_end_s, motion
            )
            new = self._linearise(prediction, measured, theta[figures:])
            after, _, _ = new.compared(linear.slack, joint)
            both = used & np.isfinite(after)  # neither is slack
            if used[:count].any() and self.share(both[:count]) < MIN_USED:
                continue
            whiten = Whitening(covariance, both)
            lower = misfit(new.theta, joint, whiten(after))
            if lower < misfit(linear.theta, joint, whiten(before)):
                return new
        return None


def begin_at_rest(scene: Scene, lift: MeasuredLift, *, tared: bool = False) -> Estimator:
    """Return an estimator of measured series that begin with the rope at rest.

    The rope begins with the measured line out. Its first block begins a minute later.

    Raises:
        InputError: the scene cannot be learned yet, or the series are empty.
        SceneError: the measured line out is not possible in this scene.
    """
    check_learnable(scene)
    for winch in suspending_winches(scene):
        lift.others.setdefault(winch, MeasuredLift(np.nan))
    begin_s = lift.begin_s
    if not np.isfinite(begin_s):
        problem = "tension, heave or line out has no sample"
        raise InputError("measured lift", problem, "give all three")
    changes = []
    for r, winch in zip(suspended_ropes(scene), ("", *suspending_winches(scene)), strict=True):
        winch_lift = lift.others[winch] if winch else lift
        length_m = float(winch_lift.line_motion(np.array([begin_s]))[0][0])
        if abs(length_m - scene.ropes[r].length_m) > SAME_LENGTH_M:
            changes.append(Change(f"ropes[{r}].length_m", length_m))
    scene = change_scene(scene, changes) if changes else scene
    prior = scene_prior(scene, tared)
    lift.pin_noise_n = prior.pin_noise_n
    model = LiftModel(scene, lift)
    return Estimator(model, prior, model.begin_at_rest(begin_s), begin_s)

"""Inputs of a twin, accepted from any thread: motion, commands, current, cuts, measurements.

Current profiles are validated on arrival and applied at a step boundary. The score of a forecaster,
which runs elsewhere, drives nothing: it comes through the twin's inputs so that a replay has the
same quality index.
"""

from __future__ import annotations

import math
import threading
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rope_twin.effects.current import Current, RisingCurrent, from_rows, profile_of, with_profile
from rope_twin.errors import did_you_mean, phrase
from rope_twin.quantity import or_nan, or_none
from rope_twin.scene.environment import (
    DEEPEST_ROW_M,
    MIN_ROW_SPACING_M,
    SHEAR_LIMIT_PER_S,
    steepest_shear,
)
from rope_twin.scene.rigging import is_joined, winches_by_name
from rope_twin.scene.schema import WINCH, Scene
from rope_twin.scene.water_warnings import strong_current
from rope_twin.twin.cut_input import CutInput
from rope_twin.twin.figures import RAMP_S, FigureBase, LearnedFigures
from rope_twin.twin.health import InputCounter
from rope_twin.twin.motion.hang_off import HangOffTrack
from rope_twin.twin.motion.heave_track import LowerEndTrack
from rope_twin.twin.motion.ship_motion import ShipPose
from rope_twin.twin.multi_line import OtherRopes
from rope_twin.twin.readings import Measurement
from rope_twin.twin.residuals import MeasuredInputs
from rope_twin.twin.snapshot import BORDER, ForecastScore, InputHealth, Snapshot, amended
from rope_twin.twin.state import Clock
from rope_twin.twin.validity import SceneMotion, StudyValidity
from rope_twin.twin.winch.commands import WinchCommand
from rope_twin.twin.winch.winch import Winch, winch_of_rope

FIGURES_INPUT = "figures"
MAX_CURRENT_M_PER_S = 10.0
MAX_ROWS = 1000  # more would slow every step, and no current meter has them
CURRENT_JUMP_M_PER_S = 0.5  # a larger change of the profile anywhere is accepted with a warning
SCORE_TIMEOUT_S = 60.0  # without a new score for this time, no forecast runs
MAX_FORECASTS_JUDGED = 1_000_000


class InputState(NamedTuple):
    """State of the inputs, by the names of their attributes."""

    heave: HangOffTrack
    winch: Winch
    current: CurrentInput
    cut: CutInput
    validity: StudyValidity
    profiles: int
    measured: MeasuredInputs
    border: InputCounter
    figures: LearnedFigures
    forecast: ForecastInput
    lower_end: LowerEndTrack | None


class TwinInputs:
    """Inputs of a twin behind one lock; each `submit_*` method validates its input.

    The stepping thread reads the inputs under `lock`.
    """

    def __init__(self, scene: Scene, ropes: OtherRopes, clock: Clock) -> None:
        """Make the inputs of a scene; `clock` is that of the twin, which advances it."""
        self.lock = threading.Lock()
        self.heave = HangOffTrack(scene)
        self.winch = winch_of_rope(scene, scene.ropes[0])
        self.current = CurrentInput(ropes.first.effects)
        self.cut = CutInput(scene)
        self.measured = MeasuredInputs(scene)
        self.border = InputCounter(BORDER)  # warnings on inputs that did not reach the twin
        self.figures = LearnedFigures()
        self.forecast = ForecastInput()
        self.lower_end = LowerEndTrack(scene) if scene.ropes[0].is_led else None
        self._base = FigureBase(ropes.first)
        self.validity = StudyValidity(scene)
        self._digest = self.validity.digest  # a run may resume in a scene with another schedule
        self.profiles = 0  # current profiles accepted before the newest step
        self.ropes = ropes  # with the winches of the other ropes
        self._clock = clock
        self._winch_names, self._lines = tuple(winches_by_name(scene)), scene.ropes
        first_rope_name = () if is_joined(scene) else (scene.ropes[0].name,)
        self._first_winch_names = ("", WINCH, *first_rope_name)
        self.scene_motion: SceneMotion | None = None  # reference for the accepted motion
        self._judges_motion, self.motion_judged = True, False

    def state(self) -> InputState:
        """Return the inputs' state; its parts are the inputs themselves."""
        return InputState(**{name: getattr(self, name) for name in InputState._fields})

    def restore(self, state: InputState) -> None:
        """Continue with the inputs of a state."""
        vars(self).update(state._asdict())
        self._apply_figures()
        self.validity.resume(self._digest)

    def expect_motion(self, scene_motion: SceneMotion | None) -> None:
        """Compare each accepted motion sample with the scene's own sea from now on.

        The error known from the scene's convergence study is reported only for motion that was
        compared in this way. None: the caller itself supplies the scene's own sea, and nothing is
        compared.
        """
        self.scene_motion, self._judges_motion = scene_motion, scene_motion is not None
        self.motion_judged = True

    def submit_heave(
        self,
        stamp_ns: int,
        position_m: float,
        velocity_m_per_s: float,
        received_ns: int | None = None,
    ) -> str:
        """Submit a heave sample of the hang-off, + up; return "" or the reason for its rejection.

        received_ns: arrival by the twin's clock, in twin time, to judge the sender's clock; None:
        unknown.
        """
        with self.lock:
            sample = position_m, velocity_m_per_s
            refusal = self.heave.submit(stamp_ns, *sample, received_ns)
            if not refusal and self._judges_motion:
                self.validity.compare_heave(self.scene_motion, stamp_ns, *sample)
            return refusal

    def submit_pose(self, pose: ShipPose, received_ns: int | None = None) -> str:
        """Submit a ship pose, which moves the hang-off in x, y, z; return "" or the rejection.

        received_ns: as in `submit_heave`.
        """
        with self.lock:
            refusal = self.heave.submit_pose(pose, received_ns)
            if not refusal and self._judges_motion:
                self.validity.compare_pose(self.scene_motion, pose)
            return refusal

    def submit_lower_end(
        self,
        stamp_ns: int,
        position_m: tuple[float, float, float],
        velocity_m_per_s: tuple[float, float, float],
    ) -> str:
        """Submit the motion of the lower end, in map; return "" or the reason for the rejection."""
        if self.lower_end is None:
            remedy = "give its rope `end_motion: {from_outside: true}`"
            return phrase("lower_end", "the scene does not let another simulator move it", remedy)
        with self.lock:
            refusal = self.lower_end.submit_position(stamp_ns, position_m, velocity_m_per_s)
            if not refusal:
                self.validity.invalidate("the lower end is moved from elsewhere")
            return refusal

    def prescribe_motion(self) -> None:
        """Accept computed heave (step, pluck, stop): only order, range, finiteness are checked."""
        with self.lock:
            self.heave.prescribe()

    def judge_clocks(self, lead_s: float, correct: bool) -> None:
        """Set the lead allowed to senders [s], and whether stamps of motion are corrected."""
        with self.lock:
            self.heave.clock.lead_s, self.heave.clock.correct = lead_s, correct
            self.measured.lead_s = lead_s

    def submit_command(
        self, stamp_ns: int | None, command: WinchCommand, winch: str = WINCH
    ) -> str:
        """Command or switch a winch (stamp None: at once); return "" or the rejection.

        A command for an unknown winch counts as rejected by the first one.
        """
        winch = self.winch_name(winch)
        with self.lock:
            if winch == WINCH:
                return self.winch.take(stamp_ns, command, self._clock.time_ns)
            if winch not in self._winch_names:
                known = self._winch_names
                remedy = did_you_mean(winch, known) if known else "this scene has none"
                if len(self._first_winch_names) > 2 and known:
                    remedy = f"name it '{WINCH}', or leave the name empty"
                sentence = phrase("winch command", f"there is no winch '{winch}'", remedy)
                return self.winch.refuse(command, sentence)
            return self.ropes.submit(winch, stamp_ns, command, self._clock.time_ns)

    def winch_may_execute(self, winch: str, stamp_ns: int | None, command: WinchCommand) -> bool:
        """Return whether a winch of the scene would not reject a command for its value or another
        clock's stamp. Any thread may ask.
        """
        judged = stamp_ns, command, self._clock.time_ns
        if self.winch_name(winch) == WINCH:
            return self.winch.may_execute(*judged)
        return self.ropes.may_execute(winch, *judged)

    def winch_forbids(self, winch: str, switch: str) -> str:
        """Return why a winch would not execute a switch now; "": it would. Any thread may ask."""
        if self.winch_name(winch) == WINCH:
            return self.winch.forbids(switch)
        return self.ropes.forbids(winch, switch)

    def winch_name(self, name: str) -> str:
        """Return the name of the commanded winch; a single-line scene accepts its rope's too."""
        return WINCH if name in self._first_winch_names else name

    def rope_of(self, winch: str) -> int:
        """Return the number of the rope that a winch moves."""
        names = [WINCH, *(line.from_ for line in self._lines[1:])]
        return names.index(self.winch_name(winch))

    def submit_current(self, profile: ArrayLike) -> str:
        """Submit a current profile; return "" or the reason for its rejection.

        profile: rows of z [m], east, north [m/s] from the surface down, (rows, 3).
        """
        with self.lock:
            return self.current.submit(np.asarray(profile, dtype=float), self._clock.time_ns)

    def submit_cut(self, stamp_ns: int | None, below_m: float, rope: str = "") -> str:
        """Submit a cut of a rope (stamp None: at once); return "" or the reason for its rejection.

        below_m: unstretched distance below its upper end [m]; infinite: as close to the lower end
        as possible. rope: its name in a multi-line scene; "" is the first one.
        """
        with self.lock:
            return self.cut.submit(stamp_ns, below_m, self._clock.time_ns, rope)

    def submit_measurement(self, measurement: Measurement, received_ns: int | None = None) -> str:
        """Submit measured values; return "" or the (first) reason for a rejection.

        received_ns: arrival in twin time, to see a sensor's clock that is ahead; None: unknown.
        """
        with self.lock:
            # An empty name stays: the only winch, or a fault.
            rows = tuple((row[0] and self.winch_name(row[0]), *row[1:]) for row in measurement.rows)
            named = measurement._replace(rows=rows)
            return self.measured.submit(named, self._clock.time_ns, self._follow, received_ns)

    def submit_figures(self, /, ramp_s: float = RAMP_S, **factors: float) -> str:
        """Ramp the figures to factors times the scene's values; return "" or the rejection.

        As in a fleet, a factor applies to all ropes of a multi-line system and to the suspended
        load.

        ramp_s: duration of the ramp [s]; factors: by the names of FIGURES, without the current.
        """
        with self.lock:
            now_ns = self._clock.time_ns
            cut = self.cut.done is not None
            refusal = self.figures.submit(self.ropes.first, factors, ramp_s, now_ns, cut)
            if not refusal:
                at_s = now_ns * 1e-9
                self.validity.invalidate(f"learned figures were taken over at {at_s:.2f} s")
            return refusal

    def submit_forecast_score(
        self, coverage: float, judged: float, factor: float, age_s: float
    ) -> str:
        """Report how the last forecasts turned out; return "" or the reason for the rejection.

        coverage: fraction of the measured tensions inside their bands, NaN: unknown; judged: number
        of forecasts evaluated for it; factor: on the members' spread; age_s: age of the inputs [s].
        """
        with self.lock:
            now_s = self._clock.time_ns * 1e-9
            return self.forecast.submit(now_s, coverage, judged, factor, age_s)

    @property
    def factors(self) -> dict[str, float]:
        """Factors on the scene's figures that are in use by name; empty: the scene's own."""
        return self.figures.at(self._clock.time_ns) if self.figures.active else {}

    def steps_before(self, now_ns: int, step_ns: int, steps: int) -> int:
        """Return the number of steps before the next cut or change of figures, at most `steps`."""
        steps = self.cut.steps_before(now_ns, step_ns, steps)
        return self.figures.steps_before(now_ns, step_ns, steps)

    def _apply_figures(self) -> None:
        """Set the figures to their present values, if any were accepted."""
        if self.figures.active and self.cut.done is None:
            factors = self.figures.at(self._clock.time_ns)
            first = self.ropes.first
            self.current.effects = self._base.apply(factors, first, self.current.effects)
            self.ropes.scale(factors)

    def take_remark(self, remark: str) -> str:
        """Report inputs that did not reach the twin, as WARN for a minute; return ""."""
        with self.lock:
            self.border.warn(remark, self._clock.time_ns)
        return ""

    def _follow(self, winch: str, stamp_ns: int, length_m: float, speed: float | None) -> None:
        """Pass its measured line out [m] and line speed [m/s] to a winch."""
        if self.winch_name(winch) == WINCH:
            self.winch.follow(stamp_ns, length_m, speed)
        elif winch in self._winch_names:
            self.ropes.follow(winch, stamp_ns, length_m, speed)

    def newest_ns(self) -> dict[str, int]:
        """Return the stamp of the newest accepted sample of heave, cut and each winch [ns]."""
        lower_end = () if self.lower_end is None else (self.lower_end.counter,)
        counters = (self.heave.counter, self.cut.counter, *lower_end)
        newest = {
            counter.name: counter.newest_ns for counter in counters if counter.newest_ns is not None
        }
        return newest | self.winch.newest_ns() | self.ropes.newest_ns() | self.measured.newest_ns()

    def invalidate(self) -> None:
        """Invalidate inputs that were known in advance, after a pause or a restart."""
        with self.lock:
            self.heave.invalidate()
            self.winch.invalidate()
            self.ropes.invalidate()
            self.measured.invalidate()
            if self.lower_end is not None:
                self.lower_end.invalidate()

    def check_profiles(self) -> None:
        """Mark the tension error as unknown after a new current profile; call it under the lock.

        Figures on a ramp are set to their present values.
        """
        self._apply_figures()
        accepted = self.current.counter.accepted
        if accepted != self.profiles:
            self.profiles = accepted
            at_s = self._clock.time_ns * 1e-9
            self.validity.invalidate(f"a current profile came from elsewhere at {at_s:.2f} s")

    def complete(self, snapshot: Snapshot) -> Snapshot:
        """Add the residuals, and the score of a running forecast, to a snapshot."""
        with self.lock:
            if self.measured.active:
                amended(snapshot, residuals=self.measured.residuals(snapshot))
            return amended(snapshot, forecast_score=self.forecast.at(snapshot.time_s))

    def health(self) -> dict[str, InputHealth]:
        """Return the health of each input; call it under the lock."""
        now_ns = self._clock.time_ns
        kept_out = self.border.health(now_ns, False)
        learned = self.figures.counter.health(now_ns, False)
        return {
            "heave": self.heave.health(now_ns),
            **self.winch.health(now_ns),
            "current": self.current.counter.health(now_ns, False),
            **self.cut.health(now_ns),
            **({} if self.lower_end is None else {"lower_end": self.lower_end.health(now_ns)}),
            **self.measured.health(now_ns),
            **({BORDER: kept_out} if kept_out.warning else {}),
            **({FIGURES_INPUT: learned} if learned.accepted or learned.note else {}),
        }


class CurrentInput:
    """Input of current profiles: rows of z [m], east, north [m/s] from the surface down, (rows, 3);
    with a vertical component (rows, 4).
    """

    def __init__(self, effects: tuple[Any, ...]) -> None:
        self.counter = InputCounter("current")
        self.effects = effects
        self.changes = 0  # number of changes of the profile since the start

    def submit(self, profile: NDArray[np.float64], now_ns: int) -> str:
        """Submit a profile; return "" or the reason for its rejection."""
        fault = self._fault(profile)
        if fault:
            return fault
        before = profile_of(self.effects)
        assert before is not None, "checked above"
        new = from_rows(_with_components(profile, len(before.U)))
        jump, z = _largest_change(before, new)
        self.effects = tuple(with_profile(effect, new) for effect in self.effects)
        self.changes += 1
        self.counter.accept(now_ns)
        if jump > CURRENT_JUMP_M_PER_S:
            problem = (
                f"at {now_ns * 1e-9:.1f} s the profile changed by {jump:.2f} m/s at z = {z:g} m"
            )
            remedy = (
                f"more than {CURRENT_JUMP_M_PER_S:g} m/s at once is accepted, but check the sensor"
            )
            self.counter.warn(phrase("current", problem, remedy), now_ns)
        points = [(float(z), tuple(velocity)) for z, *velocity in profile.tolist()]
        self.counter.set_note(strong_current("current", points))
        return ""

    def revert(self, effects: tuple[Any, ...], now_ns: int) -> bool:
        """Restore the effects of an earlier time; return whether the profile differs.

        For a return to an earlier state of the ropes: the profile may have caused the failed step.
        """
        present, restored = profile_of(self.effects), profile_of(effects)
        if present is restored:
            return False
        self.effects, self.changes = effects, self.changes + 1
        problem = f"a step failed at {now_ns * 1e-9:.2f} s, soon after a new profile"
        self.counter.warn(
            phrase("current", problem, "the one before it is in force again; check the sensor"),
            now_ns,
        )
        return True

    def _fault(self, profile: NDArray[np.float64]) -> str:
        """Return why a profile is rejected, after counting it; "" if it is accepted."""
        reason, present = "", profile_of(self.effects)
        if present is None:
            reason = phrase(
                "current", "the scene lists no current", "add the effect 'current' to the scene"
            )
        elif profile.ndim != 2 or profile.shape[1] not in (3, 4) or len(profile) == 0:
            problem = f"its shape is {profile.shape}"
            reason = phrase("current", problem, "give rows of z, east, north (, up)")
        elif len(profile) > MAX_ROWS:
            reason = phrase("current", f"it has {len(profile)} rows", f"give {MAX_ROWS} at most")
        elif not np.isfinite(profile).all():
            return self.counter.refuse(
                "non_finite",
                phrase("current", "a value is not finite", "every value must be a finite number"),
            )
        elif np.any(np.diff(profile[:, 0]) >= 0.0) or profile[0, 0] > 0.0:
            reason = phrase(
                "current", "its heights are out of order", "order rows from z = 0 or below down"
            )
        elif np.abs(profile[:, 1:]).max() > MAX_CURRENT_M_PER_S:
            reason = phrase(
                "current",
                f"{np.abs(profile[:, 1:]).max():g} m/s is no sea current",
                f"give at most {MAX_CURRENT_M_PER_S:g} m/s",
            )
        elif len(present.U) == 2 and profile[:, 3:].any():
            problem = "it has a vertical component, which this scene's current has not"
            remedy = "give the scene's profile one, [east, north, up], be it 0"
            reason = phrase("current", problem, remedy)
        else:
            reason = _spacing_fault(profile)
        return self.counter.refuse("impossible", reason) if reason else ""


def _spacing_fault(profile: NDArray[np.float64]) -> str:
    """Return the error in the depths or the shear of an ordered profile; "" if there is none."""
    if profile[-1, 0] < DEEPEST_ROW_M:
        remedy = f"the deepest row may lie at {DEEPEST_ROW_M:g} m"
        return phrase("current", f"a row lies at z = {profile[-1, 0]:g} m", remedy)
    spacing = -np.diff(profile[:, 0])
    if len(spacing) and spacing.min() < MIN_ROW_SPACING_M:
        row = int(spacing.argmin())
        problem = f"rows {row} and {row + 1} are {spacing[row]:g} m apart"
        return phrase("current", problem, f"give rows at least {MIN_ROW_SPACING_M:g} m apart")
    shear, row = steepest_shear(profile)
    if shear > SHEAR_LIMIT_PER_S:
        problem = f"it changes by {shear:.3g} m/s a metre below row {row}"
        return phrase("current", problem, f"give at most {SHEAR_LIMIT_PER_S:g} m/s a metre")
    return ""


def _with_components(profile: NDArray[np.float64], components: int) -> NDArray[np.float64]:
    """Return a profile with as many velocity components as the scene's own current.

    A different number would need other kernels, compiled in the middle of the run.
    """
    missing = np.zeros((len(profile), max(1 + components - profile.shape[1], 0)))
    return np.hstack([profile, missing])[:, : 1 + components]


def _largest_change(
    before: Current | RisingCurrent, after: Current | RisingCurrent
) -> tuple[float, float]:
    """Return the largest change of velocity [m/s] between two profiles, and its height [m]."""
    z = np.union1d(before.z, after.z)  # both are linear in between
    changes = [
        np.interp(z, after.z, new) - np.interp(z, before.z, old)
        for new, old in zip(after.U, before.U, strict=True)
    ]
    size = np.linalg.norm(changes, axis=0)
    worst = int(size.argmax())
    return float(size[worst]), float(z[worst])


class ForecastInput:
    """Input of the score of the latest forecasts."""

    def __init__(self) -> None:
        """Begin without a score."""
        # Fields of a ForecastScore. A saved state has no NaN and restores plain values only:
        # an unknown coverage is None.
        self._newest: tuple[float, float, float | None, int, float] | None = None

    def submit(
        self, now_s: float, coverage: float, judged: float, factor: float, age_s: float
    ) -> str:
        """Submit a score (fields of ForecastScore); return "" or the reason for its rejection."""
        fault = ""
        if not (math.isnan(coverage) or 0.0 <= coverage <= 1.0):
            fault = phrase("forecast", f"a coverage of {coverage:g}", "give 0 to 1, NaN: unknown")
        elif not 0.0 <= judged <= MAX_FORECASTS_JUDGED:
            fault = phrase("forecast", f"{judged:g} forecasts judged", "give their number")
        elif not (0.0 < factor < math.inf and math.isfinite(age_s)):
            problem = f"a factor of {factor:g} and inputs {age_s:g} s old"
            fault = phrase("forecast", problem, "give a positive factor and a finite age")
        if not fault:
            self._newest = now_s, age_s, or_none(coverage), int(judged), factor
        return fault

    def at(self, now_s: float) -> ForecastScore | None:
        """Return the newest score, or None if no forecast runs."""
        if self._newest is None or now_s - self._newest[0] > SCORE_TIMEOUT_S:
            return None
        at_s, age_s, coverage, judged, factor = self._newest
        return ForecastScore(at_s, age_s, or_nan(coverage), judged, factor)

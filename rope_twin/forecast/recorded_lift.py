"""A recorded lift as input of forecasts: heave, line out and tension on one time grid.

Measured topics take precedence (`ship/heave`, `winch/measured`); where they are missing, those of
the twin (`hang_off/odometry`, `ropes/length`, `ropes/tension_top`) are used; `sources` names them.
Line out and tension that a twin would refuse (out of range, a jump) are left out.

The nominal rope follows the measured motion. A forecast starts its members from the state of the
rope one burn-in period before the origin: the nominal rope is integrated with measured heave and
line out, from static equilibrium at the start of the recording, on the mesh of the forecast.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from rope_twin.effects.seabed import SeabedParams
from rope_twin.errors import BagError, InputError, SolverError
from rope_twin.forecast.heave_process import PAST_S, RECORD_S, SAMPLE_S, SHORTEST_RECORD_S
from rope_twin.forecast.orders import LinePath, Lines, below_main_m, other_winches
from rope_twin.forecast.orders import scene_at_line as scene_at_line
from rope_twin.forecast.tension_forecast import ForecastSettings, Observations
from rope_twin.messages import read_cloud
from rope_twin.messages.cdr import deserialise
from rope_twin.recording.bag import find_bag
from rope_twin.recording.recorded_run import read_content
from rope_twin.recording.track import (
    HANG_OFF,
    HEAVE,
    LENGTH,
    TENSION_TOP,
    Messages,
    contents,
    impossible_words,
    names_of,
    possible_values,
    read_undamaged,
    refusal_words,
    rope_values,
    vertical_motion,
)
from rope_twin.scene.lift import lift_figures
from rope_twin.scene.load import load_scene
from rope_twin.scene.rigging import is_joined
from rope_twin.scene.schema import WINCH, RopeLine, Scene
from rope_twin.topics import WINCH_MEASURED, is_topic
from rope_twin.twin.ensemble.fleet import Fleet, FleetInputs, FleetState
from rope_twin.twin.motion.heave_track import ramp

Floats = NDArray[np.float64]

RAMP_S = 10.0  # build-up period of the measured motion
BATCH_S = 30.0


class NominalRope:
    """Fleet of ropes or multi-line systems that follow measured motion from equilibrium."""

    def __init__(self, scene: Scene, settings: ForecastSettings, ropes: int = 1) -> None:
        """Start in static equilibrium at time 0, with the scene's line out.

        Raises:
            InputError: a scene that fleets do not step.
            SceneError: the scene has no static equilibrium.
        """
        self._settings, self._ropes = settings, ropes
        self._fleet = Fleet(scene, ropes, elements=settings.elements, step_s=settings.step_s)
        self._samples = 0  # SAMPLE_S since the beginning

    @property
    def time_s(self) -> float:
        """Time since the start [s]."""
        return self._samples * SAMPLE_S

    def follow(
        self,
        until_s: float,
        from_s: float,
        heave_m: Floats,
        line_out_m: Floats,
        lines_m: Lines | None = None,
    ) -> None:
        """Advance to a time, a whole number of SAMPLE_S.

        heave_m: (n,) or (n, ropes), line_out_m: (n,), every SAMPLE_S from `from_s` on; they span
        the present of the ropes and `until_s`. lines_m: line out of other winches, likewise; one
        that is not named holds.

        Raises:
            InputError: they do not span it.
            SolverError: a rope failed.
        """
        from scipy.interpolate import CubicSpline  # slow to import

        settings = self._settings
        heave = np.asarray(heave_m, np.float64).reshape(len(heave_m), -1)
        sample_s = from_s + SAMPLE_S * np.arange(len(heave))
        target = round(until_s / SAMPLE_S)
        if target <= self._samples:
            return
        if sample_s[0] > self.time_s + 1e-6 or sample_s[-1] < until_s - 1e-6:
            problem = f"motion from {sample_s[0]:g} to {sample_s[-1]:g} s"
            raise InputError(
                "nominal rope", problem, f"it must span {self.time_s:g} to {until_s:g} s"
            )
        heave_spline, line_spline = CubicSpline(sample_s, heave), CubicSpline(sample_s, line_out_m)
        other_splines = {
            name: CubicSpline(sample_s, line_m) for name, line_m in (lines_m or {}).items()
        }
        per_sample, per_batch = round(SAMPLE_S / settings.step_s), round(BATCH_S / SAMPLE_S)
        while self._samples < target:
            samples = min(per_batch, target - self._samples)
            number = np.arange(samples * per_sample + 1)
            step_times = self.time_s + settings.step_s * number
            ramps = np.array([ramp(float(t), RAMP_S) for t in step_times])
            ramp_factor, slope = ramps[:, :1], ramps[:, 1:]
            z, v = heave_spline(step_times), heave_spline(step_times, 1)
            z, v = ramp_factor * z, ramp_factor * v + slope * z
            other_lines = {
                name: (spline(step_times), spline(step_times, 1))
                for name, spline in other_splines.items()
            }
            inputs = FleetInputs(
                z, v, line_spline(step_times), line_spline(step_times, 1), other_lines
            )
            record = self._fleet.advance(inputs, per_sample)
            if record.failures:
                reason = next(iter(record.failures.values()))
                raise SolverError("nominal rope", reason.rstrip("."), "check its motion")
            self._samples += samples

    def states(self) -> list[FleetState]:
        """Return the present state of each rope."""
        return [self._fleet.state(k) for k in range(self._ropes)]


def nominal_states(
    scene: Scene,
    heave_m: Floats,
    line_out_m: Floats,
    samples: list[int],
    settings: ForecastSettings | None = None,
    lines_m: Lines | None = None,
) -> list[list[FleetState]]:
    """Return the states at given samples of ropes that follow measured motion from equilibrium.

    Args:
        scene: with the line out of the first sample.
        heave_m: of each rope, every SAMPLE_S from time 0 on, (n,) or (n, ropes).
        line_out_m: (n,), that of the scene at first.
        samples: numbers of samples, ascending, at which the states are wanted.
        settings: mesh and step.
        lines_m: of other winches by name, (n,), those of the scene at first.

    Returns:
        For each sample a list of the state of each rope.

    Raises:
        InputError: the samples are not ascending or beyond the record.
        SolverError: a rope failed.
    """
    heave = np.asarray(heave_m, np.float64).reshape(len(heave_m), -1)
    if sorted(set(samples)) != samples or (samples and not 0 < samples[-1] < len(heave)):
        problem = f"samples {samples} of {len(heave)}"
        raise InputError("nominal rope", problem, "give ascending numbers within the record")
    rope = NominalRope(scene, settings or ForecastSettings(), heave.shape[1])
    states = []
    for sample in samples:
        rope.follow(sample * SAMPLE_S, 0.0, heave, line_out_m, lines_m)
        states.append(rope.states())
    return states


FIRST_ORIGIN = round(max(PAST_S, SHORTEST_RECORD_S) / SAMPLE_S) + 1  # sample of the earliest origin
UNIT_SHARE = 0.02  # of the static tension: less, or as many times more, is another unit
LARGEST_GAP_S = 2.0  # bridged by interpolation
WINCH_STATE = "winch/state"
HEAVE_TOPICS = (HEAVE, HANG_OFF)
LINE_TOPICS = (WINCH_MEASURED, LENGTH)
TENSION_TOPICS = (WINCH_MEASURED, TENSION_TOP)
Read = Callable[[str, bytes], tuple[float, float]]  # topic and data: time [s] and value
_Found = tuple[str, Floats, Floats]  # topic, times [s] and values


@dataclass(frozen=True)
class RecordedLift:
    """Series of a recording, every SAMPLE_S from its first common instant on."""

    scene: Scene  # with the line out of the first sample
    begin_s: float  # of the first sample; read_lift counts from it: 0
    heave_m: Floats  # (n,) of the hang-off about its rest position
    line_out_m: Floats  # (n,)
    tension_n: Floats  # (n,) at the sample; NaN: missing
    mean_n: Floats  # (n,) over the SAMPLE_S before
    peak_n: Floats  # (n,) largest of it
    sources: tuple[str, str, str]  # topics of heave, line out and tension
    compensated: NDArray[np.bool_] | None = None  # (n,) AHC is on; None: not recorded, always on
    lines_m: Lines = field(default_factory=dict)  # (n,) of other winches, by name
    problems: tuple[str, ...] = ()  # damage of the bag; its undamaged part was read

    @property
    def first_origin(self) -> int:
        """Sample of the earliest possible origin."""
        return FIRST_ORIGIN

    def known_at(self, sample: int, to_contact_m: float | None = None) -> Observations:
        """Return the observations at a sample, which is not before the first origin."""
        first = max(sample - round(RECORD_S / SAMPLE_S) + 1, 0)
        window = slice(first, sample + 1)
        winch = self.scene.winch
        is_on = self.compensated is None or bool(self.compensated[sample])
        return Observations(
            self.begin_s + sample * SAMPLE_S, self.heave_m[window], self.line_out_m[window],
            self.mean_n[window], compensated=bool(winch and winch.heave_compensation) and is_on,
            to_contact_m=to_contact_m,
            lines_m={name: line_m[window] for name, line_m in self.lines_m.items()},
        )  # fmt: skip

    def plans_at(
        self, sample: int, settings: ForecastSettings, ahead_s: float
    ) -> dict[str, LinePath]:
        """Return the recorded line out after a sample, at the time steps of the forecast.

        Of each winch, by name, heave compensation included. It is constant beyond the end
        of the recording.
        """
        from scipy.interpolate import CubicSpline  # slow to import

        count = round(ahead_s / SAMPLE_S)
        step_times = settings.step_s * np.arange(round(ahead_s / settings.step_s) + 1)
        paths = {}
        for name, line_m in {WINCH: self.line_out_m, **self.lines_m}.items():
            planned = line_m[sample : sample + count + 1]
            planned = np.concatenate([planned, np.full(count + 1 - len(planned), planned[-1])])
            spline = CubicSpline(SAMPLE_S * np.arange(count + 1), planned)
            paths[name] = LinePath(spline(step_times), spline(step_times, 1), is_whole=True)
        return paths


def read_lift(bag: str | Path, scene: str | None = None) -> RecordedLift:
    """Return the lift in a bag; scene: its name or file, None: that of the bag's session.

    Of a damaged bag the undamaged part is read.

    Raises:
        BagError: no bag, no session and no scene, or too little of a quantity.
        SceneError: the scene cannot be read.
    """
    path = find_bag(bag)
    base = load_scene(scene) if scene is not None else _scene_of(path)
    main = "", WINCH, base.ropes[0].name
    single = not is_joined(base)
    has_compensation = base.winch is not None and base.winch.heave_compensation is not None
    refused, impossible = Counter[str](), Counter[str]()

    def read(reader: Messages) -> tuple[_Found, _Found, _Found, dict[str, _Found], Floats]:
        refused.clear()
        impossible.clear()

        def heave_of(topic: str, data: bytes) -> tuple[float, float]:
            stamp_s, (z, _) = vertical_motion(topic, data)
            return stamp_s, z

        def of_rope(r: int, names: Sequence[str], field: str, what: str) -> _Found:
            topics = LINE_TOPICS if field == "line_out_m" else TENSION_TOPICS
            found = _first(reader, topics, _of(names, single, field), what, refused)
            return _possible(base, base.ropes[r], field, found, what, impossible)

        return (
            _first(reader, HEAVE_TOPICS, heave_of, "heave", refused),
            of_rope(0, main, "line_out_m", "line out"),
            of_rope(0, main, "tension_n", "tension"),
            {
                name: of_rope(r, (name, base.ropes[r].name), "line_out_m", f"line out of {name}")
                for name, (r, _) in other_winches(base).items()
            },
            _compensation(reader) if has_compensation else np.empty((0, 2)),
        )

    (heave, line, tension, others, switched), damage = read_undamaged(path, read)
    problems = (*damage, *refusal_words(refused))
    problems += impossible_words(impossible)
    all_series = heave, line, tension, *others.values()
    begin = max(series[1][0] for series in all_series)
    end = min(series[1][-1] for series in all_series)
    count = math.floor((end - begin) / SAMPLE_S + 1e-6) + 1
    if count <= FIRST_ORIGIN:
        problem = f"{max(end - begin, 0.0):.0f} s of it have heave, line out and tension"
        raise BagError(f"bag {path}", problem, f"a forecast needs {FIRST_ORIGIN * SAMPLE_S:g} s")
    times = begin + SAMPLE_S * np.arange(count)
    rest_m = base.ship.hang_off_m[2] if heave[0] == HANG_OFF else 0.0
    measured_m = base.measured.line_out.bias
    known_m = measured_m if line[0] == LINE_TOPICS[0] else 0.0
    known_n = base.measured.tension.bias if tension[0] == TENSION_TOPICS[0] else 0.0
    z = _on_grid(path, *heave[1:], times, "heave") - rest_m
    out = _on_grid(path, *line[1:], times, "line out") - known_m
    other_lines = {
        name: _on_grid(path, *recorded[1:], times, f"line out of {name}")
        - (measured_m if recorded[0] == LINE_TOPICS[0] else 0.0)
        for name, recorded in others.items()
    }
    top, mean, peak = (recorded - known_n for recorded in _tension_on(*tension[1:], times))
    return RecordedLift(
        scene_at_line(base, float(out[0]), {name: float(m[0]) for name, m in other_lines.items()}),
        0.0, z, out, top, mean, peak, (heave[0], line[0], tension[0]), _on_at(switched, times),
        other_lines, problems,
    )  # fmt: skip


def tension_unit_warning(lift: RecordedLift) -> str:
    """Return a warning if the tension is far from the static one, as in another unit; or "".

    It is not checked in multi-line scenes, where the load is shared.
    """
    measured_n = lift.peak_n[np.isfinite(lift.peak_n)]
    if is_joined(lift.scene) or not len(measured_n):
        return ""
    static_n, max_n = lift_figures(lift.scene).top_tension_n(lift.line_out_m[0]), measured_n.max()
    if static_n <= 0.0 or UNIT_SHARE * static_n < max_n < static_n / UNIT_SHARE:
        return ""
    return (
        f"warning: the largest tension of {lift.sources[2]} is {max_n:.4g} N where the lift "
        f"weighs {static_n:.4g} N; check its unit (N)"
    )


def seabed_depth_m(scene: Scene) -> float | None:
    """Return the depth at which the payload meets a plane seabed below the hang-off, or None."""
    for params in scene.effects:
        if isinstance(params, SeabedParams) and params.depth_m is not None:
            x, y, _ = scene.ship.hang_off_m
            return float(params.depth_m - params.slope[0] * x - params.slope[1] * y)
    return None


def line_to_contact_m(scene: Scene, line_out_m: float) -> float | None:
    """Return the line to pay out until the payload lands [m], at least 0; None: no seabed.

    line_out_m: of the main winch. The depth that is missing, as if the rope hung straight.
    """
    depth = seabed_depth_m(scene)
    if depth is None:
        return None
    suspended_m = line_out_m + below_main_m(scene)
    return max(depth - (suspended_m - scene.ship.hang_off_m[2]), 0.0)


def _scene_of(path: Path) -> Scene:
    """Return the scene of the newest session in a bag. Raises BagError."""
    return read_content(path).sessions[-1].session.scene()


def _of(names: Sequence[str], single: bool, field: str) -> Read:
    """Return a reader of a value of the rope or winch with one of these names; NaN if absent.

    single: the scene has one rope, the first of the message. field: of RopeValues.
    """

    def read(topic: str, data: bytes) -> tuple[float, float]:
        stamp_s, rows = rope_values(topic, data)
        matching = rows[:1] if single else [rope for rope in rows if rope.name in names]
        return stamp_s, getattr(matching[0], field) if matching else math.nan

    return read


def _first(
    reader: Messages, topics: Sequence[str], read: Read, what: str, refused: Counter[str]
) -> _Found:
    """Return name, times [s] and values of the first of these topics with usable numbers.

    refused: counts the messages that were skipped.

    Raises:
        BagError: none of them has any.
    """
    for topic in topics:
        for name in names_of(reader, topic):
            skipped = Counter[str]()
            rows = list(contents(reader, [name], topic, read, skipped))
            refused |= skipped  # a topic may be read for several quantities
            table = np.array(rows, np.float64).reshape(-1, 2)
            table = table[np.isfinite(table).all(axis=1)]
            table = table[np.argsort(table[:, 0], kind="stable")]
            rising = np.diff(table[:, 0], prepend=-math.inf) > 0.0
            if int(rising.sum()) > 1:
                return topic, table[rising, 0], table[rising, 1]
    words = " nor ".join(topics)
    raise BagError(f"bag {reader.path}", f"it has no {what}", f"neither {words} has one")


def _possible(
    scene: Scene, line: RopeLine, field: str, found: _Found, what: str, impossible: Counter[str]
) -> _Found:
    """Return the measured values that a twin would accept of the winch of a rope.

    impossible: counts the others.

    Raises:
        BagError: fewer than two are left.
    """
    topic, time_s, values = found
    if topic != WINCH_MEASURED:
        return found
    keep, refusal = possible_values(scene, line, field, time_s, values)
    if keep.sum() < 2:
        raise BagError(f"{what} of {topic}", f"none of it is possible ({refusal.rstrip('.')})",
                       "check unit and scene")  # fmt: skip
    if not keep.all():
        impossible[what] += int((~keep).sum())
    return topic, time_s[keep], values[keep]


def _compensation(reader: Messages) -> Floats:
    """Return times [s] and whether active heave compensation is on, (n, 2), of `winch/state`."""
    rows = []
    for name in (topic for topic in reader.topics if is_topic(topic, WINCH_STATE)):
        for _, data in reader.messages(name):
            message = deserialise(reader.topics[name].type_name, data)
            table, stamp = read_cloud(message), message.header.stamp
            if len(table) and "compensation_on" in (table.dtype.names or ()):
                rows.append((stamp.sec + 1e-9 * stamp.nanosec, float(table["compensation_on"][0])))
    return np.array(sorted(rows), np.float64).reshape(-1, 2)


def _on_at(switched: Floats, times: Floats) -> NDArray[np.bool_] | None:
    """Return whether it is on at given times, by the last message (before it: on); None: none."""
    switched = switched[np.isfinite(switched).all(axis=1)]
    if not len(switched):
        return None
    states = np.concatenate([[True], switched[:, 1] > 0.5])
    return np.asarray(states[np.searchsorted(switched[:, 0], times, side="right")])


def _on_grid(path: Path, time: Floats, values: Floats, times: Floats, what: str) -> Floats:
    """Interpolate at given times. Raises BagError: a gap is too long."""
    gaps = np.diff(time)
    inside = (time[1:] > times[0]) & (time[:-1] < times[-1])
    if (gaps[inside] > LARGEST_GAP_S).any():
        k = int(np.argmax(np.where(inside, gaps, 0.0)))
        what = f"{what} is missing for {gaps[k]:.1f} s from {time[k] - times[0]:.1f} s on"
        raise BagError(f"bag {path}", what, f"right are gaps up to {LARGEST_GAP_S:g} s")
    return np.asarray(np.interp(times, time, values))


def _tension_on(time: Floats, values: Floats, times: Floats) -> tuple[Floats, Floats, Floats]:
    """Return tension at given times, mean and maximum of the SAMPLE_S before; NaN in gaps."""
    top = np.interp(times, time, values)
    last = np.searchsorted(time, times, side="right")
    first = np.searchsorted(time, times - SAMPLE_S, side="right")
    mean, peak = np.full(len(times), math.nan), np.full(len(times), math.nan)
    for k, (begin, end) in enumerate(zip(first, last, strict=True)):
        if end > begin:
            mean[k], peak[k] = values[begin:end].mean(), values[begin:end].max()
        else:
            top[k] = math.nan
    return top, mean, peak

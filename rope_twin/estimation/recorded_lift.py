"""Measured series of a recorded lift: tension, heave and line out of its winches, from a bag.

Tension comes from winch/measured; line out from there, or else from ropes/length of the twin; heave
from ship/heave, or else from the twin's hang_off/odometry. Times count from the first tension. The
winches that carry a load together are known by the scene; of others the first is taken.

Where heave or line out pause for longer than LONGEST_PAUSE_S the rope may hang anywhere behind the
pause: the stretch with the longest tension is taken, whose rope begins at rest.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace
from itertools import pairwise
from pathlib import Path
from typing import TypeVar

import numpy as np

from rope_twin.core.state import Floats
from rope_twin.errors import BagError, InputError, counted
from rope_twin.estimation.figures import ROPE_FIGURES, suspended_ropes
from rope_twin.estimation.measured_lift import MeasuredLift, Series
from rope_twin.recording.bag import find_bag
from rope_twin.recording.session import Session, decode_json
from rope_twin.recording.track import (
    HANG_OFF,
    HEAVE,
    LENGTH,
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
from rope_twin.scene.schema import Scene
from rope_twin.topics import INPUT_LOG_TOPIC, SESSION_TOPIC, WINCH_MEASURED
from rope_twin.twin.input_queue import calls_of

MIN_SAMPLES = 100
LONGEST_PAUSE_S = 600.0  # of heave and line out: the rope has forgotten its motion long before
Content = TypeVar("Content")


@dataclass(frozen=True)
class RecordedLift:
    """Series of a bag, and the scene that it was recorded with."""

    lift: MeasuredLift  # pin_noise_n is NaN until the scene's prior is known
    session: Session | None  # the first of the bag
    problems: tuple[str, ...]  # damage of the bag and messages that were left out
    applied: dict[str, float]  # factors on the scene's figures that the run took over at last

    def scene(self) -> Scene:
        """Return the scene in the bag.

        Raises:
            BagError: the bag has none.
            SceneError: it is not valid here.
        """
        if self.session is None:
            problem = f"it has no {SESSION_TOPIC}, so no scene"
            raise BagError("bag", problem, "name the scene with --scene")
        return self.session.scene()


def read_lift(bag: str | Path, winch: str = "", scene: Scene | None = None) -> RecordedLift:
    """Return the series of a winch, and of those that carry the load with it.

    winch: in winch/measured; "": the only one, or the first that is named. scene: whose winches
    they are; None: the bag's.

    A damaged bag is read as far as it is whole.

    Raises:
        BagError: there is no such bag, or it lacks tension, heave or line out.
        InputError: the winch is not the main one.
        SceneError: its scene is not valid here.
    """
    lift, damage = read_undamaged(find_bag(bag), lambda reader: _read(reader, winch, scene))
    return replace(lift, problems=(*damage, *lift.problems))


def _read(bag: Messages, winch: str, scene: Scene | None) -> RecordedLift:
    measured: dict[str, tuple[Series, Series]] = {}  # tension and line out of each winch, by name
    lengths: dict[str, Series] = {}  # line out of the twin's ropes, by name
    heave, hang_off = Series(2), Series(2)
    applied: dict[str, float] = {}
    refused = Counter[str]()

    def messages_of(topic: str, read: Callable[[str, bytes], Content]) -> Iterator[Content]:
        return contents(bag, names_of(bag, topic), topic, read, refused)

    session = next(messages_of(SESSION_TOPIC, _session), None)
    for taken_over in messages_of(INPUT_LOG_TOPIC, _applied):
        applied |= taken_over
    for stamp_s, rows in messages_of(WINCH_MEASURED, rope_values):
        for row in rows:
            tension, line_out = measured.setdefault(row.name, (Series(1), Series(1)))
            tension.add(stamp_s, row.tension_n)
            line_out.add(stamp_s, row.line_out_m)
    for topic, series in ((HEAVE, heave), (HANG_OFF, hang_off)):
        for stamp_s, moved in messages_of(topic, vertical_motion):
            series.add(stamp_s, *moved)
    for stamp_s, rows in messages_of(LENGTH, rope_values):
        for row in rows:
            lengths.setdefault(row.name, Series(1)).add(stamp_s, row.line_out_m)
    rest_z = float(hang_off.table[0, 1]) if len(hang_off.table) else None
    if scene is None and session is not None:
        scene = session.scene()
    suspended = [] if scene is None else [scene.ropes[r] for r in suspended_ropes(scene)]
    impossible = Counter[str]()
    for name, (tension, line_out) in measured.items():
        lines = [line for line in suspended if name in (line.from_, line.name)] or suspended[:1]
        if scene is None or not lines:
            continue
        for what, field, own in (
            ("tension", "tension_n", tension), ("line out", "line_out_m", line_out)
        ):  # fmt: skip
            time_s, values = own.table.T
            possible, _ = possible_values(scene, lines[0], field, time_s, values)
            impossible[what] += len(possible) - int(possible.sum())
            own.keep(possible)
    first, *further = [(line.from_, line.name) for line in suspended] or [("", "")]
    taken = [name for pair in further for name in pair]
    if winch in taken:
        problem, right = "it carries the load with the main one", f"name the winch of '{first[1]}'"
        raise InputError(f"winch '{winch}'", problem, right)
    winch = winch or next((name for name in measured if name not in taken), first[0])
    lift = MeasuredLift(np.nan)
    lift.tension, lift.line_out = _series((winch,), first[1], measured, lengths)
    for name, rope in further:
        rope_lift = lift.others[name] = MeasuredLift(np.nan)
        rope_lift.tension, rope_lift.line_out = _series((name, rope), rope, measured, lengths)
    lift.heave = heave if len(heave.table) else hang_off
    most_measured = max(lift.ropes, key=lambda rope: len(rope.tension.table))
    named = zip((winch, *lift.others), lift.ropes, strict=True)
    for name, owner, series, topics in (
        ("tension", winch, most_measured.tension, f"{WINCH_MEASURED} with effort"),
        *(
            ("line out", owner, rope_lift.line_out, f"{WINCH_MEASURED} with position, or {LENGTH}")
            for owner, rope_lift in named
        ),
        ("heave", winch, lift.heave, f"{HEAVE} or {HANG_OFF}"),
    ):
        if len(series.table) < MIN_SAMPLES:
            problem = f"{len(series.table)} samples of {name}"
            suffix = f" of winch '{owner}'" if owner else ""
            raise BagError(f"bag {bag.path}{suffix}", problem, f"record {topics}")
    if lift.heave is hang_off:
        lift.heave = _relative(hang_off, session, rest_z)
    paused = _take_longest(lift)
    zero_s = min(
        float(rope_lift.tension.table[0, 0])
        for rope_lift in lift.ropes
        if len(rope_lift.tension.table)
    )
    for rope_lift in lift.ropes:
        rope_lift.tension, rope_lift.line_out = (
            rope_lift.tension.less(zero_s, 0.0),
            rope_lift.line_out.less(zero_s, 0.0),
        )
    lift.heave = lift.heave.less(zero_s, 0.0, 0.0)
    problems = (*refusal_words(refused), *impossible_words(impossible), *paused)
    return RecordedLift(lift, session, problems, applied)


def _take_longest(lift: MeasuredLift) -> list[str]:
    """Keep the stretch with the longest tension between pauses; return a remark if there are."""
    series = (lift.heave, *(rope.line_out for rope in lift.ropes))
    borders = np.unique(np.concatenate([[-np.inf, np.inf], *map(_pauses, series)]))
    if len(borders) == 2:
        return []
    stamps = np.sort(np.concatenate([rope.tension.table[:, 0] for rope in lift.ropes]))
    edges = np.searchsorted(stamps, borders)
    spans = [stamps[b - 1] - stamps[a] if b > a else 0.0 for a, b in pairwise(edges)]
    longest = int(np.argmax(spans))
    begin_s, end_s = borders[longest : longest + 2]
    for rope in lift.ropes:
        for own in (rope.tension, rope.line_out, rope.heave):
            own.keep((own.table[:, 0] >= begin_s) & (own.table[:, 0] < end_s))
    whole, pauses = stamps[-1] - stamps[0], counted(len(borders) - 2, "pause")
    words = f"heave or line out has {pauses} of more than {LONGEST_PAUSE_S / 60.0:g} min; only the "
    words += f"longest stretch is taken, {spans[longest]:.0f} s of {whole:.0f} s, "
    return [f"{words}from {stamps[edges[longest]] - stamps[0]:.0f} s on"]


def _pauses(series: Series) -> Floats:
    """Return the times at which samples come after a pause [s]."""
    times = series.table[:, 0]
    return np.asarray(times[1:][np.diff(times) > LONGEST_PAUSE_S])


def _session(topic: str, data: bytes) -> Session:
    return Session.read(decode_json(topic, data))


def _series(
    names: tuple[str, ...], rope: str, measured: Mapping[str, tuple[Series, Series]],
    lengths: Mapping[str, Series],
) -> tuple[Series, Series]:  # fmt: skip
    """Return tension and line out of a winch by one of its names, as far as they are there.

    Line out that is not measured is that of its rope, or of the only one: another rope's would pass
    for it.
    """
    series = next((measured[name] for name in names if name in measured), (Series(1), Series(1)))
    if len(series[1].table):
        return series
    only = next(iter(lengths.values())) if len(lengths) == 1 else Series(1)
    return series[0], lengths.get(rope, only)


def _applied(topic: str, data: bytes) -> dict[str, float]:
    """Return the factors that an entry of the log of inputs takes over.

    Raises:
        InputError: it is no entry of that log.
    """
    try:
        calls = calls_of(decode_json(topic, data).get("calls", []))
    except ValueError as error:
        raise InputError(INPUT_LOG_TOPIC, str(error), "give the bag as recorded") from error
    accepted = (call.named for call in calls if call.method == "submit_figures")
    return {
        name: float(value)
        for named in accepted
        for name, value in named.items()
        if name in ROPE_FIGURES
    }


def _relative(hang_off: Series, session: Session | None, first_z: float | None) -> Series:
    """Return the hang-off's height relative to its rest: that of the scene, or its mean."""
    rest_z = float(hang_off.table[:, 1].mean()) if first_z is None else first_z
    if session is not None:
        rest_z = session.scene().ship.hang_off_m[2]
    return hang_off.less(0.0, rest_z, 0.0)

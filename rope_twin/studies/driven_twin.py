"""A twin advanced with inputs, snapshot by snapshot: its scene's own, or an exact heave motion."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterator, Sequence

from rope_twin.errors import SolverError
from rope_twin.run.inputs import FIRST_NS, LEAD_NS, offer, open_sea
from rope_twin.scene.validation.rigging import winches_by_name
from rope_twin.twin.pacing import steps_in_slot
from rope_twin.twin.snapshot import Snapshot
from rope_twin.twin.twin import Twin
from rope_twin.twin.winch.schedule import schedule_samples

Motion = Callable[[float], tuple[float, float]]  # time [s] to value and rate
Speeds = Sequence[tuple[float, float]]  # at [s], winch speed from then on [m/s]


def fed(twin: Twin, seconds: float) -> Iterator[Snapshot]:
    """Step a twin with its scene's sea and winch; a snapshot after each publish period.

    Raises:
        SolverError: a step that is not finite.
    """
    sea, named = open_sea(twin.scene), winches_by_name(twin.scene)
    steps, offered_ns = steps_in_slot(twin.step_s), FIRST_NS
    while twin.time_ns < round(seconds * 1e9):
        until_ns = twin.time_ns + steps * twin.step_ns + LEAD_NS
        for heave in sea.between(offered_ns, until_ns) if sea else ():
            offer(twin, heave)
        for name, winch in named.items():
            for command in schedule_samples(winch, offered_ns, until_ns):
                twin.offer_command(command.stamp_ns, command.command, name)
        offered_ns = until_ns
        twin.advance(steps)
        yield twin.snapshot()


def still(time: float) -> tuple[float, float]:
    """Return zero motion."""
    return 0.0, 0.0


def march(
    twin: Twin, heave: Motion, seconds: float, every: int = 1, speeds: Speeds = ()
) -> Iterator[Snapshot]:
    """Advance with exact heave samples on every border; a snapshot after each `every` steps.

    Winch commands are offered up to five seconds ahead.

    Raises:
        SolverError: the twin refused a sample, or its next state would not be finite.
    """
    twin.prescribe_motion()
    if twin.steps == 0:
        _taken(twin.offer_heave(0, *heave(0.0)))
    waiting = deque(speeds)
    for _ in range(round(seconds / (every * twin.step_s))):
        last = twin.steps + every
        while waiting and waiting[0][0] <= last * twin.step_s + 5.0:
            at, speed = waiting.popleft()
            _taken(twin.offer_speed(round(at * 1e9), speed))
        for k in range(twin.steps + 1, last + 1):
            _taken(twin.offer_heave(k * twin.step_ns, *heave(k * twin.step_s)))
        twin.advance(every)
        yield twin.snapshot()


def _taken(refusal: str) -> None:
    if refusal:
        raise SolverError(refusal)

"""The winch schedule of a scene as stamped speed commands, the same for every runner."""

from __future__ import annotations

from dataclasses import dataclass

from rope_twin.scene.schema import Winch

COMMAND_PERIOD_NS = 100_000_000  # a command is repeated at 10 Hz, so that its absence shows


@dataclass(frozen=True)
class SpeedSample:
    """The winch is to run at this speed from this twin time on."""

    stamp_ns: int
    speed_m_per_s: float  # + pays out


def schedule_samples(winch: Winch | None, from_ns: int, to_ns: int) -> list[SpeedSample]:
    """The commands with `from_ns <= stamp_ns < to_ns` (twin time), in order.

    They stand on the 10 Hz grid and, so that no change waits for the grid, at each row's own
    instant. Before the first row the speed is zero. Without a schedule there are none.
    """
    if winch is None or not winch.schedule:
        return []
    from_ns = max(0, from_ns)
    first = -(-from_ns // COMMAND_PERIOD_NS) * COMMAND_PERIOD_NS
    stamps = set(range(first, to_ns, COMMAND_PERIOD_NS))
    stamps.update(_row_instants(winch, from_ns, to_ns))
    return [SpeedSample(stamp, scheduled_speed(winch, stamp)) for stamp in sorted(stamps)]


def scheduled_speed(winch: Winch, stamp_ns: int) -> float:
    """Speed [m/s] that the schedule asks for at a twin time."""
    repeat_ns = _repeat_ns(winch)
    within_ns = stamp_ns % repeat_ns if repeat_ns else stamp_ns
    speed = 0.0
    for row in winch.schedule:
        if round(row.at_s * 1e9) > within_ns:
            break
        speed = row.speed_m_per_s
    return speed


def _repeat_ns(winch: Winch) -> int:
    return round((winch.schedule_repeats_every_s or 0.0) * 1e9)


def _row_instants(winch: Winch, from_ns: int, to_ns: int) -> list[int]:
    """When rows take effect within [from_ns, to_ns), over all repetitions."""
    repeat_ns = _repeat_ns(winch)
    rows = [round(row.at_s * 1e9) for row in winch.schedule]
    if not repeat_ns:
        return [row for row in rows if from_ns <= row < to_ns]
    rounds = range(from_ns // repeat_ns, max(0, to_ns) // repeat_ns + 1)
    instants = [again * repeat_ns + row for again in rounds for row in rows if row < repeat_ns]
    # the wrap itself is a change too: the schedule is at its beginning again
    instants += [again * repeat_ns for again in rounds if again > 0]
    return [instant for instant in instants if from_ns <= instant < to_ns]

"""The winch schedule as stamped commands: the same integers whoever asks, however often."""

from __future__ import annotations

import itertools

from hypothesis import given
from hypothesis import strategies as st

from rope_twin.scene.schema import ScheduleRow, Winch
from rope_twin.twin.snapshot import SPEED
from rope_twin.twin.winch.commands import (
    COMMAND_PERIOD_NS,
    CommandSample,
    WinchCommand,
    schedule_samples,
)

S = 1_000_000_000


def winch(rows: list[tuple[float, float]], repeat_s: float | None = None) -> Winch:
    return Winch(
        speed_limit_m_per_s=1.0,
        acceleration_limit_m_per_s2=0.3,
        min_line_out_m=10.0,
        max_line_out_m=100.0,
        schedule=tuple(ScheduleRow(at_s=at, speed_m_per_s=speed) for at, speed in rows),
        schedule_repeats_every_s=repeat_s,
    )


def reported(stamp_ns: int, speed_m_per_s: float) -> CommandSample:
    """A speed that the winch is reported."""
    return CommandSample(stamp_ns, WinchCommand(SPEED, speed_m_per_s))


def test_commands_stand_on_the_grid_and_at_each_change() -> None:
    samples = schedule_samples(winch([(0.0, 0.5), (0.25, -0.2)]), 0, round(0.45 * S))
    assert samples == [
        reported(0, 0.5),
        reported(S // 10, 0.5),
        reported(2 * S // 10, 0.5),
        reported(S // 4, -0.2),
        reported(3 * S // 10, -0.2),
        reported(4 * S // 10, -0.2),
    ]


def test_before_the_first_row_the_winch_stands() -> None:
    samples = schedule_samples(winch([(1.0, 0.5)]), -S, S + 1)
    assert samples[0] == reported(0, 0.0)
    assert [s.command.value for s in samples[:-1]] == [0.0] * 10
    assert samples[-1] == reported(S, 0.5)


def test_a_repeating_schedule_begins_again() -> None:
    samples = schedule_samples(winch([(0.5, 0.3), (1.0, 0.0)], 1.25), 0, round(2.6 * S))
    changes = [
        (now.stamp_ns / S, now.command.value)
        for before, now in itertools.pairwise(samples)
        if now.command.value != before.command.value
    ]
    assert changes == [(0.5, 0.3), (1.0, 0.0), (1.75, 0.3), (2.25, 0.0)]
    assert 1.25 * S in [s.stamp_ns for s in samples]


def test_without_a_schedule_nobody_commands() -> None:
    assert schedule_samples(None, 0, 10 * S) == []
    assert schedule_samples(winch([]), 0, 10 * S) == []


rows = st.lists(st.tuples(st.floats(0.0, 8.0), st.floats(-1.0, 1.0)), min_size=1, max_size=5).map(
    lambda pairs: sorted(pairs)
)


@given(rows, st.none() | st.floats(1.0, 9.0), st.lists(st.integers(0, 12 * S), max_size=6))
def test_asking_in_pieces_gives_the_same_samples(
    pairs: list[tuple[float, float]], repeat_s: float | None, cuts: list[int]
) -> None:
    a_winch = winch(pairs, repeat_s)
    whole = schedule_samples(a_winch, 0, 12 * S)
    edges = [0, *sorted(cuts), 12 * S]
    pieces = [
        sample for a, b in itertools.pairwise(edges) for sample in schedule_samples(a_winch, a, b)
    ]
    assert pieces == whole
    stamps = [s.stamp_ns for s in whole]
    assert stamps == sorted(set(stamps))
    assert set(range(0, 12 * S, COMMAND_PERIOD_NS)) <= set(stamps)

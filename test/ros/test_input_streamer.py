"""Which stretch of twin time an input node publishes: each instant once, whatever clocks do."""

from __future__ import annotations

from hypothesis import given
from hypothesis import strategies as st

from rope_twin.ros.input_streamer import PIECE_NS, InputClock

S = 1_000_000_000
MS = 1_000_000
ROS_NOW = 1_700_000_000 * S
STEADY_NOW = 5_000 * S


def test_nothing_is_due_before_there_is_an_epoch() -> None:
    assert InputClock(0.2, 1.0).due(STEADY_NOW) == (0, 0)


def test_a_fresh_twin_gets_everything_from_the_beginning_with_the_lead() -> None:
    clock = InputClock(lead_s=0.2, speed=1.0, first_ns=-100 * MS)
    clock.follow(ROS_NOW + S // 2, ROS_NOW, STEADY_NOW)
    assert clock.due(STEADY_NOW) == (
        -100 * MS,
        -100 * MS,
    )  # t = -0.5 s with 0.2 s lead: nothing yet
    assert clock.due(STEADY_NOW + S // 2) == (-100 * MS, 200 * MS)
    assert clock.due(STEADY_NOW + S) == (200 * MS, 700 * MS)


def test_who_joins_a_running_twin_begins_a_little_before_now() -> None:
    clock = InputClock(lead_s=0.2, speed=1.0)
    clock.follow(ROS_NOW - 60 * S, ROS_NOW, STEADY_NOW)
    assert clock.due(STEADY_NOW) == (60 * S - 100 * MS, 60 * S + 200 * MS)


def test_a_new_epoch_begins_anew_and_the_same_one_does_not() -> None:
    clock = InputClock(lead_s=0.0, speed=1.0)
    clock.follow(ROS_NOW, ROS_NOW, STEADY_NOW)
    assert clock.due(STEADY_NOW + S // 4) == (0, S // 4)
    clock.follow(ROS_NOW, ROS_NOW + S // 4, STEADY_NOW + S // 4)
    assert clock.due(STEADY_NOW + S // 2) == (S // 4, S // 2)
    later = ROS_NOW + 3 * S
    clock.follow(later, later, STEADY_NOW + 3 * S)
    assert clock.due(STEADY_NOW + 3 * S + S // 4) == (0, S // 4)


def test_speed_stretches_twin_time_and_the_lead_with_it() -> None:
    clock = InputClock(lead_s=0.2, speed=4.0)
    clock.follow(ROS_NOW, ROS_NOW, STEADY_NOW)
    moments = [clock.due(STEADY_NOW + S) for _ in range(20)]
    assert max(moments) == (4 * S + 800 * MS, 4 * S + 800 * MS)


def test_a_long_stretch_comes_in_pieces_that_a_listener_can_hold() -> None:
    """Five seconds of lead: fifty commands at once would leave it the last ten of them."""
    clock = InputClock(lead_s=5.0, speed=1.0)
    clock.follow(ROS_NOW, ROS_NOW, STEADY_NOW)
    pieces = [clock.due(STEADY_NOW) for _ in range(11)]
    assert pieces == [(k * PIECE_NS, (k + 1) * PIECE_NS) for k in range(10)] + [(5 * S, 5 * S)]


@given(
    st.lists(st.integers(-S, 3 * S), min_size=1, max_size=30),
    st.sampled_from([0.1, 1.0, 3.0]),
)
def test_stretches_join_without_gap_or_overlap(moves: list[int], speed: float) -> None:
    clock = InputClock(lead_s=0.1, speed=speed)
    clock.follow(ROS_NOW, ROS_NOW, STEADY_NOW)
    end = 0
    now = STEADY_NOW
    for move in moves:  # clocks of hypothesis may even go back
        now += move
        from_ns, to_ns = clock.due(now)
        assert from_ns == end
        assert to_ns >= from_ns
        end = to_ns

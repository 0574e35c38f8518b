"""From bytes to numbers: what is no proper message is refused with one sentence, never raised."""

from __future__ import annotations

import contextlib
import math
from collections.abc import Callable
from functools import partial

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from ros_messages import joint, multi_array

from rope_twin.errors import InputError
from rope_twin.messages import encode_current, encode_cut, encode_heave, encode_order
from rope_twin.messages.cdr import new, serialise
from rope_twin.messages.inputs import (
    read_current,
    read_cut,
    read_heave,
    read_measurement,
    read_order,
)
from rope_twin.topics import CUT_TOPIC, WINCH_TOPICS
from rope_twin.twin.winch.commands import WinchCommand

SPEED_TOPIC = "winch/speed_command"


@given(st.integers(0, 2**31 * 10**9 - 1), st.floats(-50, 50), st.floats(-20, 20))
def test_heave_comes_back_as_it_was_sent(stamp_ns: int, z: float, vz: float) -> None:
    assert read_heave(encode_heave(stamp_ns, z, vz)) == (stamp_ns, (z, vz))


ORDERS = [
    WinchCommand("speed", -0.25),
    WinchCommand("length", 350.0),
    WinchCommand("depth", 2990.0),
    WinchCommand("tension", 1.5e5),
    WinchCommand("emergency_stop"),
    WinchCommand("set_brake"),
]


@pytest.mark.parametrize("order", ORDERS, ids=[order.kind for order in ORDERS])
def test_an_order_comes_back_and_stamp_zero_means_at_once(order: WinchCommand) -> None:
    assert read_order(*encode_order(1_234_567_890, order)) == (1_234_567_890, order, "winch")
    assert read_order(*encode_order(0, order, "aft")) == (None, order, "aft")


@pytest.mark.parametrize("below_m", [1500.0, math.inf])
def test_a_cut_comes_back_and_stamp_zero_means_at_once(below_m: float) -> None:
    topic, data = encode_cut(1_234_567_890, below_m)
    assert topic == CUT_TOPIC
    assert read_cut(data) == (1_234_567_890, below_m, "rope")
    assert read_cut(encode_cut(0, below_m, "leg")[1]) == (None, below_m, "leg")


def test_a_cut_without_a_place_gets_one_sentence() -> None:
    with pytest.raises(InputError, match="ropes/cut: 0 positions"):
        read_cut(joint([0.5]))


@pytest.mark.parametrize("sizes", [[2, 3], [], [6]])
def test_current_rows_come_with_or_without_a_layout(sizes: list[int]) -> None:
    rows = read_current(multi_array([0.0, 0.5, 0.0, -100.0, 0.1, 0.2], sizes))
    assert rows.tolist() == [[0.0, 0.5, 0.0], [-100.0, 0.1, 0.2]]


def test_current_rows_may_have_a_vertical_component() -> None:
    """The layout tells rows of four; without one, twelve numbers are four rows of three."""
    rows = [[0.0, 0.5, 0.0, 0.1], [-100.0, 0.1, 0.2, -0.1], [-200.0, 0.0, 0.0, 0.0]]
    assert read_current(encode_current(rows)).tolist() == rows
    flat = [number for row in rows for number in row]
    assert read_current(multi_array(flat, [3, 4])).tolist() == rows
    assert read_current(multi_array(flat, [])).shape == (4, 3)


@pytest.mark.parametrize(
    ("data", "words"),
    [
        (joint([]), "0 velocities"),
        (joint([0.1, 0.2]), "2 velocities"),
        (joint([0.1], nanosec=2_000_000_000), "2000000000 ns"),
        (b"", "do not decode"),
        (b"\x00\x01\x00\x00", "do not decode"),
        (b"\xff" * 64, "do not decode"),
    ],
)
def test_a_malformed_command_gets_one_sentence(data: bytes, words: str) -> None:
    with pytest.raises(InputError, match=words) as caught:
        read_order(SPEED_TOPIC, data)
    assert str(caught.value).endswith(".")
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("topic", "words"),
    [
        ("winch/length_command", "0 positions; there must be exactly one, the line out"),
        ("winch/depth_command", "0 positions; there must be exactly one, the payload's depth"),
        ("winch/tension_command", "0 efforts; there must be exactly one, the tension"),
        ("winch/switch_command", "1 names; give two: the winch's, and one of emergency_stop"),
    ],
)
def test_a_speed_on_another_topic_is_refused(topic: str, words: str) -> None:
    with pytest.raises(InputError, match=words):
        read_order(topic, joint([0.1]))


@pytest.mark.parametrize(
    "data",
    [
        multi_array([], []),
        multi_array([1.0, 2.0], []),
        multi_array([0.0] * 6, [3, 2]),
        multi_array([0.0] * 6, [2, 4]),
        multi_array([0.0] * 6, [2, 3], offset=3),
        multi_array([0.0] * 6, [1, 2, 3]),
        multi_array([0.0] * 4, [4, 1]),
        multi_array([0.0] * 5, [1, 5]),
        multi_array([0.0] * 12, [4, 4]),
    ],
)
def test_a_malformed_current_gets_one_sentence(data: bytes) -> None:
    with pytest.raises(InputError, match="rows of z, east, north"):
        read_current(data)


@given(st.binary(max_size=400))
def test_random_bytes_never_raise_anything_else(data: bytes) -> None:
    orders = [partial(read_order, topic) for topic in WINCH_TOPICS]
    for read in (read_heave, *orders, read_current):
        with contextlib.suppress(InputError):
            read(data)


def measured(names: list[str], **values: list[float]) -> bytes:
    """A winch/measured message with these names and columns."""
    arrays = {name: np.array(column) for name, column in values.items()}
    return serialise(new("sensor_msgs/msg/JointState", name=names, **arrays))


@pytest.mark.parametrize("read", [
    lambda data: read_order("winch/speed_command", data), read_cut,
    lambda data: read_measurement("winch/measured", data),
    lambda data: read_order("winch/switch_command", data),
])  # fmt: skip
def test_a_name_without_end_is_not_repeated(read: Callable[[bytes], object]) -> None:
    """It would be in every diagnostics message and in the bag, and be kept for each new one."""
    with pytest.raises(InputError, match=r": a name of 1000000 characters; give 256 at most\."):
        read(measured(["winch", "y" * 1_000_000], velocity=[0.1, 0.1]))


def test_what_is_not_measured_is_nan_or_left_out() -> None:
    data = measured(["fore", "aft"], position=[12.0, math.nan], effort=[math.nan, 3e4])
    found = read_measurement("winch/measured", data)
    assert found.rows == (("fore", 12.0, None, None), ("aft", None, None, 3e4))
    assert read_measurement("winch/measured", measured([], position=[9.0])).rows == (
        ("", 9.0, None, None),
    )
    of_motor = measured(["winch"], position=[12.0], effort=[4e4])
    assert read_measurement("winch/motor_tension", of_motor).rows == (("winch", None, None, 4e4),)


@pytest.mark.parametrize(
    ("data", "words"),
    [
        (measured(["fore", "aft"], position=[1.0]), "1 values of position for 2 winches"),
        (measured(["fore", "fore"], effort=[1.0, 2.0]), "give each winch once"),
        (measured([], velocity=[1.0, 2.0]), "2 values of velocity for 1 winches"),
    ],
)
def test_columns_that_do_not_fit_their_names_get_one_sentence(data: bytes, words: str) -> None:
    with pytest.raises(InputError, match=words):
        read_measurement("winch/measured", data)

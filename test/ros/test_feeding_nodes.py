"""The nodes that feed the twin, in this process: exact stamps, two sources of sea, yielding."""

from __future__ import annotations

import time
from typing import Any

import numpy as np
import pytest
from ros_bench import Bench, stamp_ns
from ros_messages import encode_speed

from rope_twin.errors import BagError, InputError, SceneError
from rope_twin.messages import decode, encode_epoch
from rope_twin.recording.heave import open_heave
from rope_twin.recording.motion_source import open_sea
from rope_twin.ros import qos
from rope_twin.scene.load import load_scene
from rope_twin.twin.winch.commands import schedule_samples

pytestmark = pytest.mark.ros
S = 1_000_000_000
SCENE = "shallow_lift"
LEAD_S = 5.0  # a node that is held up for less than this still publishes all from the beginning


def sea_state(bench: Bench, **parameters: Any) -> Any:
    given = {"scene": SCENE, "lead_s": LEAD_S, "simulation_node": "bench", **parameters}
    return bench.make("sea_state", **given)


def winch_schedule(bench: Bench, **parameters: Any) -> Any:
    given = {"scene": SCENE, "lead_s": LEAD_S, "simulation_node": "bench", **parameters}
    return bench.make("winch_schedule", **given)


def publish_epoch(bench: Bench, ahead_s: float = LEAD_S) -> int:
    publisher = bench.publisher("twin/epoch")
    bench.until(publisher.get_subscription_count, "somebody awaits the epoch")
    epoch_ns = time.time_ns() + round(ahead_s * S)
    publisher.publish(encode_epoch(epoch_ns))
    return epoch_ns


@pytest.mark.parametrize(
    ("name", "parameter", "value"),
    [("sea_state", "loop", False), ("winch_schedule", "lead_s", 1.0), ("recorder", "out", "bag")],
)
def test_a_parameter_that_is_read_once_cannot_be_set_later(
    bench: Bench, name: str, parameter: str, value: object
) -> None:
    """Accepted, it would have no effect."""
    from rclpy.parameter import Parameter

    node = bench.make(name)
    before = node.get_parameter(parameter).value
    (result,) = node.set_parameters([Parameter(parameter, value=value)])
    assert not result.successful
    assert parameter in result.reason
    assert "read-only" in result.reason
    assert node.get_parameter(parameter).value == before


def test_another_node_s_epoch_is_ignored(bench: Bench) -> None:
    """It would shift the sea; that of the simulation is followed, in whatever order they come."""
    import rclpy

    node = sea_state(bench, simulation_node="simulation")
    node.begin()
    heave = bench.listen("ship/heave")
    publish_epoch(bench)
    bench.until(lambda: node._warned, "it is noticed")
    assert "from node bench ignored" in next(iter(node._warned))
    assert not heave
    from rope_twin.ros.qos import message_type, profile
    from rope_twin.topics import BY_NAME

    simulation = bench.add(rclpy.create_node("simulation"))
    topic = BY_NAME["twin/epoch"]
    own = simulation.create_publisher(message_type(topic), topic.name, profile(topic.qos))
    epoch_ns = time.time_ns() + S
    own.publish(encode_epoch(epoch_ns))
    bench.until(lambda: heave, "that of the simulation is followed")
    assert (stamp_ns(heave[0]) - epoch_ns) % (S // 20) == 0
    publish_epoch(bench, ahead_s=2.0123)
    until = time.monotonic() + 0.5
    bench.until(lambda: time.monotonic() > until, "half a second")
    assert (stamp_ns(heave[-1]) - epoch_ns) % (S // 20) == 0, "it stays with the simulation's"


def test_an_epoch_that_cannot_be_is_ignored(bench: Bench) -> None:
    """In 1970, or more than a minute from now."""
    node = sea_state(bench)
    node.begin()
    heave = bench.listen("ship/heave")
    publisher = bench.publisher("twin/epoch")
    bench.until(publisher.get_subscription_count, "somebody awaits the epoch")
    for number, epoch_ns in enumerate((0, time.time_ns() + 3600 * S), start=1):
        publisher.publish(encode_epoch(epoch_ns))
        bench.until(lambda number=number: len(node._warned) == number, "it is noticed")
    assert not heave
    publisher.publish(encode_epoch(time.time_ns() + S))
    bench.until(lambda: heave, "one that can be is followed")


def test_the_recorded_sea_is_stamped_exactly_from_the_epoch(bench: Bench) -> None:
    heave, elevation = bench.listen("ship/heave"), bench.listen("sea/elevation")
    node = sea_state(bench)
    node.begin()
    epoch_ns = publish_epoch(bench)
    bench.until(lambda: len(heave) >= 20, "a second of heave")
    wanted = open_heave(load_scene(SCENE).sea_state.bag).between(-S // 10, 10 * S)[: len(heave)]
    assert [stamp_ns(m) - epoch_ns for m in heave] == [sample.stamp_ns for sample in wanted]
    assert [m.pose.pose.position.z for m in heave] == [sample.position_m for sample in wanted]
    assert [m.twist.twist.linear.z for m in heave] == [s.velocity_m_per_s for s in wanted]
    bench.until(lambda: len(elevation) >= 20, "the water comes along")
    assert stamp_ns(elevation[0]) == stamp_ns(heave[0])


def test_samples_come_before_their_time(bench: Bench) -> None:
    leads: list[float] = []
    from rope_twin.ros.qos import message_type, profile
    from rope_twin.topics import BY_NAME

    topic = BY_NAME["ship/heave"]
    bench.own.create_subscription(
        message_type(topic),
        topic.name,
        lambda data: leads.append((stamp_ns(decode(topic.name, data)) - time.time_ns()) * 1e-9),
        profile(topic.qos),
        raw=True,
    )
    node = sea_state(bench, lead_s=2.0)
    node.begin()
    publish_epoch(bench, ahead_s=0.4)
    bench.until(lambda: len(leads) >= 80, "some heave")
    settled = leads[45:]  # the first 1.6 s come in one go, as soon as there is an epoch
    assert np.median(settled) > 1.5
    assert max(leads) < 2.1


def test_the_bag_can_be_another_one_started_anywhere(bench: Bench) -> None:
    heave = bench.listen("ship/heave")
    node = sea_state(bench, bag="sea_6p5m", sea_offset_s=100.0)
    node.begin()
    publish_epoch(bench)
    bench.until(lambda: len(heave) >= 3, "heave")
    first = open_heave("sea_6p5m", start_s=100.0).between(-S // 10, S)[0]
    assert heave[0].pose.pose.position.z == first.position_m


def test_a_regular_heave_is_fed_like_a_bag(bench: Bench) -> None:
    heave = bench.listen("ship/heave")
    sea_state(bench, scene="smooth_2km").begin()
    epoch_ns = publish_epoch(bench)
    bench.until(lambda: len(heave) >= 20, "a second of heave")
    sea = open_sea(load_scene("smooth_2km"))
    assert sea is not None
    wanted = sea.between(-S // 10, 10 * S)[: len(heave)]
    assert [stamp_ns(m) - epoch_ns for m in heave] == [sample.stamp_ns for sample in wanted]
    assert [m.pose.pose.position.z for m in heave] == [sample.position_m for sample in wanted]
    assert [m.twist.twist.linear.z for m in heave] == [s.velocity_m_per_s for s in wanted]


def test_a_sea_can_be_made_from_a_spectrum_and_a_seed(bench: Bench) -> None:
    heave = bench.listen("ship/heave")
    node = sea_state(bench, significant_height_m=3.0, peak_period_s=10.0, seed=5)
    node.begin()
    publish_epoch(bench, ahead_s=0.5)
    bench.until(lambda: len(heave) >= 80, "four seconds of heave ahead")
    position = np.array([m.pose.pose.position.z for m in heave])
    velocity = np.array([m.twist.twist.linear.z for m in heave])
    steps = np.diff(position) / 0.05
    assert np.allclose(steps, 0.5 * (velocity[1:] + velocity[:-1]), atol=0.01)
    assert 0.0 < np.abs(position).max() < 3.0


def test_without_an_epoch_to_wait_for_it_starts_now(bench: Bench) -> None:
    heave = bench.listen("ship/heave")
    node = sea_state(bench, wait_for_epoch=False, lead_s=0.0)
    before_ns = time.time_ns()
    node.begin()
    bench.until(lambda: len(heave) >= 5, "heave at once")
    stamps = [stamp_ns(message) for message in heave]
    assert before_ns - S // 10 <= stamps[0] < stamps[-1] < time.time_ns() + S // 100


def test_by_simulated_time_it_starts_with_the_clock(bench: Bench) -> None:
    """Before the first message on /clock time is 0, which no stamp is made of."""
    from rosgraph_msgs.msg import Clock

    heave = bench.listen("ship/heave")
    node = sea_state(bench, wait_for_epoch=False, lead_s=0.0, use_sim_time=True)
    node.begin()
    clock = bench.own.create_publisher(Clock, "/clock", 10)
    message = Clock()
    message.clock.sec = 500
    begun_s = time.monotonic()

    def begun() -> bool:
        if time.monotonic() > begun_s + 0.3:
            clock.publish(message)
        return len(heave) >= 5

    bench.until(begun, "heave comes")
    assert stamp_ns(heave[0]) == pytest.approx(500 * S, abs=S)
    bench.own.destroy_publisher(clock)


def test_a_record_that_does_not_loop_ends_and_the_node_lives(bench: Bench) -> None:
    heave = bench.listen("ship/heave")
    node = sea_state(bench, sea_offset_s=1199.0, loop=False)
    node.begin()
    publish_epoch(bench)
    bench.until(lambda: node.ended, "the end is noticed")
    assert 15 <= len(heave) <= 24  # the last second, from 0.1 s before t = 0
    assert not node.finished


@pytest.mark.parametrize(
    ("parameters", "error", "words"),
    [
        ({"bag": "sea_9m"}, BagError, "sea_9m"),
        ({"sea_offset_s": 5000.0}, BagError, "5000"),
        ({"topic": "heaven"}, BagError, "heave"),
        ({"scene": "deep_lif"}, SceneError, "did you mean 'deep_lift'"),
        ({"significant_height_m": 12.0, "peak_period_s": 1.0}, InputError, "2 to 30 s"),
    ],
)
def test_what_cannot_be_played_gets_one_sentence(
    bench: Bench, parameters: dict[str, Any], error: type[Exception], words: str
) -> None:
    with pytest.raises(error, match=words) as caught:
        sea_state(bench, **parameters).begin()
    assert "\n" not in str(caught.value)


def test_the_schedule_is_stamped_exactly_from_the_epoch(bench: Bench) -> None:
    heard = bench.listen("winch/speed_command")
    winch_schedule(bench).begin()
    epoch_ns = publish_epoch(bench)
    bench.until(lambda: len(heard) >= 12, "commands")
    wanted = schedule_samples(load_scene(SCENE).winch, 0, 10 * S)[: len(heard)]
    assert [stamp_ns(m) - epoch_ns for m in heard] == [sample.stamp_ns for sample in wanted]
    assert [list(m.velocity) for m in heard] == [[sample.command.value] for sample in wanted]


def test_the_schedule_does_not_yield_to_a_publisher_whose_node_is_not_known_yet(
    bench: Bench, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The node of a publisher that has just started is unknown at first, outside ROS always."""
    monkeypatch.setattr(qos, "NAMELESS_S", 1.0)
    heard = bench.listen("winch/speed_command")
    node = winch_schedule(bench)
    known = node.get_publishers_info_by_topic

    def nameless(topic: str) -> list[Any]:
        ends = known(topic)
        for end in (end for end in ends if end.node_name != node.get_name()):
            end.node_name = "_NODE_NAME_UNKNOWN_"
        return ends

    node.begin()
    publish_epoch(bench)
    bench.until(lambda: heard, "the schedule commands")
    monkeypatch.setattr(node, "get_publishers_info_by_topic", nameless)
    began_s = time.monotonic()
    bench.publisher("winch/speed_command")
    bench.until(lambda: node.yielded, "it yields")
    assert time.monotonic() - began_s >= 1.0


def test_the_schedule_yields_for_good_to_who_takes_the_winch(bench: Bench) -> None:
    heard = bench.listen("winch/speed_command")
    node = winch_schedule(bench)
    node.begin()
    publish_epoch(bench)
    bench.until(lambda: heard, "the schedule commands")
    operator = bench.publisher("winch/speed_command")
    bench.until(lambda: node.yielded, "it yields")
    operator.publish(encode_speed(0, -0.3))
    bench.until(lambda: heard[-1].velocity[0] == -0.3, "the operator's command")
    count = len(heard)
    bench.own.destroy_publisher(operator)
    until = time.monotonic() + 0.5
    bench.until(lambda: time.monotonic() > until, "half a second")
    assert len(heard) == count


def test_a_scene_without_sea_or_schedule_is_left_alone(bench: Bench) -> None:
    sea = sea_state(bench, scene="still_water")
    winch = winch_schedule(bench, scene="still_water")
    sea.begin()
    winch.begin()
    assert bench.own.count_publishers("ship/heave") == 0
    assert bench.own.count_publishers("winch/speed_command") == 0


def test_a_twin_fed_live_takes_samples_stamped_with_ros_time(bench: Bench) -> None:
    simulation = bench.make("simulation", scene=SCENE, input_delay_s=3.0)
    simulation.begin()
    sensor = sea_state(bench, wait_for_epoch=False, lead_s=0.0)
    sensor.begin()

    def heave() -> Any:
        return simulation.paced.last.inputs["heave"]

    bench.until(lambda: heave().accepted >= 40, "two seconds of a live sensor")
    bench.until(lambda: abs(simulation.paced.last.heave_m) > 0.0, "the ship moves with it")
    assert heave().refused == 0
    assert not heave().stale

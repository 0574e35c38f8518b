"""The suite's executor serves what rclpy's does: timers, listeners, services, what comes late."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from typing import Any

import pytest
from ros_bench import PATIENCE_S

pytestmark = pytest.mark.ros


class Served:
    """Two nodes on a SuiteExecutor."""

    def __init__(self, number: int) -> None:
        import rclpy
        from rclpy.signals import SignalHandlerOptions

        from rope_twin.ros.middleware import SuiteExecutor

        rclpy.init(args=[], domain_id=number, signal_handler_options=SignalHandlerOptions.NO)
        self.executor = SuiteExecutor()
        self.one, self.two = rclpy.create_node("one"), rclpy.create_node("two")
        self.executor.add_node(self.one)

    def until(self, holds: Callable[[], bool]) -> None:
        """Spin until it holds."""
        end_s = time.monotonic() + PATIENCE_S
        while not holds():
            assert time.monotonic() < end_s
            self.executor.spin_once(timeout_sec=0.05)


@pytest.fixture
def served(domain: int) -> Iterator[Served]:
    import rclpy

    made = Served(domain)
    yield made
    made.executor.shutdown()
    made.one.destroy_node()
    made.two.destroy_node()
    rclpy.try_shutdown()


def test_a_node_and_a_listener_that_come_later_are_served(served: Served) -> None:
    """And one that is gone is not."""
    from std_msgs.msg import Float64

    ticks: list[int] = []
    heard: list[float] = []
    publisher = served.one.create_publisher(Float64, "number", 10)

    def tick() -> None:
        ticks.append(1)
        publisher.publish(Float64(data=float(len(ticks))))

    timer = served.one.create_timer(0.01, tick)
    served.until(lambda: len(ticks) > 3)
    served.executor.add_node(served.two)

    def hear(message: Any) -> None:
        heard.append(message.data)

    listener = served.two.create_subscription(Float64, "number", hear, 10)
    served.until(lambda: len(heard) > 3)
    assert heard == [heard[0] + k for k in range(len(heard))]
    served.two.destroy_subscription(listener)
    count, beats = len(heard), len(ticks)
    served.until(lambda: len(ticks) > beats + 5)
    assert len(heard) == count
    timer.cancel()
    beats = len(ticks)
    for _ in range(5):
        served.executor.spin_once(timeout_sec=0.02)
    assert len(ticks) <= beats + 1


def test_services_and_what_waits_for_them_are_served(served: Served) -> None:
    """A parameter of a node is read over ROS, by a client on the same executor."""
    from rcl_interfaces.srv import GetParameters

    served.executor.add_node(served.two)
    served.one.declare_parameter("depth", 7)
    client = served.two.create_client(GetParameters, "/one/get_parameters")
    assert client.wait_for_service(PATIENCE_S)
    future = client.call_async(GetParameters.Request(names=["depth"]))
    served.until(future.done)
    assert future.result().values[0].integer_value == 7


def test_a_service_knows_when_it_was_called(served: Served) -> None:
    """A winch does not act on a call that waited in the middleware."""
    from std_srvs.srv import Trigger

    from rope_twin.ros.middleware import sent_ago_s

    ages: list[float] = []

    def serve(request: Any, response: Any) -> Any:
        ages.append(sent_ago_s(service.sent_ns))
        return response

    service = served.one.create_service(Trigger, "late", serve)
    client = served.one.create_client(Trigger, "late")
    served.until(client.service_is_ready)
    called_s = time.time()
    client.call_async(Trigger.Request())
    time.sleep(0.3)
    served.until(lambda: bool(ages))
    assert 0.3 <= ages[0] <= time.time() - called_s


def test_a_callback_that_raises_is_heard_of(served: Served) -> None:
    def fail() -> None:
        raise ValueError("no")

    served.one.create_timer(0.01, fail)
    with pytest.raises(ValueError, match="no"):
        served.until(lambda: False)


def test_nothing_to_do_ends_at_the_timeout(served: Served) -> None:
    served.executor.spin_once(timeout_sec=0.0)
    served.executor.spin_once(timeout_sec=0.05)


def test_an_rclpy_of_other_make_serves_by_its_own(
    served: Served, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Earlier releases run what they take elsewhere: theirs is used then."""
    from rclpy.executors import SingleThreadedExecutor

    from rope_twin.ros.middleware import SuiteExecutor, make_executor

    assert isinstance(make_executor(), SuiteExecutor)
    monkeypatch.setattr(SingleThreadedExecutor, "_execute_timer", None, raising=False)
    assert type(make_executor()) is SingleThreadedExecutor

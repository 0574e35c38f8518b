"""The commander's seat over DDS: nodes by name, services, the latched topic, a lost commander."""

from __future__ import annotations

import time
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
from ros_bench import Bench, ros_ahead_ns

from rope_twin.messages import Level, Status, encode_order, encode_text
from rope_twin.run.border import LATE_S
from rope_twin.twin.winch.commands import WinchCommand

pytestmark = pytest.mark.ros


class Operators:
    """A simulation and nodes of given names that command its winch."""

    def __init__(self, bench: Bench, scene: str = "emergency_stop", **parameters: Any) -> None:
        self.bench = bench
        self.simulation = bench.make("simulation", scene=scene, **parameters)
        self.seats = bench.listen("winch/seat")
        self.simulation.begin()
        bench.until(lambda: self.seats, "who commands is said from the start")
        self.publishers: dict[tuple[str, str], Any] = {}
        self.nodes: dict[str, Any] = {}

    def tell(self, name: str, order: WinchCommand) -> None:
        """Publish an order to be executed at once, as a node of this name."""
        import rclpy

        from rope_twin.ros.qos import message_type, profile
        from rope_twin.topics import BY_NAME

        topic, data = encode_order(0, order)
        if name not in self.nodes:
            self.nodes[name] = self.bench.add(rclpy.create_node(name))
        if (name, topic) not in self.publishers:
            row = BY_NAME[topic]
            made = self.nodes[name].create_publisher(message_type(row), topic, profile(row.qos))
            self.publishers[name, topic] = made
            self.bench.until(made.get_subscription_count, "the twin listens")
        self.publishers[name, topic].publish(data)

    def leave(self, name: str) -> None:
        """End a node."""
        self.bench.remove(self.nodes.pop(name))

    def call(self, service: str, on: bool | None = None) -> Any:
        """The answer of a service."""
        from std_srvs.srv import SetBool, Trigger

        kind = Trigger if on is None else SetBool
        client = self.bench.own.create_client(kind, service)
        self.bench.until(client.service_is_ready, "the service is there")
        future = client.call_async(kind.Request(**({} if on is None else {"data": on})))
        self.bench.until(future.done, "its answer")
        return future.result()

    @property
    def held(self) -> str:
        """Last message of winch/seat."""
        return str(self.seats[-1].data)

    def row(self) -> Status:
        return next(
            row
            for row in self.simulation.paced.rows(ros_ahead_ns())
            if row.name.endswith("seat winch")
        )

    def refused(self) -> int:
        return int(self.row().values["refused"])

    @property
    def target(self) -> tuple[str, float]:
        """Commands that the winch got."""
        (winch,) = self.simulation.paced.last.winches
        return winch.mode, winch.target


def test_one_node_commands_by_priority_and_all_may_stop(bench: Bench) -> None:
    own = Operators(bench)
    assert own.held == "winch: free"
    own.tell("one", WinchCommand("speed", 0.2))
    bench.until(lambda: own.held == "winch: one", "the first has the seat")
    own.tell("two", WinchCommand("speed", -0.3))
    bench.until(lambda: own.refused() == 1, "an equal one is refused")
    assert "'speed' from node two rejected: one has the seat" in own.row().message
    assert own.row().level == Level.WARN
    own.tell("console", WinchCommand("speed", 0.1))
    bench.until(lambda: own.held == "winch: console", "one above it takes it")
    bench.until(lambda: own.target == ("speed", 0.1), "and commands")
    own.tell("two", WinchCommand("emergency_stop"))
    bench.until(lambda: own.target[0] == "emergency_stop", "a stop is everybody's")
    refused = own.refused()
    own.tell("two", WinchCommand("reset"))
    bench.until(lambda: own.refused() == refused + 1, "its reset is not")
    assert own.target[0] == "emergency_stop"
    own.tell("console", WinchCommand("reset"))
    bench.until(lambda: own.target[0] == "speed", "it is the commander's")
    assert own.held == "winch: console"


def test_a_winch_is_switched_by_services_while_its_seat_is_free(bench: Bench) -> None:
    own = Operators(bench)
    assert own.call("winch/emergency_stop").success
    bench.until(lambda: own.target[0] == "emergency_stop", "it stops")
    assert own.call("winch/reset").success
    bench.until(lambda: own.target[0] == "speed", "it is reset")
    assert own.call("winch/set_brake", False).success
    answer = own.call("winch/set_compensation", True)
    assert (answer.success, "no heave compensation" in answer.message) == (False, True)
    own.tell("console", WinchCommand("speed", 0.2))
    bench.until(lambda: own.held == "winch: console", "a commander takes the seat")
    answer = own.call("winch/reset")
    assert (answer.success, "console has the seat" in answer.message) == (False, True)
    assert own.call("winch/emergency_stop").success
    bench.until(lambda: own.target[0] == "emergency_stop", "the stop always works")


def test_a_state_is_saved_on_request(bench: Bench, tmp_path: Path) -> None:
    own = Operators(bench)
    answer = own.call("simulation/save_state")
    assert (answer.success, "save_state" in answer.message) == (False, True)
    own.simulation.close()
    bench.remove(own.simulation)  # or its service may answer in place of the next one's
    path = tmp_path / "run.state"
    other = Operators(bench, save_state=str(path), save_every_s=3600.0)
    assert other.call("simulation/save_state").success
    bench.until(path.exists, "the state")


def test_a_seat_is_asked_for_and_released_on_services(bench: Bench) -> None:
    own = Operators(bench)
    own.tell("one", WinchCommand("speed", 0.0))
    bench.until(lambda: own.held == "winch: one", "the first has the seat")
    answer = own.call("winch/take_seat")
    assert answer.success
    assert "one has the seat of winch" in answer.message
    own.tell("two", WinchCommand("speed", 0.0))
    bench.until(lambda: own.held == "winch: two", "it was asked for")
    bench.until(lambda: own.call("winch/release_seat").success, "it is released, once it is quiet")
    bench.until(lambda: own.held == "winch: free", "and free")
    own.tell("one", WinchCommand("speed", 0.0))
    bench.until(lambda: own.held == "winch: one", "for the first that commands")


def test_a_commander_that_leaves_is_lost_and_the_winch_ramps_to_zero(bench: Bench) -> None:
    own = Operators(bench)
    own.tell("console", WinchCommand("speed", 0.4))
    bench.until(lambda: own.target == ("speed", 0.4), "it commands")
    own.leave("console")
    bench.until(lambda: own.held.startswith("winch: free (console left the network"), "it is lost")
    assert own.row().level == Level.ERROR
    assert "ramp to zero; seat free" in own.row().message
    bench.until(lambda: own.target == ("speed", 0.0), "the winch stops")
    own.tell("two", WinchCommand("speed", 0.2))
    bench.until(lambda: own.target == ("speed", 0.2), "another one commands")
    assert own.row().level == Level.OK


def test_no_message_gives_what_the_seat_orders(bench: Bench) -> None:
    """An order to do as without a commander would get past the seat."""
    own = Operators(bench)
    own.tell("console", WinchCommand("speed", 0.4))
    bench.until(lambda: own.target == ("speed", 0.4), "it commands")
    own.tell("two", WinchCommand("commander_lost"))

    def malformed() -> int:
        rows = {row.name: row for row in own.simulation.paced.rows(ros_ahead_ns())}
        return int(rows["simulation: messages"].values["winch/switch_command"])

    bench.until(lambda: malformed() == 1, "it is refused")
    assert own.target == ("speed", 0.4)


def test_the_schedule_has_the_seat_and_yields_it_to_an_operator(bench: Bench) -> None:
    """Without an alarm; and its end with the run raises none."""
    own = Operators(bench, "shallow_lift", input_delay_s=1.0)
    schedule = bench.make("winch_schedule", scene="shallow_lift")
    schedule.begin()
    bench.until(lambda: own.held == "winch: winch_schedule", "the schedule commands")
    own.tell("bench_operator", WinchCommand("speed", 0.0))
    bench.until(lambda: own.held == "winch: bench_operator", "the operator does")
    bench.until(lambda: schedule.yielded, "the schedule yields")
    assert own.row().level == Level.OK, own.row().message
    assert "lost" not in " ".join(str(message.data) for message in own.seats)


def test_the_node_of_a_publisher_is_found_in_the_graph(
    bench: Bench, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A seat that a publisher took before its node was known goes to that node, by its name."""
    import rclpy

    from rope_twin.ros.qos import Senders, message_type, profile, publisher_name
    from rope_twin.topics import BY_NAME, WINCH_TOPICS

    node, row = bench.add(rclpy.create_node("operator")), BY_NAME["winch/switch_command"]
    node.create_publisher(message_type(row), row.name, profile(row.qos))
    own, senders = bench.own, Senders(bench.own)
    bench.until(lambda: own.count_publishers(row.name), "the publisher is in the graph")
    (end,) = own.get_publishers_info_by_topic(row.name)
    called = publisher_name(bytes(end.endpoint_gid))
    bench.until(lambda: senders.node_of(called, WINCH_TOPICS) == "operator", "its node is known")
    assert senders.node_of("operator", WINCH_TOPICS) == ""
    # the graph loses the names of nodes that were not heard for the lease of DDS, as in a stop
    forgotten = SimpleNamespace(node_name="_NODE_NAME_UNKNOWN_", endpoint_gid=end.endpoint_gid)
    monkeypatch.setattr(own, "get_publishers_info_by_topic", lambda topic: [forgotten])
    assert "operator" in senders.present(WINCH_TOPICS)
    assert senders.others(WINCH_TOPICS) == ["operator"]
    assert senders.node_of(publisher_name(b"\x00"), WINCH_TOPICS) == ""


def test_what_came_while_the_simulation_was_stopped_is_not_executed(bench: Bench) -> None:
    """A minute later the lift may be elsewhere: neither the winch nor an alert obeys, but a stop
    is executed.
    """
    own = Operators(bench)
    own.tell("panel", WinchCommand("speed", 0.2))
    bench.until(lambda: own.held == "winch: panel", "it commands")
    alerts = bench.publisher("alerts/command")
    bench.until(alerts.get_subscription_count, "the list listens")
    topic, faster = encode_order(0, WinchCommand("speed", 0.4))
    own.publishers["panel", topic].publish(faster)
    alerts.publish(encode_text("limit tension_n 190000"))
    time.sleep(LATE_S + 0.2)  # nothing is spun: this process stands
    paced = own.simulation.paced

    def late() -> int:
        rows = {row.name: row for row in paced.rows(ros_ahead_ns())}
        return int(rows["simulation: messages"].values["late commands"])

    bench.until(lambda: late() == 2, "both are refused")
    assert own.target == ("speed", 0.2)
    assert paced.alerts.row().message == "none beside those of the scene"
    own.tell("panel", WinchCommand("emergency_stop"))
    time.sleep(LATE_S + 0.2)
    bench.until(lambda: own.target[0] == "emergency_stop", "it stops")

"""Winch commander of the console node: service calls before discovery, clients made early."""

from __future__ import annotations

from typing import Any

import pytest

pytest.importorskip("rclpy")

from rope_twin.console.requests import LEARNING
from rope_twin.ros import console_node
from rope_twin.twin.winch.commands import EMERGENCY_STOP, WinchCommand


class FakeClient:
    """Client of a service that discovery finds late."""

    def __init__(self) -> None:
        self.ready, self.calls = False, 0

    def service_is_ready(self) -> bool:
        return self.ready

    def call_async(self, request: Any) -> None:
        self.calls += self.ready  # a call before discovery is lost


class FakePublisher:
    """Publisher without a subscription yet."""

    def __init__(self) -> None:
        self.matched, self.sent = 0, 0

    def get_subscription_count(self) -> int:
        return self.matched

    def publish(self, data: bytes) -> None:
        self.sent += 1


class FakeNode:
    """Node that makes fake clients."""

    def __init__(self) -> None:
        self.clients: dict[str, FakeClient] = {}

    def create_client(self, kind: Any, name: str) -> FakeClient:
        return self.clients.setdefault(name, FakeClient())

    def destroy_publisher(self, publisher: Any) -> None:
        pass


class Bench:
    """Commander on a fake node and a clock set by hand."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        self.node, self.now_s = FakeNode(), 100.0
        self.publishers: list[FakePublisher] = []
        monkeypatch.setattr(console_node, "publish", self._publish)
        monkeypatch.setattr("rope_twin.ros.console_node.time.monotonic", lambda: self.now_s)
        self.commander = console_node.WinchCommander(self.node)  # type: ignore[arg-type]

    def _publish(self, node: Any, topic: Any) -> FakePublisher:
        self.publishers.append(FakePublisher())
        return self.publishers[-1]

    def look(self, for_s: float) -> None:
        until_s = self.now_s + for_s
        while self.now_s < until_s:
            self.now_s += 0.05
            self.commander.prepare(("winch",))


STOP = "winch/emergency_stop"


@pytest.fixture
def bench(monkeypatch: pytest.MonkeyPatch) -> Bench:
    return Bench(monkeypatch)


def test_clients_are_made_as_soon_as_a_winch_is_known(bench: Bench) -> None:
    bench.look(0.1)
    of_winch = {STOP, "winch/take_seat", "winch/release_seat"}
    assert set(bench.node.clients) == of_winch | set(LEARNING.values())


def test_an_emergency_stop_before_discovery_is_called_once_it_is_found(bench: Bench) -> None:
    bench.commander.send("winch", WinchCommand(EMERGENCY_STOP))
    bench.look(0.5)
    bench.node.clients[STOP].ready = True
    bench.look(0.5)
    assert bench.node.clients[STOP].calls == 1


def test_a_call_is_not_made_long_after_it_was_asked_for(bench: Bench) -> None:
    bench.commander.send("winch", WinchCommand(EMERGENCY_STOP))
    bench.look(3.0)
    bench.node.clients[STOP].ready = True
    bench.look(1.0)
    assert bench.node.clients[STOP].calls == 0


def test_an_emergency_stop_does_not_depend_on_an_unmatched_publisher(bench: Bench) -> None:
    bench.look(0.1)
    bench.node.clients[STOP].ready = True
    bench.commander.take("winch")
    bench.commander.send("winch", WinchCommand(EMERGENCY_STOP))
    assert bench.node.clients[STOP].calls == 1
    for one in bench.publishers:
        one.matched = 1
    bench.commander.send("winch", WinchCommand(EMERGENCY_STOP))
    assert bench.node.clients[STOP].calls == 1
    assert sum(one.sent for one in bench.publishers) == 1


def test_a_released_seat_is_not_requested_afterwards(bench: Bench) -> None:
    bench.commander.take("winch")
    bench.commander.release()
    for client in bench.node.clients.values():
        client.ready = True
    bench.look(0.5)
    assert bench.node.clients["winch/take_seat"].calls == 0
    assert bench.node.clients["winch/release_seat"].calls == 1

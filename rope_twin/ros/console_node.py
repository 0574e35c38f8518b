"""Console node: serves the operator console to a running suite.

It polls its subscriptions 20 times a second from the web server's thread, each for its newest
message, instead of taking every message in a callback: at 50 Hz that is most of the work. They
belong to a node of their own, which no executor spins. The node `console` publishes winch commands,
with publishers that exist only while a page has the seat.
"""

from __future__ import annotations

import math
import os
import sys
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from functools import partial
from typing import Any

import rclpy
from rclpy.node import Node
from rclpy.parameter import Parameter
from std_srvs.srv import Trigger

from rope_twin import topics
from rope_twin.console.control import Outcome, RequestHandler, Token, new_token
from rope_twin.console.pages import Page, Pages
from rope_twin.console.readings import DIAGNOSTICS, SHOWN, Readings, Values
from rope_twin.console.requests import (
    LEARNING,
    Log,
    Requests,
    SeaLimits,
    scene_facts,
    session_facts,
)
from rope_twin.console.server import Server, announce, read_address
from rope_twin.errors import InputError, phrase
from rope_twin.forecast.orders import read_orders
from rope_twin.messages import encode_order, encode_text
from rope_twin.ros.entry import SuiteNode, leave, middleware, run_node
from rope_twin.ros.params import ConsoleParams, declare
from rope_twin.ros.qos import listen as subscribe
from rope_twin.ros.qos import message_type, publish
from rope_twin.scene.load import load_scene
from rope_twin.scene.load_chart import read_load_chart
from rope_twin.twin.winch.commands import EMERGENCY_STOP, WinchCommand

TOKEN = "ROPE_TWIN_CONSOLE_TOKEN"  # environment: the token of --control
_DIAGNOSTICS_DEPTH = 10  # several nodes publish there within one poll
# topics of which more than the newest message is kept: latched ones, and diagnostics
_QUEUED = {name for name in SHOWN if topics.BY_NAME[name].qos is topics.Qos.LATCHED} | {DIAGNOSTICS}
_RETRY_S, _RETRIES_S = 0.1, 2.0  # between tries of a service that is not there, and in all
NODE = "console"


class SuiteSource:
    """Topics of a running suite as a source of the console."""

    kind = "live"

    def __init__(self, like: Node | None = None) -> None:
        """Subscribe in the domain and namespace of a node; None: those of this process."""
        self._node = rclpy.create_node(
            "console_view",
            namespace=like.get_namespace() if like else None,
            context=like.context if like else None,
            enable_rosout=False,  # it has no topic nor service that `console` does not have
            start_parameter_services=False,
            parameter_overrides=[Parameter("start_type_description_service", value=False)],
        )
        self._subscriptions = []  # name of the topic, handle and type of message
        for name in SHOWN:
            subscription = subscribe(self._node, topics.BY_NAME[name], _never_called, _depth(name))
            self._subscriptions.append(
                (name, subscription.handle, message_type(topics.BY_NAME[name]))
            )

    def poll(self, readings: Readings, now_s: float) -> None:
        """Take what has arrived: of streams the newest message, of diagnostics every one."""
        for name, handle, kind in self._subscriptions:
            if not readings.due(name):
                continue
            with handle:
                received = handle.take_message(kind, True)
                while received is not None:
                    readings.take(name, received[0], now_s)
                    received = handle.take_message(kind, True) if name in _QUEUED else None

    def state(self) -> Values:
        """Return the state of the source: nothing beyond its messages."""
        return {}

    def close(self) -> None:
        """Unsubscribe."""
        self._node.destroy_node()


@contextmanager
def suite_source() -> Iterator[SuiteSource]:
    """Open a suite as a source in a process that is no node of it; logs go to no terminal."""
    with middleware("--disable-stdout-logs"):
        source = SuiteSource()
        leave(source._node)
        yield source


class WinchCommander:
    """Commands winches through the suite's topics and seat services."""

    name = NODE

    def __init__(self, node: Node) -> None:
        self._node = node
        self._publishers: dict[str, Any] = {}
        self._winches: list[str] = []
        self._clients: dict[str, Any] = {}
        self._queued: dict[str, float] = {}  # calls of services not there yet: until when to try
        self._checked_s = -math.inf
        self._alerts = publish(node, topics.BY_NAME[topics.ALERT_COMMAND])

    def prepare(self, winches: Sequence[str]) -> None:
        """Make the clients of the winches, so that they are matched in time; repeat lost calls."""
        for winch in winches:
            for act in (EMERGENCY_STOP, topics.TAKE, topics.RELEASE):
                self._client(topics.service_name(winch, act))
        for name in LEARNING.values():
            self._client(name)
        now_s = time.monotonic()
        if not self._queued or now_s - self._checked_s < _RETRY_S:
            return
        self._checked_s = now_s
        for name, until_s in list(self._queued.items()):
            client = self._client(name)
            if client.service_is_ready():
                client.call_async(Trigger.Request())
            elif now_s <= until_s:
                continue
            del self._queued[name]

    def take(self, winch: str) -> None:
        """Make the publishers, and request the seat if the service is there."""
        for name in topics.WINCH_TOPICS:
            if name not in self._publishers:
                self._publishers[name] = publish(self._node, topics.BY_NAME[name])
        if winch not in self._winches:
            self._winches.append(winch)
        self._call(topics.service_name(winch, topics.TAKE))

    def send(self, winch: str, command: WinchCommand) -> None:
        """Publish a command that applies immediately."""
        topic, data = encode_order(0, command, winch)
        publisher = self._publishers.get(topic)
        stop = command.kind == EMERGENCY_STOP
        # an emergency stop of a page without the seat, or before the twin has found the publisher
        if publisher is None or (stop and not publisher.get_subscription_count()):
            self._call(topics.service_name(winch, command.kind))
            return
        publisher.publish(data)

    def release(self) -> None:
        """Release the seats and remove the publishers."""
        for winch in self._winches:
            self._queued.pop(topics.service_name(winch, topics.TAKE), None)
            self._call(topics.service_name(winch, topics.RELEASE))
        self._winches.clear()
        for publisher in self._publishers.values():
            self._node.destroy_publisher(publisher)
        self._publishers.clear()

    def command_alerts(self, words: str) -> None:
        """Publish a command to the alert list."""
        self._alerts.publish(encode_text(words))

    def call(self, service: str) -> Callable[[], Outcome | None]:
        """Call a service of the suite; the result returns its answer, None while there is none."""
        client = self._client(service)
        if not client.service_is_ready():
            return lambda: None
        future = client.call_async(Trigger.Request())

        def outcome() -> Outcome | None:
            if not future.done() or future.result() is None:
                return None
            return bool(future.result().success), str(future.result().message)

        return outcome

    def _call(self, name: str) -> None:
        """Call a service without waiting; `winch/seat` and the winch's mode show the outcome.

        A call before the service is found would be lost: it is tried again for _RETRIES_S.
        """
        client = self._client(name)
        if client.service_is_ready():
            client.call_async(Trigger.Request())
        else:
            self._queued[name] = time.monotonic() + _RETRIES_S

    def _client(self, name: str) -> Any:
        client = self._clients.get(name)
        if client is None:
            client = self._clients[name] = self._node.create_client(Trigger, name)
        return client


class ConsoleNode(SuiteNode):
    """Serves the console; commands winches if the parameter `control` is true."""

    def __init__(
        self, announce: Callable[[str, str], None] = announce, **node_options: Any
    ) -> None:
        """Make the node; `announce` is called with the address and the token ("": no control)."""
        super().__init__(NODE, **node_options)
        self._announce = announce
        self._params = declare(self, ConsoleParams)
        self._what_if = publish(self, topics.BY_NAME[topics.WHAT_IF])
        self._server: Server | None = None

    def begin(self) -> None:
        """Bind the address and serve."""
        host, port = read_address(self._params.address)
        source = SuiteSource(self)
        scene = self._params.scene
        facts = scene_facts(load_scene(scene)) if scene else None
        pages = Pages(source, time.monotonic, facts, session_facts)
        secret = os.environ.get(TOKEN) or new_token()
        allowed = self._params.control
        commander = WinchCommander(self) if allowed else None
        token = Token(secret, time.monotonic) if allowed else None
        desk = RequestHandler(pages, time.monotonic, commander, token)
        pages.before_tick.append(desk.update)
        if commander is not None:
            Requests(pages, desk, commander)
        log = Log(pages)
        log.connect(desk)
        if self._params.load_chart:
            chart = read_load_chart(self._params.load_chart)
            SeaLimits(pages, chart, time.monotonic).connect(desk)
        desk.further["what_if"] = self._ask_orders
        self._server = Server(pages, desk, log, host, port)
        self._server.start()
        self._announce(self._server.address, secret if allowed else "")

    def _ask_orders(self, page: Page, content: Mapping[str, Any]) -> str:
        """Ask the forecast to compare orders; return why not, in one sentence, or ""."""
        words = content.get("orders")
        try:
            read_orders(words if isinstance(words, str) else "")
        except InputError as error:
            return str(error)
        if not self._what_if.get_subscription_count():
            return phrase("what if", "no forecast runs", "start the run with --ahead")
        self._what_if.publish(encode_text(str(words)))
        return ""

    @property
    def address(self) -> str:
        """Return the address for a browser; "": not served yet."""
        return self._server.address if self._server is not None else ""

    def close(self) -> None:
        """Stop serving."""
        if self._server is not None:
            self._server.close()
            self._server = None


def _depth(name: str) -> int | None:
    if name == DIAGNOSTICS:
        return _DIAGNOSTICS_DEPTH
    return None if topics.BY_NAME[name].qos is topics.Qos.LATCHED else 1


def _never_called(data: bytes) -> None:
    """Stand for a callback: messages are polled."""


main = partial(run_node, ConsoleNode)  # console entry

if __name__ == "__main__":
    sys.exit(main())

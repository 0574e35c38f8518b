"""The middleware of this installation: its reach, a round trip through it, and an executor.

The executor is for nodes with high message rates: it keeps its wait set between waits. rclpy's own
collects every entity of every node before each wait, and its handlers wake it once more for each
callback: with the nodes of the suite this takes 1 ms each time, a fifth of a core in total. Here
subscriptions and timers are served from one wait set, which is kept until an entity is created or
destroyed. Services, clients, events and tasks are rare and are left to rclpy's executor.

rclpy.experimental.EventsExecutor is as fast, but that of rclpy 9.1 fails while a suite is shut
down. This executor uses private parts of rclpy; where they differ, `make_executor` returns rclpy's
own executor.
"""

from __future__ import annotations

import os
import time
from contextlib import ExitStack
from pathlib import Path
from typing import Any, NamedTuple

import rclpy
from rclpy.context import Context
from rclpy.executors import ExternalShutdownException, SingleThreadedExecutor
from rclpy.impl.implementation_singleton import rclpy_implementation
from rclpy.waitable import NumberOfEntities
from std_msgs.msg import Float64

from rope_twin.errors import InputError
from rope_twin.files import share_dir

_NEEDED = ("_take_timer", "_take_subscription", "_take_service", "_guard", "_context", "_tasks")
_KINDS = {  # of entities, in the order of NumberOfEntities: where a node has them
    "subscription": "subscriptions",
    "guard_condition": "guards",
    "timer": "timers",
    "client": "clients",
    "service": "services",
}
_EARLIER = "_execute_timer"  # rclpy versions with it do not return the callback of a timer


def make_executor() -> SingleThreadedExecutor:
    """Return a SuiteExecutor if this rclpy has the parts that it needs, else rclpy's own."""
    executor = SingleThreadedExecutor()
    if hasattr(executor, _EARLIER) or not all(hasattr(executor, name) for name in _NEEDED):
        return executor
    executor.shutdown()
    return SuiteExecutor()


class SuiteExecutor(SingleThreadedExecutor):
    """Executor whose `spin_once` runs all ready callbacks; to be spun by one thread only."""

    def __init__(self) -> None:
        self._wait_set: _WaitSet | None = None
        super().__init__()

    def add_node(self, node: Any) -> bool:
        """Add a node."""
        self._wait_set = None
        return bool(super().add_node(node))

    def remove_node(self, node: Any) -> None:
        """Remove a node."""
        self._wait_set = None
        super().remove_node(node)

    def wake(self) -> None:
        """Drop the wait set, since an entity was created or destroyed."""
        self._wait_set = None
        super().wake()

    def shutdown(self, timeout_sec: float | None = None) -> bool:
        """Release all entities and stop serving."""
        self._wait_set = None
        return bool(super().shutdown(timeout_sec))

    def spin_once(self, timeout_sec: float | None = None) -> None:
        """Wait at most `timeout_sec` until an entity is ready, and run all ready callbacks.

        Raises:
            ExternalShutdownException: the context was shut down.
        """
        wait_set = self._wait_set
        if wait_set is None:
            wait_set = self._wait_set = _WaitSet(self.get_nodes(), self._guard, self._context)
        ready, has_others = wait_set.wait(timeout_sec)
        if not self._context.ok():
            raise ExternalShutdownException
        for timer in ready["timer"]:
            if timer.handle.is_timer_ready():
                _run(self._take_timer(timer))
        for subscription in ready["subscription"]:
            _run(self._take_subscription(subscription))
        if has_others or self._tasks:
            super().spin_once(timeout_sec=0.0)

    def _take_service(self, srv: Any) -> Any:
        """Return what executes a request, as rclpy's does, with its `sent_ns` for the callback."""
        with srv.handle:
            request, header = srv.handle.service_take_request(srv.srv_type.Request)

        async def execute() -> None:
            if header is not None:
                srv.sent_ns = header.source_timestamp
                srv.send_response(srv.callback(request, srv.srv_type.Response()), header)

        return execute


def sent_ago_s(sent_ns: int | None) -> float:
    """Return the time since a message was sent [s], 0 if that is not known.

    sent_ns: time at its sender, by the middleware, since 1970 [ns].
    """
    return (time.time_ns() - sent_ns) * 1e-9 if sent_ns else 0.0


class _WaitSet:
    """Wait set with all entities of some nodes; it holds references so that none is destroyed."""

    def __init__(self, nodes: list[Any], guard: Any, context: Any) -> None:
        self._references = ExitStack()
        self._guard = guard.handle
        self._waitables = [entity for node in nodes for entity in node.waitables]
        for entity in (guard.handle, context.handle, *self._waitables):
            self._references.enter_context(entity)
        # by kind and by the pointer that a wait set reports
        self._entities: dict[str, dict[int, Any]] = {}
        for kind, attribute in _KINDS.items():
            entities = [entity for node in nodes for entity in getattr(node, attribute)]
            for entity in entities:
                self._references.enter_context(entity.handle)
            self._entities[kind] = {entity.handle.pointer: entity for entity in entities}
        count = NumberOfEntities(*map(len, self._entities.values()))
        count.num_guard_conditions += 1
        for waitable in self._waitables:
            count += waitable.get_num_entities()
        self._handle = rclpy_implementation.WaitSet(
            count.num_subscriptions,
            count.num_guard_conditions,
            count.num_timers,
            count.num_clients,
            count.num_services,
            count.num_events,
            context.handle,
        )

    def __del__(self) -> None:
        self._references.close()

    def wait(self, timeout_s: float | None) -> tuple[dict[str, list[Any]], bool]:
        """Wait at most `timeout_s` for any entity (None: for ever).

        Return the ready entities by kind, and whether others than timers and subscriptions are.
        """
        wait_set: Any = self._handle
        wait_set.clear_entities()
        for kind, entities in self._entities.items():
            add = getattr(wait_set, f"add_{kind}")
            for entity in entities.values():
                add(entity.handle)
        wait_set.add_guard_condition(self._guard)
        for waitable in self._waitables:
            waitable.add_to_wait_set(wait_set)
        wait_set.wait(-1 if timeout_s is None else round(timeout_s * 1e9))
        ready = {
            kind: [entities[p] for p in wait_set.get_ready_entities(kind) if p in entities]
            for kind, entities in self._entities.items()
        }
        guards = ready["guard_condition"]
        for guard in guards:  # the wait has consumed the trigger: set it again for rclpy's executor
            guard._executor_triggered = True
        has_others = bool(guards or ready["service"] or ready["client"])
        return ready, has_others or any(entity.is_ready(wait_set) for entity in self._waitables)


def _run(call: Any) -> None:
    """Run the callback that was taken, if any; callbacks here are plain functions."""
    if call is not None:
        coroutine = call()
        try:
            coroutine.send(None)
        except StopIteration:
            return
        raise RuntimeError("a callback of the suite is a coroutine that waits")


DISCOVERY_RANGE = "ROS_AUTOMATIC_DISCOVERY_RANGE"
PROFILE = "FASTDDS_DEFAULT_PROFILES_FILE"
_PATIENCE_S = 0.05  # with a message, which is lost while the participants do not know each other
_COUNTED = 5  # messages; the fastest is reported


class RoundTrip(NamedTuple):
    """Time until two participants found each other, and of one message between them."""

    discovery_s: float
    latency_s: float


def keep_to_loopback() -> None:
    """Restrict the nodes of this process and of its child processes to this machine.

    To be called before `initialise`. An environment that already has ROS_AUTOMATIC_DISCOVERY_RANGE
    is left unchanged. The variable limits discovery only; the Fast DDS profile restricts reception
    to the loopback interface, unless the environment names another profile.
    """
    if DISCOVERY_RANGE in os.environ:
        return
    os.environ[DISCOVERY_RANGE] = "LOCALHOST"
    profile = share_dir() / "config" / "ros" / "fastdds_loopback.xml"
    os.environ.setdefault(PROFILE, str(profile))


def check_profile() -> None:
    """Check that a profile which the environment names exists.

    Fast DDS would use its defaults without a word, and receive on every network interface.

    Raises:
        InputError: there is no such file.
    """
    profile = os.environ.get(PROFILE, "")
    if profile and not Path(profile).is_file():
        remedy = "name a profile of Fast DDS, or unset it"
        raise InputError(f"environment, {PROFILE}", f"there is no file '{profile}'", remedy)


def rmw_name() -> str:
    """Return the name of the RMW implementation, which is loaded for it."""
    return str(rclpy.get_rmw_implementation_identifier())


def round_trip(timeout_s: float) -> RoundTrip:
    """Publish from one DDS participant to another on this machine, as nodes of a run do.

    Raises:
        InputError: rclpy cannot be initialised, or no message arrives in time.
    """
    keep_to_loopback()
    check_profile()
    contexts = Context(), Context()
    try:
        for context in contexts:
            rclpy.init(args=[], context=context)
        return _exchange(contexts, timeout_s)
    except InputError:
        raise
    except Exception as error:  # rcl raises RuntimeErrors of several kinds
        remedy = "check RMW_IMPLEMENTATION and that ROS is sourced or its wheels are installed"
        raise InputError("ROS", str(error).splitlines()[0].rstrip("."), remedy) from error
    finally:
        for context in contexts:
            if context.ok():
                context.shutdown()


def _exchange(contexts: tuple[Context, Context], timeout_s: float) -> RoundTrip:
    name, topic = f"doctor_{os.getpid()}", f"rope_twin_doctor_{os.getpid()}"
    talker = rclpy.create_node(f"{name}_talker", context=contexts[0])
    listener = rclpy.create_node(f"{name}_listener", context=contexts[1])
    executor = SingleThreadedExecutor(context=contexts[1])
    executor.add_node(listener)
    received: list[float] = []  # when the messages were sent that have arrived
    listener.create_subscription(Float64, topic, lambda message: received.append(message.data), 10)
    publisher = talker.create_publisher(Float64, topic, 10)
    began_s, found_s = time.monotonic(), 0.0
    latencies: list[float] = []
    try:
        while len(latencies) < _COUNTED:
            sent_s = time.monotonic()
            if sent_s - began_s > timeout_s:
                problem = f"no message from one node to another within {timeout_s:g} s"
                raise InputError("DDS", problem, "allow UDP on the loopback interface")
            publisher.publish(Float64(data=sent_s))
            while sent_s not in received and time.monotonic() - sent_s < _PATIENCE_S:
                executor.spin_once(timeout_sec=_PATIENCE_S)
            if sent_s in received:
                found_s = found_s or time.monotonic()
                latencies.append(time.monotonic() - sent_s)
    finally:
        executor.shutdown()
        talker.destroy_node()
        listener.destroy_node()
    return RoundTrip(found_s - began_s, min(latencies))

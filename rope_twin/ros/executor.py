"""Executor for nodes with high message rates: it keeps its wait set between waits.

rclpy's executor collects every entity of every node before each wait, and its handlers wake it once
more for each callback: with the nodes of the suite this takes 1 ms each time, a fifth of a core in
total. Here subscriptions and timers are served from one wait set, which is kept until an entity is
created or destroyed. Services, clients, events and tasks are rare and are left to rclpy's executor.

rclpy.experimental.EventsExecutor is as fast, but that of rclpy 9.1 fails while a suite is shut
down. This executor uses private parts of rclpy; where they differ, `make_executor` returns rclpy's
own executor.
"""

from __future__ import annotations

from contextlib import ExitStack
from typing import Any, NamedTuple

from rclpy.executors import ExternalShutdownException, SingleThreadedExecutor
from rclpy.impl.implementation_singleton import rclpy_implementation
from rclpy.waitable import NumberOfEntities

_NEEDED = ("_take_timer", "_take_subscription", "_guard", "_context", "_tasks")
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
        ready = wait_set.wait(timeout_sec)
        if not self._context.ok():
            raise ExternalShutdownException
        for timer in ready.timers:
            if timer.handle.is_timer_ready():
                _run(self._take_timer(timer))
        for subscription in ready.subscriptions:
            _run(self._take_subscription(subscription))
        if ready.others or self._tasks:
            super().spin_once(timeout_sec=0.0)


class _Ready(NamedTuple):
    """Ready entities after a wait."""

    timers: list[Any]
    subscriptions: list[Any]
    others: bool


class _WaitSet:
    """Wait set with all entities of some nodes; it holds references so that none is destroyed."""

    def __init__(self, nodes: list[Any], guard: Any, context: Any) -> None:
        references = self._references = ExitStack()
        self._timers = _by_pointer(references, [timer for node in nodes for timer in node.timers])
        self._subscriptions = _by_pointer(
            references, [subscription for node in nodes for subscription in node.subscriptions]
        )
        self._services = _by_pointer(
            references, [service for node in nodes for service in node.services]
        )
        self._clients = _by_pointer(
            references, [client for node in nodes for client in node.clients]
        )
        self._guards = _by_pointer(references, [entity for node in nodes for entity in node.guards])
        self._guard = guard.handle
        self._waitables = [entity for node in nodes for entity in node.waitables]
        for entity in (guard.handle, context.handle, *self._waitables):
            references.enter_context(entity)
        count = NumberOfEntities(
            len(self._subscriptions),
            len(self._guards) + 1,
            len(self._timers),
            len(self._clients),
            len(self._services),
        )
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

    def wait(self, timeout_s: float | None) -> _Ready:
        """Wait at most `timeout_s` for any entity (None: for ever) and return the ready ones."""
        wait_set = self._handle
        wait_set.clear_entities()
        for subscription in self._subscriptions.values():
            wait_set.add_subscription(subscription.handle)
        for timer in self._timers.values():
            wait_set.add_timer(timer.handle)
        for service in self._services.values():
            wait_set.add_service(service.handle)
        for client in self._clients.values():
            wait_set.add_client(client.handle)
        for entity in self._guards.values():
            wait_set.add_guard_condition(entity.handle)
        wait_set.add_guard_condition(self._guard)
        for waitable in self._waitables:
            waitable.add_to_wait_set(wait_set)
        wait_set.wait(-1 if timeout_s is None else round(timeout_s * 1e9))
        guards = _ready(self._guards, wait_set.get_ready_entities("guard_condition"))
        for guard in guards:  # the wait has consumed the trigger: set it again for rclpy's executor
            guard._executor_triggered = True
        has_others = (
            bool(wait_set.get_ready_entities("service"))
            or bool(wait_set.get_ready_entities("client"))
            or bool(guards)
            or any(entity.is_ready(wait_set) for entity in self._waitables)
        )
        return _Ready(
            _ready(self._timers, wait_set.get_ready_entities("timer")),
            _ready(self._subscriptions, wait_set.get_ready_entities("subscription")),
            has_others,
        )


def _by_pointer(references: ExitStack, entities: list[Any]) -> dict[int, Any]:
    """Return the entities by the pointer that a wait set reports, and hold a reference to each."""
    for entity in entities:
        references.enter_context(entity.handle)
    return {entity.handle.pointer: entity for entity in entities}


def _ready(entities: dict[int, Any], pointers: list[int]) -> list[Any]:
    return [entities[pointer] for pointer in pointers if pointer in entities]


def _run(call: Any) -> None:
    """Run the callback that was taken, if any; callbacks here are plain functions."""
    if call is not None:
        coroutine = call()
        try:
            coroutine.send(None)
        except StopIteration:
            return
        raise RuntimeError("a callback of the suite is a coroutine that waits")

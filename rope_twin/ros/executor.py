"""Executor for nodes with high message rates: it keeps its wait set instead of rebuilding it.

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
    plain = SingleThreadedExecutor()
    if hasattr(plain, _EARLIER) or not all(hasattr(plain, name) for name in _NEEDED):
        return plain
    plain.shutdown()
    return SuiteExecutor()


class SuiteExecutor(SingleThreadedExecutor):
    """Executor whose `spin_once` runs all ready callbacks; to be spun by one thread only."""

    def __init__(self) -> None:
        self._gathered: _Gathered | None = None
        super().__init__()

    def add_node(self, node: Any) -> bool:
        """Add a node."""
        self._gathered = None
        return bool(super().add_node(node))

    def remove_node(self, node: Any) -> None:
        """Remove a node."""
        self._gathered = None
        super().remove_node(node)

    def wake(self) -> None:
        """Drop the wait set, since an entity was created or destroyed."""
        self._gathered = None
        super().wake()

    def shutdown(self, timeout_sec: float | None = None) -> bool:
        """Release all entities and stop serving."""
        self._gathered = None
        return bool(super().shutdown(timeout_sec))

    def spin_once(self, timeout_sec: float | None = None) -> None:
        """Wait at most `timeout_sec` until an entity is ready, and run all ready callbacks.

        Raises:
            ExternalShutdownException: the context was shut down.
        """
        gathered = self._gathered
        if gathered is None:
            gathered = self._gathered = _Gathered(self.get_nodes(), self._guard, self._context)
        ready = gathered.wait(timeout_sec)
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


class _Gathered:
    """Wait set with all entities of some nodes, which are held so that none is destroyed."""

    def __init__(self, nodes: list[Any], guard: Any, context: Any) -> None:
        held = self._held = ExitStack()
        self._timers = _by_pointer(held, [timer for node in nodes for timer in node.timers])
        self._subscriptions = _by_pointer(
            held, [subscription for node in nodes for subscription in node.subscriptions]
        )
        self._services = _by_pointer(held, [service for node in nodes for service in node.services])
        self._clients = _by_pointer(held, [client for node in nodes for client in node.clients])
        self._guards = _by_pointer(held, [one for node in nodes for one in node.guards])
        self._guard = guard.handle
        self._waitables = [one for node in nodes for one in node.waitables]
        for one in (guard.handle, context.handle, *self._waitables):
            held.enter_context(one)
        count = NumberOfEntities(
            len(self._subscriptions),
            len(self._guards) + 1,
            len(self._timers),
            len(self._clients),
            len(self._services),
        )
        for waitable in self._waitables:
            count += waitable.get_num_entities()
        self._set = rclpy_implementation.WaitSet(
            count.num_subscriptions,
            count.num_guard_conditions,
            count.num_timers,
            count.num_clients,
            count.num_services,
            count.num_events,
            context.handle,
        )

    def __del__(self) -> None:
        self._held.close()

    def wait(self, timeout_s: float | None) -> _Ready:
        """Wait at most `timeout_s` for any entity (None: for ever) and return the ready ones."""
        found = self._set
        found.clear_entities()
        for subscription in self._subscriptions.values():
            found.add_subscription(subscription.handle)
        for timer in self._timers.values():
            found.add_timer(timer.handle)
        for service in self._services.values():
            found.add_service(service.handle)
        for client in self._clients.values():
            found.add_client(client.handle)
        for one in self._guards.values():
            found.add_guard_condition(one.handle)
        found.add_guard_condition(self._guard)
        for waitable in self._waitables:
            waitable.add_to_wait_set(found)
        found.wait(-1 if timeout_s is None else round(timeout_s * 1e9))
        guards = _of(self._guards, found.get_ready_entities("guard_condition"))
        for guard in guards:  # the wait has consumed the trigger: set it again for rclpy's executor
            guard._executor_triggered = True
        others = (
            bool(found.get_ready_entities("service"))
            or bool(found.get_ready_entities("client"))
            or bool(guards)
            or any(one.is_ready(found) for one in self._waitables)
        )
        return _Ready(
            _of(self._timers, found.get_ready_entities("timer")),
            _of(self._subscriptions, found.get_ready_entities("subscription")),
            others,
        )


def _by_pointer(held: ExitStack, entities: list[Any]) -> dict[int, Any]:
    """Return the entities by the pointer that a wait set reports, each of them held."""
    for entity in entities:
        held.enter_context(entity.handle)
    return {entity.handle.pointer: entity for entity in entities}


def _of(entities: dict[int, Any], pointers: list[int]) -> list[Any]:
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

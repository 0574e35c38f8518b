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
from typing import Any

from rclpy.executors import ExternalShutdownException, SingleThreadedExecutor
from rclpy.impl.implementation_singleton import rclpy_implementation
from rclpy.waitable import NumberOfEntities

_NEEDED = ("_take_timer", "_take_subscription", "_guard", "_context", "_tasks")
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

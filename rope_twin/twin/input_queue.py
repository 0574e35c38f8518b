"""Queue of inputs to a twin: applied at the beginning of a cycle, and logged.

Callbacks submit inputs from any thread; the stepping thread applies them before each cycle in the
order of arrival. The result then depends only on the log: the calls and their instants. The log
includes changes of the accuracy level, since these follow the CPU load.
`rope_twin.recording.exact_replay` repeats a run from such a log.
"""

from __future__ import annotations

import threading
from collections import deque
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from rope_twin.errors import InputError, phrase
from rope_twin.scene.error_bound import AccuracyLevel
from rope_twin.twin.motion.ship_motion import ShipPose
from rope_twin.twin.pacing import Steppable
from rope_twin.twin.readings import Measurement
from rope_twin.twin.snapshot import Snapshot
from rope_twin.twin.twin import Twin
from rope_twin.twin.winch.commands import EMERGENCY_STOP, WinchCommand

WAITING_LIMIT = 1_000_000  # numbers that may wait for the next cycle, 8 MB
SET_LEVEL = "set_level"
_INVALIDATE = "invalidate_inputs"
_REMARK = "take_remark"
_PARTS = {kind.__name__: kind for kind in (ShipPose, WinchCommand, AccuracyLevel, Measurement)}


class Call(NamedTuple):
    """One call of a method of the twin."""

    method: str
    arguments: tuple[Any, ...]
    named: dict[str, Any]


class LogEntry(NamedTuple):
    """Calls made at one instant, in their order."""

    time_ns: int  # twin time, at the beginning of a cycle
    calls: tuple[Call, ...]


def apply(twin: Twin, calls: tuple[Call, ...]) -> None:
    """Make the calls of a log entry; the twin counts the inputs that it rejects."""
    for method, arguments, named in calls:
        try:  # noqa: SIM105 - `suppress` takes as long as the call
            getattr(twin, method)(*arguments, **named)
        except InputError:
            pass


def _is_stop(call: Call) -> bool:
    """Return whether a call is an emergency stop, for which there is always room."""
    return call.method == "submit_command" and call.arguments[1].kind == EMERGENCY_STOP


def _queued(method: str) -> Callable[..., str]:
    """Return a method that queues a call of the twin's; it returns "" or the rejection."""

    def queue_call(queue: InputQueue, *arguments: Any, **named: Any) -> str:
        return queue._put(Call(method, arguments, named))

    return queue_call


class InputQueue:
    """A twin for the pacer that applies its inputs between cycles only.

    Its `submit_*` methods, `take_remark` and `invalidate_inputs` take the arguments of the twin's,
    from any thread, and return "" or the reason why the full queue rejects them.
    """

    def __init__(
        self, twin: Twin, stepper: Steppable, log: Callable[[LogEntry], None] | None = None
    ) -> None:
        """Queue inputs of `twin`, stepped by `stepper` or itself; `log` receives each log entry."""
        self._twin = twin
        self._stepper = stepper
        self._log = log
        self._lock = threading.Lock()
        self._waiting: list[Call] = []
        self._waiting_numbers = 0
        self._level = twin.level
        self._due: deque[Callable[[], None]] = deque()
        self.refused = 0  # inputs rejected because the queue was full

    @property
    def step_ns(self) -> int:
        """Length of a step [ns]."""
        return self._stepper.step_ns

    def begin(self) -> None:
        """Start a session of the log; its header must state the accuracy level."""
        self._level = self._twin.level
        self._due.clear()

    def at_next_slot(self, call: Callable[[], None]) -> None:
        """Make the stepping thread call a function once, before the inputs of its next cycle."""
        self._due.append(call)

    def advance(self, steps: int) -> None:
        """Apply the inputs that came since the previous cycle, then advance.

        Raises:
            SolverError: a step failed.
        """
        while self._due:
            self._due.popleft()()
        self._apply()
        self._stepper.advance(steps)

    def snapshot(self) -> Snapshot:
        """Return a frozen copy of the present."""
        return self._stepper.snapshot()

    submit_heave, submit_pose = _queued("submit_heave"), _queued("submit_pose")
    submit_lower_end = _queued("submit_lower_end")
    submit_command, submit_cut = _queued("submit_command"), _queued("submit_cut")
    submit_current, submit_measurement = _queued("submit_current"), _queued("submit_measurement")
    submit_figures, take_remark = _queued("submit_figures"), _queued(_REMARK)
    submit_forecast_score, invalidate_inputs = (
        _queued("submit_forecast_score"),
        _queued(_INVALIDATE),
    )

    def _put(self, call: Call) -> str:
        size = (
            sum(argument.size for argument in call.arguments if isinstance(argument, np.ndarray))
            or 1
        )
        with self._lock:
            if self._waiting_numbers + size > WAITING_LIMIT and not _is_stop(call):
                self.refused += 1
                problem = f"inputs of {self._waiting_numbers} numbers wait for the next slot"
                return phrase(call.method, problem, "send fewer, or let the twin run")
            self._waiting.append(call)
            self._waiting_numbers += size
        return ""

    def _apply(self) -> None:
        level = self._twin.level
        if not self._waiting and level is self._level:
            return
        with self._lock:
            calls, self._waiting, self._waiting_numbers = tuple(self._waiting), [], 0
        now_ns = self._twin.time_ns
        apply(self._twin, calls)
        if level != self._level:  # changed since the previous cycle, before these calls
            calls = (Call(SET_LEVEL, (level,), {}), *calls)
        self._level = level
        if self._log is not None and calls:
            self._log(LogEntry(now_ns, calls))


def plain_calls(calls: tuple[Call, ...]) -> list[Any]:
    """Return the calls in a form for JSON; `calls_of` restores them bit-identically."""
    return [[call.method, _plain(call.arguments), _plain(call.named)] for call in calls]


def calls_of(plain: Any) -> tuple[Call, ...]:
    """Return the calls of their JSON form.

    Raises:
        ValueError: the argument is not the JSON form of calls.
    """
    try:
        return tuple(_call(*entry) for entry in plain)
    except (TypeError, KeyError, AttributeError) as error:
        raise ValueError(f"no calls: {error}") from error


def _call(method: str, arguments: Any, named: Any) -> Call:
    if not (method.startswith("submit_") or method in (_INVALIDATE, _REMARK, SET_LEVEL)):
        raise ValueError(f"'{method}' is no input")
    named_values = {str(name): _value(value) for name, value in named.items()}
    return Call(method, tuple(_value(value) for value in arguments), named_values)


def _plain(value: Any) -> Any:
    """Return numbers, strings and lists; arrays and types of the twin become one-key objects."""
    if isinstance(value, np.ndarray):
        return {"array": value.tolist()}
    if isinstance(value, np.generic):
        return value.item()
    if isinstance(value, dict):
        return {name: _plain(part) for name, part in value.items()}
    if type(value).__name__ in _PARTS:
        fields = value._asdict() if isinstance(value, WinchCommand | Measurement) else vars(value)
        return {type(value).__name__: {name: _plain(part) for name, part in fields.items()}}
    if isinstance(value, list | tuple):
        return [_plain(part) for part in value]
    if value is None or isinstance(value, bool | int | float | str):
        return value
    raise TypeError(f"a {type(value).__name__} cannot be logged")


def _value(plain: Any) -> Any:
    if isinstance(plain, list):
        return tuple(_value(part) for part in plain)
    if not isinstance(plain, dict):
        return plain
    ((kind, content),) = plain.items()
    if kind == "array":
        return np.array(content, dtype=float)
    return _PARTS[kind](**{name: _value(part) for name, part in content.items()})

"""Viewer node: shows the suite in rerun, in a window or an .rrd file.

Callbacks only queue bytes; the viewer's own thread decodes and draws, at most `rate_hz` times per
second. Every scalar is kept; of large topics only the newest message is drawn. A message that is
not what its topic carries is left out. A failure of the viewer does not affect the run.
"""

from __future__ import annotations

import sys
import threading
import time
from collections import deque
from functools import partial
from pathlib import Path
from typing import Any

from rope_twin.errors import InputError, RopeTwinError
from rope_twin.messages import decode
from rope_twin.ros.entry import SuiteNode, run_node
from rope_twin.ros.params import ViewerParams, declare
from rope_twin.ros.qos import Senders, listen
from rope_twin.topics import BY_NAME, Qos
from rope_twin.view.rope_view import SHOWN_TOPICS, RopeView
from rope_twin.view.sinks import FileSink, WindowSink, load_rerun

_DEPTH = 200  # messages of a topic that may queue in the middleware
_QUEUE = 5000  # messages that may queue for a viewer that is slow to start
_NEWEST_ONLY = (
    "ropes/nodes", "ropes/element_tension", "payloads/state", "payloads/body", "slings/state",
    "struts/state", "sea/elevation",
)  # fmt: skip
# raised for a message that any node may send: other columns, sizes or names
_MALFORMED = (InputError, LookupError, ValueError, TypeError)


class ViewerNode(SuiteNode):
    """Subscribes to the topics that RopeView shows."""

    def __init__(self, **node_options: Any) -> None:
        super().__init__("viewer", **node_options)
        self._params = declare(self, ViewerParams)
        self._queue: deque[tuple[str, int, bytes]] = deque(maxlen=_QUEUE)
        self._closing = threading.Event()
        self._thread: threading.Thread | None = None
        self._senders = Senders(self)
        self.failure = ""  # why the run is not shown, complete once closed
        self._malformed: set[str] = set()  # topics of which a message was left out
        self._shut = False  # the user has closed the window

    def begin(self) -> None:
        """Subscribe and open the view, on its own thread, as a window takes seconds to open.

        rerun is loaded here: loading it while the simulation runs would cause missed deadlines.
        """
        try:
            load_rerun()
        except InputError as error:
            self._fail(str(error))
            return
        for name in SHOWN_TOPICS:
            topic = BY_NAME[name]
            depth = 1 if topic.qos is Qos.LATCHED else _DEPTH
            listen(self, topic, self._taker(name), depth)
        self._thread = threading.Thread(target=self._run, name="viewer", daemon=True)
        self._thread.start()

    @property
    def finished(self) -> bool:
        """Return whether the window was closed.

        Raises:
            InputError: the view could not be opened.
        """
        if self.failure:
            raise InputError(self.failure)
        return self._shut

    @property
    def exit_code(self) -> int:
        """Return 1 if the view could not be opened or written."""
        return int(bool(self.failure))

    def close(self) -> None:
        """Show the queued messages and close the view; a window stays open for the user."""
        self._closing.set()
        if self._thread is not None:
            self._thread.join()
            self._thread = None

    def _taker(self, name: str) -> Any:
        def take(data: bytes, info: dict[str, Any]) -> None:
            if name == "twin/epoch":  # another node's epoch would shift all curves
                sender = self._senders.name(name, info)
                if sender not in ("", self._params.simulation_node):
                    return
            self._queue.append((name, info["source_timestamp"] or time.time_ns(), data))

        return take

    def _run(self) -> None:
        try:
            self._show()
        except RopeTwinError as error:
            self._fail(str(error))
        except Exception as error:  # whatever rerun raises: the run continues without a view
            self._fail(f"view: {type(error).__name__}: {error}")

    def _fail(self, sentence: str) -> None:
        self.failure = sentence
        self.get_logger().warning(f"run not shown: {sentence}")

    def _show(self) -> None:
        file = self._params.file
        sink = FileSink(Path(file)) if file else WindowSink()
        view = RopeView(sink)
        period_s = 1.0 / self._params.rate_hz
        ending = False
        while not ending:
            ending = self._closing.wait(period_s)
            self._draw(view)
            if isinstance(sink, WindowSink) and not sink.alive and not self._shut:
                self._shut = True
                self.get_logger().info("window closed; the run continues")
        view.close()

    def _draw(self, view: RopeView) -> None:
        batch = [self._queue.popleft() for _ in range(len(self._queue))]
        newest = {name: index for index, (name, _, _) in enumerate(batch)}
        for index, (name, time_ns, data) in enumerate(batch):
            if name in _NEWEST_ONLY and newest[name] != index:
                continue
            try:
                view.show(name, decode(name, data), time_ns)
            except _MALFORMED as error:
                if name not in self._malformed:
                    self._malformed.add(name)
                    self.get_logger().warning(f"{name}: message not shown: {error}")
        view.flush()


main = partial(run_node, ViewerNode)  # console entry

if __name__ == "__main__":
    sys.exit(main())

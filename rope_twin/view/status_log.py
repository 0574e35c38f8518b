"""What happens, as lines of text: a status when it changes, an event when it comes."""

from __future__ import annotations

from typing import Any

_LEVELS = ("INFO", "WARN", "ERROR")


class StatusLog:
    """Lines at one place of a recording, at the time that its stream is set to."""

    def __init__(self, stream: Any, path: str) -> None:
        self._stream, self._path = stream, path
        self._told: dict[str, tuple[int, str]] = {}

    def write(self, words: str, level: str = "INFO") -> None:
        """A line."""
        import rerun as rr

        self._stream.log(self._path, rr.TextLog(words, level=level))

    def take(self, status: Any) -> None:
        """A decoded DiagnosticStatus: a line if its level or its words changed."""
        level = status.level[0] if isinstance(status.level, bytes) else int(status.level)
        if self._told.get(status.name) != (level, status.message):
            self._told[status.name] = (level, status.message)
            self.write(f"{status.name}: {status.message}", _LEVELS[min(level, 2)])

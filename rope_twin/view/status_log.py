"""Text log of the view: a line for each change of a status, and for each event."""

from __future__ import annotations

from typing import Any

_LEVELS = ("INFO", "WARN", "ERROR")


class StatusLog:
    """Log at one path of a recording, at the current time of its stream."""

    def __init__(self, stream: Any, path: str) -> None:
        self._stream, self._path = stream, path
        self._logged: dict[str, tuple[int, str]] = {}

    def write(self, words: str, level: str = "INFO") -> None:
        """Write a line."""
        import rerun as rr

        self._stream.log(self._path, rr.TextLog(words, level=level))

    def take(self, status: Any) -> None:
        """Write a line for a decoded DiagnosticStatus if its level or its message has changed."""
        level = status.level[0] if isinstance(status.level, bytes) else int(status.level)
        if self._logged.get(status.name) != (level, status.message):
            self._logged[status.name] = (level, status.message)
            self.write(f"{status.name}: {status.message}", _LEVELS[min(level, 2)])

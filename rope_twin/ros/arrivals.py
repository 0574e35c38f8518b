"""Whether all that was published came: each publisher numbers its messages."""

from __future__ import annotations

from typing import Any


class Arrivals:
    """Counts the numbers that are missing between a publisher's messages.

    A queue that runs over while a process is held up drops messages without a word; the numbers
    tell. What a publisher sent before its first message came is not counted.
    """

    def __init__(self) -> None:
        self._newest: dict[bytes, int] = {}
        self.received = 0
        self.lost = 0

    def count(self, info: dict[str, Any]) -> None:
        """A message has come, with what the middleware tells of it."""
        self.received += 1
        number, publisher = info["publication_sequence_number"], info["publisher_gid"]["data"]
        if number is None:
            return  # a middleware that does not number
        before = self._newest.get(publisher)
        if before is not None:
            self.lost += max(0, number - before - 1)
        self._newest[publisher] = max(number, before or 0)

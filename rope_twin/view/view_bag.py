"""Playback of a recorded bag in the view; a truncated bag is played up to the break."""

from __future__ import annotations

import os
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Protocol

from mcap.records import Channel

from rope_twin import messages
from rope_twin.errors import BagError, InputError, phrase
from rope_twin.messages.templates import NANOSECONDS
from rope_twin.recording.bag import find_bag
from rope_twin.recording.mcap_scan import McapScan, StoredMessage, mcap_files
from rope_twin.view.rope_view import SHOWN_TOPICS


class Shows(Protocol):
    """Interface of a view that a bag is played into: RopeView."""

    def show(self, topic_name: str, message: object, time_ns: int) -> None: ...


@dataclass
class Played:
    """Result of a playback."""

    shown: int = 0
    start_ns: int | None = None  # epoch, or time of the first message if the bag has no epoch
    end_ns: int = 0
    problems: list[str] = field(default_factory=list)  # one sentence each

    @property
    def duration_s(self) -> float:
        """Return the time from the start to the last message shown [s]."""
        return 0.0 if self.start_ns is None else (self.end_ns - self.start_ns) / NANOSECONDS


def play(bag: str | os.PathLike[str], view: Shows, until_s: float | None = None) -> Played:
    """Show a bag's messages up to `until_s` after the start of the simulation.

    Raises:
        BagError: no such bag, not MCAP, or it has no topic that the view shows.
        InputError: the bag ends before `until_s`.
    """
    path = find_bag(os.fspath(bag))
    played = Played()
    undecoded: dict[str, int] = {}
    ended = False
    for name, stored in _messages(path, played):
        try:
            message = messages.decode(name, stored.data)
            if name == "twin/epoch" and not played.shown:
                played.start_ns = message.sec * NANOSECONDS + message.nanosec
            elif played.start_ns is None:
                played.start_ns = stored.log_ns
            assert played.start_ns is not None
            if until_s is not None and stored.log_ns > played.start_ns + until_s * NANOSECONDS:
                ended = True
                break
            view.show(name, message, stored.log_ns)
        except InputError as error:
            undecoded[str(error)] = undecoded.get(str(error), 0) + 1
            continue
        played.shown += 1
        played.end_ns = max(played.end_ns, stored.log_ns)
    played.problems += [f"{count} × {words}" for words, count in undecoded.items()]
    if not played.shown:
        raise BagError(_nothing(path, played))
    if until_s is not None and not ended and played.duration_s < until_s - 0.5:
        what = f"{until_s:g} s is after its end"
        right = f"it lasts {played.duration_s:.1f} s"
        raise InputError(phrase(f"bag {path}", what, right))
    return played


def _messages(path: Path, played: Played) -> Iterator[tuple[str, StoredMessage]]:
    """Return topic name and message of the topics that the view shows, in recorded order."""
    files = mcap_files(path)
    if not files or any(file.suffix != ".mcap" for file in files):
        raise BagError(phrase(f"bag {path}", "it holds no .mcap file", "record with MCAP storage"))
    for file in files:
        scan = McapScan(file)
        names: dict[int, str] = {}
        for record in scan.records():
            if isinstance(record, Channel):
                if name := _shown_name(record.topic):
                    names[record.id] = name
            elif isinstance(record, StoredMessage) and record.channel_id in names:
                yield names[record.channel_id], record
        played.problems += scan.problems


def _shown_name(recorded: str) -> str:
    """Return the topic's name in the table, without its namespace; "" if it is not shown."""
    return next((name for name in SHOWN_TOPICS if f"/{recorded}".endswith(f"/{name}")), "")


def _nothing(path: Path, played: Played) -> str:
    what = "no topic to show" + "".join(f"; {words}" for words in played.problems)
    return phrase(f"bag {path}", what, f"name a bag with {', '.join(SHOWN_TOPICS)}")

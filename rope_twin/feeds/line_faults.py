"""Faults of a line on its way: lost, doubled, cut, garbled and delayed lines, by a seed.

For practice and for tests (`rope_twin feed --faults`). Each line of a telegram is drawn by itself,
since a way loses lines and not telegrams. Five numbers are drawn for each line whatever its
fate, so that the same seed makes the same faults.

In a stream (a serial line, TCP) a line that is held up holds up those behind it, and one that is
cut runs into the next one; a datagram is overtaken.
"""

from __future__ import annotations

import contextlib
import heapq
import itertools
import random
import threading
import time
from collections import Counter
from dataclasses import dataclass

from rope_twin.errors import InputError, did_you_mean
from rope_twin.feeds.configuration import EM3000, FeedSettings
from rope_twin.feeds.transports import FILE, FileSink, Sink, Take, UdpSink, read_address
from rope_twin.quantity import read_quantity

LOST, DOUBLED, CUT, GARBLED, DELAYED = FAULTS = "lost", "doubled", "cut", "garbled", "delayed"
MAX_DELAY_S = 60.0
_SECOND_NS = 1_000_000_000
FORM = "lost:SHARE,doubled:SHARE,cut:SHARE,garbled:SHARE,delayed:[SHARE:]TIME,seed:NUMBER"

Piece = tuple[int, bytes]  # time at which it arrives [ns], bytes


@dataclass(frozen=True, kw_only=True)
class LineFaults:
    """Share of the lines that each fault hits, 0 to 1, and the seed of the draws."""

    lost: float = 0.0
    doubled: float = 0.0
    cut: float = 0.0  # at a place drawn uniformly; its end of line is lost
    garbled: float = 0.0  # one byte is replaced by another
    delayed: float = 0.0
    delay_s: float = 0.0  # of those
    seed: int = 1

    @property
    def any(self) -> bool:
        """Return whether there is a fault at all."""
        return any(getattr(self, name) for name in FAULTS)


def read_faults(words: str) -> LineFaults:
    """Return the faults in words such as `lost:0.01,delayed:0.01:0.2s,seed:3`; "": none.

    Raises:
        InputError: a name, share, time or number is impossible.
    """
    chosen: dict[str, float | int] = {}
    known = (*FAULTS, "seed")
    for entry in filter(None, (text.strip() for text in words.split(","))):
        name, colon, value = entry.partition(":")
        where = f"--faults {entry}"
        if name not in known:
            raise InputError(where, "there is no such fault", did_you_mean(name, known))
        if name in chosen or not colon:
            raise InputError(where, "given twice or without a value", f"give {FORM}")
        if name == "seed":
            if not value.isdecimal() or len(value) > 9:
                raise InputError(where, f"seed '{value}'", "give a whole number")
            chosen[name] = int(value)
            continue
        fraction, colon, delay = value.rpartition(":") if name == DELAYED else (value, "", "")
        chosen[name] = _share(where, fraction) if fraction or name != DELAYED else 1.0
        if name == DELAYED:
            chosen["delay_s"] = _delay_s(where, delay)
    return LineFaults(**chosen)  # type: ignore[arg-type]


def _share(where: str, words: str) -> float:
    with contextlib.suppress(ValueError):
        fraction = float(words)
        if 0.0 <= fraction <= 1.0:
            return fraction
    raise InputError(where, f"share '{words}'", "give a number from 0 to 1")


def _delay_s(where: str, words: str) -> float:
    with contextlib.suppress(ValueError):
        delay_s = read_quantity(words, "s")
        if 0.0 < delay_s <= MAX_DELAY_S:
            return delay_s
    remedy = f"give a time above 0, at most {MAX_DELAY_S:g} s, such as 0.2s"
    raise InputError(where, f"delay '{words}'", remedy)


class FaultyLine:
    """The way of one line source, with its faults; `counts` says how many lines each one hit."""

    def __init__(
        self, faults: LineFaults, in_order: bool, binary: bool = False, number: int = 0
    ) -> None:
        """Make the way.

        in_order: of a stream; binary: bytes are records and not lines; number: of the feed, for
        draws of its own.
        """
        self._faults, self._in_order, self._binary = faults, in_order, binary
        self._rng = random.Random(f"{faults.seed}:{number}")
        self._busy_ns = 0  # until then a stream is held up
        self.counts = Counter[str]()

    def take(self, data: bytes, at_ns: int) -> list[Piece]:
        """Return what arrives of bytes that were sent at a time, each line by itself."""
        pieces: list[Piece] = []
        for line in [data] if self._binary else data.splitlines(keepends=True):
            pieces += self._take(line, at_ns)
        return pieces

    def _take(self, line: bytes, at_ns: int) -> list[Piece]:
        faults, draw = self._faults, self._rng.random
        is_lost, doubled, is_cut, garbled, delayed = (
            draw() < getattr(faults, name) for name in FAULTS
        )
        fraction, other = draw(), 1 + int(255.0 * draw())
        self.counts["lines"] += 1
        if is_lost:
            self.counts[LOST] += 1
            return []
        if is_cut:
            self.counts[CUT] += 1
            line = line[: int(fraction * len(line))]
        if garbled and line:
            self.counts[GARBLED] += 1
            k = int(fraction * len(line))
            line = line[:k] + bytes([line[k] ^ other]) + line[k + 1 :]
        due_ns = at_ns
        if delayed:
            self.counts[DELAYED] += 1
            due_ns += round(faults.delay_s * _SECOND_NS)
        if self._in_order:
            due_ns = self._busy_ns = max(due_ns, self._busy_ns)
        if doubled:
            self.counts[DOUBLED] += 1
            return [(due_ns, line), (due_ns, line)]
        return [(due_ns, line)] if line else []


class FaultySink(Sink):
    """Way out with faults: what is held up is sent by a thread of its own when it is due."""

    def __init__(
        self, sink: Sink, faults: LineFaults, binary: bool = False, number: int = 0
    ) -> None:
        self._sink = sink
        self.line = FaultyLine(faults, not isinstance(sink, UdpSink), binary, number)
        self._waiting: list[tuple[int, int, bytes]] = []
        self._sent = 0
        self._lock = threading.Condition()
        self._closing = False
        self._thread = threading.Thread(target=self._run, name="faulty line", daemon=True)
        self._thread.start()

    def send(self, data: bytes) -> None:
        """Send what is left of the lines, at once or when it is due."""
        with self._lock:
            now_ns = time.monotonic_ns()
            for due_ns, piece in self.line.take(data, now_ns):
                if due_ns <= now_ns:
                    self._sink.send(piece)
                    continue
                self._sent += 1
                heapq.heappush(self._waiting, (due_ns, self._sent, piece))
            self._lock.notify()

    def _run(self) -> None:
        with self._lock:
            while not self._closing:
                now_ns = time.monotonic_ns()
                while self._waiting and self._waiting[0][0] <= now_ns:
                    self._sink.send(heapq.heappop(self._waiting)[2])
                left_s = (self._waiting[0][0] - now_ns) * 1e-9 if self._waiting else None
                self._lock.wait(left_s)

    def close(self) -> None:
        """Drop what waits and release what is held; may be called twice."""
        with self._lock:
            self._closing = True
            self._waiting.clear()
            self._lock.notify()
        self._thread.join(2.0)
        self._sink.close()


def with_faults(sink: Sink, faults: LineFaults, settings: FeedSettings, number: int) -> Sink:
    """Return the way out of a feed with these faults; a file keeps the lines as they were sent."""
    if not faults.any or isinstance(sink, FileSink):
        return sink
    return FaultySink(sink, faults, settings.format == EM3000, number)


def replay_with_faults(
    take: Take, faults: LineFaults, settings: FeedSettings, number: int = 0
) -> Take:
    """Return what takes the lines of a replayed file in place of `take`, and lays faults over them.

    What is still held up at the end of the file never arrives.

    Raises:
        InputError: the source is no file: what is live has its own faults.
    """
    if not faults.any:
        return take
    if read_address(settings.source).kind != FILE:
        problem = "faults are laid over a replayed file, or over what --simulate sends"
        raise InputError(f"source {settings.source}", problem, "leave --faults out")
    line = FaultyLine(faults, False, settings.format == EM3000, number)  # as of datagrams
    waiting: list[tuple[int, int, bytes, bool]] = []
    heard = itertools.count()

    def take_faulty(data: bytes, arrival_ns: int, is_complete: bool) -> None:
        for due_ns, piece in line.take(data, arrival_ns):
            heapq.heappush(waiting, (due_ns, next(heard), piece, is_complete))
        while waiting and waiting[0][0] <= arrival_ns:
            due_ns, _, piece, complete = heapq.heappop(waiting)
            take(piece, due_ns, complete)

    return take_faulty

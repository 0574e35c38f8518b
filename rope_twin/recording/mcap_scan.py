"""Reads an MCAP file from its beginning, damaged or not: what is broken costs its own record only.

Format: the MCAP specification 0 (mcap.dev): a magic, then records of an opcode (1 byte), a length
(8 bytes, little-endian) and content; chunks hold records again, compressed, with a CRC. Behind the
data stands a summary that repeats schemas and channels and has an index of all chunks. Indexed
readers start from there and so fail on a file that was cut off; this one walks over the records and
takes the summary only, where its CRC is right, to find the way again behind damage. Without a
summary it looks for the next bytes that are a chunk by sizes and CRC.
"""

from __future__ import annotations

import bisect
import re
import struct
import zlib
from collections.abc import Collection, Iterable, Iterator
from dataclasses import dataclass, field
from functools import cache
from io import BytesIO
from pathlib import Path
from typing import BinaryIO, NamedTuple, TypeAlias

import lz4.frame  # type: ignore[import-untyped]
import zstandard
from mcap.data_stream import ReadDataStream
from mcap.exceptions import McapError
from mcap.opcode import Opcode
from mcap.records import Attachment, Channel, Header, Metadata, Schema

from rope_twin.recording.bag import MCAP_MAGIC, OWN_RECORD
from rope_twin.topics import is_topic

_FRAME = struct.Struct("<BQ")  # opcode, length
_MESSAGE = struct.Struct("<HIQQ")  # channel, sequence, log time, publish time
_CHUNK = struct.Struct("<QQQII")  # start, end, size, checksum, length of the compression's name
_PACKED = struct.Struct("<Q")  # bytes of a chunk's records as stored
_FOOTER = struct.Struct("<BQQQI")  # its frame, summary's start, its offsets' start, checksum
_MESSAGE_INDEX = struct.Struct("<HI")  # channel, bytes of the entries
_LARGEST_CHUNK_BYTES = 2**30
_LONGEST_COMPRESSION = 16
_WINDOW_BYTES = 2**22
# A chunk's opcode and a length below 2^40; found at every byte, also within a match.
_CHUNK_HEAD = re.compile(rb"(?=\x06[\s\S]{5}\x00\x00\x00)")
_DAMAGE = (ValueError, McapError, struct.error, zstandard.ZstdError, MemoryError, RuntimeError,
           EOFError)  # fmt: skip


class StoredMessage(NamedTuple):
    """A message as it lies in the file."""

    channel_id: int
    sequence: int
    log_ns: int
    publish_ns: int
    data: bytes


Stored: TypeAlias = Schema | Channel | Metadata | StoredMessage


class _Part(NamedTuple):
    """One record of the file, or a stretch that is none."""

    end: int  # the byte behind it
    records: list[Stored]
    damage: str = ""  # what is wrong with it
    opcode: int = 0
    lossless: bool = False  # everything in it was read all the same


@dataclass
class _Summary:
    """Verified summary section behind the data."""

    data_end: int = 0  # the byte at which it begins
    definitions: list[Stored] = field(default_factory=list)
    chunks: list[int] = field(default_factory=list)  # where each begins, ascending
    messages: int | None = None  # in the whole file, or None if it does not say
    chunk_count: int | None = None


def mcap_files(bag: Path) -> list[Path]:
    """Return the MCAP files of a bag in the order of their numbers, or the file that it is."""

    def order(path: Path) -> tuple[str, int]:
        match = re.fullmatch(r"(.*?)(\d*)", path.stem)
        return (match[1], int(match[2] or 0)) if match else (path.stem, 0)

    return [bag] if bag.is_file() else sorted(bag.glob("*.mcap"), key=order)


def topic_messages(
    files: Iterable[Path], wanted: Collection[str], problems: list[str]
) -> Iterator[tuple[str, StoredMessage]]:
    """Yield topic and message of these topics, in any namespace, in file order.

    problems: takes what was lost in the files.
    """

    @cache
    def topic_of(name: str) -> str | None:
        return next((topic for topic in wanted if is_topic(name, topic)), None)

    for file in files:
        scan = McapScan(file)
        for name, _, message in scan.messages():
            if (topic := topic_of(name)) is not None:
                yield topic, message
        problems += scan.problems


class McapScan:
    """One pass over a file; afterwards `problems` lists what was lost (nothing: it is whole)."""

    def __init__(self, path: Path) -> None:
        self._path = path
        self.problems: list[str] = []
        self.mended: list[str] = []  # damage that cost no message
        self.left_out: set[str] = set()  # kinds of records that are whole but not handed on
        self.notes: dict[str, str] = {}  # of the bag's own, once `messages` has read them

    def records(self) -> Iterator[Stored]:
        """Return schemas, channels, metadata and messages in file order; it never raises.

        Where the summary is whole its schemas and channels come before all else.
        """
        try:
            with self._path.open("rb") as stream:
                yield from self._read(_File(stream))
        except OSError as error:
            self._report(f"cannot be read ({error.strerror})")

    def messages(self) -> Iterator[tuple[str, str, StoredMessage]]:
        """Yield topic, type ("": its definition is lost) and message, in file order."""
        types, channels = dict[int, str](), dict[int, tuple[str, str]]()
        for record in self.records():
            if isinstance(record, Schema):
                types[record.id] = record.name
            elif isinstance(record, Channel):
                channels[record.id] = record.topic, types.get(record.schema_id, "")
            elif isinstance(record, StoredMessage):
                if record.channel_id in channels:
                    yield *channels[record.channel_id], record
            elif record.name == OWN_RECORD:
                self.notes |= record.metadata

    def _read(self, file: _File) -> Iterator[Stored]:
        position = file.begin()
        if position is None:
            self._report("is empty" if not file.size else "does not begin like an MCAP file")
            return
        damage: list[tuple[str, bool]] = []  # and whether it cost nothing
        if not file.magic_first:
            damage.append(("has damaged first bytes", True))
        yield from file.summary.definitions if file.summary else []
        messages = 0
        while True:
            part = file.part(position)
            if part is None:
                break
            messages += sum(isinstance(record, StoredMessage) for record in part.records)
            if part.damage:
                damage.append((part.damage, part.lossless))
            if part.opcode == Opcode.ATTACHMENT:
                self.left_out.add("attachments")
            yield from part.records
            position = part.end
        damage += file.ending(position)
        promised = file.summary.messages if file.summary else None
        for fault, lossless in damage:
            nothing_lost = lossless if promised is None else messages == promised
            (self.mended if nothing_lost else self.problems).append(f"{self._path.name} {fault}")

    def _report(self, fault: str) -> None:
        self.problems.append(f"{self._path.name} {fault}")


class _File:
    """Records of a file by the byte at which they begin."""

    def __init__(self, stream: BinaryIO) -> None:
        self._stream = stream
        self.size = stream.seek(0, 2)
        self.magic_first = self._bytes(0, len(MCAP_MAGIC)) == MCAP_MAGIC
        self.summary = _read_summary(self)
        self._data_end = self.summary.data_end if self.summary else self.size
        self._chunked = bool(self.summary and self.summary.chunks)
        self._data_ended = False
        self._broke_off: int | None = None

    def begin(self) -> int | None:
        """Return the position of the first record; None: not an MCAP file."""
        after = len(MCAP_MAGIC)
        if self.magic_first or self.summary is not None:
            return after
        try:
            opcode, length = _FRAME.unpack(self._bytes(after, _FRAME.size))
            _parse(opcode, self._bytes(after + _FRAME.size, min(length, self.size)))
        except _DAMAGE:
            return self._next_chunk(0)
        return after if opcode == Opcode.HEADER else self._next_chunk(0)

    def part(self, position: int) -> _Part | None:
        """Return the record at a position, or the damage there; None at the end of the data."""
        if self._data_ended or position >= self._data_end or self._is_footer(position):
            return None
        head = self._bytes(position, _FRAME.size)
        opcode, length = _FRAME.unpack(head) if len(head) == _FRAME.size else (0, self.size)
        end = position + _FRAME.size + length
        fits = opcode != 0 and end <= self._limit(position)
        reason = ""
        if fits:
            try:
                return self._complete_record(opcode, position, end)
            except _DAMAGE as error:
                reason = str(error).strip() or type(error).__name__
        if (chunk := self._chunk_by_its_sizes(position)) is not None:
            return chunk
        name = "chunk" if opcode == Opcode.CHUNK else "record"
        next_at = self._behind_damage(position, end if fits and self._is_record(end) else None)
        if next_at is None:
            self._broke_off = position
            return None
        damage = f"has a damaged {name} at byte {position} ({reason or 'its length is impossible'})"
        return _Part(next_at, [], f"{damage}: {next_at - position} bytes are lost")

    def ending(self, position: int) -> list[tuple[str, bool]]:
        """Return the faults at the end of the file, each with whether it loses data."""
        if self._broke_off is not None:
            position = self._broke_off
            lost = self.size - position
            fault = f"breaks off at byte {position} of {self.size}: {lost} bytes are lost"
            return [(fault, False)]
        magic_last = self._bytes(self.size - len(MCAP_MAGIC), len(MCAP_MAGIC)) == MCAP_MAGIC
        if self.summary is not None:
            return [] if magic_last else [("has damaged last bytes", True)]
        if not self._data_ended and not self._is_footer(position):
            return [
                ("stops without its end: what its recorder still held in memory is lost", False)
            ]
        if magic_last:
            return [("has a damaged summary", True)]
        return [("does not end like an MCAP file", False)]

    def _complete_record(self, opcode: int, position: int, end: int) -> _Part:
        """Return a record whose content is valid for its kind.

        Raises:
            one of _DAMAGE: it is not valid.
        """
        content = self._bytes(position + _FRAME.size, end - position - _FRAME.size)
        if opcode == Opcode.CHUNK:
            # Unpacked as a whole first: a chunk is either handed on or reported, never both.
            part = _Part(end, _unpack(content), opcode=opcode)
            self._chunked = True
            return part
        if opcode == Opcode.MESSAGE and self._chunked:
            raise ValueError("a message outside the chunks")
        if opcode > max(Opcode) and not self._is_record(end):
            raise ValueError(f"an unknown kind of record, {opcode}")
        if opcode > max(Opcode) and self._chunk_by_its_sizes(position) is not None:
            raise ValueError(f"a chunk under the opcode {opcode}")
        records = _parse(opcode, content)
        if opcode == Opcode.DATA_END:
            if self.summary is not None and end != self._data_end:
                raise ValueError("an end of the data among the data")
            self._data_ended = True
        return _Part(end, records, opcode=opcode)

    def _chunk_by_its_sizes(self, position: int) -> _Part | None:
        """Return the chunk at a position of damaged opcode or length, from the sizes inside."""
        inside = position + _FRAME.size
        try:
            *_, name_bytes = _CHUNK.unpack(self._bytes(inside, _CHUNK.size))
            if name_bytes > _LONGEST_COMPRESSION:
                return None
            before = _CHUNK.size + name_bytes
            (packed,) = _PACKED.unpack(self._bytes(inside + before, _PACKED.size))
            end = inside + before + _PACKED.size + packed
            if end > self._limit(position):
                return None
            records = _unpack(self._bytes(inside, end - inside))
        except _DAMAGE:
            return None
        self._chunked = True
        fault = f"has a chunk at byte {position} whose opcode or length is damaged"
        return _Part(end, records, fault, Opcode.CHUNK, lossless=True) if records else None

    def _limit(self, position: int) -> int:
        """Return the position that a record at this one cannot extend beyond."""
        chunks = self.summary.chunks if self.summary else []
        following = bisect.bisect_right(chunks, position)
        return chunks[following] if following < len(chunks) else self._data_end

    def _behind_damage(self, position: int, end: int | None) -> int | None:
        """Return the position behind damage; `end`: from the damaged record's length, if valid."""
        summary = self.summary
        if summary is not None and summary.chunks and summary.chunk_count == len(summary.chunks):
            return self._limit(position)
        # The length itself may be damaged: it counts only where no whole chunk follows.
        return self._next_chunk(position + 1) or end

    def _next_chunk(self, position: int) -> int | None:
        """Return the position of the next chunk with valid sizes and CRC."""
        while position < self._data_end:
            window = self._bytes(position, _WINDOW_BYTES + _FRAME.size)
            for match in _CHUNK_HEAD.finditer(window):
                candidate = position + match.start()
                _, length = _FRAME.unpack_from(window, match.start())
                end = candidate + _FRAME.size + length
                if length >= _CHUNK.size + _PACKED.size and end <= self._data_end:
                    chunk = self._chunk_by_its_sizes(candidate)
                    if chunk is not None and chunk.end == end:
                        return candidate
            position += _WINDOW_BYTES
        return None

    def _is_record(self, position: int) -> bool:
        """Return whether a record of a known kind and a plausible length seems to begin here."""
        if position == self._data_end:
            return True
        head = self._bytes(position, _FRAME.size)
        if len(head) < _FRAME.size:
            return False
        opcode, length = _FRAME.unpack(head)
        return opcode in _IN_DATA and position + _FRAME.size + length <= self._limit(position)

    def _is_footer(self, position: int) -> bool:
        if position + _FOOTER.size > self.size:
            return False
        return self._bytes(position, _FRAME.size) == _FRAME.pack(Opcode.FOOTER, 20)

    def _bytes(self, position: int, count: int) -> bytes:
        self._stream.seek(max(0, position))
        return self._stream.read(count)


# Kinds that stand among the data; the others belong to the summary.
_IN_DATA = frozenset((Opcode.HEADER, Opcode.SCHEMA, Opcode.CHANNEL, Opcode.MESSAGE, Opcode.CHUNK,
                      Opcode.MESSAGE_INDEX, Opcode.ATTACHMENT, Opcode.METADATA,
                      Opcode.DATA_END))  # fmt: skip
_FIELDS = {
    Opcode.HEADER: Header,
    Opcode.SCHEMA: Schema,
    Opcode.CHANNEL: Channel,
    Opcode.METADATA: Metadata,
    Opcode.ATTACHMENT: Attachment,
}


def _parse(opcode: int, content: bytes) -> list[Stored]:
    """Return the parsed content of a record other than a chunk.

    Raises:
        one of _DAMAGE: the content is not as long as its kind must be, or of no kind for data.
    """
    if opcode > max(Opcode):
        return []  # of later versions of the format
    if opcode not in _IN_DATA:
        raise ValueError(f"a record of kind {opcode} among the data")
    if opcode == Opcode.MESSAGE:
        channel_id, sequence, log_ns, publish_ns = _MESSAGE.unpack_from(content)
        data = content[_MESSAGE.size :]
        return [StoredMessage(channel_id, sequence, log_ns, publish_ns, data)]
    if (kind := _FIELDS.get(Opcode(opcode))) is not None:
        stream = BytesIO(content)
        record = kind.read(ReadDataStream(stream))
        if stream.tell() != len(content):
            raise ValueError(f"{len(content)} bytes announced, {stream.tell()} in its fields")
        return [record] if isinstance(record, Schema | Channel | Metadata) else []
    expected = 4
    if opcode == Opcode.MESSAGE_INDEX:
        expected = _MESSAGE_INDEX.size + _MESSAGE_INDEX.unpack_from(content)[1]
    if len(content) != expected:
        raise ValueError(f"{len(content)} bytes announced, {expected} in its fields")
    return []


def _read_summary(file: _File) -> _Summary | None:
    """Return the summary; None if the file has none, or a damaged one."""
    position = file.size - len(MCAP_MAGIC) - _FOOTER.size
    try:
        footer = file._bytes(position, _FOOTER.size)
        opcode, length, start, _, checksum = _FOOTER.unpack(footer)
        if (opcode, length) != (Opcode.FOOTER, 20) or position < len(MCAP_MAGIC):
            return None
        if start == 0:
            start = position
        if not len(MCAP_MAGIC) <= start <= position:
            return None
        body = file._bytes(start, position - start)
        if checksum and zlib.crc32(footer[:-4], zlib.crc32(body)) != checksum:
            return None
        return _parse_summary(body, start)
    except _DAMAGE:
        return None


def _parse_summary(body: bytes, start: int) -> _Summary:
    """Return the parsed summary. Raises one of _DAMAGE: its records are inconsistent."""
    summary = _Summary(start)
    for opcode, content in _frames(body):
        if opcode in (Opcode.SCHEMA, Opcode.CHANNEL):
            summary.definitions += _parse(opcode, content)
        elif opcode == Opcode.CHUNK_INDEX:
            summary.chunks.append(struct.unpack_from("<QQQ", content)[2])
        elif opcode == Opcode.STATISTICS:
            summary.messages, *_, summary.chunk_count = struct.unpack_from("<QHIIII", content)
    summary.chunks.sort()
    return summary


def _frames(data: bytes) -> Iterator[tuple[int, bytes]]:
    """Return opcode and content of each record in a chunk.

    Raises:
        ValueError: the records are inconsistent.
    """
    position = 0
    while position < len(data):
        opcode, length = _FRAME.unpack_from(data, position)
        position += _FRAME.size
        if length > len(data) - position:
            raise ValueError(f"a record of {length} bytes in the last {len(data) - position}")
        yield opcode, data[position : position + length]
        position += length


def _unpack(content: bytes) -> list[Stored]:
    """Return the records of a chunk, decompressed and checked.

    Raises:
        one of _DAMAGE: the chunk is damaged.
    """
    _, _, size, checksum, name_length = _CHUNK.unpack_from(content)
    position = _CHUNK.size + name_length
    compression = content[_CHUNK.size : position].decode("ascii")
    (length,) = _PACKED.unpack_from(content, position)
    packed = content[position + _PACKED.size :]
    if length != len(packed) or size > _LARGEST_CHUNK_BYTES:
        raise ValueError(f"{len(packed)} bytes packed, {length} announced, {size} unpacked")
    if compression == "zstd":
        if zstandard.frame_content_size(packed) not in (size, -1):
            raise ValueError("its compressed form announces another size")
        data = zstandard.ZstdDecompressor().decompress(
            packed, max_output_size=size, allow_extra_data=False
        )
    elif compression == "lz4":
        data = lz4.frame.decompress(packed)
    elif compression == "":
        data = packed
    else:
        raise ValueError(f"unknown compression '{compression}'")
    if len(data) != size:
        raise ValueError(f"{len(data)} bytes unpacked, {size} announced")
    if checksum and zlib.crc32(data) != checksum:
        raise ValueError("its checksum is wrong")
    return [part for frame in _frames(data) for part in _parse(*frame)]

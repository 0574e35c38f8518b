"""Reads an MCAP file from its beginning for as long as it makes sense, damaged or not.

Format: the MCAP specification 0 (mcap.dev): a magic, then records of an opcode (1 byte), a length
(8 bytes, little-endian) and content; chunks hold records again, compressed. Indexed readers start
from the end and so fail on a file that was cut off; this one never looks there.
"""

from __future__ import annotations

import struct
import zlib
from collections.abc import Iterator
from io import BytesIO
from pathlib import Path
from typing import BinaryIO, NamedTuple

import lz4.frame  # type: ignore[import-untyped]
import zstandard
from mcap.data_stream import ReadDataStream
from mcap.exceptions import McapError
from mcap.opcode import Opcode
from mcap.records import Channel, Metadata, Schema

from rope_twin.recording.bag_reader import MCAP_MAGIC

_FRAME = struct.Struct("<BQ")  # opcode, length
_MESSAGE = struct.Struct("<HIQQ")  # channel, sequence, log time, publish time
_CHUNK = struct.Struct("<QQQII")  # start, end, size, checksum, length of the compression's name
_LARGEST_CHUNK_BYTES = 2**30
_DAMAGE = (ValueError, McapError, struct.error, zstandard.ZstdError, MemoryError, RuntimeError)


class StoredMessage(NamedTuple):
    """A message as it lies in the file."""

    channel_id: int
    sequence: int
    log_ns: int
    publish_ns: int
    data: bytes


class McapScan:
    """One pass over a file; afterwards `problems` tells what was wrong (none: it is whole)."""

    def __init__(self, path: Path) -> None:
        self._path = path
        self.problems: list[str] = []
        self.left_out: set[str] = set()  # kinds of records that are whole but not handed on

    def records(self) -> Iterator[Schema | Channel | Metadata | StoredMessage]:
        """Schemas, channels, metadata and messages in the order of the file. Never raises."""
        try:
            with self._path.open("rb") as file:
                yield from self._read(file)
        except OSError as error:
            self._tell(f"cannot be read ({error.strerror})")

    def _read(self, file: BinaryIO) -> Iterator[Schema | Channel | Metadata | StoredMessage]:
        size = file.seek(0, 2)
        file.seek(0)
        if file.read(len(MCAP_MAGIC)) != MCAP_MAGIC:
            self._tell("is empty" if size == 0 else "does not begin like an MCAP file")
            return
        while True:
            at = file.tell()
            frame = file.read(_FRAME.size)
            if not frame:
                self._tell("stops without its end: what its recorder still held in memory is lost")
                return
            opcode, length = _FRAME.unpack(frame) if len(frame) == _FRAME.size else (0, size)
            if opcode == 0 or length > size - file.tell():
                self._tell(f"breaks off at byte {at} of {size}: {size - at} bytes are lost")
                return
            if opcode == Opcode.FOOTER:
                file.seek(length, 1)
                if file.read(len(MCAP_MAGIC) + 1) != MCAP_MAGIC:
                    self._tell("does not end like an MCAP file")
                return
            yield from self._open(opcode, file.read(length), at)

    def _open(
        self, opcode: int, content: bytes, at: int
    ) -> Iterator[Schema | Channel | Metadata | StoredMessage]:
        """What is in one record of the file."""
        try:
            if opcode == Opcode.CHUNK:
                # Unpacked as a whole first: a chunk is either handed on or reported, never both.
                records = [part for frame in _frames(_unpack(content)) for part in _parse(*frame)]
            else:
                records = _parse(opcode, content)
        except _DAMAGE as error:
            name = "chunk" if opcode == Opcode.CHUNK else "record"
            reason = str(error).strip() or type(error).__name__
            self._tell(
                f"has a damaged {name} at byte {at} ({reason}): {len(content)} bytes are lost"
            )
            return
        if opcode == Opcode.ATTACHMENT:
            self.left_out.add("attachments")
        yield from records

    def _tell(self, what: str) -> None:
        self.problems.append(f"{self._path.name} {what}")


def _parse(opcode: int, content: bytes) -> list[Schema | Channel | Metadata | StoredMessage]:
    if opcode == Opcode.MESSAGE:
        channel_id, sequence, log_ns, publish_ns = _MESSAGE.unpack_from(content)
        data = content[_MESSAGE.size :]
        return [StoredMessage(channel_id, sequence, log_ns, publish_ns, data)]
    stream = ReadDataStream(BytesIO(content))
    if opcode == Opcode.SCHEMA:
        return [Schema.read(stream)]
    if opcode == Opcode.CHANNEL:
        return [Channel.read(stream)]
    if opcode == Opcode.METADATA:
        return [Metadata.read(stream)]
    return []


def _frames(data: bytes) -> Iterator[tuple[int, bytes]]:
    """Opcode and content of each record in a chunk. Raises ValueError if they do not fit."""
    at = 0
    while at < len(data):
        opcode, length = _FRAME.unpack_from(data, at)
        at += _FRAME.size
        if length > len(data) - at:
            raise ValueError(f"a record of {length} bytes in the last {len(data) - at}")
        yield opcode, data[at : at + length]
        at += length


def _unpack(content: bytes) -> bytes:
    """The records of a chunk, decompressed and checked.

    Raises:
        ValueError, struct.error, zstandard.ZstdError or RuntimeError (of lz4) if it is damaged.
    """
    _, _, size, checksum, name_length = _CHUNK.unpack_from(content)
    at = _CHUNK.size + name_length
    compression = content[_CHUNK.size : at].decode("ascii")
    (length,) = struct.unpack_from("<Q", content, at)
    packed = content[at + 8 :]
    if length != len(packed) or size > _LARGEST_CHUNK_BYTES:
        raise ValueError(f"{len(packed)} bytes packed, {length} announced, {size} unpacked")
    if compression == "zstd":
        if zstandard.frame_content_size(packed) not in (size, -1):
            raise ValueError("its two sizes differ")
        data = zstandard.ZstdDecompressor().decompress(packed, max_output_size=size)
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
    return data

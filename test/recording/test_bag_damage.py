"""Recovery of bags with one flipped bit: it costs the chunk that it is in, at most.

    pytest -n 0 -m long -s test/recording/test_bag_damage.py

flips 300 bits of a bag that a run has recorded and prints what came back.
"""

from __future__ import annotations

import random
import struct
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import pytest
from bag_samples import START_NS, STEP_NS, swell
from mcap.reader import make_reader

from rope_twin.messages import encode_epoch, encode_heave
from rope_twin.recording.bag_writer import BagWriter
from rope_twin.recording.mcap_scan import McapScan, StoredMessage
from rope_twin.recording.recover import Outcome, recover
from rope_twin.run.options import RunOptions
from rope_twin.run.unpaced import run_unpaced
from rope_twin.topics import BY_NAME

Message = tuple[str, int, bytes]
FRAME = struct.Struct("<BQ")
CHUNK, DATA_END = 0x06, 0x0F


@dataclass
class Recorded:
    """The bytes of a bag's file and what is in it."""

    content: bytes
    chunks: list[tuple[int, int]]  # first byte of each and the byte behind it
    messages: list[tuple[int, Message]]  # in the order of the file, each with its chunk's number

    def lost_with(self, at: int | None) -> list[Message]:
        """All messages but those of the chunk that holds this byte."""
        hit = [n for n, (begin, end) in enumerate(self.chunks) if at and begin <= at < end]
        return [message for chunk, message in self.messages if chunk not in hit]

    @property
    def all(self) -> list[Message]:
        return [message for _, message in self.messages]


def frames(content: bytes, at: int = 8) -> Iterator[tuple[int, int, int]]:
    """Opcode, first byte and the byte behind each record of a whole file, up to its data's end."""
    opcode = 0
    while opcode != DATA_END:
        opcode, length = FRAME.unpack_from(content, at)
        yield opcode, at, at + FRAME.size + length
        at += FRAME.size + length


def read(file: Path) -> list[Message]:
    """All messages in the order of the file, by mcap's own indexed reader with its checks."""
    with file.open("rb") as stream:
        reader = make_reader(stream, validate_crcs=True)
        return [
            (channel.topic, message.log_time, message.data)
            for _, channel, message in reader.iter_messages(log_time_order=False)
        ]


def recorded(file: Path) -> Recorded:
    content = file.read_bytes()
    chunks = [(at, end) for opcode, at, end in frames(content) if opcode == CHUNK]
    messages: list[tuple[int, Message]] = []
    with file.open("rb") as stream:
        reader = make_reader(stream)
        summary = reader.get_summary()
        assert summary is not None
        found = iter(read(file))
        for number, index in enumerate(summary.chunk_indexes):
            assert index.chunk_start_offset == chunks[number][0]
            stream.seek(index.chunk_start_offset + index.chunk_length)
            entries = stream.read(index.message_index_length)
            count = sum(
                (end - at - 15) // 16 for _, at, end in _records(entries)
            )  # a message index: frame, channel, length, entries of 16 bytes
            messages += [(number, next(found)) for _ in range(count)]
        assert next(found, None) is None
    return Recorded(content, chunks, messages)


def _records(content: bytes) -> Iterator[tuple[int, int, int]]:
    at = 0
    while at < len(content):
        opcode, length = FRAME.unpack_from(content, at)
        yield opcode, at, at + FRAME.size + length
        at += FRAME.size + length


@pytest.fixture(scope="module")
def of_a_run(tmp_path_factory: pytest.TempPathFactory) -> Recorded:
    """Twenty seconds of a lift, every topic."""
    folder = tmp_path_factory.mktemp("run") / "bag"
    options = RunOptions(scene="shallow_lift", end_s=20.0, speed=0.0, record=folder)
    assert not run_unpaced(options, lambda run: None, START_NS).error
    made = recorded(folder / "bag_0.mcap")
    assert len(made.chunks) > 10
    return made


@pytest.fixture(scope="module")
def small(tmp_path_factory: pytest.TempPathFactory) -> Recorded:
    """Four chunks, as the recorder makes them."""
    folder = tmp_path_factory.mktemp("small") / "bag"
    with BagWriter(
        folder, [BY_NAME["ship/heave"], BY_NAME["twin/epoch"]], {"seed": "7"}, chunk_bytes=9000
    ) as bag:
        bag.note_channels()
        bag.write("twin/epoch", START_NS, encode_epoch(START_NS))
        for k, (_, z, v) in enumerate(swell(40)):
            stamp_ns = START_NS + k * STEP_NS
            bag.write("ship/heave", stamp_ns, encode_heave(stamp_ns, z, v), sequence=k)
    made = recorded(folder / "bag_0.mcap")
    assert 3 <= len(made.chunks) <= 6
    return made


def recovered(content: bytes, folder: Path) -> tuple[list[Message], Outcome, tuple[str, ...]]:
    file = folder / "bad.mcap"
    file.write_bytes(content)
    result = recover(file, folder / "new")
    if result.directory is None:
        return [], result.outcome, result.lost
    return read(folder / "new" / "new_0.mcap"), result.outcome, result.lost


def flipped(content: bytes, bit: int) -> bytes:
    changed = bytearray(content)
    changed[bit // 8] ^= 1 << bit % 8
    return bytes(changed)


def judge(original: Recorded, bit: int, folder: Path) -> int:
    """Flip a bit, recover, compare; how many messages it cost."""
    folder.mkdir()
    found, outcome, lost = recovered(flipped(original.content, bit), folder)
    where = f"bit {bit % 8} of byte {bit // 8}"
    if found != original.all:
        assert found == original.lost_with(bit // 8), f"{where}: {lost}"
        assert outcome is Outcome.LOSS, where
        assert lost, where
    return len(original.messages) - len(found)


def random_bits(original: Recorded, seed: int, count: int) -> list[int]:
    """Half of them anywhere, half outside the content of chunks: there a bit can cost the most."""
    source = random.Random(seed)
    inside = [range(begin + FRAME.size + 40, end) for begin, end in original.chunks]
    held = set().union(*inside)
    outside = [at for at in range(len(original.content)) if at not in held]
    anywhere = [source.randrange(8 * len(original.content)) for _ in range(count // 2)]
    return anywhere + [
        8 * source.choice(outside) + source.randrange(8) for _ in range(count - count // 2)
    ]


def test_four_random_flips_cost_a_chunk_each_at_most(of_a_run: Recorded, tmp_path: Path) -> None:
    for bit in random_bits(of_a_run, 17, 4):
        judge(of_a_run, bit, tmp_path / str(bit))


@pytest.mark.long
def test_three_hundred_random_flips_cost_a_chunk_each_at_most(
    of_a_run: Recorded, tmp_path: Path
) -> None:
    bits = random_bits(of_a_run, 1917, 300)
    costs = [judge(of_a_run, bit, tmp_path / str(n)) for n, bit in enumerate(bits)]
    print(
        f"\n{len(bits)} flips in a bag of {len(of_a_run.messages)} messages in "
        f"{len(of_a_run.chunks)} chunks: {sum(cost > 0 for cost in costs)} cost messages, "
        f"at most {max(costs)}"
    )


def scanned(content: bytes, file: Path) -> tuple[list[tuple[int, int, bytes]], McapScan]:
    file.write_bytes(content)
    scan = McapScan(file)
    found = [(m.channel_id, m.log_ns, m.data) for m in scan.records()
             if isinstance(m, StoredMessage)]  # fmt: skip
    return found, scan


@pytest.mark.long
@pytest.mark.parametrize("cut_off", [False, True], ids=["whole", "killed"])
def test_damage_outside_the_chunks_costs_nothing(
    small: Recorded, tmp_path: Path, cut_off: bool
) -> None:
    """Magic, header, notes, message indexes, summary and footer; in the head of a chunk it costs
    that chunk at most. Each bit of each opcode, length and head, a bit of each other byte.
    """
    data_end = next(at for opcode, at, _ in frames(small.content) if opcode == DATA_END)
    content = small.content[:data_end] if cut_off else small.content
    file = tmp_path / "bad.mcap"
    whole, _ = scanned(content, file)
    assert len(whole) == 41
    per_chunk = [
        {data for chunk, (_, _, data) in small.messages if chunk == number}
        for number in range(len(small.chunks))
    ]
    heads = [at for begin, _ in small.chunks for at in range(begin, begin + 57)]
    inside = {at for begin, end in small.chunks for at in range(begin + 57, end)}
    records = [at for _, at, _ in frames(small.content)]
    frames_at = {at + n for at in records for n in range(FRAME.size)} | set(heads)
    frames_at |= set(range(8)) | set(range(len(small.content) - 37, len(small.content)))
    cost_nothing = 0
    for at in range(len(content)):
        if at in inside:
            continue
        for bit in range(8) if at in frames_at else (at % 8,):
            found, scan = scanned(flipped(content, 8 * at + bit), file)
            assert [message for message in whole if message in found] == found
            if found == whole:
                cost_nothing += 1
                continue
            lost = {data for _, _, data in whole} - {data for _, _, data in found}
            assert at in heads, f"byte {at}, bit {bit}: {scan.problems}"
            hit = next(n for n, (begin, end) in enumerate(small.chunks) if begin <= at < end)
            assert lost == per_chunk[hit], f"byte {at}, bit {bit}: {scan.problems}"
            assert scan.problems
    assert cost_nothing > len(content) - len(inside) - len(heads)


def test_damage_that_cost_nothing_is_a_remark_and_the_bag_counts_as_whole(
    small: Recorded, tmp_path: Path
) -> None:
    begin, _ = small.chunks[1]
    for at, words in (
        (begin, "whose opcode or length is damaged"),
        (begin + 2, "whose opcode or length is damaged"),
        (3, "damaged first bytes"),
        (len(small.content) - 3, "damaged last bytes"),
        (len(small.content) - 12, "a damaged summary"),
    ):
        file = tmp_path / f"at_{at}.mcap"
        file.write_bytes(flipped(small.content, 8 * at))
        result = recover(file)
        assert (result.outcome, result.lost) == (Outcome.WHOLE, ())
        assert any(words in remark for remark in result.remarks), result.remarks
        assert sum(result.counts.values()) == 41


def test_a_killed_bag_whose_first_chunk_is_lost_keeps_the_rest(
    small: Recorded, tmp_path: Path
) -> None:
    """It defines all channels; in their place stand the recorder's note and the topic table."""
    data_end = next(at for opcode, at, _ in frames(small.content) if opcode == DATA_END)
    begin, end = small.chunks[0]
    content = flipped(small.content[:data_end], 4 * (begin + end))
    found, outcome, lost = recovered(content, tmp_path)
    assert found == small.lost_with(begin)
    assert len(found) > 20
    assert outcome is Outcome.LOSS
    assert any("damaged chunk" in words for words in lost)

"""Saves what is left of a bag whose recording was cut off or whose file is damaged."""

from __future__ import annotations

import shutil
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from enum import IntEnum
from pathlib import Path
from typing import Any

import yaml
from mcap.records import Channel, Metadata, Schema

from rope_twin.errors import BagError
from rope_twin.recording.bag import (
    CHANNELS_RECORD,
    OWN_RECORD,
    ROSBAG_RECORD,
    RecordedTopic,
    describe_topic,
    is_readable,
)
from rope_twin.recording.bag_writer import BagWriter
from rope_twin.recording.mcap_scan import McapScan, StoredMessage, mcap_files
from rope_twin.topics import BY_NAME, recorded_name


class Outcome(IntEnum):
    """Result of a recovery; the value is the exit code of the command."""

    WHOLE = 0
    NOTHING = 1
    LOSS = 3


@dataclass(frozen=True)
class Recovery:
    """Recovered content."""

    outcome: Outcome
    directory: Path | None  # the new bag; None if there was nothing to save
    counts: Mapping[str, int]  # messages by topic
    start_ns: int
    end_ns: int
    lost: tuple[str, ...]  # a sentence for each loss
    remarks: tuple[str, ...]  # what was mended or left out without a loss of messages


def recover(bag: Path, out: Path | None = None) -> Recovery:
    """Read what is whole of a bag (directory or .mcap file) and write a whole one.

    Damage costs the chunk that it is in, a cut all behind it. The new bag is `out`, by default
    `<bag>_recovered`; the old one is not touched. Times, order, definitions and qualities of
    service stay as they were.

    Raises:
        BagError: there is no such bag, or the new one cannot be written.
    """
    bag = Path(bag)
    source = _find_files(bag)
    out = out or bag.with_name(f"{bag.stem if bag.is_file() else bag.resolve().name}_recovered")
    salvage = _Salvage(out, source.custom_data)
    lost, remarks = list(source.lost), list(source.remarks)
    for file in source.files:
        scan = McapScan(file)
        salvage.take(scan)
        lost += scan.problems
        remarks += scan.mended
        remarks += [f"{kind} are left out" for kind in sorted(scan.left_out)]
    lost += salvage.lost()
    recovered = sum(salvage.counts.values())
    if source.promised is not None and recovered < source.promised:
        lost.append(f"{source.promised - recovered} of {source.promised} messages are missing")
    if not source.files or (lost and not recovered):
        outcome = Outcome.NOTHING
    else:
        outcome = Outcome.LOSS if lost else Outcome.WHOLE
    directory = None if outcome is Outcome.NOTHING else salvage.finish(lost)
    start_ns, end_ns = salvage.span_ns if recovered else (0, 0)
    return Recovery(
        outcome, directory, salvage.counts, start_ns, end_ns, tuple(lost), tuple(remarks)
    )


@dataclass
class _Source:
    """Files of a broken bag and the remains of its metadata.yaml."""

    files: list[Path]
    promised: int | None = None
    custom_data: dict[str, str] = field(default_factory=dict)
    lost: list[str] = field(default_factory=list)
    remarks: list[str] = field(default_factory=list)


def _find_files(bag: Path) -> _Source:
    if not is_readable(bag):
        raise BagError(f"bag {bag}", "it does not exist", "give a bag or an .mcap file")
    if bag.is_file():
        return _Source([bag])
    source = _Source(mcap_files(bag))
    if not source.files:
        source.lost.append(f"{bag} holds no .mcap file")
    information = _read_metadata(bag / "metadata.yaml")
    if information is None:
        source.remarks.append("metadata.yaml was missing or damaged and was restored")
        return source
    count, custom = information.get("message_count"), information.get("custom_data")
    source.promised = count if isinstance(count, int) else None
    if isinstance(custom, dict):
        source.custom_data = {str(key): str(value) for key, value in custom.items()}
    named = information.get("relative_file_paths")
    for name in named if isinstance(named, list) else []:
        if not (bag / Path(str(name)).name).is_file():
            source.lost.append(f"{name} is missing")
    return source


def _read_metadata(path: Path) -> dict[str, Any] | None:
    try:
        content = yaml.safe_load(path.read_text(encoding="utf-8"))
        information = content["rosbag2_bagfile_information"]
    except (OSError, ValueError, TypeError, KeyError, yaml.YAMLError, RecursionError):
        return None
    return information if isinstance(information, dict) else None


class _Salvage:
    """Writes what the scans find into a new bag, which is made when the first message comes."""

    def __init__(self, out: Path, custom_data: dict[str, str]) -> None:
        self._out = out
        self._metadata = custom_data
        self._writer: BagWriter | None = None
        self._known: dict[str, RecordedTopic] = {}  # by name, of all files
        self._conflicts: dict[str, int] = {}  # messages refused, by topic
        self._unknown = 0  # messages whose channel is lost or is none of ROS
        self._misfits: dict[str, int] = {}  # messages that a bag cannot hold, by reason
        self.span_ns = (2**63 - 1, 0)

    @property
    def counts(self) -> Mapping[str, int]:
        return self._writer.counts if self._writer else {}

    def take(self, scan: McapScan) -> None:
        """Take all records of one file (ids of schemas and channels are the file's own)."""
        schemas: dict[int, Schema] = {}
        channels: dict[int, RecordedTopic] = {}
        noted: Mapping[str, str] = {}  # names by id, for channels whose own record is lost
        for record in scan.records():
            if isinstance(record, StoredMessage):
                if record.channel_id not in channels:
                    self._describe_again(channels, record.channel_id, noted)
                self._store(record, channels.get(record.channel_id))
            elif isinstance(record, Schema):
                schemas[record.id] = record
            elif isinstance(record, Channel):
                schema = schemas.get(record.schema_id)
                if schema is not None and record.message_encoding == "cdr":
                    channels[record.id] = _describe(record, schema)
                    self._add(channels[record.id])
            elif isinstance(record, Metadata) and record.name == OWN_RECORD:
                self._metadata |= record.metadata
            elif isinstance(record, Metadata) and record.name == CHANNELS_RECORD:
                noted = record.metadata
            elif isinstance(record, Metadata) and record.name != ROSBAG_RECORD:
                scan.left_out.add(f"notes '{record.name}'")

    def finish(self, lost: list[str]) -> Path:
        """Close the new bag, with a note that it is not the original.

        Raises:
            BagError: the disk did not take it whole; nothing of it is left.
        """
        writer = self._open()
        writer.add_metadata({"recovered": "; ".join(lost) or "nothing was lost"})
        try:
            writer.close()
        except BagError as error:
            shutil.rmtree(self._out, ignore_errors=True)
            problem = "the disk does not take it whole"
            right = "make room, or name a folder on another disk with --out"
            raise BagError(f"bag {self._out}", problem, right) from error
        return self._out

    def lost(self) -> list[str]:
        """Return a sentence for each kind of message that could not be recovered."""
        sentences = [
            f"{count} messages on {name} are of another type than those before"
            for name, count in self._conflicts.items()
        ]
        if self._unknown:
            sentences.append(f"{self._unknown} messages belong to topics that are lost or not CDR")
        sentences += [f"{count} messages: {reason}" for reason, count in self._misfits.items()]
        return sentences

    def _open(self) -> BagWriter:
        if self._writer is None:
            self._writer = BagWriter(self._out, (), self._metadata)
            for topic in self._known.values():
                self._writer.add_topic(topic)
        return self._writer

    def _add(self, topic: RecordedTopic) -> None:
        if topic.name not in self._known:
            self._known[topic.name] = topic
            if self._writer is not None:
                self._writer.add_topic(topic)

    def _describe_again(
        self, channels: dict[int, RecordedTopic], channel_id: int, noted: Mapping[str, str]
    ) -> None:
        """Describe a channel of ours by the topic table, if the bag notes which topic it is."""
        name, _, type_name = noted.get(str(channel_id), "").partition(" ")
        topic = BY_NAME.get(name.removeprefix("/"))
        if topic is not None and topic.type_name == type_name:
            channels[channel_id] = replace(describe_topic(topic), name=name)
            self._add(channels[channel_id])

    def _store(self, message: StoredMessage, topic: RecordedTopic | None) -> None:
        if topic is None:
            self._unknown += 1
            return
        if self._known[topic.name].type_name != topic.type_name:
            self._conflicts[topic.name] = self._conflicts.get(topic.name, 0) + 1
            return
        writer = self._open()
        try:
            more = {"publish_ns": message.publish_ns, "sequence": message.sequence}
            writer.write(topic.name, message.log_ns, message.data, **more)
        except BagError as error:
            if writer.trouble:  # a full disk is not the old bag's fault
                raise
            reason = str(error).rstrip(".")
            self._misfits[reason] = self._misfits.get(reason, 0) + 1
            return
        first, last = self.span_ns
        self.span_ns = (min(first, message.log_ns), max(last, message.log_ns))


def _describe(channel: Channel, schema: Schema) -> RecordedTopic:
    notes = dict(channel.metadata)
    return RecordedTopic(
        name=recorded_name(channel.topic),
        type_name=schema.name,
        definition=schema.data,
        definition_encoding=schema.encoding,
        qos_profiles=notes.pop("offered_qos_profiles", ""),
        type_hash=notes.pop("topic_type_hash", ""),
        extra=notes,
    )

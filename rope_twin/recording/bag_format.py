"""Format of a rosbag2 directory with MCAP storage: names, QoS text and metadata.yaml.

It follows rosbag2's own reader (metadata version 9, ROS 2 Kilted): policies as words in the
channel's `offered_qos_profiles`, next to `topic_type_hash`, and a copy of the bag's metadata inside
the MCAP file (record `rosbag2`), so that the file can be opened without its directory.

Follows rosbag2's own reader (metadata version 9, ROS 2 Kilted): policies as words in the channel's
`offered_qos_profiles`, `topic_type_hash` beside it, and a copy of the bag's metadata inside the
MCAP file (record `rosbag2`) so that the file can be opened without its directory.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from types import TracebackType
from typing import Any, Self

import yaml

from rope_twin.errors import BagError, did_you_mean, phrase
from rope_twin.messages.cdr import typestore
from rope_twin.topics import QOS_ROWS, Qos, Topic

METADATA_VERSION = 9
ROS_DISTRO = "kilted"
OWN_RECORD = "rope_twin"  # name of the MCAP metadata record with the bag's own notes
CHANNELS_RECORD = "rope_twin_channels"  # and of the one with its channels: name and type by id
ROSBAG_RECORD = "rosbag2"  # name of the one that rosbag2 looks for

_FOREVER = {"sec": 9223372036, "nsec": 854775807}  # rosbag2's infinite duration


@dataclass(frozen=True)
class RecordedTopic:
    """A topic as a bag describes it."""

    name: str  # with a leading slash
    type_name: str  # package/msg/Type
    definition: bytes  # text of the type and of those inside it
    definition_encoding: str = "ros2msg"
    type_hash: str = ""  # RIHS01_...
    qos_profiles: str = ""  # YAML list; "" where unknown
    extra: Mapping[str, str] = field(default_factory=dict)  # further notes on the channel

    def channel_metadata(self) -> dict[str, str]:
        """Return the metadata of the MCAP channel."""
        return {
            **self.extra,
            "offered_qos_profiles": self.qos_profiles,
            "topic_type_hash": self.type_hash,
        }


def recorded_name(name: str) -> str:
    """Return the name under which a topic of the (relative) table is recorded."""
    return name if name.startswith("/") else f"/{name}"


def describe_topic(topic: Topic) -> RecordedTopic:
    """Return the description in a bag of a topic of the table.

    Raises:
        BagError: its message type is not a standard one.
    """
    store = typestore()
    if topic.type_name not in store.fielddefs:
        raise BagError(
            phrase(
                f"topic {topic.name}",
                f"unknown message type '{topic.type_name}'",
                did_you_mean(topic.type_name, store.fielddefs),
            )
        )
    definition, _ = store.generate_msgdef(topic.type_name, ros_version=2)
    return RecordedTopic(
        name=recorded_name(topic.name),
        type_name=topic.type_name,
        definition=definition.encode(),
        type_hash=store.hash_rihs01(topic.type_name),
        qos_profiles=_qos_text(topic.qos),
    )


def _qos_text(qos: Qos) -> str:
    row = QOS_ROWS[qos]
    profile = {
        "history": "keep_last",
        "depth": row.depth,
        "reliability": "reliable" if row.reliable else "best_effort",
        "durability": "transient_local" if row.for_late_joiners else "volatile",
        "deadline": _FOREVER,
        "lifespan": _FOREVER,
        "liveliness": "automatic",
        "liveliness_lease_duration": _FOREVER,
        "avoid_ros_namespace_conventions": False,
    }
    return _dump([profile]).strip()


@dataclass(frozen=True)
class BagSummary:
    """Content of metadata.yaml for a bag with one file."""

    file_name: str
    topics: Sequence[RecordedTopic]
    counts: Mapping[str, int]  # by topic name
    start_ns: int
    duration_ns: int
    custom_data: Mapping[str, str]

    def as_yaml(self) -> str:
        """Return the text of the `rosbag2_bagfile_information` mapping."""
        total = sum(self.counts.values())
        start = {"nanoseconds_since_epoch": self.start_ns}
        duration = {"nanoseconds": self.duration_ns}
        return _dump(
            {
                "version": METADATA_VERSION,
                "storage_identifier": "mcap",
                "duration": duration,
                "starting_time": start,
                "message_count": total,
                "topics_with_message_count": [self._topic(topic) for topic in self.topics],
                "compression_format": "",
                "compression_mode": "",
                "relative_file_paths": [self.file_name],
                "files": [
                    {
                        "path": self.file_name,
                        "starting_time": start,
                        "duration": duration,
                        "message_count": total,
                    }
                ],
                "custom_data": dict(self.custom_data) or None,
                "ros_distro": ROS_DISTRO,
            }
        )

    def as_file(self) -> str:
        """Return the text of metadata.yaml."""
        inner = self.as_yaml().splitlines()
        return "\n".join(["rosbag2_bagfile_information:", *(f"  {line}" for line in inner)]) + "\n"

    def _topic(self, topic: RecordedTopic) -> dict[str, Any]:
        return {
            "topic_metadata": {
                "name": topic.name,
                "type": topic.type_name,
                "serialization_format": "cdr",
                "offered_qos_profiles": yaml.safe_load(topic.qos_profiles or "[]") or [],
                "type_description_hash": topic.type_hash,
            },
            "message_count": self.counts[topic.name],
        }


class _PlainDumper(yaml.SafeDumper):
    """No anchors: yaml-cpp reads them, but people should not have to."""

    def ignore_aliases(self, data: Any) -> bool:
        return True


def _dump(data: Any) -> str:
    return yaml.dump(
        data, Dumper=_PlainDumper, sort_keys=False, allow_unicode=True, width=float("inf")
    )


class ClosableBag(ABC):
    """Bag that is closed at the end of a `with` block, whatever ends it."""

    @abstractmethod
    def close(self) -> None:
        """Close the bag; may be called twice.

        Raises:
            BagError: the written data is not safe on disk.
        """

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        """Close in any case: the data written before an error is worth keeping."""
        try:
            self.close()
        except BagError as failure:
            if error is None:
                raise
            error.add_note(str(failure))

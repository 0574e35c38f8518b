"""Listener of another DDS vendor (Eclipse Cyclone DDS) for the twin's topics.

    python cyclone_listener.py DOMAIN SECONDS SAMPLES TOPIC...

It knows nothing of rclpy: the IDL types are made from the ROS message definitions that rosbags
carries. It listens until so many samples have come of each topic, no longer than SECONDS. Prints
one JSON object: per topic how many samples came and a figure of the last one.
"""

from __future__ import annotations

import json
import sys
import time
from dataclasses import dataclass
from types import new_class
from typing import Any

from cyclonedds.core import Policy, Qos
from cyclonedds.domain import Domain, DomainParticipant
from cyclonedds.idl import IdlStruct, types
from cyclonedds.sub import DataReader
from cyclonedds.topic import Topic
from rosbags.interfaces import Nodetype
from rosbags.typesys import Stores, get_typestore

from rope_twin.topics import BY_NAME

# Loopback has no multicast: peers by address.
CONFIG = """<CycloneDDS><Domain><General><AllowMulticast>false</AllowMulticast>
<Interfaces><NetworkInterface address="127.0.0.1"/></Interfaces></General>
<Discovery><ParticipantIndex>auto</ParticipantIndex><MaxAutoParticipantIndex>60</MaxAutoParticipantIndex>
<Peers><Peer address="127.0.0.1"/></Peers></Discovery></Domain></CycloneDDS>"""

STORE = get_typestore(Stores.ROS2_KILTED)
BASE = {
    "bool": bool, "byte": types.uint8, "char": types.uint8, "octet": types.uint8,
    "int8": types.int8, "uint8": types.uint8, "int16": types.int16, "uint16": types.uint16,
    "int32": types.int32, "uint32": types.uint32, "int64": types.int64, "uint64": types.uint64,
    "float32": types.float32, "float64": types.float64, "string": str,
}  # fmt: skip
_made: dict[str, type] = {}


def idl_type(name: str) -> type:
    """Return the IDL struct of a ROS message type, e.g. `sensor_msgs/msg/JointState`."""
    if name not in _made:
        package, _, short = name.split("/")
        fields = {field: _field_type(kind) for field, kind in STORE.fielddefs[name][1]}
        made = new_class(
            short,
            (IdlStruct,),
            {"typename": f"{package}.msg.dds_.{short}_"},
            lambda body: body.update(__annotations__=fields, __module__=__name__),
        )
        _made[name] = dataclass(made)
    return _made[name]


def _field_type(kind: Any) -> Any:
    node, detail = kind
    if node == Nodetype.BASE:
        return BASE[detail[0]]
    if node == Nodetype.NAME:
        return idl_type(detail)
    inner, length = detail
    element = _field_type(inner)
    return types.array[element, length] if node == Nodetype.ARRAY else types.sequence[element]


def listen(domain: int, seconds: float, wanted: int, names: list[str]) -> dict[str, Any]:
    """Listen for a number of samples of each topic or some seconds: counts and last samples."""
    kept = Domain(domain, CONFIG)
    participant = DomainParticipant(domain)
    qos = Qos(
        Policy.Reliability.BestEffort,
        Policy.History.KeepLast(100),
        Policy.DataRepresentation(use_cdrv0_representation=True),
    )
    readers = {
        name: DataReader(
            participant,
            Topic(participant, f"rt/{name}", idl_type(BY_NAME[name].type_name), qos=qos),
            qos=qos,
        )
        for name in names
    }
    counts, last = dict.fromkeys(names, 0), dict.fromkeys(names)
    end = time.monotonic() + seconds
    while min(counts.values()) < wanted and time.monotonic() < end:
        for name, reader in readers.items():
            for sample in reader.take(N=100):
                counts[name] += 1
                last[name] = sample
        time.sleep(0.005)
    del kept
    return {name: {"count": counts[name], "last": figure(last[name])} for name in names}


def figure(sample: Any) -> Any:
    """Return a value of a sample that can be compared."""
    if sample is None:
        return None
    kind = type(sample).__name__
    if kind == "Odometry":
        return sample.pose.pose.position.z
    if kind == "MultiDOFJointState":
        return sample.transforms[0].translation.z
    if kind == "JointState":
        return [list(sample.name), list(sample.position), list(sample.effort)]
    if kind == "PointCloud2":
        return [sample.width, [field.name for field in sample.fields], len(sample.data)]
    return kind


if __name__ == "__main__":
    print(json.dumps(listen(int(sys.argv[1]), float(sys.argv[2]), int(sys.argv[3]), sys.argv[4:])))

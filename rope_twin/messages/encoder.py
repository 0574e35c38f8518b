"""Snapshot -> CDR bytes of every topic that the simulation publishes from a snapshot.

The same bytes are published and recorded.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from rope_twin.errors import InputError, did_you_mean, phrase
from rope_twin.messages import templates
from rope_twin.messages.cdr import Template, Templates
from rope_twin.messages.templates import scale_above, tension_colours
from rope_twin.messages.topic_encoders import (
    MonitorEncoder,
    ShapeEncoder,
    SystemEncoder,
    WinchEncoder,
    all_elements,
    line_events,
)
from rope_twin.twin.snapshot import BodyShot, Snapshot

# Marker sizes: a 40 mm rope on 3,000 m cannot be seen, so symbols grow with the line out.
_LINE_WIDTH, _SYMBOL_SIZE, _TEXT_HEIGHT = 1 / 1000, 1 / 100, 1 / 100
_LEAST_LINE_M = 100.0


class Encoder:
    """Holds the templates; one per publishing thread."""

    def __init__(self, epoch_ns: int, frame_id: str = "sea") -> None:
        self._epoch_ns = epoch_ns
        self._frame_id = frame_id
        self._number = Template(templates.number())
        self._wrench = Template(templates.wrench(frame_id))
        self._odometry = Template(templates.odometry(frame_id, "payload"))
        self._winch = Template(
            templates.joint_state(("winch",), ("position", "velocity", "effort"))
        )
        self._contact = Template(templates.joint_state(("payload", "rope"), ("position", "effort")))
        self._sized = Templates()
        self._rope_template: tuple[int, Template, Template] | None = (
            None  # elements, of one, of all
        )
        self._scale_n = 0.0
        joined = SystemEncoder(frame_id)
        winch, watched, shape = WinchEncoder(), MonitorEncoder(frame_id), ShapeEncoder()
        self._encoders: dict[str, Callable[[Snapshot], bytes]] = {
            "tension_top": self._tension_top,
            "tension_top_error_pct": self._tension_top_error,
            "tension_top/band": self._tension_top_band,
            "tension_payload": self._tension_payload,
            "hang_off/wrench": self._hang_off_wrench,
            "tension": self._tension,
            "payload/odometry": self._payload_odometry,
            "payload/rigging": self._payload_rigging,
            "winch/state": self._winch_state,
            "winch/mode": winch.mode,
            "winch/parts": lambda shot: winch.parts(shot, self._stamp(shot)),
            "seabed/contact": self._seabed_contact,
            "seabed/touchdown": lambda shot: shape.touchdown(shot, self._stamp(shot)),
            "rope/bend": lambda shot: shape.bend(shot, self._stamp(shot)),
            "rope/utilisation": lambda shot: shape.utilisation(shot, self._stamp(shot)),
            "rope/nodes": self._rope_nodes,
            "rope/markers": self._rope_markers,
            "rope/vibration": lambda shot: watched.vibration(shot, self._stamp(shot)),
            "rope/fatigue": watched.fatigue,
            "ropes/state": lambda shot: joined.ropes_state(shot, self._stamp(shot)),
            "ropes/nodes": lambda shot: joined.ropes_nodes(shot, self._stamp(shot)),
            "bars/state": lambda shot: joined.bars_state(shot, self._stamp(shot)),
            "lines/crossings": lambda shot: joined.crossings(shot, self._stamp(shot)),
            "lines/events": line_events,
            "payloads/state": lambda shot: joined.payloads_state(shot, self._stamp(shot)),
        }

    @property
    def topics(self) -> tuple[str, ...]:
        """Return the topics that `encode` supports."""
        return tuple(self._encoders)

    def encode(self, topic_name: str, snapshot: Snapshot) -> bytes:
        """Return the message of a topic at the snapshot's time, stamped epoch + stamp_ns.

        Raises:
            InputError: if the topic is not made from a snapshot.
        """
        encoder = self._encoders.get(topic_name)
        if encoder is None:
            raise InputError(
                phrase(
                    "encode",
                    f"topic '{topic_name}' is not made from a snapshot",
                    did_you_mean(topic_name, self._encoders),
                )
            )
        return encoder(snapshot)

    def _stamp(self, snapshot: Snapshot, path: str = "header.stamp") -> dict[str, int]:
        sec, nanosec = templates.split(self._epoch_ns + snapshot.stamp_ns)
        return {f"{path}.sec": sec, f"{path}.nanosec": nanosec}

    def _tension_top(self, snapshot: Snapshot) -> bytes:
        return self._number.fill({"data": snapshot.tension_top_n})

    def _tension_top_error(self, snapshot: Snapshot) -> bytes:
        return self._number.fill({"data": snapshot.card_error.rms_pct})

    def _tension_top_band(self, snapshot: Snapshot) -> bytes:
        band = snapshot.band
        if band is None:
            raise InputError(phrase("encode", "the snapshot has no error band", "ask for one"))
        bands = {"tension_top": band}
        bands |= {one.name: one.band for one in snapshot.ropes[1:] if one.band is not None}
        names = tuple(f"{name}_{edge}" for name in bands for edge in ("low", "high"))
        template = self._sized.get(
            "tension_top/band", names, lambda: templates.joint_state(names, ("effort",))
        )
        edges = [edge for one in bands.values() for edge in (one.low_n, one.high_n)]
        return template.fill({**self._stamp(snapshot), "effort": edges})

    def _tension_payload(self, snapshot: Snapshot) -> bytes:
        return self._number.fill({"data": snapshot.tension_payload_n})

    def _hang_off_wrench(self, snapshot: Snapshot) -> bytes:
        return self._wrench.fill(
            {**self._stamp(snapshot), "wrench.force": snapshot.hang_off_force_n}
        )

    def _payload_odometry(self, snapshot: Snapshot) -> bytes:
        values: dict[str, Any] = {
            **self._stamp(snapshot),
            "pose.pose.position": snapshot.payload_position_m,
            "twist.twist.linear": snapshot.payload_velocity_m_per_s,
        }
        body = snapshot.body
        if body is not None:  # the twist is in the child frame, body axes
            values["pose.pose.orientation"] = body.quaternion
            values["twist.twist.linear"] = snapshot.payload_velocity_m_per_s @ body.turn
            values["twist.twist.angular"] = body.angular_velocity_rad_per_s
        return self._odometry.fill(values)

    def _payload_rigging(self, snapshot: Snapshot) -> bytes:
        body = snapshot.body
        if body is None:
            right = "list the effect `rigid_body`"
            raise InputError(phrase("encode", "the payload is no rigid body", right))
        legs, decks = len(body.leg_pull_n), int(body.deck_push_n is not None)
        names = templates.rigging_names(legs, decks)
        template = self._sized.get(
            "payload/rigging", names, lambda: templates.joint_state(names, ("position", "effort"))
        )
        clear, push = [body.deck_clearance_m] * decks, [body.deck_push_n] * decks
        return template.fill(
            {
                **self._stamp(snapshot),
                "position": [*body.leg_length_m, *clear, *body.size_m, *body.leg_end_m.flat],
                "effort": [*body.leg_pull_n, *push, *[0.0] * (3 + body.leg_end_m.size)],
            }
        )

    def _winch_state(self, snapshot: Snapshot) -> bytes:
        return self._winch.fill(
            {
                **self._stamp(snapshot),
                "position": [snapshot.line_out_m],
                "velocity": [snapshot.payout_speed_m_per_s],
                "effort": [snapshot.tension_top_n],
            }
        )

    def _seabed_contact(self, snapshot: Snapshot) -> bytes:
        bed = snapshot.seabed
        if bed is None:
            raise InputError(phrase("encode", "the scene has no seabed", "list the effect"))
        return self._contact.fill(
            {
                **self._stamp(snapshot),
                "position": [bed.payload_height_m, bed.rope_on_bed_m],
                "effort": [bed.payload_push_n, bed.rope_push_n],
            }
        )

    def _tension(self, snapshot: Snapshot) -> bytes:
        count = len(snapshot.element_tension_n)
        template = self._sized.get(
            "tension", count, lambda: templates.row_of_numbers("element", count)
        )
        return template.fill({"data": snapshot.element_tension_n})

    def _rope_nodes(self, snapshot: Snapshot) -> bytes:
        count = len(snapshot.node_position_m)
        template = self._sized.get(
            "rope/nodes", count, lambda: templates.point_cloud(self._frame_id, count)
        )
        points = np.empty((count, 4), dtype="<f4")
        points[:, :3] = snapshot.node_position_m
        points[:, 3] = snapshot.node_tension_n
        return template.fill({**self._stamp(snapshot), "data": points.view(np.uint8).ravel()})

    def _rope_markers(self, snapshot: Snapshot) -> bytes:
        ends, tension = all_elements(snapshot)
        peak_n = float(tension.max())
        if peak_n > self._scale_n:
            self._scale_n = scale_above(peak_n)
        line_m = max(snapshot.line_out_m, _LEAST_LINE_M)
        values = {
            "markers.0.points": ends,
            "markers.0.colors": np.repeat(tension_colours(tension, self._scale_n), 2, axis=0),
            "markers.0.scale": (_LINE_WIDTH * line_m, 0.0, 0.0),
            **_symbols(snapshot, line_m),
        }
        last = 4 + len(snapshot.payloads)
        if snapshot.struts:
            values[f"markers.{last}.points"] = np.concatenate([s.ends_m for s in snapshot.struts])
            values[f"markers.{last}.scale"] = (2.0 * _LINE_WIDTH * line_m, 0.0, 0.0)
            last += 1
        if snapshot.body is not None:
            values |= _body_markers(snapshot, snapshot.body, last, line_m)
            last += len(snapshot.body.leg_end_m) > 0
        for index in range(last):
            values |= self._stamp(snapshot, f"markers.{index}.header.stamp")
        return self._markers_template(snapshot, len(tension)).fill(values)

    def _markers_template(self, snapshot: Snapshot, count: int) -> Template:
        """Return the template for this number of elements, which the winch changes, from one of
        one.
        """
        scale_n, words = self._scale_n, scale_words(self._scale_n)
        further, bars = tuple(one.name for one in snapshot.payloads), len(snapshot.struts)
        slings = 0 if snapshot.body is None else len(snapshot.body.leg_end_m)
        form = self._sized.get(
            "rope/markers of one element",
            (scale_n, further, bars, slings),
            lambda: templates.rope_markers(self._frame_id, 1, words, further, bars, slings),
        )
        if self._rope_template is None or self._rope_template[:2] != (count, form):
            # the winch changes the count every second or so; a point as an object takes 30 µs
            ends_of = {"markers.0.points": 2 * count, "markers.0.colors": 2 * count}
            self._rope_template = count, form, form.stretched(ends_of)
        return self._rope_template[2]


def _symbols(snapshot: Snapshot, line_m: float) -> dict[str, Any]:
    """Return the values of payload, hang-off and text markers, scaled with the line out."""
    size = (_SYMBOL_SIZE * line_m,) * 3
    values: dict[str, Any] = {
        "markers.1.pose.position": snapshot.payload_position_m,
        "markers.1.scale": size,
        "markers.2.pose.position": snapshot.hang_off_position_m,
        "markers.2.scale": size,
        "markers.3.pose.position": snapshot.hang_off_position_m
        + np.array([0.0, 0.0, 2.0 * _SYMBOL_SIZE * line_m]),
        "markers.3.scale": (0.0, 0.0, _TEXT_HEIGHT * line_m),
    }
    for index, payload in enumerate(snapshot.payloads, start=4):
        values[f"markers.{index}.pose.position"] = payload.position_m
        values[f"markers.{index}.scale"] = size
    return values


def _body_markers(snapshot: Snapshot, body: BodyShot, slings: int, line_m: float) -> dict[str, Any]:
    """Return the values of a 6-DOF payload's box, not below the symbol's size, and slings."""
    lowest = snapshot.ropes[-1] if snapshot.ropes else snapshot  # the other part of a rope in two
    hook = np.broadcast_to(lowest.node_position_m[-1], body.leg_end_m.shape)
    larger = max(1.0, _SYMBOL_SIZE * line_m / float(body.size_m.max()))
    return {
        "markers.1.pose.orientation": body.quaternion,
        "markers.1.scale": larger * body.size_m,
        f"markers.{slings}.points": np.stack([hook, body.leg_end_m], axis=1).reshape(-1, 3),
        f"markers.{slings}.scale": (0.5 * _LINE_WIDTH * line_m, 0.0, 0.0),
    }


def scale_words(scale_n: float) -> str:
    """Return the meaning of the rope's colours, as a text marker."""
    return f"violet 0 kN, yellow {scale_n / 1000.0:g} kN, red slack"

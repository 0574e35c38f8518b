"""Encoders of the topics of multi-line systems; for a single rope their messages are empty."""

from __future__ import annotations

from typing import Any

import numpy as np

from rope_twin.messages import forms
from rope_twin.messages.cdr import Templates, new, serialise
from rope_twin.twin.snapshot import Snapshot

_AXES = ("x", "y", "z")
CROSSING_FIGURES = ("depth_m", "angle_deg", "gap_m", "x_m", "y_m")


class JoinedForms:
    """Holds the templates of these topics; one per encoder."""

    def __init__(self, frame_id: str) -> None:
        self._frame_id = frame_id
        self._sized = Templates()

    def ropes_state(self, snapshot: Snapshot, stamp: dict[str, int]) -> bytes:
        """Return length, pay-out rate and upper-end tension of each rope; length and tension of
        struts.
        """
        ropes, struts = snapshot.ropes, snapshot.struts
        rows = [(r.name, r.line_out_m, r.payout_speed_m_per_s, r.tension_top_n) for r in ropes]
        rows += [
            (s.name, float(np.linalg.norm(s.ends_m[1] - s.ends_m[0])), 0.0, s.pull_n)
            for s in struts
        ]
        names = tuple(row[0] for row in rows)
        template = self._sized.get(
            "ropes/state",
            names,
            lambda: forms.joint_state(names, ("position", "velocity", "effort")),
        )
        columns = zip(("position", "velocity", "effort"), (1, 2, 3), strict=True)
        values = {name: [row[k] for row in rows] for name, k in columns} if rows else {}
        return template.fill({**stamp, **values})

    def payloads_state(self, snapshot: Snapshot, stamp: dict[str, int]) -> bytes:
        """Return position and velocity of each payload along x, y and z."""
        payloads = snapshot.payloads
        names = tuple(f"{one.name}/{axis}" for one in payloads for axis in _AXES)
        template = self._sized.get(
            "payloads/state", names, lambda: forms.joint_state(names, ("position", "velocity"))
        )
        values: dict[str, Any] = {}
        if payloads:
            values["position"] = np.concatenate([one.position_m for one in payloads])
            values["velocity"] = np.concatenate([one.velocity_m_per_s for one in payloads])
        return template.fill({**stamp, **values})

    def bars_state(self, snapshot: Snapshot, stamp: dict[str, int]) -> bytes:
        """Return the positions of both ends of each strut."""
        names = tuple(
            f"{bar.name}/{end}_{axis}"
            for bar in snapshot.struts
            for end in ("from", "to")
            for axis in _AXES
        )
        template = self._sized.get(
            "bars/state", names, lambda: forms.joint_state(names, ("position",))
        )
        ends = [bar.ends_m.ravel() for bar in snapshot.struts]
        return template.fill({**stamp, **({"position": np.concatenate(ends)} if ends else {})})

    def crossings(self, snapshot: Snapshot, stamp: dict[str, int]) -> bytes:
        """Return the minimum distance and the crossings of two lines, as joint positions."""
        lines = snapshot.lines
        rows: list[tuple[str, float]] = []
        if lines is not None:
            rows += [("nearest/depth_m", lines.nearest.depth_m)]
            rows += [("nearest/distance_m", lines.nearest.distance_m)]
            for k, one in enumerate(lines.crossings, start=1):
                figures = (one.depth_m, one.angle_deg, one.gap_m, *one.position_m[:2])
                named = zip(CROSSING_FIGURES, figures, strict=True)
                rows += [(f"crossing_{k}/{name}", value) for name, value in named]
        names = tuple(name for name, _ in rows)
        template = self._sized.get(
            "lines/crossings", names, lambda: forms.joint_state(names, ("position",))
        )
        return template.fill({**stamp, **({"position": [v for _, v in rows]} if rows else {})})

    def ropes_nodes(self, snapshot: Snapshot, stamp: dict[str, int]) -> bytes:
        """Return x, y, z, tension and rope number of each node."""
        counts = [len(rope.node_position_m) for rope in snapshot.ropes]
        count = sum(counts)
        template = self._sized.get(
            "ropes/nodes", count, lambda: forms.ropes_cloud(self._frame_id, count)
        )
        if count == 0:
            return template.fill(stamp)
        points = np.empty((count, 5), dtype="<f4")
        points[:, :3] = np.concatenate([rope.node_position_m for rope in snapshot.ropes])
        points[:, 3] = np.concatenate([rope.node_tension_n for rope in snapshot.ropes])
        points[:, 4] = np.repeat(np.arange(len(counts)), counts)
        return template.fill({**stamp, "data": points.view(np.uint8).ravel()})


def line_events(snapshot: Snapshot) -> bytes:
    """Return crossings of two lines that began or ended, such as `121.4 s: the lines cross at 836
    m`.
    """
    words = "; ".join(f"{event.time_s:.1f} s: {event.words()}" for event in snapshot.line_events)
    return serialise(new("std_msgs/msg/String", data=words))


def all_elements(snapshot: Snapshot) -> tuple[Any, Any]:
    """Return ends (2·elements, 3) and tension (elements,) of the elements of all ropes."""
    if not snapshot.ropes:
        return _ends(snapshot.node_position_m), snapshot.element_tension_n
    ropes = snapshot.ropes
    ends = np.concatenate([_ends(rope.node_position_m) for rope in ropes])
    return ends, np.concatenate([rope.element_tension_n for rope in ropes])


def _ends(nodes: Any) -> Any:
    """Return the ends of the elements: nodes 0 1, 1 2, 2 3, ..."""
    return np.repeat(nodes, 2, axis=0)[1:-1]

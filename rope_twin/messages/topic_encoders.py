"""Encoders of the topics whose fields depend on the scene, from a snapshot to CDR bytes.

Each class holds the templates of its topics; an `Encoder` has one of each.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from rope_twin.errors import InputError, phrase
from rope_twin.messages import templates
from rope_twin.messages.cdr import Templates, new, serialise
from rope_twin.twin.results import RopeVibration
from rope_twin.twin.snapshot import Snapshot, WinchShot
from rope_twin.twin.winch.commands import CONTROL_MODES

_AXES = ("x", "y", "z")
CROSSING_FIGURES = ("depth_m", "angle_deg", "gap_m", "x_m", "y_m")


class SystemEncoder:
    """Encodes the topics of multi-line systems; for a single rope their messages are empty."""

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
            lambda: templates.joint_state(names, ("position", "velocity", "effort")),
        )
        columns = zip(("position", "velocity", "effort"), (1, 2, 3), strict=True)
        values = {name: [row[k] for row in rows] for name, k in columns} if rows else {}
        return template.fill({**stamp, **values})

    def payloads_state(self, snapshot: Snapshot, stamp: dict[str, int]) -> bytes:
        """Return position and velocity of each payload along x, y and z."""
        payloads = snapshot.payloads
        names = tuple(f"{one.name}/{axis}" for one in payloads for axis in _AXES)
        template = self._sized.get(
            "payloads/state", names, lambda: templates.joint_state(names, ("position", "velocity"))
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
            "bars/state", names, lambda: templates.joint_state(names, ("position",))
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
            "lines/crossings", names, lambda: templates.joint_state(names, ("position",))
        )
        return template.fill({**stamp, **({"position": [v for _, v in rows]} if rows else {})})

    def ropes_nodes(self, snapshot: Snapshot, stamp: dict[str, int]) -> bytes:
        """Return x, y, z, tension and rope number of each node."""
        counts = [len(rope.node_position_m) for rope in snapshot.ropes]
        count = sum(counts)
        template = self._sized.get(
            "ropes/nodes", count, lambda: templates.ropes_cloud(self._frame_id, count)
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


class ShapeEncoder:
    """Encodes touchdown points, bend radii and utilisation."""

    def __init__(self) -> None:
        self._sized = Templates()

    def touchdown(self, snapshot: Snapshot, stamp: dict[str, int]) -> bytes:
        """Return the touchdown point of each rope on the seabed; no joints if there is none."""
        figures: dict[str, float] = {}
        for one in snapshot.touchdowns:
            x, y, z = one.position_m
            figures |= {
                f"{one.name}/x_m": x,
                f"{one.name}/y_m": y,
                f"{one.name}/z_m": z,
                f"{one.name}/line_out_m": one.line_out_m,
                f"{one.name}/layback_m": one.layback_m,
                f"{one.name}/tension_n": one.tension_n,
                f"{one.name}/angle_deg": one.angle_deg,
            }
        return self._fill("seabed/touchdown", figures, stamp)

    def bend(self, snapshot: Snapshot, stamp: dict[str, int]) -> bytes:
        """Return the smallest bend radius of each monitored rope, and its minimum if given."""
        figures: dict[str, float] = {}
        for one in snapshot.bends:
            name, (x, y, z) = one.now.name, one.position_m
            figures |= {
                f"{name}/radius_m": one.now.radius_m,
                f"{name}/line_out_m": one.now.line_out_m,
                f"{name}/x_m": x,
                f"{name}/y_m": y,
                f"{name}/z_m": z,
                f"{name}/tightest_m": one.tightest.radius_m,
            }
            if one.now.minimum_m:
                figures[f"{name}/minimum_m"] = one.now.minimum_m
        return self._fill("rope/bend", figures, stamp)

    def utilisation(self, snapshot: Snapshot, stamp: dict[str, int]) -> bytes:
        """Return utilisation and tensions of each rope; NaN without a static tension."""
        figures: dict[str, float] = {}
        for one in snapshot.strength:
            static_n, amplification = one.static_n, one.dynamic_amplification
            figures |= {
                f"{one.name}/utilisation": one.utilisation,
                f"{one.name}/dynamic_amplification": math.nan
                if amplification is None
                else amplification,
                f"{one.name}/highest_n": one.highest_n,
                f"{one.name}/static_n": math.nan if static_n is None else static_n,
            }
        return self._fill("rope/utilisation", figures, stamp)

    def _fill(self, topic: str, figures: dict[str, float], stamp: dict[str, int]) -> bytes:
        names = tuple(figures)
        template = self._sized.get(
            topic, names, lambda: templates.joint_state(names, ("position",))
        )
        return template.fill({**stamp, **({"position": [*figures.values()]} if figures else {})})


FATIGUE_COLUMNS = ("from_lower_end_m", "from_hang_off_m", "used")


class MonitorEncoder:
    """Encodes VIV response and fatigue damage."""

    def __init__(self, frame_id: str) -> None:
        self._frame_id = frame_id
        self._sized = Templates()

    def vibration(self, snapshot: Snapshot, stamp: dict[str, int]) -> bytes:
        """Return x, y, z of each node, with amplitude, frequency and drag amplification."""
        shaking = snapshot.vibration
        if shaking is None:
            raise InputError(phrase("encode", "the snapshot has no vibration", "ask for it"))
        columns = vibration_columns(shaking)
        place = snapshot.node_position_m
        key = (len(place), ("x", "y", "z", *columns))
        template = self._sized.get(
            "rope/vibration", key, lambda: templates.cloud(self._frame_id, *key)
        )
        points = np.column_stack([place, *columns.values()]).astype("<f4")
        return template.fill({**stamp, "data": points.view(np.uint8).ravel()})

    def fatigue(self, snapshot: Snapshot) -> bytes:
        """Return rows of FATIGUE_COLUMNS, one per metre of rope."""
        wear = snapshot.fatigue
        if wear is None:
            raise InputError(phrase("encode", "the snapshot has no fatigue", "ask for it"))
        count = len(wear.used)
        template = self._sized.get(
            "rope/fatigue",
            count,
            lambda: templates.table_of_numbers("metre", count, FATIGUE_COLUMNS),
        )
        table = np.column_stack([wear.from_lower_end_m, wear.from_hang_off_m, wear.used])
        return template.fill({"data": table.ravel()})


def vibration_columns(shaking: RopeVibration) -> dict[str, np.ndarray]:
    """Return the columns of the cloud in addition to the positions, by name."""
    columns = {"cross_flow": shaking.cross_flow, "cross_flow_hz": shaking.cross_flow_hz}
    if shaking.in_line is not None and shaking.in_line_hz is not None:
        columns |= {"in_line": shaking.in_line, "in_line_hz": shaking.in_line_hz}
    return columns | {"drag_amplification": shaking.drag_amplification}


class WinchEncoder:
    """Encodes control modes and component states of the winches."""

    def __init__(self) -> None:
        self._sized = Templates()

    def mode(self, snapshot: Snapshot) -> bytes:
        """Return control mode and active limit of each winch, in words."""
        words = "; ".join(mode_words(winch) for winch in snapshot.winches)
        return serialise(new("std_msgs/msg/String", data=words))

    def parts(self, snapshot: Snapshot, stamp: dict[str, int]) -> bytes:
        """Return the component states of each winch, as positions of joints winch/quantity."""
        rows = [
            (f"{winch.name}/{name}", value)
            for winch in snapshot.winches
            for name, value in (("target", winch.target), *winch.figures)
        ]
        names = tuple(name for name, _ in rows)
        template = self._sized.get(
            "winch/parts", names, lambda: templates.joint_state(names, ("position",))
        )
        values = {"position": [value for _, value in rows]} if rows else {}
        return template.fill({**stamp, **values})


def mode_words(winch: WinchShot) -> str:
    """Return the control mode in words, such as `winch: length 350 m (limit)`."""
    unit = CONTROL_MODES.get(winch.mode, "")
    told = f"{winch.mode} {winch.target:g} {unit}" if unit else winch.mode.replace("_", " ")
    return f"{winch.name}: {told}" + (f" ({winch.at_limit})" if winch.at_limit else "")

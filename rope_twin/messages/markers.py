"""Markers of ropes and payloads, for display: lines coloured by tension, symbols, text."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from rope_twin.messages import templates
from rope_twin.messages.cdr import Template, Templates
from rope_twin.messages.templates import scale_above, tension_colours
from rope_twin.twin.snapshot import BodyShot, Snapshot

# Marker sizes: a 40 mm rope on 3,000 m cannot be seen, so symbols grow with the line out.
_LINE_WIDTH, _SYMBOL_SIZE, _TEXT_HEIGHT = 1 / 1000, 1 / 100, 1 / 100
_LEAST_LINE_M = 100.0


class RopeMarkers:
    """Encodes `ropes/markers`; keeps the colour scale and the template of the last number of
    elements.
    """

    def __init__(self, frame: str, stamp: Callable[[Snapshot, str], dict[str, int]]) -> None:
        """Encode in a frame; stamp: fields of a snapshot's stamp at a path of the message."""
        self._frame, self._stamp = frame, stamp
        self._sized = Templates()
        self._rope_template: tuple[int, Template, Template] | None = None
        self._scale_n = 0.0

    def encode(self, snapshot: Snapshot, ends: Any, tension: Any) -> bytes:
        """Return the message; ends: of each element, (2·elements, 3); tension: of each [N]."""
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
        return self._template(snapshot, len(tension)).fill(values)

    def _template(self, snapshot: Snapshot, count: int) -> Template:
        """Return the template for this number of elements, which the winch changes, from one of
        one.
        """
        scale_n, words = self._scale_n, scale_words(self._scale_n)
        further, bars = tuple(one.name for one in snapshot.payloads), len(snapshot.struts)
        slings = 0 if snapshot.body is None else len(snapshot.body.leg_end_m)
        form = self._sized.get(
            "ropes/markers of one element",
            (scale_n, further, bars, slings),
            lambda: templates.rope_markers(self._frame, 1, words, further, bars, slings),
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
    hook = np.broadcast_to(body.hook_m, body.leg_end_m.shape)
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

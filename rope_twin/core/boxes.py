"""Intersection of lines and points with boxes, for a single rope and for lanes.

A box is centre and half sizes along its axes, a row of `boxes` (boxes, 6); points are given in the
same axes [m].
"""

from __future__ import annotations

from math import sqrt
from typing import Any

from rope_twin.core.jit.decorators import jit_within
from rope_twin.core.jit.functions import anywhere
from rope_twin.core.jit.wide import choose


@jit_within
def is_near(bounds: Any, a: Any, b: Any) -> Any:
    """Return whether the bounding box of two points intersects that of all boxes."""
    return (
        (min(a[2], b[2]) < bounds[5]) & (max(a[2], b[2]) > bounds[2])
        & (min(a[0], b[0]) < bounds[3]) & (max(a[0], b[0]) > bounds[0])
        & (min(a[1], b[1]) < bounds[4]) & (max(a[1], b[1]) > bounds[1])
    )  # fmt: skip


@jit_within
def _slab(start: Any, end: Any, a: Any, b: Any, half: Any) -> Any:
    """Return the interval of start <= t <= end in which |a + t·(b - a)| < half."""
    step = b - a
    enter, leave = (-half - a) / step, (half - a) / step
    first, last = max(start, min(enter, leave)), min(end, max(enter, leave))
    along = abs(step) <= 1e-12 * half
    if anywhere(along):
        inside = abs(a) < half
        first = choose(along, choose(inside, start, 1.0), first)
        last = choose(along, choose(inside, end, 0.0), last)
    return first, last


@jit_within
def part_inside(boxes: Any, j: int, a: Any, b: Any) -> Any:
    """Return the range of t of the element from a to b inside box j; end < start if empty."""
    start, end = _slab(0.0, 1.0, a[0] - boxes[j, 0], b[0] - boxes[j, 0], boxes[j, 3])
    start, end = _slab(start, end, a[1] - boxes[j, 1], b[1] - boxes[j, 1], boxes[j, 4])
    return _slab(start, end, a[2] - boxes[j, 2], b[2] - boxes[j, 2], boxes[j, 5])


@jit_within
def depth_inside(x: Any, y: Any, z: Any, a: Any, b: Any, c: Any) -> Any:
    """Return the depth d of a point in a box about the origin, and -∇d; zeros outside.

    a, b, c: half sizes; d = (Σ 1/g²)^-½, g the distances to the six faces (effects/hull_contact).
    """
    near = min(min(a - abs(x), b - abs(y)), c - abs(z))
    inside, zero = near > 0.0, 0.0 * near
    if not anywhere(inside):
        return zero, zero, zero, zero
    x1, x2, y1, y2 = near / (a - x), near / (a + x), near / (b - y), near / (b + y)
    z1, z2 = near / (c - z), near / (c + z)
    scale = 1.0 / sqrt(x1 * x1 + x2 * x2 + y1 * y1 + y2 * y2 + z1 * z1 + z2 * z2)
    cube = scale * scale * scale
    return (
        choose(inside, near * scale, zero),
        choose(inside, cube * (x1 * x1 * x1 - x2 * x2 * x2), zero),
        choose(inside, cube * (y1 * y1 * y1 - y2 * y2 * y2), zero),
        choose(inside, cube * (z1 * z1 * z1 - z2 * z2 * z2), zero),
    )


@jit_within
def is_beyond(boxes: Any, j: int, at: Any, radius: Any) -> Any:
    """Return whether a point is farther than its radius from box j along an axis."""
    return (
        (abs(at[0] - boxes[j, 0]) > boxes[j, 3] + radius)
        | (abs(at[1] - boxes[j, 1]) > boxes[j, 4] + radius)
        | (abs(at[2] - boxes[j, 2]) > boxes[j, 5] + radius)
    )

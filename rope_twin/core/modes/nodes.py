"""A rope's nodes, for what is computed beside the step on places of its own, at each look."""

from __future__ import annotations

from math import sqrt
from typing import Any

import numpy as np

from rope_twin.core.compiler.jit import jit, jit_entry
from rope_twin.core.state import ELEMENTS, FLOW, POSITION, VELOCITY, Floats, Rope


def along(rope: Rope) -> Floats:
    """Of the nodes, along the stretched rope from the hang-off, less than 0 [m]."""
    found = np.empty(int(rope.state.counts[ELEMENTS]) + 1)
    _along(rope.state.nodes, found)
    return found


def mix_flow(flow: Floats, rope: Rope, share: float) -> None:
    """Let a share of water less rope into its running mean `flow` [m/s], (3, shares).

    flow: at equal shares of the elements from the lower end up; the hang-off has that of the node
    below.
    """
    _mix(flow, rope.state.nodes, rope.work, int(rope.state.counts[ELEMENTS]), share)


def mean_around(at: Floats, s: Floats, values: Floats) -> Floats:
    """Mean of `values`, linear between `s`, over the halves beside each of `at`, both rising.

    So a sum over coarse nodes has all of what goes up and down between them. Beyond the ends of `s`
    the end's value holds.
    """
    found = np.empty(len(at))
    _mean(at, s, values, found)
    return found


@jit_entry
def _along(nodes: Any, found: Any) -> None:
    n = found.shape[0] - 1
    found[n] = 0.0
    for i in range(n - 1, -1, -1):
        square = 0.0
        for k in range(POSITION, POSITION + 3):
            step = nodes[k, i + 1] - nodes[k, i]
            square += step * step
        found[i] = found[i + 1] - sqrt(square)


@jit_entry
def _mix(flow: Any, nodes: Any, work: Any, n: int, share: float) -> None:
    shares = flow.shape[1]
    for j in range(shares):
        place = j * n / (shares - 1.0)
        i = min(int(place), n - 1)
        part, above = place - i, min(i + 1, n - 1)
        for k in range(3):
            low = work[FLOW + k, i] - nodes[VELOCITY + k, i]
            high = work[FLOW + k, above] - nodes[VELOCITY + k, above]
            flow[k, j] += share * (low + part * (high - low) - flow[k, j])


@jit_entry
def _mean(at: Any, s: Any, values: Any, found: Any) -> None:
    """Piece by piece from the lowest up, each as far as the next of `s` or the share's end."""
    nodes, above = at.shape[0], 0  # `above`: the first of `s` that is beyond what was summed up
    start = at[0]
    while above < s.shape[0] and s[above] <= start:
        above += 1
    level = _level(s, values, above, start)
    for node in range(nodes):
        low, whole = start, 0.0
        end = at[nodes - 1] if node == nodes - 1 else 0.5 * (at[node] + at[node + 1])
        while low < end:
            high = min(end, s[above]) if above < s.shape[0] else end
            before, level = level, _level(s, values, above, high)
            whole += 0.5 * (before + level) * (high - low)
            low = high
            while above < s.shape[0] and s[above] <= low:
                above += 1
        found[node] = whole / (end - start)
        start = end


@jit
def _level(s: Any, values: Any, above: int, at: float) -> float:
    """Linear between above - 1 and `above`; beyond the ends the end's value."""
    if above == 0:
        return float(values[0])
    if above == s.shape[0]:
        return float(values[above - 1])
    share = (at - s[above - 1]) / (s[above] - s[above - 1])
    return float((1.0 - share) * values[above - 1] + share * values[above])

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


def mean_around(at: Floats, s: Floats, values: Floats, least: Floats) -> Floats:
    """Mean of `values`, linear between `s`, over the halves beside each of `at`, both rising.

    So a sum over coarse nodes has all of what goes up and down between them. `least`: a mean is
    over this length at least, but not beyond the ends of `at`, (len(at),): what goes up and down
    with a shorter wave is then the same for finer nodes. Beyond the ends of `s` the end's value
    holds.
    """
    found, up_to = np.empty(len(at)), np.empty(len(s))
    _mean(at, s, values, least, up_to, found)
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
def _mean(at: Any, s: Any, values: Any, least: Any, up_to: Any, found: Any) -> None:
    last, low, high = at.shape[0] - 1, 0, 0
    up_to[0] = 0.0
    for i in range(1, s.shape[0]):
        up_to[i] = up_to[i - 1] + 0.5 * (values[i] + values[i - 1]) * (s[i] - s[i - 1])
    for node in range(last + 1):
        start = 0.5 * (at[node] + at[max(node - 1, 0)])
        end = 0.5 * (at[node] + at[min(node + 1, last)])
        start = max(min(start, at[node] - 0.5 * least[node]), at[0])
        end = min(max(end, at[node] + 0.5 * least[node]), at[last])
        low, high = _below(s, start, low), _below(s, end, high)
        whole = _integral(s, values, up_to, end, high) - _integral(s, values, up_to, start, low)
        found[node] = whole / (end - start)


@jit
def _below(s: Any, at: float, guess: int) -> int:
    """The last of `s` that is not above, from a guess; the first where all are."""
    i, last = guess, s.shape[0] - 1
    while i < last and s[i + 1] <= at:
        i += 1
    while i > 0 and s[i] > at:
        i -= 1
    return i


@jit
def _integral(s: Any, values: Any, up_to: Any, at: float, i: int) -> float:
    """Of the values from s[0] to there; i: the last of `s` below."""
    step = at - s[i]
    if i == s.shape[0] - 1 or step <= 0.0:
        return float(up_to[i] + values[i] * step)
    slope = (values[i + 1] - values[i]) / (s[i + 1] - s[i])
    return float(up_to[i] + step * (values[i] + 0.5 * slope * step))

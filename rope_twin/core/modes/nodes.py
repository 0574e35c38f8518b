"""Sampling of a rope's nodes for models with their own mesh, decoupled from the step."""

from __future__ import annotations

from math import sqrt
from typing import Any

import numpy as np

from rope_twin.core.jit.decorators import jit, jit_entry
from rope_twin.core.state import ELEMENTS, FLOW, POSITION, VELOCITY, Floats, Rope


def along(rope: Rope) -> Floats:
    """Return the nodes' coordinates along the stretched rope, from the hang-off, negative [m]."""
    found = np.empty(int(rope.state.counts[ELEMENTS]) + 1)
    _along(rope.state.nodes, found)
    return found


def mix_flow(flow: Floats, rope: Rope, share: float) -> None:
    """Update the running mean `flow` of relative water velocity [m/s], (3, shares), by a fraction.

    flow: at equal fractions of the elements from the lower end up; the hang-off has the value of
    the node below.
    """
    _mix(flow, rope.state.nodes, rope.work, int(rope.state.counts[ELEMENTS]), share)


def mean_around(at: Floats, s: Floats, values: Floats, least: Floats) -> Floats:
    """Return weighted means of `values`, linear between `s`, around each of `at`.

    `at` and `s` are ascending. The weight falls linearly to 0 at the neighbours of `at`, so that a
    sum over coarse nodes contains everything that oscillates between them. `least`, (len(at),):
    minimum half width of the window, so that oscillations of about that period give the same mean
    on any mesh. Values are mirrored at both ends of `s`.
    """
    found, once, twice = np.empty(len(at)), np.empty(len(s)), np.empty(len(s))
    _mean(at, s, values, least, once, twice, found)
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
def _mean(at: Any, s: Any, values: Any, least: Any, once: Any, twice: Any, found: Any) -> None:
    once[0] = twice[0] = 0.0  # integrals of the values from s[0], and double integrals
    for i in range(1, s.shape[0]):
        step = s[i] - s[i - 1]
        once[i] = once[i - 1] + 0.5 * (values[i] + values[i - 1]) * step
        twice[i] = twice[i - 1] + once[i - 1] * step
        twice[i] += (2.0 * values[i - 1] + values[i]) * step * step / 6.0
    last, length, low, high = at.shape[0] - 1, s[-1] - s[0], 0, 0
    for node in range(last + 1):
        middle = min(max(at[node], s[0]), s[-1])
        down = at[node] - at[node - 1] if node > 0 else at[1] - at[0]
        up = at[node + 1] - at[node] if node < last else at[last] - at[last - 1]
        down = min(max(down, least[node]), length)
        up = min(max(up, least[node]), length)
        low, high = _below(s, middle - down, low), _below(s, middle + up, high)
        here = _twice(s, values, once, twice, middle, _below(s, middle, low))
        above = _mirrored(s, values, once, twice, middle + up, high) - here
        below = here - _mirrored(s, values, once, twice, middle - down, low)
        found[node] = (above / up - below / down) / (0.5 * (up + down))


@jit
def _below(s: Any, at: float, guess: int) -> int:
    """Return the index of the last of `s` not above `at`, from a guess; 0 if all are above."""
    i, last = guess, s.shape[0] - 1
    while i < last and s[i + 1] <= at:
        i += 1
    while i > 0 and s[i] > at:
        i -= 1
    return i


@jit
def _twice(s: Any, values: Any, once: Any, twice: Any, at: float, i: int) -> float:
    """Return the double integral of the values from s[0] to `at`; i: the last of `s` below."""
    i = min(i, s.shape[0] - 2)
    step = at - s[i]
    slope = (values[i + 1] - values[i]) / (s[i + 1] - s[i])
    inner = 0.5 * values[i] + slope * step / 6.0
    return float(twice[i] + step * (once[i] + step * inner))


@jit
def _mirrored(s: Any, values: Any, once: Any, twice: Any, at: float, guess: int) -> float:
    """Return the double integral, extended beyond the ends of `s` by mirroring."""
    if at < s[0]:
        inside = 2.0 * s[0] - at
        return float(_twice(s, values, once, twice, inside, _below(s, inside, guess)))
    if at > s[-1]:
        inside = 2.0 * s[-1] - at
        found = _twice(s, values, once, twice, inside, _below(s, inside, guess))
        return float(found + 2.0 * once[-1] * (at - s[-1]))
    return float(_twice(s, values, once, twice, at, guess))

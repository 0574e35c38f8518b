"""Initial mesh of a rope: equal elements, or shorter ones near its lower end."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import pairwise

import numpy as np

from rope_twin.core.state import Floats
from rope_twin.scene.arrays.composite import ends_m
from rope_twin.scene.schema import Grading, RopeLine, Scene

FEWEST_ELEMENTS = 3  # minimum per rope
ROOM = 0.9  # of the minimum paid-out length: maximum length of the lowest element


def node_coordinates(line: RopeLine, least_line_out_m: float | None) -> Floats:
    """Return the unstretched distance of each node from the lower end [m].

    A section's end is a node: the adjacent elements are stretched to meet there. Where the winch
    may haul in to less than the lowest of equal elements, that one is divided into elements that
    double in length, the lowest half of the minimum length.
    """
    length, count = line.length_m, line.elements
    grading = line.grading
    if grading is None:
        nodes: Floats = np.linspace(0.0, length, count + 1)
        if least_line_out_m is not None and ROOM * least_line_out_m < nodes[1]:
            nodes = np.concatenate([[0.0], halvings(least_line_out_m, float(nodes[1])), nodes[1:]])
    elif grading.nodes_m is not None:
        low = [0.0, *grading.nodes_m]
        above = np.linspace(low[-1], length, count - len(low) + 2)
        nodes = np.concatenate([low[:-1], above])
    else:
        nodes = _graded(grading.lowest_m or 0.0, grading.growth, length, count)
    return _meeting(nodes, [end for end in ends_m(line) if end < length])


def elements_with(own: Sequence[int], first: int) -> list[int]:
    """Return the elements of all ropes in proportion, given the number of the first."""
    others = (max(FEWEST_ELEMENTS, round(count * first / own[0])) for count in own[1:])
    return [first, *others]


def halvings(least: float, length: float) -> list[float]:
    """Return nodes between elements of least/2, least, 2·least ... up to a length."""
    nodes, rest = [0.5 * least], 0.5 * least
    while nodes[-1] + 3.0 * rest <= length:
        rest *= 2.0
        nodes.append(nodes[-1] + rest)
    return nodes


def least_line_out_m(scene: Scene) -> float | None:
    """Return the minimum paid-out length of the winch [m]; None without a winch."""
    return scene.winch.least_line_out_m if scene.winch else None


def grading_faults(line: RopeLine, grading: Grading) -> Iterator[tuple[str, str]]:
    """Yield the faults of a mesh grading, each with a remedy."""
    length, count = line.length_m, line.elements
    if (grading.lowest_m is None) == (grading.nodes_m is None):
        given = "neither" if grading.lowest_m is None else "both"
        yield f"{given} of lowest_m and nodes_m are given", "give one of them"
    elif grading.lowest_m is not None:
        lowest, growth = grading.lowest_m, grading.growth
        if lowest > length / count:
            what = f"{lowest:g} m is longer than equal elements of {length / count:g} m"
            yield what, "give a shorter one"
        elif largest_reach(lowest, growth, count) < length:
            reach = largest_reach(lowest, growth, count)
            what = (
                f"{count} elements from {lowest:g} m growing by {growth:g} reach only {reach:.4g} m"
            )
            yield what, "give more elements, a larger growth or a longer lowest one"
    else:
        nodes = [0.0, *(grading.nodes_m or ())]
        if len(nodes) > count:
            yield f"{len(nodes) - 1} nodes for {count} elements", "give more elements"
        elif not all(low < high for low, high in pairwise([*nodes, length])):
            yield "the nodes do not ascend from 0 to length_m", "order them from the lower end up"


def largest_reach(lowest: float, growth: float, count: int) -> float:
    """Return the length of `count` elements that all grow [m]."""
    return float(lowest * (growth ** min(count, 400) - 1.0) / (growth - 1.0))


def _graded(lowest: float, growth: float, length: float, count: int) -> Floats:
    """Return elements lowest, lowest·growth, ... up to the equal ones that fill the length."""
    growing = lowest * growth ** np.minimum(np.arange(count), 400.0)
    low, high = lowest, length
    for _ in range(100):
        middle = 0.5 * (low + high)
        short = np.minimum(growing, middle).sum() < length
        low, high = (middle, high) if short else (low, middle)
    nodes: Floats = np.concatenate([[0.0], np.cumsum(np.minimum(growing, high))])
    nodes *= length / nodes[-1]
    return nodes


def _meeting(nodes: Floats, ends: Sequence[float]) -> Floats:
    """Move nodes so that each of the ends is one; every section keeps at least one element."""
    if not ends:
        return nodes
    count = len(nodes) - 1
    chosen = [0]
    for number, end in enumerate(ends):
        nearest = int(np.abs(nodes - end).argmin())
        chosen.append(min(max(nearest, chosen[-1] + 1), count - len(ends) + number))
    chosen.append(count)
    places = [0.0, *ends, float(nodes[-1])]
    moved = nodes.copy()
    for (first, last), (low, high) in zip(pairwise(chosen), pairwise(places), strict=True):
        part = nodes[first : last + 1]
        moved[first : last + 1] = low + (part - part[0]) * ((high - low) / (part[-1] - part[0]))
        moved[first], moved[last] = low, high
    return moved

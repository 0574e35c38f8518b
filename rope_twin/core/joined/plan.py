"""Order of elimination of a multi-line system: from the leaves of its trees to their roots.

A *chain* is a range of a rope's nodes that is eliminated in one direction. Where ropes form a tree,
every connection has one outgoing chain towards the root, which is eliminated after the incoming
ones: there is no fill-in. The root is a node of a rope, chosen to balance the two lanes of a SIMD
register; the plan of a single rope is its twisted (two-sided) factorisation.

Connections in a loop of ropes, with a link or at a sheave are *dense*: trees are eliminated onto
them, ropes between two of them are condensed onto both (core/joined/chains), and a small dense
system remains (core/joined/joints).

The plan depends on the topology and the numbers of elements only, so that results are bit-identical
after a restart and for any division of a run into calls.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np

from rope_twin.core.elimination import RECORD
from rope_twin.core.state import LINE_DOUBLES, Floats, Ints

# Columns of `spans`: first node and direction of both lanes, number of pairs, the initial state of
# either lane (slot of a connection, or one of the values below), and the slot to which its Schur
# complement is added, or NOWHERE.
A, A_WAY, B, B_WAY, COUNT, A_BEGIN, B_BEGIN, A_INTO, B_INTO, SPAN = range(10)
CARRY, NOTHING, HELD, IDLE = -1, -2, -3, -4  # IDLE: the lane repeats the other one
NOWHERE = -1
JOINT, COLUMN, SUMMED, END = range(4)  # columns of `ends`
SPANS, ENDS, ROOTS, BETWEEN, ONTO, DENSE, SIZES = range(7)  # `sizes`
# Rows of `sums`: Schur complement, force, matrix of a root
LEFT, FORCE, KEPT, SUM_ROWS = 0, 6, 9, 15
NEW_SPAN = 3  # cost of starting a span, in pairs


class Plan(NamedTuple):
    """Order of elimination; nodes are columns of the contiguous work arrays of all ropes."""

    spans: Ints  # (spans, SPAN)
    ends: Ints  # (ends at connections, END); SUMMED: added to the connection's sum
    roots: Ints  # (roots, 2): node and slot
    between: Ints  # ropes between two dense connections
    onto: Ints  # (chains, 2): rope and dense connection that it was eliminated onto
    dense: Ints  # of each connection: 1 where it belongs to the dense system
    sizes: Ints  # rows in use of the tables above, and the number of dense connections
    counts: Ints  # elements of each rope for which the plan was made
    sums: Floats  # scratch, (SUM_ROWS, slots): connections, ropes, roots
    records: Floats  # scratch: factors of the pairs, (1, any)


class Chain(NamedTuple):
    """Nodes of a rope that are eliminated one after the other."""

    first: int  # column of its first node
    way: int  # 1 towards the upper end, -1 towards the lower end
    nodes: int  # number of them
    begin: int  # slot of the connection at its first node, HELD or NOTHING
    into: int  # slot


class Topology(NamedTuple):
    """Connections at the ends of ropes."""

    lower: tuple[int, ...]  # connection at each rope's lower end, negative if there is none
    upper: tuple[int, ...]
    first: tuple[int, ...]  # lowest free node of each rope
    coupled: frozenset[int]  # connections that are dense in any case
    columns: int  # between a node of a rope and the same of the next rope
    joints: int


def new_plan(ropes: int, joints: int, nodes: int) -> Plan:
    """Return an empty plan for systems of this size; nodes: maximum of all ropes together."""
    space = np.zeros(RECORD * (nodes + 1) + LINE_DOUBLES)
    start = -(space.ctypes.data // space.itemsize) % LINE_DOUBLES
    return Plan(
        spans=np.zeros((2 * ropes, SPAN), np.int64),
        ends=np.zeros((2 * ropes, END), np.int64),
        roots=np.zeros((ropes, 2), np.int64),
        between=np.zeros(ropes, np.int64),
        onto=np.zeros((2 * ropes, 2), np.int64),
        dense=np.zeros(joints, np.int64),
        sizes=np.zeros(SIZES, np.int64),
        counts=np.full(ropes, -1),
        sums=np.zeros((SUM_ROWS, joints + 2 * ropes)),
        records=space[start : start + RECORD * (nodes + 1)].reshape(1, -1),
    )


class _Order(NamedTuple):
    """Order of elimination: the rows of a plan's tables."""

    spans: list[tuple[int, ...]]
    ends: list[tuple[int, int, int]]
    roots: list[tuple[int, int]]
    between: list[int]
    onto: list[tuple[int, int]]
    dense: frozenset[int]


def write_plan(plan: Plan, topology: Topology, counts: Ints) -> None:
    """Write the plan for ropes with these numbers of elements."""
    order = _order(topology, tuple(int(count) for count in counts))
    plan.counts[:] = counts
    plan.dense[:] = [j in order.dense for j in range(topology.joints)]
    plan.sizes[:] = [len(rows_of) for rows_of in order]
    lists: tuple[Sequence[Any], ...] = order[:-1]
    tables = plan.spans, plan.ends, plan.roots, plan.between, plan.onto
    for table, rows in zip(tables, lists, strict=True):
        for k, row in enumerate(rows):
            table[k] = row


@lru_cache(maxsize=256)  # members of a fleet with equal payout share a plan
def _order(topology: Topology, n: tuple[int, ...]) -> _Order:
    """Return the order of elimination for ropes with these numbers of elements."""
    layout = _Layout(topology, n)
    dense = _dense(topology)
    between = [r for r in range(len(n)) if {topology.lower[r], topology.upper[r]} <= dense]
    seen, chains = set(between), []
    onto: list[tuple[int, int]] = []
    roots: list[tuple[int, int]] = []
    for j in sorted(dense):
        for r in layout.ropes_at(j):
            if r not in seen:
                chains += layout.towards(j, r, topology.joints + r, seen)
                onto.append((r, j))
    for r in range(len(n)):
        if r not in seen:
            slot = topology.joints + len(n) + len(roots)
            tree, root = layout.tree(r, slot, seen)
            chains += tree
            roots.append((root, slot))
    spans = _schedule(chains)
    starts = {chain.first for chain in chains if chain.begin >= 0}
    ends = [
        (j, column, int(j not in dense and column not in starts))
        for r in range(len(n))
        for j, column in layout.ends(r)
        if j >= 0
    ]
    return _Order(spans, ends, roots, between, onto, dense)


def _dense(topology: Topology) -> frozenset[int]:
    """Return the connections that remain after repeated removal of leaves."""
    links = [pair for pair in zip(topology.lower, topology.upper, strict=True) if min(pair) >= 0]
    remaining = set(range(topology.joints))
    while True:
        degree = dict.fromkeys(remaining, 0)
        for pair in links:
            if remaining.issuperset(pair):
                for j in pair:
                    degree[j] += 1
        leaves = {j for j in remaining if degree[j] < 2} - topology.coupled
        if not leaves:
            return frozenset(remaining)
        remaining.remove(min(leaves))


class _Layout:
    """Chains of a system of ropes."""

    def __init__(self, topology: Topology, counts: tuple[int, ...]) -> None:
        self._of, self._n = topology, counts

    def ends(self, r: int) -> tuple[tuple[int, int], tuple[int, int]]:
        """Return connection and node of both ends of rope r."""
        first = r * self._of.columns
        return (self._of.lower[r], first), (self._of.upper[r], first + self._n[r])

    def ropes_at(self, j: int) -> list[int]:
        """Return the ropes that end at a connection."""
        both = zip(self._of.lower, self._of.upper, strict=True)
        return [r for r, pair in enumerate(both) if j in pair]

    def _up(self, r: int, node: int, into: int) -> Chain:
        """Return the chain from the lower end of rope r to its node, which is not in it."""
        low = self._of.lower[r]
        start = 0 if low >= 0 else self._of.first[r]
        begin = low if low >= 0 else (HELD if start == 1 else NOTHING)
        return Chain(r * self._of.columns + start, 1, node - start, begin, into)

    def _down(self, r: int, node: int, into: int) -> Chain:
        """Return the chain from the upper end of rope r to its node, which is not in it."""
        high = self._of.upper[r]
        start = self._n[r] - (high < 0)
        begin = high if high >= 0 else HELD
        return Chain(r * self._of.columns + start, -1, start - node, begin, into)

    def _before(self, chain: Chain, seen: set[int]) -> list[Chain]:
        """Return a chain and all chains that must be eliminated before it."""
        chains = [chain]
        if chain.begin >= 0:
            for r in self.ropes_at(chain.begin):
                if r not in seen:
                    chains += self.towards(chain.begin, r, chain.begin, seen)
        return chains

    def towards(self, j: int, r: int, into: int, seen: set[int]) -> list[Chain]:
        """Return the chain of rope r to a connection, and those before it."""
        seen.add(r)
        upward = self._of.upper[r] == j
        chain = self._up(r, self._n[r], into) if upward else self._down(r, 0, into)
        return self._before(chain, seen)

    def _rooted(self, r: int, node: int, slot: int, seen: set[int]) -> list[Chain]:
        """Return the chains of a tree whose root is a node of rope r."""
        seen.add(r)
        halves = self._up(r, node, slot), self._down(r, node, slot)
        chains = [part for chain in halves for part in self._before(chain, seen)]
        return [chain for chain in chains if chain.nodes > 0 or chain.begin == HELD]

    def tree(self, r: int, slot: int, seen: set[int]) -> tuple[list[Chain], int]:
        """Return the chains of the tree with rope r, and its root; its ropes are added to `seen`.

        Two roots are tried in each rope: the one with equal numbers of nodes on both sides, and the
        rope's middle.
        """
        seen_before = set(seen)
        ropes = {
            chain.first // self._of.columns for chain in self._rooted(r, self._low(r), slot, seen)
        }
        best: tuple[int, list[Chain], int] | None = None
        for rope in sorted({*ropes, r}):
            low, high = self._low(rope), self._n[rope] - 1
            chains = self._rooted(rope, low, slot, set(seen_before))
            below = self._of.lower[rope]
            nodes_below = 0
            if below >= 0:
                rope_seen = {*seen_before, rope}
                nodes_below = sum(
                    chain.nodes
                    for neighbour in self.ropes_at(below)
                    if neighbour not in rope_seen
                    for chain in self.towards(below, neighbour, below, rope_seen)
                )
            total = sum(chain.nodes for chain in chains)
            for node in {(low + high) // 2, min(max(low + total // 2 - nodes_below, low), high)}:
                chains = self._rooted(rope, node, slot, set(seen_before))
                spans = _schedule(chains)
                cost = sum(span[COUNT] for span in spans) + NEW_SPAN * len(spans)
                if best is None or cost < best[0]:
                    best = cost, chains, rope * self._of.columns + node
        assert best is not None
        return best[1], best[2]

    def _low(self, r: int) -> int:
        """Return the lowest node of rope r that can be a root."""
        return 1 if self._of.lower[r] >= 0 else self._of.first[r]


class _Lane:
    """A lane of the schedule and the remainder of its chain."""

    def __init__(self) -> None:
        self.chain: Chain | None = None

    def part(self, count: int) -> tuple[tuple[int, int, int], int]:
        """Remove nodes from the chain; return first node, direction and begin, and its end slot."""
        chain = self.chain
        assert chain is not None
        begun = chain.first, chain.way, chain.begin
        remaining = chain.nodes - count
        self.chain = Chain(chain.first + count * chain.way, chain.way, remaining, CARRY, chain.into)
        if remaining == 0:
            self.chain = None
        return begun, NOWHERE if remaining else chain.into


def _schedule(chains: list[Chain]) -> list[tuple[int, ...]]:
    """Return the spans of two lanes, by list scheduling with the distance to the root as priority.

    A chain is ready once all chains into its connection are complete.
    """
    after = {chain.begin: chain for chain in chains if chain.begin >= 0}
    missing: dict[int, int] = {}
    for chain in chains:
        missing[chain.into] = missing.get(chain.into, 0) + 1

    def distance(chain: Chain) -> int:
        following = after.get(chain.into)
        return chain.nodes + (distance(following) if following else 0)

    waiting = sorted(chains, key=distance, reverse=True)  # stable sort
    lanes = _Lane(), _Lane()
    spans: list[tuple[int, ...]] = []
    while True:
        for lane in lanes:
            ready = [
                lane_a for lane_a in waiting if lane_a.begin < 0 or not missing.get(lane_a.begin)
            ]
            if lane.chain is None and ready:
                lane.chain = ready[0]
                waiting.remove(ready[0])
        remaining = [lane.chain.nodes for lane in lanes if lane.chain is not None]
        if not remaining:
            return spans
        count = min(remaining)
        parts = [lane.part(count) if lane.chain else None for lane in lanes]
        starts = [part[0] if part else None for part in parts]
        into = [part[1] if part else NOWHERE for part in parts]
        lane_a, lane_b = (
            start or (*other_start[:2], IDLE)  # type: ignore[index]
            for start, other_start in zip(starts, reversed(starts), strict=True)
        )
        for slot in into:
            if slot != NOWHERE:
                missing[slot] -= 1
        spans.append(
            (lane_a[0], lane_a[1], lane_b[0], lane_b[1], count, lane_a[2], lane_b[2], *into)
        )

"""Members of a fleet: their states as arrays with the members as the first axis, and their figures.

The arrays are what the lanes are filled from (`Group.begin_stacked`); a member that takes a step
alone does it on views of them.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

from rope_twin.core import state as rows
from rope_twin.core.jit.wide import LANES
from rope_twin.core.lanes.group import Kind, kind_of, why_alone
from rope_twin.core.state import Floats, Ints, Rope, State
from rope_twin.twin.ensemble.figures import (
    FIGURES,
    scaled_rope,
    stacked_effects,
    stacked_sections,
)
from rope_twin.twin.internal_variables import has_state, own_copies


class FleetMembers:
    """Ropes of one scene and mesh."""

    def __init__(self, rope: Rope, count: int) -> None:
        """Begin with copies of a rope."""
        self.rope = rope  # with the scene's figures; its state is not in use
        self.count = count
        self.factors: dict[str, Floats] = {name: np.ones(count) for name in FIGURES}
        self.failures: dict[int, str] = {}  # members that failed, and why
        parts: Any = (np.repeat(part[None], count, 0) for part in rope.state)
        self.states = State(*parts)
        self.effects: list[tuple[Any, ...]] = []  # of each member; shared if they have no memory
        self.adopt(rope.effects)

    @property
    def remember(self) -> bool:
        """Whether effects have internal variables."""
        return any(has_state(effect) for effect in self.rope.effects)

    @property
    def going(self) -> list[int]:
        """Members that have not failed."""
        return [k for k in range(self.count) if k not in self.failures]

    @property
    def why_alone(self) -> str:
        """Reason why members do not step in lanes; "": they do."""
        return why_alone(self.rope)

    def adopt(self, effects: tuple[Any, ...]) -> None:
        """Take effects with other data for all members, and their internal variables."""
        self.rope = self.rope._replace(effects=effects)
        self.effects = [own_copies(effects) for _ in range(self.count)] if self.remember else []
        self.scale()

    def scale(self) -> None:
        """Apply the factors to the kernel data."""
        kind = kind_of(self.rope)
        sections = stacked_sections(self.rope.sections, self.factors)
        effects = stacked_effects(self.rope.effects, self.factors) if kind and kind.plain else ()
        self._kind, self._alone = kind, dict[int, Rope]()
        self.stack = self.rope._replace(state=self.states, sections=sections, effects=effects)

    def set_all(self, state: State) -> None:
        """Give all members one state."""
        for mine, part in zip(self.states, state, strict=True):
            mine[:] = part

    def state_of(self, member: int) -> State:
        """Return views of a member's state."""
        return State(*(part[member] for part in self.states))

    def effects_of(self, member: int) -> tuple[Any, ...]:
        """Return the effects that hold a member's internal variables."""
        return self.effects[member] if self.effects else self.rope.effects

    def alone(self, member: int) -> Rope:
        """Return a member's rope, which shares its state and internal variables with the fleet."""
        found = self._alone.get(member)
        if found is None:
            factors = {name: float(value[member]) for name, value in self.factors.items()}
            rope = scaled_rope(self.rope, factors, self.effects_of(member))
            found = self._alone[member] = rope._replace(state=self.state_of(member))
        return found

    def kind_of(self, member: int) -> Kind | None:
        """Return what members in lanes must share; None: the member steps alone."""
        if self._kind is None:
            return None
        elements = int(self.states.counts[member, rows.ELEMENTS])
        if not self._kind.place and elements > 1:
            return self._kind._replace(elements=elements)
        return kind_of(self.rope._replace(state=self.state_of(member)))

    def alike(self, members: Ints) -> Iterator[Ints]:
        """Yield groups of members of one kind, as many as there are lanes, or one alone."""
        kinds: dict[Kind | int, list[int]] = {}
        for k in members.tolist():
            kinds.setdefault(self.kind_of(k) or k, []).append(k)
        for some in kinds.values():
            for first in range(0, len(some), LANES):
                yield np.array(some[first : first + LANES], dtype=np.int64)

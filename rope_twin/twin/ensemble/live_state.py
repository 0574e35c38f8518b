"""State of a live twin for members that begin from it, and its transfer to their own mesh.

The copy is cheap enough to be taken between two real-time steps. On the members' mesh a node has
the position, velocity and acceleration of the live rope's material there. An element has the mean
tension of the elements that it replaces; the tension of the uppermost one keeps the force on the
hang-off. Where a chord is shorter than the curve that it replaces, a length offset gives it its
tension and decays, as at the sheave (`core.payout`). Paid-out length, payload and connections are
kept exactly. Each rope of a multi-line system has a state of its own.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from rope_twin.core import state as rows
from rope_twin.core.payout import SMALLEST_REST, TRIALS
from rope_twin.core.state import SAME_PLACE, Floats, Ints, Model, Rope, State, new_state
from rope_twin.effects.current import profile_of, with_profile
from rope_twin.errors import InputError, StateError
from rope_twin.twin.ensemble.fleet_members import LiveState as LiveState
from rope_twin.twin.figures import copied_law
from rope_twin.twin.regrid import (
    Elements,
    UpperEnd,
    elements_of,
    has_state,
    material_nodes,
    offsets_for,
    on_nodes,
    own_copies,
    upper_ends,
    with_arrays_of,
)
from rope_twin.twin.twin import Twin


def live_state(twin: Twin) -> LiveState:
    """Return a copy of the twin's rope; call it in the stepping thread, between two steps.

    Raises:
        StateError: the rope was cut.
    """
    if twin.cut is not None:
        raise StateError("live state", "the rope was cut", "a fleet's rope is whole")
    view, joined = twin.inspect(), twin.joined
    if joined is None:
        speed = view.boundary.rate[:1, rows.LINE]
        (end,) = upper_ends(view.rope, view.pull[None], speed)
        return _copied(twin, view.rope, end)
    system = joined.system(view.rope)
    ends = upper_ends(
        system, joined.pull, joined.present_boundary(view.boundary).rate[:, rows.LINE]
    )
    first, *others = (
        _copied(twin, *rope_and_end) for rope_and_end in zip(system.ropes, ends, strict=True)
    )
    return replace(first, others=tuple(others), joints=system.joints.nodes.copy())


def _copied(twin: Twin, rope: Rope, end: UpperEnd) -> LiveState:
    """Return a copy of one of the twin's ropes."""
    state = rope.state
    n = int(state.counts[rows.ELEMENTS])
    copied = State(
        state.nodes[:, : n + 1].copy(),
        state.s[: n + 1].copy(),
        state.offset[:n].copy(),
        state.counts.copy(),
        state.health.copy(),
    )
    copied_rope = rope._replace(
        state=copied, effects=own_copies(rope.effects), work=rope.work[rows.TENSION, :n].copy(),
        sections=rope.sections.copy(), law=copied_law(rope.law),
    )  # fmt: skip
    return LiveState(
        twin.scene, twin.time_ns, copied_rope, end.pull_n, end.payout_m_per_s, end.loaded
    )


def on_mesh(live: LiveState, rope: Rope, marks_m: Floats) -> tuple[State, tuple[Any, ...]]:
    """Return the live state on the mesh of another rope of the same scene, and that rope's effects.

    These effects get the current in force and the internal variables of the live rope; figures stay
    those of the other rope. On the same mesh every number of the state is kept.

    Args:
        live: the live state.
        rope: with the capacity and the model of the mesh.
        marks_m: coordinates of its nodes at the scene's paid-out length [m], (nodes,).

    Raises:
        InputError: the live state is that of another scene.
    """
    live_rope, capacity = live.rope, rope.state.s.shape[0]
    n = int(live_rope.state.counts[rows.ELEMENTS])
    if not _same_components(live_rope, rope):
        problem = f"the live state is that of a twin of '{live.scene.name}', with other parts"
        raise InputError("fleet", problem, "begin from a twin of the fleet's scene")
    state = new_state(capacity)
    same_mesh = _same_mesh(live_rope.model, rope.model) and n + 1 <= capacity - TRIALS
    if same_mesh:
        state.nodes[:, : n + 1] = live_rope.state.nodes
        state.s[: n + 1] = live_rope.state.s
        state.offset[:n] = live_rope.state.offset
        state.counts[:] = live_rope.state.counts
        state.health[:] = live_rope.state.health
        coordinates = live_rope.state.s
    else:
        coordinates = mesh_at(rope, marks_m, live.line_out_m)
        m = len(coordinates) - 1
        state.counts[rows.ELEMENTS] = m
        state.s[: len(coordinates)] = coordinates
        old = elements_of(live_rope.state, live_rope.sections, live.payout_m_per_s)
        _interpolate(live, old, coordinates, state)
        new = elements_of(state, rope.sections, live.payout_m_per_s)
        wanted = _wanted_tensions(live, old, new, coordinates)
        state.offset[:m] = offsets_for(rope, new, wanted)
    if not (same_mesh and _same_shapes(live_rope.effects, rope.effects)):
        carrying = coordinates if live.loaded else coordinates[:-1]
        live_rope = live_rope._replace(effects=on_nodes(live_rope.effects, carrying, capacity))
    pairs = zip(rope.effects, live_rope.effects, strict=True)
    return state, tuple(_with_live_arrays(effect, live_effect) for effect, live_effect in pairs)


def _with_live_arrays(effect: Any, live: Any) -> Any:
    """Return an effect with the current or the internal variables of a live one."""
    profile = None if has_state(live) else profile_of((live,))
    return with_arrays_of(live, effect) if profile is None else with_profile(effect, profile)


def mesh_at(rope: Rope, marks_m: Floats, line_out_m: float) -> Floats:
    """Return the node coordinates of a mesh at a paid-out length [m], (nodes,).

    Nodes are added and removed below the hang-off by the rule of payout (`core.payout`): marks at
    the scene's length are kept, ends of sections become nodes.
    """
    model, ends = rope.model, rope.sections[rows.END]
    nodes = list(marks_m[:-1])
    while len(nodes) > 2 and line_out_m - nodes[-1] < model.merge_below:
        nodes.pop()
    while True:
        top_length = line_out_m - nodes[-1]
        beyond = ends[ends > nodes[-1] + SAME_PLACE]
        end = float(beyond[0])
        if line_out_m - end > 2.0 * SMALLEST_REST and end - nodes[-1] <= model.split_above:
            nodes.append(end)
        elif top_length > model.split_above:
            nodes.append(nodes[-1] + model.element_length)
        else:
            return np.array([*nodes, line_out_m])


def _same_components(rope: Rope, other: Rope) -> bool:
    """Return whether two ropes have the same sections and kinds of effects."""
    return (
        rope.sections.shape == other.sections.shape
        and np.array_equal(rope.sections[rows.END], other.sections[rows.END])
        and list(map(type, rope.effects)) == list(map(type, other.effects))
    )


def _same_mesh(model: Model, other: Model) -> bool:
    return model.element_length == other.element_length and model.split_above == other.split_above


def _same_shapes(effects: tuple[Any, ...], other: tuple[Any, ...]) -> bool:
    """Return whether arrays of effects have the same shapes."""
    return all(
        getattr(a, "shape", ()) == getattr(b, "shape", ())
        for effect, other_effect in zip(effects, other, strict=True)
        for a, b in zip(effect, other_effect, strict=True)
    )


def _interpolate(live: LiveState, old: Elements, coordinates: Floats, state: State) -> None:
    """Set position, velocity and acceleration of the nodes; both ends have the live ones."""
    s, m = live.rope.state.s, len(coordinates) - 1
    state.nodes[:, m] = live.rope.state.nodes[:, len(old.rest)]
    for row, values in enumerate(material_nodes(live.rope.state, old, live.payout_m_per_s)):
        state.nodes[row, :m] = np.interp(coordinates[:m], s, values)


def _wanted_tensions(live: LiveState, old: Elements, new: Elements, coordinates: Floats) -> Floats:
    """Return the initial tension of each new element [N]; NaN: slack, by its length alone.

    It is the mean force of the material that the element spans, along the element; that of the
    uppermost one keeps the force on the hang-off.
    """
    s, tension = live.rope.state.s, live.rope.work
    force = np.where(tension > 0.0, tension, np.nan) * old.direction
    total = np.concatenate([np.zeros((3, 1)), np.cumsum(force * old.rest, axis=1)], axis=1)
    if np.isnan(total).any():
        mean = _means_between_slack(force, old.rest, s, coordinates)
    else:
        at_nodes = np.stack([np.interp(coordinates, s, row) for row in total])
        mean = np.diff(at_nodes, axis=1) / new.rest
    wanted: Floats = (mean * new.direction).sum(axis=0)
    if wanted[-1] > 0.0:
        load = (live.pull_n + tension[-1] * old.direction[:, -1]) / (0.5 * old.rest[-1])
        direction = new.direction[:, -1]
        wanted[-1] = max(float((0.5 * new.rest[-1] * load - live.pull_n) @ direction), 0.0)
    return np.where(wanted >= 0.0, wanted, np.nan)


def _means_between_slack(
    force: Floats, rest_lengths: Floats, s: Floats, coordinates: Floats
) -> Floats:
    """Return the mean force of each span of coordinates, (3, spans); NaN: part of it is slack."""
    slack = np.isnan(force[0])
    taut = np.where(slack, 0.0, force) * rest_lengths
    total = np.concatenate([np.zeros((3, 1)), np.cumsum(taut, axis=1)], axis=1)
    length = np.concatenate([[0.0], np.cumsum(np.where(slack, rest_lengths, 0.0))])
    spans: Ints = np.arange(3)
    at_nodes = np.stack([np.interp(coordinates, s, total[k]) for k in spans])
    slack_length = np.diff(np.interp(coordinates, s, length))
    mean: Floats = np.diff(at_nodes, axis=1) / np.diff(coordinates)
    return np.where(slack_length > SAME_PLACE, np.nan, mean)

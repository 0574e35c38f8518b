"""Line model of a scene's rope for cross-flow VIV.

It is taken from the static equilibrium in the scene's current: tension, mass with added mass, and
normal flow velocity. The motion is normal to the plane of current and rope, for which a sagging
rope is a string of its own length (Irvine 1981, ch. 3).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from rope_twin.core import state as rows
from rope_twin.core.state import Floats
from rope_twin.effects.added_mass import AddedMassParams
from rope_twin.effects.bending import BendingParams
from rope_twin.effects.current import CurrentParams
from rope_twin.errors import SceneError, phrase
from rope_twin.scene.model.rope import build
from rope_twin.scene.schema import Scene
from rope_twin.studies.modes.equilibrium import AtRest, bring_to_rest, water_at
from rope_twin.vortex.line_model import Span


@dataclass(frozen=True)
class SceneSpan:
    """The line, and where it lies."""

    span: Span
    place: Floats  # of its nodes, from the lower end up [m], (3, nodes)
    unstretched: Floats  # from the hang-off [m], (nodes,)


def span_of(scene: Scene) -> SceneSpan:
    """Return the line model of a scene in static equilibrium.

    Raises:
        SceneError: a multi-line system, no current, no static equilibrium, or a slack rope.
    """
    if not any(isinstance(params, CurrentParams) for params in scene.effects):
        what = "no current, so no vortices"
        raise SceneError(phrase(f"{scene.path}: effects", what, "add the effect 'current'"))
    rest = bring_to_rest(scene)
    sections = build(scene).sections
    steps = np.diff(rest.place, axis=1)
    length = np.sqrt((steps * steps).sum(axis=0))
    unstretched = np.concatenate([[0.0], np.cumsum(rest.rest)])
    middle = 0.5 * (unstretched[1:] + unstretched[:-1])
    which = np.searchsorted(sections[rows.END], middle, side="right")
    mass, volume = sections[rows.PER_METRE : rows.PER_METRE + 2, which]
    added = sum(p.normal for p in scene.effects if isinstance(p, AddedMassParams))
    density = scene.environment.water_density_kg_per_m3
    stretch = length / rest.rest
    span = Span(
        s=np.concatenate([[0.0], np.cumsum(length)]),
        tension=rest.tension,
        mass=(mass + added * density * volume) / stretch,
        diameter=_at_nodes(np.sqrt(4.0 * volume / np.pi)),
        speed=_speed(scene, rest),
        stiffness=sum(p.stiffness_n_m2 for p in scene.effects if isinstance(p, BendingParams)),
    )
    if rest.first == 0:
        normal = _across(scene, rest)
        whole = float(normal @ rest.mass[:, :, 0] @ normal)
        span = span._replace(end_mass=max(whole - float(span.node_mass[0]), 0.0))
    return SceneSpan(span, rest.place, unstretched[-1] - unstretched)


def _at_nodes(of_elements: Floats) -> Floats:
    """Return the mean of the elements adjacent to each node."""
    both = np.concatenate([of_elements[:1], of_elements, of_elements[-1:]])
    return np.asarray(0.5 * (both[1:] + both[:-1]))


def _speed(scene: Scene, rest: AtRest) -> Floats:
    """Return the speed of the current normal to the rope at all nodes [m/s]."""
    water = water_at(scene, rest.place[2])
    direction = np.gradient(rest.place, axis=1)
    direction /= np.sqrt((direction * direction).sum(axis=0))
    across = water - (water * direction).sum(axis=0) * direction
    return np.asarray(np.sqrt((across * across).sum(axis=0)))


def _across(scene: Scene, rest: AtRest) -> Floats:
    """Return the unit vector normal to rope and current at the lower end."""
    water = water_at(scene, rest.place[2]).sum(axis=1)
    normal = np.cross(water, rest.place[:, 1] - rest.place[:, 0])
    size = float(np.linalg.norm(normal))
    return normal / size if size > 0.0 else np.array([0.0, 1.0, 0.0])

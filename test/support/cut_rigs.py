"""Ropes that are cut, and mass, momentum and energy of the two parts."""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from rigs import Rig

from rope_twin import Twin
from rope_twin.core import state as rows
from rope_twin.core.state import Rope
from rope_twin.twin.rope_cut import without_massless_section
from rope_twin.twin.ropes import CutRope

Vector = NDArray[np.float64]
VACUUM = Rig(length=400.0, elements=20, load=5000.0, damping=65e3)
WATER = Rig(
    length=200.0, elements=20, load=3000.0, volume=0.5, added=(600.0,) * 3, area=(2.0,) * 3,
    density=1025.0, drag=(1.2, 0.05), added_mass=1.0, damping=65e3, step=0.02,
)  # fmt: skip


class Sums(NamedTuple):
    """Mass, momentum and energies of a rope with its payload, without added mass."""

    mass: float
    momentum: Vector
    motion: float
    stretch: float
    height: float


def sums(rope: Rope, rig: Rig, load: float) -> Sums:
    """Return the sums of a rope of a rig with this mass at its lower end."""
    n = int(rope.state.counts[rows.ELEMENTS])
    s, x, v = rope.state.s[: n + 1], rope.state.nodes[:3, : n + 1], rope.state.nodes[3:6, : n + 1]
    rest = np.diff(s)
    mass = 0.5 * rig.mass * (np.append(0.0, rest) + np.append(rest, 0.0))
    mass[0] += load
    length = np.linalg.norm(np.diff(x), axis=0) + rope.state.offset[:n]
    return Sums(
        float(mass.sum()),
        (mass * v).sum(axis=1),
        0.5 * float((mass * v**2).sum()),
        0.5 * rig.EA * float((rest * np.maximum(length / rest - 1.0, 0.0) ** 2).sum()),
        rig.gravity * float((mass * x[2]).sum()),
    )


def parts(twin: Twin, rig: Rig) -> tuple[Sums, Sums]:
    """Return the sums of the upper and the lower part."""
    return sums(twin.rope, rig, 0.0), sums(fallen(twin), rig, rig.load)


def fallen(twin: Twin) -> Rope:
    """Return the lower part of a rope that was cut."""
    assert isinstance(twin.inspect().ropes, CutRope)
    return without_massless_section(twin.inspect().ropes.lowest(twin.rope))


def swinging(rig: Rig) -> Twin:
    """Return a rope that swings, stretches and is paid out."""
    twin = replace(rig, step=0.01).twin()
    nodes, n = twin.rope.state.nodes, rig.elements
    mode = np.sin(np.linspace(0.5 * np.pi, np.pi, n + 1))
    nodes[3, : n + 1], nodes[4, : n + 1], nodes[5, : n + 1] = 3.0 * mode, -mode, 0.8 * mode
    twin.advance(40)
    return twin

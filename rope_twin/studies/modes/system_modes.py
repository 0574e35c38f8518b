"""Natural frequencies and modes of a multi-line system: K·φ = ω²·M·φ of all ropes together.

K and M are those of studies/modes/modes.py for each rope, assembled at the connections: nodes at a
connection are one, rope over a sheave is continuous, struts and tensioners hold their ends. A mode
is classified by its strain energy: in elements that stretch, or in tension that rotates (a
pendulum).
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from math import pi
from typing import Any

import numpy as np

from rope_twin.core.state import Floats
from rope_twin.errors import InputError, phrase
from rope_twin.scene.schema import Scene
from rope_twin.studies.modes.modes import AXIAL_MODES, STROUHAL, near_waves, solve
from rope_twin.studies.modes.rest import water_at
from rope_twin.studies.modes.system_rest import StillLine, StillSystem, bring_system_to_rest

NEAR = -1e-6  # [rad²/s²]: looked for from just below 0, as ropes over a sheave may run freely
LOOKED_AT = (60, 200, 600)  # modes among which the first that stretch are sought
FREE = 1e-4  # rad/s: what is slower is a motion that nothing holds, such as a spin about one rope
STRETCHING, SWINGING, UNHELD = "stretching", "swinging", "free"


@dataclass(frozen=True)
class SystemMode:
    """One natural mode of a multi-line system."""

    frequency_hz: float
    period_s: float  # infinite where nothing holds the motion
    kind: str  # stretching or swinging: where the larger part of its strain energy is; or free
    stretching_share: float  # of the strain energy
    vertical_share: float  # of the kinetic energy
    rope: str  # the one that moves most
    largest_at_m: float  # and where: unstretched from that rope's upper end
    wave_ratio: float  # period over the nearest of the waves' periods, 1 among them; free: infinite
    strouhal_hz: float  # of vortices in the scene's current where it moves most
    shapes: tuple[Floats, ...]  # motion of each rope's nodes, upper end first, largest 1


@dataclass(frozen=True)
class SystemModes:
    """Lowest modes of a multi-line system, and its first axial ones."""

    lowest: tuple[SystemMode, ...]
    stretching: tuple[SystemMode, ...]
    still: StillSystem


def find_system_modes(scene: Scene, count: int) -> SystemModes:
    """Return the `count` lowest modes and the first that stretch the ropes.

    Raises:
        InputError: a count that the ropes' free nodes do not give.
        SceneError: the ropes cannot rest, or are slack somewhere.
    """
    still = bring_system_to_rest(scene)
    size = still.follow.shape[1]
    most = size - 2
    if not 1 <= count <= most:
        what = f"{count} of ropes with {size} ways to move"
        raise InputError(phrase("--count", what, f"give 1 to {most}"))
    from scipy.sparse import diags_array

    stretch, turn, local_mass = (_whole(still, part) for part in (_stretch, _turn, _masses))
    K, M = stretch + turn + still.tied, local_mass + diags_array(still.joint_mass)
    found: list[SystemMode] = []
    for wanted in LOOKED_AT:
        wanted = min(max(wanted, count), most)
        found = list(_modes(still, stretch, *solve(K.tocsc(), M.tocsc(), wanted, NEAR)))
        stretching = [mode for mode in found if mode.kind == STRETCHING]
        if len(stretching) >= AXIAL_MODES or wanted == most:
            break
    return SystemModes(tuple(found[:count]), tuple(stretching[:AXIAL_MODES]), still)


def _whole(still: StillSystem, part: Any) -> Any:
    """Assemble a matrix of the unknowns from those of the ropes' nodes."""
    from scipy.sparse import block_diag

    local = block_diag([part(line) for line in still.lines], format="csr")
    return (still.follow.T @ local @ still.follow).tocsr()


def _stretch(line: StillLine) -> Any:
    """Return the axial stiffness k·t·tᵀ of each element."""
    t, _ = line.directions
    return _chain(np.einsum("e,ke,ce->ekc", line.stiffness, t, t))


def _turn(line: StillLine) -> Any:
    """Return the geometric stiffness (T/l)·(I - t·tᵀ) of each element, and that of bending."""
    t, length = line.directions
    lateral = line.tension / length
    chain = _chain(lateral[:, None, None] * (np.eye(3) - np.einsum("ke,ce->ekc", t, t)))
    return chain if line.couplings is None else chain + _bent(line)


def _chain(blocks: Floats) -> Any:
    """Return the matrix of blocks (n, 3, 3) that couple neighbouring nodes."""
    from scipy.sparse import bsr_array

    n = len(blocks)
    size = (3 * n + 3, 3 * n + 3)
    own = np.zeros((n + 1, 3, 3))
    own[:n] += blocks
    own[1:] += blocks
    diagonal = bsr_array((own, np.arange(n + 1), np.arange(n + 2)), shape=size)
    above = bsr_array((blocks, np.arange(1, n + 1), np.append(np.arange(n + 1), n)), shape=size)
    return diagonal.tocsr() - above - above.T


def _bent(line: StillLine) -> Any:
    """Return the bending stiffness of second neighbours; the upper end is clamped or hinged."""
    from scipy.sparse import block_diag, diags_array, eye_array, kron

    bent = line.couplings
    assert bent is not None
    n = len(line.tension)
    near, far = bent.near[:n], bent.far[: n - 1]
    between = diags_array([near, near, far, far], offsets=[1, -1, 2, -2], shape=(n + 1, n + 1))
    last = -(near[-1] + far[-1]) * np.eye(3)
    return kron(between, eye_array(3)) + block_diag([*np.moveaxis(bent.own, 1, 0), last])


def _masses(line: StillLine) -> Any:
    from scipy.sparse import bsr_array

    nodes = len(line.mass)
    return bsr_array((line.mass, np.arange(nodes), np.arange(nodes + 1)))


def _modes(
    still: StillSystem, stretch: Any, omega: Floats, vectors: Floats
) -> Iterator[SystemMode]:
    """Return the modes as SystemMode objects."""
    masses = [line.mass for line in still.lines]
    ends = np.cumsum([mass.shape[0] for mass in masses])[:-1]
    for found, vector in zip(omega, vectors.T, strict=True):
        w = found if found > FREE else 0.0
        strain = float(vector @ (stretch @ vector))
        share = min(strain / (w * w), 1.0) if w else 0.0  # M-normal: ω² is all of it
        motions = np.split((still.follow @ vector).reshape(-1, 3), ends)
        energies = [
            np.einsum("nk,nkc,nc->nk", motion, mass, motion)
            for motion, mass in zip(motions, masses, strict=True)
        ]
        kinetic = sum(energy.sum(axis=0) for energy in energies)
        sizes = [np.sqrt((motion * motion).sum(axis=1)) for motion in motions]
        r = int(np.argmax([size.max() for size in sizes]))
        at = int(sizes[r].argmax())
        line = still.lines[r]
        period = 2.0 * pi / w if w else float("inf")
        yield SystemMode(
            frequency_hz=float(w / (2.0 * pi)),
            period_s=float(period),
            kind=(STRETCHING if share > 0.5 else SWINGING) if w else UNHELD,
            stretching_share=share,
            vertical_share=float(kinetic[2] / kinetic.sum()),
            rope=line.name,
            largest_at_m=float(line.s[at]),
            wave_ratio=near_waves(period),
            strouhal_hz=_strouhal(still, r, at),
            shapes=tuple(motion[::-1] / sizes[r][at] for motion in motions),
        )


def _strouhal(still: StillSystem, r: int, at: int) -> float:
    """Return the vortex-shedding frequency at node `at` of rope r [Hz]."""
    line = still.lines[r]
    t = line.directions[0][:, min(at, len(line.tension) - 1)]
    water = water_at(still.scene, line.place[2, at : at + 1])[:, 0]
    across = water - (water @ t) * t
    return float(STROUHAL * np.sqrt(across @ across) / still.scene.ropes[r].thinnest_m)

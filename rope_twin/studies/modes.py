"""Natural frequencies and modes of a scene's rope about its static equilibrium.

Small undamped motion u of the nodes about equilibrium: M·ü + K·u = 0. A rigid body adds six
unknowns (rope_twin.studies.equilibrium). K holds each element's stiffness k·t·tᵀ + (T/l)·(I -
t·tᵀ), axial and geometric (Irvine 1981, Cable Structures, ch. 3), and bending if the scene lists
it; M the mass and added mass of every effect: rope, its added mass in the transverse direction,
payload with its added mass. Both ends have the scene's boundary conditions. Damping and the change
of hydrodynamic loads with the shape are neglected.

The smallest eigenvalues of K·φ = ω²·M·φ are found by shift and invert (Ericsson and Ruhe 1980, as
in ARPACK); where nearly all are wanted, by a dense solution (LAPACK).
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from math import pi
from typing import Any

import numpy as np

from rope_twin.core.state import Floats
from rope_twin.core.still_rope import SYMMETRIC
from rope_twin.errors import InputError
from rope_twin.scene.schema import Scene
from rope_twin.scene.vortex import strouhal_number
from rope_twin.studies.equilibrium import (
    CENTRE,
    AtRest,
    StillLine,
    StillSystem,
    SuspendedMotion,
    bring_system_to_rest,
    bring_to_rest,
    node_diameters,
    speed_across,
    water_at,
    with_body,
)
from rope_twin.vortex.line_model import diameters

WAVE_PERIODS_S = (4.0, 20.0)  # of wind sea and swell
DEFAULT_COUNT = 10
AXIAL_MODES = 3
MAX_DENSE = 600  # unknowns of a mesh whose modes can all be computed
NEAR = 8  # modes looked at around the frequency that an axial mode should have
SAME = 1e-6  # relative: frequencies this close belong to one mode in two directions
STRAIGHT = 1e-6  # of the length: a rope within this of a line has no plane of its own


@dataclass(frozen=True)
class Mode:
    """One natural mode; shares are of its kinetic energy and add up to 1."""

    frequency_hz: float
    period_s: float
    kind: str  # axial, in-plane, out-of-plane or turning: the largest share
    axial_share: float
    in_plane_share: float
    out_of_plane_share: float
    turning_share: float  # of a rigid body's rotation
    largest_at_m: float  # where it moves most, unstretched from the hang-off
    wave_ratio: float  # period over the nearest of WAVE_PERIODS_S, 1 among them
    strouhal_hz: float  # of vortices in the scene's current where it moves most
    shape: Floats  # motion of the nodes, hang-off first, largest 1; (nodes, 3)


@dataclass(frozen=True)
class Modes:
    """The lowest modes of a scene, and its first axial ones."""

    lowest: tuple[Mode, ...]
    axial: tuple[Mode, ...]
    place: Floats  # of the nodes at rest, hang-off first [m], (nodes, 3)
    strouhal: float  # St of the scene's VIV model, else of a rope
    strouhal_max_hz: float  # where the current across the rope is fastest
    of_mesh: int  # number of modes that the mesh has


def _checked_count(count: int | None, unknowns: int, words: str) -> int:
    """Return the number of lowest modes; None: DEFAULT_COUNT, or all of a coarser mesh.

    Raises:
        InputError: the mesh does not have as many.
    """
    max_count = unknowns if unknowns <= MAX_DENSE else unknowns - NEAR
    if count is None:
        return min(DEFAULT_COUNT, max_count)
    if not 1 <= count <= max_count:
        raise InputError("--count", f"{count} of {words}", f"give 1 to {max_count}")
    return count


def find_modes(scene: Scene, count: int | None = None) -> Modes:
    """Return the `count` lowest modes and the first axial ones.

    count: None for DEFAULT_COUNT, or all of a coarser mesh.

    Raises:
        InputError: a count that the rope's free nodes do not give.
        SceneError: the rope cannot rest, or is slack somewhere: it then has no natural frequency.
    """
    rest = bring_to_rest(scene)
    # 3 unknowns per free node, and a body's 6
    free = slice(3 * rest.first, -3)
    K, M = (matrix.tocsr()[free, free] for matrix in (_stretch(rest) + _turn(rest), _masses(rest)))
    if rest.body is not None:
        K, M = with_body(K, rest.body.stiffness, 0), with_body(M, rest.body.mass, 0)
    K, M = K.tocsc(), M.tocsc()
    count = _checked_count(count, K.shape[0], f"a rope with {rest.free_count} free nodes")
    shift = 0.0 if rest.body is None else NEAR_FREE  # nothing holds a body's turn about the rope
    lowest = list(_modes(rest, *solve(K, M, count, shift)))
    axial: list[Mode] = []
    for omega in _axial_guesses(rest):
        above = (1.0 + SAME) * axial[-1].frequency_hz if axial else 0.0
        near_it = _modes(rest, *solve(K, M, NEAR, omega * omega))
        around = [mode for mode in near_it if mode.frequency_hz > above]
        # of a sagging rope several share the stretch about one guess: the lowest comes first
        axial_modes = [mode for mode in around if mode.kind == AXIAL][:1]
        axial += axial_modes or sorted(around, key=lambda mode: -mode.axial_share)[:1]
    position = np.ascontiguousarray(rest.place[:, ::-1].T)
    fastest = float(_shedding_hz(rest).max())
    strouhal = strouhal_number(scene)
    return Modes(tuple(lowest), tuple(axial), position, strouhal, fastest, K.shape[0])


def solve(K: Any, M: Any, count: int, shift: float) -> tuple[Floats, Floats]:
    """Return frequencies ω [rad/s], rising, and M-normal modes with ω² nearest to `shift`.

    The start vector is fixed, so that the same scene gives the same digits.
    """
    from scipy.linalg import eigh
    from scipy.sparse.linalg import eigsh

    if count > K.shape[0] - 2:  # ARPACK needs more unknowns than that
        squares, modes = eigh(K.toarray(), M.toarray())
        nearest = np.sort(np.argsort(np.abs(squares - shift), kind="stable")[:count])
        return np.sqrt(np.maximum(squares[nearest], 0.0)), modes[:, nearest]
    start = np.random.default_rng(1).standard_normal(K.shape[0])
    squares, modes = eigsh(K, k=count, M=M, sigma=shift, which="LM", v0=start)
    order = np.argsort(squares)
    return np.sqrt(np.maximum(squares[order], 0.0)), modes[:, order]


def _axial_guesses(rest: AtRest) -> Floats:
    """Return ω [rad/s] of the first modes of a rope whose nodes move only along it.

    Shifted off by a millionth: on a frequency itself the shifted matrix is singular.
    """
    from scipy.linalg import eigh_tridiagonal

    mass = np.einsum("kn,nkc,cn->n", rest.tangent, rest.free_mass, rest.tangent)
    if rest.body is not None:
        t = rest.tangent[:, 0]
        mass[0] += t @ rest.body.mass[CENTRE, CENTRE] @ t
    k = rest.stiffness
    diagonal = k[rest.first :].copy()
    diagonal[1 - rest.first :] += k[: len(k) - 1]
    diagonal += (rest.held[rest.first : -1] * rest.tangent.T**2).sum(axis=1)
    root = 1.0 / np.sqrt(mass)
    between = -k[rest.first : -1] * root[:-1] * root[1:]
    last = min(AXIAL_MODES, len(mass)) - 1
    squares = eigh_tridiagonal(
        diagonal * root * root, between, eigvals_only=True, select="i", select_range=(0, last)
    )
    return np.asarray(np.sqrt(squares) * (1.0 + 1e-6))


def _modes(rest: AtRest, omega: Floats, vectors: Floats) -> Iterator[Mode]:
    """Return the modes; those of equal frequency are separated by the rope's plane."""
    normal = _normal(rest)
    vectors = _separate(rest, omega, vectors, normal)
    shedding_hz = _shedding_hz(rest)
    for w, vector in zip(omega, vectors.T, strict=True):
        motion, body_motion = (
            vector[: 3 * rest.free_count].reshape(-1, 3).T,
            SuspendedMotion.of(rest.body, vector),
        )
        energy = _energy(rest, motion) + body_motion.energy
        axial_motion = (motion * rest.tangent).sum(axis=0)
        out_of_plane = normal @ motion
        axial = _energy(rest, axial_motion * rest.tangent) + body_motion.along(rest.tangent[:, 0])
        sideways = _energy(rest, out_of_plane * normal[:, None]) + body_motion.along(normal)
        axial, sideways, turning = axial / energy, sideways / energy, body_motion.turning / energy
        in_plane = 1.0 - axial - sideways - turning
        shares = {AXIAL: axial, "in-plane": in_plane, "out-of-plane": sideways, TURNING: turning}
        size = np.sqrt((motion * motion).sum(axis=0))
        largest = int(size.argmax())
        held = w > (0.0 if rest.body is None else FREE)
        period = 2.0 * pi / w if held else float("inf")
        shape = np.zeros((rest.place.shape[1], 3))
        shape[rest.first : -1] = motion.T / max(float(size[largest]), body_motion.largest)
        yield Mode(
            frequency_hz=float(w / (2.0 * pi)) if held else 0.0,
            period_s=float(period),
            kind=max(shares, key=lambda kind: shares[kind]),
            axial_share=float(axial),
            in_plane_share=float(max(in_plane, 0.0)),
            out_of_plane_share=float(sideways),
            turning_share=float(turning),
            largest_at_m=float(rest.s[rest.first + largest]),
            wave_ratio=near_waves(period),
            strouhal_hz=float(shedding_hz[rest.first + largest]),
            shape=shape[::-1].copy(),
        )


def near_waves(period_s: float) -> float:
    """Return the ratio of a period to the nearest of WAVE_PERIODS_S."""
    low, high = WAVE_PERIODS_S
    return float(period_s / min(max(period_s, low), high))


def _energy(rest: AtRest, motion: Floats) -> float:
    """Return twice the kinetic energy of a motion at ω = 1."""
    return float((motion * np.einsum("nkc,cn->kn", rest.free_mass, motion)).sum())


def _normal(rest: AtRest) -> Floats:
    """Return the normal of the rope's mean plane; of a straight rope, across the current or x."""
    offset = rest.place - rest.place[:, -1:]
    axes, sizes, _ = np.linalg.svd(offset, full_matrices=False)
    if sizes[1] > STRAIGHT * sizes[0]:
        return np.asarray(axes[:, 2])
    water = water_at(rest.scene, rest.place[2, rest.first : -1])
    across = np.cross(axes[:, 0], water.sum(axis=1))
    if not across.any():
        across = np.cross(axes[:, 0], [1.0, 0.0, 0.0])
    if not across.any():  # along x
        across = np.cross(axes[:, 0], [0.0, 1.0, 0.0])
    return np.asarray(across / np.linalg.norm(across))


def _separate(rest: AtRest, omega: Floats, vectors: Floats, normal: Floats) -> Floats:
    """Rotate modes of equal frequency into the in-plane and out-of-plane directions."""
    separated = vectors.copy()
    start = 0
    for end in range(1, len(omega) + 1):
        if end < len(omega) and omega[end] - omega[end - 1] <= SAME * omega[end]:
            continue
        group = vectors[:, start:end]
        motion = group.T[:, : 3 * rest.free_count].reshape(end - start, -1, 3)
        out_of_plane = motion @ normal
        mass = np.einsum("k,nkc,c->n", normal, rest.free_mass, normal)
        _, turn = np.linalg.eigh((out_of_plane * mass) @ out_of_plane.T)
        separated[:, start:end] = group @ turn
        start = end
    return separated


def _shedding_hz(rest: AtRest) -> Floats:
    """Return the frequency of vortex shedding at all nodes [Hz], as `viv` does."""
    speed = speed_across(rest.scene, rest.place)
    return np.asarray(strouhal_number(rest.scene) * speed / node_diameters(rest))


NEAR_FREE = -1e-6  # [rad²/s²]: looked for from just below 0, as ropes over a sheave may run freely
LOOKED_AT = (60, 200, 600)  # modes among which the first that stretch are sought
FREE = 1e-4  # rad/s: what is slower is a motion that nothing holds, such as a spin about one rope
STRETCHING, SWINGING, UNHELD = "stretching", "swinging", "free"
AXIAL, TURNING = "axial", "turning"  # kinds of modes, the latter of a rigid body


@dataclass(frozen=True)
class SystemMode:
    """One natural mode of a multi-line system."""

    frequency_hz: float
    period_s: float  # infinite where nothing holds the motion
    kind: str  # stretching or swinging: where the larger part of its strain energy is; or free
    stretching_share: float  # of the strain energy
    vertical_share: float  # of the kinetic energy
    turning_share: float  # of the kinetic energy: a rigid body's rotation
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
    of_mesh: int  # number of modes that the mesh has


def find_system_modes(scene: Scene, count: int | None = None) -> SystemModes:
    """Return the `count` lowest modes and the first that stretch the ropes.

    count: as for `find_modes`.

    Raises:
        InputError: a count that the ropes' free nodes do not give.
        SceneError: the ropes cannot rest, or are slack somewhere.
    """
    still = bring_system_to_rest(scene)
    size = still.follow.shape[1]
    count = _checked_count(count, size, f"ropes with {size} ways to move")
    from scipy.sparse import diags_array

    stretch, turn, local_mass = (_whole(still, part) for part in (_stretch, _turn, _masses))
    K, M = stretch + turn + still.tied, local_mass + diags_array(still.joint_mass)
    if still.body is not None:
        M = M + still.body_mass
    modes: list[SystemMode] = []
    for trial_count in LOOKED_AT:
        trial_count = min(max(trial_count, count), size)
        modes = list(
            _system_modes(still, stretch, *solve(K.tocsc(), M.tocsc(), trial_count, NEAR_FREE))
        )
        stretching = [mode for mode in modes if mode.kind == STRETCHING]
        if len(stretching) >= AXIAL_MODES or trial_count == size:
            break
    return SystemModes(tuple(modes[:count]), tuple(stretching[:AXIAL_MODES]), still, size)


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
    """Return the geometric stiffness (T/l)·(I - t·tᵀ) of each element, that of bending, and that of
    surface and seabed at the nodes.
    """
    from scipy.sparse import diags_array

    t, length = line.directions
    lateral = line.tension / length
    chain = _chain(lateral[:, None, None] * (np.eye(3) - np.einsum("ke,ce->ekc", t, t)))
    if line.held.any():
        chain = chain + diags_array(line.held.ravel()).tocsr()
    return chain if line.couplings is None else chain + _bent(line)


def _chain(blocks: Floats) -> Any:
    """Return the matrix of blocks (n, 3, 3) that couple neighbouring nodes."""
    from scipy.sparse import bsr_array

    n = len(blocks)
    size = (3 * n + 3, 3 * n + 3)
    diagonal_blocks = np.zeros((n + 1, 3, 3))
    diagonal_blocks[:n] += blocks
    diagonal_blocks[1:] += blocks
    diagonal = bsr_array((diagonal_blocks, np.arange(n + 1), np.arange(n + 2)), shape=size)
    above = bsr_array((blocks, np.arange(1, n + 1), np.append(np.arange(n + 1), n)), shape=size)
    return diagonal.tocsr() - above - above.T


def _bent(line: StillLine) -> Any:
    """Return the bending stiffness of second neighbours; the upper end is clamped or hinged."""
    from scipy.sparse import block_diag, diags_array, eye_array, kron

    couplings = line.couplings
    assert couplings is not None
    n = len(line.tension)
    to_next, to_second = couplings.near[:n], couplings.far[: n - 1]
    between = diags_array(
        [to_next, to_next, to_second, to_second], offsets=[1, -1, 2, -2], shape=(n + 1, n + 1)
    )
    last = -(to_next[-1] + to_second[-1]) * np.eye(3)
    return kron(between, eye_array(3)) + block_diag(
        [*np.moveaxis(couplings.own[SYMMETRIC], 2, 0), last]
    )


def _masses(line: StillLine) -> Any:
    from scipy.sparse import bsr_array

    nodes = len(line.mass)
    return bsr_array((line.mass, np.arange(nodes), np.arange(nodes + 1)))


def _system_modes(
    still: StillSystem, stretch: Any, omega: Floats, vectors: Floats
) -> Iterator[SystemMode]:
    """Return the modes as SystemMode objects."""
    masses = [line.mass for line in still.lines]
    ends = np.cumsum([mass.shape[0] for mass in masses])[:-1]
    for omega_k, vector in zip(omega, vectors.T, strict=True):
        w = omega_k if omega_k > FREE else 0.0
        strain = float(vector @ (stretch @ vector))
        share = min(strain / (w * w), 1.0) if w else 0.0  # M-normal: ω² is all of it
        motions = np.split((still.follow @ vector).reshape(-1, 3), ends)
        energies = [
            np.einsum("nk,nkc,nc->nk", motion, mass, motion)
            for motion, mass in zip(motions, masses, strict=True)
        ]
        body_motion = SuspendedMotion.of(still.body, vector)
        kinetic = sum(energy.sum(axis=0) for energy in energies)
        kinetic = kinetic + body_motion.centre * (body_motion.mass @ body_motion.centre)
        turning = body_motion.turning / (float(kinetic.sum()) + body_motion.turning)
        sizes = [np.sqrt((motion * motion).sum(axis=1)) for motion in motions]
        r = int(np.argmax([size.max() for size in sizes]))
        node = int(sizes[r].argmax())
        line = still.lines[r]
        period = 2.0 * pi / w if w else float("inf")
        kind = TURNING if turning > 0.5 else STRETCHING if share > 0.5 else SWINGING
        largest = max(float(sizes[r][node]), body_motion.largest)
        yield SystemMode(
            frequency_hz=float(w / (2.0 * pi)),
            period_s=float(period),
            kind=kind if w else UNHELD,
            stretching_share=share,
            vertical_share=float(kinetic[2] / (kinetic.sum() + body_motion.turning)),
            turning_share=float(turning),
            rope=line.name,
            largest_at_m=float(line.s[node]),
            wave_ratio=near_waves(period),
            strouhal_hz=_strouhal(still, r, node),
            shapes=tuple(motion[::-1] / largest for motion in motions),
        )


def _strouhal(still: StillSystem, r: int, node: int) -> float:
    """Return the vortex-shedding frequency at a node of rope r [Hz]."""
    line = still.lines[r]
    t = line.directions[0][:, min(node, len(line.tension) - 1)]
    water = water_at(still.scene, line.place[2, node : node + 1])[:, 0]
    across = water - (water @ t) * t
    speed = float(np.sqrt(across @ across))
    return strouhal_number(still.scene) * speed / float(diameters(still.system.ropes[r])[node])

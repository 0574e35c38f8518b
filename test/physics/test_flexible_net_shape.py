"""A flexible net between two taut lines in a current, against a loaded membrane."""

from __future__ import annotations

import math
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.optimize import brentq, fsolve

from rope_twin import Snapshot, Twin, load_scene
from rope_twin.core.loads.panel import meshed_solidity, panel_coefficients, panel_forces
from rope_twin.scene.net_grid import ELEMENTS
from rope_twin.twin.monitors import ENERGY

Vector = NDArray[np.float64]
APART, WIDTH, HEIGHT = 6.0, 6.0, 6.0  # m; the net is as wide as the lines are apart
COLUMNS, ROWS = 4, 2
CHORDS = COLUMNS * ELEMENTS
SPEED, DENSITY = 0.5, 1025.0
TWINE_N, BAR = 4e3, 0.03
STIFFNESS = TWINE_N / BAR  # N per metre of height
SOLIDITY = meshed_solidity(0.003, BAR)
POST = "rope: steel_wire_76mm, damping: {newton_seconds: 2.0e+5}, length_m: 11.98, elements: 12"
TEXT = """about: a net between two taut lines
source: made up for a test
look_at: nothing
ropes:
  - {{name: left, {post}, fixed_at_m: [0.0, 0.0, -17.0]}}
  - {{name: right, {post}, from: top_right, fixed_at_m: [0.0, {apart}, -17.0]}}
nets:
  - {{name: wall, between: [left, right], from_m: 2.0, to_m: 8.0, width_m: {width},
     columns: {columns}, rows: {rows}, twine_m: 0.003, bar_m: {bar}, twine_kg_per_m3: 1025.0,
     twine_stiffness_n: {stiff}, twine_breaking_load_n: 400.0, damping: {{newton_seconds: 2.0e+3}}}}
hang_offs: [{{name: top_right, at_m: [0.0, {apart}, -5.0]}}]
ship: {{hang_off_m: [0.0, 0.0, -5.0], motion_ramp_s: 0.0}}
effects:
  - current: {{profile: [[0.0, [{speed}, 0.0]]]}}
  - weight: {{}}
  - drag: {{normal: 0.0, tangential: 0.0}}
  - added_mass: {{normal: 1.0}}
  - payload: {{}}
time: {{step_s: 0.01}}
"""


def twin_of(folder: Path, *, energy: bool = False) -> Twin:
    path = folder / "scene.yaml"
    path.write_text(
        TEXT.format(
            post=POST, apart=APART, width=WIDTH, columns=COLUMNS, rows=ROWS, bar=BAR,
            stiff=TWINE_N, speed=SPEED,
        ),
        encoding="utf-8",
    )  # fmt: skip
    scene = load_scene(str(path))
    return Twin(scene, ENERGY) if energy else Twin(scene)


def height_of(row: int) -> float:
    """Height of net that a level stands for [m]."""
    return HEIGHT / ROWS * (1.0 if 0 < row < ROWS else 0.5)


def level(snapshot: Snapshot, row: int) -> tuple[Vector, Vector]:
    """Nodes of a level in plan, (CHORDS + 1, 2), and its tension per metre of height [N/m]."""
    named = {rope.name: rope for rope in snapshot.ropes}
    borders = [named[f"wall_level_{row}_{k}"] for k in range(COLUMNS)]
    positions = [borders[0].node_position_m[:1], *(one.node_position_m[1:] for one in borders)]
    tension = np.concatenate([one.element_tension_n for one in borders]) / height_of(row)
    return np.concatenate(positions)[:, :2], tension


class Panel(NamedTuple):
    """Coefficients of a panel of 1 m², as `panel_forces` takes them."""

    along: float
    facing: float
    lift: float


def pressure(along: float, across: float) -> Vector:
    """Return the force per area on a panel from its chord along and across the flow [N/m²]."""
    constant, facing, lift = (0.5 * DENSITY * c for c in panel_coefficients("loeland", SOLIDITY))
    n = np.array([[across], [-along], [0.0]]) / math.hypot(along, across)
    flow = np.array([[SPEED], [0.0], [0.0]])
    return panel_forces(Panel(constant, facing, 2.0 * lift), flow, n)[:2, 0]


def membrane(ends: tuple[Vector, Vector]) -> Vector:
    """Solve the balance of a polygon of panels by scipy: inner corners, (CHORDS - 1, 2) [m]."""
    rest = WIDTH / CHORDS

    def off(flat: Vector) -> Vector:
        x = np.vstack([ends[0], flat.reshape(-1, 2), ends[1]])
        chord = np.diff(x, axis=0)
        length = np.hypot(*chord.T)
        pull = (STIFFNESS * (length / rest - 1.0) / length)[:, None] * chord
        load = np.array([pressure(a, b) for a, b in chord]) * 0.5 * rest
        return np.asarray((pull[1:] - pull[:-1] + load[1:] + load[:-1]).ravel())

    share = np.linspace(0.0, 1.0, CHORDS + 1)[1:-1, None]
    guess = ends[0] + share * (ends[1] - ends[0]) + np.array([1.0, 0.0]) * share * (1.0 - share)
    return np.asarray(fsolve(off, guess.ravel(), xtol=1e-12).reshape(-1, 2))


@pytest.fixture(scope="module")
def snapshot(tmp_path_factory: pytest.TempPathFactory) -> Snapshot:
    return twin_of(tmp_path_factory.mktemp("net")).snapshot()


@pytest.mark.parametrize("row", range(ROWS + 1))
def test_each_net_level_has_the_shape_of_a_loaded_polygon(snapshot: Snapshot, row: int) -> None:
    """Every panel has its own angle to the flow; the ends are those of the lines."""
    positions, tension = level(snapshot, row)
    expected = membrane((positions[0], positions[-1]))
    assert positions[1:-1] == pytest.approx(expected, abs=2e-4)
    assert np.ptp(positions[:, 0]) > 0.25
    chord = np.hypot(*np.diff(expected, axis=0).T)
    inner = STIFFNESS * (chord / (WIDTH / CHORDS) - 1.0)
    assert tension[1:-1] == pytest.approx(inner, rel=2e-3)


def test_the_middle_level_sags_like_a_parabola(snapshot: Snapshot) -> None:
    """H = p·w²/(8·f) and length w·(1 + 8·f²/(3·w²)), Irvine 1981."""
    positions, tension = level(snapshot, 1)
    w, p = float(positions[-1, 1] - positions[0, 1]), float(pressure(0.0, 1.0)[0])

    def off(f: float) -> float:
        strain = w * (1.0 + 8.0 * f**2 / (3.0 * w**2)) / WIDTH - 1.0
        return p * w**2 / (8.0 * f) - STIFFNESS * strain

    f = float(brentq(off, 0.01, 2.0))
    sag = float(positions[CHORDS // 2, 0] - 0.5 * (positions[0, 0] + positions[-1, 0]))
    assert sag == pytest.approx(f, rel=0.03)  # panels near the lines stand at 10° to the flow
    assert tension.mean() == pytest.approx(p * w**2 / (8.0 * f), rel=0.03)


def test_the_lines_carry_the_net_drag(snapshot: Snapshot) -> None:
    """End forces of all levels sum to the net's drag, less the lines' own shares."""
    pulled = pushed = 0.0
    for row in range(ROWS + 1):
        positions, tension = level(snapshot, row)
        chord = np.diff(positions, axis=0)
        way = chord / np.hypot(*chord.T)[:, None]
        pulled += height_of(row) * (tension[0] * way[0, 0] - tension[-1] * way[-1, 0])
        load = np.array([pressure(a, b)[0] for a, b in chord])
        pushed += height_of(row) * WIDTH / CHORDS * float((load.sum() + load[1:-1].sum()) / 2.0)
    assert pulled == pytest.approx(pushed, rel=0.005)


def test_energy_balance_of_a_flexible_net_in_heave(tmp_path: Path) -> None:
    twin = twin_of(tmp_path, energy=True)
    for k in range(80):
        t = 0.05 * k
        assert not twin.submit_heave(
            round(t * 1e9), 0.02 * (1.0 - math.cos(2.0 * t)), 0.04 * math.sin(2.0 * t)
        )
    twin.advance(300)
    energy = twin.snapshot().energy
    assert energy is not None
    assert abs(energy.residual_j) < 1e-3 * energy.exchanged_j

"""Force-decomposition VIV model: force table, pre-analysis and integrators, in closed form."""

from __future__ import annotations

from dataclasses import replace
from math import pi
from pathlib import Path

import numpy as np
import pytest

from rope_twin.errors import InputError
from rope_twin.vortex.decomposed_response import (
    DecomposedResponse,
    Integrator,
    Matrices,
    Motion,
    bathe,
    upper_bands,
)
from rope_twin.vortex.force_table import fitted_forces, read_force_table
from rope_twin.vortex.line_model import Span
from rope_twin.vortex.modes import stiffness
from rope_twin.vortex.power_in import Decomposed, ExcitationSearch, decomposed, displaced
from validation.decomposed_riser import newmark
from validation.steady_riser import forces_at

L, D, T, M, EI = 90.0, 0.03, 3700.0, 2.268, 3640.0


def riser(speed: float = 0.4, n: int = 90) -> Span:
    s, same = np.linspace(0.0, L, n + 1), np.ones(n + 1)
    return Span(s, T * same[1:], M * same[1:], D * same, speed * same, EI)


def test_table_has_the_published_features() -> None:
    """Positive only in the band, 0.7 at most, nothing at 0.9 D; C_a from -0.5 to 1."""
    table = fitted_forces()
    at = np.full(3, 0.5)
    lift, added_mass = forces_at(table, at, np.array([0.17, 0.1, 0.6]))
    assert lift[0] == pytest.approx(0.7)
    assert table.lift.max() <= 0.7 + 1e-9
    outside = (table.frequency < 0.125 - 1e-9) | (table.frequency > 0.2 + 1e-9)
    assert (table.lift[outside] <= 0.0).all()
    assert (table.lift[:, table.amplitude > 0.9 + 1e-9] <= 1e-9).all()
    assert added_mass[1] == pytest.approx(-0.5, abs=0.02)
    assert added_mass[2] == pytest.approx(1.0, abs=0.01)
    # bilinear: halfway between rows the mean of four; beyond the ends the end
    i, j = 7, 3
    amplitude = np.array([table.amplitude[j : j + 2].mean(), 9.0])
    frequency = np.array([table.frequency[i : i + 2].mean(), 9.0])
    (middle, end), _ = forces_at(table, amplitude, frequency)
    assert middle == pytest.approx(table.lift[i : i + 2, j : j + 2].mean())
    assert end == table.lift[-1, -1]


def test_broken_tables_are_refused(tmp_path: Path) -> None:
    path = tmp_path / "forces.csv"
    for text in ("", "frequency,amplitude,C_Lv,C_a\n0.1,0,x,1\n", "a,b\n1,2\n"):
        path.write_text(text)
        with pytest.raises(InputError, match=str(path)):
            read_force_table(path)
    path.write_text("frequency,amplitude,C_Lv,C_a\n0.1,0,1,1\n0.1,1,1,1\n0.2,0,1,1\n0.2,2,1,1\n")
    with pytest.raises(InputError, match="4 rows of 2 frequency and 3 amplitude"):
        read_force_table(path)


def test_true_frequency() -> None:
    """f = f_dry·√(m*/(m* + C_a)) of a uniform riser, with the C_a that the table has there."""
    actual = ExcitationSearch(riser(), decomposed()).found()
    ratio = M / (1025.0 * 0.25 * pi * D**2)
    n = np.arange(1, len(actual.frequency) + 1)
    dry = 0.5 * n / L * np.sqrt((T + EI * (n * pi / L) ** 2) / M)
    np.testing.assert_allclose(
        actual.frequency, dry * np.sqrt(ratio / (ratio + actual.added_mass)), rtol=0.02
    )
    reduced = actual.frequency * D / 0.4
    _, expected = forces_at(fitted_forces(), np.full_like(reduced, 0.5), reduced)
    np.testing.assert_allclose(actual.added_mass, expected, atol=1e-4)


def test_power_of_a_uniform_current() -> None:
    """Π = |Q|²/(2R): Q = ½·C_Lv·ρ·D·U²·2L/π in the band, R = 2·m·ω·ζ·L/2."""
    fixed = decomposed(varying=False)
    analysis = ExcitationSearch(riser(n=360), fixed).found()
    for mode in np.flatnonzero(analysis.power):
        f, phi = analysis.frequency[mode], analysis.modes.shape[:, mode]
        (lift,), _ = forces_at(fixed.table, np.array([0.5]), np.array([f * D / 0.4]))
        Q = 0.5 * lift * 1025.0 * D * 0.16 * L * np.abs(phi).mean()
        R = 2.0 * fixed.structural * 2.0 * pi * f * analysis.modes.mass[mode]
        assert analysis.power[mode] == pytest.approx(0.5 * Q * Q / R, rel=0.01)
    assert analysis.dominant == 11
    assert (analysis.zones.sum(axis=1) <= 1).all()


def test_still_water_excites_no_mode() -> None:
    analysis = ExcitationSearch(riser(speed=0.0), decomposed()).found()
    assert analysis.dominant == 0
    assert not analysis.driven.any()


@pytest.mark.parametrize(
    ("integrator", "radii"),
    [
        (newmark(0.25, 0.5), (1.0, 1.0, 1.0, 1.0)),
        (newmark(), (0.991136, 0.935634, 0.919951, 0.912948)),
        (bathe, (0.999494, 0.894680, 0.648466, 0.079384)),
    ],
    ids=["trapezoidal", "newmark", "bathe"],
)
def test_spectral_radii_of_the_integrators(
    integrator: Integrator, radii: tuple[float, ...]
) -> None:
    """[SJTU] figure 3-2 at h/T 0.1, 0.5, 1 and 10: each step's matrix, column by column."""
    omega = 2.0 * pi
    parts = Matrices(np.ones(1), np.zeros(1), np.array([[0.0], [0.0], [omega**2]]))
    none = np.zeros(1)
    for h, radius in zip((0.1, 0.5, 1.0, 10.0), radii, strict=True):
        columns = []
        for unit in np.eye(3):
            after = integrator(Motion(*unit[:, None]), parts, none, none, h)
            columns.append(np.concatenate(after))
        largest = np.abs(np.linalg.eigvals(np.array(columns).T)).max()
        assert largest == pytest.approx(radius, abs=2e-6)


@pytest.mark.parametrize("integrator", [newmark(0.25, 0.5), bathe], ids=["trapezoidal", "bathe"])
def test_the_integrators_are_of_second_order(integrator: Integrator) -> None:
    """A damped, forced mass against its closed form: the error falls fourfold."""
    omega, damping, force = 2.0, 0.3, 1.5
    parts = Matrices(np.ones(1), np.array([damping]), np.array([[0.0], [0.0], [omega**2]]))
    errors = []
    for steps in (100, 200):
        h = 5.0 / steps
        at = Motion(np.zeros(1), np.zeros(1), np.array([force]))
        for _ in range(steps):
            at = integrator(at, parts, np.array([force]), np.array([force]), h)
        ring = np.sqrt(omega**2 - 0.25 * damping**2)
        decay = np.exp(-0.5 * damping * 5.0)
        exact = (force / omega**2) * (
            1.0 - decay * (np.cos(5.0 * ring) + 0.5 * damping / ring * np.sin(5.0 * ring))
        )
        errors.append(abs(at.place[0] - exact))
    assert np.log2(errors[0] / errors[1]) == pytest.approx(2.0, abs=0.1)


def test_banded_matrix_equals_the_full_one() -> None:
    matrix = stiffness(riser(n=12)).tocsr()[1:-1, 1:-1]
    bands = upper_bands(matrix, 3)
    for k in range(3):
        np.testing.assert_array_equal(bands[2 - k, k:], matrix.toarray().diagonal(k))


def test_response_is_the_dominant_mode_in_uniform_current() -> None:
    """Uniform current: it moves in the dominant mode at its frequency, below the lift's zero."""
    span = riser(n=60)
    response = DecomposedResponse(span, decomposed(varying=False))
    count = int(20.0 / response.step_s)
    motion = np.zeros((count, len(span.s)))
    for row in range(count):
        response.advance(response.step_s)
        motion[row] = response.motion / D
    late = motion[count // 2 :]
    spectrum = np.abs(np.fft.rfft(late, axis=0)).sum(axis=1)
    peak = np.fft.rfftfreq(len(late), response.step_s)[spectrum.argmax()]
    computed = response.excitation
    mode = computed.dominant - 1
    assert peak == pytest.approx(computed.frequency[mode], rel=0.05)
    assert 0.3 < late.std(axis=0).max() < 1.0
    inside = np.abs(computed.modes.shape[1:-1, mode]) > 0.5
    np.testing.assert_allclose(
        response.omega[inside] / (2.0 * pi), computed.frequency[mode], rtol=0.1
    )


def test_fixed_added_mass_is_that_of_the_modes() -> None:
    """With C_a fixed the true frequency is the mode's own, and the water moved is C_a times it."""
    model: Decomposed = replace(decomposed(varying=False), fixed_added_mass=2.0)
    analysis = ExcitationSearch(riser(n=90), model).found()
    np.testing.assert_array_equal(analysis.frequency, analysis.modes.frequency)
    wet = riser().node_mass + 2.0 * displaced(riser(), 1025.0)
    np.testing.assert_allclose(analysis.modes.mass, wet @ analysis.modes.shape**2, rtol=1e-6)

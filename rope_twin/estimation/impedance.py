"""Top impedance of a hanging rope: amplitude of the top tension per amplitude of heave.

The rope is a chain of uniform viscoelastic bars with a mass at the lower end. With E* = EA + iωC,
μ* = μ - i·d/ω and k = ω·√(μ*/E*), displacement u and tension T run up a bar of length l as

    u(l) = u(0)·cos kl + T(0)/(E*·k)·sin kl,   T(l) = T(0)·cos kl - E*·k·u(0)·sin kl,

from T(0) = -(ω²M - iωd_0)·u(0) at the mass. Quadratic drag β·|v|·v is linearised for a Gaussian
sea about the speed U of the line: d = 2β·E|v + U| = β·[√(8/π)·σ_v·exp(-U²/2σ_v²) +
2U·erf(U/√2σ_v)], which for U = 0 is Borgman's √(8/π)·β·σ_v (1969), with σ_v of the response itself,
found by iteration.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.special import erf

from rope_twin.core import state as rows
from rope_twin.core.state import Floats
from rope_twin.effects.payload import Payload, TwoWayPayload
from rope_twin.effects.rope_mass import AddedMassParams
from rope_twin.scene.rope_model import build
from rope_twin.scene.schema import Scene

Complexes = NDArray[np.complex128]
PIECES = 8  # of the rope, each with its own linearised drag
BORGMAN = np.sqrt(8.0 / np.pi)
LEAST_SIGMA = 1e-9  # m/s
STANDING: Floats = np.zeros(1)  # speeds of a line that does not move
TOLERANCE, MOST_ITERATIONS = 1e-4, 40


@dataclass(frozen=True)
class Bar:
    """Bars from the lower end up and the mass below them."""

    length_m: Floats  # (bars,)
    EA_n: Floats
    damping_newton_seconds: Floats  # C of T = EA·strain + C·strain rate
    mass_kg_per_m: Floats  # with added mass along the rope
    drag_kg_per_m2: Floats  # β of the force per metre β·|v|·v along the rope
    end_mass_kg: float  # with added mass
    end_drag_kg_per_m: float  # β of the force on the lower end

    def with_factors(self, factors: dict[str, float]) -> Bar:
        """Return the bars with the rope's figures multiplied, by the names of ROPE_FIGURES."""
        return replace(
            self,
            EA_n=self.EA_n * factors["axial_stiffness"],
            damping_newton_seconds=self.damping_newton_seconds * factors["axial_damping"],
            drag_kg_per_m2=self.drag_kg_per_m2 * factors["tangential_drag"],
            end_mass_kg=self.end_mass_kg * factors["oscillating_mass"],
            end_drag_kg_per_m=self.end_drag_kg_per_m * factors["payload_drag"],
        )

    def at_length(self, line_out_m: float) -> Bar:
        """Return the bars with the uppermost ones lengthened or shortened to a line out [m]."""
        top = np.concatenate([[0.0], np.cumsum(self.length_m)])
        top[-1] = max(line_out_m, top[-1])
        lengths = np.maximum(np.minimum(top[1:], line_out_m) - top[:-1], 0.0)
        return replace(self, length_m=lengths)


def bar_of(scene: Scene) -> Bar:
    """Return the bars of a scene's rope at its length, with the mass at the lower end.

    Raises:
        SceneError: the scene cannot be built, or has ropes that meet.
    """
    rope = build(scene)
    ends = [0.0, *rope.sections[rows.END][:-1], float(scene.ropes[0].length_m)]
    lengths = np.array([high - low for low, high in pairwise(ends)])
    mass, volume, _, skin, _ = rope.sections[rows.PER_METRE :]
    density = scene.environment.water_density_kg_per_m3
    along = sum(own.tangential for own in scene.effects if isinstance(own, AddedMassParams))
    body = next((e for e in rope.effects if isinstance(e, Payload | TwoWayPayload)), None)
    return Bar(
        lengths,
        rope.sections[rows.EA].copy(),
        rope.sections[rows.C].copy(),
        mass + along * density * volume,
        _tangential(rope.effects) * skin,
        body.Mz if body else 0.0,
        body.kz if body else 0.0,
    )


def _tangential(effects: tuple[Any, ...]) -> float:
    """Return ½·ρ·C_dt [kg/m³] of the drag among a rope's effects; 0: it has none."""
    for effect in effects:
        own = getattr(effect, "drag", effect)
        if hasattr(own, "kt"):
            return float(own.kt)
    return 0.0


def linear_drag(sigma: Floats, speeds: Floats) -> Floats:
    """Return d/β = 2·E|v + U| [m/s], (k,), as the mean over the line's speeds U, (n,) [m/s].

    sigma: standard deviation of v, (k,) [m/s].
    """
    sigma = np.maximum(sigma, LEAST_SIGMA)[:, None]
    ratio = np.abs(speeds) / (np.sqrt(2.0) * sigma)
    mean = BORGMAN * sigma * np.exp(-(ratio**2)) + 2.0 * np.abs(speeds) * erf(ratio)
    return np.asarray(mean.mean(axis=1))


def top_impedance(
    bar: Bar, frequency_hz: Floats, heave_psd: Floats | None = None, speeds: Floats = STANDING
) -> Complexes:
    """Return top tension per heave [N/m], (frequencies,) complex, for exp(+iωt).

    frequency_hz: positive and evenly spaced. heave_psd: one-sided spectrum of the heave [m²/Hz] at
    these frequencies, for which drag is linearised; None: without drag. speeds: of the line, evenly
    in time, (n,) [m/s].
    """
    w = 2.0 * np.pi * frequency_hz
    cut = np.repeat(bar.length_m / PIECES, PIECES)
    EA, C, mu, beta = (
        np.repeat(one, PIECES)
        for one in (bar.EA_n, bar.damping_newton_seconds, bar.mass_kg_per_m, bar.drag_kg_per_m2)
    )
    d_end, d = 0.0, np.zeros(len(cut))
    if heave_psd is None:
        return _response(bar.end_mass_kg, w, cut, EA, C, mu, d_end, d)[0]
    df = float(frequency_hz[1] - frequency_hz[0])
    for _ in range(MOST_ITERATIONS):
        impedance, motion = _response(bar.end_mass_kg, w, cut, EA, C, mu, d_end, d)
        sigma = np.sqrt((np.abs(motion) ** 2 * w**2 * heave_psd).sum(axis=1) * df)
        per_beta = linear_drag(np.append(0.5 * (sigma[1:] + sigma[:-1]), sigma[0]), speeds)
        new_end, new = bar.end_drag_kg_per_m * per_beta[-1], beta * per_beta[:-1]
        done = abs(new_end - d_end) <= TOLERANCE * new_end and np.all(
            np.abs(new - d) <= TOLERANCE * new
        )
        d_end, d = new_end, new
        if done:
            break
    return impedance


def _response(
    end_mass: float, w: Floats, length: Floats, EA: Floats, C: Floats, mu: Floats, d_end: float,
    d: Floats,
) -> tuple[Complexes, Complexes]:  # fmt: skip
    """Return impedance (frequencies,), and motion of each border per heave (pieces + 1, ...)."""
    u: Complexes = np.ones(len(w), complex)
    T: Complexes = -(w**2 * end_mass - 1j * w * d_end) * u
    motion = [u]
    for k in range(len(length)):
        stiff = EA[k] + 1j * w * C[k]
        wave = w * np.sqrt((mu[k] - 1j * d[k] / w) / stiff)
        c, s = np.cos(wave * length[k]), np.sin(wave * length[k])
        u, T = u * c + T * s / (stiff * wave), T * c - stiff * wave * u * s
        motion.append(u)
    return np.asarray(T / u, complex), np.asarray(motion, complex) / u

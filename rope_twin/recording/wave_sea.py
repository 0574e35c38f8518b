"""The heave of a ship on the waves that rope and payload feel: same components, same phases."""

from __future__ import annotations

import numpy as np

from rope_twin.effects.waves import WavesParams, components_of
from rope_twin.recording.heave_replay import HeaveSample, stamps_between
from rope_twin.recording.ship_sea import ShipOnWaves, wave_at
from rope_twin.scene.schema import Scene
from rope_twin.sea.components import Waves
from rope_twin.sea.heave_response import BoxHull, heave_response
from rope_twin.sea.responses import read_responses
from rope_twin.sea.spectrum import Vector


class WaveSea:
    """Samples of heave and of the surface at the hang-off by simulation time.

    A component a·cos(k·x - ω·t + φ) is the real part of a·exp(i(ω·t - k·x - φ)); the ship motion is
    its RAO times that. The sea itself builds up from flat with the ship's ramp.
    """

    note = ""

    def __init__(self, waves: Waves, hull: BoxHull, x: float, y: float) -> None:
        self.source = f"waves of Hs {waves.significant_height_m:.3g} m; {hull.describe()}"
        self._wave = wave_at(waves, x, y)
        self._heave = self._wave * heave_response(hull, waves.omega / (2.0 * np.pi))
        self._omega = waves.omega

    def at(self, time_s: Vector) -> tuple[Vector, Vector, Vector]:
        """Return position [m], velocity [m/s] and surface [m] at times (n,), exactly."""
        turn = np.exp(1j * np.outer(time_s, self._omega))
        moved = turn @ np.stack([self._heave, 1j * self._omega * self._heave, self._wave], axis=1)
        position, velocity, surface = moved.real.T
        return position, velocity, surface

    def between(self, from_ns: int, to_ns: int) -> list[HeaveSample]:
        """Return samples with from_ns <= stamp_ns < to_ns, in order.

        Each is computed by itself, so that it is bit-identical in whatever interval: the order of
        summation in a matrix product depends on the number of rows.
        """
        stamps = stamps_between(from_ns, to_ns).tolist()
        samples = []
        for stamp in stamps:
            (position,), (velocity,), (surface,) = self.at(np.array([stamp * 1e-9]))
            samples.append(HeaveSample(stamp, float(position), float(velocity), float(surface)))
        return samples

    def is_over(self, from_ns: int) -> bool:
        """Return False: the wave components have no end."""
        return False


def sea_of_waves(scene: Scene) -> WaveSea | ShipOnWaves | None:
    """Return the ship's motion on the scene's waves, or None if the scene has no such motion.

    Raises:
        InputError: its table of responses is wrong.
    """
    riding = scene.sea_state.on_waves
    if riding is None:
        return None
    params = scene.listed(WavesParams)
    assert params is not None, "checked when the scene was read"
    waves = components_of(params, scene.environment.gravity_m_per_s2)
    if riding.responses:
        return ShipOnWaves(waves, read_responses(riding.responses), scene)
    x, y, _ = scene.ship.hang_off_m
    return WaveSea(waves, riding.hull, x, y)

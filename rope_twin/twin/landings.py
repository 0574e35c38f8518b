"""Landings of the payloads on the seabed, each at its own speed."""

from __future__ import annotations

from rope_twin.twin.snapshot import Snapshot, Vector


def payload_motions(snapshot: Snapshot, count: int) -> list[tuple[Vector, Vector]]:
    """Return position [m] and velocity [m/s] of each payload, (3,) each."""
    if snapshot.payloads:
        return [(payload.position_m, payload.velocity_m_per_s) for payload in snapshot.payloads]
    return [(snapshot.payload_position_m, snapshot.payload_velocity_m_per_s)][:count]


class LandingWatch:
    """Finds landings, snapshot by snapshot; a payload that starts on the bed does not land."""

    def __init__(self) -> None:
        # numbers, since the fields of an object must be in a saved state from the start
        self._landed: list[bool] = []
        self._sinking: list[float] = []  # [m/s]

    def take(self, snapshot: Snapshot) -> list[tuple[int, float]]:
        """Return number and sinking speed [m/s] of each payload that the bed carries from now on.

        The speed is that before contact, the larger of this snapshot's and the last one's.
        """
        assert snapshot.seabed is not None, "landings are asked for where there is a seabed"
        motions = payload_motions(snapshot, 1)
        landed = [reaction_n > 0.0 for _, reaction_n in snapshot.seabed.payloads]
        sinking = [max(-float(velocity[2]), 0.0) for _, velocity in motions]
        landings = [
            (number, max(sinking[number], self._sinking[number]))
            for number, was_landed in enumerate(self._landed)
            if landed[number] and not was_landed
        ]
        self._landed, self._sinking = landed, sinking
        return landings

"""What moves the ship in a run, chosen in one place for every runner.

With the winch schedule (`rope_twin.twin.schedule`) this is all that a run feeds to its twin, with
the same stamps whether it is paced over ROS or not.
"""

from __future__ import annotations

from typing import Protocol

from rope_twin.errors import InputError, phrase
from rope_twin.recording.heave_replay import HeaveSample, open_heave
from rope_twin.recording.regular_heave import RegularSea
from rope_twin.recording.wave_sea import sea_of_waves
from rope_twin.scene.schema import Scene

FIRST_NS = -100_000_000  # samples begin this early, so that t = 0 lies between two of them
LEAD_NS = 200_000_000  # samples are given this long before they are needed


class Sea(Protocol):
    """Where heave comes from, in twin time."""

    source: str  # what it is, in words
    note: str  # what was wrong with it and what is done about it; empty: nothing

    def between(self, from_ns: int, to_ns: int) -> list[HeaveSample]:
        """Samples with from_ns <= stamp_ns < to_ns, in order; each stamp once."""

    def is_over(self, from_ns: int) -> bool:
        """Whether there is no sample from a time on."""


def open_sea(
    scene: Scene, bag: str = "", topic: str = "", start_s: float = 0.0, loop: bool = True
) -> Sea | None:
    """The heave to replay: of `bag`, or of the scene's own sea; None if the scene has none.

    `start_s` counts from the scene's own start if it is the scene's sea. A regular heave has no
    end, whatever `loop` says.

    Raises:
        BagError: one sentence on what is wrong with the bag.
        InputError: a topic is named but there is no bag to look for it in.
    """
    if bag:
        return open_heave(bag, topic or None, start_s, loop)
    sea = scene.sea_state
    if sea.bag:
        return open_heave(sea.bag, topic or None, sea.start_s + start_s, loop and sea.loop)
    if topic:
        what = f"scene {scene.name} has no bag to look for it in"
        raise InputError(phrase(f"topic '{topic}'", what, "name a bag too, or leave the topic out"))
    if sea.heave is not None:
        return RegularSea(sea.heave, sea.start_s + start_s)
    return sea_of_waves(scene)

"""What moves the ship in a run, chosen in one place for every runner.

With the winch schedule (`rope_twin.twin.schedule`) this is all that a run feeds to its twin, with
the same stamps whether it is paced over ROS or not.
"""

from __future__ import annotations

from rope_twin.recording.heave_replay import HeaveReplay, open_heave
from rope_twin.scene.schema import Scene

FIRST_NS = -100_000_000  # samples begin this early, so that t = 0 lies between two of them
LEAD_NS = 200_000_000  # samples are given this long before they are needed


def open_sea(
    scene: Scene, bag: str = "", topic: str = "", start_s: float = 0.0, loop: bool = True
) -> HeaveReplay | None:
    """The heave to replay: of `bag`, or of the scene's own sea; None if the scene has none.

    `start_s` counts from the scene's own start if it is the scene's bag.

    Raises:
        BagError: one sentence on what is wrong with the bag.
    """
    if bag:
        return open_heave(bag, topic or None, start_s, loop)
    sea = scene.sea_state
    if not sea.bag:
        return None
    return open_heave(sea.bag, topic or None, sea.start_s + start_s, loop and sea.loop)

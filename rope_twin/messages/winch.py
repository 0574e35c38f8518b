"""Encoders of the topics of winch control modes and component states."""

from __future__ import annotations

from rope_twin.messages import forms
from rope_twin.messages.cdr import Templates, new, serialise
from rope_twin.twin.hoisting.orders import MOTIONS
from rope_twin.twin.snapshot import Snapshot, WinchShot


class WinchForms:
    """Holds the template of the parts; one per encoder."""

    def __init__(self) -> None:
        self._sized = Templates()

    def mode(self, snapshot: Snapshot) -> bytes:
        """Return control mode and active limit of each winch, in words."""
        words = "; ".join(mode_words(winch) for winch in snapshot.winches)
        return serialise(new("std_msgs/msg/String", data=words))

    def parts(self, snapshot: Snapshot, stamp: dict[str, int]) -> bytes:
        """Return the component states of each winch, as positions of joints winch/quantity."""
        rows = [
            (f"{winch.name}/{name}", value)
            for winch in snapshot.winches
            for name, value in (("target", winch.target), *winch.figures)
        ]
        names = tuple(name for name, _ in rows)
        template = self._sized.get(
            "winch/parts", names, lambda: forms.joint_state(names, ("position",))
        )
        values = {"position": [value for _, value in rows]} if rows else {}
        return template.fill({**stamp, **values})


def mode_words(winch: WinchShot) -> str:
    """Return the control mode in words, such as `winch: length 350 m (limit)`."""
    unit = MOTIONS.get(winch.mode, "")
    told = f"{winch.mode} {winch.target:g} {unit}" if unit else winch.mode.replace("_", " ")
    return f"{winch.name}: {told}" + (f" ({winch.at_limit})" if winch.at_limit else "")

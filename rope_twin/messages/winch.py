"""Snapshot -> CDR bytes of what the winches were told and what their parts do."""

from __future__ import annotations

from rope_twin.messages import forms
from rope_twin.messages.cdr import Templates, new, serialise
from rope_twin.twin.snapshot import Snapshot, WinchShot
from rope_twin.twin.winch.commands import CONTROL_MODES


class WinchForms:
    """Holds the template of the parts; one per encoder."""

    def __init__(self) -> None:
        self._sized = Templates()

    def mode(self, snapshot: Snapshot) -> bytes:
        """What each winch was told and what holds it back, in words."""
        words = "; ".join(mode_words(winch) for winch in snapshot.winches)
        return serialise(new("std_msgs/msg/String", data=words))

    def parts(self, snapshot: Snapshot, stamp: dict[str, int]) -> bytes:
        """The figures of each winch's parts, as positions of joints named winch/figure."""
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
    """Like `winch: length 350 m; held at ...`."""
    unit = CONTROL_MODES.get(winch.mode, "")
    told = f"{winch.mode} {winch.target:g} {unit}" if unit else winch.mode.replace("_", " ")
    return f"{winch.name}: {told}" + (f" ({winch.at_limit})" if winch.at_limit else "")

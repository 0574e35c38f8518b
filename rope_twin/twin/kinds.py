"""Which twin a run gets by what it asks for; what it does not ask for is not there."""

from __future__ import annotations

from rope_twin.twin.accuracy.error_band import BandedTwin
from rope_twin.twin.ledger import AccountedTwin
from rope_twin.twin.twin import Twin
from rope_twin.twin.vibration.watch import Watch


class AccountedBandedTwin(AccountedTwin, BandedTwin):
    """A twin with a ledger and an error band."""


def twin_kind(energy: bool, error_band: bool, watch: Watch | None = None) -> type[Twin]:
    """The class of twin that keeps an energy balance, an error band, both or neither; watched."""
    kind: type[Twin] = BandedTwin if error_band else Twin
    if energy:
        kind = AccountedBandedTwin if error_band else AccountedTwin
    if not watch:
        return kind
    from rope_twin.twin.vibration.watched import (
        WatchedTwin,  # here: its filters take a second to load
    )

    parts = (WatchedTwin,) if kind is Twin else (WatchedTwin, kind)
    return type(f"Watched{kind.__name__}", parts, {"asked": watch})

"""Which twin a run gets by what it asks for; what it does not ask for is not there."""

from __future__ import annotations

from rope_twin.twin.error_band import BandedTwin
from rope_twin.twin.ledger import AccountedTwin
from rope_twin.twin.twin import Twin


class AccountedBandedTwin(AccountedTwin, BandedTwin):
    """A twin with a ledger and an error band."""


def twin_kind(energy: bool, error_band: bool) -> type[Twin]:
    """The class of twin that keeps an energy balance, an error band, both or neither."""
    if energy and error_band:
        return AccountedBandedTwin
    if energy:
        return AccountedTwin
    return BandedTwin if error_band else Twin

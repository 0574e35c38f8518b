"""Cut planned before a run, as text: without a scene, so that help does not load the compiler."""

from __future__ import annotations

import math
from typing import NamedTuple

from rope_twin.errors import InputError, phrase

MIN_LENGTH_M = 1.0  # minimum length left at the hang-off, and at the lower end
AT_LOWER_END = math.inf  # position as close to the lower end as possible
_FORM = (
    "write PLACE@SECONDS: metres below the hang-off, or end, and twin time, like 1500@30, or "
    "leg:4@30 where ropes meet"
)


class PlannedCut(NamedTuple):
    """A cut that is planned before a run begins."""

    at_ns: int  # twin time
    below_m: float  # unstretched rope between hang-off and cut; infinite: at the lower end
    rope: str = ""  # its name in a multi-line scene; "": the first


def read_plan(words: str) -> PlannedCut | None:
    """Return a cut from PLACE@SECONDS (`1500@30`, `end@30` or `leg:4@30`); None for no words.

    Raises:
        InputError: the words are no plan.
    """
    if not words:
        return None
    name, _, rest = words.rpartition(":")
    place, _, time = rest.partition("@")
    try:
        below_m = AT_LOWER_END if place.strip() == "end" else float(place)
        at_s = float(time)
    except ValueError as error:
        raise InputError(phrase(f"cut {words}", "that is no place and time", _FORM)) from error
    if not (below_m >= MIN_LENGTH_M and 0.0 <= at_s < math.inf):
        what = f"at {at_s:g} s, {below_m:g} m below the hang-off is not possible"
        right = f"the time is 0 or later, and at least {MIN_LENGTH_M:g} m of rope hang on"
        raise InputError(phrase(f"cut {words}", what, right))
    return PlannedCut(round(at_s * 1e9), below_m, name.strip())

"""A number in a scene or a parameter: its meaning, unit and range, kept beside the field itself."""

from __future__ import annotations

import dataclasses
import math
from typing import Any

_NO_DEFAULT = dataclasses.MISSING


@dataclasses.dataclass(frozen=True)
class Quantity:
    """Meaning, unit and the closed range [low, high] of a number (each element, for a list)."""

    about: str
    unit: str
    low: float = -math.inf
    high: float = math.inf

    def admits(self, value: float) -> bool:
        """Whether the value is finite and inside the range."""
        return math.isfinite(value) and self.low <= value <= self.high

    def range_text(self) -> str:
        """The range in words, for errors and parameter descriptions."""
        unit = f" {self.unit}" if self.unit else ""
        if math.isinf(self.low) and math.isinf(self.high):
            return f"any finite number{unit}"
        if math.isinf(self.high):
            return f"at least {self.low:g}{unit}"
        if math.isinf(self.low):
            return f"at most {self.high:g}{unit}"
        return f"{self.low:g} to {self.high:g}{unit}"


def quantity(
    about: str,
    unit: str = "",
    low: float = -math.inf,
    high: float = math.inf,
    default: Any = _NO_DEFAULT,
    *,
    only_judges: bool = False,
) -> Any:
    """A dataclass field that carries its Quantity in `metadata['quantity']`.

    only_judges: nothing that is computed depends on it, so it is left out of the object's `repr`,
    from which digests are made (scene/digest.py).
    """
    return dataclasses.field(
        default=default,
        repr=not only_judges,
        metadata={"quantity": Quantity(about, unit, low, high)},
    )


def text(about: str, default: Any = _NO_DEFAULT) -> Any:
    """A dataclass field for words or a nested part; `metadata['about']` says what it is."""
    return dataclasses.field(default=default, metadata={"about": about})

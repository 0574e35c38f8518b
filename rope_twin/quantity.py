"""A number in a scene or a parameter: its meaning, unit and range, kept beside the field itself.

And how a number that is not known is written: NaN in arrays, None in objects, null in JSON.
"""

from __future__ import annotations

import dataclasses
import math
import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any, ClassVar, cast

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
    from which digests are made (scene/convergence.py).
    """
    return dataclasses.field(
        default=default,
        repr=not only_judges,
        metadata={"quantity": Quantity(about, unit, low, high)},
    )


def text(about: str, default: Any = _NO_DEFAULT, *, only_judges: bool = False) -> Any:
    """A dataclass field for words or a nested part; `metadata['about']` says what it is.

    only_judges: as for `quantity`.
    """
    return dataclasses.field(default=default, repr=not only_judges, metadata={"about": about})


class SparingRepr:
    """Base with a repr (used for digests) that omits the optional fields that are not given.

    Those in `_spared` are left out while they are None, those in `_later`, of fields that came
    after studies of scenes had been made, while they have their default.
    """

    _spared: ClassVar[frozenset[str]] = frozenset()
    _later: ClassVar[frozenset[str]] = frozenset()
    _no_figures: ClassVar[frozenset[str]] = frozenset()  # fields excluded from digests

    def __repr__(self) -> str:
        usual: Any = {field.name: field.default for field in dataclasses.fields(cast(Any, self))}
        given = (
            (name, value) for name, value in vars(self).items()
            if name in usual and name not in self._no_figures
            and not (name in self._spared and value is None)
            and not (name in self._later and value == usual[name])
        )  # fmt: skip
        return f"{type(self).__name__}({', '.join(f'{n}={v!r}' for n, v in given)})"


# Units accepted for a quantity that is kept in an SI unit, with their size in it. Case counts:
# kN is a force, kn a speed.
UNITS: dict[str, dict[str, float]] = {
    "s": {"ms": 1e-3, "s": 1.0, "min": 60.0, "h": 3600.0},
    "m": {"mm": 1e-3, "cm": 1e-2, "m": 1.0, "km": 1e3, "ft": 0.3048},
    "m/s": {"mm/s": 1e-3, "m/s": 1.0, "m/min": 1.0 / 60.0, "kn": 1852.0 / 3600.0},
    "N": {"N": 1.0, "kN": 1e3, "MN": 1e6},
    "Hz": {"mHz": 1e-3, "Hz": 1.0},
}
_KINDS = {"s": "time", "m": "length", "m/s": "speed", "N": "force", "Hz": "frequency"}
_EXAMPLES = {"s": "90s", "m": "1.5km", "m/s": "0.5m/s", "N": "50kN", "Hz": "20Hz"}
_MEASURE = re.compile(r"([+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?)\s*([A-Za-z/]*)")


def read_quantity(words: str, unit: str) -> float:
    """Return the SI value of a number with or without a unit, such as `90s`, `2min` or `120`.

    unit: the SI unit that a number without one is in; a key of UNITS.

    Raises:
        ValueError: it is not a finite number, or its unit is not one of this quantity; the text
            says so in one sentence without a full stop.
    """
    units = UNITS[unit]
    found = _MEASURE.fullmatch(words.strip())
    scale = units.get(found[2] or unit) if found else None
    value = float(found[1]) * scale if found and scale else math.inf
    if math.isfinite(value):
        return value
    remedy = f"give a number in {unit} or with a unit ({', '.join(units)})"
    raise ValueError(f"'{words}' is not a {_KINDS[unit]}; {remedy}, like {_EXAMPLES[unit]}")


def rounded(value: float, decimals: int) -> str:
    """Return a number with these decimals, or with two significant digits where it is small."""
    is_small = 0.0 < abs(value) < 10.0 ** (1 - decimals)
    return f"{value:.2g}" if is_small else f"{value:.{decimals}f}"


def kilonewtons(force_n: float, decimals: int = 0) -> str:
    """Return a force as `rounded` in kN with its unit; less than half a newton is zero."""
    return f"{rounded(1e-3 * force_n if abs(force_n) >= 0.5 else 0.0, decimals)} kN"


_UNIT_ENDINGS = {
    "_m_per_s": "m s-1", "_m": "m", "_n": "N", "_s": "s", "_deg": "degree", "_rad": "rad",
    "_kg": "kg",
}  # fmt: skip


def unit_of(name: str) -> str:
    """Return the unit at the end of a name, as CF conventions write it; "1" without one."""
    return next((unit for end, unit in _UNIT_ENDINGS.items() if name.endswith(end)), "1")


def or_nan(value: float | None) -> float:
    """Return NaN for None."""
    return math.nan if value is None else value


def or_none(value: float) -> float | None:
    """Return None for NaN."""
    return None if math.isnan(value) else value


def json_value(value: Any) -> Any:
    """Return a value in the types of JSON; numbers that are not finite are None."""
    match value:
        case Mapping():
            return {str(key): json_value(one) for key, one in value.items()}
        case list() | tuple():
            return [json_value(one) for one in value]
        case float():
            return float(value) if math.isfinite(value) else None
        case Path():
            return str(value)
        case _:
            return value

"""Fatigue data of a rope, from its maker: its life over sheaves and under varying tension.

They judge only: no result but those of `--fatigue` depends on them.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

from rope_twin.errors import InputError, phrase
from rope_twin.quantity import quantity, text
from rope_twin.vortex.fatigue import CURVES, OWN, Endurance, Rope, TensionCurve


@dataclass(frozen=True, kw_only=True)
class BendingLife:
    """Cycles of bending to failure, N = 10^a·(T/MBL)^-m·((D/d)/(D/d)_0)^k."""

    log10_a: float = quantity(
        "a: log10 of the cycles at D/d of the tests, extrapolated to T = MBL", "", -20.0, 20.0
    )
    exponent: float = quantity("m, on tension over MBL", "", 0.0, 50.0)
    d_ratio: float = quantity("(D/d)_0: sheave over rope diameter of the tests", "", 1.0, 1e3)
    d_ratio_exponent: float = quantity(
        "k, on D/d over that of the tests; 0: the sheaves are those of the tests", "", 0.0, 20.0
    )


@dataclass(frozen=True, kw_only=True)
class TensionLife:
    """Cycles of tension to failure, N = 10^(log10_k + b·L_m)·R^-m; range R, mean L_m over MBL."""

    log10_k: float = quantity("log10 of the cycles at R = 1 and L_m = 0", "", -20.0, 20.0)
    exponent: float = quantity("m, on the range over MBL", "", 0.1, 50.0)
    per_mean_load: float = quantity("b, per mean tension over MBL", "", -50.0, 50.0, default=0.0)


@dataclass(frozen=True, kw_only=True)
class FatigueData:
    """Fatigue data of a rope, and where they come from."""

    source: str = text("where these figures come from; shown with every result")
    bending: BendingLife | None = text("life in bending over sheaves and drum", None)
    tension: TensionLife | None = text("life under varying tension, for `--fatigue own`", None)
    discard_bends: float | None = quantity(
        "bends of a metre at which the maker has it discarded", "", 1.0, 1e9, default=None
    )

    def check(self) -> str | None:
        """Return a fault if nothing is given, or None."""
        if not self.source.strip():
            return "the source is empty; name the test report, data sheet or paper"
        if self.bending is None and self.tension is None and self.discard_bends is None:
            return "no figure is given; give bending, tension or discard_bends, or remove the key"
        return None

    def curve(self) -> TensionCurve | None:
        """Return the curve of tension, or None."""
        if self.tension is None:
            return None
        own = self.tension
        return TensionCurve(own.log10_k, own.per_mean_load, own.exponent)


class _Section(Protocol):
    """Section of a line, as in rope_twin.scene.schema."""

    @property
    def rope(self) -> Rope: ...
    @property
    def fatigue(self) -> FatigueData | None: ...


class _Line(Protocol):
    """A line, as in rope_twin.scene.schema."""

    @property
    def name(self) -> str: ...
    @property
    def fatigue(self) -> FatigueData | None: ...
    @property
    def made_of(self) -> Sequence[_Section]: ...


def _data(line: _Line) -> list[FatigueData | None]:
    """Return the fatigue data of each section, from the lower end up."""
    return [section.fatigue or line.fatigue for section in line.made_of]


def endurance(line: _Line) -> tuple[Endurance, ...]:
    """Return the life in bending of each section, from the lower end up."""
    found = []
    for section, data in zip(line.made_of, _data(line), strict=True):
        own = Endurance(section.rope.diameter_m, section.rope.breaking_load_n)
        if data is not None:
            own = own._replace(discard_bends=data.discard_bends, source=data.source)
            if (life := data.bending) is not None:
                own = own._replace(
                    log10_a=life.log10_a, exponent=life.exponent, d_ratio=life.d_ratio,
                    d_ratio_exponent=life.d_ratio_exponent,
                )  # fmt: skip
        found.append(own)
    return tuple(found)


def own_curve(line: _Line) -> TensionCurve:
    """Return the line's own curve of tension.

    Raises:
        InputError: it has none, or its sections have different ones.
    """
    curves = {data.curve() if data else None for data in _data(line)}
    where = f"fatigue {OWN}: rope '{line.name}'"
    if None in curves:
        right = f"give it `fatigue: {{tension: {{...}}}}`, or take one of {', '.join(CURVES)}"
        raise InputError(phrase(where, "it has no curve of tension of its own", right))
    if len(curves) > 1:
        what = "its sections have different curves of tension"
        raise InputError(phrase(where, what, "give all of them the same"))
    (curve,) = curves
    assert curve is not None
    return curve

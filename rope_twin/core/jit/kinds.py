"""What a step is compiled for: numba's types of the values that it is given."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import numba


def kind_of(values: Iterable[Any]) -> str:
    """The types of these values, in words: the same words, the same compiled code."""
    return "; ".join(str(numba.typeof(value)) for value in values)

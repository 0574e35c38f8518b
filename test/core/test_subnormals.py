"""While a kernel steps, numbers below 2.2e-308 are zero; its caller has them as before."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from rope_twin import Twin, load_scene
from rope_twin.core.jit.decorators import jit_entry
from rope_twin.core.jit.functions import FLUSHED, HAS_REGISTER, flush, restore
from rope_twin.core.state import VELOCITY

SMALLEST, FADED = np.finfo(float).tiny, 1e-310


@jit_entry
def _exchange() -> Any:
    first = flush()
    second = flush()
    restore(first)
    third = flush()
    restore(first)
    return first, second, third


@pytest.mark.skipif(not HAS_REGISTER, reason="this processor has no such register")
def test_the_register_is_given_back_as_it_was() -> None:
    """Both bits are set in between, and no other one changes."""
    first, second, third = _exchange()
    assert not first & FLUSHED
    assert second == first | FLUSHED
    assert third == first


@pytest.mark.skipif(not HAS_REGISTER, reason="this processor has no such register")
@pytest.mark.parametrize("name", ["still_water", "bridle_lift"])
def test_nothing_fades_below_what_is_normal(name: str) -> None:
    """One rope and a multi-line system: every sideways motion is far below 1e-308."""
    twin = Twin(load_scene(name))
    twin.rope.state.nodes[VELOCITY + 1, 3] = FADED
    twin.advance(2)
    left = np.abs(twin.rope.state.nodes)
    assert not ((left > 0.0) & (left < SMALLEST)).any()
    assert np.float64(FADED) * 0.5 > 0.0

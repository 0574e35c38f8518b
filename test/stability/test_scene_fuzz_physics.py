"""Property tests: whatever a valid scene's numbers are, the rope obeys basic physics.

Every scene is drawn from ranges as wide as users may write them. Held: every number is
finite, no element pushes, rope is neither made nor lost, nothing is farther away than the rope
reaches, and with the ship at rest no energy appears from nothing where the step resolves it.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from small_scene import not_finite
from weather import UNHURRIED, Weather, that_rests, weathers

from rope_twin import Snapshot, Twin
from rope_twin.scene.schema import Winch
from rope_twin.studies.driven_twin import march
from validation.hard_cases.rigs import sine
from validation.hard_cases.thrown import is_resolved, throw
from validation.rigs import WATER, Rig

WATER_DRAG = st.tuples(st.floats(0.5, 2.0), st.floats(0.005, 0.05))  # normal, tangential


def spread(low: float, high: float) -> st.SearchStrategy[float]:
    """Numbers between, evenly over the orders of magnitude."""
    return st.floats(math.log(low), math.log(high)).map(math.exp)


@st.composite
def rigs(draw: st.DrawFn) -> Rig:
    """A rope and a payload that need not go together.

    Elements of 0.5 to 50 m, axial waves of 1 to 10 km/s (steel 5, HMPE 8), payloads up to 500 t.
    """
    mass = draw(spread(0.05, 50.0))
    diameter = math.sqrt(4.0 * mass * draw(st.floats(0.1, 1.1)) / (math.pi * WATER))
    load = draw(st.sampled_from([0.0, 1.0])) * draw(spread(1.0, 5e5))
    EA = mass * draw(spread(1e3, 1e4)) ** 2
    volume = load * draw(st.floats(0.0, 0.9)) / WATER
    elements = draw(st.integers(3, 120))
    return Rig(
        length=elements * draw(spread(0.5, 50.0)),
        elements=elements,
        mass=mass,
        EA=EA,
        diameter=diameter,
        damping=EA * draw(spread(1e-3, 0.1)),
        load=load,
        volume=volume,
        added=(WATER * volume * draw(st.floats(0.0, 3.0)),) * 3,
        area=(draw(st.floats(0.0, 5.0)) * volume ** (2.0 / 3.0),) * 3,
        density=WATER,
        drag=(draw(st.floats(0.0, 2.0)), draw(st.floats(0.0, 0.05))),
        added_mass=draw(st.floats(0.0, 3.0)),
        step=draw(st.sampled_from([5e-3, 0.01, 0.02])),
    )


def started(rig: Rig, weather: Weather) -> Twin:
    """Return the twin, if the scene has a static equilibrium that does not float."""
    winch = Winch(
        speed_limit_m_per_s=2.0,
        acceleration_limit_m_per_s2=1.0,
        min_line_out_m=min(2.0, rig.length),
        max_line_out_m=rig.length + 100.0,
    )
    profile = ((0.0, weather.current_m_per_s), (-rig.length, (0.0, 0.0)))
    return that_rests(replace(rig, winch=winch, current=profile).twin)


def reach(snapshot: Snapshot, rig: Rig) -> float:
    """Largest distance of a node from the hang-off over the stretched rope between them."""
    rest = np.diff(snapshot.arc_length_m)
    stretched = np.concatenate(
        [[0.0], np.cumsum(rest * (1.0 + snapshot.element_tension_n / rig.EA))]
    )
    away = np.linalg.norm(snapshot.node_position_m - snapshot.hang_off_position_m, axis=1)
    # the damper may hold an element short of what its tension alone would stretch it to
    return float((away - 1.01 * stretched).max() / rig.length)


@settings(max_examples=15, **UNHURRIED)
@given(rig=rigs(), weather=weathers(6.0, 20.0))
def test_drawn_ropes_stay_finite_and_conserve_length(rig: Rig, weather: Weather) -> None:
    """20 s of heave, payout and current, sampled each half second."""
    assume(rig.top_weight > 0.0 and rig.load_weight >= 0.0)
    twin = started(rig, weather)
    speeds = [(1.0, weather.payout_m_per_s), (12.0, -weather.payout_m_per_s)]
    heave = sine(weather.amplitude_m, weather.period_s)
    every = round(0.5 / rig.step)
    for snapshot in march(twin, heave, 20.0, every, speeds):
        assert not not_finite(snapshot)
        assert snapshot.element_tension_n.min() >= 0.0
        assert snapshot.tension_top_min_n >= 0.0
        rest = np.diff(snapshot.arc_length_m)
        assert rest.min() > 0.0
        assert abs(rest.sum() / snapshot.line_out_m - 1.0) < 1e-12
        assert reach(snapshot, rig) < 0.01


@settings(max_examples=60, **UNHURRIED)
@given(rig=rigs(), drag=WATER_DRAG, seed=st.integers(0, 2**32 - 1), size=st.floats(0.05, 1.0))
def test_energy_of_a_thrown_rope_never_rises(
    rig: Rig, drag: tuple[float, float], seed: int, size: float
) -> None:
    """Thrown into any shape at any speed, ship and water at rest: from look to look energy falls.

    With the drag of water and elements of 5 m or more. docs/stability.md says what a step gains
    in which an element snaps taut as a whole, common in shorter ones and rare in these.
    """
    assume(is_resolved(rig))
    rig = replace(rig, drag=drag)
    outcome = throw(rig, np.random.default_rng(seed), size)
    assert outcome.rise <= 1e-3
    if outcome.rise > 1e-9:
        outcome = throw(rig, np.random.default_rng(seed), size, parts=4)
    assert outcome.rise <= 1e-9
    assert outcome.unconverged == 0


def test_energy_gained_by_an_unresolved_snap_vanishes_at_half_the_step() -> None:
    """A weightless rope of 22 m elements in steps of 20 ms: of 200 throws, 44 and 131 gain."""
    size = 0.7573555616481563
    rig = Rig(
        length=976.709856383432,
        elements=44,
        mass=math.exp(3.1),
        EA=1457516796.0514243,
        diameter=0.16605325842835894,
        damping=1800805.984652014,
        load=71.65942304843838,
        volume=0.013887167311552564,
        added=(17.47391810946437,) * 3,
        area=(0.18186284823158372,) * 3,
        density=WATER,
        drag=(1.3407275236119012, 0.03139111815392801),
        step=0.02,
    )
    rises = [throw(rig, np.random.default_rng(seed), size).rise for seed in range(200)]
    gained = [seed for seed, rise in enumerate(rises) if rise > 1e-9]
    assert max(rises) <= 1e-3
    for seed in gained:
        assert throw(rig, np.random.default_rng(seed), size, parts=2).rise <= 1e-9

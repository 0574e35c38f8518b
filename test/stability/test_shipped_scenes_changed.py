"""Property tests: shipped scenes with other numbers in any heave, current and payout.

Its effects, sections, beds, waves, bodies and lines are as listed; figures are not. Held: every
number is finite, no element pushes, and no energy comes from nothing.

Ten scenes are drawn here. `pytest -m long test/stability/test_shipped_scenes_changed.py` draws 140
more, some with the energy balance; `--hypothesis-profile=search` draws others.
"""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from small_scene import not_finite
from weather import UNHURRIED, Weather, that_rests, weathers

from rope_twin.errors import SceneError
from rope_twin.scene.load import Change, change_scene, load_scene, scene_names
from rope_twin.scene.schema import Scene
from rope_twin.studies.driven_twin import march
from rope_twin.twin.monitors import ENERGY, NO_MONITORS, Monitors
from rope_twin.twin.twin import Twin
from validation.rigs import sine

SECONDS, LOOK_S = 8.0, 0.4
MAX_ELEMENTS = 300  # of all ropes; the others take long and are like these
MAX_GAIN_PCT = 0.1  # of the energy exchanged, as for the small scene (test_energy_balance)
FACTORS = {
    "payloads[0].mass_kg": (0.3, 3.0),
    "payloads[0].displaced_volume_m3": (0.3, 1.5),
    "ropes[0].length_m": (0.8, 1.2),
    "ropes[0].rope.axial_stiffness_n": (0.1, 10.0),
    "ropes[0].rope.mass_kg_per_m": (0.5, 2.0),
    "ropes[0].elements": (0.5, 1.5),
    "effects.drag.normal": (0.3, 3.0),
    "effects.added_mass.normal": (0.0, 3.0),
    "time.step_s": (0.5, 2.0),
}


@cache
def scene(name: str) -> Scene:
    return load_scene(name)


NAMES = [
    name for name in scene_names() if sum(r.elements for r in scene(name).ropes) <= MAX_ELEMENTS
]


@st.composite
def changed(draw: st.DrawFn) -> Scene:
    """A scene with some of its figures multiplied; a change that breaks a rule is left out."""
    found = scene(draw(st.sampled_from(NAMES)))
    for path in draw(st.lists(st.sampled_from(sorted(FACTORS)), max_size=4, unique=True)):
        times = draw(st.floats(*FACTORS[path]))
        try:
            found = change_scene(found, [Change(path, times, multiply=True)])
        except SceneError:
            continue
    return found


def through(drawn: Scene, weather: Weather, asked: Monitors = NO_MONITORS) -> Twin:
    """Run it, if it has an equilibrium; each look is held."""
    twin = that_rests(lambda: Twin(drawn, asked))
    twin.submit_speed(round(1e9), weather.payout_m_per_s)  # refused where there is no winch
    twin.submit_current(np.array([[0.0, *weather.current_m_per_s], [-100.0, 0.0, 0.0]]))
    heave = sine(weather.amplitude_m, weather.period_s)
    for snapshot in march(twin, heave, SECONDS, max(1, round(LOOK_S / twin.step_s))):
        assert not_finite(snapshot) == []
        assert snapshot.tension_top_min_n >= 0.0
        for pulls in (
            snapshot.element_tension_n,
            *(rope.element_tension_n for rope in snapshot.ropes),
        ):
            assert np.isfinite(pulls).all()
            assert pulls.min() >= 0.0
    return twin


@settings(max_examples=10, **UNHURRIED)
@given(drawn=changed(), weather=weathers(5.0, 15.0))
def test_changed_scenes_stay_finite_and_in_tension(drawn: Scene, weather: Weather) -> None:
    through(drawn, weather)


@pytest.mark.long
@settings(max_examples=100, **UNHURRIED)
@given(drawn=changed(), weather=weathers(5.0, 15.0))
def test_a_hundred_more_changed_scenes_stay_finite_and_in_tension(
    drawn: Scene, weather: Weather
) -> None:
    through(drawn, weather)


@pytest.mark.long
@settings(max_examples=40, **UNHURRIED)
@given(drawn=changed(), weather=weathers(5.0, 15.0))
def test_numerical_dissipation_of_changed_scenes_is_not_negative(
    drawn: Scene, weather: Weather
) -> None:
    """Numerical dissipation is not negative, but for a thousandth of the exchanged energy."""
    energy = through(drawn, weather, ENERGY).snapshot().energy
    assert energy is not None
    assert energy.residual_pct >= -MAX_GAIN_PCT
    assert energy.damped_j >= -1e-6 * energy.exchanged_j

"""Measured values for a live forecast are judged by the rules of the twin."""

from __future__ import annotations

import math

import pytest
from small_scene import small_scene

from rope_twin.forecast.admission import Admission
from rope_twin.scene.schema import Scene

S = 1_000_000_000
BEGIN_NS = 1_700_000_000 * S
STEP_NS = S // 10


@pytest.fixture(scope="module")
def scene(tmp_path_factory: pytest.TempPathFactory) -> Scene:
    return small_scene(tmp_path_factory.mktemp("scene"))


def swell(admission: Admission, first: int, last: int, shift_ns: int = 0) -> list[bool]:
    """Which of the 10 Hz samples of a swell are accepted; shift_ns: of the sender's clock."""
    accepted = []
    for k in range(first, last):
        at = 0.1 * k
        stamp_ns = BEGIN_NS + k * STEP_NS + shift_ns
        accepted.append(admission.heave(stamp_ns, math.sin(0.6 * at), 0.6 * math.cos(0.6 * at)))
    return accepted


def test_a_swell_is_accepted_and_what_no_ship_does_is_not(scene: Scene) -> None:
    admission = Admission(scene)
    assert all(swell(admission, 0, 100))
    ns = BEGIN_NS + 100 * STEP_NS
    z = math.sin(6.0)
    for position, rate in ((math.nan, 0.0), (1e6, 0.0), (z + 9.0, 0.0), (z, math.inf)):
        assert not admission.heave(ns, position, rate)
    assert admission.refused == {"ship/heave": 4}
    assert all(swell(admission, 100, 200))


def test_a_sensor_that_stands_still_is_refused_after_a_second(scene: Scene) -> None:
    """A forecast of it would be a calm and certain one."""
    admission = Admission(scene)
    assert all(swell(admission, 0, 100))
    z, v = math.sin(5.94), 0.6 * math.cos(5.94)
    taken = [admission.heave(BEGIN_NS + k * STEP_NS, z, v) for k in range(100, 150)]
    assert not any(taken[12:])
    assert "stuck" in admission.last_refusal


def test_a_gap_is_bridged_once_the_motion_is_confirmed(scene: Scene) -> None:
    admission = Admission(scene)
    assert all(swell(admission, 0, 100))
    after = swell(admission, 300, 350)
    assert after.index(True) == 5  # half a second
    assert all(after[5:])


def test_a_stamp_of_another_clock_stops_nothing(scene: Scene) -> None:
    """One far ahead of the simulation would make all that follow it late."""
    admission = Admission(scene, lambda: 0.0)
    for k in range(100):
        admission.note_simulated(BEGIN_NS + k * STEP_NS)
        assert swell(admission, k, k + 1) == [True]
        for shift_ns in (9 * S, 10**6 * S, -(10**6) * S, -BEGIN_NS):
            assert swell(admission, k, k + 1, shift_ns) == [False]
        ns = BEGIN_NS + k * STEP_NS
        assert admission.reading(ns, "winch", ("", 200.0, 0.0, 8e4)) == ("", 200.0, 0.0, 8e4)
        for shift_ns in (10**6 * S, -(10**6) * S):
            row = admission.reading(ns + shift_ns, "winch", ("", 200.0, 0.0, 8e4))
            assert row == ("", None, None, None)


def test_a_bag_that_is_played_again_begins_again(scene: Scene) -> None:
    """Without a simulation the sensors' clock is the only one."""
    admission = Admission(scene)
    assert all(swell(admission, 0, 100))
    assert all(swell(admission, 0, 100))
    for line_out_m in (200.0, 300.0):
        for k in range(30):
            ns = BEGIN_NS + k * STEP_NS
            row = admission.reading(ns, "winch", ("", line_out_m, None, None))
            assert row[1] == line_out_m


def test_a_faulty_value_leaves_the_others(scene: Scene) -> None:
    admission = Admission(scene)
    admission.reading(BEGIN_NS, "winch", ("", 200.0, 0.0, 8e4))
    ns = BEGIN_NS + STEP_NS
    assert admission.reading(ns, "winch", ("", 250.0, 0.0, 8e4)) == ("", None, 0.0, 8e4)
    assert admission.refused == {"winch/measured": 1}
    assert "line out changes by +50.00 m" in admission.last_refusal

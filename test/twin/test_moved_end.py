"""Lower end whose motion is prescribed, by a scene or by another simulator."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from rope_twin.errors import SceneError
from rope_twin.scene.load import load_scene
from rope_twin.scene.schema import Damping, EndHarmonic, EndMotion, Scene, SeaState
from rope_twin.twin.monitors import Monitors
from rope_twin.twin.twin import Twin

AMPLITUDE_M, PERIOD_S, RAMP_S = (0.3, 0.1, -0.2), 6.0, 2.0
HARMONICS = EndMotion(harmonics=(EndHarmonic(amplitude_m=AMPLITUDE_M, period_s=PERIOD_S),),
                      ramp_s=RAMP_S)  # fmt: skip
LED = EndMotion(from_outside=True)
PLACE_M = (150.0, 80.0, -860.0)
Vector = tuple[float, float, float]


def tether(motion: EndMotion | None, elements: int = 12) -> Scene:
    """Return the tether of an ROV that swims as given; the cage hangs still."""
    scene = load_scene("rov_tether")
    assert scene.winch is not None
    line = replace(scene.ropes[0], end_motion=motion, elements=elements)
    winch = replace(scene.winch, schedule=())
    return replace(scene, ropes=(line,), winch=winch, sea_state=SeaState())


def swimming(time_s: float) -> tuple[Vector, Vector]:
    """Return position and velocity of the harmonics, by hand."""
    u = min(max(time_s / RAMP_S, 0.0), 1.0)
    share, slope = u**3 * (10 - 15 * u + 6 * u * u), 30 * u * u * (1 - u) ** 2 / RAMP_S
    omega = 2.0 * math.pi / PERIOD_S
    s, c = math.sin(omega * time_s), math.cos(omega * time_s)
    place = np.array(PLACE_M) + np.array(AMPLITUDE_M) * share * s
    speed = np.array(AMPLITUDE_M) * (slope * s + share * omega * c)
    return tuple(place.tolist()), tuple(speed.tolist())


def lead(twin: Twin, until_s: float, every_s: float = 0.01) -> None:
    """Submit the motion up to a time, a sample a step."""
    newest = twin.inputs.newest_ns().get("lower_end", -1)
    for k in range(round(until_s / every_s) + 1):
        stamp_ns = k * round(every_s * 1e9)
        if stamp_ns > newest:
            assert twin.submit_lower_end(stamp_ns, *swimming(stamp_ns * 1e-9)) == ""


def test_force_follows_the_stretch() -> None:
    """A taut line without water and weight, pulled slowly along itself: T = EA·(d - L)/L."""
    scene = tether(None)
    length, ahead = 250.0, 252.0
    rope = scene.ropes[0].rope
    assert rope is not None
    assert rope.axial_stiffness_n is not None
    slow = EndMotion(harmonics=(EndHarmonic(amplitude_m=(0.5, 0.0, 0.0), period_s=60.0),))
    top = scene.ship.hang_off_m
    line = replace(
        scene.ropes[0], end_motion=slow, fixed_at_m=(top[0] + ahead, *top[1:]), length_m=length,
        damping=Damping(fraction_of_first_axial_mode=0.05),
    )  # fmt: skip
    environment = replace(scene.environment, gravity_m_per_s2=0.0, water_density_kg_per_m3=0.0)
    twin = Twin(replace(scene, ropes=(line,), environment=environment))
    for _ in range(60):
        twin.advance(50)
        snapshot = twin.snapshot()
        d = snapshot.payload_position_m[0] - snapshot.hang_off_position_m[0]
        tension = rope.axial_stiffness_n * (d - length) / length
        assert snapshot.lower_end_force_n[0] == pytest.approx(-tension, rel=2e-3)
        assert snapshot.hang_off_force_n[0] == pytest.approx(tension, rel=2e-3)
        assert np.abs(snapshot.lower_end_force_n[1:]).max() < 1e-6 * tension
        angle = 2.0 * math.pi * snapshot.time_s / 60.0
        if snapshot.time_s > 8.0:
            assert d == pytest.approx(ahead + 0.5 * math.sin(angle), abs=1e-9)


def test_samples_move_it_as_a_scene_does() -> None:
    """Forces on both ends agree within 1e-8 at every step of 8 s."""
    twins = Twin(tether(HARMONICS)), Twin(tether(LED))
    lead(twins[1], 0.02)
    for step in range(800):
        lead(twins[1], 0.01 * (step + 2))
        for twin in twins:
            twin.advance(1)
        one, other = (twin.snapshot() for twin in twins)
        assert one.payload_position_m == pytest.approx(swimming(one.time_s)[0], abs=1e-9)
        assert other.payload_velocity_m_per_s == pytest.approx(swimming(one.time_s)[1], abs=1e-9)
        size = np.linalg.norm(one.lower_end_force_n)
        apart = np.subtract(one.lower_end_force_n, other.lower_end_force_n)
        assert np.abs(apart).max() <= 1e-8 * size
        assert np.abs(one.hang_off_force_n - other.hang_off_force_n).max() <= 1e-8 * size
    still = Twin(tether(None))
    still.advance(800)
    assert still.snapshot().lower_end_force_n == ()
    assert abs(still.snapshot().tension_payload_n / one.tension_payload_n - 1.0) > 0.01


def test_steps_are_the_same_however_they_are_divided(tmp_path: Path) -> None:
    """To the bit: one call, many, after a saved state, and in a branch."""
    whole, parts = Twin(tether(LED)), Twin(tether(LED))
    lead(whole, 3.0)
    whole.advance(300)
    for some in (1, 99, 20, 60):
        lead(parts, min(3.0, (parts.steps + some) * 0.01 + 0.5))
        parts.advance(some)
    parts.save(tmp_path / "twin.state")
    later = Twin.restore(tmp_path / "twin.state", tether(LED))
    branch = parts.branch()
    for twin in (parts, later, branch):
        lead(twin, 3.0)
        twin.advance(120)
        for name in ("lower_end_force_n", "hang_off_force_n", "node_position_m"):
            assert np.array_equal(getattr(twin.snapshot(), name), getattr(whole.snapshot(), name))


def test_energy_of_a_moved_end_is_accounted() -> None:
    """The work of whoever moves it is among the sources; little remains."""
    twin = Twin(tether(HARMONICS), Monitors(energy=True))
    twin.advance(1200)
    balance = twin.snapshot().energy
    assert balance is not None
    assert abs(balance.hang_off_j) > 1.0
    assert abs(balance.residual_pct) < 1.0


def test_an_end_without_samples_stays() -> None:
    """It rests like a fixed one, and the input says so."""
    led, fixed = Twin(tether(LED)), Twin(tether(None))
    for twin in (led, fixed):
        twin.advance(100)
    assert led.snapshot().hang_off_force_n == pytest.approx(fixed.snapshot().hang_off_force_n,
                                                            rel=1e-12)  # fmt: skip
    assert led.snapshot().inputs["lower_end"].accepted == 0


@pytest.mark.parametrize(
    ("sample", "words"),
    [
        ((0, (150.0, 80.0, -850.0), (0.0, 0.0, 0.0)), "it jumps by 10.00 m"),
        ((0, (150.0, math.nan, -860.0), (0.0, 0.0, 0.0)), "all must be finite numbers"),
        ((0, PLACE_M, (40.0, 0.0, 0.0)), "a speed of 40.0 m/s; give at most"),
        ((10**12, PLACE_M, (0.0, 0.0, 0.0)), "lower_end: "),
    ],
)
def test_samples_that_cannot_be_are_refused(sample: tuple[int, Vector, Vector], words: str) -> None:
    """In one sentence each, and counted."""
    twin = Twin(tether(LED))
    refusal = twin.submit_lower_end(*sample)
    assert words in refusal
    assert refusal.startswith("lower_end: ")
    assert twin.snapshot().inputs["lower_end"].refused == 1


def test_an_end_that_is_not_led_takes_no_samples() -> None:
    """It says which key is missing."""
    refusal = Twin(tether(HARMONICS)).submit_lower_end(0, *swimming(0.0))
    assert "give its rope `end_motion: {from_outside: true}`" in refusal


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("-860.0]", "-860.0]\n    end_motion: {}", "neither of both; give harmonics"),
        ("-860.0]", "-860.0]\n    end_motion: {from_outside: true, harmonics: "
         "[{amplitude_m: [1, 0, 0], period_s: 6}]}", "harmonics and from_outside; give harmonics"),
        ("-860.0]", "-860.0]\n    end_motion: {harmonics: [{amplitude_m: [1, 0, 0], period_s: 0}]}",
         "0 s is out of range"),
    ],
)  # fmt: skip
def test_wrong_motions_are_refused(old: str, new: str, words: str, tmp_path: Path) -> None:
    """With their line."""
    text = load_scene("rov_tether").path.read_text()
    assert old in text
    (tmp_path / "own.yaml").write_text(text.replace(old, new, 1))
    with pytest.raises(SceneError, match=r"line \d+") as caught:
        load_scene(tmp_path / "own.yaml")
    assert words in str(caught.value)


def test_payloads_move_by_themselves(tmp_path: Path) -> None:
    """A rope with a payload has no end to be moved."""
    text = load_scene("shallow_lift").path.read_text()
    own = text.replace("    to: module\n", "    to: module\n    end_motion: {from_outside: true}\n")
    assert own != text
    (tmp_path / "own.yaml").write_text(own)
    with pytest.raises(SceneError, match="a payload moves by itself; give `fixed_at_m`"):
        load_scene(tmp_path / "own.yaml")

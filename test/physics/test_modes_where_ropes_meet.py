"""Natural modes of multi-line systems: against one rope, pendulums, springs and a wheel."""

from __future__ import annotations

import json
import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from rope_twin import load_scene
from rope_twin.cli import main
from rope_twin.effects.bending import BendingParams
from rope_twin.effects.current import CurrentParams
from rope_twin.effects.payload import SplashZoneParams
from rope_twin.errors import InputError
from rope_twin.scene.schema import (
    HangOff,
    Joint,
    Payload,
    Rope,
    RopeLine,
    RopeSection,
    Scene,
    Strut,
)
from rope_twin.studies.modes import find_modes, find_system_modes

LENGTH, LOAD, APART = 50.0, 50e3, 12.0


def stiffness_n(line: RopeLine) -> float:
    """EA [N]."""
    assert line.rope is not None
    assert line.rope.axial_stiffness_n is not None
    return line.rope.axial_stiffness_n


def lift() -> Scene:
    """One load on two lines; the effects of all scenes here but the last."""
    return load_scene("two_line_lift")


@pytest.mark.parametrize(
    ("effects", "within"), [((), 1e-5), ((BendingParams(stiffness_n_m2=1e6),), 5e-5)]
)
def test_modes_of_a_rope_in_two_parts_are_those_of_the_rope(
    effects: tuple[BendingParams, ...], within: float
) -> None:
    """A massless ring in the middle changes no frequency; of a stiff rope, as a hinge, little."""
    scene = lift()
    scene = replace(scene, effects=(*scene.effects, *effects))
    line = replace(scene.ropes[0], elements=40)
    whole = replace(scene, ropes=(line,), hang_offs=())
    upper = replace(line, elements=20, length_m=300.0, to="ring")
    lower = replace(upper, name="lower", from_="ring", to=line.to)
    parted = replace(whole, ropes=(upper, lower), joints=(Joint(name="ring"),))
    expected, found = find_modes(whole, 8), find_system_modes(parted, 8)
    ours = [mode.frequency_hz for mode in found.lowest]
    assert ours == pytest.approx([mode.frequency_hz for mode in expected.lowest], rel=within)
    first = found.stretching[0]
    assert first.frequency_hz == pytest.approx(expected.axial[0].frequency_hz, rel=1e-5)
    assert first.kind == "stretching"
    assert first.vertical_share > 0.99
    assert (first.rope, first.largest_at_m) == ("lower", 300.0)


def test_heave_of_a_payload_in_the_surface() -> None:
    """ω² = (EA/L + ρ·g·V/H)/(m + β·A33) on a light rope, whole and in two parts: 1e-3."""
    scene = lift()
    rope = Rope(diameter_m=0.01, mass_kg_per_m=0.01, hydrodynamic_diameter_m=0.001,
                    axial_stiffness_n=2e6, breaking_load_n=1e6)  # fmt: skip
    line = replace(scene.ropes[0], rope=rope, length_m=8.0, elements=8)
    buoy = Payload(
        name=line.to, mass_kg=7000.0, displaced_volume_m3=12.0, drag_area_m2=(4.0, 4.0, 4.0),
        added_mass_kg=(3000.0, 3000.0, 5000.0),
    )  # fmt: skip
    zone = SplashZoneParams(height_m=3.0)
    ship = replace(scene.ship, hang_off_m=(0.0, 0.0, 8.7))
    whole = replace(
        scene, ropes=(line,), hang_offs=(), payloads=(buoy,), ship=ship, winch=None,
        effects=(*scene.effects, zone),
    )  # fmt: skip
    upper = replace(line, elements=4, length_m=4.0, to="ring")
    lower = replace(upper, name="lower", from_="ring", to=line.to)
    parted = replace(whole, ropes=(upper, lower), joints=(Joint(name="ring"),))
    one, two = find_modes(whole, 6), find_system_modes(parted, 6)
    submerged = 0.5 - one.place[-1, 2] / 3.0
    assert 0.1 < submerged < 0.9
    stiffness = 2e6 / 8.0 + 1025.0 * 9.80665 * 12.0 / 3.0
    expected_hz = math.sqrt(stiffness / (7000.0 + submerged * 5000.0)) / (2.0 * math.pi)
    assert one.axial[0].frequency_hz == pytest.approx(expected_hz, rel=1e-3)
    vertical = max(two.lowest, key=lambda mode: mode.vertical_share)
    assert vertical.frequency_hz == pytest.approx(expected_hz, rel=1e-3)


def test_strouhal_frequency_of_the_section_that_moves_most() -> None:
    """St·U/d with the diameter there: a pipe of 0.3 m below wire, across a uniform current."""
    scene = lift()
    line = scene.ropes[0]
    assert line.rope is not None
    pipe = replace(line.rope, hydrodynamic_diameter_m=0.3, mass_kg_per_m=120.0)
    sections = (RopeSection(rope=pipe, length_m=300.0), RopeSection(rope=line.rope))
    flow = CurrentParams(profile=((0.0, (0.3, 0.0)), (-1000.0, (0.3, 0.0))))
    others = [own for own in scene.effects if not isinstance(own, CurrentParams)]
    whole = replace(line, rope=None, sections=sections, length_m=600.0, elements=40)
    parted = replace(
        scene, ropes=(whole,), hang_offs=(), effects=(flow, *others),
    )  # fmt: skip
    seen = set()
    for mode in find_system_modes(parted, 12).lowest:
        thick = mode.largest_at_m > 300.0
        d = 0.3 if thick else line.rope.hydrodynamic_diameter_m
        assert mode.strouhal_hz == pytest.approx(0.17 * 0.3 / d, rel=0.1)
        seen.add(thick)
    assert seen == {True, False}


def hung_bar() -> Scene:
    """Two loads, kept apart by a bar, each on a line of its own: a bifilar pendulum."""
    scene = lift()
    load = Payload(
        name="fore_load", mass_kg=LOAD, displaced_volume_m3=1.0,
        added_mass_kg=(0.0, 0.0, 0.0), drag_area_m2=(1.0, 1.0, 1.0),
    )  # fmt: skip
    fore = replace(scene.ropes[0], length_m=LENGTH, elements=20, to="fore_load")
    aft = replace(fore, name="aft", from_="aft_sheave", to="aft_load")
    bar = Strut(
        name="bar", between=("fore_load", "aft_load"), length_m=APART, stiffness_n_per_m=1e9
    )
    half = 0.5 * APART
    return replace(
        scene,
        ropes=(fore, aft),
        payloads=(load, replace(load, name="aft_load")),
        struts=(bar,),
        hang_offs=(HangOff(name="aft_sheave", at_m=(-half, 0.0, 0.0)),),
        winch=None,
        ship=replace(scene.ship, hang_off_m=(half, 0.0, 0.0)),
        effects=tuple(
            replace(effect, profile=((0.0, (1e-9, 0.0)),)) if hasattr(effect, "profile") else effect
            for effect in scene.effects
        ),
    )


def test_modes_of_a_bifilar_pendulum() -> None:
    """Swing and twist √(W/(M·L)), bounce and roll √(EA/(L·M))."""
    scene = hung_bar()
    rope, stiffness = scene.ropes[0].rope, stiffness_n(scene.ropes[0])
    assert rope is not None
    computed = find_system_modes(scene, 3)
    weight = (LOAD - 1.0 * scene.environment.water_density_kg_per_m3) * 9.80665
    stretched = LENGTH * (1.0 + weight / stiffness)
    swing = math.sqrt(weight / (LOAD * stretched)) / (2.0 * math.pi)
    assert [mode.frequency_hz for mode in computed.lowest] == pytest.approx([swing] * 3, rel=5e-3)
    assert all(mode.kind == "swinging" for mode in computed.lowest)
    mass = LOAD + rope.mass_kg_per_m * LENGTH / 3.0
    bounce = math.sqrt(stiffness / (LENGTH * mass)) / (2.0 * math.pi)
    ours = [mode.frequency_hz for mode in computed.stretching[:2]]
    assert ours == pytest.approx([bounce] * 2, rel=2e-3)
    assert all(mode.vertical_share > 0.99 for mode in computed.stretching[:2])


def test_a_load_under_one_hook_has_a_zero_twist_mode() -> None:
    """The bridle's spin about the hoist is free: the first mode has no period."""
    computed = find_system_modes(load_scene("bridle_lift"), 2)
    assert [mode.kind for mode in computed.lowest] == ["free", "swinging"]
    assert computed.lowest[0].frequency_hz == 0.0
    assert computed.lowest[0].vertical_share < 1e-3


def test_modes_of_a_wheel_between_two_springs() -> None:
    """A heavy wheel, a heavy sheave and two springs without mass: two frequencies."""
    scene = load_scene("two_line_loop")
    wheel, block = 2e5, 2e4
    sheave = replace(scene.sheaves[0], wheel_inertia_kg=wheel, mass_kg=block)
    small = tuple(replace(payload, mass_kg=1200.0) for payload in scene.payloads)
    scene = replace(scene, sheaves=(sheave,), payloads=small)
    soft = [line.length_m / stiffness_n(line) for line in scene.ropes]
    left, right = 1.0 / (soft[0] + soft[1]), 1.0 / (soft[2] + soft[3])
    assert sheave.tether is not None
    K = np.array([[left + right, right - left],
                  [right - left, left + right + sheave.tether.stiffness_n_per_m]])  # fmt: skip
    slow = np.linalg.eigvals(K / np.array([[wheel], [block]])).min()
    computed = find_system_modes(scene, 1).stretching[0]
    assert computed.frequency_hz == pytest.approx(math.sqrt(slow) / (2.0 * math.pi), rel=0.03)


def test_more_modes_than_degrees_of_freedom_are_rejected() -> None:
    """One sentence says how many."""
    with pytest.raises(InputError, match=r"--count: 5000 of ropes with 3\d\d ways to move; give 1"):
        find_system_modes(lift(), 5000)


def test_the_modes_command_of_a_multi_line_scene(
    capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    """A table, an object with null for what is infinite, and a picture."""
    picture = tmp_path / "modes.png"
    assert main(["modes", "bridle_lift", "--count", "2", "--out", str(picture)]) == 0
    assert "free" in capsys.readouterr().out
    assert picture.stat().st_size > 10_000
    assert main(["modes", "bridle_lift", "--count", "2", "--json"]) == 0
    rows = json.loads(capsys.readouterr().out)["rows"]
    assert [row["group"] for row in rows] == ["lowest"] * 2 + ["stretching"] * 3
    assert rows[0]["period_s"] is None
    assert rows[1]["rope"] in {"sling_port", "sling_starboard", "leg_port", "leg_starboard"}

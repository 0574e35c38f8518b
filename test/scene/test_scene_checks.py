"""Plausibility checks warn in numbers, with place and remedy, and are silent on good scenes."""

import dataclasses
from math import pi, sqrt, tan
from pathlib import Path

import pytest
from scene_text import GOOD, spoilt, written

from rope_twin.effects.bending import BendingParams
from rope_twin.scene.lift import lift_figures, schedule_meets_limit, stretch_m, suspended_weights
from rope_twin.scene.load import load_scene, rope_preset
from rope_twin.scene.rope_warnings import sense_checks
from rope_twin.scene.schema import Damping, Payload, Rope, RopeLine, Scene, ScheduleRow, Winch

LENGTH = "length_m: 500.0"
SHAPE = "shape: {box: {length_m: 3.0, width_m: 2.0, height_m: 1.5}}"
FIRST_ROW, SECOND_ROW = "{at_s: 0.0, speed_m_per_s: 0.5}", "{at_s: 20.0, speed_m_per_s: -0.5}"
PROFILE = "[[0.0, [0.5, 0.0]], [-900.0, [0.1, 0.05]]]"
FIGURES = (
    "{diameter_m: 0.04, mass_kg_per_m: 6.4, hydrodynamic_diameter_m: 0.032,"
    " axial_stiffness_n: 6.4e+7, breaking_load_n: 1.0e+6}"
)

WAVES = spoilt(
    "effects:\n",
    "effects:\n  - waves: {jonswap: {significant_height_m: 2.0, peak_period_s: 8.0}}\n",
)


def fixed(text: str, end: str) -> str:
    """Return the scene with its lower end fixed instead of loaded."""
    text = text.replace(text[text.index("payloads:") : text.index("winch:")], "")
    return text.replace("    to: tool\n", f"    fixed_at_m: {end}\n").replace(
        "  - payload: {}\n", ""
    )


BENT = "  - bending: {stiffness_n_m2: 1.0e+6, clamped_along: [0.3, 0.0, -1.0]}\n"
CLAMPED = spoilt("  - payload: {}\n", f"  - payload: {{}}\n{BENT}")
CLAMPED = CLAMPED.replace(CLAMPED[CLAMPED.index("winch:") : CLAMPED.index("ship:")], "")


# name: (scene, start of the warning, words in it)
ODD: dict[str, tuple[str, str, tuple[str, ...]]] = {
    "over a third": (
        spoilt("mass_kg: 20000.0", "mass_kg: 50000.0"),
        "ropes[0]: ",
        ("427 kN", "1013 kN", "safety factor of 2.37"),
    ),
    "over the breaking load": (
        spoilt("mass_kg: 20000.0", "mass_kg: 150000.0"),
        "ropes[0]: ",
        ("breaks", "stronger rope"),
    ),
    "too heavy with all rope out": (
        spoilt("max_line_out_m: 800.0", "max_line_out_m: 6000.0").replace("-900.0", "-9000.0"),
        "winch.max_line_out_m: ",
        ("with 6000 m out", "safety factor"),
    ),
    "coarse elements": (
        spoilt("elements: 50", "elements: 9"),
        "ropes[0].elements: ",
        ("55.6 m", "at least 10"),
    ),
    "elements too long for an edge": (
        spoilt(
            "  - weight: {}\n",
            "  - weight: {}\n  - hull_contact: {boxes: "
            "[{centre_m: [12.0, 0.0, -8.0], size_m: [20.0, 20.0, 8.0]}]}\n",
        ),
        "ropes[0].elements: ",
        ("10.0 m spread the bend at an edge 12 m below", "up to 21 % too large, or give 209"),
    ),
    "elements that cannot tell a bend": (
        spoilt("steel_wire_40mm", FIGURES.replace("}", ", minimum_bend_radius_m: 4.0}")),
        "ropes[0].elements: ",
        ("elements of 10 m", "minimum_bend_radius_m, 4 m", "at least 125"),
    ),
    "fine elements": (
        spoilt("elements: 50", "elements: 2000"),
        "ropes[0].elements: ",
        ("0.25 m", "1000 elements"),
    ),
    "stiffness in kN": (
        spoilt("steel_wire_40mm", FIGURES.replace("6.4e+7", "6.4e+4")),
        "ropes[0].rope: ",
        ("100 m/s", "axial_stiffness_n [N]"),
    ),
    "rope denser than metal": (
        spoilt("steel_wire_40mm", FIGURES.replace("0.032", "0.020")),
        "ropes[0].rope: ",
        ("20372 kg/m³", "hydrodynamic_diameter_m"),
    ),
    "payload that floats": (
        spoilt("mass_kg: 20000.0", "mass_kg: 9000.0"),
        "payloads[0]: ",
        ("it floats", "9.00 m³", "-2.2 kN", "displaced_volume_m3"),
    ),
    "payload that nearly floats": (
        spoilt("mass_kg: 20000.0", "mass_kg: 9500.0"),
        "payloads[0]: ",
        ("nearly floats", "2.7 kN"),
    ),
    "rope that floats": (
        spoilt("steel_wire_40mm", "hmpe_76mm").replace(
            "mass_kg: 20000.0", "mass_kg: 10.0\n    displaced_volume_m3: 0.0"
        ),
        "ropes[0]: ",
        ("floats with 0.72 kN over 500 m", "0.098 kN of payload"),
    ),
    "no weight": (spoilt("  - weight: {}\n", ""), "effects: ", ("`weight` is not listed",)),
    "payload without its effect": (
        spoilt("  - payload: {}\n", ""),
        "effects: ",
        ("`payload` is not listed", "'tool'"),
    ),
    "current without drag": (
        spoilt("  - drag: {normal: 1.2, tangential: 0.02}\n", ""),
        "effects: ",
        ("`current` is listed without `drag`",),
    ),
    "step coarse for the first mode": (
        spoilt("step_s: 0.01", "step_s: 0.04"),
        "time.step_s: ",
        ("0.04 s", "first axial period of rope and payload, 3.07 s", "0.031 s or less"),
    ),
    "step coarse for the rope's wave": (
        spoilt(LENGTH, "length_m: 60.0").replace("-900.0", "-999.0"),
        "time.step_s: ",
        ("rope's own axial wave, 0.0377 s", "0.0038 s or less"),
    ),
    "step coarse for the sea": (
        spoilt("step_s: 0.01", "step_s: 0.1"),
        "time.step_s: ",
        ("shortest sea waves, 2.5 s", "0.05 s or less"),
    ),
    "much damping": (
        spoilt("fraction_of_first_axial_mode: 0.02", "fraction_of_first_axial_mode: 0.2"),
        "ropes[0].damping: ",
        ("20 % of critical", "1 to 2 %"),
    ),
    "much damping in newton seconds": (
        spoilt("fraction_of_first_axial_mode: 0.02", "newton_seconds: 1.0e+7"),
        "ropes[0].damping: ",
        ("16 % of critical",),
    ),
    "no damping": (
        spoilt("fraction_of_first_axial_mode: 0.02", "newton_seconds: 0.0"),
        "ropes[0].damping: ",
        ("no limit",),
    ),
    "schedule past the rope there is": (
        spoilt(SECOND_ROW, "{at_s: 20.0, speed_m_per_s: 0.0}"),
        "winch.schedule: ",
        ("max_line_out_m (800 m) after 1200 s", "stops there"),
    ),
    "schedule past the least line out": (
        spoilt(FIRST_ROW, "{at_s: 0.0, speed_m_per_s: 0.0}"),
        "winch.schedule: ",
        ("min_line_out_m (50 m) after 1820 s",),
    ),
    "lowering faster than the payload sinks": (
        spoilt("mass_kg: 20000.0", "mass_kg: 9800.0\n    drag_area_m2: [9.0, 9.0, 90.0]"),
        "winch.schedule: ",
        ("0.5 m/s", "sinks at 0.35 m/s", "slack"),
    ),
    "hang-off above the water": (
        spoilt("hang_off_m: [0.0, 0.0, 0.0]", "hang_off_m: [0.0, 0.0, 90.0]"),
        "ship.hang_off_m[2]: ",
        ("90 m of rope above the water", "728 N of buoyancy", "443 N of drag", "132.9 kN"),
    ),
    "limit in per cent": (
        f"{GOOD}limits: {{utilisation: 30.0}}\n",
        "limits.utilisation: ",
        ("30 times the MBL", "0.3 for 30 %"),
    ),
    "motion without a ramp": (
        spoilt("motion_ramp_s: 8.0", "motion_ramp_s: 0.0").replace(
            "{start_s", "{bag: ./bag, start_s"
        ),
        "ship.motion_ramp_s: ",
        ("excites the rope",),
    ),
    "current that ends above the rope's end": (
        spoilt(PROFILE, "[[0.0, [0.5, 0.0]], [-300.0, [0.1, 0.05]]]"),
        "effects current.profile: ",
        ("below", "z = -300 m", "0.1 east, 0.05 north", "z = -800 m"),
    ),
    "current that starts deep": (
        spoilt(PROFILE, "[[-50.0, [0.5, 0.0]], [-900.0, [0.0, 0.0]]]"),
        "effects current.profile: ",
        ("above", "z = -50 m"),
    ),
    "current through the surface": (
        spoilt(PROFILE, "[[0.0, [0.5, 0.0, 0.2]], [-900.0, [0.0, 0.0, 0.0]]]"),
        "effects current.profile: ",
        ("0.2 m/s of vertical current pass through the surface", "a row at z = 0 m with 0 up"),
    ),
    "a bend that elements at a clamp spread": (
        # T = 133.0 kN, √(EI/T) = 2.742 m, l/√(EI/T) = 3.647: by hand 1/κ is 2.08 times √(EI/T)/θ
        CLAMPED,
        "ropes[0].elements: ",
        ("elements of 10 m", "√(EI/T) = 2.7 m", "108 % too large", "give 183 or more"),
    ),
    "a winch through a clamp": (
        spoilt(
            "  - payload: {}\n",
            "  - payload: {}\n"
            "  - bending: {stiffness_n_m2: 1.0e+3, clamped_along: [0.0, 0.0, -1.0]}\n",
        ),
        "effects bending.clamped_along: ",
        ("clamped in one direction", "remove it"),
    ),
    "thin water": (
        spoilt("water_density_kg_per_m3: 1025.0", "water_density_kg_per_m3: 1.2"),
        "environment.water_density_kg_per_m3: ",
        ("1.2 kg/m³", "1025"),
    ),
    "gravity of the moon": (
        spoilt("gravity_m_per_s2: 9.80665", "gravity_m_per_s2: 1.62"),
        "environment.gravity_m_per_s2: ",
        ("1.62 m/s²", "9.80665"),
    ),
    "a ship at rest in the waves that the rope feels": (
        WAVES,
        "sea_state: ",
        ("the ship does not move", "on_waves"),
    ),
    "two seas": (
        WAVES.replace("{start_s", "{bag: sea_1p2m, start_s"),
        "sea_state: ",
        ("the record", "two sea states"),
    ),
    "a heave that the payload cannot follow": (
        spoilt("{start_s: 10.0", "{heave: {amplitude_m: 7.0, period_s: 8.0}, start_s: 10.0"),
        "sea_state.heave: ",
        ("5.50 m/s", "sinks at 5.43", "slack"),
    ),
    "fixed end too far": (
        fixed(GOOD, "[0.0, 0.0, -505.0]"),
        "ropes[0].fixed_at_m: ",
        ("505.0 m from the hang-off", "646 kN"),
    ),
}


@pytest.mark.parametrize("name", ODD)
def test_implausible_scenes_are_warned_of(name: str, tmp_path: Path) -> None:
    text, start, words = ODD[name]
    (tmp_path / "bag").mkdir()
    warnings = sense_checks(load_scene(written(tmp_path, text)))
    computed = [warning for warning in warnings if all(word in warning for word in words)]
    assert len(computed) == 1, warnings
    assert computed[0].startswith(start)
    assert "; " in computed[0]
    assert computed[0].endswith(".")


def test_a_clamp_is_checked_with_the_bending_of_its_rope(tmp_path: Path) -> None:
    """A rope with a clamp and stiffness of its own, and one that the effect's clamp leaves free."""
    scene = load_scene(written(tmp_path, CLAMPED))
    for own, count in (
        (BendingParams(stiffness_n_m2=1e5, clamped_along=(0.0, 0.0, -1.0)), 1),
        (BendingParams(stiffness_n_m2=1e5), 0),
    ):
        line = dataclasses.replace(scene.ropes[0], bending=own)
        warnings = sense_checks(dataclasses.replace(scene, ropes=(line,)))
        computed = [warning for warning in warnings if "√(EI/T) = 0.87 m" in warning]
        assert len(computed) == count
        assert not any("√(EI/T) = 2.7 m" in warning for warning in warnings)


@pytest.mark.parametrize(
    "text",
    [
        GOOD,
        spoilt(f"  - current: {{profile: {PROFILE}}}\n", ""),  # drag in still water is fine
        spoilt(PROFILE, "[[0.0, [0.5, 0.0]], [-300.0, [0.0, 0.0]]]"),  # nothing held below
        spoilt(SECOND_ROW, SECOND_ROW + "\n    - {at_s: 40.0, speed_m_per_s: 0.0}").replace(
            "repeats_every_s: 40.0", "repeats_every_s: 60.0"
        ),
        fixed(GOOD, "[0.0, 0.0, -499.0]"),
    ],
)
def test_good_scenes_give_no_warning(text: str, tmp_path: Path) -> None:
    assert sense_checks(load_scene(written(tmp_path, text))) == []


STEEL_76MM = Rope(  # 76.0 mm; the preset of that name is 3 in, 76.2 mm
    diameter_m=0.076,
    mass_kg_per_m=3989.7 * 0.076**2,
    hydrodynamic_diameter_m=0.8 * 0.076,
    axial_stiffness_n=4.04e10 * 0.076**2,
    breaking_load_n=6.334e8 * 0.076**2,
)


@pytest.mark.parametrize(
    ("rope", "length", "period"),
    [
        (STEEL_76MM, 1000.0, 5.17),
        (STEEL_76MM, 3000.0, 9.39),
        (STEEL_76MM, 5000.0, 12.68),
        (rope_preset("hmpe_76mm"), 1000.0, 5.37),
        (rope_preset("hmpe_76mm"), 3000.0, 9.36),
        (rope_preset("hmpe_76mm"), 5000.0, 12.17),
    ],
)
def test_first_axial_period_is_that_of_the_closed_form(
    rope: Rope, length: float, period: float, tmp_path: Path
) -> None:
    """x·tan x = m·L/M', T = 2π·L/(c·x), M' = 150 t: periods quoted for long lifting ropes."""
    scene = load_scene(written(tmp_path, GOOD))
    payload = Payload(
        name="tool",
        mass_kg=100e3,
        displaced_volume_m3=10.0,
        added_mass_kg=(0.0, 0.0, 50e3),
        drag_area_m2=(1.0, 1.0, 1.0),
    )
    line = dataclasses.replace(scene.ropes[0], rope=rope, length_m=length)
    scene = dataclasses.replace(scene, ropes=(line,), payloads=(payload,))
    computed = lift_figures(scene).first_axial_period_s
    assert computed == pytest.approx(period, rel=1e-3)
    x = 2.0 * pi * length / (computed * sqrt(rope.axial_stiffness_n / rope.mass_kg_per_m))
    assert x * tan(x) == pytest.approx(rope.mass_kg_per_m * length / 150e3, rel=1e-9)


def test_static_values_by_hand_calculation(tmp_path: Path) -> None:
    scene = load_scene(written(tmp_path, GOOD))
    figures = lift_figures(scene)
    weight = (20000.0 - 1025.0 * 9.0) * 9.80665
    per_metre = (6.38352 - 1025.0 * 8.0424772e-4) * 9.80665
    assert figures.payload_weight_n == pytest.approx(weight)
    assert figures.rope_weight_n_per_m == pytest.approx(per_metre)
    assert figures.top_tension_n(500.0) == pytest.approx(weight + 500.0 * per_metre)
    by_hand = (weight + 0.5 * per_metre * 500.0) * 500.0 / 64.64e6
    assert stretch_m(figures) == pytest.approx(by_hand)
    assert figures.damping_fraction == pytest.approx(0.02)


def winch(*rows: tuple[float, float], repeat: float | None = None) -> Winch:
    return Winch(
        speed_limit_m_per_s=2.0,
        acceleration_limit_m_per_s2=0.3,
        min_line_out_m=50.0,
        max_line_out_m=150.0,
        schedule=tuple(ScheduleRow(at_s=at, speed_m_per_s=speed) for at, speed in rows),
        schedule_repeats_every_s=repeat,
    )


def test_when_a_schedule_meets_a_limit() -> None:
    assert schedule_meets_limit(winch((10.0, 1.0)), 100.0) == (60.0, 150.0)
    assert schedule_meets_limit(winch((0.0, -2.0)), 100.0) == (25.0, 50.0)
    assert schedule_meets_limit(winch((0.0, 1.0), (50.0, 0.0)), 100.0) is None
    net = winch((0.0, 1.0), (20.0, -1.0), (30.0, 0.0), repeat=40.0)  # 10 m deeper a round
    assert schedule_meets_limit(net, 100.0) == (170.0, 150.0)  # 140 m after four rounds
    assert schedule_meets_limit(winch((0.0, 1.0), (20.0, -1.0), repeat=40.0), 100.0) is None
    assert schedule_meets_limit(winch(), 100.0) is None


def test_warnings_follow_a_scene_changed_in_memory() -> None:
    """A scene changed in memory is checked as it is then."""
    scene: Scene = load_scene("still_water")
    line: RopeLine = dataclasses.replace(scene.ropes[0], damping=Damping(newton_seconds=0.0))
    assert sense_checks(scene) == []
    assert len(sense_checks(dataclasses.replace(scene, ropes=(line,)))) == 1


def test_two_ropes_carry_a_load_together(tmp_path: Path) -> None:
    """Each was taken for the one that carries all of it."""
    scene = load_scene("two_line_lift")
    line = (6.38352 - 1025.0 * 8.0424772e-4) * 9.80665 * 600.0
    load = (25000.0 - 1025.0 * 5.0) * 9.80665
    held = suspended_weights(scene)
    assert held is not None
    assert held.weight_n == pytest.approx(load + 2.0 * line)
    assert held.breaking_load_n == pytest.approx(2.0 * 6.334e8 * 0.04**2)

    def reported(mass_kg: float) -> list[str]:
        payload = dataclasses.replace(scene.payloads[0], mass_kg=mass_kg)
        heavier = sense_checks(dataclasses.replace(scene, payloads=(payload,)))
        return [words for words in heavier if "breaking load" in words]

    assert reported(60000.0) == []  # 604 kN: 302 kN a rope, not 604
    (warning,) = reported(80000.0)
    assert warning.startswith("ropes: 2 ropes from the ship together carry 800 kN against a ")
    assert ", a safety factor of 2.53" in warning
    assert "breaks" in reported(300000.0)[0]


def test_the_hoist_carries_everything_below_the_hook() -> None:
    scene = load_scene("bridle_lift")
    per_metre = (6.38352 - 1025.0 * 8.0424772e-4) * 9.80665
    steel = (800.0 + 2 * 50.0 + 1500.0) * (1.0 - 1025.0 / 7850.0) * 9.80665
    loads = 2.0 * (8000.0 - 1025.0 * 1.5) * 9.80665
    held = suspended_weights(scene)
    assert held is not None
    assert held.weight_n == pytest.approx(loads + steel + per_metre * (1000.0 + 28.0))
    assert held.weight_at(1200.0) - held.weight_n == pytest.approx(200.0 * per_metre)


def test_no_static_tension_is_estimated_with_a_fixed_end_or_tether() -> None:
    assert suspended_weights(load_scene("two_line_loop")) is None


def test_a_moored_float_is_not_taken_for_a_floating_lift(tmp_path: Path) -> None:
    """Its rope was said to lie on the bed, and to reach as far below the anchor as it is long."""
    text = GOOD.replace("mass_kg: 20000.0", "mass_kg: 2000.0").replace(
        "effects:\n", "effects:\n  - seabed: {depth_m: 495.0}\n"
    )
    scene = load_scene(written(tmp_path, text))
    assert "it floats" in sense_checks(scene)[0]
    ship = dataclasses.replace(scene.ship, hang_off_m=(0.0, 0.0, -495.0))
    moored = dataclasses.replace(scene, ship=ship, winch=None)
    assert lift_figures(moored).rises
    assert sense_checks(moored) == []


def test_a_payload_above_the_water_has_its_weight_in_air(tmp_path: Path) -> None:
    """Static tension, safety factor and what the drive must hold took it for submerged."""
    above = GOOD.replace("effects:\n", "effects:\n  - splash_zone: {height_m: 3.0}\n")
    scene = load_scene(written(tmp_path, above))
    ship = dataclasses.replace(scene.ship, hang_off_m=(0.0, 0.0, 600.0))
    figures = lift_figures(dataclasses.replace(scene, ship=ship))
    per_metre = (6.38352 - 1025.0 * 8.0424772e-4) * 9.80665
    in_air, lift = 20000.0 * 9.80665, 1025.0 * 9.0 * 9.80665
    assert figures.top_tension_n(500.0) == pytest.approx(in_air + 500.0 * per_metre)
    assert figures.top_tension_n(600.0) == pytest.approx(in_air - 0.5 * lift + 600.0 * per_metre)
    assert figures.top_tension_n(700.0) == pytest.approx(in_air - lift + 700.0 * per_metre)
    assert figures.suspended.dry_share(500.0) == 1.0


@pytest.mark.parametrize(
    ("area_m2", "said"),
    [(8.0, "10.2 t of water, 2.5 times the vertical"), (2.0, ""), (1.0, "0.32 times the vertical")],
)
def test_slamming_gives_the_water_the_momentum_of_the_added_mass(
    tmp_path: Path, area_m2: float, said: str
) -> None:
    """½·ρ·C_s·A·H of a box of 0.5 m against 4 t of added mass; without an area nothing is said."""
    tool = "added_mass_kg: [1000.0, 1000.0, 4040.0]\n    shape: {box: {"
    text = GOOD.replace("shape: {box: {", tool)
    zone = "  - splash_zone: {height_m: 0.5, bottom_area_m2: AREA, slamming: 5.0}\n"
    assert not _slamming(
        written(tmp_path, text.replace("effects:\n", "effects:\n" + zone.replace("AREA", "0.0")))
    )
    listed = "effects:\n" + zone.replace("AREA", f"{area_m2}")
    computed = _slamming(written(tmp_path, text.replace("effects:\n", listed)))
    assert len(computed) == (1 if said else 0)
    assert all(said in warning for warning in computed)
    least = 2.0 * 4040.0 / (1025.0 * area_m2 * 0.5)
    assert all(f"C_s = 2·A33/(ρ·A·H) is {least:.2g};" in warning for warning in computed)


def _slamming(path: Path) -> list[str]:
    position = "effects.splash_zone.slamming"
    return [words for words in sense_checks(load_scene(path)) if words.startswith(position)]

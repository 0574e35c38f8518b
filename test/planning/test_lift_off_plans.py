"""Lift-off from a deck: closed forms, the deck's motion against the tip's, re-hit, wrong plans."""

from __future__ import annotations

import math
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from rope_twin.effects.rigid_body import RigidBodyParams
from rope_twin.errors import RopeTwinError
from rope_twin.planning.cells import RowStore
from rope_twin.planning.phases import Leg, legs_of
from rope_twin.planning.plan_file import Heights, InAir, LiftedFrom, LiftOff, Phase, Plan, Seeds
from rope_twin.planning.plan_reader import deck_of, read_plan, tip_of
from rope_twin.planning.report_content import write_report
from rope_twin.planning.results import notes
from rope_twin.planning.run import run_plan
from rope_twin.planning.runs import Row, run_seeds
from rope_twin.planning.seas import (
    LEAD_SAMPLES,
    SAMPLE_NS,
    RelativeTip,
    ResponsesTip,
    SeaState,
    Ship,
    lateral_moments,
    sea_record,
    tip_moments,
    tip_record,
)
from rope_twin.planning.simplified import (
    lift_of,
    lift_off_n,
    lift_off_speed,
    simplified,
    vertical_stiffness_n_per_m,
)
from rope_twin.planning.tables import further_tables
from rope_twin.scene.error_bound import Setting
from rope_twin.scene.schema import Damping, Scene
from rope_twin.twin.twin import Twin

COARSE = Setting(6, 0.0025)


def leg_of(plan: Plan, scene: Scene, **keys: object) -> Leg:
    """Return the leg of the shipped lift-off with other keys, on a coarse mesh."""
    own = plan.phases[0].lift_off
    assert own is not None
    phase = replace(plan.phases[0], lift_off=replace(own, **keys))
    scene = replace(scene, ship=replace(scene.ship, motion_ramp_s=2.0))
    (leg,) = legs_of(replace(plan, method=replace(plan.method, settle_s=1.0)), scene, phase)
    return leg.at_setting(COARSE)


def run_of(leg: Leg, plan: Plan, height_m: float) -> Row:
    """Return the row of a run."""
    ship = Ship(tip_of(plan, leg.scene), 0.0)
    (row,) = run_seeds(leg, ship, plan.sea_state(height_m, 0, 0), [7])
    assert row["failure"] == ""
    return row


def plain_scene() -> Scene:
    """Return the scene with the weight in the middle, no hook, a hard deck and little damping."""
    scene = read_plan("lift_off")[1]
    body, rope, winch = scene.listed(RigidBodyParams), scene.ropes[0], scene.winch
    assert body is not None
    assert winch is not None
    slings = tuple(replace(one, damping_newton_seconds_per_m=0.0) for one in body.slings)
    assert body.deck is not None
    deck = replace(body.deck, penetration_m=1e-3)
    middle = (0.0, 0.0, -0.2)
    own = replace(body, centre_of_gravity_m=middle, hook_mass_kg=0.0, slings=slings, deck=deck)
    return replace(
        scene,
        effects=tuple(own if one is body else one for one in scene.effects),
        ropes=(replace(rope, damping=Damping(fraction_of_first_axial_mode=0.005)),),
        winch=replace(winch, acceleration_limit_m_per_s2=5.0),
    )


@pytest.mark.parametrize("speed", [0.1, 0.4])
def test_load_of_a_lift_off_a_fixed_deck(speed: float) -> None:
    """T = W + v·√(K·M) by hand, of a body whose corners leave the deck together."""
    plan, _ = read_plan("lift_off")
    leg = leg_of(plan, plain_scene(), deck=None, speed_m_per_s=speed, hoist_m=1.5)
    found = run_of(leg, plan, 0.05)["top_max_n"] - leg.static_hook_n
    body, lift = leg.scene.listed(RigidBodyParams), lift_of(leg)
    assert body is not None
    cos = math.sqrt(1.0 - (1.8**2 + 1.3**2) / 7.0**2)
    slings = 4.0 * 5.0e6 * cos**2
    assert vertical_stiffness_n_per_m(body) == pytest.approx(slings)
    flexible = 1.0 / slings + leg.scene.ropes[0].length_m / lift.EA_n
    right = speed * math.sqrt(lift.mass_kg / flexible)
    by_formula = lift_off_n(leg, lift, speed) - leg.static_hook_n
    assert by_formula == pytest.approx(right, rel=0.002)  # buoyancy in air
    assert found == pytest.approx(right, rel=0.03)


def test_deck_moves_with_the_components_of_the_tip() -> None:
    """Sines of a deck at the crane tip of the same vessel are the record of that tip."""
    plan, scene = read_plan("lift_off")
    tip, sea = tip_of(plan, scene), plan.sea_state(1.5, 0, 0)
    assert isinstance(tip, ResponsesTip)
    assert plan.vessel is not None
    deck = deck_of(plan, LiftedFrom(point_m=plan.vessel.crane_tip_m))
    assert deck is not None
    amplitude, omega, phase = sea_record(sea, 3, 60.0).harmonics(deck).T
    series = tip_record(Ship(tip, 0.0), sea, 3, 60.0)
    time = series.stamp_ns[LEAD_SAMPLES:-1] * 1e-9
    height = (amplitude * np.sin(np.outer(time, omega) + phase)).sum(axis=1)
    assert height == pytest.approx(series.position_m[LEAD_SAMPLES:-1], abs=1e-9)
    assert time[0] == 0.0
    assert time[1] == pytest.approx(SAMPLE_NS * 1e-9)
    f = np.linspace(0.05, 0.2, 7)
    relative = RelativeTip(tip, deck).at(f, np.full(7, 2.0))
    assert np.abs(relative[2]).max() < 1e-12
    assert np.abs(relative[:2]).max() < 1e-12


def test_deck_of_a_vessel_apart_is_late_by_the_way_of_the_waves() -> None:
    """Half a wave length on, in the direction of travel, it moves the other way."""
    plan, _ = read_plan("lift_off")
    f = np.array([0.1])
    half = 0.5 * 9.80665 / (2.0 * math.pi * 0.1**2)
    here = LiftedFrom(responses="vessel_120m", point_m=(0.0, 0.0, 0.0))
    on = replace(here, apart_m=(-half, 0.0))  # head seas travel to astern
    at, beyond = (deck_of(plan, one) for one in (here, on))
    assert at is not None
    assert beyond is not None
    heading = np.array([math.pi])
    assert beyond.at(f, heading)[2] == pytest.approx(-at.at(f, heading)[2])
    turned = deck_of(plan, replace(here, turn_deg=180.0))
    assert turned is not None
    assert turned.at(f, heading)[2] == pytest.approx(at.at(f, np.array([0.0]))[2])


def test_deck_moves_by_heave_roll_and_pitch_at_the_place_of_the_load() -> None:
    """By hand: z + y·roll - x·pitch, and along its axes, turned into those of the crane vessel."""
    plan, scene = read_plan("lift_off")
    x, y, z = -20.0, 7.0, 5.0
    own = LiftedFrom(responses="vessel_120m", point_m=(x, y, z), turn_deg=90.0)
    deck = deck_of(plan, own)
    assert deck is not None
    f, heading = np.array([0.08, 0.12]), np.radians([150.0, 200.0])
    surge, sway, heave, roll, pitch, yaw = deck.responses.at(f, heading - 0.5 * math.pi)
    assert deck.at(f, heading)[2] == pytest.approx(heave + y * roll - x * pitch, rel=1e-12)
    ahead, port = surge + z * pitch - y * yaw, sway + x * yaw - z * roll
    assert deck.at(f, heading)[:2] == pytest.approx(np.stack([-port, ahead]), rel=1e-12)
    tip, sea = tip_of(plan, scene), plan.sea_state(1.5, 0, 0)  # long-crested head seas: no sway
    found = lateral_moments(RelativeTip(tip, deck_of(plan, LiftedFrom(point_m=(x, y, z)))), sea)
    spectrum = sea.spectrum()
    assert isinstance(tip, ResponsesTip)
    pitching = np.abs(tip.freedoms(spectrum.frequency_hz, np.full_like(spectrum.frequency_hz,
                                                                       math.pi))[4])  # fmt: skip
    variance = np.trapezoid((30.0 * pitching) ** 2 * spectrum.density_m2_per_hz,
                            spectrum.frequency_hz)  # fmt: skip
    assert found.rms_m == pytest.approx(math.sqrt(variance), rel=1e-9)


@pytest.mark.long
def test_slow_winches_are_hit_again() -> None:
    """A deck that heaves faster than the winch hoists meets the object again; a fast one does not,
    and the object hangs below the tip in the end.
    """
    plan, scene = read_plan("lift_off")
    deck = LiftedFrom(responses="vessel_120m", point_m=(-50.0, 0.0, 5.0), apart_m=(0.0, 40.0))
    slow = run_of(leg_of(plan, scene, deck=deck, speed_m_per_s=0.05, hoist_m=0.9), plan, 4.0)
    fast = run_of(leg_of(plan, scene, deck=deck, speed_m_per_s=0.5, hoist_m=4.0), plan, 4.0)
    assert slow["re_hit_m_per_s"] > 0.1
    assert fast["re_hit_m_per_s"] < slow["re_hit_m_per_s"]
    assert 0.0 < fast["offset_m"] < 5.0


def test_plan_of_a_lift_off(tmp_path: Path) -> None:
    """One height, three seeds: limits, the table beside the formula, remarks and report."""
    plan, scene = read_plan("lift_off")
    own = plan.phases[0].lift_off
    assert own is not None
    plan = replace(
        plan,
        sea=replace(plan.sea, hs_m=Heights(from_=0.5, to=0.5, step=0.5)),
        phases=(replace(plan.phases[0], lift_off=replace(own, hoist_m=0.9)),),
        method=replace(plan.method, seeds=Seeds(start=3, most=3), settle_s=0.0, elements=4,
                       step_s=0.005),
    )  # fmt: skip
    scene = replace(scene, ship=replace(scene.ship, motion_ramp_s=1.0))
    result = run_plan(plan, scene, RowStore(), threads=1)
    (cell,) = result.cells
    judged = cell.judged or cell.beyond
    assert judged is not None
    assert judged.failures == 0
    assert {"swl_n", "re_hit_m_per_s", "slings", "uplift_share"} == set(judged.uses)
    table = next(one for one in further_tables(result) if one.title == "Lift-off")
    words = dict(zip(table.rows[0], table.rows[1], strict=True))
    assert words["winch m/s"] == "0.3"
    assert words["least by API m/s"] == f"{lift_off_speed(0.5):.2f}"
    simple = max(one.hook_n for one in cell.simplified) / result.works[0].static_hook_n
    assert float(words["simplified DAF"]) == pytest.approx(simple, abs=0.006)
    assert 1.05 < float(words["DAF"]) < float(words["simplified DAF"])
    assert words["re-hit m/s"] == "0.00"
    excluded = 1.0 - 0.1 ** (1.0 / cell.shown.seeds)  # (1 - q)^n = 10 %
    assert words["re-hit in % of seeds"] == f"0 (at most {100.0 * excluded:.0f})"
    remarks = list(notes(result))
    assert not any("the scene has no waves" in one for one in remarks)
    assert any("stays level" in one for one in remarks)
    write_report(result, tmp_path)
    page = (tmp_path / "report.html").read_text(encoding="utf-8")
    assert "  Lift-off</h3>" in page
    assert "there is no curve of resonance" in page
    assert "Lift off, -6 to -7 m: 4 elements" in page
    assert "Winch speeds are constant" in page
    assert "The swinging of the object in air" not in page
    differences = re.search(r"differs from the simplified one by ([^<]*)", page)
    assert differences is not None
    assert differences[1].count("%") == 1, "that of the only cell, once"


def test_least_hoisting_speed() -> None:
    """API Spec 2C 5.4.5.2 by hand: 3.28 ft: 0.3545 ft/s; 9.84 ft: 0.8805 ft/s."""
    assert lift_off_speed(1.0) == pytest.approx(0.3545 * 0.3048, rel=1e-3)
    assert lift_off_speed(3.0) == pytest.approx(0.8805 * 0.3048, rel=1e-3)


TEXT = """scene: lift_off
vessel: {responses: vessel_120m, crane_tip_m: [0.0, 25.0, 35.0]}
sea: {hs_m: {from: 0.5, to: 1.0, step: 0.5}, tp_s: [8.0], headings_deg: [180.0]}
phases:
  - lift_off: {hoist_m: 4.0, speed_m_per_s: 0.3, deck: {point_m: [0.0, 0.0, 5.0]}}
criteria: {re_hit_m_per_s: 0.2}
"""
DEEP = "scene: deep_lift"


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("scene: lift_off", DEEP, "phases[0].lift_off: the object of 'deep_lift' stands on"),
        ("scene: lift_off", "scene: manifold_lift", "the object of 'manifold_lift' stands on no"),
        ("hoist_m: 4.0", "hoist_m: 40.0", "hoist_m: 40 m leave -19 m of line, the winch keeps 5 m"),
        ("speed_m_per_s: 0.3", "speed_m_per_s: 0.9", "0.9 m/s is above the winch's 0.5 m/s"),
        ("point_m: [0.0, 0.0, 5.0]", "point_m: [0.0, 0.0, 5.0], turn_deg: 90.0",
         "turn_deg and apart_m are of another vessel; give its `responses`"),
        ("point_m", "responses: barg, point_m", "line 5, phases[0].lift_off.deck"),
        ("lift_off: {hoist_m: 4.0, speed_m_per_s: 0.3, deck: {point_m: [0.0, 0.0, 5.0]}}",
         "in_air: {above_m: 12.0}", "re_hit_m_per_s: no phase lifts off a deck"),
        ("lift_off: {hoist_m: 4.0, speed_m_per_s: 0.3, deck: {point_m: [0.0, 0.0, 5.0]}}",
         "in_air: {above_m: 40.0}", "40 m is not below the crane tip, 35 m above the water"),
    ],
)  # fmt: skip
def test_wrong_lift_offs(old: str, new: str, words: str, tmp_path: Path) -> None:
    """Refused in one sentence."""
    assert old in TEXT
    path = tmp_path / "lift.yaml"
    path.write_text(TEXT.replace(old, new, 1))
    with pytest.raises(RopeTwinError) as caught:
        read_plan(path)
    assert words in str(caught.value)


def test_an_object_in_air_hangs_clear_of_its_deck() -> None:
    """With the hook at 12 m its bottom is below the deck of the scene, 5 m above the water."""
    plan, scene = read_plan("lift_off")
    phase = Phase(in_air=InAir(above_m=12.0, exposure_s=60.0))
    (leg,) = legs_of(plan, scene, phase)
    snapshot = Twin(leg.scene).snapshot()
    assert snapshot.tension_top_n == pytest.approx(leg.static_hook_n, rel=1e-6)
    assert snapshot.tension_payload_n == pytest.approx(leg.payload_n, rel=1e-3), "hook and object"
    (lift,) = legs_of(plan, scene, plan.phases[0])
    assert lift.payload_n == pytest.approx(leg.payload_n)
    leg = leg.at_setting(Setting(4, 0.005))
    ship, sea = Ship(tip_of(plan, scene), plan.bow_of(scene)), SeaState(1.0, 11.0, 90.0)
    (row,) = run_seeds(leg, ship, sea, [7])
    (own,) = run_seeds(replace(leg, by_twin=True), ship, sea, [7])
    assert row["top_max_n"] == pytest.approx(own["top_max_n"], rel=1e-2)
    assert 0.5 < row["offset_m"] < own["offset_m"], "the hook swings less than the object below it"


def test_simplified_loads_in_air_know_no_water() -> None:
    """Above a splash zone: neither slamming nor added mass, and no snap of a free fall in water."""
    plan, scene = read_plan("splash_zone")
    (leg,) = legs_of(plan, scene, Phase(in_air=InAir(above_m=6.0, exposure_s=60.0)))
    mass_kg = scene.payloads[0].mass_kg
    assert leg.payload_n == pytest.approx(mass_kg * 9.80665)
    load = simplified(leg, tip_of(plan, scene), SeaState(2.0, 9.0, 180.0), 90.0)
    tip = tip_moments(tip_of(plan, scene), SeaState(2.0, 9.0, 180.0))
    factor = load.tip_m / tip.rms_m
    inertia_n = mass_kg * factor * tip.rms_m_per_s2
    assert load.hook_n - leg.static_hook_n == pytest.approx(inertia_n, rel=0.1)
    assert math.isnan(load.snap_n)


def test_objects_in_water_are_not_in_air(tmp_path: Path) -> None:
    """A scene without a surface has its object in water at any height."""
    path = tmp_path / "lift.yaml"
    text = TEXT.replace("scene: lift_off", DEEP).replace("criteria: {re_hit_m_per_s: 0.2}\n", "")
    path.write_text(text[: text.index("  - lift_off")] + "  - in_air: {above_m: 2.0}\n")
    with pytest.raises(RopeTwinError, match="the object of 'deep_lift' is in water everywhere"):
        read_plan(path)


def test_lift_off_keys() -> None:
    """The shipped plan has a moving deck of another vessel."""
    own = read_plan("lift_off")[0].phases[0].lift_off
    assert isinstance(own, LiftOff)
    assert own.deck is not None
    assert own.deck.apart_m == (0.0, 40.0)

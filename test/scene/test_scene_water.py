"""Depths above the surface or below the bed, spectra with gaps, breaking waves."""

from __future__ import annotations

from pathlib import Path

import pytest
from scene_text import GOOD, assert_refused, spoilt, written

from rope_twin.cli import main
from rope_twin.files import share_dir
from rope_twin.scene.joined_model import build_joined
from rope_twin.scene.load import load_scene
from rope_twin.scene.rope_warnings import sense_checks

LOOP = (share_dir() / "config" / "scenes" / "two_line_loop.yaml").read_text()
WEIGHT = "  - weight: {}\n"
CHAIN = (share_dir() / "config" / "scenes" / "chain_on_bottom.yaml").read_text()
SHALLOWS = (  # 1500 m deep at the sheave, 1700 m to the west of it
    "seabed: {soundings: {x_m: [-500, 500], y_m: [-500, 500], depth_m: [[1700, 1300], [1700, 1300]]"
    "}}"
)
HELD = "at_m: [0.0, 0.0, -1550.0]"
FIRST_ROW = "{at_s: 0.0, speed_m_per_s: 0.5}"
HEAD = "frequency_hz,S_1996-01-01T00Z_m2_per_hz\n"


def with_effect(text: str, effect: str) -> str:
    """Return the scene with one more effect."""
    assert text.count(WEIGHT) == 1
    return text.replace(WEIGHT, f"{WEIGHT}  - {effect}\n")


def measured(name: str) -> str:
    """Return GOOD in the waves of a spectrum file next to the scene."""
    sea = f"{{file: {name}, column: 1996-01-01T00Z}}"
    return with_effect(GOOD, f"waves: {{measured: {sea}, components: 20, seed: 1}}")


def swell(name: str) -> str:
    """Return GOOD in a wind sea and a swell of a spectrum file."""
    sea = f"{{file: {name}, column: 1996-01-01T00Z}}"
    wind = "jonswap: {significant_height_m: 1.0, peak_period_s: 7.0}, components: 20"
    return with_effect(GOOD, f"waves: {{{wind}, also: [{{measured: {sea}, components: 9}}]}}")


BAD: dict[str, tuple[str, str, tuple[str, ...]]] = {
    "negative mass": (
        spoilt("mass_kg: 20000.0", "mass_kg: -20000.0"),
        "payloads[0].mass_kg", ("-20000 kg is out of range", "give 0 to 1e+07 kg"),
    ),
    "depth above the surface": (
        spoilt(FIRST_ROW, "{at_s: 0.0, payload_depth_m: -10.0}"),
        "winch.schedule[0].payload_depth_m", ("-10 m is out of range", "below the mean water"),
    ),
    "bed above the surface": (
        with_effect(GOOD, "seabed: {depth_m: -20.0}"),
        "effects[4].seabed.depth_m", ("-20 m is out of range", "at the origin"),
    ),
    "sheave below the bottom": (
        with_effect(LOOP, "seabed: {depth_m: 1200.0}"),
        "sheaves[0].tether.at_m", ("z = -1550 m, below the seabed at -1200 m", "deepen `seabed`"),
    ),
    "sheave below a slope": (
        with_effect(LOOP, "seabed: {depth_m: 1600.0, slope: [0.0, 0.5]}").replace(
            HELD, "at_m: [0.0, 200.0, -1550.0]"
        ),
        "sheaves[0].tether.at_m", ("below the seabed at -1500 m",),
    ),
    "sheave above the water": (
        LOOP.replace(HELD, "at_m: [0.0, 0.0, 50.0]"),
        "sheaves[0].tether.at_m", ("is held 50 m above the water", "give a negative z"),
    ),
    "sheave in a shallow": (
        with_effect(LOOP, SHALLOWS), "sheaves[0].tether.at_m", ("below the seabed at -1500 m",),
    ),
    "fixed end below the bed": (
        CHAIN.replace("seabed: {depth_m: 300.0}", "seabed: {depth_m: 290.0}"),
        "ropes[0].fixed_at_m", ("z = -300 m, below the seabed at -290 m", "deepen `seabed`"),
    ),
    "spectrum without a value": (
        measured("./hole.csv"), "effects[4].waves.measured", ("hole.csv, line 4: ''", "finite"),
    ),
    "spectrum with a gap": (
        measured("gap.csv"), "effects.waves", ("gap from 0.06 to 0.2 Hz", "among steps of 0.01 Hz"),
    ),
    "spectrum without one of its rows": (
        measured("row.csv"), "effects.waves",
        ("gap from 0.06 to 0.08 Hz", "among steps of 0.01 Hz"),
    ),
    "swell with a gap": (
        swell("gap.csv"), "effects.waves.also[0]",
        ("gap from 0.06 to 0.2 Hz", "among steps of 0.01 Hz"),
    ),
    "swell that is not there": (
        swell("./no.csv"), "effects[4].waves.also[0].measured",
        ("no.csv: there is no such file",),
    ),
    "spectrum that is not there": (
        measured("./no.csv"), "effects[4].waves.measured", ("no.csv: there is no such file",),
    ),
    "unknown switch": (
        spoilt(FIRST_ROW, "{at_s: 0.0, switch: emergencystop}"),
        "winch.schedule[0].switch", ("did you mean 'emergency_stop'?",),
    ),
}  # fmt: skip


@pytest.mark.parametrize("fault", BAD)
def test_invalid_water_and_waves_are_rejected(tmp_path: Path, fault: str) -> None:
    """At the key, with the numbers and the way out; tables lie beside the scene."""
    (tmp_path / "hole.csv").write_text(f"{HEAD}0.05,1\n0.06,2\n0.07,\n0.08,2\n")
    (tmp_path / "gap.csv").write_text(f"{HEAD}0.05,1\n0.06,2\n0.20,2\n0.21,1\n")
    (tmp_path / "row.csv").write_text(f"{HEAD}0.05,1\n0.06,2\n0.08,2\n0.09,1\n")
    text, position, words = BAD[fault]
    assert_refused(text, position, words, tmp_path)


BRIDLE = (share_dir() / "config" / "scenes" / "bridle_lift.yaml").read_text()
SPLASH = "splash_zone: {height_m: 2.0, bottom_area_m2: 3.0}"


def test_each_payload_may_have_its_own_size_in_the_splash_zone(tmp_path: Path) -> None:
    """The one that gives it has it, the other the effect's; it needs the effect, and company."""
    first = BRIDLE.index("    mass_kg:", BRIDLE.index("payloads:"))
    own = "    splash_zone: {height_m: 5.0, bottom_area_m2: 7.0}\n"
    text = BRIDLE[:first] + own + BRIDLE[first:]
    assert_refused(
        text, "payloads[0].splash_zone", ("effect `splash_zone` is not listed",), tmp_path
    )
    scene = load_scene(written(tmp_path, with_effect(text, SPLASH)))
    system = build_joined(scene).system
    names = {line.to: rope for line, rope in zip(scene.ropes, system.ropes, strict=True)}
    results = []
    for payload in scene.payloads:
        effects = names[payload.name].effects
        (zone,) = (one for one in effects if type(one).__name__ == "SplashZone")
        results.append((zone.height, zone.slam / zone.height))
    assert results[0] == pytest.approx((5.0, 0.5 * 1025.0 * 5.0 * 7.0 / 5.0))
    assert results[1] == pytest.approx((2.0, 0.5 * 1025.0 * 5.0 * 3.0 / 2.0))
    alone = with_effect(GOOD, SPLASH).replace("    mass_kg:", own + "    mass_kg:")
    assert_refused(alone, "payloads[0].splash_zone", ("the only payload",), tmp_path)


@pytest.mark.parametrize(
    "effect",
    [
        "fairing: {face_m2: 4.0}",
        "net: {width_m: 3.0, height_m: 3.0, solidity: 0.2}",
        "payload_shedding: {strouhal: 0.2, lift_coefficient: 0.5, diameter_m: 2.0, area_m2: 4.0}",
    ],
)
def test_a_force_that_does_not_follow_submergence_is_warned_of(tmp_path: Path, effect: str) -> None:
    """A current of 2 m/s pushed a payload 9 m above the water by its fairing of 4 m²: 8.2 kN."""
    submerged = with_effect(GOOD, effect)
    position = f"effects.{effect.partition(':')[0]}"
    for text, count in ((submerged, 0), (with_effect(submerged, SPLASH), 1)):
        found = sense_checks(load_scene(written(tmp_path, text)))
        assert len([words for words in found if words.startswith(position)]) == count


def test_uneven_frequency_steps_are_not_a_gap(tmp_path: Path) -> None:
    """A buoy's bands grow with the frequency; and a table beside the scene is found."""
    (tmp_path / "even.csv").write_text(f"{HEAD}0.05,1\n0.055,2\n0.065,2\n0.085,1\n0.1,0\n")
    scene = load_scene(written(tmp_path, measured("even.csv")))
    assert scene.effects[1].measured.file == str(tmp_path / "even.csv")
    scene = load_scene(written(tmp_path, swell("even.csv")))
    assert scene.effects[1].also[0].measured.file == str(tmp_path / "even.csv")


ODD: dict[str, tuple[str, str, tuple[str, ...]]] = {
    "rope longer than the water is deep": (
        with_effect(GOOD, "seabed: {depth_m: 300.0}"),
        "ropes[0].length_m: ", ("500 m of rope is out above a seabed 300 m below", "lying on it"),
    ),
    "order deeper than the rope": (
        spoilt(FIRST_ROW, "{at_s: 0.0, payload_depth_m: 5000.0}"),
        "schedule of winch 'winch', row 0: ", ("depth of 5000 m", "give at most 800 m"),
    ),
    "order into the bed": (
        with_effect(
            spoilt(FIRST_ROW, "{at_s: 0.0, payload_depth_m: 700.0}"), "seabed: {depth_m: 600.0}"
        ),
        "schedule of winch 'winch', row 0: ", ("700 m is below the seabed", "at 600 m there"),
    ),
    "breaking wave": (
        with_effect(GOOD, "waves: {regular: {height_m: 20.0, period_s: 4.0}}"),
        "effects waves.regular: ", ("25 m long and would break", "at most 3.5 m"),
    ),
    "breaking in shallow water": (
        with_effect(GOOD, "waves: {regular: {height_m: 6.0, period_s: 8.0}, depth_m: 5.0}"),
        "effects waves.regular: ", ("53 m long and would break", "at most 4.0 m"),
    ),
    "sea steeper than seas are": (
        with_effect(GOOD, "waves: {jonswap: {significant_height_m: 2.0, peak_period_s: 4.0}}"),
        "effects waves.jonswap: ", ("Hs 2 m at Tp 4 s", "give at most 1.7 m"),
    ),
    "waves of another depth than the bed's": (
        with_effect(GOOD, "waves: {regular: {height_m: 2.0, period_s: 9.0}, depth_m: 40.0}"
                          "\n  - seabed: {depth_m: 600.0}"),
        "effects waves.depth_m: ", ("40 m deep over a seabed at 600 m", "give 600 m"),
    ),
    "deep waves over a shallow bed": (
        with_effect(GOOD, "waves: {regular: {height_m: 2.0, period_s: 12.0}}"
                          "\n  - seabed: {depth_m: 65.0}"),
        "effects waves: ", ("225 m long, feel a seabed at 65 m", "add depth_m: 65"),
    ),
    "vortices in no current": (
        with_effect(GOOD[: GOOD.index("  - current")] + GOOD[GOOD.index("  - weight") :],
                    "wake_oscillator: {}"),
        "effects wake_oscillator: ", ("nothing flows past the rope", "add `current`"),
    ),
    "vortices that are a share of nothing": (
        with_effect(spoilt("  - drag: {normal: 1.2, tangential: 0.02}\n", ""),
                    "strouhal_forcing: {}"),
        "effects strouhal_forcing: ", ("fractions of `drag`, which is not listed", "of its own"),
    ),
    "ship of nine kilometres": (
        spoilt("ship: {", "ship: {reference_m: [9000.0, 0.0, 0.0], "),
        "ship.reference_m: ", ("9000 m from the hang-off",),
    ),
}  # fmt: skip


@pytest.mark.parametrize("oddity", ODD)
def test_implausible_water_and_waves_are_warned_of(tmp_path: Path, oddity: str) -> None:
    """In one sentence with the numbers and the way out."""
    text, start, words = ODD[oddity]
    warnings = sense_checks(load_scene(written(tmp_path, text)))
    computed = [warning for warning in warnings if warning.startswith(start)]
    (sentence,) = [one for one in computed if all(word in one for word in words)]
    assert "; " in sentence
    assert sentence.endswith(".")


def test_a_lower_end_above_the_water_is_warned_of(tmp_path: Path) -> None:
    """z counts up: who forgets the sign of a depth reads it."""
    text = spoilt("    to: tool\n", "    fixed_at_m: [0.0, 0.0, 20.0]\n")
    text = text.replace(text[text.index("payloads:") : text.index("winch:")], "")
    warnings = sense_checks(load_scene(written(tmp_path, text.replace("  - payload: {}\n", ""))))
    assert any("the lower end is fixed 20 m above the water" in warning for warning in warnings)


def test_a_headless_run_prints_the_scene_warnings(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """The warnings are those of `scene check`, printed before the run."""
    text = spoilt("mass_kg: 20000.0", "mass_kg: 0.0")
    text = text.replace("  - weight: {}\n", "  - weight: {}\n  - added_mass: {normal: 1.0}\n")
    path = written(tmp_path, text)
    assert main(["run", str(path), "--duration", "1", "--speed", "0", "--no-record"]) == 1
    reported = capsys.readouterr().err
    assert "payloads[0]: it floats: 0.0 kN in air displaces 9.00 m³" in reported
    assert "at rest it floats up to z = " in reported
    assert "check mass_kg and displaced_volume_m3 of the payload" in reported
